//! The camera, and the picture a scene begins with.

use super::{SMALL, from_text, picture_place};
use glam::{DVec3, Vec3};
use shadow_fields::scene::Data;
use shadow_fields::view::Command;
use std::path::Path;

#[test]
fn a_scene_without_distant_light_gets_a_sky_that_is_saved() {
    let dark = SMALL.replace("[environment]\nuniform = [0.1, 0.1, 0.1]\n", "");
    let mut editor = from_text(&dark);
    assert!(editor.scene().data.environment.sky.is_some() && !editor.scene().environment.is_none());
    let saved = Data::parse(&editor.data(Path::new("")).to_toml().unwrap(), Path::new("d.toml")).unwrap();
    assert_eq!(saved.environment, editor.scene().data.environment);
    // Turned off, it stays off when it is saved.
    assert!(editor.apply(Command::SetSky(0.0)).changed.sky && editor.scene().environment.is_none());
    let saved = editor.data(Path::new("")).to_toml().unwrap();
    assert!(from_text(&saved).scene().environment.is_none());
    // A scene that has its light keeps it.
    assert!(from_text(SMALL).scene().data.environment.sky.is_none());
}

#[test]
fn orbiting_keeps_distance_and_target_and_never_flips() {
    let mut editor = from_text(SMALL);
    let before = editor.camera().clone();
    let distance = before.eye.distance(before.target);
    // Half a turn: x and z of the eye change sign.
    assert!(editor.apply(Command::Orbit([100.0, 0.0])).changed.camera);
    let eye = editor.camera().eye;
    assert!(eye.distance(Vec3::new(0.0, 2.0, -5.0)) < 1e-5, "{eye}");
    for drag in [[0.0, 1e6], [0.0, 500.0], [3.0, -1e9], [f32::NAN, 1.0], [f32::INFINITY, 0.0], [1e30, -1e38]] {
        editor.apply(Command::Orbit(drag));
        let camera = editor.camera();
        assert!((camera.eye.distance(camera.target) - distance).abs() < 1e-4 && camera.target == before.target);
        assert!(camera.eye.is_finite() && camera.up() == Vec3::Y, "{camera:?}: up is up even at the limit");
    }
    // Down all the way, then sideways: the eye stays below.
    assert!(editor.camera().eye.y < editor.camera().target.y);
    // A drag to the right turns the scene with the pointer: what is in front moves right.
    let mut editor = from_text(SMALL);
    let front = DVec3::new(0.0, 0.5, 0.5);
    let was = picture_place(&editor, front);
    editor.apply(Command::Orbit([10.0, 10.0]));
    let now = picture_place(&editor, front);
    assert!(now[0] > was[0] + 1.0 && now[1] > was[1] + 0.5, "{was:?} {now:?}");
}

#[test]
fn a_camera_from_straight_above_or_below_turns_on() {
    for (eye, lean) in [("[0, 5, 0]", 1.0), ("[0, -5, 0]", -1.0)] {
        let straight = SMALL.replace("eye = [0, 2, 5]", &format!("eye = {eye}"));
        let mut editor = from_text(&straight.replace("[0, 0.5, 0]\n[output]", "[0, 0, 0]\n[output]"));
        // What is up in the picture stays up when the eye leans back.
        let up = picture_place(&editor, DVec3::new(0.0, 0.0, -1.0));
        assert!((up[0] - 100.0).abs() < 1e-3 && up[1] < 50.0, "{up:?}");
        editor.apply(Command::Orbit([0.0, if lean > 0.0 { -1.0 } else { 1.0 }]));
        let eye = editor.camera().eye;
        assert!(eye.x.abs() < 1e-5 && eye.z * lean > 0.01, "{eye}");
        let up = picture_place(&editor, DVec3::new(0.0, 0.0, -1.0));
        assert!((up[0] - 100.0).abs() < 1e-3 && up[1] < 50.0, "{up:?}");
    }
}

#[test]
fn panning_keeps_the_target_plane_under_the_pointer() {
    let mut editor = from_text(SMALL);
    let point = editor.camera().target.as_dvec3();
    let was = picture_place(&editor, point);
    editor.apply(Command::Pan([17.0, -9.0]));
    let now = picture_place(&editor, point);
    assert!((now[0] - was[0] - 17.0).abs() < 1e-3 && (now[1] - was[1] + 9.0).abs() < 1e-3, "{was:?} {now:?}");
    for _ in 0..50 {
        editor.apply(Command::Pan([1e30, -1e30]));
    }
    let camera = editor.camera();
    assert!(camera.eye.is_finite() && camera.target.abs().max_element() < 1e7, "{camera:?}");
}

#[test]
fn zoom_is_bounded_and_home_frames_what_matters() {
    let mut editor = from_text(SMALL);
    editor.apply(Command::Zoom(f32::NAN));
    for notches in [1e30, -1e30, 1e30] {
        for _ in 0..300 {
            editor.apply(Command::Zoom(notches));
        }
        let camera = editor.camera();
        assert!(camera.eye.is_finite() && camera.eye.distance(camera.target) > 1e-6, "{camera:?}");
        assert!(Data::parse(&editor.scene().to_toml().unwrap(), Path::new("z.toml")).is_ok());
    }
    for size in [[200, 100], [100, 200], [10, 1000]] {
        editor.apply(Command::Resize(size));
        editor.apply(Command::Home);
        let placements = editor.placements();
        let mut farthest = 0.0_f32;
        for (entity, place) in placements.iter().enumerate().skip(1) {
            let mesh = &editor.scene().meshes[editor.scene().entities[entity].mesh];
            for p in &mesh.positions {
                let [x, y] = picture_place(&editor, (place.rotation * (*p * place.scale) + place.position).as_dvec3());
                let across = [x / size[0] as f32, y / size[1] as f32].map(|c| (c - 0.5).abs());
                farthest = across.into_iter().fold(farthest, f32::max);
            }
        }
        assert!(farthest <= 0.5 && farthest > 0.3, "{size:?}: {farthest} of the picture, and not too small in it");
    }
}
