//! Undo and redo.

use super::{SMALL, from_text};
use proptest::prelude::*;
use shadow_fields::scene::Data;
use shadow_fields::view::Command;
use shadow_fields::view::input::CONTROLS;
use std::path::Path;

#[test]
fn history_is_bounded() {
    let mut editor = from_text(SMALL);
    editor.apply(Command::SelectNext);
    for _ in 0..2000 {
        editor.apply(Command::ToggleLight);
    }
    assert_eq!(editor.undo_count(), shadow_fields::view::edit::STEP_LIMIT);
}

fn any_command() -> impl Strategy<Value = Command> {
    let number = || prop_oneof![-300.0_f32..300.0, Just(f32::NAN), Just(f32::INFINITY), Just(-1e30), Just(0.0)];
    let place = move || [number(), number()];
    let bound = CONTROLS.iter().flat_map(|row| row.bindings).map(|(.., command)| *command);
    prop_oneof![
        place().prop_map(Command::Orbit),
        place().prop_map(Command::Pan),
        number().prop_map(Command::Zoom),
        place().prop_map(Command::Pick),
        place().prop_map(Command::DragStart),
        place().prop_map(Command::DragTo),
        number().prop_map(Command::SetSkyTurn),
        number().prop_map(Command::SetSky),
        number().prop_map(Command::SetLight),
        number().prop_map(Command::SetExposure),
        [0_u32..2000, 0_u32..2000].prop_map(Command::Resize),
        proptest::sample::select(bound.collect::<Vec<_>>()),
        proptest::sample::select(vec![Command::DragEnd, Command::EndSlide]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, rng_seed: proptest::test_runner::RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever is done stays finite and fit for a scene file; undo takes it all back, redo brings it again.
    #[test]
    fn any_commands(commands in prop::collection::vec(any_command(), 1..60)) {
        let mut editor = from_text(SMALL);
        let start = editor.scene().clone();
        let mut done = 0;
        for command in commands.into_iter().filter(|c| *c != Command::NextScene) {
            let before = editor.scene().data.clone();
            let effect = editor.apply(command);
            editor.advance(0.01);
            let after = &editor.scene().data;
            // What is said to have changed is what changed.
            let changed = effect.changed;
            prop_assert!(changed.placements || changed.emission || changed.roles || before.entities == after.entities, "{command:?}");
            prop_assert_eq!(changed.sky, before.environment != after.environment, "{:?}", command);
            prop_assert_eq!(changed.exposure, before.output != after.output, "{:?}", command);
            prop_assert!(changed.camera || before.camera == after.camera);
            prop_assert!(editor.placements().iter().all(|p| p.position.is_finite() && p.scale > 0.0 && p.rotation.is_normalized()));
            done += 1;
        }
        prop_assert!(done < shadow_fields::view::edit::STEP_LIMIT);
        let saved = Data::parse(&editor.data(Path::new("")).to_toml().unwrap(), Path::new("p.toml"));
        prop_assert!(saved.is_ok(), "{saved:?}");
        let end = editor.scene().data.clone();
        let mut undone = 0;
        while editor.undo_count() > 0 {
            editor.apply(Command::Undo);
            undone += 1;
        }
        prop_assert_eq!(&editor.scene().data.entities, &start.data.entities);
        prop_assert_eq!(&editor.scene().entities, &start.entities);
        prop_assert_eq!(&editor.scene().data.environment, &start.data.environment);
        prop_assert_eq!(editor.scene().data.output.exposure_ev(), start.data.output.exposure_ev());
        (0..undone).for_each(|_| drop(editor.apply(Command::Redo)));
        prop_assert_eq!(&editor.scene().data.entities, &end.entities);
        prop_assert_eq!(&editor.scene().data.environment, &end.environment);
    }
}
