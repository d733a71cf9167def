//! Part of pass "draw": meshes that are grids, each as one parallelogram whose fragment shader finds the triangle of its cell.
//!
//! The cells of a floor are small on the screen, so that light on them is smooth. A software rasteriser takes far longer for many
//! small triangles than for a large one of the same area. The picture is that of the triangles, except for rounding.

use crate::asset::grid::{Grid, UPWARDS};
use crate::draw::DrawnEntity;
use crate::error::Result;
use crate::gpu::{Bind, Buffer, Device, Drawing, GraphicsPipeline, GraphicsState, TexelView};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

const QUADS: vk::Format = vk::Format::R32G32B32A32_UINT;
const FLOATS: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// A grid on the device.
pub struct DrawnGrid {
    positions: Buffer,
    places: Buffer,
    indices: Buffer,
    corners: Buffer,
    cells: [u32; 2],
}

impl DrawnGrid {
    /// Indices of the two triangles that it is drawn as.
    pub const INDEX_COUNT: u32 = 6;

    /// Uploads a grid. `centre` is that of the mesh's bounding sphere, `place` where each vertex of the mesh stands among those
    /// that are lit.
    ///
    /// # Errors
    /// `Device` when memory ran out.
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
        Ok(DrawnGrid {
            positions: Buffer::with_data(device, "grid positions", &positions)?,
            places: Buffer::with_data(device, "grid places", &places)?,
            indices: Buffer::with_data(device, "grid indices", &[[0_u32, 1, 2], [2, 1, 3]])?,
            corners: Buffer::with_data(device, "grid corners", &corners)?,
            cells: grid.cells,
        })
    }

    /// Whether a device's texel views hold that many cells and that many vertices in all.
    pub fn fits(device: &Device, cells: usize, vertices: usize) -> bool {
        TexelView::fits(device, QUADS, 16 * cells as u64) && TexelView::fits(device, FLOATS, 16 * vertices as u64)
    }

    /// Device memory, bytes.
    pub fn size_bytes(&self) -> u64 {
        [&self.positions, &self.places, &self.indices, &self.corners].map(|buffer| buffer.size_bytes).iter().sum()
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    clip_from_object: [f32; 16],
    emission_white: [f32; 4],
    tag: f32,
    first: u32,
    cells: [u32; 2],
}

/// The pipeline.
pub struct DrawGrid {
    pipeline: GraphicsPipeline,
}

impl DrawGrid {
    /// For what "draw" draws into; `display` where the picture is encoded.
    ///
    /// # Errors
    /// `Failed` when a shader does not compile.
    pub fn new(device: &Arc<Device>, library: &Library, state: GraphicsState, display: bool) -> Result<Self> {
        let vertex = library.shader(&ShaderPermutation::new("grid.vert", 4))?;
        let fragment = library.shader(&ShaderPermutation::new("grid.frag", 4).define("DISPLAY", display))?;
        Ok(DrawGrid { pipeline: GraphicsPipeline::new(device, "draw grid", &vertex, &fragment, state)? })
    }

    /// Draws a range of one's indices in the area that was set, lit by the radiosity of all vertices.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn record<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        (grid, indices): (&'r DrawnGrid, Range<u32>),
        entity: &DrawnEntity<'r>,
        radiosity: &'r Buffer,
        white: f32,
    ) -> Result<()> {
        drawing.bind(&self.pipeline, &[(&grid.positions, 0), (&grid.places, 0)], &grid.indices);
        let views = [TexelView::new(&grid.corners, QUADS)?, TexelView::new(radiosity, FLOATS)?];
        drawing.resources(&views.map(Bind::Texel))?;
        drawing.push(&Push {
            clip_from_object: entity.clip_from_object.to_cols_array(),
            emission_white: entity.emission.extend(white).to_array(),
            tag: entity.tag,
            first: (entity.radiosity_offset / 16) as u32,
            cells: grid.cells,
        });
        drawing.indexed(indices);
        Ok(())
    }
}
