//! Structs that cross to `glsl/merge_layout.glsl`; `tests/layouts.rs` compares names and offsets with what the compiler made.

use bytemuck::{Pod, Zeroable};

/// One object of the scene as the merge sees it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Entity {
    /// Centre of the bounding sphere in the world, metres; w = 1 / (scale x bounding radius).
    pub centre: [f32; 4],
    /// First row of the inverse rotation.
    pub to_object_x: [f32; 4],
    /// Second row.
    pub to_object_y: [f32; 4],
    /// Third row.
    pub to_object_z: [f32; 4],
    /// Radiance factor of the entity's light; w = 1 with a radiance field of its own, 0 when it shares the occlusion field.
    pub emission: [f32; 4],
    /// Albedo / pi; w = uniform scale of the object.
    pub albedo: [f32; 4],
    /// Slope and offset of the shell coordinate, inner and outer shell radius in r.
    pub radial: [f32; 4],
    /// First quad of the occlusion field.
    pub blocked_base: u32,
    /// First quad of the radiance field.
    pub radiance_base: u32,
    /// Decides between equal distances: lower is nearer.
    pub rank: u32,
    /// Not in use.
    pub spare: u32,
}

/// Push constants of one merge dispatch.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Push {
    /// First vertex of the receiver's mesh in the vertex buffer.
    pub vertex_first: u32,
    /// Vertices of the receiver.
    pub vertex_count: u32,
    /// First quad of the receiver's transfer vectors, or [`NONE`] for the cosine of the normal.
    pub transfer_first: u32,
    /// Entity that is lit.
    pub receiver: u32,
    /// First occluder in the list.
    pub occluder_first: u32,
    /// Occluders in the list.
    pub occluder_count: u32,
    /// 1 to add to what an earlier dispatch left.
    pub accumulate: u32,
    /// Not in use.
    pub spare: u32,
    /// Lights of this dispatch.
    pub light: [u32; 4],
    /// The numbers 0 to 15.
    pub digit: [u32; 16],
}

/// "No such thing" among indices.
pub const NONE: u32 = u32::MAX;
