//! Topology of a mesh after equal positions are welded.

use std::collections::{BTreeMap, HashMap};

use super::enclose;
use glam::{DVec3, Vec3};

/// Properties of a surface on which the bake depends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Topology {
    /// 2-manifold without boundary, wound consistently, positive volume.
    pub closed: bool,
    /// Closed, and every piece has positive volume: from outside no back face is seen, unless a piece intersects
    /// itself.
    pub solid: bool,
    /// Closed, in one piece, Euler characteristic 2, no edge bends inwards.
    pub convex: bool,
    /// Unit normal of the plane in which all vertices lie, if they do.
    pub plane: Option<DVec3>,
    pub euler_characteristic: i64,
}

/// Largest distance of a vertex from the plane of a flat mesh, relative to the bounding radius: a few f32 roundings.
const FLAT_TOLERANCE: f64 = 1e-5;
/// Largest displacement of a vertex by f32 rounding, relative to the bounding radius, with a factor of 4 for rotated
/// files.
const VERTEX_NOISE: f64 = 5e-7;

/// Depth of the dents that a convex body may have, relative to its bounding radius: the balls that modelling programs make
/// have dents of 6e-7. The second is relative to its farthest coordinate, whose rounding dents a body that stands far from
/// the origin, but no more than the third, of the radius again.
const DENTS: [f64; 3] = [2e-6, 4e-7, 1e-3];

/// Steps of a full turn in which sides around an edge are told apart.
const ANGLE_STEPS: f64 = 4096.0;

/// One side of a triangle: `corner` is 3 * triangle + k, the side runs from that corner to the next one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct HalfEdge {
    pub low: u32,
    pub high: u32,
    pub reversed: bool,
    pub corner: u32,
}

/// Classifies the surface. `triangles` have three different positions each; `radius_m` is that of the bounding sphere.
pub fn shape(positions: &[Vec3], triangles: &[[u32; 3]], centre: Vec3, radius_m: f32) -> Topology {
    let (corners, distinct) = weld(positions, triangles);
    let sides = sides(&corners);
    let vertex_count = distinct.len();
    let edges: Vec<&[HalfEdge]> = edges(&sides).collect();
    let euler_characteristic = vertex_count as i64 - edges.len() as i64 + triangles.len() as i64;

    // Sorted, so that the side that runs from low to high stands first.
    let paired = edges.iter().all(|e| e.len() == 2 && !e[0].reversed && e[1].reversed);
    let closed = paired
        && fan_count(&edges, corners.len()) == vertex_count
        && volume_m3(positions, triangles, centre) > VERTEX_NOISE * f64::from(radius_m).powi(3);
    let solid = closed && has_solid_pieces(&edges, positions, triangles, centre);
    let dent_m = deepest_dent_m(positions, f64::from(radius_m));
    let convex = closed
        && euler_characteristic == 2
        && pieces(&edges, triangles.len()).count == 1
        && edges.iter().all(|e| bends_outwards(e, positions, triangles, dent_m));
    Topology { closed, solid, convex, plane: plane(positions, f64::from(radius_m)), euler_characteristic }
}

/// Depth of the dents that a convex body of these vertices may have, see [`DENTS`].
fn deepest_dent_m(positions: &[Vec3], radius_m: f64) -> f64 {
    let farthest = positions.iter().fold(0.0_f32, |most, p| most.max(p.abs().max_element()));
    (DENTS[0] * radius_m).max((DENTS[1] * f64::from(farthest)).min(DENTS[2] * radius_m))
}

/// A few triangles of many by themselves: the positions of their corners, three a triangle.
pub fn apart(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corners = triangles.iter().flatten().map(|v| positions[*v as usize]).collect();
    (corners, (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}

/// Classifies a few triangles of many.
fn shape_of_part(positions: &[Vec3], triangles: &[[u32; 3]]) -> Option<Topology> {
    let (corners, apart) = apart(positions, triangles);
    let (centre, radius_m) = enclose::bounding_sphere(&corners);
    (radius_m > 0.0).then(|| shape(&corners, &apart, centre, radius_m))
}

/// Whether a few triangles of many are a convex solid.
pub fn is_convex(positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    shape_of_part(positions, triangles).is_some_and(|shape| shape.convex)
}

/// Whether a few triangles of many are closed, outwards or inside out.
pub fn is_closed_either_way(positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    let inside_out: Vec<[u32; 3]> = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let is_closed = |of: &[[u32; 3]]| shape_of_part(positions, of).is_some_and(|shape| shape.closed);
    is_closed(triangles) || is_closed(&inside_out)
}

/// Signed volume in cubic metres: the sum of the tetrahedra from `centre` to every triangle.
pub fn volume_m3(positions: &[Vec3], triangles: &[[u32; 3]], centre: Vec3) -> f64 {
    triangles.iter().map(|triangle| tetrahedron_m3(positions, triangle, centre)).sum()
}

/// How often a closed surface winds around a point: the solid angle that its triangles fill as seen from there, over that
/// of a whole view.
pub fn winding(positions: &[Vec3], triangles: &[[u32; 3]], point: DVec3) -> f64 {
    let of_triangle = |triangle: &[u32; 3]| solid_angle(triangle.map(|i| positions[i as usize].as_dvec3() - point));
    triangles.iter().map(of_triangle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// Signed solid angle of a triangle seen from the origin, positive if the back is seen (Van Oosterom and Strackee, *The
/// Solid Angle of a Plane Triangle*, 1983, equation 8).
#[inline]
pub(crate) fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [x, y, z] = [a.length(), b.length(), c.length()];
    2.0 * a.dot(b.cross(c)).atan2(x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y)
}

fn tetrahedron_m3(positions: &[Vec3], triangle: &[u32; 3], centre: Vec3) -> f64 {
    let [a, b, c] = triangle.map(|i| positions[i as usize].as_dvec3() - centre.as_dvec3());
    a.dot(b.cross(c)) / 6.0
}

/// Numbers equal positions alike (-0 is 0): the numbers of every triangle's corners, and the position of every number.
pub(super) fn weld(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<Vec3>) {
    let mut numbers = HashMap::with_capacity(positions.len());
    let mut distinct = Vec::new();
    let number = |p: &Vec3| {
        *numbers.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
            distinct.push(*p);
            distinct.len() as u32 - 1
        })
    };
    let welded: Vec<u32> = positions.iter().map(number).collect();
    (triangles.iter().flatten().map(|&i| welded[i as usize]).collect(), distinct)
}

pub(super) fn sides(corners: &[u32]) -> Vec<HalfEdge> {
    let mut sides: Vec<HalfEdge> = (0..corners.len()).map(|corner| side(corners, corner)).collect();
    sides.sort_unstable();
    sides
}

pub(super) fn edges(sides: &[HalfEdge]) -> impl Iterator<Item = &[HalfEdge]> {
    sides.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high))
}

pub(super) fn next_corner(corner: usize) -> usize {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

fn side(corners: &[u32], corner: usize) -> HalfEdge {
    let from = corners[corner];
    let to = corners[next_corner(corner)];
    HalfEdge { low: from.min(to), high: from.max(to), reversed: from > to, corner: corner as u32 }
}

/// Number of closed fans of triangles around vertices. It exceeds the number of vertices if two surfaces touch in a
/// point.
fn fan_count(edges: &[&[HalfEdge]], corner_count: usize) -> usize {
    let mut sets = Sets::new(corner_count);
    for e in edges {
        let a = e[0].corner as usize;
        let b = e[1].corner as usize;
        sets.join(a, next_corner(b));
        sets.join(next_corner(a), b);
    }
    sets.count
}

fn pieces(edges: &[&[HalfEdge]], triangle_count: usize) -> Sets {
    let mut sets = Sets::new(triangle_count);
    for pair in edges.iter().flat_map(|edge| edge.windows(2)) {
        sets.join(pair[0].corner as usize / 3, pair[1].corner as usize / 3);
    }
    sets
}

/// The sides of an edge by their angle around it, from any of them on, in [`ANGLE_STEPS`]. From the outside of a side that
/// runs from low to high the angle grows; of sides that lie on each other, such ones come first.
fn around<'e>(edge: &'e [HalfEdge], positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<(u32, &'e HalfEdge)> {
    let place = |corner: u32, along: usize| {
        let triangle = triangles[corner as usize / 3];
        positions[triangle[(corner as usize + along) % 3] as usize].as_dvec3()
    };
    // Sorted sides begin with one that runs from low to high, if there is any.
    let [from, to] = [0, 1].map(|along| place(edge[0].corner, along));
    let axis = (to - from).normalize_or_zero();
    let across = axis.any_orthonormal_vector();
    let up = axis.cross(across);
    let angle = |side: &HalfEdge| {
        let to = place(side.corner, 2) - from;
        let turns = to.dot(up).atan2(to.dot(across)) / std::f64::consts::TAU;
        (turns * ANGLE_STEPS).round().rem_euclid(ANGLE_STEPS) as u32
    };
    let mut around: Vec<(u32, &HalfEdge)> = edge.iter().map(|side| (angle(side), side)).collect();
    around.sort_by_key(|(angle, side)| (*angle, side.reversed));
    around
}

/// Corners of the sides along an edge that belong together. Where solids touch along it, each has two sides with its
/// inside between them.
fn mates(edge: &[HalfEdge], positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let forward = edge.iter().filter(|side| !side.reversed).count();
    if edge.len() < 4 || 2 * forward != edge.len() {
        return edge.windows(2).map(|pair| [pair[0].corner, pair[1].corner]).collect();
    }
    let around = around(edge, positions, triangles);
    let mate = |(at, (_, side)): (usize, &(u32, &HalfEdge))| {
        let mut others = around.iter().cycle().skip(at + 1);
        let (_, other) = others.find(|(_, other)| !other.reversed).filter(|_| side.reversed)?;
        Some([side.corner, other.corner])
    };
    around.iter().enumerate().filter_map(mate).collect()
}

/// Whether every triangle is there from both sides, so that none bounds anything.
fn is_doubled(edges: &[&[HalfEdge]], positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    edges.iter().all(|edge| {
        let around = around(edge, positions, triangles);
        around.chunk_by(|a, b| a.0 == b.0).all(|at| 2 * at.iter().filter(|(_, side)| side.reversed).count() == at.len())
    })
}

/// A few of many triangles, by their numbers.
pub fn subset(triangles: &[[u32; 3]], piece: &[u32]) -> Vec<[u32; 3]> {
    piece.iter().map(|triangle| triangles[*triangle as usize]).collect()
}

/// The pieces that hang together, in the order of their first triangles: the numbers of their triangles.
pub fn loose(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let sides = sides(&weld(positions, triangles).0);
    let edges: Vec<&[HalfEdge]> = edges(&sides).collect();
    let mut sets = Sets::new(triangles.len());
    if is_doubled(&edges, positions, triangles) {
        (1..triangles.len()).for_each(|triangle| sets.join(0, triangle));
    } else {
        for [a, b] in edges.iter().flat_map(|edge| mates(edge, positions, triangles)) {
            sets.join(a as usize / 3, b as usize / 3);
        }
    }
    // The root of a set is its first triangle.
    let mut pieces = BTreeMap::<usize, Vec<u32>>::new();
    for triangle in 0..triangles.len() {
        pieces.entry(sets.root(triangle)).or_default().push(triangle as u32);
    }
    pieces.into_values().collect()
}

/// Whether every piece of a closed surface is wound outwards, so that none is the wall of a cavity or inside out.
fn has_solid_pieces(edges: &[&[HalfEdge]], positions: &[Vec3], triangles: &[[u32; 3]], centre: Vec3) -> bool {
    let mut pieces = pieces(edges, triangles.len());
    let mut volumes = HashMap::<usize, f64>::new();
    for (number, triangle) in triangles.iter().enumerate() {
        *volumes.entry(pieces.root(number)).or_default() += tetrahedron_m3(positions, triangle, centre);
    }
    volumes.values().all(|volume| *volume > 0.0)
}

/// Disjoint sets with path halving.
pub(crate) struct Sets {
    parent: Vec<u32>,
    count: usize,
}

impl Sets {
    pub(crate) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), count }
    }

    pub(crate) fn root(&mut self, mut i: usize) -> usize {
        while self.parent[i] as usize != i {
            self.parent[i] = self.parent[self.parent[i] as usize];
            i = self.parent[i] as usize;
        }
        i
    }

    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let a = self.root(a);
        let b = self.root(b);
        if a != b {
            self.parent[a.max(b)] = a.min(b) as u32;
            self.count -= 1;
        }
    }
}

/// Whether the far corner of the edge's second triangle lies below the plane of the first, or above it by no more than
/// rounding explains. Rounding tilts the first plane, so its effect grows with the ratio of the two corners' distances
/// from the edge.
fn bends_outwards(edge: &[HalfEdge], positions: &[Vec3], triangles: &[[u32; 3]], dent_m: f64) -> bool {
    let at = |corner: usize| positions[triangles[corner / 3][corner % 3] as usize].as_dvec3();
    let one = edge[0].corner as usize;
    let other = edge[1].corner as usize;
    let from = at(one);
    let to = at(next_corner(one));
    let own_far = at(next_corner(next_corner(one)));
    let other_far = at(next_corner(next_corner(other)));
    let normal = (to - from).cross(own_far - from);
    let Some(unit) = normal.try_normalize() else { return true };
    let length = to.distance(from);
    let own_height = normal.length() / length;
    let other_height = (to - from).cross(other_far - from).length() / length;
    unit.dot(other_far - from) <= dent_m * (1.0 + other_height / own_height)
}

/// Chooses three vertices that span the set widely, so that the plane is well determined, and tests all others against
/// it.
fn plane(positions: &[Vec3], radius_m: f64) -> Option<DVec3> {
    let most = |measure: &dyn Fn(DVec3) -> f64| {
        let larger = |a: DVec3, b: DVec3| if measure(b) > measure(a) { b } else { a };
        positions.iter().map(|p| p.as_dvec3()).reduce(larger).unwrap_or_default()
    };
    let a = positions[0].as_dvec3();
    let b = most(&|p| p.distance_squared(a));
    let c = most(&|p| (p - a).cross(b - a).length_squared());
    let normal = (b - a).cross(c - a).try_normalize()?;
    positions.iter().all(|p| normal.dot(p.as_dvec3() - a).abs() <= FLAT_TOLERANCE * radius_m).then_some(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::torus;

    #[test]
    fn a_closed_surface_winds_once_around_what_it_holds() {
        let ring = torus(1.0, 0.3, 24, 12);
        let around = |point: [f64; 3]| winding(&ring.positions, &ring.triangles, DVec3::from_array(point));
        assert!((around([1.0, 0.0, 0.1]) - 1.0).abs() < 1e-9);
        assert!(around([0.0; 3]).abs() < 1e-9 && around([2.0, 0.1, 0.3]).abs() < 1e-9);
    }
}
