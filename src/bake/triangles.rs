//! The corners of a mesh in the frame of captures, and its triangles that repeat others.

use crate::asset::Mesh;
use glam::{Vec3, Vec3A};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

/// Positions in units of the bounding radius from the sphere's centre.
pub fn unit_positions(mesh: &Mesh) -> Vec<Vec3> {
    let (centre, radius_m) = mesh.bounding_sphere();
    mesh.positions.iter().map(|p| ((p.as_dvec3() - centre.as_dvec3()) / f64::from(radius_m)).as_vec3()).collect()
}

/// Whether meshes are the same but for their place and size, within 1e-4 of the radius.
pub fn have_one_shape(a: &Mesh, b: &Mesh) -> bool {
    const SAME: f32 = 1e-4;
    let is_same = || unit_positions(a).iter().zip(unit_positions(b)).all(|(p, q)| p.abs_diff_eq(q, SAME));
    a.content_hash() == b.content_hash()
        || a.positions.len() == b.positions.len() && a.triangles == b.triangles && is_same()
}

/// The weights of the second and third corner of a triangle at a place of its plane, both given from the first corner.
pub fn weights(edges: [Vec3A; 2], place: Vec3A) -> [f32; 2] {
    let normal = edges[0].cross(edges[1]);
    let whole = normal.length_squared().max(f32::MIN_POSITIVE);
    [place.cross(edges[1]), edges[0].cross(place)].map(|part| part.dot(normal) / whole)
}

/// The triangles of a mesh without those that repeat another: with corners of the same place and colour, the same way
/// around. What is seen does not change. A tree cannot divide stacked triangles, so each query of a surface would look
/// at every one of them.
///
/// Of a closed mesh no triangle repeats another, since along each edge its surface runs once each way.
pub fn distinct(mesh: &Mesh) -> Cow<'_, [[u32; 3]]> {
    if mesh.is_closed() {
        return Cow::Borrowed(&mesh.triangles);
    }
    let mut first_of = HashMap::with_capacity(mesh.positions.len());
    let first: Vec<u32> = (0..mesh.positions.len())
        .map(|vertex| {
            let color = mesh.colors.as_ref().map(|colors| colors[vertex].to_array().map(f32::to_bits));
            let key = (mesh.positions[vertex].to_array().map(f32::to_bits), color);
            *first_of.entry(key).or_insert(vertex as u32)
        })
        .collect();
    let mut known = HashSet::with_capacity(mesh.triangles.len());
    let mut is_new = |triangle: &&[u32; 3]| {
        let mut corners = triangle.map(|vertex| first[vertex as usize]);
        let least = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
        corners.rotate_left(least);
        known.insert(corners)
    };
    let kept: Vec<[u32; 3]> = mesh.triangles.iter().filter(|triangle| is_new(triangle)).copied().collect();
    if kept.len() == mesh.triangles.len() { Cow::Borrowed(&mesh.triangles) } else { Cow::Owned(kept) }
}

/// Says in one line how many triangles of a mesh repeat others, if any do.
pub(super) fn tell_repeated(mesh: &Mesh) {
    let repeated = mesh.triangles.len() - distinct(mesh).len();
    if repeated > 0 {
        log::warn!("{}: {repeated} of {} triangles repeat others and count once", mesh.name, mesh.triangles.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    #[test]
    fn meshes_of_one_shape_differ_in_place_and_size() {
        let torus = generate::torus(1.0, 0.3, 24, 12);
        let moved = |place: fn(Vec3) -> Vec3| {
            let places = torus.positions.iter().map(|p| place(*p)).collect();
            Mesh::new("moved", places, Vec::new(), None, torus.triangles.clone()).unwrap()
        };
        assert!(have_one_shape(&torus, &moved(|p| 0.7 * p + Vec3::new(3.0, -20.0, 5.0))));
        assert!(!have_one_shape(&torus, &moved(|p| p * Vec3::new(1.0, 1.01, 1.0))));
        assert!(!have_one_shape(&torus, &generate::torus(1.0, 0.3, 12, 24)));
    }

    #[test]
    fn repeated_triangles_count_once_and_backs_stay() {
        let square = [Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y].to_vec();
        let triangles = [[0, 1, 2], [1, 2, 0], [0, 2, 3], [0, 1, 2], [2, 1, 0]];
        let mesh = Mesh::new("square", square, Vec::new(), None, triangles.to_vec()).unwrap();
        assert_eq!(distinct(&mesh).len(), 3, "one is turned around its corners, one is the same, one shows its back");
        let ring = generate::torus(1.0, 0.3, 24, 12);
        assert!(matches!(distinct(&ring), Cow::Borrowed(_)));
        // A closed mesh of which one triangle is repeated is closed no more.
        let again = [ring.triangles.as_slice(), &[ring.triangles[7]]].concat();
        let ring_again = Mesh::new("ring", ring.positions.clone(), Vec::new(), None, again).unwrap();
        assert!(ring.is_closed() && !ring_again.is_closed());
        assert_eq!(distinct(&ring_again).len(), ring.triangles.len());
        // Vertices of their own at the same places change nothing; another colour does.
        let twice = |other: Vec3| {
            let positions = [Vec3::ZERO, Vec3::X, Vec3::Y].repeat(2);
            let colors = [[Vec3::ONE; 3], [other; 3]].concat();
            let mesh = Mesh::new("twice", positions, Vec::new(), Some(colors), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
            distinct(&mesh).len()
        };
        assert_eq!((twice(Vec3::ONE), twice(Vec3::X)), (1, 2));
    }
}
