//! The shortcuts of a bake, which spare it to capture every face of every sample.

use serde::{Deserialize, Serialize};

/// The shortcuts of a bake. All of them are on by default. They enter the name under which the cache keeps a field, since each can change
/// stored numbers: even a face that is left out moves the next faces to other places in the atlas, where a silhouette that runs
/// through a texel's centre may round to the other side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shortcuts {
    /// Only one of the samples that a symmetry of the mesh carries into one another is captured. It is turned for the others.
    pub symmetry: bool,
    /// Only faces that the object reaches are drawn, with only the triangles that reach into them, and without backs of closed meshes.
    pub faces: bool,
    /// Samples inside a solid are captured off its nearest surface, or are filled from their neighbours where nothing is seen from
    /// there either. With this shortcut off they are captured where they stand, with both sides of every triangle, and see all dark.
    pub inside: bool,
}

impl Default for Shortcuts {
    fn default() -> Self {
        Shortcuts { symmetry: true, faces: true, inside: true }
    }
}

impl Shortcuts {
    /// Whether all are on. Headers leave them out then.
    pub fn are_default(&self) -> bool {
        *self == Shortcuts::default()
    }
}
