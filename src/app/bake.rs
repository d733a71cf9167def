//! `shadow-fields bake` bakes the field of one mesh.

use super::context::{Context, on_or_off, three};
use super::quality::BakeArguments;
use super::source::GltfArguments;
use super::{Global, output, silhouette};
use crate::asset::Mesh;
use crate::asset::environment::RADIANCE_LIMIT;
use crate::bake::{self, silhouette::SilhouetteOptions};
use crate::error::{Error, Result};
use crate::field::{FieldKind, Shortcuts};
use clap::Args;
use glam::Vec3;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `bake`.
#[derive(Args)]
#[command(after_help = "Examples:\n  shadow-fields bake assets/meshes/teapot.obj -o teapot.sf\n  \
    shadow-fields bake lamp.obj -o lamp.sf --radiance 4,3,2 --quality high")]
pub struct Arguments {
    /// Mesh to bake with lengths in metres: a Wavefront OBJ file, or all triangles of a glTF file (.glb, .gltf) as they stand at rest
    mesh: PathBuf,
    /// Field file to write
    #[arg(short, long, value_name = "F.sf")]
    output: PathBuf,
    /// Bake a radiance field instead of an occlusion field. The surface shines with this linear RGB radiance, times the mesh's own
    /// colours if it has them. Example: 4,3,2
    #[arg(long, value_name = "R,G,B", value_parser = color, allow_hyphen_values = true)]
    radiance: Option<Vec3>,
    /// Bake a silhouette field instead: outlines from many directions, for sharp lights. Of the baking options it takes only --quality; the
    /// field has 98, 389 or 1 542 KiB, and half as much again if the mesh is not convex
    #[arg(long, conflicts_with = "radiance")]
    silhouette: bool,
    /// Capture only one of the samples or maps that a symmetry of the mesh carries into one another, and turn it for the others.
    /// This serves symmetric meshes and, with samples, bodies of revolution and spheres. What is seen moves by at most 0.25 texels
    #[arg(long, action = clap::ArgAction::Set, default_value = "on", value_name = "on|off", value_parser = on_or_off)]
    symmetry: bool,
    /// Draw fewer and larger triangles of a large mesh in place of those that are far from the eye. What is seen moves by at most 0.25
    /// texels
    #[arg(long, action = clap::ArgAction::Set, default_value = "on", value_name = "on|off", value_parser = on_or_off)]
    levels: bool,
    #[command(flatten)]
    bake: BakeArguments,
    #[command(flatten)]
    gltf: GltfArguments,
}

impl Arguments {
    fn options(&self) -> bake::Options {
        let shortcuts = Shortcuts { symmetry: self.symmetry, ..Shortcuts::default() };
        let options = self.bake.options();
        let silhouette = SilhouetteOptions { levels: self.levels, symmetry: self.symmetry, ..options.silhouette };
        bake::Options { shortcuts, silhouette, levels: self.levels, ..options }
    }

    /// Options that serve every kind of bake of a mesh.
    ///
    /// # Errors
    /// `Usage` where they say which kind.
    pub(super) fn of_any_kind(&self) -> Result<bake::Options> {
        if self.silhouette || self.radiance.is_some() {
            return Err(Error::Usage("a plan bakes all kinds of fields: leave out --silhouette and --radiance".into()));
        }
        Ok(self.options())
    }
}

/// Parses a radiance.
pub(super) fn color(text: &str) -> std::result::Result<Vec3, String> {
    let numbers = three(text).filter(|c| c.iter().all(|c| (0.0..=RADIANCE_LIMIT).contains(c)));
    numbers.map(Vec3::from_array).ok_or_else(|| {
        format!("expected a radiance like 1,0.5,0.2, three numbers from 0 to {RADIANCE_LIMIT:e}, got \"{text}\"")
    })
}

/// A mesh whose surface shines. Its colours are its own, or white, times `radiance`.
///
/// # Errors
/// `Input` that names the file when a colour becomes too bright.
pub(super) fn shining(mesh: Mesh, radiance: Vec3, path: &Path) -> Result<Mesh> {
    let white = vec![Vec3::ONE; mesh.positions.len()];
    let colors: Vec<Vec3> = mesh.colors.as_ref().unwrap_or(&white).iter().map(|c| *c * radiance).collect();
    if colors.iter().any(|c| c.max_element() > RADIANCE_LIMIT) {
        let what = format!("its colours times --radiance are over the limit of {RADIANCE_LIMIT:e}");
        return Err(Error::input(path, what));
    }
    Mesh::new(mesh.name, mesh.positions, mesh.normals, Some(colors), mesh.triangles)
}

/// Bakes one field, without the cache.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    output::check_folder(&arguments.output)?;
    output::check_ending(&arguments.output, "sf", "a field file")?;
    let mut mesh = arguments.gltf.mesh(global, &arguments.mesh)?;
    if arguments.silhouette {
        return silhouette::bake(global, (&mesh, &arguments.mesh), &arguments.output, arguments.options().silhouette);
    }
    let kind = if arguments.radiance.is_some() { FieldKind::Radiance } else { FieldKind::Occlusion };
    if let Some(radiance) = arguments.radiance {
        mesh = shining(mesh, radiance, &arguments.mesh)?;
    }
    let context = Context::new(global)?;
    let options = arguments.options();
    let (field, report) = context
        .baker
        .field(&mesh, bake::header(&mesh, kind, &options), &|done, all| context.progress.show(&mesh.name, done, all))
        .map_err(|error| error.context(arguments.mesh.display()))?;
    let result = json!({
        "origin": context.origin(global), "file": arguments.output.display().to_string(),
        "triangles": mesh.triangles.len(), "report": report, "header": field.header,
    });
    // A field that the validation layer objected to is not written.
    context.finish()?;
    field.write(&arguments.output).map_err(output::unwritten)?;
    if global.json {
        output::say(result.to_string());
    } else {
        output::say(format!(
            "{}: {} samples ({} filled, {} captured), {} triangles, {} bytes, {:.2} s",
            output::shown(&arguments.output),
            report.samples + report.filled,
            report.filled,
            field.header.captured_samples,
            mesh.triangles.len(),
            field.payload.len(),
            report.total.as_secs_f64()
        ));
    }
    Ok(())
}
