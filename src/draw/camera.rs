//! The camera: world to clip space.

use crate::scene::{Camera, Placement};
use glam::dcamera::rh::{proj::vulkan, view};
use glam::{DMat4, DVec3, DVec4};

/// World to Vulkan clip space: y down, reversed depth (1 at the near plane, 0 at infinity). `aspect` is width / height.
///
/// The near plane lies at a thousandth of the distance from eye to target.
pub fn clip_from_world(camera: &Camera, aspect: f64) -> DMat4 {
    let eye = camera.eye.as_dvec3();
    let target = camera.target.as_dvec3();
    let near = near_m(camera);
    let view = view::look_at_mat4(eye, target, camera.up().as_dvec3());
    vulkan::perspective_infinite_reverse(f64::from(camera.fov_deg).to_radians(), aspect, near) * view
}

/// Unit direction from the eye through a place in a picture of that size, in pixels from the top left.
pub fn through_pixels(camera: &Camera, size: [f64; 2]) -> impl Fn([f64; 2]) -> DVec3 + use<> {
    let eye = camera.eye.as_dvec3();
    let to_world = clip_from_world(camera, size[0] / size[1]).inverse();
    move |at| {
        let across = |axis: usize| 2.0 * at[axis] / size[axis] - 1.0;
        // Depth 1 is the near plane; any point in front of the eye gives the direction.
        let near = to_world * DVec4::new(across(0), across(1), 1.0, 1.0);
        (near.truncate() / near.w - eye).normalize()
    }
}

/// World to clip space of a face of a cube around a place, reversed depth. Faces come along x, -x, y and so on; columns
/// of each lie along the next axis of the world, and rows along the one after. `zoom` is half the width of a face over the
/// tangent of the angle that it shows to each side.
pub fn cube_face_from_world(centre: DVec3, near_m: f64, face: usize, zoom: f64) -> DMat4 {
    let axis = |offset: usize| DVec3::AXES[(face / 2 + offset) % 3];
    let forward = if face.is_multiple_of(2) { axis(0) } else { -axis(0) };
    let row = |of: DVec3| of.extend(-of.dot(centre));
    DMat4::from_cols(row(zoom * axis(1)), row(zoom * axis(2)), DVec4::W * near_m, row(forward)).transpose()
}

/// Distance of the near plane in metres.
pub fn near_m(camera: &Camera) -> f64 {
    1e-3 * camera.eye.as_dvec3().distance(camera.target.as_dvec3())
}

/// Distance from the eye to a corner of the near plane's part in the picture, metres.
pub fn near_corner_m(camera: &Camera, aspect: f64) -> f64 {
    let high = camera.half_height();
    near_m(camera) * (1.0 + high * high * (1.0 + aspect * aspect)).sqrt()
}

/// From a mesh's frame, metres from the centre of its bounding sphere, to the world; `centre_m` is that centre in the
/// file's.
pub fn world_from_centred(placement: &Placement, centre_m: DVec3) -> DMat4 {
    let scale = DVec3::splat(f64::from(placement.scale));
    DMat4::from_scale_rotation_translation(scale, placement.turn(), placement.point(centre_m))
}
