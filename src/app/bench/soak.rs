//! `shadow-fields bench soak` draws a million frames and watches for drift.

use super::common::start;
use crate::app::{Global, output};
use crate::bench::soak;
use crate::error::{Error, Result};
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench soak`.
#[derive(Args)]
pub struct Arguments {
    /// Frames to draw; a million takes about an hour on a software device
    #[arg(long, default_value_t = 1_000_000, value_name = "N", value_parser = clap::value_parser!(u64).range(3000..=1_000_000_000))]
    frames: u64,
    /// Folder for soak.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Draws, prints what was seen, and fails where something is wrong with it.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (context, outcome) = start(global, false, |bench| soak::run(bench, arguments.frames, Some(&arguments.out)))?;
    if global.json {
        output::say(serde_json::to_value(&outcome).expect("results are plain data").to_string());
    } else {
        let [first, .., last] = outcome.quicker_ms;
        let memory = outcome.memory_bytes.map_or_else(
            || "memory unknown".to_owned(),
            |[before, most]| format!("memory from {:.1} to {:.1} MB", before as f64 * 1e-6, most as f64 * 1e-6),
        );
        output::say(format!(
            "{} frames in {:.0} s: {memory}, {} of {} pictures of the same moment differ, the quicker frames took {first:.2} ms in the first tenth after the warm-up and {last:.2} ms in the last",
            outcome.frames, outcome.seconds, outcome.differing, outcome.compared
        ));
    }
    context.finish()?;
    match outcome.faults() {
        faults if faults.is_empty() => Ok(()),
        faults => Err(Error::Failed(faults.join("; "))),
    }
}
