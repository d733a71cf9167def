//! `shadow-fields inspect` shows what is in a field file.

use super::outputs::{Output, Outputs};
use super::sheet::Sheet;
use super::{Global, output};
use crate::asset::picture;
use crate::error::{Error, Result, one_line};
use crate::field::file;
use crate::field::silhouette::{REACH, SILHOUETTE_MAGIC, Side, SilhouetteField};
use crate::field::{FieldKind, ShadowField};
use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count, evaluate};
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
    /// With --at: follow the ray from there in this direction, in the mesh's frame. A silhouette field needs it
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true, requires = "at")]
    toward: Option<DVec3>,
    /// Write a picture of the cubes that the coefficients describe (-X +Z +X -Z, +Y above, -Y below), over latitude,
    /// longitude and distance; of a silhouette field, its maps
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

/// What is told of a field.
struct About {
    /// Its header and more, with "at" where a lookup is asked for.
    json: Value,
    lines: Vec<(&'static str, String)>,
    /// The picture, where one is asked for.
    sheet: Option<Sheet>,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if let Some(path) = &arguments.faces {
        Outputs::check(std::slice::from_ref(&arguments.field), &[Output::new("--faces", path, "png")])?;
    }
    let is_silhouette = file::has_magic(&arguments.field, SILHOUETTE_MAGIC);
    let about = if is_silhouette { about_silhouettes(arguments)? } else { about_field(arguments)? };
    if let (Some(path), Some(sheet)) = (&arguments.faces, &about.sheet) {
        sheet.write(path)?;
    }
    if global.json {
        output::say(about.json.to_string());
        return Ok(());
    }
    for (name, value) in about.lines {
        output::say(format!("{name:16} {value}"));
    }
    if let Some(at) = about.json.get("at") {
        output::say(format!("{:16} {at}", "at"));
    }
    Ok(())
}

fn mesh_line(mesh: &str, hash: &str) -> String {
    format!("{} ({})", one_line(mesh), &hash[..16.min(hash.len())])
}

fn about_field(arguments: &Arguments) -> Result<About> {
    if arguments.toward.is_some() {
        return Err(Error::Usage("--toward goes with a silhouette field".into()));
    }
    let field = ShadowField::read(&arguments.field)?;
    let header = &field.header;
    let lattice = header.lattice;
    let mut json = json!({
        "file": arguments.field.display().to_string(),
        "header": header,
        "samples": lattice.sample_count(),
        "stored_samples": lattice.stored_count(),
        "payload_bytes": field.payload.len(),
    });
    if let Some(position_m) = arguments.at {
        json["at"] = lookup(&field, position_m);
    }
    let shells: Vec<String> = (0..lattice.shells).map(|k| format!("{:.3}", lattice.shell(k))).collect();
    let storage = format!("{:?}", header.storage).to_lowercase();
    let mut lines = vec![
        ("kind", format!("{:?}", header.kind).to_lowercase()),
        ("mesh", mesh_line(&header.mesh, &header.mesh_hash)),
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
    Ok(About { json, lines, sheet: arguments.faces.is_some().then(|| cubes(&field)) })
}

fn about_silhouettes(arguments: &Arguments) -> Result<About> {
    if arguments.at.is_some() && arguments.toward.is_none() {
        return Err(Error::Usage("--at needs --toward X,Y,Z for a silhouette field".into()));
    }
    let field = SilhouetteField::read(&arguments.field)?;
    let header = &field.header;
    let mut json = json!({
        "file": arguments.field.display().to_string(), "header": header, "maps": header.map_count(),
        "payload_bytes": field.payload().len(),
    });
    if let (Some(position_m), Some(toward)) = (arguments.at, arguments.toward) {
        json["at"] = follow(&field, position_m, toward.normalize());
    }
    let halves = header.half_px;
    let lines = vec![
        ("kind", "silhouette".to_owned()),
        ("mesh", mesh_line(&header.mesh, &header.mesh_hash)),
        ("bounding sphere", format!("centre {:?} m, radius {} m", header.centre_m, header.radius_m)),
        ("directions", format!("{0} x {0} cells a cube face, {1} maps", header.cells, header.map_count())),
        ("map", format!("{0} x {0} texels from views of {1} x {1} pixels", header.map_px, header.view_px)),
        ("halves", if halves == 0 { "none".to_owned() } else { format!("{halves} x {halves} texels each") }),
        ("stored", format!("{} bytes", field.payload().len())),
    ];
    Ok(About { json, lines, sheet: arguments.faces.is_some().then(|| maps(&field)) })
}

/// The outline near a ray, in metres, and what it leaves of small lights at infinity.
fn follow(field: &SilhouetteField, position_m: DVec3, direction: DVec3) -> Value {
    let radius_m = f64::from(field.header.radius_m);
    let centre = DVec3::from_array(field.header.centre_m.map(f64::from));
    let point = (position_m - centre) / radius_m;
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

/// All maps side by side: distances above, depths below.
fn maps(field: &SilhouetteField) -> Sheet {
    let edge = field.header.map_px as usize;
    let count = field.header.map_count();
    let columns = ((2 * count) as f64).sqrt().ceil() as usize;
    let titles = [
        format!("distance to the outline, black -{REACH} r outside to white {REACH} r inside"),
        "depth of its nearest point, black -1 r to white 1 r along the light".to_owned(),
    ];
    let mut rows = Vec::new();
    for (half, title) in titles.into_iter().enumerate() {
        let level = |map: usize, texel: usize| {
            let value = field.texel(map, Side::Whole, texel % edge, texel / edge)[half] / [REACH, 1.0][half];
            [picture::linear_from_srgb(0.5 + 0.5 * value as f32); 3]
        };
        let tiles: Vec<Vec<_>> =
            (0..count).map(|map| (0..edge * edge).map(|texel| level(map, texel)).collect()).collect();
        rows.extend(tiles.chunks(columns).map(|tiles| (String::new(), tiles.to_vec())));
        let first = rows.len() - count.div_ceil(columns);
        rows[first].0 = title;
    }
    Sheet { tile: [edge; 2], rows }
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
        let mut basis = [0.0; MAX_COEFFICIENTS];
        evaluate(bands, cube::direction(face, s, t), &mut basis);
        [0, 1, 2].map(|c: usize| {
            let sum: f64 = found[c.min(channels - 1)].iter().zip(&basis).map(|(c, y)| c * y).sum();
            let value = if field.header.kind == FieldKind::Occlusion { 1.0 - sum } else { sum };
            value.max(0.0) as f32
        })
    };
    (0..3 * FACE_PX).flat_map(|y| (0..4 * FACE_PX).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect()
}
