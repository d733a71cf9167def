//! `shadow-fields bench skip` measures what each skip saves.

use super::common::{start, table};
use crate::app::{Global, output};
use crate::bench::{cases, skips};
use crate::error::Result;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench skip`.
#[derive(Args)]
pub struct Arguments {
    /// A minute on two cores instead of five: two scenes, fewer rays and rounds
    #[arg(long)]
    quick: bool,
    /// Measure only scenes that have TEXT in their names; may be given again; a text that none has lists them
    #[arg(long, value_name = "TEXT")]
    case: Vec<String>,
    /// Folder for skip.csv and skip.json
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints a row a scene and skip.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let scenes = cases::named(skips::all(arguments.quick)?, &arguments.case)?;
    let (context, rows) =
        start(global, arguments.quick, &arguments.out, |bench| skips::run(bench, &arguments.out, &scenes))?;
    if global.json {
        output::say(serde_json::json!({ "frames": rows }).to_string());
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
    context.finish()
}
