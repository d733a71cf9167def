//! `shadow-fields bench scaling` measures time and memory for growing scenes.

use super::common::{start, table};
use crate::app::{Global, output};
use crate::bench::scaling;
use crate::error::Result;
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
    /// Folder for scaling.csv, scaling.json and a plot for each axis
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints a row a size.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (context, points) =
        start(global, arguments.quick, &arguments.out, |bench| scaling::run(bench, &arguments.out, &arguments.axis))?;
    if global.json {
        output::say(serde_json::to_value(&points).expect("results are plain data").to_string());
        return context.finish();
    }
    output::say("Frames without drawing, in milliseconds: everything moves, one entity moves, nothing moves");
    let columns = [
        ("axis", "/axis"),
        ("vertices", "/vertices"),
        ("entities", "/entities"),
        ("lights", "/lights"),
        ("all move", "/all_move_ms/median"),
        ("merge", "/merge_ms/median"),
        ("one moves", "/one_moves_ms/median"),
        ("at rest", "/rest_ms/median"),
        ("ns/vertex", "/merge_ns_a_vertex"),
        ("lookups/vertex", "/entries_a_vertex"),
        ("error", "/error"),
        ("device bytes", "/device_bytes"),
        ("resident bytes", "/resident_bytes"),
    ];
    table(&points, &columns);
    context.finish()
}
