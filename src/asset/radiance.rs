//! The limit of radiance, and the lobe of soft directional lights.

use std::f64::consts::{PI, TAU};

/// Largest radiance, and largest of its factors. Its square still fits f32.
pub const RADIANCE_LIMIT: f32 = 1e15;
/// Intervals of Simpson's rule for the lobe of [`key_zonal`]; its relative error is then below 1e-11.
const LOBE_INTERVALS: usize = 1 << 14;

/// Default of factors in scene files.
pub(super) fn one() -> f32 {
    1.0
}

/// z_l = sqrt((2l + 1) / (4 pi)) * 2 pi * integral over c of exp(sharpness * (c - 1)) P_l(c), by Simpson's rule in 1 -
/// c over the part where the exponential exceeds 1e-17.
pub(super) fn key_zonal(bands: usize, sharpness: f64) -> Vec<f64> {
    let end = if sharpness > 20.0 { 40.0 / sharpness } else { 2.0 };
    let step = end / LOBE_INTERVALS as f64;
    let mut z = vec![0.0; bands];
    for i in 0..=LOBE_INTERVALS {
        let weight = if i == 0 || i == LOBE_INTERVALS {
            1.0
        } else if i % 2 == 1 {
            4.0
        } else {
            2.0
        };
        let below = step * i as f64;
        let value = weight * step / 3.0 * (-sharpness * below).exp();
        let c = 1.0 - below;
        let mut previous = 0.0;
        let mut legendre = 1.0;
        for (l, sum) in z.iter_mut().enumerate() {
            *sum += value * legendre;
            let degree = l as f64;
            (previous, legendre) =
                (legendre, ((2.0 * degree + 1.0) * c * legendre - degree * previous) / (degree + 1.0));
        }
    }
    z.iter().enumerate().map(|(l, sum)| ((2.0 * l as f64 + 1.0) / (4.0 * PI)).sqrt() * TAU * sum).collect()
}
