//! Part of pass "draw": meshes that are grids, each as one parallelogram whose fragment shader finds the triangle of
//! its cell.
//!
//! The cells of a floor are small on the screen, so that light on them is smooth. A software rasteriser takes far
//! longer for many small triangles than for a large one of the same area. The picture is that of the triangles, except
//! for rounding.
//!
//! Blocks of cells, the patches, are drawn again where their pixels evaluate sharp lights themselves. A software
//! rasteriser runs a fragment shader's branches for all pixels of a block of its own, taken or not. So pixels that
//! evaluate lights are not told from the others in the fragment shader: patches are drawn over the grid by a shader of
//! their own, whose vertex shader throws away those that no shadow's edge comes near.

use crate::asset::grid::Grid;
use crate::draw::pixel_light::{PixelLight, texels};
use crate::draw::{DrawnEntity, DrawnViewport, EntityPush, PipelineMaker, made_once};
use crate::error::Result;
use crate::gpu::{Buffer, Device, Drawing, GraphicsPipeline, GraphicsState, TexelView};
use crate::layout::{QUAD_FORMAT, UPWARDS};
use crate::shaders::ShaderPermutation;
use crate::sharp::SharpPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

const QUADS: vk::Format = vk::Format::R32G32B32A32_UINT;
/// How much nearer patches are drawn than the grid that they lie on, in steps of depth: 2e-6 of the distance. Rounding
/// of two triangles in one plane differs by less.
const NEARER_STEPS: f32 = 32.0;

/// Cells along an edge of a block.
const BLOCK_CELLS: u32 = 4;

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
    positions: Buffer,
    places: Buffer,
    indices: Buffer,
    corners: Buffer,
    cells: [u32; 2],
    /// [`Patches`]: positions, places and indices.
    patches: [Buffer; 3],
    patch_indices: u32,
    normal: Vec3,
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
    pub fn new(device: &Arc<Device>, grid: &Grid, centre: Vec3, normal: Vec3, place: &[u32]) -> Result<Self> {
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
            normal,
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
    first: u32,
    cells: [u32; 2],
    receiver: u32,
    cluster_first: u32,
    spare: [u32; 2],
    normal: [f32; 4],
}

pub struct DrawGrid {
    maker: PipelineMaker,
    /// Made where they are first drawn with; the second one's pixels evaluate sharp lights.
    made: [OnceLock<GraphicsPipeline>; 2],
}

impl DrawGrid {
    pub fn new(maker: PipelineMaker) -> Self {
        DrawGrid { maker, made: Default::default() }
    }

    /// Makes what grids are drawn with, on all cores.
    pub fn make(&self) -> Result<()> {
        let plain = || self.pipeline(None).map(|_| ());
        let pixels = || self.maker.sharp.as_ref().map_or(Ok(()), |sharp| self.pipeline(Some(sharp)).map(|_| ()));
        let (plain, pixels) = rayon::join(plain, pixels);
        plain.and(pixels)
    }

    fn pipeline(&self, sharp: Option<&SharpPermutation>) -> Result<&GraphicsPipeline> {
        let state = self.maker.state;
        let vertex = ShaderPermutation::new("grid.vert", 4);
        let fragment = Self::row(sharp);
        made_once(&self.made[usize::from(sharp.is_some())], || match sharp {
            None => self.maker.make("draw grid", &[vertex, fragment], state),
            Some(_) => {
                // Corners of the grid and of its patches each snap by up to half of a step along both axes.
                let nearer_px = 2.0 * self.maker.device.snap_px() as f32;
                let nearer = GraphicsState { nearer_steps: NEARER_STEPS, nearer_px, ..state };
                let vertex = vertex.define("BLOCK_CELLS", BLOCK_CELLS);
                self.maker.make("draw grid pixels", &[vertex, fragment], nearer)
            }
        })
    }

    pub fn row(sharp: Option<&SharpPermutation>) -> ShaderPermutation {
        let row = ShaderPermutation::new("grid.frag", 4).define("PIXEL", sharp.is_some());
        sharp.map_or(row.clone(), |sharp| sharp.pixel_row(row, false, false))
    }

    /// Draws a range of one's indices in the area that was set, lit by the radiosity of all vertices.
    pub fn record<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        (grid, indices): (&'r DrawnGrid, Range<u32>),
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        white: f32,
    ) -> Result<()> {
        drawing.bind(self.pipeline(None)?, &[(&grid.positions, 0), (&grid.places, 0)], &grid.indices);
        drawing.resources(&texels(&Self::own(grid, viewport))?)?;
        Self::finish(drawing, grid, entity, white, indices);
        Ok(())
    }

    /// Draws an entity's patches over the grid. Their pixels evaluate sharp lights themselves.
    pub fn record_patches<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        grid: &'r DrawnGrid,
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        light: &PixelLight<'r>,
        white: f32,
    ) -> Result<()> {
        let Some(sharp) = &self.maker.sharp else { return Ok(()) };
        let pipeline = self.pipeline(Some(sharp))?;
        let [positions, places, indices] = &grid.patches;
        drawing.bind(pipeline, &[(positions, 0), (places, 0)], indices);
        drawing.resources(&light.binds(&Self::own(grid, viewport), &[])?)?;
        Self::finish(drawing, grid, entity, white, 0..grid.patch_indices);
        Ok(())
    }

    /// Bindings of both fragment shaders.
    fn own<'r>(grid: &'r DrawnGrid, viewport: &DrawnViewport<'r>) -> [(&'r Buffer, vk::Format); 2] {
        [(&grid.corners, QUADS), (viewport.radiosity, QUAD_FORMAT)]
    }

    fn finish(
        drawing: &mut Drawing<'_, '_>,
        grid: &DrawnGrid,
        entity: &DrawnEntity<'_>,
        white: f32,
        indices: Range<u32>,
    ) {
        drawing.push(&Push {
            entity: EntityPush::new(entity, white),
            first: (entity.radiosity_offset / 16) as u32,
            cells: grid.cells,
            receiver: entity.index,
            cluster_first: entity.by_pixel.map_or(0, |by_pixel| by_pixel.cluster_first),
            spare: [0; 2],
            normal: grid.normal.extend(0.0).to_array(),
        });
        drawing.indexed(indices);
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
