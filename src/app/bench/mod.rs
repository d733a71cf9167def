//! `shadow-fields bench`: the measurements behind the documentation's figures.

pub(super) mod common;
mod scaling;
mod skip;
mod stability;
mod time_error;

use super::Global;
use crate::error::Result;
use clap::{Args, Subcommand};

/// Arguments of `bench`.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Split the error of pictures into its causes, sweep the settings, and compare with ray casting and shadow maps
    TimeError(time_error::Arguments),
    /// Test the merge with long chains, extreme places and extreme numbers; exit code 1 where a trial fails
    Stability(stability::Arguments),
    /// Measure what each skip saves and how it changes the error
    Skip(skip::Arguments),
    /// Measure time and memory for growing numbers of vertices, entities and lights
    Scaling(scaling::Arguments),
}

/// Runs a measurement.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::TimeError(arguments) => time_error::run(global, arguments),
        What::Stability(arguments) => stability::run(global, arguments),
        What::Skip(arguments) => skip::run(global, arguments),
        What::Scaling(arguments) => scaling::run(global, arguments),
    }
}
