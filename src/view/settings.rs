//! What the window remembers from one start to the next: which of its panels are unfolded.

use crate::asset::read_file;
use crate::files;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Largest file of settings that is read, in bytes.
const LIMIT_BYTES: u64 = 1 << 16;

/// Which panels are unfolded. The default is that of the first start, which shows the list of keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// The list of keys.
    pub keys: bool,
    /// The figures.
    pub figures: bool,
    /// The part of the figures that few people need.
    pub details: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { keys: true, figures: true, details: false }
    }
}

impl Settings {
    /// Reads the settings for a start. Where there is no file, or none that can be read, this is a first start: it gets the default,
    /// and the list of keys is folded from the next one on.
    pub fn start(file: &Path) -> Self {
        let read = read_file(file, LIMIT_BYTES).ok().and_then(|bytes| toml::from_slice(&bytes).ok());
        read.unwrap_or_else(|| {
            let first = Settings::default();
            Settings { keys: false, ..first }.keep(file);
            first
        })
    }

    /// These settings with the panels that were folded or unfolded since `before`.
    pub fn changed(self, before: Self, now: Self) -> Self {
        let pick = |kept, before, now| if before == now { kept } else { now };
        Settings {
            keys: pick(self.keys, before.keys, now.keys),
            figures: pick(self.figures, before.figures, now.figures),
            details: pick(self.details, before.details, now.details),
        }
    }

    /// Writes the settings. Where that is not possible, they are forgotten.
    pub fn keep(self, file: &Path) {
        let kept = toml::to_string(&self).map_err(|error| error.to_string());
        let kept = kept.and_then(|text| files::replace(file, text.as_bytes()).map_err(|error| error.to_string()));
        if let Err(error) = kept {
            log::warn!("{}: the window's settings cannot be kept: {error}", file.display());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_keys_is_unfolded_once_and_choices_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/window.toml");
        assert_eq!(Settings::start(&file), Settings::default());
        assert!(Settings::default().keys);
        let second = Settings { keys: false, ..Settings::default() };
        assert_eq!([Settings::start(&file), Settings::start(&file)], [second; 2]);
        // A window too small for the figures folds them, which is nobody's choice; unfolding the details is one.
        let small = Settings { figures: false, ..second };
        let unfolded = Settings { details: true, ..small };
        assert_eq!(second.changed(small, unfolded), Settings { details: true, ..second });
        let chosen = Settings { keys: true, figures: false, details: true };
        chosen.keep(&file);
        assert_eq!(Settings::start(&file), chosen);
        // Keys of a later version are passed over, and those that are missing have their defaults.
        std::fs::write(&file, "figures = false\ncolour = 3\n").unwrap();
        assert_eq!(Settings::start(&file), Settings { figures: false, ..Settings::default() });
    }

    #[test]
    fn a_bad_file_counts_as_none_and_one_that_cannot_be_written_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("window.toml");
        for bad in [&b"keys = 3"[..], b"keys", b"\xff\x00", &vec![b'#'; 1 << 17]] {
            std::fs::write(&file, bad).unwrap();
            assert_eq!(Settings::start(&file), Settings::default());
        }
        // A folder where the file should be.
        assert_eq!(Settings::start(folder.path()), Settings::default());
        Settings::default().keep(Path::new("/dev/null/window.toml"));
    }
}
