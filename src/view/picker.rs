//! State of the pointer: the shapes that rays meet, and the entity that is dragged.

use crate::scene::EntityData;
use crate::truth::ray_mesh::RayMesh;
use glam::DVec3;
use std::sync::OnceLock;

/// Hierarchies of the scene's meshes, each built when a ray first enters its bounding sphere.
#[derive(Default)]
pub struct Picker {
    pub(super) shapes: Vec<OnceLock<RayMesh>>,
}

impl Picker {
    /// A picker for that number of meshes.
    pub fn new(mesh_count: usize) -> Self {
        Picker { shapes: (0..mesh_count).map(|_| OnceLock::new()).collect() }
    }
}

/// An entity that is being dragged, and the other pieces of the same thing.
pub(super) struct EntityDrag {
    /// As they were before.
    pub(super) before: Vec<(usize, EntityData)>,
    /// The point where it was grabbed, metres.
    pub(super) anchor: DVec3,
    pub(super) moved: bool,
}
