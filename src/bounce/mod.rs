//! Passes "runs" and "bounce": light that surfaces of a rigid group pass on to each other.
//!
//! A vertex has links to runs of neighbouring vertices that it sees ([`crate::bake::links`]); a run has the mean light
//! that leaves its vertices. The two passes alternate, once a bounce: means of all runs, and for every vertex its direct
//! light and albedo times the light along its links. That is Jacobi's iteration of the radiosity equation: each step adds
//! a bounce. Each goes further than the light has changed, by a factor of its own, so that few bring all (`relaxation`).
//!
//! Between groups light goes by [`movers`], in the last steps, as it needs the light that those before bring. Only fronts
//! reflect. A lamp in spherical harmonics inside a closed mesh lights nothing of it, as the mesh's transfer ends where its
//! own far side blocks; a sharp one does.

pub mod boxes;
pub mod movers;
mod relaxation;
pub(crate) mod twin;

use crate::asset::Mesh;
use crate::bake::cluster_order::RunEnds;
use crate::bake::links::{self, RUN_BITS, RUNS, Runs};
use crate::bake::surfaces::Links;
use crate::error::Result;
use crate::field::cuboid::Cuboid;
use crate::field::visibility_volume::SceneVolume;
use crate::gpu::{Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, TexelView};
use crate::layout::{CLUSTER_VERTICES, QUAD_FORMAT};
use crate::lists::far::{FarRun, FarRuns};
use crate::lists::incremental::ClusterLists;
use crate::merge::MergeInputs;
use crate::merge::variant::MergePermutation;
use crate::scene::Placement;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use movers::{Movers, Surfaces};
use relaxation::Relaxation;
use std::sync::Arc;

/// How often light bounces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Bounces {
    /// Direct light alone.
    #[cfg_attr(feature = "cli", value(name = "0"))]
    None,
    #[cfg_attr(feature = "cli", value(name = "1"))]
    One,
    /// All.
    #[default]
    All,
}

impl Bounces {
    /// How many a path of the reference may have, which ends by chance long before.
    pub fn most(self) -> u32 {
        match self {
            Bounces::None => 0,
            Bounces::One => 1,
            Bounces::All => 64,
        }
    }
}

/// Neighbouring vertices that are lit alike where it is found how many steps are needed.
const SPOT: u32 = 256;
/// Error of light that goes between groups, where all vertices have a direct light of 1.
const LEAVING_ERROR: f64 = 0.04;

/// Entries that views have to hold for the lists of what moves: more than all clusters of a large scene have.
const MOST_ENTRIES: u64 = 1 << 24;

/// Links of all vertices of a scene, by the places of entities' vertices in the buffers of light.
#[derive(Default)]
pub struct Linked {
    run_count: usize,
    blocks: Vec<RunBlock>,
    /// A third of the triangles around each vertex.
    areas: Vec<f32>,
    /// For each vertex its first link, and the number of its links below its entity.
    ranges: Vec<[u32; 2]>,
    /// Numbers of runs below their shares.
    links: Vec<u32>,
    /// Mean directions of their rays, where boxes hide any.
    directions: Vec<u32>,
    /// All runs, of which those that rest are seen by what moves.
    far: FarRuns,
    surfaces: Surfaces,
    /// Whether anything that moves receives light.
    receives: bool,
}

impl Linked {
    /// The links of a scene's entities, of which those of one list of `rigid` never move against each other; `volume` tells
    /// what moves which of the others it sees. `None` where no vertex has any and nothing moves, or where there are more
    /// runs than links can number.
    pub fn new(entities: &[LinkedEntity<'_>], rigid: &[Vec<usize>], volume: Option<Arc<SceneVolume>>) -> Option<Self> {
        let vertices = entities.iter().map(|entity| entity.order.len()).sum();
        let mut linked = Linked {
            areas: vec![0.0; vertices],
            ranges: vec![[0, 0]; vertices],
            surfaces: Surfaces::new(entities),
            far: FarRuns { volume, ..FarRuns::default() },
            receives: entities.iter().any(|entity| !entity.rests && entity.receives),
            ..Linked::default()
        };
        for members in rigid {
            let base = linked.run_count as u32;
            let runs = Runs::new(members.iter().map(|&member| entities[member].runs));
            linked.run_count += runs.count() as usize;
            let block = |(number, (member, first, count)): (u32, (usize, usize, usize))| {
                let clusters = runs.parts(number);
                let mut block = RunBlock {
                    vertex_first: (entities[members[member]].first + first) as u32,
                    vertex_count: count as u32,
                    middle: base + clusters.start,
                    large: base + number,
                    ..RunBlock::zeroed()
                };
                let ends = entities[members[member]].runs[first / RUNS[1]..].iter();
                for (index, (cluster, ends)) in clusters.zip(ends).enumerate() {
                    block.smallest[index] = base + runs.parts(cluster).start;
                    block.ends[index] = *ends;
                }
                block
            };
            linked.blocks.extend(runs.of_size(RUNS.len() - 1).map(block));
            for &member in members {
                linked.add(member, &entities[member], base);
            }
            linked.surfaces.add(entities, members, &runs, base);
            if members.iter().all(|&member| entities[member].rests) {
                linked.see_from_afar(entities, members, &runs, base);
            }
            linked.far.runs.resize(linked.run_count, FarRun::default());
        }
        if linked.run_count >= 1 << RUN_BITS {
            log::warn!("light does not bounce: {} runs of vertices are more than links number", linked.run_count);
            return None;
        }
        if linked.links.is_empty() && !linked.meets() {
            return None;
        }
        // No buffer is empty.
        linked.links.resize(linked.links.len().max(1), 0);
        linked.directions.resize(linked.directions.len().max(1), 0);
        Some(linked)
    }

    /// Whether texel views of a device hold what is read of it.
    pub fn fits_texels(&self, device: &Device) -> bool {
        let quads = self.ranges.len().max(2 * self.run_count) as u64;
        TexelView::fits(device, vk::Format::R32_UINT, 4 * self.links.len() as u64)
            && TexelView::fits(device, QUAD_FORMAT, 16 * quads)
    }

    /// Whether light bounces between groups.
    fn meets(&self) -> bool {
        !self.surfaces.is_empty() || (self.receives && !self.far.roots.is_empty())
    }

    /// Adds the runs of a group that rests, numbered from `base`.
    fn see_from_afar(&mut self, entities: &[LinkedEntity<'_>], members: &[usize], runs: &Runs, base: u32) {
        let areas: Vec<_> = members.iter().map(|&member| entities[member].mesh.vertex_areas_m2()).collect();
        let all = runs.all().enumerate();
        self.far.runs.extend(all.map(|(number, (member, first, vertices))| {
            let entity = &entities[members[member]];
            let scale = f64::from(entity.placement.scale);
            let mut middle = DVec3::ZERO;
            let mut across = DVec3::ZERO;
            let mut whole = 0.0;
            let places = || entity.order[first..first + vertices].iter().map(|&v| v as usize);
            let position = |v: usize| entity.placement.point(entity.mesh.positions[v].as_dvec3());
            for v in places() {
                let area = areas[member][v] * scale * scale;
                middle += area * position(v);
                across += area * (entity.placement.turn() * entity.mesh.normals[v].as_dvec3());
                whole += area;
            }
            middle /= f64::max(whole, 1e-30);
            let parts = runs.parts(number as u32);
            FarRun {
                middle: middle.as_vec3(),
                radius_m: places().map(|v| position(v).distance(middle)).fold(0.0, f64::max) as f32,
                across: across.as_vec3(),
                area_m2: whole as f32,
                parts: base + parts.start..base + parts.end,
            }
        }));
        self.far.roots.extend(runs.of_size(RUNS.len() - 1).map(|(number, _)| base + number));
    }

    fn add(&mut self, index: usize, entity: &LinkedEntity<'_>, base: u32) {
        let areas = entity.mesh.vertex_areas_m2();
        for (place, &v) in (entity.first..).zip(entity.order) {
            self.areas[place] = areas[v as usize] as f32;
        }
        let ranges = &mut self.ranges[entity.first..][..entity.order.len()];
        ranges.fill([0, (index as u32) << 8]);
        let Some(links) = &entity.links else { return };
        let mut from = self.links.len() as u32;
        for (range, &count) in ranges.iter_mut().zip(&links.counts) {
            *range = [from, u32::from(count) | range[1]];
            from += u32::from(count);
        }
        self.links.extend(links.packed.iter().map(|link| link + base));
        if self.surfaces.hide_links() {
            self.directions.extend(&links.directions);
            // What moves itself hides nothing of its own.
            self.directions.resize(self.links.len(), 0);
        }
    }
}

impl Steps {
    /// One or no bounce.
    fn exactly(count: u32, meets: bool) -> Self {
        Steps { gains: vec![[0.0; 3]; count as usize], alone: if meets { 0 } else { count } }
    }

    /// All bounces within groups.
    fn within(all: &Relaxation) -> Self {
        let gains = all.gains(all.steps).into_iter();
        Steps { gains: gains.map(|gain| gain.as_vec3().to_array()).collect(), alone: all.steps as u32 }
    }

    /// All bounces: first within groups, then between them too, at least two and `count` in all. The last adds nothing,
    /// so that light which a surface has from other groups alone stays as it is.
    fn between(alone: &Relaxation, count: usize) -> Self {
        let met = count.saturating_sub(alone.steps + 1).max(1);
        let gains = alone.gains(alone.steps).into_iter().chain(alone.gains(met)).chain([DVec3::ZERO]);
        Steps { gains: gains.map(|gain| gain.as_vec3().to_array()).collect(), alone: alone.steps as u32 }
    }

    pub(crate) fn count(&self) -> u32 {
        self.gains.len() as u32
    }
}

/// What pass "bounce" is pushed.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, Zeroable)]
struct BouncePush {
    gain: [f32; 3],
    count: u32,
    first: u32,
    last: u32,
    meets: u32,
}

/// Clusters of a run of the largest size.
const BLOCK_CLUSTERS: usize = RUNS[2] / RUNS[1];

/// A run of the largest size and the smaller ones that it consists of.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, Zeroable)]
struct RunBlock {
    vertex_first: u32,
    vertex_count: u32,
    /// Its first cluster and itself, as runs.
    middle: u32,
    large: u32,
    /// The first smallest run of each cluster, and where those end in it.
    smallest: [u32; BLOCK_CLUSTERS],
    ends: [RunEnds; BLOCK_CLUSTERS],
}

/// An entity whose vertices may have links.
pub struct LinkedEntity<'e> {
    pub mesh: &'e Mesh,
    /// Which vertex of the mesh stands at each place of the buffers of light.
    pub order: &'e [u32],
    /// The runs of each of its clusters.
    pub runs: &'e [RunEnds],
    /// The first of these places.
    pub first: usize,
    /// Its mesh's bounding sphere, metres.
    pub centre_m: DVec3,
    pub radius_m: f64,
    /// Whether others see it by its occlusion field.
    pub reflects: bool,
    /// Its shape, if it is a box.
    pub cuboid: Option<Cuboid>,
    /// Whether it is one of the scene's screens, which hide links.
    pub is_screen: bool,
    /// Whether it never moves, and where it stands then.
    pub rests: bool,
    pub placement: Placement,
    pub receives: bool,
    pub links: Option<Arc<Links>>,
}

/// Light of every vertex before and after bounces: of all lights, and without that of sharp ones where there are any.
pub struct BouncedLight<'b> {
    pub direct: &'b Buffer,
    pub radiosity: &'b Buffer,
    pub soft_direct: Option<&'b Buffer>,
    pub soft: Option<&'b Buffer>,
    /// Share of its view that lamps take of every vertex: of the light that leaves it, as much does not get past them.
    pub lamps: Option<&'b Buffer>,
}

pub struct Bounce {
    means: ComputePipeline,
    bounce: ComputePipeline,
    texels: bool,
    blocks: Buffer,
    block_count: u32,
    areas: Buffer,
    ranges: Buffer,
    links: Buffer,
    run_light: Buffer,
    /// Two quads a run: its middle, world, metres, and whether it rests; its mean normal, and the area that faces that way.
    run_places: Buffer,
    run_count: u32,
    vertex_count: u32,
    movers: Option<Movers>,
    steps: Steps,
}

/// Steps that bring bounces.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// What each adds, by channel: so many times the change that it brought. Zero is a bounce.
    gains: Vec<[f32; 3]>,
    /// Of these, those within groups alone, which come first.
    alone: u32,
}

fn pipelines(
    device: &Arc<Device>,
    library: &Library,
    texels: bool,
    soft: bool,
    meets: bool,
) -> Result<[ComputePipeline; 2]> {
    let pipeline = |name: &str, row: ShaderPermutation| ComputePipeline::new(device, name, &library.shader(&row)?);
    Ok([pipeline("runs", runs_row(texels, soft))?, pipeline("bounce", bounce_row(texels, soft, meets))?])
}

impl Bounce {
    /// `soft` tells whether the scene has sharp lights; `merge` reads fields as these passes will where views hold the
    /// lists, too, and the maps of self-visibility, `self_cells`, if there are any.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        linked: Linked,
        soft: bool,
        merge: MergePermutation,
        self_cells: Option<&Buffer>,
    ) -> Result<Self> {
        let run_count = linked.run_count as u32;
        let vertex_count = linked.ranges.len() as u32;
        let run_light = Buffer::new(device, "light of runs", BufferKind::Device, 16 * u64::from(run_count))?;
        let texels = merge.reads_texels() && linked.fits_texels(device);
        let meets = linked.meets();
        let Linked { surfaces, far, ranges, links, directions, .. } = linked;
        let places: Vec<[f32; 4]> = far.runs.iter().flat_map(FarRun::quads).collect();
        let views_hold = texels
            && TexelView::fits(device, vk::Format::R32_UINT, 4 * MOST_ENTRIES)
            && self_cells.is_none_or(|cells| TexelView::fits(device, vk::Format::R32G32_UINT, cells.size_bytes));
        let merge = MergePermutation { variant: merge.variant.restricted(views_hold, true), ..merge };
        let movers = || {
            Movers::new(
                device,
                library,
                (surfaces, far),
                merge,
                self_cells.is_some(),
                ranges.len(),
                [&links, &directions],
            )
        };
        let [means, bounce] = pipelines(device, library, texels, soft, meets)?;
        Ok(Bounce {
            means,
            bounce,
            texels,
            block_count: linked.blocks.len() as u32,
            blocks: Buffer::with_data(device, "runs", &linked.blocks)?,
            areas: Buffer::with_data(device, "areas of vertices", &linked.areas)?,
            ranges: Buffer::with_data(device, "ranges of links", &ranges)?,
            links: Buffer::with_data(device, "links", &links)?,
            run_light,
            run_places: Buffer::with_data(device, "places of runs", &places)?,
            steps: Steps::exactly(1, meets),
            run_count,
            vertex_count,
            movers: meets.then(movers).transpose()?,
        })
    }

    /// Finds how many steps surfaces of these albedos need.
    pub fn set_albedos(&mut self, albedos: &[Vec3]) -> Result<()> {
        let host = self.download()?;
        // An even light, and one that comes in spots.
        let even = vec![DVec3::ONE; self.vertex_count as usize];
        let spots = (0..self.vertex_count).map(|v| DVec3::splat(if v / SPOT % 4 == 0 { 2.0 } else { 0.0 }));
        let errors = relaxation::errors(&[even, spots.collect()].map(|light| host.bounces(light, albedos)));
        let all = relaxation::within(relaxation::UNSEEN, &errors);
        let alone = relaxation::within(LEAVING_ERROR, &errors);
        self.steps = if self.movers.is_some() { Steps::between(&alone, all.steps) } else { Steps::within(&all) };
        Ok(())
    }

    /// Steps for bounces.
    pub fn steps(&self, bounces: Bounces) -> Steps {
        match bounces {
            Bounces::All => self.steps.clone(),
            Bounces::None | Bounces::One => Steps::exactly(bounces.most(), self.movers.is_some()),
        }
    }

    /// Prepares the lists of what moves for the lists' present time.
    pub(crate) fn prepare(&mut self, lists: &ClusterLists) -> Result<()> {
        self.movers.as_mut().map_or(Ok(()), |movers| movers.prepare(lists))
    }

    /// What every vertex sees along its links, for reflections.
    pub fn linked_light(&self) -> LinkedLight<'_> {
        let Bounce { ranges, run_light, run_places, .. } = self;
        LinkedLight { ranges, links: self.shown_links(), run_light, run_places }
    }

    /// The links of the last frame.
    fn shown_links(&self) -> &Buffer {
        let boxes = self.movers.as_ref().and_then(|movers| movers.boxes.as_ref());
        boxes.map_or(&self.links, |boxes| &boxes.links)
    }

    /// How what it reads of the merge is to be bound, if it reads any.
    pub fn reads(&self) -> Option<&MergePermutation> {
        self.movers.as_ref().map(Movers::permutation)
    }

    /// Adds bounces, step by step, to the direct light of all vertices, which was written before.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, work: &BounceWork<'r>) -> Result<()> {
        let BounceWork { entities, light, steps, .. } = work;
        let quads = vk::Format::R32G32B32A32_SFLOAT;
        let words = vk::Format::R32_UINT;
        let vertex_count = self.vertex_count;
        let count = steps.count();
        let met = self.movers.as_ref().zip(work.met.as_ref());
        if let Some((movers, (inputs, _))) = met {
            movers.hide_links(commands, inputs, &LinkedLight { links: &self.links, ..self.linked_light() })?;
        }
        for step in 0..count {
            let from = if step == 0 { light.direct } else { light.radiosity };
            let resources = [
                Bind::Buffer(&self.blocks),
                Bind::read(self.texels, &self.areas, words)?,
                Bind::read(self.texels, from, quads)?,
                Bind::Buffer(&self.run_light),
                light.lamps.map_or(Ok(Bind::None), |shares| Bind::read(self.texels, shares, words))?,
            ];
            commands.dispatch(&self.means, &resources, &(), [CLUSTER_VERTICES * self.block_count, 1, 1])?;
            commands.computed();
            if let Some((movers, (inputs, self_cells))) = met.filter(|_| step == steps.alone) {
                let of_runs = [&self.run_places, &self.run_light];
                movers.record(commands, inputs, *self_cells, of_runs, count > 1)?;
                commands.computed();
            }
            let mut resources = vec![
                Bind::read(self.texels, entities, quads)?,
                Bind::read(self.texels, &self.ranges, vk::Format::R32G32_UINT)?,
                Bind::read(self.texels, self.shown_links(), words)?,
                Bind::read(self.texels, &self.run_light, quads)?,
                Bind::read(self.texels, light.direct, quads)?,
                Bind::Buffer(light.radiosity),
                light.soft_direct.map_or(Ok(Bind::None), |light| Bind::read(self.texels, light, quads))?,
                light.soft.map_or(Bind::None, Bind::Buffer),
            ];
            if let Some(movers) = &self.movers {
                resources.push(Bind::read(self.texels, &movers.incoming, quads)?);
            }
            let push = BouncePush {
                gain: steps.gains[step as usize],
                count: vertex_count,
                first: u32::from(step == 0),
                // Pixels read the last step alone.
                last: u32::from(step + 1 == count),
                meets: u32::from(step >= steps.alone),
            };
            commands.dispatch(&self.bounce, &resources, &push, [vertex_count, 1, 1])?;
            if step + 1 < count {
                commands.computed();
                commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
            }
        }
        Ok(())
    }
}

/// Links of all vertices, and the light and the places of the runs that they lead to.
pub struct LinkedLight<'b> {
    pub ranges: &'b Buffer,
    pub links: &'b Buffer,
    pub run_light: &'b Buffer,
    pub run_places: &'b Buffer,
}

/// What the passes read and write in a frame.
pub struct BounceWork<'w> {
    pub entities: &'w Buffer,
    pub light: BouncedLight<'w>,
    pub steps: Steps,
    /// What the merge reads, by [`Bounce::reads`], and the maps of self-visibility where there are any.
    pub met: Option<(MergeInputs<'w>, Option<&'w Buffer>)>,
}

pub fn runs_row(texels: bool, soft: bool) -> ShaderPermutation {
    ShaderPermutation::new("runs.comp", 4).define("TEXEL", texels).define("LAMPS", soft)
}

pub fn bounce_row(texels: bool, soft: bool, movers: bool) -> ShaderPermutation {
    links::macros(ShaderPermutation::new("bounce.comp", 4))
        .define("TEXEL", texels)
        .define("SOFT", soft)
        .define("MOVERS", movers)
}
