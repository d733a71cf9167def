//! `shadow-fields inspect` shows what is in a field file.

use super::outputs::{Output, Outputs};
use super::sheet::{self, Cell, Row};
use super::{Global, output, silhouette};
use crate::error::{Error, Result, one_line};
use crate::field::file;
use crate::field::silhouette::SILHOUETTE_MAGIC;
use crate::field::{FieldKind, ShadowField};
use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count, evaluate};
use crate::sh::cube;
use crate::text::{self, number, triple};
use clap::Args;
use glam::DVec3;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `inspect`.
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
    /// With --at: follow the ray from there in this direction, in the mesh's frame. A silhouette field needs it
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true, requires = "at")]
    toward: Option<DVec3>,
    /// Write a picture of the cube faces that the coefficients describe, over latitude, longitude and distance
    #[arg(long, value_name = "OUT.png")]
    faces: Option<PathBuf>,
}

/// Farthest coordinate of a lookup in metres.
const PLACE_LIMIT_M: f64 = 1e15;

fn place(text: &str) -> std::result::Result<DVec3, String> {
    triple(number(-PLACE_LIMIT_M..=PLACE_LIMIT_M))(text).map(DVec3::from_array)
}

fn direction(text: &str) -> std::result::Result<DVec3, String> {
    let toward = place(text)?;
    if toward.length() > 1e-6 { Ok(toward) } else { Err(format!("expected a direction like 0,1,0.5, got \"{text}\"")) }
}

/// Prints or draws a silhouette field. A ray needs a place and a direction.
fn silhouette(global: &Global, arguments: &Arguments) -> Result<()> {
    let ray = match (arguments.at, arguments.toward) {
        (Some(_), None) => return Err(Error::Usage("--at needs --toward X,Y,Z for a silhouette field".into())),
        (at, toward) => at.zip(toward),
    };
    silhouette::inspect(global, &arguments.field, ray, arguments.faces.as_deref())
}

/// Shows a field.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if let Some(path) = &arguments.faces {
        Outputs::check(std::slice::from_ref(&arguments.field), &[Output::new("--faces", path, "png")])?;
    }
    if file::has_magic(&arguments.field, SILHOUETTE_MAGIC) {
        return silhouette(global, arguments);
    }
    if arguments.toward.is_some() {
        return Err(Error::Usage("--toward goes with a silhouette field".into()));
    }
    let field = ShadowField::read(&arguments.field)?;
    let header = &field.header;
    let mut result = json!({
        "file": arguments.field.display().to_string(),
        "header": header,
        "samples": header.lattice.sample_count(),
        "stored_samples": header.lattice.stored_count(),
        "payload_bytes": field.payload.len(),
    });
    if let Some(position_m) = arguments.at {
        result["at"] = lookup(&field, position_m);
    }
    if let Some(path) = &arguments.faces {
        write_sheet(global, &field, path)?;
    }
    if global.json {
        output::say(result.to_string());
        return Ok(());
    }
    let lattice = header.lattice;
    let shells: Vec<String> = (0..lattice.shells).map(|k| format!("{:.3}", lattice.shell(k))).collect();
    let storage = format!("{:?}", header.storage).to_lowercase();
    let lines = [
        ("kind", format!("{:?}", header.kind).to_lowercase()),
        ("mesh", format!("{} ({})", one_line(&header.mesh), &header.mesh_hash[..16.min(header.mesh_hash.len())])),
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
    for (name, value) in lines {
        output::say(format!("{name:16} {value}"));
    }
    if header.kind == FieldKind::Radiance {
        output::say(format!("{:16} {}", "radiance scale", header.radiance_scale));
    }
    if result["at"] != serde_json::Value::Null {
        output::say(format!("{:16} {}", "at", result["at"]));
    }
    Ok(())
}

/// The coefficients at a place in the mesh's frame, in metres.
fn lookup(field: &ShadowField, position_m: DVec3) -> serde_json::Value {
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
/// Directions of the sheet's columns.
const LONGITUDES: usize = 8;
/// Polar angle of the sheet's blocks of rows, degrees from the equator.
const LATITUDES_DEG: [f64; 3] = [45.0, 0.0, -45.0];
/// Shells of the sheet, as fractions of their number.
const SHELLS: [f64; 4] = [0.0, 0.3, 0.6, 1.0];

fn write_sheet(global: &Global, field: &ShadowField, path: &Path) -> Result<()> {
    let lattice = field.header.lattice;
    let mut rows = Vec::new();
    for latitude_deg in LATITUDES_DEG {
        for fraction in SHELLS {
            let shell = (fraction * f64::from(lattice.shells - 1)).round() as u32;
            let distance = lattice.shell(shell);
            let latitude = latitude_deg.to_radians();
            let mut cells = Vec::new();
            for column in 0..LONGITUDES {
                let longitude = std::f64::consts::TAU * column as f64 / LONGITUDES as f64;
                let direction =
                    DVec3::new(latitude.cos() * longitude.cos(), latitude.sin(), latitude.cos() * longitude.sin());
                cells.push(reconstruct(field, lattice.fit().invert(direction * distance)));
            }
            rows.push(Row { label: format!("{latitude_deg:+.0} deg, {distance:.2} r"), cells, white: 1.0 });
        }
    }
    // Visibility has one white for the whole sheet. Radiance falls with the square of the distance, so each row has a
    // white of its own.
    let brightest = |rows: &[Row], least: f32| {
        rows.iter().flat_map(|row| row.cells.iter().flatten()).fold(least, |most, value| most.max(*value))
    };
    let white = brightest(&rows, 1.0);
    for row in &mut rows {
        row.white = match field.header.kind {
            FieldKind::Occlusion => white,
            FieldKind::Radiance => brightest(std::slice::from_ref(row), f32::MIN_POSITIVE),
        };
        row.label += &format!(", white {}", text::three(f64::from(row.white)));
    }
    let columns: Vec<String> = (0..LONGITUDES).map(|c| format!("{} deg", 360 * c / LONGITUDES)).collect();
    sheet::write(path, &columns, &rows, FACE_PX)?;
    let what = "cubes unfolded: -X +Z +X -Z in a row, +Y above, -Y below; \"white\": the value shown as white";
    output::note(global, format!("{}: {what}", output::shown(path)));
    Ok(())
}

/// The six faces that the field's coefficients describe at a place (in r): visibility, or radiance in linear RGB.
fn reconstruct(field: &ShadowField, position: DVec3) -> Cell {
    let bands = field.header.bands;
    let count = coefficient_count(bands);
    let channels = field.header.kind.channels();
    let found: Vec<Vec<f64>> = (0..channels)
        .map(|channel| {
            let mut out = vec![0.0; count];
            field.lookup(position, channel, &mut out);
            out
        })
        .collect();
    let mut cell = Vec::with_capacity(18 * FACE_PX * FACE_PX);
    for face in 0..cube::FACE_COUNT {
        for y in 0..FACE_PX {
            for x in 0..FACE_PX {
                let w = cube::direction(face, cube::texel_st(x, FACE_PX), cube::texel_st(y, FACE_PX));
                let mut basis = [0.0; MAX_COEFFICIENTS];
                evaluate(bands, w, &mut basis);
                let value = |channel: usize| -> f64 {
                    let sum: f64 = found[channel].iter().zip(&basis).map(|(c, y)| c * y).sum();
                    if field.header.kind == FieldKind::Occlusion { 1.0 - sum } else { sum }
                };
                cell.extend((0..3).map(|c| value(c.min(channels - 1)).max(0.0) as f32));
            }
        }
    }
    cell
}
