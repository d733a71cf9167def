//! Pass "smooth": outlines and creases of a picture with one sample a pixel, smoothed by where they are.
//!
//! An outline or crease cuts each pixel that it runs through into two shares. The share beyond the line takes the
//! colour of the pixel on the line's other side (Persson, *Geometric Post-process Anti-Aliasing*, 2011). Only those
//! pixels are touched, so the pass is cheap on a software rasteriser. It does not smooth the line where two surfaces
//! run through one another, and what is thinner than a pixel stays as broken as one sample leaves it.
//!
//! Inputs: the picture with the entity's tag in alpha, its reversed depth, and two triangles for each line. They cover
//! the pixels whose centres lie within half a pixel of the line, measured along x where the line is steep and along y
//! elsewhere. Output: the smoothed picture.

use crate::asset::edges::Line;
use crate::draw::DrawnViewport;
use crate::error::Result;
use crate::gpu::{Access, Bind, Commands, Device, GraphicsPipeline, GraphicsState, Image, ImageShape, Target, Upload};
use crate::layout::TAG_STEP;
use crate::shaders::{Library, ShaderPermutation};
use glam::{DVec2, DVec3, IVec2};
use std::sync::Arc;

/// Surfaces behind a line may seem nearer by this share of its distance.
const TOLERANCE: f64 = 1e-3;

/// Pixels that a corner may be moved by: two steps of 1/256, which is what devices have to offer at least, and
/// rounding.
const SNAPPED: f64 = 0.01;

/// Tags in use; the last value is the background's.
const TAGS: usize = 254;

/// The tag of an entity in a picture's alpha. The 255th has the first one's again: their lines are then told apart by
/// depth alone.
pub fn tag(entity: usize) -> f32 {
    (1 + entity % TAGS) as f32 * TAG_STEP
}

/// Lines as the device draws them, four corners each.
#[derive(Default)]
pub struct Strips {
    corners: Vec<[f32; 4]>,
    marks: Vec<[f32; 3]>,
}

impl Strips {
    /// Adds a line of an entity in a viewport of `size` pixels.
    pub fn add(&mut self, line: &Line, size: [u32; 2], tag: f32) {
        let Some(strip) = Strip::new(line, size) else { return };
        let half = if strip.steep { DVec2::new(0.5, 0.0) } else { DVec2::new(0.0, 0.5) };
        let size = DVec2::new(size[0].into(), size[1].into());
        for (end, depth) in strip.ends.iter().zip(strip.depths) {
            for offset in [-1.0, 1.0] {
                let at = (*end + half * offset) / size * 2.0 - 1.0;
                self.corners.push([at.x as f32, at.y as f32, depth as f32, 0.5 * offset as f32]);
                self.marks.push([strip.inner as f32, f32::from(u8::from(strip.steep)), tag]);
            }
        }
    }

    pub fn count(&self) -> usize {
        self.corners.len() / 4
    }
}

/// A line in a picture.
struct Strip {
    /// Pixels from the picture's left and top.
    ends: [DVec2; 2],
    depths: [f64; 2],
    /// Whether offsets from it go along x.
    steep: bool,
    /// Sign of offsets on the side of its face.
    inner: f64,
}

impl Strip {
    /// `None` where the line is shorter than a millionth of a pixel.
    fn new(line: &Line, size: [u32; 2]) -> Option<Self> {
        let size = DVec2::new(size[0].into(), size[1].into());
        let ends = line.ends.map(|c| (DVec2::new(c.x, c.y) / c.w + 1.0) / 2.0 * size);
        let along = ends[1] - ends[0];
        let steep = along.y.abs() > along.x.abs();
        let inner = line.side.signum() * if steep { -along.y.signum() } else { along.x.signum() };
        let depths = line.ends.map(|c| c.z / c.w);
        (along.abs().max_element() > 1e-6).then_some(Strip { ends, depths, steep, inner })
    }
}

pub struct Lines {
    corners: Upload,
    marks: Upload,
    indices: Upload,
}

impl Lines {
    pub fn new(device: &Arc<Device>) -> Result<Self> {
        Ok(Lines {
            corners: Upload::new(device, "line corners", 16)?,
            marks: Upload::new(device, "line marks", 12)?,
            indices: Upload::new(device, "line indices", 24)?,
        })
    }

    pub fn write(&mut self, strips: &Strips) -> Result<()> {
        if strips.count() == 0 {
            return Ok(());
        }
        let two = |line: u32| [0, 1, 2, 2, 1, 3].map(|corner| 4 * line + corner);
        let indices: Vec<[u32; 6]> = (0..strips.count() as u32).map(two).collect();
        self.corners.write(&strips.corners)?;
        self.marks.write(&strips.marks)?;
        self.indices.write(&indices)
    }
}

pub struct Smooth {
    pipeline: GraphicsPipeline,
    pub picture: Image,
}

impl Smooth {
    pub fn fragment() -> ShaderPermutation {
        ShaderPermutation::new("smooth.frag", 4).number("TOLERANCE", TOLERANCE).number("SNAPPED", SNAPPED)
    }

    /// For pictures of a shape.
    pub fn new(device: &Arc<Device>, library: &Library, shape: ImageShape) -> Result<Self> {
        let state = GraphicsState::plain(shape.format);
        let vertex = library.shader(&ShaderPermutation::new("smooth.vert", 4))?;
        let fragment = library.shader(&Self::fragment())?;
        Ok(Smooth {
            pipeline: GraphicsPipeline::new(device, "smooth", &vertex, &fragment, state)?,
            picture: Image::new(device, "smooth picture", shape)?,
        })
    }

    /// Copies `picture` and smooths the copy along the lines of each viewport. Expects the picture as source of a copy,
    /// its own one as target and the depth to be read, and leaves its own picture as colour attachment, also where no
    /// line is in view.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        (picture, depth): (&'r Image, &'r Image),
        lines: &'r Lines,
        viewports: &[DrawnViewport<'_>],
    ) -> Result<()> {
        commands.copy_between(picture, &self.picture);
        commands.image_barrier(&self.picture, Some(Access::TransferWrite), Access::ColorWrite);
        commands.image_barrier(picture, Some(Access::TransferRead), Access::GraphicsSampled);
        let target = Target { color: &self.picture, second: None, clear: None, depth: None, resolve: None };
        commands.render(&target, |drawing| {
            drawing.bind(&self.pipeline, &[(&lines.corners, 0), (&lines.marks, 0)], &lines.indices);
            drawing.resources(&[Bind::Image(picture), Bind::Image(depth)])?;
            for DrawnViewport { area, lines, .. } in viewports.iter().filter(|viewport| !viewport.lines.is_empty()) {
                let [left, top, width, height] = *area;
                drawing.area(*area);
                drawing.push(&[left, top, left + width - 1, top + height - 1].map(u32::cast_signed));
                drawing.indexed(6 * lines.start..6 * lines.end);
            }
            Ok(())
        })
    }

    /// The twin: smooths a linear picture of `width` x `height`.
    pub fn twin(texels: &[Texel], [width, height]: [u32; 2], lines: &[(Line, f32)]) -> Vec<DVec3> {
        let last = IVec2::new(width.cast_signed() - 1, height.cast_signed() - 1);
        let at = |pixel: IVec2| {
            let pixel = pixel.clamp(IVec2::ZERO, last);
            &texels[(pixel.y * width.cast_signed() + pixel.x) as usize]
        };
        let mut out: Vec<DVec3> = texels.iter().map(|texel| texel.color).collect();
        for (line, tag) in lines {
            let Some(strip) = Strip::new(line, [width, height]) else { continue };
            let (major, minor) = if strip.steep { (1, 0) } else { (0, 1) };
            let step = IVec2::from(if strip.steep { (1, 0) } else { (0, 1) });
            let [from, to] = strip.ends;
            let first = from[major].min(to[major]);
            let end = from[major].max(to[major]);
            for column in (first - 0.5).ceil() as i32..(end - 0.5).ceil() as i32 {
                let share = (f64::from(column) + 0.5 - from[major]) / (to[major] - from[major]);
                let place = from[minor] + share * (to[minor] - from[minor]);
                let row = place.floor() as i32;
                let pixel = if strip.steep { IVec2::new(row, column) } else { IVec2::new(column, row) };
                if pixel.clamp(IVec2::ZERO, last) != pixel {
                    continue;
                }
                let offset = f64::from(row) + 0.5 - place;
                let mut across = if offset > 0.0 { -step } else { step };
                let mut inside = offset * strip.inner > 0.0;
                let shows = |pixel: IVec2| (at(pixel).tag - tag).abs() < TAG_STEP / 2.0;
                let [own, beyond, opposite] = [pixel, pixel + across, pixel - across].map(shows);
                if offset.abs() < SNAPPED && own == beyond && own != opposite {
                    (across, inside) = (-across, !inside);
                }
                let (inner, outer) = if inside { (pixel, pixel + across) } else { (pixel + across, pixel) };
                let outwards = if inside { across } else { -across };
                if !shows(inner) {
                    continue;
                }
                let behind = at(outer).depth;
                let slope = behind - at(outer.clamp(IVec2::ZERO, last) + outwards).depth;
                let reach = if inside { 1.0 - offset.abs() } else { offset.abs() };
                let depth = strip.depths[0] + share * (strip.depths[1] - strip.depths[0]);
                if behind.min(behind + slope * reach) <= depth * (1.0 + TOLERANCE) {
                    let beyond = at(pixel + across).color;
                    let number = (pixel.y * width.cast_signed() + pixel.x) as usize;
                    out[number] = at(pixel).color.lerp(beyond, 0.5 - offset.abs());
                }
            }
        }
        out
    }
}

/// A pixel as the twin of "smooth" reads it.
#[derive(Clone, Copy, Debug)]
pub struct Texel {
    pub color: DVec3,
    /// How far the color may be off, since a driver chooses where within a triangle it shades a pixel of an edge.
    pub spread: DVec3,
    /// Reversed: greater is nearer, 0 infinitely far.
    pub depth: f64,
    /// [`tag`] of the entity seen, 1 for the background.
    pub tag: f32,
}
