//! `shadow-fields bench skip` measures what each skip saves, in frames and in bakes.

use super::common::start;
use crate::app::{Global, output};
use crate::bench::{bake_skips, cases, skips};
use crate::error::Result;
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench skip`.
#[derive(Args)]
pub struct Arguments {
    /// A minute on two cores instead of five: two scenes, fewer rays and rounds
    #[arg(long)]
    quick: bool,
    /// Measure only scenes and meshes that have TEXT in their names; may be given again; a text that none has lists them
    #[arg(long, value_name = "TEXT")]
    case: Vec<String>,
    /// Folder for skip.csv, skip.json, skip.svg, and of bakes skip_bake.csv and skip_bake.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints a row a scene and skip.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (mut scenes, mut meshes) = (skips::all(arguments.quick)?, bake_skips::meshes(arguments.quick));
    let names = scenes.iter().map(|case| &case.name).chain(meshes.iter().map(|mesh| &mesh.name));
    let mut names: Vec<String> = names.cloned().collect();
    names.dedup();
    let names = cases::named(names, &arguments.case, String::as_str)?;
    scenes.retain(|case| names.contains(&case.name));
    meshes.retain(|mesh| names.contains(&mesh.name));
    let (context, (rows, bakes)) = start(global, arguments.quick, |bench| {
        Ok((skips::run(bench, &arguments.out, &scenes)?, bake_skips::run(bench, &arguments.out, &meshes)?))
    })?;
    if global.json {
        output::say(serde_json::json!({ "frames": rows, "bakes": bakes }).to_string());
    } else {
        print_frames(&rows);
        print_bakes(&bakes);
    }
    context.finish()
}

fn print_frames(rows: &[skips::SkipCost]) {
    output::say(
        "Times of a frame without drawing, in turns without and with the skip (for \"hidden\" with drawing, at 1280x720). Left off: \
         entries of\nlists (for \"hidden\": clusters). Errors and changes are relative to the RMS radiosity.",
    );
    let cells = rows.iter().map(|row| {
        let mut cells = vec![row.case.clone(), row.skip.clone()];
        cells.extend([row.off.frame_ms.median, row.on.frame_ms.median, row.times_faster].map(three));
        cells.push(row.left_off_count.map_or("-".into(), |count| count.to_string()));
        cells.extend([row.off.entries, row.on.entries].map(|entries| entries.to_string()));
        cells.extend([row.off.error.rms, row.on.error.rms, row.change.max].map(three));
        cells.extend([row.off.field_bytes, row.on.field_bytes].map(|bytes| (bytes / 1024).to_string()));
        cells
    });
    let header = [
        "scene",
        "skip",
        "off ms",
        "on ms",
        "times faster",
        "left off",
        "off lookups",
        "on lookups",
        "off error/RMS",
        "on error/RMS",
        "most change/RMS",
        "off KiB of fields",
        "on KiB",
    ];
    output::table(&header, &cells.collect::<Vec<_>>());
}

fn print_bakes(bakes: &[bake_skips::BakeSkipRow]) {
    output::say(
        "\nBakes without any shortcut (off) and with this one (on); errors are against a field of faces of 128 px. Filled: samples inside \
         the solid,\ncaptured at its surface or filled from neighbours.",
    );
    let cells = bakes.iter().map(|row| {
        let mut cells = vec![row.case.clone(), row.triangle_count.to_string(), row.lattice.clone(), row.skip.clone()];
        cells.extend([row.off.bake_ms, row.on.bake_ms, row.times_faster].map(three));
        let counts = [row.on.captured_count, row.on.filled_count, row.off.face_count, row.on.face_count];
        cells.extend(counts.map(|count| count.to_string()));
        cells.extend([row.off.error, row.on.error].map(three));
        cells
    });
    let header = [
        "mesh",
        "triangles",
        "lattice",
        "skip",
        "off ms",
        "on ms",
        "times faster",
        "captured",
        "filled",
        "off faces",
        "on faces",
        "off error",
        "on error",
    ];
    output::table(&header, &cells.collect::<Vec<_>>());
}
