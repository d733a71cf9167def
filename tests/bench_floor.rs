//! `bench floor` on a small lattice. Nothing here is timed.

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{command, finish, good, has_device, names};
use serde_json::Value;

/// A field far coarser than the default: the rungs below the bands must show it. And no more rays than it takes to tell.
const COARSE: [&str; 6] = ["--lattice", "cube:6x3", "--face-px", "16", "--rays", "2048"];

fn number(row: &Value, key: &str) -> f64 {
    row.pointer(key).and_then(Value::as_f64).unwrap_or_else(|| panic!("{key} of {row}"))
}

#[test]
fn the_ladder_below_a_teapot() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let lights = ["--case", "(a)", "--case", "(b)"];
    let ran = good(folder.path(), &[&["bench", "floor", "--json", "--out", "out"], &lights[..], &COARSE].concat());
    let rows: Vec<Value> = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(rows.len(), 2, "{rows:?}");
    // The independent ray caster's figures; what one is off by, the other need not be.
    for (row, (light, independent)) in rows.iter().zip([("uniform sky", 0.0023), ("sky gradient", 0.0054)]) {
        assert!(row["case"].as_str().unwrap().contains(light), "{row}");
        assert_eq!(number(row, "/independent_bands_per_unoccluded"), independent);
        let unit = number(row, "/budget/t0_per_unoccluded_ratio");
        let [bands, below, total] =
            ["bands", "below_bands", "total"].map(|rung| number(row, &format!("/{rung}_per_unoccluded")));
        let own = ["t0", "t1"].map(|rung| unit * number(row, &format!("/budget/{rung}_error_relative")));
        let few = own.iter().any(|error| *error <= 0.0 || *error > 0.6 * bands.min(below));
        assert!(!few, "rays too few to judge: {row}");
        // No lattice moves the first rung. Few rays add to it what they err by themselves, in squares.
        let without = (bands.powi(2) - own[0].powi(2) - own[1].powi(2)).sqrt();
        assert!((without / independent - 1.0).abs() < 0.1, "{without}: {row}");
        // Rungs are differences of the same three sets of vertices: the triangle inequality holds to rounding.
        assert!(total <= (bands + below) * (1.0 + 1e-9) && total >= (bands - below).abs() * (1.0 - 1e-9), "{row}");
        let ratio = number(row, "/below_bands_per_bands_ratio");
        assert!((ratio * bands / below - 1.0).abs() < 1e-9, "{row}");
        assert!(number(row, "/budget/arithmetic_and_storage/rms_relative") < 1e-3, "{row}");
        assert_eq!(number(row, "/budget/vertex_count"), 1600.0);
    }
    // So few samples miss the goal under a sky by far; shadow that is lost altogether would be some .1.
    let sky = number(&rows[0], "/below_bands_per_unoccluded");
    assert!((0.004..0.05).contains(&sky), "{sky}");
    assert_eq!(names(&folder.path().join("out")), ["floor.csv", "floor.json"]);
    let csv = std::fs::read_to_string(folder.path().join("out/floor.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 4, "origin, names, a row a light: {csv}");
    assert!(lines[0].contains("cube:6x3") && lines[1].contains("below_bands_per_unoccluded"), "{csv}");
    assert!(lines[2].contains("uniform sky"), "{csv}");
}

#[test]
fn an_unknown_light_lists_the_known_ones() {
    let folder = tempfile::tempdir().unwrap();
    let ran = finish(&mut command(folder.path(), &["bench", "floor", "--out", "out", "--case", "moon"]));
    if ran.code == 3 {
        return common::skip(&ran.stderr);
    }
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("moon") && ran.stderr.contains("(c) key of 4 bands"), "{}", ran.stderr);
    assert!(!folder.path().join("out").exists());
}

/// `bench skip` has scenes and meshes to choose from, and lists both.
#[test]
fn skips_of_an_unknown_case_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let ran = finish(&mut command(folder.path(), &["bench", "skip", "--quick", "--out", "out", "--case", "moon"]));
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("\"moon\"") && ran.stderr.contains("house; sphere; torus)"), "{}", ran.stderr);
    assert!(!folder.path().join("out").exists());
}
