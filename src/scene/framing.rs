//! Cameras that show a scene's things as large as a picture allows.

use super::{Camera, Placement};
use crate::asset::Mesh;
use crate::asset::enclose::around_spheres;
use glam::{DVec3, Vec3};

/// Share of a picture's width or height, whichever is reached first, that things fill.
const FILL: f64 = 0.8;
/// Azimuth from +z towards +x and elevation of an added camera, as seen from the things, degrees.
const TOWARD_DEG: [f64; 2] = [30.0, 22.0];
/// Its vertical field of view, degrees.
const FOV_DEG: f32 = 40.0;
/// Most vertices that are projected; beyond, boxes around bounding spheres are.
const POINT_LIMIT: usize = 4_000_000;
/// Halvings by which points are centred: to a thousandth of the picture.
const CENTRING_STEPS: usize = 9;
/// Cosine to the vertical from which on a sheet is level.
const LEVEL: f64 = 0.99;

/// A camera in front of points, to their right and above them, that sees them as large as a picture of that width over
/// height allows. Without any extent it sees a metre around the first of them, or around the origin.
pub(crate) fn camera(points: &[DVec3], aspect: f64) -> Camera {
    let [azimuth, elevation] = TOWARD_DEG.map(f64::to_radians);
    let toward = DVec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
    let [eye, target] = fit(points, toward, FOV_DEG, aspect).unwrap_or_else(|| {
        let middle = points.first().copied().unwrap_or_default();
        [middle + toward * (1.0 / (f64::from(FOV_DEG).to_radians() / 2.0).sin()), middle]
    });
    Camera { eye: eye.as_vec3(), target: target.as_vec3(), fov_deg: FOV_DEG }
}

/// Eye and target of a camera that looks from the unit vector `toward` and sees all points within [`FILL`] of a picture
/// of that width over height; `None` where the points have no extent.
///
/// A plane through the eye bounds them on each of four sides. Two that are opposite set how far away the eye has to be,
/// and where it stands between them.
pub(crate) fn fit(points: &[DVec3], toward: DVec3, fov_deg: f32, aspect: f64) -> Option<[DVec3; 2]> {
    let ahead = -toward;
    let up = Camera::new(toward.as_vec3(), Vec3::ZERO).up().as_dvec3();
    let right = ahead.cross(up).normalize();
    let up = right.cross(ahead);
    let farthest = |axis: DVec3| points.iter().map(|p| axis.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
    let between = |side: DVec3, slope: f64| {
        let [plus, minus] = [side, -side].map(|side| farthest(side - slope * ahead));
        ((plus - minus) / 2.0, -(plus + minus) / (2.0 * slope))
    };
    let slope = FILL * (f64::from(fov_deg).to_radians() / 2.0).tan();
    let by_width = between(right, slope * aspect).1;
    let by_height = between(up, slope).1;
    let near = -farthest(-ahead);
    let far = farthest(ahead);
    // A line along the view has no width: the eye keeps off its end.
    let depth = by_width.min(by_height).min(near - 0.05 * (far - near));
    let distance_m = (near + far) / 2.0 - depth;
    // Along the other axis the points lie between steeper planes through the eye, which leave as much on both sides.
    let middle = |side: DVec3, widest: f64| {
        let mut slopes = [0.0, widest];
        for _ in 0..CENTRING_STEPS {
            let slope = (slopes[0] + slopes[1]) / 2.0;
            slopes[usize::from(between(side, slope).1 > depth)] = slope;
        }
        between(side, slopes[1]).0
    };
    let [across, above] = [middle(right, slope * aspect), middle(up, slope)];
    let eye = across * right + above * up + depth * ahead;
    // A camera holds both in f32.
    let resolved_m = 1e-6 * eye.abs().max_element().max(1e-3);
    (distance_m > resolved_m && eye.is_finite()).then(|| [eye, eye + distance_m * ahead])
}

/// Points of what a picture is of: all vertices of things at their placements, in metres. A level sheet that is wider
/// than all the rest is a ground, and left out.
pub(crate) fn points<'a>(things: impl Iterator<Item = (&'a Mesh, Placement)>) -> Vec<DVec3> {
    let things: Vec<_> = things.map(|thing| (thing.1.sphere(thing.0.bounding_sphere()), thing)).collect();
    let is_level = |(mesh, place): &(&Mesh, Placement)| {
        mesh.plane_normal().is_some_and(|normal| (place.turn() * normal).y.abs() > LEVEL)
    };
    let standing: Vec<_> = things.iter().filter(|(_, thing)| !is_level(thing)).map(|(sphere, _)| *sphere).collect();
    let rest_m = around_spheres(&standing).map_or(f64::INFINITY, |(_, radius_m)| radius_m);
    let shown = || things.iter().filter(|((_, radius_m), thing)| !is_level(thing) || *radius_m <= rest_m);
    if shown().map(|(_, (mesh, _))| mesh.positions.len()).sum::<usize>() > POINT_LIMIT {
        let corners = [-1.0, 1.0].map(|x| [-1.0, 1.0].map(|y| [-1.0, 1.0].map(|z| DVec3::new(x, y, z))));
        let corners = corners.as_flattened().as_flattened();
        return shown().flat_map(|(sphere, _)| corners.iter().map(|c| sphere.0 + sphere.1 * *c)).collect();
    }
    let vertices = |(_, (mesh, place)): &(_, (&'a Mesh, Placement))| {
        let place = *place;
        mesh.positions.iter().map(move |p| place.point(p.as_dvec3()))
    };
    shown().flat_map(vertices).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    /// How far points reach from the middle of a picture: largest shares of half its width and of half its height.
    fn reach(camera: &Camera, points: &[DVec3], aspect: f64) -> [f64; 2] {
        let eye = camera.eye.as_dvec3();
        let ahead = (camera.target.as_dvec3() - eye).normalize();
        let right = ahead.cross(DVec3::Y).normalize();
        let up = right.cross(ahead);
        let slope = camera.half_height();
        let share = |axis: DVec3, slope: f64| {
            points.iter().map(|p| (*p - eye).dot(axis).abs() / (*p - eye).dot(ahead) / slope).fold(0.0, f64::max)
        };
        [share(right, slope * aspect), share(up, slope)]
    }

    #[test]
    fn a_box_fills_four_fifths_of_any_picture() {
        let corners: Vec<DVec3> = (0..8)
            .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1) * 3.0, f64::from(i >> 2)) + DVec3::splat(70.0))
            .collect();
        for aspect in [0.2, 0.75, 1.0, 1.5, 16.0 / 9.0, 6.0] {
            let camera = camera(&corners, aspect);
            let reach = reach(&camera, &corners, aspect);
            assert!((reach[0].max(reach[1]) - FILL).abs() < 1e-3, "{aspect}: {reach:?}");
            let toward = (camera.eye - camera.target).normalize();
            assert!(toward.z > 0.7 && toward.y > 0.3 && toward.x > 0.3, "from the front and above: {toward}");
        }
    }

    #[test]
    fn points_without_extent_are_seen_too() {
        for points in [&[][..], &[DVec3::splat(3.0); 2]] {
            let camera = camera(points, 1.5);
            assert!(camera.check().is_ok() && camera.eye.distance(camera.target) > 1.0, "{camera:?}");
        }
        let line = [DVec3::ZERO, -9.0 * DVec3::Z];
        let [eye, target] = fit(&line, DVec3::Z, FOV_DEG, 1.5).unwrap();
        assert!(eye.z > 0.1 && target.z < 0.0, "{eye} {target}");
    }

    #[test]
    fn a_ground_is_left_out_unless_there_is_nothing_else() {
        let place = Placement { position: Vec3::ZERO, rotation: glam::Quat::IDENTITY, scale: 1.0 };
        let ball = generate::sphere(0.5, 1);
        let widest =
            |things: &[&Mesh]| points(things.iter().map(|mesh| (*mesh, place))).iter().map(|p| p.x).fold(0.0, f64::max);
        let [ground, tile] = [50.0, 0.6].map(|size_m| generate::plane(size_m, 1));
        assert!((widest(&[&ground, &ball, &tile]) - 0.5).abs() < 1e-6);
        assert!((widest(&[&ground]) - 25.0).abs() < 1e-6);
    }
}
