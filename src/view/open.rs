//! Files that are dropped on the window, and the window's end: neither loses edits in silence.

use super::editor::add_sky;
use super::viewer::Viewer;
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::truth::exposure;
use std::path::Path;

impl Viewer {
    /// Shows another scene in place of this one: a scene file, a glTF file or an OBJ file, such as one that was dropped
    /// on the window. What is left out of it is said. A file that cannot be opened is one line over the picture, and
    /// the scene stays. Edits that are not saved are kept: undo returns to them, and a line says so.
    pub fn open(&mut self, path: &Path) -> Result<()> {
        let (scene, notes) = match self.read(path) {
            Ok(read) => read,
            Err(error) => {
                self.insist(format!("not opened: {error}"));
                return Ok(());
            }
        };
        notes.iter().for_each(|note| self.insist(format!("{}: {note}", path.display())));
        let effect = self.editor.open(scene, path);
        self.insist(format!("opened {}", path.display()));
        effect.message.into_iter().for_each(|message| self.insist(message));
        self.input.commands(super::input::Event::Lost, &self.editor);
        self.follow(effect.changed)
    }

    /// A scene, and what a reader of its glTF file has to know.
    fn read(&self, path: &Path) -> Result<(Scene, Vec<String>)> {
        let (mut scene, notes) = Scene::load_with_notes(path, &crate::scene::gltf::Options::default())?;
        let left_out = notes.left_out();
        if self.setup.strict && !left_out.is_empty() {
            return Err(Error::input(path, format!("--strict: {}", left_out.join("; "))));
        }
        add_sky(&mut scene);
        let [width, height] = self.size.map(f64::from);
        scene.fit_added_camera(width / height);
        let time_s = scene.data.output.time_s;
        let exposed = exposure::settle(&mut scene, time_s, width / height);
        Ok((scene, left_out.into_iter().chain(notes.said().iter().cloned()).chain(exposed).collect()))
    }

    /// Ends the window, at the second time if there are edits that are not saved.
    pub(super) fn close(&mut self) {
        let unsaved = self.editor.unsaved();
        if unsaved.is_empty() || self.asked_to_close {
            self.quit = true;
            return;
        }
        let unsaved: Vec<String> = unsaved.iter().map(|path| path.display().to_string()).collect();
        self.asked_to_close = true;
        self.insist(format!("unsaved edits of {}: Ctrl-S saves, Ctrl-Q again closes without", unsaved.join(" and ")));
    }
}
