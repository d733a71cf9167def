//! Saves edits that would be lost because the window ends by an error.

use super::editor::Editor;
use crate::error::{Error, Result};
use crate::scene::Data;
use std::path::PathBuf;

impl Editor {
    /// Whether the scene was edited since it was opened or saved. A camera that moved is no edit.
    pub fn is_edited(&self) -> bool {
        let now = &self.scene().data;
        *now != Data { camera: now.camera.clone(), ..self.kept.clone() }
    }

    /// Writes every edited scene, this one and the one that undo would return to, to a file that does not exist yet: beside the
    /// scene's own file as [`Editor::save_path`] names it, or in the folder of temporary files if that cannot be written. Returns
    /// the paths, which is none where nothing was edited.
    ///
    /// # Errors
    /// `Failed` when a scene could be written nowhere.
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

    /// What follows from an error that ends the window: edits are saved first, and the message says where.
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
