//! How finely fields are sampled and stored, in one word (`--quality`).
//!
//! | quality | lattice | face | bands | format | bake | bytes | error: torus | error: glowing ring |
//! |---|---|---|---|---|---|---|---|---|
//! | draft | cube:8x4 | 32 px | 3 | f16 | 0.3 s | 42 084 | 0.107 | 0.058 |
//! | normal | cube:18x7,edges=auto | 64 px | 4 | f16 | 3.0 s | 280 549 | 0.087 | 0.035 |
//! | high | cube:24x10 | 128 px | 5 | f16 | 15 s | 1 161 834 | 0.073 | 0.019 |
//!
//! Bake: processor time for the occlusion field of the built-in teapot (6 400 triangles) on llvmpipe, all cores together
//! (`shadow-fields bake assets/meshes/teapot.obj -o t.sf --quality Q`). Bytes: of that file. Error: root mean square over all vertices
//! against ray casting with 1 024 rays, relative to the radiosity's root mean square (`shadow-fields render torus_over_plane -o p.png
//! --error e.png --quality Q`, and the same for `glowing_torus`). Lights of few degrees are cut to few bands, which more samples do not mend.

use super::Options;
use super::silhouette::SilhouetteOptions;

/// Rows of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Quality {
    /// A tenth of the time and a seventh of the bytes, 1.2 to 1.7 times the error: cube:8x4, 32 px, 3 bands
    Draft,
    /// The default: cube:18x7, 64 px, 4 bands
    #[default]
    Normal,
    /// 4.9 times the time, 4 times the bytes, 0.55 to 0.84 of the error: cube:24x10, 128 px, 5 bands
    High,
}

impl Quality {
    /// What it stands for.
    pub fn options(self) -> Options {
        let normal = Options::default();
        let lattice = |text: &str| text.parse().expect("a lattice of the table");
        match self {
            Quality::Draft => {
                Options { lattice: lattice("cube:8x4"), face_px: 32, bands: 3, silhouette: silhouettes(4), ..normal }
            }
            Quality::Normal => normal,
            Quality::High => Options {
                lattice: lattice("cube:24x10"),
                face_px: 128,
                bands: 5,
                silhouette: silhouettes(16),
                ..normal
            },
        }
    }
}

/// 98, 389 and 1 542 KiB of silhouettes a mesh with 4, 8 and 16 cells along a cube's face, and half as much again for a mesh that is
/// not convex.
fn silhouettes(cells: u32) -> SilhouetteOptions {
    SilhouetteOptions { cells, ..Default::default() }
}
