//! Scenes: opened one after another, saved as files from which `render` makes the same picture, and rescued. A scene that
//! was edited is kept when another opens, and undo returns to it.

use super::command::{Changed, Effect};
use super::editor::Editor;
use super::pick::unbuilt_shapes;
use crate::asset::{Mesh, embedded};
use crate::error::{Error, Result};
use crate::scene::{Data, Scene};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest number of changed scenes to which undo returns, one after the other.
pub const FORMER_LIMIT: usize = 16;
/// Suffix of a saved scene's name, so that the original file with its comments is kept.
const SUFFIX: &str = "-edited";

impl Editor {
    /// Shows another scene in place of this one. If there are edits of this one that are not saved, the message says
    /// how to return. Beyond [`FORMER_LIMIT`] scenes the oldest one goes: its edits are saved, and the message says
    /// where.
    pub fn open(&mut self, mut scene: Scene, path: &Path) -> Effect {
        self.share_meshes(&mut scene);
        let message = self
            .is_edited()
            .then(|| format!("the edits of {} are not saved: Ctrl-Z returns to them", self.path().display()));
        let mut former = self.replace(Editor::new(scene, path));
        former.shapes = unbuilt_shapes(&former.scene);
        // Z is easily pressed instead of Ctrl-Z, and a file dropped by mistake.
        let changed = former.undo_count() > 0 || former.is_edited();
        self.former = if changed { Some(Box::new(former)) } else { former.former };
        let message = self.let_go_of_oldest().or(message);
        Effect { changed: Changed { scene: true, ..Changed::default() }, message }
    }

    /// Takes meshes of this scene for equal ones of the next, as a scene that is opened again has them.
    fn share_meshes(&self, next: &mut Scene) {
        for mesh in &mut next.meshes {
            let is_same = |own: &&Arc<Mesh>| own.content_hash() == mesh.content_hash() && own == &mesh;
            if let Some(own) = self.scene.meshes.iter().find(is_same) {
                *mesh = own.clone();
            }
        }
    }

    /// Drops the oldest scene beyond the limit. One whose edits can be saved nowhere stays.
    fn let_go_of_oldest(&mut self) -> Option<String> {
        let mut last = self;
        for _ in 0..FORMER_LIMIT {
            last = last.former.as_deref_mut()?;
        }
        let mut oldest = last.former.take()?;
        match oldest.rescue() {
            Ok(paths) => {
                let path = paths.first()?;
                Some(format!("the edits of {} were saved as {}", oldest.path().display(), path.display()))
            }
            Err(error) => {
                last.former = Some(oldest);
                Some(error.to_string())
            }
        }
    }

    /// The files of scenes, this one and those that undo would return to, with edits that are not saved.
    pub fn unsaved(&self) -> Vec<&Path> {
        let mut paths = self.former.as_ref().map_or(Vec::new(), |former| former.unsaved());
        paths.extend(self.is_edited().then_some(self.path()));
        paths
    }

    pub(super) fn next_scene(&mut self) -> Effect {
        match self.load_next() {
            Ok((scene, path)) => self.open(scene, &path),
            Err(error) => Effect::said(error.to_string()),
        }
    }

    /// Returns to the last scene before this one that was changed.
    pub(super) fn return_to_former(&mut self) -> Option<Effect> {
        let former = self.former.take()?;
        self.replace(*former);
        let message = Some(format!("back to {}", self.path().display()));
        Some(Effect { changed: Changed { scene: true, ..Changed::default() }, message })
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
        [data.output.width, data.output.height] = self.size();
        data.output.time_s = self.time_s;
        let from = self.path().parent().unwrap_or(Path::new(""));
        data.move_files(from, folder);
        data
    }

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
            let first = self.numbered(&self.folder(), |path| !path.exists());
            let path = match self.save(&first) {
                Ok(()) => first,
                Err(error) => {
                    let second = self.numbered(&std::env::temp_dir(), |path| !path.exists());
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
