//! Pass "pixel light": sharp lights on the pixels of triangles whose vertices carry a shadow's edge badly, as the pass of
//! sharp lights has marked them.
//!
//! A pixel evaluates the lights of which one of its triangle's vertices misses more than all light there hides, and those
//! that some of them see and others do not. Of the others it blends what vertices have.
//!
//! Every fourth pixel along both axes is evaluated first, for its neighbours too, and finds whether an edge comes near
//! that they show badly: the rule of the vertices, with pixels as steps. Between four of them on one surface that are far
//! from such edges, light is interpolated; the other pixels are evaluated. In a room of wide penumbras 20 % of the pixels
//! of marked triangles are, and pictures differ by 0.0008 of their RMS from those of all pixels.
//!
//! Output: an image of the picture's size with light, shares of highlights' lights, depth, entity and its side
//! (`glsl/screen_light.glsl`), which pass "draw" looks up. It has one sample a pixel: an evaluation is made once a pixel,
//! and llvmpipe skips pixels that are hidden or done where it has no others to test.

use crate::draw::grid::{self, BLOCK_CELLS};
use crate::draw::triangles::DrawnTriangles;
use crate::draw::{DEPTH, DrawnEntity, DrawnMesh, DrawnPaint, DrawnViewport, PipelineMaker, made_once};
use crate::error::Result;
use crate::gpu::{
    Access, Bind, Buffer, Commands, Device, Drawing, GraphicsPipeline, GraphicsState, Image, ImageShape, Target,
    TexelView,
};
use crate::layout::QUAD_FORMAT;
use crate::shaders::{Library, ShaderPermutation};
use crate::sharp::SharpPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Texel of a pixel: light and blue's flag as halves, shares as bytes, depth, entity and its side.
const LIGHT: vk::Format = vk::Format::R32G32B32A32_UINT;
/// Pixels along an edge of a coarse texel.
const COARSE_PX: u32 = 4;
/// Share of its distance that a place may lie in front of a texel's, or behind, and have its light.
const SAME_DEPTH: f64 = 1e-4;
/// Share of the brightest of four coarse texels by which they may differ.
const MOST_CHANGE: f64 = 0.08;
/// Least weight of the four coarse texels around a pixel that lie on its surface.
const LEAST_WHOLE: f64 = 0.5;
/// Binding of the image in the shaders that look it up.
pub(super) const LIGHT_BINDING: u32 = 11;
/// Binding of the coarse image in the shader that interpolates.
const COARSE_BINDING: u32 = 13;

/// Where the pixels of an entity find what they evaluate sharp lights by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByPixel {
    /// Its first cluster in [`PixelLight::chains`].
    pub cluster_first: u32,
    /// The first vertex of its mesh in [`PixelLight::vertices`].
    pub vertex_first: u32,
    /// The first cell of its mesh in [`PixelLight::self_cells`], or [`crate::layout::NONE`].
    pub self_first: u32,
}

pub struct PixelLight<'d> {
    /// [`crate::layout::DeviceEntity`] of every entity.
    pub entities: &'d Buffer,
    /// Nodes and cells of all silhouette fields.
    pub silhouettes: [&'d Buffer; 2],
    pub entries: &'d Buffer,
    /// For every cluster of the lit entities: its first entry, and the number of its entries.
    pub chains: &'d Buffer,
    /// Light on vertices without that of sharp lights.
    pub soft: &'d Buffer,
    pub self_cells: &'d Buffer,
    /// Positions and normals of all meshes.
    pub vertices: &'d Buffer,
    /// Of every entity the lights that its highlights are of, and their shares at all vertices, where the scene has any.
    pub shown: Option<[&'d Buffer; 2]>,
    /// Of all vertices by one light after another; see [`crate::sharp`].
    pub irradiances: &'d Buffer,
}

/// Texel views of buffers, in the order of their bindings.
pub(super) fn texels<'r>(buffers: &[(&'r Buffer, vk::Format)]) -> Result<Vec<Bind<'r>>> {
    buffers.iter().map(|&(buffer, format)| TexelView::new(buffer, format).map(Bind::Texel)).collect()
}

/// The macros of a shader that looks up the light of its pixel, or of one that may.
pub(super) fn shown_light(row: ShaderPermutation, looks_up: bool) -> ShaderPermutation {
    row.define("PIXEL", looks_up).define("LIGHT_BINDING", LIGHT_BINDING).number("SAME_DEPTH", SAME_DEPTH)
}

/// How a pixel comes by its light.
#[derive(Clone, Copy)]
pub enum Way {
    /// It evaluates the lights.
    Evaluated,
    /// From coarse texels, where these suffice.
    Interpolated,
}

#[derive(Clone, Copy)]
pub enum Receiver {
    Grid,
    /// Triangles, of which a texture may mask parts.
    Triangles {
        holes: bool,
    },
}

impl Receiver {
    pub const ALL: [Receiver; 3] =
        [Receiver::Grid, Receiver::Triangles { holes: false }, Receiver::Triangles { holes: true }];

    fn number(self) -> usize {
        match self {
            Receiver::Grid => 0,
            Receiver::Triangles { holes } => 1 + usize::from(holes),
        }
    }

    fn of(entity: &DrawnEntity<'_>) -> Self {
        match entity.mesh {
            DrawnMesh::Grid(..) => Receiver::Grid,
            DrawnMesh::Triangles(mesh) => Receiver::Triangles { holes: mask(entity, mesh).is_some() },
        }
    }
}

/// What masks parts of an entity, and where the texture's coordinates are.
fn mask<'r>(entity: &DrawnEntity<'r>, mesh: &'r DrawnTriangles) -> Option<(DrawnPaint<'r>, &'r Buffer)> {
    entity.paint.filter(|paint| paint.alpha_cutoff > 0.0).zip(mesh.paint.as_ref())
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TrianglePush {
    clip_from_object: [f32; 16],
    first: u32,
    receiver: u32,
    cluster_first: u32,
    vertex_first: u32,
    self_first: u32,
    alpha_cutoff: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GridPush {
    clip_from_object: [f32; 16],
    cells: [u32; 2],
    first: u32,
    receiver: u32,
    cluster_first: u32,
    spare: [u32; 3],
    normal: [f32; 4],
}

/// An image of light with the depth that it was drawn by.
struct Layer {
    light: Image,
    depth: Image,
}

impl Layer {
    fn new(device: &Arc<Device>, name: &str, [width, height]: [u32; 2]) -> Result<Self> {
        let shape = |format| ImageShape { format, width, height, samples: 1 };
        Ok(Layer {
            light: Image::new(device, name, shape(LIGHT))?,
            depth: Image::new(device, &format!("{name}, depth"), shape(DEPTH))?,
        })
    }

    /// Draws into both from nothing, and leaves the light to be read.
    fn render<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        record: impl FnOnce(&mut Drawing<'_, 'r>) -> Result<()>,
    ) -> Result<()> {
        commands.image_barrier(&self.light, None, Access::ColorWrite);
        commands.image_barrier(&self.depth, None, Access::DepthWrite);
        let target = Target { color: &self.light, clear: Some([0.0; 4]), depth: Some(&self.depth), resolve: None };
        commands.render(&target, record)?;
        commands.image_barrier(&self.light, Some(Access::ColorWrite), Access::GraphicsSampled);
        Ok(())
    }
}

struct LightPipelines {
    maker: PipelineMaker,
    sharp: SharpPermutation,
    /// By receiver and way; each is made where it is first drawn with.
    made: [[OnceLock<GraphicsPipeline>; 2]; Receiver::ALL.len()],
}

pub struct LightImages {
    pipelines: Arc<LightPipelines>,
    coarse: Layer,
    fine: Layer,
}

impl LightImages {
    /// For pictures of `width` x `height`.
    pub fn new(device: &Arc<Device>, library: &Library, size: [u32; 2], sharp: SharpPermutation) -> Result<Self> {
        let state = GraphicsState { depth: Some(DEPTH), ..GraphicsState::plain(LIGHT) };
        let maker = PipelineMaker { device: device.clone(), library: library.clone(), state };
        Self::of(Arc::new(LightPipelines { maker, sharp, made: Default::default() }), size)
    }

    /// Others for pictures of `width` x `height`, which share the pipelines.
    pub fn beside(&self, size: [u32; 2]) -> Result<Self> {
        Self::of(self.pipelines.clone(), size)
    }

    fn of(pipelines: Arc<LightPipelines>, size: [u32; 2]) -> Result<Self> {
        let device = &pipelines.maker.device;
        Ok(LightImages {
            coarse: Layer::new(device, "coarse light", size.map(|px| px.div_ceil(COARSE_PX)))?,
            fine: Layer::new(device, "pixel light", size)?,
            pipelines,
        })
    }

    /// Device memory of a pixel, bytes.
    pub fn pixel_bytes() -> u64 {
        let texel = 16 + 4;
        texel + texel / u64::from(COARSE_PX * COARSE_PX)
    }

    /// The light of pixels, for pass "draw".
    pub fn light(&self) -> &Image {
        &self.fine.light
    }

    /// Makes what is drawn with, on all cores.
    pub fn make(&self, receivers: &[Receiver]) -> Result<()> {
        let pairs: Vec<(Receiver, Way)> =
            receivers.iter().flat_map(|of| [(*of, Way::Evaluated), (*of, Way::Interpolated)]).collect();
        pairs.par_iter().try_for_each(|(receiver, way)| self.pipeline(*receiver, *way).map(|_| ()))
    }

    fn pipeline(&self, receiver: Receiver, way: Way) -> Result<&GraphicsPipeline> {
        let LightPipelines { maker, sharp, made } = &*self.pipelines;
        made_once(&made[receiver.number()][way as usize], || {
            maker.make("pixel light", &Self::rows(sharp, receiver, way), maker.state)
        })
    }

    /// Vertex and fragment shader.
    pub fn rows(sharp: &SharpPermutation, receiver: Receiver, way: Way) -> [ShaderPermutation; 2] {
        let grid = matches!(receiver, Receiver::Grid);
        let holes = matches!(receiver, Receiver::Triangles { holes: true });
        let row = |file| ShaderPermutation::new(file, 4).define("HOLES", holes).define("SAMPLES", 1_u32);
        let vertex = match grid {
            true => row("grid.vert").define("BLOCK_CELLS", BLOCK_CELLS),
            false => row("triangle.vert"),
        };
        let vertex = vertex.define("EVALUATED", matches!(way, Way::Evaluated));
        let fragment = match way {
            Way::Evaluated if grid => sharp.pixel_row(row("grid_light.frag"), false),
            Way::Evaluated => sharp.pixel_row(row("triangle.frag"), sharp.self_shadows),
            Way::Interpolated => row("coarse_light.frag")
                .define("GRID", grid)
                .define("COARSE_PX", COARSE_PX)
                .define("COARSE_BINDING", COARSE_BINDING)
                .number("SAME_DEPTH", SAME_DEPTH)
                .number("MOST_CHANGE", MOST_CHANGE)
                .number("LEAST_WHOLE", LEAST_WHOLE),
        };
        [vertex, fragment]
    }

    /// Fills the image for the viewports whose pixels evaluate lights.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, viewports: &[DrawnViewport<'r>]) -> Result<()> {
        commands.count_samples()?;
        self.coarse.render(commands, |drawing| self.draw(drawing, viewports, Way::Evaluated, COARSE_PX))?;
        self.fine.render(commands, |drawing| {
            self.draw(drawing, viewports, Way::Interpolated, 1)?;
            // What was interpolated lies as near, and stays.
            drawing.counted(|drawing| self.draw(drawing, viewports, Way::Evaluated, 1))
        })
    }

    /// Draws marked triangles of all receivers into an image whose texels are `texel_px` pixels wide.
    fn draw<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        viewports: &[DrawnViewport<'r>],
        way: Way,
        texel_px: u32,
    ) -> Result<()> {
        for viewport in viewports {
            let Some(light) = &viewport.pixel else { continue };
            drawing.part_of(viewport.area, viewport.drawn, texel_px);
            for entity in viewport.entities.iter().filter(|entity| !entity.indices.is_empty()) {
                if let Some(by_pixel) = entity.by_pixel {
                    self.draw_entity(drawing, viewport, light, entity, by_pixel, way)?;
                }
            }
        }
        Ok(())
    }

    fn draw_entity<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        viewport: &DrawnViewport<'r>,
        light: &PixelLight<'r>,
        entity: &DrawnEntity<'r>,
        by_pixel: ByPixel,
        way: Way,
    ) -> Result<()> {
        let pipeline = self.pipeline(Receiver::of(entity), way)?;
        let clip_from_object = entity.clip_from_object.to_cols_array();
        let first = (entity.radiosity_offset / 16) as u32;
        match entity.mesh {
            DrawnMesh::Grid(grid, _) => {
                let [positions, places, indices] = &grid.patches;
                let corners = [(positions, 0), (places, 0)];
                let count = if matches!(way, Way::Evaluated) { 2 } else { 1 };
                drawing.bind(pipeline, &corners[..count], indices);
                drawing.resources(&self.binds(viewport, light, (&grid.corners, grid::QUADS), None)?)?;
                drawing.push(&GridPush {
                    clip_from_object,
                    cells: grid.cells,
                    first,
                    receiver: entity.index,
                    cluster_first: by_pixel.cluster_first,
                    spare: [0; 3],
                    normal: grid.normal.extend(0.0).to_array(),
                });
                drawing.indexed(0..grid.patch_indices);
            }
            DrawnMesh::Triangles(mesh) => {
                let mask = mask(entity, mesh);
                drawing.bind(pipeline, &[], &mesh.indices);
                drawing.cull(entity.culls);
                let corners = (&mesh.indices, vk::Format::R32_UINT);
                drawing.resources(&self.binds(viewport, light, corners, mask)?)?;
                drawing.push(&TrianglePush {
                    clip_from_object,
                    first,
                    receiver: entity.index,
                    cluster_first: by_pixel.cluster_first,
                    vertex_first: by_pixel.vertex_first,
                    self_first: by_pixel.self_first,
                    alpha_cutoff: mask.map_or(0.0, |(paint, _)| paint.alpha_cutoff),
                });
                entity.indices.iter().for_each(|range| drawing.corners(range.clone()));
            }
        }
        Ok(())
    }

    /// All bindings of all of its shaders.
    fn binds<'r>(
        &'r self,
        viewport: &DrawnViewport<'r>,
        light: &PixelLight<'r>,
        corners: (&'r Buffer, vk::Format),
        mask: Option<(DrawnPaint<'r>, &'r Buffer)>,
    ) -> Result<Vec<Bind<'r>>> {
        let [nodes, cells] = light.silhouettes;
        let pairs = vk::Format::R32G32_UINT;
        let mut binds = texels(&[
            corners,
            (viewport.radiosity, QUAD_FORMAT),
            (light.entities, QUAD_FORMAT),
            (nodes, QUAD_FORMAT),
            (cells, pairs),
            (light.entries, vk::Format::R32_UINT),
            (light.chains, pairs),
            (light.soft, QUAD_FORMAT),
            (light.vertices, QUAD_FORMAT),
        ])?;
        let texel = |buffer: &'r Buffer, format| TexelView::new(buffer, format).map(Bind::Texel);
        binds.push(light.shown.map_or(Ok(Bind::None), |[lights, _]| texel(lights, grid::QUADS))?);
        binds.push(texel(light.self_cells, pairs)?);
        match mask {
            Some((paint, buffer)) => binds.extend([texel(buffer, vk::Format::R32_UINT)?, Bind::Texture(paint.texture)]),
            None => binds.extend([Bind::None, Bind::None]),
        }
        binds.push(Bind::Image(&self.coarse.light));
        binds.push(texel(light.irradiances, vk::Format::R32_SFLOAT)?);
        binds.push(light.shown.map_or(Ok(Bind::None), |[_, shares]| texel(shares, grid::QUADS))?);
        Ok(binds)
    }
}
