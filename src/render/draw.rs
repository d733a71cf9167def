//! Pass "draw": lit vertices to a picture.
//!
//! Inputs: a mesh an entity (positions from its sphere's centre in metres, emission pattern, indices) and the entity's part
//! of the radiosity buffer. Output: RGBA of `width` x `height`, multisampled with depth and resolved, linear or as a screen
//! shows it.

use crate::asset::mesh::Mesh;
use crate::asset::picture::srgb_from_linear;
use crate::error::Result;
use crate::gpu::ImageShape;
use crate::gpu::Target;
use crate::gpu::{Access, Buffer, Commands, Device, GraphicsPipeline, GraphicsState, Image};
use crate::shaders::{Library, Row};
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

/// A mesh as it is drawn.
pub struct Drawable {
    positions: Buffer,
    emission: Buffer,
    indices: Buffer,
    index_count: u32,
}

impl Drawable {
    /// Uploads a mesh, its vertices in `order`; without colours its emission pattern is white.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, order: &[u32]) -> Result<Self> {
        let (centre, _) = mesh.bounding_sphere();
        let color = |v: usize| mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[v]);
        let positions: Vec<[f32; 3]> =
            order.iter().map(|&v| (mesh.positions[v as usize] - centre).to_array()).collect();
        let emission: Vec<[f32; 3]> = order.iter().map(|&v| color(v as usize).to_array()).collect();
        let mut place = vec![0; order.len()];
        for (at, &v) in order.iter().enumerate() {
            place[v as usize] = at as u32;
        }
        let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| place[v as usize])).collect();
        Ok(Drawable {
            positions: Buffer::with_data(device, "draw positions", &positions)?,
            emission: Buffer::with_data(device, "draw emission", &emission)?,
            indices: Buffer::with_data(device, "draw indices", &triangles)?,
            index_count: 3 * triangles.len() as u32,
        })
    }
}

impl Drawable {
    /// Device memory, bytes.
    pub fn size_bytes(&self) -> u64 {
        self.positions.size_bytes + self.emission.size_bytes + self.indices.size_bytes
    }
}

/// One entity to draw.
pub struct Item<'d> {
    /// Its mesh.
    pub drawable: &'d Drawable,
    /// From the mesh's frame (metres from its sphere's centre) to clip space, reversed depth.
    pub clip_from_object: Mat4,
    /// Radiance factor of its emission pattern.
    pub emission: Vec3,
    /// Byte offset of its vertices in the radiosity buffer.
    pub radiosity_offset: u64,
}

/// Items in a part of the picture, lit one way.
pub struct Pane<'i, 'd> {
    /// What is drawn.
    pub items: &'i [Item<'d>],
    /// Radiosity of their vertices.
    pub radiosity: &'d Buffer,
    /// Left, top, width and height in pixels.
    pub area: [u32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    clip_from_object: [f32; 16],
    emission_white: [f32; 4],
}

/// The pipeline and its images.
pub struct Draw {
    pipeline: GraphicsPipeline,
    samples: Option<Image>,
    depth: Image,
    /// The finished picture.
    pub picture: Image,
    /// Triangles that a render pass draws at most before the next goes on. llvmpipe keeps what is drawn until it has filled it in:
    /// of two million triangles 300 MiB, of which 250 went when it filled each in at once.
    pub batch_triangles: u32,
}

impl Draw {
    /// For pictures of `width` x `height`, with 4 samples a pixel where `multisample` is set and the device offers it.
    ///
    /// # Errors
    /// `Input` when the picture is larger than the device's images.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        [width, height]: [u32; 2],
        multisample: bool,
        finish: Finish,
    ) -> Result<Self> {
        let limits = &device.limits;
        let offered = limits.framebuffer_color_sample_counts & limits.framebuffer_depth_sample_counts;
        let samples = if multisample && offered.contains(vk::SampleCountFlags::TYPE_4) { 4 } else { 1 };
        let color = if finish == Finish::Display { SHOWN } else { COLOR };
        let shape = ImageShape { format: color, width, height, samples: 1 };
        let state = GraphicsState { color, depth: Some(DEPTH), samples, cull: vk::CullModeFlags::NONE };
        let vertex = library.shader(&Row::new("draw.vert", 4))?;
        let fragment = library.shader(&Row::new("draw.frag", 4).define("DISPLAY", finish == Finish::Display))?;
        Ok(Draw {
            pipeline: GraphicsPipeline::new(device, "draw", &vertex, &fragment, state)?,
            samples: (samples > 1)
                .then(|| Image::new(device, "draw samples", ImageShape { samples, ..shape }))
                .transpose()?,
            depth: Image::new(device, "draw depth", ImageShape { format: DEPTH, samples, ..shape })?,
            picture: Image::new(device, "picture", shape)?,
            batch_triangles: if device.info.is_software() { 1 << 18 } else { u32::MAX / 3 },
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

    /// Images whose content is thrown away before each frame: colour ones first, the depth image last.
    pub fn attachments(&self) -> impl Iterator<Item = &Image> {
        self.samples.iter().chain([&self.picture, &self.depth])
    }

    /// Device memory of the images, bytes: 8 a sample of colour, 4 of depth.
    pub fn size_bytes(&self) -> u64 {
        let texels = |image: &Image| {
            let shape = image.shape;
            let texel_bytes = if shape.format == DEPTH { 4 } else { 8 };
            texel_bytes * u64::from(shape.width) * u64::from(shape.height) * u64::from(shape.samples)
        };
        self.attachments().map(texels).sum()
    }

    /// Draws all items over a background of one colour. Radiance above `white` is brought down to it, hue kept.
    ///
    /// # Errors
    /// What recording returns.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        items: &[Item<'r>],
        radiosity: &'r Buffer,
        background: Vec3,
        white: f32,
    ) -> Result<()> {
        let ImageShape { width, height, .. } = self.picture.shape;
        self.record_panes(commands, &[Pane { items, radiosity, area: [0, 0, width, height] }], background, white)
    }

    /// As [`Draw::record`], one pane after the other.
    ///
    /// # Errors
    /// What recording returns.
    pub fn record_panes<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        panes: &[Pane<'_, 'r>],
        background: Vec3,
        white: f32,
    ) -> Result<()> {
        let background = match self.finish() {
            Finish::Linear => background,
            Finish::Display => Vec3::from_array((background / white).to_array().map(srgb_from_linear)),
        };
        let target = Target {
            color: self.samples.as_ref().unwrap_or(&self.picture),
            clear: background.extend(1.0).to_array(),
            depth: Some(&self.depth),
            resolve: self.samples.as_ref().map(|_| &self.picture),
        };
        let every = panes.iter().flat_map(|pane| pane.items.iter().map(move |item| (pane, item)));
        let batches = batches(every, 3 * self.batch_triangles);
        let count = batches.len();
        for (number, batch) in batches.into_iter().enumerate() {
            if number > 0 {
                for image in self.attachments() {
                    let access = if image.shape.format == DEPTH { Access::DepthWrite } else { Access::ColorWrite };
                    commands.image_barrier(image, Some(access), access);
                }
            }
            commands.render_part(&target, [number == 0, number + 1 == count], |drawing| {
                for (pane, item, indices) in batch {
                    let mesh = item.drawable;
                    let vertices = [(&mesh.positions, 0), (&mesh.emission, 0), (pane.radiosity, item.radiosity_offset)];
                    drawing.bind(&self.pipeline, &vertices, &mesh.indices);
                    let [left, top, width, height] = pane.area;
                    drawing.area(left, top, width, height);
                    drawing.push(&Push {
                        clip_from_object: item.clip_from_object.to_cols_array(),
                        emission_white: item.emission.extend(white).to_array(),
                    });
                    drawing.indexed(indices);
                }
                Ok(())
            })?;
        }
        Ok(())
    }
}

/// Indices of items, in runs of at most `most`; at least one run, which may be empty.
fn batches<'p, 'i, 'd>(
    items: impl Iterator<Item = (&'p Pane<'i, 'd>, &'i Item<'d>)>,
    most: u32,
) -> Vec<Vec<(&'p Pane<'i, 'd>, &'i Item<'d>, Range<u32>)>> {
    let (mut batches, mut room) = (vec![Vec::new()], most);
    for (pane, item) in items {
        let (mut first, end) = (0, item.drawable.index_count);
        while first < end {
            if room == 0 {
                batches.push(Vec::new());
                room = most;
            }
            let next = end.min(first.saturating_add(room));
            room -= next - first;
            batches.last_mut().expect("one at least").push((pane, item, first..next));
            first = next;
        }
    }
    batches
}
