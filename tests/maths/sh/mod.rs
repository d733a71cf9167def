//! The mathematics of spherical harmonics and cube faces, in f64.

mod basis;
mod cube;
mod lobe;
mod polygon;
mod product;
mod rotation;

use fastrand::Rng;
use shadow_fields::sh::basis::coefficient_count;

/// Coefficients between -1 and 1.
fn random(rng: &mut Rng, bands: usize) -> Vec<f64> {
    (0..coefficient_count(bands)).map(|_| 2.0 * rng.f64() - 1.0).collect()
}

/// Every number is within `tolerance`, of numbers above 1 relatively.
fn assert_close(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len());
    for (k, (x, y)) in found.iter().zip(expected).enumerate() {
        assert!((x - y).abs() < tolerance * (1.0 + y.abs()), "{what}, coefficient {k}: {x} {y}");
    }
}
