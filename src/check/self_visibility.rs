//! "self_visibility" against its twin, which searches the same captured texels in f64.

use super::CheckRow;
use super::project::Content;
use crate::asset::{Mesh, generate};
use crate::bake::capture::{Capture, unit_positions};
use crate::bake::project::Projection;
use crate::bake::self_visibility::twin;
use crate::bake::{Baker, TRANSFER_OFFSET};
use crate::error::Result;
use crate::field::self_visibility::NODES;
use crate::sh::cube::FACE_COUNT;
use rayon::prelude::*;

/// Largest difference in steps of 0.35 degrees: two texels that f32 cannot tell apart differ in width by less.
pub const STEPS: f64 = 1.0;

/// Vertices that are compared, or fewer where their faces are too large for one atlas.
const VERTICES: usize = 48;

/// The largest difference in steps over some vertices of a mesh, and the number of nodes that hold neither limit.
///
/// # Errors
/// As [`Content::new`].
pub fn compare(baker: &Baker, mesh: &Mesh, face_px: u32) -> Result<(f64, usize)> {
    let positions = unit_positions(mesh);
    let room = Capture::columns(baker.device(), face_px, false).pow(2) as usize / FACE_COUNT;
    let chosen: Vec<usize> = (0..positions.len()).step_by(positions.len().div_ceil(VERTICES.min(room))).collect();
    let normals: Vec<_> = chosen.iter().map(|&v| mesh.normals[v]).collect();
    let eyes: Vec<_> =
        chosen.iter().zip(&normals).map(|(&v, normal)| positions[v] + TRANSFER_OFFSET * *normal).collect();
    let content = Content::new(baker, mesh, &eyes, (face_px, false, true))?;
    let maps = content.run_self_visibility(&content.vertex_jobs(&normals))?;
    let twin_of = |eye: usize| {
        let free = |face, x, y| content.texel(eye, face, x, y, Projection::Transfer)[0] > 0.5;
        twin(face_px as usize, normals[eye], free)
    };
    let twins: Vec<u8> = (0..eyes.len()).into_par_iter().flat_map_iter(twin_of).collect();
    assert_eq!((maps.len(), twins.len()), (eyes.len() * NODES, maps.len()), "maps and twins");
    let steps = |byte: &u8| i32::from(byte.cast_signed());
    let worst = maps.iter().zip(&twins).map(|(map, twin)| (steps(map) - steps(twin)).abs()).max();
    Ok((f64::from(worst.unwrap_or(i32::MAX)), maps.iter().filter(|byte| steps(byte).abs() < 127).count()))
}

/// The comparisons of `check`.
///
/// # Errors
/// As [`compare`].
pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    // The larger faces take more than 32 words, and more than one a row.
    for face_px in [16, 48] {
        let mesh = generate::torus(1.0, 0.3, 24, 12);
        let (worst, between) = compare(baker, &mesh, face_px)?;
        let worst = if between > 100 { worst } else { f64::INFINITY };
        add(CheckRow::new("self_visibility", format!("{}, {face_px} px", mesh.name), "steps", worst, STEPS));
    }
    Ok(())
}
