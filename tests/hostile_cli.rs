//! Names, numbers and surroundings that nobody means well: the program neither panics nor passes them to the terminal,
//! and ends with the exit code that the reason has.
#![cfg(unix)]

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{Ran, command, finish, good, has_device, names};
use shadow_fields::error::is_deceptive;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const SMALL: [&str; 4] = ["--lattice", "cube:2x3", "--face-px", "4"];

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.obj"), TRIANGLE).unwrap();
    folder
}

fn run(folder: &TempDir, arguments: &[&str]) -> Ran {
    finish(&mut command(folder.path(), arguments))
}

fn bake(folder: &TempDir, more: &[&str]) -> Command {
    command(folder.path(), &[&["bake", "m.obj"], &SMALL[..], more].concat())
}

/// No control or bidirectional character but the ends of lines.
fn assert_clean(text: &str) {
    assert!(text.chars().all(|c| c == '\n' || !is_deceptive(c)), "{text:?}");
}

#[test]
fn paths_are_bytes() {
    if !has_device() {
        return;
    }
    let folder = folder();
    let name = |text: &'static [u8]| OsStr::from_bytes(text);
    let ran = finish(bake(&folder, &["--json"]).arg("-o").arg(name(b"x\xff.sf")));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(folder.path().join(name(b"x\xff.sf")).is_file());

    std::fs::copy(folder.path().join("m.obj"), folder.path().join(name(b"m\xff.obj"))).unwrap();
    let mut other = Command::new(env!("CARGO_BIN_EXE_shadow-fields"));
    other.current_dir(folder.path()).arg("bake").arg(name(b"m\xff.obj")).args(SMALL).args(["-o", "y.sf", "--json"]);
    let ran = finish(other.arg("--cache-dir").arg(name(b"cache\xff")));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(folder.path().join("y.sf").is_file() && folder.path().join(name(b"cache\xff")).is_dir());

    let render = ["render", "sphere_over_plane", "--size", "8x8"];
    let mut picture = command(folder.path(), &SMALL);
    let ran = finish(picture.args(render).arg("-o").arg(name(b"p\xff.png")));
    assert_eq!(ran.code, 2, "options of a subcommand stand behind it: {}", ran.stderr);
    let ran = finish(command(folder.path(), &render).arg("-o").arg(name(b"p\xff.png")).args(SMALL));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(folder.path().join(name(b"p\xff.png")).is_file());
    let ran = finish(command(folder.path(), &render).arg("-o").arg(name(b"p\xff##.png")).args(SMALL));
    assert_eq!(ran.code, 2, "{}", ran.stderr);
}

#[test]
fn control_characters_do_not_reach_the_terminal() {
    let folder = folder();
    for (arguments, code) in [
        (&["bake", "a\u{1b}[31m\nb.obj", "-o", "f.sf"][..], 4),
        (&["bake", "m.obj", "-o", "a\u{1b}[31m\nb/f.sf"], 1),
        (&["bake", "m.obj", "-o", "a\u{1b}[31m\nb.txt"], 2),
        (&["inspect", "a\u{7}\r.sf"], 4),
        (&["bake", "a\u{2028}b\u{202e}c.obj", "-o", "f.sf"], 4),
        (&["bake", "m.obj", "-o", "a\u{2067}b\u{200f}.txt"], 2),
        (&["render", "\u{1b}]0;title\u{7}.toml", "-o", "p.png"], 4),
    ] {
        let ran = run(&folder, arguments);
        assert_clean(&ran.stderr);
        assert_eq!((ran.code, ran.stderr.lines().count()), (code, 1), "{}", ran.stderr);
    }
    for argument in ["--size=\u{1b}[31m9", "--\u{1b}[31mwhat", "\u{1b}[31m"] {
        let ran = run(&folder, &["render", "s.toml", "-o", "p.png", argument]);
        assert_clean(&ran.stderr);
        assert!(ran.code == 2 && ran.stderr.contains("\\u{1b}"), "{} {}", ran.code, ran.stderr);
    }
}

/// Results show names of files too, and are JSON where that is asked for.
#[test]
fn results_have_no_control_characters() {
    let folder = folder();
    let gltf = r#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [] }] }"#;
    std::fs::write(folder.path().join("m.gltf"), gltf).unwrap();
    let name = "a\u{202e}b\u{85}c.toml";
    let said = good(folder.path(), &["import", "m.gltf", "-o", name]).stdout;
    assert_clean(&said);
    let said = good(folder.path(), &["import", "m.gltf", "-o", name, "--json"]).stdout;
    assert_clean(&said);
    let report: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(report["file"], name);
}

#[test]
fn headers_of_pictures_do_not_reach_the_terminal() {
    let folder = folder();
    let scene = "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[environment]\nimage = { file = \"sky.hdr\" }\n";
    std::fs::write(folder.path().join("s.toml"), scene).unwrap();
    for header in [
        "#?RADIANCE\n\u{1b}[31mFORMAT=x\n\n",
        "#?RADIANCE\nFORMAT=\u{1b}[31mx\n\n",
        "#?RADIANCE\n\n-Y \u{1b}[31m +X 4\n",
    ] {
        std::fs::write(folder.path().join("sky.hdr"), header).unwrap();
        let ran = run(&folder, &["render", "s.toml", "-o", "p.png"]);
        assert_clean(&ran.stderr);
        assert_eq!((ran.code, ran.stderr.lines().count()), (4, 1), "{}", ran.stderr);
    }
}

#[test]
fn numbers_beyond_their_limits_are_usage() {
    let folder = folder();
    for (arguments, part) in [
        (&["render", "sphere_over_plane", "-o", "p.png", "--time", "1e300"][..], "1e9"),
        (&["render", "sphere_over_plane", "-o", "p.png", "--time", "-1.1e9"], "1e9"),
        (&["bake", "m.obj", "-o", "f.sf", "--lattice", "cube:2x3,outer=0.1"], "0.25 to 0.1"),
    ] {
        let ran = run(&folder, arguments);
        assert!(ran.code == 2 && ran.stderr.contains(part), "{arguments:?}: {} {}", ran.code, ran.stderr);
    }
}

#[test]
fn links_in_a_circle_are_no_output() {
    if !has_device() {
        return;
    }
    let folder = folder();
    symlink("two.sf", folder.path().join("one.sf")).unwrap();
    symlink("one.sf", folder.path().join("two.sf")).unwrap();
    let ran = finish(&mut bake(&folder, &["-o", "one.sf"]));
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(folder.path().join("one.sf").is_symlink());
    assert_eq!(names(folder.path()), ["m.obj", "one.sf", "two.sf"]);
}

#[test]
#[cfg(target_os = "linux")]
fn full_devices_are_told_alike() {
    if !has_device() {
        return;
    }
    let folder = folder();
    let render = ["render", "sphere_over_plane", "--size", "8x8", "-o", "/dev/full"];
    for mut command in [bake(&folder, &["-o", "/dev/full"]), command(folder.path(), &[&render[..], &SMALL].concat())] {
        let ran = finish(&mut command);
        assert!(ran.code == 1 && ran.stderr.contains("/dev/full: cannot be written: No space left"), "{}", ran.stderr);
    }
}

/// A write beyond the limit on file sizes raises a signal that would end the program without a word.
#[test]
fn a_limit_on_file_sizes_is_an_error() {
    if !has_device() {
        return;
    }
    let folder = folder();
    let program = bake(&folder, &["-o", "f.sf", "--no-cache"]);
    let mut limited = Command::new("sh");
    limited.current_dir(folder.path()).args(["-c", "ulimit -f 2; exec \"$@\"", "sh"]);
    let ran = finish(limited.arg(program.get_program()).args(program.get_args()));
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("f.sf: cannot be written: File too large"), "{}", ran.stderr);
    assert_eq!(names(folder.path()), ["m.obj"]);
}

/// What memory a picture takes is compared with what there is before anything is baked for it.
#[test]
#[cfg(target_os = "linux")]
fn a_picture_larger_than_memory_is_refused_with_numbers() {
    let folder = folder();
    // Four million KiB of address space: less than 20 bytes for each of 2^28 pixels.
    let limited = |arguments: &[&str]| {
        let mut limited = Command::new("sh");
        limited.current_dir(folder.path()).args(["-c", "ulimit -v 4000000; exec \"$@\"", "sh"]);
        finish(limited.arg(env!("CARGO_BIN_EXE_shadow-fields")).args(arguments).args(["--cache-dir", "cache"]))
    };
    if limited(&["devices"]).code != 0 {
        return common::skip("no device opens in 4 GB of addresses");
    }
    let ran = limited(&["render", "sphere_over_plane", "--size", "16384x16384", "-o", "p.png"]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    let line = ran.stderr.lines().last().unwrap();
    assert!(line.contains("a picture of 16384x16384 pixels takes ") && line.ends_with(" GB left"), "{line}");
    assert!(!folder.path().join("cache/fields").exists() && !folder.path().join("p.png").exists());
}

/// A shader of many bands takes long to compile: the terminal says so, unless it is to be left alone.
#[test]
fn a_terminal_is_told_what_is_compiled() {
    if !has_device() {
        return;
    }
    let terminal = |more: &str| {
        let folder = folder();
        let program = env!("CARGO_BIN_EXE_shadow-fields");
        let small = SMALL.join(" ");
        let line = format!(
            "'{program}' render sphere_over_plane -o p.png --size 8x8 --antialias none --variant storage --bands 5 {small} \
             --cache-dir cache {more}"
        );
        // `script` runs a command on a terminal of its own and prints what that shows.
        let mut script = Command::new("script");
        let ran = script.current_dir(folder.path()).env("TERM", "xterm").args(["-qec", &line, "/dev/null"]).output();
        ran.ok().map(|ran| (ran.status.success(), String::from_utf8_lossy(&ran.stdout).into_owned()))
    };
    let Some((good, shown)) = terminal("") else { return common::skip("no script (Debian's package is bsdutils)") };
    assert!(good && shown.contains("compiling shader merge.comp, "), "{shown}");
    for more in ["--quiet", "--no-progress"] {
        let (good, shown) = terminal(more).unwrap();
        assert!(good && !shown.contains("compiling"), "{shown}");
    }
}

/// What killed runs left is gone after the next run, in the folder of results and in the cache.
#[test]
fn leftovers_of_killed_runs_are_swept() {
    if !has_device() {
        return;
    }
    let folder = folder();
    let cache = folder.path().join("cache");
    let places = [folder.path().to_owned(), cache.clone(), cache.join("fields"), cache.join("spirv")];
    for place in &places {
        std::fs::create_dir_all(place).unwrap();
        std::fs::write(place.join(".unfinished-killed"), "half").unwrap();
    }
    let mut run = Command::new(env!("CARGO_BIN_EXE_shadow-fields"));
    run.current_dir(folder.path()).args(["bake", "m.obj", "-o", "f.sf", "--cache-dir", "cache"]).args(SMALL);
    let ran = finish(&mut run);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    for place in &places {
        let left = names(place).into_iter().filter(|name| name.starts_with(".unfinished-"));
        assert_eq!(left.collect::<Vec<_>>(), [""; 0], "{}", place.display());
    }
}

#[test]
fn a_broken_description_of_a_driver_is_no_driver() {
    let folder = folder();
    std::fs::write(folder.path().join("icd.json"), "{ \"ICD\": \u{1b}").unwrap();
    let mut devices = command(folder.path(), &["devices"]);
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        devices.env(variable, Path::new("icd.json"));
    }
    let ran = finish(devices.env_remove("VK_ADD_DRIVER_FILES"));
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let lines: Vec<&str> = ran.stderr.lines().collect();
    assert!(lines.iter().any(|line| line.contains("icd.json: ") && line.contains("JSON")), "{}", ran.stderr);
    assert_clean(&ran.stderr);
}
