//! The engine of one machine: slices in processes, as many at a time as there are workers.

use super::engines::Call;
use crate::gpu;
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, mpsc};

/// How often a slice is tried.
const TRIES: usize = 3;

/// Runs slices, each up to three times, and tells how many are done. A slice that fails keeps no other from running.
/// Answers with the numbers of those that failed at every try, and the last line that each of them said.
pub fn run(call: &Call, workers: usize, slices: &[usize], progress: &dyn Fn(usize)) -> Vec<(usize, String)> {
    let queue = Mutex::new(slices.iter());
    let next = || queue.lock().expect("no worker panics while it takes a slice").next().copied();
    let (to, results) = mpsc::channel();
    let mut failures = Vec::new();
    std::thread::scope(|scope| {
        for _ in 0..workers.min(slices.len()) {
            let to = to.clone();
            let next = &next;
            scope.spawn(move || {
                while let Some(slice) = next() {
                    let _ = to.send((slice, try_slice(call, slice, workers)));
                }
            });
        }
        drop(to);
        let mut done = 0;
        for (slice, outcome) in results {
            match outcome {
                Ok(()) => done += 1,
                Err(said) => failures.push((slice, said)),
            }
            progress(done);
        }
    });
    failures.sort();
    failures
}

/// Runs a slice, or answers with the last line that it said.
fn try_slice(call: &Call, slice: usize, workers: usize) -> Result<(), String> {
    for attempt in 1.. {
        let mut command = call.command(slice);
        gpu::share_cores(&mut command, workers);
        let output = output_with_stdin(&mut command).map_err(|error| format!("cannot be started: {error}"))?;
        if output.status.success() {
            break;
        }
        let last = last_line(&output);
        log::info!("slice {slice}, try {attempt}: {last}");
        // A usage error, another device or program, and bad input stay so.
        if attempt == TRIES || output.status.code().is_some_and(|code| (2..=4).contains(&code)) {
            return Err(last);
        }
    }
    Ok(())
}

/// Runs a command to its end. It can tell by the end of its stdin, which is held open here, that this process was
/// killed.
pub fn output_with_stdin(command: &mut Command) -> std::io::Result<Output> {
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn()?;
    let _held = child.stdin.take();
    child.wait_with_output()
}

/// The last line that a process wrote to stderr, or how it ended.
pub fn last_line(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty());
    last.map_or_else(|| output.status.to_string(), str::to_owned)
}
