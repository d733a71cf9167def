//! `bench stability`: behaviour of the merge with long chains and with extreme placements and numbers.

use super::Bench;
use super::default_options;
use super::trials::{self, Trial};
use crate::error::Result;
use crate::field::Storage;
use crate::merge::chain::Multiplier;
use crate::sh::basis::MAX_COEFFICIENTS;
use crate::sh::lobe::{cap, clamped_cosine};
use crate::sh::product::Tensor;
use crate::sh::quadrature::sphere_rule;
use crate::text::{csv, write};
use glam::DVec3;
use half::f16;
use serde::Serialize;
use serde_json::json;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::LazyLock;

/// Bands of the transfer in all chains.
const BANDS: usize = 4;
/// Degree of the quadrature rule of the true irradiance; its error at a cap's edge is about 1e-3.
const TRUTH_DEGREE: usize = 400;

/// Irradiance of a horizontal plane under a uniform sky of unit irradiance, behind a chain of caps.
#[derive(Clone, Debug, Serialize)]
pub struct CapChain {
    pub caps: &'static str,
    #[serde(rename = "cap_count")]
    pub count: usize,
    /// True irradiance, by quadrature of the true visibility.
    #[serde(rename = "truth_relative")]
    pub truth: f64,
    /// Products of 4 bands in f64.
    #[serde(rename = "plain_relative")]
    pub plain: f64,
    /// Guarded products of 4 bands in f64, as in the merge by default: 0 to 1 by construction.
    #[serde(rename = "guarded_relative")]
    pub guarded: f64,
    /// Guarded products in f32.
    #[serde(rename = "guarded_f32_relative")]
    pub f32: f64,
    /// Factors rounded to f16, guarded products in f64.
    #[serde(rename = "guarded_f16_relative")]
    pub f16: f64,
    /// Whether the guarded chain is within its bound, and f32 and f16 are within [`NEAR_F32`] and [`NEAR_F16`] of it.
    pub passed: bool,
}

/// Largest allowed difference between f32 and f64 for a guarded chain of up to 1 000 factors; each factor rounds by
/// 6e-8.
pub const NEAR_F32: f64 = 1e-5;
/// Largest allowed difference for factors stored in f16, each rounded by at most 5e-4 of its largest coefficients.
pub const NEAR_F16: f64 = 2e-3;

#[derive(Serialize)]
pub struct StabilityOutcome {
    pub chains: Vec<CapChain>,
    pub trials: Vec<Trial>,
}

impl StabilityOutcome {
    /// Number of failures, and number of tests.
    pub fn failed(&self) -> [usize; 2] {
        let passed = self.chains.iter().map(|c| c.passed).chain(self.trials.iter().map(|t| t.passed));
        let all: Vec<bool> = passed.collect();
        [all.iter().filter(|passed| !**passed).count(), all.len()]
    }
}

/// A cap: axis and half angle in radians.
type Cap = (DVec3, f64);
type Coefficients = [f64; MAX_COEFFICIENTS];

/// Irradiance behind caps; `multiply` takes the blocked part of one off the rest.
fn chain(caps: &[Cap], multiply: fn(&Multiplier, &mut Coefficients, &[f64])) -> f64 {
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

/// The visibility matrix of 4 bands, which is the same for every chain.
static TENSOR: LazyLock<Tensor> = LazyLock::new(|| Tensor::new(BANDS));

/// One guarded product in single precision, as in `glsl/merge_product.glsl`.
fn multiply_single(t: &mut Coefficients, blocked: &[f64]) {
    let before: Vec<f32> = t.iter().map(|c| *c as f32).collect();
    let rest_of = |c: &[f32]| c[1..].iter().map(|c| c * c).sum::<f32>();
    let mut after = before.clone();
    for entry in TENSOR.entries() {
        after[entry.k] -= entry.value as f32 * (before[entry.i] * blocked[entry.j] as f32);
    }
    let first = before[0];
    let rest = rest_of(&after);
    let kept = after[0].clamp(first.min(0.0), first.max(0.0));
    let room = (rest_of(&before) + (first - kept) * (first + kept)).max(0.0);
    let shorten = if rest > room { (room / rest).sqrt() } else { 1.0 };
    for (k, (t, after)) in t.iter_mut().zip(after).enumerate() {
        *t = f64::from(if k == 0 { kept } else { shorten * after });
    }
}

fn truth(caps: &[Cap], rule: &[(DVec3, f64)]) -> f64 {
    let free = |w: &DVec3| caps.iter().all(|(axis, half_angle)| axis.dot(*w) < half_angle.cos());
    rule.iter().filter(|(w, _)| w.y > 0.0 && free(w)).map(|(w, weight)| weight * w.y).sum::<f64>() / PI
}

/// Chains of identical and of distinct caps.
pub fn chains(seed: u64, longest: usize) -> Vec<CapChain> {
    let points = sphere_rule(TRUTH_DEGREE);
    let mut rng = fastrand::Rng::with_seed(seed);
    let distinct: Vec<Cap> = (0..longest)
        .map(|_| {
            let height = rng.f64();
            let turn = 2.0 * PI * rng.f64();
            let across = (1.0 - height * height).sqrt();
            let axis = DVec3::new(across * turn.cos(), height, across * turn.sin());
            (axis, (10.0 + 30.0 * rng.f64()).to_radians())
        })
        .collect();
    let tilted = DVec3::new(0.5, 0.75_f64.sqrt(), 0.0);
    let identical: Vec<Cap> = vec![(tilted, 30_f64.to_radians()); longest];
    let mut out = Vec::new();
    for (name, caps) in [("identical, 30 degrees", identical), ("distinct, 10 to 40 degrees", distinct)] {
        for count in [1, 2, 4, 8, 16, 64, 256, 1000].into_iter().filter(|n| *n <= longest) {
            let caps = &caps[..count];
            let guarded = chain(caps, Multiplier::multiply);
            let f32 = chain(caps, |_, t, blocked| multiply_single(t, blocked));
            let f16 = chain(caps, |multiplier, t, blocked| {
                let rounded: Vec<f64> = blocked.iter().map(|b| f16::from_f64(*b).to_f64()).collect();
                multiplier.multiply(t, &rounded);
            });
            out.push(CapChain {
                caps: name,
                count,
                truth: truth(caps, &points),
                plain: chain(caps, Multiplier::multiply_unguarded),
                guarded,
                f32,
                f16,
                passed: (0.0..=1.0).contains(&guarded)
                    && (f32 - guarded).abs() < NEAR_F32
                    && (f16 - guarded).abs() < NEAR_F16,
            });
        }
    }
    out
}

/// Runs all tests, and writes `chains.csv`, `trials.csv` and `stability.json` into `folder`.
pub fn run(bench: &Bench<'_>, folder: &Path) -> Result<StabilityOutcome> {
    crate::text::make_folder(folder)?;
    (bench.progress)("chains of caps");
    let chains = chains(bench.seed, if bench.quick { 64 } else { 1000 });
    let mut trials = Vec::new();
    for case in trials::cases(if bench.quick { 64 } else { 1000 })? {
        let frame = |options| bench.frame(&case.scene, options);
        for storage in [Storage::F16, Storage::F32] {
            let options = default_options();
            let bake = crate::bake::Options { storage, ..options.bake };
            trials.push(trials::run(&case, frame(crate::frame::Options { bake, ..options })?, storage)?);
        }
        (bench.progress)(&case.name);
    }
    let origin = json!({ "origin": bench.origin, "quick": bench.quick, "seed": bench.seed });
    let outcome = StabilityOutcome { chains, trials };
    write(&folder.join("chains.csv"), csv(&origin, &outcome.chains))?;
    write(&folder.join("trials.csv"), csv(&origin, &outcome.trials))?;
    write(&folder.join("stability.json"), format!("{:#}\n", json!({ "origin": origin, "outcome": outcome })))?;
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guard_keeps_chains_from_growing() {
        for chain in chains(1, 64) {
            let name = format!("{} x {}: {chain:?}", chain.count, chain.caps);
            // One cap of 30 degrees, 30 degrees off the normal, takes sin^2 30 cos 30.
            if chain.count == 1 && chain.caps.starts_with("identical") {
                assert!((chain.truth - (1.0 - 0.25 * 0.75_f64.sqrt())).abs() < 2e-3, "{name}");
                assert!((chain.plain - chain.truth).abs() < 5e-3, "{name}");
            }
            assert!(chain.guarded <= 1.0, "{name}");
            assert!(chain.passed, "{name}");
        }
        let worst = chains(1, 64).into_iter().filter(|c| c.count == 64).map(|c| c.plain).fold(0.0, f64::max);
        assert!(worst > 1.2, "the plain chain is known to brighten: {worst}");
    }
}
