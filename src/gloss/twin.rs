//! The CPU twin of pass "gloss" in f64: what a vertex reflects, from the same table, map and products.

use super::lobe::{self, LEVELS, TABLE, TAPS};
use super::sky_map::{COUNT, SIDE, SkyMap};
use super::{
    LEAST_COSINE, LEAST_HIDDEN, LEAST_SHARE, LEAST_VIEW_Z, MOST_NEARBY, MOST_SHARE, MOST_SLOPES, PIXEL_ROUGHNESS,
    WIDENED, brdf,
};
use crate::bounce::twin::SeenLink;
use crate::field::octahedron;
use crate::sh::basis::values;
use crate::sh::lobe::clamped_cosine;
use glam::DVec3;
use std::f64::consts::PI;

/// Distant light and lobes as shaders read them, rounded to halves.
pub struct Twin {
    map: SkyMap,
    lobes: Vec<[f32; 4]>,
}

/// A vertex and what reaches it.
pub struct TwinVertex {
    /// Unit, world.
    pub normal: DVec3,
    /// Towards the eye, unit.
    pub toward: DVec3,
    /// Transfer at the end of the sky's chain.
    pub through: [f64; COUNT],
    /// Where it stands, world, metres.
    pub place: DVec3,
    /// Irradiance over pi of all light that has bounced, and what the links lead to, where light bounces.
    pub bounced: Option<(DVec3, Vec<SeenLink>)>,
}

struct Tap {
    toward: DVec3,
    level: f64,
    weight: f64,
    whole: f64,
    bands: [f64; 3],
}

/// Bilinear within the centres of the first and last texel.
fn bilinear(texel: impl Fn(usize, usize) -> [f32; 4], [x, y]: [f64; 2], [width, height]: [usize; 2]) -> [f64; 4] {
    let x = (x - 0.5).clamp(0.0, (width - 1) as f64);
    let y = (y - 0.5).clamp(0.0, (height - 1) as f64);
    let [left, top] = [x as usize, y as usize];
    let [right, below] = [(left + 1).min(width - 1), (top + 1).min(height - 1)];
    let mix = |a: f64, b: f64, share: f64| a + (b - a) * share;
    std::array::from_fn(|c| {
        let at = |x: usize, y: usize| f64::from(half::f16::from_f32(texel(x, y)[c]));
        let upper = mix(at(left, top), at(right, top), x.fract());
        let lower = mix(at(left, below), at(right, below), x.fract());
        mix(upper, lower, y.fract())
    })
}

impl Twin {
    pub fn new(map: SkyMap) -> Self {
        Twin { map, lobes: lobe::texels() }
    }

    fn row(&self, row: usize, roughness: f64, z: f64) -> [f64; 4] {
        let last = (TABLE - 1) as f64;
        let at = [(1.0 - z).max(0.0).sqrt() * last + 0.5, roughness * last + 0.5];
        bilinear(|x, y| self.lobes[(row * TABLE + y) * TABLE + x], at, [TABLE, TABLE])
    }

    fn sky(&self, toward: DVec3, level: f64) -> DVec3 {
        let wide = SIDE + 2;
        let place = (octahedron::place(toward) * SIDE as f64 + 1.0).to_array();
        let below = level.floor().clamp(0.0, (LEVELS - 2) as f64);
        let at = |level: f64| {
            let first = level as usize * wide * wide;
            let [r, g, b, _] = bilinear(|x, y| self.map.texels[first + y * wide + x], place, [wide, wide]);
            DVec3::new(r, g, b)
        };
        at(below).lerp(at(below + 1.0), level - below)
    }

    fn taps(&self, vertex: &TwinVertex, z: f64, roughness: f64) -> [Tap; TAPS] {
        let away = vertex.normal * vertex.normal.dot(vertex.toward) - vertex.toward;
        let away = away / away.length().max(1e-6);
        std::array::from_fn(|k| {
            let [shift, level, weight, whole] = self.row(k, roughness, z);
            let [a, b, c, _] = self.row(TAPS + k, roughness, z);
            let angle = z.min(1.0).acos() + brdf::alpha(roughness) * shift;
            let toward = (angle.sin() * away + angle.cos().max(0.0) * vertex.normal).normalize();
            Tap { toward, level, weight, whole, bands: [a, b, c] }
        })
    }

    /// Light that has bounced, as the lobe sees it. `energy` is what the lobe reflects of unit light from everywhere.
    fn bounced(&self, vertex: &TwinVertex, roughness: f64, energy: f64, [hidden, nearby]: [f64; 2]) -> DVec3 {
        let Some((bounced, links)) = &vertex.bounced else { return DVec3::ZERO };
        let alpha = brdf::alpha(roughness).max(brdf::LEAST_ALPHA);
        let z = vertex.normal.dot(vertex.toward).max(LEAST_VIEW_Z);
        let mut mean = DVec3::ZERO;
        let mut lobe = DVec3::ZERO;
        let mut whole = 0.0;
        for link in links {
            let along = (link.middle - vertex.place).normalize_or_zero();
            let lit = vertex.normal.dot(along).max(LEAST_COSINE);
            let view_half = (0.5 + 0.5 * along.dot(vertex.toward)).max(0.0).sqrt().max(1e-4);
            let half_z = (vertex.normal.dot(along + vertex.toward) / (2.0 * view_half)).max(0.0);
            let slopes = PI * link.share / lit / (4.0 * view_half * half_z.powi(3)).max(1e-30);
            let widened = alpha * alpha + WIDENED * slopes.min(MOST_SLOPES);
            let weight = brdf::distribution(widened.sqrt(), half_z) * brdf::visibility(alpha, z, lit);
            mean += link.share * link.light;
            lobe += PI * link.share * weight * link.light;
            whole += PI * link.share * weight;
        }
        let [hidden, nearby] = if self.map.scale == 0.0 { [(whole / energy).min(1.0), 1.0] } else { [hidden, nearby] };
        let kept = (*bounced / mean.max(DVec3::splat(1e-20))).clamp(DVec3::ZERO, DVec3::ONE);
        hidden * kept * lobe / f64::max(whole, 1e-30) + nearby * (*bounced - mean).max(DVec3::ZERO)
    }

    /// The share of the sky of each colour that gets through; the share of the lobe that something stands before, and the
    /// factor on light from there.
    fn seen(&self, vertex: &TwinVertex, taps: &[Tap]) -> (DVec3, [f64; 2]) {
        let mut lobe = [0.0; COUNT];
        for tap in taps {
            let basis = values(4, tap.toward);
            let weight = tap.weight / tap.toward.dot(vertex.normal).max(LEAST_COSINE);
            for (k, sum) in lobe.iter_mut().enumerate() {
                let band = k.isqrt();
                *sum += weight * basis[k] * if band == 0 { 1.0 } else { tap.bands[band - 1] };
            }
        }
        let whole: f64 = taps.iter().map(|tap| tap.weight).sum();
        let cosine = clamped_cosine(4, vertex.normal);
        let share = |products: &[f32]| {
            let meet = |other: &[f64]| -> f64 {
                let row = |(row, other): (&[f32], &f64)| {
                    other * row.iter().zip(&lobe).map(|(p, l)| f64::from(*p) * l).sum::<f64>()
                };
                products.chunks_exact(COUNT).zip(other).map(row).sum()
            };
            let least = LEAST_SHARE * f64::from(products[0]) * whole + 1e-30;
            (meet(&vertex.through) / meet(&cosine).max(least)).clamp(0.0, MOST_SHARE)
        };
        let colors: Vec<f64> = self.map.products.chunks_exact(COUNT * COUNT).map(share).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let through = dot(&vertex.through, &lobe) / dot(&cosine, &lobe).max(LEAST_SHARE * whole);
        let hidden = 1.0 - through.clamp(0.0, 1.0);
        let of_cosine = 1.0 - (vertex.through[0] / cosine[0]).clamp(0.0, 1.0);
        (DVec3::from_slice(&colors), [hidden, (hidden / of_cosine.max(LEAST_HIDDEN)).min(MOST_NEARBY)])
    }

    /// What the pass writes for a vertex: what is multiplied by the colour of the faced surface, and what is added.
    pub fn vertex(&self, vertex: &TwinVertex, roughness: f64) -> [DVec3; 2] {
        let z = vertex.normal.dot(vertex.toward).max(LEAST_VIEW_Z);
        let taps = self.taps(vertex, z, roughness);
        let (share, hidden) = self.seen(vertex, &taps);
        let share = share * f64::from(self.map.scale);
        let energy = taps.iter().map(|tap| tap.weight).sum();
        let bounced = self.bounced(vertex, roughness, energy, hidden);
        if roughness < f64::from(PIXEL_ROUGHNESS) {
            return [share, bounced];
        }
        let mut sums = [DVec3::ZERO; 2];
        let mut weights = [0.0; 2];
        for tap in &taps {
            let light = tap.weight * self.sky(tap.toward, tap.level);
            let term = brdf::grazing(vertex.toward.dot((vertex.toward + tap.toward).normalize()));
            sums[0] += light;
            sums[1] += term * light;
            weights[0] += tap.weight;
            weights[1] += term * tap.weight;
        }
        let whole = taps[TAPS - 1].whole;
        let facing = (1.0 - whole / weights[0].max(1e-6)) * sums[0];
        let grazing = whole * sums[1] / weights[1].max(1e-6);
        [share * facing + (weights[0] - whole) * bounced, share * grazing + whole * bounced]
    }
}
