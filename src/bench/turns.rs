//! Rotations that a program composes of small steps.

use crate::scene::Placement;
use crate::sh::rotation::Rotation;
use glam::{DQuat, DVec3, Quat, Vec3};
use serde::Serialize;

/// A rotation composed of many small ones in f32, as a program does that turns an object a little every frame.
#[derive(Clone, Debug, Serialize)]
pub struct Turn {
    /// What is done after each step.
    pub name: &'static str,
    /// Steps.
    #[serde(rename = "step_count")]
    pub steps: usize,
    /// Length of the quaternion in the end.
    #[serde(rename = "length_ratio")]
    pub length: f64,
    /// How far the frame's rotation matrix of it is from keeping lengths: largest error of the SH blocks' rows.
    #[serde(rename = "not_orthogonal_relative")]
    pub not_orthogonal: f64,
    /// Angle to the same turn in f64, degrees.
    pub drift_deg: f64,
    /// Whether it is finite and, as the frame normalises what it is given, keeps lengths to f32's rounding.
    pub passed: bool,
}

/// Composes `steps` turns of a hundredth of a degree about a tilted axis.
pub fn turns(steps: usize) -> Vec<Turn> {
    let axis = DVec3::new(0.48, 0.6, 0.64);
    let step = DQuat::from_axis_angle(axis, 0.01_f64.to_radians());
    let turn = |(name, normalise): (&'static str, bool)| {
        let (mut single, narrow) = (Quat::IDENTITY, step.as_quat());
        for _ in 0..steps {
            single = narrow * single;
            if normalise {
                single = single.normalize();
            }
        }
        let exact = DQuat::from_axis_angle(axis, (0.01 * steps as f64).to_radians());
        let given = Placement { position: Vec3::ZERO, rotation: single, scale: 1.0 }.turn();
        let rotation = Rotation::new(4, given);
        let mut worst = 0.0_f64;
        for k in 0..16 {
            let (mut unit, mut turned) = ([0.0; 16], [0.0; 16]);
            unit[k] = 1.0;
            rotation.apply(&unit, &mut turned);
            worst = worst.max((turned.iter().map(|c| c * c).sum::<f64>() - 1.0).abs());
        }
        let drift_deg = given.angle_between(exact).to_degrees();
        let finite = single.is_finite() && drift_deg.is_finite();
        Turn {
            name,
            steps,
            length: single.as_dquat().length(),
            not_orthogonal: worst,
            drift_deg,
            passed: finite && worst < 1e-9,
        }
    };
    [("normalised every frame", true), ("never normalised", false)].map(turn).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_small_turns_keep_lengths() {
        for turn in turns(1_000_000) {
            assert!(turn.passed, "{turn:?}");
        }
    }
}
