//! The outline of an entity as the camera sees it: edges between a face that looks at the eye and one that does not.

use crate::asset::Mesh;
use crate::scene::Placement;
use glam::{DMat4, DVec2, DVec3, DVec4, Vec3};
use std::collections::HashMap;

/// Edges of a mesh with the faces beside them.
pub struct Edges {
    /// Corners of each edge.
    ends: Vec<[Vec3; 2]>,
    /// Faces beside it; the second is the first at a border.
    faces: Vec<[u32; 2]>,
    /// A point and the normal of each face.
    planes: Vec<(DVec3, DVec3)>,
}

impl Edges {
    /// Finds the edges of a mesh. Vertices at one place are one corner, whatever their normals.
    pub fn new(mesh: &Mesh) -> Self {
        let mut corners: HashMap<[u32; 3], u32> = HashMap::new();
        let mut corner = |v: u32| {
            // -0 and 0 are one place.
            let bits = (mesh.positions[v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
            let next = corners.len() as u32;
            *corners.entry(bits).or_insert(next)
        };
        let mut known: HashMap<[u32; 2], usize> = HashMap::new();
        let mut edges = Edges { ends: Vec::new(), faces: Vec::new(), planes: Vec::new() };
        for triangle in &mesh.triangles {
            let face = edges.planes.len() as u32;
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
            edges.planes.push((a, (b - a).cross(c - a)));
            for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                let (i, j) = (corner(triangle[from]), corner(triangle[to]));
                match known.get(&[i.min(j), i.max(j)]) {
                    Some(&edge) => edges.faces[edge][1] = face,
                    None => {
                        known.insert([i.min(j), i.max(j)], edges.ends.len());
                        edges.ends.push([triangle[from], triangle[to]].map(|v| mesh.positions[v as usize]));
                        edges.faces.push([face, face]);
                    }
                }
            }
        }
        edges
    }

    /// Line segments of the outline in a picture of `size` pixels (any unit), in its coordinates: x right, y down. They end at
    /// the picture's edges.
    pub fn outline(&self, placement: &Placement, clip_from_world: DMat4, eye: DVec3, size: DVec2) -> Vec<[DVec2; 2]> {
        let rotation = placement.rotation.as_dquat().normalize();
        let world = DMat4::from_scale_rotation_translation(
            DVec3::splat(placement.scale.into()),
            rotation,
            placement.position.as_dvec3(),
        );
        let clip = clip_from_world * world;
        let eye = world.inverse().transform_point3(eye);
        let seen: Vec<bool> = self.planes.iter().map(|(point, normal)| normal.dot(eye - *point) > 0.0).collect();
        let place = |c: DVec4| (DVec2::new(c.x, c.y) / c.w + 1.0) / 2.0 * size;
        let of = |(faces, ends): (&[u32; 2], &[Vec3; 2])| {
            let [a, b] = faces.map(|f| seen[f as usize]);
            if a == b && faces[0] != faces[1] {
                return None;
            }
            clipped(ends.map(|p| clip * p.as_dvec3().extend(1.0))).map(|ends| ends.map(place))
        };
        self.faces.iter().zip(&self.ends).filter_map(of).collect()
    }
}

/// The part of a segment in clip coordinates that is before the eye and between the picture's edges.
fn clipped([from, to]: [DVec4; 2]) -> Option<[DVec4; 2]> {
    let sides = |c: DVec4| [c.w - 1e-6, c.w - c.x, c.w + c.x, c.w - c.y, c.w + c.y];
    let (mut first, mut last) = (0.0, 1.0);
    for (a, b) in sides(from).into_iter().zip(sides(to)) {
        if a < 0.0 && b < 0.0 {
            return None;
        }
        let crossing = a / (a - b);
        if a < 0.0 {
            first = f64::max(first, crossing);
        } else if b < 0.0 {
            last = f64::min(last, crossing);
        }
    }
    (first < last).then(|| [first, last].map(|t| from.lerp(to, t)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::Generator;
    use crate::frame::camera::clip_from_world;
    use crate::scene::Camera;
    use glam::Quat;

    fn outline(toml: &str) -> Vec<[DVec2; 2]> {
        outline_at(toml, Vec3::ZERO)
    }

    fn outline_at(toml: &str, position: Vec3) -> Vec<[DVec2; 2]> {
        let table: HashMap<String, Generator> = toml::from_str(&format!("mesh.{toml}")).unwrap();
        let mesh = table["mesh"].build().unwrap();
        let camera = Camera { eye: Vec3::new(0.0, 0.0, 10.0), target: Vec3::ZERO, fov_deg: 40.0 };
        let placement = Placement { position, rotation: Quat::IDENTITY, scale: 1.0 };
        let clip = clip_from_world(&camera, 1.0);
        Edges::new(&mesh).outline(&placement, clip, camera.eye.as_dvec3(), DVec2::splat(200.0))
    }

    #[test]
    fn a_sphere_has_a_circle_and_nothing_inside() {
        let lines = outline("sphere = { radius_m = 1, subdivisions = 3 }");
        // tan(asin(1 / 10)) over tan(20 degrees), in halves of 200.
        let radius = 100.0 * 0.1 / (1.0_f64 - 0.01).sqrt() / 20.0_f64.to_radians().tan();
        assert!(lines.len() > 30);
        for point in lines.iter().flatten() {
            let distance = point.distance(DVec2::splat(100.0));
            assert!((distance / radius - 1.0).abs() < 0.03, "{distance} of {radius}");
        }
    }

    #[test]
    fn flat_faces_show_no_triangles() {
        let lines = outline("cuboid = { size_m = [1, 1, 1], cells = 2 }");
        assert_eq!(lines.len(), 8, "two edges a side of the square seen from the front: {lines:?}");
    }

    #[test]
    fn an_outline_ends_at_the_edges_of_the_picture() {
        // Wider than the picture, and its near edge is behind the camera.
        let lines = outline_at("plane = { size_m = 60, cells = 1 }", Vec3::new(0.0, -1.0, 0.0));
        assert_eq!(lines.len(), 1, "the far edge alone is in view: {lines:?}");
        let [a, b] = lines[0];
        assert!((a.x - b.x).abs() > 199.9 && (a.y - b.y).abs() < 1e-6 && (100.0..200.0).contains(&a.y), "{lines:?}");
        // Half of a square beyond the right edge: its two long sides reach that edge.
        let edge = 10.0 * 20.0_f64.to_radians().tan() as f32;
        let lines = outline_at("cuboid = { size_m = [1, 1, 0.001], cells = 1 }", Vec3::new(edge, 0.0, 0.0));
        let reach = |l: &&[DVec2; 2]| l.iter().any(|p| (p.x - 200.0).abs() < 1e-6);
        assert_eq!(lines.iter().filter(reach).count(), 2, "{lines:?}");
        assert!(lines.iter().flatten().all(|p| (0.0..=200.0 + 1e-6).contains(&p.x)));
    }
}
