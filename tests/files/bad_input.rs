//! Bad meshes and scenes: each is refused with exit code 4 and one line that names the file and the line to look at.

use shadow_fields::asset::{Mesh, obj};
use shadow_fields::scene::Scene;
use shadow_fields::{Error, Result};
use std::path::Path;

fn refused<T>(result: Result<T>, start: &str, part: &str) {
    let Err(error) = result else { panic!("not refused: {start} {part}") };
    assert_eq!(error.exit_code(), 4, "{error}");
    let message = error.to_string();
    assert!(message.starts_with(start), "{message:?} does not start with {start:?}");
    assert!(message.contains(part), "{message:?} does not say {part:?}");
    assert!(!message.contains('\n'), "{message:?} has several lines");
}

#[test]
fn meshes() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    // text, line, part of the message
    let table: &[(String, usize, &str)] = &[
        (String::new(), 0, "no faces"),
        ("# nothing\n".into(), 0, "no faces"),
        (square.into(), 0, "no faces"),
        (format!("{square}f 1 2 5\n"), 5, "position index 5 is out of range: the file has 4"),
        (format!("{square}f 1 2 0\n"), 5, "index 0 is out of range"),
        (format!("{square}f -1 -2 -5\n"), 5, "index -5 is out of range"),
        (format!("f -1 -2 -3\n{square}"), 1, "index -1 is out of range"),
        (format!("{square}f 1 2 99999999999999999999\n"), 5, "malformed position index"),
        (format!("{square}f 1 2 9223372036854775807\n"), 5, "out of range"),
        (format!("{square}f 1 2 -9223372036854775808\n"), 5, "out of range"),
        (format!("{square}f 1//1 2//1 3//1\n"), 5, "normal index 1 is out of range: the file has 0"),
        (format!("{square}f 1 2 x\n"), 5, "malformed position index \"x\""),
        (format!("{square}f 1/1/1/1 2 3\n"), 5, "malformed corner"),
        (format!("{square}f 1 2\n"), 5, "at least three corners, not 2"),
        (format!("{square}f\n"), 5, "at least three corners, not 0"),
        ("v 0 0 nan\n".into(), 1, "\"nan\" is not finite"),
        ("v 0 0 0\nv 0 inf 0\n".into(), 2, "\"inf\" is not finite"),
        ("v 0 0 0\nv 0 1e39 0\n".into(), 2, "\"1e39\" is not finite"),
        ("v 0 2e7 0\n".into(), 1, "beyond the limit of 1e7 m"),
        ("v 0 0\n".into(), 1, "three numbers"),
        ("v 0 0 zero\n".into(), 1, "malformed number \"zero\""),
        ("v 0 0 0 1 1\n".into(), 1, "3, 4 or 6 numbers, not 5"),
        ("v 0 0 0 0\n".into(), 1, "weight 0"),
        ("v 0 0 0 1 1 1\nv 0 0 0\n".into(), 2, "some have none"),
        ("v 0 0 0\nv 0 0 0 1 1 1\n".into(), 2, "some have none"),
        ("v 0 0 0 1 -1 1\n".into(), 1, "negative"),
        ("vn 0 1\n".into(), 1, "a normal has 3 numbers"),
        ("vn 0 1 NaN\n".into(), 1, "not finite"),
        ("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n".into(), 0, "three different corners"),
        ("v 1 1 1\nf 1 1 1\n".into(), 0, "three different corners"),
        ("v 0 0 0\nv 1e-12 0 0\nv 0 1e-12 0\nf 1 2 3\n".into(), 0, "zero radius"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".into(), 0, "zero total area"),
    ];
    for (text, line, part) in table {
        let start = if *line == 0 { "dir/bad.obj: ".to_owned() } else { format!("dir/bad.obj:{line}: ") };
        refused(Mesh::parse(text.as_bytes(), Path::new("dir/bad.obj")), &start, part);
    }
    refused(Mesh::parse(b"v 0 0 0\n# \xff\n", Path::new("b.obj")), "b.obj:2: ", "UTF-8");
    refused(Mesh::load(Path::new("no/such.obj")), "no/such.obj: ", "o such file");
    refused(Mesh::load(Path::new(".")), ".: ", "directory");
}

#[test]
fn mesh_limits() {
    // A triangle fan of one face: 4 000 002 corners are 4 000 000 triangles, one more is too many.
    let mut text = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3");
    text.extend(std::iter::repeat_n(" 3", 3_999_999));
    assert!(Mesh::parse(text.as_bytes(), Path::new("fan.obj")).is_ok());
    text += " 3";
    refused(Mesh::parse(text.as_bytes(), Path::new("fan.obj")), "fan.obj:4: ", "limit of 4000000 triangles");
    let folder = tempfile::tempdir().unwrap();
    let big = folder.path().join("big.obj");
    std::fs::File::create(&big).unwrap().set_len(obj::FILE_LIMIT_BYTES + 1).unwrap();
    refused(Mesh::load(&big), big.to_str().unwrap(), "limit of 256 MiB");
}

const HEAD: &str = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n";
const MESH: &str = "[[mesh]]\nname = \"m\"\nsphere = { radius_m = 1, subdivisions = 1 }\n";

fn scene(text: &str) -> Result<Scene> {
    let read = |path: &Path| match path.to_str() {
        Some("dir/bad.obj") => Ok(b"v 0 0 0\nf 1 2 3\n".to_vec()),
        Some("dir/bad.png") => Ok(b"\x89PNG\r\n\x1a\nnot really".to_vec()),
        _ => Err(Error::input(path, "no such file")),
    };
    Scene::parse(text, Path::new("dir/s.toml"), &read)
}

#[test]
fn scene_file() {
    let table: &[(&str, usize, &str)] = &[
        ("", 1, "missing field `camera`"),
        ("[camera\n", 1, ""),
        ("x = 1\n", 1, "unknown field `x`"),
        ("[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\nfov = 40\n", 4, "unknown field `fov`"),
        ("[camera]\neye = [0, 1]\ntarget = [0, 0, 0]\n", 2, "3 numbers, not 2"),
        ("[camera]\neye = [0, 1, 2, 3]\ntarget = [0, 0, 0]\n", 2, "3 numbers, not 4"),
        ("[camera]\neye = [0, 1, nan]\ntarget = [0, 0, 0]\n", 2, "out of range"),
        ("[camera]\neye = [0, 0, 0]\ntarget = [0, 0, 0]\n", 1, "the same"),
        ("[camera]\neye = [0, 1, 0]\ntarget = [0, 0, 0]\nfov_deg = 180\n", 1, "180 is not within"),
        ("# a comment\n[camera]\neye = \"up\"\ntarget = [0, 0, 0]\n", 3, "invalid type"),
    ];
    for (text, line, part) in table {
        refused(scene(text), &format!("dir/s.toml:{line}: "), part);
    }
    refused(scene(&format!("{HEAD}[output]\nwidth = 0\n")), "dir/s.toml:4: ", "0 x 640 pixels");
    refused(scene(&format!("{HEAD}[output]\nexposure_ev = inf\n")), "dir/s.toml:4: ", "exposure_ev inf");
    refused(scene(&format!("{HEAD}[output]\ntime_s = nan\n")), "dir/s.toml:5: ", "not finite");
    refused(scene(&format!("{HEAD}[output]\ntime_s = \"now\"\n")), "dir/s.toml:5: ", "invalid type");
    refused(Scene::load(Path::new("no/such.toml")), "no/such.toml: ", "o such file");
}

#[test]
fn scene_entities() {
    let table = [
        ("scale = 0", "uniform and positive"),
        ("scale = -1.0", "uniform and positive"),
        ("scale = nan", "uniform and positive"),
        ("scale = inf", "uniform and positive"),
        ("scale = 1e8", "uniform and positive"),
        ("scale = 1e-8", "uniform and positive"),
        ("scale = [1, 2, 1]", "uniform and positive"),
        ("scale = \"big\"", "uniform and positive"),
        ("position = [1e8, 0, 0]", "1e7 m"),
        ("position = [0, 0, inf]", "out of range"),
        ("position = [0, 0, \"x\"]", "invalid type"),
        ("albedo = [0.5, 0.5, 1.5]", "0 to 1"),
        ("albedo = [-0.1, 0.5, 0.5]", "0 to 1"),
        ("emission = [-1, 0, 0]", "radiance"),
        ("emission = [nan, 0, 0]", "radiance"),
        ("emission = [1e16, 0, 0]", "radiance"),
        ("rotation = { axis = [0, 0, 0], angle_deg = 10 }", "a rotation is"),
        ("rotation = { axis = [0, 1, 0] }", "a rotation is"),
        ("rotation = { quaternion = [0, 0, 0, 0] }", "a rotation is"),
        ("rotation = { quaternion = [0, 0, 1] }", "a rotation is"),
        ("rotation = { axis = [0, 1, 0], angle_deg = 10, quaternion = [0, 0, 0, 1] }", "a rotation is"),
        ("rotation = [0, 0, 0]", "invalid type"),
        ("spot = { inner_deg = 30, outer_deg = 20 }", "of a spot are not 0 <= inner <= outer <= 90"),
        ("spot = { outer_deg = 91 }", "of a spot are not"),
        ("spot = { outer_deg = 0 }", "of a spot are not"),
        ("spot = { inner_deg = -1, outer_deg = 9 }", "of a spot are not"),
        ("emits = 1", "invalid type"),
        ("colour = [1, 1, 1]", "unknown field `colour`"),
        ("motion = [{ orbit = { centre = [0, 0, 0], period_s = 0 } }]", "too short"),
        ("motion = [{ spin = { axis = [0, 0, 0], period_s = 1 } }]", "no length"),
        ("motion = [{ spin = { period_s = inf } }]", "not finite"),
        ("motion = [{ spin = { period_s = 1, speed = 2 } }]", "speed"),
        ("motion = [{ jump = { } }]", "unknown variant `jump`"),
        ("motion = [{ keyframes = { keys = [] } }]", "at least one key"),
        ("motion = [{ keyframes = { keys = [{ time_s = 1 }, { time_s = 1 }] } }]", "increase: key 2 of 2 is at 1 s"),
        ("motion = [{ keyframes = { keys = [{ time_s = nan }] } }]", "not finite"),
        ("motion = [{ keyframes = { keys = [{ time_s = 1, scale = 0 }] } }]", "uniform and positive"),
        ("motion = [{ keyframes = { keys = [{ time_s = 1, at = 0 }] } }]", "at"),
        ("motion = [{ keyframes = { interpolation = \"bezier\", keys = [] } }]", "unknown variant `bezier`"),
        ("motion = [{ keyframes = { interpolation = 3, keys = [{ time_s = 1 }] } }]", ""),
    ];
    for (line, part) in table {
        // The entity's table begins in line 7; the line to blame is the ninth.
        let text = format!("{HEAD}{MESH}[[entity]]\nmesh = \"m\"\n{line}\n");
        refused(scene(&text), "dir/s.toml:9: ", part);
    }
    // In a table of its own the line is the key's, too.
    let long = format!(
        "{HEAD}{MESH}[[entity]]\nmesh = \"m\"\n[[entity.motion]]\n[entity.motion.keyframes]\ninterpolation = \"x\"\nkeys = []\n"
    );
    refused(scene(&long), "dir/s.toml:", "unknown variant `x`");
    refused(scene(&format!("{HEAD}{MESH}\n[[entity]]\nmesh = \"n\"\n")), "dir/s.toml:8: ", "there is no mesh \"n\"");
    refused(scene(&format!("{HEAD}{MESH}[[entity]]\nname = \"x\"\n")), "dir/s.toml:7: ", "missing field `mesh`");
    let many = format!("{HEAD}{MESH}{}", "[[entity]]\nmesh = \"m\"\n".repeat(4097));
    refused(scene(&many), "dir/s.toml: ", "limit of 4096");
}

#[test]
fn scene_meshes_and_environment() {
    let table = [
        ("[[mesh]]\nname = \"m\"\n", "either a file or one generator"),
        ("[[mesh]]\nname = \"m\"\nfile = \"x.obj\"\ndisc = { radius_m = 1 }\n", "either a file or one generator"),
        ("[[mesh]]\nname = \"m\"\nplain = { size_m = 1, cells = 1 }\n", "unknown variant `plain`"),
        ("[[mesh]]\nname = \"m\"\nplane = { size_m = 1, cells = 1, extra = 1 }\n", "unknown field `extra`"),
        ("[[mesh]]\nname = \"m\"\nplane = { size_m = 1, cells = -1 }\n", "invalid value"),
        ("[[mesh]]\nname = \"m\"\nplane = { size_m = 1, cells = 100000 }\n", "limit of 4000000"),
        ("[[mesh]]\nname = \"m\"\nplane = { size_m = inf, cells = 1 }\n", "a length is not within"),
        ("[[mesh]]\nname = \"m\"\ncuboid = { size_m = [1e-7, 1e-7, 5e6], cells = 1 }\n", "lengths differ by more than"),
        ("[[mesh]]\nname = \"m\"\ncuboid = { size_m = [1, 1], cells = 1 }\n", "invalid length 2"),
        ("[[mesh]]\nname = \"m\"\nfile = \"none.obj\"\n", "none.obj: no such file"),
        ("[[mesh]]\nname = \"m\"\nfile = \"bad.obj\"\n", "bad.obj:2: position index 2 is out of range"),
        ("[environment]\nuniform = [-1, 0, 0]\n", "environment uniform -1"),
        ("[environment]\ngradient = { radiance = [1, 1, nan] }\n", "environment gradient NaN"),
        ("[environment]\nkey = { radiance = [1, 1, 1], toward = [0, 0, 0], sharpness = 1 }\n", "no direction"),
        ("[environment]\nkey = { radiance = [1, 1, 1], toward = [0, 1, 0], sharpness = 1e6 }\n", "limit of 1e5"),
        ("[environment]\nstrength = -1\n", "environment strength -1"),
        ("[environment]\nstrength = inf\n", "environment strength inf"),
        ("[environment]\nstrength = 1e38\n", "environment strength 1e38 is not within 0 to 1e15"),
        ("[environment]\nuniform = [1, 1e16, 1]\n", "environment uniform 1e16 is not within 0 to 1e15"),
        ("[environment]\nuniform = [1, 1e15, 1]\nstrength = 2\n", "uniform times strength 2 is over the limit of 1e15"),
        ("[environment]\ngradient = { radiance = [1, 1, 1e15], rise = 1e3 }\n", "environment gradient times strength"),
        (
            "[environment]\nkey = { radiance = [1e9, 1, 1], toward = [0, 1, 0], sharpness = 1 }\nstrength = 1e9\n",
            "key times",
        ),
        ("[environment]\nsky = { radiance = 1e12, sun = 1e6 }\n", "environment sky times strength 1 is over"),
        ("[environment]\nsky = { radiance = 1e16 }\n", "sky radiance 1e16 is not within 0 to 1e15"),
        ("[environment]\nturn_deg = nan\n", "environment turn_deg NaN"),
        ("[environment]\nturn_deg = 1e6\n", "is not within 1e5"),
        ("[environment]\nsky = { turbidity = 1 }\n", "sky turbidity 1 is not within 2 to 10"),
        ("[environment]\nsky = { sun_elevation_deg = -1 }\n", "sun_elevation_deg -1 is not within 0 to 90"),
        ("[environment]\nsky = { sun_azimuth_deg = nan }\n", "sun_azimuth_deg NaN"),
        ("[environment]\nsky = { radiance = -1 }\n", "sky radiance -1"),
        ("[environment]\nsky = { sun = inf }\n", "sky sun inf"),
        ("[environment]\nsky = { ground = [0, 0, 2] }\n", "sky ground 2 is not within 0 to 1"),
        ("[environment]\nimage = { file = \"sky.exr\", scale = -1 }\n", "image scale -1"),
        ("[environment]\nimage = { file = \"none.exr\" }\n", "no such file"),
        ("[environment]\nimage = { file = \"bad.png\" }\n", "bad.png: environment image"),
        ("[environment]\nimage = { file = \"bad.obj\" }\n", "not an HDR, EXR or PNG"),
    ];
    for (lines, part) in table {
        refused(scene(&format!("{HEAD}{lines}")), "dir/s.toml:4: ", part);
    }
    refused(scene(&format!("{HEAD}{MESH}{MESH}")), "dir/s.toml:7: ", "two meshes \"m\"");
    for (line, part) in [
        ("fog = 1", "unknown field `fog`"),
        ("sky = { moon = 1 }", "unknown field `moon`"),
        ("sky = { ground = [1, 1] }", "invalid length 2"),
        ("sky = 3", "invalid type: integer `3`, expected a table { ... }"),
        ("gradient = 3", "invalid type: integer `3`, expected a table { ... }"),
    ] {
        refused(scene(&format!("{HEAD}[environment]\n{line}\n")), "dir/s.toml:5: ", part);
    }
}
