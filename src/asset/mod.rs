//! Triangle meshes, distant light and pictures.
//!
//! Everything read from a file is checked here, once: all other modules rely on a [`mesh::Mesh`] to have finite
//! numbers, indices within range and a positive size.

use std::io::Read as _;
use std::path::Path;

use crate::error::{Error, Result};

pub mod backdrop;
pub mod bars;
mod boxes;
pub mod decode;
pub mod disc;
pub mod edges;
pub mod embedded;
pub mod enclose;
pub mod environment;
pub mod equirect;
#[cfg(feature = "cli")]
pub mod false_color;
pub mod generate;
pub mod grid;
#[cfg(feature = "cli")]
pub mod lettering;
pub mod mesh;
pub mod obj;
mod outline;
mod panel;
mod peak;
pub mod picture;
pub mod pierce;
pub mod sky;
pub mod texture;
pub mod topology;

pub use generate::Generator;
pub use mesh::Mesh;

/// Fails where the content of a file is larger than what is read; `what` says what it is.
pub(crate) fn check_size(path: &Path, size: usize, limit_bytes: u64, what: &str) -> Result<()> {
    if size as u64 <= limit_bytes {
        return Ok(());
    }
    Err(Error::input(path, format!("over the limit of {} MiB for a {what} file", limit_bytes >> 20)))
}

/// The content of a file as text, as far as it is not too large.
pub(crate) fn utf8<'b>(path: &Path, bytes: &'b [u8], limit_bytes: u64, what: &str) -> Result<&'b str> {
    check_size(path, bytes.len(), limit_bytes, what)?;
    std::str::from_utf8(bytes)
        .map_err(|error| Error::input_at(path, line_of(bytes, error.valid_up_to()), "not UTF-8 text"))
}

/// The line that holds a byte of a text, counted from 1.
pub(crate) fn line_of(text: &[u8], byte: usize) -> usize {
    1 + text[..byte.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

/// Reads a file of at most `limit_bytes`, whatever length the file system reports (see [`crate::files::open`]).
pub fn read_file(path: &Path, limit_bytes: u64) -> Result<Vec<u8>> {
    let unread = |error| Error::input(path, format!("cannot be read: {error}"));
    let file = crate::files::open(path).map_err(unread)?;
    let mut bytes = Vec::new();
    // Reading one byte past the limit detects an oversized file; pipes and devices report no length.
    file.take(limit_bytes + 1).read_to_end(&mut bytes).map_err(unread)?;
    if bytes.len() as u64 > limit_bytes {
        return Err(Error::input(path, format!("over the limit of {} MiB", limit_bytes >> 20)));
    }
    Ok(bytes)
}
