//! "self_visibility" against its twin, which searches the same captured texels in f64.

use super::CheckRow;
use super::project::Content;
use crate::asset::{Mesh, generate};
use crate::bake::capture::{Capture, CaptureKind};
use crate::bake::project::Projection;
use crate::bake::self_visibility::twin;
use crate::bake::triangles::unit_positions;
use crate::bake::{Baker, TRANSFER_OFFSET};
use crate::error::Result;
use crate::field::self_visibility::{BYTES, NODES};
use crate::sh::cube::FACE_COUNT;
use rayon::prelude::*;

/// Largest difference in steps of 0.35 degrees: two texels that f32 cannot tell apart differ in width by less.
pub const STEPS: f64 = 1.0;

/// Share of nodes whose distance may be that of another texel, which is as near the node as the twin's.
pub const OTHER_DISTANCES: f64 = 0.02;

/// Vertices that are compared, or fewer where their faces are too large for one atlas.
const VERTICES: usize = 48;

pub struct Compared {
    /// Largest difference of an angle in steps.
    pub worst_steps: f64,
    /// Nodes whose angle is neither limit.
    pub between: usize,
    /// Share of nodes with another distance.
    pub other_distances: f64,
}

/// Compares the maps of some vertices of a mesh.
pub fn compare(baker: &Baker, mesh: &Mesh, face_px: u32) -> Result<Compared> {
    let positions = unit_positions(mesh);
    let room = Capture::columns(baker.device(), face_px, CaptureKind::Distance).pow(2) as usize / FACE_COUNT;
    let chosen: Vec<usize> = (0..positions.len()).step_by(positions.len().div_ceil(VERTICES.min(room))).collect();
    let normals: Vec<_> = chosen.iter().map(|&v| mesh.normals[v]).collect();
    let eyes: Vec<_> =
        chosen.iter().zip(&normals).map(|(&v, normal)| positions[v] + TRANSFER_OFFSET * *normal).collect();
    let content = Content::new(baker, mesh, &eyes, (face_px, CaptureKind::Distance, true))?;
    let maps = content.run_self_visibility(&content.vertices(&normals))?;
    let twin_of = |eye: usize| {
        let byte = |face, x, y| (255.0 * content.texel(eye, face, x, y, Projection::Transfer)[0]).round() as u8;
        twin(face_px as usize, normals[eye], byte)
    };
    let twins: Vec<u8> = (0..eyes.len()).into_par_iter().flat_map_iter(twin_of).collect();
    assert_eq!((maps.len(), twins.len()), (eyes.len() * BYTES, maps.len()), "maps and twins");
    let steps = |byte: &u8| i32::from(byte.cast_signed());
    let angles =
        |maps: &[u8]| -> Vec<i32> { maps.chunks_exact(BYTES).flat_map(|map| &map[..NODES]).map(steps).collect() };
    let found = angles(&maps);
    let wanted = angles(&twins);
    let worst = found.iter().zip(&wanted).map(|(map, twin)| (map - twin).abs()).max();
    // Two texels that lie equally near a node may differ in distance.
    let distances =
        |maps: &[u8]| -> Vec<u8> { maps.chunks_exact(BYTES).flat_map(|map| &map[NODES..]).copied().collect() };
    let apart = distances(&maps).into_iter().zip(distances(&twins)).filter(|(a, b)| a != b);
    Ok(Compared {
        worst_steps: f64::from(worst.unwrap_or(i32::MAX)),
        between: found.iter().filter(|angle| angle.abs() < 127).count(),
        other_distances: apart.count() as f64 / found.len() as f64,
    })
}

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    // The larger faces take more than 32 words, and more than one a row.
    for face_px in [16, 48] {
        let mesh = generate::torus(1.0, 0.3, 24, 12);
        let Compared { worst_steps, between, other_distances } = compare(baker, &mesh, face_px)?;
        let worst = if between > 100 { worst_steps } else { f64::INFINITY };
        let what = format!("{}, {face_px} px", mesh.name);
        add(CheckRow::new("self_visibility", what.clone(), "steps", worst, STEPS));
        add(CheckRow::new("self_visibility", what, "share of other distances", other_distances, OTHER_DISTANCES));
    }
    Ok(())
}
