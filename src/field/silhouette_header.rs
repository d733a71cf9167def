//! Header of a silhouette field's file.

use super::silhouette_nodes::NodeGrid;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// The part of an object that a map shows. Halves meet in the plane through the sphere's centre at right angles to the
/// map's direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Whole,
    /// The half beyond the centre along the direction.
    Far,
    /// The half before the centre.
    Near,
}

impl Side {
    /// All of them, in the order in which they are stored.
    pub const ALL: [Side; 3] = [Side::Whole, Side::Far, Side::Near];

    /// The side as seen in the opposite direction.
    pub fn mirrored(self) -> Side {
        match self {
            Side::Whole => Side::Whole,
            Side::Far => Side::Near,
            Side::Near => Side::Far,
        }
    }

    /// Sign of depths on the side; 0 for the whole.
    pub fn sign(self) -> f32 {
        match self {
            Side::Whole => 0.0,
            Side::Far => 1.0,
            Side::Near => -1.0,
        }
    }
}

/// Most faces that are kept of a convex mesh.
pub const FACES_LIMIT: usize = 12;
/// Bound on coordinates in bounding radii: 1 and what rounding adds.
const MOST_EXTENT: f32 = 1.01;

/// Everything about a silhouette field but its maps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SilhouetteHeader {
    /// Cells along an edge of a cube face of the [`NodeGrid`], 1 to 64.
    pub cells: u32,
    /// Texels along an edge of a map: a power of two, 8 to 256.
    pub map_px: u32,
    /// Pixels along an edge of the view that a map is reduced from, a multiple of `map_px`.
    pub view_px: u32,
    /// Texels along an edge of the maps of the object's two halves: half of `map_px`, or 0 where a field has none, as
    /// of convex meshes.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub half_px: u32,
    /// Share of a view's pixel by which what was drawn may miss the mesh; 0 where all of its triangles were drawn.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub level_pixels: f64,
    /// Centre of the bounding sphere in the mesh's own frame, metres.
    pub centre_m: [f32; 3],
    pub radius_m: f32,
    /// Least and largest coordinates of the mesh from that centre, in its own frame and in bounding radii.
    pub extent: [[f32; 3]; 2],
    /// Planes of the faces of a convex mesh that has few, but for those of the box: unit normal, and distance from the
    /// centre in bounding radii.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faces: Vec<[f32; 4]>,
    /// Name of the mesh, for people.
    pub mesh: String,
    /// Content hash of the mesh, hexadecimal.
    pub mesh_hash: String,
}

impl SilhouetteHeader {
    /// Maps that are stored: one for each pair of opposite nodes.
    pub fn map_count(&self) -> usize {
        NodeGrid::map_count(self.cells)
    }

    /// Bytes of one map: four floats of its [`MapFrame`](super::silhouette::MapFrame)'s rectangle, then two bytes a
    /// texel of the whole object and of its halves.
    pub fn map_bytes(&self) -> usize {
        16 + self.texel_bytes(Side::Whole) + 2 * self.texel_bytes(Side::Far)
    }

    pub fn edge_px(&self, side: Side) -> usize {
        (if side == Side::Whole { self.map_px } else { self.half_px }) as usize
    }

    pub fn texel_bytes(&self, side: Side) -> usize {
        2 * self.edge_px(side).pow(2)
    }

    /// First byte of the texels of a map's side within the map.
    pub fn texels_at(&self, side: Side) -> usize {
        16 + match side {
            Side::Whole => 0,
            Side::Far => self.texel_bytes(Side::Whole),
            Side::Near => self.texel_bytes(Side::Whole) + self.texel_bytes(Side::Far),
        }
    }

    pub fn payload_bytes(&self) -> usize {
        self.map_count() * self.map_bytes()
    }

    pub fn validate(&self) -> Result<()> {
        let bad = |what: String| Err(Error::Input(what));
        if !(1..=64).contains(&self.cells) {
            return bad(format!("{} cells a face, a silhouette field has 1 to 64", self.cells));
        }
        if !(8..=256).contains(&self.map_px) || !self.map_px.is_power_of_two() {
            return bad(format!("maps of {} px, a silhouette field has a power of two from 8 to 256", self.map_px));
        }
        if !(self.map_px..=1024).contains(&self.view_px) || !self.view_px.is_multiple_of(self.map_px) {
            return bad(format!("views of {} px for maps of {} px", self.view_px, self.map_px));
        }
        if self.half_px != 0 && self.half_px != self.map_px / 2 {
            return bad(format!("maps of halves of {} px beside maps of {} px", self.half_px, self.map_px));
        }
        let usable = self.centre_m.iter().all(|c| c.is_finite()) && self.radius_m > 0.0 && self.radius_m.is_finite();
        if !usable {
            return bad("centre or radius is not a usable number".into());
        }
        let [low, high] = self.extent;
        let is_face = |face: &[f32; 4]| face.iter().all(|x| x.abs() <= MOST_EXTENT);
        if self.faces.len() > FACES_LIMIT || !self.faces.iter().all(is_face) {
            return bad(format!("faces {:?}", self.faces));
        }
        let ordered = (0..3).all(|i| low[i] <= high[i] && low[i] >= -MOST_EXTENT && high[i] <= MOST_EXTENT);
        if ordered { Ok(()) } else { bad(format!("an extent from {low:?} to {high:?} within a sphere of radius 1")) }
    }
}
