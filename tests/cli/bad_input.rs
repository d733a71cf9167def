//! Bad input and usage: one line that names the file and line or the option, the exit code of README, no files left.

use crate::cli::{Folder, TRIANGLE, finish, has_device, without_drivers};
use std::time::{Duration, Instant};

const CAMERA: &str = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n";
const BALL: &str = "[[mesh]]\nname = \"ball\"\nsphere = { radius_m = 1, subdivisions = 1 }\n";
const RENDER: &str = "render s.toml -o p.png";
const BAKE: &str = "bake m.obj -o f.sf";
const TINY: &str = "--lattice cube:1x1 --face-px 4";

/// A folder with a scene of nothing but a camera and a mesh, and a triangle.
fn folder() -> Folder {
    Folder::of(&[("s.toml", &format!("{CAMERA}{BALL}")), ("m.obj", TRIANGLE)])
}

/// All that the readers refuse is in `tests/files/bad_input.rs`.
#[test]
fn meshes_scenes_and_fields() {
    let folder = Folder::new();
    folder.refused(BAKE, 4, &["m.obj: ", "o such file"]);
    let render = &format!("{RENDER} --exr p.exr --vertices v.csv --stats s.json");
    folder.refused(render, 4, &["s.toml: ", "o such file"]);
    folder.refused("render no_such_scene -o p.png", 4, &["no_such_scene: "]);
    folder.write("m.obj", TRIANGLE.replace("1 2 3", "1 2 4"));
    folder.refused(BAKE, 4, &["m.obj:4: ", "index 4 is out of range: the file has 3"]);
    // Through a scene: the scene's line and the mesh's own.
    folder.write("s.toml", format!("{CAMERA}[[mesh]]\nname = \"m\"\nfile = \"m.obj\"\n"));
    folder.refused(render, 4, &["s.toml:4: ", "m.obj:4: "]);
    std::fs::File::create(folder.at("m.obj")).unwrap().set_len(300 << 20).unwrap();
    folder.refused(BAKE, 4, &["m.obj: ", "limit of 256 MiB"]);
    folder.write("s.toml", format!("{CAMERA}\"a\\nb\" = 1\n"));
    folder.refused(render, 4, &["s.toml:4: ", "unknown field `a\\nb`"]);
    // Each byte of a field file is cut and flipped in `tests/files/field_file.rs`.
    folder.refused("inspect none.sf", 4, &["none.sf: ", "o such file"]);
    folder.write("d.sf", "not a field at all, but long enough to hold the first part of one");
    folder.refused("inspect d.sf --json", 4, &["d.sf: ", "not a field file"]);
}

#[test]
fn drivers_layers_and_devices() {
    let folder = folder();
    for line in [RENDER, "devices"] {
        let parts = ["no Vulkan driver", "mesa-vulkan-drivers", "/nowhere/no.json"];
        folder.refuses(without_drivers(&mut folder.command(line)), 3, &parts);
    }
    // What is to be timed is read before anything is measured.
    folder.refuses(without_drivers(&mut folder.command("profile gone.toml")), 4, &["gone.", "o such file"]);
    if !has_device() {
        return;
    }
    let layers = tempfile::tempdir().unwrap();
    let mut without = folder.command(&format!("{RENDER} --validation core"));
    without.env("VK_LAYER_PATH", layers.path()).env_remove("VK_ADD_LAYER_PATH");
    folder.refuses(&mut without, 3, &["validation layer", "vulkan-validationlayers"]);
    for name in ["Voodoo", "4000"] {
        let no_such = format!("no device matches \"{name}\"");
        folder.refused(&format!("{RENDER} --device {name}"), 3, &[&no_such, "available: 0 "]);
    }
}

/// Fields that the device cannot bind are refused with the numbers, before anything of their size is made.
#[test]
fn more_than_the_device_can_hold() {
    let Some(folder) = Folder::with_device() else { return };
    // What nobody sees, or what stands in no light, is not baked; nor are fields of things that rest beside one another.
    let light = "[environment]\nuniform = [1, 1, 1]\n";
    let two = "[[entity]]\nmesh = \"ball\"\n[[entity]]\nmesh = \"ball\"\nmotion = [{ spin = { period_s = 4 } }]\n";
    folder.write("s.toml", format!("{CAMERA}{light}{BALL}{two}"));
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
    let started = Instant::now();
    let options = shadow_fields::gpu::DeviceOptions::default();
    let limit: u64 = shadow_fields::gpu::Device::new(&options).unwrap().limits.max_storage_buffer_range.into();
    let refused = |line: &str, numbers: u64| {
        if numbers > limit {
            folder.refused(line, 4, &[&numbers.to_string(), &limit.to_string(), "--lattice"]);
        }
    };
    // Seven bands, four bytes, 4 million samples: 832 MB of an occlusion field, three times that of a radiance field.
    let huge = "--lattice cube:100x81 --bands 7 --storage f32";
    let bytes = 100 * 6 * 83 * 83 * 52 * 4_u64;
    // Fields in one buffer start at multiples of 256 bytes.
    refused(&format!("{RENDER} {huge}"), bytes.next_multiple_of(256));
    refused(&format!("{BAKE} --radiance 1,1,1 {huge}"), 3 * bytes);
    // Small enough as it is stored, too large in f32 while it is baked.
    refused(&format!("{BAKE} --lattice cube:100x81"), 100 * 6 * 81 * 81 * 64);
    // A picture beyond any device's memory or image size, or beyond what the host has left.
    if limit < 1 << 30 {
        folder.refused(&format!("{RENDER} --size 16384x16384 {TINY}"), 4, &["16384"]);
    }
    assert!(started.elapsed() < Duration::from_secs(30), "it was tried first: {:?}", started.elapsed());
}

/// Found late, or only a warning; what is found at the start is in `outputs.rs`.
#[test]
fn output_that_cannot_be_written() {
    let Some(folder) = Folder::with_device() else { return };
    folder.write("s.toml", format!("{CAMERA}{BALL}"));
    folder.write("file", "");
    std::fs::create_dir(folder.at("dir.png")).unwrap();
    folder.refused(&format!("render s.toml -o dir.png --size 8x8 {TINY}"), 1, &["dir.png: "]);
    folder.refused("demo -o file", 1, &["file: "]);
    // A cache that cannot be kept is a warning.
    let ran = finish(&mut folder.bare(&format!("{RENDER} --size 8x8 --cache-dir file/x {TINY}"))).ended(0, &[]);
    let lines: Vec<&str> = ran.stderr.lines().filter(|line| !line.starts_with("note: ")).collect();
    assert!(lines.len() == 1 && lines[0].contains("file/x"), "{}", ran.stderr);
}

/// Words that the command line does not know: exit code 2, the option and what it takes.
#[test]
fn usage() {
    let folder = folder();
    for (option, word, part) in [
        ("--variant", "fast", "texel-packed"),
        ("--size", "10", "1280x720"),
        ("--size", "0x10", "1280x720"),
        ("--size", "-1x10", "1280x720"),
        ("--lattice", "many", "cube:20x7"),
        ("--lattice", "cube:0x5", "at least 1"),
        ("--lattice", "cube:99999999x99999999", "4000000"),
        ("--lattice", "cube:4x5,inner=9,outer=2", "9"),
        ("--lattice", "cube:2x3,outer=0.1", "0.25 to 0.1"),
        ("--face-px", "2", "4..=1024"),
        ("--bands", "8", "2..=7"),
        ("--storage", "f8", "f16"),
        ("--frames", "0", "1..="),
        ("--validation", "some", "sync"),
        ("--eps", "-1", "expected a number from 0 to 1, got \"-1\""),
        ("--time", "nan", "expected a number from -1e9 to 1e9, got \"nan\""),
        ("--time", "-1.1e9", "1e9"),
        ("--environment", "moonlight", "expected daylight, studio, none or a picture"),
        ("--exposure", "33", "expected a number from -32 to 32, got \"33\""),
    ] {
        let ran = folder.run(&format!("{RENDER} {option}={word}"));
        assert_eq!(ran.code, 2, "{option} {word}: {}", ran.stderr);
        // Where a word is one of a few, they follow on a line of their own.
        let lines: Vec<&str> = ran.stderr.lines().take_while(|line| !line.is_empty()).collect();
        assert!(lines.len() <= 2, "{}", ran.stderr);
        assert!(lines[0].contains(option) && lines[0].contains(word), "{option} {word}: {}", ran.stderr);
        assert!(lines.concat().contains(part), "{option} {word}: no {part} in {}", ran.stderr);
    }
    for line in ["frobnicate", "", "render s.toml", "bake m.obj", "inspect"] {
        let ran = folder.run(line);
        assert!(ran.code == 2 && !ran.stderr.is_empty(), "{line}: {} {}", ran.code, ran.stderr);
    }
}

/// Values of other commands, and options without the one that they belong to: told before anything is done.
#[test]
fn usage_of_values_and_pairs() {
    let folder = folder();
    for (line, part) in [
        ("render s.toml -o p.png --error e.png --error-limit -1", "expected a number above 0, got \"-1\""),
        ("render s.toml -o p.png --error e.png --error-limit 0", "expected a number above 0"),
        ("render s.toml -o p.png --error e.png --reference", "cannot be used with"),
        ("render s.toml -o p.png --error-limit 1", "--error"),
        ("render s.toml -o p.png --rays 64", "--reference"),
        ("bake m.obj -o f.sf --radiance -1,2,3", "expected a number from 0 to 1e15, got \"-1\""),
        ("bake m.obj -o f.sf --radiance 1e38,1,1", "from 0 to 1e15"),
        ("inspect f.sf --at 1e300,0,0", "expected a number from -1e15 to 1e15"),
    ] {
        folder.run(line).ended(2, &[part]);
    }
    folder.refused(&format!("{RENDER} --environment no.hdr"), 4, &["no.hdr: ", "o such file"]);
    folder.write("text.exr", "no picture");
    folder.refused(&format!("{RENDER} --environment text.exr"), 4, &["text.exr: ", "environment image"]);
    folder.refused(&format!("{RENDER} --shader-dir none"), 4, &["none: ", "folder"]);
    std::fs::create_dir(folder.at("dir.sf")).unwrap();
    folder.refused("bake m.obj -o dir.sf", 1, &["dir.sf: ", "a folder"]);
    folder.refused("inspect dir.sf", 4, &["dir.sf: ", "Is a directory"]);
    if has_device() {
        folder.good(&format!("render sphere_over_plane -o p.png --size 8x8 --time -3 {TINY}"));
    }
}
