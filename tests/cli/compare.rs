//! `compare` as a user runs it: two pictures, bounds, masks, and what is no picture.

use crate::cli::Folder;
use serde_json::{Value, json};
use shadow_fields::asset::decode::Picture;
use shadow_fields::asset::picture::{linear_from_srgb, write_exr, write_png};

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

fn png(folder: &Folder, name: &str, rgb: &[f32]) {
    write_png(&folder.at(name), WIDTH as u32, HEIGHT as u32, rgb, 0.0).unwrap();
}

fn exr(folder: &Folder, name: &str, rgb: &[f32]) {
    write_exr(&folder.at(name), WIDTH as u32, HEIGHT as u32, rgb).unwrap();
}

fn folder() -> Folder {
    let folder = Folder::new();
    png(&folder, "a.png", &grey(51.0 / 255.0, &[]));
    png(&folder, "b.png", &grey(51.0 / 255.0, &[(7, 20, 102.0 / 255.0)]));
    folder
}

/// Exit code and report.
fn compare(folder: &Folder, line: &str) -> (i32, Value) {
    let ran = folder.run(&format!("compare {line} --json"));
    (ran.code, serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{} {}", ran.stdout, ran.stderr)))
}

fn near(value: &Value, expected: f64) -> bool {
    (value.as_f64().unwrap() - expected).abs() < 1e-6
}

#[test]
fn one_pixel_is_found_and_measured() {
    let folder = folder();
    let (code, report) = compare(&folder, "a.png b.png");
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
    let said = folder.good("compare a.png b.png").stdout;
    assert!(said.contains("at x 7, y 20: 0.2000 0.2000 0.2000 against 0.4000 0.4000 0.4000"), "{said}");
    assert!(said.contains("mean FLIP") && said.contains("RMS"), "{said}");
}

/// A bound decides, and where it is exceeded the difference is drawn all the same: then it is wanted most.
#[test]
fn bounds_decide() {
    let folder = folder();
    let (_, report) = compare(&folder, "a.png b.png");
    for (option, key) in [("--max-flip", "mean_flip_ratio"), ("--max-rms", "rms")] {
        let found = report[key].as_f64().unwrap();
        assert_eq!(compare(&folder, &format!("a.png b.png {option} {found}")).0, 0, "{option}");
        let exceeded = format!("a.png b.png {option} {}", 0.999 * found);
        let ran = folder.run(&format!("compare {exceeded} -o d.png"));
        assert_eq!((ran.code, ran.stderr.lines().count()), (1, 1), "{}", ran.stderr);
        assert!(ran.stderr.contains("b.png differs from a.png") && ran.stderr.contains(option), "{}", ran.stderr);
        let (code, report) = compare(&folder, &exceeded);
        assert_eq!((code, &report["passed"]), (1, &json!(false)));
        let picture = Picture::read(&folder.at("d.png")).unwrap();
        assert!(picture.width == WIDTH && picture.height > HEIGHT, "a bar stands below");
        let light = |x: usize, y: usize| picture.rgb[3 * (y * WIDTH + x)..][..3].iter().sum::<f32>();
        assert!(light(7, 20) > light(40, 5), "where they differ it is lighter");
        std::fs::remove_file(folder.at("d.png")).unwrap();
    }
}

#[test]
fn masks_leave_out_what_is_dark() {
    let folder = folder();
    png(&folder, "all_but_it.png", &grey(1.0, &[(7, 20, 0.0)]));
    png(&folder, "only_it.png", &grey(0.0, &[(7, 20, 1.0)]));
    png(&folder, "none.png", &grey(0.0, &[]));
    let masked = |mask: &str| compare(&folder, &format!("a.png b.png --mask {mask} --max-flip 0 --max-rms 0"));
    let (code, report) = masked("all_but_it.png");
    assert_eq!((code, &report["pixel_count"]), (0, &1535.into()), "what does not count blurs into nothing: {report}");
    let (code, report) = masked("only_it.png");
    assert_eq!((code, &report["pixel_count"]), (1, &1.into()));
    assert!(near(&report["rms"], 0.2), "{report}");
    assert_eq!(report["mean_flip_ratio"], report["largest_flip"]["difference"]);
    folder.refused("compare a.png b.png --mask none.png", 4, &["none.png: the mask is dark"]);
}

#[test]
fn linear_pictures_are_compared_as_they_are_and_shown_where_one_is_a_png() {
    let folder = folder();
    let bright: Vec<f32> = grey(0.0, &[]).iter().map(|_| 40.0).collect();
    exr(&folder, "bright.exr", &bright);
    exr(&folder, "brighter.exr", &bright.iter().map(|c| c + 0.5).collect::<Vec<f32>>());
    let (_, report) = compare(&folder, "bright.exr brighter.exr");
    assert!(near(&report["rms"], 0.5) && report["values"] == "linear", "{report}");
    assert_eq!(report["mean_flip_ratio"], 0.0, "both are white");
    let (_, report) = compare(&folder, "bright.exr brighter.exr --exposure-ev -6");
    assert!(report["mean_flip_ratio"].as_f64().unwrap() > 0.0);
    // A linear picture that is brightened looks as the PNG of it does.
    exr(&folder, "a.exr", &grey(51.0 / 255.0, &[]).iter().map(|c| c / 4.0).collect::<Vec<f32>>());
    let (code, report) = compare(&folder, "a.png a.exr --exposure-ev 2 --max-rms 1e-5");
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
        for bound in ["--max-flip 1", "--max-rms 1e30"] {
            let (code, report) = compare(&folder, &format!("good.exr odd.exr {bound}"));
            assert_eq!((code, &report["not_finite_count"]), (1, &1.into()), "{odd} {report}");
            assert_eq!((&report["largest"]["x"], &report["largest"]["y"]), (&4.into(), &5.into()));
        }
        let (code, _) = compare(&folder, "odd.exr odd.exr --max-flip 0 --max-rms 0");
        assert_eq!(code, 0, "the same in both");
    }
}

#[test]
fn bad_input_is_one_line() {
    let folder = folder();
    write_png(&folder.at("small.png"), 2, 2, &[0.5; 12], 0.0).unwrap();
    write_png(&folder.at("low.png"), 48, 2, &[0.5; 288], 0.0).unwrap();
    folder.write("text.png", "no picture");
    let whole = folder.read("a.png");
    folder.write("cut.png", &whole[..whole.len() / 2]);
    folder.write("bomb.png", crate::common::huge_png());
    for (line, code, parts) in [
        ("a.png small.png", 4, &["small.png: ", "2 x 2 pixels against 48 x 32"][..]),
        ("a.png low.png", 4, &["low.png: ", "48 x 2 pixels against 48 x 32"]),
        ("a.png none.png", 4, &["none.png: ", "o such file"]),
        ("text.png a.png", 4, &["text.png: ", "expected a picture"]),
        ("cut.png a.png", 4, &["cut.png: "]),
        ("bomb.png a.png", 4, &["bomb.png: ", "65535 x 65535 pixels"]),
        ("a.png b.png --mask small.png", 4, &["small.png: ", "another size"]),
        ("a.png b.png --mask low.png", 4, &["low.png: ", "another size"]),
    ] {
        folder.refused(&format!("compare {line}"), code, parts);
    }
    for (option, value) in [("--max-flip", "nan"), ("--max-flip", "1.1"), ("--max-rms", "-1"), ("--max-rms", "inf")] {
        folder.run(&format!("compare a.png b.png {option} {value}")).ended(2, &[option, value]);
    }
    assert_eq!(folder.run("compare a.png").code, 2);
}

#[test]
fn transparency_is_told() {
    let folder = folder();
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, 1, 1);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&[9, 9, 9, 128]).unwrap();
    folder.write("t.png", file);
    let ran = folder.good("compare t.png t.png");
    assert!(ran.stderr.contains("t.png: some pixels are transparent"), "{}", ran.stderr);
}
