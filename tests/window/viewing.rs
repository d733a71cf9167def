//! The program with its window on a virtual display.

use super::cli::{COARSE, Folder};
use super::common::Running;
use super::display::Display;
use super::room;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

pub const SIZE: [usize; 2] = [480, 320];
/// How the lamp moves while the scene runs.
pub const MOTION: &str = ", motion = [{ bob = { amplitude_m = 0.2, period_s = 3 } }]";
/// The window's size, and samples as `render` takes them.
pub const OPTIONS: &str = "--size 480x320 --no-overlay --antialias samples --validation sync";
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Waits until `done`, with a pause between questions; panics with what is wrong.
pub fn until(wrong: &str, pause_ms: u64, mut done: impl FnMut() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !done() {
        assert!(Instant::now() < end, "{wrong}");
        std::thread::sleep(Duration::from_millis(pause_ms));
    }
}

/// A folder and a display; `None` where a device or the display is missing.
pub fn desk() -> Option<(Folder, Display)> {
    let folder = Folder::with_device()?;
    let display = Display::open(folder.path())?;
    Some((folder, display))
}

/// The program with its window, and the lines that it logs.
pub struct View<'d> {
    pub display: &'d Display,
    pub child: Running,
    lines: Receiver<String>,
    pub heard: Vec<String>,
    pub window: String,
}

impl<'d> View<'d> {
    pub fn open(display: &'d Display, folder: &Folder, line: &str) -> Self {
        let mut program = folder.command(line);
        program.env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY").arg("-v");
        let mut child = program.stderr(Stdio::piped()).spawn().unwrap();
        let stderr = child.stderr.take().unwrap();
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| drop(sender.send(line)));
        });
        let mut view = View { display, child: Running(child), lines, heard: Vec::new(), window: String::new() };
        view.hears("the first picture");
        until("the window is of one colour", 50, || display.look(SIZE).windows(2).any(|pair| pair[0] != pair[1]));
        view.window = display.xdotool(&["search", "--name", "shadow-fields"]).trim().to_owned();
        display.xdotool(&["windowfocus", "--sync", &view.window]);
        view
    }

    /// Waits until a line with that text is logged.
    pub fn hears(&mut self, text: &str) {
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    let found = line.contains(text);
                    self.heard.push(line);
                    if found {
                        return;
                    }
                }
                Err(_) => panic!("\"{text}\" was not heard; before: {:#?}", self.heard),
            }
        }
    }

    pub fn key(&mut self, key: &str, text: &str) {
        self.display.xdotool(&["key", key]);
        self.hears(text);
    }

    pub fn drag(&mut self, button: &str, from: [i32; 2], to: [i32; 2]) {
        let places = [from, [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2], to].map(|p| p.map(|c| c.to_string()));
        let mut arguments = vec!["mousemove", &places[0][0], &places[0][1], "mousedown", button];
        for place in &places[1..] {
            arguments.extend(["sleep", "0.05", "mousemove", &place[0], &place[1]]);
        }
        arguments.extend(["sleep", "0.05", "mouseup", button]);
        self.display.xdotool(&arguments);
    }

    /// Looks until two looks in a row show the same.
    pub fn picture(&self, size: [usize; 2]) -> Vec<[u8; 3]> {
        let mut now = Vec::new();
        until("the picture does not settle", 400, || {
            let before = std::mem::replace(&mut now, self.display.look(size));
            now == before
        });
        now
    }

    /// Closes the window by its key: the program ends well, the validation layers are silent. All that was logged.
    pub fn close(self) -> Vec<String> {
        self.display.xdotool(&["key", "ctrl+q"]);
        let (code, heard) = self.end();
        let last = &heard[heard.len().saturating_sub(40)..];
        assert_eq!(code, 0, "{last:#?}");
        assert!(!heard.iter().any(|line| line.contains("validation:")), "{heard:#?}");
        heard
    }

    /// Waits for the end; everything that was logged.
    pub fn end(mut self) -> (i32, Vec<String>) {
        let start = Instant::now();
        let code = loop {
            if let Some(status) = self.child.0.try_wait().unwrap() {
                break status.code().unwrap_or_else(|| panic!("it did not end by itself: {status}"));
            }
            assert!(start.elapsed() < PATIENCE, "the window does not close: {:#?}", self.heard);
            std::thread::sleep(Duration::from_millis(20));
        };
        self.heard.extend(self.lines.try_iter());
        (code, std::mem::take(&mut self.heard))
    }
}

/// Opens a window on the room, at 480x320.
pub fn open<'d>(display: &'d Display, folder: &Folder) -> View<'d> {
    let size = SIZE.map(|side| side as u32);
    room::write(folder.path(), size, MOTION);
    View::open(display, folder, &format!("view scene.toml --paused {OPTIONS} {COARSE}"))
}
