//! What commands write, where, and that it is what it should be.

use crate::cli::{Folder, SMALL, cache, finish};
use crate::common::{cap, names};
use glam::DVec3;
use serde_json::{Value, json};
use shadow_fields::asset::picture::srgb_from_linear;
use shadow_fields::scene::Scene;
use std::path::Path;

const SCENE: &str = "assets/scenes/sphere_over_plane.toml";

/// A PNG that is not of one colour.
fn picture(folder: &Folder, name: &str) -> image::RgbImage {
    let picture = image::load_from_memory(&folder.read(name)).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (96, 64), "{name}");
    let levels: std::collections::HashSet<_> = picture.pixels().map(|p| p.0).collect();
    assert!(levels.len() > 50, "{name}: flat");
    picture
}

/// Asserts that a PNG is the EXR in sRGB, except where a sample of the pixel is brighter than white: near what is.
fn assert_encodes(png: &image::RgbImage, exr: &image::Rgb32FImage, gain: f32) {
    let mut same = 0;
    let mut clamped = 0;
    for (x, y, p) in png.enumerate_pixels() {
        let linear = exr.get_pixel(x, y).0;
        let around = (y.saturating_sub(1)..(y + 2).min(64))
            .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(96)).map(move |x| (x, y)));
        if around.flat_map(|(x, y)| exr.get_pixel(x, y).0).all(|c| gain * c < 0.95) {
            for (shown, linear) in p.0.iter().zip(linear.map(|c| gain * c)) {
                let srgb = 255.0 * srgb_from_linear(linear);
                assert!((f32::from(*shown) - srgb).abs() <= 1.0, "pixel {x}, {y}: {shown} for {srgb}");
            }
            same += 1;
        } else {
            clamped += 1;
        }
    }
    assert!(same > 5000 && clamped > 5, "{same} pixels below white, {clamped} not");
}

#[test]
fn render_writes_what_it_is_asked_for() {
    let Some(folder) = Folder::with_device() else { return };
    let files = "-o p.png --exr p.exr --vertices v.csv --stats s.json";
    let render = format!("render {SCENE} --seed 7 {files} --variant storage {SMALL}");
    let ran = folder.good(&render);
    assert_eq!(folder.names(), ["p.exr", "p.png", "s.json", "v.csv"]);
    assert_eq!(ran.stdout.lines().count(), 1, "{}", ran.stdout);

    let png = picture(&folder, "p.png");
    let exr = image::load_from_memory(&folder.read("p.exr")).unwrap().into_rgb32f();
    assert_eq!(exr.dimensions(), (96, 64));
    let brightest = exr.pixels().flat_map(|p| p.0).fold(0.0_f32, f32::max);
    assert!((100.0..200.0).contains(&brightest), "the light itself is seen, unclamped: {brightest}");
    let scene = Scene::load(Path::new(SCENE)).unwrap();
    assert_encodes(&png, &exr, scene.data.output.exposure_ev().exp2());

    let text = String::from_utf8(folder.read("v.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("entity,x,y,z,nx,ny,nz,r,g,b"));
    let row = |line| {
        let (entity, numbers) = str::split_once(line, ',').unwrap();
        (entity, numbers.split(',').map(|n| n.parse().unwrap()).collect())
    };
    let rows: Vec<(&str, Vec<f32>)> = lines.map(row).collect();
    assert!(rows.iter().all(|(_, n)| n.len() == 9 && n.iter().all(|n| n.is_finite())));
    for entity in &scene.entities {
        let count = rows.iter().filter(|(name, _)| *name == entity.name).count();
        assert_eq!(count, scene.meshes[entity.mesh].positions.len(), "{}", entity.name);
    }
    for (entity, n) in &rows {
        let ball = [n[0] + 0.2, n[1] - 0.65, n[2]];
        match *entity {
            "floor" => assert!(n[1] == 0.0 && n[4] == 1.0, "{n:?}"),
            "ball" => assert!((ball.iter().map(|c| c * c).sum::<f32>().sqrt() - 0.5).abs() < 1e-4, "{n:?}"),
            _ => assert!(n[1] > 1.8, "{n:?}"),
        }
    }

    let stats = || -> Value { serde_json::from_slice(&folder.read("s.json")).unwrap() };
    let first = stats();
    for key in ["program", "revision", "device", "driver", "vulkan"] {
        assert!(first["origin"][key].as_str().is_some_and(|s| !s.is_empty()), "{key}: {first}");
    }
    assert_eq!((&first["origin"]["seed"], &first["variant"]), (&json!(7), &json!("storage")));
    assert_eq!(first["receiver_vertices"], rows.len());
    assert_eq!(first["options"]["lattice"], "cube:4x3,outer=8");
    assert_eq!(first["options"]["size"], json!([96, 64]));
    let passes = &first["frames"][0]["passes"];
    for pass in ["merge_ms", "draw_ms", "read_back_ms"] {
        assert!(passes[pass].as_f64().is_some_and(|ms| ms > 0.0), "{pass}: {passes}");
    }

    // Again: the same bytes, and everything is found in the cache.
    let outputs = || ["p.png", "p.exr", "v.csv"].map(|name| folder.read(name));
    let before = outputs();
    folder.good(&render);
    assert!(before == outputs(), "the same command gives the same bytes");
    assert_eq!(stats()["baked"], json!([]), "a second run bakes nothing");
}

#[test]
fn animations_are_one_file_or_numbered() {
    let Some(folder) = Folder::with_device() else { return };
    let render = |rest: &str| folder.json(&format!("render {SCENE} {rest} --variant storage {SMALL}"));
    let report = render("--frames 3 --fps 4 -o n_##.png --exr n_##.exr");
    assert_eq!(folder.names(), ["n_00.exr", "n_00.png", "n_01.exr", "n_01.png", "n_02.exr", "n_02.png"]);
    assert_eq!(report["frames"].as_array().unwrap().len(), 3);
    let frames = ["n_00.png", "n_01.png", "n_02.png"].map(|name| picture(&folder, name));
    assert!(frames[0] != frames[1] && frames[1] != frames[2], "the light moves");
    render("--frames 3 --fps 4 -o a.png");
    let apng = image::codecs::png::PngDecoder::new(std::io::Cursor::new(folder.read("a.png"))).unwrap();
    assert!(apng.is_apng().unwrap());
    let animated: Vec<_> = image::AnimationDecoder::into_frames(apng.apng().unwrap()).map(Result::unwrap).collect();
    assert_eq!(animated.len(), 3);
    for (animated, numbered) in animated.iter().zip(&frames) {
        assert_eq!(animated.delay().numer_denom_ms().0 / animated.delay().numer_denom_ms().1, 250);
        let rgb = image::DynamicImage::from(animated.buffer().clone()).into_rgb8();
        assert!(rgb == *numbered, "the same frame in both");
    }
    // At any rate of frames one moment is one picture, and one EXR is the last picture's.
    render("--frames 2 --fps 2 -o half_#.png --exr half.exr");
    assert!(picture(&folder, "half_1.png") == frames[2] && folder.read("half.exr") == folder.read("n_02.exr"));
    assert!(folder.read("half.exr") != folder.read("n_00.exr"));
}

/// What a sphere of radius 1 blocks towards `direction`, seen from a distance.
fn blocked_part(distance: f64, direction: DVec3) -> Vec<f64> {
    cap(4, direction, distance.recip().asin())
}

#[test]
fn bake_and_inspect_a_sphere() {
    let Some(folder) = Folder::with_device() else { return };
    folder.write("ball.obj", include_str!("../../assets/meshes/sphere.obj"));
    let bake = "bake ball.obj -o f.sf --lattice cube:12x5 --face-px 32";
    let ran = folder.good(bake);
    assert!(ran.stdout.starts_with("f.sf: 1800 samples"), "{}", ran.stdout);
    let first = folder.read("f.sf");
    folder.good(bake);
    assert_eq!(first, folder.read("f.sf"), "the same command gives the same bytes");

    // Seen from P, the ball lies towards -P.
    let at = [0.9, -0.7, 1.1];
    let ran = folder.good("inspect f.sf --json --at 0.9,-0.7,1.1");
    assert_eq!(ran.stderr, "", "no device is opened");
    let result: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!((&result["at"]["position_m"], &result["header"]["kind"]), (&json!(at), &json!("occlusion")));
    let blocked: Vec<f64> = result["at"]["blocked"].as_array().unwrap().iter().map(|c| c.as_f64().unwrap()).collect();
    assert_eq!(blocked.len(), 16);
    let distance = DVec3::from(at).length();
    let expected = blocked_part(distance / 0.5, -DVec3::from(at) / distance);
    let norm = expected.iter().map(|c| c * c).sum::<f64>().sqrt();
    let error = expected.iter().zip(&blocked).map(|(e, b)| (e - b).powi(2)).sum::<f64>().sqrt() / norm;
    // Faces of 32 px and shells in coarse steps: some percent of the blocked part.
    assert!(error < 0.05, "{error} of the blocked part: {blocked:?} for {expected:?}");
    let text = folder.good("inspect f.sf").stdout;
    for word in ["kind", "occlusion", "ball", "radius 0.5", "cube:12x5", "f16", "32 x 32"] {
        assert!(text.contains(word), "no {word} in {text}");
    }

    folder.good("bake ball.obj -o r.sf --lattice cube:8x5 --face-px 32 --radiance 4,2,0.5");
    let result = folder.json("inspect r.sf --at 0,2,0");
    assert_eq!(result["header"]["kind"], "radiance");
    let mean = |channel: usize| result["at"]["radiance"][channel][0].as_f64().unwrap();
    assert!((mean(0) / mean(1) - 2.0).abs() < 1e-3 && (mean(1) / mean(2) - 4.0).abs() < 1e-3, "{result}");
    // A cap of cos c and radiance 4 has 4 sqrt(pi) (1 - c) in band 0; 32 px see it within some percent.
    let expected = 4.0 * blocked_part(4.0, DVec3::NEG_Y)[0];
    assert!((mean(0) / expected - 1.0).abs() < 0.08, "{} for {expected}", mean(0));
    assert_eq!(folder.names(), ["ball.obj", "f.sf", "r.sf"]);
}

#[test]
fn devices_lists_the_one_that_is_taken() {
    let Some(folder) = Folder::with_device() else { return };
    let list = folder.json("devices");
    let chosen: Vec<_> = list.as_array().unwrap().iter().filter(|d| d["chosen"] == true).collect();
    let [device] = &chosen[..] else { panic!("{list}") };
    for key in ["name", "kind", "vulkan", "driver", "uuid"] {
        assert!(device[key].as_str().is_some_and(|s| !s.is_empty()), "{key}: {device}");
    }
    let table = folder.good("devices").stdout;
    assert!(table.contains(device["name"].as_str().unwrap()) && table.contains("chosen"), "{table}");
    assert!(folder.names().is_empty());
}

#[test]
fn demo_writes_pictures_and_a_table() {
    let Some(folder) = Folder::with_device() else { return };
    let ran = folder.good("demo --timed-frames 1 --size 96x64 --quality draft -o made/out");
    let scenes = "room sphere_over_plane torus_over_plane small_lights teapot_lights glowing_torus twelve_instances";
    let mut expected: Vec<String> = scenes.split(' ').map(|s| format!("{s}.png")).collect();
    expected.sort();
    assert_eq!(names(&folder.at("made/out")), expected);
    let pictures: Vec<_> = expected.iter().map(|name| picture(&folder, &format!("made/out/{name}"))).collect();
    assert!((0..pictures.len()).all(|i| (0..i).all(|j| pictures[i] != pictures[j])), "two pictures are equal");
    let rows: Vec<&str> = ran.stdout.lines().collect();
    assert!(rows[0].starts_with("scene") && rows[0].ends_with("frames/s  at 4 samples  at 1 sample"), "{}", ran.stdout);
    for (scene, row) in scenes.split(' ').zip(&rows[1..]) {
        let cells: Vec<&str> = row.split_whitespace().collect();
        assert!(cells[0] == scene && cells.len() == 10, "{row}");
        assert!(cells[5..].iter().all(|c| c.parse::<f64>().is_ok_and(|v| v > 0.0)), "{row}");
    }
    assert!(expected.iter().all(|name| ran.stdout.contains(&format!("made/out/{name}"))), "{}", ran.stdout);
}

#[test]
fn quiet_and_no_cache() {
    let Some(folder) = Folder::with_device() else { return };
    let render = format!("render {SCENE} -o p.png {SMALL}");
    assert_eq!(folder.run(&format!("{render} --quiet")).stderr, "");
    assert!(cache().join("fields").is_dir() && cache().join("spirv").is_dir());
    // Nothing is kept: neither in the named folder nor where the cache would be.
    let mut bare = folder.bare(&format!("{render} --no-cache --cache-dir named"));
    bare.env("XDG_CACHE_HOME", folder.at("home")).env("MESA_SHADER_CACHE_DISABLE", "true");
    let ran = finish(&mut bare).ended(0, &[]);
    assert!(ran.stderr.lines().count() <= 1, "only the note on the device: {}", ran.stderr);
    assert_eq!(folder.names(), ["p.png"]);
}

#[test]
fn shaders_can_be_replaced() {
    let Some(folder) = Folder::with_device() else { return };
    std::fs::create_dir(folder.at("glsl")).unwrap();
    let source = include_str!("../../glsl/merge.comp");
    let render = |output: &str| format!("render {SCENE} --lights sh --shader-dir glsl -o {output} {SMALL}");
    folder.good(&render("plain.png"));
    let last = "sum * receiver.albedo";
    assert!(source.contains(last));
    folder.write("glsl/merge.comp", source.replace(last, &format!("vec3(0.5, 0.25, 0.0) * {last}")));
    folder.good(&render("edited.png"));
    let [plain, edited] = ["plain.png", "edited.png"].map(|name| picture(&folder, name));
    let sum = |picture: &image::RgbImage, c: usize| picture.pixels().map(|p| u64::from(p.0[c])).sum::<u64>();
    assert!(sum(&edited, 0) < sum(&plain, 0) && sum(&edited, 2) < sum(&plain, 2) / 2);

    folder.write("glsl/merge.comp", source.replace(last, "sum * nonsense"));
    let line = 1 + source.lines().position(|l| l.contains(last)).unwrap();
    folder.run(&render("broken.png")).ended(1, &[&format!("merge.comp:{line}: "), "nonsense"]);
    assert_eq!(folder.names(), ["edited.png", "glsl", "plain.png"]);
}

/// Wrong on purpose: two bands err more than the default's four, and the picture says by how much.
#[test]
fn errors_are_shown_in_false_colour() {
    let Some(folder) = Folder::with_device() else { return };
    let shown = |name: &str, more: &str| {
        // Faces of 16 pixels would err as much as two bands do.
        let size = "--lattice cube:4x3 --face-px 64 --size 96x64";
        let render = format!("render {SCENE} -o p.png --lights sh --error {name} --rays 32 {size} {more}");
        let report = folder.json(&render);
        (image::load_from_memory(&folder.read(name)).unwrap().into_rgb8(), report["error"].clone())
    };
    let (picture, error) = shown("signed.png", "--error-limit 0.25");
    assert_eq!(error["scale"]["limit"], 0.25);
    assert!(picture.width() == 96 && picture.height() > 64, "a scale bar stands below the picture");
    let rms = error["rms"].as_f64().unwrap();
    assert!((0.005..0.3).contains(&rms), "{rms}");
    let (_, blurred) = shown("blurred.png", "--bands 2");
    assert!(blurred["rms"].as_f64().unwrap() > 1.2 * rms, "{blurred} against {rms}");
}
