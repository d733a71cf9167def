//! What engines of farms are given: a batch script for Slurm, a script for Dask, a job template for OpenJD, plain commands.

use super::plan::Plan;
use super::status::ranges;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// The script that maps slices over a Dask cluster.
pub const DASK: &str = include_str!("../../scripts/farm_dask.py");
/// Most tasks of a Slurm array: the default of `MaxArraySize` is one more.
pub const ARRAY: usize = 1000;

/// How a slice is started on every machine.
pub struct Call<'c> {
    /// The program.
    pub program: &'c Path,
    /// The plan.
    pub plan: &'c Path,
    /// Words of options that every slice gets.
    pub words: &'c [String],
}

/// A word as a POSIX shell reads it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

impl Call<'_> {
    /// The words of the command that runs a slice, whose number is written as `slice`.
    pub fn words(&self, slice: &str) -> Vec<String> {
        let path = |path: &Path| path.to_string_lossy().into_owned();
        let own = [path(self.program), "farm".into(), "run".into(), path(self.plan), "--slice".into(), slice.into()];
        own.into_iter().chain(self.words.iter().cloned()).collect()
    }

    /// The command as a line of a shell script.
    pub fn line(&self, slice: &str) -> String {
        self.words(slice).iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }
}

/// Minutes that a slice may take on a slow machine: ten times the longest estimate, and ten minutes.
fn limit_minutes(plan: &Plan) -> u64 {
    let longest = plan.slices.iter().map(|slice| slice.seconds()).fold(0.0, f64::max);
    10 + (longest / 6.0).ceil() as u64
}

fn memory_mb(plan: &Plan) -> u32 {
    plan.slices.iter().map(|slice| slice.memory_mb()).max().unwrap_or(0)
}

/// The batch script of a Slurm array whose task T runs the slice in line FIRST + T + 1 of the file `list`. A failed task is put back
/// into the queue twice, with FIRST in its environment as at first.
pub fn slurm(plan: &Plan, call: &Call<'_>, list: &Path, logs: &Path) -> String {
    let command = call.line("SLICE").replace("SLICE", "\"$slice\"");
    let mut text = String::from("#!/bin/sh\n");
    let _ = writeln!(
        text,
        "# Slices of a plan, one a task. FIRST is the line of the list that task 0 takes, counted from 0."
    );
    let _ = writeln!(text, "#SBATCH --job-name=shadow-fields");
    let _ = writeln!(text, "#SBATCH --requeue --open-mode=append");
    let _ = writeln!(text, "#SBATCH --cpus-per-task=1 --mem={}M --time={}", memory_mb(plan), limit_minutes(plan));
    let _ = writeln!(text, "#SBATCH --output={}/%A_%a.log", logs.display());
    let _ =
        writeln!(text, "slice=$(sed -n \"$((FIRST + SLURM_ARRAY_TASK_ID + 1))p\" {})", quoted(&list.to_string_lossy()));
    let _ = writeln!(text, "echo \"slice $slice on $(hostname), start ${{SLURM_RESTART_COUNT:-0}}\"");
    let _ = writeln!(text, "{command} && exit");
    let _ = writeln!(text, "code=$?");
    let _ = writeln!(text, "# 2 usage, 3 another device or program, 4 bad input: these would fail again.");
    let _ = writeln!(text, "case $code in [234]) exit $code ;; esac");
    let _ = writeln!(text, "if [ \"${{SLURM_RESTART_COUNT:-0}}\" -lt 2 ]; then");
    let _ = writeln!(text, "    exec scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID\"");
    let _ = writeln!(text, "fi");
    let _ = writeln!(text, "exit $code");
    text
}

/// A job template of Open Job Description with a task a slice.
pub fn openjd(plan: &Plan, call: &Call<'_>, slices: &[usize]) -> Value {
    let words = call.words("{{Task.Param.Slice}}");
    json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": "shadow-fields",
        "steps": [{
            "name": "Slices",
            "parameterSpace": {
                "taskParameterDefinitions": [{ "name": "Slice", "type": "INT", "range": ranges(slices) }],
            },
            "hostRequirements": { "amounts": [
                { "name": "amount.worker.vcpu", "min": 1 },
                { "name": "amount.worker.memory", "min": memory_mb(plan) },
            ] },
            "script": { "actions": { "onRun": { "command": words[0], "args": words[1..] } } },
        }],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_with_blanks_and_quotes_stay_one() {
        let words = ["--time=0".to_owned(), "it's here".to_owned()];
        let call = Call { program: Path::new("/a b/p"), plan: Path::new("plan.json"), words: &words };
        assert_eq!(call.line("7"), r"'/a b/p' farm run plan.json --slice 7 --time=0 'it'\''s here'");
    }
}
