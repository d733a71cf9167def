//! Skips of the bake, part of `bench skip`: time, number of captures and the field's error, with each skip off and on
//! in turns.

use super::Bench;
use crate::asset::{Mesh, generate};
use crate::bake::{self, BakeReport};
use crate::error::Result;
use crate::field::{FieldKind, Storage};
use crate::text;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// Time, captures and error of one bake.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BakeTime {
    /// Wall time, the least of the rounds, milliseconds.
    pub bake_ms: f64,
    /// Samples that were captured.
    pub captured_count: u32,
    /// Samples inside the solid that were captured off its surface or filled from neighbours.
    pub filled_count: u32,
    /// Cube faces that were drawn.
    pub face_count: u32,
    /// Triangles that were drawn, each as often as faces showed it.
    pub drawn_triangle_count: u64,
    /// Relative root mean square error of the coefficients against a bake without skips and with faces of twice the
    /// edge; for the large mesh, against the bake without this skip.
    pub error: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct BakeSkipRow {
    pub case: String,
    pub triangle_count: usize,
    /// Sample points.
    pub lattice: String,
    pub skip: String,
    /// The bake without any skip; for the large mesh, with all other skips.
    pub off: BakeTime,
    /// The bake with this skip alone; for the large mesh, with all skips.
    pub on: BakeTime,
    /// Bake time without the skip over bake time with it.
    #[serde(rename = "speed_up_ratio")]
    pub times_faster: f64,
}

/// The skips by name, with whether levels of detail are drawn without them and with them.
const SKIPS: [(&str, [bool; 2]); 1] = [("levels", [false, true])];

/// Half of the default shells and directions.
const LATTICE: &str = "cube:8x5";

pub fn meshes(quick: bool) -> Vec<Mesh> {
    let mut meshes = vec![generate::sphere(0.5, 4), generate::torus(0.5, 0.2, 96, 48)];
    if !quick {
        meshes.push(generate::torus(0.5, 0.2, 200, 100));
    }
    meshes
}

/// Measures every skip on some meshes, and writes `skip_bake.csv` and `skip_bake.json` into `folder`.
pub fn run(bench: &Bench<'_>, folder: &Path, meshes: &[Mesh]) -> Result<Vec<BakeSkipRow>> {
    let mut rows = Vec::new();
    for mesh in meshes {
        let (_, exact) = bake_once(bench, mesh, 128, false)?;
        for (skip, levels) in SKIPS {
            let mut sides = [None::<BakeTime>; 2];
            let rounds = if bench.quick { 1 } else { 3 };
            for _ in 0..rounds {
                for (side, levels) in sides.iter_mut().zip(levels) {
                    let (report, values) = bake_once(bench, mesh, 64, levels)?;
                    let now = BakeTime {
                        bake_ms: report.total.as_secs_f64() * 1e3,
                        captured_count: report.samples + report.filled,
                        filled_count: report.filled,
                        face_count: report.faces,
                        drawn_triangle_count: report.triangles,
                        error: relative(&values, &exact),
                    };
                    *side = Some(side.filter(|before| before.bake_ms < now.bake_ms).unwrap_or(now));
                }
            }
            let [Some(off), Some(on)] = sides else { continue };
            (bench.progress)(&format!("{}: {skip} measured", mesh.name));
            rows.push(BakeSkipRow {
                case: mesh.name.clone(),
                triangle_count: mesh.triangles.len(),
                lattice: LATTICE.to_owned(),
                skip: skip.to_owned(),
                times_faster: off.bake_ms / on.bake_ms,
                off,
                on,
            });
        }
    }
    let origin = json!({ "origin": bench.origin, "quick": bench.quick });
    text::write_rows(folder, "skip_bake", &origin, &rows)?;
    Ok(rows)
}

/// An occlusion field in f32.
fn bake_once(bench: &Bench<'_>, mesh: &Mesh, face_px: u32, levels: bool) -> Result<(BakeReport, Vec<f32>)> {
    let lattice = LATTICE.parse().expect("a lattice");
    let options = bake::Options { lattice, storage: Storage::F32, face_px, levels, ..Default::default() };
    let header = bake::header(mesh, FieldKind::Occlusion, &options);
    let (field, report) = bench.baker.field(mesh, header, &|_, _| ())?;
    Ok((report, field.payload.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect()))
}

fn relative(values: &[f32], exact: &[f32]) -> f64 {
    let squares = |it: &mut dyn Iterator<Item = f32>| it.map(|x| f64::from(x).powi(2)).sum::<f64>();
    let off = squares(&mut values.iter().zip(exact).map(|(a, b)| a - b));
    (off / squares(&mut exact.iter().copied()).max(f64::MIN_POSITIVE)).sqrt()
}
