//! Pass "merge": light on every vertex of every receiver.
//!
//! Output: `radiosity`, four floats a vertex: radiance that leaves the surface, albedo / pi times the integral of
//! incoming light, without emission.

pub mod calibrate;
pub mod chain;
pub mod twin;
pub mod variant;
pub mod workload;

use crate::error::Result;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device};
use crate::layout::CLUSTER_VERTICES;
use crate::shaders::Library;
use std::sync::Arc;
use variant::MergePermutation;
pub use variant::Variant;

/// What the pass reads, as its variant does: as blocks or through texel views ([`Bind::read`]).
pub struct MergeInputs<'b> {
    /// The same in a whole workgroup: some variants read them as a uniform block.
    pub entities: Bind<'b>,
    pub entries: Bind<'b>,
    pub clusters: Bind<'b>,
    pub fields: Bind<'b>,
    pub transfers: Bind<'b>,
    /// Position and normal in the object's frame, two quads a vertex.
    pub vertices: Bind<'b>,
    /// Coefficients of the sky, a channel after the other, [`crate::field::quantity::channel_stride`] floats apart;
    /// zero without one.
    pub sky: Bind<'b>,
    /// Where the transfer at the end of the sky's chain goes, in the permutation that keeps it.
    pub through: Option<&'b Buffer>,
}

pub struct Merge {
    pipeline: ComputePipeline,
    pub permutation: MergePermutation,
}

impl Merge {
    pub fn new(device: &Arc<Device>, library: &Library, permutation: MergePermutation) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, "merge", &library.shader(&permutation.row())?)?;
        Ok(Merge { pipeline, permutation })
    }

    /// Lights the first `cluster_count` clusters.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &MergeInputs<'r>,
        radiosity: &'r Buffer,
        cluster_count: u32,
    ) -> Result<()> {
        let resources = [
            inputs.entities.clone(),
            inputs.entries.clone(),
            inputs.clusters.clone(),
            inputs.fields.clone(),
            inputs.transfers.clone(),
            inputs.vertices.clone(),
            inputs.sky.clone(),
            Bind::Buffer(radiosity),
            inputs.through.map_or(Bind::None, Bind::Buffer),
        ];
        commands.dispatch(&self.pipeline, &resources, &(), [cluster_count * CLUSTER_VERTICES, 1, 1])
    }
}
