//! `shadow-fields bench`: the measurements behind the documentation's figures.

pub(super) mod common;
mod floor;
mod product;
mod scaling;
mod skip;
mod soak;
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
    /// Measure the error of bands and of sampling below a teapot, and compare it with an independent ray caster's
    Floor(floor::Arguments),
    /// Time one SH product in each of its forms
    Product(product::Arguments),
    /// Test the merge with long chains, extreme places and extreme numbers; exit code 1 where a trial fails
    Stability(stability::Arguments),
    /// Measure what each skip saves and how it changes the error
    Skip(skip::Arguments),
    /// Draw a million frames and watch memory, pictures and frame times; exit code 1 where they drift
    Soak(soak::Arguments),
    /// Measure time and memory for growing numbers of vertices, entities and lights
    Scaling(scaling::Arguments),
}

/// Runs a measurement.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::TimeError(arguments) => time_error::run(global, arguments),
        What::Floor(arguments) => floor::run(global, arguments),
        What::Product(arguments) => product::run(global, arguments),
        What::Stability(arguments) => stability::run(global, arguments),
        What::Skip(arguments) => skip::run(global, arguments),
        What::Soak(arguments) => soak::run(global, arguments),
        What::Scaling(arguments) => scaling::run(global, arguments),
    }
}
