//! A mesh as captures show it, and what they show of it.

use super::chunk::{Chunk, Chunked, chunk, faces_reached};
use super::levels::{Leveled, Tolerance};
use super::triangles::{distinct, unit_positions};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::FieldKind;
use crate::gpu::{Buffer, BufferKind, Device};
use crate::sh::cube::FACE_COUNT;
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

enum Cut {
    Whole(Vec<Chunk>),
    Levels(Arc<Leveled>),
}

/// A mesh on the device, centred and scaled to bounding radius 1, with its triangles in chunks.
pub struct Model {
    pub(super) positions: Buffer,
    pub(super) colors: Option<Buffer>,
    pub(super) indices: Buffer,
    cut: Cut,
    /// Whether backs of triangles are left out, as of every closed mesh: only an eye inside the solid would see them.
    pub closed: bool,
}

impl Model {
    /// A mesh as captures of a kind show it: with its colours for radiance, where one without any is white.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, kind: FieldKind) -> Result<Self> {
        let Chunked { vertices, triangles, chunks } = chunk(&unit_positions(mesh), &distinct(mesh))?;
        let mut model = Self::upload(device, mesh, &vertices, &triangles, Cut::Whole(chunks))?;
        if kind == FieldKind::Radiance {
            let color = |&v: &u32| mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[v as usize]).to_array();
            let colors: Vec<[f32; 3]> = vertices.iter().map(color).collect();
            model.colors = Some(Buffer::with_data(device, "capture colors", &colors)?);
        }
        Ok(model)
    }

    /// A mesh and its levels of detail (see [`super::levels`]), for captures that see no colours.
    pub(super) fn with_levels(device: &Arc<Device>, mesh: &Mesh, leveled: Arc<Leveled>) -> Result<Self> {
        let Chunked { vertices, triangles, .. } = &leveled.chunked;
        Self::upload(device, mesh, vertices, triangles, Cut::Levels(leveled.clone()))
    }

    fn upload(device: &Arc<Device>, mesh: &Mesh, vertices: &[u32], triangles: &[[u32; 3]], cut: Cut) -> Result<Self> {
        let unit = unit_positions(mesh);
        let positions: Vec<_> = vertices.iter().map(|&v| unit[v as usize].extend(0.0).to_array()).collect();
        Ok(Model {
            positions: Buffer::with_data(device, "capture positions", &positions)?,
            colors: None,
            indices: Buffer::with_data(device, "capture indices", triangles)?,
            cut,
            closed: mesh.is_closed(),
        })
    }

    /// The chunks that an eye is shown in faces of `face_px`. `buffer` holds ranges of their numbers.
    pub(super) fn shown<'m>(
        &'m self,
        eye: Vec3,
        face_px: u32,
        buffer: &'m mut Vec<Range<u32>>,
    ) -> impl Iterator<Item = &'m Chunk> {
        let chunks = match &self.cut {
            Cut::Levels(leveled) => {
                leveled.choose(Tolerance::capture(eye, face_px), buffer);
                &leveled.chunked.chunks
            }
            Cut::Whole(chunks) => {
                buffer.clear();
                buffer.push(0..chunks.len() as u32);
                chunks
            }
        };
        buffer.iter().flat_map(|range| &chunks[range.start as usize..range.end as usize])
    }

    /// The faces in which an eye sees any of these chunks.
    pub(super) fn faces(&self, eye: Vec3, face_px: u32, buffer: &mut Vec<Range<u32>>) -> [bool; FACE_COUNT] {
        let mut faces = [false; FACE_COUNT];
        let whole = faces_reached(eye, Vec3::ZERO, 1.0);
        for chunk in self.shown(eye, face_px, buffer) {
            let reached = faces_reached(eye, chunk.centre, chunk.radius);
            for face in 0..FACE_COUNT {
                faces[face] |= whole[face] && reached[face];
            }
        }
        faces
    }

    /// The indices that faces draw; `None` where those of the model are drawn. A face shows hundreds of small chunks of
    /// levels, and llvmpipe takes 4 us for each draw, so the indices of a model with levels are gathered, face after
    /// face.
    pub(super) fn gather(&self, faces: &mut [DrawnFace]) -> Result<Option<Buffer>> {
        let mut gathered = Vec::new();
        if let Cut::Levels(leveled) = &self.cut {
            for face in faces {
                face.ranges = leveled.gathered(&face.ranges, &mut gathered);
            }
        }
        if gathered.is_empty() {
            return Ok(None);
        }
        let bytes = size_of_val(gathered.as_slice()) as u64;
        let mut buffer = Buffer::new(self.positions.device(), "capture gathered", BufferKind::Upload, bytes)?;
        buffer.write(0, &gathered);
        Ok(Some(buffer))
    }
}

/// What one face shows: ranges of indices.
pub(super) struct DrawnFace {
    pub eye: Vec3,
    pub face: usize,
    pub slot: u32,
    pub ranges: Vec<Range<u32>>,
}
