//! The front door: scenes made in code, light and pictures by `Renderer`, and what it refuses.

use crate::common::{gpu, parse, shown};
use crate::stage::{shines, stands};
use glam::{Quat, Vec3};
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::frame::Frame;
use shadow_fields::prelude::*;
use shadow_fields::scene::{Lights, Output, SceneBuilder};

/// A floor, a box that turns on it and a lamp under a grey sky.
fn room() -> SceneBuilder {
    Scene::builder()
        .camera(Camera::new([0.0, 2.0, 4.0], [0.0, 0.3, 0.0]))
        .environment(EnvironmentData { uniform: Some(Vec3::splat(0.2)), ..Default::default() })
        .mesh("floor", Generator::Plane { size_m: 3.0, cells: 16 })
        .mesh("ring", Generator::Torus { major_m: 0.4, minor_m: 0.15, segments: 16, sides: 8 })
        .mesh("lamp", Generator::Sphere { radius_m: 0.1, subdivisions: 2 })
        .entity(EntityData::of_mesh("floor"))
        .entity(EntityData { movable: true, ..stands("ring", [0.0, 0.6, 0.0]) })
        .entity(shines("lamp", [0.0, 1.8, 0.0], 30.0))
}

fn small() -> RenderOptions {
    RenderOptions { bake: Quality::Draft.into(), size: Some([96, 64]), ..Default::default() }
}

#[test]
fn a_scene_made_in_code_is_that_of_its_file() {
    let made = room().build().unwrap();
    let read = parse(&made.to_toml().unwrap());
    assert_eq!(made.data, read.data);
    assert_eq!(made.entities, read.entities);
    assert!(made.meshes.iter().zip(&read.meshes).all(|(a, b)| a == b && a.content_hash() == b.content_hash()));
    // A mesh that is there already needs no file.
    let ring = made.meshes[1].clone();
    let given = Scene::builder().mesh("other", ring.clone()).entity(EntityData::of_mesh("other")).build().unwrap();
    assert_eq!((given.meshes[0].name.as_str(), given.meshes[0].content_hash()), ("other", ring.content_hash()));
}

#[test]
fn scenes_made_in_code_are_held_to_the_rules_of_scene_files() {
    let ring = || EntityData::of_mesh("ring");
    let with = |entity| room().entity(entity);
    let odd = EnvironmentData { uniform: Some(Vec3::NAN), ..Default::default() };
    let cases = [
        (with(EntityData { albedo: Vec3::splat(1.5).into(), ..ring() }), "entity 3: 1.5 is out of range for an albedo"),
        (with(EntityData { position: Vec3::NAN, ..ring() }), "entity 3: NaN is out of range for a position"),
        (with(EntityData { name: Some("big".into()), scale: 1e9, ..ring() }), "entity \"big\": "),
        (with(EntityData { emission: Vec3::NEG_ONE, ..ring() }), "entity 3: -1 is out of range for a radiance"),
        (with(EntityData::of_mesh("none")), "entity 3: there is no mesh \"none\""),
        (room().mesh("ring", Generator::Plane { size_m: 1.0, cells: 1 }), "there are two meshes \"ring\""),
        (room().mesh("flat", Generator::Plane { size_m: -1.0, cells: 1 }), "mesh \"flat\": "),
        (room().mesh("none", Generator::Plane { size_m: 1.0, cells: u32::MAX }), "mesh \"none\": "),
        (room().camera(Camera::new([0.0; 3], [0.0; 3])), "camera: the camera's eye and target are the same"),
        (room().camera(Camera { fov_deg: 400.0, ..Camera::new([1.0; 3], [0.0; 3]) }), "camera: fov_deg 400"),
        (room().output(Output { width: 0, ..Default::default() }), "output: a picture of 0 x 640 pixels"),
        (room().environment(odd), "environment uniform NaN"),
        ((0..5000).fold(Scene::builder(), |all, _| all.entity(ring())), "5000 entities are over the limit of 4096"),
    ];
    for (builder, expected) in cases {
        let error = builder.build().map(|_| ()).unwrap_err();
        let line = error.to_string();
        assert!(matches!(error, Error::Input(_)) && line.starts_with(expected) && !line.contains('\n'), "{line:?}");
    }
}

#[test]
fn light_and_picture_are_those_of_a_frame() {
    let Some(gpu) = gpu() else { return };
    let door = Gpu::from(gpu.device.clone());
    let cache = Cache::default();
    let scene = room().build().unwrap();
    let options = RenderOptions { cache: Some(cache.clone()), ..small() };
    let mut renderer = Renderer::new(&door, &scene, &options).unwrap();
    let scene = renderer.scene().clone();
    assert!(scene.data.output.exposure_ev.is_some(), "it is found from the light");
    let white = scene.data.output.white();
    let mut frame = Frame::new(&gpu.baker(), &cache, &scene, options.frame(&scene).unwrap(), &|_, _, _| ()).unwrap();
    let black = renderer.light_buffer();
    assert_eq!(black.entities.len(), 3);
    assert_eq!(black.size_bytes, black.entities.last().unwrap().bytes.end);
    for step in 0..3 {
        let mut placements = scene.at(0.0);
        placements[1].position.x += 0.2 * step as f32;
        placements[1].rotation = Quat::from_rotation_x(0.4 * step as f32);
        renderer.update(&placements).unwrap();
        let expected = shown(&mut frame, &placements, white);
        frame.render(&placements, None).unwrap();
        for entity in 0..3 {
            let light = &renderer.light().unwrap()[entity];
            assert!(*light == frame.radiosity(entity).unwrap(), "entity {entity}");
            assert_eq!(light.len(), renderer.mesh(entity).positions.len());
        }
        let picture = renderer.picture().unwrap();
        assert!((picture.width, picture.height, picture.is_linear) == (96, 64, true));
        assert!(picture.rgb == expected, "picture {step}");
    }
    // From elsewhere it is another picture of the same light.
    let before = renderer.picture().unwrap();
    let lit = renderer.light().unwrap().to_vec();
    renderer.set_camera(&Camera::new([4.0, 1.0, 0.0], [0.0; 3])).unwrap();
    assert!(renderer.picture().unwrap().rgb != before.rgb && renderer.light().unwrap() == lit);
    assert!(matches!(renderer.set_camera(&Camera::new([f32::NAN; 3], [0.0; 3])), Err(Error::Input(_))));
    let folder = tempfile::tempdir().unwrap();
    renderer.write_png(&folder.path().join("p.png")).unwrap();
    assert!(matches!(renderer.write_png(&folder.path().join("none/p.png")), Err(Error::Failed(_))));
}

#[test]
fn a_renderer_lights_its_scene_at_once_and_refuses_what_is_no_placement() {
    let Some(gpu) = gpu() else { return };
    let door = Gpu::from(gpu.device.clone());
    let scene = room().output(Output { time_s: 0.0, ..Default::default() }).build().unwrap();
    let mut renderer = Renderer::new(&door, &scene, &RenderOptions { lights: Lights::Sh, ..small() }).unwrap();
    let at_once = renderer.light().unwrap().to_vec();
    assert!(at_once[0].iter().flatten().all(|c| c.is_finite()) && at_once[0].iter().any(|c| c[0] > 0.0));
    let refuse = |renderer: &mut Renderer, placements: &[Placement]| {
        assert!(matches!(renderer.update(placements), Err(Error::Input(_))), "{placements:?}");
    };
    let good = scene.at(0.0);
    refuse(&mut renderer, &[]);
    refuse(&mut renderer, &good[..2]);
    for bad in [
        Placement { position: Vec3::new(f32::NAN, 0.0, 0.0), ..good[1] },
        Placement { position: Vec3::splat(1e30), ..good[1] },
        Placement { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..good[1] },
        Placement { rotation: Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0), ..good[1] },
        Placement { scale: 0.0, ..good[1] },
        Placement { scale: f32::INFINITY, ..good[1] },
    ] {
        refuse(&mut renderer, &[good[0], bad, good[2]]);
    }
    // The floor and the lamp rest: light past one another is baked.
    let aside = |placement: Placement| Placement { position: placement.position + Vec3::X, ..placement };
    refuse(&mut renderer, &[aside(good[0]), good[1], good[2]]);
    refuse(&mut renderer, &[good[0], good[1], Placement { rotation: Quat::from_rotation_x(0.1), ..good[2] }]);
    assert!(renderer.light().unwrap() == at_once, "what is refused changes nothing");

    // Transfer vectors: baked of the ring, lobes of the floor; an open vertex begins with sqrt(pi) / 2.
    let [floor, ring] = [0, 1].map(|entity| renderer.transfer(entity).unwrap());
    assert_eq!((floor.bands, floor.coefficients.len()), (3, 9 * at_once[0].len()));
    assert_eq!(ring.coefficients.len(), 9 * at_once[1].len());
    let open = std::f32::consts::PI.sqrt() / 2.0;
    assert!(floor.coefficients.chunks(9).all(|vector| (vector[0] - open).abs() < 1e-6));
    let first = || ring.coefficients.chunks(9).map(|vector| vector[0]);
    assert!(first().all(|c| c < open * 1.02) && first().any(|c| c < 0.9 * open), "inside the ring it is shadowed");
    assert!(matches!(renderer.transfer(3), Err(Error::Input(_))));

    for options in [
        RenderOptions { size: Some([0, 64]), ..small() },
        RenderOptions { size: Some([64, 20_000]), ..small() },
        RenderOptions { eps: f32::NAN, ..small() },
    ] {
        assert!(matches!(Renderer::new(&door, &scene, &options), Err(Error::Input(_))));
    }
}
