//! The growth certificate of an occlusion field: no product with a visibility that is looked up in it lengthens an
//! expansion T (in the sum of squares) by more than this factor.
//!
//! With M(b) the symmetric matrix of multiplication by b, a product with visibility is T' = (I - M(b)) T. What is looked up
//! at distance d is b = u sum_k w_k s_k: stored samples s_k with convex weights w_k, and u = [`Lattice::unscale`] at d.
//! The norm of I - u sum w_k M(s_k) is at most the largest of |I - u M(s_k)|, because sum w_k = 1. This is convex in u. Since u falls
//! with d, it lies between its values on the two interpolated shells, or beyond the last shell between that shell's value and 0.
//! So it suffices to test every sample with u of its own shell and of the neighbouring shells. Rotations do not change norms.
//!
//! A factor between 0 and 1 lengthens no function, but its projection to few bands can: by up to 1.058 for a cap of 30 degrees at
//! 4 bands.

use super::{Lattice, ShadowField};
use crate::sh::basis::coefficient_count;
use crate::sh::product::{Tensor, eigenvalues};
use rayon::prelude::*;

/// SH bands of the transfers that the certificate covers, independent of the field's bands. It also holds for fewer bands, whose
/// matrix is a principal submatrix with eigenvalues between this one's (Cauchy interlacing), but not for more.
pub const TRANSFER_BANDS: usize = 4;

/// Largest factor, computed from the stored, quantised numbers. It is at least 1, because a visibility of 1 changes nothing.
pub fn growth(field: &ShadowField) -> f64 {
    let header = &field.header;
    let (lattice, bands) = (header.lattice, header.bands);
    let tensor = Tensor::new(TRANSFER_BANDS, bands, TRANSFER_BANDS);
    let directions = lattice.stored_direction_count();
    // Border samples of a cube's face are copies of other faces' samples, except corners, which are means.
    let sources = lattice.sources();
    let mut seen = vec![false; lattice.direction_count() as usize];
    let own = |of: &Vec<u32>| of.len() > 1 || !std::mem::replace(&mut seen[of[0] as usize], true);
    let planes: Vec<bool> = sources.iter().map(own).collect();
    (0..lattice.stored_count())
        .into_par_iter()
        .filter(|sample| planes[(sample % directions) as usize])
        .map(|sample| {
            let coefficients: Vec<f64> = (0..coefficient_count(bands)).map(|k| field.stored(sample, 0, k)).collect();
            let values = eigenvalues(&tensor.matrix(&coefficients));
            let shell = sample / directions;
            let norm = |u: f64| values.iter().map(|lambda| (1.0 - u * lambda).abs()).fold(0.0, f64::max);
            neighbouring(&lattice, shell).map(norm).fold(1.0, f64::max)
        })
        .reduce(|| 1.0, f64::max)
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
    use crate::field::{FieldHeader, FieldKind, Lookup, Storage};
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
            shortcuts: Default::default(),
            level_texels: 0.0,
            filled_samples: 0,
            captured_samples: 0,
            symmetry: String::new(),
            growth: 0.0,
            centre_m: [0.0; 3],
            radius_m: 1.0,
            radiance_scale: 1.0,
            mesh: "ball".into(),
            mesh_hash: String::new(),
        };
        ShadowField { header, payload }
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
            field.lookup(unit * distance, Lookup::Trilinear, 0, &mut blocked[..16]);
            let values = eigenvalues(&tensor.matrix(&blocked[..16]));
            worst = values.iter().map(|lambda| (1.0 - lambda).abs()).fold(worst, f64::max);
        }
        assert!(worst <= bound + 1e-12 && worst > 1.02, "{worst} of {bound}");
    }

    /// Seven bands of a factor between 0 and 1 give four bands of transfer eigenvalues in [0, 1]; what is left is that u of the
    /// neighbouring shells is not the sample's own.
    #[test]
    fn more_stored_bands_grow_less() {
        let lattice = "cube:24x2,inner=1.3".parse().expect("a lattice");
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
