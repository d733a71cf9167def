//! Distant discs as entities: balls so far beyond a scene that all of it sees them alike.
//!
//! Lists, merge, pass "sharp", pictures and rays need to know nothing of them: a ball of angular radius a at distance d
//! has the radius d sin(a), and its irradiance is that of a disc at infinity. Over a scene of 100 km its direction
//! changes by 1e-4 radians. The distance is the same for every scene, so that no edit of anything else moves a sun by
//! the last bit.

use super::{Entity, Placement, Scene};
use crate::asset::disc::Disc;
use crate::asset::generate::sphere;
use glam::{DVec3, Quat};
use std::sync::Arc;

/// Distance of suns from the origin, metres. Directions from f32 coordinates are as exact as from near lights, 1e-7.
const DISTANCE_M: f32 = 1e9;
/// Subdivisions of the ball's icosahedron.
const SUBDIVISIONS: u32 = 4;

impl Scene {
    /// Puts the environment's discs behind the entities of the file, in place of those that stand there.
    pub(super) fn place_suns(&mut self) {
        let count = self.data.entities.len();
        self.entities.truncate(count);
        self.suns.clear();
        let discs = self.environment.discs();
        if discs.is_empty() {
            return;
        }
        let name = "sun";
        let mesh =
            self.meshes.iter().position(|mesh| mesh.name == name && self.data.meshes.iter().all(|m| m.name != name));
        let mesh = mesh.unwrap_or_else(|| {
            let mut mesh = sphere(1.0, SUBDIVISIONS);
            mesh.name = name.into();
            self.meshes.push(Arc::new(mesh));
            self.meshes.len() - 1
        });
        // The mesh is a little smaller than its bounding sphere, which shaders take for the light.
        let share = self.meshes[mesh].ball_share().unwrap_or(1.0);
        for Disc { name, toward, half_angle_rad, radiance } in discs {
            self.entities.push(Entity {
                name: name.into(),
                mesh,
                opacity: 1.0,
                emission: (radiance / share).as_vec3(),
                emits: radiance != DVec3::ZERO,
                ..Entity::default()
            });
            self.suns.push(Placement {
                position: toward.as_vec3() * DISTANCE_M,
                rotation: Quat::IDENTITY,
                scale: DISTANCE_M * half_angle_rad.sin() as f32,
            });
        }
    }
}
