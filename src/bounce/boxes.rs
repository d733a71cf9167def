//! Pass "hidden links": what boxes that move hide of the links between what rests.
//!
//! Of most things that move it is known how much of a vertex's view they take, and not which links that is: all are
//! dimmed alike ([`super::movers`]), and through a closed door came most of the light of the room behind. Boxes in closed
//! form ([`crate::field::cuboid`]) hide of each link what they hide of a round light that takes as much of the view, in
//! the mean direction of its rays and as far away as its run. Such links serve the frame, and the boxes dim no others;
//! the light that they reflect themselves comes as that of all movers.

use super::LinkedLight;
use crate::bake::links;
use crate::error::Result;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device, Upload};
use crate::layout::{CLUSTER_VERTICES, QUAD_FORMAT};
use crate::merge::MergeInputs;
use crate::merge::variant::MergePermutation;
use crate::scene::MOST_SCREENS;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Rays that are flatter than this over the surface count as this: they are few.
pub(super) const LEAST_COSINE: f64 = 0.1;
/// Width of the light that stands for a link's rays, of a disc's that takes as much of the view: rays that come through a
/// door lie closer together than a disc's, and a door that is shut should let none of them through.
pub(super) const NARROWED: f64 = 0.5;

pub(super) struct Boxes {
    pipeline: ComputePipeline,
    texels: bool,
    pub push: BoxPush,
    /// Of all links, the mean directions of their rays.
    pub directions: Buffer,
    /// All links, as the last frame has left them.
    pub links: Buffer,
}

/// What the pass is pushed.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct BoxPush {
    count: u32,
    /// Numbers of entities.
    entities: [u32; MOST_SCREENS],
}

impl BoxPush {
    pub fn entities(&self) -> &[u32] {
        &self.entities[..self.count as usize]
    }
}

impl Boxes {
    /// `None` without boxes. Reads what [`super::movers`] reads in the same way.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        boxes: &[usize],
        [links, directions]: [&[u32]; 2],
        permutation: &MergePermutation,
    ) -> Result<Option<Self>> {
        if boxes.is_empty() {
            return Ok(None);
        }
        let mut entities = [0; MOST_SCREENS];
        entities.iter_mut().zip(boxes).for_each(|(to, entity)| *to = *entity as u32);
        Ok(Some(Boxes {
            pipeline: ComputePipeline::new(device, "hidden links", &library.shader(&hidden_row(permutation))?)?,
            texels: permutation.reads_texels(),
            push: BoxPush { count: boxes.len() as u32, entities },
            directions: Buffer::with_data(device, "directions of links", directions)?,
            // Links of what receives no light stay so.
            links: Buffer::with_data(device, "links past boxes", links)?,
        }))
    }

    /// Writes the links of so many clusters.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &MergeInputs<'r>,
        (clusters, cluster_count): (&'r Upload, u32),
        baked: &LinkedLight<'r>,
        edges: &'r Buffer,
    ) -> Result<()> {
        let resources = [
            inputs.entities.clone(),
            Bind::read(self.texels, clusters, vk::Format::R32G32_UINT)?,
            inputs.vertices.clone(),
            Bind::read(self.texels, baked.ranges, vk::Format::R32G32_UINT)?,
            Bind::read(self.texels, baked.links, vk::Format::R32_UINT)?,
            Bind::read(self.texels, baked.run_places, QUAD_FORMAT)?,
            Bind::read(self.texels, edges, QUAD_FORMAT)?,
            Bind::read(self.texels, &self.directions, vk::Format::R32_UINT)?,
            Bind::Buffer(&self.links),
        ];
        commands.dispatch(&self.pipeline, &resources, &self.push, [cluster_count * CLUSTER_VERTICES, 1, 1])
    }
}

pub fn hidden_row(permutation: &MergePermutation) -> ShaderPermutation {
    links::macros(permutation.row_of("hidden_links.comp"))
        .number("LEAST_COSINE", LEAST_COSINE)
        .number("NARROWED", NARROWED)
        .define("MOST_BOXES", MOST_SCREENS as u32)
        .define("BOXES", false)
        .define("HALVES", false)
        .define("CUBOIDS", true)
        .outlines()
}
