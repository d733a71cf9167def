//! Pass "hidden links": what boxes that move hide of the links between what rests.
//!
//! Of most things that move it is known how much of a vertex's view they take, and not which links that is: all are
//! dimmed alike ([`super::movers`]), and through a closed door came most of the light of the room behind. Boxes in closed
//! form ([`crate::field::cuboid`]) hide of each link what they hide of a round light that takes as much of the view, in
//! the mean direction of its rays and as far away as its run. Such links serve the frame, and the boxes dim no others;
//! the light that they reflect themselves comes as that of all movers.

use super::{LinkBuffers, LinkList};
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
    texels: bool,
    pub push: BoxPush,
    /// Those of vertices, then of runs.
    pub hidden: [HiddenLinks; 2],
}

pub(super) struct HiddenLinks {
    pipeline: ComputePipeline,
    /// Mean directions of their rays.
    pub directions: Buffer,
    /// As the last frame has left them.
    links: Buffer,
}

/// What the pass is pushed.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct BoxPush {
    count: u32,
    /// Numbers of entities.
    entities: [u32; MOST_SCREENS],
    /// Runs of the scene.
    run_count: u32,
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
        [of_vertices, of_runs]: [&LinkList; 2],
        permutation: &MergePermutation,
    ) -> Result<Option<Self>> {
        if boxes.is_empty() {
            return Ok(None);
        }
        let run_count = of_runs.ranges.len() as u32;
        let mut entities = [0; MOST_SCREENS];
        entities.iter_mut().zip(boxes).for_each(|(to, entity)| *to = *entity as u32);
        let hidden = |list: &LinkList, runs| -> Result<HiddenLinks> {
            let shader = library.shader(&hidden_row(permutation, runs))?;
            Ok(HiddenLinks {
                pipeline: ComputePipeline::new(device, "hidden links", &shader)?,
                directions: Buffer::with_data(device, "directions of links", &list.directions)?,
                // Links of what receives no light stay so.
                links: Buffer::with_data(device, "links past boxes", &list.links)?,
            })
        };
        Ok(Some(Boxes {
            texels: permutation.reads_texels(),
            push: BoxPush { count: boxes.len() as u32, entities, run_count },
            hidden: [hidden(of_vertices, false)?, hidden(of_runs, true)?],
        }))
    }

    pub fn links(&self) -> [&Buffer; 2] {
        self.hidden.each_ref().map(|hidden| &hidden.links)
    }

    /// Writes the links of the vertices of so many clusters, and of all runs, from those that are `baked`.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &MergeInputs<'r>,
        (clusters, cluster_count): (&'r Upload, u32),
        baked: [&'r LinkBuffers; 2],
        [run_places, edges]: [&'r Buffer; 2],
    ) -> Result<()> {
        let threads = [cluster_count * CLUSTER_VERTICES, self.push.run_count];
        for ((hidden, baked), threads) in self.hidden.iter().zip(baked).zip(threads) {
            let resources = [
                inputs.entities.clone(),
                Bind::read(self.texels, clusters, vk::Format::R32G32_UINT)?,
                inputs.vertices.clone(),
                Bind::read(self.texels, &baked.ranges, vk::Format::R32G32_UINT)?,
                Bind::read(self.texels, &baked.links, vk::Format::R32_UINT)?,
                Bind::read(self.texels, run_places, QUAD_FORMAT)?,
                Bind::read(self.texels, edges, QUAD_FORMAT)?,
                Bind::read(self.texels, &hidden.directions, vk::Format::R32_UINT)?,
                Bind::Buffer(&hidden.links),
            ];
            commands.dispatch(&hidden.pipeline, &resources, &self.push, [threads, 1, 1])?;
        }
        Ok(())
    }
}

/// The links of vertices, or of runs.
pub fn hidden_row(permutation: &MergePermutation, runs: bool) -> ShaderPermutation {
    links::macros(permutation.row_of("hidden_links.comp"))
        .define("OF_RUNS", runs)
        .number("LEAST_COSINE", LEAST_COSINE)
        .number("NARROWED", NARROWED)
        .define("MOST_BOXES", MOST_SCREENS as u32)
        .define("BOXES", false)
        .define("HALVES", false)
        .define("CUBOIDS", true)
        .outlines()
}
