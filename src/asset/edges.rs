//! Edges of a mesh, and which of them a picture shows as lines: outlines and creases.

use super::Mesh;
use super::topology::{HalfEdge, edges, next_corner, sides, weld};
use glam::{DMat3, DMat4, DVec3, DVec4};

/// Two normals at one position whose cosine is below this (5 degrees) form a crease.
const CREASE_COSINE: f32 = 0.996;
/// Faces with a sine up to this between them lie in one plane, and their edge is never seen. It allows for the rounding
/// of f32 positions.
const COPLANAR_SINE: f64 = 1e-5;

#[derive(Clone, Copy, PartialEq, Eq)]
enum EdgeKind {
    /// When exactly one of its two faces looks at the eye; `flipped` if their windings are opposite.
    Fold { flipped: bool },
    /// As a fold, and also when both faces are in view, because their shading differs.
    Crease { flipped: bool },
    /// Always, because it has one face or more than two.
    Border,
}

struct Edge {
    ends: [u32; 2],
    /// The corner of its first face that is no end of the edge.
    far: u32,
    faces: [u32; 2],
    kind: EdgeKind,
}

#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// End points in clip space, in front of the eye and within the picture.
    pub ends: [DVec4; 2],
    /// Side of its face, seen along the line from its first end to its second with x to the right and y down: positive
    /// is right. A crease also has a face on the other side.
    pub side: f64,
}

/// Edges of a mesh with the faces beside them.
pub struct Edges {
    /// Positions, metres from the centre of the bounding sphere. Vertices at one position are one corner, whatever
    /// their normals.
    corners: Vec<DVec3>,
    edges: Vec<Edge>,
    /// Plane of each face: normal, and the dot product of the normal with a point of the face.
    planes: Vec<(DVec3, f64)>,
}

impl Edges {
    /// Finds the edges of a mesh, without those between faces in one plane.
    pub fn new(mesh: &Mesh) -> Self {
        let (centre, _) = mesh.bounding_sphere();
        let (welded, distinct) = weld(&mesh.positions, &mesh.triangles);
        let corners: Vec<DVec3> = distinct.iter().map(|position| (*position - centre).as_dvec3()).collect();
        let planes = welded.chunks_exact(3).map(|triangle| {
            let [a, b, c] = [0, 1, 2].map(|k| corners[triangle[k] as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            (normal, normal.dot(a))
        });
        let planes: Vec<(DVec3, f64)> = planes.collect();
        // Vertices of the mesh at the ends of a side, in ascending order of the corners.
        let vertices = |side: &HalfEdge| {
            let corner = side.corner as usize;
            let pair = [corner, next_corner(corner)].map(|at| mesh.triangles[at / 3][at % 3] as usize);
            if side.reversed { [pair[1], pair[0]] } else { pair }
        };
        let differ = |[a, b]: [usize; 2]| {
            a != b
                && (mesh.normals[a].dot(mesh.normals[b]) < CREASE_COSINE
                    || mesh.colors.as_ref().is_some_and(|colors| colors[a] != colors[b]))
        };
        let edge = |sides: &[HalfEdge]| {
            let HalfEdge { low, high, corner, .. } = sides[0];
            let ends = [low, high];
            let far = welded[next_corner(next_corner(corner as usize))];
            let face = |side: &HalfEdge| side.corner / 3;
            let [one, other] = sides else {
                return Some(Edge { ends, far, faces: [face(&sides[0]); 2], kind: EdgeKind::Border });
            };
            let u = vertices(one);
            let v = vertices(other);
            let crease = differ([u[0], v[0]]) || differ([u[1], v[1]]);
            let flipped = one.reversed == other.reversed;
            let [m, n] = [one, other].map(|side| planes[face(side) as usize].0);
            let straight = m.cross(n).length() < COPLANAR_SINE && (m.dot(n) > 0.0) != flipped;
            let kind = if crease { EdgeKind::Crease { flipped } } else { EdgeKind::Fold { flipped } };
            (crease || !straight).then_some(Edge { ends, far, faces: [face(one), face(other)], kind })
        };
        let edges = edges(&sides(&welded)).filter_map(edge).collect();
        Edges { corners, edges, planes }
    }

    /// Silhouette and border edges as seen from `eye` (metres from the centre of the bounding sphere, in the mesh's
    /// frame), and with `creases` also the creases in view. Hidden edges are included.
    pub fn lines(&self, clip_from_object: DMat4, eye: DVec3, creases: bool) -> Vec<Line> {
        let seen: Vec<bool> = self.planes.iter().map(|(normal, offset)| normal.dot(eye) > *offset).collect();
        let place = |corner: u32| clip_from_object * self.corners[corner as usize].extend(1.0);
        let line = |edge: &Edge| {
            let [a, b] = edge.faces.map(|face| seen[face as usize]);
            let shown = match edge.kind {
                EdgeKind::Fold { flipped } => (a == b) == flipped,
                EdgeKind::Crease { flipped } => (a == b) == flipped || (creases && (a || b)),
                EdgeKind::Border => true,
            };
            if !shown {
                return None;
            }
            let ends = edge.ends.map(place);
            let [p, q, far] = [ends[0], ends[1], place(edge.far)].map(|c| DVec3::new(c.x, c.y, c.w));
            let side = DMat3::from_cols(p, q, far).determinant();
            clipped(ends).map(|ends| Line { ends, side })
        };
        self.edges.iter().filter_map(line).collect()
    }
}

/// How far within the picture's four sides, and in front of the eye, a place in clip coordinates lies.
pub(crate) fn within_picture(c: DVec4) -> [f64; 5] {
    [c.w - 1e-6, c.w - c.x, c.w + c.x, c.w - c.y, c.w + c.y]
}

/// The part of a segment in clip coordinates that lies in front of the eye and within the picture.
fn clipped([from, to]: [DVec4; 2]) -> Option<[DVec4; 2]> {
    let mut first = 0.0;
    let mut last = 1.0;
    for (a, b) in within_picture(from).into_iter().zip(within_picture(to)) {
        if a < 0.0 && b < 0.0 {
            return None;
        }
        let crossing = a / (a - b);
        if a < 0.0 {
            first = f64::max(first, crossing);
        } else if b < 0.0 {
            last = f64::min(last, crossing);
        }
    }
    (first < last).then(|| [first, last].map(|t| from.lerp(to, t)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::{cuboid, plane};
    use glam::Vec3;

    /// Clip space of a camera at the origin that looks along -z and sees 90 degrees.
    const CLIP: DMat4 = DMat4::from_cols_array_2d(&[
        [1.0, 0.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -1.0],
        [0.0, 0.0, 0.01, 0.0],
    ]);

    #[test]
    fn a_box_shows_its_creases_where_asked() {
        let edges = Edges::new(&cuboid(Vec3::ONE, 2));
        // Three faces are seen: six sides of the outline and three creases, two edges each.
        let place = DVec3::new(-1.0, -1.0, -4.0);
        let lines = |creases| edges.lines(CLIP * DMat4::from_translation(place), -place, creases);
        assert_eq!((lines(false).len(), lines(true).len()), (12, 18));
        // The middle of the picture of the box lies on its side of every outline.
        for line in lines(false) {
            let [p, q] = line.ends.map(|c| c.truncate() / c.w);
            let middle = CLIP * place.extend(1.0);
            let middle = middle.truncate() / middle.w;
            let turn = (q - p).truncate().perp_dot((middle - p).truncate());
            assert!(turn * line.side > 0.0, "{line:?}");
        }
    }

    /// A floor that is wider than the picture and reaches behind the eye shows its far edge alone, as far as that is seen.
    #[test]
    fn lines_end_at_the_edges_of_the_picture() {
        let place = DVec3::new(0.0, -1.0, 10.0);
        let lines = Edges::new(&plane(60.0, 1)).lines(CLIP * DMat4::from_translation(place), -place, false);
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert!(lines[0].ends.iter().all(|c| (c.w - 20.0).abs() < 1e-3 && (c.x.abs() / c.w - 1.0).abs() < 1e-6));
    }
}
