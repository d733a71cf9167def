//! Pass "self_visibility": makes a map of signed angles of the captured cube faces around a vertex, with one workgroup
//! for each.
//!
//! Inputs: the atlas of [`super::capture`] with distances, and [`SampleFaces`](super::project::SampleFaces) of each
//! vertex. Output: [`BYTES`] for each, as [`crate::field::self_visibility`] reads them. A node holds the angle from its
//! direction to the nearest texel of the other state that lies above the horizon, less half that texel's width: there
//! is the edge. Its distance is that of the texel in its direction, or of the nearest that the mesh covers where that
//! one is free.

use super::project::Push;
use crate::error::Result;
use crate::field::self_visibility::{BYTES, NODES, encode_angle, frame, node_direction};
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device, Image};
use crate::sh::cube::{FACE_COUNT, direction, face_st, solid_angle, texel_st};
use crate::shaders::{Library, ShaderPermutation};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Words of 32 texels that a workgroup looks at together; it keeps three bits a texel, 12 KB of the 16 KB of shared
/// memory that every device has. Faces of up to 170 px fit as a whole.
const WORDS: u32 = 1024;
/// What a texel holds that shows no part of the mesh.
pub const FREE: u8 = u8::MAX;

pub struct SelfVisibility {
    pipeline: ComputePipeline,
    face_px: u32,
    columns: u32,
}

impl SelfVisibility {
    pub fn row() -> ShaderPermutation {
        ShaderPermutation::new("self_visibility.comp", 4)
            .define("NODES", NODES as u32)
            .define("WORDS", WORDS)
            .self_visibility()
    }

    /// A pipeline for faces of `face_px` in an atlas of `columns`.
    pub fn new(device: &Arc<Device>, library: &Library, face_px: u32, columns: u32) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, "self_visibility", &library.shader(&Self::row())?, &[])?;
        Ok(SelfVisibility { pipeline, face_px, columns })
    }

    /// Makes the maps of the first `sample_count` samples.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        atlas: &'r Image,
        samples: &'r Buffer,
        maps: &'r Buffer,
        sample_count: u32,
    ) -> Result<()> {
        let push = Push { face_px: self.face_px, atlas_columns: self.columns };
        let resources = [Bind::Image(atlas), Bind::Buffer(samples), Bind::Buffer(maps)];
        commands.dispatch(&self.pipeline, &resources, &push, [sample_count * self.pipeline.local_size[0], 1, 1])
    }
}

/// The CPU twin of the pass for one vertex, in f64 and by plain search through all texels. `captured(face, x, y)` is
/// the byte that was captured.
pub fn twin(face_px: usize, normal: Vec3, captured: impl Fn(usize, usize, usize) -> u8) -> [u8; BYTES] {
    let normal = normal.as_dvec3();
    let widths: Vec<f64> = solid_angle(face_px).iter().map(|area| area.sqrt()).collect();
    let mut above: Vec<(DVec3, f64, u8)> = Vec::new();
    for (face, i) in (0..FACE_COUNT).flat_map(|face| (0..face_px * face_px).map(move |i| (face, i))) {
        let x = i % face_px;
        let y = i / face_px;
        let toward = direction(face, texel_st(x, face_px), texel_st(y, face_px));
        if toward.dot(normal) > 0.0 {
            above.push((toward, widths[i] / 2.0, captured(face, x, y)));
        }
    }
    let toward = |direction| {
        let (face, s, t) = face_st(direction);
        let at = |st: f64| (((st + 1.0) * 0.5 * face_px as f64) as usize).min(face_px - 1);
        captured(face, at(s), at(t))
    };
    let axes = frame(normal);
    let mut map = [FREE; BYTES];
    for i in 0..NODES {
        let node = axes * node_direction(i);
        // Angle to the centre of the nearest texel of a state, to its rim, and its byte.
        let nearest = |free: bool| {
            let texels = above.iter().filter(|texel| (texel.2 == FREE) == free);
            let nearest = texels.max_by(|a, b| a.0.dot(node).total_cmp(&b.0.dot(node)));
            nearest.map_or((f64::MAX, f64::MAX, FREE), |texel| {
                let angle = node.angle_between(texel.0);
                (angle, (angle - texel.1).max(0.0), texel.2)
            })
        };
        let [to_free, to_blocked] = [nearest(true), nearest(false)];
        let free = if to_free.0 == to_blocked.0 { toward(normal) == FREE } else { to_blocked.0 > to_free.0 };
        map[i] = encode_angle(if free { to_blocked.1 } else { -to_free.1 });
        map[NODES + i] = match toward(node) {
            FREE => to_blocked.2,
            byte => byte,
        };
    }
    map
}
