//! Closed forms against quadrature and against figures of the literature.

use super::assert_close;
use crate::common::cap;
use glam::DVec3;
use shadow_fields::sh::basis::{MAX_BANDS, coefficient_count, values};
use shadow_fields::sh::lobe::{clamped_cosine, zonal};
use shadow_fields::sh::quadrature::sphere_rule;
use std::f64::consts::PI;

const AXES: [DVec3; 4] = [
    DVec3::new(0.36, -0.48, 0.8),
    DVec3::new(-0.8, -0.36, -0.48),
    DVec3::new(0.0, 0.0, -1.0),
    DVec3::new(-0.48, 0.8, 0.36),
];

/// Coefficients of `f(w . axis)`, which is a polynomial on [`low`, 1] and 0 below: Gauss-Legendre in the height along
/// the axis and equal angles around it, both exact, so that the edge costs no accuracy.
fn by_quadrature(axis: DVec3, low: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    let (u, v) = axis.any_orthonormal_pair();
    let mut sums = vec![0.0; coefficient_count(MAX_BANDS)];
    // The z of a sphere rule are Gauss-Legendre nodes: stretch [-1, 1] to [low, 1].
    for (point, weight) in sphere_rule(24) {
        let height = low + (1.0 - low) * (point.z + 1.0) / 2.0;
        let radius = (1.0 - height * height).sqrt();
        let azimuth = point.y.atan2(point.x);
        let direction = height * axis + radius * (azimuth.cos() * u + azimuth.sin() * v);
        let scale = weight * (1.0 - low) / 2.0 * f(height);
        sums.iter_mut().zip(values(MAX_BANDS, direction.normalize())).for_each(|(sum, y)| *sum += scale * y);
    }
    sums
}

#[test]
fn cap_equals_quadrature() {
    for axis in AXES {
        for half_angle_rad in [0.1, PI / 6.0, 1.0, PI / 2.0, 2.5] {
            for bands in 1..=MAX_BANDS {
                let expected = &by_quadrature(axis, half_angle_rad.cos(), |_| 1.0)[..coefficient_count(bands)];
                assert_close(&cap(bands, axis, half_angle_rad), expected, 1e-13, "cap");
            }
        }
    }
}

#[test]
fn clamped_cosine_has_the_known_zonal_form() {
    let root = PI.sqrt();
    let z = [root / 2.0, (PI / 3.0).sqrt(), (5.0 * PI).sqrt() / 8.0, 0.0, -root / 16.0];
    for axis in AXES {
        assert_close(&clamped_cosine(5, axis), &zonal(5, &z, axis), 1e-15, "cosine");
        assert!(clamped_cosine(4, axis)[9..].iter().all(|&c| c == 0.0), "band 3 is exactly 0");
        assert_close(&clamped_cosine(MAX_BANDS, axis), &by_quadrature(axis, 0.0, |z| z), 1e-13, "cosine");
    }
}
