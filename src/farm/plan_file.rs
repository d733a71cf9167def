//! The file of a plan: written whole, and checked when it is read.

use super::plan::{FORMAT, PROGRAM, Plan, SECONDS_LIMIT, Slice, Task, TaskKind};
use crate::asset;
use crate::error::{Error, Result, one_line};
use crate::text;
use serde::Deserialize;
use std::path::Path;

/// Longest plan that is read, in bytes.
const LIMIT_BYTES: u64 = 1 << 30;

impl Plan {
    /// Reads a plan and checks that this program made it.
    ///
    /// # Errors
    /// `Input` where it is missing or malformed; `Unsupported`, with both versions, where another program made it.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&asset::read_file(path, LIMIT_BYTES)?, path)
    }

    /// As [`Plan::read`], of the bytes of the file `path`.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let bad = |what: String| Error::input(path, what);
        // The version comes first: another program's plan may have another form.
        #[derive(Deserialize)]
        struct Made {
            format: u32,
            program: String,
        }
        let made: Made = serde_json::from_slice(bytes)
            .map_err(|error| bad(format!("not a plan: {}", one_line(&error.to_string()))))?;
        if (made.format, made.program.as_str()) != (FORMAT, PROGRAM) {
            return Err(Error::Unsupported(format!(
                "{}: a plan of {}, and this is {PROGRAM}; plan again, or use that program",
                path.display(),
                one_line(&made.program)
            )));
        }
        let mut plan: Plan = serde_json::from_slice(bytes)
            .map_err(|error| bad(format!("not a plan: {}", one_line(&error.to_string()))))?;
        plan.check().map_err(bad)?;
        let full = std::path::absolute(path).map_err(|error| bad(format!("cannot be read: {error}")))?;
        plan.folder = full.parent().unwrap_or(Path::new("/")).to_owned();
        Ok(plan)
    }

    /// Whether all indices lead somewhere and all numbers make sense.
    fn check(&self) -> std::result::Result<(), String> {
        if self.slices.is_empty() {
            return Err("it has no slices".into());
        }
        let mut next = 0;
        for (index, Slice { first, count, seconds, .. }) in self.slices.iter().enumerate() {
            if *first != next || *count == 0 {
                return Err(format!("slice {index} does not begin where the one before it ends"));
            }
            if !(0.0..=SECONDS_LIMIT).contains(seconds) {
                return Err(format!("slice {index} is estimated to take {seconds} seconds"));
            }
            next = first.checked_add(*count).ok_or("too many tasks")?;
        }
        if next as usize != self.tasks.len() {
            return Err("its slices do not cover its tasks, each once".into());
        }
        for (index, task) in self.tasks.iter().enumerate() {
            let Task { work, input, kind, first, count } = *task;
            let Some(work) = self.works.get(work as usize) else {
                return Err(format!("task {index} is of a work that is not there"));
            };
            if input as usize >= self.inputs.len() {
                return Err(format!("task {index} has an input that is not there"));
            }
            let makes_sense = match kind {
                TaskKind::Frames => work.pictures.is_some() && count > 0 && first.checked_add(count).is_some(),
                TaskKind::Bake(kind) => first < count && (count == 1 || kind.is_cut()),
            };
            if !makes_sense {
                return Err(format!("task {index}, {first} of {count}, does not belong to its work"));
            }
        }
        Ok(())
    }

    /// Writes the plan, whole or not at all.
    ///
    /// # Errors
    /// `Failed` where it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        text::write(path, serde_json::to_vec(self).expect("a plan is plain data"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::tests::plan;
    use super::*;
    use crate::bake::kinds::Kind;

    #[test]
    fn other_versions_and_broken_plans_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.json");
        let refused = |edit: &dyn Fn(&mut Plan)| {
            let mut plan = plan(2, 100.0);
            edit(&mut plan);
            plan.write(&path).unwrap();
            Plan::read(&path).map(|_| ()).unwrap_err()
        };
        let older = refused(&|p| p.program = "shadow-fields 0.0.9 abc".into());
        assert!(
            older.exit_code() == 3 && older.to_string().contains("0.0.9 abc, and this is shadow-fields"),
            "{older}"
        );
        let broken = refused(&|p| p.program = "shadow\nfields".into()).to_string();
        assert!(broken.contains(r"a plan of shadow\nfields, and this is") && !broken.contains('\n'), "{broken}");
        let edits: [(fn(&mut Plan), &str); 9] = [
            (|p| p.slices[0].count = 9, "slice 1 does not begin where the one before it ends"),
            (|p| p.slices[0].seconds = 1e38, "slice 0 is estimated to take"),
            (|p| p.slices[1].seconds = -1.0, "slice 1 is estimated to take -1 seconds"),
            (|p| p.slices.truncate(1), "its slices do not cover its tasks, each once"),
            (|p| p.slices.clear(), "it has no slices"),
            (|p| p.tasks[0].input = 9, "task 0 has an input that is not there"),
            (|p| p.tasks[1].work = 9, "task 1 is of a work that is not there"),
            (|p| p.tasks[1].kind = TaskKind::Frames, "task 1, 1 of 2, does not belong to its work"),
            (|p| p.tasks[1].kind = TaskKind::Bake(Kind::Silhouette), "task 1, 1 of 2, does not belong to its work"),
        ];
        for (edit, what) in edits {
            let error = refused(&edit);
            assert!(error.exit_code() == 4 && error.to_string().contains(what), "{error}");
        }
        std::fs::write(&path, "{").unwrap();
        assert_eq!(Plan::read(&path).unwrap_err().exit_code(), 4);
    }
}
