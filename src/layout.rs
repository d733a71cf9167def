//! Data that Rust and GLSL share: structs, of which the GLSL text and its readers are generated from the Rust fields,
//! and constants.

use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::fmt::Write;

trait Shared {
    /// Its name in GLSL.
    const GLSL: &'static str;
}

impl Shared for u32 {
    const GLSL: &'static str = "uint";
}
impl Shared for f32 {
    const GLSL: &'static str = "float";
}
impl Shared for [f32; 2] {
    const GLSL: &'static str = "vec2";
}
impl Shared for [f32; 3] {
    const GLSL: &'static str = "vec3";
}
impl Shared for [f32; 4] {
    const GLSL: &'static str = "vec4";
}
impl Shared for [u32; 4] {
    const GLSL: &'static str = "uvec4";
}

struct SharedField {
    name: &'static str,
    glsl: &'static str,
    offset_bytes: usize,
    size_bytes: usize,
}

/// Declares a struct whose fields both languages have, and lists them for the generated GLSL. That would put a field
/// elsewhere which is not aligned to its size, or to a power of two above it.
macro_rules! shared_struct {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty),* $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        pub struct $name {
            $($(#[$doc])* pub $field: $kind),*
        }

        impl $name {
            const FIELDS: &[SharedField] = &[$(SharedField {
                name: stringify!($field),
                glsl: <$kind as Shared>::GLSL,
                offset_bytes: std::mem::offset_of!($name, $field),
                size_bytes: size_of::<$kind>(),
            }),*];
        }

        const _: () = {
            $(let alignment = size_of::<$kind>().next_power_of_two();
            assert!(std::mem::offset_of!($name, $field) % alignment == 0 && size_of::<$name>() % alignment == 0);)*
        };
    };
}

shared_struct! {
    /// An entity of the scene at one time, in the form that passes read: `Entity` of the shaders.
    DeviceEntity {
        /// Centre of the bounding sphere in the world, metres; w = 1 / (scale x bounding radius), 1/m.
        centre: [f32; 4],
        /// Cosine and sine of alpha and of beta; the rotation to the world is Rz(alpha) Ry(beta) Rz(gamma).
        alpha_beta: [f32; 4],
        gamma: [f32; 2],
        blocked_base: u32,
        /// First quad of its radiance field; of a sharp light that of its colours among the nodes of silhouettes, or
        /// [`NONE`] where all its parts have the same.
        radiance_base: u32,
        /// Slope and offset of the shell coordinate, inner and outer shell radius in r.
        radial: [f32; 4],
        /// Linear RGB radiance factor of the entity's light.
        emission: [f32; 3],
        /// Share of light that it keeps back where it blocks.
        opacity: f32,
        /// Added to a stretched position, in r; w = the packed stretch factors of the axes
        /// ([`crate::field::Fit::packed`]).
        shift: [f32; 4],
        /// Albedo / pi.
        albedo: [f32; 3],
        scale: f32,
        /// First axis of its projected area ([`crate::field::Area`]), world; w = the area's constant term. Of a sheet
        /// these two are the axes of its rectangle.
        area_x: [f32; 4],
        /// Second axis, world; w = factor of u, the square of a direction's cosine to the first.
        area_y: [f32; 4],
        /// Factors of v (the square of the cosine to the second axis), u u, v v and u v.
        area_terms: [f32; 4],
        /// First quad of its silhouette field, with [`HAS_HALVES`] where it has maps of halves, or of the box that it is;
        /// 0 without either.
        silhouette: u32,
        /// Shape of its sharp light: a [`LightKind`].
        light_kind: u32,
        /// Ball or disc: the share of its bounding sphere's disc that shines. Rectangle or tube: half its first edge, in r.
        light_size: f32,
        /// Rectangle: its edge along z over that along x. Tube: its width over its length.
        light_ratio: f32,
        /// Spot, which shines along its own +y: [`crate::scene::light::Spot::ramp`]. 0 and 1 for any other light.
        light_ramp: [f32; 2],
        /// Of a sheet: half the sides of its rectangle, metres.
        half_sides: [f32; 2],
        /// Of a sharp light: the first of its irradiances on all vertices, or [`NONE`] where they are not kept.
        irradiance_first: u32,
        /// Of a tube: its thickness over its width, 1 of a round one; see [`crate::field::sub_light::LampFace::Tube`].
        light_thin: f32,
        /// Of a sun: the bits that a vertex has of it, see [`pack_suns`]; the last where nothing moves or lets light
        /// through that may hide a sun of which a vertex sees all. Of a lamp [`LAMP_AT_REST`] where it stands among the
        /// links of what rests. 0 of any other light.
        sun_bits: u32,
        /// Of a light the bit of its map, if it has one; of what occludes those of the maps that hold it.
        light_maps: u32,
    }
}

/// The most suns that have maps, whose bits come first, and the most other lights.
pub const MOST_SUN_MAPS: usize = 2;
pub const MOST_LAMP_MAPS: usize = 32 - MOST_SUN_MAPS;

/// A bit beyond those of suns, of a lamp at rest: links end at it.
pub const LAMP_AT_REST: u32 = 1 << 30;

/// The most suns of which vertices tell whether they are hidden.
pub const MOST_SUNS: usize = 8;

/// A vertex tells of each sun whether it is hidden, whether it is on all triangles around, and whether all of it is seen.
/// A float holds all bits.
pub fn pack_suns(hidden: u32, around: u32, free: u32) -> u32 {
    hidden | around << MOST_SUNS | free << (2 * MOST_SUNS)
}

impl DeviceEntity {
    pub fn is_spot(&self) -> bool {
        self.light_ramp[0] > 0.0
    }
}

shared_struct! {
    /// A workgroup's worth of neighbouring vertices of one receiver.
    Cluster {
        /// Entity that is lit.
        receiver: u32,
        /// First vertex in the vertex buffer.
        vertex_first: u32,
        /// Vertices, at most [`CLUSTER_VERTICES`].
        vertex_count: u32,
        /// First quad of the first vertex's transfer vector, or [`NONE`] for the cosine of the normal.
        transfer_first: u32,
        /// First vertex in the radiosity buffer.
        radiosity_first: u32,
        /// First entry in the list.
        entry_first: u32,
        /// Entries, at least 1.
        entry_count: u32,
        /// Texels hold an even number of words.
        unused: u32,
        /// Number of entries at the front that are chains of sharp lights.
        sharp_count: u32,
        /// First cell of its first vertex's self-visibility, or [`NONE`] where the mesh cannot shadow itself.
        self_first: u32,
    }
}

shared_struct! {
    /// A map of what rests as a sun sees it ([`crate::draw::sun_map`]): `SunMap` of the shaders.
    SunMap {
        /// Factors on a place from its middle, metres, and the sum's offset: to texels.
        across: [f32; 3],
        across_first: f32,
        down: [f32; 3],
        down_first: f32,
        /// Unit direction to the sun, world.
        toward: [f32; 3],
        /// Where heights begin along it from the middle, metres.
        lowest: f32,
        /// Centres of its first and last texels.
        low: [f32; 2],
        high: [f32; 2],
        /// The height that 1 stands for, metres.
        range_m: f32,
        texel_m: f32,
        /// Of the sun's angular radius.
        tangent: f32,
        spare: f32,
        /// Its middle in the world: with numbers that begin there, what lies far from the origin is as exact as any.
        middle: [f32; 3],
        unused: f32,
    }
}

shared_struct! {
    /// A cube map of what rests around a part of a lamp ([`crate::draw::lamp_map`]): `LampMap` of the shaders.
    LampMap {
        /// Of the part, world, metres.
        middle: [f32; 3],
        /// The distance along a face's axis that 1 stands for, metres.
        nearest_m: f32,
        /// 1 over the distance of the nearest thing, 1/m.
        most_inverse: f32,
        side_px: f32,
        /// Of its six faces.
        first_texel: u32,
        /// Parts of the lamp, 1 or 4, whose maps follow each other.
        parts: u32,
    }
}

/// Lights whose highlights an entity shows, strongest first. Pixels find the shares of the first four.
pub const SHOWN_LIGHTS: usize = 16;

shared_struct! {
    /// A glossy entity as the eye sees it: `GlossEntity` of the shaders.
    GlossEntity {
        /// Rows of the matrix from the entity's frame (metres from the centre of its bounding sphere) to the world's
        /// axes at the eye.
        row_x: [f32; 4],
        row_y: [f32; 4],
        row_z: [f32; 4],
        albedo: [f32; 3],
        roughness: f32,
        /// Place of the eye in the world.
        eye: [f32; 3],
        metallic: f32,
        /// Entities whose highlights it shows, two in a word and the first in its low half; 0 where there are fewer.
        lights: [u32; 4],
        more_lights: [u32; 4],
        /// Reflectance of a dielectric that is faced.
        f0: f32,
        /// Radiance that 1 in the sky's map stands for.
        sky_scale: f32,
        /// First vertex in the vertex buffer.
        vertex_first: u32,
        /// First vertex in the radiosity buffer.
        radiosity_first: u32,
        vertex_count: u32,
        /// What a metal of no colour reflects once of unit light from everywhere, over all views; 0 where light that
        /// microfacets pass on to each other is lost.
        mean_energy: f32,
        /// How many of the lights there are, at least 1.
        light_count: u32,
        /// 1 where textures vary its gloss or normals, so that pixels look everything up; else 0.
        textured: u32,
        /// Factors on the textures: of roughness, metal, and the slope of normals; 1 where a texture has the emission.
        factors: [f32; 4],
        /// What the texels of its emission are multiplied by.
        glow: [f32; 4],
        /// Planes that mirror, one in each column, by the world's axes from the eye: unit normals and offsets. Zeros
        /// where there are fewer.
        mirror_x: [f32; 4],
        mirror_y: [f32; 4],
        mirror_z: [f32; 4],
        mirror_offset: [f32; 4],
        /// Left edge of each mirror's part of the picture of mirrors, texels.
        mirror_left: [f32; 4],
        /// Factor of each on what depth leaves of 1, over that of a pixel's view depth, that gives the share of the way
        /// from the mirror's eye that lies behind the mirror.
        mirror_behind: [f32; 4],
        /// Share of each mirror's picture in what its surface reflects.
        mirror_share: [f32; 4],
        /// From pixels to places in a part: factors on both, in texels. Width of a part, texels. Radius in texels of a
        /// lobe of slope 1.
        mirror_view: [f32; 4],
        /// Of a curved surface, which has no plane: the place of its probe from the eye by the world's axes, and the edge
        /// of one of six pictures in texels. The first mirror's numbers are the probe's; it is behind by the distance of
        /// the pictures' near plane, metres.
        probe: [f32; 4],
    }
}

/// Shape of an entity's light in passes that evaluate sharp lights.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightKind {
    /// It is no sharp light.
    #[default]
    None,
    Ball,
    /// The mesh's own outline.
    Outline,
    /// A disc that shines from one side.
    Disc,
    /// A rectangle that shines from one side.
    Rectangle,
    /// A rectangle that shines from both sides.
    Sheet,
    /// A tube along the object's x axis; then along y, and along z.
    TubeX,
    TubeY,
    TubeZ,
}

/// The text of a generated include that declares or reads shared structs.
pub fn glsl(file: &str) -> Option<String> {
    Some(match file {
        "structs.glsl" => glsl_struct("Entity", DeviceEntity::FIELDS) + &glsl_struct("Cluster", Cluster::FIELDS),
        "gloss_structs.glsl" => glsl_struct("GlossEntity", GlossEntity::FIELDS),
        "sun_map_structs.glsl" => glsl_struct("SunMap", SunMap::FIELDS),
        "lamp_map_structs.glsl" => glsl_struct("LampMap", LampMap::FIELDS),
        "lamp_map_at.glsl" => glsl_reader("LampMap lamp_map_at", "lamp_maps", "vec4", LampMap::FIELDS),
        "sun_map_at.glsl" => glsl_reader("SunMap sun_map_at", "sun_maps", "vec4", SunMap::FIELDS),
        "entity_at.glsl" => glsl_reader("Entity entity_at", "entities", "vec4", DeviceEntity::FIELDS),
        "cluster_at.glsl" => glsl_reader("Cluster cluster_at", "clusters", "uvec2", Cluster::FIELDS),
        "gloss_entity_at.glsl" => {
            glsl_reader("GlossEntity gloss_entity_at", "gloss_entities", "vec4", GlossEntity::FIELDS)
        }
        _ => return None,
    })
}

fn glsl_struct(name: &str, fields: &[SharedField]) -> String {
    let fields: String = fields.iter().map(|field| format!("    {} {};\n", field.glsl, field.name)).collect();
    format!("struct {name} {{\n{fields}}};\n")
}

/// A function `NAME(i)` that puts a struct together from the texels of a view, of two or four words each: one of
/// [`CLUSTER_FORMAT`] has two. No field lies in two texels.
fn glsl_reader(function: &str, view: &str, texel: &str, fields: &[SharedField]) -> String {
    let texel_words = if texel == "uvec2" { 2 } else { 4 };
    let end_bytes = fields.last().map_or(0, |field| field.offset_bytes + field.size_bytes);
    let texels = (end_bytes / 4).div_ceil(texel_words);
    let mut text = format!("{function}(uint i) {{\n    int at = int(i) * {texels};\n");
    for t in 0..texels {
        writeln!(text, "    {texel} t{t} = {texel}(texelFetch({view}, at + {t}));").expect("a String takes all");
    }
    let read = |field: &SharedField| {
        let word = field.offset_bytes / 4;
        let count = field.size_bytes / 4;
        let first = word % texel_words;
        let part = format!("t{}.{}", word / texel_words, &"xyzw"[first..first + count]);
        if field.glsl.starts_with('u') && texel == "vec4" { format!("floatBitsToUint({part})") } else { part }
    };
    let name = function.split(' ').next().unwrap_or(function);
    let reads: Vec<String> = fields.iter().map(read).collect();
    writeln!(text, "    return {name}({});\n}}", reads.join(", ")).expect("a String takes all");
    text
}

pub const NONE: u32 = u32::MAX;

/// Vertices of a cluster, which is one workgroup: eight subgroups on llvmpipe, two on most GPUs, and within the limits
/// of every device.
pub const CLUSTER_VERTICES: u32 = 64;

/// Clusters that are gathered for together: enough to share a search, few enough that what is found matters to each. In
/// a town of 4 095 things 32 find 700 of them, 16 find 420; 170 matter to one.
pub const GROUP_CLUSTERS: usize = 16;

/// Texels through which some variants of a pass read entries: one each.
pub const ENTRY_FORMAT: vk::Format = vk::Format::R32_UINT;
/// Texels through which they read [`Cluster`]: two of its numbers each.
pub const CLUSTER_FORMAT: vk::Format = vk::Format::R32G32_UINT;
/// As which texel views show floats: a texel is four of them.
pub const QUAD_FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// Bits of an entity's number in an entry.
pub const ENTRY_BITS: u32 = 14;
/// Entities that an entry can name: numbers below this, which stands for the sky.
pub const ENTRY_ENTITIES: u32 = (1 << ENTRY_BITS) - 1;

/// Purpose of one lookup of the merge, packed into 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListEntry {
    /// Multiply the chain of a light (`None`: of the sky) by the visibility past an entity.
    Occlude { entity: u32, light: Option<u32> },
    /// As [`ListEntry::Occlude`], for vertices that see the entity small.
    Cap { entity: u32, light: Option<u32> },
    /// As [`ListEntry::Occlude`], of a sheet.
    Sheet { entity: u32, light: Option<u32> },
    /// As [`ListEntry::Occlude`], of a box before a sharp light.
    Cuboid { entity: u32, light: Option<u32> },
    /// As [`ListEntry::Occlude`], of a closed surface around a sharp light.
    Globe { entity: u32, light: Option<u32> },
    /// Multiply the sky's chain by the visibility past all that rests, from where it began; it names its receiver.
    Volume { receiver: u32 },
    /// Meet a light; `channel` is `None` for a light of one colour, which shares the occlusion field.
    Shine {
        entity: u32,
        /// Channel of its radiance field.
        channel: Option<u32>,
        /// Whether the chain ends here and the next begins anew.
        last: bool,
    },
    /// The end of a sharp light's chain, which so many entries stand before.
    Sharp { entity: u32, occluders: u32 },
}

impl ListEntry {
    /// The two entities that packed bits name: the occluder or the light, and the light whose chain this is,
    /// [`ENTRY_ENTITIES`] in the sky's.
    pub fn entities(packed: u32) -> [u32; 2] {
        let chain = packed >> ENTRY_BITS & ENTRY_ENTITIES;
        [if Self::is_light(packed) { chain } else { packed & ENTRY_ENTITIES }, chain]
    }

    /// A number for each kind of those that are no lights.
    pub fn kind(packed: u32) -> u32 {
        packed >> (2 * ENTRY_BITS + 1)
    }

    pub fn is_light(packed: u32) -> bool {
        packed >> (2 * ENTRY_BITS) & 1 == 1
    }

    /// The 32 bits that `merge_layout.glsl` takes apart.
    pub fn pack(self) -> u32 {
        let occlude = |entity: u32, light: Option<u32>, kind: u32| {
            entity | light.unwrap_or(ENTRY_ENTITIES) << ENTRY_BITS | kind << (2 * ENTRY_BITS + 1)
        };
        let shine = |first: u32, light: u32, flags: u32| first | light << ENTRY_BITS | (1 | flags) << (2 * ENTRY_BITS);
        match self {
            ListEntry::Occlude { entity, light } => occlude(entity, light, 0),
            ListEntry::Cap { entity, light } => occlude(entity, light, 1),
            ListEntry::Sheet { entity, light } => occlude(entity, light, 2),
            ListEntry::Volume { receiver } => occlude(receiver, None, 3),
            ListEntry::Cuboid { entity, light } => occlude(entity, light, 4),
            ListEntry::Globe { entity, light } => occlude(entity, light, 5),
            ListEntry::Shine { entity, channel, last } => {
                shine(entity, entity, channel.unwrap_or(3) << 1 | u32::from(last) << 3)
            }
            ListEntry::Sharp { entity, occluders } => shine(occluders, entity, 0),
        }
    }
}

/// Alignment, in bytes, of everything that a pass may bind as a range. It is the largest that Vulkan lets a device ask
/// for.
pub const ALIGNMENT: u64 = 256;
/// The weight of what may be anywhere, and a length beyond all others: more than any light makes negligible.
pub const EVERYTHING: f64 = 1e30;
/// Flag of a grid's cell whose diagonal runs from corner (0, 0) to (1, 1), not from (1, 0) to (0, 1).
pub const UPWARDS: u32 = 1 << 31;
/// Added to the first quad of a silhouette field that has maps of halves.
pub const HAS_HALVES: u32 = 1 << 31;
/// Flag of the number of a cluster's entries, for pixels: only maps of its own vertices go with them, as those of
/// neighbouring clusters have other shadows.
pub const OWN_MAPS: u32 = 1 << 31;
/// Bits of a lattice's factors (see [`crate::field::Fit::packed`]).
pub const FIT_BITS: u32 = 21;
/// How far apart tags of entities are in a picture's alpha: as 8 bits tell.
pub const TAG_STEP: f32 = 1.0 / 255.0;
/// Coefficients of 1, cosine and its square in the clamped cosine of four bands.
pub const COSINE_LOBE: [f64; 3] = [0.09375, 0.5, 0.46875];

/// The macros that every shader has: what both languages have to agree on.
pub fn shared_macros() -> [(&'static str, String); 16] {
    let [a, b, c] = COSINE_LOBE;
    let kind = |kind: LightKind| format!("{}u", kind as u32);
    [
        ("PI", std::f64::consts::PI.to_string()),
        ("EVERYTHING", format!("{EVERYTHING:e}")),
        ("UPWARDS", format!("{UPWARDS:#x}u")),
        ("HAS_HALVES", format!("{HAS_HALVES:#x}u")),
        ("OWN_MAPS", format!("{OWN_MAPS:#x}u")),
        ("MOST_SUNS", format!("{MOST_SUNS}u")),
        ("ALL_SUNS", format!("{}u", (1 << MOST_SUNS) - 1)),
        ("FIT_BITS", FIT_BITS.to_string()),
        ("TAG_STEP", format!("{TAG_STEP:?}")),
        ("COSINE_LOBE", format!("vec3({a:?}, {b:?}, {c:?})")),
        ("LIGHT_BALL", kind(LightKind::Ball)),
        ("LIGHT_OUTLINE", kind(LightKind::Outline)),
        ("LIGHT_DISC", kind(LightKind::Disc)),
        ("LIGHT_RECTANGLE", kind(LightKind::Rectangle)),
        ("LIGHT_SHEET", kind(LightKind::Sheet)),
        ("LIGHT_TUBE", kind(LightKind::TubeX)),
    ]
}
