//! `shadow-fields farm submit` hands slices to an engine.

use super::super::output::Progress;
use super::super::{Global, output};
use crate::error::{Error, Result};
use crate::farm::engines::{self, Call};
use crate::farm::plan::plain;
use crate::farm::{Plan, counted, local, results};
use crate::gpu::{self, Validation};
use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::{self, Command};

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// Processes on this machine; ends when all are done
    Local,
    /// A job array of Slurm: PLAN.sbatch is written and handed to sbatch
    Slurm,
    /// A Dask cluster: PLAN.dask.py is written and run by python3, which needs the package distributed
    Dask,
    /// A command for each slice, one per line, for GNU parallel, Nextflow and others
    Print,
    /// A job template of Open Job Description, in JSON
    Openjd,
}

#[derive(Args)]
pub struct Arguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
    /// Engine that runs the slices
    #[arg(long, value_enum, value_name = "ENGINE")]
    engine: Engine,
    /// Number of slices at a time: processes of local, or of a Dask cluster on this machine (default: one per core), or
    /// tasks of a Slurm array (default: no limit)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    workers: Option<u32>,
    /// Address of a Dask scheduler; default: a cluster on this machine
    #[arg(long, value_name = "ADDRESS")]
    scheduler: Option<String>,
    /// With Slurm or Dask: write the script only, and say how it is started
    #[arg(long)]
    dry_run: bool,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let plan = Plan::read(&arguments.plan)?;
    let path = std::path::absolute(&arguments.plan).map_err(|error| Error::input(&arguments.plan, error))?;
    let program = std::env::current_exe()
        .map_err(|error| Error::Failed(format!("the program's own file is not known: {error}")))?;
    let mut options = passed_on(global)?;
    if matches!(arguments.engine, Engine::Local | Engine::Dask) {
        options.push("--until-stdin-ends".into());
    }
    let call = Call::new(&program, &path, options)?;
    let mut slices = results::missing(&plan);
    if slices.is_empty() {
        if arguments.engine != Engine::Openjd {
            output::note(global, "all results are there");
            return Ok(());
        }
        slices = (0..plan.slices.len()).collect();
    }
    match arguments.engine {
        Engine::Local => local(global, arguments, &call, &slices),
        Engine::Slurm => slurm(arguments, &call, &path, &slices),
        Engine::Dask => dask(arguments, &call, &path, &slices),
        Engine::Print => {
            slices.iter().for_each(|slice| output::say(call.line(*slice)));
            Ok(())
        }
        Engine::Openjd => {
            output::say(engines::openjd(&call, &slices)?.trim_end());
            Ok(())
        }
    }
}

/// Options of this command that slices get too.
fn passed_on(global: &Global) -> Result<Vec<String>> {
    let mut words: Vec<String> = ["--no-progress", "--quiet"].map(str::to_owned).into();
    let mut add = |name: &str, value: String| words.extend([name.to_owned(), value]);
    if let Some(device) = &global.device {
        add("--device", device.clone());
    }
    if let Some(folder) = &global.cache_dir {
        let full = std::path::absolute(folder).map_err(|error| Error::input(folder, error))?;
        add("--cache-dir", plain(&full)?.to_owned());
    }
    if global.validation != Validation::Off {
        add("--validation", format!("{:?}", global.validation).to_lowercase());
    }
    if global.no_cache {
        words.push("--no-cache".into());
    }
    Ok(words)
}

fn local(global: &Global, arguments: &Arguments, call: &Call, slices: &[usize]) -> Result<()> {
    let workers = arguments.workers.map_or_else(gpu::cores, |workers| workers as usize);
    let progress = Progress::new(global);
    let failures =
        local::run(call, workers, slices, &|done| progress.count("running slices", done as u32, slices.len() as u32));
    for (slice, said) in &failures {
        log::error!("slice {slice}: {said}");
    }
    let all = counted(slices.len(), "slice");
    let Some((slice, said)) = failures.first() else {
        output::say(format!("{all} done"));
        return Ok(());
    };
    Err(Error::Failed(format!("{} of {all} failed; slice {slice}: {said}", failures.len())))
}

/// Runs an engine's command by `to_end`; with --dry-run only says it, and answers with `None`.
fn start(
    arguments: &Arguments,
    mut command: Command,
    to_end: fn(&mut Command) -> std::io::Result<process::Output>,
) -> Result<Option<process::Output>> {
    if arguments.dry_run {
        let words = [command.get_program()].into_iter().chain(command.get_args());
        output::say(engines::shell(&json!(words.map(|word| word.to_string_lossy()).collect::<Vec<_>>())));
        return Ok(None);
    }
    let program = command.get_program().to_string_lossy().into_owned();
    let cannot = |error| Error::Failed(format!("{program}: cannot be started: {error}"));
    to_end(&mut command).map(Some).map_err(cannot)
}

fn slurm(arguments: &Arguments, call: &Call, path: &Path, slices: &[usize]) -> Result<()> {
    let logs = path.with_extension("logs");
    let output = format!("--output={}", engines::slurm_logs(&logs)?);
    crate::text::make_folder(&logs)?;
    let script = path.with_extension("sbatch");
    crate::text::write(&script, engines::slurm(call))?;
    let limit = arguments.workers.map_or_else(String::new, |workers| format!("%{workers}"));
    let mut command = Command::new("sbatch");
    command.arg(format!("--array={}{limit}", engines::ranges(slices))).arg(output).arg(&script);
    let Some(done) = start(arguments, command, Command::output)? else { return Ok(()) };
    if !done.status.success() {
        let said = local::last_line(&done);
        return Err(Error::Failed(format!("{said} (an array may be too long: plan with more --per-slice)")));
    }
    output::say(String::from_utf8_lossy(&done.stdout).trim_end());
    Ok(())
}

fn dask(arguments: &Arguments, call: &Call, path: &Path, slices: &[usize]) -> Result<()> {
    let script = path.with_extension("dask.py");
    crate::text::write(&script, engines::dask(call, slices, arguments.scheduler.as_deref(), arguments.workers))?;
    let mut command = Command::new("python3");
    command.arg(&script);
    match start(arguments, command, local::output_with_stdin)? {
        Some(done) if !done.status.success() => Err(Error::Failed(format!("dask: {}", local::last_line(&done)))),
        _ => Ok(()),
    }
}
