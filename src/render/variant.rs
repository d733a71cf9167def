//! Variants of the merge shader that compute the same function, by name, and what else its code depends on.

use crate::error::{Error, Result};
use crate::field::lattice::{CELL_WARP, Directions, Lattice, Lookup, Spacing};
use crate::field::quantity::Storage;
use crate::gpu::Device;
use crate::shaders::Row;

/// How the merge is done, where that changes its speed and not its outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    /// Name on the command line.
    pub name: &'static str,
    /// Fields, transfers and vertices are read through texel views rather than storage blocks.
    pub texel: bool,
    /// Entities, rotations and sky are uniform blocks, at indices that Mesa's software driver sees to be uniform; storage
    /// blocks otherwise.
    pub uniform: bool,
    /// Invocations a workgroup.
    pub workgroup: u32,
}

/// Every variant.
pub const VARIANTS: &[Variant] = &[
    Variant { name: "storage", texel: false, uniform: false, workgroup: 64 },
    Variant { name: "storage-uniform", texel: false, uniform: true, workgroup: 64 },
    Variant { name: "texel", texel: true, uniform: false, workgroup: 64 },
    Variant { name: "texel-uniform", texel: true, uniform: true, workgroup: 64 },
];

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
        let name = if device.info.is_software() { "texel-uniform" } else { "storage" };
        Self::named(name).expect("the default is in the table")
    }

    /// The variant that does without what a scene or device rules out.
    pub fn restricted(self, texel: bool, uniform: bool) -> Self {
        let (texel, uniform) = (self.texel && texel, self.uniform && uniform);
        VARIANTS.iter().copied().find(|v| v.texel == texel && v.uniform == uniform).expect("every pair has a row")
    }
}

/// Entities that the uniform blocks hold: their 4-band rotations then take 16 128 of the 16 384 bytes that every device binds.
pub const UNIFORM_ENTITIES: u32 = 48;

/// What the merge shader is compiled for: a variant, the shape of the fields, and the lights of a dispatch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// How it is done.
    pub variant: Variant,
    /// SH bands of transfer and fields.
    pub bands: usize,
    /// Number format of the fields.
    pub storage: Storage,
    /// Samples of the fields. First and last shell are data, not code.
    pub lattice: Lattice,
    /// Which samples a lookup takes.
    pub lookup: Lookup,
    /// Local lights in a dispatch, 0 to [`MAX_LIGHTS`].
    pub lights: u32,
    /// Whether the distant light is in it.
    pub sky: bool,
}

/// Most local lights of one dispatch: each keeps a running product of 16 registers.
pub const MAX_LIGHTS: u32 = 4;

impl Form {
    /// The row of the shader table.
    pub fn row(&self) -> Row {
        let lattice = self.lattice;
        let (cells, latitudes, longitudes) = match lattice.directions {
            Directions::Cube { cells } => (cells, 0, 0),
            Directions::LatLon { latitudes, longitudes } => (0, latitudes, longitudes),
        };
        let cube = matches!(lattice.directions, Directions::Cube { .. });
        let row = Row::new("merge.comp", self.bands)
            .define("WORKGROUP", self.variant.workgroup)
            .define("TEXEL", self.variant.texel)
            .define("UNIFORM", self.variant.uniform)
            .define("ENTITY_LIMIT", UNIFORM_ENTITIES)
            .define("HALF", self.storage == Storage::F16)
            .define("LIGHTS", self.lights)
            .define("SKY", self.sky)
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
                    Spacing::Log => 1,
                    Spacing::Linear => 2,
                },
            )
            .define("SCALED", lattice.scaled)
            .define("SHELLS", lattice.shells)
            .define("DIRECTIONS", !cube)
            .define("CELLS", cells)
            .define("LATITUDES", latitudes)
            .define("LONGITUDES", longitudes);
        ["WARP_0", "WARP_1", "WARP_2"]
            .into_iter()
            .zip(CELL_WARP)
            .fold(row, |row, (name, value)| row.number(name, value))
    }
}
