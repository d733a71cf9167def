//! How a surface reflects besides diffusely: the metallic-roughness model of glTF 2.0.

use super::values;
use serde::{Deserialize, Serialize};

/// Reflectance of a dielectric that is faced, for an index of refraction of 1.5.
pub const USUAL_F0: f32 = 0.04;

/// The metallic-roughness model of glTF 2.0 (specification, appendix B): a diffuse part and the reflection of
/// microfacets. The albedo is its base colour. A surface without it is diffuse alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gloss {
    /// Roughness, 0 (a mirror) to 1; its square is the width alpha of the microfacets' slopes.
    #[serde(deserialize_with = "values::share")]
    pub roughness: f32,
    /// 1 of a metal, whose reflection has the albedo's colour; 0, which is the default, of what is none.
    #[serde(default, deserialize_with = "values::share", skip_serializing_if = "crate::field::is_zero")]
    pub metallic: f32,
    /// Share of light that a surface which is no metal reflects when faced, 0 to 1. The default is 0.04.
    #[serde(default = "usual_f0", deserialize_with = "values::share", skip_serializing_if = "is_usual_f0")]
    pub f0: f32,
}

fn usual_f0() -> f32 {
    USUAL_F0
}

fn is_usual_f0(f0: &f32) -> bool {
    *f0 == USUAL_F0
}
