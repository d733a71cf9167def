//! The error of a picture, split into its causes by the rungs of [`crate::truth`].

use super::Bench;
use super::cases::Case;
use super::figures::{Radiosity, VertexDifference, difference, rms};
use crate::error::{Error, Result};
use crate::field::Storage;
use crate::frame::{self, Frame};
use crate::scene::Lights;
use crate::scene::light::has_sharp;
use crate::truth::raycast::{RayCast, relative_error};
use crate::truth::{RayMeshes, Vertex, World, sample_vertices};
use serde::Serialize;

/// Number of vertices that are compared per scene.
pub const VERTICES: usize = 1500;

/// Effort of the truth of a case.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Number of vertices, chosen at random; all if there are fewer.
    pub vertices: usize,
    /// Rays of T0 per vertex and light.
    pub t0_rays: u32,
}

impl Effort {
    /// Effort of a quick or a thorough run.
    pub fn new(quick: bool) -> Self {
        if quick { Effort { vertices: 1000, t0_rays: 1024 } } else { Effort { vertices: VERTICES, t0_rays: 16384 } }
    }
}

/// Vertices chosen at random, and their radiosity by ray casting (T0).
pub struct Reference {
    pub vertices: Vec<Vertex>,
    pub t0: Vec<Radiosity>,
    /// Relative standard error of `t0`.
    pub t0_error: f64,
    /// Root mean square of `t0`: the unit of relative errors.
    pub unit: f64,
}

impl Reference {
    /// The truth of a case, which does not depend on options of bake or merge; an error where no light reaches any of
    /// the vertices.
    pub fn of_case(case: &Case, effort: Effort, seed: u64) -> Result<Self> {
        let shapes = RayMeshes::new(&case.scene);
        let world = World::new(&case.scene, &shapes, &case.scene.at(case.time_s));
        let cast = RayCast { rays: effort.t0_rays, seed, distant: case.distant, ..Default::default() };
        let reference = Reference::new(&world, effort.vertices, &cast);
        if reference.t0.as_flattened().iter().any(|c| *c > 0.0) {
            return Ok(reference);
        }
        let count = reference.vertices.len();
        let what = format!("no light reaches any of the {count} judged vertices, so there is nothing to compare");
        Err(Error::Input(format!("{}: {what}", case.name)))
    }

    /// `count` vertices of the world's scene, or all if there are fewer.
    pub fn new(world: &World<'_>, count: usize, cast: &RayCast) -> Self {
        let vertices = sample_vertices(world.scene, count, cast.seed);
        let lit = cast.run(world, &vertices);
        let t0: Vec<Radiosity> = lit.iter().map(|e| e.radiosity).collect();
        let unit = rms(&t0).max(f64::MIN_POSITIVE);
        Reference { vertices, t0, t0_error: relative_error(&lit), unit }
    }

    /// Difference to T0 relative to its root mean square.
    pub fn error(&self, of: &[Radiosity]) -> VertexDifference {
        difference(of, &self.t0, self.unit)
    }
}

/// Values of the compared vertices, from values of all vertices by entity.
pub fn select(all: &[(usize, Vec<Radiosity>)], vertices: &[Vertex]) -> Vec<Radiosity> {
    let of = |v: &Vertex| all.iter().find(|(entity, _)| *entity == v.entity).expect("it receives").1[v.index];
    vertices.iter().map(of).collect()
}

/// The device's radiosity of the compared vertices after a merge.
pub fn device_radiosity(frame: &Frame, vertices: &[Vertex]) -> Result<Vec<Radiosity>> {
    let mut all = Vec::new();
    for (entity, _) in frame.scene().entities.iter().enumerate().filter(|(_, e)| e.receives) {
        let wide = frame.radiosity(entity)?.into_iter().map(|rgb| rgb.map(f64::from)).collect();
        all.push((entity, wide));
    }
    Ok(select(&all, vertices))
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

/// Computes T1 and T2 with fields and a merge of the given options, all lights in SH, and compares all rungs; then the
/// same merge with sharp lights.
pub fn budget(bench: &Bench<'_>, case: &Case, reference: &Reference, options: frame::Options) -> Result<Budget> {
    let placements = case.scene.at(case.time_s);
    let options = frame::Options { lights: Lights::Sh, ..options };
    let wide = frame::Options { bake: crate::bake::Options { storage: Storage::F32, ..options.bake }, ..options };
    let t1 = select(&bench.frame(&case.scene, wide)?.twin(&placements)?, &reference.vertices);
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, None)?;
    let t2 = device_radiosity(&frame, &reference.vertices)?;
    let sharp_total = if has_sharp(&case.scene, Lights::Sharp) {
        let mut frame = bench.frame(&case.scene, frame::Options { lights: Lights::Sharp, ..options })?;
        frame.render(&placements, None)?;
        Some(reference.error(&device_radiosity(&frame, &reference.vertices)?))
    } else {
        None
    };
    let between = |a: &[Radiosity], b: &[Radiosity]| difference(a, b, reference.unit);
    Ok(Budget {
        case: case.name.clone(),
        vertices: reference.vertices.len(),
        t0_error: reference.t0_error,
        bands_and_sampling: between(&reference.t0, &t1),
        arithmetic_and_storage: between(&t1, &t2),
        total: between(&reference.t0, &t2),
        sharp_total,
    })
}
