//! Distant light: projections against a quadrature rule and closed forms, and the orientation of pictures.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DVec3, Vec3};
use shadow_fields::asset::disc::Sun;
use shadow_fields::asset::environment::{Environment, EnvironmentData, EnvironmentImage, Gradient, KeyLight};
use shadow_fields::asset::picture::{write_exr, write_png};
use shadow_fields::asset::sky::Sky;
use shadow_fields::sh::{basis, lobe, quadrature};

fn build(source: &EnvironmentData) -> Environment {
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
    let none = build(&EnvironmentData::default());
    assert!(none.is_none() && none.coefficients(4).iter().flatten().all(|c| *c == 0.0));
    let uniform = build(&EnvironmentData { uniform: Some(Vec3::new(0.5, 1.0, 2.0)), ..Default::default() });
    assert_eq!(uniform.radiance(DVec3::Y), [0.5, 1.0, 2.0]);
    let c = uniform.coefficients(4);
    for (channel, radiance) in c.iter().zip([0.5, 1.0, 2.0]) {
        assert!((channel[0] - radiance * (4.0 * PI).sqrt()).abs() < 1e-12 && channel[1..].iter().all(|v| *v == 0.0));
    }
}

#[test]
fn gradient_and_key_match_the_rule() {
    let gradient = Gradient { radiance: Vec3::new(0.3, 0.6, 1.2), base: 0.2, rise: 0.8 };
    let sky = build(&EnvironmentData { gradient: Some(gradient), ..Default::default() });
    assert!((sky.radiance(DVec3::Y)[2] - 1.2).abs() < 1e-6 && (sky.radiance(-DVec3::Y)[2] - 0.24).abs() < 1e-6);
    // max(0, y) has a kink: a rule of degree d is off by O(1 / d^2).
    agree(&sky.coefficients(5), &by_rule(&sky, 5, 120), 2e-3);
    for sharpness in [0.0, 0.7, 6.0, 24.0] {
        let key = KeyLight { radiance: Vec3::new(2.0, 1.0, 0.5), toward: Vec3::new(0.3, 2.0, -0.8), sharpness };
        let light = build(&EnvironmentData { key: Some(key), ..Default::default() });
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
fn sources_add() {
    let uniform = EnvironmentData { uniform: Some(Vec3::new(0.5, 1.0, 2.0)), ..Default::default() };
    let key = KeyLight { radiance: Vec3::ONE, toward: Vec3::X, sharpness: 3.0 };
    let both = build(&EnvironmentData { key: Some(key.clone()), ..uniform.clone() }).coefficients(3);
    let a = build(&uniform).coefficients(3);
    let b = build(&EnvironmentData { key: Some(key), ..Default::default() }).coefficients(3);
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
    let sky = build(&EnvironmentData { image: Some(EnvironmentImage { file, scale: 2.0 }), ..Default::default() });
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
    let white = build(&EnvironmentData {
        image: Some(EnvironmentImage { file: file.clone(), scale: 1.0 }),
        ..Default::default()
    });
    for channel in white.coefficients(4) {
        assert!((channel[0] - (4.0 * PI).sqrt()).abs() < 1e-9);
        assert!(channel[1..].iter().all(|c| c.abs() < 1e-12), "{channel:?}");
    }
    // A smooth light drawn into a picture projects as the light does.
    let key = KeyLight { radiance: Vec3::new(1.0, 0.5, 0.25), toward: Vec3::new(0.6, 0.7, -0.4), sharpness: 5.0 };
    let light = build(&EnvironmentData { key: Some(key), ..Default::default() });
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (s, c) = (PI * (y as f64 + 0.5) / height as f64).sin_cos();
            let azimuth = 2.0 * PI * (x as f64 + 0.5) / width as f64 - PI;
            pixels.extend(light.radiance(DVec3::new(s * azimuth.sin(), c, -s * azimuth.cos())).map(|v| v as f32));
        }
    }
    write_exr(&file, 256, 128, &pixels).unwrap();
    let drawn = build(&EnvironmentData { image: Some(EnvironmentImage { file, scale: 1.0 }), ..Default::default() });
    agree(&drawn.coefficients(5), &light.coefficients(5), 3e-4);
}

#[test]
fn png_pictures_are_decoded_from_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.png");
    write_png(&file, 2, 1, &[0.18, 0.5, 1.0, 0.18, 0.5, 1.0], 0.0).unwrap();
    let sky = build(&EnvironmentData { image: Some(EnvironmentImage { file, scale: 1.0 }), ..Default::default() });
    for (value, expected) in sky.radiance(DVec3::X).into_iter().zip([0.18, 0.5, 1.0]) {
        // One 8-bit step at mid grey is about 0.8 %.
        assert!((value - expected).abs() < 5e-3, "{value} {expected}");
    }
}

/// The projection of a picture of these red values.
fn picture(width: u32, height: u32, red: &[f32], bands: usize) -> Vec<f64> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    write_exr(&file, width, height, &red.iter().flat_map(|r| [*r, 0.0, 0.0]).collect::<Vec<_>>()).unwrap();
    let sky = build(&EnvironmentData { image: Some(EnvironmentImage { file, scale: 1.0 }), ..Default::default() });
    let [red, green, blue] = sky.coefficients(bands);
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
    near(&picture(1, 2, &[1.0, 0.0], 7), &lobe::cap(7, DVec3::Y, half), "top row");
    near(
        &picture(3, 4, &[0., 0., 0., 0., 0., 0., 1., 1., 1., 1., 1., 1.], 7),
        &lobe::cap(7, DVec3::NEG_Y, half),
        "lower rows",
    );
    near(&picture(2, 1, &[1.0, 0.0], 7), &lobe::cap(7, DVec3::NEG_X, half), "left half");
    near(&picture(2, 3, &[0., 1., 0., 1., 0., 1.], 7), &lobe::cap(7, DVec3::X, half), "right half");
    near(&picture(4, 1, &[0., 1., 1., 0.], 7), &lobe::cap(7, DVec3::NEG_Z, half), "the middle is ahead");
    // A polar cap of a third of the way down: 60 degrees.
    near(&picture(5, 3, &[[1.0; 5].as_slice(), &[0.0; 10]].concat(), 7), &lobe::cap(7, DVec3::Y, PI / 3.0), "cap");
    // An octant: the integral of each axis over it is pi / 4. Column 2 of 4 is ahead to the right, the upper row.
    let octant = picture(4, 2, &[0., 0., 1., 0., 0., 0., 0., 0.], 2);
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
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    let columns = |shift: usize| {
        (0..24).flat_map(|i| [[1.0, 2.0, 4.0, 8.0, 16.0, 3.0, 5.0, 7.0][(i + shift) % 8]; 3]).collect::<Vec<f32>>()
    };
    let of = |pixels: &[f32], turn_deg: f32| {
        write_exr(&file, 8, 3, pixels).unwrap();
        build(&EnvironmentData {
            image: Some(EnvironmentImage { file: file.clone(), scale: 0.5 }),
            turn_deg,
            ..Default::default()
        })
        .coefficients(6)
    };
    agree(&of(&columns(0), 90.0), &of(&columns(2), 0.0), 1e-9);
}

#[test]
fn a_picture_is_kept_under_another_description() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.exr");
    write_exr(&file, 2, 1, &[1.0; 6]).unwrap();
    let source =
        EnvironmentData { image: Some(EnvironmentImage { file: file.clone(), scale: 1.0 }), ..Default::default() };
    let sky = build(&source);
    std::fs::remove_file(&file).unwrap();
    let brighter = sky.with(&EnvironmentData { strength: 2.0, ..source.clone() }).unwrap();
    assert_eq!(brighter.radiance(DVec3::X), [2.0; 3]);
    let other = EnvironmentImage { file: "other.exr".into(), scale: 1.0 };
    assert!(sky.with(&EnvironmentData { image: Some(other), ..Default::default() }).is_err());
    assert!(sky.with(&EnvironmentData::default()).unwrap().is_none());
    let dark = sky.with(&EnvironmentData { strength: 0.0, ..source }).unwrap();
    assert!(dark.is_none() && dark.coefficients(3).iter().flatten().all(|c| *c == 0.0));
    assert_eq!(dark.with(brighter.source()).unwrap().radiance(DVec3::Y), [2.0; 3]);
}

fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

#[test]
fn a_generated_sky_is_the_papers() {
    let dome = |sky: Sky| build(&EnvironmentData { sky: Some(sky), ..Default::default() });
    let clear = Sky {
        sun_elevation_deg: 40.0,
        sun_azimuth_deg: 0.0,
        turbidity: 3.0,
        radiance: 0.5,
        sun: 0.0,
        sun_angle_deg: 0.53,
        ground: Vec3::ZERO,
    };
    let sky = dome(clear.clone());
    let at = |polar_deg: f64, azimuth_deg: f64| {
        let ((s, c), (a, b)) = (polar_deg.to_radians().sin_cos(), azimuth_deg.to_radians().sin_cos());
        sky.radiance(DVec3::new(s * a, c, -s * b))
    };
    // Chromaticity overhead and two ratios of luminance, from the paper's formulas by hand.
    let [r, g, b] = at(0.0, 0.0);
    let x = 0.4124 * r + 0.3576 * g + 0.1805 * b;
    let y = luminance([r, g, b]);
    let z = 0.0193 * r + 0.1192 * g + 0.9505 * b;
    assert!(
        (x / (x + y + z) - 0.244_411_9).abs() < 2e-4 && (y / (x + y + z) - 0.250_520_8).abs() < 2e-4,
        "{x} {y} {z}"
    );
    assert!((luminance(at(60.0, 180.0)) / y - 0.868_447_5).abs() < 2e-3, "{}", luminance(at(60.0, 180.0)) / y);
    assert!((luminance(at(50.0, 0.0)) / y - 4.515_885).abs() < 1e-2, "{}", luminance(at(50.0, 0.0)) / y);
    assert!(b > 1.5 * r, "blue overhead");
    assert_eq!(at(120.0, 10.0), [0.0; 3]);
    // White level ground shows what was asked for: 1 / pi of the irradiance, which a cosine lobe takes from bands 0, 1, 2, 4, 6.
    let cosine = lobe::clamped_cosine(7, DVec3::Y);
    let level =
        |e: &Environment| e.coefficients(7).map(|c| c.iter().zip(&cosine).map(|(c, l)| c * l).sum::<f64>() / PI);
    assert!((luminance(level(&sky)) - 0.5).abs() < 2e-3, "{:?}", level(&sky));
    // The sun adds its share of that to what faces it, mostly red when it is low; the ground answers with its reflectance.
    let noon = Sky { sun_elevation_deg: 90.0, sun: 2.0, ground: Vec3::new(0.5, 0.25, 0.0), ..clear.clone() };
    let sunny = dome(noon);
    let facing = |e: &Environment| {
        let [disc] = e.discs()[..] else { panic!("one sun") };
        (disc.toward, disc.radiance * disc.half_angle_rad.sin().powi(2))
    };
    let (toward, sun) = facing(&sunny);
    assert!(toward.distance(DVec3::Y) < 1e-9 && dome(clear.clone()).discs().is_empty());
    let white = (DVec3::from_array(level(&sunny)) + sun).to_array();
    assert!((luminance(white) - 1.5).abs() < 2e-3, "{white:?}");
    let ground = sunny.radiance(DVec3::new(0.6, -0.8, 0.0));
    assert!(
        (ground[0] / white[0] - 0.5).abs() < 1e-2 && (ground[1] / white[1] - 0.25).abs() < 1e-2 && ground[2] < 1e-9
    );
    let low = dome(Sky { sun_elevation_deg: 3.0, sun_azimuth_deg: 90.0, sun: 2.0, ..clear.clone() });
    let (toward, sun) = facing(&low);
    assert!(sun.x > 3.0 * sun.z && toward.x > 0.99, "a low sun over the right is red: {sun} from {toward}");
    // Everywhere finite and not negative, at every corner of the keys' ranges; the projection is that of what rays see.
    for (sun_elevation_deg, turbidity) in [(0.0, 2.0), (0.0, 10.0), (90.0, 2.0), (90.0, 10.0), (25.0, 5.0)] {
        let sky = dome(Sky { sun_elevation_deg, turbidity, sun: 1.0, ground: Vec3::splat(0.3), ..clear.clone() });
        for (direction, _) in quadrature::sphere_rule(40) {
            assert!(sky.radiance(direction).iter().all(|c| c.is_finite() && *c >= 0.0));
        }
        // The horizon is an edge: a rule of degree d is off by O(1 / d) of it.
        let coefficients = sky.coefficients(4);
        let largest = coefficients.iter().flatten().fold(0.0_f64, |most, c| most.max(c.abs()));
        agree(&coefficients, &by_rule(&sky, 4, 250), 1e-2 * largest);
    }
}

#[test]
fn hdr_pictures_are_read_and_oversized_ones_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sky.hdr");
    // Powers of two times three quarters are exact in RGBE.
    let pixels: Vec<image::Rgb<f32>> = (0..32).map(|i| image::Rgb([0.75 * 2.0_f32.powi(i / 4), 0.375, 12.0])).collect();
    let bytes = std::fs::File::create(&file).unwrap();
    image::codecs::hdr::HdrEncoder::new(bytes).encode(&pixels, 8, 4).unwrap();
    let sky = build(&EnvironmentData {
        image: Some(EnvironmentImage { file: file.clone(), scale: 1.0 }),
        ..Default::default()
    });
    assert_eq!(sky.radiance(DVec3::new(0.01, 0.1, -1.0).normalize())[0], 6.0, "row 1, column 4: the 12th pixel");
    assert_eq!(sky.radiance(DVec3::NEG_Y)[0], 96.0);
    let chunk = |name: &[u8], data: &[u8]| {
        let body = [name, data].concat();
        // CRC-32 as PNG has it, bit by bit.
        let crc = !body.iter().fold(!0_u32, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
        });
        [&(data.len() as u32).to_be_bytes()[..], &body, &crc.to_be_bytes()].concat()
    };
    let header = [&100_000_u32.to_be_bytes()[..], &50_000_u32.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
    let png =
        [b"\x89PNG\r\n\x1a\n".to_vec(), chunk(b"IHDR", &header), chunk(b"IDAT", &[0; 9]), chunk(b"IEND", b"")].concat();
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 50000 +X 100000\n".to_vec();
    for bytes in [png, hdr] {
        let source =
            EnvironmentData { image: Some(EnvironmentImage { file: "big".into(), scale: 1.0 }), ..Default::default() };
        let error = Environment::new(&source, &|_: &Path| Ok(bytes.clone())).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("16384 x 8192 pixels"), "{error}");
    }
}

/// Discs follow strength and turn, and stay out of what is projected.
#[test]
fn a_sun_is_a_disc_of_its_own() {
    let sun =
        |angle_deg, radiance| Sun { toward: Vec3::new(0.0, 3.0, -3.0), angle_deg, radiance: Vec3::splat(radiance) };
    let source = EnvironmentData { sun: Some(sun(2.0, 10.0)), strength: 0.5, turn_deg: 90.0, ..Default::default() };
    let environment = build(&source);
    let [disc] = environment.discs()[..] else { panic!("one sun") };
    assert!(disc.toward.distance(DVec3::new(-1.0, 1.0, 0.0).normalize()) < 1e-6, "{}", disc.toward);
    assert!(
        (disc.half_angle_rad - 1.0_f64.to_radians()).abs() < 1e-7 && disc.radiance.distance(DVec3::splat(5.0)) < 1e-6
    );
    assert!(environment.is_none() && environment.coefficients(4).iter().flatten().all(|c| *c == 0.0));
    for bad in [sun(0.0, 1.0), sun(91.0, 1.0), sun(f32::NAN, 1.0), sun(1.0, -1.0), sun(1.0, f32::INFINITY)] {
        let refused = Environment::new(&EnvironmentData { sun: Some(bad), ..Default::default() }, &|_| unreachable!());
        assert!(refused.unwrap_err().to_string().contains("environment sun"));
    }
    let nowhere = Sun { toward: Vec3::ZERO, ..sun(1.0, 1.0) };
    assert!(
        Environment::new(&EnvironmentData { sun: Some(nowhere), ..Default::default() }, &|_| unreachable!()).is_err()
    );
}

/// What is taken out of a picture as a disc and what is left send as much light as the picture did, of every colour.
#[test]
fn the_sun_of_a_picture_is_taken_out_whole() {
    const SIZE: [u32; 2] = [512, 256];
    let folder = tempfile::tempdir().unwrap();
    let open = |name: &str, radiance: &dyn Fn(DVec3) -> [f32; 3]| {
        let file = folder.path().join(name);
        let [width, height] = SIZE.map(f64::from);
        let texel = |i: u32| {
            let (x, y) = (f64::from(i % SIZE[0]) + 0.5, f64::from(i / SIZE[0]) + 0.5);
            let (across, ahead) = (2.0 * PI * (x / width - 0.5)).sin_cos();
            let (level, up) = (PI * y / height).sin_cos();
            radiance(DVec3::new(level * across, up, -level * ahead))
        };
        let texels: Vec<f32> = (0..SIZE[0] * SIZE[1]).flat_map(texel).collect();
        write_exr(&file, SIZE[0], SIZE[1], &texels).unwrap();
        // The sum over texels of radiance and solid angle, by hand.
        let solid =
            |y: u32| 2.0 * PI / width * ((PI * f64::from(y) / height).cos() - (PI * f64::from(y + 1) / height).cos());
        let sum =
            |c: usize| (0..SIZE[0] * SIZE[1]).map(|i| f64::from(texels[3 * i as usize + c]) * solid(i / SIZE[0])).sum();
        let image = Some(EnvironmentImage { file, scale: 3.0 });
        (
            build(&EnvironmentData { image, strength: 0.5, ..Default::default() }),
            [0, 1, 2].map(sum).map(|s: f64| 1.5 * s),
        )
    };
    let sun = DVec3::new(0.3, 0.6, -0.7).normalize();
    let sky = |d: DVec3| 0.2 + 0.3 * d.y.max(0.0) as f32;
    let spot =
        |d: DVec3, half_deg: f64, over: f32| if d.angle_between(sun) < half_deg.to_radians() { over } else { 0.0 };
    let (sunny, whole) = open("sunny.exr", &|d| [1.0, 0.9, 0.7].map(|c| c * (sky(d) + spot(d, 1.5, 900.0))));
    let [disc] = sunny.discs()[..] else { panic!("one sun") };
    assert!(disc.toward.angle_between(sun) < 0.1_f64.to_radians(), "{}", disc.toward);
    assert!((disc.half_angle_rad.to_degrees() - 1.5).abs() < 0.15, "{}", disc.half_angle_rad.to_degrees());
    let solid_angle = 4.0 * PI * (disc.half_angle_rad / 2.0).sin().powi(2);
    for (channel, (rest, whole)) in sunny.coefficients(1).iter().zip(whole).enumerate() {
        let sum = rest[0] * (4.0 * PI).sqrt() + disc.radiance[channel] * solid_angle;
        assert!((sum / whole - 1.0).abs() < 1e-5, "{sum} for {whole}");
    }
    assert!(sunny.radiance(sun)[0] < 1.0, "what is left is as bright as what is around: {:?}", sunny.radiance(sun));
    // Nothing is taken from pictures without a small bright spot.
    for (name, radiance) in [
        ("even.exr", &(|_| [1.0_f32; 3]) as &dyn Fn(DVec3) -> [f32; 3]),
        ("sky.exr", &|d| [sky(d); 3]),
        ("window.exr", &|d| [sky(d) + spot(d, 20.0, 30.0); 3]),
        ("star.exr", &|d| [sky(d) + spot(d, 0.6, 5.0); 3]),
        ("dark.exr", &|_| [0.0; 3]),
    ] {
        let (environment, whole) = open(name, radiance);
        assert!(environment.discs().is_empty(), "{name}");
        let left = environment.coefficients(1)[0][0] * (4.0 * PI).sqrt();
        assert!((left - whole[0]).abs() <= 1e-6 * whole[0], "{name}: {left} for {}", whole[0]);
    }
}
