//! A mesh as captures draw it, and what they draw of it.

use super::chunk::{Chunk, Chunked, chunk};
use super::levels::{Leveled, Tolerance};
use super::raster::RasterFaces;
use super::triangles::{distinct, unit_positions};
use crate::asset::Mesh;
use crate::error::Result;
use crate::gpu::{Access, Buffer, BufferKind, Device};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// How a mesh is cut.
enum Cut {
    /// Into these chunks.
    Whole(Vec<Chunk>),
    /// Into chunks of all levels.
    Levels(Arc<Leveled>),
}

/// A mesh on the device, centred and scaled to bounding radius 1, with its triangles in chunks.
pub struct Model {
    pub(super) positions: Buffer,
    pub(super) colors: Option<Buffer>,
    pub(super) indices: Buffer,
    cut: Cut,
    pub(super) closed: bool,
}

impl Model {
    /// Uploads a mesh. `with_colors` is for a radiance capture; a mesh without colours is white.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, with_colors: bool) -> Result<Self> {
        let unit = unit_positions(mesh);
        let Chunked { vertices, triangles, chunks } = chunk(&unit, &distinct(mesh))?;
        let colors = with_colors.then(|| mesh.colors.clone().unwrap_or_else(|| vec![Vec3::ONE; mesh.positions.len()]));
        let colors: Option<Vec<_>> = colors.map(|c| vertices.iter().map(|&v| c[v as usize].to_array()).collect());
        let colors = colors.map(|colors| Buffer::with_data(device, "capture colors", &colors));
        let model = Self::of(device, mesh, (&vertices, &triangles), Cut::Whole(chunks))?;
        Ok(Model { colors: colors.transpose()?, ..model })
    }

    /// Uploads a mesh and its levels of detail (see [`super::levels`]), for captures that see no colours.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub(super) fn with_levels(device: &Arc<Device>, mesh: &Mesh, leveled: Arc<Leveled>) -> Result<Self> {
        let Chunked { vertices, triangles, .. } = &leveled.chunked;
        Self::of(device, mesh, (vertices, triangles), Cut::Levels(leveled.clone()))
    }

    fn of(device: &Arc<Device>, mesh: &Mesh, (vertices, triangles): (&[u32], &[[u32; 3]]), cut: Cut) -> Result<Self> {
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

    /// The indices of a mesh with levels, which are gathered for each face that is drawn.
    pub(super) fn gathered_from(&self) -> Option<&Leveled> {
        match &self.cut {
            Cut::Whole(_) => None,
            Cut::Levels(leveled) => Some(leveled),
        }
    }

    /// The chunks that an eye is shown in faces of `face_px`. `buffer` holds runs of their numbers.
    pub(super) fn seen<'m>(
        &'m self,
        eye: Vec3,
        face_px: u32,
        buffer: &'m mut Vec<Range<u32>>,
    ) -> impl Iterator<Item = &'m Chunk> {
        let chunks = match &self.cut {
            Cut::Levels(leveled) => {
                leveled.levels.choose(Tolerance::capture(eye, face_px), buffer);
                &leveled.chunked.chunks
            }
            Cut::Whole(chunks) => {
                buffer.clear();
                buffer.push(0..chunks.len() as u32);
                chunks
            }
        };
        buffer.iter().flat_map(|run| &chunks[run.start as usize..run.end as usize])
    }
}

/// What one face shows: runs of indices.
pub(super) struct DrawnFace {
    pub eye: Vec3,
    pub face: usize,
    pub slot: u32,
    pub runs: Vec<Range<u32>>,
}

/// What the faces of a batch show.
pub struct Drawn {
    pub(super) faces: Vec<DrawnFace>,
    /// The indices of a model with levels, face after face; other models have theirs on the device. A face shows hundreds of small chunks
    /// of levels, and llvmpipe takes 4 us for each draw.
    pub(super) indices: Option<Buffer>,
    /// The faces for a device that computes them.
    pub(super) computed: Option<RasterFaces>,
    /// Whether back faces are culled.
    pub(super) closed: bool,
}

impl Drawn {
    /// What is computed: faces with runs of the model's own indices.
    pub(super) fn computed(model: &Model, faces: Vec<DrawnFace>, closed: bool) -> Result<Self> {
        let shown = faces.iter().map(|face| (face.eye, face.face, face.slot, face.runs.as_slice()));
        let computed = Some(RasterFaces::new(model.positions.device(), shown)?);
        Ok(Drawn { faces, indices: None, computed, closed })
    }

    /// What is drawn: faces with runs of the model's own indices, or of those gathered for them.
    pub(super) fn new(model: &Model, faces: Vec<DrawnFace>, gathered: &[u32], closed: bool) -> Result<Self> {
        let indices = if model.gathered_from().is_some() && !gathered.is_empty() {
            let bytes = size_of_val(gathered) as u64;
            let mut buffer = Buffer::new(model.positions.device(), "capture gathered", BufferKind::Upload, bytes)?;
            buffer.write(0, gathered);
            Some(buffer)
        } else {
            None
        };
        Ok(Drawn { faces, indices, computed: None, closed })
    }

    /// How the atlas is written.
    pub fn access(&self) -> Access {
        if self.computed.is_some() { Access::TransferWrite } else { Access::ColorWrite }
    }

    /// Triangles that are drawn, each as often as faces show it.
    pub fn triangles(&self) -> u64 {
        self.faces.iter().flat_map(|face| &face.runs).map(|run| u64::from(run.end - run.start) / 3).sum()
    }
}
