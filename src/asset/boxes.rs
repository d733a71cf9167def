//! Solids with square corners as boxes: houses, stairs, frames, shelves. Each box blocks light in closed form, where the
//! maps and outlines of the whole are coarse.
//!
//! The planes of all faces cut the solid into cells. Boxes of them, each as large as fits, overlap until any two cells
//! that share a face are in one box: where boxes only touched, light would pass between them, since each takes its own
//! share of a light.

use super::mesh::{Mesh, twice_area_m2};
use super::outline::{SQUARE, square_axes};
use crate::field::cuboid::{Cuboid, PlacedCuboid};
use glam::{DMat3, DVec2, DVec3};

/// Most triangles of a solid, most planes along an axis, most cells and most boxes.
const TRIANGLES_LIMIT: usize = 4096;
const PLANES_LIMIT: usize = 64;
const CELLS_LIMIT: usize = 8192;
const BOXES_LIMIT: usize = 48;
/// Planes that are closer are one, in bounding radii.
const SAME: f64 = 1e-5;
/// Where in a cell it is tested, so that no diagonal of a face passes there.
const WITHIN: [f64; 2] = [0.381_966, 0.732_051];

/// The boxes that cover a closed mesh with square corners, two at least; none of any other.
pub(super) fn boxes(mesh: &Mesh) -> Vec<PlacedCuboid> {
    let is_solid = mesh.is_closed() && !mesh.is_convex() && mesh.triangles.len() <= TRIANGLES_LIMIT;
    is_solid.then(|| Cells::new(mesh)).flatten().and_then(|cells| cells.boxes()).unwrap_or_default()
}

/// A box of cells: the first along each axis, and the one behind the last.
type Block = [[usize; 3]; 2];

fn holds([low, high]: Block, cell: [usize; 3]) -> bool {
    (0..3).all(|axis| (low[axis]..high[axis]).contains(&cell[axis]))
}

/// The cells between the planes of a solid's faces.
struct Cells {
    axes: DMat3,
    /// Places of the planes along each axis, rising.
    planes: [Vec<f64>; 3],
    /// Of each cell whether it is within the solid; the last axis runs fastest.
    within: Vec<bool>,
}

impl Cells {
    fn new(mesh: &Mesh) -> Option<Self> {
        let normal = |t: &[u32; 3]| twice_area_m2(&mesh.positions, t).try_normalize();
        let [x, y, z] = square_axes(mesh.triangles.iter().filter_map(normal))?;
        let axes = DMat3::from_cols(x, y, z);
        // Along which axis each face looks, its place there, and which way.
        let mut faces: [Vec<(f64, f64, [DVec2; 3])>; 3] = Default::default();
        for triangle in &mesh.triangles {
            let Some(normal) = normal(triangle) else { continue };
            let local = axes.transpose() * normal;
            let axis = (0..3).find(|axis| local[*axis].abs() > 1.0 - SQUARE)?;
            let places = triangle.map(|v| axes.transpose() * mesh.positions[v as usize].as_dvec3());
            let flat = places.map(|p| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]));
            faces[axis].push((places.iter().map(|p| p[axis]).sum::<f64>() / 3.0, local[axis].signum(), flat));
        }
        let same = SAME * f64::from(mesh.bounding_sphere().1);
        let planes = faces.each_ref().map(|faces| {
            let mut places: Vec<f64> = faces.iter().map(|(place, ..)| *place).collect();
            places.sort_by(f64::total_cmp);
            places.dedup_by(|b, a| *b - *a < same);
            places
        });
        let counts = planes.each_ref().map(|planes| planes.len().saturating_sub(1));
        let fits = planes.iter().all(|planes| planes.len() <= PLANES_LIMIT);
        if !fits || !(2..=CELLS_LIMIT).contains(&counts.iter().product()) {
            return None;
        }
        let mut cells = Cells { axes, planes, within: vec![false; counts.iter().product()] };
        // Along every column of cells the solid begins where it is entered more often than left.
        for y in 0..counts[1] {
            for z in 0..counts[2] {
                let at = |axis: usize, i: usize| {
                    let planes = &cells.planes[axis];
                    planes[i] + WITHIN[axis - 1] * (planes[i + 1] - planes[i])
                };
                let point = DVec2::new(at(1, y), at(2, z));
                let mut turns = vec![0.0; counts[0] + 1];
                for (place, way, _) in faces[0].iter().filter(|(_, _, flat)| is_in(point, flat)) {
                    let plane = cells.planes[0].partition_point(|plane| *plane <= place - same);
                    turns[plane] -= way;
                }
                let mut depth = 0.0;
                for x in 0..counts[0] {
                    depth += turns[x];
                    let cell = cells.index([x, y, z]);
                    cells.within[cell] = depth > 0.5;
                }
                if depth + turns[counts[0]] != 0.0 {
                    return None;
                }
            }
        }
        Some(cells)
    }

    fn counts(&self) -> [usize; 3] {
        self.planes.each_ref().map(|planes| planes.len() - 1)
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        let [_, ny, nz] = self.counts();
        (x * ny + y) * nz + z
    }

    fn is_solid(&self, [low, high]: Block) -> bool {
        (low[0]..high[0])
            .all(|x| (low[1]..high[1]).all(|y| (low[2]..high[2]).all(|z| self.within[self.index([x, y, z])])))
    }

    /// The largest block around one that grows along one axis after the other, in any order of these.
    fn grown(&self, from: Block) -> Block {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let counts = self.counts();
        let grow = |order: [usize; 3]| {
            let mut block = from;
            for axis in order {
                let slab = |block: Block, at: usize| {
                    let mut slab = block;
                    (slab[0][axis], slab[1][axis]) = (at, at + 1);
                    self.is_solid(slab)
                };
                while block[0][axis] > 0 && slab(block, block[0][axis] - 1) {
                    block[0][axis] -= 1;
                }
                while block[1][axis] < counts[axis] && slab(block, block[1][axis]) {
                    block[1][axis] += 1;
                }
            }
            block
        };
        ORDERS.map(grow).into_iter().max_by(|a, b| self.volume(*a).total_cmp(&self.volume(*b))).unwrap_or(from)
    }

    fn edges(&self, [low, high]: Block) -> [[f64; 2]; 3] {
        [0, 1, 2].map(|axis| [low[axis], high[axis]].map(|plane| self.planes[axis][plane]))
    }

    fn volume(&self, block: Block) -> f64 {
        self.edges(block).iter().map(|[low, high]| high - low).product()
    }

    /// Blocks in which every cell is, and any two that share a face are together; `None` if there are too many.
    fn boxes(&self) -> Option<Vec<PlacedCuboid>> {
        let counts = self.counts();
        let mut blocks: Vec<Block> = Vec::new();
        let all = (0..self.within.len()).map(|i| {
            let [_, ny, nz] = counts;
            [i / (ny * nz), i / nz % ny, i % nz]
        });
        for cell in all.filter(|cell| self.within[self.index(*cell)]) {
            let beside = (0..3).map(|axis| {
                let mut next = cell;
                next[axis] += 1;
                next
            });
            for last in std::iter::once(cell).chain(beside) {
                let seed = [cell, last.map(|at| at + 1)];
                let exists = (0..3).all(|axis| last[axis] < counts[axis]) && self.is_solid(seed);
                if exists && !blocks.iter().any(|block| holds(*block, cell) && holds(*block, last)) {
                    blocks.push(self.grown(seed));
                }
            }
            if blocks.len() > BOXES_LIMIT {
                return None;
            }
        }
        Some(blocks.into_iter().map(|block| self.placed(block)).collect())
    }

    fn placed(&self, block: Block) -> PlacedCuboid {
        let edges = self.edges(block);
        let middle = DVec3::from_array(edges.map(|[low, high]| (low + high) / 2.0));
        let half = DVec3::from_array(edges.map(|[low, high]| (high - low) / 2.0));
        let radius_m = half.length();
        let half_edges = [0, 1, 2].map(|axis| half[axis] / radius_m * self.axes.col(axis));
        PlacedCuboid { centre_m: self.axes * middle, radius_m, cuboid: Cuboid { half_edges } }
    }
}

/// Whether a point is within a triangle, however that is wound.
fn is_in(point: DVec2, corners: &[DVec2; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner - point);
    let sides = [a.perp_dot(b), b.perp_dot(c), c.perp_dot(a)];
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side < 0.0)
}
