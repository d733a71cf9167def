//! Runs something again and again, and lets one Vulkan call after another fail.

use super::claimed::Claims;
use super::common::{paths_below, report};
use super::layer::{Call, Heard, Plan, watch};
use ash::vk;
use shadow_fields::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Longest time that a run may take.
const PATIENCE: Duration = Duration::from_secs(60);

/// What is run: in a folder with the inputs, it makes outputs.
pub struct Job {
    pub name: &'static str,
    pub run: fn(&Path) -> Result<()>,
    /// Files that a good run makes, the same in every run.
    pub outputs: &'static [&'static str],
    /// What is removed from the folder before a run, besides its outputs.
    pub cold: &'static [&'static str],
    /// Parts of the names of the calls that fail, if not all do.
    pub only: Option<&'static [&'static str]>,
}

/// Ends the process where a run hangs, which no test could do otherwise.
fn guarded<R>(what: &str, run: impl FnOnce() -> R) -> R {
    let (done, waits) = channel::<()>();
    let what = what.to_owned();
    let guard = std::thread::spawn(move || {
        if waits.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
            report(&format!("{what}: it hangs"));
            std::process::exit(101);
        }
    });
    let outcome = run();
    drop(done);
    guard.join().unwrap();
    outcome
}

impl Job {
    fn remove(&self, folder: &Path, names: &[&str]) {
        for name in names {
            let path = folder.join(name);
            let gone = if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
            assert!(gone.is_ok() || !path.exists(), "{}: {}", self.name, path.display());
        }
    }

    fn made(&self, folder: &Path) -> Vec<Option<Vec<u8>>> {
        self.outputs.iter().map(|name| std::fs::read(folder.join(name)).ok()).collect()
    }

    /// One run, which neither panics nor hangs and leaves nothing on the device.
    fn watched(&self, folder: &Path, what: &str, plan: Option<Plan>) -> (Result<()>, Heard) {
        let run = || catch_unwind(AssertUnwindSafe(|| (self.run)(folder)));
        let (outcome, heard) = guarded(what, || watch(plan, Claims::default(), run));
        let outcome = outcome.unwrap_or_else(|_| panic!("{what}: it panicked"));
        assert_clean(what, &heard);
        (outcome, heard)
    }

    /// One run without a fault, with all that it made.
    fn good(&self, folder: &Path, what: &str) -> (Vec<Option<Vec<u8>>>, Heard) {
        let what = &format!("{}: {what}", self.name);
        let (outcome, heard) = self.watched(folder, what, None);
        outcome.unwrap_or_else(|error| panic!("{what}: {error}"));
        let made = self.made(folder);
        for (name, content) in self.outputs.iter().zip(&made) {
            assert!(content.is_some(), "{what}: there is no {name}");
        }
        (made, heard)
    }

    /// Calls that are to fail, each with one of its errors: a seeded one in `share`, a tenth of names for debuggers.
    fn faults(&self, share: usize, calls: &[Call]) -> Vec<Plan> {
        let is_wanted = |call: &Call| self.only.is_none_or(|parts| parts.iter().any(|part| call.name.contains(part)));
        let plans = |at: usize| (0..calls[at].errors.len()).map(move |error| Plan { at, error });
        let wanted = (0..calls.len()).filter(|at| is_wanted(&calls[*at])).flat_map(plans);
        let is_name = |plan: &Plan| calls[plan.at].name == "vkSetDebugUtilsObjectNameEXT";
        let mut faults: Vec<Plan> =
            wanted.filter(|plan| share == 1 || !is_name(plan) || plan.at.is_multiple_of(10)).collect();
        fastrand::Rng::with_seed(1).shuffle(&mut faults);
        faults.truncate(faults.len().div_ceil(share));
        faults
    }

    /// Lets calls fail, each in a run of its own, which makes the calls of a good one up to there; how many did. After
    /// every eight, a run without a fault must make what it did before.
    pub fn sweep(&self, folder: &Path, share: usize) -> usize {
        let start = Instant::now();
        self.good(folder, "the first run");
        self.remove(folder, self.outputs);
        self.remove(folder, self.cold);
        let (expected, heard) = self.good(folder, "the second run");
        let faults = self.faults(share, &heard.calls);
        for (index, &plan) in faults.iter().enumerate() {
            let call = heard.calls[plan.at];
            let what = format!("{}: call {}, {} with {:?}", self.name, plan.at, call.name, call.errors[plan.error]);
            self.one(folder, &what, plan, call, &expected);
            if index % 8 == 7 || index + 1 == faults.len() {
                self.again(folder, &format!("faults up to call {}, {}", plan.at, call.name), &expected);
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        let calls = heard.calls.len();
        report(&format!("{}: {calls} calls can fail, {} faults, {seconds:.1} s", self.name, faults.len()));
        faults.len()
    }

    /// A run without a fault makes what one did before, whatever the runs since left in the process and the cache.
    fn again(&self, folder: &Path, since: &str, expected: &[Option<Vec<u8>>]) {
        self.remove(folder, self.outputs);
        let what = format!("the run after {since}");
        let (made, _) = self.good(folder, &what);
        assert!(made == expected, "{}: {what} makes something else", self.name);
    }

    fn one(&self, folder: &Path, what: &str, plan: Plan, planned: Call, expected: &[Option<Vec<u8>>]) {
        self.remove(folder, self.outputs);
        self.remove(folder, self.cold);
        let (outcome, heard) = self.watched(folder, what, Some(plan));
        let (call, code) = heard.fired.unwrap_or_else(|| panic!("{what}: only {} calls were made", heard.calls.len()));
        assert_eq!(call, planned, "{what}: the calls before it are others");
        match &outcome {
            Ok(()) => assert!(is_forgiven(call), "{what}: nobody noticed"),
            Err(error) => assert_told(what, call, code, error),
        }
        for ((name, expected), made) in self.outputs.iter().zip(expected).zip(self.made(folder)) {
            assert!(outcome.is_err() || made.is_some(), "{what}: there is no {name}");
            assert!(made.is_none() || made == *expected, "{what}: {name} is not what it is without a fault");
        }
        assert_no_leftovers(what, folder);
    }
}

/// Nothing is left, and nothing was done that no valid program does.
pub fn assert_clean(what: &str, heard: &Heard) {
    assert!(heard.left.is_empty(), "{what}: not destroyed: {:?}", heard.left);
    assert!(heard.wrong.is_empty(), "{what}: {:?}", heard.wrong);
}

/// Calls whose failure no user misses: names for debuggers, the pipeline cache, waiting for what has ended.
fn is_forgiven(call: Call) -> bool {
    let forgiven = ["vkSetDebugUtilsObjectNameEXT", "vkGetPipelineCacheData", "vkDeviceWaitIdle", "vkWaitForFences"];
    forgiven.contains(&call.name)
}

/// One line that names the call, the object and the error, and the right exit code.
fn assert_told(what: &str, call: Call, code: vk::Result, error: &Error) {
    let line = error.to_string();
    assert!(!line.contains('\n') && line == error.line(), "{what}: {line:?} is not one line");
    assert_eq!(error.exit_code(), 5, "{what}: {line}");
    // Before an object is destroyed the device waits, and passes over its loss; the next call tells of it.
    let passes_over = (call.name, code) == ("vkWaitForFences", vk::Result::ERROR_DEVICE_LOST);
    let (_, rest) = line
        .split_once(&format!("{} (", call.name))
        .or_else(|| line.split_once(" (").filter(|(later, _)| passes_over && later.starts_with("vk")))
        .unwrap_or_else(|| panic!("{what}: {line} does not name the call"));
    let (object, rest) = rest.split_once("): ").unwrap_or_else(|| panic!("{what}: {line} does not name an object"));
    assert!(!object.is_empty() && rest.starts_with(&format!("{code:?}")), "{what}: {line}");
}

fn assert_no_leftovers(what: &str, folder: &Path) {
    for path in paths_below(folder) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        assert!(!name.starts_with(".unfinished-"), "{what}: {} is left", path.display());
    }
}
