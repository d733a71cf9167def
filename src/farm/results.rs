//! Results of slices in a shared folder: named by what decides them, sealed by a hash, replaced whole.

use super::plan::{Plan, SECONDS_LIMIT};
use crate::error::{Error, Result};
use crate::field::file;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

const MAGIC: [u8; 8] = *b"SHSLICE\n";

/// What a result says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// What it is the result of, see [`Plan::key`].
    pub key: String,
    /// Seconds that it took.
    pub seconds: f64,
}

/// A file of a result: the index of its task within the slice, its name, its content.
pub type Entry = (u32, String, Vec<u8>);

/// How the result of a slice stands.
#[derive(Debug)]
pub enum SliceResult {
    /// It is there and intact.
    Whole(About, Vec<Entry>),
    /// There is none.
    Missing,
    /// It is there, but damaged.
    Damaged(Error),
}

/// Where the result of a slice is.
pub fn path(plan: &Plan, slice: usize) -> PathBuf {
    let key = plan.key(slice);
    plan.path(&plan.results).join(&key[..2]).join(format!("{key}.slice"))
}

/// Looks for the result of a slice and reads it.
pub fn find(plan: &Plan, slice: usize) -> SliceResult {
    let path = path(plan, slice);
    if !path.exists() {
        return SliceResult::Missing;
    }
    let tasks = plan.tasks_of(slice).len();
    let read = file::read::<About>(&path, MAGIC).and_then(|(about, payload)| {
        if about.key != plan.key(slice) {
            return Err(Error::input(&path, "it does not fit its name"));
        }
        Ok((about, entries(&payload, tasks).ok_or_else(|| Error::input(&path, "malformed"))?))
    });
    match read {
        Ok((about, entries)) => SliceResult::Whole(about, entries),
        Err(error) => SliceResult::Damaged(error),
    }
}

/// The seconds that a result says it took, without a look at its content; `None` where there is none, or what it says is no time.
pub fn seconds(plan: &Plan, slice: usize) -> Option<f64> {
    let about: About = file::read_header(&path(plan, slice), MAGIC)?;
    Some(about.seconds).filter(|seconds| (0.0..=f64::from(SECONDS_LIMIT)).contains(seconds))
}

/// The content of a result while its slice is being done.
#[derive(Default)]
pub struct Content(Vec<u8>);

impl Content {
    /// Adds a file that the task with this index within the slice has made.
    pub fn add(&mut self, task: u32, name: &str, bytes: &[u8]) {
        self.0.extend(task.to_le_bytes());
        self.0.extend((name.len() as u32).to_le_bytes());
        self.0.extend((bytes.len() as u64).to_le_bytes());
        self.0.extend(name.as_bytes());
        self.0.extend(bytes);
    }

    /// Writes the result of a slice, whole or not at all.
    ///
    /// # Errors
    /// `Failed` where it is too large to be read, or the folder cannot be written.
    pub fn write(&self, plan: &Plan, slice: usize, seconds: f64) -> Result<()> {
        let (path, bytes) = (path(plan, slice), self.0.len() as u64);
        if bytes > file::PAYLOAD_LIMIT {
            let limit = file::PAYLOAD_LIMIT;
            return Err(Error::Failed(format!(
                "slice {slice}: a result of {bytes} bytes is over the limit of {limit}"
            )));
        }
        let about = About { key: plan.key(slice), seconds };
        file::write(&path, MAGIC, &about, &self.0).map_err(|error| Error::Failed(error.to_string()))
    }
}

/// The entries of a result of so many tasks.
fn entries(mut rest: &[u8], tasks: usize) -> Option<Vec<Entry>> {
    let mut out = Vec::new();
    while !rest.is_empty() {
        let (head, tail) = rest.split_at_checked(16)?;
        let word = |at: usize| u32::from_le_bytes(head[at..at + 4].try_into().expect("four bytes"));
        let length = u64::from_le_bytes(head[8..].try_into().expect("eight bytes"));
        let (name, tail) = tail.split_at_checked(word(4) as usize)?;
        let (bytes, tail) = tail.split_at_checked(usize::try_from(length).ok()?)?;
        let name = String::from_utf8(name.to_vec()).ok()?;
        // A name is one file's: it leads nowhere else.
        if name.is_empty() || name.contains(['/', '\\']) || name.starts_with('.') || word(0) as usize >= tasks {
            return None;
        }
        out.push((word(0), name, bytes.to_vec()));
        rest = tail;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::kinds::Kind;
    use crate::farm::plan::{DeviceClass, Input, Task, TaskCost, TaskKind, Work};

    #[test]
    fn results_are_found_missing_and_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let device = DeviceClass { name: "a".into(), driver: "b".into() };
        let mut plan = Plan::new(device, "results".into());
        plan.folder = folder.path().to_owned();
        plan.works.push(Work { words: Vec::new(), pictures: None });
        plan.inputs.push(Input { path: "m.obj".into(), hash: "00".into() });
        let cost = TaskCost { seconds: 100.0, memory_mb: 1.0, bytes: 1.0 };
        let task = |first| Task { work: 0, input: 0, kind: TaskKind::Bake(Kind::Shadow), first, count: 2 };
        (0..2).for_each(|part| plan.add(task(part), cost));
        let write = |slice, seconds, entries: &[Entry]| {
            let mut content = Content::default();
            entries.iter().for_each(|(task, name, bytes)| content.add(*task, name, bytes));
            content.write(&plan, slice, seconds).unwrap();
        };
        assert!(matches!(find(&plan, 0), SliceResult::Missing) && seconds(&plan, 0).is_none());
        let entries = vec![(0, "a.sf".to_owned(), vec![1, 2, 3]), (0, "b".to_owned(), Vec::new())];
        write(0, 2.5, &entries);
        assert!(matches!(find(&plan, 0), SliceResult::Whole(about, found) if about.seconds == 2.5 && found == entries));
        assert_eq!(seconds(&plan, 0), Some(2.5));
        let good = std::fs::read(path(&plan, 0)).unwrap();
        for at in (0..good.len()).step_by(7) {
            let mut bad = good.clone();
            bad[at] ^= 4;
            std::fs::write(path(&plan, 0), bad).unwrap();
            assert!(matches!(find(&plan, 0), SliceResult::Damaged(_)), "byte {at}");
        }
        std::fs::create_dir_all(path(&plan, 1).parent().unwrap()).unwrap();
        std::fs::write(path(&plan, 1), &good).unwrap();
        assert!(matches!(find(&plan, 1), SliceResult::Damaged(_)), "another slice's");
        for (task, name) in [(0, "../a"), (0, ""), (0, ".a"), (1, "a")] {
            write(1, 1.0, &[(task, name.to_owned(), Vec::new())]);
            assert!(matches!(find(&plan, 1), SliceResult::Damaged(_)), "task {task}, name {name:?}");
        }
        for no_time in [-1.0, 1e300, f64::NAN] {
            write(1, no_time, &[]);
            assert_eq!(seconds(&plan, 1), None, "{no_time} s");
        }
    }
}
