//! T1: the merge's chain of products on exact factors. Each occluder's visibility and each light's radiance is ray cast
//! from the vertex itself, projected to SH, and multiplied in f64.

use super::Vertex;
use super::sequence::{Axes, COSINE_INTEGRAL, Sequence, cone_solid_angle};
use super::world::{EntityView, VertexView, World};
use crate::lists::gather::distance_key;
use crate::lists::skip::Skip;
use crate::merge::chain::Multiplier;
use crate::merge::twin::{Cap, Cone, sheet_above_horizon, sheet_before};
use crate::sh::basis::{MAX_COEFFICIENTS, Y00, coefficient_count, evaluate};
use crate::sh::lobe::clamped_cosine;
use crate::sh::polygon::POLYGON_BANDS;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

type Coefficients = [f64; MAX_COEFFICIENTS];

#[derive(Clone, Copy, Debug)]
pub struct ExactChain {
    /// SH bands of transfer, light and visibility.
    pub bands: usize,
    /// Rays per factor. Powers of two are stratified best.
    pub rays: u32,
    /// Seed of the ray directions.
    pub seed: u64,
    /// Lookups that the chain skips, by the merge's rules. Skips matter because the band-limited product is not zero
    /// where the true visibility is zero.
    pub skip: Skip,
}

impl Default for ExactChain {
    /// 4 bands throughout, 4096 rays a factor, the merge's chain, every skip.
    fn default() -> Self {
        ExactChain { bands: 4, rays: 4096, seed: 2, skip: Skip::ALL }
    }
}

impl ExactChain {
    /// Radiosity of the given vertices: linear RGB radiance that leaves the surface, without emission.
    pub fn run(&self, world: &World<'_>, vertices: &[Vertex]) -> Vec<[f64; 3]> {
        let multiplier = Multiplier::new(self.bands);
        let sky = world.scene.environment.coefficients(self.bands);
        vertices.par_iter().map(|&vertex| self.vertex(world, &multiplier, &sky, vertex)).collect()
    }

    fn vertex(&self, world: &World<'_>, multiplier: &Multiplier, sky: &[Vec<f64>; 3], vertex: Vertex) -> [f64; 3] {
        let count = coefficient_count(self.bands);
        let view = world.view(vertex);
        let points = |stream: usize| {
            Sequence::new(self.seed, [u64::MAX, vertex.entity as u64, (vertex.index as u64) << 16 | stream as u64])
        };
        let transfer = self.transfer(world, &view, points(0));
        let centre = |entity: usize| world.entities[entity].centre.as_vec3().to_array();
        let cone = |sight: &EntityView| {
            let entity = &world.entities[sight.entity];
            Cone::new(entity.centre, entity.radius_m, view.position)
        };
        let mut occluders = world.occluders(&view);
        // As in the merge, ties of the f32 distance key are ordered by index, and sheets come last.
        let sheet = |sight: &EntityView| world.sheet(sight.entity, &view);
        occluders.sort_by_key(|sight| {
            (sheet(sight).is_some(), distance_key(centre(sight.entity), centre(vertex.entity)), sight.entity)
        });
        let factors: Vec<(EntityView, f64, Coefficients, Option<Cap>)> = occluders
            .into_iter()
            .map(|occluder| {
                if let Some(sheet) = sheet(&occluder) {
                    let blocked = if self.bands > POLYGON_BANDS {
                        self.blocked(world, &occluder, points(1 + occluder.entity))
                    } else {
                        let known = sheet.blocked();
                        std::array::from_fn(|k| if k < count { known[k] } else { 0.0 })
                    };
                    return (occluder, sheet_above_horizon(&sheet, view.normal, self.skip), blocked, None);
                }
                let cone = cone(&occluder);
                let share = cone.field_share(self.skip);
                let blocked = self.blocked(world, &occluder, points(1 + occluder.entity));
                // Its area is that of the blocked part, not the fitted area that the merge uses.
                let cap = (share < 1.0).then(|| cone.cap_of(blocked[0] / Y00).by(1.0 - share));
                (occluder, cone.above_horizon(view.normal, self.skip), blocked.map(|b| b * share), cap)
            })
            .collect();
        // The chain of the occluders, each weighted by `share`.
        let chain = |share: &dyn Fn(&EntityView) -> f64| {
            let mut state = multiplier.begin(&transfer[..count]);
            for (occluder, reach, blocked, cap) in &factors {
                let share = reach * share(occluder);
                multiplier.multiply(&mut state, &blocked.map(|b| b * share));
                if let Some(cap) = cap {
                    cap.by(share).cover(multiplier, &mut state);
                }
            }
            state
        };

        let through = chain(&|_| 1.0);
        let mut sum = DVec3::from_array(sky.each_ref().map(|channel| multiplier.meet(&through, channel)));
        for light in world.lights(&view) {
            let behind = cone(&light);
            let t = chain(&|occluder| match sheet(occluder) {
                Some(sheet) => {
                    let radius_m = world.entities[light.entity].radius_m;
                    sheet_before(&sheet, behind.distance * behind.toward, radius_m, self.skip)
                }
                None if occluder.precedes(&light) => cone(occluder).overlap(&behind, self.skip),
                None => 0.0,
            });
            let reach = behind.above_horizon(view.normal, self.skip);
            let radiance = self.radiance(world, &light, points(1 + light.entity));
            let emission = world.emission_at(light.entity, view.position);
            sum +=
                reach * emission * DVec3::from_array(radiance.each_ref().map(|channel| multiplier.meet(&t, channel)));
        }
        (sum * world.scene.entities[vertex.entity].albedo.as_dvec3() / PI).to_array()
    }

    /// Self-visibility times cosine.
    fn transfer(&self, world: &World<'_>, view: &VertexView, points: Sequence) -> Coefficients {
        let mut out = [0.0; MAX_COEFFICIENTS];
        if !view.shadows_itself() {
            let count = coefficient_count(self.bands);
            out[..count].copy_from_slice(&clamped_cosine(self.bands, view.normal));
            return out;
        }
        let axes = Axes::new(view.normal);
        let mut basis = [0.0; MAX_COEFFICIENTS];
        for ray in 0..self.rays {
            let direction = axes.cosine(points.point(ray));
            if !world.blocks_itself(view, direction, f64::INFINITY) {
                evaluate(self.bands, direction, &mut basis);
                out.iter_mut().zip(&basis).for_each(|(sum, y)| *sum += y);
            }
        }
        out.map(|sum| sum * COSINE_INTEGRAL / f64::from(self.rays))
    }

    fn blocked(&self, world: &World<'_>, occluder: &EntityView, points: Sequence) -> Coefficients {
        let cone = occluder.cone();
        let mut out = [0.0; MAX_COEFFICIENTS];
        let mut basis = [0.0; MAX_COEFFICIENTS];
        for ray in 0..self.rays {
            let direction = cone.axes.cone(points.point(ray), cone.height);
            if world.blocks(occluder, direction, f64::INFINITY) {
                evaluate(self.bands, direction, &mut basis);
                out.iter_mut().zip(&basis).for_each(|(sum, y)| *sum += y);
            }
        }
        out.map(|sum| sum * cone_solid_angle(cone.height) / f64::from(self.rays))
    }

    fn radiance(&self, world: &World<'_>, light: &EntityView, points: Sequence) -> [Coefficients; 3] {
        let cone = light.cone();
        let mut out = [[0.0; MAX_COEFFICIENTS]; 3];
        let mut basis = [0.0; MAX_COEFFICIENTS];
        for ray in 0..self.rays {
            let direction = cone.axes.cone(points.point(ray), cone.height);
            if let Some(pattern) = world.emission(light, direction) {
                evaluate(self.bands, direction, &mut basis);
                for (channel, amount) in out.iter_mut().zip(pattern.to_array()) {
                    channel.iter_mut().zip(&basis).for_each(|(sum, y)| *sum += amount * y);
                }
            }
        }
        out.map(|channel| channel.map(|sum| sum * cone_solid_angle(cone.height) / f64::from(self.rays)))
    }
}
