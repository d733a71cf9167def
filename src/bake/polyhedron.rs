//! Occlusion of convex solids with few flat faces, in closed form: from outside such a solid blocks what those of its
//! faces block that the eye is in front of, and they do not overlap.

use super::samples::Sample;
use super::triangles::{distinct, unit_positions};
use crate::asset::Mesh;
use crate::sh::polygon::{POLYGON_COEFFICIENTS, polygon};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Most faces. A box takes a tenth of the time of captures, and a solid of so many half of it.
const MOST_FACES: usize = 24;
/// How far vertices of a face may lie from its plane, in r, and its triangles' normals from each other.
const FLAT: f64 = 1e-5;

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
    use super::*;
    use crate::asset::generate;
    use crate::field::silhouette::through_box;
    use crate::sh::basis::{Y00, values};
    use crate::sh::quadrature::random_direction;

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
                let way = random_direction(&mut rng);
                if through_box([-half, half], eye, way).is_some_and(|[_, leaves]| leaves > 0.0) {
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
}
