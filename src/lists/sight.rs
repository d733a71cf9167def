//! Which runs of a mesh's triangles the camera may see. What it cannot see is not drawn, and reflects nothing to it.
//!
//! The test is conservative: it never calls a run unseen that a pixel shows. A run lies outside the picture where the
//! sphere or the box around it lies outside by at least a pixel. Its triangles are backs where the cone of their
//! normals says so for every point of that sphere, with a margin of `BACK_RAD`. Backs count as unseen only where the
//! draw culls them, which it does for solid meshes ([`Mesh::is_solid`]) with the eye outside, because at an outline the
//! rasteriser decides whether a pixel shows a front or a back.

use crate::asset::grid::Grid;
use crate::asset::mesh::Mesh;
use crate::lists::scene_bounds::ClusterBounds;
use glam::{DMat4, DVec3, DVec4, Vec3};
use rayon::prelude::*;

/// Angle beyond edge-on from which triangles count as backs: vertices that a rasteriser moves to its grid of 1/256
/// pixel turn over no triangle of a third of a pixel or more that is tilted so far.
const BACK_RAD: f64 = 0.02;
/// Width in pixels of the margin around the picture that counts as seen.
const RIM_PX: f64 = 1.0;
/// Largest relative error of lengths by rounding, of the matrix and in the vertex shader, times 8 as a margin.
const ROUNDING: f32 = 4e-6;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleRun {
    /// Centre of a sphere around their corners, metres from that of the mesh's bounding sphere.
    centre: Vec3,
    radius_m: f32,
    /// Half the edges of a box around them with that centre, metres.
    half_m: Vec3,
    /// Axis of a cone around their normals.
    axis: Vec3,
    /// Cosine and sine of its half-angle plus [`BACK_RAD`]. Where the cosine is not positive, the triangles are never
    /// all backs.
    spread: [f32; 2],
    /// Whether they stand at the rim of a grid, whose light pixels beyond the rim show.
    rim: bool,
}

impl TriangleRun {
    /// For each run of `count` vertices of a mesh, in a given order, the triangles that use one of them: these show its
    /// light.
    pub fn around(mesh: &Mesh, order: &[u32], count: usize) -> Vec<TriangleRun> {
        let runs = order.len().div_ceil(count);
        let mut run_of = vec![0_u32; order.len()];
        for (place, &v) in order.iter().enumerate() {
            run_of[v as usize] = (place / count) as u32;
        }
        let mut members = vec![Vec::new(); runs];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| run_of[v as usize] as usize);
            members[a].push(*triangle);
            if b != a {
                members[b].push(*triangle);
            }
            if c != a && c != b {
                members[c].push(*triangle);
            }
        }
        let mut faces: Vec<TriangleRun> = members.par_iter().map(|triangles| Self::of(mesh, triangles)).collect();
        for v in Grid::find(mesh).iter().flat_map(Grid::rim) {
            faces[run_of[v as usize] as usize].rim = true;
        }
        faces
    }

    pub fn of(mesh: &Mesh, triangles: &[[u32; 3]]) -> TriangleRun {
        let (middle, _) = mesh.bounding_sphere();
        let at = |v: u32| mesh.positions[v as usize] - middle;
        let corners: Vec<Vec3> = triangles.iter().flatten().map(|&v| at(v)).collect();
        // A triangle without area covers no pixel.
        let normal = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| at(v).as_dvec3());
            (b - a).cross(c - a).try_normalize().map(|n| n.as_vec3())
        };
        let normals: Vec<Vec3> = triangles.iter().filter_map(normal).collect();
        let bounds = ClusterBounds::new(&corners, &normals);
        let centre = bounds.centre;
        let half = corners.iter().fold(Vec3::ZERO, |half, corner| half.max((*corner - centre).abs()));
        let spread = f64::from(bounds.cosine).acos() + BACK_RAD;
        let known = bounds.axis != Vec3::ZERO;
        TriangleRun {
            centre,
            radius_m: bounds.radius_m,
            half_m: half + Vec3::splat(1e-6 * (centre.length() + bounds.radius_m)),
            axis: bounds.axis,
            spread: if known { [spread.cos() as f32, spread.sin() as f32] } else { [-1.0, 0.0] },
            rim: false,
        }
    }

    /// Whether a place sees only the backs of these triangles.
    ///
    /// The direction to any point of the sphere is within asin(radius / distance) of that to the centre, a normal
    /// within the cone of the axis: all are backs where these two, [`BACK_RAD`] and the angle between axis and
    /// direction stay below a right angle together.
    fn are_backs(&self, eye: Vec3) -> bool {
        let way = self.centre - eye;
        let distance = way.length();
        let [cosine, sine] = self.spread;
        if cosine <= 0.0 || self.radius_m >= distance {
            return false;
        }
        let turn_sine = self.radius_m / distance;
        let turn_cosine = (1.0 - turn_sine * turn_sine).sqrt();
        let all = [cosine * turn_cosine - sine * turn_sine, sine * turn_cosine + cosine * turn_sine];
        all[0] > 0.0 && self.axis.dot(way) > distance * all[1]
    }
}

/// How one entity is seen. Places are metres from the centre of its mesh's bounding sphere, in the mesh's frame.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Planes of the picture's four sides and one through the eye. Points on the positive side are seen.
    planes: [Plane; 5],
    /// The eye, where backs are culled.
    eye: Option<Vec3>,
    samples: bool,
}

#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: Vec3,
    offset: f32,
    /// Distance beyond a plane up to which points may be seen.
    slack: f32,
}

#[derive(Clone, Copy, Debug)]
pub struct SightCamera {
    pub clip_from_world: DMat4,
    /// Where it stands, metres.
    pub eye: DVec3,
    /// Distance from there to the farthest corner of the near plane, metres.
    pub near_m: f64,
    /// Width and height of its part in pixels.
    pub size: [u32; 2],
    pub samples: bool,
}

impl Sight {
    /// The view of an entity with a bounding radius in its own frame; `solid` says whether its mesh is solid.
    pub fn new(camera: &SightCamera, world_from_object: DMat4, radius_m: f64, solid: bool) -> Self {
        // The vertex shader computes the same.
        let clip = (camera.clip_from_world * world_from_object).as_mat4();
        let [x, y, w] = [clip.row(0), clip.row(1), clip.row(3)].map(|row| row.as_dvec4());
        let [wide, high] = camera.size.map(|pixels| 1.0 + 2.0 * RIM_PX / f64::from(pixels.max(1)));
        let plane = |p: DVec4, terms: [DVec4; 2]| {
            let length = p.truncate().length().max(f64::MIN_POSITIVE);
            let size = |row: DVec4| row.truncate().length() * radius_m + row.w.abs();
            Plane {
                normal: (p.truncate() / length).as_vec3(),
                offset: (p.w / length) as f32,
                slack: (terms.into_iter().map(size).sum::<f64>() / length) as f32 * ROUNDING,
            }
        };
        let none = DVec4::ZERO;
        let planes = [
            plane(w * wide - x, [w, x]),
            plane(w * wide + x, [w, x]),
            plane(w * high - y, [w, y]),
            plane(w * high + y, [w, y]),
            plane(w, [w, none]),
        ];
        let eye = world_from_object.inverse().transform_point3(camera.eye);
        let scale = world_from_object.x_axis.truncate().length();
        // Where the near plane cuts the mesh, the camera sees its inside.
        let outside = eye.length() > (radius_m + camera.near_m / scale) * 1.001;
        Sight { planes, eye: (solid && outside).then(|| eye.as_vec3()), samples: camera.samples }
    }

    pub fn culls(&self) -> bool {
        self.eye.is_some()
    }

    /// Whether any of some triangles may be seen.
    pub fn may_see(&self, faces: &TriangleRun) -> bool {
        // A pixel whose centre lies beyond the rim of a grid shows the light of the nearest cell, which may be any cell
        // of the rim.
        if self.samples && faces.rim {
            return true;
        }
        let reach_m = |p: &Plane| p.normal.abs().dot(faces.half_m).min(faces.radius_m) + p.slack;
        let outside = |p: &Plane| p.normal.dot(faces.centre) + p.offset < -reach_m(p);
        !self.planes.iter().any(outside) && !self.eye.is_some_and(|eye| faces.are_backs(eye))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::{cuboid, plane, sphere, torus};
    use crate::bake::chunk::morton;
    use glam::dcamera::rh::{proj::vulkan, view};

    /// Every triangle of an unseen run is outside the picture or turned away, and most runs of which that is true are
    /// found.
    #[test]
    fn nothing_that_is_seen_is_called_unseen() {
        let meshes = [sphere(1.0, 4), torus(1.0, 0.3, 96, 48), cuboid(Vec3::new(1.0, 2.0, 0.5), 24), plane(3.0, 60)];
        let mut rng = fastrand::Rng::with_seed(9);
        for mesh in &meshes {
            let (centre, radius_m) = mesh.bounding_sphere();
            let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
            order.sort_by_cached_key(|&v| morton((mesh.positions[v as usize] - centre) / radius_m));
            let mut run_of = vec![0; order.len()];
            order.iter().enumerate().for_each(|(place, &v)| run_of[v as usize] = place / 64);
            let faces = TriangleRun::around(mesh, &order, 64);
            let mut unseen = 0;
            let mut all = 0;
            let mut backs = 0;
            for _ in 0..60 {
                let mut point = |reach: f64| reach * DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5);
                let eye = point(12.0);
                let target = point(3.0);
                let near = 1e-3 * eye.distance(target);
                let clip_from_world =
                    vulkan::perspective_infinite_reverse(0.5, 1.5, near) * view::look_at_mat4(eye, target, DVec3::Y);
                let camera = SightCamera { clip_from_world, eye, near_m: 2.0 * near, size: [300, 200], samples: false };
                let sight = Sight::new(&camera, DMat4::IDENTITY, radius_m.into(), mesh.is_solid());
                for (run, faces) in faces.iter().enumerate() {
                    all += 1;
                    if sight.may_see(faces) {
                        continue;
                    }
                    unseen += 1;
                    for triangle in &mesh.triangles {
                        if triangle.iter().all(|v| run_of[*v as usize] != run) {
                            continue;
                        }
                        let corners = triangle.map(|v| (mesh.positions[v as usize] - centre).as_dvec3());
                        let [a, b, c] = corners;
                        let away = (b - a).cross(c - a).dot(eye - a) <= 0.0;
                        let clip = corners.map(|p| clip_from_world * p.extend(1.0));
                        let outside = |side: &dyn Fn(DVec4) -> f64| clip.iter().all(|c| side(*c) < 0.0);
                        let outside = outside(&|c| c.w - c.x)
                            || outside(&|c| c.w + c.x)
                            || outside(&|c| c.w - c.y)
                            || outside(&|c| c.w + c.y)
                            || outside(&|c| c.w);
                        assert!(outside || (sight.culls() && away), "{}: run {run} from {eye}", mesh.name);
                        backs += usize::from(!outside);
                    }
                }
            }
            assert!(20 * unseen > all, "{}: {unseen} of {all}", mesh.name);
            assert_eq!(backs > 0, mesh.is_solid(), "{}", mesh.name);
        }
    }

    #[test]
    fn the_rim_of_a_grid_is_seen_with_samples() {
        let mesh = plane(2.0, 40);
        let order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        let faces = TriangleRun::around(&mesh, &order, 64);
        assert!(faces.first().unwrap().rim && faces.last().unwrap().rim);
        // Rows of 41 vertices: each run of 64 holds an end of one.
        let cells = Grid::find(&mesh).unwrap().rim().count();
        assert_eq!(cells, 4 * (4 * 40 - 4));
        assert!(TriangleRun::around(&sphere(1.0, 3), &order[..642], 64).iter().all(|faces| !faces.rim));
    }
}
