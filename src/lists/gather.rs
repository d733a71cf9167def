//! Pass "gather": which lookups each cluster of vertices needs, in which order. It runs on the device as a pass of the frame, or on
//! the host.
//!
//! GatherInputs: bounding spheres of the entities, their switches, bounds of the clusters. Output: a list of
//! [`layout::ListEntry`]s a cluster. An entry is left off when it changes no vertex of the cluster (an occluder farther
//! than the light from all of them, or one that the skips in `merge_cone.glsl` weigh with zero everywhere), and, with a
//! threshold `eps`, when the light that it could take or bring is bounded below it.
//!
//! A list is a superset of what matters, within a stated slack ([`crate::lists::scope`]). Lists by host and device may differ by
//! entities within that slack: without a threshold these have a weight of exactly zero in the merge, so the light is the same to the
//! bit; with a threshold each may change a vertex by eps at most. The order in which occluders are multiplied is the same
//! everywhere ([`SceneBounds::order`]).
//!
//! Neighbouring clusters are gathered together, so that the work grows with what may matter to any of them and not with what exists:
//! the host finds that through a tree of the occluders, the device by looking at blocks of them and then into those that matter.
//! What a group leaves out, each cluster would leave off by itself.

use crate::error::Result;
use crate::gpu::{Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, TexelView};
use crate::layout::{self, ENTRY_BITS};
pub use crate::lists::host::{Candidates, counts, twin};
pub use crate::lists::scene_bounds::{
    ClusterBounds, Counts, EntityBounds, ListLight, OutlineView, SceneBounds, distance_key,
};
pub use crate::lists::scope::{SLACK, Scope};
use crate::lists::skip::{CAP_SINES, SKIP_FADE_RAD, Skip};
use crate::lists::tree::Crowd;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Clusters that are gathered for together: enough to share a search, few enough that what is found matters to each. In a town of
/// 4 095 things 32 find 700 of them, 16 find 420; 170 matter to one.
pub const GROUP_CLUSTERS: usize = 16;
/// Invocations of a workgroup: a wave of the commonest GPUs. All of them search, then each has a cluster of its own.
const LANES: u32 = 32;
/// Stretches of distance that occluders are sorted into first.
const BUCKETS: u32 = 64;
/// Occluders that are looked at as one first.
const BLOCK: usize = 64;
/// Occluders that a group may find: 12 bytes each of a workgroup's memory, of which every device has 16 384. A group that finds
/// more is gathered in a second round.
pub const FOUND: usize = 1024;
/// Workgroups of the second round, each with memory of its own for as many occluders as there are: 8 bytes for each, 512 KiB in all
/// for 4 096. Each takes one such group after the other.
const ROOMS: u32 = 16;
/// Occluders times chains that the pass looks at for a cluster on a software device, and entries that a merge takes there: llvmpipe
/// (Mesa 22.3) ends all loops of an invocation after 65 535 turns together, without a word. To sort 1 024 occluders takes up to
/// half of them, and an entry of the merge up to two.
pub const TURNS: u32 = 30_000;

/// Where lists are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// The host makes them, on all its cores.
    Host,
    /// The pass makes them, on the device.
    Device,
}

impl Place {
    /// Where lists are made by default: on the device, but on the host for fewer than 128 entities on a software device, which takes
    /// longer than the host's cores to make so few (`bench scaling --axis entities`).
    pub fn quicker(device: &Device, entity_count: usize) -> Self {
        if device.info.is_software() && entity_count < 128 { Place::Host } else { Place::Device }
    }
}

/// Whether clusters are as near one another as neighbours on a surface are, so that they make a group: a space-filling curve leaps
/// at times. It does not help against a single cluster that spans a leap.
pub fn compact(clusters: &[ClusterBounds]) -> bool {
    let largest = clusters.iter().map(|bounds| bounds.radius_m).fold(0.0, f32::max);
    ClusterBounds::union(clusters).radius_m <= 2.0 * largest * (clusters.len() as f32).sqrt()
}

/// Neighbouring clusters of one receiver that a workgroup gathers for.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Group {
    /// First cluster.
    pub first: u32,
    /// Clusters, at most [`GROUP_CLUSTERS`].
    pub count: u32,
    /// Bounds around them all.
    pub bounds: u32,
    /// Written by the pass: of the group at this place among those that are left to the second round, the number.
    pub left: u32,
}

/// What the device says of the lists that it made.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Report {
    /// Entries of the longest list, as long as it should have been; `u32::MAX` where a group has more to look at than the device can.
    pub longest: u32,
    /// Most occluders that a group found.
    pub most_found: u32,
    /// Entries of all lists.
    pub entry_total: u32,
    /// Groups that found more than [`FOUND`] and were gathered in the second round.
    pub left_count: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Push {
    occluder_count: u32,
    block_first: u32,
    member_first: u32,
    light_first: u32,
    light_count: u32,
    capacity: u32,
    switches: u32,
    sky: f32,
    brightest: f32,
    eps: f32,
}

/// Scene bounds as the device reads them: quads of spheres, blocks of occluders (two quads each), their members, and lights (two each).
pub struct Packed {
    /// The quads.
    pub quads: Vec<[f32; 4]>,
    push: Push,
}

impl Packed {
    /// Packs scene bounds.
    pub fn new(scene: &SceneBounds) -> Self {
        let mut quads = scene.spheres.clone();
        let members = scene.tree.members();
        let block_first = quads.len();
        for block in members.chunks(BLOCK) {
            let crowd = Crowd::around(block.iter().map(|&j| scene.spheres[j as usize]));
            let [x, y, z] = crowd.centre;
            quads.extend([[x, y, z, crowd.reach_m], [crowd.radius_m, 0.0, 0.0, 0.0]]);
        }
        let member_first = quads.len();
        let member = |quad: &[u32]| [0, 1, 2, 3].map(|i| f32::from_bits(quad.get(i).copied().unwrap_or(0)));
        quads.extend(members.chunks(4).map(member));
        let light_first = quads.len();
        for light in &scene.lights {
            let numbers = [
                light.radiance,
                f32::from_bits(light.entity),
                f32::from_bits(light.coloured),
                f32::from_bits(light.sharp),
            ];
            quads.extend([light.facing, numbers]);
        }
        Packed {
            push: Push {
                occluder_count: members.len() as u32,
                block_first: block_first as u32,
                member_first: member_first as u32,
                light_first: light_first as u32,
                light_count: scene.lights.len() as u32,
                capacity: 0,
                switches: scene.skip.bits(),
                sky: scene.sky.unwrap_or(-1.0),
                brightest: scene.brightest,
                eps: scene.eps,
            },
            quads,
        }
    }

    /// Entries of the longest list that there can be.
    pub fn longest(&self) -> u64 {
        let Push { occluder_count, light_count, sky, .. } = self.push;
        // Each by its field and as a cap.
        let (occluders, lights) = (2 * u64::from(occluder_count), u64::from(light_count));
        lights * (occluders + 3) + if sky >= 0.0 { occluders } else { 0 }
    }
}

/// What the pass reads and writes.
pub struct GatherInputs<'b> {
    /// [`Packed::quads`].
    pub scene_quads: &'b Buffer,
    /// [`layout::DeviceEntity`] of every entity.
    pub entities: &'b Buffer,
    /// [`ClusterBounds`] of clusters and groups.
    pub bounds: &'b Buffer,
    /// [`Group`]s.
    pub groups: &'b Buffer,
    /// [`layout::Cluster`]s: where their entries go and how many they are is written. One whose list does not fit loses its vertices,
    /// so that the merge leaves it as it is.
    pub clusters: &'b Buffer,
    /// `capacity` of them a cluster.
    pub entries: &'b Buffer,
    /// A [`Report`], zero before.
    pub report: &'b Buffer,
}

/// The pipeline.
pub struct Gather {
    pipeline: ComputePipeline,
    texel: bool,
    second: Option<Second>,
}

/// The round of groups that find more than a workgroup's memory holds.
struct Second {
    pipeline: ComputePipeline,
    /// Memory of its workgroups: two words an occluder each, padded to a power of two.
    room: Buffer,
    occluder_count: u32,
}

impl Gather {
    /// Makes the pass for at most `entity_count` entities; with no more than [`FOUND`] there is no second round.
    /// `texel` says whether spheres are read through a texel view, which is for software devices.
    ///
    /// # Errors
    /// `Failed` when the shader does not compile; as [`Buffer::new`].
    pub fn new(device: &Arc<Device>, library: &Library, texel: bool, entity_count: usize) -> Result<Self> {
        let pipeline =
            |name, roomy| ComputePipeline::new(device, name, &library.shader(&Self::row(texel, roomy))?, &[]);
        let second = || -> Result<Second> {
            let bytes = 8 * u64::from(ROOMS) * entity_count.next_power_of_two() as u64;
            let room = Buffer::new(device, "gather room", BufferKind::Device, bytes)?;
            Ok(Second { pipeline: pipeline("gather again", true)?, room, occluder_count: entity_count as u32 })
        };
        let second = (entity_count > FOUND).then(second).transpose()?;
        Ok(Gather { pipeline: pipeline("gather", false)?, texel, second })
    }

    /// The row of the shader table; `roomy` for the second round.
    pub fn row(texel: bool, roomy: bool) -> ShaderPermutation {
        Skip::gather_defines()
            .fold(ShaderPermutation::new("gather.comp", 4), |row, (name, bit)| row.define(name, bit))
            .define("ENTRY_BITS", ENTRY_BITS)
            .define("TEXEL", texel)
            .define("ROOMY", roomy)
            .define("LANES", LANES)
            .define("BUCKETS", BUCKETS)
            .define("BLOCK", BLOCK as u32)
            .define("BLOCKS", layout::ENTRY_ENTITIES.div_ceil(BLOCK as u32))
            .define("ROOM", FOUND as u32)
            .define("TURNS", if texel { TURNS } else { u32::MAX })
            .number("SLACK", SLACK)
            .number("FADE_SINE", SKIP_FADE_RAD.sin())
            .number("FADE_COSINE", SKIP_FADE_RAD.cos())
            .number("CAP_SINE_LEAST", CAP_SINES[0])
            .number("CAP_SINE_MOST", CAP_SINES[1])
    }

    /// Makes the lists of `group_count` groups, `capacity` entries a cluster at most.
    ///
    /// # Errors
    /// `Input` when a buffer is larger than the device can bind.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &GatherInputs<'r>,
        packed: &Packed,
        capacity: u32,
        group_count: u32,
    ) -> Result<()> {
        let scene_quads = if self.texel {
            Bind::Texel(TexelView::new(inputs.scene_quads, vk::Format::R32G32B32A32_SFLOAT)?)
        } else {
            Bind::Buffer(inputs.scene_quads)
        };
        let others = [inputs.entities, inputs.bounds, inputs.groups, inputs.clusters, inputs.entries, inputs.report]
            .map(Bind::Buffer);
        let mut resources: Vec<Bind<'r>> = std::iter::once(scene_quads).chain(others).collect();
        let push = Push { capacity, ..packed.push };
        commands.dispatch(&self.pipeline, &resources, &push, [group_count * LANES, 1, 1])?;
        let Some(second) = self.second.as_ref().filter(|_| push.occluder_count as usize > FOUND) else { return Ok(()) };
        assert!(push.occluder_count <= second.occluder_count, "more occluders than entities");
        resources.push(Bind::Buffer(&second.room));
        commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
        commands.dispatch(&second.pipeline, &resources, &push, [ROOMS.min(group_count) * LANES, 1, 1])
    }

    /// Bytes of the second round's memory.
    pub fn size_bytes(&self) -> u64 {
        self.second.as_ref().map_or(0, |second| second.room.size_bytes)
    }
}
