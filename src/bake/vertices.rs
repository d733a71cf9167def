//! What is baked of every vertex of a mesh: its transfer vector and its self-visibility. Both come from one capture of the faces
//! around the vertex, in which a texel holds how far away the mesh is.
//!
//! Every vertex has its faces' places in the plan of the captures, whatever is wanted of it. So the numbers do not depend on whether
//! one of the two is baked alone.

use super::batches::{CaptureTarget, Captures, Reduction};
use super::partial::Partial;
use super::project::{Job, Projection};
use super::symmetric_samples::{self, Turned};
use super::symmetry::Symmetry;
use super::triangles::unit_positions;
use super::{BakeReport, Baker, Options, Progress, TRANSFER_OFFSET, levels, triangles};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::BYTES;
use std::time::Instant;

/// Which of the two is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Transfer vectors.
    pub transfer: bool,
    /// Self-visibility.
    pub self_visibility: bool,
}

impl Wanted {
    /// Both.
    pub const BOTH: Wanted = Wanted { transfer: true, self_visibility: true };
    /// Transfer vectors alone.
    pub const TRANSFER: Wanted = Wanted { transfer: true, self_visibility: false };
    /// Self-visibility alone.
    pub const SELF_VISIBILITY: Wanted = Wanted { transfer: false, self_visibility: true };

    /// Words for it, for people.
    pub(super) fn name(self) -> &'static str {
        match (self.transfer, self.self_visibility) {
            (true, true) => "transfer and self-visibility",
            (true, false) => "transfer",
            _ => "self-visibility",
        }
    }

    /// How the faces of a vertex are reduced.
    pub(super) fn reduction(self, bands: usize) -> Reduction {
        match (self.transfer, self.self_visibility) {
            (true, true) => Reduction::Vertex { bands },
            (true, false) => Reduction::Project { bands, projection: Projection::Transfer },
            _ => Reduction::SelfVisibility,
        }
    }
}

/// What was baked, in the mesh's order of vertices; empty where it was not wanted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// Transfer vectors, `channel_stride(bands)` floats each, in the object's frame.
    pub transfer: Vec<f32>,
    /// Self-visibility, [`BYTES`] each, as [`crate::field::self_visibility`] reads it.
    pub self_visibility: Vec<u8>,
}

impl Baker {
    /// Bakes what is wanted of every vertex, going on from what a cancelled bake of the same has kept. A flat or convex mesh needs none
    /// of it, since the cosine lobe of the normal is exact there and nothing hides a light. Transfer vectors are turned from vertex to
    /// vertex by the mesh's symmetries. Maps of self-visibility are not, since a turn would lay the nodes of one beside those of another.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn vertices_from(
        &self,
        partial: &Partial,
        mesh: &Mesh,
        options: &Options,
        wanted: Wanted,
        progress: Progress<'_>,
    ) -> Result<(Vertices, BakeReport)> {
        let started = Instant::now();
        triangles::tell_repeated(mesh);
        let Options { bands, face_px, shortcuts, .. } = *options;
        let (targets, turned) = targets(mesh, options, wanted);
        let levels = levels::are_used(mesh, options.levels);
        let reduction = wanted.reduction(bands);
        let captures = Captures { mesh, reduction, face_px, shortcuts, levels, partial };
        let mut samples = vec![0_u8; mesh.positions.len() * reduction.sample_bytes()];
        let mut report = captures.run(self, &targets, &mut samples, progress)?;
        let mut out = parted(samples, mesh.positions.len(), bands, wanted);
        report.samples = mesh.positions.len() as u32;
        if wanted.transfer {
            symmetric_samples::turn_all(&mut out.transfer, &turned, bands, 1);
            report.turned = turned.iter().flatten().count() as u32;
        }
        report.total = started.elapsed();
        Ok((out, report))
    }

    /// Bakes the transfer vector of every vertex.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn transfer(&self, mesh: &Mesh, options: &Options, progress: Progress<'_>) -> Result<(Vec<f32>, BakeReport)> {
        let (baked, report) = self.vertices_from(&Partial::new(None), mesh, options, Wanted::TRANSFER, progress)?;
        Ok((baked.transfer, report))
    }

    /// Bakes the self-visibility of every vertex.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn self_visibility(
        &self,
        mesh: &Mesh,
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<(Vec<u8>, BakeReport)> {
        let (baked, report) =
            self.vertices_from(&Partial::new(None), mesh, options, Wanted::SELF_VISIBILITY, progress)?;
        Ok((baked.self_visibility, report))
    }
}

/// A target for every vertex, just off the surface, and for every vertex the one whose transfer vector is turned for it, or `None` where
/// its own is projected. Where a vertex needs no projection, the factor of its job is 0.
pub(super) fn targets(mesh: &Mesh, options: &Options, wanted: Wanted) -> (Vec<CaptureTarget>, Vec<Option<Turned>>) {
    let turned = if wanted.transfer && options.shortcuts.symmetry {
        let symmetry = Symmetry::of_vertices(mesh, None);
        symmetric_samples::plan_vertices(mesh, &symmetry, options.face_px, f64::from(TRANSFER_OFFSET))
    } else {
        vec![None; mesh.positions.len()]
    };
    let vertices = unit_positions(mesh).into_iter().zip(&mesh.normals).zip(&turned).enumerate();
    let target = |(vertex, ((position, normal), turned)): (usize, ((glam::Vec3, &glam::Vec3), &Option<Turned>))| {
        let scale = if turned.is_some() { 0.0 } else { 1.0 };
        let normal4 = normal.extend(0.0).to_array();
        let job = Job { normal: normal4, slots: [0; 6], target: vertex as u32, scale };
        CaptureTarget { eye: position + TRANSFER_OFFSET * *normal, job }
    };
    (vertices.map(target).collect(), turned)
}

/// The samples of all vertices, taken apart.
fn parted(samples: Vec<u8>, count: usize, bands: usize, wanted: Wanted) -> Vertices {
    let floats = if wanted.transfer { channel_stride(bands) } else { 0 };
    let bytes = if wanted.self_visibility { BYTES } else { 0 };
    let mut out = Vertices::default();
    out.transfer.reserve_exact(count * floats);
    out.self_visibility.reserve_exact(count * bytes);
    for sample in samples.chunks_exact(4 * floats + bytes) {
        let (transfer, map) = sample.split_at(4 * floats);
        out.transfer.extend(bytemuck::pod_collect_to_vec::<u8, f32>(transfer));
        out.self_visibility.extend_from_slice(map);
    }
    out
}
