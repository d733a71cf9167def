//! Background tasks, bakes and ray casting, each on its own thread, which can be stopped.

use crate::error::{Error, Result};
use std::any::Any;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TaskProgress {
    /// Description of the current work.
    pub what: String,
    pub done: u32,
    pub all: u32,
    pub elapsed: Duration,
}

impl TaskProgress {
    pub fn share(&self) -> f32 {
        self.done as f32 / self.all.max(1) as f32
    }
}

/// The thread's side of a task: it reports progress and sends results.
pub struct TaskWorker<T> {
    stop: Arc<AtomicBool>,
    start: Instant,
    progress: Arc<Mutex<TaskProgress>>,
    results: Sender<T>,
}

/// Payload of the unwinding that stops a task.
struct Stopped;

impl<T> TaskWorker<T> {
    /// Reports progress. If the task was told to stop, this unwinds its thread, which drops everything on its stack.
    pub fn report(&self, what: &str, done: u32, all: u32) {
        if self.stop.load(Ordering::Relaxed) {
            // Unlike a panic, `resume_unwind` prints nothing; `BackgroundTask` expects the payload.
            resume_unwind(Box::new(Stopped));
        }
        let progress = TaskProgress { what: what.to_owned(), done, all, elapsed: self.start.elapsed() };
        *self.progress.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = progress;
    }

    pub fn send(&self, result: T) {
        let _ = self.results.send(result); // fails only if the task was dropped, which needs no result
    }
}

/// A running task. Dropping it stops it and waits for its thread.
pub struct BackgroundTask<T> {
    thread: Option<JoinHandle<Result<()>>>,
    start: Instant,
    stop: Arc<AtomicBool>,
    progress: Arc<Mutex<TaskProgress>>,
    results: Receiver<T>,
}

impl<T: Send + 'static> BackgroundTask<T> {
    /// Starts `work` on a thread.
    pub fn new(work: impl FnOnce(&TaskWorker<T>) -> Result<()> + Send + 'static) -> Self {
        let stop = Arc::<AtomicBool>::default();
        let progress = Arc::<Mutex<TaskProgress>>::default();
        let (sender, results) = channel();
        let start = Instant::now();
        let worker = TaskWorker { stop: stop.clone(), start, progress: progress.clone(), results: sender };
        let thread = std::thread::spawn(move || work(&worker));
        BackgroundTask { thread: Some(thread), start, stop, progress, results }
    }

    /// Results since the last call, oldest first.
    pub fn results(&self) -> Vec<T> {
        self.results.try_iter().collect()
    }

    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    pub fn progress(&self) -> TaskProgress {
        self.progress.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).clone()
    }

    /// Its outcome, once it has ended; `None` before, and after the outcome was taken.
    pub fn ended(&mut self) -> Option<Result<()>> {
        self.thread.take_if(|thread| thread.is_finished()).map(|thread| outcome(thread.join()))
    }

    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

fn outcome(joined: std::result::Result<Result<()>, Box<dyn Any + Send>>) -> Result<()> {
    match joined {
        Ok(result) => result,
        Err(thrown) if thrown.is::<Stopped>() => Err(Error::Failed("stopped".into())),
        Err(thrown) => resume_unwind(thrown),
    }
}

impl<T> Drop for BackgroundTask<T> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_task_stops_at_its_next_report() {
        let freed = Arc::new(AtomicBool::new(false));
        struct SetWhenDropped(Arc<AtomicBool>);
        impl Drop for SetWhenDropped {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
            }
        }
        let held = SetWhenDropped(freed.clone());
        let task = BackgroundTask::new(move |worker: &TaskWorker<u32>| {
            let _held = held;
            for i in 0.. {
                worker.report("counting", i, u32::MAX);
                worker.send(i);
                std::thread::yield_now();
            }
            Ok(())
        });
        while task.results().is_empty() {
            std::thread::yield_now();
        }
        assert_eq!(task.progress().what, "counting");
        drop(task);
        assert!(freed.load(Ordering::Relaxed), "the thread's stack was unwound");
    }

    #[test]
    fn a_task_that_ends_says_how_once() {
        let mut task = BackgroundTask::new(|worker: &TaskWorker<&str>| {
            worker.send("half");
            Err(Error::Device("gone".into()))
        });
        let ended = loop {
            if let Some(ended) = task.ended() {
                break ended;
            }
            std::thread::yield_now();
        };
        assert_eq!(ended.unwrap_err().exit_code(), 5);
        assert_eq!(task.results(), ["half"]);
        assert!(task.ended().is_none() && !task.is_running());
    }
}
