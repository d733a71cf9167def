//! glTF through the whole program: `render`, `import`, `bake`.

use crate::cli::{COARSE, Folder, SMALL};
use crate::model::room;
use serde_json::{Value, json};

#[test]
fn a_model_and_the_scene_file_that_is_made_of_it_give_the_same_picture() {
    let Some(folder) = Folder::with_device() else { return };
    room().write(folder.path(), "room");
    let import = folder.good("import room.glb -o room.toml");
    assert!(import.stdout.contains("room.toml: 4 entities, 4 meshes"), "{}", import.stdout);
    for line in ["baked into copies of meshes (1)", "point and spot lights (1) are balls of radius", "no sky"] {
        assert!(import.stderr.contains(line), "no {line:?} in {}", import.stderr);
    }
    assert!(!import.stderr.contains("left out"), "{}", import.stderr);
    assert_eq!(folder.names(), ["room.glb", "room.toml"]);
    for (file, picture) in [("room.glb", "a.png"), ("room.toml", "b.png")] {
        folder.good(&format!("render {file} -o {picture} --time 0.6 --strict {SMALL}"));
    }
    assert!(folder.read("a.png") == folder.read("b.png"), "the pictures differ");
    // It moves.
    folder.good(&format!("render room.glb -o c.png --time 0.3 {SMALL}"));
    assert_eq!(folder.run("compare a.png c.png --max-rms 0.001").code, 1);
}

/// A mesh of a scene file may be a glTF file too: all its triangles.
#[test]
fn scene_files_name_gltf_files_as_meshes() {
    let folder = Folder::new();
    room().write(folder.path(), "room");
    let text = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"room\"\nfile = \"room.glb\"\n";
    folder.write("s.toml", text);
    let scene = shadow_fields::scene::Scene::load(&folder.at("s.toml")).unwrap();
    assert_eq!((scene.meshes[0].name.as_str(), scene.meshes[0].triangles.len()), ("room", 36));
    folder.write("room.glb", "glTF");
    folder.refused("render s.toml -o p.png", 4, &["s.toml:4: mesh \"room\": room.glb: expected version 2"]);
}

#[test]
fn a_model_bakes_as_one_mesh() {
    let Some(folder) = Folder::with_device() else { return };
    room().write(folder.path(), "room");
    let ran = folder.good(&format!("bake room.glb -o room.sf {COARSE}"));
    assert!(ran.stdout.contains("36 triangles"), "{}", ran.stdout);
    assert!(ran.stderr.contains("left out (1): animations"), "{}", ran.stderr);
    assert!(!folder.good("inspect room.sf").stdout.is_empty());
    folder.refused("bake room.glb -o s.sf --strict", 4, &["--strict: left out (1): animations"]);
}

#[test]
fn strict_refuses_what_is_left_out_and_quiet_says_nothing() {
    let folder = Folder::new();
    let mut model = room();
    model.push("scenes", json!({ "nodes": [0] }));
    model.write(folder.path(), "room");
    let import = "import room.glb -o r.toml";
    folder.refused(&format!("{import} --strict"), 4, &["room.glb: --strict: left out (1): further scenes"]);
    let ran = folder.good(import);
    assert!(ran.stderr.contains("note: room.glb: left out (1): further scenes"), "{}", ran.stderr);
    let ran = folder.good(&format!("{import} --quiet --json"));
    assert_eq!(ran.stderr, "");
    let report: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&report["entities"], &report["triangles"]), (&json!(4), &json!(36 + 320)));
    for line in ["import r.toml -o x.toml", "import room.glb -o x.png"] {
        assert_eq!(folder.run(line).code, 2, "{line}");
    }
}
