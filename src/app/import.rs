//! `shadow-fields import` writes a glTF or OBJ file as a scene file.

use super::outputs::{self, Output};
use super::source::GltfSceneArguments;
use super::{Global, output};
use crate::error::{Error, Result, one_line};
use crate::files;
use crate::scene::{self, Scene, gltf, single};
use crate::text::number;
use clap::Args;
use serde_json::json;
use std::io::Read;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(
    after_help = "The scene file can be edited like any other; it names the glTF or OBJ file for meshes and textures, which has to stay. \
    `render` gives the same picture of both. What has no form in a scene file is left out, with a line for each kind.\n\n\
    Example:\n  shadow-fields import robot.glb -o robot.toml && shadow-fields render robot.toml -o robot.png --frames 48"
)]
pub struct Arguments {
    /// glTF 2.0 file, .glb or .gltf, or an OBJ file, .obj
    scene: PathBuf,
    /// Scene file to write
    #[arg(short, long, value_name = "SCENE.toml")]
    output: PathBuf,
    /// Replace a file that stands under the scene file's name, also one that `import` did not write
    #[arg(long)]
    force: bool,
    /// Time at which skins and morph targets stand in their pose, seconds
    #[arg(long, default_value_t = 0.0, value_name = "S", value_parser = number::<f64>(-1e9..=1e9), allow_negative_numbers = true)]
    time: f64,
    #[command(flatten)]
    gltf: GltfSceneArguments,
}

impl Arguments {
    /// Fails where a file would be replaced that an import did not write.
    fn check_own(&self) -> Result<()> {
        let path = &self.output;
        let own = format!("# {HEAD}");
        let mut start = vec![0; own.len()];
        let foreign = path.is_file()
            && !files::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok() && start == own.as_bytes());
        if foreign && !self.force {
            let what = "stands there already, and `import` did not write it; --force replaces it";
            return Err(Error::Usage(format!("{} {what}", path.display())));
        }
        Ok(())
    }
}

/// Start of the comment in the first line of every imported file.
const HEAD: &str = "Written by shadow-fields import";

/// Reads a glTF or OBJ file and writes it as a scene file.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if !gltf::is_gltf(&arguments.scene) && !single::is_obj(&arguments.scene) {
        return Err(Error::Usage(format!("{}: expected a .glb, .gltf or .obj file", arguments.scene.display())));
    }
    let inputs = scene::files::of_scene(&arguments.scene);
    outputs::check(&inputs, &[Output::new("--output", &arguments.output, "toml")])?;
    arguments.check_own()?;
    let scene: Scene = arguments.gltf.scene(global, &arguments.scene, arguments.time)?;
    let mut data = scene.data.clone();
    let folder = |path: &Path| path.parent().unwrap_or(Path::new("")).to_owned();
    data.move_files(&folder(&arguments.scene), &folder(&arguments.output));
    let name = arguments.scene.file_name().unwrap_or_default().to_string_lossy();
    data.write(&arguments.output, &one_line(&format!("{HEAD} from {name}.")))?;
    let meshes = scene.meshes.len();
    let entities = scene.entities.len();
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    if global.json {
        let file = arguments.output.display().to_string();
        let report = json!({ "file": file, "entities": entities, "meshes": meshes, "triangles": triangles });
        output::say(report.to_string());
    } else {
        let file = output::shown(&arguments.output);
        output::say(format!("{file}: {entities} entities, {meshes} meshes with {triangles} triangles"));
    }
    Ok(())
}
