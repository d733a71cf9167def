//! The engine of one machine: slices in processes, as many at a time as there are workers.

use super::engines::Call;
use crate::error::{Error, Result};
use crate::gpu;
use std::path::Path;
use std::process::Stdio;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// How often a slice is tried.
const TRIES: usize = 3;

/// What runs slices.
pub struct Runner {
    /// How a slice is started.
    pub call: Call,
    /// Processes at a time.
    pub workers: usize,
}

/// What became of a slice that failed at every try: its number, and the last line that it said.
pub type Failure = (usize, String);

impl Runner {
    /// Runs slices, each up to three times, and tells how many are done. A slice that fails keeps no other from running.
    ///
    /// # Errors
    /// `Failed` where the program cannot be started.
    pub fn run(&self, slices: &[usize], progress: &dyn Fn(usize)) -> Result<Vec<Failure>> {
        let next = AtomicUsize::new(0);
        let (to, results) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..self.workers.min(slices.len()) {
                let (to, next) = (to.clone(), &next);
                scope.spawn(move || {
                    while let Some(&slice) = slices.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if to.send(self.one(slice)).is_err() {
                            return;
                        }
                    }
                });
            }
            drop(to);
            let (mut failures, mut done) = (Vec::new(), 0);
            for outcome in results {
                match outcome {
                    Ok(None) => done += 1,
                    Ok(Some(failure)) => failures.push(failure),
                    Err(error) => {
                        next.store(slices.len(), Ordering::Relaxed);
                        return Err(error);
                    }
                }
                progress(done);
            }
            failures.sort();
            Ok(failures)
        })
    }

    fn one(&self, slice: usize) -> Result<Option<Failure>> {
        let mut last = String::new();
        for attempt in 1..=TRIES {
            let mut command = self.call.command(slice);
            gpu::share_cores(&mut command, self.workers);
            let output = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).output();
            let output = output.map_err(|error| cannot_start(&self.call.program, &error))?;
            if output.status.success() {
                return Ok(None);
            }
            let said = String::from_utf8_lossy(&output.stderr);
            last = said.lines().last().map_or_else(|| output.status.to_string(), str::to_owned);
            log::info!("slice {slice}, try {attempt}: {last}");
            // A usage error, another device or program, and bad input stay so.
            if output.status.code().is_some_and(|code| (2..=4).contains(&code)) {
                break;
            }
        }
        Ok(Some((slice, last)))
    }
}

/// A program that does not start.
pub fn cannot_start(program: &Path, error: &std::io::Error) -> Error {
    Error::Failed(format!("{}: cannot be started: {error}", program.display()))
}
