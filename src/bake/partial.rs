//! The samples that a bake has done so far. They are kept on disk every few seconds, so that a bake that was cancelled, by Ctrl-C or
//! by a power cut, goes on from there. The file is replaced whole, so it is never half-written. It is removed when the bake is done.

use crate::error::{Error, Result};
use crate::field::file;
use bytemuck::Pod;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

const MAGIC: [u8; 8] = *b"SHPART\n\0";
/// Time between two savings, which a cancelled bake loses at most. A saving takes milliseconds.
const INTERVAL: Duration = Duration::from_secs(2);

/// Samples of one bake, in the order of capture.
pub struct Partial {
    path: Option<PathBuf>,
    saved: Mutex<Instant>,
    interval: Duration,
}

/// Writes samples that are all captured, in their places, as a bake would keep them; it then captures none.
///
/// # Errors
/// `Failed` when the file cannot be written.
pub(super) fn write_done(path: &Path, all: u32, numbers: usize, values: &[u8]) -> Result<()> {
    file::write(path, MAGIC, &Header { done: all, all, numbers }, values)
        .map_err(|error| Error::Failed(error.to_string()))
}

#[derive(Serialize, Deserialize)]
struct Header {
    /// Number of targets that are captured.
    done: u32,
    /// Number of targets in all.
    all: u32,
    /// Numbers of all samples.
    numbers: usize,
}

impl Partial {
    /// Samples are kept at `path`, whose name is a hash of everything that decides them. Without a path nothing is kept.
    pub fn new(path: Option<PathBuf>) -> Self {
        Partial { path, saved: Mutex::new(Instant::now()), interval: INTERVAL }
    }

    /// As [`Partial::new`], but saves after every batch.
    pub fn eager(path: PathBuf) -> Self {
        Partial { interval: Duration::ZERO, ..Self::new(Some(path)) }
    }

    /// Puts what was kept into `values` and returns how many of `all` targets it holds. A file that does not fit counts as none.
    pub fn load<T: Pod>(&self, values: &mut [T], all: u32) -> u32 {
        let Some(path) = self.path.as_ref().filter(|path| path.exists()) else { return 0 };
        match file::read::<Header>(path, MAGIC) {
            Ok((header, payload))
                if (header.all, header.numbers) == (all, values.len())
                    && header.done <= all
                    && payload.len() == size_of_val(values) =>
            {
                bytemuck::cast_slice_mut::<T, u8>(values).copy_from_slice(&payload);
                log::info!("{}: going on after {} of {all} samples", path.display(), header.done);
                header.done
            }
            Ok(_) => 0,
            Err(error) => {
                log::warn!("{error}; baking from the start");
                0
            }
        }
    }

    /// Keeps the samples after `done` of `all` targets if the last saving is long enough ago.
    pub fn save<T: Pod>(&self, values: &[T], done: u32, all: u32) {
        let mut saved = self.saved.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(path) = self.path.as_ref().filter(|_| done < all && saved.elapsed() >= self.interval) else { return };
        *saved = Instant::now();
        let header = Header { done, all, numbers: values.len() };
        if let Err(error) = file::write(path, MAGIC, &header, bytemuck::cast_slice(values)) {
            log::warn!("{error}; a cancelled bake would start anew");
        }
    }

    /// Removes the file, since the bake is done.
    pub fn remove(&self) {
        if let Some(path) = self.path.as_ref().filter(|path| path.exists())
            && let Err(error) = std::fs::remove_file(path)
        {
            log::warn!("{}: cannot be removed: {error}", path.display());
        }
    }
}
