//! `bench floor`: a teapot over a floor, compared with an independent ray caster's errors of four bands.

use super::budget::{Budget, Effort, Truth, budget};
use super::cases;
use super::{Bench, default_options};
use crate::bake;
use crate::error::Result;
use crate::frame;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// Root mean square of T0-T1 over that of the unoccluded value by the independent check, if it has the case, in the order of
/// [`cases::floor`].
const INDEPENDENT: [Option<f64>; 7] = [Some(0.0023), Some(0.0054), Some(0.0064), None, None, Some(0.036), Some(0.061)];

/// Cells along a side of the floor: 40 x 40 receiving vertices, as in the independent check.
const CELLS: usize = 39;

/// Goal: largest T1-T3 as a share of T0-T1.
pub const GOAL: f64 = 0.45;

/// Errors under one light.
#[derive(Clone, Debug, Serialize)]
pub struct FloorRow {
    /// Teapot and light.
    pub case: String,
    /// T0-T1, root mean square over that of the unoccluded value.
    pub bands_per_unoccluded: f64,
    /// The same by the independent check.
    pub independent_bands_per_unoccluded: Option<f64>,
    /// T1-T3 in the same unit.
    pub below_bands_per_unoccluded: f64,
    /// T0-T3 in the same unit.
    pub total_per_unoccluded: f64,
    /// T1-T3 over T0-T1.
    pub below_bands_per_bands_ratio: f64,
    /// All rungs, relative to T0.
    pub budget: Budget,
}

impl FloorRow {
    fn new(budget: Budget, independent: Option<f64>) -> Self {
        let unit = budget.t0_per_unoccluded;
        FloorRow {
            case: budget.case.clone(),
            bands_per_unoccluded: unit * budget.bands.rms,
            independent_bands_per_unoccluded: independent,
            below_bands_per_unoccluded: unit * budget.below_bands.rms,
            total_per_unoccluded: unit * budget.total.rms,
            below_bands_per_bands_ratio: budget.below_bands.rms / budget.bands.rms,
            budget,
        }
    }

    /// T0-T1 without the standard errors of T0 and T1, whose squares are subtracted.
    pub fn bands_without_noise(&self) -> f64 {
        let Budget { bands, t0_error, t1_error, t0_per_unoccluded, .. } = &self.budget;
        t0_per_unoccluded * (bands.rms.powi(2) - t0_error.powi(2) - t1_error.powi(2)).max(0.0).sqrt()
    }

    /// Whether T0-T1 is within 20 % of the independent check's.
    pub fn agrees(&self) -> bool {
        let off = |known: f64| (self.bands_without_noise() / known - 1.0).abs();
        self.independent_bands_per_unoccluded.is_none_or(|known| off(known) <= 0.2)
    }

    /// Whether T1-T3 meets the goal.
    pub fn keeps_goal(&self) -> bool {
        self.below_bands_per_bands_ratio <= GOAL
    }
}

/// Measures the named lights, or all, with `rays` rays per vertex, light and factor and with fields of the given bake options, and
/// writes `floor.csv` and `floor.json` into `folder`.
///
/// # Errors
/// `Usage` when no light has a given text in its name, `Failed` when the folder cannot be written; else as [`crate::frame::Frame::new`].
pub fn run(
    bench: &Bench<'_>,
    folder: &Path,
    lights: &[String],
    rays: Option<u32>,
    bake: bake::Options,
) -> Result<Vec<FloorRow>> {
    let known: Vec<_> = cases::floor(CELLS)?.into_iter().zip(INDEPENDENT).collect();
    let chosen = cases::named(known, lights, |(case, _)| &case.name)?;
    let options = frame::Options { bake, ..default_options() };
    crate::text::make_folder(folder)?;
    // All 1 600 vertices: most of the error sits in the few under the teapot.
    let rays = rays.unwrap_or(if bench.quick { 4096 } else { 16384 });
    let effort = Effort { vertices: usize::MAX, t0_rays: rays, t1_rays: rays };
    let mut rows = Vec::new();
    for (case, independent) in chosen {
        (bench.progress)(&format!("{}: casting rays", case.name));
        let truth = Truth::new(&case, effort, bench.seed, bench.progress);
        rows.push(FloorRow::new(budget(bench, &case, &truth, options)?, independent));
    }
    let origin = json!({
        "origin": bench.origin, "quick": bench.quick, "seed": bench.seed, "bake": bake, "lattice": bake.lattice.to_string(),
        "errors": "root mean square over all 1600 vertices, relative to that of the unoccluded value",
    });
    crate::text::write_rows(folder, "floor", &origin, &rows)?;
    Ok(rows)
}
