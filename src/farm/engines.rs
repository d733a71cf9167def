//! What engines of farms are given: a batch script for Slurm, a script for Dask, a job template for OpenJD, plain commands.

use super::plan::Plan;
use super::status::ranges;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The script that maps slices over a Dask cluster.
pub const DASK: &str = include_str!("../../scripts/farm_dask.py");
/// Most tasks of a Slurm array: the default of `MaxArraySize` is one more.
pub const ARRAY: usize = 1000;

/// Place of the slice's number among the words of a command.
const SLICE_AT: usize = 5;

/// How a slice is started on every machine.
pub struct Call {
    /// The program.
    pub program: PathBuf,
    /// The plan.
    pub plan: PathBuf,
    /// Words of options that every slice gets.
    pub words: Vec<String>,
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

impl Call {
    /// The command that runs a slice on this machine.
    pub fn command(&self, slice: usize) -> Command {
        let mut command = Command::new(&self.program);
        command.args(["farm", "run"]).arg(&self.plan).args(["--slice", &slice.to_string()]).args(&self.words);
        command
    }

    /// The words of the command that runs a slice, whose number is written as `slice`.
    pub fn words(&self, slice: &str) -> Vec<String> {
        let path = |path: &Path| path.to_string_lossy().into_owned();
        let own = [path(&self.program), "farm".into(), "run".into(), path(&self.plan), "--slice".into(), slice.into()];
        own.into_iter().chain(self.words.iter().cloned()).collect()
    }

    /// The command as a line of a shell script, in which `slice` stands as it is.
    pub fn line(&self, slice: &str) -> String {
        let words = self.words(slice);
        let word = |(at, word): (usize, &String)| if at == SLICE_AT { word.clone() } else { quoted(word) };
        words.iter().enumerate().map(word).collect::<Vec<_>>().join(" ")
    }
}

/// Minutes that a slice may take on a slow machine: ten times the longest estimate, and ten minutes.
fn limit_minutes(plan: &Plan) -> u64 {
    let longest = plan.slices.iter().map(|slice| f64::from(slice.seconds)).fold(0.0, f64::max);
    10 + (longest / 6.0).ceil() as u64
}

fn memory_mb(plan: &Plan) -> u32 {
    plan.slices.iter().map(|slice| slice.memory_mb).max().unwrap_or(0)
}

/// An array of Slurm: the number of the slice that its task 0 would take, and the tasks as `--array` has them.
pub type Array = (usize, String);

/// Arrays that run these slices, whose numbers increase, together at most `workers` at a time, or one of each array.
pub fn arrays(slices: &[usize], workers: Option<usize>) -> Vec<Array> {
    let chunks: Vec<&[usize]> = slices.chunk_by(|a, b| a / ARRAY == b / ARRAY).collect();
    let limit = workers.map_or_else(String::new, |workers| format!("%{}", (workers / chunks.len()).max(1)));
    let array = |chunk: &&[usize]| {
        let tasks: Vec<usize> = chunk.iter().map(|slice| slice % ARRAY).collect();
        (chunk[0] / ARRAY * ARRAY, format!("{}{limit}", ranges(&tasks)))
    };
    chunks.iter().map(array).collect()
}

/// The batch script of a Slurm array whose task T runs slice FIRST + T. A failed task is put back into the queue twice, with FIRST in
/// its environment as at first.
pub fn slurm(plan: &Plan, call: &Call, logs: &Path) -> String {
    let command = call.line("\"$slice\"");
    // In a name of a log %A stands for the array and %a for the task, and %% for %.
    let logs = logs.display().to_string().replace('%', "%%");
    let (memory, minutes) = (memory_mb(plan), limit_minutes(plan));
    format!(
        r#"#!/bin/sh
# Slices of a plan: task T of an array runs slice FIRST + T.
#SBATCH --job-name=shadow-fields
#SBATCH --requeue --open-mode=append
#SBATCH --cpus-per-task=1 --mem={memory}M --time={minutes}
#SBATCH --output="{logs}/%A_%a.log"
slice=$((FIRST + SLURM_ARRAY_TASK_ID))
echo "slice $slice on $(hostname), start ${{SLURM_RESTART_COUNT:-0}}"
# A task has one core: llvmpipe draws in the thread that asks for it.
export LP_NUM_THREADS="${{LP_NUM_THREADS:-0}}"
{command} && exit
code=$?
# 2 usage, 3 another device or program, 4 bad input: these would fail again.
case $code in [234]) exit $code ;; esac
if [ "${{SLURM_RESTART_COUNT:-0}}" -lt 2 ]; then
    exec scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit $code
"#
    )
}

/// A job template of Open Job Description with a task a slice.
pub fn openjd(plan: &Plan, call: &Call, slices: &[usize]) -> Value {
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
    fn arrays_keep_their_indices_and_share_the_limit() {
        let slices: Vec<usize> = (3..2002).filter(|slice| *slice != 7).collect();
        let found = arrays(&slices, Some(7));
        let expected = [(0, "3-6,8-999%2"), (1000, "0-999%2"), (2000, "0-1%2")];
        assert_eq!(found, expected.map(|(first, tasks)| (first, tasks.to_owned())));
        assert_eq!(arrays(&[5, 1000], Some(1)), [(0, "5%1".to_owned()), (1000, "0%1".to_owned())]);
        assert_eq!(arrays(&[5], None), [(0, "5".to_owned())]);
    }

    #[test]
    fn words_with_blanks_and_quotes_stay_one() {
        let words = vec!["--time=0".to_owned(), "it's here".to_owned()];
        let call = Call { program: "/a b/p".into(), plan: "plan.json".into(), words };
        assert_eq!(call.line("7"), r"'/a b/p' farm run plan.json --slice 7 --time=0 'it'\''s here'");
        assert_eq!(call.words("7")[SLICE_AT], "7");
        let call = Call { plan: "$slice/SLICE.json".into(), ..call };
        assert!(call.line("\"$slice\"").contains("run '$slice/SLICE.json' --slice \"$slice\" --time"));
    }
}
