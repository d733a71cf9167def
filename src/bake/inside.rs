//! Which sample points lie inside the solid, by generalised winding number.
//!
//! Winding number: the mesh's signed solid angle over 4 pi; 1 inside and 0 outside a closed mesh, in between near the holes
//! of an open one (Jacobson, Kavan, Sorkine-Hornung, *Robust Inside-Outside Segmentation using Generalized Winding Numbers*,
//! SIGGRAPH 2013). Solid angle of a triangle: Van Oosterom, Strackee 1983, equation 8.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Above this a point counts as inside.
const THRESHOLD: f64 = 0.5;

/// Marks the points inside the mesh; positions and points in the same frame.
pub fn inside(positions: &[Vec3], triangles: &[[u32; 3]], points: &[DVec3]) -> Vec<bool> {
    let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    points
        .par_iter()
        .map(|&point| {
            let boxed = point.cmpge(low).all() && point.cmple(high).all();
            boxed && winding_number(positions, triangles, point) > THRESHOLD
        })
        .collect()
}

/// Generalised winding number of the mesh around a point.
pub fn winding_number(positions: &[Vec3], triangles: &[[u32; 3]], point: DVec3) -> f64 {
    let total: f64 = triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|i| positions[i as usize].as_dvec3() - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(denominator)
        })
        .sum();
    total / (4.0 * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    #[test]
    fn torus_is_solid_in_the_tube_and_empty_in_the_hole() {
        let mesh = generate::torus(1.0, 0.3, 48, 24);
        let at = |x: f64, y: f64| DVec3::new(x * 0.6, y, x * 0.8);
        let points = [at(1.0, 0.0), at(0.0, 0.0), at(1.0, 0.31), at(0.75, 0.1), at(1.29, 0.0), at(1.31, 0.0)];
        let found = inside(&mesh.positions, &mesh.triangles, &points);
        assert_eq!(found, [true, false, false, true, true, false]);
    }
}
