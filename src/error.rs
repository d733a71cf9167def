//! The one error type, and the exit code that each kind of failure ends the program with.

use std::path::Path;

/// Everything that can go wrong, grouped by what the user can do about it (see [`Error::exit_code`]).
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A comparison, check or run failed (exit code 1).
    #[error("{0}")]
    Failed(String),
    /// A shader does not compile (exit code 1). Only this message has several lines.
    #[error("{0}")]
    Shader(String),
    /// The command line is invalid (exit code 2).
    #[error("{0}")]
    Usage(String),
    /// There is no suitable device, driver, feature or display (exit code 3).
    #[error("{0}")]
    Unsupported(String),
    /// An input is missing, malformed or too large (exit code 4).
    #[error("{0}")]
    Input(String),
    /// The device was lost, or it or the host ran out of memory (exit code 5).
    #[error("{0}")]
    Device(String),
}

impl Error {
    /// Process exit code: 1 failed, 2 usage, 3 unsupported, 4 bad input, 5 device lost or out of memory.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Failed(_) | Error::Shader(_) => 1,
            Error::Usage(_) => 2,
            Error::Unsupported(_) => 3,
            Error::Input(_) => 4,
            Error::Device(_) => 5,
        }
    }

    /// The message for a terminal: on one line, unless it is a compiler's, and without control characters.
    pub fn line(&self) -> String {
        match self {
            Error::Shader(message) => message.lines().map(one_line).collect::<Vec<_>>().join("\n"),
            other => one_line(&other.to_string()),
        }
    }

    /// An error in the file `path`: one line that starts with the file.
    pub fn input(path: &Path, what: impl std::fmt::Display) -> Self {
        Error::Input(format!("{}: {what}", path.display()))
    }

    /// An error in the file `path` at a line counted from 1.
    pub fn input_at(path: &Path, line: usize, what: impl std::fmt::Display) -> Self {
        Error::Input(format!("{}:{line}: {what}", path.display()))
    }

    /// Puts the place of the error in front of its message and keeps its kind.
    pub fn context(self, place: impl std::fmt::Display) -> Self {
        self.map(|message| format!("{place}: {message}"))
    }

    /// Adds to the message what follows from the error, and keeps its kind.
    pub fn followed_by(self, what: impl std::fmt::Display) -> Self {
        self.map(|message| format!("{message}; {what}"))
    }

    /// An output that cannot be written is a run that failed, not bad input.
    pub fn unwritten(self) -> Self {
        match self {
            Error::Input(message) => Error::Failed(message),
            other => other,
        }
    }

    fn map(self, change: impl FnOnce(String) -> String) -> Self {
        match self {
            Error::Failed(m) => Error::Failed(change(m)),
            Error::Shader(m) => Error::Shader(change(m)),
            Error::Usage(m) => Error::Usage(change(m)),
            Error::Unsupported(m) => Error::Unsupported(change(m)),
            Error::Input(m) => Error::Input(change(m)),
            Error::Device(m) => Error::Device(change(m)),
        }
    }
}

/// Whether a character breaks a line, starts an escape sequence, or changes the order or the look of those around it.
pub fn is_deceptive(c: char) -> bool {
    let invisible = ['\u{61c}', '\u{200b}', '\u{200e}', '\u{200f}', '\u{feff}'].contains(&c);
    c.is_control() || invisible || ('\u{2028}'..='\u{202e}').contains(&c) || ('\u{2060}'..='\u{206f}').contains(&c)
}

/// Text with its control and bidirectional characters written as escapes: a file's name neither breaks a line nor
/// reaches the terminal as anything but text.
pub fn one_line(text: &str) -> String {
    let escaped = |c: char| if is_deceptive(c) { c.escape_default().to_string() } else { c.to_string() };
    text.chars().map(escaped).collect()
}

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;
