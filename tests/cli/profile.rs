//! What `profile` counts and prints. Nothing here is timed.

use crate::cli::{Folder, finish};
use crate::common::{library, names};
use serde_json::Value;
use shadow_fields::gpu::census;
use shadow_fields::shaders::ShaderPermutation;

#[test]
fn a_round_of_a_loop_is_counted() {
    let flops = |kind: u32| {
        let row = ShaderPermutation::new("ceiling.comp", 4).define("KIND", kind).define("READS", 16_u32);
        let row = row.define("ROUNDS", 64_u32).define("MASK", 1023_u32);
        census::flops(&library().unrolled(&row).unwrap()).unwrap()
    };
    assert_eq!(flops(0), 16 * 4 * 2, "sixteen vectors of four, multiplied and added");
    assert_eq!(flops(1), 16 * 4, "sixteen texels, each added");
}

fn profile(folder: &Folder, line: &str) -> Value {
    folder.json(&format!("profile --validation sync {line}"))
}

fn positive(row: &Value, keys: &[&str]) {
    for key in keys {
        let value = row.pointer(key).and_then(Value::as_f64);
        assert!(value.is_some_and(|v| v > 0.0 && v.is_finite()), "{key} of {row}");
    }
}

#[test]
fn two_variants_side_by_side() {
    let Some(folder) = Folder::with_device() else { return };
    let line = "--runs 2 --grid 65536 --occluders 2 --variant texel-packed --variant storage --output out";
    let document = profile(&folder, line);
    let ceilings = ["/gflops", "/texel_halves_giga", "/texel_packed_giga", "/storage_giga", "/dispatch_ms"];
    positive(&document["ceilings"], &ceilings);
    let rows = document["passes"].as_array().unwrap();
    assert_eq!(rows.len(), 2);
    for (row, name) in rows.iter().zip(["texel-packed", "storage"]) {
        assert_eq!(row["variant"], name);
        positive(row, &["/ms/median", "/ns_a_pair", "/flops", "/gflops", "/arithmetic_share"]);
    }
    assert_eq!(names(&folder.at("out")), ["profile.json"]);
}

/// A floor under a uniform sky.
const FLOOR: &str = "camera = { eye = [0, 2, 3], target = [0, 0, 0] }\nenvironment = { uniform = [1, 1, 1] }\n\
    [[mesh]]\nname = \"floor\"\nplane = { size_m = 2, cells = 9 }\n[[entity]]\nmesh = \"floor\"\n";

#[test]
fn a_scene_is_timed_pass_by_pass() {
    let Some(folder) = Folder::with_device() else { return };
    folder.write("floor.toml", FLOOR);
    let line = "floor.toml --runs 2 --size 64x48 --variant texel-packed --variant texel-shifted";
    let document = profile(&folder, line);
    let rows = document["passes"].as_array().unwrap();
    let of_lookups = ["arithmetic_share", "ns_a_pair"].map(|key| &rows[0][key]);
    assert_eq!(of_lookups, [&Value::Null; 2], "nothing is looked up");
    let passes: Vec<_> = rows.iter().map(|row| row["pass"].as_str().unwrap()).collect();
    assert_eq!(passes[..2], ["merge", "merge"]);
    assert_eq!(passes.iter().filter(|pass| **pass == "draw").count(), 3, "ways to smooth edges: {passes:?}");
    assert_eq!(passes.iter().filter(|pass| **pass == "frame").count(), 3, "{passes:?}");
    rows.iter().for_each(|row| positive(row, &["/ms/median"]));
}

/// A first run does not wait for a calibration, and the next goes by what it found.
#[test]
fn a_device_never_seen_gets_a_default_at_once() {
    let Some(folder) = Folder::with_device() else { return };
    folder.write("floor.toml", FLOOR);
    let variant = || {
        // A cache of its own, in which nothing is known.
        let mut render = folder.bare("render floor.toml -o a.png --size 32x32 --json --cache-dir cache");
        let document: Value = serde_json::from_str(&finish(&mut render).ended(0, &[]).stdout).unwrap();
        document["variant"].as_str().unwrap().to_owned()
    };
    let known = || {
        let names = names(&folder.at("cache"));
        let name = names.iter().find(|name| name.starts_with("calibration-")).expect("it was measured").clone();
        let path = folder.at("cache").join(name);
        let calibration: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        (path, calibration)
    };
    let default = variant();
    let (path, mut calibration) = known();
    let times: Vec<_> =
        calibration["milliseconds"].as_array().unwrap().iter().map(|pair| pair[1].as_f64().unwrap()).collect();
    assert!(times.len() > 1 && times.iter().all(|t| *t > 0.0), "{calibration}");
    let write = |calibration: &Value| std::fs::write(&path, calibration.to_string()).unwrap();
    calibration["fastest"] = "storage".into();
    write(&calibration);
    assert_eq!(variant(), "storage", "what was measured is used");
    assert_eq!(known().1["fastest"], "storage", "and not measured again");
    for (key, value) in [("driver", "another"), ("fastest", "unheard of")] {
        let mut other = calibration.clone();
        other[key] = value.into();
        write(&other);
        assert_eq!(variant(), default, "{key}: the device is as one never seen");
        assert_ne!(known().1[key], value, "{key}: and measured again");
    }
}
