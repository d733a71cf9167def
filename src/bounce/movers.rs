//! Light that bounces between rigid groups: passes "outgoing" and "movers".
//!
//! A vertex reads the occlusion field of everything near it that moves: its product with the cosine lobe of the vertex is
//! the share of the view that the thing takes, and so much of what the vertex's own group reflects is lost. The light
//! that comes from there instead is the mean of those surfaces of the thing that face the vertex. The light that leaves
//! it and its area, both by direction, are nine SH coefficients each, the light of its runs of vertices times a cosine
//! lobe; their quotient towards the vertex is that mean. (Means of six sides were too bright below what is lit from
//! above.) Of a box it is that of those faces that are seen from the vertex. How much of it the vertex sees past its own
//! group say its map of self-visibility, or else its transfer.
//!
//! What moves sees all that rests as flat discs: a cut of a tree of runs ([`crate::lists::far`]). How much of each is seen
//! tells the visibility volume, if the scene has one.

use super::boxes::Boxes;
use super::{LinkBuffers, LinkList, LinkedEntity};
use crate::bake::links::{self, RUNS, Runs};
use crate::error::Result;
use crate::field::cuboid::Cuboid;
use crate::field::self_visibility;
use crate::gpu::{Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, Upload};
use crate::layout::CLUSTER_VERTICES;
use crate::lists::far::FarRuns;
use crate::lists::incremental::{CUT_HEADER, ClusterLists, Reflectors};
use crate::merge::MergeInputs;
use crate::merge::variant::MergePermutation;
use crate::sh::lobe::clamped_cosine;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::Arc;

/// Coefficients of the light that leaves a thing, by direction: three bands.
pub(super) const OUTGOING: usize = 9;
/// Most runs of which that is summed, a workgroup's worth; where there are more, the next larger ones are taken.
const MOST_RUNS: usize = 64;
/// Share of a disc's area over which places count as over its middle.
pub(super) const OVER: f64 = 0.8;
/// Width of the smoothing of cosines, in radii of the disc: what makes it right far above the disc's middle.
pub(super) const SMOOTH: f64 = 4.0 / (3.0 * PI);

/// Share of a face's view that counts where it is seen from its edge or from within: a mean of all faces where none is
/// seen; and the square of the distance from its middle, in r, that is added.
pub(super) const UNFACED: f64 = 1e-3;

/// The surfaces of those entities of a scene that reflect.
#[derive(Default)]
pub(super) struct Surfaces {
    /// Whether each entity reflects by its field.
    pub reflects: Vec<bool>,
    pub rests: Vec<bool>,
    /// Shapes of those that are boxes and move.
    pub cuboids: Vec<Option<Cuboid>>,
    /// Those that hide links.
    boxes: Vec<usize>,
    pub movers: Vec<Mover>,
    pub runs: Vec<MoverRun>,
}

/// An entity that reflects.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Mover {
    pub entity: u32,
    pub run_first: u32,
    pub run_count: u32,
    /// Entries of its cut of what rests, in the last lists.
    pub far_first: u32,
    pub far_count: u32,
}

/// A run of its vertices.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct MoverRun {
    /// In r from the centre of the entity's bounding sphere, its frame; and the bits of the run's number.
    pub middle: [f32; 4],
    /// Mean normal.
    pub normal: [f32; 4],
    /// Its area by direction, as seen from there, in SH, or by the six faces of a box: m^2 of the mesh.
    pub areas: [f32; 12],
}

impl Surfaces {
    /// Without runs.
    pub fn new(entities: &[LinkedEntity<'_>]) -> Self {
        Surfaces {
            reflects: entities.iter().map(|entity| entity.reflects).collect(),
            rests: entities.iter().map(|entity| entity.rests).collect(),
            cuboids: entities.iter().map(|entity| entity.cuboid.filter(|_| !entity.rests)).collect(),
            boxes: (0..entities.len()).filter(|&index| entities[index].is_screen && entities[index].reflects).collect(),
            ..Surfaces::default()
        }
    }

    /// Whether boxes hide links.
    pub fn hide_links(&self) -> bool {
        !self.boxes.is_empty()
    }

    /// Adds those members of a group that reflect, with runs numbered from `base`.
    pub fn add(&mut self, entities: &[LinkedEntity<'_>], members: &[usize], runs: &Runs, base: u32) {
        for (member, &index) in members.iter().enumerate().filter(|(_, index)| entities[**index].reflects) {
            let entity = &entities[index];
            let of_size = |size| runs.of_size(size).filter(move |(_, run)| run.0 == member);
            let size = (0..RUNS.len()).find(|&size| of_size(size).count() <= MOST_RUNS);
            let areas = entity.mesh.vertex_areas_m2();
            let run = |(number, (_, first, vertices)): (u32, (usize, usize, usize))| {
                let mut area = 0.0;
                let mut middle = DVec3::ZERO;
                let mut normal = DVec3::ZERO;
                let mut by_direction = [0.0; 12];
                for v in entity.order[first..first + vertices].iter().map(|&v| v as usize) {
                    let of_vertex = entity.mesh.normals[v].as_dvec3();
                    area += areas[v];
                    middle += areas[v] * (entity.mesh.positions[v].as_dvec3() - entity.centre_m);
                    normal += areas[v] * of_vertex;
                    if let Some(cuboid) = self.cuboids[index] {
                        by_direction[cuboid.face(of_vertex)] += areas[v];
                        continue;
                    }
                    for (sum, c) in by_direction.iter_mut().zip(clamped_cosine(3, of_vertex)) {
                        *sum += areas[v] * c;
                    }
                }
                let middle = (middle / f64::max(area, 1e-30) / entity.radius_m).as_vec3();
                MoverRun {
                    middle: middle.extend(f32::from_bits(base + number)).to_array(),
                    normal: normal.normalize_or_zero().as_vec3().extend(0.0).to_array(),
                    areas: by_direction.map(|c| c as f32),
                }
            };
            let run_first = self.runs.len() as u32;
            // Of the largest, what is too much is left out.
            self.runs.extend(of_size(size.unwrap_or(RUNS.len() - 1)).take(MOST_RUNS).map(run));
            let run_count = self.runs.len() as u32 - run_first;
            self.movers.push(Mover { entity: index as u32, run_first, run_count, far_first: 0, far_count: 0 });
        }
    }
}

/// The passes on a device.
pub(super) struct Movers {
    outgoing: ComputePipeline,
    distant: ComputePipeline,
    movers: ComputePipeline,
    /// Which variant its inputs are to be read by.
    pub permutation: MergePermutation,
    pub surfaces: Surfaces,
    pub far: FarRuns,
    /// Those that hide links.
    pub boxes: Option<Boxes>,
    /// Of every entity, three quads: halves of a box's edges.
    edges: Buffer,
    movers_data: Upload,
    runs: Buffer,
    /// Of every entity, nine quads.
    light: Buffer,
    /// Of every vertex: share of the view times radiosity, and share that is taken.
    pub incoming: Buffer,
    pub clusters: Upload,
    pub entries: Upload,
    pub cluster_count: u32,
    pub pairs: Upload,
    pub pair_count: u32,
    /// Two quads a pair: a sphere, its light and weight.
    spheres: Upload,
}

impl Movers {
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        (surfaces, far): (Surfaces, FarRuns),
        permutation: MergePermutation,
        self_shadows: bool,
        vertex_count: u32,
        lists: [&LinkList; 2],
    ) -> Result<Self> {
        let pipeline = |name: &str, row: ShaderPermutation| ComputePipeline::new(device, name, &library.shader(&row)?);
        // No buffer is empty.
        let buffer = |name: &str, quads: &[[f32; 4]]| match quads {
            [] => Buffer::zeros(device, name, 16),
            quads => Buffer::with_data(device, name, quads),
        };
        let of_entity = |cuboid: &Option<Cuboid>| cuboid.map_or([[0.0; 4]; 3], |cuboid| cuboid.quads());
        let edges: Vec<[f32; 4]> = surfaces.cuboids.iter().flat_map(of_entity).collect();
        Ok(Movers {
            outgoing: pipeline("outgoing", outgoing_row(&permutation))?,
            distant: pipeline("distant movers", distant_row(&permutation))?,
            movers: pipeline("movers", movers_row(&permutation, self_shadows))?,
            movers_data: Upload::new(device, "movers", size_of_val(&surfaces.movers[..]).max(32) as u64)?,
            runs: buffer("runs of movers", bytemuck::cast_slice(&surfaces.runs))?,
            light: Buffer::zeros(device, "light of movers", (16 * OUTGOING * surfaces.rests.len()) as u64)?,
            incoming: Buffer::zeros(device, "light from other groups", 16 * u64::from(vertex_count))?,
            clusters: Upload::new(device, "clusters of movers", 64)?,
            entries: Upload::new(device, "lists of movers", 64)?,
            cluster_count: 0,
            pairs: Upload::new(device, "distant movers", 64)?,
            pair_count: 0,
            spheres: Upload::of_kind(device, "distant movers as spheres", BufferKind::Device, 64)?,
            boxes: Boxes::new(device, library, &surfaces.boxes, lists, &permutation)?,
            edges: buffer("boxes that move", &edges)?,
            permutation,
            surfaces,
            far,
        })
    }

    /// Lists what each cluster meets at the lists' time.
    pub fn prepare(&mut self, lists: &ClusterLists) -> Result<()> {
        let Surfaces { reflects, rests, boxes, movers, .. } = &mut self.surfaces;
        let of = Reflectors {
            movers: movers.iter().map(|mover| mover.entity as usize),
            reflects,
            rests,
            boxes,
            far: &self.far,
        };
        let found = lists.reflectors(&of);
        for (mover, [first, count]) in movers.iter_mut().zip(found.cuts) {
            mover.far_first = first;
            mover.far_count = count;
        }
        self.movers_data.write(movers)?;
        self.cluster_count = found.clusters.len() as u32;
        self.clusters.write(&found.clusters)?;
        self.entries.write(&found.entries)?;
        self.pair_count = found.pairs.len() as u32;
        self.pairs.write(&found.pairs)?;
        self.spheres.reserve(32 * found.pairs.len() as u64)
    }

    /// Writes the links of the frame, where boxes hide any.
    pub fn hide_links<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &MergeInputs<'r>,
        baked: [&'r LinkBuffers; 2],
        run_places: &'r Buffer,
    ) -> Result<()> {
        let Some(boxes) = &self.boxes else { return Ok(()) };
        let places = [run_places, &self.edges];
        boxes.record(commands, inputs, (&self.clusters, self.cluster_count), baked, places)?;
        commands.computed();
        Ok(())
    }

    /// Writes what every vertex receives from other groups, after the light of all runs was written. What moves reflects
    /// light of what rests too where `bounced` says so. `places` and `run_light` are of every run.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &MergeInputs<'r>,
        self_cells: Option<&'r Buffer>,
        [places, run_light]: [&'r Buffer; 2],
        bounced: bool,
    ) -> Result<()> {
        let texels = self.permutation.reads_texels();
        let quads = vk::Format::R32G32B32A32_SFLOAT;
        let shared = || -> Result<[Bind<'r>; 4]> {
            Ok([
                inputs.entities.clone(),
                Bind::read(texels, &self.entries, vk::Format::R32_UINT)?,
                Bind::read(texels, places, quads)?,
                Bind::read(texels, run_light, quads)?,
            ])
        };
        let of_outgoing = [Bind::Buffer(&self.movers_data), Bind::Buffer(&self.runs), Bind::Buffer(&self.light)];
        let resources: Vec<Bind<'r>> = shared()?.into_iter().chain(of_outgoing).collect();
        let count = self.surfaces.movers.len() as u32 * MOST_RUNS as u32;
        commands.dispatch(&self.outgoing, &resources, &u32::from(bounced), [count, 1, 1])?;
        commands.computed();
        if self.pair_count > 0 {
            let resources = [
                inputs.entities.clone(),
                Bind::read(texels, &self.entries, vk::Format::R32_UINT)?,
                Bind::read(texels, &self.clusters, vk::Format::R32G32_UINT)?,
                inputs.fields.clone(),
                Bind::read(texels, &self.light, quads)?,
                Bind::read(texels, &self.edges, quads)?,
                Bind::read(texels, &self.pairs, vk::Format::R32G32_UINT)?,
                Bind::Buffer(&self.spheres),
            ];
            commands.dispatch(&self.distant, &resources, &self.pair_count, [self.pair_count, 1, 1])?;
            commands.computed();
        }
        let of_movers = [
            Bind::read(texels, &self.clusters, vk::Format::R32G32_UINT)?,
            inputs.fields.clone(),
            inputs.transfers.clone(),
            inputs.vertices.clone(),
            Bind::read(texels, &self.light, quads)?,
            Bind::read(texels, &self.edges, quads)?,
            Bind::Buffer(&self.incoming),
            self_cells.map_or(Ok(Bind::None), |cells| Bind::read(texels, cells, vk::Format::R32G32_UINT))?,
            Bind::read(texels, &self.spheres, quads)?,
        ];
        let resources: Vec<Bind<'r>> = shared()?.into_iter().chain(of_movers).collect();
        commands.dispatch(&self.movers, &resources, &(), [self.cluster_count * CLUSTER_VERTICES, 1, 1])
    }
}

pub fn outgoing_row(permutation: &MergePermutation) -> ShaderPermutation {
    far_row(permutation, "outgoing.comp").define("RUNS", MOST_RUNS as u32)
}

pub fn distant_row(permutation: &MergePermutation) -> ShaderPermutation {
    far_row(permutation, "distant.comp")
}

pub fn movers_row(permutation: &MergePermutation, self_shadows: bool) -> ShaderPermutation {
    far_row(permutation, "movers.comp")
        .define("SELF", self_shadows)
        .define("CUT_HEADER", CUT_HEADER as u32)
        .define("SELF_CELLS", self_visibility::CELLS as u32)
        .self_visibility()
}

fn far_row(permutation: &MergePermutation, file: &'static str) -> ShaderPermutation {
    links::macros(permutation.row_of(file)).number("OVER", OVER).number("SMOOTH", SMOOTH).number("UNFACED", UNFACED)
}
