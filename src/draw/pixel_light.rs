//! Pass "pixel light": sharp lights on the pixels of triangles whose vertices carry a shadow's edge badly, as the pass of
//! sharp lights has marked them.
//!
//! A pixel evaluates the lights of which one of its triangle's vertices misses more than all light there hides, and those
//! that some of them see and others do not. Of the others it blends what vertices have.
//!
//! The surfaces that pixels show are drawn first. Every fourth pixel along both axes is evaluated then, for its
//! neighbours too, and finds whether an edge comes near that they show badly: the rule of the vertices, with pixels as
//! steps. Between four of them on one surface that are far from such edges, light is interpolated; the other pixels are
//! listed and evaluated. In a room of wide penumbras 20 % of the pixels of marked triangles are, and pictures differ by
//! 0.0008 of their RMS from those of all pixels.
//!
//! Output: light, shares of highlights' lights, depth, entity and its side of every pixel (`glsl/screen_light.glsl`),
//! which pass "draw" looks up. Places of a list are evaluated side by side: where triangles are small, a fragment shader
//! runs for few pixels of each block of them.

use crate::draw::grid::{self, BLOCK_CELLS};
use crate::draw::lamp_map::LampMaps;
use crate::draw::sun_map::{SUN_BINDING, SunMaps};
use crate::draw::triangles::DrawnTriangles;
use crate::draw::{DEPTH, DrawnEntity, DrawnMesh, DrawnPaint, DrawnViewport, PipelineMaker, made_once};
use crate::error::Result;
use crate::gpu::{
    Access, Bind, Buffer, BufferKind, Commands, ComputePipeline, Device, Drawing, GraphicsPipeline, GraphicsState,
    Image, ImageShape, Target, TexelView,
};
use crate::layout::QUAD_FORMAT;
use crate::shaders::{Library, ShaderPermutation};
use crate::sharp::SharpPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// What is kept of the surface that a pixel shows, twice (`glsl/seen_surface.glsl`).
const SEEN: vk::Format = vk::Format::R32G32B32A32_UINT;
/// Light of a place: light and blue's flag as halves, shares as bytes, depth, entity and its side.
const LIGHT: vk::Format = vk::Format::R32G32B32A32_UINT;
/// Pixels along an edge of a coarse texel.
const COARSE_PX: u32 = 4;
/// Places that one invocation selects, across and down.
const SELECTED_BLOCK: [u32; 2] = [4, 2];
/// Share of its distance that a place may lie in front of a texel's, or behind, and have its light.
const SAME_DEPTH: f64 = 1e-4;
/// Share of the brightest of four coarse texels by which they may differ.
const MOST_CHANGE: f64 = 0.08;
/// Least weight of the four coarse texels around a pixel that lie on its surface.
const LEAST_WHOLE: f64 = 0.9;
/// Binding of pixels' light in the shaders that look it up.
pub(super) const LIGHT_BINDING: u32 = 11;

/// Where the pixels of an entity find what they evaluate sharp lights by.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ByPixel {
    /// Its first vertex among all that are lit.
    pub lit_first: u32,
    /// Its first cluster in [`PixelLight::chains`].
    pub cluster_first: u32,
    /// The first vertex of its mesh in [`PixelLight::vertices`].
    pub vertex_first: u32,
    /// The first cell of its mesh in [`PixelLight::self_cells`], or [`crate::layout::NONE`].
    pub self_first: u32,
}

pub struct PixelLight<'d> {
    /// [`ByPixel`] of every entity.
    pub receivers: &'d Buffer,
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
    /// Maps of suns, where the scene has any.
    pub sun_maps: Option<&'d SunMaps>,
    /// Maps of lamps, where any has one.
    pub lamp_maps: Option<&'d LampMaps>,
}

/// Texel views of buffers, in the order of their bindings.
pub(super) fn texels<'r>(buffers: &[(&'r Buffer, vk::Format)]) -> Result<Vec<Bind<'r>>> {
    buffers.iter().map(|&(buffer, format)| TexelView::new(buffer, format).map(Bind::Texel)).collect()
}

/// The macros of a shader that looks up the light of its pixel, or of one that may.
pub(super) fn shown_light(row: ShaderPermutation, looks_up: bool) -> ShaderPermutation {
    row.define("PIXEL", looks_up).define("LIGHT_BINDING", LIGHT_BINDING).number("SAME_DEPTH", SAME_DEPTH)
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
    vertex_first: u32,
    alpha_cutoff: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GridPush {
    clip_from_object: [f32; 16],
    cells: [u32; 2],
    first: u32,
    receiver: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SelectPush {
    /// Left, top, width and height in pixels.
    part: [u32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct EvaluatePush {
    /// Which of the steps' lists.
    list: u32,
    /// Width of a place in pixels.
    texel_px: u32,
}

/// The head of the list of places (`glsl/pixel_work.glsl`): how many pixels are evaluated in all, and of each step the
/// workgroups that evaluate it and its places.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PixelWork {
    total: u32,
    spare: [u32; 3],
    steps: [[u32; 4]; 2],
}

impl PixelWork {
    const NONE: PixelWork = PixelWork { total: 0, spare: [0; 3], steps: [[0, 1, 1, 0]; 2] };
    const STEPS_AT: u64 = 16;
    const STEP_BYTES: u64 = 16;
}

/// The two steps: coarse places, then pixels.
#[derive(Clone, Copy)]
pub enum Step {
    Coarse,
    Fine,
}

impl Step {
    fn texel_px(self) -> u32 {
        if matches!(self, Step::Coarse) { COARSE_PX } else { 1 }
    }
}

/// Each is made where it is first needed.
struct LightPipelines {
    maker: PipelineMaker,
    sharp: SharpPermutation,
    /// By receiver.
    drawn: [OnceLock<GraphicsPipeline>; Receiver::ALL.len()],
    select: [OnceLock<ComputePipeline>; 2],
    evaluate: OnceLock<ComputePipeline>,
    /// [`PixelWork::NONE`].
    none: Buffer,
}

pub struct LightImages {
    pipelines: Arc<LightPipelines>,
    /// What pixels show.
    seen: [Image; 2],
    depth: Image,
    /// [`PixelWork`] and the places of one step.
    work: Buffer,
    /// Light of the places of each step.
    light: [Image; 2],
}

impl LightImages {
    /// For pictures of `width` x `height`.
    pub fn new(device: &Arc<Device>, library: &Library, size: [u32; 2], sharp: SharpPermutation) -> Result<Self> {
        let state = GraphicsState { depth: Some(DEPTH), second: Some(SEEN), ..GraphicsState::plain(SEEN) };
        let maker = PipelineMaker { device: device.clone(), library: library.clone(), state };
        let pipelines = LightPipelines {
            maker,
            sharp,
            drawn: Default::default(),
            select: Default::default(),
            evaluate: OnceLock::new(),
            none: Buffer::with_data(device, "no pixel work", &[PixelWork::NONE])?,
        };
        Self::of(Arc::new(pipelines), size)
    }

    /// Others for pictures of `width` x `height`, which share the pipelines.
    pub fn beside(&self, size: [u32; 2]) -> Result<Self> {
        Self::of(self.pipelines.clone(), size)
    }

    fn of(pipelines: Arc<LightPipelines>, size: [u32; 2]) -> Result<Self> {
        let device = &pipelines.maker.device;
        let image = |name, format, texel_px: u32| {
            let [width, height] = size.map(|px| px.div_ceil(texel_px));
            Image::new(device, name, ImageShape { format, width, height, samples: 1 })
        };
        let pixels: u64 = size.map(u64::from).iter().product();
        let work_bytes = size_of::<PixelWork>() as u64 + 4 * pixels;
        Ok(LightImages {
            seen: [image("seen triangles", SEEN, 1)?, image("seen places", SEEN, 1)?],
            depth: image("seen depth", DEPTH, 1)?,
            work: Buffer::new(device, "pixel work", BufferKind::Device, work_bytes)?,
            light: [image("coarse light", LIGHT, COARSE_PX)?, image("pixel light", LIGHT, 1)?],
            pipelines,
        })
    }

    /// Device memory of a pixel, bytes.
    pub fn pixel_bytes() -> u64 {
        let seen = 2 * 16 + 4;
        let work = 4;
        let light = 16;
        seen + work + light + light / u64::from(COARSE_PX * COARSE_PX)
    }

    /// The light of pixels, for pass "draw".
    pub fn light(&self) -> &Image {
        &self.light[Step::Fine as usize]
    }

    /// Makes all pipelines for these receivers, on all cores.
    pub fn make(&self, receivers: &[Receiver]) -> Result<()> {
        let drawn = || receivers.par_iter().try_for_each(|receiver| self.pipeline(*receiver).map(|_| ()));
        let select = || [Step::Coarse, Step::Fine].iter().try_for_each(|step| self.select(*step).map(|_| ()));
        let (evaluate, others) = rayon::join(|| self.evaluate().map(|_| ()), || drawn().and_then(|()| select()));
        evaluate.and(others)
    }

    fn compute(&self, row: &ShaderPermutation) -> Result<ComputePipeline> {
        let PipelineMaker { device, library, .. } = &self.pipelines.maker;
        ComputePipeline::new(device, "pixel light", &library.shader(row)?)
    }

    fn select(&self, step: Step) -> Result<&ComputePipeline> {
        made_once(&self.pipelines.select[step as usize], || self.compute(&Self::select_row(step)))
    }

    fn evaluate(&self) -> Result<&ComputePipeline> {
        let LightPipelines { evaluate, sharp, .. } = &*self.pipelines;
        made_once(evaluate, || self.compute(&Self::evaluate_row(sharp)))
    }

    fn pipeline(&self, receiver: Receiver) -> Result<&GraphicsPipeline> {
        let LightPipelines { maker, drawn, .. } = &*self.pipelines;
        made_once(&drawn[receiver.number()], || maker.make("seen surfaces", &Self::rows(receiver), maker.state))
    }

    /// Vertex and fragment shader that draw what pixels show.
    pub fn rows(receiver: Receiver) -> [ShaderPermutation; 2] {
        let row = |file| ShaderPermutation::new(file, 4);
        match receiver {
            Receiver::Grid => [row("grid.vert").define("BLOCK_CELLS", BLOCK_CELLS), row("grid_seen.frag")],
            Receiver::Triangles { holes } => {
                ["triangle.vert", "triangle.frag"].map(|file| row(file).define("HOLES", holes).define("SAMPLES", 1_u32))
            }
        }
    }

    pub fn select_row(step: Step) -> ShaderPermutation {
        ShaderPermutation::new("select.comp", 4)
            .define("COARSE", matches!(step, Step::Coarse))
            .define("COARSE_PX", COARSE_PX)
            .define("BLOCK_X", SELECTED_BLOCK[0])
            .define("BLOCK_Y", SELECTED_BLOCK[1])
            .number("SAME_DEPTH", SAME_DEPTH)
            .number("MOST_CHANGE", MOST_CHANGE)
            .number("LEAST_WHOLE", LEAST_WHOLE)
    }

    pub fn evaluate_row(sharp: &SharpPermutation) -> ShaderPermutation {
        sharp
            .pixel_row(ShaderPermutation::new("pixel_light.comp", 4))
            .define("SUN_BINDING", SUN_BINDING)
            .define("LAMP_BINDING", SUN_BINDING + 2)
    }

    /// Finds the light of pixels in the viewports whose pixels evaluate lights.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, viewports: &[DrawnViewport<'r>]) -> Result<()> {
        let images = self.seen.each_ref().map(|seen| (seen, Access::ColorWrite));
        let images = images.into_iter().chain([(&self.depth, Access::DepthWrite)]);
        images.clone().for_each(|(image, access)| commands.image_barrier(image, None, access));
        let [color, second] = self.seen.each_ref();
        let target =
            Target { color, second: Some(second), clear: Some([0.0; 4]), depth: Some(&self.depth), resolve: None };
        commands.render(&target, |drawing| self.draw(drawing, viewports))?;
        images.for_each(|(image, access)| commands.image_barrier(image, Some(access), Access::ComputeSampled));
        self.light.iter().for_each(|light| commands.image_barrier(light, None, Access::ComputeWrite));
        let none = &self.pipelines.none;
        commands.copy_range(none, 0..none.size_bytes, &self.work, 0);
        commands.barrier(Access::TransferWrite, Access::ComputeWrite);
        let mut is_first = true;
        for viewport in viewports {
            let Some(light) = &viewport.pixel else { continue };
            if !is_first {
                // The steps begin anew; the sum of all pixels goes on.
                let steps = PixelWork::STEPS_AT..none.size_bytes;
                commands.barrier(Access::ComputeWrite, Access::TransferWrite);
                commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
                commands.barrier(Access::Indirect, Access::TransferWrite);
                commands.copy_range(none, steps, &self.work, PixelWork::STEPS_AT);
                commands.barrier(Access::TransferWrite, Access::ComputeWrite);
            }
            is_first = false;
            self.light_places(commands, viewport, light, Step::Coarse)?;
            commands.barrier(Access::ComputeWrite, Access::ComputeSampled);
            commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
            commands.barrier(Access::Indirect, Access::ComputeWrite);
            self.light_places(commands, viewport, light, Step::Fine)?;
        }
        commands.barrier(Access::ComputeWrite, Access::GraphicsSampled);
        Ok(())
    }

    /// Has the pass tell how many pixels it has evaluated.
    pub fn count<'r>(&'r self, commands: &mut Commands<'r>) -> Result<()> {
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        commands.count(&self.work, 0)
    }

    /// Lists the places of a step in a viewport, and evaluates them.
    fn light_places<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        viewport: &DrawnViewport<'r>,
        light: &PixelLight<'r>,
        step: Step,
    ) -> Result<()> {
        let [seen, places] = self.seen.each_ref().map(Bind::Image);
        let depth = Bind::Image(&self.depth);
        let [coarse, _] = &self.light;
        let found = &self.light[step as usize];
        let work = Bind::Buffer(&self.work);
        let resources =
            [seen.clone(), places.clone(), depth.clone(), work.clone(), Bind::Image(found), Bind::Image(coarse)];
        // Eight by eight blocks of places make a workgroup of 64, from the place that holds the first pixel.
        let [left, top, width, height] = viewport.drawn;
        let texel_px = step.texel_px();
        let count = |first: u32, size: u32| (first + size).div_ceil(texel_px) - first / texel_px;
        let [across, down] = SELECTED_BLOCK;
        let elements = [64 * count(left, width).div_ceil(8 * across), count(top, height).div_ceil(8 * down), 1];
        commands.dispatch(self.select(step)?, &resources, &SelectPush { part: viewport.drawn }, elements)?;
        commands.barrier(Access::ComputeWrite, Access::ComputeRead);
        commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
        commands.barrier(Access::ComputeWrite, Access::Indirect);
        let mut binds = light.binds(viewport.radiosity)?;
        binds.splice(11..14, [seen, places, depth]);
        binds.extend([work, Bind::Image(found)]);
        binds.extend(match light.sun_maps {
            Some(SunMaps { heights, maps }) => {
                [TexelView::new(maps, QUAD_FORMAT).map(Bind::Texel)?, Bind::Image(heights)]
            }
            None => [Bind::None, Bind::None],
        });
        if let Some(LampMaps { texels: found, maps }) = light.lamp_maps {
            binds.extend(texels(&[(maps, QUAD_FORMAT), (found, vk::Format::R32_SFLOAT)])?);
        }
        let push = EvaluatePush { list: step as u32, texel_px };
        let groups = (&self.work, PixelWork::STEPS_AT + PixelWork::STEP_BYTES * step as u64);
        commands.dispatch_indirect(self.evaluate()?, &binds, &push, groups)
    }

    /// Draws marked triangles of all receivers.
    fn draw<'r>(&'r self, drawing: &mut Drawing<'_, 'r>, viewports: &[DrawnViewport<'r>]) -> Result<()> {
        for viewport in viewports {
            let Some(light) = &viewport.pixel else { continue };
            drawing.part_of(viewport.area, viewport.drawn);
            for entity in viewport.entities.iter().filter(|entity| !entity.indices.is_empty()) {
                if let Some(by_pixel) = entity.by_pixel {
                    self.draw_entity(drawing, viewport, light, entity, by_pixel)?;
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
    ) -> Result<()> {
        let pipeline = self.pipeline(Receiver::of(entity))?;
        let clip_from_object = entity.clip_from_object.to_cols_array();
        let radiosity = (viewport.radiosity, QUAD_FORMAT);
        match entity.mesh {
            DrawnMesh::Grid(grid, _) => {
                let [positions, places, indices] = &grid.patches;
                drawing.bind(pipeline, &[(positions, 0), (places, 0)], indices);
                drawing.resources(&texels(&[(&grid.corners, grid::QUADS), radiosity])?)?;
                drawing.push(&GridPush {
                    clip_from_object,
                    cells: grid.cells,
                    first: by_pixel.lit_first,
                    receiver: entity.index,
                });
                drawing.indexed(0..grid.patch_indices);
            }
            DrawnMesh::Triangles(mesh) => {
                let mask = mask(entity, mesh);
                drawing.bind(pipeline, &[], &mesh.indices);
                drawing.cull(entity.culls);
                let indices = (&mesh.indices, vk::Format::R32_UINT);
                let mut binds = texels(&[indices, radiosity, (light.vertices, QUAD_FORMAT)])?;
                if let Some((paint, buffer)) = mask {
                    binds.extend(texels(&[(buffer, vk::Format::R32_UINT)])?);
                    binds.push(Bind::Texture(paint.texture));
                }
                drawing.resources(&binds)?;
                drawing.push(&TrianglePush {
                    clip_from_object,
                    first: by_pixel.lit_first,
                    receiver: entity.index,
                    vertex_first: by_pixel.vertex_first,
                    alpha_cutoff: mask.map_or(0.0, |(paint, _)| paint.alpha_cutoff),
                });
                entity.indices.iter().for_each(|range| drawing.corners(range.clone()));
            }
        }
        Ok(())
    }
}

impl<'d> PixelLight<'d> {
    /// What evaluation binds, with room for the images of what is seen.
    fn binds(&self, radiosity: &'d Buffer) -> Result<Vec<Bind<'d>>> {
        let [nodes, cells] = self.silhouettes;
        let pairs = vk::Format::R32G32_UINT;
        let mut binds = texels(&[
            (self.receivers, grid::QUADS),
            (radiosity, QUAD_FORMAT),
            (self.entities, QUAD_FORMAT),
            (nodes, QUAD_FORMAT),
            (cells, pairs),
            (self.entries, vk::Format::R32_UINT),
            (self.chains, pairs),
            (self.soft, QUAD_FORMAT),
            (self.vertices, QUAD_FORMAT),
        ])?;
        let texel = |buffer: &'d Buffer, format| TexelView::new(buffer, format).map(Bind::Texel);
        binds.push(self.shown.map_or(Ok(Bind::None), |[lights, _]| texel(lights, grid::QUADS))?);
        binds.push(texel(self.self_cells, pairs)?);
        binds.extend([Bind::None, Bind::None, Bind::None]);
        binds.push(texel(self.irradiances, pairs)?);
        binds.push(self.shown.map_or(Ok(Bind::None), |[_, shares]| texel(shares, grid::QUADS))?);
        Ok(binds)
    }
}
