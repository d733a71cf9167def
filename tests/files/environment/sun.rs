//! Generated skies, and suns, which are discs of their own.

use super::{agree, build, by_rule};
use glam::{DVec3, Vec3};
use shadow_fields::asset::disc::{Disc, Sun};
use shadow_fields::asset::environment::{Environment, EnvironmentData, EnvironmentImage};
use shadow_fields::asset::picture::write_exr;
use shadow_fields::asset::sky::Sky;
use shadow_fields::sh::{lobe, quadrature};
use std::f64::consts::PI;
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
    let sum = x + y + z;
    assert!((x / sum - 0.244_411_9).abs() < 2e-4 && (y / sum - 0.250_520_8).abs() < 2e-4, "{x} {y} {z}");
    assert!((luminance(at(60.0, 180.0)) / y - 0.868_447_5).abs() < 2e-3, "{}", luminance(at(60.0, 180.0)) / y);
    assert!((luminance(at(50.0, 0.0)) / y - 4.515_885).abs() < 1e-2, "{}", luminance(at(50.0, 0.0)) / y);
    assert!(b > 1.5 * r, "blue overhead");
    assert_eq!(at(120.0, 10.0), [0.0; 3]);
    // White level ground shows what was asked for: 1 / pi of the irradiance, by a cosine lobe of bands 0, 1, 2, 4, 6.
    let cosine = lobe::clamped_cosine(7, DVec3::Y);
    let level =
        |e: &Environment| e.coefficients(7).map(|c| c.iter().zip(&cosine).map(|(c, l)| c * l).sum::<f64>() / PI);
    assert!((luminance(level(&sky)) - 0.5).abs() < 2e-3, "{:?}", level(&sky));
    // The sun adds its share to what faces it, mostly red when it is low; the ground answers with its reflectance.
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
    let [red, green] = [0, 1].map(|c| ground[c] / white[c]);
    assert!((red - 0.5).abs() < 1e-2 && (green - 0.25).abs() < 1e-2 && ground[2] < 1e-9, "{ground:?}");
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

/// Discs follow strength and turn, and stay out of what is projected.
#[test]
fn a_sun_is_a_disc_of_its_own() {
    let sun =
        |angle_deg, radiance| Sun { toward: Vec3::new(0.0, 3.0, -3.0), angle_deg, radiance: Vec3::splat(radiance) };
    let source = EnvironmentData { sun: Some(sun(2.0, 10.0)), strength: 0.5, turn_deg: 90.0, ..Default::default() };
    let environment = build(&source);
    let [disc] = environment.discs()[..] else { panic!("one sun") };
    assert!(disc.toward.distance(DVec3::new(-1.0, 1.0, 0.0).normalize()) < 1e-6, "{}", disc.toward);
    assert!((disc.half_angle_rad - 1.0_f64.to_radians()).abs() < 1e-7, "{}", disc.half_angle_rad);
    assert!(disc.radiance.distance(DVec3::splat(5.0)) < 1e-6, "{}", disc.radiance);
    assert!(environment.is_none() && environment.coefficients(4).iter().flatten().all(|c| *c == 0.0));
    let nowhere = Sun { toward: Vec3::ZERO, ..sun(1.0, 1.0) };
    let odd = [sun(0.0, 1.0), sun(91.0, 1.0), sun(f32::NAN, 1.0), sun(1.0, -1.0), sun(1.0, f32::INFINITY)];
    for bad in odd.into_iter().chain([nowhere]) {
        let refused = Environment::new(&EnvironmentData { sun: Some(bad), ..Default::default() }, &|_| unreachable!());
        assert!(refused.unwrap_err().to_string().contains("environment sun"));
    }
}

/// What is taken out of a picture as a disc and what is left send as much light as the picture did, of every colour.
#[test]
fn the_lights_of_a_picture_are_taken_out_whole() {
    const SIZE: [u32; 2] = [512, 256];
    let folder = tempfile::tempdir().unwrap();
    let open = |name: &str, radiance: &dyn Fn(DVec3) -> [f32; 3]| {
        let file = folder.path().join(name);
        let [width, height] = SIZE.map(f64::from);
        let texel = |i: u32| {
            let x = f64::from(i % SIZE[0]) + 0.5;
            let y = f64::from(i / SIZE[0]) + 0.5;
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
        let environment = build(&EnvironmentData { image, strength: 0.5, ..Default::default() });
        (environment, [0, 1, 2].map(sum).map(|s: f64| 1.5 * s))
    };
    let sun = DVec3::new(0.3, 0.6, -0.7).normalize();
    let sky = |d: DVec3| 0.2 + 0.3 * d.y.max(0.0) as f32;
    let spot =
        |d: DVec3, half_deg: f64, over: f32| if d.angle_between(sun) < half_deg.to_radians() { over } else { 0.0 };
    let (sunny, whole) = open("sunny.exr", &|d| [1.0, 0.9, 0.7].map(|c| c * (sky(d) + spot(d, 1.5, 900.0))));
    let [disc] = sunny.discs()[..] else { panic!("one sun") };
    assert!(disc.toward.angle_between(sun) < 0.1_f64.to_radians(), "{}", disc.toward);
    assert!((disc.half_angle_rad.to_degrees() - 1.5).abs() < 0.15, "{}", disc.half_angle_rad.to_degrees());
    let sends = |environment: &Environment, channel: usize| {
        let discs = environment.discs();
        let of_disc = |disc: &Disc| disc.radiance[channel] * Disc::solid_angle(disc.half_angle_rad);
        environment.coefficients(1)[channel][0] * (4.0 * PI).sqrt() + discs.iter().map(of_disc).sum::<f64>()
    };
    for (channel, whole) in whole.into_iter().enumerate() {
        let sum = sends(&sunny, channel);
        assert!((sum / whole - 1.0).abs() < 1e-5, "{sum} for {whole}");
    }
    assert!(sunny.radiance(sun)[0] < 1.0, "what is left is as bright as what is around: {:?}", sunny.radiance(sun));
    // A round window beside one of 40 by 40 degrees across the picture's edge, and a strip of sky too long for a disc.
    let pane = |d: DVec3| d.z > 0.0 && (d.x / d.z).abs().max((d.y / d.z).abs()) < 20_f64.to_radians().tan();
    let strip = |d: DVec3| d.y.abs() < 0.02 && d.z < 0.0;
    let (room, whole) =
        open("room.exr", &|d| [0.1 + spot(d, 20.0, 9.0) + if pane(d) || strip(d) { 6.0 } else { 0.0 }; 3]);
    let [round, square] = room.discs()[..] else { panic!("{} windows", room.discs().len()) };
    assert!(round.toward.angle_between(sun) < 0.01 && (round.half_angle_rad.to_degrees() - 20.0).abs() < 0.5);
    let degrees = square.half_angle_rad.to_degrees();
    assert!(square.toward.angle_between(DVec3::Z) < 0.01 && (degrees - 22.5).abs() < 1.0, "{degrees}");
    let sum = sends(&room, 0);
    assert!((sum / whole[0] - 1.0).abs() < 1e-5, "{sum} for {}", whole[0]);
    // Nothing is taken from pictures without a bright spot.
    for (name, radiance) in [
        ("even.exr", &(|_| [1.0_f32; 3]) as &dyn Fn(DVec3) -> [f32; 3]),
        ("sky.exr", &|d| [sky(d); 3]),
        ("half.exr", &|d| [if d.x > 0.0 { 9.0 } else { 0.1 }; 3]),
        ("star.exr", &|d| [sky(d) + spot(d, 0.6, 5.0); 3]),
        ("dark.exr", &|_| [0.0; 3]),
    ] {
        let (environment, whole) = open(name, radiance);
        assert!(environment.discs().is_empty(), "{name}");
        let left = environment.coefficients(1)[0][0] * (4.0 * PI).sqrt();
        assert!((left - whole[0]).abs() <= 1e-6 * whole[0], "{name}: {left} for {}", whole[0]);
    }
}
