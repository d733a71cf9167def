//! `shadow-fields import` writes a glTF file as a scene file.

use super::source::GltfArguments;
use super::{Global, output};
use crate::error::{Error, Result};
use crate::scene::{Scene, export, gltf};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `import`.
#[derive(Args)]
#[command(
    after_help = "The scene file can be edited like any other; its meshes are OBJ files in the folder SCENE_meshes beside it. \
    `render` gives the\nsame picture of both. What has no form in a scene file is left out, with a line for each kind.\n\n\
    Example:\n  shadow-fields import robot.glb -o robot.toml && shadow-fields render robot.toml -o robot.png --frames 48"
)]
pub struct Arguments {
    /// glTF 2.0 file, .glb or .gltf
    scene: PathBuf,
    /// Scene file to write
    #[arg(short, long, value_name = "SCENE.toml")]
    output: PathBuf,
    #[command(flatten)]
    gltf: GltfArguments,
}

/// Reads a glTF file and writes it as a scene file.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    output::check_folder(&arguments.output)?;
    output::check_ending(&arguments.output, "toml", "a scene file")?;
    if !gltf::is_gltf(&arguments.scene) {
        return Err(Error::Usage(format!("{}: expected a .glb or .gltf file", arguments.scene.display())));
    }
    let scene: Scene = arguments.gltf.scene(global, &arguments.scene)?;
    let name = arguments.scene.file_name().unwrap_or_default().to_string_lossy();
    let head = crate::error::one_line(&format!("Written by shadow-fields import from {name}."));
    export::write(&scene.data, &scene.meshes, &arguments.output, &head)?;
    let (meshes, entities) = (scene.meshes.len(), scene.entities.len());
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
