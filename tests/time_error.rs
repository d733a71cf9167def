//! `bench time-error`: what it measures and says of one scene. Nothing here is timed.

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{command, finish, good, has_device, names};
use serde_json::Value;

fn rms(value: &Value) -> f64 {
    value["rms_relative"].as_f64().unwrap_or_else(|| panic!("an error in {value}"))
}

#[test]
fn one_scene_and_one_axis() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let asked = ["bench", "time-error", "--quick", "--case", "(b)", "--axis", "lookup", "--out", "out", "--json"];
    let ran = good(folder.path(), &asked);
    let out = folder.path().join("out");
    let written = names(&out);
    for name in ["budget.csv", "rival.csv", "rival.svg", "sweep.csv", "time-error.json", "time-error.txt"] {
        assert!(written.iter().any(|found| found == name), "{name} among {written:?}");
    }
    assert!(written.iter().any(|name| name.starts_with("error-") && name.ends_with(".png")), "an error picture");
    let text = std::fs::read_to_string(out.join("time-error.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&ran.stdout).unwrap()["budgets"], document["outcome"]["budgets"]);
    let outcome = &document["outcome"];

    // The ladder: what causes add up to is near the whole, and no cause is free.
    let budget = &outcome["budgets"][0];
    let [bands, sampling, storage, total] =
        ["bands", "sampling", "arithmetic_and_storage", "total"].map(|rung| rms(&budget[rung]));
    assert!(bands > 0.003 && bands < 0.01, "four bands under a gradient: {bands}");
    assert_eq!(rms(&budget["centre_rule"]), 0.0, "no local light");
    assert!(sampling > 1e-4 && sampling < bands, "sampling {sampling}");
    assert!(storage > 1e-7 && storage < 1e-3, "arithmetic and storage {storage}");
    assert!(total <= bands + sampling + storage && total >= bands - sampling - storage, "{total} of {budget}");

    // The sweep: coarser lookups err more, and all is in units of a default that is among the points.
    let points = outcome["points"].as_array().unwrap();
    let error = |name: &str| {
        let point = points.iter().find(|p| p["name"].as_str().unwrap().contains(name));
        rms(&point.unwrap_or_else(|| panic!("{name} in {points:?}"))["total"])
    };
    assert_eq!(points.len(), 3, "trilinear, radial, nearest");
    assert_eq!(points[0]["axis"], "default");
    assert!((rms(&points[0]["total"]) - total).abs() < 1e-9);
    assert!(error("nearest") > 1.5 * total && error("radial") > 1.5 * total, "{points:?}");

    // The rival: more rays err less, about as the number's square root or faster.
    let comparison = &outcome["comparisons"][0];
    let rival: Vec<f64> = comparison["rival"].as_array().unwrap().iter().map(|p| rms(&p["error"])).collect();
    assert!(rival.windows(2).all(|pair| pair[1] < 0.7 * pair[0]), "four times the rays: {rival:?}");
    let equal = comparison["rays_at_equal_rms_count"].as_f64().unwrap();
    assert!(equal > 16.0 && equal < 1024.0, "{equal} rays err as the merge does");
    let page = std::fs::read_to_string(out.join("time-error.txt")).unwrap();
    assert!(page.starts_with("Which setting is the default, and why") && page.contains("nearest"), "{page}");
}

#[test]
fn unknown_cases_and_axes_are_listed() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (flag, known) in [("--case", "glowing_torus"), ("--axis", "lookup")] {
        let mut command = command(folder.path(), &["bench", "time-error", flag, "moonlight", "--out", "out"]);
        let ran = finish(&mut command);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        assert!(ran.stderr.contains("moonlight") && ran.stderr.contains(known), "{}", ran.stderr);
        assert!(!folder.path().join("out").exists(), "nothing is written");
    }
}
