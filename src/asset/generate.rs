//! Generated meshes with analytic normals: as scene files name them, and for numbers that are in range.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::mesh::{COORDINATE_LIMIT_M, Mesh, TRIANGLE_LIMIT};
use super::panel;
use crate::error::{Error, Result};

/// Largest number of times that an icosahedron's triangles are divided: 1.3 million triangles.
pub const SPHERE_SUBDIVISION_LIMIT: u32 = 8;
/// Emission pattern of the x < 0 half of a torus of two colours, linear RGB.
pub const COOL: Vec3 = Vec3::new(0.02, 0.12, 1.0);
/// Emission pattern of the x > 0 half of a torus of two colours, linear RGB.
pub const WARM: Vec3 = Vec3::new(1.0, 0.12, 0.02);
/// Half the width of the blend between the two colours, as a share of the major radius. It spans several segments.
const BLEND: f64 = 0.15;
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
}

impl Generator {
    /// Whether its user chose how many faces it has, and not the fewest for its shape.
    pub(crate) fn is_tessellated(&self) -> bool {
        !matches!(self, Generator::Plane { cells: 1, .. } | Generator::Cuboid { cells: 1, .. })
    }

    /// Checks the numbers and makes the mesh.
    ///
    /// # Errors
    /// [`Error::Input`], one line, where a length is not positive and finite or a count is zero or makes too many
    /// triangles.
    pub fn build(&self) -> Result<Mesh> {
        use Generator::{Cuboid, Disc, Plane, Rectangle, Sphere, Torus, TorusTwoColour};
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
        })
    }
}

/// Makes the mesh. It meets the conditions of [`Mesh::new`] if the numbers are in range.
fn finish(
    name: &str,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    colors: Option<Vec<Vec3>>,
    triangles: Vec<[u32; 3]>,
) -> Mesh {
    Mesh::new(name, positions, normals, colors, triangles)
        .unwrap_or_else(|e| panic!("generator {name} made a bad mesh: {e}"))
}

/// Coordinate `index` of 0 to `cells` on an edge of length `size` centred on zero. All edges use this function, so
/// shared edges match to the bit; it is odd about the middle, so opposite ends do too.
fn along(size: f32, index: u32, cells: u32) -> f32 {
    (f64::from(size) * 0.5 * (2.0 * f64::from(index) - f64::from(cells)) / f64::from(cells)) as f32
}

/// The two triangles of a square whose corners are numbered around it.
fn split([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    [[a, b, c], [a, c, d]]
}

/// [`Generator::Plane`] of (cells + 1)^2 vertices.
pub fn plane(size_m: f32, cells: u32) -> Mesh {
    let row = cells + 1;
    let positions: Vec<Vec3> =
        (0..row * row).map(|i| Vec3::new(along(size_m, i % row, cells), 0.0, along(size_m, i / row, cells))).collect();
    let corner = |x: u32, z: u32| z * row + x;
    let triangles = (0..cells * cells).flat_map(|i| {
        let x = i % cells;
        let z = i / cells;
        split([corner(x, z), corner(x, z + 1), corner(x + 1, z + 1), corner(x + 1, z)])
    });
    let triangles = triangles.collect();
    finish("plane", positions, vec![Vec3::Y; (row * row) as usize], None, triangles)
}

/// [`Generator::Sphere`] of 10 * 4^s + 2 vertices and 20 * 4^s triangles.
pub fn sphere(radius_m: f32, subdivisions: u32) -> Mesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    // Cyclic turns of (0, +-1, +-golden); the twenty faces are the triples at edge length 2.
    let mut points: Vec<DVec3> = [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)]
        .iter()
        .flat_map(|&(a, b)| [DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)])
        .collect();
    let near = |a: usize, b: usize| (points[a].distance_squared(points[b]) - 4.0).abs() < 1e-9;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = points[a].dot(points[b].cross(points[c])) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let ab = middle(a, b);
                let bc = middle(b, c);
                let ca = middle(c, a);
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let positions = points.iter().map(|p| (*p * f64::from(radius_m)).as_vec3()).collect();
    finish("sphere", positions, points.iter().map(|p| p.as_vec3()).collect(), None, triangles)
}

/// [`Generator::Torus`] of segments * sides vertices.
pub fn torus(major_m: f32, minor_m: f32, segments: u32, sides: u32) -> Mesh {
    ring("torus", major_m, minor_m, segments, sides, None)
}

pub fn torus_two_colour(major_m: f32, minor_m: f32, segments: u32, sides: u32) -> Mesh {
    let color = |p: Vec3| {
        let t = ((f64::from(p.x) / (f64::from(major_m) * BLEND) + 1.0) * 0.5).clamp(0.0, 1.0);
        COOL.lerp(WARM, (t * t * (3.0 - 2.0 * t)) as f32)
    };
    ring("torus_two_colour", major_m, minor_m, segments, sides, Some(&color))
}

fn ring(
    name: &str,
    major_m: f32,
    minor_m: f32,
    segments: u32,
    sides: u32,
    color: Option<&dyn Fn(Vec3) -> Vec3>,
) -> Mesh {
    let vertex = |i: u32| {
        let around = TAU * f64::from(i / sides) / f64::from(segments);
        let across = TAU * f64::from(i % sides) / f64::from(sides);
        let outward = DVec3::new(around.cos(), 0.0, -around.sin());
        let normal = outward * across.cos() + DVec3::Y * across.sin();
        ((outward * f64::from(major_m) + normal * f64::from(minor_m)).as_vec3(), normal.as_vec3())
    };
    let (positions, normals): (Vec<Vec3>, Vec<Vec3>) = (0..segments * sides).map(vertex).unzip();
    let corner = |s: u32, k: u32| (s % segments) * sides + k % sides;
    let triangles = (0..segments * sides)
        .flat_map(|i| {
            let s = i / sides;
            let k = i % sides;
            split([corner(s, k), corner(s + 1, k), corner(s + 1, k + 1), corner(s, k + 1)])
        })
        .collect();
    let colors = color.map(|c| positions.iter().map(|p| c(*p)).collect());
    finish(name, positions, normals, colors, triangles)
}

pub fn cuboid(size_m: Vec3, cells: u32) -> Mesh {
    let mut positions = Vec::new();
    let mut normals = Vec::new();
    let mut triangles = Vec::new();
    let row = cells + 1;
    for axis in 0..3 {
        for side in [0, cells] {
            let base = positions.len() as u32;
            let mut normal = Vec3::ZERO;
            normal[axis] = if side == 0 { -1.0 } else { 1.0 };
            let u = (axis + 1) % 3;
            let v = (axis + 2) % 3;
            for i in 0..row * row {
                let mut p = Vec3::ZERO;
                p[axis] = along(size_m[axis], side, cells);
                p[u] = along(size_m[u], i % row, cells);
                p[v] = along(size_m[v], i / row, cells);
                positions.push(p);
                normals.push(normal);
            }
            let corner = |x: u32, y: u32| base + y * row + x;
            for i in 0..cells * cells {
                let x = i % cells;
                let y = i / cells;
                let square = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
                // u, v and the axis are right-handed, so the square as it stands faces the positive side.
                triangles.extend(split(if side == 0 { [square[0], square[3], square[2], square[1]] } else { square }));
            }
        }
    }
    finish("cuboid", positions, normals, None, triangles)
}

/// An open tube of `sides` around places.
#[cfg(test)]
pub fn tube(places: &[Vec3], radius_m: f32, sides: u32) -> Mesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for (k, place) in places.iter().enumerate() {
        let along = places[(k + 1).min(places.len() - 1)] - places[k.max(1) - 1];
        let across = along.any_orthogonal_vector().normalize();
        let down = along.cross(across).normalize();
        positions.extend((0..sides).map(|i| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / sides as f32).sin_cos();
            *place + radius_m * (cos * across + sin * down)
        }));
        for i in (0..sides).filter(|_| k > 0) {
            let [a, b] = [i, (i + 1) % sides].map(|i| (k as u32 - 1) * sides + i);
            triangles.extend([[a, b, b + sides], [a, b + sides, a + sides]]);
        }
    }
    Mesh::new("tube", positions, Vec::new(), None, triangles).expect("a tube has an area")
}
