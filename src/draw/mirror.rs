//! Pass "mirror": what glossy surfaces mirror.
//!
//! For each plane that mirrors, the scene is drawn as the eye's mirror image sees it, without gloss, into a part of one
//! picture, at half the size where a software device is to be fast. A pixel of the plane finds there what it mirrors at its
//! own place, blurred by the lobe and by how far behind the mirror that is: levels of detail of the picture are the
//! blur. Where the picture is empty the sky is mirrored.
//!
//! A curved surface has a probe: six pictures from its middle of what stands around it, without it, in its part of that
//! picture. A pixel follows the mirrored ray from its own place, in steps, to where it is behind what these show. A pane
//! counts as what it hides there, and a surface does not see itself.

use crate::draw::pixel_light::LightImages;
use crate::draw::triangles::DrawnSurface;
use crate::draw::{Antialias, Draw, DrawnViewport, PictureLights};
use crate::error::Result;
use crate::gpu::{Access, Bind, Commands, Device, GraphicsPipeline, GraphicsState, Image, ImageShape, Target, Texture};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use std::collections::HashSet;
use std::sync::Arc;

/// Levels of detail.
const LEVELS: u32 = 6;
/// Texels of the finest level along a texel of the coarsest.
const COARSEST: u32 = 1 << (LEVELS - 1);
/// Radius within which depths tell how far away is what a lobe shows, over that of the microfacets' slopes, at a distance
/// of 1 from the mirror. The blur's own widths are in `glsl/mirror.glsl`.
pub const SPREAD: f64 = 1.6;
/// The same for probes, as an angle: most of what they show is faced, and a mirrored ray turns by twice a slope.
pub const PROBE_SPREAD: f64 = 3.2;
/// Texels beside its place that a pixel may read: filters of the coarsest level reach three quarters so far, and faces that
/// are not quite flat stick out of their rectangles.
pub const REACH: u32 = 2 * COARSEST;
/// Pixels of a picture up to which mirrors may have as many: a mirror takes 89 bytes for each.
const MOST_FINE_PX: u32 = 1920 * 1200;
/// Least cosine of the angle between a pixel's normal and the plane's. What this leaves of 1 is how far off the plane a
/// pixel may lie, over its distance from the eye.
pub const FLAT: f64 = 0.999;

/// What half floats hold. Radiance above is brought down to it, as blur would spread what is infinite.
const MOST_RADIANCE: f32 = 65_504.0;

/// Half of the width of a probe's picture over the tangent of the angle that it shows to each side: less than 1, so that
/// blur at the edge of a picture finds what the next one shows.
pub const PROBE_ZOOM: f64 = 0.8;
/// The coarsest level that probes read, and texels of the finest along one of its texels.
pub const PROBE_LEVEL: u32 = 4;
const PROBE_COARSEST: u32 = 1 << PROBE_LEVEL;
/// Least width of its pictures, where there is room.
const LEAST_SIDE: u32 = 64;

/// What is infinitely far, and does not count.
const NOWHERE: [f32; 4] = [1.0, 0.0, 0.0, 0.0];

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FarPush {
    edges: [[f32; 4]; 4],
    area: [f32; 4],
}

/// What may be mirrors in pictures of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mirrored {
    #[default]
    Nothing,
    Planes,
    /// Curved surfaces, too.
    PlanesAndProbes,
}

/// Width and height of a probe's pictures from which on a lobe is wider than the coarsest level's texels.
pub fn finest_side(roughness: f64) -> f64 {
    f64::from(2 * PROBE_COARSEST) / (PROBE_ZOOM * PROBE_SPREAD * (roughness * roughness).max(1e-3))
}

/// What mirrors show, in one picture.
pub struct Mirrors {
    draw: Draw,
    /// What depth leaves of 1, and what of the picture counts.
    far: Image,
    to_far: GraphicsPipeline,
    /// Levels of detail of the picture, and of that.
    levels: [Texture; 2],
    /// Width and height of a mirror's part in texels.
    pub part: [u32; 2],
}

impl Mirrors {
    /// For pictures of `size`, width and height in pixels, with at most `count` mirrors, `fine` ones or of half the
    /// size; `light` is that of these pictures, where mirrors are to have such, too.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        size: [u32; 2],
        count: u32,
        fine: bool,
        light: Option<&LightImages>,
    ) -> Result<Self> {
        // Texels of the coarsest level belong to one mirror each.
        let texel_px = if fine && size[0].saturating_mul(size[1]) <= MOST_FINE_PX { 1 } else { 2 };
        let most = device.most_image_px();
        let fit = |pixels: u32, most: u32| {
            pixels.div_ceil(texel_px).next_multiple_of(COARSEST).min(most / COARSEST * COARSEST)
        };
        let part = [fit(size[0], most / count), fit(size[1], most)];
        let all = [count * part[0], part[1]];
        let light = light.map(|light| light.beside(all)).transpose()?;
        let draw = Draw { light, ..Draw::new(device, library, all, Antialias::None, PictureLights::default())? };
        let shape = draw.picture.shape;
        let of_far = ImageShape { format: vk::Format::R16G16_SFLOAT, ..shape };
        let [vertex, fragment] = ["show.vert", "mirror_far.frag"].map(|file| ShaderPermutation::new(file, 4));
        let [vertex, fragment] = [library.shader(&vertex)?, library.shader(&fragment)?];
        let state = GraphicsState::plain(of_far.format);
        Ok(Mirrors {
            far: Image::new(device, "mirror far", of_far)?,
            to_far: GraphicsPipeline::new(device, "mirror far", &vertex, &fragment, state)?,
            levels: [
                Texture::filled_by_passes(device, "mirror levels", shape, LEVELS)?,
                Texture::filled_by_passes(device, "mirror far levels", of_far, LEVELS)?,
            ],
            draw,
            part,
        })
    }

    /// How many mirrors there may be.
    pub fn count(&self) -> usize {
        (self.draw.picture.shape.width / self.part[0]) as usize
    }

    /// Left, top, width and height of a mirror's part.
    pub fn area(&self, mirror: usize) -> [u32; 4] {
        let [width, height] = self.part;
        [mirror as u32 * width, 0, width, height]
    }

    /// Width and height of each of the six pictures of a probe that is seen `texels` wide; 0 where parts are too small.
    pub fn face_side(&self, texels: f64) -> u32 {
        let most = (self.part[0] / 3).min(self.part[1] / 2) / PROBE_COARSEST * PROBE_COARSEST;
        let wanted = texels.clamp(f64::from(LEAST_SIDE), f64::from(most.max(LEAST_SIDE))) as u32;
        most.min(wanted.next_multiple_of(PROBE_COARSEST))
    }

    /// Left, top, width and height of one of a probe's pictures, which lie in two rows of its part.
    pub fn face_area(&self, mirror: usize, face: usize, side: u32) -> [u32; 4] {
        [mirror as u32 * self.part[0] + face as u32 % 3 * side, face as u32 / 3 * side, side, side]
    }

    pub(super) fn make(&self, surfaces: &HashSet<DrawnSurface>, grids: bool) -> Result<()> {
        let diffuse = surfaces.iter().map(|surface| DrawnSurface { detail: None, ..*surface }).collect();
        self.draw.make_shown(&diffuse, grids)
    }

    /// Draws what the mirrors show and makes it ready to be sampled.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, viewports: &[DrawnViewport<'r>]) -> Result<()> {
        if viewports.is_empty() {
            // They are bound, and not read.
            self.levels.iter().for_each(|levels| commands.image_barrier(&levels.image, None, Access::GraphicsSampled));
            return Ok(());
        }
        // The parts in use, and what filters of the coarsest level read beside them.
        let end = viewports.iter().map(|viewport| viewport.area[0] / self.part[0] + 1).max().unwrap_or(0);
        let width = (end * self.part[0] + COARSEST).min(self.far.shape.width);
        for (image, access) in self.draw.attachments() {
            commands.image_barrier(image, None, access);
        }
        if let Some(light) = self.draw.pixel_light(viewports) {
            light.record(commands, viewports)?;
        }
        self.draw.record(commands, viewports, Vec4::ZERO, MOST_RADIANCE)?;
        commands.image_barrier(&self.draw.depth, Some(Access::DepthWrite), Access::GraphicsSampled);
        commands.image_barrier(&self.far, None, Access::ColorWrite);
        let target = Target { color: &self.far, second: None, clear: Some(NOWHERE), depth: None, resolve: None };
        commands.render(&target, |drawing| {
            viewports.iter().try_for_each(|viewport| {
                drawing.part_of(viewport.area, viewport.drawn);
                let push = FarPush { edges: viewport.edges, area: viewport.area.map(|px| px as f32) };
                drawing.screen(&self.to_far, &[Bind::Image(&self.draw.depth)], &push)
            })
        })?;
        for (image, levels) in [&self.draw.picture, &self.far].into_iter().zip(&self.levels) {
            commands.image_barrier(image, Some(Access::ColorWrite), Access::TransferRead);
            commands.fill_levels(image, levels, width);
        }
        Ok(())
    }

    pub(super) fn binds(&self) -> [Bind<'_>; 2] {
        self.levels.each_ref().map(Bind::Texture)
    }
}
