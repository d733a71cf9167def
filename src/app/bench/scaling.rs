//! `shadow-fields bench scaling` measures time and memory for growing scenes.

use super::common::start;
use crate::app::{Global, output};
use crate::bench::scaling;
use crate::error::Result;
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench scaling`.
#[derive(Args)]
pub struct Arguments {
    /// A minute on two cores instead of five: fewer and smaller sizes
    #[arg(long)]
    quick: bool,
    /// Measure only this axis; may be given again; an unknown name lists them
    #[arg(long, value_name = "NAME")]
    axis: Vec<String>,
    /// Folder for scaling.csv, scaling.json and plots
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints a row a size.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (context, points) =
        start(global, arguments.quick, |bench| scaling::run(bench, &arguments.out, &arguments.axis))?;
    if global.json {
        output::say(serde_json::to_value(&points).expect("results are plain data").to_string());
        return context.finish();
    }
    output::say("Frames without drawing: everything moves, one entity moves, nothing moves");
    let cells = points.iter().map(|p| {
        let mut cells = vec![p.axis.to_owned()];
        cells.extend([p.vertices, p.entities, p.lights].map(|n| n.to_string()));
        cells.extend([p.all_move_ms, p.merge_ms, p.one_moves_ms, p.rest_ms].map(|ms| three(ms.median)));
        cells.extend([p.host_lists_ms, p.device_lists_ms].map(|ms| ms.map_or("-".into(), three)));
        cells.extend([p.merge_ns_a_vertex, p.entries_a_vertex, p.counts.dropped_bound, p.error].map(three));
        cells.push(three(p.device_bytes as f64 / 1048576.0));
        cells.push(p.resident_bytes.map_or("-".into(), |bytes| three(bytes as f64 / 1048576.0)));
        cells
    });
    let header = [
        "axis",
        "vertices",
        "entities",
        "lights",
        "all ms",
        "merge ms",
        "one ms",
        "rest ms",
        "host lists ms",
        "device lists ms",
        "ns/vertex",
        "entries",
        "dropped",
        "error",
        "device MiB",
        "resident MiB",
    ];
    output::table(&header, &cells.collect::<Vec<_>>());
    context.finish()
}
