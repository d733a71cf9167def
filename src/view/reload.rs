//! Polls a folder for changed shader files, by modification time and length.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

const PERIOD: Duration = Duration::from_millis(250);

type Stamps = BTreeMap<String, (Option<SystemTime>, u64)>;

pub struct Watch {
    folder: PathBuf,
    stamps: Stamps,
    looked: Instant,
}

impl Watch {
    /// Starts watching; the present files count as compiled.
    pub fn new(folder: &Path) -> Self {
        Watch { folder: folder.to_owned(), stamps: stamps(folder), looked: Instant::now() }
    }

    /// The files that changed since the last poll, if any did.
    pub fn poll(&mut self) -> Option<Vec<String>> {
        if self.looked.elapsed() < PERIOD {
            return None;
        }
        self.looked = Instant::now();
        let now = stamps(&self.folder);
        let names: BTreeSet<&String> = now.keys().chain(self.stamps.keys()).collect();
        let changed: Vec<String> =
            names.into_iter().filter(|name| now.get(*name) != self.stamps.get(*name)).cloned().collect();
        self.stamps = now;
        (!changed.is_empty()).then_some(changed)
    }
}

fn stamps(folder: &Path) -> Stamps {
    let Ok(entries) = std::fs::read_dir(folder) else { return Stamps::new() };
    let stamp = |entry: std::fs::DirEntry| {
        let metadata = entry.metadata().ok().filter(std::fs::Metadata::is_file)?;
        Some((entry.file_name().into_string().ok()?, (metadata.modified().ok(), metadata.len())))
    };
    entries.flatten().filter_map(stamp).collect()
}
