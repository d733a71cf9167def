//! `shadow-fields farm submit` hands slices to an engine.

use super::super::output::Progress;
use super::super::{Global, output};
use crate::error::{Error, Result};
use crate::farm::Plan;
use crate::farm::engines::{self, Call};
use crate::farm::local::{Runner, cannot_start};
use crate::farm::status::missing;
use crate::gpu::{self, Validation};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What runs slices.
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

/// Arguments of `farm submit`.
#[derive(Args)]
pub struct Arguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
    /// What runs the slices
    #[arg(long, value_enum, value_name = "ENGINE")]
    engine: Engine,
    /// Number of slices at a time: processes of local, or of a Dask cluster on this machine (default: one per core), or tasks of all Slurm
    /// arrays together, but at least one of each (default: no limit)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    workers: Option<u32>,
    /// Address of a Dask scheduler; default: a cluster on this machine
    #[arg(long, value_name = "ADDRESS")]
    scheduler: Option<String>,
    /// With Slurm or Dask: write the script only, and say how it is started
    #[arg(long)]
    dry_run: bool,
}

/// Hands slices to an engine.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let plan = Plan::read(&arguments.plan)?;
    let slices = missing(&plan);
    let full = |path: &Path| std::path::absolute(path).map_err(|error| Error::input(path, error));
    let program =
        std::env::current_exe().map_err(|e| Error::Failed(format!("the program's own file is not known: {e}")))?;
    let call = Call { program, plan: full(&arguments.plan)?, words: passed_on(global) };
    if slices.is_empty() && arguments.engine != Engine::Openjd {
        output::note(global, "all results are there");
        return Ok(());
    }
    match arguments.engine {
        Engine::Local => {
            let workers = arguments.workers.map_or_else(gpu::cores, |workers| workers as usize);
            local(global, &Runner { call, workers }, &slices)
        }
        Engine::Slurm => slurm(arguments, &plan, &call, &slices),
        Engine::Dask => dask(arguments, &call, &slices),
        Engine::Print => {
            slices.iter().for_each(|slice| output::say(call.line(&slice.to_string())));
            Ok(())
        }
        Engine::Openjd => {
            let all: Vec<usize> = (0..plan.slices.len()).collect();
            let template = engines::openjd(&plan, &call, if slices.is_empty() { &all } else { &slices });
            output::say(format!("{template:#}"));
            Ok(())
        }
    }
}

/// Options of this command that slices get too. Each slice is one process.
fn passed_on(global: &Global) -> Vec<String> {
    let mut words: Vec<String> = ["--jobs", "1", "--no-progress", "--quiet"].map(str::to_owned).into();
    let mut add = |name: &str, value: String| words.extend([name.to_owned(), value]);
    if let Some(device) = &global.device {
        add("--device", device.clone());
    }
    if let Some(folder) = &global.cache_dir {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.clone());
        add("--cache-dir", folder.to_string_lossy().into_owned());
    }
    if global.validation != Validation::Off {
        add("--validation", format!("{:?}", global.validation).to_lowercase());
    }
    if global.no_cache {
        words.push("--no-cache".into());
    }
    words
}

fn local(global: &Global, runner: &Runner, slices: &[usize]) -> Result<()> {
    let progress = Progress::new(global);
    let failures = runner.run(slices, &|done| progress.slices(done as u32, slices.len() as u32))?;
    for (slice, said) in &failures {
        log::error!("slice {slice}: {said}");
    }
    match failures.first() {
        None => {
            output::say(format!("{} slices done", slices.len()));
            Ok(())
        }
        Some((slice, said)) => {
            Err(Error::Failed(format!("{} of {} slices failed; slice {slice}: {said}", failures.len(), slices.len())))
        }
    }
}

/// Writes a file beside the plan, with another ending.
fn beside(plan: &Path, ending: &str, text: &str) -> Result<PathBuf> {
    let path = plan.with_extension(ending);
    crate::text::write(&path, text)?;
    Ok(path)
}

/// A command as a line of a shell script.
fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| engines::quoted(&word.to_string_lossy())).collect::<Vec<_>>().join(" ")
}

fn slurm(arguments: &Arguments, plan: &Plan, call: &Call, slices: &[usize]) -> Result<()> {
    let logs = call.plan.with_extension("logs");
    crate::text::make_folder(&logs)?;
    let script = beside(&call.plan, "sbatch", &engines::slurm(plan, call, &logs))?;
    for (first, tasks) in engines::arrays(slices, arguments.workers.map(|workers| workers as usize)) {
        let mut command = Command::new("sbatch");
        command.args([&format!("--array={tasks}"), &format!("--export=ALL,FIRST={first}")]).arg(&script);
        if arguments.dry_run {
            output::say(shown(&command));
            continue;
        }
        let done = command.output().map_err(|error| cannot_start(Path::new("sbatch"), &error))?;
        let said = if done.status.success() { &done.stdout } else { &done.stderr };
        let said = String::from_utf8_lossy(said).trim().to_owned();
        if !done.status.success() {
            return Err(Error::Failed(format!("sbatch: {said}")));
        }
        output::say(said);
    }
    Ok(())
}

fn dask(arguments: &Arguments, call: &Call, slices: &[usize]) -> Result<()> {
    let script = beside(&call.plan, "dask.py", engines::DASK)?;
    let mut command = Command::new("python3");
    command.arg(&script);
    if let Some(address) = &arguments.scheduler {
        command.args(["--scheduler", address]);
    }
    if let Some(workers) = arguments.workers {
        command.args(["--workers", &workers.to_string()]);
    }
    let numbers: String = slices.iter().map(|slice| format!("{slice}\n")).collect();
    command.arg(beside(&call.plan, "slices", &numbers)?);
    // The number of the slice comes last.
    command.arg(&call.program).args(["farm", "run"]).arg(&call.plan).args(&call.words).arg("--slice");
    if arguments.dry_run {
        output::say(shown(&command));
        return Ok(());
    }
    let status = command.status().map_err(|error| cannot_start(Path::new("python3"), &error))?;
    if status.success() { Ok(()) } else { Err(Error::Failed(format!("dask: not all slices are done ({status})"))) }
}
