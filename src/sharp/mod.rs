//! Pass "sharp": light of sharp lights on every vertex of every receiver, with what the merge has written.
//!
//! A light is cut into parts ([`crate::field::sub_light`]); in each part the visibilities past all occluders are
//! multiplied. Output: `radiosity`, as [`crate::merge`] has it, and albedo / pi times the irradiance of sharp lights.
//! Where pixels evaluate lights, the fourth number tells where they do, and of each light irradiance and occluders are
//! kept ([`KeptIrradiance`]).

pub mod twin;

use crate::bake::silhouette::SilhouetteOptions;
use crate::error::Result;
use crate::field::lamp_colors::{SHELL_STEP, SHELLS};
use crate::field::lattice::CELL_WARP;
use crate::field::sheet::{BEYOND as BEYOND_SHEET, CONTACT};
use crate::field::silhouette::{DEEP, HALF_DEPTH, INSIDE, REACH};
use crate::field::silhouette_nodes::{BEYOND, EASED, LEAST_AHEAD};
use crate::field::sub_light::{
    BLEND, CORNER, LIMIT_OUTLINE, LIMIT_SINE, MOST_SINE, NEAR_LIGHT_STEPS, STRIP, THIN, TURNED_BY,
};
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device, TexelView};
use crate::layout::{
    CLUSTER_FORMAT, CLUSTER_VERTICES, ENTRY_BITS, ENTRY_FORMAT, LAMP_AT_REST, MOST_SUN_MAPS, QUAD_FORMAT, SHOWN_LIGHTS,
};
use crate::merge::variant::Reads;
use crate::shaders::{Library, ShaderPermutation};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// How near a shadow's edge must come to a vertex for pixels around it to evaluate lights, in steps to its neighbours:
/// more than the 0.71 that the middle of a grid's cell is away from its corners.
const EDGE_REACH: f64 = 0.75;
/// The same for pixels that are evaluated for others too, where an edge counts that is near to all four around a place.
/// With 1.42, the diagonal, 15 % more pixels are evaluated, and pictures differ from those of all pixels as little.
const PIXEL_EDGE_REACH: f64 = 1.2;
/// Half-width, in the same steps, of the widest penumbra that pixels evaluate, for a light that is all the light of a
/// vertex. For one that is a share of it, it is narrower by the share's square root, because what vertices miss goes
/// with the light and with the inverse square of the width. Pictures then differ by at most 0.0018 relative RMS from
/// pictures whose pixels evaluate every edge.
const EDGE_STEPS: f64 = 1.1;

/// Share of what vertices may miss of all lights that they may miss of one that pixels blend beside those which they
/// evaluate: several of those add up. With 1 a gallery of 20 lamps has 0.0022 more FLIP, with this 0.0005, and its pixels
/// take a tenth longer.
const BLENDED_MISS: f64 = 0.25;

/// The most that vertices miss of a light, in the same measure: eight widths of a penumbra in a step, past which no more
/// than the light itself is missed. Of lights with less than 0.3 % of all light there pixels blend all shadows.
const MOST_MISS: f64 = 64.0;

/// Steps in the width of the narrowest penumbra, of which the square is far from overflow.
const MOST_STEPS: f64 = 1e4;

/// Factor on the sine of a light's radius in which all its parts lie: a part's middle lies [`CORNER`] from the light's,
/// and its rim half a radius on.
const CONE_WIDER: f64 = 1.12;
/// Factor on the radius of an occluder's ball beyond which its outline, which maps of 32 texels blur, takes nothing
/// from a light. With 1.1 no pixel changes, with 1.06 by 0.0009 of the brightest.
const BALL_WIDER: f64 = 1.15;

/// Lookups in the map of a sun that find what hides it, and those that find how much of it is hidden.
const SEEKING_TAPS: u32 = 16;
const BLURRING_TAPS: u32 = 24;
/// Places on a lamp to which rays go, or on each of its four parts, and steps of each ray through a map.
const LAMP_TAPS: u32 = 16;
const PART_TAPS: u32 = 4;
const LAMP_STEPS: u32 = 6;
/// Halvings of the step in which a ray comes out from behind something. With two the edges of a lampshade's light are off
/// by 0.0185 of all light, with one by 0.028.
const HALVINGS: u32 = 3;
/// First binding of the maps of lamps.
const LAMP_BINDING: u32 = 13;
/// Share of its gap that something must still leave where a ray that passes behind it meets it.
const STILL_THERE: f64 = 0.8;
/// How far above a surface something must stand that casts a shadow on it, in texels of the map: above a flat one, and
/// above one that stands for something round, whose vertices have other normals.
const FLAT_BIAS: f64 = 0.1;
const ROUND_BIAS: f64 = 1.0;
/// Least cosine between the normals of a flat triangle and of its vertices.
const FLAT: f64 = 0.9995;
/// Radius of the least blur of a shadow's edge, in texels of the map; twice that where what casts it touches the surface.
const LEAST_BLUR: f64 = 0.75;
/// Share of a sun up to which nothing of it is seen where what hides it touches the surface: half a texel beside the edge.
const DARKENED: f64 = 0.7;
/// How far above a surface something stands that touches it, in texels; at twice as many it does not.
const TOUCHING_TEXELS: f64 = 8.0;
/// Least cosine to the sun by which a surface's plane is steep.
const LEAST_FACING: f64 = 0.02;

/// A permutation of the shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharpPermutation {
    /// How it reads what it is given.
    pub reads: Reads,
    /// Entities that the uniform block holds.
    pub entity_limit: u32,
    /// Sizes of the silhouette fields.
    pub silhouette: SilhouetteOptions,
    /// Whether the scene has a sharp light with an outline of its own.
    pub outlines: bool,
    /// Whether the scene has a sharp light that shines from one flat side.
    pub panels: bool,
    /// Whether the scene has a sharp light whose parts have colours of their own.
    pub colors: bool,
    /// Whether any silhouette field has maps of halves.
    pub halves: bool,
    /// Whether any silhouette field has a box that tells more than its outlines: of a convex mesh that is no ball.
    pub boxes: bool,
    /// Whether any mesh is a sheet.
    pub sheets: bool,
    /// Whether any occluder is a box.
    pub cuboids: bool,
    /// Whether anything may be a globe of glass around a lamp.
    pub globes: bool,
    /// Whether suns have maps of what rests.
    pub sun_maps: bool,
    /// Whether other lights have.
    pub lamp_maps: bool,
    /// Whether any lit mesh can shadow itself.
    pub self_shadows: bool,
    /// Whether the shares of lights whose highlights are shown are kept.
    pub gloss: bool,
    /// Whether there are more of them than four.
    pub many_shown: bool,
    /// Whether the share of its view that lamps take is kept of every vertex, for bounces.
    pub lamps: bool,
    /// Whether vertices that a shadow's edge comes near are marked, and their irradiance by each light is kept, for pixels
    /// that evaluate lights there.
    pub edges: bool,
    /// Whether loops over parts and maps stay loops: on SwiftShader, which takes over 250 s and 8 GB to compile them
    /// unrolled.
    pub rolled: bool,
}

impl SharpPermutation {
    pub fn row(&self) -> ShaderPermutation {
        let row = self.shared(ShaderPermutation::new("sharp.comp", 4)).define("LAMP_BINDING", LAMP_BINDING);
        row.define("SHOWN_QUADS", self.shown_quads()).number("EDGE_REACH", EDGE_REACH)
    }

    /// Fours of lights that highlights are of.
    pub fn shown_quads(&self) -> u32 {
        if self.many_shown { SHOWN_LIGHTS as u32 / 4 } else { 1 }
    }

    /// A shader that evaluates sharp lights on pixels. It reads everything through texel views.
    pub fn pixel_row(&self, row: ShaderPermutation) -> ShaderPermutation {
        SharpPermutation { edges: true, ..*self }.on_pixels(row)
    }

    /// A fragment shader that shows highlights of sharp lights, whose shadows it is given.
    pub fn highlight_row(&self, row: ShaderPermutation) -> ShaderPermutation {
        SharpPermutation { self_shadows: false, edges: false, gloss: false, sun_maps: false, lamp_maps: false, ..*self }
            .on_pixels(row)
    }

    fn on_pixels(self, row: ShaderPermutation) -> ShaderPermutation {
        SharpPermutation { reads: Reads::Texels, lamps: false, ..self }
            .shared(row)
            .number("EDGE_REACH", PIXEL_EDGE_REACH)
    }

    /// The macros of every shader that evaluates sharp lights.
    fn shared(&self, row: ShaderPermutation) -> ShaderPermutation {
        row.define("WORKGROUP", CLUSTER_VERTICES)
            .define("TEXEL", self.reads == Reads::Texels)
            .define("UNIFORM", self.reads == Reads::StorageUniform)
            .define("ENTITY_LIMIT", self.entity_limit)
            .define("ENTRY_BITS", ENTRY_BITS)
            .define("OUTLINES", self.outlines)
            .define("PANELS", self.panels)
            .define("COLORS", self.colors)
            .define("HALVES", self.halves)
            .define("BOXES", self.boxes)
            .define("SHEETS", self.sheets)
            .define("CUBOIDS", self.cuboids)
            .define("GLOBES", self.globes)
            .define("SUN_MAPS", self.sun_maps)
            .define("LAMP_MAPS", self.lamp_maps)
            .define("LAMP_BIT", 1_u32 << MOST_SUN_MAPS)
            .define("LAMP_STEPS", LAMP_STEPS)
            .define("LAMP_TAPS", LAMP_TAPS)
            .define("PART_TAPS", PART_TAPS)
            .define("HALVINGS", HALVINGS)
            .define("SEEKING_TAPS", SEEKING_TAPS)
            .define("BLURRING_TAPS", BLURRING_TAPS)
            .define("SELF", self.self_shadows)
            .define("EDGES", self.edges)
            .define("SHOWN", self.gloss)
            .define("ALL_SHOWN_QUADS", SHOWN_LIGHTS as u32 / 4)
            .define("LAMPS", self.lamps)
            .define("LAMP_AT_REST", LAMP_AT_REST)
            .define("ROLLED", self.rolled)
            .define("NODE_CELLS", self.silhouette.cells)
            .define("MAP", self.silhouette.map_px)
            .number("REACH", REACH)
            .number("SHELL_STEP", SHELL_STEP)
            .number("LAST_SHELL", (SHELLS - 1) as f64)
            .number("INSIDE_FROM", INSIDE[0])
            .number("INSIDE_TO", INSIDE[1])
            .number("HALF_DEPTH", HALF_DEPTH)
            .number("DEEP_FROM", DEEP[0])
            .number("DEEP_TO", DEEP[1])
            .number("CONTACT", CONTACT)
            .number("BEYOND_SHEET", BEYOND_SHEET)
            .number("CONE_WIDER", CONE_WIDER)
            .number("BALL_WIDER", BALL_WIDER)
            .number("EDGE_STEPS", EDGE_STEPS)
            .number("MOST_STEPS", MOST_STEPS)
            .number("BLENDED_MISS", BLENDED_MISS)
            .number("MOST_MISS", MOST_MISS)
            .number("FLAT", FLAT)
            .number("FLAT_BIAS", FLAT_BIAS)
            .number("ROUND_BIAS", ROUND_BIAS)
            .number("LEAST_BLUR", LEAST_BLUR)
            .number("DARKENED", DARKENED)
            .number("TOUCHING_TEXELS", TOUCHING_TEXELS)
            .number("LEAST_FACING", LEAST_FACING)
            .number("STILL_THERE", STILL_THERE)
            .number("NEAR_LIGHT", (NEAR_LIGHT_STEPS / EDGE_STEPS).powi(2))
            .number("MOST_SINE", MOST_SINE)
            .number("LIMIT_SINE", LIMIT_SINE)
            .number("LIMIT_OUTLINE", LIMIT_OUTLINE)
            .number("BLEND", BLEND)
            .number("CORNER", CORNER)
            .number("STRIP", STRIP)
            .number("THIN", THIN)
            .number("BEYOND", BEYOND)
            .number("EASED", EASED)
            .number("LEAST_AHEAD", LEAST_AHEAD)
            .number("TURNED_X", TURNED_BY[0])
            .number("TURNED_Y", TURNED_BY[1])
            .number("TURNED_Z", TURNED_BY[2])
            .number("WARP_0", CELL_WARP[0])
            .number("WARP_1", CELL_WARP[1])
            .number("WARP_2", CELL_WARP[2])
            .outlines()
            .self_visibility()
    }

    /// The permutation with the loops that the device wants, and with storage blocks where its texel views cannot hold
    /// the scene's buffers.
    pub fn fitting(self, device: &Device, [nodes, cells, self_cells]: [&Buffer; 3], soft: &Buffer) -> Self {
        let fits = TexelView::fits(device, vk::Format::R32G32_UINT, self_cells.size_bytes);
        let fits = fits && Self::fits_views(device, [nodes, cells, soft]);
        let reads = if self.reads == Reads::Texels && !fits { Reads::Storage } else { self.reads };
        SharpPermutation { reads, rolled: device.info.wants_loops(), ..self }
    }

    /// Whether the device's texel views hold nodes and cells of silhouette fields, and a quad of light for every
    /// vertex.
    pub fn fits_views(device: &Device, [nodes, cells, soft]: [&Buffer; 3]) -> bool {
        [nodes, soft].into_iter().all(|buffer| TexelView::fits(device, QUAD_FORMAT, buffer.size_bytes))
            && TexelView::fits(device, vk::Format::R32G32_UINT, cells.size_bytes)
    }
}

/// Light of a vertex by one light of radiance 1, for the pixels around it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct KeptIrradiance {
    /// 0 where it is dark, negative where pixels need to evaluate the light.
    pub irradiance: f32,
    /// A bit for occluders that take any of it or whose shadows' edges are near.
    pub occluders: u32,
}

/// Everything that the pass reads.
pub struct SharpInputs<'b> {
    /// [`crate::layout::DeviceEntity`] of every entity.
    pub entities: &'b Buffer,
    pub entries: &'b Buffer,
    /// [`crate::layout::Cluster`] of every cluster.
    pub clusters: &'b Buffer,
    /// Nodes of all silhouette fields.
    pub nodes: &'b Buffer,
    pub cells: &'b Buffer,
    /// Positions and normals.
    pub vertices: &'b Buffer,
    pub self_cells: &'b Buffer,
    /// Output of the merge.
    pub soft: &'b Buffer,
    /// For every entity the lights whose highlights it shows, and where their shares at all vertices go, in the
    /// permutation that keeps them.
    pub shown: Option<[&'b Buffer; 2]>,
    /// Where the shares go that lamps take of the view of all vertices, in the permutation that keeps them.
    pub lamps: Option<&'b Buffer>,
    /// Where the irradiances of all vertices by sharp lights go, and by how many, in the permutation that finds edges.
    pub irradiances: Option<(&'b Buffer, u32)>,
    /// Maps of lamps and their texels, in the permutation that reads them.
    pub lamp_maps: Option<[&'b Buffer; 2]>,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    /// Lights whose irradiances are kept, and vertices of each.
    kept_lights: u32,
    all_vertices: u32,
}

pub struct Sharp {
    pipeline: ComputePipeline,
    pub permutation: SharpPermutation,
}

impl Sharp {
    pub fn new(device: &Arc<Device>, library: &Library, permutation: SharpPermutation) -> Result<Self> {
        let pipeline = ComputePipeline::new(device, "sharp", &library.shader(&permutation.row())?)?;
        Ok(Sharp { pipeline, permutation })
    }

    /// Adds the sharp lights' light to the first `cluster_count` clusters.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        inputs: &SharpInputs<'r>,
        radiosity: &'r Buffer,
        cluster_count: u32,
    ) -> Result<()> {
        let SharpPermutation { reads, self_shadows, edges, .. } = self.permutation;
        let irradiances = inputs.irradiances.filter(|_| edges);
        let read = |buffer: &'r Buffer, format| Bind::read(reads == Reads::Texels, buffer, format);
        let mut resources = vec![
            read(inputs.entities, QUAD_FORMAT)?,
            read(inputs.entries, ENTRY_FORMAT)?,
            read(inputs.clusters, CLUSTER_FORMAT)?,
            read(inputs.nodes, QUAD_FORMAT)?,
            read(inputs.cells, vk::Format::R32G32_UINT)?,
            read(inputs.vertices, QUAD_FORMAT)?,
            Bind::Buffer(radiosity),
            if self_shadows { read(inputs.self_cells, vk::Format::R32G32_UINT)? } else { Bind::None },
            read(inputs.soft, QUAD_FORMAT)?,
            inputs.shown.map_or(Bind::None, |[lights, _]| Bind::Buffer(lights)),
            inputs.shown.map_or(Bind::None, |[_, shares]| Bind::Buffer(shares)),
            inputs.lamps.map_or(Bind::None, Bind::Buffer),
            irradiances.map_or(Bind::None, |(buffer, _)| Bind::Buffer(buffer)),
        ];
        if let Some([maps, texels]) = inputs.lamp_maps {
            resources.push(Bind::Texel(TexelView::new(maps, QUAD_FORMAT)?));
            resources.push(Bind::Texel(TexelView::new(texels, vk::Format::R32_SFLOAT)?));
        }
        let elements = [cluster_count * CLUSTER_VERTICES, 1, 1];
        let Some((_, kept_lights)) = irradiances else {
            return commands.dispatch(&self.pipeline, &resources, &(), elements);
        };
        let all_vertices = (radiosity.size_bytes / 16) as u32;
        commands.dispatch(&self.pipeline, &resources, &Push { kept_lights, all_vertices }, elements)
    }
}
