//! Silhouette fields on the command line: `bake --silhouette`, and `inspect` of what it wrote.

use super::context::Context;
use super::{Global, output};
use crate::asset::{Mesh, lettering, picture};
use crate::bake::silhouette::{SilhouetteOptions, bake_silhouette};
use crate::error::{Result, one_line};
use crate::field::silhouette::{REACH, Side, SilhouetteField};
use glam::DVec3;
use serde_json::json;
use std::path::Path;

/// Bakes the silhouette field of a mesh that was read from a file, and writes it.
pub fn bake(global: &Global, (mesh, mesh_file): (&Mesh, &Path), out: &Path, options: SilhouetteOptions) -> Result<()> {
    let context = Context::new(global)?;
    let told = |done, all| context.progress.show(&mesh.name, done, all);
    let (field, report) =
        bake_silhouette(&context.baker, mesh, options, &told).map_err(|error| error.context(mesh_file.display()))?;
    let seconds = report.total.as_secs_f64();
    let result = json!({
        "origin": context.origin(global), "file": out.display().to_string(), "triangles": mesh.triangles.len(),
        "report": report, "header": field.header,
    });
    // A field that the validation layer objected to is not written.
    context.finish()?;
    field.write(out).map_err(output::unwritten)?;
    if global.json {
        output::say(result.to_string());
    } else {
        let file = output::shown(out);
        let edge = field.header.map_px;
        let maps = field.header.map_count();
        let triangles = mesh.triangles.len();
        let bytes = field.payload().len();
        output::say(format!(
            "{file}: {maps} maps of {edge}x{edge}, {triangles} triangles, {bytes} bytes, {seconds:.2} s"
        ));
    }
    Ok(())
}

/// A ray in the mesh's frame that `inspect` follows: from a place in metres, in a direction of any length but 0.
pub type Ray = (DVec3, DVec3);

/// Shows a silhouette field: its header, what one ray passes, and a contact sheet of its maps.
pub fn inspect(global: &Global, file: &Path, ray: Option<Ray>, sheet: Option<&Path>) -> Result<()> {
    let field = SilhouetteField::read(file)?;
    let header = &field.header;
    let mut result = json!({
        "file": file.display().to_string(), "header": header, "maps": header.map_count(),
        "payload_bytes": field.payload().len(),
    });
    if let Some(ray) = ray {
        result["at"] = lookup(&field, ray);
    }
    if let Some(path) = sheet {
        write_sheet(&field, path)?;
    }
    if global.json {
        output::say(result.to_string());
        return Ok(());
    }
    let hash = &header.mesh_hash[..16.min(header.mesh_hash.len())];
    let edge = header.map_px;
    let lines = [
        ("kind", "silhouette".to_owned()),
        ("mesh", format!("{} ({hash})", one_line(&header.mesh))),
        ("bounding sphere", format!("centre {:?} m, radius {} m", header.centre_m, header.radius_m)),
        ("directions", format!("{0} x {0} cells a cube face, {1} maps", header.cells, header.map_count())),
        ("map", format!("{edge} x {edge} texels from views of {0} x {0} pixels", header.view_px)),
        (
            "halves",
            if header.half_px == 0 { "none".to_owned() } else { format!("{0} x {0} texels each", header.half_px) },
        ),
        ("stored", format!("{} bytes", field.payload().len())),
    ];
    for (name, value) in lines {
        output::say(format!("{name:16} {value}"));
    }
    if ray.is_some() {
        output::say(format!("{:16} {}", "at", result["at"]));
    }
    Ok(())
}

/// The outline near a ray, in metres, and what it leaves of small lights at infinity.
fn lookup(field: &SilhouetteField, (position_m, toward): Ray) -> serde_json::Value {
    let radius_m = f64::from(field.header.radius_m);
    let centre = DVec3::from_array(field.header.centre_m.map(f64::from));
    let point = (position_m - centre) / radius_m;
    let direction = toward.normalize();
    let near = field.near(point, direction);
    let outline = field.outline(&near, Side::Whole, direction);
    let blocked = |angle_deg: f64| field.blocked(&near, direction, f64::INFINITY, angle_deg.to_radians().tan());
    json!({
        "position_m": position_m.to_array(), "direction": direction.to_array(),
        "outline_distance_m": outline.distance * radius_m,
        "outline_along_ray_m": (outline.depth - point.dot(direction)) * radius_m,
        "blocked_of_light_of_1_3_8_deg": [blocked(1.0), blocked(3.0), blocked(8.0)],
    })
}

/// Height of a line of text in pixels.
const TEXT_PX: usize = 14;

/// Writes all maps side by side: distances above, depths below.
fn write_sheet(field: &SilhouetteField, path: &Path) -> Result<()> {
    let edge = field.header.map_px as usize;
    let count = field.header.map_count();
    let columns = ((2 * count) as f64).sqrt().ceil() as usize;
    let rows = count.div_ceil(columns);
    let width = (columns * (edge + 1)).max(420);
    let block = TEXT_PX + rows * (edge + 1);
    let mut rgb = vec![0.35_f32; 3 * width * 2 * block];
    let titles = [
        format!("distance to the outline, black -{REACH} r outside to white {REACH} r inside"),
        "depth of its nearest point, black -1 r to white 1 r along the light".to_owned(),
    ];
    for (half, title) in titles.iter().enumerate() {
        lettering::write(&mut rgb, width, (4, half * block + 2), 1, [0.0; 3], title);
        for map in 0..count {
            let left = map % columns * (edge + 1);
            let top = half * block + TEXT_PX + map / columns * (edge + 1);
            for (y, x) in (0..edge).flat_map(|y| (0..edge).map(move |x| (y, x))) {
                let value = field.texel(map, Side::Whole, x, y)[half] / [REACH, 1.0][half];
                let level = picture::linear_from_srgb(0.5 + 0.5 * value as f32);
                rgb[3 * ((top + y) * width + left + x)..][..3].fill(level);
            }
        }
    }
    picture::write_png(path, width as u32, (2 * block) as u32, &rgb, 0.0)
}
