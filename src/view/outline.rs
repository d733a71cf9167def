//! The outline of an entity as the camera sees it: its silhouette edges.

use crate::asset::edges::Edges;
use crate::draw::camera::world_from_centred;
use crate::scene::Placement;
use glam::{DMat4, DVec2, DVec3, DVec4};

/// Line segments of an outline in a picture of `size` (in any unit), with x to the right and y down. Segments are
/// clipped to the picture. `centre_m` is the centre of the mesh's bounding sphere.
pub fn outline(
    edges: &Edges,
    centre_m: DVec3,
    placement: &Placement,
    clip_from_world: DMat4,
    eye: DVec3,
    size: DVec2,
) -> Vec<[DVec2; 2]> {
    let world = world_from_centred(placement, centre_m);
    let place = |c: DVec4| (DVec2::new(c.x, c.y) / c.w + 1.0) / 2.0 * size;
    let lines = edges.lines(clip_from_world * world, world.inverse().transform_point3(eye), false);
    lines.into_iter().map(|line| line.ends.map(place)).collect()
}

#[cfg(test)]
mod tests {
    use super::{outline as outline_of, *};
    use crate::asset::Generator;
    use crate::draw::camera::clip_from_world;
    use crate::scene::Camera;
    use glam::{Quat, Vec3};
    use std::collections::HashMap;

    fn outline(toml: &str) -> Vec<[DVec2; 2]> {
        outline_at(toml, Vec3::ZERO)
    }

    fn outline_at(toml: &str, position: Vec3) -> Vec<[DVec2; 2]> {
        let table: HashMap<String, Generator> = toml::from_str(&format!("mesh.{toml}")).unwrap();
        let mesh = table["mesh"].build().unwrap();
        let camera = Camera { eye: Vec3::new(0.0, 0.0, 10.0), target: Vec3::ZERO, fov_deg: 40.0 };
        let placement = Placement { position, rotation: Quat::IDENTITY, scale: 1.0 };
        let clip = clip_from_world(&camera, 1.0);
        let centre = mesh.bounding_sphere().0.as_dvec3();
        outline_of(&Edges::new(&mesh), centre, &placement, clip, camera.eye.as_dvec3(), DVec2::splat(200.0))
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
