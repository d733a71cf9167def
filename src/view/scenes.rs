//! Scenes: opened one after another, saved as files from which `render` makes the same picture, and rescued.

use super::command::{Changed, Effect};
use super::editor::Editor;
use crate::asset::embedded;
use crate::error::{Error, Result};
use crate::scene::{Data, Scene};
use std::path::{Path, PathBuf};

/// Suffix of a saved scene's name, so that the original file with its comments is kept.
const SUFFIX: &str = "-edited";

impl Editor {
    /// Shows another scene in place of this one, whose edits are lost unless they are saved.
    pub fn open(&mut self, scene: Scene, path: &Path) -> Effect {
        self.replace(Editor::new(scene, path));
        Changed { scene: true, ..Changed::default() }.into()
    }

    pub(super) fn next_scene(&mut self) -> Effect {
        match self.load_next() {
            Ok((scene, path)) => self.open(scene, &path),
            Err(error) => Effect::said(error.to_string()),
        }
    }

    /// The next built-in scene; the first one if this is not a built-in scene.
    fn load_next(&self) -> Result<(Scene, PathBuf)> {
        let scenes = embedded::scenes();
        let now = self.path().file_stem().and_then(|stem| scenes.iter().position(|(name, _)| stem == *name));
        let (name, text) = scenes[now.map_or(0, |now| (now + 1) % scenes.len())];
        let path = Path::new(embedded::ROOT).join("scenes").join(name).with_extension("toml");
        Ok((Scene::parse(text, &path, &embedded::read)?, path))
    }

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
        [data.output.width, data.output.height] = self.window();
        data.output.time_s = self.time_s;
        let from = self.path().parent().unwrap_or(Path::new(""));
        data.move_files(from, folder);
        data
    }

    pub fn save(&mut self, path: &Path) -> Result<()> {
        let data = self.data(path.parent().unwrap_or(Path::new("")));
        let head = "Written by shadow-fields view; `shadow-fields render` gives the same picture.";
        data.write(path, head).map_err(Error::unwritten)?;
        self.saved.insert(path.to_owned());
        self.kept = self.scene().data.clone();
        Ok(())
    }

    /// Whether the scene was edited since it was opened or saved. A camera that moved is no edit.
    pub fn is_edited(&self) -> bool {
        let now = &self.scene().data;
        *now != Data { camera: now.camera.clone(), ..self.kept.clone() }
    }

    /// Writes an edited scene to a file that does not exist yet: beside the scene's own file as [`Editor::save_path`]
    /// names it, or in the folder of temporary files if that cannot be written. Returns its path, or `None` where
    /// nothing was edited.
    pub fn rescue(&mut self) -> Result<Option<PathBuf>> {
        if !self.is_edited() {
            return Ok(None);
        }
        let first = self.numbered(&self.folder(), |path| !path.exists());
        let Err(error) = self.save(&first) else { return Ok(Some(first)) };
        let second = self.numbered(&std::env::temp_dir(), |path| !path.exists());
        self.save(&second).map_err(|_| error)?;
        Ok(Some(second))
    }

    /// Saves edits before an error ends the window, and adds to its message where.
    pub fn rescued(&mut self, error: Error) -> Error {
        match self.rescue() {
            Ok(None) => error,
            Ok(Some(path)) => error.followed_by(format!("the edited scene was saved as {}", path.display())),
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
