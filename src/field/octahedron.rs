//! The octahedral map: all directions on a square.

use glam::{DVec2, DVec3};

/// The direction of a place of the octahedral map (Engelhardt and Dachsbacher, *Octahedron Environment Maps*, VMV
/// 2008): the upper half within the inner diamond. Places up to half a map beyond its edge are the map's
/// continuation.
pub fn direction(place: DVec2) -> DVec3 {
    let mut at = 2.0 * place - DVec2::ONE;
    for axis in 0..2 {
        if at[axis].abs() > 1.0 {
            at[axis] = 2.0 * at[axis].signum() - at[axis];
            at[1 - axis] = -at[1 - axis];
        }
    }
    let y = 1.0 - at.x.abs() - at.y.abs();
    let fold = |a: f64, b: f64| if y < 0.0 { (1.0 - b.abs()) * 1.0_f64.copysign(a) } else { a };
    DVec3::new(fold(at.x, at.y), y, fold(at.y, at.x)).normalize()
}

/// The place of a direction.
pub fn place(direction: DVec3) -> DVec2 {
    let at = direction / direction.abs().element_sum();
    let fold = |a: f64, b: f64| if at.y < 0.0 { (1.0 - b.abs()) * 1.0_f64.copysign(a) } else { a };
    DVec2::new(fold(at.x, at.z), fold(at.z, at.x)) * 0.5 + DVec2::splat(0.5)
}
