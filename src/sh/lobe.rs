//! Closed forms for the SH of functions that are symmetric about an axis.

use std::f64::consts::PI;

use glam::DVec3;

use super::basis::{MAX_BANDS, coefficient_count, values};

/// Turns a function that is symmetric about +z to `axis` (unit): `z[l]` is its coefficient of Y_l0.
///
/// f_lm = sqrt(4 pi / (2l + 1)) z_l Y_lm(axis) (reference 1 of [`crate::sh`]).
pub fn zonal(bands: usize, z: &[f64], axis: DVec3) -> Vec<f64> {
    let basis = values(bands, axis);
    let mut coefficients = Vec::with_capacity(coefficient_count(bands));
    for (l, z_l) in z[..bands].iter().enumerate() {
        let scale = (4.0 * PI / (2 * l + 1) as f64).sqrt() * z_l;
        coefficients.extend(basis[l * l..(l + 1) * (l + 1)].iter().map(|y| scale * y));
    }
    coefficients
}

/// The zonal coefficients of a cap about +z whose half angle has the cosine `c`: 1 inside, 0 outside.
///
/// z_0 = sqrt(pi) (1 - c), z_l = sqrt(pi / (2l + 1)) (P_l-1(c) - P_l+1(c)), the integral of Y_l0 over the cap.
pub fn cap_zonal(bands: usize, c: f64) -> Vec<f64> {
    let mut legendre = [1.0, c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for l in 2..=bands.min(MAX_BANDS) {
        let lf = l as f64;
        legendre[l] = ((2.0 * lf - 1.0) * c * legendre[l - 1] - (lf - 1.0) * legendre[l - 2]) / lf;
    }
    let band = |l: usize| (PI / (2 * l + 1) as f64).sqrt() * (legendre[l - 1] - legendre[l + 1]);
    (0..bands).map(|l| if l == 0 { PI.sqrt() * (1.0 - c) } else { band(l) }).collect()
}

/// The blocked part of a cap: the SH of 1 within `half_angle_rad` (0 to pi) of the unit vector `axis`, 0 elsewhere.
pub fn cap(bands: usize, axis: DVec3, half_angle_rad: f64) -> Vec<f64> {
    zonal(bands, &cap_zonal(bands, half_angle_rad.cos()), axis)
}

/// The SH of max(0, n . w) for the unit vector `normal`.
///
/// Zonal coefficients sqrt(pi)/2, sqrt(pi/3), sqrt(5 pi)/8, 0, -sqrt(pi)/16, 0, ...: from band 2 on, odd bands are zero
/// and z_l = sqrt((2l + 1) pi) (-1)^(l/2 + 1) l! / ((l - 1) (l + 2) 2^l ((l/2)!)^2) (reference 4 of [`crate::sh`]).
pub fn clamped_cosine(bands: usize, normal: DVec3) -> Vec<f64> {
    // central = l! / (2^l ((l/2)!)^2), the sign included: 1 at l = 0, times -(l - 1) / l for each step of 2.
    let mut central = 1.0;
    let z: Vec<f64> = (0..bands)
        .map(|l| {
            let lf = l as f64;
            match l {
                0 => PI.sqrt() / 2.0,
                1 => (PI / 3.0).sqrt(),
                _ if l % 2 == 1 => 0.0,
                _ => {
                    central *= -(lf - 1.0) / lf;
                    -((2.0 * lf + 1.0) * PI).sqrt() * central / ((lf - 1.0) * (lf + 2.0))
                }
            }
        })
        .collect();
    zonal(bands, &z, normal)
}

/// GLSL 460 text of `void sh_cosine(vec3 n, out float f[N])`, N = bands^2: [`clamped_cosine`] of the unit vector `n`.
/// Needs [`super::basis::glsl_basis`] before it.
pub fn glsl_clamped_cosine(bands: usize) -> String {
    let count = coefficient_count(bands);
    // Along an axis only m = 0 is left, with Y_l0(z) = sqrt((2l + 1) / 4 pi): the band's factor is their quotient.
    let along_z = values(bands, DVec3::Z);
    let lobe = clamped_cosine(bands, DVec3::Z);
    let scaled = (0..bands).flat_map(|l| {
        let factor = lobe[l * (l + 1)] / along_z[l * (l + 1)];
        (l * l..(l + 1) * (l + 1)).map(move |k| match factor == 0.0 {
            true => format!("f[{k}] = 0.0;\n"),
            false => format!("f[{k}] *= {factor:.9e};\n"),
        })
    });
    format!("void sh_cosine(vec3 n, out float f[{count}]) {{\nsh_basis(n, f);\n{}}}\n", scaled.collect::<String>())
}
