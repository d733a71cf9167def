//! T0 at pixels: what pixels show of the scene, lit by rays from there.

use super::raycast::{Estimate, RayCast};
use super::world::{EntityView, VertexView, World};
use super::{RayMeshes, Vertex};
use crate::draw::camera::through_pixels;
use crate::scene::{Placement, Scene};
use glam::DVec3;
use rayon::prelude::*;

/// The scene's camera in front of a world, for pictures of one size.
pub struct Eye<'w> {
    world: &'w World<'w>,
    size: [u32; 2],
    direction: Box<dyn Fn([f64; 2]) -> DVec3 + Sync>,
    /// Every entity as seen from there.
    sights: Vec<EntityView>,
}

/// What a ray from the eye meets first.
pub struct Seen {
    pub entity: usize,
    /// The view from there, with the normal of smooth shading. Seen from behind, a surface is lit as it is drawn: by
    /// its normal.
    pub view: VertexView,
    /// Linear RGB radiance that it emits.
    pub emission: DVec3,
}

impl<'w> Eye<'w> {
    /// The eye for pictures of that width and height in pixels.
    pub fn new(world: &'w World<'w>, size: [u32; 2]) -> Self {
        let camera = &world.scene.data.camera;
        let position = camera.eye.as_dvec3();
        Eye {
            world,
            size,
            direction: Box::new(through_pixels(camera, size.map(f64::from))),
            sights: (0..world.entities.len()).map(|entity| world.sight(entity, position)).collect(),
        }
    }

    /// What a pixel, counted row by row from the top left, shows at a place within it, (0, 0) to (1, 1).
    pub fn seen(&self, pixel: u32, place: [f64; 2]) -> Option<Seen> {
        let [width, _] = self.size;
        let direction = (self.direction)([f64::from(pixel % width) + place[0], f64::from(pixel / width) + place[1]]);
        let world = self.world;
        let met = self.sights.iter().filter_map(|sight| Some((sight, world.first_hit_m(sight, direction)?)));
        let (sight, _) = met.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let entity = sight.entity;
        let (local, normal) = world.surface_hit(sight, direction)?;
        let emission = match world.scene.entities[entity].emission.as_dvec3() {
            DVec3::ZERO => DVec3::ZERO,
            emission => emission * world.emission(sight, direction).unwrap_or(DVec3::ZERO),
        };
        Some(Seen { entity, view: world.surface(entity, local, normal), emission })
    }
}

/// What the middle of each pixel shows that is lit and does not emit: its entity with the pixel's number, row by row
/// from the top left, and the view from there.
pub fn lit_points(world: &World<'_>, [width, height]: [u32; 2]) -> Vec<(Vertex, VertexView)> {
    let eye = Eye::new(world, [width, height]);
    let surface = |pixel: u32| {
        let Seen { entity, view, .. } = eye.seen(pixel, [0.5; 2])?;
        let entity_data = &world.scene.entities[entity];
        (entity_data.receives && !entity_data.emits).then_some((Vertex { entity, index: pixel as usize }, view))
    };
    (0..width * height).into_par_iter().filter_map(surface).collect()
}

/// The pixels of [`lit_points`], and the linear RGB radiance that leaves what they show. `cast` decides the rays a
/// pixel.
pub fn pixels(scene: &Scene, placements: &[Placement], size: [u32; 2], cast: &RayCast) -> Vec<(usize, Estimate)> {
    let shapes = RayMeshes::new(scene);
    let world = World::new(scene, &shapes, placements);
    let points = lit_points(&world, size);
    let lit = cast.run_at(&world, &points);
    points.iter().zip(lit).map(|((key, _), estimate)| (key.index, estimate)).collect()
}
