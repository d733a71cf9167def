//! T0 at pixels: what the middle of each pixel shows of the scene, lit by rays from there.

use super::raycast::{Estimate, RayCast};
use super::world::{VertexView, World};
use super::{RayMeshes, Vertex};
use crate::draw::camera::through_pixels;
use crate::scene::{Placement, Scene};
use glam::DVec3;
use rayon::prelude::*;

/// What the middle of each pixel shows that is lit and does not emit: its entity with the pixel's number, row by row
/// from the top left, and the view from there.
pub fn lit_points(world: &World<'_>, [width, height]: [u32; 2]) -> Vec<(Vertex, VertexView)> {
    let camera = &world.scene.data.camera;
    let eye = camera.eye.as_dvec3();
    let direction = through_pixels(camera, [width, height].map(f64::from));
    let surface = |pixel: u32| {
        let middle = [pixel % width, pixel / width].map(|place| f64::from(place) + 0.5);
        let (entity, view) = seen(world, eye, direction(middle))?;
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

/// The entity that a ray meets first, and the place where it does, with the normal of smooth shading.
fn seen(world: &World<'_>, eye: DVec3, direction: DVec3) -> Option<(usize, VertexView)> {
    let all = (0..world.entities.len()).filter_map(|entity| {
        let sight = world.sight(entity, eye);
        Some((entity, world.first_hit_m(&sight, direction)?))
    });
    let (entity, _) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (local, normal) = world.surface_hit(&world.sight(entity, eye), direction)?;
    // Seen from behind, a surface is lit as it is drawn: by its normal.
    Some((entity, world.surface(entity, local, normal)))
}
