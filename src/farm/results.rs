//! Results of slices in a shared folder: named by what decides them, sealed by a hash, replaced whole.

use super::counted;
use super::plan::Plan;
use crate::error::{Error, Result};
use crate::field::file;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const MAGIC: [u8; 8] = *b"SHSLICE\n";

/// Header of a result's file.
#[derive(Serialize, Deserialize)]
struct About {
    /// [`Plan::key`] of its slice.
    key: String,
    /// Name and length of each file, in the order in which they follow.
    files: Vec<(String, u64)>,
}

/// How the result of a slice stands.
pub enum SliceResult {
    /// It is there and intact: names and contents of its files.
    Whole(Vec<(String, Vec<u8>)>),
    Missing,
    Damaged(Error),
}

pub fn path(plan: &Plan, slice: usize) -> PathBuf {
    let key = plan.key(slice);
    plan.path(&plan.results).join(&key[..2]).join(format!("{key}.slice"))
}

/// Slices without a result. Whether a result is intact, [`find`] tells.
pub fn missing(plan: &Plan) -> Vec<usize> {
    (0..plan.slices.len()).filter(|&slice| !path(plan, slice).exists()).collect()
}

/// Looks for the result of a slice and reads it.
pub fn find(plan: &Plan, slice: usize) -> SliceResult {
    let path = path(plan, slice);
    if !path.exists() {
        return SliceResult::Missing;
    }
    let read = file::read::<About>(&path, MAGIC).and_then(|(about, payload)| {
        if about.key != plan.key(slice) {
            return Err(Error::input(&path, "it does not fit its name"));
        }
        files(about.files, &payload).ok_or_else(|| Error::input(&path, "malformed"))
    });
    read.map_or_else(SliceResult::Damaged, SliceResult::Whole)
}

fn files(listed: Vec<(String, u64)>, mut rest: &[u8]) -> Option<Vec<(String, Vec<u8>)>> {
    let mut files = Vec::new();
    for (name, length) in listed {
        let (bytes, tail) = rest.split_at_checked(usize::try_from(length).ok()?)?;
        // A name is one file's: it leads nowhere else.
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\']) || name.contains(char::is_control) {
            return None;
        }
        files.push((name, bytes.to_vec()));
        rest = tail;
    }
    rest.is_empty().then_some(files)
}

/// Writes the files of a folder as the result of a slice, whole or not at all.
pub fn write(plan: &Plan, slice: usize, folder: &Path, count: usize) -> Result<()> {
    let unread = |error| Error::Failed(format!("{}: cannot be read: {error}", folder.display()));
    let mut paths: Vec<PathBuf> = match std::fs::read_dir(folder) {
        Ok(entries) => entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>().map_err(unread)?,
        Err(_) => Vec::new(),
    };
    if paths.len() != count {
        let what = format!("{} of {} were written, the disk may be full", paths.len(), counted(count, "file"));
        return Err(Error::Failed(format!("{}: {what}", folder.display())));
    }
    paths.sort();
    let mut about = About { key: plan.key(slice), files: Vec::new() };
    let mut payload = Vec::new();
    for path in paths {
        let bytes = std::fs::read(&path).map_err(unread)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        about.files.push((name, bytes.len() as u64));
        payload.extend(bytes);
    }
    if payload.len() as u64 > file::PAYLOAD_LIMIT {
        return Err(Error::Failed(format!(
            "slice {slice}: its result is too large to be read; plan with less --per-slice"
        )));
    }
    file::write(&path(plan, slice), MAGIC, &about, &payload).map_err(|error| Error::Failed(error.to_string()))
}
