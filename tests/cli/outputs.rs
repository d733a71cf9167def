//! No output replaces a file that is read or written; bad outputs are found at the start, pipes are not waited for.
#![cfg(unix)]

use crate::cli::{Folder, Ran, SMALL, TRIANGLE, finish, has_device, limited, without_drivers};
use shadow_fields::asset::picture::write_png;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::process::Command;

const SCENE: &str = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[environment]\nimage = { file = \"sky_0003.png\" }\n\
    [[mesh]]\nname = \"a\"\nfile = \"tri.obj\"\n[[mesh]]\nname = \"b\"\nfile = \"model.gltf\"\n\
    [[entity]]\nmesh = \"a\"\n[[entity]]\nmesh = \"b\"\n";
const MODEL: &str = r#"{
    "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
    "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
    "textures": [{ "source": 0 }], "images": [{ "uri": "paint.png" }],
    "buffers": [{ "uri": "the%20buffer.bin", "byteLength": 36 }], "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
    "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }]
}"#;

/// A scene with all kinds of files that a scene may name.
fn folder() -> Folder {
    let folder = Folder::of(&[("s.toml", SCENE), ("tri.obj", TRIANGLE), ("model.gltf", MODEL)]);
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    folder.write("the buffer.bin", corners.map(f32::to_le_bytes).concat());
    for picture in ["sky_0003.png", "paint.png", "a.png", "b.png", "mask.png"] {
        write_png(&folder.at(picture), 4, 2, &[0.9; 24], 0.0).unwrap();
    }
    folder
}

/// The command is refused before it looks for a device.
fn refused(folder: &Folder, line: &str, code: i32, parts: &[&str]) {
    folder.refuses(without_drivers(&mut folder.command(line)), code, parts);
}

#[test]
fn outputs_do_not_replace_inputs() {
    let folder = folder();
    for (link, file) in [
        ("scene.png", "s.toml"),
        ("scene.csv", "s.toml"),
        ("mesh.csv", "tri.obj"),
        ("model.json", "model.gltf"),
        ("buffer.exr", "the buffer.bin"),
        ("buffer.sf", "the buffer.bin"),
        ("scene_meshes.toml", "model.gltf"),
    ] {
        symlink(file, folder.at(link)).unwrap();
    }
    std::fs::hard_link(folder.at("s.toml"), folder.at("hard.json")).unwrap();
    std::fs::create_dir(folder.at("in")).unwrap();
    for (line, output, input) in [
        ("render s.toml -o o.png --error scene.png", "--error scene.png", "s.toml"),
        ("render s.toml -o o.png --vertices scene.csv", "--vertices scene.csv", "s.toml"),
        ("render s.toml -o o.png --stats hard.json", "--stats hard.json", "s.toml"),
        ("render s.toml -o sky_0003.png", "--output sky_0003.png", "sky_0003.png"),
        ("render s.toml -o in/../sky_0003.png", "--output in/../sky_0003.png", "sky_0003.png"),
        ("render s.toml -o sky_####.png --frames 9", "--output sky_0003.png", "sky_0003.png"),
        ("render s.toml -o o.png --vertices mesh.csv", "--vertices mesh.csv", "tri.obj"),
        ("render s.toml -o o.png --stats model.json", "--stats model.json", "model.gltf"),
        ("render s.toml -o o.png --exr buffer.exr", "--exr buffer.exr", "the buffer.bin"),
        ("render model.gltf -o paint.png", "--output paint.png", "paint.png"),
        ("bake model.gltf -o buffer.sf", "--output buffer.sf", "the buffer.bin"),
        ("import model.gltf -o scene_meshes.toml --force", "--output scene_meshes.toml", "model.gltf"),
        ("compare a.png b.png -o a.png", "--output a.png", "a.png"),
        ("compare a.png b.png -o b.png", "--output b.png", "b.png"),
        ("compare a.png b.png --mask mask.png -o mask.png", "--output mask.png", "mask.png"),
    ] {
        refused(&folder, line, 2, &[output, &format!("input {input}")]);
    }
    // Folders take files of names that the command chooses.
    refused(&folder, "profile s.toml --output .", 2, &[".", "input s.toml"]);
    // The pictures before and after those of the scene are free.
    folder.run("render s.toml -o sky_####.png --first 4 --device none").ended(3, &[]);
}

#[test]
fn outputs_do_not_replace_one_another() {
    let folder = folder();
    symlink("o.png", folder.at("link.png")).unwrap();
    for (line, first, second) in [
        ("render s.toml -o o.png --error o.png", "--output o.png", "--error o.png"),
        ("render s.toml -o o.png --error link.png", "--output o.png", "--error link.png"),
        ("render s.toml -o o_##.png --frames 5 --error o_04.png", "--output o_04.png", "--error o_04.png"),
    ] {
        refused(&folder, line, 2, &[first, second]);
    }
    // A device takes everything.
    folder.run("render s.toml -o /dev/null --exr /dev/null --device none").ended(3, &[]);
}

#[test]
fn every_output_asks_for_its_ending() {
    let folder = folder();
    for (line, file, ending) in [
        ("render s.toml -o o.toml", "o.toml", ".png"),
        ("render s.toml -o o.png --exr s.toml", "s.toml", ".exr"),
        ("render s.toml -o o.png --vertices s.toml", "s.toml", ".csv"),
        ("render s.toml -o o.png --stats s.toml", "s.toml", ".json"),
        ("render s.toml -o o.png --error s.toml", "s.toml", ".png"),
        ("bake tri.obj -o tri.obj", "tri.obj", ".sf"),
        ("import model.gltf -o model.gltf", "model.gltf", ".toml"),
        ("compare a.png b.png -o a", "a", ".png"),
        ("farm plan s.toml -o s.toml", "s.toml", ".json"),
    ] {
        refused(&folder, line, 2, &[file, ending]);
    }
}

/// `import` replaces what it wrote itself, and other files where it is told to.
#[test]
fn import_replaces_only_its_own_files() {
    let folder = folder();
    refused(&folder, "import model.gltf -o s.toml", 2, &["s.toml", "--force"]);
    let import = "import model.gltf -o m.toml";
    folder.good(import);
    folder.good(import);
    folder.write("m.toml", TRIANGLE);
    refused(&folder, &format!("{import} --quiet"), 2, &["m.toml", "--force"]);
    folder.good(&format!("{import} --force"));
    assert_ne!(folder.read("m.toml"), TRIANGLE.as_bytes());
}

#[test]
fn what_cannot_be_written_is_found_at_the_start() {
    let folder = folder();
    let read_only = folder.at("kept.csv");
    std::fs::write(&read_only, "kept").unwrap();
    std::fs::set_permissions(&read_only, PermissionsExt::from_mode(0o444)).unwrap();
    std::fs::create_dir(folder.at("folder.exr")).unwrap();
    for (line, parts) in [
        ("render s.toml -o o.png --vertices kept.csv", ["kept.csv: cannot be written", "read-only"]),
        ("render s.toml -o o.png --exr folder.exr", ["folder.exr: cannot be written", "a folder"]),
        ("render s.toml -o o.png --stats gone/s.json", ["gone/s.json: cannot be written", "no folder gone"]),
        ("render s.toml -o o.png --error s.toml/e.png", ["s.toml/e.png: cannot be written", "no folder s.toml"]),
        #[cfg(target_os = "linux")]
        ("render s.toml -o o.png --vertices /proc/v.csv", ["/proc/v.csv: cannot be written", ""]),
        ("render s.toml -o gone/p_##.png", ["gone", "no folder gone"]),
        ("bake tri.obj -o gone/f.sf", ["gone/f.sf: cannot be written", "no folder gone"]),
        ("import model.gltf -o gone/m.toml", ["gone/m.toml: cannot be written", "no folder gone"]),
        ("compare a.png b.png -o gone/d.png", ["gone/d.png: cannot be written", "no folder gone"]),
    ] {
        refused(&folder, line, 1, &parts);
    }
}

/// A disk may become full later.
#[test]
fn a_late_failure_names_its_file() {
    let Some(folder) = has_device().then(folder) else { return };
    let render =
        folder.command(&format!("render sphere_over_plane -o o.png --vertices v.csv --no-cache --quiet {SMALL}"));
    let ran = finish(&mut limited(&render, "ulimit -f 64"));
    assert_eq!((ran.code, ran.stderr.lines().count()), (1, 1), "{}", ran.stderr);
    assert!(ran.stderr.contains("v.csv: cannot be written: File too large"), "{}", ran.stderr);
}

/// Runs a command, which ends with code 124 where it waits without end.
fn ended(command: &Command) -> Ran {
    finish(&mut limited(command, "set -- timeout 60 \"$@\""))
}

#[test]
fn inputs_that_are_no_files_are_refused_and_not_waited_for() {
    let folder = folder();
    let at = |name: &str| folder.at(name);
    for pipe in ["pipe.toml", "pipe.obj", "pipe.png", "pipe.glb", "pipe.sf", "pipe.json", "project.comp"] {
        let made = Command::new("mkfifo").arg(at(pipe)).status();
        assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    }
    folder.write("mesh.toml", SCENE.replace("tri.obj", "pipe.obj"));
    folder.write("sky.toml", SCENE.replace("sky_0003.png", "pipe.png"));
    folder.write("buffer.gltf", MODEL.replace("the%20buffer.bin", "pipe.obj"));
    folder.write("texture.gltf", MODEL.replace("paint.png", "pipe.png"));
    let socket = std::os::unix::net::UnixListener::bind(at("socket.toml")).unwrap();
    for (line, file) in [
        ("render pipe.toml -o o.png", "pipe.toml"),
        ("render mesh.toml -o o.png", "pipe.obj"),
        ("render sky.toml -o o.png", "pipe.png"),
        ("render buffer.gltf -o o.png", "pipe.obj"),
        ("render texture.gltf -o o.png", "pipe.png"),
        ("bake pipe.obj -o f.sf", "pipe.obj"),
        ("bake pipe.glb -o f.sf", "pipe.glb"),
        ("import pipe.glb -o m.toml", "pipe.glb"),
        ("inspect pipe.sf", "pipe.sf"),
        ("compare a.png pipe.png", "pipe.png"),
        ("farm status pipe.json", "pipe.json"),
        ("render socket.toml -o o.png", "socket.toml"),
        ("render . -o o.png", "."),
        ("compare a.png .", "."),
        ("bake /dev/zero -o f.sf", "/dev/zero"),
        ("inspect /dev/zero", "/dev/zero"),
    ] {
        let ran = ended(&folder.command(line));
        assert_eq!((ran.code, ran.stderr.lines().count()), (4, 1), "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(&format!("{file}: ")), "{line}: {}", ran.stderr);
    }
    drop(socket);
    if has_device() {
        let line = "bake tri.obj -o f.sf --face-px 4 --lattice cube:1x1 --shader-dir .";
        ended(&folder.command(line)).ended(4, &["project.comp: cannot be read"]);
    }
}

/// A pipe that the shell hands over on purpose has a writer, and an end.
#[test]
fn pipes_of_a_shell_are_read() {
    let folder = folder();
    for script in ["\"$0\" compare <(sleep 0.2; cat a.png) b.png", "cat a.png | \"$0\" compare /dev/stdin b.png"] {
        let mut bash = Command::new("bash");
        bash.current_dir(folder.path()).args(["-c", script, env!("CARGO_BIN_EXE_shadow-fields")]);
        ended(&bash).ended(0, &[]);
    }
}
