//! Cube geometry against Vulkan's table, solid angles, projection.

use super::random;
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::sh::basis::values;
use shadow_fields::sh::cube::{FACE_COUNT, direction, face_st, solid_angle, texel_st};
use shadow_fields::sh::project::project;
use shadow_fields::sh::quadrature::random_direction;
use std::f64::consts::PI;

/// The table of the Vulkan specification as it is printed there: (sc, tc, rc) of a direction on each face.
fn vulkan_table(face: usize, r: DVec3) -> [f64; 3] {
    match face {
        0 => [-r.z, -r.y, r.x],
        1 => [r.z, -r.y, r.x],
        2 => [r.x, r.z, r.y],
        3 => [r.x, -r.z, r.y],
        4 => [r.x, -r.y, r.z],
        _ => [-r.x, -r.y, r.z],
    }
}

#[test]
fn faces_and_axes_are_vulkans() {
    let mut rng = Rng::with_seed(21);
    let mut visits = [0; FACE_COUNT];
    for _ in 0..2000 {
        let r = random_direction(&mut rng) * (0.1 + 9.0 * rng.f64());
        let (face, s, t) = face_st(r);
        visits[face] += 1;
        let [sc, tc, rc] = vulkan_table(face, r);
        assert_eq!(rc.abs(), r.abs().max_element(), "the major axis of {r} is face {face}'s");
        assert_eq!(rc > 0.0, face % 2 == 0, "sign of face {face}");
        // The specification's s and t are in [0, 1]: (sc / |rc| + 1) / 2.
        assert!((s - sc / rc.abs()).abs() < 1e-15 && (t - tc / rc.abs()).abs() < 1e-15, "{r} on face {face}: {s} {t}");
        assert!((direction(face, s, t) - r.normalize()).length() < 1e-15, "{r} and back");
    }
    assert!(visits.iter().all(|&count| count > 200), "every face was met: {visits:?}");
}

#[test]
fn solid_angles_are_exact() {
    for face_px in [1, 2, 3, 8, 32, 101] {
        let angles = solid_angle(face_px);
        assert_eq!(angles.len(), face_px * face_px);
        // A texel of 101^2 is 1e-4 sr, from differences of arctangents up to .5 of rounding 1e-16.
        let sum: f64 = angles.iter().sum();
        assert!((6.0 * sum - 4.0 * PI).abs() < 1e-12, "{face_px}: {sum}");
        for y in 0..face_px {
            for x in 0..face_px {
                let mirrored = angles[x * face_px + face_px - 1 - y];
                assert!((angles[y * face_px + x] - mirrored).abs() < 1e-15, "a face has the symmetry of a square");
            }
        }
    }
    // One texel of 2 x 2: a 24th of the sphere. One of 64 x 64: the integrand (1 + s^2 + t^2)^-3/2 at its centre, whose
    // error is the texel's area times its width squared.
    assert!((solid_angle(2)[3] - 4.0 * PI / 24.0).abs() < 1e-15);
    let s = texel_st(50, 64);
    let t = texel_st(9, 64);
    let area = (2.0_f64 / 64.0).powi(2);
    let approximate = area * (1.0 + s * s + t * t).powf(-1.5);
    assert!((solid_angle(64)[9 * 64 + 50] / approximate - 1.0).abs() < 1e-3);
}

/// The largest error of the coefficients of a random 4-band function, sampled at the centres of texels.
fn projection_error(face_px: usize) -> f64 {
    let mut rng = Rng::with_seed(22);
    let coefficients = random(&mut rng, 4);
    let projected = project(4, face_px, |face, x, y| {
        let basis = values(4, direction(face, texel_st(x, face_px), texel_st(y, face_px)));
        coefficients.iter().zip(&basis).map(|(c, y)| c * y).sum()
    });
    coefficients.iter().zip(&projected).map(|(c, p)| (c - p).abs()).fold(0.0, f64::max)
}

#[test]
fn projection_returns_the_coefficients_of_an_expansion() {
    let errors = [8, 16, 32, 64].map(projection_error);
    // The midpoint rule: a quarter of the error for half the width, within a fifth.
    for pair in errors.windows(2) {
        assert!(pair[0] / pair[1] > 3.2 && pair[0] / pair[1] < 4.8, "{errors:?}");
    }
    assert!(errors[3] < 2e-3, "{errors:?}");
}
