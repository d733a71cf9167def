//! Pass "merge": light on every vertex of every receiver.
//!
//! MergeInputs: entities, clusters and their entries (see [`crate::lists::gather`]), the fields, transfer vectors,
//! vertices (position and normal, object frame, two quads each), the sky's coefficients. Output: `radiosity`, four
//! floats a vertex: radiance that leaves the surface, albedo / pi times the integral of incoming light, without
//! emission.

pub mod calibrate;
pub mod chain;
pub mod twin;
pub mod variant;
pub mod workload;

use crate::error::Result;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device};
use crate::layout::CLUSTER_VERTICES;
use crate::shaders::Library;
use ash::vk;
use std::sync::Arc;
pub use variant::Variant;
use variant::{MergePermutation, Reads};

/// A resource that a variant reads as a block or through a texel view.
pub struct Readable<'b>(Bind<'b>);

impl<'b> Readable<'b> {
    pub fn new(buffer: &'b Buffer, variant: Variant, format: vk::Format) -> Result<Self> {
        Ok(Readable(Bind::read(variant.reads == Reads::Texels, buffer, format)?))
    }

    pub fn bind(&self) -> Bind<'b> {
        self.0.clone()
    }
}

pub struct MergeInputs<'b> {
    /// The same in a whole workgroup: some variants read them as a uniform block.
    pub entities: Readable<'b>,
    pub entries: Readable<'b>,
    pub clusters: Readable<'b>,
    pub fields: Readable<'b>,
    pub transfers: Readable<'b>,
    pub vertices: Readable<'b>,
    /// Coefficients of the sky, a channel after the other, [`crate::field::quantity::channel_stride`] floats apart;
    /// zero without one.
    pub sky: Readable<'b>,
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
            inputs.entities.bind(),
            inputs.entries.bind(),
            inputs.clusters.bind(),
            inputs.fields.bind(),
            inputs.transfers.bind(),
            inputs.vertices.bind(),
            inputs.sky.bind(),
            Bind::Buffer(radiosity),
            inputs.through.map_or(Bind::None, Bind::Buffer),
        ];
        commands.dispatch(&self.pipeline, &resources, &(), [cluster_count * CLUSTER_VERTICES, 1, 1])
    }
}
