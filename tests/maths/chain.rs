//! Long chains of products, behind which the guard keeps light from growing.

use crate::common::cap;
use glam::DVec3;
use half::f16;
use shadow_fields::merge::chain::{ChainState, Multiplier};
use shadow_fields::sh::basis::MAX_COEFFICIENTS;
use shadow_fields::sh::lobe::clamped_cosine;
use shadow_fields::sh::quadrature::sphere_rule;
use std::f64::consts::PI;

const BANDS: usize = 4;

/// A cap: axis and half angle in radians.
type Cap = (DVec3, f64);

/// Irradiance of a level plane under a sky of unit irradiance past caps, which `multiply` takes off the rest.
fn chain(caps: &[Cap], multiply: fn(&Multiplier, &mut ChainState, &[f64])) -> f64 {
    let multiplier = Multiplier::new(BANDS);
    let mut t = multiplier.begin(&clamped_cosine(BANDS, DVec3::Y));
    for &(axis, half_angle) in caps {
        let mut blocked = [0.0; MAX_COEFFICIENTS];
        let exact = cap(BANDS, axis, half_angle);
        blocked[..exact.len()].copy_from_slice(&exact);
        multiply(&multiplier, &mut t, &blocked);
    }
    // Unit irradiance: radiance 1 / pi, whose expansion is sqrt(4 pi) / pi in the constant band.
    t[0] * (4.0 * PI).sqrt() / PI
}

/// The same by quadrature of the true visibility; its error at a cap's edge is about 1e-3.
fn truth(caps: &[Cap]) -> f64 {
    let free = |w: &DVec3| caps.iter().all(|(axis, half_angle)| axis.dot(*w) < half_angle.cos());
    let points = sphere_rule(400).into_iter().filter(|(w, _)| w.y > 0.0 && free(w));
    points.map(|(w, weight)| weight * w.y).sum::<f64>() / PI
}

#[test]
fn the_guard_keeps_chains_from_growing() {
    let mut rng = fastrand::Rng::with_seed(1);
    let distinct: Vec<Cap> = (0..1000)
        .map(|_| {
            let height = rng.f64();
            let turn = 2.0 * PI * rng.f64();
            let across = (1.0 - height * height).sqrt();
            let axis = DVec3::new(across * turn.cos(), height, across * turn.sin());
            (axis, (10.0 + 30.0 * rng.f64()).to_radians())
        })
        .collect();
    let identical: Vec<Cap> = vec![(DVec3::new(0.5, 0.75_f64.sqrt(), 0.0), 30_f64.to_radians()); 1000];
    // One cap of 30 degrees, 30 degrees off the normal, takes sin^2 30 cos 30.
    let one = 1.0 - 0.25 * 0.75_f64.sqrt();
    assert!((truth(&identical[..1]) - one).abs() < 2e-3);
    assert!((chain(&identical[..1], Multiplier::multiply_unguarded) - one).abs() < 5e-3);
    for caps in [&identical, &distinct] {
        for count in [1, 2, 4, 8, 16, 64, 256, 1000] {
            let guarded = chain(&caps[..count], Multiplier::multiply);
            let halves = chain(&caps[..count], |multiplier, t, blocked| {
                let rounded: Vec<f64> = blocked.iter().map(|b| f16::from_f64(*b).to_f64()).collect();
                multiplier.multiply(t, &rounded);
            });
            assert!((0.0..=1.0).contains(&guarded), "{count}: {guarded}");
            // Each factor is rounded by at most 5e-4 of its largest coefficients.
            assert!((halves - guarded).abs() < 2e-3, "{count}: {halves} in f16, {guarded}");
        }
    }
    assert!(chain(&identical[..64], Multiplier::multiply_unguarded) > 1.2, "without the guard it is known to brighten");
}
