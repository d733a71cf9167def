//! `shadow-fields inspect` shows what is in a field file.

use super::outputs::{Output, Outputs};
use super::sheet::Sheet;
use super::{Global, output};
use crate::error::{Result, one_line};
use crate::field::{FieldKind, ShadowField};
use crate::sh::basis::{coefficient_count, values};
use crate::sh::cube;
use crate::text::{self, number, triple};
use clap::Args;
use glam::DVec3;
use serde_json::{Value, json};
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  shadow-fields inspect teapot.sf\n  shadow-fields inspect teapot.sf --at 0,1.5,2\n  \
    shadow-fields inspect teapot.sf --faces sheet.png"
)]
pub struct Arguments {
    /// Field file to show, as `bake` writes it
    field: PathBuf,
    /// Print the field's coefficients at this place, in metres in the mesh's frame. Example: 0,1.5,2
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    at: Option<DVec3>,
    /// Write a picture of the cubes that the coefficients describe (-X +Z +X -Z, +Y above, -Y below), over latitude,
    /// longitude and distance
    #[arg(long, value_name = "OUT.png")]
    faces: Option<PathBuf>,
}

/// Farthest coordinate of a lookup in metres.
const PLACE_LIMIT_M: f64 = 1e15;

fn place(text: &str) -> std::result::Result<DVec3, String> {
    triple(number(-PLACE_LIMIT_M..=PLACE_LIMIT_M))(text).map(DVec3::from_array)
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if let Some(path) = &arguments.faces {
        Outputs::check(std::slice::from_ref(&arguments.field), &[Output::new("--faces", path, "png")])?;
    }
    let field = ShadowField::read(&arguments.field)?;
    if let Some(path) = &arguments.faces {
        cubes(&field).write(path)?;
    }
    let at = arguments.at.map(|position_m| lookup(&field, position_m));
    if global.json {
        let mut json = json!({
            "file": arguments.field.display().to_string(),
            "header": field.header,
            "samples": field.header.lattice.sample_count(),
            "stored_samples": field.header.lattice.stored_count(),
            "payload_bytes": field.payload.len(),
        });
        if let Some(at) = at {
            json["at"] = at;
        }
        output::say(json.to_string());
        return Ok(());
    }
    for (name, value) in lines(&field) {
        output::say(format!("{name:16} {value}"));
    }
    if let Some(at) = at {
        output::say(format!("{:16} {at}", "at"));
    }
    Ok(())
}

fn lines(field: &ShadowField) -> Vec<(&'static str, String)> {
    let header = &field.header;
    let lattice = header.lattice;
    let hash = &header.mesh_hash;
    let shells: Vec<String> = (0..lattice.shells).map(|k| format!("{:.3}", lattice.shell(k))).collect();
    let storage = format!("{:?}", header.storage).to_lowercase();
    let mut lines = vec![
        ("kind", format!("{:?}", header.kind).to_lowercase()),
        ("mesh", format!("{} ({})", one_line(&header.mesh), &hash[..16.min(hash.len())])),
        ("bounding sphere", format!("centre {:?} m, radius {} m", header.centre_m, header.radius_m)),
        ("bands", format!("{} ({} coefficients a channel)", header.bands, header.bands * header.bands)),
        ("lattice", lattice.to_string()),
        ("shells", format!("{} r", shells.join(" "))),
        ("fit", format!("about {:?} r, stretched by {:?}", lattice.fit().centre, lattice.fit().stretch)),
        ("samples", format!("{} ({} inside, seen from the surface)", lattice.sample_count(), header.filled_samples)),
        ("captured", format!("{}; the other samples lie at the same places or see nothing", header.captured_samples)),
        ("stored", format!("{} samples, {storage}, {} bytes", lattice.stored_count(), field.payload.len())),
        ("face", format!("{0} x {0} texels", header.face_px)),
    ];
    if header.kind == FieldKind::Radiance {
        lines.push(("radiance scale", header.radiance_scale.to_string()));
    }
    lines
}

/// The coefficients at a place in the mesh's frame, in metres.
fn lookup(field: &ShadowField, position_m: DVec3) -> Value {
    let centre = DVec3::from_array(field.header.centre_m.map(f64::from));
    let position = (position_m - centre) / f64::from(field.header.radius_m);
    let channel = |channel| {
        let mut out = vec![0.0; coefficient_count(field.header.bands)];
        field.lookup(position, channel, &mut out);
        out
    };
    match field.header.kind {
        FieldKind::Occlusion => json!({ "position_m": position_m.to_array(), "blocked": channel(0) }),
        FieldKind::Radiance => {
            let channels = [0, 1, 2].map(channel);
            json!({ "position_m": position_m.to_array(), "radiance": channels })
        }
    }
}

/// Edge of a face on the sheet in pixels.
const FACE_PX: usize = 20;
/// An unfolded cube: its faces, +X -X +Y -Y +Z -Z, in three rows.
const UNFOLDED: [[Option<usize>; 4]; 3] =
    [[None, Some(2), None, None], [Some(1), Some(4), Some(0), Some(5)], [None, Some(3), None, None]];
/// Directions of the sheet's columns.
const LONGITUDES: usize = 8;
/// Polar angle of the sheet's blocks of rows, degrees from the equator.
const LATITUDES_DEG: [f64; 3] = [45.0, 0.0, -45.0];
/// Shells of the sheet, as fractions of their number.
const SHELLS: [f64; 4] = [0.0, 0.3, 0.6, 1.0];

/// Unfolded cubes around a field. Visibility is white at 1; radiance falls with the square of the distance, so each row
/// has a white of its own.
fn cubes(field: &ShadowField) -> Sheet {
    let lattice = field.header.lattice;
    let mut rows = Vec::new();
    for latitude_deg in LATITUDES_DEG {
        for fraction in SHELLS {
            let distance = lattice.shell((fraction * f64::from(lattice.shells - 1)).round() as u32);
            let cube = |column: usize| {
                let longitude = std::f64::consts::TAU * column as f64 / LONGITUDES as f64;
                let (up, across) = latitude_deg.to_radians().sin_cos();
                let direction = DVec3::new(across * longitude.cos(), up, across * longitude.sin());
                unfolded(field, lattice.fit().invert(direction * distance))
            };
            let mut tiles: Vec<Vec<[f32; 3]>> = (0..LONGITUDES).map(cube).collect();
            let white = match field.header.kind {
                FieldKind::Occlusion => 1.0,
                FieldKind::Radiance => {
                    let values = tiles.iter().flat_map(|tile| tile.as_flattened());
                    values.fold(f32::MIN_POSITIVE, |most, value| most.max(*value))
                }
            };
            tiles.iter_mut().flat_map(|tile| tile.as_flattened_mut()).for_each(|value| *value /= white);
            let white = text::three(f64::from(white));
            let label = format!("{latitude_deg:+.0} deg up, 0 to 315 deg around, {distance:.2} r, white is {white}");
            rows.push((label, tiles));
        }
    }
    Sheet { tile: [4 * FACE_PX, 3 * FACE_PX], rows }
}

/// The cube that the field's coefficients describe at a place (in r): visibility, or radiance in linear RGB; NaN beside
/// its faces.
fn unfolded(field: &ShadowField, position: DVec3) -> Vec<[f32; 3]> {
    let bands = field.header.bands;
    let channels = field.header.kind.channels();
    let channel = |channel| {
        let mut out = vec![0.0; coefficient_count(bands)];
        field.lookup(position, channel, &mut out);
        out
    };
    let found: Vec<Vec<f64>> = (0..channels).map(channel).collect();
    let texel = |x: usize, y: usize| {
        let Some(face) = UNFOLDED[y / FACE_PX][x / FACE_PX] else { return [f32::NAN; 3] };
        let [s, t] = [x, y].map(|at| cube::texel_st(at % FACE_PX, FACE_PX));
        let basis = values(bands, cube::direction(face, s, t));
        [0, 1, 2].map(|c: usize| {
            let sum: f64 = found[c.min(channels - 1)].iter().zip(&basis).map(|(c, y)| c * y).sum();
            let value = if field.header.kind == FieldKind::Occlusion { 1.0 - sum } else { sum };
            value.max(0.0) as f32
        })
    };
    (0..3 * FACE_PX).flat_map(|y| (0..4 * FACE_PX).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect()
}
