//! What a bake does in place of capturing every face of every sample.

use serde::{Deserialize, Serialize};

/// Shortcuts of a bake, each of them on by default. All of them enter the name under which the cache keeps a field, since each can
/// change stored numbers: even a face that is left out moves the next ones to other places in the atlas, where a silhouette that
/// runs through a texel's centre may round to the other side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shortcuts {
    /// Of samples that a symmetry of the mesh carries into one another only one is captured, and turned for the others.
    pub symmetry: bool,
    /// Only faces that the object reaches are drawn, of these only what reaches into them, and of closed meshes no backs.
    pub faces: bool,
    /// Samples inside a solid are captured off its nearest surface, or are filled from their neighbours where nothing is seen from
    /// there either. If not, they are captured where they stand, from where both sides of every face are drawn: all dark.
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
