//! `shadow-fields farm collect` checks results and makes cache files and pictures of them.

use super::super::context::Context;
use super::super::render::Numbered;
use super::super::{Global, output};
use super::run::{files, mesh, mesh_options, scratch};
use crate::bake::cache::Cache;
use crate::bake::parts::join;
use crate::error::{Error, Result};
use crate::farm::plan::{DeviceClass, Plan, Task, TaskKind};
use crate::farm::results::{self, SliceResult};
use crate::farm::status::ranges;
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments of `farm collect`.
#[derive(Args)]
pub struct Arguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
    /// Cache that bakes go to; default: that of --cache-dir
    #[arg(long, value_name = "DIR")]
    into: Option<PathBuf>,
}

/// Parts of one bake, by their index.
type Parts = BTreeMap<u32, Vec<u8>>;

/// Collects results.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let plan = Plan::read(&arguments.plan)?;
    let cache_dir = arguments.into.clone().or_else(|| super::super::context::cache_dir(global));
    let mut collecting =
        Collecting { global, plan: &plan, cache_dir, context: None, parts: BTreeMap::new(), written: 0 };
    let (mut missing, mut damaged) = (Vec::new(), Vec::new());
    for slice in 0..plan.slices.len() {
        match results::find(&plan, slice) {
            SliceResult::Missing => missing.push(slice),
            SliceResult::Damaged(error) => {
                log::warn!("slice {slice}: {error}");
                damaged.push(slice);
                // With it away, the engines run it again.
                let path = results::path(&plan, slice);
                match std::fs::remove_file(&path) {
                    // Another collect was faster.
                    Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                    removed => removed
                        .map_err(|error| Error::Failed(format!("{}: cannot be removed: {error}", path.display())))?,
                }
            }
            SliceResult::Whole(_, entries) => {
                for (task, name, bytes) in entries {
                    collecting.take(&plan.tasks_of(slice)[task as usize], &name, bytes)?;
                }
            }
        }
    }
    let (written, unjoined) = (collecting.written, collecting.parts.len());
    collecting.context.map_or(Ok(()), Context::finish)?;
    if global.json {
        let line = json!({ "slices": plan.slices.len(), "files": written, "missing": missing, "damaged": damaged });
        output::say(line.to_string());
    } else {
        output::say(format!("{written} files of {} slices", plan.slices.len() - missing.len() - damaged.len()));
    }
    if missing.is_empty() && damaged.is_empty() {
        let broken = || Error::input(&arguments.plan, format!("{unjoined} bakes have parts that are in no slice"));
        return if unjoined == 0 { Ok(()) } else { Err(broken()) };
    }
    let list = |what: &str, numbers: &[usize]| {
        if numbers.is_empty() { String::new() } else { format!(", {what}: {}", ranges(numbers)) }
    };
    Err(Error::Failed(format!(
        "{} of {} slices have to run again{}{}; `farm submit` runs them",
        missing.len() + damaged.len(),
        plan.slices.len(),
        list("missing", &missing),
        list("damaged", &damaged)
    )))
}

struct Collecting<'c> {
    global: &'c Global,
    plan: &'c Plan,
    cache_dir: Option<PathBuf>,
    /// Open once parts have to be joined.
    context: Option<Context>,
    parts: BTreeMap<Task, Parts>,
    written: usize,
}

impl Collecting<'_> {
    fn take(&mut self, task: &Task, name: &str, bytes: Vec<u8>) -> Result<()> {
        match (task.kind, task.count) {
            (TaskKind::Frames, _) => {
                let number = name.trim_end_matches(".png").parse();
                let (Some(pattern), Ok(number)) = (&self.plan.works[task.work as usize].pictures, number) else {
                    return Err(Error::Failed(format!("a result of pictures holds a file {name:?}")));
                };
                match Numbered::new(Path::new(pattern), "png")? {
                    Some(numbered) => self.replace(&self.plan.folder.join(numbered.path(number)), &bytes),
                    None => self.replace(&self.plan.path(pattern), &bytes),
                }
            }
            (_, 1) => {
                let path = self.cache()?.join("fields").join(name);
                self.replace(&path, &bytes)
            }
            (_, count) => {
                let whole = Task { first: 0, ..*task };
                let parts = self.parts.entry(whole).or_default();
                parts.insert(task.first, bytes);
                if parts.len() < count as usize {
                    return Ok(());
                }
                let parts: Vec<Vec<u8>> =
                    self.parts.remove(&whole).into_iter().flatten().map(|(_, bytes)| bytes).collect();
                self.join(&whole, &parts)
            }
        }
    }

    fn cache(&self) -> Result<PathBuf> {
        self.cache_dir.clone().ok_or_else(|| Error::Usage("there is no cache to collect into: give --into".into()))
    }

    /// Writes a file that is not there as it should be.
    fn replace(&mut self, path: &Path, bytes: &[u8]) -> Result<()> {
        self.written += 1;
        if std::fs::read(path).is_ok_and(|found| found == bytes) {
            return Ok(());
        }
        crate::text::write(path, bytes)
    }

    fn join(&mut self, task: &Task, parts: &[Vec<u8>]) -> Result<()> {
        let Task { work, input, kind: TaskKind::Bake(kind), .. } = *task else { return Ok(()) };
        let folder = self.cache()?;
        let context = match self.context.take() {
            Some(context) => context,
            None => Context::new(self.global)?,
        };
        self.plan.check_device(&DeviceClass::of(&context.device))?;
        let mesh = mesh(self.plan, input as usize)?;
        let options = mesh_options(&self.plan.works[work as usize].words)?;
        // A cache of its own, as for a slice that bakes the whole.
        let scratch = scratch()?;
        join(&context.baker, &Cache::new(Some(scratch.path())), (&mesh, &options), kind, parts)?;
        self.context = Some(context);
        let fields = folder.join("fields");
        files(&scratch.path().join("fields"), &mut |name, bytes| self.replace(&fields.join(name), bytes))
    }
}
