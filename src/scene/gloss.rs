//! How a surface reflects besides diffusely: the metallic-roughness model of glTF 2.0.

use super::values;
use glam::Vec3;
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
    #[serde(default, deserialize_with = "values::share", skip_serializing_if = "crate::field::is_default")]
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

/// Pictures of a surface besides its albedo, by the texture coordinates of its mesh. Each is the name of a texture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Maps {
    /// Green is a factor on the roughness, blue on the metallic share, as in glTF.
    pub gloss: Option<String>,
    /// The normal in tangent space, as in glTF: red along u, green against v, blue away from the surface.
    pub normal: Option<String>,
    /// Factor on the slope of those normals; 1 unless it is given.
    #[serde(deserialize_with = "values::slope")]
    pub normal_scale: Option<f32>,
    /// A factor on the emission that is seen. What the surface shines on others goes by its mesh's colours.
    pub glow: Option<String>,
}

impl Maps {
    /// The names.
    pub(crate) fn names(&self) -> impl Iterator<Item = &String> {
        self.gloss.iter().chain(&self.normal).chain(&self.glow)
    }
}

/// [`Maps`] by the numbers of textures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MapIndices {
    /// Roughness and metal.
    pub gloss: Option<usize>,
    /// Normals.
    pub normal: Option<usize>,
    /// Factor on their slope; 0 without normals.
    pub normal_scale: f32,
    /// The emission that is seen.
    pub glow: Option<usize>,
    /// What its texels are multiplied by: 1 over their mean on the mesh, which the emission stands for; 1 where the mesh
    /// has colours of its own.
    pub glow_scale: Vec3,
}

impl MapIndices {
    /// Whether there are any.
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}
