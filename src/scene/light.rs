//! How a scene's lights are computed: by spherical harmonics, or as sharp lights whose shadows have edges.

use super::Scene;
use crate::field::sub_light::LampFace;
use serde::{Deserialize, Serialize};

/// Which lights are sharp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Lights {
    /// Spherical harmonics for all lights; shadows have no edges.
    Sh,
    /// Every entity that glows in one colour, or on one flat side, is a sharp light, as every sun is; all other light
    /// stays in spherical harmonics.
    #[default]
    Sharp,
}

/// How one light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightMethod {
    /// By its field of spherical harmonics.
    Harmonics,
    /// As a sharp light that is a ball; its mesh covers this share of its bounding sphere's disc, on average over all directions.
    Ball(f64),
    /// As a sharp light of the mesh's own outline.
    Outline,
    /// As a sharp light that shines from one flat side.
    LampFace(LampFace),
}

impl LightMethod {
    /// How the light of an entity is computed; of no meaning for one that does not emit.
    pub fn of(scene: &Scene, entity: usize, lights: Lights) -> Self {
        let mesh = &scene.meshes[scene.entities[entity].mesh];
        match mesh.panel() {
            _ if lights == Lights::Sh => LightMethod::Harmonics,
            Some(panel) => LightMethod::LampFace(panel),
            None if mesh.colors.is_some() => LightMethod::Harmonics,
            None => mesh.ball_share().map_or(LightMethod::Outline, LightMethod::Ball),
        }
    }

    /// Whether its shadows have edges.
    pub fn is_sharp(self) -> bool {
        self != LightMethod::Harmonics
    }

    /// What people read.
    pub fn name(self) -> &'static str {
        match self {
            LightMethod::Harmonics => "spherical harmonics",
            LightMethod::Ball(_) => "sharp, a ball",
            LightMethod::Outline => "sharp, the mesh's outline",
            LightMethod::LampFace(LampFace::Disc(_)) => "sharp, a disc",
            LightMethod::LampFace(LampFace::Rectangle(_)) => "sharp, a rectangle",
        }
    }
}

/// Every light of a scene by its name, and how it is computed: entities that emit, and then the distant light.
pub fn listed(scene: &Scene, lights: Lights) -> Vec<(&str, LightMethod)> {
    let local =
        emitters(scene).map(|entity| (scene.entities[entity].name.as_str(), LightMethod::of(scene, entity, lights)));
    let distant = (!scene.environment.is_none()).then_some(("sky", LightMethod::Harmonics));
    local.chain(distant).collect()
}

/// Whether any light of a scene is sharp.
pub fn has_sharp(scene: &Scene, lights: Lights) -> bool {
    emitters(scene).any(|entity| LightMethod::of(scene, entity, lights).is_sharp())
}

/// Whether any light of a scene, local or distant, goes through spherical harmonics.
pub fn has_harmonics(scene: &Scene, lights: Lights) -> bool {
    !scene.environment.is_none() || emitters(scene).any(|entity| !LightMethod::of(scene, entity, lights).is_sharp())
}

fn emitters(scene: &Scene) -> impl Iterator<Item = usize> + '_ {
    (0..scene.entities.len()).filter(|&entity| scene.entities[entity].emits)
}
