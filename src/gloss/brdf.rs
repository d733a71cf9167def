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

#[cfg(test)]
mod tests {
    use super::*;

    /// Light and eye may change places: what is reflected, over the cosine of the light, stays the same.
    #[test]
    fn lobes_are_reciprocal() {
        let at = |z: f64, turn: f64| {
            let across = (1.0 - z * z).sqrt();
            DVec3::new(across * turn.cos(), across * turn.sin(), z)
        };
        for roughness in [0.0, 0.1, 0.5, 1.0] {
            for (view, light) in
                [(at(0.9, 0.3), at(0.4, 2.0)), (at(0.05, 0.0), at(0.7, 3.0)), (at(0.5, 1.0), at(0.5, 4.1))]
            {
                let [there, term] = lobe(alpha(roughness), view, light);
                let [back, other] = lobe(alpha(roughness), light, view);
                assert!((there / light.z - back / view.z).abs() <= 1e-12 * there.max(1e-300) / light.z, "{roughness}");
                assert!((term - other).abs() < 1e-12);
            }
        }
        assert_eq!(lobe(0.5, at(0.5, 0.0), DVec3::new(0.6, 0.0, -0.8)), [0.0; 2], "below the horizon");
    }

    /// At grazing angles everything reflects all light, and faced a dielectric its own share.
    #[test]
    fn fresnel_goes_from_facing_to_all() {
        let gloss = Gloss { roughness: 0.5, metallic: 0.0, f0: 0.04 };
        let base = DVec3::new(0.9, 0.5, 0.0);
        assert!((facing(&gloss, base) - DVec3::splat(0.04)).length() < 1e-7);
        let metal = Gloss { metallic: 1.0, ..gloss };
        assert!((facing(&metal, base) - base).length() < 1e-7);
        assert_eq!((grazing(0.0), grazing(1.0)), (1.0, 0.0));
        assert!((diffuse_share(&gloss, 1.0) - 0.96).abs() < 1e-7);
        assert_eq!((diffuse_share(&gloss, 0.0), diffuse_share(&metal, 1.0)), (0.0, 0.0));
    }
}
