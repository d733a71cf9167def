//! `compare` as a user runs it: two pictures, bounds, masks, and what is no picture.

#[path = "common/cli.rs"]
mod cli;
mod common;

use cli::{Ran, command, finish, good, names};
use serde_json::Value;
use shadow_fields::asset::decode::Picture;
use shadow_fields::asset::picture::{linear_from_srgb, write_exr, write_png};
use std::path::Path;
use tempfile::TempDir;

const WIDTH: usize = 48;
const HEIGHT: usize = 32;

/// A picture of one sRGB grey, with other greys at some pixels.
fn grey(base: f32, at: &[(usize, usize, f32)]) -> Vec<f32> {
    let mut rgb = vec![linear_from_srgb(base); 3 * WIDTH * HEIGHT];
    for (x, y, value) in at {
        rgb[3 * (y * WIDTH + x)..][..3].fill(linear_from_srgb(*value));
    }
    rgb
}

fn png(folder: &TempDir, name: &str, rgb: &[f32]) {
    write_png(&folder.path().join(name), WIDTH as u32, HEIGHT as u32, rgb, 0.0).unwrap();
}

fn exr(folder: &TempDir, name: &str, rgb: &[f32]) {
    write_exr(&folder.path().join(name), WIDTH as u32, HEIGHT as u32, rgb).unwrap();
}

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    png(&folder, "a.png", &grey(51.0 / 255.0, &[]));
    png(&folder, "b.png", &grey(51.0 / 255.0, &[(7, 20, 102.0 / 255.0)]));
    folder
}

fn run(folder: &TempDir, arguments: &[&str]) -> Ran {
    finish(&mut command(folder.path(), &[&["compare"], arguments].concat()))
}

fn json(folder: &TempDir, arguments: &[&str]) -> (i32, Value) {
    let ran = run(folder, &[arguments, &["--json"]].concat());
    (ran.code, serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{} {}", ran.stdout, ran.stderr)))
}

fn near(value: &Value, expected: f64) -> bool {
    (value.as_f64().unwrap() - expected).abs() < 1e-6
}

#[test]
fn the_same_picture_does_not_differ() {
    let folder = folder();
    let (code, report) = json(&folder, &["a.png", "a.png", "--max-flip", "0", "--max-rms", "0"]);
    assert_eq!((code, &report["passed"]), (0, &Value::Bool(true)));
    for key in ["mean_flip_ratio", "rms"] {
        assert_eq!(report[key], 0.0);
    }
    assert_eq!((&report["largest"]["difference"], &report["values"]), (&Value::from(0.0), &Value::from("srgb")));
}

#[test]
fn one_pixel_is_found_and_measured() {
    let folder = folder();
    let (code, report) = json(&folder, &["a.png", "b.png"]);
    assert_eq!(code, 0, "no bound is given");
    assert_eq!((&report["width"], &report["height"], &report["pixel_count"]), (&48.into(), &32.into(), &1536.into()));
    // 51 of 255 steps at one of 48 x 32 pixels.
    assert!(near(&report["largest"]["difference"], 0.2), "{report}");
    assert!(near(&report["rms"], (0.04 / 1536.0_f64).sqrt()), "{report}");
    for place in ["largest", "largest_flip"] {
        assert_eq!((&report[place]["x"], &report[place]["y"]), (&7.into(), &20.into()), "{report}");
    }
    assert!(near(&report["largest"]["a"][0], 0.2) && near(&report["largest"]["b"][2], 0.4), "{report}");
    let flip = report["mean_flip_ratio"].as_f64().unwrap();
    assert!(flip > 1e-5 && flip < 0.1, "{flip}");
    let said = good(folder.path(), &["compare", "a.png", "b.png"]).stdout;
    assert!(said.contains("at x 7, y 20: 0.2000 0.2000 0.2000 against 0.4000 0.4000 0.4000"), "{said}");
    assert!(said.contains("mean FLIP") && said.contains("RMS"), "{said}");
}

#[test]
fn bounds_decide() {
    let folder = folder();
    let (_, report) = json(&folder, &["a.png", "b.png"]);
    for (option, key) in [("--max-flip", "mean_flip_ratio"), ("--max-rms", "rms")] {
        let found = report[key].as_f64().unwrap();
        assert_eq!(json(&folder, &["a.png", "b.png", option, &found.to_string()]).0, 0, "{option}");
        let below = (0.999 * found).to_string();
        let ran = run(&folder, &["a.png", "b.png", option, &below]);
        assert_eq!((ran.code, ran.stderr.lines().count()), (1, 1), "{}", ran.stderr);
        assert!(ran.stderr.contains("b.png differs from a.png") && ran.stderr.contains(option), "{}", ran.stderr);
        let (code, report) = json(&folder, &["a.png", "b.png", option, &below]);
        assert_eq!((code, &report["passed"]), (1, &Value::Bool(false)));
    }
}

#[test]
fn masks_leave_out_what_is_dark() {
    let folder = folder();
    png(&folder, "all_but_it.png", &grey(1.0, &[(7, 20, 0.0)]));
    png(&folder, "only_it.png", &grey(0.0, &[(7, 20, 1.0)]));
    png(&folder, "none.png", &grey(0.0, &[]));
    let masked = |mask| json(&folder, &["a.png", "b.png", "--mask", mask, "--max-flip", "0", "--max-rms", "0"]);
    let (code, report) = masked("all_but_it.png");
    assert_eq!((code, &report["pixel_count"]), (0, &1535.into()), "what does not count blurs into nothing: {report}");
    let (code, report) = masked("only_it.png");
    assert_eq!((code, &report["pixel_count"]), (1, &1.into()));
    assert!(near(&report["rms"], 0.2), "{report}");
    assert_eq!(report["mean_flip_ratio"], report["largest_flip"]["difference"]);
    let ran = run(&folder, &["a.png", "b.png", "--mask", "none.png"]);
    assert!(ran.code == 4 && ran.stderr.contains("none.png: the mask is dark"), "{}", ran.stderr);
}

#[test]
fn linear_pictures_are_compared_as_they_are_and_shown_where_one_is_a_png() {
    let folder = folder();
    let bright: Vec<f32> = grey(0.0, &[]).iter().map(|_| 40.0).collect();
    exr(&folder, "bright.exr", &bright);
    exr(&folder, "brighter.exr", &bright.iter().map(|c| c + 0.5).collect::<Vec<f32>>());
    let (_, report) = json(&folder, &["bright.exr", "brighter.exr"]);
    assert!(near(&report["rms"], 0.5) && report["values"] == "linear", "{report}");
    assert_eq!(report["mean_flip_ratio"], 0.0, "both are white");
    let (_, report) = json(&folder, &["bright.exr", "brighter.exr", "--exposure-ev", "-6"]);
    assert!(report["mean_flip_ratio"].as_f64().unwrap() > 0.0);
    // A linear picture that is brightened looks as the PNG of it does.
    exr(&folder, "a.exr", &grey(51.0 / 255.0, &[]).iter().map(|c| c / 4.0).collect::<Vec<f32>>());
    let (code, report) = json(&folder, &["a.png", "a.exr", "--exposure-ev", "2", "--max-rms", "1e-5"]);
    assert!(code == 0 && report["values"] == "srgb", "{report}");
}

#[test]
fn what_is_no_number_is_beyond_every_bound() {
    let folder = folder();
    let good = grey(0.0, &[]);
    exr(&folder, "good.exr", &good);
    for odd in [f32::NAN, f32::INFINITY] {
        let mut rgb = good.clone();
        rgb[3 * (5 * WIDTH + 4) + 1] = odd;
        exr(&folder, "odd.exr", &rgb);
        for bound in [["--max-flip", "1"], ["--max-rms", "1e30"]] {
            let (code, report) = json(&folder, &[&["good.exr", "odd.exr"], &bound[..]].concat());
            assert_eq!((code, &report["not_finite_count"]), (1, &1.into()), "{odd} {report}");
            assert_eq!((&report["largest"]["x"], &report["largest"]["y"]), (&4.into(), &5.into()));
        }
        let (code, _) = json(&folder, &["odd.exr", "odd.exr", "--max-flip", "0", "--max-rms", "0"]);
        assert_eq!(code, 0, "the same in both");
    }
}

#[test]
fn the_difference_is_drawn() {
    let folder = folder();
    good(folder.path(), &["compare", "a.png", "b.png", "-o", "d.png", "--max-flip", "1"]);
    let picture = Picture::read(&folder.path().join("d.png")).unwrap();
    assert!(picture.width == WIDTH && picture.height > HEIGHT, "a bar stands below");
    let light = |x: usize, y: usize| picture.rgb[3 * (y * WIDTH + x)..][..3].iter().sum::<f32>();
    assert!(light(7, 20) > light(40, 5), "where they differ it is lighter");
    // Also where the bound is exceeded: then the picture is wanted most.
    std::fs::remove_file(folder.path().join("d.png")).unwrap();
    assert_eq!(run(&folder, &["a.png", "b.png", "-o", "d.png", "--max-flip", "0"]).code, 1);
    assert!(folder.path().join("d.png").exists());
}

#[test]
fn bad_input_is_one_line() {
    let folder = folder();
    write_png(&folder.path().join("small.png"), 2, 2, &[0.5; 12], 0.0).unwrap();
    write_png(&folder.path().join("low.png"), 48, 2, &[0.5; 288], 0.0).unwrap();
    std::fs::write(folder.path().join("text.png"), "no picture").unwrap();
    let whole = std::fs::read(folder.path().join("a.png")).unwrap();
    std::fs::write(folder.path().join("cut.png"), &whole[..whole.len() / 2]).unwrap();
    // A header of 65 535 x 65 535 pixels and nothing behind it.
    let mut bomb = whole[..16].to_vec();
    bomb.extend([0, 0, 255, 255, 0, 0, 255, 255, 8, 2, 0, 0, 0]);
    let crc = bomb[12..].iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    });
    bomb.extend((!crc).to_be_bytes());
    bomb.extend([0, 0, 0, 0]);
    bomb.extend(b"IDAT\x35\xaf\x06\x1e\0\0\0\0IEND\xae\x42\x60\x82");
    std::fs::write(folder.path().join("bomb.png"), bomb).unwrap();
    let before = names(folder.path());
    for (arguments, code, parts) in [
        (&["a.png", "small.png"][..], 4, &["small.png: ", "2 x 2 pixels against 48 x 32"][..]),
        (&["a.png", "low.png"], 4, &["low.png: ", "48 x 2 pixels against 48 x 32"]),
        (&["a.png", "none.png"], 4, &["none.png: ", "o such file"]),
        (&["text.png", "a.png"], 4, &["text.png: ", "expected a picture"]),
        (&["cut.png", "a.png"], 4, &["cut.png: "]),
        (&["bomb.png", "a.png"], 4, &["bomb.png: ", "65535 x 65535 pixels"]),
        (&["a.png", "b.png", "--mask", "small.png"], 4, &["small.png: ", "another size"]),
        (&["a.png", "b.png", "--mask", "low.png"], 4, &["low.png: ", "another size"]),
        (&["a.png", "b.png", "-o", "d.jpg"], 2, &["d.jpg: ", ".png"]),
        (&["a.png", "b.png", "-o", "no/d.png"], 1, &["no/d.png: ", "no folder no"]),
    ] {
        let ran = run(&folder, arguments);
        assert_eq!((ran.code, ran.stderr.lines().count()), (code, 1), "{arguments:?}: {}", ran.stderr);
        parts.iter().for_each(|part| assert!(ran.stderr.contains(part), "no {part:?} in {}", ran.stderr));
        assert_eq!(names(folder.path()), before);
    }
    for (option, value) in [("--max-flip", "nan"), ("--max-flip", "1.1"), ("--max-rms", "-1"), ("--max-rms", "inf")] {
        let ran = run(&folder, &["a.png", "b.png", option, value]);
        assert!(ran.code == 2 && ran.stderr.contains(option) && ran.stderr.contains(value), "{}", ran.stderr);
    }
    assert_eq!(run(&folder, &["a.png"]).code, 2);
}

#[test]
fn transparency_is_told() {
    let folder = folder();
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 1, 1);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&[9, 9, 9, 128]).unwrap();
    std::fs::write(folder.path().join("t.png"), file).unwrap();
    let ran = good(folder.path(), &["compare", "t.png", "t.png"]);
    assert!(ran.stderr.contains("t.png: some pixels are transparent"), "{}", ran.stderr);
    assert!(Path::new(&folder.path().join("t.png")).exists());
}
