//! Writes scenes as files.

use super::FILE_LIMIT_BYTES;
use super::data::Data;
use crate::asset::{check_size, embedded};
use crate::error::{Error, Result};
use crate::files;
use std::path::{Path, PathBuf};

impl Data {
    /// Makes the names of files, which are relative to the folder `from`, relative to `to`. Files of built-in scenes keep
    /// their built-in names.
    pub fn move_files(&mut self, from: &Path, to: &Path) {
        self.files_mut().for_each(|file| *file = found_from(to, from, file));
    }

    /// All names of files.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let meshes = self.meshes.iter_mut().filter_map(|mesh| mesh.file.as_mut());
        let textures = self.textures.iter_mut().filter_map(|texture| texture.file.as_mut());
        meshes.chain(textures).chain(self.environment.image.as_mut().map(|image| &mut image.file))
    }

    /// Writes the scene as a file with the comment `head` (without `#`) in its first line.
    ///
    /// # Errors
    /// [`Error::Failed`] where it cannot be written, or where the path of a file is not UTF-8.
    pub fn write(&self, path: &Path, head: &str) -> Result<()> {
        let text = format!("# {head}\n\n{}", self.to_toml()?);
        check_size(path, text.len(), FILE_LIMIT_BYTES, "scene")?;
        Data::parse(&text, path)?;
        files::replace_with(path, |file| file.write_all(text.as_bytes()))
            .map_err(|error: std::io::Error| Error::Failed(format!("{}: cannot be written: {error}", path.display())))
    }
}

/// Converts a path `file` of a scene in folder `from` to a path for a scene in folder `to`.
fn found_from(to: &Path, from: &Path, file: &Path) -> PathBuf {
    let here = |folder: &Path| if folder == Path::new("") { Path::new(".") } else { folder }.canonicalize().ok();
    let full = from.join(file);
    match full.canonicalize() {
        Ok(_) if here(to).is_some() && here(to) == here(from) => file.to_owned(),
        Ok(full) => here(to).and_then(|to| full.strip_prefix(to).ok().map(Path::to_owned)).unwrap_or(full),
        // A file that is not on disk is embedded, under its own name or relative to the built-in scene.
        Err(_) if embedded::find(file).is_some() => file.to_owned(),
        Err(_) => embedded::name(&full).map_or(full, PathBuf::from),
    }
}
