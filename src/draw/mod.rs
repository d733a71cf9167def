//! Pass "draw": lit vertices to a picture.
//!
//! Inputs: a mesh an entity (positions from its sphere's centre in metres, emission pattern, indices) and the entity's part
//! of the radiosity buffer. Output: RGBA of `width` x `height`, linear or as a screen shows it: with one sample a pixel, that
//! one's entity in alpha and its depth beside it, or multisampled and resolved.

pub mod camera;
pub mod grid;
pub mod show;
pub mod smooth;

use crate::asset::grid::Grid;
use crate::asset::mesh::Mesh;
use crate::asset::picture::srgb_from_linear;
use crate::draw::grid::{DrawGrid, GridDrawable};
use crate::draw::smooth::Smooth;
use crate::error::Result;
use crate::gpu::ImageShape;
use crate::gpu::Target;
use crate::gpu::{Access, Buffer, Commands, Device, GraphicsPipeline, GraphicsState, Image};
use crate::lists::sight::{Faces, Sight};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};
use std::ops::Range;
use std::sync::Arc;

/// Linear half floats: 11 bits are more than a PNG shows, at half the bandwidth of f32.
const COLOR: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
/// What a screen shows, encoded by the shader: half the bytes of half floats. A format that encodes by itself (_SRGB) takes
/// llvmpipe half as long again with four samples.
const SHOWN: vk::Format = vk::Format::R8G8B8A8_UNORM;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;

/// What a picture is made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Finish {
    /// Linear radiance in half floats, for files and further work.
    #[default]
    Linear,
    /// 8 bits, sRGB, with white at its brightest, for a screen. Samples are averaged after encoding.
    Display,
}

/// How the edges of what is drawn are kept from showing as stairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Antialias {
    /// They are not: one sample a pixel.
    None,
    /// One sample a pixel, and outlines and creases smoothed by pass "smooth".
    Outlines,
    /// Four samples a pixel where the device can.
    #[default]
    Samples,
}

impl Antialias {
    /// What a device draws at interactive rates: a GPU has samples for next to nothing, a software device shades and resolves each.
    pub fn usual(device: &Device) -> Self {
        if device.info.is_software() { Antialias::Outlines } else { Antialias::Samples }
    }
}

impl std::str::FromStr for Antialias {
    type Err = String;
    fn from_str(word: &str) -> std::result::Result<Self, String> {
        match word {
            "none" => Ok(Antialias::None),
            "outlines" => Ok(Antialias::Outlines),
            "samples" => Ok(Antialias::Samples),
            _ => Err(format!("\"{word}\" is none of none, outlines and samples")),
        }
    }
}

/// A mesh as it is drawn.
pub enum Drawable {
    /// By its triangles.
    Triangles {
        /// Positions from the sphere's centre, metres.
        positions: Buffer,
        /// Emission pattern.
        emission: Buffer,
        /// Three a triangle, neighbours together.
        indices: Buffer,
        /// Runs of them, one after the other.
        runs: Vec<(Range<u32>, Faces)>,
    },
    /// As a whole.
    Grid(GridDrawable, Faces),
}

/// Triangles of a run: few enough that most runs lie on one side of an object, enough that a draw call costs little beside them.
const RUN_TRIANGLES: usize = 128;

impl Drawable {
    /// Uploads a mesh, its vertices in `order`; without colours its emission pattern is white. `vertices` are those of all that
    /// will be drawn together.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, order: &[u32], vertices: usize) -> Result<Self> {
        let (centre, _) = mesh.bounding_sphere();
        let mut place = vec![0; order.len()];
        for (at, &v) in order.iter().enumerate() {
            place[v as usize] = at as u32;
        }
        if let Some(grid) = Grid::find(mesh).filter(|grid| GridDrawable::fits(device, grid.vertices.len(), vertices)) {
            return Ok(Drawable::Grid(
                GridDrawable::new(device, &grid, centre, &place)?,
                Faces::of(mesh, &mesh.triangles),
            ));
        }
        let color = |v: usize| mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[v]);
        let positions: Vec<[f32; 3]> =
            order.iter().map(|&v| (mesh.positions[v as usize] - centre).to_array()).collect();
        let emission: Vec<[f32; 3]> = order.iter().map(|&v| color(v as usize).to_array()).collect();
        let mut triangles = mesh.triangles.clone();
        triangles.sort_by_cached_key(|t| t.map(|v| place[v as usize]).into_iter().min());
        let mut runs = Vec::with_capacity(triangles.len().div_ceil(RUN_TRIANGLES));
        let mut first = 0;
        for run in triangles.chunks(RUN_TRIANGLES) {
            let end = first + 3 * run.len() as u32;
            runs.push((first..end, Faces::of(mesh, run)));
            first = end;
        }
        triangles.iter_mut().flatten().for_each(|v| *v = place[*v as usize]);
        Ok(Drawable::Triangles {
            positions: Buffer::with_data(device, "draw positions", &positions)?,
            emission: Buffer::with_data(device, "draw emission", &emission)?,
            indices: Buffer::with_data(device, "draw indices", &triangles)?,
            runs,
        })
    }
}

impl Drawable {
    /// Indices that have to be drawn, in order: all, or those of runs that may be seen.
    pub fn seen(&self, sight: Option<&Sight>) -> Vec<Range<u32>> {
        let may_see = |faces: &Faces| sight.is_none_or(|sight| sight.may_see(faces));
        let mut out: Vec<Range<u32>> = Vec::new();
        match self {
            Drawable::Grid(_, faces) => out.extend(may_see(faces).then_some(0..GridDrawable::INDEX_COUNT)),
            Drawable::Triangles { runs, .. } => {
                for (range, _) in runs.iter().filter(|(_, faces)| may_see(faces)) {
                    match out.last_mut() {
                        Some(last) if last.end == range.start => last.end = range.end,
                        _ => out.push(range.clone()),
                    }
                }
            }
        }
        out
    }

    /// Whether it is drawn as a whole.
    pub fn is_grid(&self) -> bool {
        matches!(self, Drawable::Grid(..))
    }

    /// Device memory, bytes.
    pub fn size_bytes(&self) -> u64 {
        match self {
            Drawable::Triangles { positions, emission, indices, .. } => {
                positions.size_bytes + emission.size_bytes + indices.size_bytes
            }
            Drawable::Grid(grid, _) => grid.size_bytes(),
        }
    }
}

/// One entity to draw.
pub struct Item<'d> {
    /// Its mesh.
    pub drawable: &'d Drawable,
    /// From the mesh's frame (metres from its sphere's centre) to clip space, reversed depth.
    pub clip_from_object: Mat4,
    /// Indices of it to draw.
    pub indices: Vec<Range<u32>>,
    /// Whether its backs are left out: they are never seen.
    pub culls: bool,
    /// Radiance factor of its emission pattern.
    pub emission: Vec3,
    /// Byte offset of its vertices in the radiosity buffer.
    pub radiosity_offset: u64,
    /// What a picture's alpha says where it is seen.
    pub tag: f32,
}

/// A region of the picture, and what is drawn there.
pub struct DrawnViewport<'d> {
    /// Left, top, width and height in pixels.
    pub area: [u32; 4],
    /// The entities that are drawn, in this order.
    pub items: Vec<Item<'d>>,
    /// Radiosity of their vertices.
    pub radiosity: &'d Buffer,
    /// Which of the lines that pass "smooth" reads belong to this region.
    pub lines: Range<u32>,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    clip_from_object: [f32; 16],
    emission_white: [f32; 4],
    tag: f32,
}

/// The pipelines and their images.
pub struct Draw {
    /// For meshes that are seen from both sides.
    open: GraphicsPipeline,
    /// For those of which only fronts are seen.
    solid: GraphicsPipeline,
    grid: DrawGrid,
    samples: Option<Image>,
    /// Depth, reversed: of every sample.
    pub depth: Image,
    /// The picture as it is drawn.
    pub picture: Image,
    /// Triangles that a render pass draws at most before the next goes on. llvmpipe keeps what is drawn until it has filled it in:
    /// of two million triangles 300 MiB, of which 250 went when it filled each in at once.
    pub batch_triangles: u32,
    /// What comes after, where outlines are smoothed.
    pub smooth: Option<Smooth>,
}

impl Draw {
    /// For pictures of `width` x `height`.
    ///
    /// # Errors
    /// `Input` when the picture is larger than the device's images.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        [width, height]: [u32; 2],
        antialias: Antialias,
        finish: Finish,
    ) -> Result<Self> {
        let limits = &device.limits;
        let offered = limits.framebuffer_color_sample_counts & limits.framebuffer_depth_sample_counts;
        let samples =
            if antialias == Antialias::Samples && offered.contains(vk::SampleCountFlags::TYPE_4) { 4 } else { 1 };
        let color = if finish == Finish::Display { SHOWN } else { COLOR };
        let shape = ImageShape { format: color, width, height, samples: 1 };
        let state = GraphicsState { color, depth: Some(DEPTH), samples, cull: vk::CullModeFlags::NONE };
        let vertex = library.shader(&ShaderPermutation::new("draw.vert", 4))?;
        let fragment =
            library.shader(&ShaderPermutation::new("draw.frag", 4).define("DISPLAY", finish == Finish::Display))?;
        Ok(Draw {
            open: GraphicsPipeline::new(device, "draw", &vertex, &fragment, state)?,
            solid: GraphicsPipeline::new(
                device,
                "draw solid",
                &vertex,
                &fragment,
                GraphicsState { cull: vk::CullModeFlags::BACK, ..state },
            )?,
            grid: DrawGrid::new(device, library, state, finish == Finish::Display)?,
            samples: (samples > 1)
                .then(|| Image::new(device, "draw samples", ImageShape { samples, ..shape }))
                .transpose()?,
            depth: Image::new(device, "draw depth", ImageShape { format: DEPTH, samples, ..shape })?,
            picture: Image::new(device, "picture", shape)?,
            batch_triangles: if device.info.is_software() { 1 << 18 } else { u32::MAX / 3 },
            smooth: (antialias == Antialias::Outlines)
                .then(|| Smooth::new(device, library, shape, finish == Finish::Display))
                .transpose()?,
        })
    }

    /// What its pictures are made for.
    pub fn finish(&self) -> Finish {
        if self.picture.shape.format == SHOWN { Finish::Display } else { Finish::Linear }
    }

    /// Samples a pixel.
    pub fn samples(&self) -> u32 {
        self.samples.as_ref().map_or(1, |image| image.shape.samples)
    }

    /// The finished picture.
    pub fn finished(&self) -> &Image {
        self.smooth.as_ref().map_or(&self.picture, |smooth| &smooth.picture)
    }

    /// Images that the pass writes, and how: colour ones first, the depth image last. No picture needs what they held before.
    pub fn attachments(&self) -> impl Iterator<Item = (&Image, Access)> {
        let colors = self.samples.iter().chain([&self.picture]).map(|image| (image, Access::ColorWrite));
        colors.chain([(&self.depth, Access::DepthWrite)])
    }

    /// Device memory of the images, bytes: 8 a sample of linear colour, 4 of encoded colour and of depth.
    pub fn size_bytes(&self) -> u64 {
        let texels = |image: &Image| {
            let shape = image.shape;
            let texel_bytes = if shape.format == COLOR { 8 } else { 4 };
            texel_bytes * u64::from(shape.width) * u64::from(shape.height) * u64::from(shape.samples)
        };
        let attachments = self.attachments().map(|(image, _)| image);
        attachments.chain(self.smooth.iter().map(|smooth| &smooth.picture)).map(texels).sum()
    }

    /// Draws all viewports, one after the other, over a background of one colour. Radiance above `white` is brought down to it,
    /// hue kept. Between the render passes of a large picture stand barriers of the pass's own.
    ///
    /// # Errors
    /// What recording returns.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        viewports: &[DrawnViewport<'r>],
        background: Vec3,
        white: f32,
    ) -> Result<()> {
        let background = match self.finish() {
            Finish::Linear => background,
            Finish::Display => Vec3::from_array((background / white).to_array().map(srgb_from_linear)),
        };
        let target = Target {
            color: self.samples.as_ref().unwrap_or(&self.picture),
            clear: Some(background.extend(1.0).to_array()),
            depth: Some(&self.depth),
            resolve: self.samples.as_ref().map(|_| &self.picture),
        };
        let every = viewports.iter().flat_map(|viewport| viewport.items.iter().map(move |item| (viewport, item)));
        let batches = batches(every, 3 * self.batch_triangles);
        let count = batches.len();
        for (number, batch) in batches.into_iter().enumerate() {
            if number > 0 {
                for (image, access) in self.attachments() {
                    commands.image_barrier(image, Some(access), access);
                }
            }
            commands.render_part(&target, [number == 0, number + 1 == count], |drawing| {
                let mut bound: Option<&Item<'_>> = None;
                for (viewport, item, indices) in batch {
                    if bound.is_none_or(|bound| !std::ptr::eq(bound, item)) {
                        let [left, top, width, height] = viewport.area;
                        drawing.area(left, top, width, height);
                        if let Drawable::Triangles { positions, emission, indices, .. } = item.drawable {
                            let vertices = [(positions, 0), (emission, 0), (viewport.radiosity, item.radiosity_offset)];
                            drawing.bind(if item.culls { &self.solid } else { &self.open }, &vertices, indices);
                            drawing.push(&Push {
                                clip_from_object: item.clip_from_object.to_cols_array(),
                                emission_white: item.emission.extend(white).to_array(),
                                tag: item.tag,
                            });
                        }
                        bound = Some(item);
                    }
                    match item.drawable {
                        Drawable::Triangles { .. } => drawing.indexed(indices),
                        Drawable::Grid(grid, _) => {
                            self.grid.record(drawing, (grid, indices), item, viewport.radiosity, white)?;
                        }
                    }
                }
                Ok(())
            })?;
        }
        Ok(())
    }
}

/// Indices of items, in runs of at most `most`; at least one run, which may be empty.
fn batches<'v, 'd>(
    items: impl Iterator<Item = (&'v DrawnViewport<'d>, &'v Item<'d>)>,
    most: u32,
) -> Vec<Vec<(&'v DrawnViewport<'d>, &'v Item<'d>, Range<u32>)>> {
    let (mut batches, mut room) = (vec![Vec::new()], most);
    for (viewport, item) in items {
        for &Range { mut start, end } in &item.indices {
            while start < end {
                if room == 0 {
                    batches.push(Vec::new());
                    room = most;
                }
                let next = end.min(start.saturating_add(room));
                room -= next - start;
                batches.last_mut().expect("one at least").push((viewport, item, start..next));
                start = next;
            }
        }
    }
    batches
}
