//! The surface of a mesh, which answers how near it is to a point and whether it encloses a point. It is a tree of
//! neighbouring triangles, so that most of them are judged together.
//!
//! The winding number is the mesh's signed solid angle over 4 pi. A node whose distance is large against its size counts
//! as a dipole: the sum of its area normals at its middle. This follows Barill, Dickson, Schmidt, Levin, Jacobson, *Fast
//! Winding Numbers for Soups and Clouds*, SIGGRAPH 2018, equation 11.

use super::TRANSFER_OFFSET;
use super::chunk::morton;
use crate::asset::topology::solid_angle;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;

const LEAF_TRIANGLES: usize = 8;
/// A node counts as a dipole from this many of its radii on. What that leaves out is of second order, about a hundredth
/// of its share, and the question is only whether the sum is nearer to 0 or to 1.
const FAR: f64 = 5.0;
/// A point lies inside if its winding number is above this.
const INSIDE: f64 = 0.5;

/// Neighbouring triangles with the sphere around them.
struct SurfaceNode {
    triangles: Range<usize>,
    centre: DVec3,
    radius: f64,
    /// Corners of the box around them, which fits them more closely.
    low: DVec3,
    high: DVec3,
    /// Sum of normals as long as the triangles' areas.
    dipole: DVec3,
    /// Index of the second child; the first child comes next. It is 0 for a leaf.
    second: usize,
}

pub struct Surface {
    triangles: Vec<[DVec3; 3]>,
    nodes: Vec<SurfaceNode>,
}

impl Surface {
    /// The surface of a mesh whose positions lie within the unit sphere (see [`super::triangles::unit_positions`]).
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut order = triangles.to_vec();
        // Along a space-filling curve.
        order.par_sort_by_cached_key(|t| morton(t.iter().map(|i| positions[*i as usize]).sum::<Vec3>() / 3.0));
        let triangles: Vec<[DVec3; 3]> = order.iter().map(|t| t.map(|i| positions[i as usize].as_dvec3())).collect();
        let mut surface = Surface { triangles, nodes: Vec::new() };
        if !surface.triangles.is_empty() {
            surface.build(0..surface.triangles.len());
        }
        surface
    }

    fn build(&mut self, range: Range<usize>) {
        let within = &self.triangles[range.clone()];
        let corners = || within.iter().flatten().copied();
        let low = corners().fold(DVec3::MAX, DVec3::min);
        let high = corners().fold(DVec3::MIN, DVec3::max);
        let centre = (low + high) / 2.0;
        let radius = corners().map(|p| p.distance(centre)).fold(0.0, f64::max);
        let dipole = within.iter().map(|[a, b, c]| (b - a).cross(c - a) / 2.0).sum();
        let node = self.nodes.len();
        self.nodes.push(SurfaceNode { triangles: range.clone(), centre, radius, low, high, dipole, second: 0 });
        if range.len() > LEAF_TRIANGLES {
            let middle = range.start + range.len() / 2;
            self.build(range.start..middle);
            self.nodes[node].second = self.nodes.len();
            self.build(middle..range.end);
        }
    }

    /// The point of the surface nearest to `point`, or `None` if there are no triangles.
    pub fn nearest(&self, point: DVec3) -> Option<DVec3> {
        let mut best = (f64::INFINITY, DVec3::ZERO);
        let bound = |node: usize| point.distance(self.nodes[node].centre) - self.nodes[node].radius;
        let mut open = Vec::with_capacity(64);
        open.extend((!self.nodes.is_empty()).then(|| (bound(0), 0)));
        while let Some((least, index)) = open.pop() {
            if least >= best.0 {
                continue;
            }
            let node = &self.nodes[index];
            // The margin covers rounding.
            if point.clamp(node.low, node.high).distance(point) - 1e-12 >= best.0 {
                continue;
            }
            if node.second == 0 {
                for [a, b, c] in &self.triangles[node.triangles.clone()] {
                    let towards = nearest_on_triangle([a - point, b - point, c - point]);
                    let distance = towards.length();
                    if distance < best.0 {
                        best = (distance, point + towards);
                    }
                }
            } else {
                // The nearer child is looked into first.
                let first = (bound(index + 1), index + 1);
                let second = (bound(node.second), node.second);
                open.extend(if first.0 < second.0 { [second, first] } else { [first, second] });
            }
        }
        (best.0 < f64::INFINITY).then_some(best.1)
    }

    /// Whether a point lies inside the solid that the surface bounds.
    pub fn encloses(&self, point: DVec3) -> bool {
        let is_boxed = |all: &SurfaceNode| point.cmpge(all.low).all() && point.cmple(all.high).all();
        self.nodes.first().is_some_and(is_boxed) && self.winding_number(point) > INSIDE
    }

    /// The generalised winding number around a point. It is 1 inside and 0 outside a closed mesh, and in between near
    /// the holes of an open mesh.
    pub fn winding_number(&self, point: DVec3) -> f64 {
        let mut total = 0.0;
        let mut index = 0;
        let mut open = Vec::with_capacity(64);
        while let Some(node) = self.nodes.get(index) {
            let q = node.centre - point;
            let distance = q.length();
            let far = distance > FAR * node.radius;
            if far {
                total += q.dot(node.dipole) / distance.powi(3);
            } else if node.second == 0 {
                let leaf = &self.triangles[node.triangles.clone()];
                total += leaf.iter().map(|[a, b, c]| solid_angle([a - point, b - point, c - point])).sum::<f64>();
            } else {
                open.push(node.second);
                index += 1;
                continue;
            }
            index = open.pop().unwrap_or(usize::MAX);
        }
        total / (4.0 * PI)
    }
}

/// The distance of a surface from the origin, if it encloses the origin. One pass over all triangles takes less than a
/// tree does for one question.
pub fn depth_at_origin(triangles: &[[DVec3; 3]]) -> Option<f64> {
    // Shares of a fixed length are summed in order, so that the sum is the same on any number of threads.
    let share = |part: &[[DVec3; 3]]| {
        let nearest = part.iter().map(|t| nearest_on_triangle(*t).length()).fold(f64::INFINITY, f64::min);
        (part.iter().map(|t| solid_angle(*t)).sum::<f64>(), nearest)
    };
    let shares: Vec<(f64, f64)> = triangles.par_chunks(4096).map(share).collect();
    let winding = shares.iter().map(|(angle, _)| angle).sum::<f64>() / (4.0 * PI);
    (winding > INSIDE).then(|| shares.iter().map(|(_, nearest)| *nearest).fold(f64::INFINITY, f64::min))
}

/// Most points that a thread takes at a time. Points near the surface take far longer than those outside its box.
const TOGETHER: usize = 64;

/// Marks the points inside the mesh. Surface and points are in the same frame.
pub fn inside(surface: &Surface, points: &[DVec3]) -> Vec<bool> {
    points.par_iter().with_max_len(TOGETHER).map(|&point| surface.encloses(point)).collect()
}

/// For every marked point the nearest place that stands off the surface by [`TRANSFER_OFFSET`], from where something
/// can be seen. It is `None` for points that are not marked, and where that place lies inside as well because parts of
/// the mesh run into each other.
///
/// An interpolation between such a sample and one outside takes the surface's own value at the surface. Receivers in a
/// narrow gap therefore find what is seen there.
pub fn pushed_out(surface: &Surface, points: &[DVec3], inside: &[bool]) -> Vec<Option<DVec3>> {
    let place = |(&point, &inside): (&DVec3, &bool)| {
        let on_surface = inside.then(|| surface.nearest(point)).flatten()?;
        let eye = on_surface + f64::from(TRANSFER_OFFSET) * (on_surface - point).try_normalize()?;
        (!surface.encloses(eye)).then_some(eye)
    };
    points.par_iter().zip(inside).with_max_len(TOGETHER).map(place).collect()
}

/// The point of a triangle nearest to the origin (Ericson, *Real-Time Collision Detection*, section 5.1.5, by regions).
/// Bakes of large meshes spend a quarter of their time here, so nothing is left to the inlining of closures.
pub fn nearest_on_triangle([a, b, c]: [DVec3; 3]) -> DVec3 {
    let ab = b - a;
    let bc = c - b;
    let ca = a - c;
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
    use crate::bake::triangles::unit_positions;

    #[test]
    fn the_tree_agrees_with_single_triangles() {
        let mesh = generate::torus(1.0, 0.3, 48, 24);
        let unit = unit_positions(&mesh);
        let surface = Surface::new(&unit, &mesh.triangles);
        let corners: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|t| t.map(|i| unit[i as usize].as_dvec3())).collect();
        let mut rng = fastrand::Rng::with_seed(3);
        let mut inside = 0;
        for _ in 0..500 {
            let p = DVec3::from_array([(); 3].map(|()| 2.4 * (rng.f64() - 0.5)));
            let moved: Vec<[DVec3; 3]> = corners.iter().map(|t| t.map(|c| c - p)).collect();
            let distance = moved.iter().map(|t| nearest_on_triangle(*t).length()).fold(f64::INFINITY, f64::min);
            assert!((surface.nearest(p).unwrap().distance(p) - distance).abs() < 1e-12, "{p}");
            let exact = moved.iter().map(|t| solid_angle(*t)).sum::<f64>() / (4.0 * PI);
            assert!((surface.winding_number(p) - exact).abs() < 0.02, "{p}: {exact}");
            inside += usize::from(exact > 0.5);
            let depth = depth_at_origin(&moved);
            assert_eq!(depth.is_some(), exact > 0.5, "{p}");
            assert!(depth.is_none_or(|depth| (depth - distance).abs() < 1e-12), "{p}");
        }
        assert!((20..480).contains(&inside), "{inside}");
    }

    #[test]
    fn torus_is_solid_in_the_tube_and_empty_in_the_hole() {
        let mesh = generate::torus(1.0, 0.3, 48, 24);
        let at = |x: f64, y: f64| DVec3::new(x * 0.6, y, x * 0.8);
        let points = [at(1.0, 0.0), at(0.0, 0.0), at(1.0, 0.31), at(0.75, 0.1), at(1.29, 0.0), at(1.31, 0.0)];
        let found = inside(&Surface::new(&mesh.positions, &mesh.triangles), &points);
        assert_eq!(found, [true, false, false, true, true, false]);
    }
}
