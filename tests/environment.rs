//! Distant light: projections against a quadrature rule and closed forms, and the orientation of pictures.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DVec3, Vec3};
use shadow_fields::asset::environment::{Environment, Gradient, Image, Key, Source};
use shadow_fields::asset::picture::{write_exr, write_png};
use shadow_fields::sh::{basis, quadrature};

fn build(source: &Source) -> Environment {
    Environment::new(source, &|path: &Path| Ok(std::fs::read(path).unwrap())).unwrap()
}

/// Slow twin: radiance times basis, summed over a product rule of the given degree.
fn by_rule(environment: &Environment, bands: usize, degree: usize) -> [Vec<f64>; 3] {
    let mut sum = [(); 3].map(|()| vec![0.0; bands * bands]);
    let mut values = vec![0.0; bands * bands];
    for (direction, weight) in quadrature::sphere_rule(degree) {
        basis::evaluate(bands, direction, &mut values);
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

#[test]
fn none_and_uniform() {
    let none = build(&Source::default());
    assert!(none.is_none() && none.coefficients(4).iter().flatten().all(|c| *c == 0.0));
    let uniform = build(&Source { uniform: Some(Vec3::new(0.5, 1.0, 2.0)), ..Default::default() });
    assert_eq!(uniform.radiance(DVec3::Y), [0.5, 1.0, 2.0]);
    let c = uniform.coefficients(4);
    for (channel, radiance) in c.iter().zip([0.5, 1.0, 2.0]) {
        assert!((channel[0] - radiance * (4.0 * PI).sqrt()).abs() < 1e-12 && channel[1..].iter().all(|v| *v == 0.0));
    }
}

#[test]
fn gradient_and_key_match_the_rule() {
    let gradient = Gradient { radiance: Vec3::new(0.3, 0.6, 1.2), base: 0.2, rise: 0.8 };
    let sky = build(&Source { gradient: Some(gradient), ..Default::default() });
    assert!((sky.radiance(DVec3::Y)[2] - 1.2).abs() < 1e-6 && (sky.radiance(-DVec3::Y)[2] - 0.24).abs() < 1e-6);
    // max(0, y) has a kink: a rule of degree d is off by O(1 / d^2).
    agree(&sky.coefficients(5), &by_rule(&sky, 5, 120), 2e-3);
    for sharpness in [0.0, 0.7, 6.0, 24.0] {
        let key = Key { radiance: Vec3::new(2.0, 1.0, 0.5), toward: Vec3::new(0.3, 2.0, -0.8), sharpness };
        let light = build(&Source { key: Some(key), ..Default::default() });
        // Entire functions: the rule converges faster than any power.
        agree(&light.coefficients(6), &by_rule(&light, 6, 80), 1e-9);
    }
    // A sharp lobe is a point: z_0 -> 2 pi / s * Y_00.
    let key = Key { radiance: Vec3::ONE, toward: Vec3::Z, sharpness: 1e5 };
    let c = build(&Source { key: Some(key), ..Default::default() }).coefficients(2);
    let expected = 2.0 * PI / 1e5 * (0.25 / PI).sqrt();
    assert!((c[0][0] / expected - 1.0).abs() < 1e-9, "{} {expected}", c[0][0]);
}

#[test]
fn sources_add() {
    let uniform = Source { uniform: Some(Vec3::new(0.5, 1.0, 2.0)), ..Default::default() };
    let key = Key { radiance: Vec3::ONE, toward: Vec3::X, sharpness: 3.0 };
    let both = build(&Source { key: Some(key.clone()), ..uniform.clone() }).coefficients(3);
    let a = build(&uniform).coefficients(3);
    let b = build(&Source { key: Some(key), ..Default::default() }).coefficients(3);
    for k in 0..3 {
        for i in 0..9 {
            assert!((both[k][i] - a[k][i] - b[k][i]).abs() < 1e-12);
        }
    }
}

#[test]
fn picture_orientation() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    // 8 x 4: red = column, green = row.
    let pixels: Vec<f32> = (0..32).flat_map(|i| [(i % 8) as f32, (i / 8) as f32, 1.0]).collect();
    write_exr(&file, 8, 4, &pixels).unwrap();
    let sky = build(&Source { image: Some(Image { file, scale: 2.0 }), ..Default::default() });
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
fn picture_projection() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    let (width, height) = (256usize, 128usize);
    // A white picture has the coefficients of a uniform sky exactly in band 0: solid angles sum to 4 pi.
    write_exr(&file, 256, 128, &vec![1.0; width * height * 3]).unwrap();
    let white = build(&Source { image: Some(Image { file: file.clone(), scale: 1.0 }), ..Default::default() });
    for channel in white.coefficients(4) {
        assert!((channel[0] - (4.0 * PI).sqrt()).abs() < 1e-9);
        // Texel centres stand in for texels: O(h^2), h = 0.025.
        assert!(channel[1..].iter().all(|c| c.abs() < 2e-4), "{channel:?}");
    }
    // A smooth light drawn into a picture projects as the light does.
    let key = Key { radiance: Vec3::new(1.0, 0.5, 0.25), toward: Vec3::new(0.6, 0.7, -0.4), sharpness: 5.0 };
    let light = build(&Source { key: Some(key), ..Default::default() });
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (s, c) = (PI * (y as f64 + 0.5) / height as f64).sin_cos();
            let azimuth = 2.0 * PI * (x as f64 + 0.5) / width as f64 - PI;
            pixels.extend(light.radiance(DVec3::new(s * azimuth.sin(), c, -s * azimuth.cos())).map(|v| v as f32));
        }
    }
    write_exr(&file, 256, 128, &pixels).unwrap();
    let drawn = build(&Source { image: Some(Image { file, scale: 1.0 }), ..Default::default() });
    agree(&drawn.coefficients(5), &light.coefficients(5), 3e-4);
}

#[test]
fn png_pictures_are_decoded_from_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.png");
    write_png(&file, 2, 1, &[0.18, 0.5, 1.0, 0.18, 0.5, 1.0], 0.0).unwrap();
    let sky = build(&Source { image: Some(Image { file, scale: 1.0 }), ..Default::default() });
    for (value, expected) in sky.radiance(DVec3::X).into_iter().zip([0.18, 0.5, 1.0]) {
        // One 8-bit step at mid grey is about 0.8 %.
        assert!((value - expected).abs() < 5e-3, "{value} {expected}");
    }
}
