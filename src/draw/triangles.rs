//! Part of pass "draw": meshes by their triangles.

use crate::asset::mesh::Mesh;
use crate::draw::PictureLights;
use crate::draw::mirror::{self, Mirrored, Mirrors};
use crate::draw::pixel_light::{LIGHT_BINDING, shown_light, texels};
use crate::draw::{DrawnEntity, DrawnPaint, DrawnViewport, EntityPush, PipelineMaker, made_once};
use crate::error::Result;
use crate::gloss::{self, DrawnReflections};
use crate::gpu::{Bind, Buffer, Device, Drawing, GraphicsPipeline, GraphicsState, Image, Keeps, TexelView};
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

    /// Whether a device's texel views hold the mesh, and the vertices of all meshes, so that its pixels can evaluate
    /// lights.
    pub fn fits_views(&self, device: &Device, vertices: &Buffer) -> bool {
        let numbers = |buffer: &Buffer| TexelView::fits(device, vk::Format::R32_UINT, buffer.size_bytes);
        numbers(&self.indices)
            && self.paint.as_ref().is_none_or(numbers)
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
    padding: [f32; 2],
    paint: [f32; 4],
}

#[derive(Clone, Copy)]
pub enum Look<'p> {
    /// One reflectance.
    Plain,
    /// Textures or tints vary the reflectance.
    Painted,
    /// It may be painted, and reflects; highlights are of sharp lights that are evaluated so, if there are any.
    Glossy { highlights: Option<&'p SharpPermutation>, detail: Detail, mirrored: Mirrored },
}

/// What decides which pipelines draw a surface of triangles.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrawnSurface {
    pub painted: bool,
    /// Of a glossy one.
    pub detail: Option<Detail>,
    pub transparent: bool,
    /// Whether a texture masks parts of it.
    pub holes: bool,
}

/// What the pixels of a glossy surface look up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Detail {
    /// Nothing: its vertices reflect.
    Rough,
    /// The sky, and what it mirrors.
    Mirror,
    /// The same, and textures of its gloss, normals and emission.
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

    /// The macros of both stages.
    fn macros(self, row: ShaderPermutation) -> ShaderPermutation {
        let row = row.define("PAINTED", !matches!(self, Look::Plain));
        let Look::Glossy { highlights, detail, mirrored } = self else { return row.define("GLOSS", false) };
        gloss::macros(row)
            .define("GLOSS", true)
            .define("GLOSS_BINDING", GLOSS_BINDING)
            .define("HIGHLIGHTS", highlights.is_some())
            .define("SHOWN_QUADS", highlights.map_or(1, SharpPermutation::shown_quads))
            .define("MIRROR", detail != Detail::Rough)
            .define("MIRRORED", mirrored != Mirrored::Nothing && detail != Detail::Rough)
            .define("PROBES", mirrored == Mirrored::PlanesAndProbes)
            .define("PROBE_LEVEL", mirror::PROBE_LEVEL)
            .number("PROBE_ZOOM", mirror::PROBE_ZOOM)
            .number("PROBE_SPREAD", mirror::PROBE_SPREAD)
            .define("MIRROR_BINDING", MIRROR_BINDING)
            .number("MIRROR_SPREAD", mirror::SPREAD)
            .number("MIRROR_FLAT", mirror::FLAT)
            .define("TEXTURED", detail == Detail::Textured)
    }
}

/// First binding of reflections.
const GLOSS_BINDING: u32 = 2;
/// First binding of the picture of mirrors.
const MIRROR_BINDING: u32 = LIGHT_BINDING + 1;

/// What is drawn of an entity.
#[derive(Clone, Copy)]
pub enum DrawnLayer<'d> {
    /// An opaque one, by the light of its pixels where they have any of their own.
    Opaque { light: Option<&'d Image> },
    /// Of a transparent one the depth of what is nearest.
    Depth,
    /// Its colour over what lies behind.
    Over,
}

/// How the triangles of a surface become pixels.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// By the light of vertices.
    Vertices,
    /// By the light of pixels where there is any, else of vertices.
    Pixels,
    /// By the light of vertices over what lies behind: first the depth of what is nearest, then its colour.
    OverDepth,
    Over,
}

impl Form {
    const COUNT: usize = 4;
}

pub struct DrawTriangles {
    maker: PipelineMaker,
    /// How the sharp lights are evaluated that glossy surfaces have highlights of.
    highlights: Option<SharpPermutation>,
    mirrored: Mirrored,
    /// By look and form; each is made where it is first drawn with.
    made: [[OnceLock<GraphicsPipeline>; Form::COUNT]; Look::COUNT],
}

impl DrawTriangles {
    pub fn new(maker: PipelineMaker, lights: PictureLights) -> Self {
        DrawTriangles { maker, highlights: lights.highlights, mirrored: lights.mirrored, made: Default::default() }
    }

    /// Makes what surfaces are drawn with, on all cores; `by_pixel` where pixels have light of their own.
    pub fn make(&self, surfaces: &HashSet<DrawnSurface>, by_pixel: bool) -> Result<()> {
        surfaces.par_iter().try_for_each(|surface| {
            let forms: &[Form] = match surface.transparent {
                true => &[Form::OverDepth, Form::Over],
                false if by_pixel => &[Form::Pixels],
                false => &[Form::Vertices],
            };
            let look = self.look_of(surface.painted, surface.detail);
            forms.par_iter().try_for_each(|form| self.pipeline(look, *form).map(|_| ()))
        })
    }

    fn pipeline(&self, look: Look<'_>, form: Form) -> Result<&GraphicsPipeline> {
        let state = self.maker.state;
        made_once(&self.made[look.number()][form as usize], || {
            let keeps = match form {
                Form::Vertices | Form::Pixels => state.keeps,
                Form::OverDepth => Keeps::Depth,
                Form::Over => Keeps::ColorOver,
            };
            let rows = Self::rows(state.samples, look, form);
            self.maker.make("draw", &rows, GraphicsState { keeps, ..state })
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
            Some(detail) => Look::Glossy { highlights: self.highlights.as_ref(), detail, mirrored: self.mirrored },
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

    /// Vertex and fragment shader.
    pub fn rows(samples: u32, look: Look<'_>, form: Form) -> [ShaderPermutation; 2] {
        let row = |file| shown_light(look.macros(ShaderPermutation::new(file, 4)), form == Form::Pixels);
        let over = matches!(form, Form::OverDepth | Form::Over);
        let fragment = row("draw.frag").define("OVER", over).define("SAMPLES", samples);
        let fragment = match look {
            Look::Glossy { highlights: Some(sharp), .. } => sharp.highlight_row(fragment),
            _ => fragment,
        };
        [row("draw.vert"), fragment]
    }

    /// Makes ready to draw ranges of an entity's indices in the area that was set.
    pub fn bind<'r>(
        &'r self,
        drawing: &mut Drawing<'_, 'r>,
        mesh: &'r DrawnTriangles,
        entity: &DrawnEntity<'r>,
        viewport: &DrawnViewport<'r>,
        mirrors: Option<&'r Mirrors>,
        white: f32,
        layer: DrawnLayer<'r>,
    ) -> Result<()> {
        let mut vertices =
            vec![(&mesh.positions, 0), (&mesh.emission, 0), (viewport.radiosity, entity.radiosity_offset)];
        let (look, paint, gloss) = self.look(entity, viewport);
        vertices.extend(mesh.paint.iter().filter(|_| paint.is_some()).map(|paint| (paint, 0)));
        let form = match layer {
            DrawnLayer::Depth => Form::OverDepth,
            DrawnLayer::Over => Form::Over,
            DrawnLayer::Opaque { light: Some(_) } => Form::Pixels,
            DrawnLayer::Opaque { light: None } => Form::Vertices,
        };
        drawing.bind(self.pipeline(look, form)?, &vertices, &mesh.indices);
        drawing.cull(entity.culls);
        let mut binds = Vec::new();
        if let Some(paint) = paint {
            binds.push(Bind::Texture(paint.texture));
        }
        if let Some(gloss) = gloss {
            binds.extend(texels(&[(gloss.vertices, QUAD_FORMAT)])?);
            binds.extend(gloss.binds()?);
            binds.extend(Self::maps(entity, gloss));
            if self.highlights.is_some() {
                binds.extend(texels(&[(gloss.lights, QUAD_FORMAT)])?);
            }
        }
        if let DrawnLayer::Opaque { light: Some(light) } = layer {
            binds.resize(LIGHT_BINDING as usize, Bind::None);
            binds.push(Bind::Image(light));
        }
        if let (Look::Glossy { .. }, Some(mirrors)) = (look, mirrors) {
            binds.resize(MIRROR_BINDING as usize, Bind::None);
            binds.extend(mirrors.binds());
        }
        drawing.resources(&binds)?;
        let push = EntityPush::new(entity, white);
        match paint {
            None => drawing.push(&push),
            Some(DrawnPaint { tint, alpha_cutoff, .. }) => {
                let paint = tint.extend(alpha_cutoff).to_array();
                drawing.push(&PaintedPush { entity: push, padding: [0.0; 2], paint });
            }
        }
        Ok(())
    }
}
