//! Variants of the merge shader that compute the same function, by name, and what else its code depends on.

use crate::error::{Error, Result};
use crate::field::lattice::{CELL_WARP, Lattice};
use crate::field::quantity::{Storage, channel_stride};
use crate::field::sheet::CONTACT;
use crate::gpu::Device;
use crate::layout::{ALIGNMENT, CLUSTER_VERTICES, DeviceEntity, ENTRY_BITS, QUAD_FORMAT};
use crate::lists::skip::{CAP_SINES, CAP_SPREAD, CONES_MEET_RAD, SKIP_FADE_RAD, Skip};
use crate::merge::twin::BEHIND_SHEET;
use crate::sh::basis::{Y00, coefficient_count};
use crate::sh::polygon::POLYGON_BANDS;
use crate::shaders::ShaderPermutation;
use ash::vk;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reads {
    /// Everything from storage blocks.
    Storage,
    /// Entities from a uniform block, the rest from storage blocks.
    StorageUniform,
    /// Everything through texel views, and fields of halves eight coefficients a texel, where a channel's coefficients
    /// are a multiple of eight.
    Texels,
}

/// How the merge is done, where that changes its speed and not its outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    pub name: &'static str,
    pub reads: Reads,
    /// Packed halves become floats by shifts of their bits rather than by the instruction for it.
    pub shifted: bool,
}

/// Every variant. A GPU reads storage blocks, and a uniform block where the entities fit into one. llvmpipe and
/// SwiftShader read texels faster; which way of decoding halves is best depends on the version. `docs/measured.md` has
/// the times.
pub const VARIANTS: &[Variant] = &[
    Variant { name: "storage", reads: Reads::Storage, shifted: false },
    Variant { name: "storage-uniform", reads: Reads::StorageUniform, shifted: false },
    Variant { name: "texel-packed", reads: Reads::Texels, shifted: false },
    Variant { name: "texel-shifted", reads: Reads::Texels, shifted: true },
];

impl Serialize for Variant {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        self.name.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Variant {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        Self::named(&String::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}

impl Variant {
    pub fn named(name: &str) -> Result<Self> {
        VARIANTS.iter().copied().find(|v| v.name == name).ok_or_else(|| {
            let names: Vec<_> = VARIANTS.iter().map(|v| v.name).collect();
            Error::Usage(format!("unknown variant \"{name}\" ({})", names.join(", ")))
        })
    }

    /// Default before anything was measured: texel reads are more than ten times faster than storage
    /// reads on a processor, and no slower than them on the GPUs that are known.
    pub fn sane_default(device: &Device) -> Self {
        let name = if device.info.is_software() { "texel-shifted" } else { "storage-uniform" };
        Self::named(name).expect("the default is in the table")
    }

    /// The variant that does without what a scene or device rules out.
    pub fn restricted(self, texel: bool, uniform: bool) -> Self {
        let name = match self.reads {
            Reads::Texels if texel => self.name,
            Reads::StorageUniform if uniform => self.name,
            _ => "storage",
        };
        Self::named(name).expect("the names are in the table")
    }
}

/// Entities that a uniform block of the device holds, at most 512 (48 KiB; most devices bind 64).
pub fn uniform_entities(device: &Device) -> u32 {
    (device.limits.max_uniform_buffer_range / size_of::<DeviceEntity>() as u32).min(512)
}

/// A permutation of the merge shader: a variant, the shape of the fields, and the skips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergePermutation {
    pub variant: Variant,
    /// SH bands of transfer, light and fields.
    pub bands: usize,
    pub storage: Storage,
    /// Samples of the fields. First and last shell are data, not code.
    pub lattice: Lattice,
    pub skip: Skip,
    /// Whether any light meets a chain. Without, there is the sky's chain alone.
    pub lights: bool,
    pub sheets: bool,
    /// Whether what moves reads all that rests at once.
    pub volume: bool,
    /// Whether the transfer at the end of the sky's chain is kept, for surfaces that reflect.
    pub gloss: bool,
    /// Entities that uniform blocks hold on the device, [`uniform_entities`].
    pub entity_limit: u32,
}

impl MergePermutation {
    pub fn field_format(&self) -> vk::Format {
        match self.storage {
            Storage::F32 => QUAD_FORMAT,
            Storage::F16 if self.packed() => vk::Format::R32G32B32A32_UINT,
            Storage::F16 => vk::Format::R16G16B16A16_SFLOAT,
        }
    }

    pub fn reads_texels(&self) -> bool {
        self.variant.reads == Reads::Texels
    }

    fn packed(&self) -> bool {
        self.reads_texels() && self.storage == Storage::F16 && channel_stride(self.bands).is_multiple_of(8)
    }

    pub fn row(&self) -> ShaderPermutation {
        self.row_of("merge.comp")
    }

    /// The same macros for another shader that reads fields.
    pub fn row_of(&self, file: &'static str) -> ShaderPermutation {
        let lattice = self.lattice;
        let row = ShaderPermutation::new(file, self.bands)
            .number("Y00", Y00)
            .define("WORKGROUP", CLUSTER_VERTICES)
            .define("ENTRY_BITS", ENTRY_BITS)
            .define("TEXEL", self.reads_texels())
            .define("PACKED", self.packed())
            .define("SHIFTED", self.packed() && self.variant.shifted)
            .define("LIGHTS", self.lights)
            .define("SHEETS", self.sheets)
            .define("VOLUME", self.volume)
            .define("VOLUME_UNIT", ALIGNMENT as u32 / (4 * self.storage.bytes() as u32))
            .define("KEEPS", self.gloss)
            .define("SHEET_COEFFICIENTS", coefficient_count(self.bands.min(POLYGON_BANDS)) as u32)
            .number("CONTACT", CONTACT)
            .number("BEHIND_SHEET", BEHIND_SHEET)
            .define("UNIFORM", self.variant.reads == Reads::StorageUniform)
            .define("ENTITY_LIMIT", self.entity_limit)
            .define("HALF", self.storage == Storage::F16)
            .number("FADE", SKIP_FADE_RAD)
            .number("MEET", CONES_MEET_RAD)
            .number("CAP_SINE_LEAST", CAP_SINES[0])
            .number("CAP_SINE_MOST", CAP_SINES[1])
            .number("CAP_SPREAD", CAP_SPREAD)
            .define("SHELLS", lattice.shells)
            .define("CELLS", lattice.cells);
        let row = self.skip.merge_defines().fold(row, |row, (name, on)| row.define(name, on));
        row.number("WARP_0", CELL_WARP[0]).number("WARP_1", CELL_WARP[1]).number("WARP_2", CELL_WARP[2])
    }
}
