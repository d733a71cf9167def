//! Products of SH expansions: `c = P[(sum a_i Y_i) (sum b_j Y_j)]`, the projection of the pointwise product.
//!
//! `c_k = sum_ij G_ijk a_i b_j` with the Gaunt tensor `G_ijk`, the integral of `Y_i Y_j Y_k` over the sphere: symmetric
//! in its three indices and mostly zero (353 of 4096 entries at 4 bands).

use super::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, values};
use super::quadrature::sphere_rule;

/// Entries below this are zeros with rounding errors. The smallest true magnitudes are 0.0584 at 4 bands and above 1e-4
/// at 8 bands, and the errors of the sums are below 1e-14.
const ZERO: f64 = 1e-9;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    pub i: usize,
    pub j: usize,
    pub k: usize,
    /// The integral of `Y_i Y_j Y_k`.
    pub value: f64,
}

/// The non-zero entries of the product of two expansions, cut to as many bands.
#[derive(Clone, Debug)]
pub struct Tensor {
    pub bands: usize,
    /// The non-zero entries, sorted by (i, j, k).
    pub entries: Vec<Entry>,
    /// The same entries as [`Tensor::multiply`] uses them: `a_i b_j + a_j b_i` is computed once and added to a run of
    /// targets.
    pairs: Vec<Pair>,
    targets: Vec<(u8, f64)>,
}

/// `a_i b_j + a_j b_i`, or `a_i b_i`, with the end of its run in `targets`.
#[derive(Clone, Copy, Debug)]
struct Pair {
    i: u8,
    j: u8,
    end: u16,
}

impl Tensor {
    /// Computes the integrals with a rule that is exact for them. `bands` is 1 to [`MAX_BANDS`].
    pub fn new(bands: usize) -> Self {
        assert!((1..=MAX_BANDS).contains(&bands), "bands must be 1 to {MAX_BANDS}, not {bands}");
        let count = coefficient_count(bands);
        let rule = sphere_rule(3 * (bands - 1)).into_iter();
        let points: Vec<_> = rule.map(|(direction, weight)| (values(bands, direction), weight)).collect();
        let mut entries = Vec::new();
        let mut sums = vec![0.0; count];
        for i in 0..count {
            for j in 0..count {
                sums.fill(0.0);
                for (basis, weight) in &points {
                    let product = weight * basis[i] * basis[j];
                    for (sum, y) in sums.iter_mut().zip(basis) {
                        *sum += product * y;
                    }
                }
                let kept = sums.iter().enumerate().filter(|(_, value)| value.abs() > ZERO);
                entries.extend(kept.map(|(k, &value)| Entry { i, j, k, value }));
            }
        }
        let (pairs, targets) = pair_up(&entries);
        Self { bands, pairs, targets, entries }
    }

    /// Writes the product of `a` and `b` to the front of `out`; slices must hold at least their bands' coefficients.
    pub fn multiply(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        let count = coefficient_count(self.bands);
        // Fixed sizes and masked indices (coefficients number at most 64) leave the inner loop without bounds checks.
        const MASK: usize = MAX_COEFFICIENTS - 1;
        let mut left = [0.0; MAX_COEFFICIENTS];
        let mut right = [0.0; MAX_COEFFICIENTS];
        let mut sums = [0.0; MAX_COEFFICIENTS];
        left[..count].copy_from_slice(&a[..count]);
        right[..count].copy_from_slice(&b[..count]);
        let mut targets = self.targets.as_slice();
        let mut start = 0;
        for pair in &self.pairs {
            let i = pair.i as usize & MASK;
            let j = pair.j as usize & MASK;
            let mirrored = if i == j { 0.0 } else { left[j] * right[i] };
            let product = left[i] * right[j] + mirrored;
            let (run, rest) = targets.split_at((pair.end - start) as usize);
            for &(k, value) in run {
                sums[k as usize & MASK] += value * product;
            }
            (targets, start) = (rest, pair.end);
        }
        out[..count].copy_from_slice(&sums[..count]);
    }
}

/// Groups the entries with `i <= j` by pair of factors; each also stands for its mirror image.
fn pair_up(entries: &[Entry]) -> (Vec<Pair>, Vec<(u8, f64)>) {
    let mut pairs = Vec::new();
    let mut targets = Vec::new();
    for run in entries.chunk_by(|x, y| (x.i, x.j) == (y.i, y.j)).filter(|run| run[0].i <= run[0].j) {
        targets.extend(run.iter().map(|entry| (entry.k as u8, entry.value)));
        let end = u16::try_from(targets.len()).expect("8 bands have fewer than 65536 entries");
        pairs.push(Pair { i: run[0].i as u8, j: run[0].j as u8, end });
    }
    (pairs, targets)
}
