//! A virtual display, and programs that end with the test.

#![allow(dead_code)] // every test binary uses its own part

use super::common::{self, Running};
use std::cell::RefCell;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A virtual display that writes its pixels to a file.
pub struct Display {
    pub name: String,
    pixels: PathBuf,
    server: RefCell<Running>,
}

impl Display {
    /// `None` where Xvfb or xdotool is missing.
    pub fn open(folder: &Path) -> Option<Self> {
        if Command::new("xdotool").arg("version").output().is_err() {
            common::skip("no xdotool");
            return None;
        }
        // The server picks a free number and tells it.
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "640x480x24", "-noreset", "-fbdir"])
            .arg(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut server) = server else {
            common::skip("no Xvfb");
            return None;
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let name = format!(":{}", number.trim());
        Some(Display { name, pixels: folder.join("Xvfb_screen0"), server: RefCell::new(Running(server)) })
    }

    pub fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").env("DISPLAY", &self.name).args(arguments).output().unwrap();
        assert!(output.status.success(), "xdotool {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// RGB of the top left corner of the screen: X11's window dump format, 32 bits a pixel.
    pub fn look(&self, [width, height]: [usize; 2]) -> Vec<[u8; 3]> {
        let bytes = std::fs::read(&self.pixels).unwrap();
        let word = |i: usize| u32::from_be_bytes(bytes[4 * i..][..4].try_into().unwrap()) as usize;
        let header = word(0);
        let little = word(7) == 0;
        let bits = word(11);
        let line = word(12);
        let colors = word(19);
        assert!(little && bits == 32, "the display's pixels are of another kind");
        let first = header + 12 * colors;
        let pixel = |i: usize| {
            let at = first + i / width * line + i % width * 4;
            [bytes[at + 2], bytes[at + 1], bytes[at]]
        };
        (0..width * height).map(pixel).collect()
    }

    pub fn end(&self) {
        let server = &mut self.server.borrow_mut().0;
        server.kill().unwrap();
        server.wait().unwrap();
    }
}
