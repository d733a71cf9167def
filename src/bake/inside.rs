//! Finds the sample points that lie inside the solid, by their generalised winding number.
//!
//! A point counts as inside where the winding number is above one half (Jacobson, Kavan, Sorkine-Hornung, *Robust Inside-Outside
//! Segmentation using Generalized Winding Numbers*, SIGGRAPH 2013).

use super::TRANSFER_OFFSET;
use super::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;

/// Most points that a thread takes at a time. Points near the surface take far longer than those outside its box.
const TOGETHER: usize = 64;

/// Marks the points inside the mesh. Surface and points are in the same frame.
pub fn inside(surface: &Surface, points: &[DVec3]) -> Vec<bool> {
    points.par_iter().with_max_len(TOGETHER).map(|&point| surface.encloses(point)).collect()
}

/// For every marked point the nearest place that stands off the surface by [`TRANSFER_OFFSET`], from where something can be seen. It is
/// `None` for points that are not marked, and where that place lies inside as well because parts of the mesh run into each other.
///
/// An interpolation between such a sample and one outside takes the surface's own value at the surface. Receivers in a narrow gap
/// therefore find what is seen there.
pub fn pushed_out(surface: &Surface, points: &[DVec3], inside: &[bool]) -> Vec<Option<DVec3>> {
    let place = |(&point, &inside): (&DVec3, &bool)| {
        let on_surface = inside.then(|| surface.nearest(point)).flatten()?;
        let eye = on_surface + f64::from(TRANSFER_OFFSET) * (on_surface - point).try_normalize()?;
        (!surface.encloses(eye)).then_some(eye)
    };
    points.par_iter().zip(inside).with_max_len(TOGETHER).map(place).collect()
}

/// The point of a triangle nearest to the origin (Ericson, *Real-Time Collision Detection*, section 5.1.5, by regions). Bakes of large
/// meshes spend a quarter of their time here, so nothing is left to the inlining of closures.
pub fn nearest_on_triangle([a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let normal = ab.cross(c - a);
    let faces = normal != DVec3::ZERO
        && normal.dot(ab.cross(-a)) >= 0.0
        && normal.dot(bc.cross(-b)) >= 0.0
        && normal.dot(ca.cross(-c)) >= 0.0;
    if faces {
        let unit = normal.normalize();
        return a.dot(unit) * unit;
    }
    nearer(nearer(nearest_on_side(a, ab), nearest_on_side(b, bc)), nearest_on_side(c, ca))
}

#[inline]
fn nearest_on_side(from: DVec3, edge: DVec3) -> DVec3 {
    let t = (-from.dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    from + t * edge
}

#[inline]
fn nearer(a: DVec3, b: DVec3) -> DVec3 {
    if b.length_squared() < a.length_squared() { b } else { a }
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
        let found = inside(&Surface::new(&mesh.positions, &mesh.triangles), &points);
        assert_eq!(found, [true, false, false, true, true, false]);
    }
}
