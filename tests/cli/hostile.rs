//! Names, numbers and surroundings that nobody means well: no panic, nothing raw on the terminal, the right exit code.
#![cfg(unix)]

use crate::cli::{COARSE, Folder, TRIANGLE, finish, has_device, limited, without_drivers};
use crate::common;
use shadow_fields::error::is_deceptive;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::process::Command;

const BAKE: &str = "bake m.obj --lattice cube:2x3 --face-px 4";
const RENDER: &str = "render sphere_over_plane --size 8x8 --lattice cube:2x3 --face-px 4";

fn folder() -> Folder {
    Folder::of(&[("m.obj", TRIANGLE)])
}

/// No control or bidirectional character but the ends of lines.
fn assert_clean(text: &str) {
    assert!(text.chars().all(|c| c == '\n' || !is_deceptive(c)), "{text:?}");
}

#[test]
fn paths_are_bytes() {
    let Some(folder) = has_device().then(folder) else { return };
    let name = |text: &'static [u8]| OsStr::from_bytes(text);
    let ends = |command: &mut Command, code: i32, made: &[&'static [u8]]| {
        finish(command).ended(code, &[]);
        assert!(made.iter().all(|made| folder.path().join(name(made)).exists()), "{command:?}");
    };
    ends(folder.command(BAKE).arg("-o").arg(name(b"x\xff.sf")), 0, &[b"x\xff.sf"]);
    std::fs::copy(folder.at("m.obj"), folder.path().join(name(b"m\xff.obj"))).unwrap();
    let mut other = folder.bare("bake -o y.sf");
    other.args(COARSE.split(' ')).arg(name(b"m\xff.obj")).arg("--cache-dir").arg(name(b"cache\xff"));
    ends(&mut other, 0, &[b"y.sf", b"cache\xff"]);
    ends(folder.command(RENDER).arg("-o").arg(name(b"p\xff.png")), 0, &[b"p\xff.png"]);
    ends(folder.command(RENDER).arg("-o").arg(name(b"p\xff##.png")), 2, &[]);
    ends(&mut folder.command("--face-px 4 render sphere_over_plane -o p.png"), 2, &[]);
}

#[test]
fn control_characters_do_not_reach_the_terminal() {
    let folder = folder();
    for (line, code) in [
        ("bake a\u{1b}[31m\nb.obj -o f.sf", 4),
        ("bake m.obj -o a\u{1b}[31m\nb/f.sf", 1),
        ("bake m.obj -o a\u{1b}[31m\nb.txt", 2),
        ("inspect a\u{7}\r.sf", 4),
        ("bake a\u{2028}b\u{202e}c.obj -o f.sf", 4),
        ("bake m.obj -o a\u{2067}b\u{200f}.txt", 2),
        ("render \u{1b}]0;title\u{7}.toml -o p.png", 4),
    ] {
        let ran = folder.run(line);
        assert_clean(&ran.stderr);
        assert_eq!((ran.code, ran.stderr.lines().count()), (code, 1), "{}", ran.stderr);
    }
    for argument in ["--size=\u{1b}[31m9", "--\u{1b}[31mwhat", "\u{1b}[31m"] {
        let ran = folder.run(&format!("render s.toml -o p.png {argument}")).ended(2, &["\\u{1b}"]);
        assert_clean(&ran.stderr);
    }
    // Headers of pictures.
    let scene = "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[environment]\nimage = { file = \"sky.hdr\" }\n";
    folder.write("s.toml", scene);
    for header in [
        "#?RADIANCE\n\u{1b}[31mFORMAT=x\n\n",
        "#?RADIANCE\nFORMAT=\u{1b}[31mx\n\n",
        "#?RADIANCE\n\n-Y \u{1b}[31m +X 4\n",
    ] {
        folder.write("sky.hdr", header);
        let ran = folder.run("render s.toml -o p.png");
        assert_clean(&ran.stderr);
        assert_eq!((ran.code, ran.stderr.lines().count()), (4, 1), "{}", ran.stderr);
    }
    // Files of other programs.
    folder.write("s.blend", "BLENDER-v300\0\0");
    let kinds = "s.blend: scenes are .toml, .glb, .gltf or .obj files: export it as one of these\n";
    let ran = folder.run("render s.blend -o p.png").ended(4, &[]);
    assert!(ran.stderr.ends_with(kinds), "{}", ran.stderr);
    // Results show names of files too, and are JSON where that is asked for.
    folder.write("m.gltf", r#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [] }] }"#);
    let name = "a\u{202e}b\u{85}c.toml";
    assert_clean(&folder.good(&format!("import m.gltf -o {name}")).stdout);
    let said = folder.good(&format!("import m.gltf -o {name} --json")).stdout;
    assert_clean(&said);
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(report["file"], name);
}

#[test]
#[cfg(target_os = "linux")]
fn full_devices_are_told_alike() {
    let Some(folder) = has_device().then(folder) else { return };
    for command in [BAKE, RENDER] {
        let full = ["/dev/full: cannot be written: No space left"];
        folder.run(&format!("{command} -o /dev/full")).ended(1, &full);
    }
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut devices = folder.command("devices");
    let ran = devices.stdout(full).stderr(std::process::Stdio::piped()).spawn().unwrap().wait_with_output().unwrap();
    let text = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(1), "{text}");
    assert!(text.lines().count() == 1 && text.starts_with("shadow-fields: stdout: "), "{text}");
    let ran = folder.run(&format!("{RENDER} -o /proc/x.png"));
    assert!(ran.code == 1 && !ran.stderr.contains("unfinished"), "{}", ran.stderr);
}

/// What memory a picture takes is compared with what there is before anything is baked for it.
#[test]
#[cfg(target_os = "linux")]
fn a_picture_larger_than_memory_is_refused_with_numbers() {
    let folder = folder();
    // Four million KiB of address space: less than 20 bytes for each of 2^28 pixels.
    let cramped =
        |line: &str| finish(&mut limited(&folder.bare(&format!("{line} --cache-dir cache")), "ulimit -v 4000000"));
    if cramped("devices").code != 0 {
        return common::skip("no device opens in 4 GB of addresses");
    }
    let ran = cramped("render sphere_over_plane --size 16384x16384 -o p.png").ended(4, &[]);
    let line = ran.stderr.lines().last().unwrap();
    assert!(line.contains("a picture of 16384x16384 pixels takes ") && line.ends_with(" GB left"), "{line}");
    assert!(!folder.at("cache/fields").exists() && !folder.at("p.png").exists());
}

#[test]
fn a_broken_description_of_a_driver_is_no_driver() {
    let folder = Folder::of(&[("icd.json", "{ \"ICD\": \u{1b}")]);
    let mut devices = folder.command("devices");
    without_drivers(&mut devices).env("VK_DRIVER_FILES", "icd.json").env("VK_ICD_FILENAMES", "icd.json");
    let ran = finish(&mut devices).ended(3, &["no Vulkan driver found", "is icd.json"]);
    assert_clean(&ran.stderr);
}
