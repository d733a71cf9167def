//! The state as a scene file that `render` turns into the same picture.

use super::editor::Editor;
use crate::asset::embedded;
use crate::error::{Error, Result};
use crate::files;
use crate::scene::Data;
use std::path::{Path, PathBuf};

/// What is added to a scene's name, so that its own file and its comments stay.
const SUFFIX: &str = "-edited";

impl Editor {
    /// Where [`Editor::save`] writes unless told otherwise: `NAME-edited.toml` beside the scene's file, or in the current folder
    /// for a built-in scene; with the next free number where there is such a file that this editor did not write. An edited
    /// scene that was opened is written over.
    pub fn save_path(&self) -> PathBuf {
        let own = self.path().exists();
        let folder = if own { self.path().parent() } else { None }.unwrap_or(Path::new(""));
        let stem = self.path().file_stem().unwrap_or_default().to_string_lossy();
        let name = unedited(&stem);
        if own && name != stem {
            return folder.join(format!("{stem}.toml"));
        }
        let numbered = |number: u32| match number {
            1 => folder.join(format!("{name}{SUFFIX}.toml")),
            _ => folder.join(format!("{name}{SUFFIX}-{number}.toml")),
        };
        let usable = |path: &PathBuf| self.saved.contains(path) || !path.exists();
        (1..).map(numbered).find(usable).expect("numbers do not end")
    }

    /// The state as scene data for a file in `folder`: placed, lit, seen, sized and timed as now, so that its first picture is
    /// the one that is shown. Files that it names are found from there; those of built-in scenes by their built-in names.
    ///
    /// # Errors
    /// `Failed` where the path of a file is no UTF-8.
    pub fn data(&self, folder: &Path) -> Result<Data> {
        let mut data = self.scene().data.clone();
        [data.output.width, data.output.height] = self.size();
        data.output.time_s = self.time_s();
        let from = self.path().parent().unwrap_or(Path::new(""));
        let files = data.meshes.iter_mut().filter_map(|m| m.file.as_mut());
        for file in files.chain(data.environment.image.iter_mut().map(|image| &mut image.file)) {
            *file = found_from(folder, from, file);
            if file.to_str().is_none() {
                return Err(Error::Failed(format!("{}: a scene file can only name UTF-8 paths", file.display())));
            }
        }
        Ok(data)
    }

    /// Writes the state as a scene file.
    ///
    /// # Errors
    /// `Failed` where it cannot be written; an older file is left as it was then.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        let data = self.data(path.parent().unwrap_or(Path::new("")))?;
        let text = format!(
            "# Written by shadow-fields view; `shadow-fields render` gives the same picture.\n\n{}",
            data.to_toml()
        );
        files::replace_with(path, |file| file.write_all(text.as_bytes()))
            .map_err(|error: std::io::Error| Error::Failed(format!("{}: cannot write: {error}", path.display())))?;
        self.saved.insert(path.to_owned());
        Ok(())
    }
}

/// A name without what [`Editor::save_path`] adds to it.
pub(super) fn unedited(stem: &str) -> &str {
    let number = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let marked = if number.len() < stem.len() { number.strip_suffix('-') } else { Some(stem) };
    marked.and_then(|marked| marked.strip_suffix(SUFFIX)).unwrap_or(stem)
}

/// How a file that a scene in `from` calls `file` is called by a scene in `to`.
fn found_from(to: &Path, from: &Path, file: &Path) -> PathBuf {
    let here = |folder: &Path| std::path::absolute(folder).and_then(|f| f.canonicalize()).ok();
    let full = from.join(file);
    match full.canonicalize() {
        Ok(_) if here(to).is_some() && here(to) == here(from) => file.to_owned(),
        Ok(full) => here(to).and_then(|to| full.strip_prefix(to).ok().map(Path::to_owned)).unwrap_or(full),
        // Not on disk, so it was read from the binary: under its own name, or where the built-in scene stands.
        Err(_) if embedded::find(file).is_some() => file.to_owned(),
        Err(_) => embedded::name(&full).map_or(full, PathBuf::from),
    }
}
