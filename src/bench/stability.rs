//! `bench stability`: what long chains, odd places and odd numbers do to the merge.

use super::Bench;
use super::default_options;
use super::text::{csv, write};
use super::trials::{self, Trial, Turn};
use crate::error::{Error, Result};
use crate::field::Storage;
use crate::render::chain::Multiplier;
use crate::render::variant::{self, Product};
use crate::sh::basis::MAX_COEFFICIENTS;
use crate::sh::lobe::{cap, clamped_cosine};
use crate::sh::product::Tensor;
use crate::sh::quadrature::sphere_rule;
use glam::DVec3;
use half::f16;
use serde::Serialize;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::path::Path;

/// Bands of the transfer in all chains.
const BANDS: usize = 4;
/// Degree of the rule by which the true irradiance is found; a cap's edge leaves about 1e-3.
const TRUTH_DEGREE: usize = 400;

/// Irradiance of a horizontal plane under a uniform sky of unit irradiance, behind a chain of caps.
#[derive(Clone, Debug, Serialize)]
pub struct Chain {
    /// Which caps.
    pub caps: &'static str,
    /// How many.
    pub count: usize,
    /// By quadrature of the true visibility.
    pub truth: f64,
    /// Products of 4 bands in f64.
    pub plain: f64,
    /// The same, guarded as the merge does it by default.
    pub guarded: f64,
    /// Products of 4 bands in f32.
    pub f32: f64,
    /// Factors rounded to f16, products in f64.
    pub f16: f64,
    /// Visibility of 5 bands.
    pub bands_5: f64,
    /// Visibility of 6 bands.
    pub bands_6: f64,
    /// Visibility of 7 bands: with 4 of transfer the chain cannot grow.
    pub bands_7: f64,
}

/// What was measured.
#[derive(Serialize)]
pub struct Outcome {
    /// Chains of caps.
    pub chains: Vec<Chain>,
    /// Scenes.
    pub trials: Vec<Trial>,
    /// Rotations composed of small steps.
    pub turns: Vec<Turn>,
}

/// How a chain multiplies.
#[derive(Clone, Copy, Default)]
struct Rule {
    visibility_bands: usize,
    guard: bool,
    single: bool,
    half: bool,
}

/// A cap: axis and half angle in radians.
type Cap = (DVec3, f64);

fn chain(caps: &[Cap], rule: Rule) -> f64 {
    let tensor = Tensor::new(BANDS, rule.visibility_bands, BANDS);
    let guarded = variant::Chain { product: Product::Factored, guard: rule.guard };
    let multiplier = Multiplier::new(guarded, BANDS, rule.visibility_bands);
    let mut t = multiplier.begin(&clamped_cosine(BANDS, DVec3::Y));
    for &(axis, half_angle) in caps {
        let mut blocked = [0.0; MAX_COEFFICIENTS];
        let exact = cap(rule.visibility_bands, axis, half_angle);
        for (to, from) in blocked.iter_mut().zip(exact) {
            *to = if rule.half { f16::from_f64(from).to_f64() } else { from };
        }
        if rule.single {
            subtract_single(&tensor, &mut t, &blocked);
        } else {
            multiplier.multiply(&mut t, &blocked);
        }
    }
    // Unit irradiance: radiance 1 / pi, whose expansion is sqrt(4 pi) / pi in the constant band.
    t[0] * (4.0 * PI).sqrt() / PI
}

/// One product as the device does it.
fn subtract_single(tensor: &Tensor, t: &mut [f64; MAX_COEFFICIENTS], blocked: &[f64; MAX_COEFFICIENTS]) {
    let mut product = [0.0_f32; MAX_COEFFICIENTS];
    for entry in tensor.entries() {
        product[entry.k] += entry.value as f32 * (t[entry.i] as f32 * blocked[entry.j] as f32);
    }
    t.iter_mut().zip(product).for_each(|(t, p)| *t = f64::from(*t as f32 - p));
}

fn truth(caps: &[Cap], rule: &[(DVec3, f64)]) -> f64 {
    let free = |w: &DVec3| caps.iter().all(|(axis, half_angle)| axis.dot(*w) < half_angle.cos());
    rule.iter().filter(|(w, _)| w.y > 0.0 && free(w)).map(|(w, weight)| weight * w.y).sum::<f64>() / PI
}

/// Chains of identical and of distinct caps.
pub fn chains(seed: u64, longest: usize) -> Vec<Chain> {
    let points = sphere_rule(TRUTH_DEGREE);
    let mut rng = fastrand::Rng::with_seed(seed);
    let distinct: Vec<Cap> = (0..longest)
        .map(|_| {
            let (height, turn) = (rng.f64(), 2.0 * PI * rng.f64());
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
            let base = Rule { visibility_bands: BANDS, ..Rule::default() };
            let of_bands = |visibility_bands| chain(caps, Rule { visibility_bands, ..base });
            out.push(Chain {
                caps: name,
                count,
                truth: truth(caps, &points),
                plain: chain(caps, base),
                guarded: chain(caps, Rule { guard: true, ..base }),
                f32: chain(caps, Rule { single: true, ..base }),
                f16: chain(caps, Rule { half: true, ..base }),
                bands_5: of_bands(5),
                bands_6: of_bands(6),
                bands_7: of_bands(7),
            });
        }
    }
    out
}

/// Measures, and writes `chains.csv`, `trials.csv`, `turns.csv` and `stability.json` into `folder`.
///
/// # Errors
/// `Failed` when the folder cannot be written; else as [`crate::frame::Frame::new`].
pub fn run(bench: &Bench<'_>, folder: &Path) -> Result<Outcome> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::Failed(format!("{}: cannot be made: {error}", folder.display())))?;
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
    (bench.progress)("a million small turns");
    let turns = trials::turns(1_000_000);
    let rows = |value: Value| value.as_array().cloned().unwrap_or_default();
    let origin = json!({ "origin": bench.origin, "quick": bench.quick, "seed": bench.seed });
    let outcome = Outcome { chains, trials, turns };
    write(&folder.join("chains.csv"), &csv(&origin, &rows(json!(outcome.chains))))?;
    write(&folder.join("trials.csv"), &csv(&origin, &rows(json!(outcome.trials))))?;
    write(&folder.join("turns.csv"), &csv(&origin, &rows(json!(outcome.turns))))?;
    write(&folder.join("stability.json"), &format!("{:#}\n", json!({ "origin": origin, "outcome": outcome })))?;
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guard_and_seven_bands_keep_chains_from_growing() {
        for chain in chains(1, 64) {
            let name = format!("{} x {}: {chain:?}", chain.count, chain.caps);
            // One cap of 30 degrees, 30 degrees off the normal, takes sin^2 30 cos 30.
            if chain.count == 1 && chain.caps.starts_with("identical") {
                assert!((chain.truth - (1.0 - 0.25 * 0.75_f64.sqrt())).abs() < 2e-3, "{name}");
                assert!((chain.plain - chain.truth).abs() < 5e-3, "{name}");
            }
            assert!(chain.guarded <= 1.0 && chain.bands_7 <= 1.0, "{name}");
            assert!((chain.f32 - chain.plain).abs() < 1e-4 * (1.0 + chain.plain.abs()), "{name}");
        }
        let worst = chains(1, 64).into_iter().filter(|c| c.count == 64).map(|c| c.plain).fold(0.0, f64::max);
        assert!(worst > 1.2, "the plain chain is known to brighten: {worst}");
    }
}
