//! Output of the program: results, logs, errors, progress bars, tables.

use super::Global;
use crate::error::{Error, Result, is_deceptive, one_line};
use crate::gpu::compiling;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The first error that kept results from being written.
static UNWRITTEN: Mutex<Option<std::io::Error>> = Mutex::new(None);

/// Writes lines of results to stdout. A reader that went away is no error; any other is kept for [`written`].
pub fn say(text: impl AsRef<str>) {
    // In the form of JSON's escapes, because results may be JSON.
    let escaped = |c: char| match c {
        c if c != '\n' && is_deceptive(c) => format!("\\u{:04x}", u32::from(c)),
        c => c.to_string(),
    };
    let text: String = text.as_ref().chars().map(escaped).collect();
    let mut stdout = std::io::stdout().lock();
    let Err(error) = writeln!(stdout, "{text}").and_then(|()| stdout.flush()) else { return };
    if error.kind() != std::io::ErrorKind::BrokenPipe {
        UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// Fails where results could not be written, as to a full disk.
pub fn written() -> Result<()> {
    match UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).take() {
        Some(error) => Err(Error::Failed(format!("stdout: cannot be written: {error}"))),
        None => Ok(()),
    }
}

/// Writes one line of an error to stderr.
pub fn complain(error: &Error) {
    let _ = writeln!(std::io::stderr().lock(), "shadow-fields: {}", error.line());
}

/// A path as it is shown in a line.
pub fn shown(path: &Path) -> String {
    one_line(&path.to_string_lossy())
}

/// Writes one line for people to stderr.
pub fn note(global: &Global, line: impl AsRef<str>) {
    if !global.quiet {
        let _ = writeln!(std::io::stderr().lock(), "{}", one_line(line.as_ref()));
    }
}

/// Starts the log on stderr: warnings by default, more with `-v`, as RUST_LOG says where it is set.
pub fn start_log(global: &Global) {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    let environment = env_logger::Env::default().default_filter_or(level);
    let start = Instant::now();
    let line = move |buffer: &mut env_logger::fmt::Formatter, record: &log::Record<'_>| {
        let level = record.level();
        let style = buffer.default_level_style(record.level());
        let seconds = start.elapsed().as_secs_f64();
        let message = one_line(&record.args().to_string());
        writeln!(buffer, "[{style}{level:<5}{style:#} {seconds:.2} s {}] {message}", record.target())
    };
    let _ = env_logger::Builder::from_env(environment).format(line).try_init();
}

/// Time between lines of progress where stderr is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// A progress bar for each piece of work that is being done, and a line where shaders are compiled. Where stderr is no
/// terminal, a line now and then; nothing where progress is not wanted.
pub struct Progress {
    hidden: bool,
    /// When the last line was written, where stderr is no terminal.
    line: Option<Mutex<Instant>>,
    bars: MultiProgress,
    /// Those that are not done, and their names.
    current: Mutex<Vec<(String, ProgressBar)>>,
}

impl Progress {
    /// A bar as the global options want it.
    pub fn new(global: &Global) -> Self {
        let unwanted = global.no_progress || global.quiet;
        let is_terminal = std::io::stderr().is_terminal();
        let hidden = unwanted || !is_terminal;
        let bars = MultiProgress::with_draw_target(ProgressDrawTarget::stderr());
        if !hidden {
            let lines = bars.clone();
            compiling::tell_first(move |shader| {
                let line = format!("compiling shaders, {shader} first: this takes longer than with a cache");
                let _ = lines.println(one_line(&line)); // a line that failed is no reason to fail
            });
        }
        let line = (!unwanted && !is_terminal).then(|| Mutex::new(Instant::now()));
        Progress { hidden, line, bars, current: Mutex::default() }
    }

    /// Shows that `done` of `all` samples of `what` are baked.
    pub fn show(&self, what: &str, done: u32, all: u32) {
        self.bar(&format!("baking {what}"), "{msg:24} [{bar:32}] {pos}/{len} samples, {eta} left", done, all);
    }

    /// Shows that `done` of `all` pictures are rendered; a single one needs no bar.
    pub fn pictures(&self, done: u32, all: u32) {
        if all > 1 {
            self.count("rendering pictures", done, all);
        }
    }

    /// Shows that `done` of `all` pieces of some work are done.
    pub fn count(&self, what: &str, done: u32, all: u32) {
        self.bar(what, "{msg} [{bar:32}] {pos}/{len}, {eta} left", done, all);
    }

    fn bar(&self, what: &str, template: &str, done: u32, all: u32) {
        if let Some(line) = &self.line {
            let mut last = line.lock().unwrap_or_else(PoisonError::into_inner);
            if last.elapsed() > LINE_EVERY {
                *last = Instant::now();
                let _ = writeln!(std::io::stderr().lock(), "{}: {done} of {all}", one_line(what));
            }
        }
        if self.hidden {
            return;
        }
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        let known = current.iter().position(|(name, _)| name == what);
        let number = known.unwrap_or_else(|| {
            let bar = self.bars.add(ProgressBar::new(all.into()));
            let style = ProgressStyle::with_template(template);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
            bar.set_message(one_line(what));
            current.push((what.to_owned(), bar));
            current.len() - 1
        });
        current[number].1.set_position(done.into());
        if done == all {
            current.swap_remove(number).1.finish_and_clear();
        }
    }
}

/// Prints rows under a header: the first column flush left, the others flush right.
pub fn table(header: &[&str], rows: &[Vec<String>]) {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: Vec<String>| {
        let padded = cells.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        say(padded.collect::<Vec<_>>().join("  ").trim_end());
    };
    line(header.iter().map(|h| (*h).to_owned()).collect());
    rows.iter().for_each(|row| line(row.clone()));
}
