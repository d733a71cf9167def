//! A window at its limits: its display goes away, or another program destroys it.

use crate::display::Display;
use crate::viewing::{View, desk, open};
use std::path::Path;

/// A window whose first entity has lost or got its light, while the scene stands still or runs.
fn edited<'d>(display: &'d Display, folder: &Path, is_still: bool) -> View<'d> {
    let mut view = open(display, folder);
    view.key("q", "SelectNext");
    view.key("e", "ToggleLight");
    if !is_still {
        view.key("space", "ToggleRunning");
    }
    view
}

/// Xlib would end the process: instead, edits are saved beside the scene, and one line says so.
#[test]
fn a_lost_display_saves_edits() {
    for is_still in [true, false] {
        let Some((folder, display)) = desk() else { return };
        let view = edited(&display, folder.path(), is_still);
        display.end();
        let (code, heard) = view.end();
        assert_eq!(code, 5, "{heard:#?}");
        // The log, and what Xlib itself prints of a request that follows the loss, which nothing can turn off.
        let others = ["[", "note:", "Xlib:"];
        let is_said = |line: &&String| !others.iter().any(|other| line.starts_with(other));
        let said: Vec<&String> = heard.iter().filter(is_said).collect();
        assert_eq!(said, ["shadow-fields: the display was lost; the edited scene was saved as scene-edited.toml"]);
        let [before, after] = ["scene.toml", "scene-edited.toml"]
            .map(|name| shadow_fields::scene::Scene::load(&folder.path().join(name)).unwrap().entities[0].emits);
        assert_ne!(before, after, "the edit is in the file");
    }
}

/// Another program destroys the window, by its close button or at random: the same holds.
#[test]
fn a_destroyed_window_saves_edits() {
    for is_still in [true, false] {
        let Some((folder, display)) = desk() else { return };
        let view = edited(&display, folder.path(), is_still);
        display.xdotool(&["windowclose", &view.window]);
        let (code, heard) = view.end();
        assert_eq!(code, 5, "{heard:#?}");
        let end = heard.iter().rfind(|line| line.starts_with("shadow-fields: ")).unwrap();
        assert!(end.ends_with("; the edited scene was saved as scene-edited.toml"), "{end}");
        assert!(shadow_fields::scene::Scene::load(&folder.path().join("scene-edited.toml")).is_ok());
    }
}
