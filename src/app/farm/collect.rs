//! `shadow-fields farm collect`

use super::super::context::Context;
use super::super::{Global, output};
use super::run::{mesh, mesh_options};
use crate::bake::cache::Cache;
use crate::bake::parts::join;
use crate::error::{Error, Result};
use crate::farm::plan::{DeviceClass, Plan, Task, TaskKind};
use crate::farm::results::{self, Found};
use crate::farm::status::ranges;
use crate::files;
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
            Found::Missing => missing.push(slice),
            Found::Damaged(error) => {
                log::warn!("slice {slice}: {error}");
                damaged.push(slice);
                // With it away, the engines run it again.
                let path = results::path(&plan, slice);
                std::fs::remove_file(&path)
                    .map_err(|error| Error::Failed(format!("{}: cannot be removed: {error}", path.display())))?;
            }
            Found::Whole(_, entries) => {
                for (task, name, bytes) in entries {
                    let task = plan.tasks_of(slice).get(task as usize);
                    let task = task.ok_or_else(|| Error::Failed(format!("slice {slice}: a result of no task")))?;
                    collecting.take(task, &name, bytes)?;
                }
            }
        }
    }
    let written = collecting.written;
    collecting.context.map_or(Ok(()), Context::finish)?;
    if global.json {
        let line = json!({ "slices": plan.slices.len(), "files": written, "missing": missing, "damaged": damaged });
        output::say(line.to_string());
    } else {
        output::say(format!("{written} files of {} slices", plan.slices.len() - missing.len() - damaged.len()));
    }
    if missing.is_empty() && damaged.is_empty() {
        return Ok(());
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
        match *task {
            Task(work, _, TaskKind::Frames, ..) => {
                let pattern = self.plan.works[work as usize].pictures.as_deref().unwrap_or("####.png");
                let number: u64 = name.trim_end_matches(".png").parse().unwrap_or(0);
                self.replace(&self.plan.path(&numbered(pattern, number)), &bytes)
            }
            Task(.., 1) => {
                let path = self.cache()?.join("fields").join(name);
                self.replace(&path, &bytes)
            }
            Task(work, input, kind, part, count) => {
                let whole = Task(work, input, kind, 0, count);
                let parts = self.parts.entry(whole).or_default();
                parts.insert(part, bytes);
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
        files::replace(path, bytes)
            .map_err(|error| Error::Failed(format!("{}: cannot be written: {error}", path.display())))
    }

    fn join(&mut self, task: &Task, parts: &[Vec<u8>]) -> Result<()> {
        let Task(work, input, TaskKind::Bake(kind), ..) = *task else { return Ok(()) };
        let folder = self.cache()?;
        let context = match self.context.take() {
            Some(context) => context,
            None => Context::new(self.global)?,
        };
        self.plan.check_device(&DeviceClass::of(&context.device))?;
        let mesh = mesh(self.plan, input as usize)?;
        let options = mesh_options(&self.plan.works[work as usize].words)?;
        join(&context.baker, &Cache::new(Some(&folder)), (&mesh, &options), kind, parts)?;
        self.written += 1;
        self.context = Some(context);
        Ok(())
    }
}

/// A name whose run of # is replaced by a number.
fn numbered(pattern: &str, number: u64) -> String {
    let Some(at) = pattern.find('#') else { return pattern.to_owned() };
    let digits = pattern[at..].bytes().take_while(|b| *b == b'#').count();
    format!("{}{number:0digits$}{}", &pattern[..at], &pattern[at + digits..])
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_take_the_place_of_a_run() {
        assert_eq!(super::numbered("out/f_####.png", 17), "out/f_0017.png");
        assert_eq!(super::numbered("f#.png", 123), "f123.png");
    }
}
