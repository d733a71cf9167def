//! Part of pass "draw": meshes that are grids, each as one parallelogram whose fragment shader finds the triangle of
//! its cell.
//!
//! The cells of a floor are small on the screen, so that light on them is smooth. A software rasteriser takes far
//! longer for many small triangles than for a large one of the same area. The picture is that of the triangles, except
//! for rounding.
//!
//! Blocks of cells, the patches, are drawn by pass "pixel light" where a shadow's edge comes near; a vertex shader throws
//! the others away, whose pixels are those of vertices.

use crate::asset::grid::Grid;
use crate::draw::pixel_light::{LIGHT_BINDING, shown_light, texels};
use crate::draw::{DrawnEntity, DrawnViewport, EntityPush, PipelineMaker, made_once};
use crate::error::Result;
use crate::gpu::{Bind, Buffer, Device, Drawing, GraphicsPipeline, Image, TexelView};
use crate::layout::{QUAD_FORMAT, UPWARDS};
use crate::shaders::ShaderPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

pub(super) const QUADS: vk::Format = vk::Format::R32G32B32A32_UINT;

/// Cells along an edge of a block.
pub(super) const BLOCK_CELLS: u32 = 4;

/// How far a block reaches over its cells on every side, in cells: corners that lie on a neighbour's edge leave cracks.
const OVERLAP: f32 = 1.0 / 16.0;

/// The blocks of a grid, row by row, as they are drawn.
#[derive(Default)]
struct Patches {
    /// Four corners a block in the object's frame, metres.
    positions: Vec<[f32; 3]>,
    /// The same in cells from the first.
    places: Vec<[f32; 2]>,
    /// Two triangles a block.
    indices: Vec<[u32; 3]>,
}

impl Patches {
    /// All blocks of a grid whose first corner is `corner`.
    fn new(grid: &Grid, corner: Vec3) -> Self {
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

pub struct DrawnGrid {
    /// Of the parallelogram.
    pub(super) positions: Buffer,
    places: Buffer,
    /// Of its triangles.
    pub(super) indices: Buffer,
    pub(super) corners: Buffer,
    pub(super) cells: [u32; 2],
    /// [`Patches`]: positions, places and indices.
    pub(super) patches: [Buffer; 3],
    pub(super) patch_indices: u32,
    /// Diagonal of a cell at most, metres.
    pub reach_m: f32,
    /// Longest side of a cell, metres.
    pub step_m: f32,
}

impl DrawnGrid {
    /// Indices of the two triangles that it is drawn as.
    pub const INDEX_COUNT: u32 = 6;

    /// Uploads a grid. `centre` is that of the mesh's bounding sphere, `place` where each vertex of the mesh stands
    /// among those that are lit.
    pub fn new(device: &Arc<Device>, grid: &Grid, centre: Vec3, place: &[u32]) -> Result<Self> {
        let corner = grid.corner - centre;
        let [u, v] = grid.sides;
        let positions = [corner, corner + u, corner + v, corner + u + v].map(|p| p.to_array());
        let [columns, rows] = grid.cells.map(|n| n as f32);
        let places = [[0.0, 0.0], [columns, 0.0], [0.0, rows], [columns, rows]];
        let corners: Vec<[u32; 4]> = grid
            .vertices
            .iter()
            .map(|cell| cell.map(|vertex| place[(vertex & !UPWARDS) as usize] | vertex & UPWARDS))
            .collect();
        let patches = Patches::new(grid, corner);
        Ok(DrawnGrid {
            positions: Buffer::with_data(device, "grid positions", &positions)?,
            places: Buffer::with_data(device, "grid places", &places)?,
            indices: Buffer::with_data(device, "grid indices", &[[0_u32, 1, 2], [2, 1, 3]])?,
            corners: Buffer::with_data(device, "grid corners", &corners)?,
            cells: grid.cells,
            patches: [
                Buffer::with_data(device, "grid patch positions", &patches.positions)?,
                Buffer::with_data(device, "grid patch places", &patches.places)?,
                Buffer::with_data(device, "grid patch indices", &patches.indices)?,
            ],
            patch_indices: 3 * patches.indices.len() as u32,
            reach_m: u.length() / columns + v.length() / rows,
            step_m: (u.length() / columns).max(v.length() / rows),
        })
    }

    /// Whether a device's texel views hold that many cells and that many vertices in all.
    pub fn fits(device: &Device, cells: usize, vertices: usize) -> bool {
        TexelView::fits(device, QUADS, 16 * cells as u64) && TexelView::fits(device, QUAD_FORMAT, 16 * vertices as u64)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    entity: EntityPush,
    cells: [u32; 2],
    first: u32,
    spare: u32,
}

pub struct DrawGrid {
    maker: PipelineMaker,
    /// Made where they are first drawn with; the second one looks up the light of pixels.
    made: [OnceLock<GraphicsPipeline>; 2],
}

impl DrawGrid {
    pub fn new(maker: PipelineMaker) -> Self {
        DrawGrid { maker, made: Default::default() }
    }

    /// What grids are drawn with.
    pub(super) fn pipeline(&self, by_pixel: bool) -> Result<&GraphicsPipeline> {
        made_once(&self.made[usize::from(by_pixel)], || {
            self.maker.make("draw grid", &Self::rows(by_pixel), self.maker.state)
        })
    }

    /// Vertex and fragment shader.
    pub fn rows(by_pixel: bool) -> [ShaderPermutation; 2] {
        [
            ShaderPermutation::new("grid.vert", 4).define("BLOCK_CELLS", 0_u32),
            shown_light(ShaderPermutation::new("grid.frag", 4), by_pixel),
        ]
    }

    /// Draws a range of one's indices in the area that was set, lit by the radiosity of all vertices, or by the `light`
    /// of pixels where that has any.
    pub fn record<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        (grid, indices): (&'r DrawnGrid, Range<u32>),
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        light: Option<&'r Image>,
        white: f32,
    ) -> Result<()> {
        drawing.bind(self.pipeline(light.is_some())?, &[(&grid.positions, 0), (&grid.places, 0)], &grid.indices);
        let mut binds = texels(&[(&grid.corners, QUADS), (viewport.radiosity, QUAD_FORMAT)])?;
        binds.resize(LIGHT_BINDING as usize, Bind::None);
        binds.extend(light.map(Bind::Image));
        drawing.resources(&binds)?;
        drawing.push(&Push {
            entity: EntityPush::new(entity, white),
            cells: grid.cells,
            first: (entity.radiosity_offset / 16) as u32,
            spare: 0,
        });
        drawing.indexed(indices);
        Ok(())
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
