//! The housing of a spot: a plate with a round hole before the lamp, and five whole plates behind and beside it.
//!
//! A ball of radius r that stands h behind a hole of radius R is seen whole within the angle whose tangent is (R - r) / h, and not at
//! all beyond that of (R + r) / h. So r and the light's inner and outer angle give h and R. Every plate lies on one side of the
//! lamp, so the order of centres by which occluders precede a light is the true one.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DQuat, DVec3, Vec3};

use crate::asset::Mesh;
use crate::error::Result;
use crate::scene::data::EntityData;
use crate::scene::motion::RotationData;

/// Name of the whole plates' mesh, 1 m wide.
pub const PLATE: &str = "lamp plate";
/// Half the width of the plate with the hole, in distances between lamp and hole: from the lamp it covers all but what is 68 degrees
/// and more off the axis, which the plates beside it cover.
const REACH: f64 = 2.5;
/// The whole plates overlap the edges of the others by this factor.
const OVERLAP: f64 = 1.3;
/// Widest spot, degrees off its axis: beyond it the hole would be larger than the housing.
pub const WIDEST_DEG: f64 = 80.0;
/// Least difference of the two angles' tangents, as a share of the outer one: softer than any sharper edge.
const SOFTNESS: f64 = 0.1;
/// Corners of the hole.
const CORNERS: u32 = 48;

/// Proportions of a housing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Housing {
    /// Distance from the lamp's centre to the hole, in radii of the lamp.
    pub distance: f64,
    /// Radius of the hole, in radii of the lamp.
    pub hole: f64,
    /// Half the width of the housing, in radii of the lamp.
    pub half_width: f64,
}

impl Housing {
    /// The housing for a light that is full within `inner` radians of its axis and dark beyond `outer`.
    pub fn new(inner: f64, outer: f64) -> Self {
        let outer = outer.clamp(0.01, WIDEST_DEG.to_radians()).tan();
        let inner = inner.clamp(0.0, FRAC_PI_2).tan().min(outer * (1.0 - SOFTNESS));
        let distance = 2.0 / (outer - inner);
        let hole = distance * (outer + inner) / 2.0;
        Housing { distance, hole, half_width: (1.5 * hole).max(REACH * distance).max(2.0) }
    }

    /// The plate with the hole, whose radius is 1 m: in the plane z = 0, a square of the housing's width.
    ///
    /// # Errors
    /// As [`Mesh::new`].
    pub fn front(&self, name: &str) -> Result<Mesh> {
        let half_width = self.half_width / self.hole;
        let ring = |i: u32| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
            let rim = DVec3::new(cos, sin, 0.0);
            // Corners of the square are among the directions, since 8 divides their number.
            [rim, rim * half_width / cos.abs().max(sin.abs())].map(|p| p.as_vec3())
        };
        let positions = (0..CORNERS).flat_map(ring).collect();
        let piece = |i: u32| {
            let next = (i + 1) % CORNERS;
            [[2 * i, 2 * i + 1, 2 * next + 1], [2 * i, 2 * next + 1, 2 * next]]
        };
        let triangles: Vec<[u32; 3]> = (0..CORNERS).flat_map(piece).collect();
        Mesh::new(name, positions, vec![Vec3::Z; 2 * CORNERS as usize], None, triangles)
    }

    /// Entities around a lamp, a ball of radius 1 m times its scale that looks along its own -z. `front` is the name of the mesh of
    /// [`Housing::front`].
    pub fn entities(&self, lamp: &EntityData, front: &str) -> Vec<EntityData> {
        let (turn, centre, radius) = (lamp.rotation.unit(), lamp.position.as_dvec3(), f64::from(lamp.scale));
        let [distance, hole, half_width] = [self.distance, self.hole, self.half_width].map(|share| share * radius);
        let plate = |mesh: &str, offset: DVec3, own: DQuat, scale: f64| EntityData {
            name: lamp.name.as_ref().map(|name| format!("{name} housing")),
            position: (centre + turn * offset).as_vec3(),
            rotation: RotationData::Quaternion((turn * own).as_quat().to_array()),
            scale: scale as f32,
            albedo: Vec3::splat(0.2),
            occludes: Some(true),
            receives: Some(false),
            motion: lamp.motion.clone(),
            ..EntityData::of_mesh(mesh)
        };
        // Whole plates lie in the plane y = 0 of their own and are 1 m wide.
        let (beside, wide) = (half_width.max(distance), 2.0 * OVERLAP * half_width.max(distance));
        let (flat, upright, across) =
            (DQuat::IDENTITY, DQuat::from_rotation_x(FRAC_PI_2), DQuat::from_rotation_z(FRAC_PI_2));
        vec![
            plate(front, DVec3::NEG_Z * distance, DQuat::IDENTITY, hole),
            plate(PLATE, DVec3::Z * distance, upright, wide),
            plate(PLATE, DVec3::X * beside, across, wide),
            plate(PLATE, DVec3::NEG_X * beside, across, wide),
            plate(PLATE, DVec3::Y * beside, flat, wide),
            plate(PLATE, DVec3::NEG_Y * beside, flat, wide),
        ]
    }
}
