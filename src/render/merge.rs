//! Pass "merge": light on every vertex of every receiver.
//!
//! Inputs: entities and their rotations, a list of occluders, the field store, transfer vectors, vertices (position and
//! normal, object frame, two quads each), the sky's coefficients. Output: `radiosity`, four floats a vertex: radiance that
//! leaves the surface, albedo / pi times the integral of incoming light, without emission.

use super::variant::{Form, MAX_LIGHTS, Variant};
use crate::error::Result;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device, TexelView};
use crate::layout::{NONE, Push};
use crate::shaders::Library;
use ash::vk;
use std::ops::Range;
use std::sync::Arc;

/// One dispatch: a receiver under some of the lights.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Entity that is lit.
    pub receiver: u32,
    /// Its vertices in the vertex buffer.
    pub vertices: Range<u32>,
    /// First quad of its transfer vectors, or [`NONE`].
    pub transfer_first: u32,
    /// Its part of the occluder list.
    pub occluders: Range<u32>,
    /// Lights of this dispatch, at most [`MAX_LIGHTS`].
    pub lights: Vec<u32>,
    /// Whether the distant light is in this dispatch.
    pub sky: bool,
    /// Whether an earlier dispatch has written the same vertices.
    pub accumulate: bool,
    /// Byte range of the receiver's vertices in the radiosity buffer.
    pub radiosity: Range<u64>,
}

/// A resource that a variant reads as a storage block or through a texel view.
pub struct Readable<'b> {
    buffer: &'b Buffer,
    view: Option<TexelView<'b>>,
}

impl<'b> Readable<'b> {
    /// Prepares `buffer` for `variant`.
    ///
    /// # Errors
    /// `Input` when a texel view of the device cannot hold it.
    pub fn new(buffer: &'b Buffer, variant: Variant, format: vk::Format) -> Result<Self> {
        let view = variant.texel.then(|| TexelView::new(buffer, format)).transpose()?;
        Ok(Readable { buffer, view })
    }

    fn bind<'r>(&'r self) -> Bind<'r> {
        match &self.view {
            Some(view) => Bind::Texel(view),
            None => Bind::Buffer(self.buffer),
        }
    }
}

/// Everything that a merge reads.
pub struct Inputs<'b> {
    /// [`crate::layout::Entity`] of every entity.
    pub entities: &'b Buffer,
    /// Rotation blocks of every entity, [`rotation_stride`] floats apart.
    pub rotations: &'b Buffer,
    /// Occluders of all jobs.
    pub list: &'b Buffer,
    /// Field store.
    pub fields: Readable<'b>,
    /// Transfer vectors.
    pub transfers: Readable<'b>,
    /// Positions and normals.
    pub vertices: Readable<'b>,
    /// Four floats a coefficient: red, green, blue of the sky.
    pub sky: &'b Buffer,
}

/// Floats of one entity's rotation in the buffer.
pub fn rotation_stride(bands: usize) -> usize {
    crate::sh::rotation::block_count(bands).next_multiple_of(4)
}

/// A pipeline for every combination of lights and sky that a scene has.
pub struct Merge {
    pipelines: Vec<((usize, bool), ComputePipeline)>,
}

impl Merge {
    /// Pipelines for the dispatches in `jobs`; `form` gives everything but lights and sky.
    ///
    /// # Errors
    /// `Failed` when a shader does not compile.
    pub fn new(device: &Arc<Device>, library: &Library, form: Form, kinds: &[(usize, bool)]) -> Result<Self> {
        let mut pipelines: Vec<((usize, bool), ComputePipeline)> = Vec::new();
        for &(lights, sky) in kinds {
            assert!(lights as u32 <= MAX_LIGHTS, "{lights} lights in one dispatch");
            if pipelines.iter().any(|(kind, _)| *kind == (lights, sky)) {
                continue;
            }
            let shader = library.shader(&Form { lights: lights as u32, sky, ..form }.row())?;
            pipelines.push(((lights, sky), ComputePipeline::new(device, "merge", &shader, &[])?));
        }
        Ok(Merge { pipelines })
    }

    /// Dispatches one job.
    ///
    /// # Errors
    /// `Input` when a buffer is larger than the device can bind.
    ///
    /// # Panics
    /// When [`Merge::new`] was not told of the job's kind.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &'r Inputs<'r>,
        radiosity: &'r Buffer,
        job: &Job,
    ) -> Result<()> {
        let kind = (job.lights.len(), job.sky);
        let (_, pipeline) =
            self.pipelines.iter().find(|(k, _)| *k == kind).unwrap_or_else(|| panic!("no merge pipeline for {kind:?}"));
        let mut light = [NONE; MAX_LIGHTS as usize];
        light[..job.lights.len()].copy_from_slice(&job.lights);
        let push = Push {
            vertex_first: job.vertices.start,
            vertex_count: job.vertices.end - job.vertices.start,
            transfer_first: job.transfer_first,
            receiver: job.receiver,
            occluder_first: job.occluders.start,
            occluder_count: job.occluders.end - job.occluders.start,
            accumulate: job.accumulate.into(),
            spare: 0,
            light,
            digit: std::array::from_fn(|i| i as u32),
        };
        let resources = [
            Bind::Buffer(inputs.entities),
            Bind::Buffer(inputs.rotations),
            Bind::Buffer(inputs.list),
            inputs.fields.bind(),
            inputs.transfers.bind(),
            inputs.vertices.bind(),
            Bind::Buffer(inputs.sky),
            Bind::Range(radiosity, job.radiosity.clone()),
        ];
        commands.dispatch(pipeline, &resources, &push, [push.vertex_count, 1, 1])
    }
}
