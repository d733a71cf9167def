//! Martin Newell's teapot (1975): 32 bicubic Bezier patches from the control points in `assets/newell_teapot.txt`.

use std::collections::HashMap;

use glam::{DVec3, IVec3, Vec3};

use super::mesh::Mesh;

/// The control points; source and credit stand in its header and in `assets/CREDITS.md`.
const CONTROL_TEXT: &str = include_str!("../../assets/newell_teapot.txt");
/// Heights are divided by this, as in renderings of the teapot since Blinn.
const VERTICAL_SQUEEZE: f64 = 1.3;
/// Vertices of neighbouring patches closer than this, in units of the table, are one position.
const WELD_DISTANCE: f64 = 1e-6;
/// Normals that agree this closely at one position are one vertex; f64 rounding leaves less than 1e-9 between patches
/// that meet smoothly.
const WELD_COSINE: f64 = 1.0 - 1e-6;

type Patch = [[DVec3; 4]; 4];

/// Tessellates the patches with `subdivisions` squares along each edge.
///
/// The result has y up, spout towards +x, handle towards -x, its base on y = 0, and is in units of the original table
/// taken as metres (6.4 m from handle to spout, 2.4 m high). Normals are analytic, and point out of the body. Where a
/// patch edge collapses to a point, the limit of the normal is taken and triangles without area are dropped. The mesh
/// is not closed: the lid rests on an open pot, and spout and handle reach into it.
pub fn teapot(subdivisions: u32) -> Mesh {
    let mut weld = Weld::default();
    let mut triangles = Vec::new();
    for patch in patches() {
        let row = subdivisions + 1;
        let vertices: Vec<u32> = (0..row * row)
            .map(|i| {
                let u = f64::from(i / row) / f64::from(subdivisions);
                let v = f64::from(i % row) / f64::from(subdivisions);
                let (position, normal) = evaluate(&patch, u, v);
                weld.add(position, normal)
            })
            .collect();
        for i in 0..subdivisions * subdivisions {
            let u = i / subdivisions;
            let v = i % subdivisions;
            let at = |u: u32, v: u32| vertices[(u * row + v) as usize];
            let [a, b, c, d] = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)];
            // The table's u x v points into the body, so the square is wound the other way and normals are v x u.
            triangles.extend([[a, c, b], [a, d, c]]);
        }
    }
    Mesh::new("teapot", weld.positions, weld.normals, None, triangles).expect("the teapot is a mesh")
}

/// Reads `v x y z` and `p` lines; turns z up into y up and squeezes the vertical.
fn patches() -> Vec<Patch> {
    let mut points: Vec<DVec3> = Vec::new();
    let mut patches = Vec::new();
    for line in CONTROL_TEXT.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["v", x, y, z] => {
                let [x, y, z] = [x, y, z].map(|word| word.parse::<f64>().expect("a coordinate"));
                points.push(DVec3::new(x, z / VERTICAL_SQUEEZE, -y));
            }
            ["p", ref indices @ ..] => {
                let point = |k: usize| points[indices[k].parse::<usize>().expect("a point's number")];
                patches.push(std::array::from_fn(|row| std::array::from_fn(|column| point(4 * row + column))));
            }
            _ => {}
        }
    }
    patches
}

fn bernstein(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    let value = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    (value, [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t])
}

fn blend(patch: &Patch, u: [f64; 4], v: [f64; 4]) -> DVec3 {
    (0..16).map(|k| patch[k / 4][k % 4] * (u[k / 4] * v[k % 4])).sum()
}

/// Position and unit normal.
///
/// Along a collapsed edge u = 0 the derivative S_v vanishes and near it is u S_uv: the limit of the normal is that of
/// S_uv x S_u, and with the sign of (1/2 - u) at u = 1. Edges v = 0 and v = 1 likewise.
fn evaluate(patch: &Patch, u: f64, v: f64) -> (DVec3, DVec3) {
    let ((bu, du), (bv, dv)) = (bernstein(u), bernstein(v));
    let along_u = blend(patch, du, bv);
    let along_v = blend(patch, bu, dv);
    let mixed = blend(patch, du, dv);
    // Derivatives are of the size of the control polygon; 1e-9 of that is rounding.
    let vanishes = |d: DVec3| d.length() < 1e-9;
    let inwards = |t: f64| if t < 0.5 { 1.0 } else { -1.0 };
    let normal = match (vanishes(along_u), vanishes(along_v)) {
        (false, true) => (mixed * inwards(u)).cross(along_u),
        (true, false) => along_v.cross(mixed * inwards(v)),
        _ => along_v.cross(along_u),
    };
    (blend(patch, bu, bv), normal.normalize_or(DVec3::Y))
}

/// Collects vertices: positions closer than [`WELD_DISTANCE`] become equal, and one vertex where the normals agree as
/// well.
#[derive(Default)]
struct Weld {
    cells: HashMap<IVec3, Vec<u32>>,
    exact: Vec<DVec3>,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl Weld {
    fn add(&mut self, position: DVec3, normal: DVec3) -> u32 {
        // Cells are much larger than the distance; neighbouring cells are searched where their border is close.
        let cell = |p: DVec3| (p / (64.0 * WELD_DISTANCE)).floor().as_ivec3();
        let low = cell(position - WELD_DISTANCE);
        let high = cell(position + WELD_DISTANCE);
        let mut found = None;
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    for &i in self.cells.get(&IVec3::new(x, y, z)).into_iter().flatten() {
                        if self.exact[i as usize].distance(position) < WELD_DISTANCE {
                            if self.normals[i as usize].as_dvec3().dot(normal) > WELD_COSINE {
                                return i;
                            }
                            found = Some(i);
                        }
                    }
                }
            }
        }
        let exact = found.map_or(position, |i| self.exact[i as usize]);
        let index = self.exact.len() as u32;
        self.cells.entry(cell(exact)).or_default().push(index);
        self.exact.push(exact);
        self.positions.push(exact.as_vec3());
        self.normals.push(normal.as_vec3());
        index
    }
}
