//! Pass "gloss": distant and bounced light that glossy surfaces reflect towards the eye.
//!
//! Inputs: the transfer that the merge has left at the end of the sky's chain, light before and after bounces, vertices,
//! the prefiltered sky and the table of lobes. Output: two quads a vertex, which "draw" takes: what is multiplied by the
//! colour of the faced surface, and what is added to it. Below [`PIXEL_ROUGHNESS`] the pass gives the share of the sky
//! that gets through and the light that has bounced, and pixels look the reflection up.
//!
//! A moving camera runs this pass alone; nothing is merged again. Highlights of sharp lights are evaluated at pixels
//! (`glsl/gloss_pixel.glsl`), by the shares that the pass of sharp lights leaves at vertices.

pub mod brdf;
pub mod lobe;
pub mod sky_map;
pub mod twin;

use crate::asset::environment::Environment;
use crate::bake::links;
use crate::bounce::LinkedLight;
use crate::error::Result;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device, TexelView, Texture, Upload};
use crate::layout::{CLUSTER_VERTICES, GlossEntity, NONE, QUAD_FORMAT, SHOWN_LIGHTS};
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use half::f16;
use sky_map::SkyMap;
use std::sync::Arc;

/// Below this roughness pixels look the sky up themselves, as vertices are too far apart for what it shows.
pub const PIXEL_ROUGHNESS: f32 = 0.4;
/// How the pass's textures go on beyond their edges.
const EDGE: [vk::SamplerAddressMode; 2] = [vk::SamplerAddressMode::CLAMP_TO_EDGE; 2];
/// Least cosine by which a lobe is divided, as the transfer holds the cosine already.
pub const LEAST_COSINE: f64 = 0.25;
/// Least light that a share is taken of, as a share of the mean of the sky.
pub const LEAST_SHARE: f64 = 0.1;
/// Four bands ring: shares are cut off above.
pub const MOST_SHARE: f64 = 1.1;
/// Least share of the cosine-weighted hemisphere that is taken to be hidden where the share that a lobe sees of it is
/// found, and the most that this may be.
pub const LEAST_HIDDEN: f64 = 0.02;
pub const MOST_NEARBY: f64 = 4.0;
/// Least cosine between normal and view.
pub const LEAST_VIEW_Z: f64 = 1e-3;
/// Least share of light that counts as reflected once.
pub const LEAST_ENERGY: f64 = 0.1;
/// Most by which a normal map brightens diffuse light.
pub const MOST_TILTED: f64 = 4.0;
/// Least cosine between the normal and a microfacet's.
pub const LEAST_HALF_Z: f64 = 1e-3;
/// How much wider slopes become by the width of a part of a light that counts as a point.
pub const WIDENED: f64 = 0.35;
/// Largest area of slopes by which they become wider: where view and light graze it has no bound.
pub const MOST_SLOPES: f64 = 1.0;
/// Square of half a rectangle of light's longer diagonal as slopes from which on it is no disc, over 1 + p^2, where it lies
/// at p.
pub const WIDE_OUTLINE: f64 = 0.01;
/// Where the cosine between the normal and that of a microfacet that mirrors the light's rim, over alpha, is below the
/// first, the light is a point; above the second it is its outline.
pub const LOW_HALF_Z: [f64; 2] = [0.02, 0.12];

/// Share of a pixel's radiance below which it leaves a highlight out.
const LEAST_HIGHLIGHT: f64 = 0.002;

/// A receiver that reflects: its vertices in the buffers of light.
#[derive(Clone, Copy, Debug)]
pub struct Glossy {
    pub entity: usize,
    pub vertex_count: u32,
    /// The sharp lights whose highlights it shows, or [`NONE`]. They stay so while things move, as the shares of lights
    /// that vertices hold are theirs.
    pub lights: [u32; SHOWN_LIGHTS],
}

/// The macros of every shader that includes `glsl/gloss.glsl`.
pub fn macros(row: ShaderPermutation) -> ShaderPermutation {
    row.number("PIXEL_ROUGHNESS", f64::from(PIXEL_ROUGHNESS))
        .number("LEAST_COSINE", LEAST_COSINE)
        .number("LEAST_SHARE", LEAST_SHARE)
        .number("MOST_SHARE", MOST_SHARE)
        .number("LEAST_HIDDEN", LEAST_HIDDEN)
        .number("MOST_NEARBY", MOST_NEARBY)
        .number("LEAST_VIEW_Z", LEAST_VIEW_Z)
        .number("LEAST_ALPHA", brdf::LEAST_ALPHA)
        .number("LEAST_ENERGY", LEAST_ENERGY)
        .number("MOST_TILTED", MOST_TILTED)
        .number("LEAST_HALF_Z", LEAST_HALF_Z)
        .number("MOST_SLOPES", MOST_SLOPES)
        .number("WIDENED", WIDENED)
        .number("WIDE_OUTLINE", WIDE_OUTLINE)
        .number("LEAST_HIGHLIGHT", LEAST_HIGHLIGHT)
        .number("LOW_FROM", LOW_HALF_Z[0])
        .number("LOW_TO", LOW_HALF_Z[1])
        .number("TABLE", lobe::TABLE as f64)
        .number("LEVELS", lobe::LEVELS as f64)
        .number("MAP_SIDE", sky_map::SIDE as f64)
        .define("TAPS", lobe::TAPS as u32)
}

/// `links` where light bounces.
pub fn gloss_row(texels: bool, links: bool) -> ShaderPermutation {
    links::macros(macros(ShaderPermutation::new("gloss.comp", 4)))
        .define("TEXEL", texels)
        .define("LINKS", links)
        .define("WORKGROUP", CLUSTER_VERTICES)
}

/// Distant light on the device: see [`SkyMap`].
struct FilteredSky {
    map: Texture,
    products: Buffer,
    /// Radiance that 1 in the map stands for.
    scale: f32,
}

impl FilteredSky {
    fn new(device: &Arc<Device>, environment: &Environment) -> Result<Self> {
        let SkyMap { texels, products, scale } = SkyMap::new(environment);
        Ok(FilteredSky {
            map: Texture::of_halves(device, "sky map", (sky_map::SIDE + 2) as u32, &texels, EDGE)?,
            products: Buffer::with_data(device, "products of the sky", &products)?,
            scale,
        })
    }
}

/// Everything that reflections are computed from and kept in.
pub struct Reflections {
    pipeline: ComputePipeline,
    texels: bool,
    sky: FilteredSky,
    lobes: Texture,
    /// One white texel, for surfaces of one colour.
    pub white: Texture,
    /// One texel of a normal that is not tilted.
    pub flat: Texture,
    /// The receivers that reflect.
    pub glossy: Vec<Glossy>,
    /// Clusters that a picture may show: an entity, and the first of its vertices.
    clusters: Upload,
    cluster_count: u32,
    /// [`GlossEntity`] of every entity of the scene, as the eye sees it.
    pub entities: Upload,
    /// For every entity the sharp lights that its highlights are of.
    pub shown_lights: Buffer,
    /// Transfer at the end of the sky's chain, sixteen halves a vertex, which the merge writes.
    pub through: Buffer,
    /// Shares of the shown lights at every vertex, which the pass of sharp lights writes.
    pub shown_shares: Buffer,
    reflected: Buffer,
}

/// What the pass reads of a frame.
pub struct ReflectionInputs<'b> {
    /// Positions and normals.
    pub vertices: &'b Buffer,
    /// Light of every vertex before bounces, and after them.
    pub direct: &'b Buffer,
    pub radiosity: &'b Buffer,
    /// What vertices see along their links, where light bounces.
    pub linked: Option<LinkedLight<'b>>,
}

/// What drawing shaders read of reflections.
#[derive(Clone, Copy)]
pub struct DrawnReflections<'b> {
    pub reflections: &'b Reflections,
    pub vertices: &'b Buffer,
    /// [`crate::layout::DeviceEntity`] of every entity, for highlights.
    pub lights: &'b Buffer,
}

impl Reflections {
    /// For the glossy receivers of a scene of `entity_count` entities, whose buffers of light hold `light_bytes`;
    /// `texels` where the device reads texels faster than blocks, `links` where light bounces.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        environment: &Environment,
        glossy: Vec<Glossy>,
        entity_count: usize,
        light_bytes: u64,
        texels: bool,
        links: bool,
    ) -> Result<Self> {
        let mut shown_lights = vec![[NONE; SHOWN_LIGHTS]; entity_count];
        glossy.iter().for_each(|of| shown_lights[of.entity] = of.lights);
        Ok(Reflections {
            pipeline: ComputePipeline::new(device, "gloss", &library.shader(&gloss_row(texels, links))?)?,
            texels,
            sky: FilteredSky::new(device, environment)?,
            lobes: Texture::of_halves(device, "lobes", lobe::TABLE as u32, &lobe::texels(), EDGE)?,
            white: Texture::of_halves(device, "white", 1, &[[1.0; 4]], EDGE)?,
            flat: Texture::of_halves(device, "flat", 1, &[[0.5, 0.5, 1.0, 1.0]], EDGE)?,
            clusters: Upload::new(device, "glossy clusters", 64)?,
            cluster_count: 0,
            entities: Upload::new(device, "glossy entities", (entity_count * size_of::<GlossEntity>()) as u64)?,
            shown_lights: Buffer::with_data(device, "shown lights", &shown_lights)?,
            through: Buffer::zeros(device, "transfer through", 2 * light_bytes)?,
            shown_shares: Buffer::zeros(device, "shown shares", light_bytes)?,
            reflected: Buffer::zeros(device, "reflected", 2 * light_bytes)?,
            glossy,
        })
    }

    /// The clusters that the next picture may show.
    pub(crate) fn set_clusters(&mut self, clusters: &[[u32; 2]]) -> Result<()> {
        self.cluster_count = clusters.len() as u32;
        self.clusters.write(clusters)
    }

    /// Takes over distant light.
    pub fn set_sky(&mut self, environment: &Environment) -> Result<()> {
        self.sky = FilteredSky::new(&self.through.device().clone(), environment)?;
        Ok(())
    }

    /// Radiance that 1 in the sky's map stands for.
    pub fn sky_scale(&self) -> f32 {
        self.sky.scale
    }

    /// Computes what every vertex reflects.
    pub fn record<'r>(&'r self, commands: &mut Commands<'r>, inputs: &ReflectionInputs<'r>) -> Result<()> {
        let read = |buffer: &'r Buffer| Bind::read(self.texels, buffer, QUAD_FORMAT);
        let mut resources = vec![
            Bind::Buffer(&self.entities),
            Bind::Buffer(&self.clusters),
            read(inputs.vertices)?,
            Bind::Buffer(&self.through),
            Bind::Buffer(&self.sky.products),
            Bind::Texture(&self.sky.map),
            Bind::Texture(&self.lobes),
            read(inputs.direct)?,
            read(inputs.radiosity)?,
            Bind::Buffer(&self.reflected),
        ];
        if let Some(linked) = &inputs.linked {
            resources.extend([
                Bind::read(self.texels, linked.ranges, vk::Format::R32G32_UINT)?,
                Bind::read(self.texels, linked.links, vk::Format::R32_UINT)?,
                read(linked.run_light)?,
                read(linked.run_places)?,
            ]);
        }
        commands.dispatch(&self.pipeline, &resources, &(), [self.cluster_count * CLUSTER_VERTICES, 1, 1])
    }

    /// The two quads of an entity's vertices, as they are stored: `first` is its first vertex.
    pub fn read(&self, first: usize, vertex_count: usize) -> Result<Vec<[[f32; 4]; 2]>> {
        let bytes = 32 * first as u64..32 * (first + vertex_count) as u64;
        self.reflected.download_range(bytes)
    }

    /// The transfer at the end of the sky's chain, of the same vertices.
    pub fn read_through(&self, first: usize, vertex_count: usize) -> Result<Vec<[f64; 16]>> {
        let bytes = 32 * first as u64..32 * (first + vertex_count) as u64;
        let halves: Vec<[f16; 16]> = self.through.download_range(bytes)?;
        Ok(halves.iter().map(|of| of.map(f64::from)).collect())
    }
}

impl<'b> DrawnReflections<'b> {
    /// Whether a device's texel views hold what pixels read.
    pub fn fit(device: &Device, light_bytes: u64, vertices: &Buffer, entity_count: usize) -> bool {
        let entities = (entity_count * size_of::<GlossEntity>()) as u64;
        [2 * light_bytes, vertices.size_bytes, entities]
            .into_iter()
            .all(|bytes| TexelView::fits(device, QUAD_FORMAT, bytes))
    }

    /// Bindings from GLOSS_BINDING on: entities, what vertices reflect, shares of lights, sky map and lobes.
    pub fn binds(&self) -> Result<Vec<Bind<'b>>> {
        let of = self.reflections;
        let texels = |buffer| TexelView::new(buffer, QUAD_FORMAT).map(Bind::Texel);
        Ok(vec![
            texels(&*of.entities)?,
            texels(&of.reflected)?,
            Bind::Texel(TexelView::new(&of.shown_shares, vk::Format::R32G32B32A32_UINT)?),
            Bind::Texture(&of.sky.map),
            Bind::Texture(&of.lobes),
        ])
    }
}
