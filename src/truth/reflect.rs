//! How a point of a surface reflects light towards the eye: diffusely, and by microfacets where it is glossy.

use super::pixels::Seen;
use super::sequence::Axes;
use crate::gloss::{brdf, lobe};
use crate::scene::Gloss;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// The reflection of a point of a surface.
#[derive(Clone, Copy)]
pub struct Reflection {
    /// Base colour.
    pub base: DVec3,
    /// The microfacets, where there are any.
    pub lobe: Option<MicrofacetLobe>,
    /// The normal of the surface itself, which hides what lies below it; `None` where it is that of the view.
    pub ground: Option<DVec3>,
}

/// Microfacets that are seen from somewhere.
#[derive(Clone, Copy)]
pub struct MicrofacetLobe {
    gloss: Gloss,
    alpha: f64,
    facing: DVec3,
    axes: Axes,
    /// Towards the eye, by the axes.
    view: DVec3,
    /// What light gains that microfacets pass on to each other.
    again: DVec3,
}

impl Reflection {
    /// Of a surface that is diffuse alone.
    pub fn diffuse(base: DVec3) -> Self {
        Reflection { base, lobe: None, ground: None }
    }

    /// Of what a ray from the eye meets; `single_scatter` where light that microfacets pass on to each other is lost.
    /// Seen from behind it shows its front's diffuse light alone.
    pub fn seen(base: DVec3, seen: &Seen, single_scatter: bool) -> Self {
        let lobe = seen.hit.gloss.map(|gloss| {
            let lobe = MicrofacetLobe::new(gloss, base, seen.view.normal, seen.toward, single_scatter);
            if seen.ground.dot(seen.toward) < 0.0 { MicrofacetLobe { again: DVec3::ZERO, ..lobe } } else { lobe }
        });
        Reflection { base, lobe, ground: Some(seen.ground) }
    }

    /// Whether the surface itself does not hide a direction.
    pub fn sees(&self, direction: DVec3) -> bool {
        self.ground.is_none_or(|ground| ground.dot(direction) > 0.0)
    }

    /// The share of the base colour that reflects light from a direction diffusely.
    pub fn diffuse_share(&self, direction: DVec3) -> f64 {
        self.lobe.map_or(1.0, |lobe| {
            let half = (lobe.axes.local(direction) + lobe.view).normalize_or_zero();
            brdf::diffuse_share(&lobe.gloss, half.dot(lobe.view))
        })
    }
}

impl MicrofacetLobe {
    fn new(gloss: Gloss, base: DVec3, normal: DVec3, toward: DVec3, single_scatter: bool) -> Self {
        let axes = Axes::new(normal);
        let mut view = axes.local(toward);
        // As shaders have it where smooth shading turns a normal away from the eye.
        view.z = view.z.max(crate::gloss::LEAST_VIEW_Z);
        let view = view.normalize();
        let facing = brdf::facing(&gloss, base);
        let roughness = f64::from(gloss.roughness);
        let again = if single_scatter {
            DVec3::ONE
        } else {
            let mean = f64::from(lobe::mean_energy(gloss.roughness));
            let passed = facing * mean / (1.0 - facing * (1.0 - mean)).max(DVec3::splat(1e-6));
            1.0 + passed * (1.0 / lobe::energy(roughness, view.z).max(crate::gloss::LEAST_ENERGY) - 1.0)
        };
        MicrofacetLobe { gloss, alpha: brdf::alpha(roughness), facing, axes, view, again }
    }

    fn colored(&self, [value, schlick]: [f64; 2]) -> DVec3 {
        value * self.again * (self.facing + (1.0 - self.facing) * schlick)
    }

    /// What is reflected of unit radiance from a direction, by solid angle.
    pub fn value(&self, direction: DVec3) -> DVec3 {
        self.colored(brdf::lobe(self.alpha, self.view, self.axes.local(direction)))
    }

    /// The density by solid angle with which [`MicrofacetLobe::sample`] takes a direction.
    pub fn density(&self, direction: DVec3) -> f64 {
        let half = (self.axes.local(direction) + self.view).normalize_or_zero();
        brdf::distribution(self.alpha, half.z) * half.z / (4.0 * self.view.dot(half)).max(1e-12)
    }

    /// A direction for a point of the unit square, and what is reflected of unit radiance from there over its density.
    pub fn sample(&self, point: DVec2) -> (DVec3, DVec3) {
        let local = brdf::reflected(self.alpha, self.view, point.x.min(1.0 - 1e-9), TAU * point.y);
        (self.axes.world(local), self.colored(brdf::sampled_lobe(self.alpha, self.view, local)))
    }
}

/// Radiance of white under unit irradiance.
pub const LAMBERT: f64 = 1.0 / PI;
