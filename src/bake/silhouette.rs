//! Pass "silhouette": an object as parallel light sees it from every node of a grid, reduced to maps of distance and
//! depth.
//!
//! Inputs: the mesh in units of its bounding radius around its centre; a [`MapFrame`] for each map. Output: two bytes a
//! texel and map, see [`crate::field::silhouette`]. Views of `view_px` are drawn side by side into an atlas of the
//! farthest and the nearest depth a pixel; two dispatches reduce every view to its map.

use super::polyhedron::Polyhedron;
use super::triangles::unit_positions;
use super::{BakeReport, Baker, Progress, hash_text, levels};
use crate::asset::mesh::Mesh;
use crate::error::{Error, Result};
use crate::field::silhouette::{
    FACES_LIMIT, MapFrame, REACH, SURFACE, Side, SilhouetteField, SilhouetteHeader, encode,
};
use crate::field::silhouette_nodes::NodeGrid;
use crate::gpu::{
    Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, GraphicsPipeline, GraphicsState, Image,
    ImageShape, Keeps, Target,
};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3, Vec4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

/// Edge of the atlas in pixels: 256 views of 128 px, 16 MB.
const ATLAS_PX: u32 = 2048;
/// Depth that stands for an uncovered pixel; every depth is above -1.
const CLEAR: f32 = -4.0;
/// Invocations of a workgroup: a wave of the widest GPUs.
const WORKGROUP: u32 = 64;

/// What decides a silhouette field besides the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SilhouetteOptions {
    /// Cells along an edge of a cube face of the node grid.
    pub cells: u32,
    pub map_px: u32,
    /// Pixels along an edge of the view that a map is reduced from.
    pub view_px: u32,
    /// Whether a large mesh is drawn with fewer triangles, which miss it by a share of a view's pixel (see
    /// [`super::levels`]).
    pub levels: bool,
}

impl Default for SilhouetteOptions {
    /// 193 maps of 32 x 32 texels: 389 KiB, and 193 KiB for the halves of a mesh that is not convex. With 4 and 16 cells
    /// they are 98 and 1 542 KiB, and half as much again.
    fn default() -> Self {
        SilhouetteOptions { cells: 8, map_px: 32, view_px: 128, levels: true }
    }
}

/// Header of the silhouette field that a bake of `mesh` would make.
pub fn silhouette_header(mesh: &Mesh, options: SilhouetteOptions) -> SilhouetteHeader {
    let (centre, radius_m) = mesh.bounding_sphere();
    SilhouetteHeader {
        cells: options.cells,
        map_px: options.map_px,
        view_px: options.view_px,
        half_px: if mesh.is_convex() { 0 } else { options.map_px / 2 },
        level_pixels: if options.levels { levels::texels(mesh) } else { 0.0 },
        centre_m: centre.to_array(),
        radius_m,
        extent: extent(mesh),
        faces: faces(mesh),
        mesh: mesh.name.clone(),
        mesh_hash: hash_text(mesh),
    }
}

/// Least and largest coordinates of a mesh about its bounding sphere's centre, in bounding radii.
fn extent(mesh: &Mesh) -> [[f32; 3]; 2] {
    let positions = unit_positions(mesh);
    let start = (positions[0], positions[0]);
    let (low, high) = positions.iter().fold(start, |(low, high), p| (low.min(*p), high.max(*p)));
    [low.to_array(), high.to_array()]
}

/// Normals and distances of the faces of a convex mesh, but for those of the box of its extent; none where there are more
/// than [`FACES_LIMIT`].
fn faces(mesh: &Mesh) -> Vec<[f32; 4]> {
    const SAME: f32 = 1.0 - 1e-5;
    let mut found: Vec<[f32; 4]> = Vec::new();
    if !mesh.is_convex() {
        return found;
    }
    let positions = unit_positions(mesh);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let is_same = |face: &[f32; 4]| normal.dot(Vec3::from_slice(face)) > SAME;
        if normal.abs().max_element() > SAME || found.iter().any(is_same) {
            continue;
        }
        let distance = positions.iter().map(|p| normal.dot(*p)).fold(f32::MIN, f32::max);
        found.push(normal.extend(distance).to_array());
        if found.len() > FACES_LIMIT {
            return Vec::new();
        }
    }
    found
}

fn frames(mesh: &Mesh, nodes: &NodeGrid, count: usize) -> Vec<MapFrame> {
    let positions: Vec<DVec3> = unit_positions(mesh).iter().map(|p| p.as_dvec3()).collect();
    let maps = (0..count).into_par_iter();
    maps.map(|map| MapFrame::around(nodes.map_direction(map), &positions)).collect()
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ViewPush {
    across: [f32; 4],
    down: [f32; 4],
    direction: [f32; 4],
}

impl ViewPush {
    fn new(frame: &MapFrame, side: Side) -> Self {
        let row = |axis: DVec3, centre: f64, half: f64| (axis / half).extend(-centre / half).as_vec4().to_array();
        let [a, b] = frame.axes;
        ViewPush {
            across: row(a, frame.centre.x, frame.half.x),
            down: row(b, frame.centre.y, frame.half.y),
            direction: Vec4::from((frame.direction.as_vec3(), side.sign())).to_array(),
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ReducePush {
    map_first: u32,
    map_count: u32,
}

/// The pipelines, the atlas and the buffers between the steps.
pub struct Silhouette {
    view: GraphicsPipeline,
    columns: ComputePipeline,
    rows: ComputePipeline,
    atlas: Image,
    nearest: Buffer,
    atlas_columns: u32,
    map_px: u32,
    view_px: u32,
}

/// What the pass reads and writes: the mesh, half edges of all rectangles, and all maps.
pub struct SilhouetteBuffers {
    positions: Buffer,
    indices: Buffer,
    index_count: u32,
    halves: Buffer,
    maps: Buffer,
}

impl SilhouetteBuffers {
    /// Uploads a mesh, of which `triangles` are drawn, and the rectangles of its maps.
    pub fn new(
        device: &Arc<Device>,
        mesh: &Mesh,
        triangles: &[[u32; 3]],
        frames: &[MapFrame],
        map_px: u32,
    ) -> Result<Self> {
        let positions: Vec<[f32; 3]> = unit_positions(mesh).iter().map(|p| p.to_array()).collect();
        let halves: Vec<[f32; 2]> = frames.iter().map(|frame| frame.half.as_vec2().to_array()).collect();
        let bytes = 2 * u64::from(map_px * map_px) * frames.len() as u64;
        Ok(SilhouetteBuffers {
            positions: Buffer::with_data(device, "silhouette positions", &positions)?,
            indices: Buffer::with_data(device, "silhouette indices", triangles)?,
            index_count: 3 * triangles.len() as u32,
            halves: Buffer::with_data(device, "silhouette halves", &halves)?,
            maps: Buffer::new(device, "silhouette maps", BufferKind::Device, bytes)?,
        })
    }
}

impl Silhouette {
    /// The permutations: vertex, fragment, and the two steps of the reduction, of wholes or of halves.
    pub fn permutations(map_px: u32, view_px: u32, atlas_columns: u32, half: bool) -> [ShaderPermutation; 4] {
        let reduce = |columns: bool| {
            ShaderPermutation::new("silhouette.comp", 4)
                .define("COLUMNS", columns)
                .define("WORKGROUP", WORKGROUP)
                .define("MAP", map_px)
                .define("VIEW", view_px)
                .define("ATLAS_COLUMNS", atlas_columns)
                .define("HALF", half)
                .number("CLEAR", CLEAR.into())
                .number("REACH", REACH)
                .number("SURFACE_FROM", SURFACE[0])
                .number("SURFACE_TO", SURFACE[1])
        };
        [
            ShaderPermutation::new("silhouette.vert", 4),
            ShaderPermutation::new("silhouette.frag", 4),
            reduce(true),
            reduce(false),
        ]
    }

    /// The pipelines for maps and views of these edges, of wholes or of halves.
    pub fn new(device: &Arc<Device>, library: &Library, map_px: u32, view_px: u32, half: bool) -> Result<Self> {
        let most = device.most_image_px();
        if view_px > most {
            return Err(Error::Input(format!("views of {view_px} px are larger than the device's images ({most} px)")));
        }
        let atlas_columns = (ATLAS_PX.min(most) / view_px).max(1);
        let edge = atlas_columns * view_px;
        let shape = ImageShape { format: vk::Format::R16G16_SFLOAT, width: edge, height: edge, samples: 1 };
        let [vertex, fragment, columns, rows] = Self::permutations(map_px, view_px, atlas_columns, half);
        let state = GraphicsState { keeps: Keeps::Largest, ..GraphicsState::plain(shape.format) };
        let vertex = library.shader(&vertex)?;
        let fragment = library.shader(&fragment)?;
        let reduce = |name, row| ComputePipeline::new(device, name, &library.shader(row)?);
        let bytes = 4 * u64::from(atlas_columns * atlas_columns) * u64::from(map_px) * u64::from(2 * view_px - 1);
        Ok(Silhouette {
            view: GraphicsPipeline::new(device, "silhouette", &vertex, &fragment, state)?,
            columns: reduce("silhouette columns", &columns)?,
            rows: reduce("silhouette rows", &rows)?,
            atlas: Image::new(device, "silhouette atlas", shape)?,
            nearest: Buffer::new(device, "silhouette nearest", BufferKind::Device, bytes)?,
            atlas_columns,
            map_px,
            view_px,
        })
    }

    pub fn capacity(&self) -> usize {
        (self.atlas_columns * self.atlas_columns) as usize
    }

    /// Draws and reduces that side of the maps from `map_first` on, one for each frame, at most
    /// [`Silhouette::capacity`]. It places the barriers between its own steps.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        buffers: &'r SilhouetteBuffers,
        frames: &[MapFrame],
        side: Side,
        map_first: usize,
    ) -> Result<()> {
        assert!(frames.len() <= self.capacity(), "{} views in an atlas of {}", frames.len(), self.capacity());
        let target = Target { color: &self.atlas, second: None, clear: Some([CLEAR; 4]), depth: None, resolve: None };
        commands.image_barrier(&self.atlas, None, Access::ColorWrite);
        commands.render(&target, |drawing| {
            drawing.bind(&self.view, &[(&buffers.positions, 0)], &buffers.indices);
            for (view, frame) in frames.iter().enumerate() {
                let view = view as u32;
                let px = self.view_px;
                drawing.area([view % self.atlas_columns * px, view / self.atlas_columns * px, px, px]);
                drawing.push(&ViewPush::new(frame, side));
                drawing.indexed(0..buffers.index_count);
            }
            Ok(())
        })?;
        commands.image_barrier(&self.atlas, Some(Access::ColorWrite), Access::ComputeSampled);
        let count = frames.len() as u32;
        let push = ReducePush { map_first: map_first as u32, map_count: count };
        let resources = [Bind::Image(&self.atlas), Bind::Buffer(&self.nearest)];
        commands.dispatch(&self.columns, &resources, &push, [count * (2 * self.view_px - 1), 1, 1])?;
        commands.barrier(Access::ComputeWrite, Access::ComputeRead);
        let [atlas, nearest] = resources;
        let resources = [atlas, nearest, Bind::Buffer(&buffers.halves), Bind::Buffer(&buffers.maps)];
        commands.dispatch(&self.rows, &resources, &push, [count * self.map_px * self.map_px / 2, 1, 1])
    }
}

/// The triangles that all views show. With levels of detail they miss the mesh by a share of the smallest pixel of all
/// views.
fn drawn_triangles<'m>(
    baker: &Baker,
    mesh: &'m Mesh,
    header: &SilhouetteHeader,
    frames: &[MapFrame],
) -> Result<Cow<'m, [[u32; 3]]>> {
    if header.level_pixels == 0.0 {
        return Ok(Cow::Borrowed(&mesh.triangles));
    }
    let edges = frames.iter().map(|frame| 2.0 * frame.half.min_element());
    let pixel = edges.fold(f64::INFINITY, f64::min) / f64::from(header.view_px);
    Ok(Cow::Owned(baker.leveled(mesh)?.within(header.level_pixels * pixel)))
}

/// Bakes the silhouette field of a mesh, on the device but for convex solids of few faces; `progress` hears of maps.
/// Returns the report of the bake too.
pub fn bake_silhouette(
    baker: &Baker,
    mesh: &Mesh,
    options: SilhouetteOptions,
    progress: Progress<'_>,
) -> Result<(SilhouetteField, BakeReport)> {
    let started = Instant::now();
    let device = baker.device();
    let library = baker.library();
    let header = silhouette_header(mesh, options);
    header.validate()?;
    let frames = frames(mesh, &NodeGrid::new(options.cells), header.map_count());
    if let Some(solid) = Polyhedron::new(mesh) {
        let maps: Vec<Vec<[u8; 2]>> = frames.par_iter().map(|frame| solid.outline(frame, options.map_px)).collect();
        progress(frames.len() as u32, frames.len() as u32);
        let samples = frames.len() as u32;
        let report = BakeReport { samples, total: started.elapsed(), ..BakeReport::default() };
        let payload = payload(&header, &frames, &[maps.concat().into_flattened()]);
        return Ok((SilhouetteField::new(header, payload)?, report));
    }
    let triangles = drawn_triangles(baker, mesh, &header, &frames)?;
    // Sides whose maps have the same size share the pass and its buffers.
    let sizes: &[&[Side]] =
        if header.half_px > 0 { &[&[Side::Whole], &[Side::Far, Side::Near]] } else { &[&[Side::Whole]] };
    let all = (frames.len() * sizes.iter().map(|sides| sides.len()).sum::<usize>()) as u32;
    let mut texels = Vec::new();
    let mut done = 0;
    let mut report = BakeReport::default();
    for sides in sizes {
        let map_px = header.edge_px(sides[0]) as u32;
        let view_px = options.view_px * map_px / options.map_px;
        let pass = Silhouette::new(device, library, map_px, view_px, sides[0] != Side::Whole)?;
        let buffers = SilhouetteBuffers::new(device, mesh, &triangles, &frames, map_px)?;
        for &side in *sides {
            for (batch, frames) in frames.chunks(pass.capacity()).enumerate() {
                let mut commands = Commands::new(device, "silhouette bake")?;
                let first = batch * pass.capacity();
                commands.pass("silhouette", |c| pass.record(c, &buffers, frames, side, first))?;
                report.add(&commands.submit()?);
                done += frames.len() as u32;
                progress(done, all);
            }
            texels.push(buffers.maps.download::<u8>(frames.len() * header.texel_bytes(side))?);
        }
    }
    report.samples = frames.len() as u32;
    report.total = started.elapsed();
    let payload = payload(&header, &frames, &texels);
    Ok((SilhouetteField::new(header, payload)?, report))
}

/// The payload of a field: each map's rectangle before the texels of its sides. `texels` holds those of all maps, side
/// after side.
fn payload(header: &SilhouetteHeader, frames: &[MapFrame], texels: &[Vec<u8>]) -> Vec<u8> {
    let mut payload = Vec::with_capacity(header.payload_bytes());
    for (map, frame) in frames.iter().enumerate() {
        for number in [frame.centre.x, frame.centre.y, frame.half.x, frame.half.y] {
            payload.extend((number as f32).to_le_bytes());
        }
        for (&side, texels) in Side::ALL.iter().zip(texels) {
            let bytes = header.texel_bytes(side);
            payload.extend(&texels[map * bytes..][..bytes]);
        }
    }
    payload
}

/// The CPU twin of the pass for one side of a map, in f64 and by plain search: bytes of distance and depth, row by row.
pub fn silhouette_twin(mesh: &Mesh, (frame, side): (&MapFrame, Side), map_px: u32, view_px: u32) -> Vec<[u8; 2]> {
    let view = drawn(mesh, (frame, side), view_px as usize);
    let px = view_px as usize;
    let pixel = 2.0 * frame.half / px as f64;
    let mut points = Vec::new();
    for (y, x) in (0..px).flat_map(|y| (0..px).map(move |x| (y, x))) {
        for (i, j) in [(1, 0), (0, 1)] {
            if x + i < px && y + j < px {
                let a = view[y * px + x];
                let b = view[(y + j) * px + x + i];
                let Some((low, high)) = a.xor(b) else { continue };
                let place = DVec2::new((x + 1) as f64 - 0.5 * j as f64, (y + 1) as f64 - 0.5 * i as f64);
                points.push((place, (low + high) / 2.0));
            }
        }
    }
    let texel = |i: u32| {
        let at = |i: u32| (f64::from(i) + 0.5) * f64::from(view_px) / f64::from(map_px);
        let place = DVec2::new(at(i % map_px), at(i / map_px));
        let squared = |p: &DVec2| ((*p - place) * pixel).length_squared();
        let least = points.iter().map(|(p, _)| squared(p)).fold(f64::INFINITY, f64::min);
        // Views of a symmetric mesh have points that are equally near.
        let nearest = points.iter().filter(|(p, _)| squared(p) <= least * (1.0 + 1e-9)).map(|(_, depth)| *depth);
        let (sum, count) = nearest.fold((0.0, 0.0), |(sum, count), depth| (sum + depth, count + 1.0));
        let around =
            [-0.25, 0.25].map(|dy| [-0.25, 0.25].map(|dx| (place + DVec2::new(dx, dy)).floor().as_usizevec2()));
        let covered: Vec<(f64, f64)> = around.iter().flatten().filter_map(|p| view[p.y * px + p.x]).collect();
        let inside = (covered.len() as i32 - 2).signum();
        let distance = least.sqrt().min(f64::MAX) * f64::from(inside);
        let mut depth = sum / f64::max(count, 1.0);
        if side != Side::Whole && !covered.is_empty() {
            let surface = covered.iter().map(|(low, high)| (low + high) / 2.0).sum::<f64>() / covered.len() as f64;
            let within = ((distance - SURFACE[0]) / (SURFACE[1] - SURFACE[0])).clamp(0.0, 1.0);
            depth += (surface - depth) * within * within * (3.0 - 2.0 * within);
        }
        [encode(distance, REACH), encode(depth, 1.0)]
    };
    (0..map_px * map_px).into_par_iter().map(texel).collect()
}

/// Nearest and farthest depth of every covered pixel.
fn drawn(mesh: &Mesh, (frame, side): (&MapFrame, Side), px: usize) -> Vec<Option<(f64, f64)>> {
    let positions: Vec<DVec3> = unit_positions(mesh).iter().map(|p| p.as_dvec3()).collect();
    let mut view: Vec<Option<(f64, f64)>> = vec![None; px * px];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| {
            let p = positions[i as usize];
            ((frame.place(p) + 1.0) * 0.5 * px as f64, p.dot(frame.direction))
        });
        let [a, b, c] = corners.map(|(place, _)| place);
        let area = (b - a).perp_dot(c - a);
        let low = a.min(b).min(c).floor().max(DVec2::ZERO).as_usizevec2();
        let high = a.max(b).max(c).ceil().min(DVec2::splat(px as f64)).as_usizevec2();
        for (y, x) in (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| (y, x))) {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let weights = [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)].map(|w| w / area);
            if weights.iter().all(|w| *w >= 0.0) {
                let depth = corners.iter().zip(weights).map(|((_, depth), w)| depth * w).sum::<f64>();
                if side == Side::Whole || depth * f64::from(side.sign()) >= 0.0 {
                    let (least, most) = view[y * px + x].unwrap_or((depth, depth));
                    view[y * px + x] = Some((least.min(depth), most.max(depth)));
                }
            }
        }
    }
    view
}
