//! Invalid numbers and meshes; each must be refused with one line.

use super::trials::{GRADIENT, entity, scene};
use crate::asset::Mesh;
use crate::error::{Error, Result};
use glam::Vec3;
use serde::Serialize;

/// The result for an input that must be refused.
#[derive(Clone, Debug, Serialize)]
pub struct Refusal {
    /// Description of the input.
    pub name: String,
    /// The error message.
    pub message: String,
    /// Whether it was refused as bad input (exit code 4) with one line that fits two lines of a terminal.
    pub passed: bool,
}

/// Invalid properties of an entity.
const ENTITIES: &[(&str, &str)] = &[
    ("scale 0", "scale = 0"),
    ("negative scale", "scale = -1"),
    ("scale 10^8", "scale = 1e8"),
    ("infinite scale", "scale = inf"),
    ("a scale an axis", "scale = [1, 2, 1]"),
    ("position not a number", "position = [0, nan, 0]"),
    ("position of 10^8 m", "position = [1e8, 0, 0]"),
    ("rotation about no axis", "rotation = { axis = [0, 0, 0], angle_deg = 10 }"),
    ("quaternion of length 0", "rotation = { quaternion = [0, 0, 0, 0] }"),
    ("negative radiance", "emission = [-1, 0, 0]"),
    ("infinite radiance", "emission = [inf, 0, 0]"),
    ("radiance of 10^16", "emission = [1e16, 0, 0]"),
];

fn refusal(name: &str, outcome: Result<()>) -> Refusal {
    let (message, refused) = match outcome {
        Err(error @ Error::Input(_)) => (error.to_string(), true),
        Err(error) => (error.to_string(), false),
        Ok(()) => ("accepted".into(), false),
    };
    let passed = refused && !message.is_empty() && message.lines().count() == 1 && message.len() <= 240;
    Refusal { name: name.to_owned(), message, passed }
}

fn triangle(corners: [Vec3; 3], indices: [u32; 3]) -> Result<()> {
    Mesh::new("odd", corners.to_vec(), vec![Vec3::Y; 3], None, vec![indices]).map(|_| ())
}

/// Tries all invalid inputs; this needs no device.
pub fn refusals() -> Vec<Refusal> {
    let placed = ENTITIES.iter().map(|(name, with)| (*name, scene(2, GRADIENT, &entity("ball", with)).map(|_| ())));
    let meshes = [
        ("a mesh of points", triangle([Vec3::ZERO; 3], [0, 1, 2])),
        ("a mesh of one needle", triangle([Vec3::ZERO, Vec3::X, 2.0 * Vec3::X], [0, 1, 2])),
        ("a face of one corner", triangle([Vec3::ZERO, Vec3::X, Vec3::Z], [1, 1, 1])),
        ("a corner that is not there", triangle([Vec3::ZERO, Vec3::X, Vec3::Z], [0, 1, 7])),
        ("a vertex that is not a number", triangle([Vec3::NAN, Vec3::X, Vec3::Z], [0, 1, 2])),
        ("a mesh of 10^-12 m", triangle([Vec3::ZERO, 1e-12 * Vec3::X, 1e-12 * Vec3::Z], [0, 1, 2])),
        ("a mesh of 10^30 m", triangle([Vec3::ZERO, 1e30 * Vec3::X, 1e30 * Vec3::Z], [0, 1, 2])),
    ];
    placed.chain(meshes).map(|(name, outcome)| refusal(name, outcome)).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn what_no_picture_can_be_made_of_is_refused_in_one_line() {
        for refusal in super::refusals() {
            assert!(refusal.passed, "{refusal:?}");
        }
    }
}
