//! A camera that turns around a point.

use crate::scene::{Camera, framing};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Largest angle of the eye above or below the target; up to it, +y is up in the picture.
const PITCH_LIMIT_RAD: f64 = 89.0 * PI / 180.0;
/// Factor by which one notch of the wheel divides the distance.
const NOTCH: f64 = 1.15;
/// Distances lie between 1/1000 and 1000 scene radii.
const DISTANCE_RANGE: f64 = 1e3;
/// Targets stay within this many metres of the origin, so that a scene file can hold them and the eye.
const TARGET_LIMIT_M: f64 = 9e6;

/// The eye's position relative to the target. All methods keep it finite for any arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitCamera {
    /// Target point, metres.
    pub target: DVec3,
    /// Angle about +y of the eye from +z, radians, -pi to pi.
    pub yaw_rad: f64,
    /// Angle of the eye above the horizon, radians.
    pub pitch_rad: f64,
    /// Distance from target to eye, metres, above 0.
    pub distance_m: f64,
    /// Vertical field of view in degrees.
    pub fov_deg: f32,
}

impl OrbitCamera {
    pub fn new(camera: &Camera) -> Self {
        let eye = camera.eye.as_dvec3();
        let target = camera.target.as_dvec3();
        let offset = eye - target;
        let distance_m = offset.length();
        let pitch_rad = (offset.y / distance_m).clamp(-1.0, 1.0).asin();
        // If the eye is straight above or below, the picture's up direction gives the yaw.
        let lean = if camera.up() == glam::Vec3::Y { offset } else { -camera.up().as_dvec3() * offset.y.signum() };
        let yaw_rad = lean.x.atan2(lean.z);
        OrbitCamera { target, yaw_rad, pitch_rad, distance_m, fov_deg: camera.fov_deg }
    }

    /// Unit vector from the target to the eye.
    pub fn outward(&self) -> DVec3 {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let (up, out) = self.pitch_rad.sin_cos();
        DVec3::new(sin * out, up, cos * out)
    }

    /// Unit vector to the right in the picture; it is horizontal.
    pub fn right(&self) -> DVec3 {
        let (sin, cos) = self.yaw_rad.sin_cos();
        DVec3::new(cos, 0.0, -sin)
    }

    /// Unit vector up in the picture.
    pub fn up(&self) -> DVec3 {
        self.outward().cross(self.right())
    }

    /// The camera in the form of a scene.
    pub fn camera(&self) -> Camera {
        // Far from the origin, f32 cannot represent an eye nearer to the target.
        let distance_m = self.distance_m.max(1e-5 * self.target.abs().max_element());
        let eye = self.target + distance_m * self.outward();
        Camera { eye: eye.as_vec3(), target: self.target.as_vec3(), fov_deg: self.fov_deg }
    }

    /// Turns by a drag in a picture of that height; a drag across the whole height is half a turn.
    pub fn turn(&mut self, drag_px: [f32; 2], height_px: u32) {
        let [dx, dy] = drag_px.map(|d| f64::from(d) * PI / f64::from(height_px.max(1)));
        if dx.is_finite() && dy.is_finite() {
            self.yaw_rad = (self.yaw_rad - dx + PI).rem_euclid(TAU) - PI;
            self.pitch_rad = (self.pitch_rad + dy).clamp(-PITCH_LIMIT_RAD, PITCH_LIMIT_RAD);
        }
    }

    /// Moves the target so that it stays under the pointer.
    pub fn pan(&mut self, drag_px: [f32; 2], height_px: u32) {
        let height_m = 2.0 * self.distance_m * (f64::from(self.fov_deg).to_radians() / 2.0).tan();
        let [dx, dy] = drag_px.map(|d| f64::from(d) * height_m / f64::from(height_px.max(1)));
        let target = self.target - dx * self.right() + dy * self.up();
        if target.is_finite() {
            self.target = target.clamp(DVec3::splat(-TARGET_LIMIT_M), DVec3::splat(TARGET_LIMIT_M));
        }
    }

    /// Moves nearer by notches of the wheel, in a scene of that radius.
    pub fn zoom(&mut self, notches: f32, scene_radius_m: f64) {
        if notches.is_finite() {
            let notches = f64::from(notches).clamp(-100.0, 100.0);
            self.distance_m = limited(self.distance_m * NOTCH.powf(-notches), scene_radius_m);
        }
    }

    /// Looks at points from the current direction so that they fill the picture, in a scene of that radius. `aspect` is
    /// width / height.
    pub fn frame(&mut self, points: &[DVec3], scene_radius_m: f64, aspect: f64) {
        self.pitch_rad = self.pitch_rad.clamp(-PITCH_LIMIT_RAD, PITCH_LIMIT_RAD);
        if let Some([eye, target]) = framing::fit(points, self.outward(), self.fov_deg, aspect) {
            self.target = target.clamp(DVec3::splat(-TARGET_LIMIT_M), DVec3::splat(TARGET_LIMIT_M));
            self.distance_m = limited(eye.distance(target), scene_radius_m);
        }
    }
}

fn limited(distance_m: f64, scene_radius_m: f64) -> f64 {
    // In a scene file's f32, the eye's offset must not vanish and its position must stay in range.
    let radius_m = if scene_radius_m.is_finite() { scene_radius_m.max(1e-6) } else { 1.0 };
    distance_m.clamp((radius_m / DISTANCE_RANGE).max(1e-5), (radius_m * DISTANCE_RANGE).min(1e6))
}
