//! What leaves an object as it is: the 48 turns and mirrors of a cube, of which the lattice of a cube is made too; turns by any
//! angle about x, y or z; and every turn.
//!
//! A mesh is seldom exactly as symmetric as what it stands for: facets turn with it, and squares are cut along one diagonal. Each
//! symmetry therefore has a deviation, in r: no point of the moved surface is farther from the surface. Symmetries of the first kind
//! are found by matching vertices, and their deviation is measured where the matched triangles differ. Turns by any angle are tried
//! at a few odd angles. The deviation of a sphere is the depth of its facets.

use super::surface::{Surface, nearest_on_triangle};
use super::triangles::unit_positions;
use crate::asset::Mesh;
use crate::field::Fit;
use glam::{DMat3, DVec3, IVec3, Vec3};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::sync::LazyLock;

/// Farthest that a vertex may lie from where a symmetry wants it, in r. Files with six digits are as exact as this.
const MATCH: f64 = 2e-5;
/// A deviation beyond this, in r, is of no use, since it would be seen from everywhere.
const USELESS: f64 = 0.05;
/// Most comparisons of triangles, for each triangle of a mesh, that finding the deviation of one symmetry may take. Where squares are
/// cut along one diagonal it takes 72 for each square, and 304 for each triangle at the pole of a sphere of 64 segments. A mesh of
/// many triangles around one vertex can need the square of their number. Such a symmetry is not used.
const COMPARISONS_A_TRIANGLE: usize = 1_000;
/// Most vertices in one cell of the search, and at one place. A mesh with more, all but a few of its vertices in a thousandth of its
/// radius, is taken for one without symmetries: each search would look at all of them.
const CROWD: usize = 1_024;
/// Angles, in radians, at which a body of revolution is tried. None is a simple fraction of a circle.
const ANGLES_RAD: [f64; 3] = [0.1234, 0.5077, -1.0609];
/// A turned vertex may lie anywhere between the corners of a facet. The tried angles come near the middle, within this factor.
const ANGLE_MARGIN: f64 = 1.15;

/// A turn or mirror, and how far the surface is from being moved onto itself.
#[derive(Clone, Copy, Debug)]
pub struct Operation {
    /// An orthogonal matrix with entries 0 and +-1.
    pub matrix: DMat3,
    /// Largest distance of the moved surface from the surface, in r.
    pub deviation: f64,
}

/// The symmetries of an object around its bounding sphere's centre.
#[derive(Clone, Debug, Default)]
pub struct Symmetry {
    /// Turns and mirrors of a cube without the identity. The one with the least deviation comes first.
    pub operations: Vec<Operation>,
    /// Deviation of turns about x, y and z.
    pub revolution: [Option<f64>; 3],
    /// Deviation of turns about every axis.
    pub sphere: Option<f64>,
}

impl Symmetry {
    /// Finds the symmetries of a mesh, with its colours where it has any and `with_colors` is set.
    pub fn of(mesh: &Mesh, surface: &Surface, with_colors: bool) -> Self {
        let colors = mesh.colors.as_ref().filter(|_| with_colors);
        let varied = colors.filter(|colors| colors.iter().any(|c| *c != colors[0]));
        let symmetry = Self::of_vertices(mesh, varied);
        if varied.is_some() {
            return symmetry;
        }
        let unit = unit_positions(mesh);
        let points = LazyLock::new(|| Points::new(mesh, None));
        let revolution = DVec3::AXES.map(|axis| {
            let turn = DMat3::from_axis_angle(axis, ANGLES_RAD[0]);
            // Most meshes fail at once. A round body with bumps does so at few of its vertices.
            let may_be = few(&unit, 1000).all(|place| surface.distance(turn * place) < USELESS);
            may_be.then(|| points.revolution(axis, surface)).flatten()
        });
        let sphere = (mesh.is_closed() && surface.encloses(DVec3::ZERO))
            .then(|| 1.0 - surface.distance(DVec3::ZERO))
            .filter(|deviation| *deviation < USELESS);
        Symmetry { revolution, sphere, ..symmetry }
    }

    /// Finds only the turns and mirrors of a cube, for the mesh with the colours of its vertices if it has any.
    pub fn of_vertices(mesh: &Mesh, colors: Option<&Vec<Vec3>>) -> Self {
        let unit = unit_positions(mesh);
        let points = LazyLock::new(|| Points::new(mesh, colors));
        let find = |matrix| {
            // Most meshes fail at once: to find a vertex near each of a few places takes less than to order all vertices.
            let may_be = few(&unit, 20).all(|place| is_at(&unit, matrix * place));
            Some(Operation { matrix, deviation: may_be.then(|| points.deviation(matrix, &mut 0)).flatten()? })
        };
        let mut operations: Vec<Operation> = cube_group().into_par_iter().skip(1).filter_map(find).collect();
        operations.sort_by(|a, b| a.deviation.total_cmp(&b.deviation));
        Symmetry { operations, ..Symmetry::default() }
    }

    /// The symmetries under which the lattice's space stays as it is. Only these take samples to samples.
    pub fn kept_by(mut self, fit: &Fit) -> Self {
        self.operations.retain(|operation| fit.keeps(operation.matrix));
        for (axis, revolution) in DVec3::AXES.into_iter().zip(&mut self.revolution) {
            *revolution = revolution.filter(|_| fit.keeps(DMat3::from_axis_angle(axis, 1.0)));
        }
        self.sphere = self.sphere.filter(|_| *fit == Fit::ROUND);
        self
    }

    /// Names the symmetries in words, for headers.
    pub fn describe(&self) -> String {
        let exact = self.operations.iter().filter(|o| o.deviation < MATCH).count();
        let mut words = vec![];
        if exact > 0 {
            words.push(format!("{exact} turns and mirrors"));
        }
        let rest = &self.operations[exact..];
        if let Some(worst) = rest.last() {
            words.push(format!("{} more within {:.1e} r", rest.len(), worst.deviation));
        }
        for (name, deviation) in ["x", "y", "z"].iter().zip(self.revolution) {
            words.extend(deviation.map(|deviation| format!("revolution about {name} within {deviation:.1e} r")));
        }
        words.extend(self.sphere.map(|deviation| format!("sphere within {deviation:.1e} r")));
        if words.is_empty() { "none".to_owned() } else { words.join(", ") }
    }
}

/// The 48 turns and mirrors of a cube, the identity first.
pub fn cube_group() -> Vec<DMat3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let sign = |bits: usize, k: usize| if bits >> k & 1 == 1 { -1.0 } else { 1.0 };
    let of_order = |[i, j, k]: [usize; 3]| {
        (0..8).map(move |b| DMat3::from_cols(sign(b, 0) * axes[i], sign(b, 1) * axes[j], sign(b, 2) * axes[k]))
    };
    orders.into_iter().flat_map(of_order).collect()
}

/// The mesh's vertices by place, joined where they coincide. It is empty where too many of them lie too close together.
#[derive(Default)]
pub struct Points {
    places: Vec<DVec3>,
    colors: Vec<Vec3>,
    /// The joined vertex of each vertex of the mesh.
    of_vertex: Vec<u32>,
    cells: HashMap<IVec3, Vec<u32>>,
    triangles: Vec<[u32; 3]>,
    known: HashSet<[u32; 3]>,
    /// Triangles around each joined vertex.
    around: Vec<Vec<u32>>,
}

impl Points {
    /// Joins vertices that agree in place, and in colour where colours are given.
    pub fn new(mesh: &Mesh, colors: Option<&Vec<Vec3>>) -> Self {
        let unit = unit_positions(mesh);
        let mut points = Points::default();
        for (vertex, position) in unit.iter().enumerate() {
            let place = position.as_dvec3();
            let color = colors.map_or(Vec3::ONE, |colors| colors[vertex]);
            let index = points.find(place, color).unwrap_or_else(|| {
                let index = points.places.len() as u32;
                points.places.push(place);
                points.colors.push(color);
                points.cells.entry(cell(place)).or_default().push(index);
                index
            });
            points.of_vertex.push(index);
            if points.cells.get(&cell(place)).is_some_and(|within| within.len() > CROWD) {
                return Points::default();
            }
        }
        points.around = vec![Vec::new(); points.places.len()];
        for triangle in &mesh.triangles {
            let joined = triangle.map(|i| points.of_vertex[i as usize]);
            // Triangles of the same corners count once.
            if !points.known.insert(sorted(joined)) {
                continue;
            }
            for corner in joined {
                points.around[corner as usize].push(points.triangles.len() as u32);
            }
            points.triangles.push(joined);
        }
        points
    }

    /// The vertex at a place, if one is.
    fn find(&self, place: DVec3, color: Vec3) -> Option<u32> {
        let (low, high) = (cell(place - MATCH), cell(place + MATCH));
        let mut best: Option<(f64, u32)> = None;
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    for &index in self.cells.get(&IVec3::new(x, y, z)).into_iter().flatten() {
                        let distance = self.places[index as usize].distance(place);
                        let same = (self.colors[index as usize] - color).abs().max_element() <= 1e-6;
                        if same && distance <= best.map_or(MATCH, |(least, _)| least) {
                            best = Some((distance, index));
                        }
                    }
                }
            }
        }
        best.map(|(_, index)| index)
    }

    /// Where each joined vertex goes, or `None` unless every one has a counterpart.
    fn image(&self, matrix: DMat3) -> Option<Vec<u32>> {
        self.places.iter().zip(&self.colors).map(|(place, color)| self.find(matrix * *place, *color)).collect()
    }

    /// How far the moved surface is from the surface. `None` if a vertex has no counterpart, if the surface is too far, or if more than
    /// [`COMPARISONS_A_TRIANGLE`] would be needed. Counts comparisons of triangles in `compared`.
    fn deviation(&self, matrix: DMat3, compared: &mut usize) -> Option<f64> {
        if self.triangles.is_empty() {
            return None;
        }
        let image = self.image(matrix)?;
        let moved = |vertex: u32| matrix * self.places[vertex as usize];
        let off = |(vertex, to): (usize, &u32)| moved(vertex as u32).distance(self.places[*to as usize]);
        let mut worst = image.iter().enumerate().map(off).fold(0.0, f64::max);
        for triangle in &self.triangles {
            let to = triangle.map(|i| image[i as usize]);
            if self.known.contains(&sorted(to)) {
                continue;
            }
            *compared += 4 * to.iter().map(|&i| self.around[i as usize].len()).sum::<usize>();
            if *compared > COMPARISONS_A_TRIANGLE * self.triangles.len() {
                return None;
            }
            let [a, b, c] = triangle.map(moved);
            for point in [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0] {
                let near = to.iter().flat_map(|&i| &self.around[i as usize]).map(|&t| {
                    let corners = self.triangles[t as usize].map(|i| self.places[i as usize] - point);
                    nearest_on_triangle(corners).length()
                });
                worst = near.fold(f64::INFINITY, f64::min).max(worst);
            }
        }
        (worst < USELESS).then_some(worst)
    }

    /// How far the surface, turned about an axis through the centre, is from the surface, or `None` where that is too far.
    fn revolution(&self, axis: DVec3, surface: &Surface) -> Option<f64> {
        let farthest = |points: &[DVec3], angle: f64| -> Option<f64> {
            let turn = DMat3::from_axis_angle(axis, angle);
            let off = |p: &DVec3| Some(surface.distance(turn * *p)).filter(|d| *d < USELESS);
            points.par_iter().map(off).try_reduce(|| 0.0, |a, b| Some(a.max(b)))
        };
        if self.places.is_empty() {
            return None;
        }
        let middle = |t: &[u32; 3]| t.iter().map(|i| self.places[*i as usize]).sum::<DVec3>() / 3.0;
        let all: Vec<DVec3> = self.places.iter().copied().chain(self.triangles.iter().map(middle)).collect();
        let mut worst = 0.0_f64;
        for angle in ANGLES_RAD {
            worst = worst.max(farthest(&all, angle)?);
        }
        Some(ANGLE_MARGIN * worst)
    }

    /// The vertices to which those of a mesh are moved, or `None` unless all of them agree in place and normal.
    pub fn vertices(&self, matrix: DMat3, mesh: &Mesh) -> Option<Vec<u32>> {
        let image = self.image(matrix)?;
        let mut at: Vec<Vec<u32>> = vec![Vec::new(); self.places.len()];
        for (vertex, joined) in self.of_vertex.iter().enumerate() {
            at[*joined as usize].push(vertex as u32);
        }
        let of = |(vertex, joined): (usize, &u32)| {
            let normal = matrix * mesh.normals[vertex].as_dvec3();
            let agrees = |v: &&u32| mesh.normals[**v as usize].as_dvec3().distance(normal) < NORMAL_MATCH;
            at[image[*joined as usize] as usize].iter().take(CROWD).find(agrees).copied()
        };
        self.of_vertex.iter().enumerate().map(of).collect()
    }
}

/// Largest distance of unit normals that count as one.
const NORMAL_MATCH: f64 = 1e-4;

/// At most `count` of a mesh's vertices, from all over it.
fn few(unit: &[Vec3], count: usize) -> impl Iterator<Item = DVec3> {
    unit.iter().step_by(unit.len().div_ceil(count).max(1)).map(|place| place.as_dvec3())
}

/// Whether a vertex lies as near to a place as a symmetry demands.
fn is_at(unit: &[Vec3], place: DVec3) -> bool {
    // The margin covers rounding.
    unit.iter().any(|vertex| vertex.as_dvec3().distance_squared(place) < (1.001 * MATCH).powi(2))
}

fn cell(place: DVec3) -> IVec3 {
    // Cells are much larger than the distance sought, so that a search looks into one cell and seldom into two.
    (place / (50.0 * MATCH)).floor().as_ivec3()
}

fn sorted(mut triangle: [u32; 3]) -> [u32; 3] {
    triangle.sort_unstable();
    triangle
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Operations that are found, and the most comparisons that any of the 48 takes.
    fn search(mesh: &Mesh) -> (usize, usize) {
        let points = Points::new(mesh, None);
        let mut most = 0;
        for matrix in cube_group() {
            let mut compared = 0;
            points.deviation(matrix, &mut compared);
            most = most.max(compared);
        }
        (Symmetry::of_vertices(mesh, None).operations.len(), most)
    }

    fn mesh(name: &str, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
        Mesh::new(name, positions, Vec::new(), None, triangles).unwrap()
    }

    /// A quarter turn takes the diagonal of a square to the other one, so that its triangles have to be compared.
    #[test]
    fn stacked_triangles_are_compared_once() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let square = |times| mesh("square", corners.clone(), [[0, 1, 2], [0, 2, 3]].repeat(times));
        let (once, stacked) = (search(&square(1)), search(&square(1_000)));
        assert_eq!(once, stacked);
        assert!(once.0 == 15 && once.1 > 0 && once.1 < 100, "{once:?}");
    }

    /// Triangles around one vertex, whose other corners a quarter turn takes to those of triangles that are not there.
    #[test]
    fn the_search_is_bounded_where_many_triangles_meet() {
        let count = 64;
        let on_ring = |k: u32| {
            let angle = std::f32::consts::TAU * k as f32 / count as f32;
            Vec3::new(angle.cos(), 0.0, angle.sin())
        };
        let positions: Vec<Vec3> = std::iter::once(Vec3::ZERO).chain((0..count).map(on_ring)).collect();
        let mut rng = fastrand::Rng::with_seed(7);
        let pairs = (1..=count).flat_map(|a| (1..a).map(move |b| [0, a, b]));
        let triangles: Vec<[u32; 3]> = pairs.filter(|_| rng.bool()).collect();
        let hub = mesh("hub", positions, triangles);
        let points = Points::new(&hub, None);
        let (_, most) = search(&hub);
        // One triangle alone costs four times all that meet at the hub.
        let limit = COMPARISONS_A_TRIANGLE * hub.triangles.len() + 5 * hub.triangles.len();
        assert!(points.triangles.len() > 900 && most > limit / 2 && most <= limit, "{most} of {limit}");
    }

    #[test]
    fn a_crowd_of_vertices_has_no_symmetries() {
        let mut rng = fastrand::Rng::with_seed(8);
        let mut near = || 8e-4 * Vec3::new(rng.f32(), rng.f32(), rng.f32());
        let mut positions: Vec<Vec3> = (0..60_000).map(|_| near()).collect();
        positions.push(2.0 * Vec3::X);
        let triangles = (0..20_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).chain([[0, 1, 60_000]]).collect();
        let crowd = mesh("crowd", positions, triangles);
        let points = Points::new(&crowd, None);
        assert!(points.places.is_empty(), "{} places", points.places.len());
        let surface = Surface::new(&unit_positions(&crowd), &crowd.triangles);
        assert_eq!(Symmetry::of(&crowd, &surface, false).describe(), "none");
    }
}
