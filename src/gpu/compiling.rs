//! Tells of the first shader that is compiled rather than found in the cache: some take seconds, of seven bands a
//! minute, and a terminal can say what it waits for.

use std::sync::{Mutex, PoisonError};

type Tell = Box<dyn FnOnce(&str) + Send>;

static TELL: Mutex<Option<Tell>> = Mutex::new(None);

/// Has `tell` told the name of the first shader that is compiled from now on.
pub fn tell_first(tell: impl FnOnce(&str) + Send + 'static) {
    *TELL.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(tell));
}

pub(super) fn begins(shader: &str) {
    let tell = TELL.lock().unwrap_or_else(PoisonError::into_inner).take();
    tell.into_iter().for_each(|tell| tell(shader));
}
