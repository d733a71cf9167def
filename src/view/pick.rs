//! Picking and dragging: rays from the picture into the scene.

use super::command::{Changed, Effect};
use super::edit::{self, EditKind};
use super::editor::Editor;
use crate::draw::camera::through_pixels;
use crate::scene::{EntityData, Placement, Scene};
use crate::truth::ray_mesh::RayMesh;
use glam::DVec3;
use std::sync::OnceLock;

/// A drag reaches at most this many scene radii from the eye, because near the horizon a pixel covers kilometres.
const REACH: f64 = 30.0;

#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

/// Hierarchies of the scene's meshes, each built when a ray first enters its bounding sphere.
pub(super) type Shapes = Vec<OnceLock<RayMesh>>;

/// An entity that is being dragged, and the other pieces of the same thing.
pub(super) struct EntityDrag {
    /// As they were before.
    pub(super) before: Vec<(usize, EntityData)>,
    /// The point where it was grabbed, metres.
    anchor: DVec3,
    moved: bool,
}

pub(super) fn unbuilt_shapes(scene: &Scene) -> Shapes {
    scene.meshes.iter().map(|_| OnceLock::new()).collect()
}

impl Editor {
    /// The ray through a position in the picture (in pixels, with pixel centres at halves).
    pub fn ray(&self, at: [f32; 2]) -> Ray {
        let direction = through_pixels(self.camera(), self.size().map(f64::from))(at.map(f64::from));
        Ray { origin: self.camera().eye.as_dvec3(), direction }
    }

    /// The entity that is seen at a position in the picture, and the visible point in the world.
    pub fn hit(&self, at: [f32; 2]) -> Option<(usize, DVec3)> {
        let ray = self.ray(at);
        if !ray.direction.is_finite() {
            return None;
        }
        let placements = self.placements();
        let mut near: Vec<(f64, usize)> = (0..self.scene.data.entities.len())
            .filter_map(|entity| {
                let (centre, radius_m) = self.sphere(entity, &placements[entity]);
                Some((ray.enters(centre, radius_m)?, entity))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(f64, usize)> = None;
        for (enters_m, entity) in near {
            // Spheres are ordered from near to far, so a sphere behind the best hit contains no nearer one.
            if best.is_some_and(|(distance_m, _)| distance_m < enters_m) {
                break;
            }
            if let Some(distance_m) = self.meets(entity, &placements[entity], ray, enters_m)
                && best.is_none_or(|(least_m, _)| distance_m < least_m)
            {
                best = Some((distance_m, entity));
            }
        }
        best.map(|(distance_m, entity)| (entity, ray.origin + distance_m * ray.direction))
    }

    /// Distance at which a ray that enters the bounding sphere at `enters_m` meets the mesh.
    fn meets(&self, entity: usize, placement: &Placement, ray: Ray, enters_m: f64) -> Option<f64> {
        let mesh = self.scene.entities[entity].mesh;
        let shape = self.shapes[mesh].get_or_init(|| RayMesh::new(&self.scene.meshes[mesh]));
        let (centre, radius_m) = self.sphere(entity, placement);
        let to_object = placement.turn().inverse();
        // The ray starts at the sphere, in units of its radius, so f32 is precise for any distance of the camera.
        let start = to_object * (ray.origin + enters_m * ray.direction - centre) / radius_m;
        let hit = shape.first_hit(start.as_vec3a(), (to_object * ray.direction).as_vec3a())?;
        Some(enters_m + f64::from(hit) * radius_m)
    }

    /// Whether a drag from a position moves the selected entity instead of the camera: the entity, or another piece of the
    /// same thing, is seen there, and it occludes or emits.
    pub fn grabs(&self, at: [f32; 2]) -> bool {
        self.selection.is_some_and(|selected| {
            let entity = &self.scene.entities[selected];
            let is_of_it = |seen: usize| seen == selected || edit::pieces(&self.scene.data, selected).contains(&seen);
            (entity.occludes || entity.emits) && self.hit(at).is_some_and(|(seen, _)| is_of_it(seen))
        })
    }

    pub(super) fn grab(&mut self, at: [f32; 2]) -> Effect {
        self.drag = None;
        if self.grabs(at)
            && let Some((entity, anchor)) = self.hit(at)
        {
            let data = &self.scene.data;
            let before = edit::pieces(data, entity).into_iter().map(|piece| (piece, data.entities[piece].clone()));
            self.drag = Some(EntityDrag { before: before.collect(), anchor, moved: false });
        }
        Effect::default()
    }

    pub(super) fn let_go(&mut self) -> Effect {
        let moved = self.drag.take().is_some_and(|drag| drag.moved);
        self.history.close();
        // Back among what rests: the group is baked anew while the picture goes on by fields.
        let regrouped = moved && self.scene.rejoin();
        Changed { placements: regrouped, ..Changed::default() }.into()
    }

    pub(super) fn drag_to(&mut self, at: [f32; 2]) -> Effect {
        let reach_m = REACH * self.bounds().1.max(self.orbit.distance_m);
        let ray = self.ray(at);
        let Some(drag) = &mut self.drag else { return Effect::default() };
        let along = (drag.anchor.y - ray.origin.y) / ray.direction.y;
        if !(along > 0.0 && along < reach_m) {
            return Effect::default();
        }
        let by = (ray.origin + along * ray.direction - drag.anchor) * DVec3::new(1.0, 0.0, 1.0);
        let after: Option<Vec<EntityData>> = drag.before.iter().map(|(_, data)| edit::moved(data, by)).collect();
        let Some(after) = after else { return Effect::default() };
        let joins = drag.moved;
        drag.moved = true;
        self.history.note(EditKind::Drag, Some(drag.before[0].0), joins, &self.scene.data);
        for ((entity, _), after) in drag.before.iter().zip(after) {
            self.scene.put_entity(*entity, after);
        }
        Changed { placements: true, ..Changed::default() }.into()
    }
}

impl Ray {
    /// Distance at which the ray enters a sphere: 0 from inside, `None` if it misses.
    fn enters(&self, centre: DVec3, radius_m: f64) -> Option<f64> {
        let toward = centre - self.origin;
        let along = toward.dot(self.direction);
        let beside = (toward - along * self.direction).length_squared();
        // The sphere is slightly enlarged, because its radius and the mesh are rounded to f32.
        let half = (radius_m * (1.0 + 1e-6)).powi(2) - beside;
        (half >= 0.0 && along + half.sqrt() >= 0.0).then(|| (along - half.sqrt()).max(0.0))
    }
}
