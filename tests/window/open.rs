//! Files that are dropped on the window, and its close, without a window.

use crate::model::Model;
use crate::room::{self, apart};
use crate::stand::{SIZE, Stand};
use shadow_fields::view::command::Command;

/// A file that is dropped on the window: each kind opens, a bad one changes nothing, and edits are not lost unasked.
#[test]
fn a_dropped_file_opens() {
    let Some(mut stand) = Stand::new("drop") else { return };
    stand.ready();
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let said = |stand: &Stand| stand.viewer.message().unwrap().to_owned();
    let own = stand.viewer.editor.path().to_owned();
    let plain = stand.shown();

    // What cannot be opened is one line, also while the overlay is hidden, and the scene stays.
    assert!(!stand.viewer.editor.overlay);
    for (name, text) in [("bad.toml", "[camera"), ("bad.glb", "glTF"), ("bad.obj", "f 1 2 3"), ("notes.txt", "words")] {
        stand.viewer.open(&write(name, text.as_bytes())).unwrap();
        let line = said(&stand);
        assert!(line.starts_with("not opened: ") && line.contains(name) && line.lines().count() == 1, "{line}");
        assert_eq!(stand.viewer.editor.path(), own);
    }
    stand.viewer.open(&folder.path().join("missing.toml")).unwrap();
    assert!(said(&stand).contains("missing.toml"));
    stand.turn();
    assert!(apart(&plain, &stand.shown()) > 100, "the lines are seen");

    // Each kind of file opens; over unsaved edits at the second time.
    let pyramid = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    let mut model = Model::default();
    let mesh = model.cuboid([-0.5; 3], [0.5; 3], None);
    model.node(serde_json::json!({ "name": "box", "mesh": mesh }));
    let files = [
        room::write(folder.path(), SIZE, ""),
        model.write(folder.path(), "model"),
        model.write_embedded(folder.path(), "model"),
        write("pyramid.obj", pyramid),
    ];
    let mut path = own;
    for next in &files {
        stand.viewer.apply(Command::SetExposure(0.7)).unwrap();
        stand.viewer.open(next).unwrap();
        let line = said(&stand);
        assert!(line.contains("unsaved edits of") && line.contains(&path.display().to_string()), "{line}");
        assert_eq!(stand.viewer.editor.path(), path);
        stand.viewer.open(next).unwrap();
        stand.ready();
        assert_eq!(stand.viewer.editor.path(), next);
        assert!(apart(&plain, &stand.shown()) > 100, "{} is seen", next.display());
        path = next.to_owned();
    }
    // Nor does the next scene come, or the window close, over unsaved edits at the first time.
    stand.viewer.apply(Command::SetExposure(0.7)).unwrap();
    stand.viewer.apply(Command::NextScene).unwrap();
    assert_eq!(stand.viewer.editor.path(), path);
    stand.viewer.apply(Command::SetExposure(0.6)).unwrap();
    stand.viewer.apply(Command::Quit).unwrap();
    assert!(!stand.viewer.quit, "a new edit is asked for anew");
    stand.viewer.apply(Command::Quit).unwrap();
    assert!(stand.viewer.quit);
}

/// What a dropped glTF file loses is said; where that is not allowed, the file is not opened.
#[test]
fn what_a_dropped_file_loses_is_said() {
    let mut model = Model::default();
    let mesh = model.cuboid([-0.5; 3], [0.5; 3], None);
    model.node(serde_json::json!({ "name": "box", "mesh": mesh }));
    model.push("scenes", serde_json::json!({ "nodes": [0] }));
    let folder = tempfile::tempdir().unwrap();
    let path = model.write(folder.path(), "scenes");
    let Some(mut stand) = Stand::new("lost") else { return };
    stand.viewer.open(&path).unwrap();
    let lines = stand.viewer.messages();
    assert!(lines.iter().any(|line| line.contains("scenes.glb: left out (1): further scenes")), "{lines:?}");
    drop(stand);
    let Some(mut stand) = Stand::with("strict", |setup| setup.strict = true) else { return };
    stand.viewer.open(&path).unwrap();
    let line = stand.viewer.message().unwrap();
    assert!(line.starts_with("not opened: ") && line.contains("--strict"), "{line}");
}
