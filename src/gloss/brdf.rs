//! The metallic-roughness model of glTF 2.0 (specification, appendix B) in a frame whose z axis is the normal.

use crate::scene::Gloss;
use glam::DVec3;
use std::f64::consts::PI;

/// Least width of the microfacets' slopes: a mirror would reflect in no direction that can be integrated.
pub const LEAST_ALPHA: f64 = 0.002;

/// The width of the slopes of microfacets.
pub fn alpha(roughness: f64) -> f64 {
    (roughness * roughness).max(LEAST_ALPHA)
}

/// The microfacets' normals: GGX (Walter et al., *Microfacet Models for Refraction*, EGSR 2007, equation 33).
pub fn distribution(alpha: f64, half_z: f64) -> f64 {
    let below = half_z * half_z * (alpha * alpha - 1.0) + 1.0;
    alpha * alpha / (PI * below * below)
}

/// Masking and shadowing over 4 (n.v) (n.l): Smith's, correlated by height (Heitz, *Understanding the Masking-Shadowing
/// Function*, JCGT 2014, equation 99).
pub fn visibility(alpha: f64, view_z: f64, light_z: f64) -> f64 {
    let part = |a: f64, b: f64| a * (b * b * (1.0 - alpha * alpha) + alpha * alpha).sqrt();
    0.5 / (part(light_z, view_z) + part(view_z, light_z)).max(1e-30)
}

/// Schlick's (1 - v.h)^5.
pub fn grazing(view_half: f64) -> f64 {
    (1.0 - view_half).clamp(0.0, 1.0).powi(5)
}

/// The microfacet reflection of a unit Fresnel factor, times the cosine of the light, and Schlick's term of the pair.
/// Zero below the horizon.
pub fn lobe(alpha: f64, view: DVec3, light: DVec3) -> [f64; 2] {
    let half = (view + light).normalize_or_zero();
    if light.z <= 0.0 || view.z <= 0.0 || half.z <= 0.0 {
        return [0.0; 2];
    }
    let value = distribution(alpha, half.z) * visibility(alpha, view.z, light.z) * light.z;
    [value, grazing(view.dot(half))]
}

/// Reflectance of a surface that is faced: that of a dielectric, or of a metal with this colour, or between.
pub fn facing(gloss: &Gloss, base: DVec3) -> DVec3 {
    DVec3::splat(f64::from(gloss.f0)).lerp(base, f64::from(gloss.metallic))
}

/// The share of the base colour that reflects diffusely.
pub fn diffuse_share(gloss: &Gloss, view_half: f64) -> f64 {
    let f0 = f64::from(gloss.f0);
    (1.0 - f64::from(gloss.metallic)) * (1.0 - f0) * (1.0 - grazing(view_half))
}

/// Where the light comes from whose reflection about a microfacet leaves towards `view`. The microfacet's slope has a
/// share of `u` of all slopes below it and the azimuth `turn`, radians.
pub fn reflected(alpha: f64, view: DVec3, u: f64, turn: f64) -> DVec3 {
    let tangent = alpha * (u / (1.0 - u)).sqrt();
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let (sin, cos) = turn.sin_cos();
    let half = DVec3::new(tangent * cosine * cos, tangent * cosine * sin, cosine);
    2.0 * view.dot(half) * half - view
}

/// [`lobe`] over the density by which [`reflected`] samples: its value is the visibility's share.
pub fn sampled_lobe(alpha: f64, view: DVec3, light: DVec3) -> [f64; 2] {
    let half = (view + light).normalize_or_zero();
    let view_half = view.dot(half);
    if light.z <= 0.0 || view.z <= 0.0 || half.z <= 0.0 || view_half <= 0.0 {
        return [0.0; 2];
    }
    let value = visibility(alpha, view.z, light.z) * light.z * 4.0 * view_half / half.z;
    [value, grazing(view_half)]
}
