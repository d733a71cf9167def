//! What a reader of a file has to know: what was left out, with counts, and what was made of the rest.

use std::collections::BTreeMap;

/// Lines about a file that was read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes {
    left_out: BTreeMap<&'static str, usize>,
    said: Vec<String>,
}

impl Notes {
    /// Counts one more of `what`, which ends with what happens instead.
    pub fn leave_out(&mut self, what: &'static str) {
        self.leave_out_many(what, 1);
    }

    /// Counts `count` more of `what`.
    pub fn leave_out_many(&mut self, what: &'static str, count: usize) {
        if count > 0 {
            *self.left_out.entry(what).or_default() += count;
        }
    }

    /// Adds a line of what was made of something.
    pub fn say(&mut self, line: String) {
        self.said.push(line);
    }

    /// A line for each kind of thing that was left out: `left out (2): skins ...`.
    pub fn left_out(&self) -> Vec<String> {
        self.left_out.iter().map(|(what, count)| format!("left out ({count}): {what}")).collect()
    }

    /// Lines of what was made of something.
    pub fn said(&self) -> &[String] {
        &self.said
    }
}
