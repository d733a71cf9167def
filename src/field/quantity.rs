//! The quantity that a field holds, and its number format.

use serde::{Deserialize, Serialize};

/// Meaning of a field's coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FieldKind {
    /// Object occlusion field: the blocked part b = P[1 - V], one channel.
    Occlusion,
    /// Source radiance field: `P[L]` in red, green and blue.
    Radiance,
}

impl FieldKind {
    pub fn channels(self) -> usize {
        match self {
            FieldKind::Occlusion => 1,
            FieldKind::Radiance => 3,
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Storage {
    F32,
    /// 16-bit floats. The error is below 1e-3 of the blocked part; magnitudes below 2^-14 are stored as 0.
    #[default]
    F16,
}

impl Storage {
    pub fn bytes(self) -> usize {
        match self {
            Storage::F32 => 4,
            Storage::F16 => 2,
        }
    }
}

/// Stored coefficients of one channel: bands^2 rounded up to a multiple of four.
pub fn channel_stride(bands: usize) -> usize {
    (bands * bands).next_multiple_of(4)
}
