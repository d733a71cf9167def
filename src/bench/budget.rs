//! The error of a picture, split into its causes by the rungs of [`crate::truth`].

use super::cases::Case;
use super::figures::{Radiosity, VertexDifference, difference};
use super::judged::Judged;
use super::{Bench, default_options};
use crate::error::Result;
use crate::field::Storage;
use crate::frame::{self, Frame};
use crate::scene::Lights;
use crate::scene::light::has_sharp;
use crate::truth::{Vertex, error_map};
use serde::Serialize;

/// Values of the compared vertices, from values of all vertices by entity.
fn select<T: Copy + Into<f64>>(all: &[(usize, Vec<[T; 3]>)], vertices: &[Vertex]) -> Vec<Radiosity> {
    let of = |v: &Vertex| all.iter().find(|(entity, _)| *entity == v.entity).expect("it receives").1[v.index];
    vertices.iter().map(|vertex| of(vertex).map(Into::into)).collect()
}

/// The device's radiosity of the compared vertices after a merge.
pub fn device_radiosity(frame: &Frame, vertices: &[Vertex]) -> Result<Vec<Radiosity>> {
    Ok(select(&error_map::radiosity(frame)?, vertices))
}

/// The errors of one case.
#[derive(Clone, Debug, Serialize)]
pub struct Budget {
    /// Scene and light.
    pub case: String,
    /// Number of compared vertices.
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// T0's own relative standard error.
    #[serde(rename = "t0_error_relative")]
    pub t0_error: f64,
    /// T0 to T1: what few bands lose, the lattice, and the merge's order of occluders and lights by their centres.
    pub bands_and_sampling: VertexDifference,
    /// T1 to T2.
    pub arithmetic_and_storage: VertexDifference,
    /// T0 to T2.
    pub total: VertexDifference,
    /// T0 to the merge on the device with sharp lights, which the rungs are not about; none where no light can be
    /// sharp.
    pub sharp_total: Option<VertexDifference>,
}

/// Computes T1 and T2, all lights in SH, and compares all rungs; then the same merge with sharp lights.
pub fn budget(bench: &Bench<'_>, case: &Case, judged: &Judged) -> Result<Budget> {
    let placements = case.scene.at(case.time_s);
    let options = frame::Options { lights: Lights::Sh, ..default_options() };
    let wide = frame::Options { bake: crate::bake::Options { storage: Storage::F32, ..options.bake }, ..options };
    let t1 = select(&bench.frame(&case.scene, wide)?.twin(&placements)?, &judged.keys());
    let merged = |lights: Lights| {
        let mut frame = bench.frame(&case.scene, frame::Options { lights, ..options })?;
        frame.render(&placements, None)?;
        judged.found(&frame)
    };
    let t2 = merged(Lights::Sh)?;
    let is_sharp = has_sharp(&case.scene, Lights::Sharp);
    let sharp = is_sharp.then(|| merged(Lights::Sharp)).transpose()?;
    let between = |a: &[Radiosity], b: &[Radiosity]| difference(a, b, judged.unit);
    Ok(Budget {
        case: case.name.clone(),
        vertices: judged.points.len(),
        t0_error: judged.t0_error,
        bands_and_sampling: between(&judged.t0, &t1),
        arithmetic_and_storage: between(&t1, &t2),
        total: between(&judged.t0, &t2),
        sharp_total: sharp.map(|found| judged.error(&found)),
    })
}
