//! Precomputed shadow fields for dynamic scenes, on hand-managed Vulkan.
//!
//! Method: Zhou, Hu, Lin, Guo, Shum, *Precomputed Shadow Fields for Dynamic Scenes*, SIGGRAPH 2005. Around every
//! object, cube maps are captured at points on concentric shells and projected to spherical harmonics (SH): an
//! occlusion field for what the object blocks, a radiance field for what it emits. At run time every vertex merges
//! these fields by SH products. Lamps are sharp lights: they look up silhouette fields, which keep the edges of shadows.
//!
//! # Conventions
//!
//! - SH basis: it is real and orthonormal, with the Condon-Shortley phase as in Sloan, *Stupid SH Tricks*: Y1,-1 =
//!   -0.488603 y, Y1,0 = 0.488603 z, Y1,1 = -0.488603 x. Coefficient (l, m) has index l(l+1)+m. The basis is evaluated
//!   as polynomials of a unit vector.
//! - Bands: n bands are n^2 coefficients. What the literature calls "order 4" is 4 bands, 16 coefficients.
//! - Space: it is right-handed, +y is up, and lengths are in metres. SH are taken on world x, y, z as they stand.
//! - Cube faces: they are +X -X +Y -Y +Z -Z, with Vulkan's s and t on each. A texel stands for the direction of its
//!   centre and weighs its exact solid angle; the weights sum to 4 pi.
//! - Field distances: they are in units of the object's bounding-sphere radius r, from the sphere's centre. Shells lie
//!   about the middle of the mesh's box, and its short axes are stretched ([`field::fit`]).
//! - Occlusion field: it stores the *blocked* part b = P[1 - V], which is 0 where nothing blocks. A sample inside the
//!   solid is captured off the nearest surface.
//! - Between shells: b / (1 - cos a) is interpolated over sin(a/2), where a is the half-angle of the bounding sphere.
//!   Samples are lowered by a twelfth of their second differences. Beyond 8 r the value falls as (8r/d)^2.
//! - Order: an occluder precedes a light if its bounding sphere's centre is nearer to the vertex than the light's.
//!   Entity indices decide ties. A sheet precedes what lies beyond its plane.
//! - Sharp lights: an entity that glows is a sharp light: a ball, a disc, a rectangle, a tube, or whatever its outline
//!   is. It is cut into 4 or 16 parts ([`field::sub_light`]); in each, the visibilities past all occluders' outlines
//!   ([`field::silhouette`]) and past the receiver's own mesh ([`field::self_visibility`]) are multiplied. What lies
//!   beyond the light's surface blocks nothing. Parts of an outline, and of a light of several colours, have colours of
//!   their own ([`field::lamp_colors`]). The sky goes through SH, and all light with `--lights sh`.
//! - Small occluders: an occluder whose bounding sphere has a half-angle below 12 degrees blocks a point. It takes away
//!   the chain's value in its direction times the solid angle of a projected area, which is fitted to its outermost
//!   shell ([`field::Area`]). Up to 16 degrees the point and the field share.
//! - Rigid groups: entities without motion, but for `movable` ones, are one group, and so are those that the same
//!   nodes carry. A vertex's own visibility is cast by rays past its whole group, so members leave each other's
//!   chains; under sharp lights a member that is convex, or farther than 0.65 of its bounding radii and not around
//!   what it blocks, keeps its silhouette. What moves among many of them reads the sky past all at once, from nodes
//!   of the box in which it moves ([`field::visibility_volume`]). With `--lights sh`, and without the skip
//!   `static`, every entity is alone.
//! - Surfaces: a mesh is lit and drawn with more vertices where its own visibility varies, and along the shadows of suns
//!   ([`bake::surfaces`]). Vertices of what rests know from rays whether its own group hides a sun. Pixels that evaluate
//!   lights look up a map of all that rests as the sun sees it ([`draw::sun_map`]); they and vertices look up maps around
//!   lamps in fittings or among many things ([`draw::lamp_map`]). Outlines tell the rest: suns at vertices that rays leave
//!   undecided, what moves, and everything once the light or something that rested has moved.
//! - Entities: everything receives, and everything but emitters occludes. Each can be set per entity. Scales are uniform
//!   and positive.
//! - Transparency: what lets light through blocks its opacity's share of a field or an outline. It stands before all
//!   others, its own group too, as something that moves does; nothing counts what it passes on as coloured. What a
//!   texture cuts out is a hole for rays and captures alike ([`asset::pierce`]).
//! - Sheets: a flat mesh blocks light from both sides. What a rectangle blocks has a closed form, for SH and for sharp
//!   lights, so nothing is baked of it; other flat meshes have fields as all others do. A point within 0.002 bounding
//!   radii of its receiver from the sheet's plane counts as that far from it, on the side of its receiver's centre
//!   ([`field::sheet`]). One that ends at boxes, as a ceiling at its walls, reaches a little into them.
//! - Boxes block sharp lights in closed form too ([`field::cuboid`]), and so do solids with square corners, as houses
//!   and stairs, as overlapping boxes ([`asset::Mesh::boxes`]). A closed surface that lets light through and holds a
//!   lamp takes its share once of all that leaves it.
//! - Bounces: every vertex of a rigid group has links to runs of vertices that it sees, up to lamps at rest, and reads
//!   the occlusion fields of what moves around it for the light that comes from there ([`bounce`]); boxes that move hide
//!   links. All that reflects passes its base colour's share of light on as a diffuse surface does, metals too.
//! - Gloss: roughness, metal and a base colour as in glTF ([`gloss`]). The merge leaves the transfer past everything, of
//!   which the share of a reflected sky follows for any view. The rest of a lobe is filled with bounced light: along a
//!   vertex's links by where they lead, and alike with that of what moves. Flat faces of a low roughness, and what
//!   is curved, show pictures that are drawn for them ([`draw::mirror`]). A highlight is the share of the microfacets
//!   that mirror its light.
//! - Light: it is linear Rec.709 radiance. The radiosity is B = albedo/pi * integral of L V max(0, n.w) dw.
//! - Numbers: tables are made in f64, shaders compute in f32, and fields are stored as f16 or f32.
//!
//! # Layers
//!
//! A module uses only modules above it in this table, and a test holds it to that.
//!
//! | module | content |
//! |---|---|
//! | [`error`], [`files`], [`text`] | errors with their exit codes; files that are replaced whole; text files of results |
//! | [`sh`] | spherical harmonics in f64, and the GLSL that is generated from them |
//! | [`layout`] | structs that two or more shaders read |
//! | [`gpu`] | Vulkan: device, memory, pipelines, commands, barriers, window; all `unsafe` code |
//! | [`field`] | what is sampled where, what is stored, and its file |
//! | [`shaders`] | every shader entry point and its permutations |
//! | [`asset`] | meshes, distant light, pictures |
//! | [`scene`] | scenes as plain data, motion, glTF |
//! | [`bake`] | capture, project, assemble: fields of a mesh; rays: surfaces and their own visibility; the cache |
//! | [`lists`] | which entities concern which cluster of vertices, and which clusters have to be merged again |
//! | [`merge`] | the merge pass, its permutations, its CPU twin and its calibration |
//! | [`sharp`] | the pass of lights whose shadows have edges, and its CPU twin |
//! | [`bounce`] | the passes of light that surfaces pass on to each other |
//! | [`gloss`] | the pass of what glossy surfaces reflect, its table of lobes, its sky and its CPU twin |
//! | [`draw`] | camera, rasterisation, smoothed outlines, tone and encoding |
//! | [`scene_buffers`] | what a scene keeps on the device, and whether it fits |
//! | [`frame`] | the sequence of passes with all barriers |
//! | [`truth`] | ray casting and the exact SH chain |
//! | [`renderer`] | the front door for programs: a device, a scene, its light and its picture |
//! | [`check`] | every pass against its CPU twin |
//! | `bench` | measurements of time and error (feature `cli`) |
//! | [`farm`] | bakes and pictures of many machines: plans, results, engines (`docs/farm.md` says how they are used) |
//! | `view` | the state behind the window (feature `view`) |
//! | `app` | the command line, a file for each subcommand (feature `cli`) |

pub mod error;
#[allow(unsafe_code)]
pub mod gpu;
pub mod prelude;
pub mod renderer;
pub mod scene;

// Below the front door: public for the tests of this repository alone, and free to change with every version.
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod app;
#[doc(hidden)]
pub mod asset;
#[doc(hidden)]
pub mod bake;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod bench;
#[doc(hidden)]
pub mod bounce;
#[doc(hidden)]
pub mod check;
#[doc(hidden)]
pub mod draw;
#[doc(hidden)]
pub mod farm;
#[doc(hidden)]
pub mod field;
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod frame;
#[doc(hidden)]
pub mod gloss;
#[doc(hidden)]
pub mod layout;
#[doc(hidden)]
pub mod lists;
#[doc(hidden)]
pub mod merge;
#[doc(hidden)]
pub mod scene_buffers;
#[doc(hidden)]
pub mod sh;
#[doc(hidden)]
pub mod shaders;
#[doc(hidden)]
pub mod sharp;
#[doc(hidden)]
pub mod text;
#[doc(hidden)]
pub mod truth;
#[cfg(feature = "view")]
#[doc(hidden)]
pub mod view;

/// The crate whose Vulkan handles this library takes and returns.
pub use ash;
pub use error::{Error, Result};
/// The crate whose vectors, matrices and quaternions this library takes and returns.
pub use glam;
