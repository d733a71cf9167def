//! `shadow-fields farm`: bakes and pictures of many machines, cut into slices that share a folder.

mod collect;
mod plan;
mod run;
mod submit;

use super::{Global, output};
use crate::error::{Error, Result};
use crate::farm::{Plan, counted, results};
use clap::{Args, Subcommand};
use serde_json::json;
use std::path::PathBuf;

#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Commands,
}

#[derive(Subcommand)]
enum Commands {
    /// Cut bakes and pictures into slices and write them, with everything that decides their bytes
    Plan(Box<plan::Arguments>),
    /// Compute one slice; return at once if its result exists and is intact
    Run(run::Arguments),
    /// Check all results and make cache files and pictures of them, or say which slices have to run again
    Collect(collect::Arguments),
    /// Count the slices whose result is there
    Status {
        /// Plan that `farm plan` has written
        plan: PathBuf,
    },
    /// Hand the slices that have no result to an engine
    Submit(submit::Arguments),
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    // Results are named by all that decides them, and a plan says nothing of these two.
    if global.shader_dir.is_some() || global.seed != Global::SEED {
        return Err(Error::Usage("farm does not take --shader-dir and --seed: a plan does not store them".into()));
    }
    match &arguments.command {
        Commands::Plan(arguments) => plan::run(global, arguments),
        Commands::Run(arguments) => run::run(global, arguments),
        Commands::Collect(arguments) => collect::run(global, arguments),
        Commands::Status { plan } => {
            let plan = Plan::read(plan)?;
            let all = plan.slices.len();
            let done = all - results::missing(&plan).len();
            output::say(if global.json {
                json!({ "slices": all, "done": done }).to_string()
            } else {
                format!("{done} of {} done", counted(all, "slice"))
            });
            Ok(())
        }
        Commands::Submit(arguments) => submit::run(global, arguments),
    }
}
