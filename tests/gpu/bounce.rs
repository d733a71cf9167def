//! Light that bounces within a rigid group, against the closed form of a hollow sphere: of all that leaves one place of
//! its inside, every other place receives the same.

use super::common::generate;
use super::stage::{Stage, small, stage};
use glam::Vec3;
use shadow_fields::asset::Mesh;
use shadow_fields::bounce::Bounces;
use shadow_fields::frame;
use shadow_fields::scene::data::EntityData;
use shadow_fields::scene::{Lights, Motion, Scene};

const ALBEDO: f32 = 0.6;

/// The inside of a sphere of 1 m.
fn inside() -> Mesh {
    let ball = generate::sphere(1.0, 4);
    let inwards = ball.normals.iter().map(|normal| -*normal).collect();
    let turned = ball.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    Mesh::new("inside", ball.positions.clone(), inwards, None, turned).unwrap()
}

/// A lamp beside the sphere's middle.
fn lamp() -> EntityData {
    EntityData {
        position: Vec3::new(0.4, 0.2, 0.0),
        emission: Vec3::new(50.0, 30.0, 10.0),
        emits: Some(true),
        receives: Some(false),
        ..EntityData::of_mesh("lamp")
    }
}

fn hollow() -> Scene {
    Scene::builder()
        .mesh("inside", inside())
        .mesh("lamp", generate::sphere(0.05, 2))
        .entity(EntityData { albedo: Vec3::splat(ALBEDO).into(), ..EntityData::of_mesh("inside") })
        .entity(lamp())
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

/// What moves within the sphere is lit by the mean of its inside, which rests.
#[test]
fn what_moves_is_lit_by_what_rests() {
    let Some(stage) = stage() else { return };
    let moving = Motion::Spin { axis: Vec3::Y, period_s: 9.0 };
    let scene = Scene::builder()
        .mesh("inside", inside())
        .mesh("lamp", generate::sphere(0.05, 2))
        .mesh("ball", generate::sphere(0.1, 2))
        .entity(EntityData { albedo: Vec3::splat(ALBEDO).into(), ..EntityData::of_mesh("inside") })
        .entity(EntityData { position: Vec3::new(0.0, 0.1, 0.0), ..lamp() })
        .entity(EntityData { position: Vec3::new(0.4, -0.3, 0.2), motion: vec![moving], ..EntityData::of_mesh("ball") })
        .build()
        .unwrap();
    let areas = scene.meshes[0].vertex_areas_m2();
    let frame = |bounces| {
        let mut frame = stage.frame(&scene, frame::Options { bounces, lights: Lights::Sharp, ..small() });
        stage.light(&mut frame, &scene.at(0.0))
    };
    let direct = frame(Bounces::None);
    let all = frame(Bounces::All);
    let whole: f64 = areas.iter().sum();
    for channel in 0..3 {
        let mean = all[0].iter().zip(&areas).map(|(c, area)| f64::from(c[channel]) * area).sum::<f64>() / whole;
        for (v, (all, direct)) in all[2].iter().zip(&direct[2]).enumerate() {
            let bounced = f64::from(all[channel] - direct[channel]);
            // Walls are brighter near the lamp, and runs of 64 vertices are seen as flat pieces.
            assert!((bounced / (0.7 * mean) - 1.0).abs() < 0.25, "{v}: {bounced}, not {}", 0.7 * mean);
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
