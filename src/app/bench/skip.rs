//! `shadow-fields bench skip` measures what each skip saves, in frames and in bakes.

use super::common::{start, table};
use crate::app::{Global, output};
use crate::bench::{bake_skips, cases, skips};
use crate::error::Result;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench skip`.
#[derive(Args)]
pub struct Arguments {
    /// A minute on two cores instead of five: two scenes, fewer rays and rounds
    #[arg(long)]
    quick: bool,
    /// Measure only scenes and meshes that have TEXT in their names; may be given again; a text that none has lists
    /// them
    #[arg(long, value_name = "TEXT")]
    case: Vec<String>,
    /// Folder for skip.csv and skip.json, and of bakes skip_bake.csv and skip_bake.json
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints a row a scene and skip.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let mut scenes = skips::all(arguments.quick)?;
    let mut meshes = bake_skips::meshes(arguments.quick);
    let names = scenes.iter().map(|case| &case.name).chain(meshes.iter().map(|mesh| &mesh.name));
    let mut names: Vec<String> = names.cloned().collect();
    names.dedup();
    let names = cases::named(names, &arguments.case, String::as_str)?;
    scenes.retain(|case| names.contains(&case.name));
    meshes.retain(|mesh| names.contains(&mesh.name));
    let (context, (rows, bakes)) = start(global, arguments.quick, &arguments.out, |bench| {
        Ok((skips::run(bench, &arguments.out, &scenes)?, bake_skips::run(bench, &arguments.out, &meshes)?))
    })?;
    if global.json {
        output::say(serde_json::json!({ "frames": rows, "bakes": bakes }).to_string());
        return context.finish();
    }
    output::say(
        "Times of a frame without drawing, in turns without and with the skip (for \"hidden\" with drawing, at 1280x720). Left off: \
         entries of\nlists (for \"hidden\": clusters). Errors and changes are relative to the RMS radiosity.",
    );
    let columns = [
        ("scene", "/case"),
        ("skip", "/skip"),
        ("off ms", "/off/frame_ms/median"),
        ("on ms", "/on/frame_ms/median"),
        ("times faster", "/speed_up_ratio"),
        ("left off", "/left_off_count"),
        ("off lookups", "/off/entry_count"),
        ("on lookups", "/on/entry_count"),
        ("off error", "/off/error/rms_relative"),
        ("on error", "/on/error/rms_relative"),
        ("most change", "/change/max_relative"),
    ];
    table(&rows, &columns);
    output::say(
        "\nBakes without any shortcut (off) and with this one (on); errors are against a field of faces of 128 px. Filled: samples inside \
         the solid,\ncaptured at its surface or filled from neighbours.",
    );
    let columns = [
        ("mesh", "/case"),
        ("triangles", "/triangle_count"),
        ("skip", "/skip"),
        ("off ms", "/off/bake_ms"),
        ("on ms", "/on/bake_ms"),
        ("times faster", "/speed_up_ratio"),
        ("captured", "/on/captured_count"),
        ("filled", "/on/filled_count"),
        ("off faces", "/off/face_count"),
        ("on faces", "/on/face_count"),
        ("off error", "/off/error"),
        ("on error", "/on/error"),
    ];
    table(&bakes, &columns);
    context.finish()
}
