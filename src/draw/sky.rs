//! Part of pass "draw": distant light where nothing else is seen.

use crate::asset::backdrop::Backdrop;
use crate::asset::environment::Environment;
use crate::draw::{PipelineMaker, made_once};
use crate::error::Result;
use crate::gpu::{Bind, Device, Drawing, GraphicsPipeline, GraphicsState, Keeps, Texture};
use crate::scene::Camera;
use crate::shaders::ShaderPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use std::sync::{Arc, OnceLock};

/// Value of the map's brightest texel. Halves end at 65504, and what is 1e8 times as dark is still above their least.
const BRIGHTEST: f32 = 6e4;

/// What a picture shows behind everything.
pub struct DrawnSky {
    map: Texture,
    /// Radiance that 1 in the map stands for.
    scale: f32,
    turn: DMat3,
}

/// A sky from where a picture's region is seen.
pub struct SeenSky<'d> {
    map: &'d Texture,
    scale: f32,
    /// In the map's axes: a direction at the picture's upper left corner, and its changes for a pixel across and down.
    axes: DMat3,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    corner_scale: [f32; 4],
    across_white: [f32; 4],
    down: [f32; 4],
}

impl DrawnSky {
    /// `None` for an environment that is the same in all directions.
    pub fn new(device: &Arc<Device>, environment: &Environment) -> Result<Option<Self>> {
        let Some(Backdrop { width, texels, turn }) = Backdrop::new(environment) else { return Ok(None) };
        let brightest = texels.iter().map(|texel| texel.max_element()).fold(f32::MIN_POSITIVE, f32::max);
        let scale = brightest / BRIGHTEST;
        let scaled: Vec<[f32; 4]> = texels.iter().map(|texel| (*texel / scale).extend(1.0).to_array()).collect();
        let wrap = [vk::SamplerAddressMode::REPEAT, vk::SamplerAddressMode::CLAMP_TO_EDGE];
        let map = Texture::of_halves(device, "backdrop", width as u32, &scaled, wrap)?;
        Ok(Some(DrawnSky { map, scale, turn: DMat3::from_quat(turn) }))
    }

    /// As a camera sees it in a region: left, top, width and height in pixels.
    pub fn seen(&self, camera: &Camera, area: [u32; 4]) -> SeenSky<'_> {
        let [left, top, width, height] = area.map(f64::from);
        let ahead = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize();
        let right = ahead.cross(camera.up().as_dvec3()).normalize();
        let pixel = 2.0 * camera.half_height() / height;
        let across = pixel * right;
        let down = pixel * ahead.cross(right);
        let corner = ahead - (left + 0.5 * width) * across - (top + 0.5 * height) * down;
        SeenSky { map: &self.map, scale: self.scale, axes: self.turn * DMat3::from_cols(corner, across, down) }
    }
}

pub(super) struct DrawSky {
    maker: PipelineMaker,
    made: OnceLock<GraphicsPipeline>,
}

impl DrawSky {
    pub fn new(maker: PipelineMaker) -> Self {
        DrawSky { maker, made: OnceLock::new() }
    }

    /// What skies are drawn with.
    pub fn pipeline(&self) -> Result<&GraphicsPipeline> {
        made_once(&self.made, || {
            let state = GraphicsState { keeps: Keeps::ColorOver, ..self.maker.state };
            let rows = ["show.vert", "sky.frag"].map(|file| ShaderPermutation::new(file, 4));
            self.maker.make("sky", &rows, state)
        })
    }

    /// Draws a sky in the area that was set, where nothing has been drawn.
    pub fn record<'r>(&'r self, drawing: &mut Drawing<'_, 'r>, sky: &SeenSky<'r>, white: f32) -> Result<()> {
        let axis = |axis: DVec3, w: f32| axis.as_vec3().extend(w).to_array();
        let SeenSky { map, scale, axes } = sky;
        let push = Push {
            corner_scale: axis(axes.x_axis, *scale),
            across_white: axis(axes.y_axis, white),
            down: axis(axes.z_axis, 0.0),
        };
        drawing.screen(self.pipeline()?, &[Bind::Texture(map)], &push)
    }
}
