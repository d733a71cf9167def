//! Which sample points lie inside the solid, by generalised winding number.
//!
//! Winding number: the mesh's signed solid angle over 4 pi; 1 inside and 0 outside a closed mesh, in between near the holes
//! of an open one (Jacobson, Kavan, Sorkine-Hornung, *Robust Inside-Outside Segmentation using Generalized Winding Numbers*,
//! SIGGRAPH 2013). Solid angle of a triangle: Van Oosterom, Strackee 1983, equation 8.

use super::TRANSFER_OFFSET;
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

/// For every marked point the place nearest to it that stands off the surface by [`TRANSFER_OFFSET`], where something can be seen; `None` where that lies
/// inside as well (parts of the mesh that run into each other), and for points that are not marked.
///
/// What is interpolated between such a sample and one outside has the surface's own value at the surface, so receivers in a
/// narrow gap find what is seen there.
pub fn pushed_out(positions: &[Vec3], triangles: &[[u32; 3]], points: &[DVec3], inside: &[bool]) -> Vec<Option<DVec3>> {
    let corners: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.map(|i| positions[i as usize].as_dvec3())).collect();
    let place = |(&point, &inside): (&DVec3, &bool)| {
        let on_surface = inside.then(|| nearest_on_surface(&corners, point)).flatten()?;
        let eye = on_surface + f64::from(TRANSFER_OFFSET) * (on_surface - point).try_normalize()?;
        (winding_number(positions, triangles, eye) <= THRESHOLD).then_some(eye)
    };
    points.par_iter().zip(inside).map(place).collect()
}

/// The nearest of all points on the triangles; `None` without any.
fn nearest_on_surface(triangles: &[[DVec3; 3]], point: DVec3) -> Option<DVec3> {
    let on = triangles.iter().map(|t| nearest_on_triangle(t.map(|corner| corner - point)) + point);
    on.min_by(|a, b| a.distance_squared(point).total_cmp(&b.distance_squared(point)))
}

/// The point of a triangle nearest to the origin (Ericson, *Real-Time Collision Detection*, section 5.1.5, by regions).
pub fn nearest_on_triangle([a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let along = |from: DVec3, edge: DVec3| {
        let t = (-from.dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        from + t * edge
    };
    let sides = [(a, ab), (b, c - b), (c, a - c)];
    if normal != DVec3::ZERO && sides.iter().all(|(from, edge)| normal.dot(edge.cross(-*from)) >= 0.0) {
        let unit = normal.normalize();
        return a.dot(unit) * unit;
    }
    let ends = sides.map(|(from, edge)| along(from, edge));
    ends.into_iter().min_by(|a, b| a.length_squared().total_cmp(&b.length_squared())).expect("three sides")
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
