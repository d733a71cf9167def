//! The cube around a capture point: faces, texels, directions and solid angles are defined only here.
//!
//! Faces are +X -X +Y -Y +Z -Z, numbered 0 to 5. On a face, s runs to the right and t *down*, both in [-1, 1], as in
//! the table "Cube Map Face Selection" of the Vulkan specification, so that texel (x, y) of layer `face` of a cube
//! image lies at `direction(face, texel_st(x, face_px), texel_st(y, face_px))`. Every face is a mirror image of what a
//! camera there would see: seen along `forward`, `right` and `down` are a left-handed frame, and the winding of
//! triangles flips.

use glam::DVec3;

pub const FACE_COUNT: usize = 6;

/// (forward, right, down) of `face`, such that a texel's direction is `normalize(forward + s * right + t * down)`.
///
/// The three are unit axes. Panics when `face` is not below [`FACE_COUNT`].
pub fn face_basis(face: usize) -> (DVec3, DVec3, DVec3) {
    const X: DVec3 = DVec3::X;
    const Y: DVec3 = DVec3::Y;
    const Z: DVec3 = DVec3::Z;
    match face {
        0 => (X, -Z, -Y),
        1 => (-X, Z, -Y),
        2 => (Y, X, Z),
        3 => (-Y, X, -Z),
        4 => (Z, X, -Y),
        5 => (-Z, -X, -Y),
        _ => panic!("a cube has {FACE_COUNT} faces, there is no face {face}"),
    }
}

/// Unit direction of the point (s, t) of `face`; s and t in [-1, 1].
pub fn direction(face: usize, s: f64, t: f64) -> DVec3 {
    let (forward, right, down) = face_basis(face);
    (forward + s * right + t * down).normalize()
}

/// The face that `direction` (any length but 0) meets, and where: (face, s, t) with s and t in [-1, 1].
///
/// On an edge or corner, where faces tie, z wins over y and y over x, as the specification's "largest magnitude"
/// allows.
pub fn face_st(direction: DVec3) -> (usize, f64, f64) {
    let magnitude = direction.abs();
    let axis = if magnitude.z >= magnitude.x && magnitude.z >= magnitude.y {
        2
    } else if magnitude.y >= magnitude.x {
        1
    } else {
        0
    };
    let face = 2 * axis + usize::from(direction[axis] < 0.0);
    let (_, right, down) = face_basis(face);
    (face, direction.dot(right) / magnitude[axis], direction.dot(down) / magnitude[axis])
}

/// s or t of the centre of texel column or row `x` of a face of `face_px` texels a side.
pub fn texel_st(x: usize, face_px: usize) -> f64 {
    (2 * x + 1) as f64 / face_px as f64 - 1.0
}

/// Exact solid angles (steradians) of the texels of one face, row-major; the same for all faces, sum 4 pi / 6.
///
/// The solid angle of the rectangle from the face's centre to (s, t) is atan(s t / sqrt(s^2 + t^2 + 1)); a texel is a
/// signed sum of its four corners.
pub fn solid_angle(face_px: usize) -> Vec<f64> {
    assert!(face_px > 0, "a face needs a texel");
    let corner = |x: usize, y: usize| {
        let s = 2.0 * x as f64 / face_px as f64 - 1.0;
        let t = 2.0 * y as f64 / face_px as f64 - 1.0;
        (s * t).atan2((s * s + t * t + 1.0).sqrt())
    };
    let mut angles = Vec::with_capacity(face_px * face_px);
    for y in 0..face_px {
        for x in 0..face_px {
            angles.push(corner(x + 1, y + 1) - corner(x, y + 1) - corner(x + 1, y) + corner(x, y));
        }
    }
    angles
}
