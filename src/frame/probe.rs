//! Probes: what stands around a curved glossy surface, in six pictures from its middle.

use crate::asset::mesh::Mesh;
use crate::draw::camera;
use crate::draw::mirror::PROBE_ZOOM;
use crate::lists::sight::SightCamera;
use glam::DVec3;

/// Distance from the middle, in bounding radii, within which nothing is shown.
const NEAREST: f64 = 0.05;
/// Least mean over a surface of its outwardness, the cosine between its normal and the way from the middle times the
/// share of the radius that this way is: 1 of a ball, 0 of a plane, less of a room.
const LEAST_OUTWARD: f64 = 0.15;

/// Six pictures from a place: along x, -x, y and so on.
pub(super) struct Probe {
    pub centre: DVec3,
    pub near_m: f64,
    /// Width and height of each picture in texels.
    pub side: u32,
    pub cameras: [SightCamera; 6],
}

impl Probe {
    /// Of an entity with a bounding ball; each picture has `side` x `side` texels.
    pub fn new(centre: DVec3, radius_m: f64, side: u32) -> Self {
        let near_m = NEAREST * radius_m;
        let camera = |face: usize| SightCamera {
            clip_from_world: camera::cube_face_from_world(centre, near_m, face, PROBE_ZOOM),
            eye: centre,
            near_m: near_m * (1.0 + 2.0 / (PROBE_ZOOM * PROBE_ZOOM)).sqrt(),
            size: [side; 2],
            samples: false,
        };
        Probe { centre, near_m, side, cameras: std::array::from_fn(camera) }
    }
}

/// The middle of a surface that mostly faces away from it, so that it hides little of what it reflects.
pub(super) fn outward_centre(mesh: &Mesh) -> Option<DVec3> {
    let (centre, radius_m) = mesh.bounding_sphere();
    let mut mean = DVec3::ZERO;
    let mut facing = DVec3::ZERO;
    let mut outward = 0.0;
    let mut area_m2 = 0.0;
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| (mesh.positions[v as usize] - centre).as_dvec3());
        let normal_m2 = 0.5 * (b - a).cross(c - a);
        let middle = (a + b + c) / 3.0;
        mean += normal_m2.length() * middle;
        facing += normal_m2;
        outward += normal_m2.dot(middle);
        area_m2 += normal_m2.length();
    }
    mean /= area_m2;
    (outward - facing.dot(mean) > LEAST_OUTWARD * area_m2 * f64::from(radius_m)).then(|| centre.as_dvec3() + mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    /// As `probe_place` in `glsl/mirror.glsl` has it.
    fn place(toward: DVec3) -> (usize, [f64; 2]) {
        let size = toward.abs();
        let axis = if size.x >= size.y.max(size.z) {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let face = 2 * axis + usize::from(toward[axis] < 0.0);
        (face, [1, 2].map(|offset| PROBE_ZOOM * toward[(axis + offset) % 3] / size[axis]))
    }

    #[test]
    fn every_direction_is_in_the_picture_where_the_shader_looks() {
        let centre = DVec3::new(1.0, -2.0, 0.5);
        let probe = Probe::new(centre, 0.5, 64);
        for point in [DVec3::new(3.0, 0.2, 0.1), DVec3::new(1.2, -5.0, 1.0), DVec3::new(0.8, -1.5, -7.0)] {
            let (face, [x, y]) = place(point - centre);
            let clip = probe.cameras[face].clip_from_world * point.extend(1.0);
            assert!(clip.w > 0.0 && clip.z < clip.w, "{point}");
            assert!((clip.x / clip.w - x).abs() < 1e-12 && (clip.y / clip.w - y).abs() < 1e-12, "{point}");
            assert!((probe.near_m * clip.w / clip.z - clip.w).abs() < 1e-12, "depth tells how far it is");
        }
    }

    #[test]
    fn balls_and_rings_face_outwards_and_planes_do_not() {
        for mesh in [generate::sphere(1.0, 3), generate::torus(0.7, 0.25, 24, 12)] {
            assert!(outward_centre(&mesh).unwrap().length() < 1e-3, "{}", mesh.name);
        }
        assert_eq!(outward_centre(&generate::plane(2.0, 4)), None);
    }
}
