//! The truth that pictures are compared with: the same scene lit by ray casting.
//!
//! The rungs of the comparison, each with one more approximation than the previous one:
//!
//! | rung | what | where |
//! |---|---|---|
//! | T0 | rays against the placed meshes, full visibility: what they meet before a light's surface blocks it | [`raycast`] |
//! | T1 | fields looked up, f64 | [`crate::merge::twin`] |
//! | T2 | the merge on the device, f32 | [`crate::merge`] |
//!
//! All rungs use the same rules as the merge for what emits, occludes and receives. A receiver does not occlude itself
//! through its field; if it is neither flat nor convex, its self-shadowing is judged from
//! [`crate::bake::TRANSFER_OFFSET`] off its surface. A light that does not occlude is transparent, and no light lights
//! or shadows itself.
//!
//! T0 is physical: an occluder, or a part of the receiver itself, blocks a ray only where the ray meets it before the
//! light. From T1 on an occluder precedes a light as a whole or not at all, if its bounding sphere's centre is nearer
//! to the vertex (ties by index), and the receiver shadows itself from what lies beyond the light too.

pub mod difference;
#[cfg(feature = "cli")]
pub mod error_map;
pub mod exposure;
pub mod flip;
pub mod pixels;
pub mod ray_mesh;
pub mod raycast;
pub mod reflect;
pub mod sequence;
pub mod world;

#[cfg(feature = "cli")]
pub use error_map::ErrorMap;
pub use ray_mesh::RayMeshes;
pub use raycast::{Estimate, RayCast};
pub use world::World;

use crate::scene::{Placement, Scene};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Vertex {
    pub entity: usize,
    /// Index of the vertex in the entity's mesh.
    pub index: usize,
}

/// All vertices of all receivers, by entity.
pub fn receiver_vertices(scene: &Scene) -> Vec<Vertex> {
    let of = |(entity, e): (usize, &crate::scene::Entity)| {
        let count = if e.receives { scene.surface(entity).positions.len() } else { 0 };
        (0..count).map(move |index| Vertex { entity, index })
    };
    scene.entities.iter().enumerate().flat_map(of).collect()
}

/// `count` lit vertices (or all, if there are fewer), chosen at random by `seed` and sorted.
pub fn sample_vertices(scene: &Scene, count: usize, seed: u64) -> Vec<Vertex> {
    let mut all = receiver_vertices(scene);
    fastrand::Rng::with_seed(seed).shuffle(&mut all);
    all.truncate(count);
    all.sort();
    all
}

/// An entity and the radiosity of its vertices.
pub type EntityRadiosity = (usize, Vec<[f32; 3]>);

/// Radiosity by entity, of vertices that are sorted.
pub fn by_entity(vertices: &[Vertex], lit: &[Estimate]) -> Vec<EntityRadiosity> {
    let lit: Vec<_> = vertices.iter().zip(lit).collect();
    let entities = lit.chunk_by(|(a, _), (b, _)| a.entity == b.entity);
    let radiosity = |(_, estimate): &(&Vertex, &Estimate)| estimate.radiosity.map(|c| c as f32);
    entities.map(|run| (run[0].0.entity, run.iter().map(radiosity).collect())).collect()
}

/// T0 of a whole scene, for pictures: radiosity of every receiver's vertices by entity, as `Frame::set_comparison` takes
/// it, and the root mean square of its standard error relative to that of the radiosity.
pub fn picture(scene: &Scene, placements: &[Placement], cast: &RayCast) -> (Vec<EntityRadiosity>, f64) {
    let world = World::of(scene, placements);
    let vertices = receiver_vertices(scene);
    let lit = cast.run(&world, &vertices);
    (by_entity(&vertices, &lit), raycast::relative_error(&lit))
}
