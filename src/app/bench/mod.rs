//! `shadow-fields bench`: the measurements behind the documentation's figures.

mod common;
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
    /// What a picture's error is made of, what run time buys, and ray casting beside the merge
    TimeError(time_error::Arguments),
    /// What band-limiting and sampling cost below a teapot, beside an independent ray caster's figures
    Floor(floor::Arguments),
    /// What one product costs in every form, alone on the device
    Product(product::Arguments),
    /// What long chains, odd places and odd numbers do to the merge; exit code 1 where one goes wrong
    Stability(stability::Arguments),
    /// What each skip saves and what it does to the error
    Skip(skip::Arguments),
    /// Whether memory grows, pictures drift or frames slow over a million frames; exit code 1 where they do
    Soak(soak::Arguments),
    /// Time and memory as vertices, entities and lights become many
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
