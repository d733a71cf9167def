//! `shadow-fields farm`: bakes and pictures of many machines, cut into slices that share a folder.

mod collect;
mod plan;
mod run;
mod submit;

use super::{Global, output};
use crate::error::{Error, Result};
use crate::farm::Plan;
use crate::farm::status::Status;
use clap::{Args, Subcommand};
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `farm`.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Commands,
}

#[derive(Subcommand)]
enum Commands {
    /// Cut works into slices of about two minutes and write them, with everything that decides their bytes
    Plan(plan::Arguments),
    /// Compute one slice; return at once if its result exists and is intact
    Run(run::Arguments),
    /// Check all results and make cache files and pictures of them, or say which slices have to run again
    Collect(collect::Arguments),
    /// Count what is done and estimate what is left
    Status(StatusArguments),
    /// Hand the slices that have no result to an engine
    Submit(submit::Arguments),
}

/// Arguments of `farm status`.
#[derive(Args)]
pub struct StatusArguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
}

/// Runs one of the commands.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    // Results are named by all that decides them, and a plan says nothing of these two.
    if global.shader_dir.is_some() || global.seed != Global::SEED {
        return Err(Error::Usage("farm does not take --shader-dir and --seed: a plan does not store them".into()));
    }
    match &arguments.command {
        Commands::Plan(arguments) => plan::run(global, arguments),
        Commands::Run(arguments) => run::run(global, arguments),
        Commands::Collect(arguments) => collect::run(global, arguments),
        Commands::Status(arguments) => status(global, arguments),
        Commands::Submit(arguments) => submit::run(global, arguments),
    }
}

fn status(global: &Global, arguments: &StatusArguments) -> Result<()> {
    let status = Status::of(&Plan::read(&arguments.plan)?);
    output::say(if global.json { json!(status).to_string() } else { status.line(32) });
    Ok(())
}
