//! Pass "draw": lit vertices to a picture.
//!
//! Inputs: for each entity its mesh (positions in metres from the centre of its bounding sphere, emission pattern,
//! indices) and its range of the radiosity buffer. Output: RGBA of `width` x `height`, linear.
//! With one sample a pixel, alpha holds the tag of the entity that is seen, and the depth image is kept. With more
//! samples they are averaged.

pub mod camera;
pub mod grid;
pub mod lamp_map;
pub mod mirror;
pub mod pixel_light;
pub mod show;
pub mod sky;
pub mod smooth;
pub mod sun_map;
pub mod triangles;

use crate::asset::grid::Grid;
use crate::asset::mesh::Mesh;
use crate::draw::grid::{DrawGrid, DrawnGrid};
use crate::draw::mirror::{Mirrored, Mirrors};
use crate::draw::pixel_light::{ByPixel, LightImages, PixelLight, Receiver};
use crate::draw::sky::{DrawSky, SeenSky};
use crate::draw::smooth::Smooth;
use crate::draw::triangles::{Detail, DrawTriangles, DrawnLayer, DrawnSurface, DrawnTriangles};
use crate::error::Result;
use crate::gloss::DrawnReflections;
use crate::gpu::{
    Access, Buffer, Commands, Device, Drawing, GraphicsPipeline, GraphicsState, Image, ImageShape, Target, Texture,
};
use crate::lists::sight::{Sight, TriangleRun};
use crate::shaders::{Library, ShaderPermutation};
use crate::sharp::SharpPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};
use std::collections::HashSet;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Linear half floats. Their 11 bits are more than a PNG shows, and they take half the bandwidth of f32.
const COLOR: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;

/// How the edges of what is drawn are kept from showing as stairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Antialias {
    /// One sample a pixel; edges show as stairs.
    None,
    /// One sample a pixel, and outlines and creases smoothed by pass "smooth".
    Outlines,
    /// Four samples a pixel where the device can.
    #[default]
    Samples,
}

impl Antialias {
    /// Default at interactive rates. On a GPU four samples cost little; a software device stores and
    /// averages each.
    pub fn usual(device: &Device) -> Self {
        if device.info.is_software() { Antialias::Outlines } else { Antialias::Samples }
    }

    /// Samples a pixel on a device.
    fn samples(self, device: &Device) -> u32 {
        let limits = &device.limits;
        let offered = limits.framebuffer_color_sample_counts & limits.framebuffer_depth_sample_counts;
        if self == Antialias::Samples && offered.contains(vk::SampleCountFlags::TYPE_4) { 4 } else { 1 }
    }
}

/// Where the light of sharp lights is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Shading {
    /// At vertices only; pixels interpolate.
    Vertex,
    /// At pixels near shadow edges that are finer than the mesh's triangles; else at vertices.
    Pixel,
}

impl Shading {
    /// Default of the shading: pixels where they have several samples, as on a GPU and in files, else vertices. A
    /// pixel that evaluates a few lights takes about 2 us of a core on llvmpipe, one among 45 lamps 100 us.
    pub fn usual(antialias: Antialias) -> Self {
        if antialias == Antialias::Samples { Shading::Pixel } else { Shading::Vertex }
    }
}

pub enum DrawnMesh {
    Triangles(DrawnTriangles),
    /// The mesh is a grid and is drawn as one parallelogram.
    Grid(DrawnGrid, TriangleRun),
}

impl DrawnMesh {
    /// Uploads a mesh with its vertices in `order`. The emission pattern of a mesh without colours is white. `vertices`
    /// counts the vertices of everything that is drawn together. With `by_triangles` no grid is drawn as one.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, order: &[u32], vertices: usize, by_triangles: bool) -> Result<Self> {
        let (centre, _) = mesh.bounding_sphere();
        let mut place = vec![0; order.len()];
        for (at, &v) in order.iter().enumerate() {
            place[v as usize] = at as u32;
        }
        let is_plain = mesh.uvs.is_none() && mesh.tints.is_none() && !by_triangles;
        if let Some(grid) =
            Grid::find(mesh).filter(|_| is_plain).filter(|grid| DrawnGrid::fits(device, grid.vertices.len(), vertices))
        {
            return Ok(DrawnMesh::Grid(
                DrawnGrid::new(device, &grid, centre, &place)?,
                TriangleRun::of(mesh, &mesh.triangles),
            ));
        }
        DrawnTriangles::new(device, mesh, order, &place, !is_plain).map(DrawnMesh::Triangles)
    }

    /// Ranges of indices that have to be drawn, in order: all of them, or those of the runs that may be seen.
    pub fn seen(&self, sight: Option<&Sight>) -> Vec<Range<u32>> {
        let may_see = |faces: &TriangleRun| sight.is_none_or(|sight| sight.may_see(faces));
        let mut out: Vec<Range<u32>> = Vec::new();
        match self {
            DrawnMesh::Grid(_, faces) => out.extend(may_see(faces).then_some(0..DrawnGrid::INDEX_COUNT)),
            DrawnMesh::Triangles(triangles) => {
                for (range, _) in triangles.runs.iter().filter(|(_, faces)| may_see(faces)) {
                    match out.last_mut() {
                        Some(last) if last.end == range.start => last.end = range.end,
                        _ => out.push(range.clone()),
                    }
                }
            }
        }
        out
    }

    /// The grid that it is drawn as, if it is.
    pub fn grid(&self) -> Option<&DrawnGrid> {
        if let DrawnMesh::Grid(grid, _) = self { Some(grid) } else { None }
    }
}

pub struct DrawnEntity<'d> {
    pub mesh: &'d DrawnMesh,
    /// From the mesh's frame (metres from its sphere's centre) to clip space, reversed depth.
    pub clip_from_object: Mat4,
    /// The ranges of the mesh's indices that are drawn.
    pub indices: Vec<Range<u32>>,
    /// The faces that are culled, because they are never seen.
    pub culls: vk::CullModeFlags,
    /// The factor that turns the emission pattern into radiance, linear RGB.
    pub emission: Vec3,
    /// Byte offset of its vertices in the radiosity buffer.
    pub radiosity_offset: u64,
    /// Alpha of the picture where the entity is seen; of a transparent one its opacity, less what textures take.
    pub tag: f32,
    /// Whether it is drawn over what lies behind it.
    pub transparent: bool,
    pub index: u32,
    /// What varies its reflectance, if anything does.
    pub paint: Option<DrawnPaint<'d>>,
    /// How it reflects besides diffusely.
    pub gloss: Option<DrawnGloss<'d>>,
    pub by_pixel: Option<ByPixel>,
}

/// How pixels of a glossy entity are drawn.
#[derive(Clone, Copy)]
pub struct DrawnGloss<'d> {
    pub detail: Detail,
    /// Of gloss, normals and emission.
    pub maps: [Option<&'d Texture>; 3],
}

/// What varies the reflectance of an entity.
#[derive(Clone, Copy)]
pub struct DrawnPaint<'d> {
    pub texture: &'d Texture,
    /// Factor on the texture's colour that gives the reflectance over its mean.
    pub tint: Vec3,
    /// Places whose alpha is less are not drawn.
    pub alpha_cutoff: f32,
}

/// The push constants that all drawing shaders begin with.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct EntityPush {
    clip_from_object: [f32; 16],
    emission_white: [f32; 4],
    tag: f32,
    index: u32,
}

impl EntityPush {
    fn new(entity: &DrawnEntity<'_>, white: f32) -> Self {
        EntityPush {
            clip_from_object: entity.clip_from_object.to_cols_array(),
            emission_white: entity.emission.extend(white).to_array(),
            tag: entity.tag,
            index: entity.index,
        }
    }
}

/// A region of the picture, and what is drawn there.
pub struct DrawnViewport<'d> {
    /// Left, top, width and height in pixels.
    pub area: [u32; 4],
    /// What of it is drawn.
    pub drawn: [u32; 4],
    /// The entities that are drawn, in this order: transparent ones last, from far to near.
    pub entities: Vec<DrawnEntity<'d>>,
    pub radiosity: &'d Buffer,
    /// What glossy entities reflect; `None` where they are shown as diffuse.
    pub gloss: Option<DrawnReflections<'d>>,
    /// Input of pixels that evaluate sharp lights; `None` where only the radiosity of vertices is shown.
    pub pixel: Option<PixelLight<'d>>,
    /// What is seen behind everything; `None` where that has one colour.
    pub sky: Option<SeenSky<'d>>,
    /// Which of the lines that pass "smooth" reads belong to this region.
    pub lines: Range<u32>,
    /// Edges of the mirror whose picture this is, as glsl/mirror_far.frag has them.
    pub edges: [[f32; 4]; 4],
}

/// Edges within which everything lies.
pub const EVERYWHERE: [[f32; 4]; 4] = [[0.0, 0.0, 1.0, 0.0]; 4];

/// How pictures evaluate sharp lights themselves.
#[derive(Clone, Copy, Default)]
pub struct PictureLights {
    /// By pixels, where they do.
    pub pixels: Option<SharpPermutation>,
    /// For highlights, where the scene has such lights.
    pub highlights: Option<SharpPermutation>,
    /// How many mirrors there may be at a time.
    pub mirrors: u32,
    pub mirrored: Mirrored,
    /// Whether pixels evaluate lights in mirrors, too.
    pub mirrored_pixels: bool,
}

/// What pipelines are made of that draw into the same images.
#[derive(Clone)]
pub struct PipelineMaker {
    device: Arc<Device>,
    library: Library,
    state: GraphicsState,
}

impl PipelineMaker {
    /// A pipeline of a vertex and a fragment shader.
    fn make(&self, name: &str, rows: &[ShaderPermutation; 2], state: GraphicsState) -> Result<GraphicsPipeline> {
        let [vertex, fragment] = rows;
        let vertex = self.library.shader(vertex)?;
        let fragment = self.library.shader(fragment)?;
        GraphicsPipeline::new(&self.device, name, &vertex, &fragment, state)
    }
}

/// The pipeline that was made before, or is made now: a scene needs few of all that there are, and one may take half a
/// second to compile.
fn made_once<P>(made: &OnceLock<P>, make: impl FnOnce() -> Result<P>) -> Result<&P> {
    if made.get().is_none() {
        let pipeline = make()?;
        return Ok(made.get_or_init(|| pipeline));
    }
    Ok(made.get().expect("it was made"))
}

pub struct Draw {
    triangles: DrawTriangles,
    grid: DrawGrid,
    sky: DrawSky,
    samples: Option<Image>,
    /// Reversed depth of every sample: 1 at the near plane, 0 at infinity.
    pub depth: Image,
    pub picture: Image,
    /// The most triangles that one render pass draws; the next one goes on. llvmpipe keeps all triangles of a render
    /// pass until its end: for two million triangles it held 300 MiB, and 50 MiB when they were divided.
    pub batch_triangles: u32,
    /// Whether [`Draw::make`] has made the pipelines of the scene.
    pub is_made: bool,
    /// Pass "pixel light", which comes before where pixels evaluate sharp lights.
    light: Option<LightImages>,
    /// Pass "smooth", which follows where outlines are smoothed.
    pub smooth: Option<Smooth>,
    /// Pass "mirror", which comes first where something may be a mirror.
    pub mirrors: Option<Box<Mirrors>>,
}

impl Draw {
    /// For pictures of `width` x `height`.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        [width, height]: [u32; 2],
        antialias: Antialias,
        lights: PictureLights,
    ) -> Result<Self> {
        let samples = antialias.samples(device);
        let shape = ImageShape { format: COLOR, width, height, samples: 1 };
        let state = GraphicsState { depth: Some(DEPTH), samples, ..GraphicsState::plain(COLOR) };
        let maker = PipelineMaker { device: device.clone(), library: library.clone(), state };
        let light = lights.pixels.map(|sharp| LightImages::new(device, library, [width, height], sharp)).transpose()?;
        let fine = antialias == Antialias::Samples || !device.info.is_software();
        let mirrored = light.as_ref().filter(|_| lights.mirrored_pixels);
        Ok(Draw {
            triangles: DrawTriangles::new(maker.clone(), lights),
            grid: DrawGrid::new(maker.clone()),
            sky: DrawSky::new(maker),
            samples: (samples > 1)
                .then(|| Image::new(device, "draw samples", ImageShape { samples, ..shape }))
                .transpose()?,
            depth: Image::new(device, "draw depth", ImageShape { format: DEPTH, samples, ..shape })?,
            picture: Image::new(device, "picture", shape)?,
            batch_triangles: if device.info.is_software() { 1 << 18 } else { u32::MAX / 3 },
            is_made: false,
            smooth: (antialias == Antialias::Outlines).then(|| Smooth::new(device, library, shape)).transpose()?,
            mirrors: (lights.mirrors > 0)
                .then(|| Mirrors::new(device, library, [width, height], lights.mirrors, fine, mirrored).map(Box::new))
                .transpose()?,
            light,
        })
    }

    /// Makes the pipelines of these surfaces, of grids if there are `grids`, and of the `sky` if it is drawn, on all
    /// cores: one may take a second to compile. Others are made where they are first drawn with.
    pub fn make(&self, surfaces: &HashSet<DrawnSurface>, grids: bool, sky: bool) -> Result<()> {
        let light = || {
            let holes = |wanted: bool| surfaces.iter().any(|surface| !surface.transparent && surface.holes == wanted);
            let triangles = [false, true].into_iter().filter(|&wanted| holes(wanted));
            let triangles = triangles.map(|holes| Receiver::Triangles { holes });
            let receivers: Vec<Receiver> = grids.then_some(Receiver::Grid).into_iter().chain(triangles).collect();
            self.light.as_ref().map_or(Ok(()), |light| light.make(&receivers))
        };
        let mirrors = || self.mirrors.as_ref().map_or(Ok(()), |mirrors| mirrors.make(surfaces, grids));
        let shown = || self.make_shown(surfaces, grids);
        let (light, (mirrors, shown)) = rayon::join(light, || rayon::join(mirrors, shown));
        if sky {
            self.sky.pipeline()?;
        }
        light.and(mirrors).and(shown)
    }

    /// Those of them that show the light.
    fn make_shown(&self, surfaces: &HashSet<DrawnSurface>, grids: bool) -> Result<()> {
        let by_pixel = self.evaluates_pixels();
        let grid = || if grids { self.grid.pipeline(by_pixel).map(|_| ()) } else { Ok(()) };
        let (triangles, grid) = rayon::join(|| self.triangles.make(surfaces, by_pixel), grid);
        triangles.and(grid)
    }

    /// Device memory of a pixel in the images of [`Draw::new`] but those of mirrors, bytes; `by_pixel` where pixels
    /// evaluate sharp lights.
    pub fn pixel_bytes(device: &Device, antialias: Antialias, by_pixel: bool) -> u64 {
        let samples = u64::from(antialias.samples(device));
        let colors = 1 + u64::from(antialias == Antialias::Outlines) + if samples > 1 { samples } else { 0 };
        colors * 8 + samples * 4 + if by_pixel { LightImages::pixel_bytes() } else { 0 }
    }

    /// What pass "pixel light" fills for these viewports, if any of them has pixels that evaluate lights.
    pub fn pixel_light(&self, viewports: &[DrawnViewport<'_>]) -> Option<&LightImages> {
        self.light.as_ref().filter(|_| viewports.iter().any(|viewport| viewport.pixel.is_some()))
    }

    /// The light of an entity's pixels in a viewport.
    fn light_of(&self, viewport: &DrawnViewport<'_>, entity: &DrawnEntity<'_>) -> Option<&Image> {
        let has_pixels = viewport.pixel.is_some() && entity.by_pixel.is_some();
        self.light.as_ref().filter(|_| has_pixels).map(LightImages::light)
    }

    /// Whether pixels evaluate sharp lights themselves.
    pub fn evaluates_pixels(&self) -> bool {
        self.light.is_some()
    }

    pub fn samples(&self) -> u32 {
        self.samples.as_ref().map_or(1, |image| image.shape.samples)
    }

    pub fn finished(&self) -> &Image {
        self.smooth.as_ref().map_or(&self.picture, |smooth| &smooth.picture)
    }

    /// Images that the pass writes, and how: colour ones first, the depth image last. No picture needs what they held
    /// before.
    pub fn attachments(&self) -> impl Iterator<Item = (&Image, Access)> {
        let colors = self.samples.iter().chain([&self.picture]).map(|image| (image, Access::ColorWrite));
        colors.chain([(&self.depth, Access::DepthWrite)])
    }

    /// Draws all viewports, one after the other, over a background of one colour and alpha where they have no sky. Radiance
    /// above `white` is brought down to it, hue kept. Between the render passes of a large picture stand barriers of the
    /// pass's own.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        viewports: &[DrawnViewport<'r>],
        background: Vec4,
        white: f32,
    ) -> Result<()> {
        // Its hue is kept, as that of surfaces is.
        let brightest = background.truncate().max_element();
        let factor = if brightest > white { white / brightest } else { 1.0 };
        let background = (factor * background.truncate()).extend(background.w);
        let target = Target {
            color: self.samples.as_ref().unwrap_or(&self.picture),
            second: None,
            clear: Some(background.to_array()),
            depth: Some(&self.depth),
            resolve: self.samples.as_ref().map(|_| &self.picture),
        };
        let every = viewports.iter().flat_map(|viewport| {
            let opaque = viewport.entities.iter().filter(|entity| !entity.transparent);
            opaque.map(move |entity| (viewport, entity))
        });
        let batches = batches(every, 3 * self.batch_triangles);
        let count = batches.len();
        for (number, batch) in batches.into_iter().enumerate() {
            if number > 0 {
                for (image, access) in self.attachments() {
                    commands.image_barrier(image, Some(access), access);
                }
            }
            commands.render_part(&target, [number == 0, number + 1 == count], |drawing| {
                let mut bound: Option<&DrawnEntity<'_>> = None;
                for (viewport, entity, indices) in batch {
                    let light = self.light_of(viewport, entity);
                    if bound.is_none_or(|bound| !std::ptr::eq(bound, entity)) {
                        drawing.part_of(viewport.area, viewport.drawn);
                        if let DrawnMesh::Triangles(mesh) = entity.mesh {
                            let layer = DrawnLayer::Opaque { light };
                            self.triangles.bind(
                                drawing,
                                mesh,
                                entity,
                                viewport,
                                self.mirrors.as_deref(),
                                white,
                                layer,
                            )?;
                        }
                        bound = Some(entity);
                    }
                    match entity.mesh {
                        DrawnMesh::Triangles(_) => drawing.indexed(indices),
                        DrawnMesh::Grid(grid, _) => {
                            self.grid.record(drawing, (grid, indices), entity, viewport, light, white)?;
                        }
                    }
                }
                if number + 1 < count {
                    return Ok(());
                }
                for viewport in viewports {
                    if let Some(sky) = &viewport.sky {
                        drawing.part_of(viewport.area, viewport.drawn);
                        self.sky.record(drawing, sky, white)?;
                    }
                }
                self.record_transparent(drawing, viewports, white)
            })?;
        }
        Ok(())
    }

    /// Draws transparent entities over everything else, from far to near.
    fn record_transparent<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        viewports: &[DrawnViewport<'r>],
        white: f32,
    ) -> Result<()> {
        for viewport in viewports {
            for entity in viewport.entities.iter().filter(|entity| entity.transparent && !entity.indices.is_empty()) {
                let DrawnMesh::Triangles(mesh) = entity.mesh else { continue };
                drawing.part_of(viewport.area, viewport.drawn);
                // Of one entity the nearest place alone is seen, in whatever order its triangles come.
                for layer in [DrawnLayer::Depth, DrawnLayer::Over] {
                    self.triangles.bind(drawing, mesh, entity, viewport, self.mirrors.as_deref(), white, layer)?;
                    entity.indices.iter().for_each(|range| drawing.indexed(range.clone()));
                }
            }
        }
        Ok(())
    }
}

/// Divides the indices of all entities into batches of at most `most` indices. There is at least one batch, which may
/// be empty.
fn batches<'v, 'd>(
    entities: impl Iterator<Item = (&'v DrawnViewport<'d>, &'v DrawnEntity<'d>)>,
    most: u32,
) -> Vec<Vec<(&'v DrawnViewport<'d>, &'v DrawnEntity<'d>, Range<u32>)>> {
    let mut batches = vec![Vec::new()];
    let mut room = most;
    for (viewport, entity) in entities {
        for &Range { mut start, end } in &entity.indices {
            while start < end {
                if room == 0 {
                    batches.push(Vec::new());
                    room = most;
                }
                let next = end.min(start.saturating_add(room));
                room -= next - start;
                batches.last_mut().expect("one at least").push((viewport, entity, start..next));
                start = next;
            }
        }
    }
    batches
}
