//! `bench time-error`: error budgets, run time against error, and ray casting beside it.

use super::budget::{Budget, Effort, Truth, budget};
use super::cases::{self, Case};
use super::rival::{Comparison, compare};
use super::{Bench, default_options};
use crate::error::Result;
use crate::text::{csv, write};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The selected cases; an empty list selects all, but for cases that run only when they are named.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Selection {
    /// A scene file, which is then the only case.
    pub scene: Option<PathBuf>,
    /// Parts of the names of cases.
    pub cases: Vec<String>,
}

#[derive(Default, Serialize)]
pub struct TimeErrorOutcome {
    /// One row per scene and light.
    pub budgets: Vec<Budget>,
    /// Rows of each case: at vertices and at pixels, and by every way to take the lights.
    pub comparisons: Vec<Comparison>,
}

/// Measures, and writes into `folder`: `budget.csv`, `rival.csv` and `time-error.json`. `own` is the case of the selected scene file.
pub fn run(bench: &Bench<'_>, folder: &Path, selection: &Selection, own: Option<Case>) -> Result<TimeErrorOutcome> {
    let cases = own.map_or_else(|| chosen(bench.quick, &selection.cases), |case| Ok(vec![case]))?;
    crate::text::make_folder(folder)?;
    let mut outcome = TimeErrorOutcome::default();
    let effort = Effort::new(bench.quick);
    for (index, case) in cases.iter().enumerate() {
        (bench.progress)(&format!("case {} of {}, {}: casting rays", index + 1, cases.len(), case.name));
        let truth = Truth::new(case, effort, bench.seed);
        truth.check(case)?;
        outcome.budgets.push(budget(bench, case, &truth, default_options())?);
        (bench.progress)(&format!("{}: errors split into their causes", case.name));
        outcome.comparisons.extend(compare(bench, case, &truth)?);
    }
    write_all(bench, folder, selection, &outcome)?;
    Ok(outcome)
}

/// The named cases, or all. A quick run without names leaves out cases that take ten seconds or more to bake on two
/// cores, and uses the teapot under one light only.
fn chosen(quick: bool, names: &[String]) -> Result<Vec<Case>> {
    let mut all: Vec<Case> = cases::teapot_lights()?.into_iter().chain(cases::scenes()?).collect();
    if quick && names.is_empty() {
        all.retain(|case| {
            ["sphere_over_plane", "torus_over_plane"].contains(&case.name.as_str()) || case.name.contains("(b)")
        });
    }
    cases::named(all, names)
}

fn write_all(bench: &Bench<'_>, folder: &Path, selection: &Selection, outcome: &TimeErrorOutcome) -> Result<()> {
    let origin = json!({
        "origin": bench.origin, "quick": bench.quick, "seed": bench.seed, "selection": selection,
        "errors": "relative to the root mean square of T0 over the judged vertices",
    });
    write(&folder.join("budget.csv"), csv(&origin, &outcome.budgets))?;
    let rivals: Vec<Value> = outcome.comparisons.iter().flat_map(rival_rows).collect();
    write(&folder.join("rival.csv"), csv(&origin, &rivals))?;
    write(&folder.join("time-error.json"), format!("{:#}\n", json!({ "origin": origin, "outcome": outcome })))?;
    Ok(())
}

/// One row for the merge, and one for each number of rays and each shadow map. Comparisons of one place have the same
/// rivals.
fn rival_rows(comparison: &Comparison) -> Vec<Value> {
    let row = |what: String, wall_ms: f64, error| {
        json!({
            "case": comparison.case, "place": comparison.place, "what": what,
            "point_count": comparison.points, "thread_count": comparison.threads, "wall_ms": wall_ms, "error": error,
            "speed_up_at_equal_rms_ratio": comparison.speed_up_at_equal_rms,
            "merge_speed_up_at_equal_rms_ratio": comparison.merge_speed_up_at_equal_rms, "rays_at_equal_rms_count": comparison.rays_at_equal_rms,
        })
    };
    let merge = row(comparison.merge_title().into(), comparison.frame_wall_ms.median, comparison.merge_error);
    let cast = comparison.rival.iter().map(|p| row(format!("{} rays", p.rays), p.wall_ms.median, p.error));
    let maps = comparison.maps.iter().map(|p| row(p.title(), p.wall_ms.median, p.error));
    let rivals = cast.chain(maps);
    std::iter::once(merge).chain(rivals).collect()
}
