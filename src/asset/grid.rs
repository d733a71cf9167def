//! Finds flat meshes that are grids, as floors are: equal cells in rows, two triangles each.

use super::Mesh;
use crate::layout::UPWARDS;
use glam::{DVec3, Vec3};

/// Largest distance of a vertex from its grid position, in cells. It allows for rounding to f32 and in files.
const TOLERANCE: f64 = 1e-3;

/// A mesh that covers a parallelogram by cells.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Corner of the first cell, metres.
    pub corner: Vec3,
    /// From there to the ends of the first row and of the first column, metres.
    pub sides: [Vec3; 2],
    /// Number of cells in a row, and number of rows.
    pub cells: [u32; 2],
    /// Vertices of every cell, row by row: at its corners (0, 0), (1, 0), (0, 1) and (1, 1). The first may have
    /// [`UPWARDS`] added.
    pub vertices: Vec<[u32; 4]>,
}

impl Grid {
    /// The mesh as a grid, if it is flat, of one colour, and has every cell exactly once.
    pub fn find(mesh: &Mesh) -> Option<Grid> {
        let triangles = &mesh.triangles;
        if !mesh.is_flat()
            || mesh.colors.is_some()
            || !triangles.len().is_multiple_of(2)
            || mesh.positions.len() >= UPWARDS as usize
        {
            return None;
        }
        let at = |v: u32| mesh.positions[v as usize].as_dvec3();
        // The first cell's corner opposite to the line that its triangles share, and the two beside it.
        let [one, other] = [triangles[0], triangles[1]];
        let apex = (0..3).find(|&k| !other.contains(&one[k]))?;
        let origin = at(one[apex]);
        let steps = [at(one[(apex + 1) % 3]) - origin, at(one[(apex + 2) % 3]) - origin];
        let normal = steps[0].cross(steps[1]);
        // Coordinates along the steps: the dual basis.
        let dual = [steps[1].cross(normal), normal.cross(steps[0])].map(|d| d / normal.length_squared());
        let place = |p: DVec3| dual.map(|d| d.dot(p - origin));
        let places: Vec<[i64; 2]> = mesh
            .positions
            .iter()
            .map(|p| {
                let place = place(p.as_dvec3());
                let whole = place.map(|x| x.round());
                let near = (0..2).all(|k| (place[k] - whole[k]).abs() < TOLERANCE && whole[k].abs() < 1e6);
                near.then(|| whole.map(|x| x as i64))
            })
            .collect::<Option<_>>()?;
        let least = [0, 1].map(|k| places.iter().map(|p| p[k]).min().unwrap_or(0));
        let most = [0, 1].map(|k| places.iter().map(|p| p[k]).max().unwrap_or(0));
        let [columns, rows] = [0, 1].map(|k| most[k] - least[k]);
        if columns <= 0 || rows <= 0 || columns * rows * 2 != triangles.len() as i64 {
            return None;
        }
        let vertices = cells(triangles, &places, least, columns)?;
        let corner = origin + steps[0] * least[0] as f64 + steps[1] * least[1] as f64;
        let sides = [steps[0] * columns as f64, steps[1] * rows as f64].map(|side| side.as_vec3());
        Some(Grid { corner: corner.as_vec3(), sides, cells: [columns as u32, rows as u32], vertices })
    }

    /// Vertices of the cells at its four sides; some occur more than once.
    pub fn rim(&self) -> impl Iterator<Item = u32> {
        let [columns, rows] = self.cells.map(|n| n as usize);
        let at_side = move |cell: usize| {
            let x = cell % columns;
            let y = cell / columns;
            x == 0 || y == 0 || x + 1 == columns || y + 1 == rows
        };
        let cells = self.vertices.iter().enumerate().filter(move |(cell, _)| at_side(*cell));
        cells.flat_map(|(_, vertices)| vertices.map(|v| v & !UPWARDS))
    }
}

/// Vertices of every cell of a grid with `columns` cells in a row, if every cell has two halves along one diagonal.
/// `places` are the vertices' grid coordinates, which start at `least`.
fn cells(triangles: &[[u32; 3]], places: &[[i64; 2]], least: [i64; 2], columns: i64) -> Option<Vec<[u32; 4]>> {
    const NONE: u32 = u32::MAX;
    let mut cells = vec![[NONE; 4]; triangles.len() / 2];
    // The halves found of each cell, as a bit for the corner that the half lacks.
    let mut halves = vec![0_u8; cells.len()];
    for triangle in triangles {
        let corners = triangle.map(|v| places[v as usize]);
        let first = [0, 1].map(|k| corners.iter().map(|c| c[k]).min().unwrap_or(0));
        let cell = ((first[1] - least[1]) * columns + first[0] - least[0]) as usize;
        let mut lacks = 0b1111_u8;
        for (corner, &v) in corners.iter().zip(triangle) {
            let [x, y] = [0, 1].map(|k| corner[k] - first[k]);
            if x > 1 || y > 1 {
                return None;
            }
            let slot = (x + 2 * y) as usize;
            let held = &mut cells.get_mut(cell)?[slot];
            if *held != NONE && *held != v {
                return None;
            }
            *held = v;
            lacks &= !(1 << slot);
        }
        if lacks.count_ones() != 1 || halves[cell] & lacks != 0 {
            return None;
        }
        halves[cell] |= lacks;
    }
    for (cell, halves) in cells.iter_mut().zip(halves) {
        match halves {
            // The triangles lack (0, 0) and (1, 1): they share the line between the others.
            0b1001 => {}
            0b0110 => cell[0] |= UPWARDS,
            _ => return None,
        }
    }
    Some(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::{cuboid, plane, sphere};

    #[test]
    fn planes_are_grids_and_nothing_else_is() {
        let mesh = plane(3.0, 7);
        let grid = Grid::find(&mesh).unwrap();
        assert_eq!(grid.cells, [7, 7]);
        for (number, cell) in grid.vertices.iter().enumerate() {
            let [x, y] = [number % 7, number / 7].map(|i| i as f32 / 7.0);
            let at = |x: f32, y: f32| grid.corner + grid.sides[0] * x + grid.sides[1] * y;
            for (slot, &v) in cell.iter().enumerate() {
                let corner = at(x + (slot % 2) as f32 / 7.0, y + (slot / 2) as f32 / 7.0);
                let found = mesh.positions[(v & !UPWARDS) as usize];
                assert!(found.distance(corner) < 1e-5, "cell {number}, corner {slot}: {found} for {corner}");
            }
        }
        assert!(Grid::find(&sphere(1.0, 1)).is_none() && Grid::find(&cuboid(Vec3::ONE, 2)).is_none());
        let with = |triangles: Vec<[u32; 3]>, positions: Vec<Vec3>| {
            Grid::find(&Mesh::new("odd", positions, Vec::new(), None, triangles).unwrap()).is_some()
        };
        assert!(with(mesh.triangles.clone(), mesh.positions.clone()));
        assert!(!with(mesh.triangles[2..].to_vec(), mesh.positions.clone()), "a cell is missing");
        let mut twice = mesh.triangles.clone();
        twice[5] = twice[4];
        assert!(!with(twice, mesh.positions.clone()), "half of a cell is there twice");
        let mut moved = mesh.positions.clone();
        moved[20].x += 0.01;
        assert!(!with(mesh.triangles.clone(), moved), "a vertex is off its place");
    }

    #[test]
    fn both_ways_of_cutting_a_cell_are_told_apart() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [0.5, 1.0], [2.5, 1.0]].map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
        for triangles in [vec![[0, 2, 1], [1, 2, 3]], vec![[0, 2, 3], [0, 3, 1]]] {
            let mesh = Mesh::new("cell", corners.clone(), Vec::new(), None, triangles).unwrap();
            let grid = Grid::find(&mesh).unwrap();
            let shared: Vec<u32> =
                mesh.triangles[0].iter().filter(|v| mesh.triangles[1].contains(v)).copied().collect();
            let [a, b, c, d] = grid.vertices[0].map(|v| v & !UPWARDS);
            let line = if grid.vertices[0][0] & UPWARDS == 0 { [b, c] } else { [a, d] };
            assert!(line.iter().all(|v| shared.contains(v)), "{grid:?}");
        }
    }
}
