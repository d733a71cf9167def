//! A line on a terminal that says which shader or pipeline is being compiled, where that takes longer than a moment.

use crate::error::one_line;
use crate::gpu::compiling;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Compilations shorter than this are not shown.
const MOMENT: Duration = Duration::from_millis(500);
/// Time between two looks at what is being compiled.
const PERIOD: Duration = Duration::from_millis(100);

/// Shows the line while it lives.
pub struct CompilingLine {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl CompilingLine {
    pub fn new(bars: MultiProgress) -> Self {
        let (stop, stopped) = channel();
        let thread = std::thread::spawn(move || {
            let mut line = None;
            while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                update(&bars, &mut line);
            }
            clear(&bars, &mut line);
        });
        CompilingLine { stop: Some(stop), thread: Some(thread) }
    }
}

impl Drop for CompilingLine {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // a line that failed is no reason to fail
        }
    }
}

fn update(bars: &MultiProgress, line: &mut Option<ProgressBar>) {
    let Some((what, since)) = compiling::longest().filter(|(_, since)| since.elapsed() >= MOMENT) else {
        return clear(bars, line);
    };
    let line = line.get_or_insert_with(|| {
        let style = ProgressStyle::with_template("{spinner} compiling {msg}");
        let bar = bars.add(ProgressBar::new_spinner());
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        bar
    });
    line.set_message(format!("{}, {} s", one_line(&what), since.elapsed().as_secs()));
    line.tick();
}

fn clear(bars: &MultiProgress, line: &mut Option<ProgressBar>) {
    if let Some(bar) = line.take() {
        bar.finish_and_clear();
        bars.remove(&bar);
    }
}
