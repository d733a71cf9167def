//! Arrangement of the directions of a shell, and interpolation between them.

use super::lattice::Lattice;
use crate::sh::cube;
use glam::DVec3;
use std::f64::consts::PI;

/// Cells of a cube face have (almost) equal angles: cell coordinate u = s (c0 + c1 s^2 + c2 s^4) for s in [-1, 1]. This
/// approximates (4/pi) atan(s) within 4.3e-3, with equal value at 1 and equal slope at 0 and 1; a shader evaluates it
/// with three multiply-adds.
pub const CELL_WARP: [f64; 3] = {
    let slope_0 = 4.0 / PI;
    let slope_1 = 2.0 / PI;
    let c2 = (slope_1 - slope_0 - 3.0 * (1.0 - slope_0)) / 2.0;
    [slope_0, 1.0 - slope_0 - c2, c2]
};

/// Cell coordinate in [-1, 1] of face coordinate s in [-1, 1].
pub fn warp(s: f64) -> f64 {
    let q = s * s;
    s * (CELL_WARP[0] + q * (CELL_WARP[1] + q * CELL_WARP[2]))
}

/// Inverse of [`warp`] by Newton's method, which starts at the arctangent's inverse.
pub fn unwarp(u: f64) -> f64 {
    let mut s = (u * PI / 4.0).tan();
    for _ in 0..8 {
        let q = s * s;
        let slope = CELL_WARP[0] + q * (3.0 * CELL_WARP[1] + q * 5.0 * CELL_WARP[2]);
        s -= (warp(s) - u) / slope;
    }
    s
}

/// Face coordinate of the i-th of `columns` nodes along a row, from edge to edge.
fn node_st(i: u32, columns: u32) -> f64 {
    match i {
        0 => -1.0,
        i if i + 1 == columns => 1.0,
        i => unwarp(2.0 * f64::from(i) / f64::from(columns - 1) - 1.0),
    }
}

/// Inverse of [`node_st`], also between nodes.
fn node_at(s: f64, columns: u32) -> f64 {
    (warp(s) + 1.0) / 2.0 * f64::from(columns - 1)
}

impl Lattice {
    /// Whether samples lie on the edges of a cube's faces.
    pub fn has_edges(&self) -> bool {
        self.edges == Some(true)
    }

    fn columns(&self) -> u32 {
        if self.has_edges() { self.cells + 2 } else { self.cells }
    }

    /// Number of directions of one shell; a direction that several faces share counts once per face.
    pub fn direction_count(&self) -> u32 {
        6 * self.columns() * self.columns()
    }

    /// The first index of the direction with this index: a direction that several faces share has several indices.
    pub fn first_of(&self, index: u32) -> u32 {
        if !self.has_edges() {
            return index;
        }
        let columns = self.columns();
        let face = index / (columns * columns);
        let x = index % columns;
        let y = index / columns % columns;
        if [x, y].iter().all(|i| (1..columns - 1).contains(i)) {
            return index;
        }
        let direction = cube::direction(face as usize, node_st(x, columns), node_st(y, columns));
        let most = direction.abs().max_element();
        let first = (0..cube::FACE_COUNT).find(|&f| cube::face_basis(f).0.dot(direction) > most - 1e-9);
        let (first, (forward, right, down)) = first.map(|f| (f as u32, cube::face_basis(f))).expect("one is largest");
        let at = |axis: DVec3| node_at(axis.dot(direction) / forward.dot(direction), columns).round() as u32;
        (first * columns + at(down)) * columns + at(right)
    }

    /// Face coordinate of the i-th captured direction along a row.
    fn st(&self, i: u32) -> f64 {
        let columns = self.columns();
        if self.has_edges() {
            node_st(i, columns)
        } else {
            unwarp((f64::from(i) + 0.5) / f64::from(columns) * 2.0 - 1.0)
        }
    }

    /// The captured direction at a place of a face, or at a place one step beyond one of the face's edges.
    fn captured(&self, face: u32, x: i64, y: i64) -> u32 {
        let columns = self.columns();
        let last = i64::from(columns) - 1;
        let within = |i: i64| (0..=last).contains(&i);
        if within(x) && within(y) {
            return self.first_of((face * columns + y as u32) * columns + x as u32);
        }
        // Projection of a point just beyond the edge finds the neighbouring face. At an edge's end there would be two.
        let st = |i: i64| match i {
            -1 => -1.0 - 1e-6,
            i if i > last => 1.0 + 1e-6,
            i => self.st(i as u32).clamp(-0.999, 0.999),
        };
        let (other, s, t) = cube::face_st(cube::direction(face as usize, st(x), st(y)));
        let (x, y) = if self.has_edges() {
            // One step from the edge, which both faces have.
            let along = |s: f64| node_at(s, columns).round() as u32;
            let step = |s: f64| if s < 0.0 { 1 } else { columns - 2 };
            if s.abs() > t.abs() { (step(s), along(t)) } else { (along(s), step(t)) }
        } else {
            let cell = |s: f64| (((warp(s) + 1.0) / 2.0 * f64::from(columns)).floor() as u32).min(columns - 1);
            (cell(s), cell(t))
        };
        self.first_of((other as u32 * columns + y) * columns + x)
    }

    pub fn stored_direction_count(&self) -> u32 {
        6 * (self.cells + 2) * (self.cells + 2)
    }

    /// Unit direction of the `index`-th captured sample of a shell, in the lattice's space.
    pub fn direction(&self, index: u32) -> DVec3 {
        let columns = self.columns();
        let index = self.first_of(index);
        let face = (index / (columns * columns)) as usize;
        cube::direction(face, self.st(index % columns), self.st(index / columns % columns))
    }

    /// For every stored direction, the captured directions of which it is the mean: one, but on an edge between cells
    /// the two beside it, and in a corner of the cube three.
    pub fn sources(&self) -> Vec<Vec<u32>> {
        if self.has_edges() {
            return (0..self.direction_count()).map(|i| vec![self.first_of(i)]).collect();
        }
        let n = i64::from(self.cells);
        let mut out = Vec::with_capacity(self.stored_direction_count() as usize);
        for face in 0..6 {
            for y in -1..=n {
                for x in -1..=n {
                    let inside_x = x.clamp(0, n - 1);
                    let inside_y = y.clamp(0, n - 1);
                    let nearest = self.captured(face, inside_x, inside_y);
                    out.push(match (x == inside_x, y == inside_y) {
                        (true, true) => vec![nearest],
                        (false, false) => {
                            vec![nearest, self.captured(face, x, inside_y), self.captured(face, inside_x, y)]
                        }
                        _ => vec![nearest, self.captured(face, x, y)],
                    });
                }
            }
        }
        out
    }

    /// The four captured directions around one direction of a cube lattice, as two opposite pairs. Where three edges
    /// meet there are only three, and the one on the third edge is opposite to both others.
    pub fn cell_neighbours(&self, direction: u32) -> Vec<u32> {
        let columns = self.columns();
        let face = direction / (columns * columns);
        let x = i64::from(direction % columns);
        let y = i64::from(direction / columns % columns);
        [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)].map(|(x, y)| self.captured(face, x, y)).to_vec()
    }

    /// The face that a direction meets, and its place among the face's stored samples: 0 to cells + 1.
    pub(super) fn place(&self, direction: DVec3) -> (u32, [f64; 2]) {
        let (face, s, t) = cube::face_st(direction);
        let cells = f64::from(self.cells);
        let place = |s: f64| {
            if self.has_edges() {
                return (warp(s) + 1.0) / 2.0 * (cells + 1.0);
            }
            // The outermost steps are half as wide, and count as whole ones.
            let at = (warp(s) * cells + cells + 1.0) / 2.0;
            at + (at - 1.0).min(0.0) + (at - cells).max(0.0)
        };
        (face as u32, [place(s), place(t)])
    }
}
