//! Precomputed shadow fields for dynamic scenes, on hand-managed Vulkan.
//!
//! Method: Zhou, Hu, Lin, Guo, Shum, *Precomputed Shadow Fields for Dynamic Scenes*, SIGGRAPH 2005, low-frequency version.
//! Around every object, cube maps are captured at points on concentric shells and projected to spherical harmonics (SH):
//! an object occlusion field (OOF) for what blocks, a source radiance field (SRF) for what shines. At run time every vertex
//! of every receiver merges these fields with order-4 SH products.
//!
//! # Conventions
//!
//! | thing | choice |
//! |---|---|
//! | SH basis | real, orthonormal, Condon-Shortley phase as in Sloan, *Stupid SH Tricks*: Y1,-1 = -.488603 y, Y1,0 = .488603 z, Y1,1 = -.488603 x; index l(l+1)+m; evaluated as polynomials of a unit vector |
//! | bands | n bands = n^2 coefficients; "order 4" in the literature is 4 bands, 16 coefficients |
//! | space | right-handed, +y up, metres; SH are taken on world x, y, z as they stand |
//! | cube faces | +X -X +Y -Y +Z -Z with Vulkan's s/t on each; texel centres; exact texel solid angle, weights sum to 4 pi |
//! | field distances | in units of the object's bounding-sphere radius r, from the sphere's centre; shells lie about the middle of the mesh's box, short axes stretched ([`field::fit`]) |
//! | occlusion field | stores the *blocked* part b = P[1 - V]: 0 where nothing blocks; samples inside the solid are captured off the nearest surface |
//! | between shells | b / (1 - cos a) is interpolated over sin(a/2), a the half-angle of the bounding sphere, samples lowered by a twelfth of their second differences; beyond 8 r it falls as (8r/d)^2 |
//! | order | an occluder precedes a light whose bounding sphere's centre is farther from the vertex; ties by entity index |
//! | small occluders | bounding spheres of a half-angle below 12 degrees (16 with shares between) block a point: the chain's value there times the solid angle of a projected area fitted to the outermost shell ([`field::Area`]) |
//! | switches | an emitter does not occlude, flat ground only receives, all else does both; each can be set per entity |
//! | scale | uniform and positive |
//! | light | linear Rec.709 radiance; radiosity B = albedo/pi * integral L V max(0, n.w) dw |
//! | numbers | tables in f64, shaders in f32, field storage f16 or f32 |
//!
//! # Layers
//!
//! A module uses only modules above it in this table, and a test holds it to that.
//!
//! | module | what stands there |
//! |---|---|
//! | [`error`], [`files`] | errors with their exit codes; files that are replaced whole |
//! | [`sh`] | spherical harmonics in f64, and the GLSL that is generated from them |
//! | [`layout`] | structs that two or more shaders read |
//! | [`gpu`] | Vulkan: device, memory, pipelines, commands, barriers, window; all `unsafe` code |
//! | [`field`] | what is sampled where, what is stored, and its file |
//! | [`shaders`] | every shader entry point and its permutations |
//! | [`asset`] | meshes, distant light, pictures |
//! | [`scene`] | scenes as plain data, and motion |
//! | [`bake`] | capture, project, assemble: fields and transfer vectors of a mesh, and their cache |
//! | [`lists`] | which entities concern which cluster of vertices, and which clusters have to be merged again |
//! | [`merge`] | the merge pass, its permutations, its CPU twin and its calibration |
//! | [`draw`] | camera, rasterisation, smoothed outlines, tone and encoding |
//! | [`scene_buffers`] | what a scene keeps on the device, and whether it fits |
//! | [`frame`] | the sequence of passes with all barriers |
//! | [`truth`] | ray casting and the exact SH chain |
//! | [`check`] | every pass against its CPU twin |
//! | [`mod@bench`] | what things cost and how wrong they are |
//! | [`view`], [`app`] | the state behind the window; a file for each subcommand |
//!
//! # Beyond one device
//!
//! On paper, not built. *Merges over many devices*: a cluster reads its list, the entities on it and their fields, and writes its
//! own vertices only, so clusters can be dealt out by receiver and place with no exchange but the entities' 5 600 bytes a frame
//! for every 30 of them; each device needs the fields and vertices of its own clusters, and sends 16 bytes a vertex to the one
//! that draws. What a device merges again is what moved near its clusters. *Farms of bakes*: a field depends on mesh, lattice,
//! bands, face size and format, whose hash names its cache file, and every file is replaced whole: workers that share a cache
//! folder need no other meeting place. Within one field, targets are independent and the kept part of a bake is a prefix of
//! them; a range for each worker and a sum of the parts would do. *Larger scenes*: fields beyond what a device binds want several
//! buffers, or those of a neighbourhood at a time, which the lists already name.

pub mod app;
pub mod asset;
pub mod bake;
pub mod bench;
pub mod check;
pub mod draw;
pub mod error;
pub mod field;
pub mod files;
pub mod frame;
#[allow(unsafe_code)]
pub mod gpu;
pub mod layout;
pub mod lists;
pub mod merge;
pub mod scene;
pub mod scene_buffers;
pub mod sh;
pub mod shaders;
pub mod truth;
pub mod view;

pub use error::{Error, Result};
