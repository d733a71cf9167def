//! Compilations in progress. A shader of seven bands takes a minute, so a terminal can show what it
//! waits for.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

static NOW: Mutex<Vec<(String, Instant)>> = Mutex::new(Vec::new());

fn now() -> MutexGuard<'static, Vec<(String, Instant)>> {
    NOW.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Lists something as being compiled while it lives.
pub(super) struct Compiling((String, Instant));

impl Compiling {
    pub(super) fn new(kind: &str, name: &str) -> Self {
        let entry = (format!("{kind} {name}"), Instant::now());
        now().push(entry.clone());
        Compiling(entry)
    }
}

impl Drop for Compiling {
    fn drop(&mut self) {
        let mut now = now();
        if let Some(at) = now.iter().position(|entry| *entry == self.0) {
            now.remove(at);
        }
    }
}

/// The longest compilation in progress, and its start.
pub fn longest() -> Option<(String, Instant)> {
    now().iter().min_by_key(|(_, since)| *since).cloned()
}
