//! Distant light: projections against a quadrature rule and closed forms, and the orientation of pictures.

mod sun;

use crate::common::cap;
use glam::{DVec3, Vec3};
use shadow_fields::asset::environment::{Environment, EnvironmentData, EnvironmentImage, Gradient, KeyLight};
use shadow_fields::asset::picture::{write_exr, write_png};
use shadow_fields::sh::{basis, quadrature};
use std::f64::consts::PI;
use std::path::Path;

fn build(source: &EnvironmentData) -> Environment {
    Environment::new(source, &|path: &Path| Ok(std::fs::read(path).unwrap())).unwrap()
}

fn of_image(file: &Path, scale: f32) -> EnvironmentData {
    EnvironmentData { image: Some(EnvironmentImage { file: file.into(), scale }), ..Default::default() }
}

/// The light of a linear picture of that width, by what it is described with besides.
fn of_pixels(width: usize, pixels: &[f32], scale: f32, turn_deg: f32) -> Environment {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    write_exr(&file, width as u32, (pixels.len() / 3 / width) as u32, pixels).unwrap();
    build(&EnvironmentData { turn_deg, ..of_image(&file, scale) })
}

/// Slow twin: radiance times basis, summed over a product rule of the given degree.
fn by_rule(environment: &Environment, bands: usize, degree: usize) -> [Vec<f64>; 3] {
    let mut sum = [(); 3].map(|()| vec![0.0; bands * bands]);
    for (direction, weight) in quadrature::sphere_rule(degree) {
        let values = basis::values(bands, direction);
        for (channel, radiance) in sum.iter_mut().zip(environment.radiance(direction)) {
            channel.iter_mut().zip(&values).for_each(|(c, v)| *c += weight * radiance * v);
        }
    }
    sum
}

fn agree(a: &[Vec<f64>; 3], b: &[Vec<f64>; 3], tolerance: f64) {
    for (x, y) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((x - y).abs() <= tolerance, "{x} {y}");
    }
}

/// Sources add: each stands beside a uniform sky.
#[test]
fn gradient_and_key_match_the_rule() {
    let uniform = EnvironmentData { uniform: Some(Vec3::new(0.5, 1.0, 2.0)), ..Default::default() };
    let gradient = Gradient { radiance: Vec3::new(0.3, 0.6, 1.2), base: 0.2, rise: 0.8 };
    let sky = build(&EnvironmentData { gradient: Some(gradient), ..uniform.clone() });
    assert!((sky.radiance(DVec3::Y)[2] - 3.2).abs() < 1e-6 && (sky.radiance(-DVec3::Y)[2] - 2.24).abs() < 1e-6);
    // max(0, y) has a kink: a rule of degree d is off by O(1 / d^2).
    agree(&sky.coefficients(5), &by_rule(&sky, 5, 120), 2e-3);
    for sharpness in [0.0, 0.7, 6.0, 24.0] {
        let key = KeyLight { radiance: Vec3::new(2.0, 1.0, 0.5), toward: Vec3::new(0.3, 2.0, -0.8), sharpness };
        let light = build(&EnvironmentData { key: Some(key), ..uniform.clone() });
        // Entire functions: the rule converges faster than any power.
        agree(&light.coefficients(6), &by_rule(&light, 6, 80), 1e-9);
    }
    // A sharp lobe is a point: z_0 -> 2 pi / s * Y_00.
    let key = KeyLight { radiance: Vec3::ONE, toward: Vec3::Z, sharpness: 1e5 };
    let c = build(&EnvironmentData { key: Some(key), ..Default::default() }).coefficients(2);
    let expected = 2.0 * PI / 1e5 * (0.25 / PI).sqrt();
    assert!((c[0][0] / expected - 1.0).abs() < 1e-9, "{} {expected}", c[0][0]);
}

#[test]
fn picture_orientation() {
    // 8 x 4: red = column, green = row.
    let pixels: Vec<f32> = (0..32).flat_map(|i| [(i % 8) as f32, (i / 8) as f32, 1.0]).collect();
    let sky = of_pixels(8, &pixels, 2.0, 0.0);
    let at = |x: f64, y: f64, z: f64| sky.radiance(DVec3::new(x, y, z).normalize()).map(|c| c / 2.0);
    assert_eq!(at(0.01, 0.01, -1.0), [4.0, 1.0, 1.0], "ahead, just right of the middle and above it");
    assert_eq!(at(-0.01, -0.01, -1.0), [3.0, 2.0, 1.0]);
    assert_eq!(at(1.0, 0.01, -0.01)[0], 5.0, "to the right");
    assert_eq!(at(-1.0, 0.01, -0.01)[0], 2.0, "to the left");
    assert_eq!(at(0.01, 0.01, 1.0)[0], 7.0, "behind, the right edge");
    assert_eq!(at(-0.01, 0.01, 1.0)[0], 0.0);
    assert_eq!((sky.radiance(DVec3::Y)[1], sky.radiance(-DVec3::Y)[1]), (0.0, 6.0), "the top row is +y");
}

#[test]
fn png_pictures_are_decoded_from_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.png");
    write_png(&file, 2, 1, &[0.18, 0.5, 1.0, 0.18, 0.5, 1.0], 0.0).unwrap();
    let sky = build(&of_image(&file, 1.0));
    for (value, expected) in sky.radiance(DVec3::X).into_iter().zip([0.18, 0.5, 1.0]) {
        // One 8-bit step at mid grey is about 0.8 %.
        assert!((value - expected).abs() < 5e-3, "{value} {expected}");
    }
}

/// The projection of a picture of that width and these red values.
fn picture(width: usize, red: &[f32], bands: usize) -> Vec<f64> {
    let pixels: Vec<f32> = red.iter().flat_map(|r| [*r, 0.0, 0.0]).collect();
    let [red, green, blue] = of_pixels(width, &pixels, 1.0, 0.0).coefficients(bands);
    assert!(green.iter().chain(&blue).all(|c| *c == 0.0));
    red
}

#[test]
fn texels_are_integrated_exactly() {
    let near = |a: &[f64], b: &[f64], what: &str| {
        assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-9), "{what}: {a:?} {b:?}");
    };
    let half = PI / 2.0;
    // Halves of the sphere are caps of 90 degrees, whatever the number of texels: up, down, left, right, ahead.
    near(&picture(1, &[1.0, 0.0], 7), &cap(7, DVec3::Y, half), "top row");
    near(&picture(3, &[0., 0., 0., 0., 0., 0., 1., 1., 1., 1., 1., 1.], 7), &cap(7, DVec3::NEG_Y, half), "lower rows");
    near(&picture(2, &[1.0, 0.0], 7), &cap(7, DVec3::NEG_X, half), "left half");
    near(&picture(2, &[0., 1., 0., 1., 0., 1.], 7), &cap(7, DVec3::X, half), "right half");
    near(&picture(4, &[0., 1., 1., 0.], 7), &cap(7, DVec3::NEG_Z, half), "the middle is ahead");
    // A polar cap of a third of the way down: 60 degrees.
    near(&picture(5, &[[1.0; 5].as_slice(), &[0.0; 10]].concat(), 7), &cap(7, DVec3::Y, PI / 3.0), "cap");
    // An octant: the integral of each axis over it is pi / 4. Column 2 of 4 is ahead to the right, the upper row.
    let octant = picture(4, &[0., 0., 1., 0., 0., 0., 0., 0.], 2);
    let first = 0.488_602_511_902_919_9 * PI / 4.0;
    near(&octant, &[(0.25 / PI).sqrt() * half, -first, -first, -first], "octant x > 0, y > 0, z < 0");
}

#[test]
fn a_turn_carries_everything_along() {
    let key = |toward: Vec3| KeyLight { radiance: Vec3::new(2.0, 1.0, 0.5), toward, sharpness: 6.0 };
    // A quarter turn, counter-clockwise seen from above, takes -z to -x and +x to -z.
    for (before, after) in
        [(Vec3::NEG_Z, Vec3::NEG_X), (Vec3::X, Vec3::NEG_Z), (Vec3::new(1.0, 2.0, 0.0), Vec3::new(0.0, 2.0, -1.0))]
    {
        let turned =
            build(&EnvironmentData { key: Some(key(before)), turn_deg: 90.0, strength: 3.0, ..Default::default() });
        let there = build(&EnvironmentData { key: Some(key(after)), ..Default::default() });
        let thrice = there.coefficients(5).map(|c| c.iter().map(|c| 3.0 * c).collect());
        agree(&turned.coefficients(5), &thrice, 1e-12);
        for (direction, _) in quadrature::sphere_rule(6) {
            let [a, b] = [turned.radiance(direction), there.radiance(direction)];
            assert!((a[0] - 3.0 * b[0]).abs() < 1e-12);
        }
    }
    // Pictures, too: a quarter turn moves the columns by a quarter of the width.
    let columns = |shift: usize| {
        (0..24).flat_map(|i| [[1.0, 2.0, 4.0, 8.0, 16.0, 3.0, 5.0, 7.0][(i + shift) % 8]; 3]).collect::<Vec<f32>>()
    };
    let of = |pixels: &[f32], turn_deg: f32| of_pixels(8, pixels, 0.5, turn_deg).coefficients(6);
    agree(&of(&columns(0), 90.0), &of(&columns(2), 0.0), 1e-9);
}

#[test]
fn a_picture_is_kept_under_another_description() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    write_exr(&file, 2, 1, &[1.0; 6]).unwrap();
    let source = of_image(&file, 1.0);
    let sky = build(&source);
    std::fs::remove_file(&file).unwrap();
    let bright = EnvironmentData { strength: 2.0, ..source.clone() };
    let brighter = sky.with(&bright).unwrap();
    assert_eq!(brighter.radiance(DVec3::X), [2.0; 3]);
    assert!(sky.with(&of_image(Path::new("other.exr"), 1.0)).is_err());
    assert!(sky.with(&EnvironmentData::default()).unwrap().is_none());
    let dark = sky.with(&EnvironmentData { strength: 0.0, ..source }).unwrap();
    assert!(dark.is_none() && dark.coefficients(3).iter().flatten().all(|c| *c == 0.0));
    assert_eq!(dark.with(&bright).unwrap().radiance(DVec3::Y), [2.0; 3]);
}

#[test]
fn hdr_pictures_are_read_and_oversized_ones_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.hdr");
    // Powers of two times three quarters are exact in RGBE.
    let pixels: Vec<image::Rgb<f32>> = (0..32).map(|i| image::Rgb([0.75 * 2.0_f32.powi(i / 4), 0.375, 12.0])).collect();
    let bytes = std::fs::File::create(&file).unwrap();
    image::codecs::hdr::HdrEncoder::new(bytes).encode(&pixels, 8, 4).unwrap();
    let sky = build(&of_image(&file, 1.0));
    assert_eq!(sky.radiance(DVec3::new(0.01, 0.1, -1.0).normalize())[0], 6.0, "row 1, column 4: the 12th pixel");
    assert_eq!(sky.radiance(DVec3::NEG_Y)[0], 96.0);
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 50000 +X 100000\n".to_vec();
    for bytes in [crate::common::huge_png(), hdr] {
        let source = of_image(Path::new("big"), 1.0);
        let error = Environment::new(&source, &|_: &Path| Ok(bytes.clone())).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("16384 x 8192 pixels"), "{error}");
    }
}
