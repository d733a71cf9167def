//! Changes from one scene to another. A scene that was edited is kept, and undo returns to it.

use super::command::{Changed, Effect};
use super::editor::Editor;
use super::pick::unbuilt_shapes;
use crate::asset::{Mesh, embedded};
use crate::error::Result;
use crate::scene::Scene;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest number of changed scenes to which undo returns, one after the other.
pub const FORMER_LIMIT: usize = 16;

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
            Err(error) => Effect { message: Some(error.to_string()), ..Effect::default() },
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
}
