//! Scenes and meshes that a command is given: of this program's own formats, or glTF.

use super::{Global, output};
use crate::asset::Mesh;
use crate::error::{Error, Result};
use crate::scene::{self, Scene, gltf::Notes};
use clap::Args;
use std::path::Path;

/// Options of commands that read glTF.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "glTF files (.glb, .gltf)")]
pub struct GltfArguments {
    /// End with exit code 4 if anything in a glTF file is left out; by default each kind is only listed
    #[arg(long)]
    pub strict: bool,
}

impl GltfArguments {
    /// Reads a scene file or a glTF file, and says what is left out of the latter.
    pub fn scene(self, global: &Global, path: &Path) -> Result<Scene> {
        let (scene, notes) = Scene::load_with_notes(path)?;
        self.tell(global, path, &notes)?;
        Ok(scene)
    }

    /// Reads an OBJ file or all triangles of a glTF file, and says what is left out of the latter.
    pub fn mesh(self, global: &Global, path: &Path) -> Result<Mesh> {
        let (mesh, notes) = scene::load_mesh(path)?;
        self.tell(global, path, &notes)?;
        Ok(mesh)
    }

    fn tell(self, global: &Global, path: &Path, notes: &Notes) -> Result<()> {
        let left_out = notes.left_out();
        if self.strict && !left_out.is_empty() {
            return Err(Error::input(path, format!("--strict: {}", left_out.join("; "))));
        }
        for line in left_out.iter().chain(notes.said()) {
            output::note(global, format!("note: {}: {line}", path.display()));
        }
        Ok(())
    }
}
