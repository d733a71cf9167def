//! Closed forms for the SH of functions that are symmetric about an axis.

use std::f64::consts::PI;

use glam::DVec3;

use super::basis::{coefficient_count, values};

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
