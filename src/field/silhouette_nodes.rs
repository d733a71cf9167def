//! The directions for which a silhouette field has maps: corners of square cells on the faces of a cube.

use super::directions::{unwarp, warp};
use crate::sh::cube::{FACE_COUNT, direction, face_basis, face_st};
use glam::{DVec2, DVec3, IVec3, Vec2Swizzles};
use std::collections::HashMap;

/// Nodes at the corners of `cells` x `cells` cells of almost equal angles on every cube face, edges and corners shared.
/// Opposite nodes see the same outline from its two sides, so they share a map.
#[derive(Clone, Debug)]
pub struct NodeGrid {
    cells: u32,
    /// Map and whether the node is the opposite of the map's direction, by face, row and column.
    pub nodes: Vec<(usize, bool)>,
    directions: Vec<DVec3>,
}

/// Shared nodes come out of several faces with different last digits.
fn rounded(direction: DVec3) -> IVec3 {
    (direction * f64::from(1 << 20)).round().as_ivec3()
}

/// Four neighbouring nodes around a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    face: usize,
    low: DVec2,
    /// Place of the direction in the cell, 0 to 1.
    middle: DVec2,
    /// By how much other directions count along each axis, 0 at the cell's border ([`EASED`]).
    eased: DVec2,
    /// Map of each node, and whether the map's own direction is opposite to the node's, so that depths change sign.
    pub nodes: [(usize, bool); 4],
}

/// How far beyond a cell its nodes are extrapolated, in cells.
pub const BEYOND: f64 = 0.25;
/// Distance from a cell's border, in cells, within which directions beside the cell's own count less and less, until on
/// the border itself the weights are those of the cell's own direction: there the next cell has the same, so shadows
/// have no step where the cell changes. Errors stay those of weights without easing (0.0121 and 0.0127 below a torus
/// under 8 degrees); if directions never counted, they would be 0.0189.
pub const EASED: f64 = 1.0 / 6.0;
/// Least part of a direction along the face's own, against directions that leave the face's half of the sphere.
pub const LEAST_AHEAD: f64 = 0.1;

impl NodeGrid {
    /// Maps of a grid: the 6 n^2 + 2 corners of n x n cells a face, in pairs.
    pub fn map_count(cells: u32) -> usize {
        (3 * cells * cells + 1) as usize
    }

    /// The grid of `cells` x `cells` cells a face, at least 1.
    pub fn new(cells: u32) -> Self {
        let columns = cells + 1;
        let mut nodes = Vec::with_capacity(FACE_COUNT * (columns * columns) as usize);
        let mut directions = Vec::with_capacity(Self::map_count(cells));
        // Map of a node and whether it is the opposite of the map's direction.
        let mut known: HashMap<IVec3, (usize, bool)> = HashMap::new();
        for face in 0..FACE_COUNT {
            for (y, x) in (0..columns).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                let st = |i: u32| unwarp(2.0 * f64::from(i) / f64::from(cells) - 1.0);
                let node = direction(face, st(x), st(y));
                let found = known.get(&rounded(node)).copied().unwrap_or_else(|| {
                    let map = directions.len();
                    directions.push(node);
                    known.insert(rounded(-node), (map, true));
                    known.insert(rounded(node), (map, false));
                    (map, false)
                });
                nodes.push(found);
            }
        }
        assert_eq!(directions.len(), Self::map_count(cells), "maps of a grid of {cells} cells");
        NodeGrid { cells, nodes, directions }
    }

    pub fn map_direction(&self, map: usize) -> DVec3 {
        self.directions[map]
    }

    /// The cell around a direction of any length but 0.
    pub fn cell(&self, toward: DVec3) -> Cell {
        let (face, s, t) = face_st(toward);
        let last = f64::from(self.cells - 1);
        let at = DVec2::new(self.along(s), self.along(t));
        let low = at.floor().clamp(DVec2::ZERO, DVec2::splat(last));
        let middle = at - low;
        // On a cube's edge the lines of both its faces have a kink: so neither axis counts there.
        let border = at.min(f64::from(self.cells) - at);
        let eased = (middle.min(1.0 - middle).min(border.yx()) / EASED).clamp(DVec2::ZERO, DVec2::ONE);
        let columns = self.cells as usize + 1;
        let node = |i, j| self.nodes[(face * columns + low.y as usize + j) * columns + low.x as usize + i];
        Cell { face, low, middle, eased, nodes: [node(0, 0), node(1, 0), node(0, 1), node(1, 1)] }
    }

    /// Bilinear weights of a cell's nodes for a direction near the one that the cell lies around. They add up to 1.
    /// Beyond the cell they extrapolate as far as [`BEYOND`]. They are continuous in both directions, also where the
    /// cell changes ([`EASED`]).
    pub fn weights(&self, cell: &Cell, toward: DVec3) -> [f64; 4] {
        let (forward, right, down) = face_basis(cell.face);
        let ahead = toward.dot(forward).max(LEAST_AHEAD);
        let at = DVec2::new(self.along(toward.dot(right) / ahead), self.along(toward.dot(down) / ahead)) - cell.low;
        let place = cell.middle + cell.eased * (at - cell.middle);
        let DVec2 { x: u, y: v } = place.clamp(DVec2::splat(-BEYOND), DVec2::splat(1.0 + BEYOND));
        [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
    }

    /// Place among the cells of a face's row or column.
    fn along(&self, s: f64) -> f64 {
        (warp(s) + 1.0) / 2.0 * f64::from(self.cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_nodes_share_a_map_and_weights_lead_back_to_the_direction() {
        for cells in [1, 2, 5, 8] {
            let grid = NodeGrid::new(cells);
            assert_eq!(grid.nodes.len(), (6 * (cells + 1) * (cells + 1)) as usize);
            assert!(grid.nodes.iter().any(|(_, mirrored)| *mirrored));
            let mut rng = fastrand::Rng::with_seed(7);
            for _ in 0..500 {
                let toward = DVec3::from_array([0; 3].map(|_| 2.0 * rng.f64() - 1.0)).normalize();
                let cell = grid.cell(toward);
                let weights = grid.weights(&cell, toward);
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                let node = |(map, mirrored)| if mirrored { -grid.map_direction(map) } else { grid.map_direction(map) };
                let mean: DVec3 = cell.nodes.into_iter().zip(weights).map(|(n, weight)| weight * node(n)).sum();
                // The mean of a cell's corners lies in the cell: at most half its diagonal from any direction in it.
                let cell = std::f64::consts::FRAC_PI_2 / f64::from(cells);
                assert!(mean.angle_between(toward) < 0.3 * cell, "{toward} {mean} at {cells} cells");
            }
        }
    }

    #[test]
    fn weights_have_no_step_where_the_cell_changes() {
        const STEP: f64 = 1e-7;
        let grid = NodeGrid::new(8);
        let mut rng = fastrand::Rng::with_seed(3);
        let mut random = || DVec3::from_array([0; 3].map(|_| 2.0 * rng.f64() - 1.0)).normalize();
        let mut changed = 0;
        let mut faces = 0;
        let mut worst = 0_f64;
        for _ in 0..20_000 {
            // The border between two directions' cells, found by halving.
            let mut from = random();
            let mut to = random();
            to = (from + 0.1 * to).normalize();
            if grid.cell(from).nodes == grid.cell(to).nodes {
                continue;
            }
            while from.distance(to) > STEP {
                let middle = ((from + to) / 2.0).normalize();
                if grid.cell(middle).nodes == grid.cell(from).nodes { from = middle } else { to = middle }
            }
            let beside = (from + 0.05 * random()).normalize();
            let [a, b] = [from, to].map(|toward| {
                let cell = grid.cell(toward);
                (cell, grid.weights(&cell, beside))
            });
            let of = |(cell, weights): &(Cell, [f64; 4]), node: (usize, bool)| -> f64 {
                cell.nodes.iter().zip(weights).filter(|(n, _)| **n == node).map(|(_, w)| w).sum()
            };
            let nodes = a.0.nodes.into_iter().chain(b.0.nodes);
            worst = nodes.map(|node| (of(&a, node) - of(&b, node)).abs()).fold(worst, f64::max);
            changed += 1;
            faces += usize::from(a.0.face != b.0.face);
        }
        assert!(changed > 5_000 && faces > 500, "{changed} borders, {faces} between faces");
        assert!(worst < 1e3 * STEP, "a weight changes by {worst}");
    }

    #[test]
    fn a_node_itself_has_all_the_weight() {
        let grid = NodeGrid::new(4);
        for map in 0..NodeGrid::map_count(4) {
            for sign in [1.0, -1.0] {
                let toward = sign * grid.map_direction(map);
                let cell = grid.cell(toward);
                let around = || cell.nodes.into_iter().zip(grid.weights(&cell, toward));
                let weight: f64 = around().filter(|(node, _)| node.0 == map).map(|(_, weight)| weight).sum();
                assert!(weight > 1.0 - 1e-6, "map {map}: {cell:?}");
                assert!(around().filter(|(_, weight)| *weight > 0.5).all(|(node, _)| node.1 == (sign < 0.0)));
            }
        }
    }
}
