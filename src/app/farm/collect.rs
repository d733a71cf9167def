//! `shadow-fields farm collect` checks results and makes cache files and pictures of them.

use super::super::outputs::PictureName;
use super::super::{Global, context, output};
use crate::error::{Error, Result};
use crate::farm::engines::ranges;
use crate::farm::results::{self, SliceResult};
use crate::farm::{Plan, Slice, counted};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct Arguments {
    /// Plan that `farm plan` has written
    plan: PathBuf,
    /// Cache that bakes go to; default: that of --cache-dir
    #[arg(long, value_name = "DIR")]
    into: Option<PathBuf>,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let plan = Plan::read(&arguments.plan)?;
    let cache_dir = arguments.into.clone().or_else(|| context::cache_dir(global));
    let mut written = 0;
    let mut missing = Vec::new();
    let mut damaged = Vec::new();
    for slice in 0..plan.slices.len() {
        match results::find(&plan, slice) {
            SliceResult::Missing => missing.push(slice),
            SliceResult::Damaged(error) => {
                log::warn!("slice {slice}: {error}");
                damaged.push(slice);
                // With it away, the engines run it again.
                remove(&results::path(&plan, slice))?;
            }
            SliceResult::Whole(files) => {
                for (name, bytes) in files {
                    let path = target(&plan, slice, &name, cache_dir.as_deref())?;
                    if !crate::files::read(&path).is_ok_and(|found| found == bytes) {
                        crate::text::write(&path, &bytes)?;
                    }
                    written += 1;
                }
            }
        }
    }
    let again = missing.len() + damaged.len();
    if global.json {
        let line = json!({ "slices": plan.slices.len(), "files": written, "missing": missing, "damaged": damaged });
        output::say(line.to_string());
    } else {
        output::say(format!("{} of {}", counted(written, "file"), counted(plan.slices.len() - again, "slice")));
    }
    if again == 0 {
        return Ok(());
    }
    let list = |what: &str, numbers: &[usize]| {
        if numbers.is_empty() { String::new() } else { format!(", {what}: {}", ranges(numbers)) }
    };
    Err(Error::Failed(format!(
        "{again} of {} to run again{}{}; `farm submit` runs them",
        counted(plan.slices.len(), "slice"),
        list("missing", &missing),
        list("damaged", &damaged)
    )))
}

/// Where a file of a result goes.
fn target(plan: &Plan, slice: usize, name: &str, cache_dir: Option<&Path>) -> Result<PathBuf> {
    let Slice::Pictures { film, .. } = plan.slices[slice] else {
        let cache = cache_dir.ok_or_else(|| Error::Usage("there is no cache to collect into: give --into".into()))?;
        return Ok(cache.join("fields").join(name));
    };
    let pattern = &plan.films[film as usize].pictures;
    let number = name.strip_suffix(".png").and_then(|number| number.parse().ok());
    let number = number.ok_or_else(|| Error::Failed(format!("a result of pictures holds a file {name:?}")))?;
    Ok(plan.folder.join(PictureName::new(Path::new(pattern))?.path(number)))
}

/// Removes a file that another process may remove as well.
fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::Failed(format!("{}: cannot be removed: {error}", path.display())))
        }
        _ => Ok(()),
    }
}
