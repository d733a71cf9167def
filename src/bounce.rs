//! Passes "runs" and "bounce": light that surfaces of a rigid group pass on to each other.
//!
//! A vertex has links to runs of neighbouring vertices that it sees ([`crate::bake::links`]); a run has the mean light
//! that leaves its vertices. The two passes alternate, once a bounce: means of all runs, and for every vertex its direct
//! light and albedo times the light along its links. That is Jacobi's iteration of the radiosity equation: each step adds
//! a bounce.
//!
//! Onto what moves, pass "bounce" adds the light of larger runs of all that rests, as flat pieces seen from afar with
//! nothing between; where they take more than the hemisphere, as furniture before a wall does, they are scaled down to
//! it. What moves reflects nothing onto what rests. Only fronts reflect. A lamp in spherical harmonics inside a
//! closed mesh lights nothing of it, as the mesh's transfer ends where its own far side blocks; a sharp one does.

use crate::asset::Mesh;
use crate::bake::links::{RUN_BITS, RUNS, Runs, WHOLE_SHARE};
use crate::bake::surfaces::Links;
use crate::error::Result;
use crate::gpu::{Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, TexelView};
use crate::layout::{CLUSTER_VERTICES, ENTRY_BITS};
use crate::scene::Placement;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use glam::DVec3;
use std::f64::consts::PI;
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
    /// As many as are seen: eight.
    #[default]
    All,
}

/// Steps for all bounces. In a closed room of albedo 0.7 they leave 0.7^8 of the light, 6 %, in an open one of the same
/// 1 %.
const MOST: u32 = 8;

impl Bounces {
    /// Steps of the iteration.
    pub fn steps(self) -> u32 {
        match self {
            Bounces::None => 0,
            Bounces::One => 1,
            Bounces::All => MOST,
        }
    }
}

/// Links of all vertices of a scene, by the places of entities' vertices in the buffers of light.
#[derive(Default)]
pub struct Linked {
    /// First vertex and number of vertices of every run.
    runs: Vec<[u32; 2]>,
    /// A third of the triangles around each vertex.
    areas: Vec<f32>,
    /// For each vertex its first link, and the number of its links below its entity.
    ranges: Vec<[u32; 2]>,
    /// Numbers of runs below their shares.
    links: Vec<u32>,
    /// Of what rests, as what moves sees it: the middle of each run with its number's bits, world, and the sum of its
    /// normals times their areas.
    far: Vec<[[f32; 4]; 2]>,
    /// Workgroups of the vertices of what moves: entity, first vertex in the vertex buffer and in the buffers of light,
    /// and number of vertices.
    moved: Vec<[u32; 4]>,
}

/// Most runs that what moves sees; beyond, they are the next larger ones.
const MOST_FAR: usize = 512;

impl Linked {
    /// The links of a scene's entities, of which those of one list of `rigid` never move against each other; `None` where
    /// no vertex has any and nothing moves, or where there are more runs than links can number.
    pub fn new(entities: &[LinkedEntity<'_>], rigid: &[Vec<usize>]) -> Option<Self> {
        let vertices = entities.iter().map(|entity| entity.order.len()).sum();
        let mut linked = Linked { areas: vec![0.0; vertices], ranges: vec![[0, 0]; vertices], ..Linked::default() };
        for members in rigid {
            let base = linked.runs.len() as u32;
            let runs = Runs::new(members.iter().map(|&member| entities[member].order.len()));
            let run = |(member, first, count): (usize, usize, usize)| {
                [(entities[members[member]].first + first) as u32, count as u32]
            };
            linked.runs.extend(runs.all().map(run));
            for &member in members {
                linked.add(member, &entities[member], base);
            }
            if members.iter().all(|&member| entities[member].rests) {
                linked.see_from_afar(entities, members, base);
            }
        }
        let moved = entities.iter().enumerate().filter(|(_, entity)| !entity.rests && entity.receives);
        for (index, entity) in moved.filter(|_| !linked.far.is_empty()) {
            let count = entity.order.len();
            linked.moved.extend((0..count).step_by(CLUSTER_VERTICES as usize).map(|first| {
                let vertices = (count - first).min(CLUSTER_VERTICES as usize);
                [index, entity.vertex_first + first, entity.first + first, vertices].map(|x| x as u32)
            }));
        }
        if linked.runs.len() >= 1 << RUN_BITS {
            log::warn!("light does not bounce: {} runs of vertices are more than links number", linked.runs.len());
            return None;
        }
        if linked.links.is_empty() && linked.moved.is_empty() {
            return None;
        }
        // No buffer is empty.
        linked.links.extend(linked.links.is_empty().then_some(0));
        Some(linked)
    }

    /// Adds the smallest runs of a group of which there are not too many.
    fn see_from_afar(&mut self, entities: &[LinkedEntity<'_>], members: &[usize], base: u32) {
        let runs = Runs::new(members.iter().map(|&member| entities[member].order.len()));
        let size = (0..RUNS.len() - 1).find(|&size| runs.of_size(size).count() <= MOST_FAR).unwrap_or(RUNS.len() - 1);
        let areas: Vec<_> = members.iter().map(|&member| entities[member].mesh.vertex_areas_m2()).collect();
        for (number, (member, first, vertices)) in runs.of_size(size) {
            let entity = &entities[members[member]];
            let scale = f64::from(entity.placement.scale);
            let mut middle = DVec3::ZERO;
            let mut across = DVec3::ZERO;
            let mut whole = 0.0;
            for &v in &entity.order[first..first + vertices] {
                let area = areas[member][v as usize] * scale * scale;
                middle += area * entity.placement.point(entity.mesh.positions[v as usize].as_dvec3());
                across += area * (entity.placement.turn() * entity.mesh.normals[v as usize].as_dvec3());
                whole += area;
            }
            if whole > 0.0 {
                let [x, y, z] = (middle / whole).as_vec3().to_array();
                self.far.push([[x, y, z, f32::from_bits(base + number)], across.as_vec3().extend(0.0).to_array()]);
            }
        }
    }

    fn add(&mut self, index: usize, entity: &LinkedEntity<'_>, base: u32) {
        let areas = entity.mesh.vertex_areas_m2();
        for (place, &v) in (entity.first..).zip(entity.order) {
            self.areas[place] = areas[v as usize] as f32;
        }
        let Some(links) = &entity.links else { return };
        let mut from = self.links.len() as u32;
        for (place, &count) in (entity.first..).zip(&links.counts) {
            self.ranges[place] = [from, u32::from(count) | (index as u32) << 8];
            from += u32::from(count);
        }
        self.links.extend(links.packed.iter().map(|link| link + base));
    }
}

/// An entity whose vertices may have links.
pub struct LinkedEntity<'e> {
    pub mesh: &'e Mesh,
    /// Which vertex of the mesh stands at each place of the buffers of light.
    pub order: &'e [u32],
    /// The first of these places.
    pub first: usize,
    /// Its first vertex in the vertex buffer.
    pub vertex_first: usize,
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
}

pub struct Bounce {
    means: ComputePipeline,
    bounce: ComputePipeline,
    texels: bool,
    runs: Buffer,
    areas: Buffer,
    ranges: Buffer,
    links: Buffer,
    run_light: Buffer,
    counts: [u32; 2],
    moved: Option<Moved>,
}

/// What lights that which moves.
struct Moved {
    pipeline: ComputePipeline,
    groups: Buffer,
    far: Buffer,
    /// Workgroups, and runs that they see.
    counts: [u32; 2],
}

impl Bounce {
    /// `soft` tells whether the scene has sharp lights, and `texels` whether the device reads texels faster than blocks.
    pub fn new(device: &Arc<Device>, library: &Library, linked: &Linked, soft: bool, texels: bool) -> Result<Self> {
        let counts = [linked.runs.len() as u32, linked.ranges.len() as u32];
        let run_light = Buffer::new(device, "light of runs", BufferKind::Device, 16 * u64::from(counts[0]))?;
        let fits = TexelView::fits(device, vk::Format::R32_UINT, 4 * linked.links.len() as u64)
            && TexelView::fits(device, vk::Format::R32G32B32A32_SFLOAT, 16 * u64::from(counts[1]));
        let texels = texels && fits;
        let pipeline =
            |name: &str, row: ShaderPermutation| ComputePipeline::new(device, name, &library.shader(&row)?, &[]);
        let moved = || -> Result<Moved> {
            Ok(Moved {
                pipeline: pipeline("moved", moved_row(texels, soft))?,
                groups: Buffer::with_data(device, "moved groups", &linked.moved)?,
                far: Buffer::with_data(device, "far runs", &linked.far)?,
                counts: [linked.moved.len() as u32, linked.far.len() as u32],
            })
        };
        Ok(Bounce {
            means: pipeline("runs", runs_row(texels))?,
            bounce: pipeline("bounce", bounce_row(texels, soft))?,
            texels,
            runs: Buffer::with_data(device, "runs", &linked.runs)?,
            areas: Buffer::with_data(device, "areas of vertices", &linked.areas)?,
            ranges: Buffer::with_data(device, "ranges of links", &linked.ranges)?,
            links: Buffer::with_data(device, "links", &linked.links)?,
            run_light,
            counts,
            moved: (!linked.moved.is_empty()).then(moved).transpose()?,
        })
    }

    pub fn size_bytes(&self) -> u64 {
        let moved = self.moved.iter().flat_map(|moved| [&moved.groups, &moved.far]);
        let all = [&self.runs, &self.areas, &self.ranges, &self.links, &self.run_light];
        all.into_iter().chain(moved).map(|buffer| buffer.size_bytes).sum()
    }

    /// Adds bounces, one a step, to the direct light of all vertices, which was written before.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        [entities, vertices]: [&'r Buffer; 2],
        light: &BouncedLight<'r>,
        steps: u32,
    ) -> Result<()> {
        let read = |buffer: &'r Buffer, format| -> Result<Bind<'r>> {
            Ok(if self.texels { Bind::Texel(TexelView::new(buffer, format)?) } else { Bind::Buffer(buffer) })
        };
        let quads = vk::Format::R32G32B32A32_SFLOAT;
        let written = |commands: &mut Commands<'r>| {
            commands.barrier(Access::ComputeWrite, Access::ComputeRead);
            commands.barrier(Access::ComputeWrite, Access::ComputeSampled);
        };
        let [run_count, vertex_count] = self.counts;
        for step in 0..steps {
            let from = if step == 0 { light.direct } else { light.radiosity };
            let resources = [
                Bind::Buffer(&self.runs),
                Bind::Buffer(&self.areas),
                read(from, quads)?,
                Bind::Buffer(&self.run_light),
            ];
            commands.dispatch(&self.means, &resources, &run_count, [run_count, 1, 1])?;
            written(commands);
            let mut resources = vec![
                Bind::Buffer(entities),
                Bind::Buffer(&self.ranges),
                read(&self.links, vk::Format::R32_UINT)?,
                read(&self.run_light, quads)?,
                Bind::Buffer(light.direct),
                Bind::Buffer(light.radiosity),
            ];
            resources.extend(light.soft_direct.into_iter().chain(light.soft).map(Bind::Buffer));
            // Pixels read the last step alone.
            let push = [vertex_count, u32::from(step + 1 == steps)];
            commands.dispatch(&self.bounce, &resources, &push, [vertex_count, 1, 1])?;
            if step + 1 < steps {
                written(commands);
                commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
            }
        }
        let Some(Moved { pipeline, groups, far, counts }) = &self.moved else { return Ok(()) };
        commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
        let mut resources = vec![
            Bind::Buffer(entities),
            Bind::Buffer(groups),
            read(vertices, quads)?,
            read(far, quads)?,
            read(&self.run_light, quads)?,
            Bind::Buffer(light.radiosity),
        ];
        resources.extend(light.soft.map(Bind::Buffer));
        commands.dispatch(pipeline, &resources, &counts[1], [counts[0] * CLUSTER_VERTICES, 1, 1])
    }
}

/// What the passes read of the scene and of light.
pub struct TwinInput<'t> {
    /// Direct light of every place of the buffers of light.
    pub direct: &'t [DVec3],
    /// Albedo of every entity, over pi.
    pub albedo: &'t [DVec3],
    /// Place and normal in the world of a vertex of an entity that moves: entity, vertex of the vertex buffer.
    pub vertex: &'t dyn Fn(usize, usize) -> [DVec3; 2],
}

impl Bounce {
    /// The CPU twin of the passes, in f64, from the same links: light of every place after so many steps.
    pub fn twin(&self, input: &TwinInput<'_>, steps: u32) -> Result<Vec<DVec3>> {
        let [run_count, vertex_count] = self.counts.map(|count| count as usize);
        let runs: Vec<[u32; 2]> = self.runs.download(run_count)?;
        let areas: Vec<f32> = self.areas.download(vertex_count)?;
        let ranges: Vec<[u32; 2]> = self.ranges.download(vertex_count)?;
        let links: Vec<u32> = self.links.download((self.links.size_bytes / 4) as usize)?;
        let mut light = input.direct.to_vec();
        let mut of_runs = Vec::new();
        for _ in 0..steps {
            let mean = |[first, count]: &[u32; 2]| {
                let places = *first as usize..(first + count) as usize;
                let whole: f64 = areas[places.clone()].iter().map(|area| f64::from(*area)).sum();
                places.map(|v| f64::from(areas[v]) * light[v]).sum::<DVec3>() / whole.max(1e-30)
            };
            of_runs = runs.iter().map(mean).collect::<Vec<DVec3>>();
            let bounced = |(place, [first, packed]): (usize, &[u32; 2])| {
                let own = &links[*first as usize..][..(packed & 255) as usize];
                let along = |link: &u32| f64::from(link >> RUN_BITS) * of_runs[(link & ((1 << RUN_BITS) - 1)) as usize];
                let sum = own.iter().map(along).sum::<DVec3>() / f64::from(WHOLE_SHARE);
                input.direct[place] + PI * input.albedo[(packed >> 8) as usize] * sum
            };
            light = ranges.iter().enumerate().map(bounced).collect();
        }
        let Some(Moved { groups, far, counts, .. }) = &self.moved else { return Ok(light) };
        let groups: Vec<[u32; 4]> = groups.download(counts[0] as usize)?;
        let far: Vec<[[f32; 4]; 2]> = far.download(counts[1] as usize)?;
        for [entity, vertex_first, first, count] in groups.into_iter().map(|group| group.map(|x| x as usize)) {
            for v in 0..count {
                let [place, normal] = (input.vertex)(entity, vertex_first + v);
                let mut sum = DVec3::ZERO;
                let mut whole = 0.0;
                for [[x, y, z, number], [a, b, c, _]] in &far {
                    let to = DVec3::new((*x).into(), (*y).into(), (*z).into()) - place;
                    let area = DVec3::new((*a).into(), (*b).into(), (*c).into());
                    let square = to.length_squared();
                    let faced = normal.dot(to).max(0.0) * (-area.dot(to)).max(0.0);
                    let share = faced / (square * (PI * square + area.length())).max(1e-30);
                    sum += share * of_runs[number.to_bits() as usize];
                    whole += share;
                }
                light[first + v] += PI * input.albedo[entity] * sum / whole.max(1.0);
            }
        }
        Ok(light)
    }
}

pub fn runs_row(texels: bool) -> ShaderPermutation {
    ShaderPermutation::new("runs.comp", 4).define("TEXEL", texels)
}

pub fn moved_row(texels: bool, soft: bool) -> ShaderPermutation {
    ShaderPermutation::new("moved.comp", 4)
        .define("TEXEL", texels)
        .define("SOFT", soft)
        .define("WORKGROUP", CLUSTER_VERTICES)
        .define("ENTRY_BITS", ENTRY_BITS)
}

pub fn bounce_row(texels: bool, soft: bool) -> ShaderPermutation {
    ShaderPermutation::new("bounce.comp", 4)
        .define("TEXEL", texels)
        .define("SOFT", soft)
        .define("RUN_BITS", RUN_BITS)
        .number("WHOLE_SHARE", f64::from(WHOLE_SHARE))
}
