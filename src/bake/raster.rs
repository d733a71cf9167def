//! The pass "capture" by computation, for software devices. llvmpipe transforms and clips the triangles that are drawn
//! on one thread, which takes most of a bake; a compute shader runs on all of its threads, eight triangles a step.
//!
//! Inputs: the mesh and the ranges of its indices that each face shows (see [`super::capture`]). Output: the atlas, by
//! way of a buffer of a byte a texel. Faces are cut into strips of rows whose texels fit the shared memory of a
//! workgroup.

use super::model::{DrawnFace, Model};
use crate::error::Result;
use crate::gpu::memory::TexelView;
use crate::gpu::{Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, Image};
use crate::layout::QUAD_FORMAT;
use crate::sh::cube::face_basis;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::sync::Arc;

/// Invocations of a workgroup: as many as llvmpipe runs in one step with AVX2. With more, each further step would go
/// through all ranges again.
const WORKGROUP: u32 = 8;
/// Words of shared memory, one bit for each texel: a face of 168 px.
const WORDS: u32 = 1024;
const INDEX_FORMAT: vk::Format = vk::Format::R32_UINT;

/// A face, where it goes, and its ranges of indices.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct Face {
    /// Place of the eye, in r.
    pub eye: [f32; 4],
    pub right: [f32; 4],
    pub down: [f32; 4],
    pub forward: [f32; 4],
    pub slot: u32,
    pub range_first: u32,
    pub range_count: u32,
    pub unused: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    face_px: u32,
    atlas_columns: u32,
    band_rows: u32,
    culls: u32,
}

pub struct Raster {
    pipeline: ComputePipeline,
    texels: Buffer,
    face_px: u32,
    columns: u32,
}

/// The faces of a batch on the device.
pub(super) struct RasterFaces {
    faces: Buffer,
    ranges: Buffer,
    count: u32,
}

/// Forward, right and down of a cube face as single-precision vectors; their components are 0 and +-1.
pub(super) fn face_axes(face: usize) -> (Vec3, Vec3, Vec3) {
    let (forward, right, down) = face_basis(face);
    (forward.as_vec3(), right.as_vec3(), down.as_vec3())
}

impl RasterFaces {
    pub fn new(device: &Arc<Device>, shown: &[DrawnFace]) -> Result<Self> {
        let mut faces = Vec::new();
        let mut ranges = Vec::new();
        for DrawnFace { eye, face, slot, ranges: own } in shown {
            let (forward, right, down) = face_axes(*face);
            let [eye, right, down, forward] = [*eye, right, down, forward].map(|v| v.extend(0.0).to_array());
            let range_first = ranges.len() as u32;
            let range_count = own.len() as u32;
            faces.push(Face { eye, right, down, forward, slot: *slot, range_first, range_count, unused: 0 });
            ranges.extend(own.iter().map(|range| [range.start, range.end]));
        }
        let upload = |name, bytes: &[u8]| -> Result<Buffer> {
            let mut buffer = Buffer::new(device, name, BufferKind::Upload, bytes.len() as u64)?;
            buffer.write(0, bytes);
            Ok(buffer)
        };
        Ok(RasterFaces {
            faces: upload("capture faces", bytemuck::cast_slice(&faces))?,
            ranges: upload("capture ranges", bytemuck::cast_slice(&ranges))?,
            count: faces.len() as u32,
        })
    }
}

impl Raster {
    pub fn row() -> ShaderPermutation {
        ShaderPermutation::new("raster.comp", 4).define("WORKGROUP", WORKGROUP).define("WORDS", WORDS)
    }

    /// Whether faces of this edge can be computed: bytes are written in words of four of a row.
    pub(super) fn serves(face_px: u32) -> bool {
        face_px.is_multiple_of(4) && face_px <= WORDS
    }

    pub(super) fn holds(device: &Device, model: &Model) -> bool {
        TexelView::fits(device, QUAD_FORMAT, model.positions.size_bytes)
            && TexelView::fits(device, INDEX_FORMAT, model.indices.size_bytes)
    }

    /// The pipeline for an atlas of `columns` by `columns` faces of `face_px`.
    pub(super) fn new(device: &Arc<Device>, library: &Library, face_px: u32, columns: u32) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, "capture", &library.shader(&Self::row())?)?;
        let bytes = u64::from(columns * face_px).pow(2);
        let texels = Buffer::new(device, "capture texels", BufferKind::Device, bytes)?;
        Ok(Raster { pipeline, texels, face_px, columns })
    }

    /// Computes faces, with a barrier of its own, and copies them into the atlas, which must be in the layout of
    /// [`Access::TransferWrite`].
    pub(super) fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        model: &'r Model,
        faces: &'r RasterFaces,
        atlas: &'r Image,
    ) -> Result<()> {
        let face_px = self.face_px;
        let band_rows = (WORDS / face_px.div_ceil(32)).min(face_px);
        let push = Push { face_px, atlas_columns: self.columns, band_rows, culls: u32::from(model.closed) };
        let resources = [
            Bind::Buffer(&faces.faces),
            Bind::Buffer(&faces.ranges),
            Bind::Texel(TexelView::new(&model.positions, QUAD_FORMAT)?),
            Bind::Texel(TexelView::new(&model.indices, INDEX_FORMAT)?),
            Bind::Buffer(&self.texels),
        ];
        let groups = [faces.count * WORKGROUP, face_px.div_ceil(band_rows), 1];
        commands.dispatch(&self.pipeline, &resources, &push, groups)?;
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        commands.copy_to_image(&self.texels, atlas);
        Ok(())
    }
}
