//! Occlusion of convex solids with few flat faces, in closed form: from outside such a solid blocks what those of its
//! faces block that the eye is in front of, and they do not overlap; its outline is the convex hull of its corners.

use super::samples::Sample;
use super::triangles::{distinct, unit_positions};
use crate::asset::Mesh;
use crate::field::silhouette::{MapFrame, REACH, encode};
use crate::sh::polygon::{POLYGON_COEFFICIENTS, polygon};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Most faces. A box takes a tenth of the time of captures, and a solid of so many half of it.
const MOST_FACES: usize = 24;
/// How far vertices of a face may lie from its plane, in r, and its triangles' normals from each other.
const FLAT: f64 = 1e-5;
/// How far corners may lie from an edge of the outline, in r, and be on it: those of faces that are seen edge-on.
const ON_EDGE: f64 = 1e-5;

pub(super) struct Polyhedron {
    faces: Vec<Face>,
}

struct Face {
    /// Outward unit normal, and the plane's distance from the centre along it, in r.
    normal: DVec3,
    offset: f64,
    /// In r from the centre, in order around the face.
    corners: Vec<DVec3>,
}

impl Polyhedron {
    /// The faces of a mesh; `None` where it is not convex or has too many.
    pub fn new(mesh: &Mesh) -> Option<Self> {
        if !mesh.is_convex() {
            return None;
        }
        let positions: Vec<DVec3> = unit_positions(mesh).iter().map(|p| p.as_dvec3()).collect();
        let mut faces: Vec<Face> = Vec::new();
        for triangle in distinct(mesh).iter() {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let is_in = |face: &Face| {
                face.normal.distance(normal) < FLAT && [a, b, c].iter().all(|p| face.height(*p).abs() < FLAT)
            };
            match faces.iter().position(is_in) {
                Some(face) => faces[face].corners.extend([a, b, c]),
                None if faces.len() == MOST_FACES => return None,
                None => faces.push(Face { normal, offset: normal.dot(a), corners: vec![a, b, c] }),
            }
        }
        for face in &mut faces {
            face.corners = around(face.normal, std::mem::take(&mut face.corners));
        }
        Some(Polyhedron { faces })
    }

    /// Coefficients of the blocked part at samples, one after another, `stride` floats each.
    pub fn coefficients(&self, samples: &[Sample], bands: usize, stride: usize) -> Vec<f32> {
        let mut coefficients = vec![0.0; samples.len() * stride];
        coefficients.par_chunks_exact_mut(stride).zip(samples).for_each(|(out, sample)| {
            let blocked = self.blocked(sample.eye.as_dvec3());
            for (to, from) in out.iter_mut().zip(&blocked[..bands * bands]) {
                *to = (from * f64::from(sample.scale)) as f32;
            }
        });
        coefficients
    }

    fn blocked(&self, eye: DVec3) -> [f64; POLYGON_COEFFICIENTS] {
        let mut blocked = [0.0; POLYGON_COEFFICIENTS];
        for face in self.faces.iter().filter(|face| face.height(eye) > 0.0) {
            let corners: Vec<DVec3> = face.corners.iter().map(|corner| *corner - eye).collect();
            blocked.iter_mut().zip(polygon(&corners)).for_each(|(sum, of_face)| *sum += of_face);
        }
        blocked
    }
}

impl Polyhedron {
    /// The map of an outline, bytes of distance and depth: what the pass "silhouette" makes of pixels.
    pub fn outline(&self, frame: &MapFrame, map_px: u32) -> Vec<[u8; 2]> {
        let corners: Vec<DVec3> = self.faces.iter().flat_map(|face| face.corners.iter().copied()).collect();
        let hull = around(frame.direction, corners.clone());
        let edges: Vec<OutlineEdge> = (0..hull.len())
            .filter_map(|i| OutlineEdge::new(hull[i], hull[(i + 1) % hull.len()], &corners, frame))
            .collect();
        let centre =
            corners.iter().map(|corner| frame.place(*corner) * frame.half).sum::<DVec2>() / corners.len() as f64;
        let at = |i: u32| (2.0 * f64::from(i) + 1.0) / f64::from(map_px) - 1.0;
        let texel = |i: u32| {
            let place = DVec2::new(at(i % map_px), at(i / map_px)) * frame.half;
            let distances: Vec<f64> = edges.iter().map(|edge| edge.distance(place)).collect();
            let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
            // Outlines have places from which several of their points are equally near.
            let nearest = edges.iter().zip(&distances).filter(|(_, distance)| **distance <= least * (1.0 + 1e-9));
            let depths: Vec<f64> = nearest.map(|(edge, _)| edge.depth(place)).collect();
            let depth = depths.iter().sum::<f64>() / depths.len().max(1) as f64;
            let inside = edges.iter().all(|edge| edge.side(place) * edge.side(centre) >= 0.0);
            [encode(if inside { least } else { -least }, REACH), encode(depth, 1.0)]
        };
        (0..map_px * map_px).map(texel).collect()
    }
}

/// A straight part of an outline, in the plane of its map, in r.
struct OutlineEdge {
    from: DVec2,
    along: DVec2,
    length: f64,
    /// Corners of the solid on it: how far along they lie, and how deep.
    corners: Vec<[f64; 2]>,
}

impl OutlineEdge {
    /// `None` between corners that lie behind each other.
    fn new(from: DVec3, to: DVec3, corners: &[DVec3], frame: &MapFrame) -> Option<Self> {
        let place = |p: DVec3| frame.place(p) * frame.half;
        let length = place(from).distance(place(to));
        if length < ON_EDGE {
            return None;
        }
        let from = place(from);
        let along = (place(to) - from) / length;
        let on = |corner: &DVec3| {
            let off = place(*corner) - from;
            let far = along.dot(off);
            let is_on = along.perp_dot(off).abs() < ON_EDGE && (-ON_EDGE..length + ON_EDGE).contains(&far);
            is_on.then(|| [far, corner.dot(frame.direction)])
        };
        Some(OutlineEdge { from, along, length, corners: corners.iter().filter_map(on).collect() })
    }

    /// How far along the edge its point lies that is nearest to a place.
    fn nearest(&self, place: DVec2) -> f64 {
        self.along.dot(place - self.from).clamp(0.0, self.length)
    }

    fn distance(&self, place: DVec2) -> f64 {
        place.distance(self.from + self.nearest(place) * self.along)
    }

    /// Which side of the edge's line a place lies on.
    fn side(&self, place: DVec2) -> f64 {
        self.along.perp_dot(place - self.from)
    }

    /// Middle between the nearest and the farthest surface at the point that is nearest to a place.
    fn depth(&self, place: DVec2) -> f64 {
        let at = self.nearest(place);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for (i, [a, near]) in self.corners.iter().enumerate() {
            for [b, far] in &self.corners[i..] {
                if at < a.min(*b) - ON_EDGE || at > a.max(*b) + ON_EDGE {
                    continue;
                }
                let is_one_place = (a - b).abs() < ON_EDGE;
                let depths = if is_one_place { [*near, *far] } else { [near + (far - near) * (at - a) / (b - a); 2] };
                range = [range[0].min(depths[0]).min(depths[1]), range[1].max(depths[0]).max(depths[1])];
            }
        }
        (range[0] + range[1]) / 2.0
    }
}

impl Face {
    fn height(&self, place: DVec3) -> f64 {
        self.normal.dot(place) - self.offset
    }
}

/// The corners of the convex hull of places in a plane, in order: by the monotone chain of Andrew, *Another Efficient
/// Algorithm for Convex Hulls in Two Dimensions*, 1979.
fn around(normal: DVec3, mut places: Vec<DVec3>) -> Vec<DVec3> {
    let (x, y) = normal.any_orthonormal_pair();
    let flat = |p: &DVec3| DVec2::new(p.dot(x), p.dot(y));
    places.sort_by(|a, b| (flat(a).x, flat(a).y).partial_cmp(&(flat(b).x, flat(b).y)).expect("positions are finite"));
    let half = |places: &mut dyn Iterator<Item = &DVec3>| {
        let mut hull: Vec<DVec3> = Vec::new();
        for &place in places {
            while let [.., a, b] = hull[..]
                && (flat(&b) - flat(&a)).perp_dot(flat(&place) - flat(&b)) <= 1e-12
            {
                hull.pop();
            }
            hull.push(place);
        }
        // The other half begins with it.
        hull.pop();
        hull
    };
    [half(&mut places.iter()), half(&mut places.iter().rev())].concat()
}

#[cfg(test)]
mod tests {
    use super::super::silhouette::silhouette_twin;
    use super::*;
    use crate::asset::generate;
    use crate::field::silhouette::Side;
    use crate::sh::basis::{Y00, values};

    #[test]
    fn a_box_blocks_what_rays_meet() {
        let mesh = generate::cuboid(glam::Vec3::new(1.0, 0.4, 0.7), 3);
        let solid = Polyhedron::new(&mesh).unwrap();
        assert_eq!(solid.faces.len(), 6);
        assert!(solid.faces.iter().all(|face| face.corners.len() == 4));
        let mut rng = fastrand::Rng::with_seed(4);
        let half = DVec3::new(1.0, 0.4, 0.7) / DVec3::new(1.0, 0.4, 0.7).length();
        for eye in [DVec3::new(1.1, 0.2, 0.3), DVec3::new(-0.2, 0.35, 0.1), DVec3::new(2.0, -3.0, 1.0)] {
            let found = solid.blocked(eye);
            let mut wanted = [0.0; POLYGON_COEFFICIENTS];
            const RAYS: usize = 200_000;
            for _ in 0..RAYS {
                let z = 2.0 * rng.f64() - 1.0;
                let turn = std::f64::consts::TAU * rng.f64();
                let flat = (1.0 - z * z).sqrt();
                let way = DVec3::new(flat * turn.cos(), flat * turn.sin(), z);
                let [one, other] = [(-half - eye) / way, (half - eye) / way];
                let hit = one.min(other).max_element() < one.max(other).min_element().max(0.0);
                if hit && one.max(other).min_element() > 0.0 {
                    let y = values(4, way);
                    wanted.iter_mut().zip(y).for_each(|(sum, y)| *sum += y * 4.0 * std::f64::consts::PI / RAYS as f64);
                }
            }
            for (found, wanted) in found.iter().zip(&wanted) {
                assert!((found - wanted).abs() < 0.02, "{eye}: {found}, {wanted}");
            }
            assert!(found[0] > 0.1 * Y00, "{eye}: it blocks something");
        }
    }

    #[test]
    fn what_is_round_or_not_convex_is_none() {
        assert!(Polyhedron::new(&generate::sphere(1.0, 3)).is_none());
        assert!(Polyhedron::new(&generate::torus(1.0, 0.3, 12, 8)).is_none());
    }

    /// Also along faces that are seen edge-on, whose middle depth counts.
    #[test]
    fn outlines_are_those_of_fine_views() {
        let prism = generate::cuboid(glam::Vec3::new(1.0, 0.3, 0.7), 2);
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 0.9, 0.0], [0.3, 0.2, 0.8]].map(glam::Vec3::from);
        let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let tetrahedron = Mesh::new("tetrahedron", corners.to_vec(), Vec::new(), None, triangles).unwrap();
        for mesh in [prism, tetrahedron] {
            let solid = Polyhedron::new(&mesh).unwrap();
            let positions: Vec<DVec3> = unit_positions(&mesh).iter().map(|p| p.as_dvec3()).collect();
            for direction in [[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.3, -0.5, 0.8], [-1.0, -0.2, 0.0]] {
                let frame = MapFrame::around(DVec3::from(direction).normalize(), &positions);
                let twin = silhouette_twin(&mesh, (&frame, Side::Whole), 16, 512);
                let found = solid.outline(&frame, 16);
                let apart = |kind: usize| {
                    let steps = |(a, b): (&[u8; 2], &[u8; 2])| {
                        (i32::from(a[kind].cast_signed()) - i32::from(b[kind].cast_signed())).abs()
                    };
                    found.iter().zip(&twin).map(steps).collect::<Vec<_>>()
                };
                assert!(apart(0).iter().all(|steps| *steps <= 1), "{} along {direction:?}: {:?}", mesh.name, apart(0));
                let off = apart(1).iter().filter(|steps| **steps > 3).count();
                assert!(off <= 8, "{} along {direction:?}: depths of {off} texels: {:?}", mesh.name, apart(1));
            }
        }
    }
}
