//! Projection of the texels of a cube map to SH.

use super::basis::{MAX_COEFFICIENTS, coefficient_count, evaluate};
use super::cube::{FACE_COUNT, direction, solid_angle, texel_st};

/// SH coefficients of a function that is sampled at texel centres: the sum of value x solid angle x basis function.
///
/// `texel(face, x, y)` is called once per texel, in order of faces and rows; coefficients have its unit. Texels of
/// value 0 cost nothing. The error falls about as `face_px^-1.5` for a cap with its sharp edge, and as `face_px^-2` for
/// a smooth function.
pub fn project(bands: usize, face_px: usize, texel: impl Fn(usize, usize, usize) -> f64) -> Vec<f64> {
    let mut coefficients = vec![0.0; coefficient_count(bands)];
    let weights = solid_angle(face_px);
    let mut basis = [0.0; MAX_COEFFICIENTS];
    for face in 0..FACE_COUNT {
        for y in 0..face_px {
            for x in 0..face_px {
                let value = texel(face, x, y) * weights[y * face_px + x];
                if value != 0.0 {
                    evaluate(bands, direction(face, texel_st(x, face_px), texel_st(y, face_px)), &mut basis);
                    for (coefficient, y_lm) in coefficients.iter_mut().zip(&basis) {
                        *coefficient += value * y_lm;
                    }
                }
            }
        }
    }
    coefficients
}
