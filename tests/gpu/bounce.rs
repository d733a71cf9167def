//! Light that bounces within a rigid group, against the closed form of a hollow sphere: of all that leaves one place of
//! its inside, every other place receives the same.

use super::common::generate;
use super::stage::{Stage, small, stage};
use glam::Vec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bounce::Bounces;
use shadow_fields::frame;
use shadow_fields::scene::data::EntityData;
use shadow_fields::scene::{Lights, Scene};

const ALBEDO: f32 = 0.6;

/// The inside of a sphere of 1 m, and a lamp beside its middle.
fn hollow() -> Scene {
    let ball = generate::sphere(1.0, 4);
    let inwards = ball.normals.iter().map(|normal| -*normal).collect();
    let turned = ball.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let inside = Mesh::new("inside", ball.positions.clone(), inwards, None, turned).unwrap();
    let lamp = EntityData {
        position: Vec3::new(0.4, 0.2, 0.0),
        emission: Vec3::new(50.0, 30.0, 10.0),
        emits: Some(true),
        receives: Some(false),
        ..EntityData::of_mesh("lamp")
    };
    Scene::builder()
        .mesh("inside", inside)
        .mesh("lamp", generate::sphere(0.05, 2))
        .entity(EntityData { albedo: Vec3::splat(ALBEDO).into(), ..EntityData::of_mesh("inside") })
        .entity(lamp)
        .build()
        .unwrap()
}

fn lit(stage: &Stage, scene: &Scene, bounces: Bounces) -> Vec<[f32; 3]> {
    let mut frame = stage.frame(scene, frame::Options { bounces, lights: Lights::Sharp, ..small() });
    stage.light(&mut frame, &scene.at(0.0)).remove(0)
}

#[test]
fn all_of_a_hollow_sphere_is_lit_by_its_mean() {
    let Some(stage) = stage() else { return };
    let scene = hollow();
    let areas = scene.meshes[0].vertex_areas_m2();
    let direct = lit(&stage, &scene, Bounces::None);
    let weighed = |channel: usize| direct.iter().zip(&areas).map(move |(c, area)| f64::from(c[channel]) * area);
    let whole: f64 = areas.iter().sum();
    let mean = [0, 1, 2].map(|channel| weighed(channel).sum::<f64>() / whole);
    assert!(mean[0] > 0.01 && mean[0] > 1.5 * mean[1], "the lamp shines: {mean:?}");
    let albedo = f64::from(ALBEDO);
    for (bounces, gain) in [(Bounces::One, albedo), (Bounces::All, albedo * (1.0 - albedo.powi(8)) / (1.0 - albedo))] {
        let found = lit(&stage, &scene, bounces);
        for (v, (found, direct)) in found.iter().zip(&direct).enumerate() {
            for channel in 0..3 {
                let wanted = gain * mean[channel];
                let bounced = f64::from(found[channel] - direct[channel]);
                // Rays leave from just inside, and a mesh of 5 120 triangles is no sphere.
                assert!((bounced / wanted - 1.0).abs() < 0.03, "{bounces:?} {v}: {bounced}, not {wanted}");
            }
        }
    }
}

/// A second frame starts from the direct light, not from the light of the last one.
#[test]
fn frames_do_not_add_up() {
    let Some(stage) = stage() else { return };
    let scene = hollow();
    let mut frame = stage.frame(&scene, frame::Options { bounces: Bounces::All, lights: Lights::Sharp, ..small() });
    let first = stage.light(&mut frame, &scene.at(0.0));
    assert!(first[1].iter().flatten().all(|&c| c == 0.0), "the lamp receives nothing");
    frame.forget();
    assert_eq!(stage.light(&mut frame, &scene.at(0.0)), first);
    assert_eq!(stage.light(&mut frame, &scene.at(0.0)), first, "at rest nothing changes");
}
