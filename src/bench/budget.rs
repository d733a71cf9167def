//! The error of a picture split into its causes, rung by rung of the ladder of [`crate::truth`].

use super::Bench;
use super::cases::Case;
use super::figures::{Difference, Radiosity, difference, rms};
use crate::error::Result;
use crate::field::Storage;
use crate::frame::{self, Frame};
use crate::truth::raycast::{RayCast, relative_error};
use crate::truth::{ExactChain, RayMeshes, Vertex, World, sample_vertices};
use serde::Serialize;

/// Vertices that are judged a scene.
pub const VERTICES: usize = 1500;

/// How a case is judged.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Vertices, chosen at random; all where there are fewer.
    pub vertices: usize,
    /// Rays of T0 a vertex and light.
    pub t0_rays: u32,
    /// Rays of T1 a factor.
    pub t1_rays: u32,
}

impl Effort {
    /// For a quick or a thorough run.
    pub fn new(quick: bool) -> Self {
        if quick {
            Effort { vertices: 1000, t0_rays: 1024, t1_rays: 1024 }
        } else {
            Effort { vertices: VERTICES, t0_rays: 16384, t1_rays: 8192 }
        }
    }
}

/// The upper rungs of a case, which no option of bake or merge moves.
pub struct Truth {
    /// The vertices that are judged.
    pub vertices: Vec<Vertex>,
    /// Rays.
    pub t0: Vec<Radiosity>,
    /// Relative standard error of `t0`.
    pub t0_error: f64,
    /// Exact factors, band-limited chain.
    pub t1: Vec<Radiosity>,
    /// Relative standard error of `t1`, from two halves of its rays.
    pub t1_error: f64,
    /// Root mean square of `t0`: the unit of relative errors.
    pub unit: f64,
    /// Root mean square of what would be there if nothing blocked.
    pub unoccluded: f64,
}

impl Truth {
    /// Casts all rays.
    pub fn new(case: &Case, effort: Effort, seed: u64) -> Self {
        let placements = case.scene.at(case.time_s);
        let shapes = RayMeshes::new(&case.scene);
        let world = World::new(&case.scene, &shapes, &placements);
        let vertices = sample_vertices(&case.scene, effort.vertices, seed);
        let cast = RayCast { rays: effort.t0_rays, seed, distant: case.distant, ..Default::default() };
        let lit = cast.run(&world, &vertices);
        let open = RayCast { rays: 256, runs: 1, shadows: false, ..cast }.run(&world, &vertices);
        let half = |half| ExactChain { rays: effort.t1_rays / 2, seed: seed ^ half, ..Default::default() };
        let (first, second) = (half(1 << 32).run(&world, &vertices), half(2 << 32).run(&world, &vertices));
        let t0: Vec<Radiosity> = lit.iter().map(|e| e.radiosity).collect();
        let unit = rms(&t0).max(f64::MIN_POSITIVE);
        Truth {
            unit,
            t0,
            t0_error: relative_error(&lit),
            t1_error: difference(&first, &second, unit).rms / 2.0,
            t1: first.iter().zip(&second).map(|(a, b)| std::array::from_fn(|c| (a[c] + b[c]) / 2.0)).collect(),
            unoccluded: rms(&open.iter().map(|e| e.radiosity).collect::<Vec<_>>()),
            vertices,
        }
    }

    /// Difference to T0 relative to its root mean square.
    pub fn error(&self, of: &[Radiosity]) -> Difference {
        difference(of, &self.t0, self.unit)
    }
}

/// Values of the judged vertices from values of all, by entity.
pub fn select(all: &[(usize, Vec<Radiosity>)], vertices: &[Vertex]) -> Vec<Radiosity> {
    let of = |v: &Vertex| all.iter().find(|(entity, _)| *entity == v.entity).expect("it receives").1[v.index];
    vertices.iter().map(of).collect()
}

/// The device's radiosity of the judged vertices after a merge.
///
/// # Errors
/// `Device` when memory ran out.
pub fn device_radiosity(frame: &Frame, vertices: &[Vertex]) -> Result<Vec<Radiosity>> {
    let mut all = Vec::new();
    for (entity, _) in frame.scene().entities.iter().enumerate().filter(|(_, e)| e.receives) {
        let wide = frame.radiosity(entity)?.into_iter().map(|rgb| rgb.map(f64::from)).collect();
        all.push((entity, wide));
    }
    Ok(select(&all, vertices))
}

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Budget {
    /// Scene and light.
    pub case: String,
    /// Vertices judged.
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// T0's own relative standard error.
    #[serde(rename = "t0_error_relative")]
    pub t0_error: f64,
    /// T1's own relative standard error.
    #[serde(rename = "t1_error_relative")]
    pub t1_error: f64,
    /// T0 to T1.
    pub bands: Difference,
    /// T1 to T2.
    pub sampling: Difference,
    /// T2 to T3.
    pub arithmetic_and_storage: Difference,
    /// T1 to T3: all that better code or more memory could take away.
    pub below_bands: Difference,
    /// T0 to T3.
    pub total: Difference,
    /// T0's root mean square over that of the unoccluded value: what turns errors relative to T0 into errors relative to it.
    #[serde(rename = "t0_per_unoccluded_ratio")]
    pub t0_per_unoccluded: f64,
}

/// Climbs down the ladder, with fields and a merge of the given options.
///
/// # Errors
/// As [`Frame::new`].
pub fn budget(bench: &Bench<'_>, case: &Case, truth: &Truth, options: frame::Options) -> Result<Budget> {
    let placements = case.scene.at(case.time_s);
    let wide = frame::Options { bake: crate::bake::Options { storage: Storage::F32, ..options.bake }, ..options };
    let t2 = select(&bench.frame(&case.scene, wide)?.reference(&placements)?, &truth.vertices);
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, None)?;
    let t3 = device_radiosity(&frame, &truth.vertices)?;
    let between = |a: &[Radiosity], b: &[Radiosity]| difference(a, b, truth.unit);
    Ok(Budget {
        case: case.name.clone(),
        vertices: truth.vertices.len(),
        t0_error: truth.t0_error,
        t1_error: truth.t1_error,
        bands: between(&truth.t0, &truth.t1),
        sampling: between(&truth.t1, &t2),
        arithmetic_and_storage: between(&t2, &t3),
        below_bands: between(&truth.t1, &t3),
        total: between(&truth.t0, &t3),
        t0_per_unoccluded: truth.unit / truth.unoccluded.max(f64::MIN_POSITIVE),
    })
}
