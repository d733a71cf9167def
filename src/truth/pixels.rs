//! T0 at pixels: what pixels show of the scene, lit by rays from there.

use super::Vertex;
use super::raycast::{Estimate, RayCast};
use super::reflect::Reflection;
use super::world::{EntityView, SurfaceHit, VertexView, World};
use crate::asset::backdrop::Backdrop;
use crate::draw::camera::through_pixels;
use glam::DVec3;
use rayon::prelude::*;

/// Vulkan's standard places of four samples in a pixel ("Standard sample locations"), and of one.
const FOUR: [[f64; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];
const ONE: [[f64; 2]; 1] = [[0.5, 0.5]];
/// Rows of pixels between two reports of progress.
const ROWS: usize = 8;

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
    /// From there towards the eye, unit.
    pub toward: DVec3,
    /// Linear RGB radiance that it emits.
    pub emission: DVec3,
    /// The surface's own normal, which maps do not tilt, unit.
    pub ground: DVec3,
    pub hit: SurfaceHit,
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

    /// Unit direction through a place of a pixel, (0, 0) to (1, 1).
    fn toward(&self, pixel: u32, place: [f64; 2]) -> DVec3 {
        let [width, _] = self.size;
        (self.direction)([f64::from(pixel % width) + place[0], f64::from(pixel / width) + place[1]])
    }

    /// What a pixel, counted row by row from the top left, shows at a place within it, (0, 0) to (1, 1): from near to
    /// far, up to what lets no light through.
    pub fn seen(&self, pixel: u32, place: [f64; 2]) -> Vec<Seen> {
        let direction = self.toward(pixel, place);
        let world = self.world;
        let met = self.sights.iter().filter_map(|sight| Some((sight, world.first_hit_m(sight, direction)?)));
        let mut met: Vec<(&EntityView, f64)> = met.collect();
        met.sort_by(|a, b| a.1.total_cmp(&b.1));
        let is_opaque = |(sight, _): &(&EntityView, f64)| !world.scene.entities[sight.entity].transparent;
        let count = met.iter().position(is_opaque).map_or(met.len(), |last| last + 1);
        met[..count].iter().filter_map(|(sight, _)| self.surface(sight, direction)).collect()
    }

    /// An entity where a ray meets it first.
    fn surface(&self, sight: &EntityView, direction: DVec3) -> Option<Seen> {
        let world = self.world;
        let entity = sight.entity;
        let hit = world.surface_hit(sight, direction)?;
        let emission = match world.scene.entities[entity].emission.as_dvec3() {
            DVec3::ZERO => DVec3::ZERO,
            emission => emission * hit.glow * world.emission(sight, direction).unwrap_or(DVec3::ZERO),
        };
        let view = world.surface(entity, hit.place, hit.tilted);
        let ground = (world.entities[entity].rotation * hit.normal).normalize();
        Some(Seen { entity, view, toward: -direction, emission, ground, hit })
    }
}

/// What the middle of each pixel shows that is lit and does not emit: its entity with the pixel's number, row by row
/// from the top left, and the view from there.
pub fn lit_points(world: &World<'_>, [width, height]: [u32; 2]) -> Vec<(Vertex, VertexView)> {
    let eye = Eye::new(world, [width, height]);
    let surface = |pixel: u32| {
        let Seen { entity, view, .. } = eye.seen(pixel, ONE[0]).pop()?;
        let entity_data = &world.scene.entities[entity];
        (entity_data.receives && !entity_data.emits).then_some((Vertex { entity, index: pixel as usize }, view))
    };
    (0..width * height).into_par_iter().filter_map(surface).collect()
}

/// A picture by rays: linear RGB, three floats a pixel, rows from the top.
pub struct RayPicture {
    /// Samples above the white of the exposure were brought down to it, as pictures for a screen have them.
    pub shown: Vec<f32>,
    /// Radiance as it is.
    pub linear: Vec<f32>,
    /// Root mean square of the standard error relative to that of the radiosity, over what is lit.
    pub error: f64,
}

/// The picture of a scene by rays through its pixels, each at four places where edges are `smoothed`, which share the
/// rays of `cast`: emission, and light from the sky and from every light past everything, as [`RayCast`] has it. Where
/// nothing is met it has the sky as [`Backdrop`] has it. `tell` is given the rows that are done.
pub fn picture(
    world: &World<'_>,
    [width, height]: [u32; 2],
    smoothed: bool,
    cast: &RayCast,
    tell: &dyn Fn(u32),
) -> RayPicture {
    let scene = world.scene;
    let eye = Eye::new(world, [width, height]);
    let places: &[[f64; 2]] = if smoothed { &FOUR } else { &ONE };
    let share = cast.rays / places.len() as u32;
    let runs = cast.runs.min(2);
    let cast = RayCast { rays: share.max(runs), runs, ..*cast };
    let caster = cast.caster(world);
    let backdrop = Backdrop::new(&scene.environment);
    let mean = scene.environment.mean();
    let background = |pixel, place| backdrop.as_ref().map_or(mean, |sky| sky.radiance(eye.toward(pixel, place)));
    let white = f64::from(scene.data.output.white());
    // The two values of a pixel, its squared radiosity and its squared standard error.
    let pixel = |pixel: u32| {
        let mut of_pixel = [DVec3::ZERO; 4];
        for (index, place) in places.iter().enumerate() {
            let mut radiance = DVec3::ZERO;
            let mut free = 1.0;
            for seen in eye.seen(pixel, *place) {
                radiance += free * seen.emission;
                let before = free;
                free *= 1.0 - seen.hit.opacity;
                if !scene.entities[seen.entity].receives {
                    continue;
                }
                let key = Vertex { entity: seen.entity, index: pixel as usize * places.len() + index };
                let entity = &scene.entities[seen.entity];
                let base = seen.hit.over_mean * entity.albedo.as_dvec3();
                let surface = Reflection::seen(base, &seen, cast.single_scatter);
                let Estimate { radiosity, error } = caster.reflected(&seen.view, &surface, key);
                let radiosity = before * DVec3::from(radiosity);
                let error = before * DVec3::from(error);
                radiance += radiosity;
                of_pixel[2] += radiosity * radiosity;
                of_pixel[3] += error * error;
            }
            radiance += free * background(pixel, *place);
            // As drawing brings it down, hue kept.
            of_pixel[0] += radiance * (white / radiance.max_element().max(white));
            of_pixel[1] += radiance;
        }
        of_pixel.map(|value| value / places.len() as f64)
    };
    let mut out = RayPicture { shown: Vec::new(), linear: Vec::new(), error: 0.0 };
    let mut squares = [f64::MIN_POSITIVE, 0.0];
    for rows in (0..height).step_by(ROWS) {
        let end = (rows + ROWS as u32).min(height);
        let values: Vec<[DVec3; 4]> = (rows * width..end * width).into_par_iter().map(pixel).collect();
        for [shown, linear, radiosity, error] in values {
            out.shown.extend(shown.as_vec3().to_array());
            out.linear.extend(linear.as_vec3().to_array());
            squares[0] += radiosity.element_sum();
            squares[1] += error.element_sum() / places.len() as f64;
        }
        tell(end);
    }
    out.error = (squares[1] / squares[0]).sqrt();
    out
}
