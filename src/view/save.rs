//! Saves the state as a scene file from which `render` makes the same picture.

use super::editor::Editor;
use crate::error::{Error, Result};
use crate::scene::Data;
use std::path::{Path, PathBuf};

/// Suffix of a saved scene's name, so that the original file with its comments is kept.
const SUFFIX: &str = "-edited";

impl Editor {
    /// Default path of [`Editor::save`]: `NAME-edited.toml` beside the scene's file, or in the current folder for a
    /// built-in scene. If another program wrote such a file, the name gets the next free number. An edited scene that
    /// was opened is overwritten.
    pub fn save_path(&self) -> PathBuf {
        let stem = self.stem();
        if self.path().exists() && unedited(&stem) != stem {
            return self.folder().join(format!("{stem}.toml"));
        }
        self.numbered(&self.folder(), |path| self.saved.contains(path) || !path.exists())
    }

    /// Path of a file in `folder` that does not exist yet, named as [`Editor::save_path`] does.
    pub(super) fn unused_path(&self, folder: &Path) -> PathBuf {
        self.numbered(folder, |path| !path.exists())
    }

    /// The folder of [`Editor::save_path`].
    pub(super) fn folder(&self) -> PathBuf {
        if self.path().exists() { self.path().parent().unwrap_or(Path::new("")).to_owned() } else { PathBuf::new() }
    }

    fn stem(&self) -> String {
        self.path().file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// `NAME-edited.toml` in `folder`, or the first with a number that is `usable`.
    fn numbered(&self, folder: &Path, usable: impl Fn(&PathBuf) -> bool) -> PathBuf {
        let stem = self.stem();
        let name = unedited(&stem);
        let path = |number: u32| match number {
            1 => folder.join(format!("{name}{SUFFIX}.toml")),
            _ => folder.join(format!("{name}{SUFFIX}-{number}.toml")),
        };
        (1..).map(path).find(usable).expect("numbers do not end")
    }

    /// The current state as scene data for a file in `folder`, so that its first picture is the one shown now. Paths in
    /// it are relative to `folder`; files of built-in scenes keep their built-in names.
    pub fn data(&self, folder: &Path) -> Data {
        let mut data = self.scene().data.clone();
        [data.output.width, data.output.height] = self.size();
        data.output.time_s = self.time_s;
        let from = self.path().parent().unwrap_or(Path::new(""));
        data.move_files(from, folder);
        data
    }

    /// Writes the state as a scene file.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        let data = self.data(path.parent().unwrap_or(Path::new("")));
        let head = "Written by shadow-fields view; `shadow-fields render` gives the same picture.";
        data.write(path, head).map_err(|error| match error {
            Error::Input(message) => Error::Failed(message),
            other => other,
        })?;
        self.saved.insert(path.to_owned());
        self.kept = self.scene().data.clone();
        Ok(())
    }

    /// Whether the scene was edited since it was opened or saved. A camera that moved is no edit.
    pub fn is_edited(&self) -> bool {
        let now = &self.scene().data;
        *now != Data { camera: now.camera.clone(), ..self.kept.clone() }
    }

    /// Writes every edited scene, this one and the one that undo would return to, to a file that does not exist yet:
    /// beside the scene's own file as [`Editor::save_path`] names it, or in the folder of temporary files if that
    /// cannot be written. Returns the paths, which is none where nothing was edited.
    pub fn rescue(&mut self) -> Result<Vec<PathBuf>> {
        let mut paths = match &mut self.former {
            Some(former) => former.rescue()?,
            None => Vec::new(),
        };
        if self.is_edited() {
            let first = self.unused_path(&self.folder());
            let path = match self.save(&first) {
                Ok(()) => first,
                Err(error) => {
                    let second = self.unused_path(&std::env::temp_dir());
                    self.save(&second).map_err(|_| error)?;
                    second
                }
            };
            paths.push(path);
        }
        Ok(paths)
    }

    /// Saves edits before an error ends the window, and adds to its message where.
    pub fn rescued(&mut self, error: Error) -> Error {
        match self.rescue() {
            Ok(paths) if paths.is_empty() => error,
            Ok(paths) => {
                let paths: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
                error.followed_by(format!("the edited scene was saved as {}", paths.join(" and ")))
            }
            Err(lost) => error.followed_by(format!("the edited scene could not be saved: {lost}")),
        }
    }
}

/// A name without the suffix and number that [`Editor::save_path`] adds.
pub(super) fn unedited(stem: &str) -> &str {
    let number = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let marked = if number.len() < stem.len() { number.strip_suffix('-') } else { Some(stem) };
    marked.and_then(|marked| marked.strip_suffix(SUFFIX)).unwrap_or(stem)
}
