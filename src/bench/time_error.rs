//! `bench time-error`: error budgets, run time against error, and ray casting beside it.

use super::budget::{Budget, budget};
use super::cases::{self, Case};
use super::figures::{Spread, VertexDifference, spread};
use super::judged::Judged;
use super::rival::{Comparison, compare};
use super::{Bench, default_options, merge_ms};
use crate::bake::{self, Quality};
use crate::error::Result;
use crate::frame::{self, Frame};
use serde::Serialize;

#[derive(Default, Serialize)]
pub struct TimeErrorOutcome {
    /// One row per scene and light.
    pub budgets: Vec<Budget>,
    /// One row per scene, light and `--quality`.
    pub qualities: Vec<QualityPoint>,
    /// Rows of each case: at vertices and at pixels, and by every way to take the lights.
    pub comparisons: Vec<Comparison>,
}

/// What fields of one quality cost and how far they err.
#[derive(Clone, Debug, Serialize)]
pub struct QualityPoint {
    pub case: String,
    pub quality: String,
    pub field_bytes: u64,
    /// Device time of the merge and of sharp lights.
    pub merge_ms: Spread,
    pub error: VertexDifference,
}

/// Measures every case.
pub fn run(bench: &Bench<'_>, cases: &[Case]) -> Result<TimeErrorOutcome> {
    let mut outcome = TimeErrorOutcome::default();
    for (index, case) in cases.iter().enumerate() {
        (bench.progress)(&format!("case {} of {}, {}: casting rays", index + 1, cases.len(), case.name));
        let judged = Judged::vertices_of(bench, case)?;
        outcome.budgets.push(budget(bench, case, &judged)?);
        (bench.progress)(&format!("{}: errors split into their causes", case.name));
        outcome.qualities.extend(qualities(bench, case, &judged)?);
        outcome.comparisons.extend(compare(bench, case, &judged)?);
    }
    Ok(outcome)
}

/// All qualities on the same vertices, rendered in turns, so that whatever else the machine does meets all alike.
fn qualities(bench: &Bench<'_>, case: &Case, judged: &Judged) -> Result<Vec<QualityPoint>> {
    let placements = case.scene.at(case.time_s);
    let base = default_options();
    let frame = |quality: Quality| {
        let bake = bake::Options { vertices: base.bake.vertices, groups: base.bake.groups, ..quality.options() };
        bench.frame(&case.scene, frame::Options { bake, ..base })
    };
    // The finest takes long to bake.
    let all = &[Quality::Draft, Quality::Normal, Quality::High][..if bench.quick { 2 } else { 3 }];
    let mut frames = all.iter().map(|&quality| frame(quality)).collect::<Result<Vec<Frame>>>()?;
    let mut times = vec![Vec::new(); frames.len()];
    for round in 0..if bench.quick { 8 } else { 18 } {
        for (frame, times) in frames.iter_mut().zip(&mut times) {
            frame.forget();
            let took = merge_ms(&frame.render(&placements, None)?);
            // The first frames compile and warm up.
            if round >= 3 {
                times.push(took);
            }
        }
    }
    let point = |((quality, frame), times): ((&Quality, &Frame), &Vec<f64>)| {
        Ok(QualityPoint {
            case: case.name.clone(),
            quality: format!("{quality:?}").to_lowercase(),
            field_bytes: frame.buffers.fields.size_bytes,
            merge_ms: spread(times),
            error: judged.error(&judged.found(frame)?),
        })
    };
    all.iter().zip(&frames).zip(&times).map(point).collect()
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
