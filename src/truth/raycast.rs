//! T0: radiosity by ray casting, which is also the alternative to shadow fields in benchmarks.
//!
//! The distant light is sampled in proportion to the cosine, local lights uniformly in the cone around their bounding
//! sphere. Sums are in f64, rays in f32 (in units of each occluder's radius, so that scales do not matter). Each
//! vertex has its own scrambling; several runs give the standard error.

use super::Vertex;
use super::reflect::{LAMBERT, Reflection};
use super::sequence::{Axes, COSINE_INTEGRAL, Sequence, cone_solid_angle};
use super::world::{EntityView, VertexView, World};
use crate::asset::environment::Environment;
use crate::sh::basis::values;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// The form in which the distant light is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distant {
    /// The radiance that the scene describes.
    Exact,
    /// Its projection to that number of bands, for a light that is defined by its projection.
    Bands(usize),
}

#[derive(Clone, Copy, Debug)]
pub struct RayCast {
    /// Rays per vertex for the distant light, and the same number for every local light; at least `runs`. Powers of two
    /// are stratified best.
    pub rays: u32,
    /// Number of independent runs that share the rays, at least 1; the standard error needs 2.
    pub runs: u32,
    pub seed: u64,
    pub distant: Distant,
    /// How often light bounces at most; each ray that counts it is followed from surface to surface, which reflect
    /// diffusely with their base colour. Of paths that are longer than three bounces a part stands for all.
    pub bounces: u32,
    /// Whether glossy surfaces lose light that microfacets pass on to each other.
    pub single_scatter: bool,
}

impl Default for RayCast {
    /// 4096 rays in 8 runs, which stop at what they meet.
    fn default() -> Self {
        RayCast { rays: 4096, runs: 8, seed: 1, distant: Distant::Exact, bounces: 0, single_scatter: false }
    }
}

/// Radiosity of a vertex.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    /// Linear RGB radiance that leaves the surface, without emission.
    pub radiosity: [f64; 3],
    /// Its standard error; 0 after a single run.
    pub error: [f64; 3],
}

/// Root mean square of the standard errors, relative to that of the values.
pub fn relative_error(estimates: &[Estimate]) -> f64 {
    let square = |of: &dyn Fn(&Estimate) -> [f64; 3]| estimates.iter().flat_map(of).map(|c| c * c).sum::<f64>();
    (square(&|e| e.error) / square(&|e| e.radiosity).max(f64::MIN_POSITIVE)).sqrt()
}

/// The distant light, prepared for evaluation in many directions.
enum Radiance<'e> {
    None,
    Exact(&'e Environment),
    Bands(usize, Box<[Vec<f64>; 3]>),
}

impl Radiance<'_> {
    fn at(&self, direction: DVec3) -> DVec3 {
        match self {
            Radiance::None => DVec3::ZERO,
            Radiance::Exact(environment) => DVec3::from_array(environment.radiance(direction)),
            Radiance::Bands(bands, coefficients) => {
                let basis = values(*bands, direction);
                let sum = |channel: &Vec<f64>| channel.iter().zip(&basis).map(|(c, y)| c * y).sum();
                DVec3::from_array(coefficients.each_ref().map(sum))
            }
        }
    }
}

/// Rays into a world.
#[derive(Clone)]
pub(super) struct Caster<'w> {
    cast: RayCast,
    world: &'w World<'w>,
    radiance: Arc<Radiance<'w>>,
}

impl RayCast {
    /// Radiosity of the given vertices.
    pub fn run(&self, world: &World<'_>, vertices: &[Vertex]) -> Vec<Estimate> {
        let caster = self.caster(world);
        vertices.par_iter().map(|&vertex| caster.point(&world.view(vertex), vertex)).collect()
    }

    /// Radiosity of points of surfaces. A point's entity reflects, and its index decides the rays.
    pub fn run_at(&self, world: &World<'_>, points: &[(Vertex, VertexView)]) -> Vec<Estimate> {
        let caster = self.caster(world);
        points.par_iter().map(|(key, view)| caster.point(view, *key)).collect()
    }

    /// What points of a world can be lit with, one after another.
    pub(super) fn caster<'w>(&self, world: &'w World<'w>) -> Caster<'w> {
        assert!(self.runs >= 1 && self.rays >= self.runs, "{} rays in {} runs", self.rays, self.runs);
        let environment = &world.scene.environment;
        let radiance = match self.distant {
            _ if environment.is_none() => Radiance::None,
            Distant::Exact => Radiance::Exact(environment),
            Distant::Bands(bands) => Radiance::Bands(bands, Box::new(environment.coefficients(bands))),
        };
        Caster { cast: *self, world, radiance: Arc::new(radiance) }
    }
}

impl Caster<'_> {
    /// Radiosity of a point of a surface, as [`RayCast::run_at`] has it.
    pub(super) fn point(&self, view: &VertexView, key: Vertex) -> Estimate {
        let albedo = self.world.scene.entities[key.entity].albedo.as_dvec3();
        self.reflected(view, &Reflection::diffuse(albedo), key)
    }

    /// Radiance that a point of a surface reflects.
    pub(super) fn reflected(&self, view: &VertexView, surface: &Reflection, key: Vertex) -> Estimate {
        let Caster { cast, world, .. } = self;
        let mut occluders = world.occluders(view);
        occluders.retain(|occluder| occluder.rises_above(view.normal));
        // Near occluders come first, because they are the most likely to block a ray.
        occluders.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        let lights: Vec<Shadowed> = world
            .lights(view)
            .into_iter()
            .filter(|light| light.rises_above(view.normal))
            .map(|light| Shadowed::new(view, light, &occluders))
            .collect();

        let mut sum = DVec3::ZERO;
        let mut squares = DVec3::ZERO;
        for run in 0..cast.runs {
            let sequence = |stream: usize| {
                let keys = [u64::from(run), key.entity as u64, (key.index as u64) << 16 | stream as u64];
                Sequence::new(cast.seed, keys)
            };
            let at = |stream: usize| Point { view, surface, points: sequence(stream) };
            let mut found = self.sky(&at(0), &occluders);
            for (stream, light) in lights.iter().enumerate() {
                found += self.light(&at(1 + stream), light);
            }
            if cast.bounces > 0 {
                found += self.bounced(&at(lights.len() + 1));
            }
            sum += found;
            squares += found * found;
        }
        let runs = f64::from(cast.runs);
        let mean = sum / runs;
        let variance = (squares / runs - mean * mean).max(DVec3::ZERO) / (runs - 1.0).max(1.0);
        Estimate { radiosity: mean.to_array(), error: variance.to_array().map(f64::sqrt) }
    }

    fn rays_a_run(&self) -> u32 {
        self.cast.rays / self.cast.runs
    }

    /// Reflected light of the distant light.
    fn sky(&self, at: &Point<'_>, occluders: &[EntityView]) -> DVec3 {
        if matches!(*self.radiance, Radiance::None) {
            return DVec3::ZERO;
        }
        let arrives = |direction: DVec3| {
            let blocked = occluders.iter().any(|occluder| self.world.blocks(occluder, direction, f64::INFINITY))
                || self.world.blocks_itself(at.view, direction, f64::INFINITY);
            if blocked { DVec3::ZERO } else { self.radiance.at(direction) }
        };
        self.gather(at, &arrives)
    }

    /// What a surface reflects of the light that arrives from each direction.
    fn gather(&self, Point { view, surface, points }: &Point<'_>, arrives: &dyn Fn(DVec3) -> DVec3) -> DVec3 {
        let axes = Axes::new(view.normal);
        let mut diffuse = DVec3::ZERO;
        let mut glossy = DVec3::ZERO;
        for ray in 0..self.rays_a_run() {
            let direction = axes.cosine(points.point(ray));
            if surface.sees(direction) {
                diffuse += surface.diffuse_share(direction) * arrives(direction);
            }
            if let Some(lobe) = &surface.lobe {
                let (direction, weight) = lobe.sample(points.point(self.rays_a_run() + ray));
                if weight != DVec3::ZERO && surface.sees(direction) {
                    glossy += weight * arrives(direction);
                }
            }
        }
        (diffuse * surface.base * (LAMBERT * COSINE_INTEGRAL) + glossy) / f64::from(self.rays_a_run())
    }

    /// Reflected light of a local light behind what lies before it. Directions of a glossy surface are taken half from
    /// the light and half from the lobe, weighed by the sum of both densities (Veach, *Robust Monte Carlo Methods*,
    /// 1997, section 9.2.2).
    fn light(&self, at: &Point<'_>, shadowed: &Shadowed) -> DVec3 {
        let Point { view, surface, points } = at;
        let world = self.world;
        let light = &shadowed.light;
        let cone = light.cone();
        let density = 1.0 / cone_solid_angle(cone.height);
        let arrives = |direction: DVec3| {
            let cosine = direction.dot(view.normal);
            let pattern = (cosine > 0.0 && surface.sees(direction)).then(|| world.emission(light, direction)).flatten();
            let seen = pattern.filter(|_| !shadowed.hidden(world, view, direction));
            (cosine, seen.unwrap_or(DVec3::ZERO))
        };
        let mut sum = DVec3::ZERO;
        for ray in 0..self.rays_a_run() {
            let direction = cone.axes.cone(points.point(ray), cone.height);
            let (cosine, pattern) = arrives(direction);
            if pattern != DVec3::ZERO {
                sum += surface.base * (LAMBERT * cosine * surface.diffuse_share(direction) / density) * pattern;
                if let Some(lobe) = &surface.lobe {
                    sum += lobe.value(direction) * pattern / (density + lobe.density(direction));
                }
            }
            if let Some(lobe) = &surface.lobe {
                let (direction, weight) = lobe.sample(points.point(self.rays_a_run() + ray));
                let of_lobe = lobe.density(direction);
                if weight != DVec3::ZERO {
                    sum += weight * arrives(direction).1 * (of_lobe / (of_lobe + density));
                }
            }
        }
        sum * world.emission_at(light.entity, view.position) / f64::from(self.rays_a_run())
    }

    /// Reflected light that comes from other surfaces.
    fn bounced(&self, at: &Point<'_>) -> DVec3 {
        let cast = RayCast { rays: 1, runs: 1, bounces: 0, seed: at.points.seed(), ..self.cast };
        let one = Caster { cast, ..self.clone() };
        let next = std::cell::Cell::new(0);
        let arrives = |direction: DVec3| {
            next.set(next.get() + 1);
            self.along(at, direction, next.get(), &one)
        };
        self.gather(at, &arrives)
    }

    /// Radiance without emission along the path of that number from a point; `one` casts a ray from each surface that it
    /// meets.
    fn along(&self, at: &Point<'_>, toward: DVec3, path: u32, one: &Caster<'_>) -> DVec3 {
        let Caster { cast, world, .. } = self;
        let mut view = *at.view;
        let mut direction = toward;
        let mut weight = DVec3::ONE;
        let mut sum = DVec3::ZERO;
        for bounce in 0..cast.bounces {
            let Some((entity, hit)) = world.first_surface(&view, direction) else { break };
            view = world.surface(entity, hit.place, hit.normal);
            let of = &world.scene.entities[entity];
            // Only fronts reflect.
            if !of.receives || view.normal.dot(direction) >= 0.0 {
                break;
            }
            let base = of.albedo.as_dvec3() * hit.over_mean;
            let key = Vertex { entity, index: (path * cast.bounces + bounce) as usize };
            sum += weight * DVec3::from(one.reflected(&view, &Reflection::diffuse(base), key).radiosity);
            weight *= base;
            if bounce >= SURE_BOUNCES {
                // Russian roulette.
                let stays = weight.max_element().min(1.0);
                if at.points.other(cast.bounces + bounce).point(path).x >= stays {
                    break;
                }
                weight /= stays;
            }
            direction = Axes::new(view.normal).cosine(at.points.other(bounce).point(path));
        }
        sum
    }
}

/// A point of a surface on which light falls, and the points of the unit square that its rays are of.
struct Point<'p> {
    view: &'p VertexView,
    surface: &'p Reflection,
    points: Sequence,
}

/// After so many bounces a path may end by chance.
const SURE_BOUNCES: u32 = 2;

/// Distances along a ray that differ by less than this share are equal: rays are cast in f32, each in units of its
/// mesh. Where two surfaces coincide, the light's counts as the nearer one.
const TIE: f64 = 1e-5;

/// A local light as seen from a vertex, and what may hide it there.
struct Shadowed {
    light: EntityView,
    /// Occluders that lie wholly before it.
    before: Vec<EntityView>,
    /// Occluders that a ray may meet before the light or beyond it.
    beside: Vec<EntityView>,
    /// Whether the receiver's own mesh reaches beyond the light.
    limits_itself: bool,
}

impl Shadowed {
    fn new(view: &VertexView, light: EntityView, occluders: &[EntityView]) -> Self {
        let [near, far] = light.range_m();
        // The comparison of distances comes first, because that of cones costs an arc cosine.
        let nearer = |o: &&EntityView| o.entity != light.entity && o.range_m()[0] < far && o.overlaps(&light);
        let mut before = Vec::new();
        let mut beside = Vec::new();
        for occluder in occluders.iter().filter(nearer) {
            if occluder.range_m()[1] <= near { &mut before } else { &mut beside }.push(*occluder);
        }
        let limits_itself = view.own.is_some_and(|own| own.range_m()[1] > near);
        Shadowed { light, before, beside, limits_itself }
    }

    /// Whether a ray that meets the light is blocked before it. Only a ray that meets what lies beside the light is
    /// asked where it meets the light.
    fn hidden(&self, world: &World<'_>, view: &VertexView, direction: DVec3) -> bool {
        let anywhere = f64::INFINITY;
        if self.before.iter().any(|occluder| world.blocks(occluder, direction, anywhere))
            || (!self.limits_itself && world.blocks_itself(view, direction, anywhere))
        {
            return true;
        }
        let met = |limit_m: f64| {
            self.beside.iter().any(|occluder| world.blocks(occluder, direction, limit_m))
                || (self.limits_itself && world.blocks_itself(view, direction, limit_m))
        };
        // A ray that slips between two triangles of the light ends at its centre.
        let surface_m = || world.first_hit_m(&self.light, direction).unwrap_or(self.light.distance_m);
        met(self.light.range_m()[1]) && met(surface_m() * (1.0 - TIE))
    }
}
