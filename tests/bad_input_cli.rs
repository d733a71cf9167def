//! Bad input through the program: one clear line on stderr that names the file (and the line), the exit code that
//! README lists, and nothing left behind.

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{command, finish, good, has_device, names};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

const CAMERA: &str = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n";
const BALL: &str = "[[mesh]]\nname = \"ball\"\nsphere = { radius_m = 1, subdivisions = 1 }\n";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A folder with the files that a case needs.
struct Case {
    _temporary: tempfile::TempDir,
    folder: PathBuf,
}

fn case(files: &[(&str, &str)]) -> Case {
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path().to_owned();
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap();
    }
    Case { _temporary: temporary, folder }
}

/// The command ends with `code` and, besides the note on a software device, one line with every one of `parts`; no file
/// comes or goes.
fn refused_command(folder: &Path, command: &mut Command, code: i32, parts: &[&str]) {
    let before = names(folder);
    let ran = finish(command);
    let lines: Vec<&str> = ran.stderr.lines().filter(|l| !l.starts_with("note: ")).collect();
    let [line] = lines[..] else { panic!("{} lines: {}", lines.len(), ran.stderr) };
    assert_eq!(ran.code, code, "{line}");
    assert_eq!(ran.stdout, "", "results are printed only where there are any");
    assert!(line.starts_with("shadow-fields: "), "{line}");
    for part in parts {
        assert!(line.contains(part), "no {part:?} in {line:?}");
    }
    assert_eq!(names(folder), before, "something is left behind");
}

fn refused(case: &Case, arguments: &[&str], code: i32, parts: &[&str]) {
    refused_command(&case.folder, &mut command(&case.folder, arguments), code, parts);
}

#[test]
fn meshes() {
    let bake = ["bake", "m.obj", "-o", "f.sf"];
    refused(&case(&[]), &bake, 4, &["m.obj: ", "o such file"]);
    for (text, parts) in [
        (format!("{TRIANGLE}f 1 2 4\n"), ["m.obj:4: ", "index 4 is out of range: the file has 3"]),
        ("v 0 0 0\nv 0 NaN 0\n".into(), ["m.obj:2: ", "\"NaN\" is not finite"]),
        (TRIANGLE.into(), ["m.obj: ", "no faces"]),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".into(), ["m.obj: ", "zero total area"]),
        ("\u{1}\u{2}\u{3}".into(), ["m.obj: ", "no faces"]),
    ] {
        refused(&case(&[("m.obj", &text)]), &bake, 4, &parts);
    }
    let large = case(&[]);
    std::fs::File::create(large.folder.join("m.obj")).unwrap().set_len(300 << 20).unwrap();
    refused(&large, &bake, 4, &["m.obj: ", "limit of 256 MiB"]);
    // Through a scene: the scene's line and the mesh's own.
    let files = [("s.toml", &*format!("{CAMERA}[[mesh]]\nname = \"m\"\nfile = \"m.obj\"\n")), ("m.obj", "v 0 0 x\n")];
    refused(&case(&files), &["render", "s.toml", "-o", "p.png"], 4, &["s.toml:4: ", "m.obj:1: ", "\"x\""]);
}

#[test]
fn scenes() {
    let render = ["render", "s.toml", "-o", "p.png", "--exr", "p.exr", "--vertices", "v.csv", "--stats", "s.json"];
    refused(&case(&[]), &render, 4, &["s.toml: ", "o such file"]);
    let entity = |line: &str| format!("{CAMERA}{BALL}[[entity]]\nmesh = \"ball\"\n{line}\n");
    for (text, parts) in [
        (format!("{CAMERA}[[mesh]]\nname = \"m\"\nfile = \"gone.obj\"\n"), ["s.toml:4: ", "gone.obj: "]),
        (format!("{CAMERA}{BALL}[[entity]]\nmesh = \"cube\"\n"), ["s.toml:7: ", "no mesh \"cube\""]),
        (entity("scale = -1"), ["s.toml:9: ", "uniform and positive"]),
        (entity("scale = [1, 2, 1]"), ["s.toml:9: ", "uniform and positive"]),
        (entity("colour = 1"), ["s.toml:9: ", "unknown field `colour`"]),
        ("this is no scene".into(), ["s.toml:1: ", ""]),
        (format!("{CAMERA}\"a\\nb\" = 1\n"), ["s.toml:4: ", "unknown field `a\\nb`"]),
    ] {
        refused(&case(&[("s.toml", &text)]), &render, 4, &parts);
    }
}

#[test]
fn field_files() {
    if !has_device() {
        return;
    }
    let case = case(&[("m.obj", &format!("{TRIANGLE}f 1 2 3\n"))]);
    good(&case.folder, &["bake", "m.obj", "-o", "f.sf", "--lattice", "cube:2x3", "--face-px", "8"]);
    let whole = std::fs::read(case.folder.join("f.sf")).unwrap();
    let damaged = |bytes: &[u8], parts: &[&str]| {
        std::fs::write(case.folder.join("d.sf"), bytes).unwrap();
        refused(&case, &["inspect", "d.sf", "--json", "--faces", "o.png"], 4, &[&["d.sf: "], parts].concat());
    };
    // tests/field_file.rs cuts and flips every byte; here a few, through the program.
    for length in [0, 1, 10, 40, 60, whole.len() / 2, whole.len() - 1] {
        damaged(&whole[..length], &[]);
    }
    damaged(&[&whole[..], b"!"].concat(), &["claims"]);
    for at in [0, 9, 20, 30, 60, 100, whole.len() / 2, whole.len() - 1] {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        damaged(&bytes, &[]);
    }
    damaged(b"not a field at all, but long enough to hold the first part of one", &["not a field file"]);
    // The version stands behind the magic; the number of samples in the header, whose hash is then wrong too: neither
    // is believed before it is checked, and nothing of that size is allocated.
    let mut bytes = whole.clone();
    bytes[8] = bytes[8].wrapping_add(1);
    damaged(&bytes, &["version"]);
    let text = String::from_utf8_lossy(&whole).into_owned();
    let shells = text.find("\"shells\":2").expect("the header is JSON");
    let mut bytes = whole[..shells].to_vec();
    bytes.extend(b"\"shells\":100000000");
    bytes.extend(&whole[shells + 10..]);
    damaged(&bytes, &[]);
    let missing = ["inspect", "none.sf"];
    refused(&case, &missing, 4, &["none.sf: ", "o such file"]);
}

#[test]
fn drivers_layers_and_devices() {
    let case = case(&[("s.toml", &format!("{CAMERA}{BALL}"))]);
    let render = ["render", "s.toml", "-o", "p.png"];
    for arguments in [&render[..], &["devices"]] {
        let mut without = command(&case.folder, arguments);
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            without.env(variable, "/nowhere/no.json");
        }
        without.env_remove("VK_ADD_DRIVER_FILES");
        refused_command(
            &case.folder,
            &mut without,
            3,
            &["no Vulkan driver", "mesa-vulkan-drivers", "/nowhere/no.json"],
        );
    }
    // What is to be timed is read before anything is measured.
    for arguments in [["profile", "gone.toml"], ["profile", "--bake=gone.obj"]] {
        let mut without = command(&case.folder, &arguments);
        without.env("VK_DRIVER_FILES", "/nowhere/no.json").env_remove("VK_ADD_DRIVER_FILES");
        refused_command(&case.folder, &mut without, 4, &["gone.", "o such file"]);
    }
    if !has_device() {
        return;
    }
    let layers = tempfile::tempdir().unwrap();
    let mut without = command(&case.folder, &[&render[..], &["--validation", "core"]].concat());
    without.env("VK_LAYER_PATH", layers.path()).env_remove("VK_ADD_LAYER_PATH");
    refused_command(&case.folder, &mut without, 3, &["validation layer", "vulkan-validationlayers"]);
    refused(
        &case,
        &[&render[..], &["--device", "Voodoo"]].concat(),
        3,
        &["no device matches \"Voodoo\"", "available: 0 "],
    );
    refused(&case, &[&render[..], &["--device", "4000"]].concat(), 3, &["no device matches \"4000\""]);
}

/// Fields that the device cannot bind are refused with the numbers, before anything of their size is made.
#[test]
fn more_than_the_device_can_hold() {
    if !has_device() {
        return;
    }
    // What nobody sees, or what stands in no light, is not baked.
    let light = "[environment]\nuniform = [1, 1, 1]\n";
    // Nor are fields of things that rest beside one another.
    let two = "[[entity]]\nmesh = \"ball\"\n[[entity]]\nmesh = \"ball\"\nmotion = [{ spin = { period_s = 4 } }]\n";
    let scene = format!("{CAMERA}{light}{BALL}{two}");
    let case =
        case(&[("s.toml", &scene), ("m.obj", &format!("{TRIANGLE}v 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"))]);
    // Seven bands, four bytes, 4 million samples: 832 MB of an occlusion field, three times that of a radiance field.
    let huge = ["--lattice", "cube:100x81", "--bands", "7", "--storage", "f32"];
    let started = Instant::now();
    let render = [&["render", "s.toml", "-o", "p.png"][..], &huge].concat();
    let bake = [&["bake", "m.obj", "-o", "f.sf", "--radiance", "1,1,1"][..], &huge].concat();
    let limit = storage_range();
    let bytes = |stored: u64| stored * 52 * 4;
    if bytes(100 * 6 * 83 * 83) > limit {
        // Fields in one buffer start at multiples of 256 bytes.
        let number = bytes(100 * 6 * 83 * 83).next_multiple_of(256).to_string();
        refused(&case, &render, 4, &["s.toml: ", &number, &limit.to_string(), "--lattice"]);
    }
    if 3 * bytes(100 * 6 * 83 * 83) > limit {
        let number = (3 * bytes(100 * 6 * 83 * 83)).to_string();
        refused(&case, &bake, 4, &["m.obj: ", &number, &limit.to_string(), "--lattice"]);
    }
    // Small enough as it is stored, too large in f32 while it is baked.
    if 100 * 6 * 81 * 81 * 64 > limit {
        let half = ["bake", "m.obj", "-o", "f.sf", "--lattice", "cube:100x81"];
        refused(&case, &half, 4, &["m.obj: ", "251942400", &limit.to_string(), "--lattice"]);
    }
    // A picture beyond any device's memory or image size, or beyond what the host has left.
    let small = ["--lattice", "cube:1x1", "--face-px", "4"];
    let wide = [&["render", "s.toml", "-o", "p.png", "--size", "16384x16384"][..], &small].concat();
    if limit < 1 << 30 {
        refused(&case, &wide, 4, &["16384"]);
    }
    assert!(started.elapsed() < Duration::from_secs(30), "it was tried first: {:?}", started.elapsed());
}

fn storage_range() -> u64 {
    let options = shadow_fields::gpu::DeviceOptions::default();
    shadow_fields::gpu::Device::new(&options).unwrap().limits.max_storage_buffer_range.into()
}

#[test]
fn output_that_cannot_be_written() {
    let files = [("s.toml", &*format!("{CAMERA}{BALL}")), ("m.obj", &*format!("{TRIANGLE}f 1 2 3\n")), ("file", "")];
    let case = case(&files);
    let small = ["--lattice", "cube:1x1", "--face-px", "4"];
    // Told before a device is opened.
    for (option, output) in [("--exr", "no/such/p.exr"), ("--vertices", "no/such/v.csv"), ("--stats", "no/such/s.json")]
    {
        let render = ["render", "s.toml", "-o", "p.png", option, output];
        refused(&case, &[&render[..], &small].concat(), 1, &[output, "no folder no/such"]);
    }
    for output in ["no/p.png", "file/p.png", "no/p_##.png"] {
        let render = ["render", "s.toml", "-o", output];
        refused(&case, &[&render[..], &small].concat(), 1, &[&output[..4], "no folder "]);
    }
    refused(&case, &[&["bake", "m.obj", "-o", "no/f.sf"][..], &small].concat(), 1, &["no/f.sf: ", "no folder no"]);
    if !has_device() {
        return;
    }
    std::fs::create_dir(case.folder.join("dir.png")).unwrap();
    let render = ["render", "s.toml", "-o", "dir.png", "--size", "8x8"];
    refused(&case, &[&render[..], &small].concat(), 1, &["dir.png: "]);
    refused(&case, &["demo", "-o", "file"], 1, &["file: "]);
    // A cache that cannot be kept is a warning.
    let mut uncached = Command::new(env!("CARGO_BIN_EXE_shadow-fields"));
    uncached.current_dir(&case.folder).args([
        "render",
        "s.toml",
        "-o",
        "p.png",
        "--size",
        "8x8",
        "--cache-dir",
        "file/x",
    ]);
    let ran = finish(uncached.args(small));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let warnings = ran.stderr.lines().filter(|l| l.contains("file/x")).count();
    let others = ran.stderr.lines().filter(|l| !l.starts_with("note: ")).count();
    assert!(warnings == 1 && others == 1, "{}", ran.stderr);
}

/// Words that the command line does not know: exit code 2, the option and what it takes.
#[test]
fn usage() {
    let case = case(&[("s.toml", &format!("{CAMERA}{BALL}"))]);
    let render = ["render", "s.toml", "-o", "p.png"];
    for (option, word, part) in [
        ("--variant", "fast", "texel-packed"),
        ("--size", "10", "1280x720"),
        ("--size", "0x10", "1280x720"),
        ("--size", "-1x10", "1280x720"),
        ("--lattice", "many", "cube:20x7"),
        ("--lattice", "cube:0x5", "at least 1"),
        ("--lattice", "cube:99999999x99999999", "4000000"),
        ("--lattice", "cube:4x5,inner=9,outer=2", "9"),
        ("--face-px", "2", "4..=1024"),
        ("--bands", "8", "2..=7"),
        ("--storage", "f8", "f16"),
        ("--frames", "0", "1..="),
        ("--validation", "some", "sync"),
    ] {
        let ran = finish(&mut command(&case.folder, &[&render[..], &[&format!("{option}={word}")]].concat()));
        assert_eq!(ran.code, 2, "{option} {word}: {}", ran.stderr);
        // Where a word is one of a few, they follow on a line of their own.
        let lines: Vec<&str> = ran.stderr.lines().take_while(|line| !line.is_empty()).collect();
        assert!(lines.len() <= 2, "{}", ran.stderr);
        for part in [option, word] {
            assert!(lines[0].contains(part), "{option} {word}: no {part} in {}", ran.stderr);
        }
        assert!(lines.concat().contains(part), "{option} {word}: no {part} in {}", ran.stderr);
    }
    for arguments in [&["frobnicate"][..], &[], &["render", "s.toml"], &["bake", "m.obj"], &["inspect"]] {
        let ran = finish(&mut command(&case.folder, arguments));
        assert!(ran.code == 2 && !ran.stderr.is_empty(), "{arguments:?}: {} {}", ran.code, ran.stderr);
    }
    refused(&case, &["render", "s.toml", "-o", "p.jpg"], 2, &["p.jpg", ".png"]);
    refused(&case, &[&render[..], &["--shader-dir", "none"]].concat(), 4, &["none: ", "folder"]);
}

/// Numbers out of range, endings and options without the one that they belong to: told before anything is done.
#[test]
fn usage_of_values_and_pairs() {
    let case = case(&[("s.toml", &format!("{CAMERA}{BALL}")), ("m.obj", &format!("{TRIANGLE}f 1 2 3\n"))]);
    std::fs::create_dir(case.folder.join("dir.sf")).unwrap();
    let render = ["render", "s.toml", "-o", "p.png"];
    let bake = ["bake", "m.obj", "-o", "f.sf"];
    for (start, more, part) in [
        (&render[..], &["--eps", "-1"][..], "expected a number from 0 to 1, got \"-1\""),
        (&render, &["--error", "e.png", "--error-limit", "-1"], "expected a number above 0, got \"-1\""),
        (&render, &["--time", "nan"], "expected a number from -1e9 to 1e9, got \"nan\""),
        (&render, &["--rays", "64"], "--reference"),
        (&render, &["--environment", "moonlight"], "expected daylight, studio, none or a picture"),
        (&render, &["--exposure", "33"], "expected a number from -32 to 32, got \"33\""),
        (&render, &["--error-scheme", "absolute"], "--error"),
        (&render, &["--error-limit", "1"], "--error"),
        (&bake, &["--radiance", "-1,2,3"], "expected a number from 0 to 1e15, got \"-1\""),
        (&bake, &["--radiance", "1e38,1,1"], "from 0 to 1e15"),
        (&["inspect", "f.sf"], &["--at", "1e300,0,0"], "expected a number from -1e15 to 1e15"),
    ] {
        let ran = finish(&mut command(&case.folder, &[start, more].concat()));
        assert!(ran.code == 2 && ran.stderr.contains(part), "{more:?}: {} {}", ran.code, ran.stderr);
    }
    refused(&case, &[&render[..], &["--environment", "no.hdr"]].concat(), 4, &["no.hdr: ", "o such file"]);
    std::fs::write(case.folder.join("text.exr"), "no picture").unwrap();
    refused(
        &case,
        &[&render[..], &["--environment", "text.exr"]].concat(),
        4,
        &["", "text.exr: ", "environment image"],
    );
    refused(&case, &["bake", "m.obj", "-o", "f.png"], 2, &["f.png: ", ".sf"]);
    refused(&case, &["bake", "m.obj", "-o", "dir.sf"], 1, &["dir.sf: ", "a folder"]);
    refused(&case, &["inspect", "f.sf", "--faces", "f.jpg"], 2, &["f.jpg: ", ".png"]);
    refused(&case, &["inspect", "dir.sf"], 4, &["dir.sf: ", "Is a directory"]);
}

/// A name that a built-in scene has not is a missing file; a full disk under the results is told.
#[test]
fn names_and_results() {
    let case = case(&[
        ("m.obj", &format!("{TRIANGLE}f 1 2 3\n")),
        ("n.obj", &format!("{TRIANGLE}v 0 0 2\nf 1 2 3\nf 1 2 4\n")),
        ("dark.toml", &format!("{CAMERA}[environment]\nuniform = [1e38, 1, 1]\nstrength = 1e38\n")),
    ]);
    refused(&case, &["render", "dark.toml", "-o", "p.png"], 4, &["dark.toml:4: ", "1e38", "1e15"]);
    refused(&case, &["render", "no_such_scene", "-o", "p.png"], 4, &["no_such_scene: "]);
    if !has_device() {
        return;
    }
    let small = ["--lattice", "cube:1x1", "--face-px", "4"];
    let picture = ["render", "sphere_over_plane", "-o", "p.png", "--size", "8x8", "--time", "-3"];
    good(&case.folder, &[&picture[..], &small].concat());
    good(&case.folder, &[&["bake", "m.obj", "-o", "f.sf"][..], &small].concat());
    let other = ["inspect", "f.sf", "--faces", "o.png", "--mesh", "n.obj"];
    refused(&case, &other, 4, &["n.obj: ", "not the mesh m "]);
    good(&case.folder, &[&["bake", "m.obj", "-o", "r.sf", "--radiance", "1,2,3"][..], &small].concat());
    refused(&case, &["inspect", "r.sf", "--faces", "o.png", "--mesh", "n.obj"], 4, &["n.obj: "]);
    // The same triangles, but not the colour that was baked.
    let same = ["inspect", "r.sf", "--faces", "o.png", "--mesh", "m.obj"];
    refused(&case, &same, 4, &["m.obj: ", "--radiance"]);
    good(&case.folder, &[&same[..], &["--radiance", "1,2,3"]].concat());
    refused(
        &case,
        &["inspect", "f.sf", "--faces", "o.png", "--mesh", "m.obj", "--radiance", "1,2,3"],
        2,
        &["occlusion"],
    );
    #[cfg(target_os = "linux")]
    {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut devices = command(&case.folder, &["devices"]);
        let ran =
            devices.stdout(full).stderr(std::process::Stdio::piped()).spawn().unwrap().wait_with_output().unwrap();
        let text = String::from_utf8(ran.stderr).unwrap();
        assert_eq!(ran.status.code(), Some(1), "{text}");
        assert!(text.lines().count() == 1 && text.starts_with("shadow-fields: stdout: "), "{text}");
        let proc = [&["render", "sphere_over_plane", "-o", "/proc/x.png", "--size", "8x8"][..], &small].concat();
        let ran = finish(&mut command(&case.folder, &proc));
        assert!(ran.code == 1 && !ran.stderr.contains("unfinished"), "{}", ran.stderr);
    }
}
