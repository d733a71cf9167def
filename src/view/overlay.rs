//! Pass "overlay": egui's triangles over a picture.
//!
//! Inputs: meshes with their textures and clip rectangles, in points; colours are sRGB, premultiplied by alpha. Output:
//! the target of the render pass, 8 bits a channel, sRGB by its format or by the shader.

use crate::error::Result;
use crate::gpu::image::encodes_srgb;
use crate::gpu::{
    Access, Bind, Buffer, BufferKind, Commands, Device, Drawing, GraphicsPipeline, GraphicsState, Image, ImageShape,
    Keeps, Upload,
};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use egui::epaint::{ClippedPrimitive, Primitive};
use egui::{ColorImage, ImageData, TextureId, TexturesDelta};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// One tessellated frame of egui.
pub struct Paint {
    /// Triangles with clip rectangles, in points.
    pub primitives: Vec<ClippedPrimitive>,
    pub pixels_per_point: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    size: [f32; 2],
    encode: u32,
}

/// A texture with its content on the host, because changes of a part are uploaded as a whole.
struct Texture {
    pixels: ColorImage,
    image: Image,
}

/// Triangles of one texture and clip rectangle.
struct Run {
    texture: TextureId,
    /// Left, top, width and height, pixels.
    clip: [u32; 4],
    indices: Range<u32>,
}

pub struct Overlay {
    device: Arc<Device>,
    pipeline: GraphicsPipeline,
    encode: bool,
    textures: HashMap<TextureId, Texture>,
    /// Textures of which the last frame is being drawn.
    retired: Vec<TextureId>,
    /// All positions, then all places in textures, then all colours.
    vertices: Upload,
    vertex_count: u64,
    indices: Upload,
    runs: Vec<Run>,
    /// Width and height of the target, pixels and points.
    size: [u32; 2],
    points: [f32; 2],
}

impl Overlay {
    /// For targets of `format`.
    pub fn new(device: &Arc<Device>, library: &Library, format: vk::Format) -> Result<Self> {
        let state = GraphicsState { keeps: Keeps::Over, ..GraphicsState::plain(format) };
        let vertex = library.shader(&ShaderPermutation::new("overlay.vert", 4))?;
        let fragment = library.shader(&ShaderPermutation::new("overlay.frag", 4))?;
        Ok(Overlay {
            device: device.clone(),
            pipeline: GraphicsPipeline::new(device, "overlay", &vertex, &fragment, state)?,
            encode: !encodes_srgb(format),
            textures: HashMap::new(),
            retired: Vec::new(),
            vertices: Upload::new(device, "overlay vertices", 1 << 18)?,
            vertex_count: 0,
            indices: Upload::new(device, "overlay indices", 1 << 16)?,
            runs: Vec::new(),
            size: [0; 2],
            points: [0.0; 2],
        })
    }

    /// Applies changes of textures; call it before the frame that needs them is prepared.
    pub fn update(&mut self, mut delta: TexturesDelta) -> Result<()> {
        for id in self.retired.drain(..) {
            self.textures.remove(&id);
        }
        for (id, changes) in delta.set.drain() {
            let mut pixels = self.textures.remove(&id).map(|texture| texture.pixels);
            for change in changes {
                let ImageData::Color(part) = change.image;
                match (change.pos, &mut pixels) {
                    (Some(place), Some(whole)) => replace(whole, place, &part),
                    _ => pixels = Some((*part).clone()),
                }
            }
            if let Some(pixels) = pixels {
                let image = upload(&self.device, &pixels)?;
                self.textures.insert(id, Texture { pixels, image });
            }
        }
        // The coming frame still draws with these.
        self.retired.extend(delta.free.drain());
        Ok(())
    }

    /// Writes what the next recording draws, into buffers of that flight's own.
    pub fn prepare(&mut self, paint: &Paint, size: [u32; 2]) -> Result<()> {
        let scale = paint.pixels_per_point;
        let mut positions: Vec<[f32; 2]> = Vec::new();
        let mut places: Vec<[f32; 2]> = Vec::new();
        let mut colors: Vec<[f32; 4]> = Vec::new();
        let mut indices: Vec<u32> = Vec::new();
        self.size = size;
        self.points = size.map(|side| side as f32 / scale);
        self.runs.clear();
        for ClippedPrimitive { clip_rect, primitive } in &paint.primitives {
            let Primitive::Mesh(mesh) = primitive else { continue };
            let first = indices.len() as u32;
            let base = positions.len() as u32;
            indices.extend(mesh.indices.iter().map(|index| base + index));
            for vertex in &mesh.vertices {
                positions.push([vertex.pos.x, vertex.pos.y]);
                places.push([vertex.uv.x, vertex.uv.y]);
                colors.push(vertex.color.to_array().map(|channel| f32::from(channel) / 255.0));
            }
            let pixel = |place: f32, side: u32| (place * scale).round().clamp(0.0, side as f32) as u32;
            let left = pixel(clip_rect.min.x, size[0]);
            let top = pixel(clip_rect.min.y, size[1]);
            let right = pixel(clip_rect.max.x, size[0]);
            let bottom = pixel(clip_rect.max.y, size[1]);
            let clip = [left, top, right.saturating_sub(left), bottom.saturating_sub(top)];
            self.runs.push(Run { texture: mesh.texture_id, clip, indices: first..indices.len() as u32 });
        }
        self.vertex_count = positions.len() as u64;
        let floats = [positions.as_flattened(), places.as_flattened(), colors.as_flattened()].concat();
        self.vertices.write(&floats)?;
        self.indices.write(&indices)
    }

    /// Draws over the picture what was prepared last.
    pub fn record<'r>(&'r self, drawing: &mut Drawing<'_, 'r>) -> Result<()> {
        let [width, height] = self.size;
        drawing.area([0, 0, width, height]);
        for Run { texture, clip, indices } in &self.runs {
            let Some(texture) = self.textures.get(texture).filter(|_| !clip[2..].contains(&0)) else { continue };
            let vertices: &Buffer = &self.vertices;
            let parts = [(vertices, 0), (vertices, 8 * self.vertex_count), (vertices, 16 * self.vertex_count)];
            drawing.bind(&self.pipeline, &parts, &self.indices);
            drawing.resources(&[Bind::Image(&texture.image)])?;
            drawing.push(&Push { size: self.points, encode: u32::from(self.encode) });
            drawing.clip(*clip);
            drawing.indexed(indices.clone());
        }
        Ok(())
    }
}

fn replace(whole: &mut ColorImage, [x, y]: [usize; 2], part: &ColorImage) {
    for row in 0..part.height() {
        let at = (y + row) * whole.width() + x;
        let from = &part.pixels[row * part.width()..][..part.width()];
        whole.pixels[at..at + part.width()].copy_from_slice(from);
    }
}

/// An image on the device, ready to be read.
fn upload(device: &Arc<Device>, pixels: &ColorImage) -> Result<Image> {
    let width = pixels.width() as u32;
    let height = pixels.height() as u32;
    let shape = ImageShape { format: vk::Format::R8G8B8A8_SRGB, width, height, samples: 1 };
    let image = Image::new(device, "overlay texture", shape)?;
    let bytes: Vec<[u8; 4]> = pixels.pixels.iter().map(|pixel| pixel.to_array()).collect();
    let mut staging = Buffer::new(device, "overlay texture on the host", BufferKind::Upload, 4 * bytes.len() as u64)?;
    staging.write(0, &bytes);
    let mut commands = Commands::new(device, "overlay texture")?;
    commands.image_barrier(&image, None, Access::TransferWrite);
    commands.copy_to_image(&staging, &image);
    commands.image_barrier(&image, Some(Access::TransferWrite), Access::GraphicsSampled);
    commands.submit()?;
    Ok(image)
}
