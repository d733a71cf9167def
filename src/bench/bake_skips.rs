//! Skips of the bake, part of `bench skip`: time, number of captures and the field's error, with each skip off and on in turns.

use super::Bench;
use crate::asset::{Mesh, generate};
use crate::bake::{self, Baker, Report};
use crate::error::Result;
use crate::field::{FieldKind, Storage};
use crate::gpu::{Buffer, BufferKind};
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
    /// Relative root mean square error of the coefficients against a bake without skips and with faces of twice the edge; for
    /// the large mesh, against the bake without this skip.
    pub error: f64,
}

/// One skip on one mesh.
#[derive(Clone, Debug, Serialize)]
pub struct BakeSkipRow {
    /// Mesh.
    pub case: String,
    /// Its triangles.
    pub triangle_count: usize,
    /// Sample points.
    pub lattice: String,
    /// Name of the skip.
    pub skip: String,
    /// The bake without any skip; for the large mesh, with all other skips.
    pub off: BakeTime,
    /// The bake with this skip alone; for the large mesh, with all skips.
    pub on: BakeTime,
    /// Bake time without the skip over bake time with it.
    #[serde(rename = "speed_up_ratio")]
    pub times_faster: f64,
}

type Set = fn(&mut Baker);

/// The skips by name, with the functions that switch them off and on.
const SKIPS: [(&str, Set, Set); 5] = [
    ("faces", |_| (), |baker| baker.faces = true),
    ("orbit", |_| (), |baker| baker.orbit = true),
    ("inside", |baker| baker.inside = false, |_| ()),
    ("simplify", |_| (), |baker| baker.simplify = true),
    ("all but simplify", |_| (), |baker| (baker.faces, baker.orbit) = (true, true)),
];

/// Half of the default shells and directions.
const SMALL: &str = "cube:8x5";
/// About as many samples as by default, most of them far away, where simplified meshes help.
const FAR: &str = "cube:16x8,log,outer=64";

/// Measures every skip on a few meshes, and writes `skip_bake.csv` and `skip_bake.json` into `folder`. `cases`: of all meshes only
/// those that have one of these texts in their names.
///
/// # Errors
/// `Failed` when a file cannot be written; else as [`Baker::field`].
pub fn run(bench: &Bench<'_>, folder: &Path, cases: &[String]) -> Result<Vec<BakeSkipRow>> {
    let mut meshes = vec![(generate::sphere(0.5, 4), SMALL), (generate::torus(0.5, 0.2, 96, 48), SMALL)];
    if !bench.quick {
        meshes.push((generate::torus(0.5, 0.2, 200, 100), SMALL));
        meshes.push((large(), FAR));
    }
    meshes.retain(|(mesh, _)| cases.is_empty() || cases.iter().any(|text| mesh.name.contains(text)));
    let mut rows = Vec::new();
    for (mesh, lattice) in &meshes {
        let far = *lattice == FAR;
        let exact = if far { None } else { Some(bake_once(bench, mesh, lattice, 128, &|_| ())?.1) };
        for (skip, off, on) in SKIPS.into_iter().filter(|(skip, ..)| !far || *skip == "simplify") {
            let (mut sides, rounds) = ([None::<BakeTime>; 2], if bench.quick || far { 1 } else { 3 });
            let mut exact = exact.clone();
            for _ in 0..rounds {
                for (side, set) in sides.iter_mut().zip([off, on]) {
                    // Faces and orbits as usual where the mesh is large: without them it would take minutes.
                    let (report, values) = bake_once(bench, mesh, lattice, 64, &|baker| {
                        (baker.faces, baker.orbit) = (far, far);
                        set(baker);
                    })?;
                    let exact = exact.get_or_insert_with(|| values.clone());
                    let now = BakeTime {
                        bake_ms: report.total.as_secs_f64() * 1e3,
                        captured_count: report.samples + report.filled - report.turned,
                        filled_count: report.filled,
                        face_count: report.faces,
                        error: relative(&values, exact),
                    };
                    *side = Some(side.filter(|before| before.bake_ms < now.bake_ms).unwrap_or(now));
                }
            }
            let [Some(off), Some(on)] = sides else { continue };
            (bench.progress)(&format!("{}: {skip} measured", mesh.name));
            rows.push(BakeSkipRow {
                case: mesh.name.clone(),
                triangle_count: mesh.triangles.len(),
                lattice: (*lattice).to_owned(),
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

/// A ring of 102 400 triangles with waves on it.
fn large() -> Mesh {
    let ring = generate::torus(0.5, 0.2, 320, 160);
    let wave = |p: &glam::Vec3| 0.01 * (18.0 * p.x).sin() * (22.0 * p.z + 4.0 * p.y).cos();
    let moved = ring.positions.iter().zip(&ring.normals).map(|(p, n)| *p + wave(p) * *n).collect();
    Mesh::new("large", moved, Vec::new(), None, ring.triangles).expect("a ring with waves is a mesh")
}

/// An occlusion field in f32, nothing left out but what `set` sets.
fn bake_once(
    bench: &Bench<'_>,
    mesh: &Mesh,
    lattice: &str,
    face_px: u32,
    set: &dyn Fn(&mut Baker),
) -> Result<(Report, Vec<f32>)> {
    let mut baker = Baker::new(bench.baker.device(), bench.baker.library());
    (baker.faces, baker.orbit, baker.simplify) = (false, false, false);
    set(&mut baker);
    let lattice = lattice.parse().expect("a lattice");
    let options = bake::Options { lattice, storage: Storage::F32, face_px, ..Default::default() };
    let mut header = bake::header(mesh, FieldKind::Occlusion, &options);
    let store = Buffer::new(baker.device(), "field", BufferKind::Device, header.payload_bytes())?;
    let report = baker.field(mesh, &mut header, (&store, 0), &|_, _| ())?;
    Ok((report, store.download_range(0..header.payload_bytes())?))
}

fn relative(values: &[f32], exact: &[f32]) -> f64 {
    let squares = |it: &mut dyn Iterator<Item = f32>| it.map(|x| f64::from(x).powi(2)).sum::<f64>();
    let off = squares(&mut values.iter().zip(exact).map(|(a, b)| a - b));
    (off / squares(&mut exact.iter().copied()).max(f64::MIN_POSITIVE)).sqrt()
}
