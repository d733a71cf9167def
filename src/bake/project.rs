//! Pass "project": makes SH coefficients of captured cube faces, with one workgroup for each sample.
//!
//! Inputs: the atlas of [`super::capture`], [`SampleFaces`] for each sample, and the texel table. Output: for each
//! sample `channels` x `channel_stride(bands)` floats. They hold the blocked part (1 where a texel is below 1) or the
//! radiance.

use super::capture::{Capture, Slots};
use crate::error::{Error, Result};
use crate::field::quantity::{FieldKind, channel_stride};
use crate::gpu::memory::TexelView;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device, Image};
use crate::layout::QUAD_FORMAT;
use crate::sh;
use crate::sh::basis::coefficient_count;
use crate::sh::cube::{solid_angle, texel_st};
use crate::shaders::{Library, ShaderPermutation};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use std::sync::Arc;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SampleFaces {
    pub slots: Slots,
    /// Factor on coefficients.
    pub scale: f32,
}

/// Bytes of shared memory that every device has (Vulkan 1.3, "Required Limits": maxComputeSharedMemorySize).
const SHARED_BYTES: usize = 16_384;

/// Number of invocations that share a sample's texels. It is one wave of the widest GPUs, or fewer where their sums
/// (one float for each coefficient and channel) would not fit [`SHARED_BYTES`]: 32 from 5 bands of radiance on, and 16
/// for 7 bands.
fn workgroup(bands: usize, kind: FieldKind) -> u32 {
    let sums = 4 * coefficient_count(bands) * kind.channels();
    [64, 32].into_iter().find(|count| count * sums <= SHARED_BYTES).unwrap_or(16) as u32
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    face_px: u32,
    atlas_columns: u32,
}

pub struct Project {
    pipeline: ComputePipeline,
    texels: Buffer,
    pub bands: usize,
    pub kind: FieldKind,
    push: Push,
}

impl Project {
    pub fn row(bands: usize, kind: FieldKind) -> ShaderPermutation {
        ShaderPermutation::new("project.comp", bands)
            .define("CHANNELS", kind.channels() as u32)
            .define("WORKGROUP", workgroup(bands, kind))
    }

    pub fn new(device: &Arc<Device>, library: &Library, bands: usize, capture: &Capture) -> Result<Self> {
        let Capture { kind, face_px, columns, .. } = *capture;
        let shader = library.shader(&Self::row(bands, kind))?;
        let pipeline = ComputePipeline::new(device, "project", &shader)?;
        let texels = Buffer::with_data(device, "project texels", &texel_table(face_px as usize))?;
        if !TexelView::fits(device, QUAD_FORMAT, texels.size_bytes) {
            let most = device.limits.max_texel_buffer_elements;
            return Err(Error::Input(format!(
                "cube faces of {face_px} px have more texels than the device's views hold ({most})"
            )));
        }
        Ok(Project { pipeline, texels, bands, kind, push: Push { face_px, atlas_columns: columns } })
    }

    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        atlas: &'r Image,
        samples: &'r Buffer,
        coefficients: &'r Buffer,
        sample_count: u32,
    ) -> Result<()> {
        let texels = TexelView::new(&self.texels, QUAD_FORMAT)?;
        let resources = [Bind::Image(atlas), Bind::Buffer(samples), Bind::Texel(texels), Bind::Buffer(coefficients)];
        commands.dispatch(&self.pipeline, &resources, &self.push, [sample_count * self.pipeline.local_size[0], 1, 1])
    }
}

/// For every texel of a face its direction along right, down and forward, and its solid angle.
fn texel_table(face_px: usize) -> Vec<[f32; 4]> {
    let weights = solid_angle(face_px);
    let texel = |i: usize| {
        let toward = DVec3::new(texel_st(i % face_px, face_px), texel_st(i / face_px, face_px), 1.0);
        toward.normalize().extend(weights[i]).as_vec4().to_array()
    };
    (0..face_px * face_px).map(texel).collect()
}

/// The CPU twin of the pass. `texel(face, x, y)` is what was captured, by channel. The result holds the coefficients of
/// one channel after another, `channel_stride(bands)` apart.
pub fn twin(
    bands: usize,
    kind: FieldKind,
    face_px: usize,
    scale: f32,
    texel: impl Fn(usize, usize, usize) -> [f32; 3],
) -> Vec<f64> {
    let channel = |channel: usize| {
        let value = |face, x, y| match kind {
            FieldKind::Radiance => f64::from(texel(face, x, y)[channel]),
            FieldKind::Occlusion => f64::from(texel(face, x, y)[0] < 1.0),
        };
        let mut coefficients = sh::project(bands, face_px, value);
        coefficients.iter_mut().for_each(|c| *c *= f64::from(scale));
        coefficients.resize(channel_stride(bands), 0.0);
        coefficients
    };
    (0..kind.channels()).flat_map(channel).collect()
}
