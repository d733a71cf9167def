//! How a scene's lights are computed: by spherical harmonics, or as sharp lights whose shadows have edges.

use super::{Entity, Scene};
use crate::asset::Mesh;
use crate::field::sub_light::LampFace;
use crate::layout::LightKind;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Which lights are sharp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Lights {
    /// Spherical harmonics for all lights but spots; shadows have no edges.
    Sh,
    /// Every entity that glows is a sharp light, as every sun is; the sky stays in spherical harmonics.
    #[default]
    Sharp,
}

/// The cone of a spot about its entity's own +y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Within this angle to the axis it shines in full, degrees, 0 to `outer_deg`.
    #[serde(default)]
    pub inner_deg: f32,
    /// Beyond this angle it is dark, degrees, up to 90.
    pub outer_deg: f32,
}

/// Reads a spot and checks its angles.
pub(super) fn checked<'de, D: serde::Deserializer<'de>>(source: D) -> Result<Option<Spot>, D::Error> {
    let spot = Spot::deserialize(source)?;
    let Spot { inner_deg: inner, outer_deg: outer } = spot;
    if !(outer > 0.0 && outer <= 90.0 && (0.0..=outer).contains(&inner)) {
        let what = format!("the angles {inner} and {outer} of a spot are not 0 <= inner <= outer <= 90");
        return Err(serde::de::Error::custom(what));
    }
    Ok(Some(spot))
}

impl Spot {
    /// Factor and summand that turn the cosine to the axis into the square root of the share that shines: the falloff
    /// of KHR_lights_punctual.
    pub fn ramp(&self) -> [f64; 2] {
        let [inner, outer] = [self.inner_deg, self.outer_deg].map(|deg| f64::from(deg).to_radians().cos());
        let factor = 1.0 / (inner - outer).max(1e-3);
        [factor, -outer * factor]
    }

    /// Share of its light that shines at a point, for a light turned by `rotation` whose centre is at `to_light` from
    /// there.
    pub fn share(&self, rotation: DQuat, to_light: DVec3) -> f64 {
        let [factor, summand] = self.ramp();
        let cosine = -(rotation * DVec3::Y).dot(to_light.normalize_or(DVec3::Y));
        (cosine * factor + summand).clamp(0.0, 1.0).powi(2)
    }
}

/// How one light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightMethod {
    /// By its field of spherical harmonics.
    Harmonics,
    /// As a sharp light that is a ball; its mesh covers this share of its bounding sphere's disc, on average over all
    /// directions.
    Ball(f64),
    /// As a sharp light of the mesh's own outline.
    Outline,
    /// As a sharp light that is flat, or a tube.
    LampFace(LampFace),
}

impl LightMethod {
    /// How the light of an entity is computed; of no meaning for one that does not emit.
    pub fn of(scene: &Scene, entity: usize, lights: Lights) -> Self {
        let Entity { mesh, spot, .. } = scene.entities[entity];
        let mesh = &scene.meshes[mesh];
        match mesh.panel() {
            // Four bands would blur the rim of a spot's cone.
            _ if lights == Lights::Sh && spot.is_none() => LightMethod::Harmonics,
            Some(panel) => LightMethod::LampFace(panel),
            None => mesh.ball_share().map_or(LightMethod::Outline, LightMethod::Ball),
        }
    }

    /// Whether the parts of a sharp light of that mesh have colours of their own ([`crate::field::lamp_colors`]): those of
    /// an outline have them to make up for what they miss of it.
    pub fn has_colors(self, mesh: &Mesh) -> bool {
        self == LightMethod::Outline || (matches!(self, LightMethod::Ball(_)) && mesh.colors.is_some())
    }

    /// Whether its shadows have edges.
    pub fn is_sharp(self) -> bool {
        self != LightMethod::Harmonics
    }

    /// Its shape, as shaders know it.
    pub fn kind(self) -> LightKind {
        match self {
            LightMethod::Harmonics => LightKind::None,
            LightMethod::Ball(_) => LightKind::Ball,
            LightMethod::Outline => LightKind::Outline,
            LightMethod::LampFace(LampFace::Disc(_)) => LightKind::Disc,
            LightMethod::LampFace(LampFace::Rectangle(_)) => LightKind::Rectangle,
            LightMethod::LampFace(LampFace::Sheet(_)) => LightKind::Sheet,
            LightMethod::LampFace(LampFace::Tube { axis, .. }) => {
                [LightKind::TubeX, LightKind::TubeY, LightKind::TubeZ][axis]
            }
        }
    }

    /// The word for users.
    pub fn name(self) -> &'static str {
        match self {
            LightMethod::Harmonics => "spherical harmonics",
            LightMethod::Ball(_) => "sharp, a ball",
            LightMethod::Outline => "sharp, the mesh's outline",
            LightMethod::LampFace(LampFace::Disc(_)) => "sharp, a disc",
            LightMethod::LampFace(LampFace::Rectangle(_)) => "sharp, a rectangle",
            LightMethod::LampFace(LampFace::Sheet(_)) => "sharp, a rectangle that shines from both sides",
            LightMethod::LampFace(LampFace::Tube { .. }) => "sharp, a tube",
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
