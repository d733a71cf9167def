//! Scenes and meshes that a command is given: of this program's own formats, or glTF.

use super::{Global, output};
use crate::asset::Mesh;
use crate::error::{Error, Result};
use crate::scene::{self, Scene, Surroundings, gltf::Notes};
use crate::text::number;
use crate::truth::exposure;
use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::path::Path;

/// Options of how a scene looks that its file does not say.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Look")]
pub struct LookArguments {
    /// Distant light in place of the scene's, its suns included: daylight, studio (soft, from above), none, or an
    /// equirectangular picture (.hdr, .exr or .png). Default: the scene's own; a glTF file without light gets daylight,
    /// and one with lights a dim sky beside them
    #[arg(long, value_name = "daylight|studio|none|FILE", value_parser = OsStringValueParser::new().try_map(|name| Surroundings::parse(&name)))]
    pub environment: Option<Surroundings>,
    /// Stops by which pictures are brighter, -32 to 32, than the scene's exposure makes them. A scene that states none,
    /// or whose light --environment replaces, has one from the light of its first picture
    #[arg(long, default_value_t = 0.0, value_name = "EV", value_parser = number::<f32>(-32.0..=32.0), allow_negative_numbers = true)]
    pub exposure: f32,
}

impl LookArguments {
    /// The picture of distant light, if it is one.
    pub fn picture(&self) -> Option<&Path> {
        match &self.environment {
            Some(Surroundings::Picture(file)) => Some(file),
            _ => None,
        }
    }

    /// Gives a scene its light, its camera where that was added, and its exposure for pictures of that size in pixels,
    /// the first of which is at `time_s`.
    pub fn apply(&self, global: &Global, path: &Path, scene: &mut Scene, size: [u32; 2], time_s: f64) -> Result<()> {
        if let Some(environment) = &self.environment {
            scene.surround(environment)?;
        }
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        scene.fit_added_camera(aspect);
        if let Some(said) = exposure::settle(scene, time_s, aspect) {
            output::note(global, format!("note: {}: {said} (--exposure changes it)", path.display()));
        }
        let exposure_ev = (scene.data.output.exposure_ev() + self.exposure).clamp(-32.0, 32.0);
        scene.data.output.exposure_ev = Some(exposure_ev);
        Ok(())
    }
}

/// Options of commands that read glTF.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "glTF files (.glb, .gltf)")]
pub struct GltfArguments {
    /// End with exit code 4 if anything in a glTF file is left out; by default each kind is only listed
    #[arg(long)]
    pub strict: bool,
}

/// Options of commands that read glTF files as scenes.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "glTF files (.glb, .gltf)")]
pub struct GltfSceneArguments {
    #[command(flatten)]
    pub gltf: GltfArguments,
    /// The camera, or the node that holds it, that a glTF file's picture is seen from. Default: the first with
    /// perspective
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
}

impl GltfSceneArguments {
    /// Reads a scene file or a glTF file, and says what is left out of the latter. Skins and morph targets stand in
    /// their pose at `time_s`.
    pub fn scene(&self, global: &Global, path: &Path, time_s: f64) -> Result<Scene> {
        if self.camera.is_some() && !scene::gltf::is_gltf(path) {
            return Err(Error::Usage(format!("{}: --camera is for glTF files", path.display())));
        }
        let options = scene::gltf::Options { time_s, camera: self.camera.clone() };
        let (scene, notes) = Scene::load_with_notes(path, &options)?;
        self.gltf.tell(global, path, &notes)?;
        Ok(scene)
    }
}

impl GltfArguments {
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
