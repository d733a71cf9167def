//! `bench time-error`: error budgets, run time against error, and ray casting beside it.

use super::budget::{Budget, Effort, Truth, budget};
use super::cases::{self, Case};
use super::rival::{Comparison, compare};
use super::{Bench, default_options};
use crate::error::Result;
use serde::Serialize;

#[derive(Default, Serialize)]
pub struct TimeErrorOutcome {
    /// One row per scene and light.
    pub budgets: Vec<Budget>,
    /// Rows of each case: at vertices and at pixels, and by every way to take the lights.
    pub comparisons: Vec<Comparison>,
}

/// Measures every case.
pub fn run(bench: &Bench<'_>, cases: &[Case]) -> Result<TimeErrorOutcome> {
    let mut outcome = TimeErrorOutcome::default();
    let effort = Effort::new(bench.quick);
    for (index, case) in cases.iter().enumerate() {
        (bench.progress)(&format!("case {} of {}, {}: casting rays", index + 1, cases.len(), case.name));
        let truth = Truth::new(case, effort, bench.seed);
        truth.check(case)?;
        outcome.budgets.push(budget(bench, case, &truth, default_options())?);
        (bench.progress)(&format!("{}: errors split into their causes", case.name));
        outcome.comparisons.extend(compare(bench, case, &truth.reference)?);
    }
    Ok(outcome)
}

/// The named cases, or all. A quick run without names leaves out cases that take ten seconds or more to bake on two
/// cores, and uses the teapot under one light only.
pub fn chosen(quick: bool, names: &[String]) -> Result<Vec<Case>> {
    let mut all: Vec<Case> = cases::teapot_lights()?.into_iter().chain(cases::scenes()?).collect();
    if quick && names.is_empty() {
        all.retain(|case| {
            ["sphere_over_plane", "torus_over_plane"].contains(&case.name.as_str()) || case.name.contains("(b)")
        });
    }
    cases::named(all, names)
}
