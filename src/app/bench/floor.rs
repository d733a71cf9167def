//! `shadow-fields bench floor` measures the error of bands and of sampling below a teapot.

use super::common::start;
use crate::app::{Global, output};
use crate::bake;
use crate::bench::floor;
use crate::error::{Error, Result};
use crate::field::Lattice;
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench floor`.
#[derive(Args)]
pub struct Arguments {
    /// Fewer rays
    #[arg(long)]
    quick: bool,
    /// Only lights that have TEXT in their names; may be given again; a text that none has lists them
    #[arg(long, value_name = "TEXT")]
    case: Vec<String>,
    /// Rays for each vertex, light and factor; default: 16 384, with --quick 4 096
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=1_048_576))]
    rays: Option<u32>,
    /// Sample points, as `bake --lattice` takes them
    #[arg(long, default_value = "cube:18x7,edges=auto", value_name = "LATTICE")]
    lattice: Lattice,
    /// Edge of a captured cube face in texels
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=1024))]
    face_px: u32,
    /// Folder for floor.csv and floor.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints the table; fails where the bands rung is not what was found independently.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let bake = bake::Options { lattice: arguments.lattice, face_px: arguments.face_px, ..Default::default() };
    let (context, rows) = start(global, arguments.quick, |bench| {
        floor::run(bench, &arguments.out, &arguments.case, arguments.rays, bake)
    })?;
    if global.json {
        output::say(serde_json::to_value(&rows).expect("results are plain data").to_string());
    } else {
        output::say("A teapot over a floor: RMS of radiosity over all vertices, in units of the unoccluded value's");
        let lines: Vec<Vec<String>> = rows
            .iter()
            .map(|row| {
                let independent = row.independent_bands_per_unoccluded.map_or("-".into(), three);
                let mut line = vec![row.case.clone(), three(row.bands_per_unoccluded), independent];
                line.extend([row.below_bands_per_unoccluded, row.total_per_unoccluded].map(three));
                line.push(three(row.below_bands_per_bands_ratio));
                line.push(if row.keeps_goal() { "kept" } else { "missed" }.into());
                line
            })
            .collect();
        let header = ["light", "bands", "independent", "below bands", "total", "below / bands", "goal"];
        output::table(&header, &lines);
        output::say(format!("Goal: what is below the bands rung at most {} of it", floor::GOAL));
    }
    context.finish()?;
    let apart: Vec<&str> = rows.iter().filter(|row| !row.agrees()).map(|row| row.case.as_str()).collect();
    if apart.is_empty() {
        return Ok(());
    }
    Err(Error::Failed(format!("bands rung off by more than a fifth of the independent figure: {}", apart.join("; "))))
}
