//! Structs shared with `glsl/merge_layout.glsl`; `tests/layouts.rs` compares names and offsets with the compiled shaders.

use ash::vk;
use bytemuck::{Pod, Zeroable};

/// An entity of the scene at one time, in the form that passes read: `Entity` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct DeviceEntity {
    /// Centre of the bounding sphere in the world, metres; w = 1 / (scale x bounding radius).
    pub centre: [f32; 4],
    /// Cosine and sine of alpha and of beta; the rotation to the world is Rz(alpha) Ry(beta) Rz(gamma).
    pub alpha_beta: [f32; 4],
    /// Cosine and sine of gamma.
    pub gamma: [f32; 2],
    /// First quad of the occlusion field.
    pub blocked_base: u32,
    /// First quad of the radiance field.
    pub radiance_base: u32,
    /// Slope and offset of the shell coordinate, inner and outer shell radius in r.
    pub radial: [f32; 4],
    /// Linear RGB radiance factor of the entity's light; w = the largest channel of its albedo.
    pub emission: [f32; 4],
    /// Added to a stretched position, in r; w = the packed stretch factors of the axes ([`crate::field::Fit::packed`]).
    pub shift: [f32; 4],
    /// Albedo / pi; w = uniform scale of the entity.
    pub albedo: [f32; 4],
    /// First axis of its projected area ([`crate::field::Area`]), world; w = the area's constant term.
    pub area_x: [f32; 4],
    /// Second axis, world; w = factor of u, the square of a direction's cosine to the first.
    pub area_y: [f32; 4],
    /// Factors of v (the square of the cosine to the second axis), u u, v v and u v.
    pub area_terms: [f32; 4],
    /// For sharp lights: the bits of the first quad of its silhouette field, 0 without one, and bit 31 where it has maps of halves; of a
    /// light that is a ball the share of its sphere's disc that shines, 0 where its own outline tells; of a light that shines from one flat
    /// side [`crate::field::sub_light::LampFace::packed`]; and 0.
    pub sharp: [f32; 4],
}

/// A workgroup's worth of neighbouring vertices of one receiver.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Cluster {
    /// Entity that is lit.
    pub receiver: u32,
    /// First vertex in the vertex buffer.
    pub vertex_first: u32,
    /// Vertices, at most [`CLUSTER_VERTICES`].
    pub vertex_count: u32,
    /// First quad of the first vertex's transfer vector, or [`NONE`] for the cosine of the normal.
    pub transfer_first: u32,
    /// First vertex in the radiosity buffer.
    pub radiosity_first: u32,
    /// First entry in the list.
    pub entry_first: u32,
    /// Entries, at least 1.
    pub entry_count: u32,
    /// Index of its bounds for the gather on the device.
    pub bounds: u32,
    /// Number of entries at the front that are chains of sharp lights.
    pub sharp_count: u32,
    /// First cell of its first vertex's self-visibility, or [`NONE`] where the mesh cannot shadow itself.
    pub self_first: u32,
}

/// The index that means "none".
pub const NONE: u32 = u32::MAX;

/// Vertices of a cluster, which is one workgroup: eight subgroups on llvmpipe, two on most GPUs, and within the limits of
/// every device.
pub const CLUSTER_VERTICES: u32 = 64;

/// Texels through which some variants of a pass read entries: one each.
pub const ENTRY_FORMAT: vk::Format = vk::Format::R32_UINT;
/// Texels through which they read [`Cluster`]: two of its numbers each.
pub const CLUSTER_FORMAT: vk::Format = vk::Format::R32G32_UINT;

/// Bits of an entity's number in an entry.
pub const ENTRY_BITS: u32 = 14;
/// Entities that an entry can name: numbers below this, which stands for the sky.
pub const ENTRY_ENTITIES: u32 = (1 << ENTRY_BITS) - 1;

/// What one lookup of the merge is for, packed into 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListEntry {
    /// Multiply the chain of a light (`None`: of the sky) by the visibility past an entity.
    Occlude {
        /// The occluder.
        entity: u32,
        /// Whose chain it is.
        light: Option<u32>,
    },
    /// As [`ListEntry::Occlude`], for vertices that see the entity small.
    Cap {
        /// The occluder.
        entity: u32,
        /// Whose chain it is.
        light: Option<u32>,
    },
    /// Meet a light; `channel` is `None` for a light of one colour, which shares the occlusion field.
    Shine {
        /// The light.
        entity: u32,
        /// Channel of its radiance field.
        channel: Option<u32>,
        /// Whether the chain ends here and the next begins anew.
        last: bool,
    },
}

impl ListEntry {
    /// The two entities that packed bits name; the second is [`ENTRY_ENTITIES`] in the sky's chain.
    pub fn entities(packed: u32) -> [u32; 2] {
        [packed & ENTRY_ENTITIES, packed >> ENTRY_BITS & ENTRY_ENTITIES]
    }

    /// Whether packed bits meet a light.
    pub fn is_light(packed: u32) -> bool {
        packed >> (2 * ENTRY_BITS) & 1 == 1
    }

    /// The 32 bits that `merge_layout.glsl` takes apart.
    pub fn pack(self) -> u32 {
        match self {
            ListEntry::Occlude { entity, light } => entity | light.unwrap_or(ENTRY_ENTITIES) << ENTRY_BITS,
            ListEntry::Cap { entity, light } => ListEntry::Occlude { entity, light }.pack() | 1 << (2 * ENTRY_BITS + 1),
            ListEntry::Shine { entity, channel, last } => {
                let flags = 1 | channel.unwrap_or(3) << 1 | u32::from(last) << 3;
                entity | entity << ENTRY_BITS | flags << (2 * ENTRY_BITS)
            }
        }
    }
}

/// The weight of what may be anywhere, and a length beyond all others: more than any light makes negligible.
pub const EVERYTHING: f64 = 1e30;
/// Flag of a grid's cell whose diagonal runs from corner (0, 0) to (1, 1), not from (1, 0) to (0, 1).
pub const UPWARDS: u32 = 1 << 31;
/// Added to the first quad of a silhouette field that has maps of halves.
pub const HAS_HALVES: u32 = 1 << 31;
/// Bits of a lattice's factors (see [`crate::field::Fit::packed`]).
pub const FIT_BITS: u32 = 21;
/// How far apart tags of entities are in a picture's alpha: as 8 bits tell.
pub const TAG_STEP: f32 = 1.0 / 255.0;
/// Coefficients of 1, cosine and its square in the clamped cosine of four bands.
pub const COSINE_LOBE: [f64; 3] = [0.09375, 0.5, 0.46875];

/// The macros that every shader has: what both languages have to agree on.
pub fn shared_macros() -> [(&'static str, String); 7] {
    let [a, b, c] = COSINE_LOBE;
    [
        ("PI", std::f64::consts::PI.to_string()),
        ("EVERYTHING", format!("{EVERYTHING:e}")),
        ("UPWARDS", format!("{UPWARDS:#x}u")),
        ("HAS_HALVES", format!("{HAS_HALVES:#x}u")),
        ("FIT_BITS", FIT_BITS.to_string()),
        ("TAG_STEP", format!("{TAG_STEP:?}")),
        ("COSINE_LOBE", format!("vec3({a:?}, {b:?}, {c:?})")),
    ]
}
