//! Part of pass "draw": meshes by their triangles, and those triangles again whose pixels evaluate sharp lights.
//!
//! A triangle is drawn again where the pass of sharp lights has marked one of its vertices and its sides span 4 px on
//! the screen.

use crate::asset::mesh::Mesh;
use crate::draw::pixel_light::PixelLight;
use crate::draw::{DrawnEntity, DrawnViewport, EntityPush};
use crate::error::Result;
use crate::gpu::{Buffer, Device, Drawing, GraphicsPipeline, GraphicsState, TexelView};
use crate::lists::sight::TriangleRun;
use crate::shaders::{Library, ShaderPermutation};
use crate::sharp::SharpPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// Triangles in a run. They are few enough that most runs lie on one side of an object, and many enough that a draw
/// call costs little beside them.
const RUN_TRIANGLES: usize = 128;
/// Triangles whose sides are all shorter on the screen, in pixels, have edges as fine as their vertices carry.
const LEAST_PX: f64 = 4.0;
/// How much nearer triangles are drawn that are drawn again, in steps of depth: their corners round as they did before.
const NEARER_STEPS: f32 = 4.0;

/// A mesh's triangles on the device.
pub struct DrawnTriangles {
    /// Positions in metres from the centre of the bounding sphere.
    pub positions: Buffer,
    /// Linear RGB that is multiplied by the entity's emission.
    pub emission: Buffer,
    /// Three indices a triangle; neighbouring triangles stand together.
    pub indices: Buffer,
    /// The indices in runs, and which way the triangles of each run face.
    pub runs: Vec<(Range<u32>, TriangleRun)>,
}

impl DrawnTriangles {
    /// Uploads a mesh with its vertices in `order`, where vertex v of the mesh stands at `place[v]`. The emission
    /// pattern of a mesh without colours is white.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, order: &[u32], place: &[u32]) -> Result<Self> {
        let (centre, _) = mesh.bounding_sphere();
        let color = |v: usize| mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[v]);
        let positions: Vec<[f32; 3]> =
            order.iter().map(|&v| (mesh.positions[v as usize] - centre).to_array()).collect();
        let emission: Vec<[f32; 3]> = order.iter().map(|&v| color(v as usize).to_array()).collect();
        let mut triangles = mesh.triangles.clone();
        triangles.sort_by_cached_key(|t| t.map(|v| place[v as usize]).into_iter().min());
        let mut runs = Vec::with_capacity(triangles.len().div_ceil(RUN_TRIANGLES));
        let mut first = 0;
        for run in triangles.chunks(RUN_TRIANGLES) {
            let end = first + 3 * run.len() as u32;
            runs.push((first..end, TriangleRun::of(mesh, run)));
            first = end;
        }
        triangles.iter_mut().flatten().for_each(|v| *v = place[*v as usize]);
        Ok(DrawnTriangles {
            positions: Buffer::with_data(device, "draw positions", &positions)?,
            emission: Buffer::with_data(device, "draw emission", &emission)?,
            indices: Buffer::with_data(device, "draw indices", &triangles)?,
            runs,
        })
    }

    /// Device memory, bytes.
    pub fn size_bytes(&self) -> u64 {
        self.positions.size_bytes + self.emission.size_bytes + self.indices.size_bytes
    }

    /// Whether a device's texel views hold the mesh, and the vertices and the self-visibility of all meshes, so that
    /// its pixels can evaluate lights.
    pub fn fits_views(&self, device: &Device, vertices: &Buffer, self_cells: &Buffer) -> bool {
        TexelView::fits(device, vk::Format::R32_UINT, self.indices.size_bytes)
            && TexelView::fits(device, vk::Format::R32G32_UINT, self_cells.size_bytes)
            && TexelView::fits(device, vk::Format::R32_UINT, self.emission.size_bytes)
            && TexelView::fits(device, vk::Format::R32G32B32A32_SFLOAT, vertices.size_bytes)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PatchPush {
    entity: EntityPush,
    first: u32,
    half_size: [f32; 2],
    receiver: u32,
    cluster_first: u32,
    vertex_first: u32,
    self_first: u32,
}

pub struct DrawTriangles {
    /// Draws both sides of triangles.
    open: GraphicsPipeline,
    /// Culls back faces.
    solid: GraphicsPipeline,
    /// The one whose pixels evaluate sharp lights, where the scene has any.
    pixel: Option<GraphicsPipeline>,
}

impl DrawTriangles {
    /// For what "draw" draws into; `display` where the picture is encoded.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        state: GraphicsState,
        display: bool,
        sharp: Option<&SharpPermutation>,
    ) -> Result<Self> {
        let vertex = library.shader(&ShaderPermutation::new("draw.vert", 4))?;
        let fragment = library.shader(&ShaderPermutation::new("draw.frag", 4).define("DISPLAY", display))?;
        let solid = GraphicsState { cull: vk::CullModeFlags::BACK, ..state };
        let pixel = |sharp: &SharpPermutation| -> Result<GraphicsPipeline> {
            let [vertex, fragment] = Self::patch_rows(display, sharp);
            let nearer = GraphicsState { nearer_steps: NEARER_STEPS, ..state };
            let vertex = library.shader(&vertex)?;
            let fragment = library.shader(&fragment)?;
            GraphicsPipeline::new(device, "draw triangle pixels", &vertex, &fragment, nearer)
        };
        Ok(DrawTriangles {
            open: GraphicsPipeline::new(device, "draw", &vertex, &fragment, state)?,
            solid: GraphicsPipeline::new(device, "draw solid", &vertex, &fragment, solid)?,
            pixel: sharp.map(pixel).transpose()?,
        })
    }

    /// The rows of the shaders whose pixels evaluate lights: vertex and fragment.
    pub fn patch_rows(display: bool, sharp: &SharpPermutation) -> [ShaderPermutation; 2] {
        let fragment = ShaderPermutation::new("triangle.frag", 4).define("DISPLAY", display);
        [
            ShaderPermutation::new("triangle.vert", 4).number("LEAST_PX", LEAST_PX),
            sharp.pixel_row(fragment, sharp.self_shadows),
        ]
    }

    /// Makes ready to draw ranges of an entity's indices in the area that was set.
    pub fn bind<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        mesh: &'r DrawnTriangles,
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        white: f32,
    ) {
        let vertices = [(&mesh.positions, 0), (&mesh.emission, 0), (viewport.radiosity, entity.radiosity_offset)];
        drawing.bind(if entity.culls { &self.solid } else { &self.open }, &vertices, &mesh.indices);
        drawing.push(&EntityPush::new(entity, white));
    }

    /// Draws the triangles of an entity again that a shadow's edge comes near. Their pixels evaluate sharp lights
    /// themselves.
    pub fn record_patches<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        mesh: &'r DrawnTriangles,
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        light: &PixelLight<'r>,
        white: f32,
    ) -> Result<()> {
        let (Some(pipeline), Some(by_pixel)) = (&self.pixel, entity.by_pixel) else { return Ok(()) };
        drawing.bind(pipeline, &[], &mesh.indices);
        drawing.resources(&light.binds(
            &[(&mesh.indices, vk::Format::R32_UINT), (viewport.radiosity, vk::Format::R32G32B32A32_SFLOAT)],
            &[
                (light.vertices, vk::Format::R32G32B32A32_SFLOAT),
                (&mesh.emission, vk::Format::R32_UINT),
                (light.self_cells, vk::Format::R32G32_UINT),
            ],
        )?)?;
        let [_, _, width, height] = viewport.area;
        drawing.push(&PatchPush {
            entity: EntityPush::new(entity, white),
            first: (entity.radiosity_offset / 16) as u32,
            half_size: [0.5 * width as f32, 0.5 * height as f32],
            receiver: entity.index,
            cluster_first: by_pixel.cluster_first,
            vertex_first: by_pixel.vertex_first,
            self_first: by_pixel.self_first,
        });
        entity.indices.iter().for_each(|range| drawing.corners(range.clone()));
        Ok(())
    }
}
