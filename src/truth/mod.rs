//! What pictures are held against: the same scene lit by ray casting and by an exact band-limited chain.
//!
//! The ladder, each rung with one approximation more than the one before:
//!
//! | rung | what | where |
//! |---|---|---|
//! | T0 | rays against the moved meshes, full visibility | [`raycast`] |
//! | T1 | exact visibility of every occluder projected to SH, exact chain of products | [`exact`] |
//! | T2 | fields looked up, f64 | [`crate::merge::reference`] |
//! | T3 | the device | [`crate::merge`] |
//!
//! T0 and T1 agree with the merge on who lights, blocks and receives: a light is preceded by the occluders whose bounding
//! sphere's centre is nearer to the vertex than its own (ties by index); a receiver is no occluder of its own, but shadows
//! itself if it is neither flat nor convex, seen from [`crate::bake::TRANSFER_OFFSET`] off its surface; a light that does
//! not occlude is transparent, and none lights itself.

pub mod error_map;
pub mod exact;
pub mod ray_mesh;
pub mod raycast;
pub mod sequence;
pub mod world;

pub use error_map::ErrorMap;
pub use exact::ExactChain;
pub use ray_mesh::RayMeshes;
pub use raycast::{Estimate, RayCast};
pub use world::World;

use crate::scene::{Placement, Scene};

/// A vertex that is lit: entity and index into its mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Vertex {
    /// Entity.
    pub entity: usize,
    /// Vertex of its mesh.
    pub index: usize,
}

/// All vertices of all receivers, by entity.
pub fn receiver_vertices(scene: &Scene) -> Vec<Vertex> {
    let of = |(entity, e): (usize, &crate::scene::Entity)| {
        let count = if e.receives { scene.meshes[e.mesh].positions.len() } else { 0 };
        (0..count).map(move |index| Vertex { entity, index })
    };
    scene.entities.iter().enumerate().flat_map(of).collect()
}

/// `count` of them (or all, where there are fewer), chosen by `seed`, sorted.
pub fn sample_vertices(scene: &Scene, count: usize, seed: u64) -> Vec<Vertex> {
    let mut all = receiver_vertices(scene);
    fastrand::Rng::with_seed(seed).shuffle(&mut all);
    all.truncate(count);
    all.sort();
    all
}

/// An entity and the radiosity of its vertices.
pub type EntityRadiosity = (usize, Vec<[f32; 3]>);

/// T0 of a whole scene, for pictures: radiosity of every receiver's vertices by entity, as `Frame::set_radiosity` takes
/// it, and the root mean square of its standard error relative to that of the radiosity.
pub fn picture(scene: &Scene, placements: &[Placement], cast: &RayCast) -> (Vec<EntityRadiosity>, f64) {
    let shapes = RayMeshes::new(scene);
    let world = World::new(scene, &shapes, placements);
    let vertices = receiver_vertices(scene);
    let lit = cast.run(&world, &vertices);
    let mut out: Vec<EntityRadiosity> = Vec::new();
    for (vertex, estimate) in vertices.iter().zip(&lit) {
        if out.last().is_none_or(|(entity, _)| *entity != vertex.entity) {
            out.push((vertex.entity, Vec::new()));
        }
        out.last_mut().expect("just pushed").1.push(estimate.radiosity.map(|c| c as f32));
    }
    (out, raycast::relative_error(&lit))
}
