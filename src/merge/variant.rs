//! Variants of the merge shader that compute the same function, by name, and what else its code depends on.

use crate::error::{Error, Result};
use crate::field::lattice::{CELL_WARP, Directions, Lattice, Lookup, Spacing};
use crate::field::quantity::{Storage, channel_stride};
use crate::gpu::Device;
use crate::layout::{CLUSTER_VERTICES, DeviceEntity, ENTRY_BITS};
use crate::lists::skip::{CAP_SINES, CAP_SPREAD, CONES_MEET_RAD, SKIP_FADE_RAD, Skip};
use crate::merge::chain::{Chain, Product};
use crate::sh::basis::Y00;
use crate::sh::product_program::STYLES;
use crate::shaders::ShaderPermutation;
use ash::vk;

/// How the merge is done, where that changes its speed and not its outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Name on the command line.
    pub name: &'static str,
    /// Everything is read through texel views rather than storage blocks.
    pub texel: bool,
    /// Entities are a uniform block; otherwise a storage block or texels like the rest.
    pub uniform: bool,
    /// Fields of halves are read eight coefficients a texel, where a channel's coefficients are a multiple of eight.
    pub packed: bool,
    /// Packed halves become floats by shifts of their bits rather than by the instruction for it.
    pub shifted: bool,
    /// Fields are an image whose samples a sampler interpolates, with weights of as few bits as the device likes (8 on
    /// most): not quite the same function, and so only by name.
    pub image: bool,
}

/// Every variant. A GPU reads storage blocks, and a uniform block where the entities fit into one. llvmpipe and SwiftShader read texels
/// faster, and halves best where they are packed or decoded by shifts; which is best depends on the version. The image is the fastest
/// on Mesa 25, at the cost of the sampler's precision. `bench/MEASURED.md` has the times.
pub const VARIANTS: &[Variant] = &[
    Variant { name: "storage", ..STORAGE },
    Variant { name: "storage-uniform", uniform: true, ..STORAGE },
    Variant { name: "texel", texel: true, ..STORAGE },
    Variant { name: "texel-packed", texel: true, packed: true, ..STORAGE },
    Variant { name: "texel-shifted", texel: true, packed: true, shifted: true, ..STORAGE },
    Variant { name: "image", texel: true, image: true, ..STORAGE },
];
const STORAGE: Variant =
    Variant { name: "", texel: false, uniform: false, packed: false, shifted: false, image: false };

impl Variant {
    /// The variant of that name.
    ///
    /// # Errors
    /// `Usage` that lists the names.
    pub fn named(name: &str) -> Result<Self> {
        VARIANTS.iter().copied().find(|v| v.name == name).ok_or_else(|| {
            let names: Vec<_> = VARIANTS.iter().map(|v| v.name).collect();
            Error::Usage(format!("unknown variant \"{name}\" ({})", names.join(", ")))
        })
    }

    /// What a device gets before anything was measured on it: texel reads are more than ten times faster than storage reads
    /// on a processor, and no slower than them on the GPUs that are known.
    pub fn sane_default(device: &Device) -> Self {
        let name = if device.info.is_software() { "texel-shifted" } else { "storage-uniform" };
        Self::named(name).expect("the default is in the table")
    }

    /// The variant that does without what a scene or device rules out.
    pub fn restricted(self, texel: bool, uniform: bool, image: bool) -> Self {
        let name = match (self.texel && texel, self.uniform && uniform) {
            _ if self.image && image && texel => self.name,
            (true, _) if self.image => "texel-packed",
            (true, _) => self.name,
            (false, true) => "storage-uniform",
            (false, false) => "storage",
        };
        Self::named(name).expect("the names are in the table")
    }
}

/// Entities that a uniform block of the device holds, at most 512 (48 KiB; most devices bind 64).
pub fn uniform_entities(device: &Device) -> u32 {
    (device.limits.max_uniform_buffer_range / size_of::<DeviceEntity>() as u32).min(512)
}

/// What the merge shader is compiled for: a variant, the shape of the fields, and what is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergePermutation {
    /// How it is done.
    pub variant: Variant,
    /// SH bands of transfer, light and products.
    pub bands: usize,
    /// SH bands of occlusion fields.
    pub field_bands: usize,
    /// Number format of the fields.
    pub storage: Storage,
    /// Samples of the fields. First and last shell are data, not code.
    pub lattice: Lattice,
    /// Which samples a lookup takes.
    pub lookup: Lookup,
    /// What is left out.
    pub skip: Skip,
    /// Whether any light meets a chain. Without, there is the sky's chain alone.
    pub lights: bool,
    /// Entities that uniform blocks hold on the device, [`uniform_entities`].
    pub entity_limit: u32,
}

impl MergePermutation {
    /// Format of the texels that fields are read through.
    pub fn field_format(&self) -> vk::Format {
        match self.storage {
            Storage::F32 => vk::Format::R32G32B32A32_SFLOAT,
            Storage::F16 if self.packed() => vk::Format::R32G32B32A32_UINT,
            Storage::F16 => vk::Format::R16G16B16A16_SFLOAT,
        }
    }

    /// Whether fields of this permutation can be read as an image.
    pub fn fits_image(&self) -> bool {
        self.storage == Storage::F16
            && self.bands == self.field_bands
            && self.lookup == Lookup::Trilinear
            && matches!(self.lattice.directions, Directions::Cube { .. })
    }

    fn packed(&self) -> bool {
        self.variant.packed
            && self.storage == Storage::F16
            && [self.bands, self.field_bands].iter().all(|&bands| channel_stride(bands).is_multiple_of(8))
    }

    /// The row of the shader table.
    pub fn row(&self) -> ShaderPermutation {
        let lattice = self.lattice;
        let (cells, latitudes, longitudes) = match lattice.directions {
            // What a lattice has none of is 1: the shader's other side must compile too.
            Directions::Cube { cells } => (cells, 1, 1),
            Directions::LatLon { latitudes, longitudes } => (1, latitudes, longitudes),
        };
        let cube = matches!(lattice.directions, Directions::Cube { .. });
        let product = Product::Factored.style(self.bands, self.field_bands);
        let row = ShaderPermutation::new("merge.comp", self.bands)
            .field_bands(self.field_bands)
            .define("PRODUCT", STYLES.iter().position(|style| *style == product).expect("every style is listed") as u32)
            .define("GUARD", Chain::default().guard)
            .number("Y00", Y00)
            .define("WORKGROUP", CLUSTER_VERTICES)
            .define("ENTRY_BITS", ENTRY_BITS)
            .define("TEXEL", self.variant.texel)
            .define("IMAGE", self.variant.image && self.fits_image())
            .define("PACKED", self.packed())
            .define("SHIFTED", self.packed() && self.variant.shifted)
            .define("LIGHTS", self.lights)
            .define("UNIFORM", self.variant.uniform)
            .define("ENTITY_LIMIT", self.entity_limit)
            .define("HALF", self.storage == Storage::F16)
            .number("FADE", SKIP_FADE_RAD)
            .number("MEET", CONES_MEET_RAD)
            .number("CAP_SINE_LEAST", CAP_SINES[0])
            .number("CAP_SINE_MOST", CAP_SINES[1])
            .number("CAP_SPREAD", CAP_SPREAD)
            .define(
                "LOOKUP",
                match self.lookup {
                    Lookup::Nearest => 0_u32,
                    Lookup::Radial => 1,
                    Lookup::Trilinear => 2,
                },
            )
            .define(
                "SPACING",
                match lattice.spacing {
                    Spacing::Chord => 0_u32,
                    Spacing::Linear => 1,
                },
            )
            .define("SHELLS", lattice.shells)
            .define("DIRECTIONS", !cube)
            .define("CELLS", cells)
            .define("LATITUDES", latitudes)
            .define("LONGITUDES", longitudes);
        let row = self.skip.merge_defines().fold(row, |row, (name, on)| row.define(name, on));
        ["WARP_0", "WARP_1", "WARP_2"]
            .into_iter()
            .zip(CELL_WARP)
            .fold(row, |row, (name, value)| row.number(name, value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// Of one number of bands and one size of lattice there are 1 568: five ways to read halves and three to read floats, with three
    /// lookups and two kinds of directions (48), and the image, which is trilinear and a cube; times two spacings, with
    /// lights or without, and three skips on or off (32).
    #[test]
    fn there_are_as_many_permutations_as_counted() {
        let mut rows = HashSet::new();
        let lattices = ["chord,scaled", "linear,raw"]
            .into_iter()
            .flat_map(|spacing| ["cube:8x4", "latlon:8x4x4"].map(|shape| format!("{shape},{spacing},inner=1.02")));
        for lattice in lattices.map(|text| text.parse().unwrap()) {
            for &variant in VARIANTS {
                for storage in [Storage::F16, Storage::F32] {
                    for lookup in [Lookup::Nearest, Lookup::Radial, Lookup::Trilinear] {
                        for switches in 0..16 {
                            let on = |bit: u32| switches >> bit & 1 == 1;
                            let skip = Skip { horizon: on(0), cones: on(1), caps: on(2), ..Skip::NONE };
                            let lights = on(3);
                            let (bands, field_bands, entity_limit) = (4, 4, 48);
                            let permutation = MergePermutation {
                                variant,
                                bands,
                                field_bands,
                                storage,
                                lattice,
                                lookup,
                                skip,
                                lights,
                                entity_limit,
                            };
                            rows.insert(permutation.row());
                        }
                    }
                }
            }
        }
        assert_eq!(rows.len(), (8 * 3 * 2 + 1) * 2 * 2 * 8);
    }
}
