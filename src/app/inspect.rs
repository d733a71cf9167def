//! `shadow-fields inspect` shows what is in a field file.

use super::{Global, output};
use crate::error::{Result, one_line};
use crate::field::{FieldKind, ShadowField};
use crate::sh::basis::coefficient_count;
use crate::text::{number, triple};
use clap::Args;
use clap::builder::TypedValueParser;
use glam::DVec3;
use serde_json::{Value, json};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  shadow-fields inspect teapot.sf\n  shadow-fields inspect teapot.sf --at 0,1.5,2")]
pub struct Arguments {
    /// Field file to show, as `bake` writes it
    field: PathBuf,
    /// Print the field's coefficients at this place, in metres in the mesh's frame. Example: 0,1.5,2
    #[arg(long, value_name = "X,Y,Z", value_parser = triple(number(-PLACE_LIMIT_M..=PLACE_LIMIT_M)).map(DVec3::from_array), allow_hyphen_values = true)]
    at: Option<DVec3>,
}

/// Farthest coordinate of a lookup in metres.
const PLACE_LIMIT_M: f64 = 1e15;

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let field = ShadowField::read(&arguments.field)?;
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
