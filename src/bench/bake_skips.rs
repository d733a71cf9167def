//! What a bake leaves out, part of `bench skip`: time, what is captured, and the field's error, with each skip off and on in turns.

use super::{Bench, text};
use crate::asset::{Mesh, generate};
use crate::bake::{self, Baker, Report};
use crate::error::Result;
use crate::field::{Kind, Storage};
use crate::gpu::{Buffer, BufferKind};
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// One bake.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Side {
    /// Wall time, the least of the rounds, milliseconds.
    pub bake_ms: f64,
    /// Samples that were captured.
    pub captured_count: u32,
    /// Cube faces that were drawn.
    pub face_count: u32,
    /// Of the coefficients against a bake that leaves nothing out, on faces of twice the edge: relative root mean square.
    pub error: f64,
}

/// One skip on one mesh.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Mesh.
    pub case: String,
    /// Its triangles.
    pub triangle_count: usize,
    /// Name of the skip.
    pub skip: String,
    /// With nothing else left out either.
    pub off: Side,
    /// With this alone.
    pub on: Side,
    /// Bake time off over on.
    #[serde(rename = "speed_up_ratio")]
    pub times_faster: f64,
}

type Set = fn(&mut Baker);

/// The skips by name, and what sets them.
const SKIPS: [(&str, Set); 4] = [
    ("faces", |baker| baker.faces = true),
    ("orbit", |baker| baker.orbit = true),
    ("simplify", |baker| baker.simplify = true),
    ("all but simplify", |baker| {
        (baker.faces, baker.orbit) = (true, true);
    }),
];

/// Measures every skip on a few meshes, and writes `skip_bake.csv` and `skip_bake.json` into `folder`.
///
/// # Errors
/// `Failed` when a file cannot be written; else as [`Baker::field`].
pub fn run(bench: &Bench<'_>, folder: &Path) -> Result<Vec<Row>> {
    let mut meshes = vec![generate::sphere(0.5, 4), generate::torus(0.5, 0.2, 96, 48)];
    if !bench.quick {
        meshes.push(generate::torus(0.5, 0.2, 200, 100));
    }
    let mut rows = Vec::new();
    for mesh in &meshes {
        let exact = bake_once(bench, mesh, 128, |_| ())?.1;
        for (skip, set) in SKIPS {
            let (mut sides, rounds) = ([None::<Side>; 2], if bench.quick { 1 } else { 3 });
            for _ in 0..rounds {
                for (side, on) in sides.iter_mut().zip([false, true]) {
                    let (report, values) = bake_once(bench, mesh, 64, |baker| {
                        if on {
                            set(baker)
                        }
                    })?;
                    let now = Side {
                        bake_ms: report.total.as_secs_f64() * 1e3,
                        captured_count: report.samples + report.filled - report.turned,
                        face_count: report.faces,
                        error: relative(&values, &exact),
                    };
                    *side = Some(side.filter(|before| before.bake_ms < now.bake_ms).unwrap_or(now));
                }
            }
            let [Some(off), Some(on)] = sides else { continue };
            (bench.progress)(&format!("{}: {skip} measured", mesh.name));
            rows.push(Row {
                case: mesh.name.clone(),
                triangle_count: mesh.triangles.len(),
                skip: skip.to_owned(),
                times_faster: off.bake_ms / on.bake_ms,
                off,
                on,
            });
        }
    }
    let origin = json!({ "origin": bench.origin, "quick": bench.quick });
    let values: Vec<_> = rows.iter().map(|row| serde_json::to_value(row).expect("rows are plain data")).collect();
    text::write(&folder.join("skip_bake.csv"), &text::csv(&origin, &values))?;
    text::write(&folder.join("skip_bake.json"), &format!("{:#}\n", json!({ "origin": origin, "rows": rows })))?;
    Ok(rows)
}

/// An occlusion field in f32 on half of the default shells and directions, nothing left out but what `set` sets.
fn bake_once(bench: &Bench<'_>, mesh: &Mesh, face_px: u32, set: impl Fn(&mut Baker)) -> Result<(Report, Vec<f32>)> {
    let mut baker = Baker::new(bench.baker.device(), bench.baker.library());
    (baker.faces, baker.orbit, baker.simplify) = (false, false, false);
    set(&mut baker);
    let lattice = "cube:8x5".parse().expect("a lattice");
    let options = bake::Options { lattice, storage: Storage::F32, face_px, ..Default::default() };
    let mut header = bake::header(mesh, Kind::Occlusion, &options);
    let store = Buffer::new(baker.device(), "field", BufferKind::Device, header.payload_bytes())?;
    let report = baker.field(mesh, &mut header, (&store, 0), &|_, _| ())?;
    Ok((report, store.download_range(0..header.payload_bytes())?))
}

fn relative(values: &[f32], exact: &[f32]) -> f64 {
    let squares = |it: &mut dyn Iterator<Item = f32>| it.map(|x| f64::from(x).powi(2)).sum::<f64>();
    let off = squares(&mut values.iter().zip(exact).map(|(a, b)| a - b));
    (off / squares(&mut exact.iter().copied()).max(f64::MIN_POSITIVE)).sqrt()
}
