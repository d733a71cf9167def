//! Rotation of coefficients is rotation of the function.

use super::{assert_close, random};
use fastrand::Rng;
use glam::{DQuat, DVec3};
use shadow_fields::sh::basis::{MAX_BANDS, values};
use shadow_fields::sh::quadrature::random_direction;
use shadow_fields::sh::rotation::{Rotation, rotate_program, turns};
use std::f64::consts::PI;

fn random_rotation(rng: &mut Rng) -> DQuat {
    DQuat::from_axis_angle(random_direction(rng), 2.0 * PI * rng.f64())
}

fn apply(rotation: &Rotation, coefficients: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; coefficients.len()];
    rotation.apply(coefficients, &mut out);
    out
}

fn value(bands: usize, coefficients: &[f64], direction: DVec3) -> f64 {
    coefficients.iter().zip(values(bands, direction)).map(|(c, y)| c * y).sum()
}

#[test]
fn rotated_coefficients_are_the_rotated_function() {
    let mut rng = Rng::with_seed(11);
    for bands in 1..=MAX_BANDS {
        for _ in 0..20 {
            let coefficients = random(&mut rng, bands);
            let turn = random_rotation(&mut rng);
            let rotated = apply(&Rotation::new(bands, turn), &coefficients);
            for _ in 0..50 {
                let direction = random_direction(&mut rng);
                let expected = value(bands, &coefficients, turn.inverse() * direction);
                let found = value(bands, &rotated, direction);
                assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{bands}: {found} {expected}");
            }
        }
    }
}

#[test]
fn the_program_that_is_printed_equals_the_rotation() {
    let mut rng = Rng::with_seed(13);
    let mut rotations: Vec<DQuat> = (0..20).map(|_| random_rotation(&mut rng)).collect();
    // Where the angles are not unique, and near it.
    rotations.extend([0.0, 1e-9, PI - 1e-9, PI].into_iter().flat_map(|angle| {
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| DQuat::from_axis_angle(axis, angle) * DQuat::from_rotation_z(0.7))
    }));
    for bands in 2..=6 {
        for &rotation in &rotations {
            let coefficients = random(&mut rng, bands);
            let expected = apply(&Rotation::new(bands, rotation), &coefficients);
            let mut out = vec![f64::NAN; coefficients.len() - 1];
            rotate_program(bands).evaluate(&[coefficients.as_slice(), &turns(rotation)].concat(), &mut out);
            // Block elements are at most 1 and sums at most 15 terms, from f64 tables of 1e-15.
            assert_close(&out, &expected[1..], 1e-12, "program");
        }
    }
}
