//! The directions for which a silhouette field has maps: corners of square cells on the faces of a cube.

use super::directions::{unwarp, warp};
use crate::sh::cube::{FACE_COUNT, direction, face_st};
use glam::DVec3;
use std::collections::HashMap;

/// Nodes at the corners of `cells` x `cells` cells of almost equal angles on every cube face, edges and corners shared. Opposite
/// nodes see the same outline from its two sides, so they share a map.
#[derive(Clone, Debug)]
pub struct NodeGrid {
    cells: u32,
    /// Map and whether the node is the opposite of the map's direction, by face, row and column.
    nodes: Vec<(usize, bool)>,
    directions: Vec<DVec3>,
}

/// A node near a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Its map.
    pub map: usize,
    /// Whether the map's own direction is opposite to the node's, so that depths change sign.
    pub mirrored: bool,
    /// Bilinear weight; the four add up to 1.
    pub weight: f64,
}

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
        let mut known = HashMap::new();
        // Shared nodes come out of several faces with different last digits.
        let key = |d: DVec3| (d * f64::from(1 << 20)).round().as_ivec3();
        for face in 0..FACE_COUNT {
            for (y, x) in (0..columns).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                let st = |i: u32| unwarp(2.0 * f64::from(i) / f64::from(cells) - 1.0);
                let node = direction(face, st(x), st(y));
                let found = known.get(&key(node)).copied().unwrap_or_else(|| {
                    let map = directions.len();
                    directions.push(node);
                    known.insert(key(-node), (map, true));
                    known.insert(key(node), (map, false));
                    (map, false)
                });
                nodes.push(found);
            }
        }
        assert_eq!(directions.len(), Self::map_count(cells), "maps of a grid of {cells} cells");
        NodeGrid { cells, nodes, directions }
    }

    /// Unit direction of a map.
    pub fn map_direction(&self, map: usize) -> DVec3 {
        self.directions[map]
    }

    /// Map and mirroring of every node, by face, row and column.
    pub fn nodes(&self) -> &[(usize, bool)] {
        &self.nodes
    }

    /// The four nodes around a direction of any length but 0.
    pub fn around(&self, toward: DVec3) -> [Corner; 4] {
        let (face, s, t) = face_st(toward);
        let columns = self.cells as usize + 1;
        let at = |s: f64| ((warp(s) + 1.0) / 2.0 * f64::from(self.cells)).clamp(0.0, f64::from(self.cells));
        let (u, v) = (at(s), at(t));
        let last = self.cells as usize - 1;
        let (x, y) = ((u as usize).min(last), (v as usize).min(last));
        let (u, v) = (u - x as f64, v - y as f64);
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
            let (map, mirrored) = self.nodes[(face * columns + y + j) * columns + x + i];
            let weight = (if i == 0 { 1.0 - u } else { u }) * (if j == 0 { 1.0 - v } else { v });
            Corner { map, mirrored, weight }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_nodes_share_a_map_and_weights_lead_back_to_the_direction() {
        for cells in [1, 2, 5, 8] {
            let grid = NodeGrid::new(cells);
            assert_eq!(grid.nodes().len(), (6 * (cells + 1) * (cells + 1)) as usize);
            assert!(grid.nodes().iter().any(|(_, mirrored)| *mirrored));
            let mut rng = fastrand::Rng::with_seed(7);
            for _ in 0..500 {
                let toward = DVec3::from_array([0; 3].map(|_| 2.0 * rng.f64() - 1.0)).normalize();
                let around = grid.around(toward);
                let total: f64 = around.iter().map(|corner| corner.weight).sum();
                assert!((total - 1.0).abs() < 1e-12);
                let mean: DVec3 = around
                    .iter()
                    .map(|c| c.weight * if c.mirrored { -1.0 } else { 1.0 } * grid.map_direction(c.map))
                    .sum();
                // The mean of a cell's corners lies in the cell: at most half its diagonal from any direction in it.
                let cell = std::f64::consts::FRAC_PI_2 / f64::from(cells);
                assert!(mean.angle_between(toward) < 0.3 * cell, "{toward} {mean} at {cells} cells");
            }
        }
    }

    #[test]
    fn a_node_itself_has_all_the_weight() {
        let grid = NodeGrid::new(4);
        for map in 0..NodeGrid::map_count(4) {
            for sign in [1.0, -1.0] {
                let around = grid.around(sign * grid.map_direction(map));
                let weight: f64 = around.iter().filter(|c| c.map == map).map(|c| c.weight).sum();
                assert!(weight > 1.0 - 1e-6, "map {map}: {around:?}");
                assert!(around.iter().filter(|c| c.weight > 0.5).all(|c| c.mirrored == (sign < 0.0)));
            }
        }
    }
}
