//! What a bake has done so far, kept on disk every few seconds: one that is cancelled, by Ctrl-C or a power cut, goes on from
//! there. The file is replaced whole, so it is never half-written, and goes once the bake is done.

use crate::error::Result;
use crate::field::file;
use crate::gpu::Buffer;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::path::PathBuf;
use std::time::{Duration, Instant};

const MAGIC: [u8; 8] = *b"SHPART\n\0";
/// Time between two savings: what a cancelled bake loses at most; a saving takes milliseconds.
const INTERVAL: Duration = Duration::from_secs(2);

/// Samples of one bake, in the order of capture.
pub struct Partial {
    path: Option<PathBuf>,
    saved: Cell<Instant>,
    interval: Duration,
}

#[derive(Serialize, Deserialize)]
struct Header {
    /// Targets that are captured.
    done: u32,
    /// Targets in all.
    all: u32,
    floats: usize,
}

impl Partial {
    /// Kept at `path`, which is named by everything that decides the samples; without one, nothing is kept.
    pub fn new(path: Option<PathBuf>) -> Self {
        Partial { path, saved: Cell::new(Instant::now()), interval: INTERVAL }
    }

    /// As [`Partial::new`], saving whenever it can.
    pub fn eager(path: PathBuf) -> Self {
        Partial { interval: Duration::ZERO, ..Self::new(Some(path)) }
    }

    /// Puts what was kept into `samples`, of which `floats` are in use; returns how many of `all` targets it holds.
    ///
    /// # Errors
    /// `Device` when memory ran out. A file that does not fit is as good as none.
    pub fn load(&self, samples: &mut Buffer, floats: usize, all: u32) -> Result<u32> {
        let Some(path) = self.path.as_ref().filter(|path| path.exists()) else { return Ok(0) };
        match file::read::<Header>(path, MAGIC) {
            Ok((header, payload))
                if (header.all, header.floats) == (all, floats)
                    && header.done <= all
                    && payload.len() == 4 * floats =>
            {
                samples.fill(0, &payload)?;
                log::info!("{}: going on after {} of {all} samples", path.display(), header.done);
                Ok(header.done)
            }
            Ok(_) => Ok(0),
            Err(error) => {
                log::warn!("{error}; baking from the start");
                Ok(0)
            }
        }
    }

    /// Keeps the samples after `done` of `all` targets, if it is time.
    pub fn save(&self, samples: &Buffer, floats: usize, done: u32, all: u32) {
        let Some(path) = self.path.as_ref().filter(|_| done < all && self.saved.get().elapsed() >= self.interval)
        else {
            return;
        };
        self.saved.set(Instant::now());
        let kept = samples
            .download::<f32>(floats)
            .and_then(|values| file::write(path, MAGIC, &Header { done, all, floats }, bytemuck::cast_slice(&values)));
        if let Err(error) = kept {
            log::warn!("{error}; a cancelled bake would start anew");
        }
    }

    /// The bake is done.
    pub fn remove(&self) {
        if let Some(path) = self.path.as_ref().filter(|path| path.exists())
            && let Err(error) = std::fs::remove_file(path)
        {
            log::warn!("{}: cannot be removed: {error}", path.display());
        }
    }
}
