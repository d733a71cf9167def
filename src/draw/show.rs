//! Pass "show": a linear picture onto what a display shows.
//!
//! Input: the picture, as large as the target. Output: an 8-bit image, sRGB by its format or by the shader.

use crate::asset::picture::srgb_from_linear;
use crate::error::Result;
use crate::gpu::image::encodes_srgb;
use crate::gpu::{Bind, Device, Drawing, GraphicsPipeline, GraphicsState, Image};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    gain: f32,
    encode: u32,
}

pub struct Show {
    pipeline: GraphicsPipeline,
    encode: bool,
}

impl Show {
    /// For targets of `format`.
    pub fn new(device: &Arc<Device>, library: &Library, format: vk::Format) -> Result<Self> {
        let vertex = library.shader(&ShaderPermutation::new("show.vert", 4))?;
        let fragment = library.shader(&ShaderPermutation::new("show.frag", 4))?;
        let pipeline = GraphicsPipeline::new(device, "show", &vertex, &fragment, GraphicsState::plain(format))?;
        Ok(Show { pipeline, encode: !encodes_srgb(format) })
    }

    /// Covers the target with the picture; `white` is the radiance that becomes white.
    pub fn record<'r>(&'r self, drawing: &mut Drawing<'_, 'r>, picture: &'r Image, white: f32) -> Result<()> {
        drawing.area([0, 0, picture.shape.width, picture.shape.height]);
        let push = Push { gain: 1.0 / white, encode: u32::from(self.encode) };
        drawing.screen(&self.pipeline, &[Bind::Image(picture)], &push)
    }

    /// The twin: a channel of radiance as 8 bits.
    pub fn twin(radiance: f32, white: f32) -> u8 {
        (255.0 * srgb_from_linear(radiance / white)).round() as u8
    }
}
