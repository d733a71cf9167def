//! `shadow-fields bake` bakes the field of one mesh.

use super::context::Context;
use super::outputs::{self, Output};
use super::source::GltfArguments;
use super::{Global, output};
use crate::asset::Mesh;
use crate::asset::environment::RADIANCE_LIMIT;
use crate::bake::{self, BakeOptions};
use crate::error::{Error, Result};
use crate::field::FieldKind;
use crate::scene;
use crate::text::{number, triple};
use clap::Args;
use clap::builder::{BoolishValueParser, TypedValueParser};
use glam::Vec3;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Examples:\n  shadow-fields bake assets/meshes/teapot.obj -o teapot.sf\n  \
    shadow-fields bake lamp.obj -o lamp.sf --radiance 4,3,2 --quality high")]
pub struct Arguments {
    /// Mesh to bake with lengths in metres: a Wavefront OBJ file, or all triangles of a glTF file (.glb, .gltf) as they
    /// stand at rest
    mesh: PathBuf,
    /// Field file to write
    #[arg(short, long, value_name = "F.sf")]
    output: PathBuf,
    /// Bake a radiance field instead of an occlusion field. The surface shines with this linear RGB radiance, times the
    /// mesh's own colours if it has them. Example: 4,3,2
    #[arg(long, value_name = "R,G,B", value_parser = triple(number(0.0..=RADIANCE_LIMIT)).map(Vec3::from_array), allow_hyphen_values = true)]
    radiance: Option<Vec3>,
    /// Draw fewer and larger triangles of a large mesh in place of those that are far from the eye. What is seen moves
    /// by at most 0.25 texels
    #[arg(long, action = clap::ArgAction::Set, default_value = "on", value_name = "on|off", value_parser = BoolishValueParser::new())]
    levels: bool,
    #[command(flatten)]
    bake: BakeOptions,
    #[command(flatten)]
    gltf: GltfArguments,
}

/// A mesh whose surface shines. Its colours are its own, or white, times `radiance`.
fn shining(mesh: Mesh, radiance: Vec3, path: &Path) -> Result<Mesh> {
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
    let inputs = scene::files::of_mesh(&arguments.mesh);
    outputs::check(&inputs, &[Output::new("--output", &arguments.output, "sf")])?;
    let mut mesh = arguments.gltf.mesh(global, &arguments.mesh)?;
    let options = bake::Options { levels: arguments.levels, ..arguments.bake.resolve()? };
    if let Some(radiance) = arguments.radiance {
        mesh = shining(mesh, radiance, &arguments.mesh)?;
    }
    let context = Context::new(global)?;
    let progress = |done, all| context.progress.show(&mesh.name, done, all);
    let out = &arguments.output;
    let kind = if arguments.radiance.is_some() { FieldKind::Radiance } else { FieldKind::Occlusion };
    let wanted = bake::header(&mesh, kind, &options);
    let baked = context.baker.field(&mesh, wanted, &progress);
    let (field, report) = baked.map_err(|error| error.context(arguments.mesh.display()))?;
    let triangles = mesh.triangles.len();
    let origin = context.origin(global);
    // A field that the validation layer objected to is not written.
    context.finish()?;
    field.write(out).map_err(Error::unwritten)?;
    output::say(if global.json {
        let file = out.display().to_string();
        let header = &field.header;
        json!({ "triangles": triangles, "report": report, "header": header, "origin": origin, "file": file })
            .to_string()
    } else {
        format!(
            "{}: {} samples ({} filled, {} captured), {triangles} triangles, {} bytes, {:.2} s",
            output::shown(out),
            report.samples + report.filled,
            report.filled,
            field.header.captured_samples,
            field.payload.len(),
            report.total.as_secs_f64()
        )
    });
    Ok(())
}
