//! Passes "runs" and "bounce": light that surfaces of a rigid group pass on to each other.
//!
//! A vertex has links to runs of neighbouring vertices that it sees ([`crate::bake::links`]); a run has the mean light
//! that leaves its vertices, and all of their links, each by the mean of its shares. So runs alone pass light on to each
//! other, step by step, and the last bounce goes along the links of vertices. That is Jacobi's iteration of the radiosity
//! equation: each step adds a bounce, and goes further than the light has changed, by a factor of its own, so that few
//! bring all (`relaxation`).
//!
//! Between groups light goes by [`movers`], in later steps, as it needs the light that those before bring. Only fronts
//! reflect. A lamp in spherical harmonics inside a closed mesh lights nothing of it, as the mesh's transfer ends where its
//! own far side blocks; a sharp one does.

pub mod boxes;
pub mod movers;
mod relaxation;
pub(crate) mod twin;

use crate::asset::Mesh;
use crate::bake::cluster_order::{RunEnds, runs};
use crate::bake::links::{self, COUNT_BITS, RUN_BITS, RUNS, Runs, pack, pack_direction, unpack, unpack_direction};
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
use rayon::prelude::*;
use std::ops::Range;
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

/// Neighbouring runs that are lit alike where it is found how many steps are needed.
const SPOT: usize = 32;

/// Entries that views have to hold for the lists of what moves: more than all clusters of a large scene have.
const MOST_ENTRIES: u64 = 1 << 24;

/// Links of vertices or of runs.
#[derive(Default)]
struct LinkList {
    /// For each its first link, and the number of its links below its entity.
    ranges: Vec<[u32; 2]>,
    /// Numbers of runs below their shares.
    links: Vec<u32>,
    /// Mean directions of their rays, where boxes hide any.
    directions: Vec<u32>,
}

impl LinkList {
    /// No buffer is empty.
    fn fill(&mut self) {
        self.links.resize(self.links.len().max(1), 0);
        self.directions.resize(self.directions.len().max(1), 0);
    }
}

/// Links of all vertices of a scene, by the places of entities' vertices in the buffers of light.
#[derive(Default)]
pub struct Linked {
    run_count: usize,
    blocks: Vec<RunBlock>,
    /// A third of the triangles around each vertex.
    areas: Vec<f32>,
    of_vertices: LinkList,
    /// Those of the smallest runs, by number.
    of_runs: LinkList,
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
            of_vertices: LinkList { ranges: vec![[0, 0]; vertices], ..LinkList::default() },
            surfaces: Surfaces::new(entities),
            far: FarRuns { volume, ..FarRuns::default() },
            receives: entities.iter().any(|entity| !entity.rests && entity.receives),
            ..Linked::default()
        };
        for members in rigid {
            let base = linked.run_count as u32;
            let runs = Runs::new(members.iter().map(|&member| entities[member].runs));
            linked.run_count += runs.count as usize;
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
        if linked.of_vertices.links.is_empty() && !linked.meets() {
            return None;
        }
        linked.of_runs = linked.links_of_runs();
        linked.of_vertices.fill();
        linked.of_runs.fill();
        Some(linked)
    }

    /// Whether texel views of a device hold what is read of it.
    pub fn fits_texels(&self, device: &Device) -> bool {
        let quads = self.of_vertices.ranges.len().max(2 * self.run_count) as u64;
        let links = self.of_vertices.links.len().max(self.of_runs.links.len()) as u64;
        TexelView::fits(device, vk::Format::R32_UINT, 4 * links) && TexelView::fits(device, QUAD_FORMAT, 16 * quads)
    }

    /// Whether light bounces between groups.
    fn meets(&self) -> bool {
        !self.surfaces.movers.is_empty() || (self.receives && !self.far.roots.is_empty())
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
        let list = &mut self.of_vertices;
        let ranges = &mut list.ranges[entity.first..][..entity.order.len()];
        ranges.fill([0, (index as u32) << COUNT_BITS]);
        let Some(links) = &entity.links else { return };
        let mut from = list.links.len() as u32;
        for (range, &count) in ranges.iter_mut().zip(&links.counts) {
            *range = [from, u32::from(count) | range[1]];
            from += u32::from(count);
        }
        list.links.extend(links.packed.iter().map(|link| link + base));
        if self.surfaces.hide_links() {
            list.directions.extend(&links.directions);
            // What moves itself hides nothing of its own.
            list.directions.resize(list.links.len(), 0);
        }
    }

    /// The links of every smallest run: those of its vertices by their areas, one for each run that they lead to.
    fn links_of_runs(&self) -> LinkList {
        let of_block = |block: &RunBlock| {
            let of_run = |(run, places): (usize, Range<usize>)| (run, places.start, self.joined_links(places));
            block.smallest_runs().map(of_run).collect::<Vec<_>>()
        };
        let found: Vec<_> = self.blocks.par_iter().flat_map_iter(of_block).collect();
        let mut list = LinkList { ranges: vec![[0, 0]; self.run_count], ..LinkList::default() };
        for (run, place, joined) in found {
            let entity = self.of_vertices.ranges[place][1] >> COUNT_BITS;
            list.ranges[run] = [list.links.len() as u32, joined.len() as u32 | entity << COUNT_BITS];
            list.links.extend(joined.iter().map(|(link, _)| link));
            if self.surfaces.hide_links() {
                list.directions.extend(joined.iter().map(|(_, toward)| pack_direction(*toward)));
            }
        }
        list
    }

    /// Links of some vertices as one, each with its direction where that is known.
    fn joined_links(&self, places: Range<usize>) -> Vec<(u32, Vec3)> {
        let LinkList { ranges, links, directions } = &self.of_vertices;
        let whole_m2: f32 = self.areas[places.clone()].iter().sum();
        let mut found: Vec<(usize, f32, Vec3)> = Vec::new();
        for place in places {
            let weight = self.areas[place] / whole_m2.max(1e-30);
            let [first, packed] = ranges[place];
            for link in (first as usize..).take(links::count(packed)) {
                let (run, share) = unpack(links[link]);
                let toward = directions.get(link).map_or(Vec3::ZERO, |packed| unpack_direction(*packed));
                found.push((run, weight * share, weight * share * toward));
            }
        }
        found.sort_by_key(|(run, ..)| *run);
        let joined = |same: &[(usize, f32, Vec3)]| {
            let share = same.iter().map(|(_, share, _)| share).sum();
            let toward = same.iter().map(|(.., toward)| *toward).sum();
            pack(share, same[0].0 as u32).map(|link| (link, toward))
        };
        found.chunk_by(|a, b| a.0 == b.0).filter_map(joined).collect()
    }
}

impl Steps {
    /// What pass "runs" is pushed for each of its steps.
    fn pushes(&self) -> impl Iterator<Item = RelaxPush> {
        let meets = |step| u32::from(step >= self.alone);
        self.gains.iter().enumerate().map(move |(step, &gain)| RelaxPush { gain, meets: meets(step) })
    }
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, Zeroable)]
struct RelaxPush {
    gain: [f32; 3],
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

impl RunBlock {
    /// Numbers of its smallest runs, and the places of their vertices.
    fn smallest_runs(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        let clusters = (self.vertex_first as usize..).step_by(RUNS[1]).zip(self.smallest.iter().zip(&self.ends));
        clusters.flat_map(|(first, (run, ends))| {
            (*run as usize..).zip(runs(ends).map(move |of| first + of.start..first + of.end))
        })
    }
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
    relax: ComputePipeline,
    bounce: ComputePipeline,
    texels: bool,
    blocks: Buffer,
    block_count: u32,
    areas: Buffer,
    of_vertices: LinkBuffers,
    of_runs: LinkBuffers,
    /// Direct light of the smallest runs, and how much of the light that leaves them gets past lamps.
    run_direct: Buffer,
    /// Light of all runs, of which steps read one and write the other; the last writes the first.
    run_light: [Buffer; 2],
    /// Two quads a run: its middle, world, metres, and whether it rests; its mean normal, and the area that faces that way.
    run_places: Buffer,
    run_count: u32,
    vertex_count: u32,
    movers: Option<Movers>,
    steps: Steps,
}

/// A [`LinkList`] on the device, as it was baked.
struct LinkBuffers {
    ranges: Buffer,
    links: Buffer,
}

impl LinkBuffers {
    fn new(device: &Arc<Device>, list: &LinkList) -> Result<Self> {
        Ok(LinkBuffers {
            ranges: Buffer::with_data(device, "ranges of links", &list.ranges)?,
            links: Buffer::with_data(device, "links", &list.links)?,
        })
    }
}

/// Steps in which runs pass on light. The last bounce, along links of vertices, follows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Steps {
    /// What each adds, by channel: so many times the change that it brought. Zero is a bounce.
    gains: Vec<[f32; 3]>,
    /// Of these, those within groups alone, which come first.
    alone: usize,
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
        let vertex_count = linked.areas.len() as u32;
        let of_runs = |name: &str| Buffer::new(device, name, BufferKind::Device, 16 * u64::from(run_count));
        let texels = merge.reads_texels() && linked.fits_texels(device);
        let meets = linked.meets();
        let Linked { surfaces, far, .. } = linked;
        let places: Vec<[f32; 4]> = far.runs.iter().flat_map(FarRun::quads).collect();
        let views_hold = texels
            && TexelView::fits(device, vk::Format::R32_UINT, 4 * MOST_ENTRIES)
            && self_cells.is_none_or(|cells| TexelView::fits(device, vk::Format::R32G32_UINT, cells.size_bytes));
        let merge = MergePermutation { variant: merge.variant.restricted(views_hold, true), ..merge };
        let lists = [&linked.of_vertices, &linked.of_runs];
        let movers = || Movers::new(device, library, (surfaces, far), merge, self_cells.is_some(), vertex_count, lists);
        let pipeline = |name: &str, row: ShaderPermutation| ComputePipeline::new(device, name, &library.shader(&row)?);
        Ok(Bounce {
            means: pipeline("runs", means_row(texels, soft))?,
            relax: pipeline("runs", relax_row(texels, meets))?,
            bounce: pipeline("bounce", bounce_row(texels, soft, meets))?,
            texels,
            block_count: linked.blocks.len() as u32,
            blocks: Buffer::with_data(device, "runs", &linked.blocks)?,
            areas: Buffer::with_data(device, "areas of vertices", &linked.areas)?,
            of_vertices: LinkBuffers::new(device, &linked.of_vertices)?,
            of_runs: LinkBuffers::new(device, &linked.of_runs)?,
            run_direct: of_runs("direct light of runs")?,
            run_light: [of_runs("light of runs")?, of_runs("light of runs, every other step")?],
            run_places: Buffer::with_data(device, "places of runs", &places)?,
            steps: Steps::default(),
            run_count,
            vertex_count,
            movers: meets.then(movers).transpose()?,
        })
    }

    /// Finds how many steps surfaces of these albedos need.
    pub fn set_albedos(&mut self, albedos: &[Vec3]) -> Result<()> {
        let host = self.download()?;
        // An even light, and one that comes in spots.
        let even = vec![DVec3::ONE; host.smallest.len()];
        let spots = (0..even.len()).map(|run| DVec3::splat(if run / SPOT % 4 == 0 { 2.0 } else { 0.0 })).collect();
        let found = relaxation::fewest(&[even, spots].map(|light| host.bounces(light, albedos)));
        // Light from other groups is passed on within these in the last steps.
        let met = if self.movers.is_some() { (found.steps / 3).max(1) } else { 0 };
        let alone = found.steps.saturating_sub(met).max(found.steps.min(1));
        let gains = found.gains(alone).into_iter().chain(found.gains(met));
        self.steps = Steps { gains: gains.map(|gain| gain.as_vec3().to_array()).collect(), alone };
        Ok(())
    }

    /// Steps for bounces.
    pub fn steps(&self, bounces: Bounces) -> Steps {
        if bounces == Bounces::All { self.steps.clone() } else { Steps::default() }
    }

    /// Prepares the lists of what moves for the lists' present time.
    pub(crate) fn prepare(&mut self, lists: &ClusterLists) -> Result<()> {
        self.movers.as_mut().map_or(Ok(()), |movers| movers.prepare(lists))
    }

    /// What every vertex sees along its links, for reflections.
    pub fn linked_light(&self) -> LinkedLight<'_> {
        let [links, _] = self.shown_links();
        let ranges = &self.of_vertices.ranges;
        LinkedLight { ranges, links, run_light: &self.run_light[0], run_places: &self.run_places }
    }

    /// The links of vertices and of runs of the last frame.
    fn shown_links(&self) -> [&Buffer; 2] {
        let boxes = self.movers.as_ref().and_then(|movers| movers.boxes.as_ref());
        boxes.map_or([&self.of_vertices.links, &self.of_runs.links], |boxes| boxes.links())
    }

    /// How what it reads of the merge is to be bound, if it reads any.
    pub fn reads(&self) -> Option<&MergePermutation> {
        self.movers.as_ref().map(|movers| &movers.permutation)
    }

    /// Adds bounces to the direct light of all vertices, which was written before.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, work: &BounceWork<'r>) -> Result<()> {
        let BounceWork { entities, light, steps, .. } = work;
        let read = |buffer: &'r Buffer| Bind::read(self.texels, buffer, QUAD_FORMAT);
        let words = |buffer: &'r Buffer| Bind::read(self.texels, buffer, vk::Format::R32_UINT);
        let pairs = |buffer: &'r Buffer| Bind::read(self.texels, buffer, vk::Format::R32G32_UINT);
        let met = self.movers.as_ref().zip(work.met.as_ref());
        if let Some((movers, (inputs, _))) = met {
            let baked = [&self.of_vertices, &self.of_runs];
            movers.hide_links(commands, inputs, baked, &self.run_places)?;
        }
        let [links, run_links] = self.shown_links();
        let light_before = |step: usize| &self.run_light[(steps.gains.len() - step) % 2];
        let run_threads = [CLUSTER_VERTICES * self.block_count, 1, 1];
        let resources = [
            Bind::Buffer(&self.blocks),
            words(&self.areas)?,
            read(light.direct)?,
            Bind::Buffer(light_before(0)),
            Bind::Buffer(&self.run_direct),
            light.lamps.map_or(Ok(Bind::None), words)?,
        ];
        commands.dispatch(&self.means, &resources, &(), run_threads)?;
        commands.computed();
        let meet = |commands: &mut Commands<'r>, step| {
            let Some((movers, (inputs, self_cells))) = met.filter(|_| step == steps.alone) else { return Ok(()) };
            let of_runs = [&self.run_places, light_before(step)];
            movers.record(commands, inputs, *self_cells, of_runs, !steps.gains.is_empty())?;
            commands.computed();
            Ok(())
        };
        for (step, push) in steps.pushes().enumerate() {
            meet(commands, step)?;
            let mut resources = vec![
                Bind::Buffer(&self.blocks),
                words(&self.areas)?,
                read(light_before(step))?,
                Bind::Buffer(light_before(step + 1)),
                read(&self.run_direct)?,
                read(entities)?,
                pairs(&self.of_runs.ranges)?,
                words(run_links)?,
            ];
            if let Some(movers) = &self.movers {
                resources.push(read(&movers.incoming)?);
            }
            if step > 0 {
                commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
            }
            commands.dispatch(&self.relax, &resources, &push, run_threads)?;
            commands.computed();
        }
        meet(commands, steps.gains.len())?;
        let mut resources = vec![
            read(entities)?,
            pairs(&self.of_vertices.ranges)?,
            words(links)?,
            read(&self.run_light[0])?,
            read(light.direct)?,
            Bind::Buffer(light.radiosity),
            light.soft_direct.map_or(Ok(Bind::None), read)?,
            light.soft.map_or(Bind::None, Bind::Buffer),
        ];
        if let Some(movers) = &self.movers {
            resources.push(read(&movers.incoming)?);
        }
        commands.dispatch(&self.bounce, &resources, &self.vertex_count, [self.vertex_count, 1, 1])
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

/// Light of all runs from that of their vertices.
pub fn means_row(texels: bool, soft: bool) -> ShaderPermutation {
    ShaderPermutation::new("runs.comp", 4).define("TEXEL", texels).define("RELAX", false).define("LAMPS", soft)
}

/// A step of it.
pub fn relax_row(texels: bool, movers: bool) -> ShaderPermutation {
    let row = links::macros(ShaderPermutation::new("runs.comp", 4));
    row.define("TEXEL", texels).define("RELAX", true).define("MOVERS", movers)
}

pub fn bounce_row(texels: bool, soft: bool, movers: bool) -> ShaderPermutation {
    links::macros(ShaderPermutation::new("bounce.comp", 4))
        .define("TEXEL", texels)
        .define("SOFT", soft)
        .define("MOVERS", movers)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The light along links of a run is the mean, by area, of that along links of its vertices.
    #[test]
    fn links_of_a_run_are_the_mean_of_those_of_its_vertices() {
        let of_vertex: [&[(f32, u32)]; 3] = [&[(0.5, 7), (0.25, 2)], &[(0.125, 2), (0.0625, 9)], &[]];
        let mut list = LinkList::default();
        for links in of_vertex {
            list.ranges.push([list.links.len() as u32, links.len() as u32 | 3 << COUNT_BITS]);
            list.links.extend(links.iter().map(|&(share, run)| pack(share, run).unwrap()));
            list.directions.extend(links.iter().map(|_| pack_direction(Vec3::Y)));
        }
        let linked = Linked { areas: vec![1.0, 2.0, 1.0], of_vertices: list, ..Linked::default() };
        let joined = linked.joined_links(0..3);
        let found: Vec<(usize, f32)> = joined.iter().map(|(link, _)| unpack(*link)).collect();
        assert_eq!(found, [(2, 0.125), (7, 0.125), (9, 0.03125)]);
        assert!(joined.iter().all(|(_, toward)| toward.normalize().y > 0.99));
    }
}
