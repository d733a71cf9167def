//! Generated meshes as scene files name them.

pub use super::generate::{COOL, SPHERE_SUBDIVISION_LIMIT, WARM, library};
use super::generate::{cuboid, plane, sphere, torus, torus_two_colour};
use super::mesh::{COORDINATE_LIMIT_M, Mesh, TRIANGLE_LIMIT};
use super::{panel, teapot};
use crate::error::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Most that lengths of one mesh may differ by, so that f32 positions still keep its vertices apart.
const LENGTH_RATIO: f32 = 1e6;

/// A generated mesh as a scene file names it: a table with one key, for example `sphere = { radius_m = 0.5,
/// subdivisions = 3 }`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Generator {
    /// A square in y = 0 around the origin with normal +y, edges along x and z.
    Plane {
        /// Edge length in metres.
        size_m: f32,
        /// Squares along an edge.
        cells: u32,
    },
    /// A closed sphere around the origin: an icosahedron whose triangles are divided, every vertex on the sphere.
    Sphere {
        /// Radius in metres.
        radius_m: f32,
        /// Number of times that every triangle is divided into four, at most [`SPHERE_SUBDIVISION_LIMIT`].
        subdivisions: u32,
    },
    /// A closed ring around the y axis, every vertex on the torus.
    Torus {
        /// Radius in metres of the circle in the middle of the ring.
        major_m: f32,
        /// Radius in metres of the ring's cross-section.
        minor_m: f32,
        /// Pieces around the axis.
        segments: u32,
        /// Pieces around the cross-section.
        sides: u32,
    },
    /// The same with the emission pattern [`WARM`] where x > 0 and [`COOL`] where x < 0, with a narrow smooth blend.
    TorusTwoColour {
        /// Radius in metres of the circle in the middle of the ring.
        major_m: f32,
        /// Radius in metres of the ring's cross-section.
        minor_m: f32,
        /// Pieces around the axis.
        segments: u32,
        /// Pieces around the cross-section.
        sides: u32,
    },
    /// A closed box around the origin; normals are split at the edges, positions agree.
    Cuboid {
        /// Edge lengths in metres along x, y and z.
        size_m: Vec3,
        /// Squares along every edge.
        cells: u32,
    },
    /// A lamp around the origin that shines towards +y.
    Disc {
        /// Radius in metres.
        radius_m: f32,
    },
    /// A lamp around the origin that shines towards +y.
    Rectangle {
        /// Edge lengths in metres along x and z.
        size_m: [f32; 2],
    },
    /// Martin Newell's teapot: y up, base on y = 0, spout towards +x, 6.5 m from handle to spout and 2.4 m high. It is
    /// not closed.
    Teapot {
        /// Squares along an edge of each of the 32 patches.
        subdivisions: u32,
    },
}

impl Generator {
    /// Checks the numbers and makes the mesh.
    ///
    /// # Errors
    /// [`Error::Input`], one line, where a length is not positive and finite or a count is zero or makes too many
    /// triangles.
    pub fn build(&self) -> Result<Mesh> {
        use Generator::{Cuboid, Disc, Plane, Rectangle, Sphere, Teapot, Torus, TorusTwoColour};
        let square = |n: u32| u64::from(n).pow(2);
        let (lengths, counts, triangles) = match *self {
            Plane { size_m, cells } => (vec![size_m], vec![cells], square(cells).saturating_mul(2)),
            Sphere { radius_m, subdivisions } => {
                if subdivisions > SPHERE_SUBDIVISION_LIMIT {
                    return Err(Error::Input(format!("subdivisions are over the limit of {SPHERE_SUBDIVISION_LIMIT}")));
                }
                (vec![radius_m], vec![], 0)
            }
            Torus { major_m, minor_m, segments, sides } | TorusTwoColour { major_m, minor_m, segments, sides } => {
                if segments < 3 || sides < 3 {
                    return Err(Error::Input("a torus needs at least 3 segments and 3 sides".into()));
                }
                if minor_m > major_m {
                    return Err(Error::Input("the minor radius of a torus is at most its major radius".into()));
                }
                (vec![major_m, minor_m], vec![], (u64::from(segments) * u64::from(sides)).saturating_mul(2))
            }
            Cuboid { size_m, cells } => (size_m.to_array().to_vec(), vec![cells], square(cells).saturating_mul(12)),
            Disc { radius_m } => (vec![radius_m], vec![], 0),
            Rectangle { size_m } => (size_m.to_vec(), vec![], 0),
            Teapot { subdivisions } => (vec![], vec![subdivisions], square(subdivisions).saturating_mul(64)),
        };
        if lengths.iter().any(|l| !(1e-7..=COORDINATE_LIMIT_M / 2.0).contains(l)) {
            return Err(Error::Input(format!("a length is not within 1e-7 to {:e} m", COORDINATE_LIMIT_M / 2.0)));
        }
        let longest = lengths.iter().copied().fold(0.0, f32::max);
        if lengths.iter().any(|l| longest > LENGTH_RATIO * l) {
            return Err(Error::Input(format!("lengths differ by more than a factor of {LENGTH_RATIO:e}")));
        }
        if counts.contains(&0) {
            return Err(Error::Input("a count of cells or subdivisions is zero".into()));
        }
        if triangles > TRIANGLE_LIMIT as u64 {
            return Err(Error::Input(format!("{triangles} triangles are over the limit of {TRIANGLE_LIMIT}")));
        }
        Ok(match *self {
            Plane { size_m, cells } => plane(size_m, cells),
            Sphere { radius_m, subdivisions } => sphere(radius_m, subdivisions),
            Torus { major_m, minor_m, segments, sides } => torus(major_m, minor_m, segments, sides),
            TorusTwoColour { major_m, minor_m, segments, sides } => torus_two_colour(major_m, minor_m, segments, sides),
            Cuboid { size_m, cells } => cuboid(size_m, cells),
            Disc { radius_m } => panel::disc(radius_m)?,
            Rectangle { size_m } => panel::rectangle(size_m)?,
            Teapot { subdivisions } => teapot::teapot(subdivisions),
        })
    }
}
