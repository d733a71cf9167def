//! Slender pieces of meshes as chains of boxes: bars, rails, cables, legs. They block light in closed form, where maps of
//! outlines, of 32 texels across the whole mesh, have no place for them.

use super::mesh::{Mesh, area_m2, twice_area_m2};
use super::topology;
use crate::field::cuboid::{Cuboid, PlacedCuboid};
use glam::{DMat3, DVec3, Vec3};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Most triangles of a mesh that is searched, and most boxes of one.
const TRIANGLES_LIMIT: usize = 16_384;
pub const BARS_LIMIT: usize = 64;
/// A piece is slender if its boxes together are so many times as long as they are wide in the mean. Outlines are better of
/// thicker ones that stand alone: the box in a round bar is up to 0.3 narrower than that.
const SLENDER: f64 = 20.0;
/// Area of a piece from which on it is not slender, over the square of its extent: of a straight bar of that length it is
/// 0.16, of a coil of wire more.
const COMPACT: f64 = 0.5;
/// A part is straight if its sides have this share of the area of the box around them: those of a round bar have 0.79.
const STRAIGHT: f64 = 0.62;
/// From this share on it is a box.
const SQUARE: f64 = 0.98;
/// Area of the sides of a box within a round bar, over the bar's.
const INSCRIBED: f64 = 0.9;
/// One half of a part is at most so many times as wide as the other: a spike is no bar.
const TAPERED: f64 = 1.6;
/// Most times that a piece is halved.
const HALVINGS: u32 = 9;
/// A part of less than this share of the area is left out: caps within a joint.
const SCRAP: f64 = 5e-3;
/// Fewest triangles of a part that is halved.
const LEAST_TRIANGLES: usize = 16;
/// Least thickness of a bar, of its width.
const THIN: f64 = 0.05;
/// Cosine between a bar's axis and the normals of its ends.
const END: f64 = 0.7;

/// The boxes of a mesh that has slender pieces, and of what else it consists; none of any other mesh.
pub(super) fn bars(mesh: &Mesh) -> Vec<PlacedCuboid> {
    if mesh.triangles.len() > TRIANGLES_LIMIT || mesh.cuboid().is_some() {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut others = Vec::new();
    for piece in topology::loose(&mesh.positions, &mesh.triangles) {
        let triangles = topology::subset(&mesh.triangles, &piece);
        match bar(&mesh.positions, &triangles) {
            Some(boxes) if found.len() + boxes.len() > BARS_LIMIT => return Vec::new(),
            Some(boxes) => found.extend(boxes),
            None => others.extend(triangles),
        }
    }
    if !found.is_empty() && !others.is_empty() {
        let others = Mesh::new("", mesh.positions.clone(), Vec::new(), None, others).ok();
        match others.map_or(Vec::new(), |others| others.as_boxes()) {
            boxes if boxes.is_empty() => found.clear(),
            boxes => found.extend(boxes),
        }
    }
    found
}

/// The boxes along a piece that hangs together, if it is slender.
pub fn bar(positions: &[Vec3], triangles: &[[u32; 3]]) -> Option<Vec<PlacedCuboid>> {
    let corners = || triangles.iter().flatten().map(|v| positions[*v as usize]);
    let extent = corners().fold(Vec3::MIN, Vec3::max) - corners().fold(Vec3::MAX, Vec3::min);
    if area_m2(positions, triangles) > COMPACT * f64::from(extent.length_squared()) {
        return None;
    }
    let (positions, triangles) = topology::apart(positions, triangles);
    let along = ways(&positions, &triangles);
    let mut parts = Vec::new();
    split(&positions, &along, triangles, HALVINGS, &mut parts);
    let whole_m2: f64 = parts.iter().map(|part| part.sides_m2).sum();
    parts.retain(|part| part.sides_m2 > SCRAP * whole_m2);
    let boxes: Vec<[DVec3; 4]> = parts.iter().map(|part| part.inscribed()).collect::<Option<_>>()?;
    let length_m: f64 = boxes.iter().map(|[_, along, ..]| 2.0 * along.length()).sum();
    let width_m = parts.iter().map(|part| part.half.y + part.half.z).sum::<f64>() / parts.len() as f64;
    (length_m > SLENDER * width_m).then(|| boxes.into_iter().map(placed).collect())
}

fn placed([centre_m, a, b, c]: [DVec3; 4]) -> PlacedCuboid {
    let radius_m = (a + b + c).length();
    PlacedCuboid { centre_m, radius_m, cuboid: Cuboid { half_edges: [a, b, c].map(|edge| edge / radius_m) } }
}

/// A part of a piece, and the box around it.
struct Part {
    /// The first along the part.
    axes: DMat3,
    /// By the axes.
    middle: DVec3,
    half: DVec3,
    /// Area of its sides, and that over the box's.
    sides_m2: f64,
    share: f64,
    /// How far its corners lie off the axis at most, before the middle and behind it.
    widths: [f64; 2],
}

impl Part {
    fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let corners = || triangles.iter().flatten().map(|v| positions[*v as usize].as_dvec3());
        let sides = || triangles.iter().map(|triangle| twice_area_m2(positions, triangle) / 2.0);
        let x = longest_axis(corners);
        let is_side = |normal: &DVec3| normal.dot(x).abs() < END * normal.length();
        let widest = sides().filter(is_side).max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let y = widest.unwrap_or(x.any_orthonormal_vector()).reject_from_normalized(x);
        let y = y.try_normalize().unwrap_or(x.any_orthonormal_vector());
        let axes = DMat3::from_cols(x, y, x.cross(y));
        let local = || corners().map(|corner| axes.transpose() * corner);
        let [low, high] = [local().fold(DVec3::MAX, DVec3::min), local().fold(DVec3::MIN, DVec3::max)];
        let middle = (low + high) / 2.0;
        let half = (high - low) / 2.0;
        let sides_m2: f64 = sides().filter(is_side).map(DVec3::length).sum();
        let width = |before: bool| {
            let on_side = local().filter(|at| (at.x < middle.x) == before);
            on_side.map(|at| (at.y - middle.y).hypot(at.z - middle.z)).fold(0.0, f64::max)
        };
        let share = sides_m2 / (8.0 * half.x * (half.y + half.z)).max(f64::MIN_POSITIVE);
        Part { axes, middle, half, sides_m2, share, widths: [width(true), width(false)] }
    }

    /// Its centre and half edges, as a box that lies within a round bar; `None` if it is none.
    fn inscribed(&self) -> Option<[DVec3; 4]> {
        let [a, b] = self.widths;
        let [_, y, z] = self.half.to_array();
        let is_long = self.half.x > y + z && y.min(z) > THIN * y.max(z);
        let is_bar = is_long && a.max(b) < TAPERED * a.min(b) && self.share > STRAIGHT;
        let scale = match self.share {
            share if share > 1.0 + 1e-3 => INSCRIBED * std::f64::consts::FRAC_PI_4, // a tube has an inside
            share if share > SQUARE => 1.0,
            share => INSCRIBED * share,
        };
        let half = self.half * DVec3::new(1.0, scale, scale);
        let edges = [0, 1, 2].map(|axis| half[axis] * self.axes.col(axis));
        is_bar.then_some([self.axes * self.middle, edges[0], edges[1], edges[2]])
    }
}

/// The axis along which places spread most: power iteration.
pub fn longest_axis<P: Iterator<Item = DVec3>>(places: impl Fn() -> P) -> DVec3 {
    let mean = places().sum::<DVec3>() / places().count() as f64;
    let spread = places().fold(DMat3::ZERO, |sum, place| {
        let off = place - mean;
        sum + DMat3::from_cols(off.x * off, off.y * off, off.z * off)
    });
    let longest = |a: &DVec3, b: &DVec3| a.length_squared().total_cmp(&b.length_squared());
    let start = (0..3).map(|axis| spread.col(axis)).max_by(longest).unwrap_or(DVec3::X);
    (0..32).fold(start.normalize_or(DVec3::X), |axis, _| (spread * axis).normalize_or(DVec3::X))
}

/// Halves a piece across its length until its parts are straight. `along` has for each vertex how far along the piece it
/// lies.
fn split(positions: &[Vec3], along: &[f64], triangles: Vec<[u32; 3]>, halvings: u32, parts: &mut Vec<Part>) {
    let part = Part::new(positions, &triangles);
    if part.share > STRAIGHT || halvings == 0 || triangles.len() < LEAST_TRIANGLES {
        return parts.push(part);
    }
    // Triangles between the same two rings of corners stay together.
    let place = |triangle: &[u32; 3]| triangle.map(|v| along[v as usize]).into_iter().fold(f64::MAX, f64::min);
    let mut places: Vec<f64> = triangles.iter().map(place).collect();
    places.sort_by(f64::total_cmp);
    // The widest gap between rings in the middle half.
    let [low, high] = [0.75, 0.25].map(|share| share * places[0] + (1.0 - share) * places[places.len() - 1]);
    let in_middle = |pair: &[f64]| (low..=high).contains(&((pair[0] + pair[1]) / 2.0));
    let gaps = places.windows(2).filter(|pair| in_middle(pair));
    let widest = gaps.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    let limit = widest.map_or((low + high) / 2.0, |pair| (pair[0] + pair[1]) / 2.0);
    let (before, behind): (Vec<_>, Vec<_>) = triangles.iter().partition(|triangle| place(triangle) < limit);
    for half in [before, behind] {
        // Both arms of a ring are as far from its end.
        for piece in topology::loose(positions, &half) {
            split(positions, along, topology::subset(&half, &piece), halvings - 1, parts);
        }
    }
}

/// For each vertex of a piece the way along its edges from the farthest end, metres.
fn ways(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<f64> {
    let (corners, distinct) = topology::weld(positions, triangles);
    let count = distinct.len();
    let mut beside: Vec<Vec<(u32, f64)>> = vec![Vec::new(); count];
    for (numbers, triangle) in corners.chunks_exact(3).zip(triangles) {
        for k in 0..3 {
            let [from, to] = [k, (k + 1) % 3];
            let length_m = positions[triangle[from] as usize].distance(positions[triangle[to] as usize]);
            beside[numbers[from] as usize].push((numbers[to], length_m.into()));
            beside[numbers[to] as usize].push((numbers[from], length_m.into()));
        }
    }
    let ways_from = |start: u32| {
        let mut ways = vec![f64::INFINITY; count];
        let mut open = BinaryHeap::from([(Reverse(0), start)]);
        ways[start as usize] = 0.0;
        while let Some((Reverse(bits), vertex)) = open.pop() {
            for &(next, length_m) in &beside[vertex as usize] {
                // Numbers that are not negative are in the order of their bits.
                let way = f64::from_bits(bits) + length_m;
                if way < ways[next as usize] {
                    ways[next as usize] = way;
                    open.push((Reverse(way.to_bits()), next));
                }
            }
        }
        ways
    };
    let first = ways_from(corners[0]);
    let end = (0..count as u32).max_by(|a, b| first[*a as usize].total_cmp(&first[*b as usize])).unwrap_or(0);
    let ways = ways_from(end);
    let mut along = vec![0.0; positions.len()];
    for (numbers, triangle) in corners.chunks_exact(3).zip(triangles) {
        (0..3).for_each(|k| along[triangle[k] as usize] = ways[numbers[k] as usize]);
    }
    along
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::{cuboid, sphere, torus, tube};
    use std::f32::consts::TAU;

    fn line(from: Vec3, to: Vec3, count: u32) -> Vec<Vec3> {
        (0..=count).map(|k| from.lerp(to, k as f32 / count as f32)).collect()
    }

    fn lengths(boxes: &[PlacedCuboid]) -> f64 {
        boxes.iter().map(|of| 2.0 * of.radius_m * of.cuboid.half_edges[0].length()).sum()
    }

    #[test]
    fn a_round_bar_is_a_box_within_it() {
        let [from, to] = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(3.1, 1.2, -0.7)];
        for (rings, sides) in [(1, 6), (8, 12)] {
            let mesh = tube(&line(from, to, rings), 0.05, sides);
            let &[of] = mesh.boxes() else { panic!("{} boxes", mesh.boxes().len()) };
            assert!((lengths(&[of]) - f64::from(from.distance(to))).abs() < 1e-3);
            let [_, y, z] = of.cuboid.half_edges.map(|edge| of.radius_m * edge.length());
            assert!(y.hypot(z) < 0.0501 && y.min(z) > 0.03, "{y} {z}");
        }
    }

    /// Two turns of a coil: boxes lie along it, and are as long together.
    #[test]
    fn a_coil_is_a_chain_of_boxes() {
        let place = |share: f64| {
            let (sin, cos) = (2.0 * f64::from(TAU) * share).sin_cos();
            DVec3::new(1.2 * cos, 2.0 * share, 1.2 * sin)
        };
        let places: Vec<Vec3> = (0..=96).map(|k| place(f64::from(k) / 96.0).as_vec3()).collect();
        let mesh = tube(&places, 0.025, 8);
        let boxes = mesh.boxes();
        assert!((24..=BARS_LIMIT).contains(&boxes.len()), "{}", boxes.len());
        let off_m = |of: &PlacedCuboid| {
            (0..1000).map(|k| place(f64::from(k) / 1000.0).distance(of.centre_m)).fold(f64::MAX, f64::min)
        };
        assert!(boxes.iter().all(|of| off_m(of) < 0.025));
        let length_m = (4.0 * std::f64::consts::PI * 1.2).hypot(2.0);
        assert!((lengths(boxes) / length_m - 1.0).abs() < 0.02, "{}", lengths(boxes));
    }

    #[test]
    fn bars_of_one_mesh_may_stand_on_a_plate() {
        let rail = line(Vec3::ZERO, 3.0 * Vec3::Y, 1);
        let parts = [tube(&rail, 0.04, 8), cuboid(Vec3::new(1.0, 0.1, 1.0), 1)];
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for part in &parts {
            let first = positions.len() as u32;
            positions.extend(&part.positions);
            triangles.extend(part.triangles.iter().map(|triangle| triangle.map(|v| v + first)));
        }
        assert_eq!(Mesh::new("", positions, Vec::new(), None, triangles).unwrap().boxes().len(), 2);
    }

    #[test]
    fn other_pieces_are_no_bars() {
        let spike = |t: f32| 0.06 * (1.0 - t) + 1e-3;
        let mut cone = tube(&line(Vec3::ZERO, 4.0 * Vec3::Y, 8), 1.0, 12).positions;
        cone.iter_mut().for_each(|p| *p *= Vec3::new(spike(p.y / 4.0), 1.0, spike(p.y / 4.0)));
        let triangles = tube(&line(Vec3::ZERO, 4.0 * Vec3::Y, 8), 1.0, 12).triangles;
        let cone = Mesh::new("spike", cone, Vec::new(), None, triangles).unwrap();
        let stick = tube(&line(Vec3::ZERO, Vec3::Y, 2), 0.05, 8);
        for mesh in [cone, stick, sphere(1.0, 2), torus(1.0, 0.3, 12, 6)] {
            assert!(mesh.boxes().is_empty(), "{}", mesh.name);
        }
        assert!(!torus(1.0, 0.02, 48, 6).boxes().is_empty(), "a ring of wire");
    }
}
