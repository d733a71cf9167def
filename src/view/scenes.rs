//! Changes from one scene to another. A scene that was edited is kept, and undo returns to it.

use super::command::{Changed, Effect};
use super::editor::Editor;
use crate::asset::embedded;
use crate::error::Result;
use crate::scene::Scene;
use std::path::{Path, PathBuf};

impl Editor {
    /// Shows another scene in place of this one. If there are edits of this one that are not saved, the message says how to return.
    pub fn open(&mut self, scene: Scene, path: &Path) -> Effect {
        let message = self
            .is_edited()
            .then(|| format!("the edits of {} are not saved: Ctrl-Z returns to them", self.path().display()));
        let former = self.replace(Editor::new(scene, path));
        // Z is easily pressed instead of Ctrl-Z, and a file dropped by mistake.
        let changed = former.undo_count() > 0 || former.is_edited();
        self.former = if changed { Some(Box::new(former)) } else { former.former };
        Effect { changed: Changed { scene: true, ..Changed::default() }, message, request: None }
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
            Err(error) => Effect { message: Some(error.to_string()), ..Effect::default() },
        }
    }

    /// Returns to the last scene before this one that was changed.
    pub(super) fn return_to_former(&mut self) -> Option<Effect> {
        let former = self.former.take()?;
        self.replace(*former);
        let message = Some(format!("back to {}", self.path().display()));
        Some(Effect { changed: Changed { scene: true, ..Changed::default() }, message, request: None })
    }

    /// The next built-in scene; the first one if this is not a built-in scene.
    fn load_next(&self) -> Result<(Scene, PathBuf)> {
        let scenes = embedded::scenes();
        let now = self.path().file_stem().and_then(|stem| scenes.iter().position(|(name, _)| stem == *name));
        let (name, text) = scenes[now.map_or(0, |now| (now + 1) % scenes.len())];
        let path = Path::new(embedded::ROOT).join("scenes").join(name).with_extension("toml");
        Ok((Scene::parse(text, &path, &embedded::read)?, path))
    }
}
