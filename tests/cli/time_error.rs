//! `bench time-error`: what it measures and says of one scene. Nothing here is timed.

use crate::cli::{Folder, finish, has_device};
use serde_json::Value;

fn rms(value: &Value) -> f64 {
    value["rms_relative"].as_f64().unwrap_or_else(|| panic!("an error in {value}"))
}

#[test]
fn unknown_cases_are_listed() {
    let Some(folder) = Folder::with_device() else { return };
    folder.run("bench time-error --case moonlight --out out").ended(2, &["moonlight", "glowing_torus"]);
    assert!(!folder.at("out").exists(), "nothing is written");
}

/// A floor and a ring that moves over it, under `light`.
fn own_scene(light: &str) -> String {
    format!(
        r#"
camera = {{ eye = [0, 2, 4], target = [0, 0.3, 0] }}
output = {{ time_s = 0.5, exposure_ev = -0.5 }}
mesh = [
    {{ name = "floor", plane = {{ size_m = 4, cells = 16 }} }},
    {{ name = "ring", torus = {{ major_m = 0.5, minor_m = 0.15, segments = 24, sides = 8 }} }},
    {{ name = "ball", sphere = {{ radius_m = 0.2, subdivisions = 2 }} }},
]
[[entity]]
mesh = "floor"
[[entity]]
mesh = "ring"
position = [0, 0.6, 0]
motion = [{{ spin = {{ axis = [1, 0, 0], period_s = 4 }} }}]
{light}"#
    )
}

const LIGHT: &str =
    "[[entity]]\nmesh = \"ball\"\nposition = [0.6, 2, 0.3]\nemission = [60, 50, 40]\nreceives = false\n";

#[test]
fn a_scene_of_ones_own() {
    let Some(folder) = Folder::with_device() else { return };
    folder.write("my ring.toml", own_scene(LIGHT));
    let mut asked = folder.command("bench time-error --quick --out out --json");
    let ran = finish(asked.arg("my ring.toml")).ended(0, &[]);
    let outcome: Value = serde_json::from_str(&ran.stdout).unwrap();
    for (part, count) in [("budgets", 1), ("qualities", 2), ("comparisons", 5)] {
        assert_eq!(outcome[part].as_array().unwrap().len(), count, "{part}");
        assert_eq!(outcome[part][0]["case"], "my ring");
    }
    // The ladder: what causes add up to is near the whole, and no cause is free.
    let budget = &outcome["budgets"][0];
    let [fields, storage, total] =
        ["bands_and_sampling", "arithmetic_and_storage", "total"].map(|rung| rms(&budget[rung]));
    assert!(fields > 0.01 && fields < 0.3, "four bands below a small light: {fields}");
    assert!(storage > 1e-7 && storage < 1e-3, "arithmetic and storage {storage}");
    assert!(total <= fields + storage && total >= fields - storage, "{total} of {budget}");
    // Sharp lights beside lights in SH, against the same rays.
    let comparisons = outcome["comparisons"].as_array().unwrap();
    let ways: Vec<[&str; 3]> = comparisons
        .iter()
        .map(|c| ["place", "lights", "shading"].map(|key| c[key].as_str().expect("a name")))
        .collect();
    let [at_vertices, at_pixels] = ["vertices", "pixels"];
    let by_vertex = [[at_vertices, "sharp", "vertex"], [at_vertices, "sh", "vertex"]];
    let by_pixel = [[at_pixels, "sharp", "pixel"], [at_pixels, "sharp", "vertex"], [at_pixels, "sh", "vertex"]];
    assert_eq!(ways, [&by_vertex[..], &by_pixel].concat());
    assert_eq!(comparisons[0]["rival"], comparisons[1]["rival"]);
    let [sharp, sh] = [0, 1].map(|i| rms(&comparisons[i]["merge_error"]));
    // At pixels vertices of the coarse floor carry no edge; all three stand beside the same rays, and more err less.
    let [pixel, vertex, pixel_sh] = [2, 3, 4].map(|i| rms(&comparisons[i]["merge_error"]));
    assert!(pixel < 0.6 * vertex && vertex < pixel_sh, "{pixel}, {vertex}, {pixel_sh}");
    assert_eq!(comparisons[2]["rival"], comparisons[4]["rival"]);
    let cast: Vec<f64> = comparisons[2]["rival"].as_array().unwrap().iter().map(|p| rms(&p["error"])).collect();
    assert!(cast.windows(2).all(|pair| pair[1] < pair[0]) && cast[4] < 0.05, "{cast:?}");
    assert!(sharp < 0.5 * sh && (sh / total - 1.0).abs() < 1e-6, "{sharp} and {sh} of {total}");
    assert!((rms(&budget["sharp_total"]) / sharp - 1.0).abs() < 1e-6);

    let document: Value = serde_json::from_slice(&folder.read("out/time-error.json")).unwrap();
    assert_eq!(document["outcome"]["budgets"], outcome["budgets"]);
    let csv = String::from_utf8(folder.read("out/qualities.csv")).unwrap();
    let bytes = &outcome["qualities"][1]["field_bytes"];
    assert!(csv.starts_with("\"scene\",\"quality\",") && csv.ends_with(&format!(",{bytes}\n")), "{csv}");
    // The tables of docs/measured.md are made of this file.
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/measured");
    let Ok(tables) = std::process::Command::new(script).arg(folder.at("out")).output() else { return };
    let tables = String::from_utf8(tables.stdout).unwrap();
    for mark in ["budget", "vertices", "pixels"] {
        let table = tables.split(&format!("<!-- measured: {mark} -->")).nth(1).unwrap_or_default();
        assert!(table.split("<!-- end -->").next().unwrap().contains("| my ring"), "{mark}: {tables}");
    }
}

#[test]
fn a_scene_that_cannot_be_judged_says_why() {
    let folder = Folder::new();
    let buried = LIGHT.replace("2, 0.3", "-2, 0.3");
    let unlit = own_scene(LIGHT).replace("mesh = \"floor\"\n", "mesh = \"floor\"\nreceives = false\n");
    let unlit = unlit.replace("position = [0, 0.6, 0]", "receives = false");
    let scenes = [
        ("torn.toml", "[camera]\neye = [0, 2".to_owned(), "torn.toml:2"),
        ("dark.toml", own_scene(""), "nothing shines"),
        ("unlit.toml", unlit, "no entity receives light"),
        ("meshless.toml", own_scene("[[entity]]\nmesh = \"horse\"\n"), "there is no mesh \"horse\""),
    ];
    let ask = |name: &str| folder.run(&format!("bench time-error {name} --quick --out out"));
    for (name, text, expected) in scenes {
        folder.write(name, text);
        ask(name).ended(4, &[name, expected]);
        assert!(!folder.at("out").exists(), "nothing is written");
    }
    ask("absent.toml").ended(4, &[]);
    // A scene or cases.
    folder.run("bench time-error dark.toml --case torus --out out").ended(2, &[]);
    if !has_device() {
        return;
    }
    // The floor is not lit from below, and only the ring's underside would see it: it does not receive here.
    let buried = own_scene(&buried).replace("position = [0, 0.6, 0]", "position = [0, 0.6, 0]\nreceives = false");
    folder.write("buried.toml", buried);
    ask("buried.toml").ended(4, &["no light reaches any of the 289 judged vertices"]);
}
