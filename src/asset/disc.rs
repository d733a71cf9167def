//! Distant discs of light: suns.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// The sun's angular diameter seen from the earth, degrees.
pub const SUN_DEG: f32 = 0.53;
/// Angular diameters that a disc may have, degrees.
pub(super) const ANGLES_DEG: RangeInclusive<f32> = 0.01..=90.0;

/// A distant disc of one radiance, as data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Direction towards its middle, of any length but 0.
    pub toward: Vec3,
    /// Angular diameter, 0.01 to 90 degrees.
    #[serde(default = "sun_deg")]
    pub angle_deg: f32,
    /// Linear RGB radiance, W m^-2 sr^-1. A white surface that faces a disc of diameter `a` shines with radiance *
    /// sin^2(a / 2).
    pub radiance: Vec3,
}

fn sun_deg() -> f32 {
    SUN_DEG
}

impl Sun {
    pub fn disc(&self) -> Disc {
        Disc {
            name: "sun",
            toward: self.toward.as_dvec3().normalize(),
            half_angle_rad: f64::from(self.angle_deg).to_radians() / 2.0,
            radiance: self.radiance.as_dvec3(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    pub name: &'static str,
    /// Direction towards its middle, unit.
    pub toward: DVec3,
    /// Half its angular diameter, radians.
    pub half_angle_rad: f64,
    /// Linear RGB radiance, W m^-2 sr^-1.
    pub radiance: DVec3,
}

impl Disc {
    /// Solid angle in steradians of a disc of half the diameter `half_angle_rad`.
    pub fn solid_angle(half_angle_rad: f64) -> f64 {
        // 1 - cos a = 2 sin^2(a / 2) keeps its digits for small discs.
        2.0 * TAU * (half_angle_rad / 2.0).sin().powi(2)
    }
}
