//! Messages to the user, which stand over the picture for a while.

use super::command::Changed;
use super::viewer::{Message, Viewer};
use crate::error::{Error, Result};
use std::time::{Duration, Instant};

/// Time for which a message is shown.
const SHOWN: Duration = Duration::from_secs(6);

impl Viewer {
    /// The last message to the user.
    pub fn message(&self) -> Option<&str> {
        self.messages.back().map(|message| message.text.as_str())
    }

    /// The messages that are shown, oldest first.
    pub fn messages(&self) -> Vec<&str> {
        let shown = self.messages.iter().filter(|message| message.insists || self.editor.overlay);
        shown.map(|message| message.text.as_str()).collect()
    }

    pub(super) fn say(&mut self, message: Option<String>) {
        if let Some(text) = message {
            self.add(text, false);
        }
    }

    /// As [`Viewer::say`], also where the overlay is hidden.
    pub fn insist(&mut self, text: String) {
        self.add(text, true);
    }

    fn add(&mut self, text: String, insists: bool) {
        log::info!("message: {text}");
        self.messages.push_back(Message { since: Instant::now(), text, insists });
        self.pending |= Changed { display: true, ..Changed::default() };
    }

    /// Forgets messages that were shown long enough. Returns whether there were any.
    pub(super) fn forget_messages(&mut self) -> bool {
        let count = self.messages.len();
        self.messages.retain(|message| message.since.elapsed() < SHOWN);
        count != self.messages.len()
    }

    /// Returns `Device` and `Unsupported` errors; all other errors become messages.
    pub(super) fn tolerate<T>(&mut self, outcome: Result<T>) -> Result<Option<T>> {
        match outcome {
            Ok(value) => Ok(Some(value)),
            Err(error @ (Error::Device(_) | Error::Unsupported(_))) => Err(error),
            Err(error) => {
                self.say(Some(error.to_string()));
                Ok(None)
            }
        }
    }
}
