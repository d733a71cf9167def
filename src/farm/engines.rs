//! Input of farm engines: templates in `assets/farm` with the commands of slices, and plain commands.

use super::plan::plain;
use crate::error::{Error, Result};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// How a slice is started on every machine: the words of a command, which the number of the slice ends.
pub struct Call(Vec<String>);

impl Call {
    /// A call of a program on a plan, with words of options that every slice gets.
    pub fn new(program: &Path, plan: &Path, options: Vec<String>) -> Result<Self> {
        let mut words = vec![plain(program)?.to_owned(), "farm".into(), "run".into(), plain(plan)?.to_owned()];
        for option in options {
            words.push(plain(Path::new(&option))?.to_owned());
        }
        words.push("--slice".into());
        Ok(Call(words))
    }

    /// The command that runs a slice on this machine.
    pub fn command(&self, slice: usize) -> Command {
        let mut command = Command::new(&self.0[0]);
        command.args(&self.0[1..]).arg(slice.to_string());
        command
    }

    /// The command that runs a slice as a line of a shell.
    pub fn line(&self, slice: usize) -> String {
        format!("{} {slice}", shell(&json!(self.0)))
    }
}

/// A text as a word of a POSIX shell, a list as words, and numbers as they are.
pub fn shell(value: &Value) -> String {
    match value {
        Value::Array(words) => words.iter().map(shell).collect::<Vec<_>>().join(" "),
        Value::String(word) => {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+%@".contains(c);
            if !word.is_empty() && word.chars().all(is_plain) {
                word.clone()
            } else {
                format!("'{}'", word.replace('\'', r"'\''"))
            }
        }
        other => other.to_string(),
    }
}

/// A template whose `{name}`s are replaced by the values of these names, as `escape` writes them. What is put in is not
/// looked at again, and other braces stay.
fn fill(template: &str, escape: fn(&Value) -> String, values: &Value) -> String {
    let mut filled = String::new();
    let mut rest = template;
    while let Some((before, from)) = rest.split_once('{') {
        filled += before;
        let known = from.split_once('}').and_then(|(name, after)| Some((values.get(name)?, after)));
        rest = match known {
            Some((value, after)) => {
                filled += &escape(value);
                after
            }
            None => {
                filled.push('{');
                from
            }
        };
    }
    filled + rest
}

/// The batch script of a Slurm array whose task T runs slice T. A failed task is put back into the queue twice.
pub fn slurm(call: &Call) -> String {
    fill(include_str!("../../assets/farm/slurm.sbatch"), shell, &json!({ "command": call.0 }))
}

/// The name of the logs of a Slurm array in a folder: %A stands for the array, %a for the task, and %% for %.
pub fn slurm_logs(folder: &Path) -> Result<String> {
    let text = plain(folder)?;
    if text.contains('\\') {
        return Err(Error::Usage(format!("{text}: Slurm takes no backslash in the path of a log")));
    }
    Ok(format!("{}/%A_%a.log", text.replace('%', "%%")))
}

/// The script that maps slices over a Dask cluster: that at an address, or one of so many workers on this machine.
pub fn dask(call: &Call, slices: &[usize], scheduler: Option<&str>, workers: Option<u32>) -> String {
    let values = json!({
        "command": call.0, "slices": slices, "scheduler": scheduler.unwrap_or(""), "workers": workers.unwrap_or(0),
    });
    // Lists, numbers and texts of JSON are those of Python.
    fill(include_str!("../../assets/farm/dask.py"), Value::to_string, &values)
}

/// A job template of Open Job Description with a task a slice.
pub fn openjd(call: &Call, slices: &[usize]) -> Result<String> {
    if let Some(word) = call.0.iter().find(|word| word.contains("{{")) {
        return Err(Error::Usage(format!("{word}: a template of OpenJD takes no {{{{ in paths")));
    }
    let arguments: Vec<&str> = call.0[1..].iter().map(String::as_str).chain(["{{Task.Param.Slice}}"]).collect();
    let values = json!({ "slices": ranges(slices), "command": call.0[0], "arguments": arguments });
    Ok(fill(include_str!("../../assets/farm/openjd.json"), Value::to_string, &values))
}

/// Numbers in ranges: `0-3,7`.
pub fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = runs.map(|run| match run {
        [one] => one.to_string(),
        _ => format!("{}-{}", run[0], run[run.len() - 1]),
    });
    text.collect::<Vec<_>>().join(",")
}
