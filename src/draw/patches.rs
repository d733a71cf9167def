//! Blocks of a grid's cells, which are drawn again where their pixels evaluate sharp lights themselves.
//!
//! A software rasteriser runs a fragment shader's branches for all pixels of a block of its own, taken or not. So
//! pixels that evaluate lights are not told from the others in the fragment shader: blocks of cells are drawn over the
//! grid by a shader of their own, whose vertex shader throws away those that no shadow's edge comes near.

use crate::asset::grid::Grid;
use glam::Vec3;

/// Cells along an edge of a block.
pub const BLOCK_CELLS: u32 = 4;

/// How far a block reaches over its cells on every side, in cells: corners that lie on a neighbour's edge leave cracks.
const OVERLAP: f32 = 1.0 / 16.0;

/// The blocks of a grid, row by row, as they are drawn.
#[derive(Default)]
pub struct Patches {
    /// Four corners a block in the object's frame, metres.
    pub positions: Vec<[f32; 3]>,
    /// The same in cells from the first.
    pub places: Vec<[f32; 2]>,
    /// Two triangles a block.
    pub indices: Vec<[u32; 3]>,
}

impl Patches {
    /// All blocks of a grid whose first corner is `corner`.
    pub fn new(grid: &Grid, corner: Vec3) -> Self {
        let mut patches = Patches::default();
        let [columns, rows] = grid.cells;
        let steps = [grid.sides[0] / columns as f32, grid.sides[1] / rows as f32];
        for (y, x) in
            (0..rows.div_ceil(BLOCK_CELLS)).flat_map(|y| (0..columns.div_ceil(BLOCK_CELLS)).map(move |x| (y, x)))
        {
            let reach = |block: u32, cells: u32| {
                let first = (block * BLOCK_CELLS) as f32;
                [(first - OVERLAP).max(0.0), (first + BLOCK_CELLS as f32 + OVERLAP).min(cells as f32)]
            };
            let across = reach(x, columns);
            let down = reach(y, rows);
            let first = patches.positions.len() as u32;
            for place in [[across[0], down[0]], [across[1], down[0]], [across[0], down[1]], [across[1], down[1]]] {
                patches.positions.push((corner + steps[0] * place[0] + steps[1] * place[1]).to_array());
                patches.places.push(place);
            }
            patches.indices.extend([[0, 1, 2], [2, 1, 3]].map(|triangle| triangle.map(|v| v + first)));
        }
        patches
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::plane;

    /// Blocks cover every cell, and reach over them by no more than the overlap.
    #[test]
    fn blocks_cover_the_grid() {
        for cells in [1, 3, 4, 25] {
            let grid = Grid::find(&plane(3.0, cells)).unwrap();
            let patches = Patches::new(&grid, grid.corner);
            let mut covered = vec![0; (cells * cells) as usize];
            for corners in patches.places.chunks_exact(4) {
                let [low, high] = [corners[0], corners[3]].map(|place| place.map(|at| at.round() as usize));
                for (y, x) in (low[1]..high[1]).flat_map(|y| (low[0]..high[0]).map(move |x| (y, x))) {
                    covered[y * cells as usize + x] += 1;
                }
            }
            assert!(covered.iter().all(|&times| times == 1), "{covered:?}");
            assert_eq!(3 * patches.places.len(), 2 * 3 * patches.indices.len());
            for (position, [x, y]) in patches.positions.iter().zip(&patches.places) {
                let exact = grid.corner + (grid.sides[0] * *x + grid.sides[1] * *y) / cells as f32;
                assert!(Vec3::from_array(*position).distance(exact) < 1e-5 && (0.0..=cells as f32).contains(x));
            }
        }
    }
}
