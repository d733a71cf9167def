//! `shadow-fields bench time-error`

use super::common::start;
use crate::app::{Global, output};
use crate::bench::time_error::{self, Selection};
use crate::error::Result;
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench time-error`.
#[derive(Args)]
pub struct Arguments {
    /// A minute on two cores instead of a quarter of an hour: fewer scenes, settings and rays
    #[arg(long)]
    quick: bool,
    /// Measure and sweep only cases that have TEXT in their names; may be given again; a text that none has lists them
    #[arg(long, value_name = "TEXT")]
    case: Vec<String>,
    /// Sweep only this axis, with all its settings; may be given again; an unknown name lists them
    #[arg(long, value_name = "NAME")]
    axis: Vec<String>,
    /// Folder for budget.csv, sweep.csv, rival.csv, time-error.json, time-error.txt (which setting is the default and why), plots
    /// and error pictures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints the budget and the comparison.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let selection = Selection { cases: arguments.case.clone(), axes: arguments.axis.clone() };
    let (context, outcome) =
        start(global, arguments.quick, |bench| time_error::run(bench, &arguments.out, &selection))?;
    if global.json {
        output::say(serde_json::to_value(&outcome).expect("results are plain data").to_string());
        return context.finish();
    }
    output::say("Relative RMS error over vertices, by cause (p99 and max of the total)");
    let rows: Vec<Vec<String>> = outcome
        .budgets
        .iter()
        .map(|b| {
            let mut row = vec![b.case.clone()];
            row.extend(
                [b.centre_rule.rms, b.bands.rms, b.sampling.rms, b.arithmetic_and_storage.rms, b.total.rms].map(three),
            );
            row.extend([b.total.p99, b.total.max, b.t0_error].map(three));
            row
        })
        .collect();
    output::table(&["scene", "centre rule", "bands", "sampling", "storage", "total", "p99", "max", "T0 error"], &rows);
    output::say("\nFrame against ray casting with as many threads");
    let rows: Vec<Vec<String>> = outcome
        .comparisons
        .iter()
        .map(|c| {
            let or_none = |x: Option<f64>| x.map_or("-".into(), three);
            let mut row = vec![c.case.clone(), c.light.clone()];
            row.extend([c.frame_wall_ms.median, c.merge_error.rms].map(three));
            row.extend([c.rays_at_equal_rms, c.rival_ms_at_equal_rms].map(or_none));
            row.extend([c.speed_up_at_equal_rms, c.merge_speed_up_at_equal_rms].map(or_none));
            row
        })
        .collect();
    output::table(&["scene", "light", "frame ms", "error", "rays", "rays ms", "times faster", "merge alone"], &rows);
    let folder = output::shown(&arguments.out);
    output::say(format!("\n{folder}: {} settings measured, {}", outcome.points.len(), outcome.took()));
    output::say(format!("{folder}/time-error.txt says which setting is the default and why"));
    context.finish()
}
