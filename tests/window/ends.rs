//! A window at its limits: its display goes away, or another program destroys it.

use crate::viewing::{desk, open};
use shadow_fields::scene::Scene;

/// Where display or window are lost, edits are saved beside the scene and one line says so; Xlib alone would exit.
#[test]
fn a_lost_display_and_a_destroyed_window_save_edits() {
    for (is_lost, is_still) in [(true, true), (true, false), (false, true), (false, false)] {
        let Some((folder, display)) = desk() else { return };
        let mut view = open(&display, &folder);
        view.key("q", "SelectNext");
        view.key("e", "ToggleLight");
        if !is_still {
            view.key("space", "ToggleRunning");
        }
        if is_lost {
            display.end();
        } else {
            display.xdotool(&["windowclose", &view.window]);
        }
        let (code, heard) = view.end();
        assert_eq!(code, 5, "{heard:#?}");
        let line = heard.iter().rfind(|line| line.starts_with("shadow-fields: ")).unwrap();
        assert!(line.ends_with("; the edited scene was saved as scene-edited.toml"), "{line}");
        if is_lost {
            // The log, and what Xlib itself prints of a request that follows the loss, which nothing can turn off.
            let others = ["[", "note:", "Xlib:"];
            let said = heard.iter().filter(|line| !others.iter().any(|other| line.starts_with(other)));
            assert_eq!(said.collect::<Vec<_>>(), [line]);
            assert!(line.starts_with("shadow-fields: the display was lost; "), "{line}");
        }
        let [before, after] =
            ["scene.toml", "scene-edited.toml"].map(|name| Scene::load(&folder.at(name)).unwrap().entities[0].emits);
        assert_ne!(before, after, "the edit is in the file");
    }
}
