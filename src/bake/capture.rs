//! Pass "capture": draws an object as seen from sample points: six cube faces for each point, many points in one render pass.
//!
//! Inputs: the mesh in units of its bounding radius around its centre; eyes in the same frame. Output: an atlas of square
//! faces. An occlusion capture is R8 without depth: the object is black, or holds its distance, on white. A radiance
//! capture is RGBA32F with depth: the mesh's colours on black. A face that the object's bounding sphere does not reach
//! is not drawn and gets no place in the atlas. The other faces are drawn in chunks of neighbouring triangles. A chunk
//! is left out if its bounding sphere does not reach into the face, or if the mesh is closed and the eye sees only
//! backs of the chunk. Of a large mesh, chunks of fewer triangles stand for what is far off.

use super::chunk::{faces_reached, joined};
use super::model::DrawnFace;
pub use super::model::{Drawn, Model};
use super::raster::{Raster, face_axes};
use crate::error::{Error, Result};
use crate::field::self_visibility::DISTANCE_STEPS;
use crate::gpu::{Commands, Device, GraphicsPipeline, GraphicsState, Image, ImageShape, Keeps, Target};
use crate::sh::cube::{FACE_COUNT, face_basis, texel_st};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Edge of the atlas in texels, where the device allows it. It holds 1 024 faces of 64 px, in 4 MB for occlusion.
const ATLAS_PX: u32 = 2048;
/// Nearest distance that a radiance capture sees, in r.
const NEAR: f32 = 1e-4;
/// The slot of a face that is not in the atlas.
pub const NO_SLOT: u32 = u32::MAX;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    eye: [f32; 4],
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
}

/// What an eye is shown.
pub(super) struct Outlook {
    /// The faces that the object reaches.
    faces: [bool; FACE_COUNT],
    /// Triangles of all sides of the object.
    pub triangles: usize,
}

/// What a capture sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaptureKind {
    /// Where the object is: 0 there and 1 elsewhere.
    Cover,
    /// How far the object is: [`DISTANCE_STEPS`] bytes an r, and 255 where it is not.
    Distance,
    /// The mesh's colours.
    Radiance,
}

impl CaptureKind {
    /// The kind of capture that the samples of a field need.
    pub fn of_field(radiance: bool) -> Self {
        if radiance { CaptureKind::Radiance } else { CaptureKind::Cover }
    }
}

/// Which faces of which eye lie where in the atlas.
pub type Slots = [u32; FACE_COUNT];

/// The atlas, and the pipelines that write it. A pipeline is made when faces are first chosen for it: a bake draws all
/// of them, or computes all.
pub struct Capture {
    device: Arc<Device>,
    library: Library,
    /// The first draws both sides of triangles, the second leaves out the backs of closed meshes.
    pipelines: [OnceLock<GraphicsPipeline>; 2],
    raster: OnceLock<Raster>,
    /// Captured faces, row by row.
    pub atlas: Image,
    depth: Option<Image>,
    /// Edge of a face in texels.
    pub face_px: u32,
    /// Faces in a row of the atlas.
    pub columns: u32,
    kind: CaptureKind,
    /// Whether faces and chunks that cannot matter are left out.
    pub skips: bool,
    /// Whether faces are computed in place of drawn, where they can be. It is so on software devices.
    pub computes: bool,
}

impl Capture {
    /// The rows of the shader table: vertex and fragment.
    pub fn rows(kind: CaptureKind) -> [ShaderPermutation; 2] {
        ["capture.vert", "capture.frag"].map(|file| {
            ShaderPermutation::new(file, 4)
                .define("RADIANCE", kind == CaptureKind::Radiance)
                .define("DISTANCE", kind == CaptureKind::Distance)
                .number("DISTANCE_STEPS", DISTANCE_STEPS)
        })
    }

    /// Faces in a row of the atlas.
    pub fn columns(device: &Device, face_px: u32, kind: CaptureKind) -> u32 {
        let atlas_px = ATLAS_PX.min(device.most_image_px());
        // The texels of a radiance capture, with depth, are 20 times as large. Six faces always fit.
        (if kind == CaptureKind::Radiance { atlas_px / 2 } else { atlas_px } / face_px).max(3)
    }

    /// For faces of `face_px`.
    ///
    /// # Errors
    /// `Input` when a face is larger than the device's images.
    pub fn new(device: &Arc<Device>, library: &Library, face_px: u32, kind: CaptureKind) -> Result<Self> {
        let columns = Self::columns(device, face_px, kind);
        let radiance = kind == CaptureKind::Radiance;
        let most = device.most_image_px();
        if columns * face_px > most {
            let edge = columns * face_px;
            return Err(Error::Input(format!(
                "cube faces of {face_px} px take images of {edge} px, the device's have at most {most} px"
            )));
        }
        let color = if radiance { vk::Format::R32G32B32A32_SFLOAT } else { vk::Format::R8_UNORM };
        let depth = radiance.then_some(vk::Format::D32_SFLOAT);
        let shape = ImageShape { format: color, width: columns * face_px, height: columns * face_px, samples: 1 };
        Ok(Capture {
            device: device.clone(),
            library: library.clone(),
            pipelines: Default::default(),
            raster: OnceLock::new(),
            atlas: Image::new(device, "capture atlas", shape)?,
            depth: depth
                .map(|format| Image::new(device, "capture depth", ImageShape { format, ..shape }))
                .transpose()?,
            face_px,
            columns,
            kind,
            skips: true,
            computes: device.info.is_software(),
        })
    }

    /// Makes the pipeline that draws faces.
    fn make_pipeline(&self, closed: bool) -> Result<GraphicsPipeline> {
        let [vertex, fragment] = Self::rows(self.kind);
        let state = GraphicsState {
            color: self.atlas.shape.format,
            depth: self.depth.as_ref().map(|image| image.shape.format),
            samples: 1,
            // A cube face is a mirror image, which turns every triangle over, so FRONT removes the object's back faces.
            cull: if closed { vk::CullModeFlags::FRONT } else { vk::CullModeFlags::NONE },
            keeps: if self.kind == CaptureKind::Distance { Keeps::Smallest } else { Keeps::Last },
            nearer_steps: 0.0,
        };
        let (vertex, fragment) = (self.library.shader(&vertex)?, self.library.shader(&fragment)?);
        GraphicsPipeline::new(&self.device, "capture", &vertex, &fragment, state)
    }

    /// Whether faces of a model are computed.
    pub fn computes(&self, model: &Model) -> bool {
        self.computes
            && self.kind != CaptureKind::Radiance
            && Raster::serves(self.face_px)
            && Raster::holds(&self.device, &model.positions, &model.indices)
    }

    /// Faces that one render pass can hold.
    pub fn capacity(&self) -> u32 {
        self.columns * self.columns
    }

    /// What each eye is shown.
    pub(super) fn look(&self, model: &Model, eyes: &[Vec3]) -> Vec<Outlook> {
        let of = |buffer: &mut Vec<Range<u32>>, &eye: &Vec3| {
            let mut outlook = Outlook { faces: [!self.skips; FACE_COUNT], triangles: 0 };
            let whole = faces_reached(eye, Vec3::ZERO, 1.0);
            for chunk in model.seen(eye, self.face_px, buffer) {
                outlook.triangles += chunk.indices.len() / 3;
                let reached = faces_reached(eye, chunk.centre, chunk.radius);
                for (shows, (whole, reached)) in outlook.faces.iter_mut().zip(whole.into_iter().zip(reached)) {
                    *shows |= whole && reached;
                }
            }
            outlook
        };
        eyes.par_iter().map_init(Vec::new, of).collect()
    }

    /// Gives the faces of the next eyes their places in the atlas until it is full. Returns a slot table for every eye that fits;
    /// at least one does.
    pub(super) fn places(&self, outlooks: &[Outlook]) -> Vec<Slots> {
        let (mut used, mut out) = (0, Vec::new());
        for outlook in outlooks {
            // An eye that sees nothing has no face, but it still has a job.
            if used.max(out.len() as u32) + FACE_COUNT as u32 > self.capacity() {
                break;
            }
            out.push(outlook.faces.map(|shows| {
                used += u32::from(shows);
                if shows { used - 1 } else { NO_SLOT }
            }));
        }
        out
    }

    /// The places of the next eyes' faces, for captures that are not planned as a whole bake.
    pub fn plan(&self, model: &Model, eyes: &[Vec3]) -> Vec<Slots> {
        self.places(&self.look(model, eyes))
    }

    /// Chooses what every planned face shows. Back faces of closed meshes are culled when `cull` is set.
    ///
    /// # Errors
    /// `Device` when memory ran out, `Failed` when a shader does not compile.
    pub fn choose(&self, model: &Model, eyes: &[Vec3], plan: &[Slots], cull: bool) -> Result<Drawn> {
        let closed = cull && model.closed;
        let computes = self.computes(model);
        let shown = |buffer: &mut Vec<Range<u32>>, (&eye, slots): (&Vec3, &Slots)| -> Vec<DrawnFace> {
            let seen = model.seen(eye, self.face_px, buffer);
            let facing = seen.filter(|chunk| !(closed && self.skips && chunk.turned_away(eye)));
            let facing: Vec<_> = facing.map(|c| (&c.indices, faces_reached(eye, c.centre, c.radius))).collect();
            let drawn = slots.iter().enumerate().filter(|(_, slot)| **slot != NO_SLOT);
            let face = |(face, &slot): (usize, &u32)| {
                let visible = facing.iter().filter(|(_, reached)| !self.skips || reached[face]);
                DrawnFace { eye, face, slot, runs: joined(visible.map(|(indices, _)| (*indices).clone())) }
            };
            drawn.map(face).collect()
        };
        let mut faces: Vec<DrawnFace> = eyes.par_iter().zip(plan).map_init(Vec::new, shown).flatten_iter().collect();
        let mut indices = Vec::new();
        if let Some(leveled) = model.gathered_from().filter(|_| !computes) {
            for face in &mut faces {
                face.runs = leveled.levels.gathered(&face.runs, &mut indices);
            }
        }
        if computes {
            let size = (self.face_px, self.columns);
            let distance = self.kind == CaptureKind::Distance;
            once(&self.raster, || Raster::new(&self.device, &self.library, distance, size))?;
            Drawn::computed(model, faces, closed)
        } else {
            once(&self.pipelines[usize::from(closed)], || self.make_pipeline(closed))?;
            Drawn::new(model, faces, &indices, closed)
        }
    }

    /// Draws or computes what was chosen. The atlas must be in the layout of [`Drawn::access`].
    ///
    /// # Errors
    /// What recording returns.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, model: &'r Model, drawn: &'r Drawn) -> Result<()> {
        if let (Some(raster), Some(faces)) = (self.raster.get(), &drawn.computed) {
            return raster.record(commands, (&model.positions, &model.indices), (faces, drawn.closed), &self.atlas);
        }
        let radiance = self.kind == CaptureKind::Radiance;
        let background = if radiance { [0.0, 0.0, 0.0, 1.0] } else { [1.0; 4] };
        let target = Target { color: &self.atlas, clear: Some(background), depth: self.depth.as_ref(), resolve: None };
        let pipeline = self.pipelines[usize::from(drawn.closed)].get().expect("made when the faces were chosen");
        let mut vertices = vec![(&model.positions, 0)];
        vertices.extend(model.colors.iter().filter(|_| radiance).map(|colors| (colors, 0)));
        commands.render(&target, |drawing| {
            drawing.bind(pipeline, &vertices, drawn.indices.as_ref().unwrap_or(&model.indices));
            for DrawnFace { eye, face, slot, runs } in &drawn.faces {
                let (forward, right, down) = face_axes(*face);
                let px = self.face_px;
                drawing.area(slot % self.columns * px, slot / self.columns * px, px, px);
                drawing.push(&Push {
                    eye: eye.extend(NEAR).to_array(),
                    right: right.extend(0.0).to_array(),
                    down: down.extend(0.0).to_array(),
                    forward: forward.extend(0.0).to_array(),
                });
                runs.iter().for_each(|run| drawing.indexed(run.clone()));
            }
            Ok(())
        })
    }

    /// The depth image that [`Capture::record`] needs in the layout of [`crate::gpu::Access::DepthWrite`].
    pub fn depth(&self) -> Option<&Image> {
        self.depth.as_ref()
    }
}

/// What a cell holds, made by `make` where it holds nothing yet.
fn once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    if cell.get().is_none() {
        let _ = cell.set(make()?); // it was empty
    }
    Ok(cell.get().expect("just made"))
}

/// The CPU twin of an occlusion capture, by another method: it casts a ray through every texel centre of one face. The result is
/// row-major and true where a ray hits the object. Positions are those of [`super::triangles::unit_positions`].
pub fn twin(positions: &[Vec3], triangles: &[[u32; 3]], eye: DVec3, face: usize, face_px: u32) -> Vec<bool> {
    let mut covered = vec![false; (face_px * face_px) as usize];
    rays(positions, triangles, eye, face, face_px, |texel, _, _| covered[texel] = true);
    covered
}

/// The CPU twin of a radiance capture: the colour of the nearest triangle that each ray meets, or black where it meets none.
pub fn twin_colors(
    (positions, colors): (&[Vec3], &[Vec3]),
    triangles: &[[u32; 3]],
    eye: DVec3,
    face: usize,
    face_px: u32,
) -> Vec<DVec3> {
    let mut nearest = vec![(f64::INFINITY, DVec3::ZERO); (face_px * face_px) as usize];
    rays(positions, triangles, eye, face, face_px, |texel, triangle, (distance, weights)| {
        if distance < nearest[texel].0 {
            let corners = triangle.map(|i| colors[i as usize].as_dvec3());
            nearest[texel] = (distance, corners.iter().zip(weights).map(|(color, weight)| *color * weight).sum());
        }
    });
    nearest.into_iter().map(|(_, color)| color).collect()
}

/// The CPU twin of a capture of distances: how far the nearest triangle is that each ray meets, in r, infinite where it meets none.
pub fn twin_distances(positions: &[Vec3], triangles: &[[u32; 3]], eye: DVec3, face: usize, face_px: u32) -> Vec<f64> {
    let px = face_px as usize;
    let mut nearest = vec![f64::INFINITY; px * px];
    rays(positions, triangles, eye, face, face_px, |texel, _, (distance, _)| {
        let ray = DVec3::new(texel_st(texel % px, px), texel_st(texel / px, px), 1.0);
        nearest[texel] = nearest[texel].min(distance * ray.length());
    });
    nearest
}

/// Calls a function for every ray and triangle that meet: with the distance in units of the ray's (s, t, 1), and with the point's
/// weights among the triangle's corners.
fn rays(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    eye: DVec3,
    face: usize,
    face_px: u32,
    mut met: impl FnMut(usize, &[u32; 3], (f64, [f64; 3])),
) {
    let (forward, right, down) = face_basis(face);
    let px = face_px as usize;
    for triangle in triangles {
        // The triangle stands in the face's frame, where the direction of a ray is (s, t, 1).
        let [a, b, c] = triangle.map(|i| {
            let q = positions[i as usize].as_dvec3() - eye;
            DVec3::new(q.dot(right), q.dot(down), q.dot(forward))
        });
        // A ray hits when it lies on the same side of the three planes through the eye and an edge, and in front.
        let edges = [b.cross(c), c.cross(a), a.cross(b)];
        let plane = (b - a).cross(c - a);
        let offset = plane.dot(a);
        for y in 0..px {
            for x in 0..px {
                let ray = DVec3::new(texel_st(x, px), texel_st(y, px), 1.0);
                let sides = edges.map(|edge| edge.dot(ray));
                let same = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
                let along = plane.dot(ray);
                if same && offset * along > 0.0 {
                    let sum: f64 = sides.iter().sum();
                    met(y * px + x, triangle, (offset / along, sides.map(|side| side / sum)));
                }
            }
        }
    }
}
