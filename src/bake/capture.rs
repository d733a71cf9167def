//! Pass "capture": shows an object from sample points: the six cube faces around each eye, many eyes in one atlas.
//!
//! Inputs: the mesh in units of its bounding radius around its centre; eyes in the same frame. Output: an atlas of
//! square faces. An occlusion capture is R8: the object is black on white. A radiance capture is RGBA32F: the mesh's
//! colours on black. A face that the object's bounding sphere does not reach is left out and gets no place in the
//! atlas. The other faces show chunks of neighbouring triangles. A chunk is left out if its bounding sphere does not
//! reach into the face, or if the mesh is closed and the eye sees only backs of the chunk. Of a large mesh, chunks of
//! fewer triangles stand for what is far off.

use super::chunk::{faces_reached, joined};
use super::model::DrawnFace;
pub use super::model::Model;
use super::raster::{Raster, RasterFaces, face_axes};
use crate::error::{Error, Result};
use crate::field::FieldKind;
use crate::gpu::{Access, Buffer, Commands, Device, GraphicsPipeline, GraphicsState, Image, ImageShape, Target};
use crate::sh::cube::{FACE_COUNT, face_basis, texel_st};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Edge of the atlas in texels, where the device allows it. It holds 1 024 faces of 64 px, in 4 MB for occlusion.
const ATLAS_PX: u32 = 2048;
/// Nearest distance that a drawn radiance capture sees, in r.
const NEAR: f32 = 1e-4;
pub const NO_SLOT: u32 = u32::MAX;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    eye: [f32; 4],
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    Drawn,
    /// By a compute shader ([`super::raster`]), as on software devices. Colours are drawn all the same: to find the
    /// nearest triangle of a texel takes a second round over all of them, and with the atlas of 16 bytes a texel four
    /// times as long as drawing.
    Computed,
}

impl Way {
    pub fn usual(device: &Device) -> Self {
        if device.info.is_software() { Way::Computed } else { Way::Drawn }
    }
}

/// Where in the atlas the faces of an eye lie.
pub type Slots = [u32; FACE_COUNT];

enum Writer {
    Drawn { pipeline: GraphicsPipeline, depth: Option<Image> },
    Computed(Raster),
}

/// What the faces of a batch show.
pub struct Drawn {
    faces: Vec<DrawnFace>,
    /// Indices of faces that are drawn, where they are not those of the model.
    gathered: Option<Buffer>,
    computed: Option<RasterFaces>,
}

impl Drawn {
    fn access(&self) -> Access {
        if self.computed.is_some() { Access::TransferWrite } else { Access::ColorWrite }
    }

    /// Triangles that are drawn, each as often as faces show it.
    pub fn triangles(&self) -> u64 {
        self.faces.iter().flat_map(|face| &face.ranges).map(|range| u64::from(range.end - range.start) / 3).sum()
    }
}

pub struct Capture {
    pub(super) model: Model,
    writer: Writer,
    /// Captured faces, row by row.
    pub atlas: Image,
    pub face_px: u32,
    pub columns: u32,
    pub kind: FieldKind,
}

impl Capture {
    pub fn rows(kind: FieldKind) -> [ShaderPermutation; 2] {
        ["capture.vert", "capture.frag"]
            .map(|file| ShaderPermutation::new(file, 4).define("RADIANCE", kind == FieldKind::Radiance))
    }

    /// Captures of a model in faces of `face_px`. Those that cannot be computed are drawn. `Input` when a face is
    /// larger than the device's images.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        model: Model,
        face_px: u32,
        kind: FieldKind,
        way: Way,
    ) -> Result<Self> {
        let radiance = kind == FieldKind::Radiance;
        let most = device.most_image_px();
        let atlas_px = ATLAS_PX.min(most);
        // The texels of a radiance capture are 16 times as large. Six faces always fit.
        let columns = (if radiance { atlas_px / 2 } else { atlas_px } / face_px).max(3);
        let edge = columns * face_px;
        if edge > most {
            return Err(Error::Input(format!(
                "cube faces of {face_px} px take images of {edge} px, the device's have at most {most} px"
            )));
        }
        let format = if radiance { vk::Format::R32G32B32A32_SFLOAT } else { vk::Format::R8_UNORM };
        let shape = ImageShape { format, width: edge, height: edge, samples: 1 };
        let computed = way == Way::Computed && !radiance && Raster::serves(face_px) && Raster::holds(device, &model);
        let writer = if computed {
            Writer::Computed(Raster::new(device, library, face_px, columns)?)
        } else {
            let depth_format = radiance.then_some(vk::Format::D32_SFLOAT);
            let depth_image = |format| Image::new(device, "capture depth", ImageShape { format, ..shape });
            let depth = depth_format.map(depth_image).transpose()?;
            let [vertex, fragment] = Self::rows(kind).map(|row| library.shader(&row));
            let state = GraphicsState { depth: depth_format, ..GraphicsState::plain(format) };
            Writer::Drawn { pipeline: GraphicsPipeline::new(device, "capture", &vertex?, &fragment?, state)?, depth }
        };
        Ok(Capture { model, writer, atlas: Image::new(device, "capture atlas", shape)?, face_px, columns, kind })
    }

    pub fn capacity(&self) -> u32 {
        self.columns * self.columns
    }

    /// Gives the faces of all eyes their slots, batch after batch, each of which fills the atlas once.
    pub fn plan(&self, eyes: &[Vec3]) -> Vec<Vec<Slots>> {
        let shown: Vec<_> =
            eyes.par_iter().map_init(Vec::new, |buffer, &eye| self.model.faces(eye, self.face_px, buffer)).collect();
        let mut batches: Vec<Vec<Slots>> = Vec::new();
        let mut used = self.capacity();
        for faces in shown {
            // A sample without any face still takes a place in its batch.
            let taken = batches.last().map_or(used, |batch| used.max(batch.len() as u32));
            if taken + FACE_COUNT as u32 > self.capacity() {
                batches.push(Vec::new());
                used = 0;
            }
            let slots = faces.map(|shows| {
                used += u32::from(shows);
                if shows { used - 1 } else { NO_SLOT }
            });
            batches.last_mut().expect("one was begun above").push(slots);
        }
        batches
    }

    pub fn choose(&self, eyes: &[Vec3], slots: &[Slots]) -> Result<Drawn> {
        let shown = |buffer: &mut Vec<Range<u32>>, (&eye, slots): (&Vec3, &Slots)| -> Vec<DrawnFace> {
            let chunks = self.model.shown(eye, self.face_px, buffer);
            let facing: Vec<_> = chunks.filter(|chunk| !(self.model.closed && chunk.turned_away(eye))).collect();
            let reached: Vec<_> = facing.iter().map(|chunk| faces_reached(eye, chunk.centre, chunk.radius)).collect();
            let in_atlas = slots.iter().enumerate().filter(|(_, slot)| **slot != NO_SLOT);
            let face = |(face, &slot): (usize, &u32)| {
                let visible = facing.iter().zip(&reached).filter(|(_, reached)| reached[face]);
                DrawnFace { eye, face, slot, ranges: joined(visible.map(|(chunk, _)| chunk.indices.clone())) }
            };
            in_atlas.map(face).collect()
        };
        let mut faces: Vec<_> = eyes.par_iter().zip(slots).map_init(Vec::new, shown).flatten_iter().collect();
        let (gathered, computed) = match &self.writer {
            Writer::Computed(_) => (None, Some(RasterFaces::new(self.model.positions.device(), &faces)?)),
            Writer::Drawn { .. } => (self.model.gather(&mut faces)?, None),
        };
        Ok(Drawn { faces, gathered, computed })
    }

    /// Captures what was chosen, and records the barriers around it up to the one for `reader`, which reads the atlas
    /// next.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, drawn: &'r Drawn, reader: Access) -> Result<()> {
        commands.image_barrier(&self.atlas, None, drawn.access());
        if let Writer::Drawn { depth: Some(depth), .. } = &self.writer {
            commands.image_barrier(depth, None, Access::DepthWrite);
        }
        commands.pass("capture", |c| match (&self.writer, &drawn.computed) {
            (Writer::Computed(raster), Some(faces)) => raster.record(c, &self.model, faces, &self.atlas),
            (Writer::Drawn { pipeline, depth }, None) => self.draw(c, pipeline, depth.as_ref(), drawn),
            _ => unreachable!("what was chosen is for another capture"),
        })?;
        commands.image_barrier(&self.atlas, Some(drawn.access()), reader);
        Ok(())
    }

    fn draw<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        pipeline: &'r GraphicsPipeline,
        depth: Option<&'r Image>,
        drawn: &'r Drawn,
    ) -> Result<()> {
        let radiance = self.kind == FieldKind::Radiance;
        let background = if radiance { [0.0, 0.0, 0.0, 1.0] } else { [1.0; 4] };
        let target = Target { color: &self.atlas, second: None, clear: Some(background), depth, resolve: None };
        let mut vertices = vec![(&self.model.positions, 0)];
        vertices.extend(self.model.colors.iter().filter(|_| radiance).map(|colors| (colors, 0)));
        commands.render(&target, |drawing| {
            drawing.bind(pipeline, &vertices, drawn.gathered.as_ref().unwrap_or(&self.model.indices));
            if self.model.closed {
                // A cube face is a mirror image, which turns every triangle over: these are the object's back faces.
                drawing.cull(vk::CullModeFlags::FRONT);
            }
            for DrawnFace { eye, face, slot, ranges } in &drawn.faces {
                let (forward, right, down) = face_axes(*face);
                let px = self.face_px;
                drawing.area([slot % self.columns * px, slot / self.columns * px, px, px]);
                let [right, down, forward] = [right, down, forward].map(|axis| axis.extend(0.0).to_array());
                drawing.push(&Push { eye: eye.extend(NEAR).to_array(), right, down, forward });
                for range in ranges {
                    drawing.indexed(range.clone());
                }
            }
            Ok(())
        })
    }
}

/// The rows or columns of a face in which rays may meet a triangle, by one coordinate of its corners and their depths.
fn reach(sides: [f64; 3], depths: [f64; 3], px: usize) -> Range<usize> {
    if depths.iter().any(|depth| *depth <= 0.0) {
        return 0..px;
    }
    let texels = [0, 1, 2].map(|corner| 0.5 * (sides[corner] / depths[corner] + 1.0) * px as f64);
    let first = texels.into_iter().fold(f64::INFINITY, f64::min) - 1.0;
    let end = texels.into_iter().fold(f64::NEG_INFINITY, f64::max) + 1.0;
    (first.max(0.0) as usize).min(px)..(end.max(0.0) as usize).min(px)
}

/// The CPU twin of a capture, by another method: it casts a ray through every texel centre of one face. Row by row the
/// corners of the nearest triangle that each meets, and the place's weights among them. Positions are those of
/// [`super::triangles::unit_positions`].
pub fn twin(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    eye: DVec3,
    face: usize,
    face_px: u32,
) -> Vec<Option<([u32; 3], [f64; 3])>> {
    let (forward, right, down) = face_basis(face);
    let px = face_px as usize;
    // With distances in units of the ray's (s, t, 1).
    let mut nearest = vec![(f64::INFINITY, None); px * px];
    for triangle in triangles {
        // The triangle stands in the face's frame, where the direction of a ray is (s, t, 1).
        let [a, b, c] = triangle.map(|i| {
            let q = positions[i as usize].as_dvec3() - eye;
            DVec3::new(q.dot(right), q.dot(down), q.dot(forward))
        });
        let depths = [a.z, b.z, c.z];
        if depths.iter().all(|depth| *depth <= 0.0) {
            continue;
        }
        // A ray hits when it lies on the same side of the three planes through the eye and an edge, and in front.
        let edges = [b.cross(c), c.cross(a), a.cross(b)];
        let plane = (b - a).cross(c - a);
        let offset = plane.dot(a);
        for y in reach([a.y, b.y, c.y], depths, px) {
            for x in reach([a.x, b.x, c.x], depths, px) {
                let ray = DVec3::new(texel_st(x, px), texel_st(y, px), 1.0);
                let sides = edges.map(|edge| edge.dot(ray));
                let same = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
                let along = plane.dot(ray);
                let texel = &mut nearest[y * px + x];
                if same && offset * along > 0.0 && offset / along < texel.0 {
                    let sum: f64 = sides.iter().sum();
                    *texel = (offset / along, Some((*triangle, sides.map(|side| side / sum))));
                }
            }
        }
    }
    nearest.into_iter().map(|(_, met)| met).collect()
}
