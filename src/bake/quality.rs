//! How finely fields are sampled and stored, in one word (`--quality`).
//!
//! | quality | lattice | face | bands | format |
//! |---|---|---|---|---|
//! | draft | cube:8x4 | 32 px | 3 | f16 |
//! | normal | cube:18x7,edges=auto | 64 px | 4 | f16 |
//! | high | cube:24x10 | 128 px | 5 | f16 |
//!
//! Times, bytes and errors are in `src/bench/MEASURED.md`. More samples do not help small lights in bands: the number
//! of bands limits them.

use super::Options;
use super::silhouette::SilhouetteOptions;

/// Rows of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Quality {
    /// A tenth of the time and a seventh of the bytes; light in bands has 1.2 to 1.7 times the error: cube:8x4, 32 px, 3 bands
    Draft,
    /// The default: cube:18x7,edges=auto, 64 px, 4 bands
    #[default]
    Normal,
    /// 5 times the time and 4 times the bytes; light in bands has 0.54 to 0.84 of the error: cube:24x10, 128 px, 5 bands
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
