//! Steps and sliders that change entities.

use super::{SMALL, built_in, from_text, picture_place, step};
use glam::{DVec3, Vec3};
use shadow_fields::view::{Command, Step};

#[test]
fn steps_go_where_the_camera_sees_them_go_at_all_times() {
    let ways = [
        (Step::Left, [-1, 0]),
        (Step::Right, [1, 0]),
        (Step::Up, [0, -1]),
        (Step::Down, [0, 1]),
        (Step::Forth, [0, -1]),
        (Step::Back, [0, 1]),
    ];
    for turn in [0.0, 30.0, 120.0, 190.0] {
        for (way, [right, down]) in ways {
            let mut editor = from_text(SMALL);
            editor.apply(Command::Orbit([turn, 3.0]));
            editor.apply(Command::SelectPrevious);
            let times = [0.0, 1.3, 77.7];
            let before = times.map(|t| editor.scene().at(t));
            assert!(editor.apply(step(way)).changed.placements);
            let after = times.map(|t| editor.scene().at(t));
            let moved = after[0][2].position - before[0][2].position;
            for (a, b) in after.iter().zip(&before) {
                assert_eq!(a[..2], b[..2], "the others stay");
                // The whole path moves along.
                assert!((a[2].position - b[2].position).distance(moved) < 1e-5);
                assert_eq!((a[2].rotation, a[2].scale), (b[2].rotation, b[2].scale));
            }
            // At the target, so that a step along the line of sight is not seen as one across it.
            let target = editor.camera().target.as_dvec3();
            let (was, now) = (picture_place(&editor, target), picture_place(&editor, target + moved.as_dvec3()));
            let across = [now[0] - was[0], now[1] - was[1]];
            for (axis, sign) in [(0, right), (1, down)] {
                let seen = across[axis];
                assert!(if sign == 0 { seen.abs() < 1e-2 } else { seen * sign as f32 > 0.3 }, "{way:?} {across:?}");
            }
        }
    }
}

#[test]
fn nothing_selected_moves_all_but_mere_ground() {
    let mut editor = from_text(SMALL);
    let before = editor.placements();
    editor.apply(step(Step::Up));
    editor.apply(step(Step::Larger));
    let after = editor.placements();
    assert_eq!(before[0], after[0], "the floor stays");
    for (a, b) in after.iter().zip(&before).skip(1) {
        assert!(a.position.y > b.position.y && (a.scale / b.scale - 1.05).abs() < 1e-6);
    }
    // The floor can be moved by itself.
    editor.apply(Command::SelectNext);
    editor.apply(step(Step::Down));
    assert!(editor.placements()[0].position.y < 0.0);
}

#[test]
fn turning_turns_in_place_at_all_times() {
    let text = format!(
        "{SMALL}[[entity]]\nmesh = \"ball\"\nposition = [1, 1, 1]\nmotion = [{{ spin = {{ axis = [1, 0.2, 0], period_s = 3 }} }}, \
        {{ bob = {{ amplitude_m = 0.3, period_s = 2 }} }}]\n"
    );
    let mut editor = from_text(&text);
    editor.apply(Command::SelectPrevious);
    for time in [0.0, 0.4, 2.9, 50.0] {
        let before = editor.scene().at(time)[3];
        editor.apply(step(Step::TurnLeft));
        let after = editor.scene().at(time)[3];
        let turn = glam::Quat::from_rotation_y(5.0_f32.to_radians());
        assert!((turn * before.rotation).dot(after.rotation).abs() > 1.0 - 1e-6);
        assert_eq!(after.position, before.position);
    }
}

#[test]
fn a_step_beyond_the_limits_of_a_scene_does_nothing() {
    let mut editor = from_text(&SMALL.replace("scale = 0.5", "scale = 9.9e6"));
    editor.apply(Command::SelectPrevious);
    let before = editor.scene().data.clone();
    let effect = editor.apply(step(Step::Larger));
    assert!(effect.message.is_some() && !effect.changed.any() && editor.undo_count() == 0);
    assert_eq!(editor.scene().data, before);
}

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
    // A lamp that stops shining casts a shadow, and its field is the occlusion field that it had.
    editor.apply(Command::SelectNext);
    let fields = editor.needs(1);
    editor.apply(Command::ToggleLight);
    let lamp = &editor.scene().entities[2];
    assert!(!lamp.emits && lamp.occludes && lamp.emission == Vec3::ZERO);
    assert_eq!(editor.needs(1), fields);
    // The floor needs a field that it did not have.
    assert_eq!(editor.needs(0), [None, None]);
    editor.apply(Command::SelectNext);
    editor.apply(Command::ToggleLight);
    assert!(editor.needs(0)[0].is_some());
    // A torus of two colours needs the other kind.
    let mut editor = built_in("glowing_torus");
    let glowing = editor.scene().entities.iter().position(|e| e.name == "glowing").unwrap();
    while editor.selection() != Some(glowing) {
        editor.apply(Command::SelectNext);
    }
    let mesh = editor.scene().entities[glowing].mesh;
    let before = editor.needs(mesh);
    editor.apply(Command::ToggleLight);
    assert!(
        before[0].is_none()
            && before[1].is_some()
            && editor.needs(mesh)[0].is_some()
            && editor.needs(mesh)[1].is_none()
    );
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
    assert!((editor.sky_turn_deg() - 80.0).abs() < 1e-3);
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
        let (now, count) = (editor.scene().data.clone(), editor.undo_count());
        assert!(!editor.apply(bad).changed.any(), "{bad:?}");
        assert_eq!((&editor.scene().data, editor.undo_count()), (&now, count), "{bad:?}");
    }
    assert_eq!(editor.undo_count(), 4);
    for _ in 0..4 {
        assert!(editor.apply(Command::Undo).changed.any());
    }
    assert_eq!(editor.scene().data, before);
    assert!(editor.apply(Command::Undo).message.is_some());
}
