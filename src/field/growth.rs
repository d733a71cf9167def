//! The growth certificate of an occlusion field: no product with a visibility that is looked up in it lengthens an
//! expansion T (in the sum of squares) by more than this factor.
//!
//! With M(b) the symmetric matrix of multiplication by b, a product with visibility is T' = (I - M(b)) T. What is
//! looked up at distance d is b = u sum_k w_k s_k: stored samples s_k with convex weights w_k, and u =
//! [`Lattice::unscale`] at d. The norm of I - u sum w_k M(s_k) is at most the largest of |I - u M(s_k)|, because sum
//! w_k = 1. This is convex in u. Since u falls with d, it lies between its values on the two interpolated shells, or
//! beyond the last shell between that shell's value and 0. So it suffices to test every sample with u of its own shell
//! and of the neighbouring shells. Rotations do not change norms.
//!
//! A factor between 0 and 1 lengthens no function, but its projection to few bands can: by up to 1.058 for a cap of 30
//! degrees at 4 bands.

use super::{Lattice, ShadowField};
use crate::sh::basis::coefficient_count;
use crate::sh::product::{Tensor, eigenvalues};
use rayon::prelude::*;

/// SH bands of the transfers that the certificate covers, independent of the field's bands. It also holds for fewer
/// bands, whose matrix is a principal submatrix with eigenvalues between this one's (Cauchy interlacing), but not for
/// more.
pub const TRANSFER_BANDS: usize = 4;

/// Largest factor, computed from the stored, quantised numbers. It is at least 1, because a visibility of 1 changes
/// nothing.
pub fn growth(field: &ShadowField) -> f64 {
    let header = &field.header;
    let lattice = header.lattice;
    let bands = header.bands;
    let tensor = Tensor::new(TRANSFER_BANDS, bands, TRANSFER_BANDS);
    let directions = lattice.stored_direction_count();
    // Samples on the edges of a cube's face are another face's too.
    let sources = lattice.sources();
    let mut seen = vec![false; lattice.direction_count() as usize];
    let own = |of: &Vec<u32>| of.len() > 1 || !std::mem::replace(&mut seen[of[0] as usize], true);
    let planes: Vec<bool> = sources.iter().map(own).collect();
    let matrix = |sample: u32| {
        let coefficients: Vec<f64> = (0..coefficient_count(bands)).map(|k| field.stored(sample, 0, k)).collect();
        tensor.matrix(&coefficients)
    };
    let norm = |sample: u32| {
        let values = eigenvalues(&matrix(sample));
        let norm = |u: f64| values.iter().map(|lambda| (1.0 - u * lambda).abs()).fold(0.0, f64::max);
        neighbouring(&lattice, sample / directions).map(norm).fold(1.0, f64::max)
    };
    let samples: Vec<u32> =
        (0..lattice.stored_count()).filter(|sample| planes[(sample % directions) as usize]).collect();
    let largest = |of: &[u32]| of.par_iter().map(|&sample| norm(sample)).reduce(|| 1.0, f64::max);
    // Some samples give a bound, and to see that another stays below takes a hundredth of what its eigenvalues take.
    let some: Vec<u32> = samples.iter().copied().step_by(SOME).collect();
    let bound = largest(&some);
    let stays = |sample: &u32| {
        let us: Vec<f64> = neighbouring(&lattice, sample / directions).collect();
        is_within(&matrix(*sample), us.into_iter().fold(0.0, f64::max), bound)
    };
    let rest: Vec<u32> = samples.into_par_iter().filter(|sample| !stays(sample)).collect();
    largest(&rest).max(bound)
}

/// One in so many samples gives a first bound.
const SOME: usize = 32;

/// Whether no eigenvalue of I - u M, for any u from 0 to `most`, is larger in magnitude than a bound of at least 1:
/// whether (bound - 1) / most + M and (bound + 1) / most - M are positive definite. The margin is far above rounding,
/// and where it decides, the answer is no.
fn is_within(matrix: &[f64], most: f64, bound: f64) -> bool {
    let bound = bound * (1.0 - 1e-9);
    let n = matrix.len().isqrt();
    let shifted = |sign: f64, by: f64| -> Vec<f64> {
        matrix.iter().enumerate().map(|(i, x)| sign * x + if i % (n + 1) == 0 { by } else { 0.0 }).collect()
    };
    is_positive(&mut shifted(1.0, (bound - 1.0) / most)) && is_positive(&mut shifted(-1.0, (bound + 1.0) / most))
}

/// Whether a symmetric row-major matrix is positive definite: whether it has a Cholesky factor. Overwrites the matrix.
fn is_positive(a: &mut [f64]) -> bool {
    let n = a.len().isqrt();
    for column in 0..n {
        let (above, below) = a.split_at_mut((column + 1) * n);
        let pivot = &above[column * n..];
        if pivot[column].is_nan() || pivot[column] <= 0.0 {
            return false;
        }
        for row in below.chunks_exact_mut(n) {
            let factor = row[column] / pivot[column];
            row[column + 1..].iter_mut().zip(&pivot[column + 1..]).for_each(|(x, p)| *x -= factor * p);
        }
    }
    true
}

/// Bounds of u for lookups that use samples of `shell`.
fn neighbouring(lattice: &Lattice, shell: u32) -> impl Iterator<Item = f64> {
    let lattice = *lattice;
    let shells = shell.saturating_sub(1)..=(shell + 1).min(lattice.shells - 1);
    shells.map(move |s| lattice.unscale(lattice.shell(s)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{FieldHeader, FieldKind, Storage};
    use crate::sh::basis::MAX_COEFFICIENTS;
    use crate::sh::lobe;
    use glam::DVec3;

    /// The exact field of a ball, stored as f32.
    fn ball(lattice: Lattice) -> ShadowField {
        ball_of(4, lattice)
    }

    fn ball_of(bands: usize, lattice: Lattice) -> ShadowField {
        let sources = lattice.sources();
        let directions = lattice.direction_count();
        let mut payload = Vec::new();
        for shell in 0..lattice.shells {
            for source in &sources {
                let mut mean = vec![0.0; crate::field::quantity::channel_stride(bands)];
                for &direction in source {
                    let position = lattice.position(shell * directions + direction);
                    let blocked = lobe::sphere(bands, -position, 1.0);
                    let share = lattice.scale(position.length()) / source.len() as f64;
                    mean.iter_mut().zip(&blocked).for_each(|(m, b)| *m += share * b);
                }
                payload.extend(mean.iter().flat_map(|&c| (c as f32).to_le_bytes()));
            }
        }
        let header = FieldHeader {
            kind: FieldKind::Occlusion,
            bands,
            storage: Storage::F32,
            lattice,
            face_px: 64,
            level_texels: 0.0,
            filled_samples: 0,
            captured_samples: 0,
            growth: 0.0,
            centre_m: [0.0; 3],
            radius_m: 1.0,
            radiance_scale: 1.0,
            mesh: "ball".into(),
            mesh_hash: String::new(),
        };
        ShadowField { header, payload }
    }

    /// The cheap bound agrees with the eigenvalues.
    #[test]
    fn a_bound_holds_exactly_where_eigenvalues_say_so() {
        let tensor = Tensor::new(4, 4, 4);
        let mut rng = fastrand::Rng::with_seed(6);
        let mut within = 0;
        for _ in 0..500 {
            let coefficients: Vec<f64> = (0..16).map(|k| (rng.f64() - 0.5) / f64::from(1 + k)).collect();
            let matrix = tensor.matrix(&coefficients);
            let most = 0.3 + rng.f64();
            let norm = |u: f64| eigenvalues(&matrix).iter().map(|l| (1.0 - u * l).abs()).fold(0.0, f64::max);
            let bound = 1.0 + 0.5 * rng.f64();
            let expected = norm(most) < bound && norm(0.5 * most) < bound;
            assert_eq!(is_within(&matrix, most, bound), expected, "{} and {bound}", norm(most));
            within += usize::from(expected);
        }
        assert!((50..450).contains(&within), "{within}");
        assert!(!is_within(&[f64::NAN], 1.0, 2.0));
    }

    #[test]
    fn a_ball_grows_as_known_and_nothing_looked_up_grows_more() {
        let field = ball(Lattice { inner: 1.05, ..Lattice::default() });
        let bound = growth(&field);
        // Over all half angles a cap of 4 bands reaches about 1.06; neighbouring factors and corners add little.
        assert!((1.03..1.15).contains(&bound), "{bound}");
        let tensor = Tensor::new(4, 4, 4);
        let mut rng = fastrand::Rng::with_seed(4);
        let mut worst: f64 = 0.0;
        for _ in 0..2000 {
            let unit = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5).normalize();
            let distance = 1.0 + 9.0 * rng.f64() * rng.f64();
            let mut blocked = [0.0; MAX_COEFFICIENTS];
            field.lookup(unit * distance, 0, &mut blocked[..16]);
            let values = eigenvalues(&tensor.matrix(&blocked[..16]));
            worst = values.iter().map(|lambda| (1.0 - lambda).abs()).fold(worst, f64::max);
        }
        assert!(worst <= bound + 1e-12 && worst > 1.02, "{worst} of {bound}");
    }

    /// Seven bands of a factor between 0 and 1 give four bands of transfer eigenvalues in [0, 1]; what is left is that
    /// u of the neighbouring shells is not the sample's own.
    #[test]
    fn more_stored_bands_grow_less() {
        let lattice = "cube:24x3,inner=1.3".parse().expect("a lattice");
        let [four, five, seven] = [4, 5, 7].map(|bands| growth(&ball_of(bands, lattice)));
        assert!(four > five && five > seven && four > 1.03 && seven < 1.02, "{four} {five} {seven}");
    }

    #[test]
    fn nothing_stored_grows_nothing() {
        let mut field = ball(Lattice { inner: 1.05, ..Lattice::default() });
        field.payload.fill(0);
        assert_eq!(growth(&field), 1.0);
    }
}
