//! Products of SH expansions: `c = P[(sum a_i Y_i) (sum b_j Y_j)]`, the projection of the pointwise product.
//!
//! `c_k = sum_ij G_ijk a_i b_j` with the Gaunt tensor `G_ijk`, the integral of `Y_i Y_j Y_k` over the sphere: symmetric
//! in its three indices and mostly zero (353 of 4096 entries at 4 bands).

use super::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, evaluate};
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

/// The non-zero entries of the product of `a_bands` by `b_bands`, cut to `c_bands`.
#[derive(Clone, Debug)]
pub struct Tensor {
    bands: [usize; 3],
    entries: Vec<Entry>,
    /// The same entries as [`Tensor::multiply`] uses them. For coefficients that both expansions have, `a_i b_j + a_j
    /// b_i` is computed once and added to a run of targets.
    pairs: Vec<Pair>,
    targets: Vec<(u8, f64)>,
    /// The other entries, `a_i b_j`, as a flat list: most have one target, and the branch at the end of a loop of one
    /// iteration is mispredicted.
    single: Vec<Single>,
}

/// `a_i b_j + a_j b_i`, or `a_i b_i`, with the end of its run in `targets`.
#[derive(Clone, Copy, Debug)]
struct Pair {
    i: u8,
    j: u8,
    end: u16,
}

#[derive(Clone, Copy, Debug)]
struct Single {
    i: u8,
    j: u8,
    k: u8,
    value: f64,
}

impl Tensor {
    /// Computes the integrals with a rule that is exact for them. Each number of bands is 1 to [`MAX_BANDS`].
    pub fn new(a_bands: usize, b_bands: usize, c_bands: usize) -> Self {
        let bands = [a_bands, b_bands, c_bands];
        assert!(bands.iter().all(|b| (1..=MAX_BANDS).contains(b)), "bands must be 1 to {MAX_BANDS}, not {bands:?}");
        let [a_count, b_count, c_count] = bands.map(coefficient_count);
        let most = a_bands.max(b_bands).max(c_bands);
        let points: Vec<([f64; MAX_COEFFICIENTS], f64)> = sphere_rule(a_bands + b_bands + c_bands - 3)
            .into_iter()
            .map(|(direction, weight)| {
                let mut basis = [0.0; MAX_COEFFICIENTS];
                evaluate(most, direction, &mut basis);
                (basis, weight)
            })
            .collect();
        let mut entries = Vec::new();
        let mut sums = vec![0.0; c_count];
        for i in 0..a_count {
            for j in 0..b_count {
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
        let shared = a_count.min(b_count);
        let (both, others): (Vec<Entry>, Vec<Entry>) = entries.iter().partition(|entry| entry.i.max(entry.j) < shared);
        let (pairs, targets) = pair_up(&both);
        // Coefficients number at most 64.
        let single = others.iter().map(|e| Single { i: e.i as u8, j: e.j as u8, k: e.k as u8, value: e.value });
        Self { bands, pairs, targets, single: single.collect(), entries }
    }

    /// Bands of the first factor, the second factor and the product.
    pub fn bands(&self) -> [usize; 3] {
        self.bands
    }

    /// The non-zero entries, sorted by (i, j, k).
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Writes the product of `a` and `b` to the front of `out`; slices must hold at least their bands' coefficients.
    pub fn multiply(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        let [a_count, b_count, c_count] = self.bands.map(coefficient_count);
        // Fixed sizes and masked indices (coefficients number at most 64) leave the inner loop without bounds checks.
        const MASK: usize = MAX_COEFFICIENTS - 1;
        let mut left = [0.0; MAX_COEFFICIENTS];
        let mut right = [0.0; MAX_COEFFICIENTS];
        let mut sums = [0.0; MAX_COEFFICIENTS];
        left[..a_count].copy_from_slice(&a[..a_count]);
        right[..b_count].copy_from_slice(&b[..b_count]);
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
        for &Single { i, j, k, value } in &self.single {
            sums[k as usize & MASK] += value * (left[i as usize & MASK] * right[j as usize & MASK]);
        }
        out[..c_count].copy_from_slice(&sums[..c_count]);
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
