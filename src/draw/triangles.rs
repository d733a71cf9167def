//! Part of pass "draw": meshes by their triangles, and those triangles again whose pixels evaluate sharp lights.
//!
//! A triangle is drawn again where the pass of sharp lights has marked one of its vertices and its sides span 4 px on
//! the screen.

use crate::asset::mesh::Mesh;
use crate::draw::pixel_light::{PixelLight, texels};
use crate::draw::{DrawnEntity, DrawnPaint, DrawnViewport, EntityPush, PipelineMaker, made_once};
use crate::error::Result;
use crate::gloss::{self, DrawnReflections};
use crate::gpu::{Bind, Buffer, Device, Drawing, GraphicsPipeline, GraphicsState, Keeps, TexelView};
use crate::layout::QUAD_FORMAT;
use crate::lists::sight::TriangleRun;
use crate::shaders::ShaderPermutation;
use crate::sharp::SharpPermutation;
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashSet;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Triangles in a run. They are few enough that most runs lie on one side of an object, and many enough that a draw
/// call costs little beside them.
const RUN_TRIANGLES: usize = 128;
/// Triangles whose sides are all shorter on the screen, in pixels, have edges as fine as their vertices carry.
const LEAST_PX: f64 = 4.0;
/// How much nearer triangles are drawn that are drawn again, in steps of depth: their corners round as they did before.
const NEARER_STEPS: f32 = 4.0;

pub struct DrawnTriangles {
    /// Positions in metres from the centre of the bounding sphere.
    pub positions: Buffer,
    /// Linear RGB that is multiplied by the entity's emission.
    pub emission: Buffer,
    /// Texture coordinates, and the tint as `packed` says, where the mesh has either.
    pub paint: Option<Buffer>,
    /// Three indices a triangle; neighbouring triangles stand together.
    pub indices: Buffer,
    /// The indices in runs, and which way the triangles of each run face.
    pub runs: Vec<(Range<u32>, TriangleRun)>,
}

impl DrawnTriangles {
    /// Uploads a mesh with its vertices in `order`, where vertex v of the mesh stands at `place[v]`. The emission
    /// pattern of a mesh without colours is white. `painted` where its reflectance may vary.
    pub fn new(device: &Arc<Device>, mesh: &Mesh, order: &[u32], place: &[u32], painted: bool) -> Result<Self> {
        let (centre, _) = mesh.bounding_sphere();
        let color = |v: usize| mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[v]);
        let positions: Vec<[f32; 3]> =
            order.iter().map(|&v| (mesh.positions[v as usize] - centre).to_array()).collect();
        let emission: Vec<[f32; 3]> = order.iter().map(|&v| color(v as usize).to_array()).collect();
        let paint = |&v: &u32| {
            let uv = mesh.uvs.as_ref().map_or(Vec2::ZERO, |uvs| uvs[v as usize]);
            let tint = mesh.tints.as_ref().map_or(Vec3::ONE, |tints| tints[v as usize]);
            // Textures have their first row on top.
            [uv.x, 1.0 - uv.y, packed(tint)]
        };
        let paint: Option<Vec<[f32; 3]>> = painted.then(|| order.iter().map(paint).collect());
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
            paint: paint.map(|paint| Buffer::with_data(device, "draw paint", &paint)).transpose()?,
            indices: Buffer::with_data(device, "draw indices", &triangles)?,
            runs,
        })
    }

    /// Whether a device's texel views hold the mesh, and the vertices and the self-visibility of all meshes, so that
    /// its pixels can evaluate lights.
    pub fn fits_views(&self, device: &Device, vertices: &Buffer, self_cells: &Buffer) -> bool {
        TexelView::fits(device, vk::Format::R32_UINT, self.indices.size_bytes)
            && TexelView::fits(device, vk::Format::R32G32_UINT, self_cells.size_bytes)
            && TexelView::fits(device, vk::Format::R32_UINT, self.emission.size_bytes)
            && TexelView::fits(device, QUAD_FORMAT, vertices.size_bytes)
    }
}

/// A tint from 0 to 1 as a whole number below 2^24, which f32 holds: the roots of its channels, 8 bits each.
fn packed(tint: Vec3) -> f32 {
    let [r, g, b] = tint.to_array().map(|c| (255.0 * c.sqrt()).round());
    r + 256.0 * g + 65536.0 * b
}

/// [`EntityPush`] of a painted entity.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PaintedPush {
    entity: EntityPush,
    index: u32,
    padding: [f32; 2],
    paint: [f32; 4],
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
    paint: [f32; 4],
}

impl DrawnPaint<'_> {
    fn push(&self) -> [f32; 4] {
        self.tint.extend(self.alpha_cutoff).to_array()
    }
}

#[derive(Clone, Copy)]
pub enum Look<'p> {
    /// One reflectance.
    Plain,
    /// Textures or tints vary the reflectance.
    Painted,
    /// It may be painted, and reflects; highlights are of sharp lights that are evaluated so, if there are any.
    Glossy { highlights: Option<&'p SharpPermutation>, detail: Detail },
}

/// What decides which pipelines draw a surface of triangles.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrawnSurface {
    pub painted: bool,
    /// Of a glossy one.
    pub detail: Option<Detail>,
    pub transparent: bool,
}

/// What the pixels of a glossy surface look up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Detail {
    /// Nothing: its vertices reflect.
    Rough,
    /// The sky.
    Mirror,
    /// The sky, and textures of its gloss, normals and emission.
    Textured,
}

impl Look<'_> {
    const COUNT: usize = 5;

    fn number(self) -> usize {
        match self {
            Look::Plain => 0,
            Look::Painted => 1,
            Look::Glossy { detail, .. } => 2 + detail as usize,
        }
    }

    /// The macros of both stages; `first` is the first binding of reflections.
    fn macros(self, row: ShaderPermutation, first: u32) -> ShaderPermutation {
        let row = row.define("PAINTED", !matches!(self, Look::Plain));
        let Look::Glossy { highlights, detail } = self else { return row.define("GLOSS", false) };
        gloss::macros(row)
            .define("GLOSS", true)
            .define("GLOSS_BINDING", first)
            .define("HIGHLIGHTS", highlights.is_some())
            .define("MIRROR", detail != Detail::Rough)
            .define("TEXTURED", detail == Detail::Textured)
    }
}

/// Bindings of reflections in the shaders that show the light of vertices, and in those whose pixels evaluate lights.
const GLOSS_BINDINGS: [u32; 2] = [2, 13];

/// How the triangles of a surface become pixels.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    /// By the light of vertices.
    Vertices,
    /// The same over what lies behind: first the depth of what is nearest, then its colour.
    OverDepth,
    Over,
    /// Pixels evaluate sharp lights.
    Pixels,
}

impl Form {
    const COUNT: usize = 4;
}

fn culled(entity: &DrawnEntity<'_>) -> vk::CullModeFlags {
    if entity.culls { vk::CullModeFlags::BACK } else { vk::CullModeFlags::NONE }
}

pub struct DrawTriangles {
    maker: PipelineMaker,
    /// How the sharp lights are evaluated that glossy surfaces have highlights of.
    highlights: Option<SharpPermutation>,
    /// By look and form; each is made where it is first drawn with.
    made: [[OnceLock<GraphicsPipeline>; Form::COUNT]; Look::COUNT],
}

impl DrawTriangles {
    pub fn new(maker: PipelineMaker, highlights: Option<SharpPermutation>) -> Self {
        DrawTriangles { maker, highlights, made: Default::default() }
    }

    /// Makes what surfaces are drawn with, on all cores.
    pub fn make(&self, surfaces: HashSet<DrawnSurface>) -> Result<()> {
        surfaces.into_par_iter().try_for_each(|surface| {
            let forms: &[Form] = match surface.transparent {
                true => &[Form::OverDepth, Form::Over],
                false if self.maker.sharp.is_some() => &[Form::Vertices, Form::Pixels],
                false => &[Form::Vertices],
            };
            let look = self.look_of(surface.painted, surface.detail);
            forms.par_iter().try_for_each(|form| self.pipeline(look, *form).map(|_| ()))
        })
    }

    fn pipeline(&self, look: Look<'_>, form: Form) -> Result<&GraphicsPipeline> {
        let PipelineMaker { state, sharp, .. } = &self.maker;
        made_once(&self.made[look.number()][form as usize], || {
            let keeps = match form {
                Form::Vertices => state.keeps,
                Form::OverDepth => Keeps::Depth,
                Form::Over => Keeps::ColorOver,
                Form::Pixels => {
                    let sharp = sharp.as_ref().expect("pixels evaluate lights where a scene has sharp ones");
                    let rows = Self::patch_rows(state.samples, look, sharp);
                    let nearer = GraphicsState { nearer_steps: NEARER_STEPS, ..*state };
                    return self.maker.make("draw triangle pixels", &rows, nearer);
                }
            };
            let rows = Self::rows(state.samples, look, form != Form::Vertices);
            self.maker.make("draw", &rows, GraphicsState { keeps, ..*state })
        })
    }

    /// How an entity looks, its paint, and what it reflects.
    fn look<'d>(
        &self,
        entity: &DrawnEntity<'d>,
        viewport: &DrawnViewport<'d>,
    ) -> (Look<'_>, Option<DrawnPaint<'d>>, Option<DrawnReflections<'d>>) {
        let Some((gloss, drawn)) = viewport.gloss.zip(entity.gloss.as_ref()) else {
            return (self.look_of(entity.paint.is_some(), None), entity.paint, None);
        };
        let white = DrawnPaint { texture: &gloss.reflections.white, tint: Vec3::ONE, alpha_cutoff: 0.0 };
        let paint = Some(entity.paint.unwrap_or(white));
        (self.look_of(true, Some(drawn.detail)), paint, Some(gloss))
    }

    fn look_of(&self, painted: bool, detail: Option<Detail>) -> Look<'_> {
        match detail {
            Some(detail) => Look::Glossy { highlights: self.highlights.as_ref(), detail },
            None if painted => Look::Painted,
            None => Look::Plain,
        }
    }

    /// Textures of gloss, normals and emission, or what stands for those that there are not.
    fn maps<'d>(entity: &DrawnEntity<'d>, gloss: DrawnReflections<'d>) -> [Bind<'d>; 3] {
        let maps = entity.gloss.as_ref().map_or([None; 3], |drawn| drawn.maps);
        let neutral = [&gloss.reflections.white, &gloss.reflections.flat, &gloss.reflections.white];
        std::array::from_fn(|k| Bind::Texture(maps[k].unwrap_or(neutral[k])))
    }

    /// The rows of the shaders that show the light of vertices: vertex and fragment. With `over` what they draw lies over
    /// what is behind it.
    pub fn rows(samples: u32, look: Look<'_>, over: bool) -> [ShaderPermutation; 2] {
        let row = |file| look.macros(ShaderPermutation::new(file, 4), GLOSS_BINDINGS[0]);
        let fragment = row("draw.frag").define("OVER", over).define("SAMPLES", samples);
        let fragment = match look {
            Look::Glossy { highlights: Some(sharp), .. } => sharp.pixel_row(fragment, false, false),
            _ => fragment,
        };
        [row("draw.vert"), fragment]
    }

    /// The rows of the shaders whose pixels evaluate lights: vertex and fragment.
    pub fn patch_rows(samples: u32, look: Look<'_>, sharp: &SharpPermutation) -> [ShaderPermutation; 2] {
        let row = |file| look.macros(ShaderPermutation::new(file, 4), GLOSS_BINDINGS[1]);
        let shows = matches!(look, Look::Glossy { highlights: Some(_), .. });
        [
            row("triangle.vert").number("LEAST_PX", LEAST_PX),
            sharp.pixel_row(row("triangle.frag").define("SAMPLES", samples), sharp.self_shadows, shows),
        ]
    }

    /// Makes ready to draw ranges of an entity's indices in the area that was set: of a transparent one the `depth`, or
    /// the colour over what lies behind.
    pub fn bind<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        mesh: &'r DrawnTriangles,
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        white: f32,
        depth: bool,
    ) -> Result<()> {
        let mut vertices =
            vec![(&mesh.positions, 0), (&mesh.emission, 0), (viewport.radiosity, entity.radiosity_offset)];
        let (look, paint, gloss) = self.look(entity, viewport);
        vertices.extend(mesh.paint.iter().filter(|_| paint.is_some()).map(|paint| (paint, 0)));
        let form = match entity.transparent {
            true if depth => Form::OverDepth,
            true => Form::Over,
            false => Form::Vertices,
        };
        drawing.bind(self.pipeline(look, form)?, &vertices, &mesh.indices);
        drawing.cull(culled(entity));
        let push = EntityPush::new(entity, white);
        match paint {
            None => drawing.push(&push),
            Some(paint) => {
                let mut binds = vec![Bind::Texture(paint.texture)];
                if let Some(gloss) = gloss {
                    binds.extend(texels(&[(gloss.vertices, QUAD_FORMAT)])?);
                    binds.extend(gloss.binds()?);
                    binds.extend(Self::maps(entity, gloss));
                    if self.highlights.is_some() {
                        binds.extend(texels(&[(gloss.lights, QUAD_FORMAT)])?);
                    }
                }
                drawing.resources(&binds)?;
                drawing.push(&PaintedPush {
                    entity: push,
                    index: entity.index,
                    padding: [0.0; 2],
                    paint: paint.push(),
                });
            }
        }
        Ok(())
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
        let Some(by_pixel) = entity.by_pixel.filter(|_| self.maker.sharp.is_some()) else { return Ok(()) };
        let (look, paint, gloss) = self.look(entity, viewport);
        drawing.bind(self.pipeline(look, Form::Pixels)?, &[], &mesh.indices);
        drawing.cull(culled(entity));
        let mut binds = light.binds(
            &[(&mesh.indices, vk::Format::R32_UINT), (viewport.radiosity, QUAD_FORMAT)],
            &[
                (light.vertices, QUAD_FORMAT),
                (&mesh.emission, vk::Format::R32_UINT),
                (light.self_cells, vk::Format::R32G32_UINT),
            ],
        )?;
        if let (Some(paint), Some(buffer)) = (paint, &mesh.paint) {
            binds.extend(texels(&[(buffer, vk::Format::R32_UINT)])?);
            binds.push(Bind::Texture(paint.texture));
        }
        if let Some(gloss) = gloss {
            binds.extend(gloss.binds()?);
            binds.extend(Self::maps(entity, gloss));
        }
        drawing.resources(&binds)?;
        let [_, _, width, height] = viewport.area;
        drawing.push(&PatchPush {
            entity: EntityPush::new(entity, white),
            first: (entity.radiosity_offset / 16) as u32,
            half_size: [0.5 * width as f32, 0.5 * height as f32],
            receiver: entity.index,
            cluster_first: by_pixel.cluster_first,
            vertex_first: by_pixel.vertex_first,
            self_first: by_pixel.self_first,
            paint: paint.map_or([0.0; 4], |paint| paint.push()),
        });
        entity.indices.iter().for_each(|range| drawing.corners(range.clone()));
        Ok(())
    }
}
