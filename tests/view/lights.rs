//! Lights and sliders.

use super::{SMALL, from_text};
use glam::{DVec3, Vec3};
use shadow_fields::view::Command;

#[test]
fn an_occluder_becomes_a_light_and_back() {
    let mut editor = from_text(SMALL);
    assert!(editor.apply(Command::ToggleLight).message.is_some(), "nothing selected");
    editor.apply(Command::SelectNext);
    editor.apply(Command::SelectNext);
    let before = editor.scene().entities[1].clone();
    let effect = editor.apply(Command::ToggleLight);
    assert!(effect.changed.roles && effect.changed.emission);
    let light = editor.scene().entities[1].clone();
    assert!(light.emits && !light.occludes && light.emission.max_element() >= 1.0);
    let hue = light.emission / light.emission.max_element();
    assert!(hue.distance(Vec3::new(1.0, 0.5, 0.25)) < 1e-5, "its light has its colour: {hue}");
    editor.apply(Command::SetLight(5.0));
    editor.apply(Command::ToggleLight);
    assert_eq!(editor.scene().entities[1], before);
    editor.apply(Command::ToggleLight);
    assert!((editor.scene().entities[1].emission.max_element() - 32.0).abs() < 1e-3, "it is as bright as it was");
    // A lamp that stops shining casts a shadow.
    editor.apply(Command::SelectNext);
    editor.apply(Command::ToggleLight);
    let lamp = &editor.scene().entities[2];
    assert!(!lamp.emits && lamp.occludes && lamp.emission == Vec3::ZERO);
}

#[test]
fn sliders_change_the_scene_and_undo_as_one() {
    let mut editor = from_text(SMALL);
    let before = editor.scene().data.clone();
    assert!((editor.light_ev().unwrap() - 40.0_f32.log2()).abs() < 1e-6);
    for i in 0..20 {
        assert!(editor.apply(Command::SetLight(1.0 + i as f32 * 0.2)).changed.emission);
    }
    assert!((editor.light_ev().unwrap() - 4.8).abs() < 1e-5);
    let hue = editor.scene().entities[2].emission;
    assert!((hue.z / hue.x - 0.75).abs() < 1e-5, "the colour stays");
    editor.apply(Command::EndSlide);
    for i in 2..9 {
        assert!(editor.apply(Command::SetSky(i as f32)).changed.sky);
    }
    assert!((editor.scene().environment.radiance(DVec3::Y)[0] - 0.8).abs() < 1e-6);
    for i in 1..9 {
        assert!(editor.apply(Command::SetSkyTurn(100.0 * i as f32)).changed.sky);
    }
    assert!((editor.scene().data.environment.turn_deg - 80.0).abs() < 1e-3);
    for i in 1..9 {
        assert!(editor.apply(Command::SetExposure(i as f32 / 4.0)).changed.exposure);
    }
    for bad in [
        Command::SetSky(-1.0),
        Command::SetSky(f32::NAN),
        Command::SetExposure(f32::NAN),
        Command::SetLight(f32::NAN),
        Command::SetExposure(99.0),
        Command::SetLight(1e9),
        Command::SetSkyTurn(f32::INFINITY),
    ] {
        let now = editor.scene().data.clone();
        let count = editor.undo_count();
        assert!(!editor.apply(bad).changed.any(), "{bad:?}");
        assert_eq!((&editor.scene().data, editor.undo_count()), (&now, count), "{bad:?}");
    }
    assert_eq!(editor.undo_count(), 4);
    for _ in 0..4 {
        assert!(editor.apply(Command::Undo).changed.any());
    }
    assert_eq!(editor.scene().data, before);
    assert!(editor.apply(Command::Undo).message.is_some());
    // A new change forgets what was taken back.
    assert!(editor.apply(Command::Redo).changed.emission);
    editor.apply(Command::SetExposure(2.0));
    assert!(editor.apply(Command::Redo).message.is_some());
}
