//! glTF through the whole program: `render`, `import`, `bake`.

use crate::{cli, model};
use cli::{command, finish, good, has_device, names};
use model::room;
use serde_json::{Value, json};
use tempfile::TempDir;

const SMALL: [&str; 4] = ["--lattice", "cube:4x3", "--face-px", "16"];

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn a_model_and_the_scene_file_that_is_made_of_it_give_the_same_picture() {
    if !has_device() {
        return;
    }
    let folder = folder();
    room().write(folder.path(), "room");
    let import = good(folder.path(), &["import", "room.glb", "-o", "room.toml"]);
    assert!(import.stdout.contains("room.toml: 4 entities, 4 meshes"), "{}", import.stdout);
    for line in ["baked into copies of meshes (1)", "point and spot lights (1) are balls of radius", "no sky"] {
        assert!(import.stderr.contains(line), "no {line:?} in {}", import.stderr);
    }
    assert!(!import.stderr.contains("left out"), "{}", import.stderr);
    assert_eq!(names(folder.path()), ["room.glb", "room.toml"]);
    for (file, picture) in [("room.glb", "a.png"), ("room.toml", "b.png")] {
        let render = ["render", file, "-o", picture, "--size", "96x64", "--time", "0.6", "--strict"];
        good(folder.path(), &[&render[..], &SMALL].concat());
    }
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(read("a.png") == read("b.png"), "the pictures differ");
    good(folder.path(), &["compare", "a.png", "b.png", "--max-flip", "0", "--max-rms", "0"]);
    // It moves.
    let render = ["render", "room.glb", "-o", "c.png", "--size", "96x64", "--time", "0.3"];
    good(folder.path(), &[&render[..], &SMALL].concat());
    assert_eq!(finish(&mut command(folder.path(), &["compare", "a.png", "c.png", "--max-rms", "0.001"])).code, 1);
}

/// A mesh of a scene file may be a glTF file too: all its triangles.
#[test]
fn scene_files_name_gltf_files_as_meshes() {
    let folder = folder();
    room().write(folder.path(), "room");
    let text = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"room\"\nfile = \"room.glb\"\n";
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    let scene = shadow_fields::scene::Scene::load(&folder.path().join("s.toml")).unwrap();
    assert_eq!((scene.meshes[0].name.as_str(), scene.meshes[0].triangles.len()), ("room", 36));
    std::fs::write(folder.path().join("room.glb"), "glTF").unwrap();
    let ran = finish(&mut command(folder.path(), &["render", "s.toml", "-o", "p.png"]));
    assert!(
        ran.code == 4 && ran.stderr.contains("s.toml:4: mesh \"room\": room.glb: expected version 2"),
        "{}",
        ran.stderr
    );
}

#[test]
fn a_model_bakes_as_one_mesh() {
    if !has_device() {
        return;
    }
    let folder = folder();
    room().write(folder.path(), "room");
    let ran = good(folder.path(), &[&["bake", "room.glb", "-o", "room.sf"][..], &SMALL].concat());
    assert!(ran.stdout.contains("36 triangles"), "{}", ran.stdout);
    assert!(ran.stderr.contains("left out (1): animations"), "{}", ran.stderr);
    let ran = good(folder.path(), &["inspect", "room.sf"]);
    assert!(!ran.stdout.is_empty());
    let ran = finish(&mut command(folder.path(), &["bake", "room.glb", "-o", "s.sf", "--strict"]));
    assert!(ran.code == 4 && ran.stderr.contains("--strict: left out (1): animations"), "{}", ran.stderr);
}

#[test]
fn strict_refuses_what_is_left_out_and_quiet_says_nothing() {
    let folder = folder();
    let mut model = room();
    model.push("scenes", json!({ "nodes": [0] }));
    model.write(folder.path(), "room");
    let import =
        |more: &[&str]| finish(&mut command(folder.path(), &[&["import", "room.glb", "-o", "r.toml"], more].concat()));
    let ran = import(&["--strict"]);
    assert_eq!((ran.code, ran.stderr.lines().count()), (4, 1), "{}", ran.stderr);
    assert!(ran.stderr.contains("room.glb: --strict: left out (1): further scenes"), "{}", ran.stderr);
    assert_eq!(names(folder.path()), ["room.glb"]);
    let ran = import(&[]);
    assert!(ran.code == 0 && ran.stderr.contains("note: room.glb: left out (1): further scenes"), "{}", ran.stderr);
    let ran = import(&["--quiet", "--json"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (0, ""));
    let report: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&report["entities"], &report["triangles"]), (&json!(4), &json!(36 + 320)));
    for (arguments, code) in [(["import", "r.toml", "-o", "x.toml"], 2), (["import", "room.glb", "-o", "x.png"], 2)] {
        assert_eq!(finish(&mut command(folder.path(), &arguments)).code, code);
    }
}
