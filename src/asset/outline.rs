//! Finds flat meshes that cover a rectangle, and boxes.

use super::mesh::Mesh;
use crate::field::cuboid::Cuboid;
use crate::field::sheet::Rectangle;
use glam::{DVec2, DVec3};

/// How far outside of the rectangle a vertex may lie, as a share of the bounding radius.
const BEYOND: f64 = 1e-5;
/// By how much the area of the triangles may differ from the rectangle's, as a share of it.
const AREA: f64 = 1e-3;

/// The rectangle that the triangles of a flat mesh cover, if they do, all facing one way or once each way. How they cut
/// it does not matter.
pub(super) fn rectangle(mesh: &Mesh) -> Option<Rectangle> {
    let normal = mesh.plane_normal()?;
    let (centre, radius) = mesh.bounding_sphere();
    let centre = centre.as_dvec3();
    let radius = f64::from(radius);
    let place = |v: u32| mesh.positions[v as usize].as_dvec3() - centre;
    let places = || (0..mesh.positions.len() as u32).map(place);
    let most = |measure: &dyn Fn(DVec3) -> f64| places().max_by(|a, b| measure(*a).total_cmp(&measure(*b)));
    // The corners lie on the bounding sphere: one of them, and of its neighbours one, which is as far from their
    // diagonal as any point is.
    let corner = most(&|p| p.length_squared())?;
    let beside = most(&|p| p.dot(corner.cross(normal)))?;
    let long = (corner - beside).try_normalize()?;
    let axes = [long, normal.cross(long)];
    let half_m = axes.map(|axis| axis.dot(corner).abs());
    let within = |p: DVec3| (0..2).all(|k| axes[k].dot(p).abs() <= half_m[k] + BEYOND * radius);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(place).map(|p| DVec2::new(p.dot(axes[0]), p.dot(axes[1])));
        (b - a).perp_dot(c - a) / 2.0
    };
    let areas = || mesh.triangles.iter().map(area);
    let sides = [areas().map(|a| a.max(0.0)).sum::<f64>(), areas().map(|a| (-a).max(0.0)).sum::<f64>()];
    let whole = 4.0 * half_m[0] * half_m[1];
    let is = |area: f64, whole_part: f64| (area - whole_part).abs() <= AREA * whole;
    let covered = sides.iter().any(|&area| is(area, whole)) && sides.iter().all(|&a| is(a, whole) || is(a, 0.0));
    (covered && half_m[0].min(half_m[1]) > BEYOND * radius && places().all(within))
        .then_some(Rectangle { axes, half_m })
}

/// By how much the cosine of the angle between a box's face and its edges may differ from 0 or 1.
pub(super) const SQUARE: f64 = 1e-4;

/// The axes along which a solid's faces look, if its corners are square: those of its first face and of the first one at
/// a right angle to that.
pub(super) fn square_axes(mut normals: impl Iterator<Item = DVec3> + Clone) -> Option<[DVec3; 3]> {
    let x = normals.clone().next()?;
    let y = normals.clone().find(|normal| normal.dot(x).abs() < SQUARE)?;
    let y = (y - y.dot(x) * x).normalize();
    let axes = [x, y, x.cross(y)];
    let is_face = |normal: DVec3| axes.iter().any(|axis| axis.dot(normal).abs() > 1.0 - SQUARE);
    normals.all(is_face).then_some(axes)
}

/// The box that a convex mesh is, if it is one: however it is turned and its faces are cut.
pub(super) fn cuboid(mesh: &Mesh) -> Option<Cuboid> {
    let (centre, radius) = mesh.bounding_sphere();
    let place = |v: u32| (mesh.positions[v as usize] - centre).as_dvec3() / f64::from(radius);
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(place);
        (b - a).cross(c - a).try_normalize()
    };
    if !mesh.is_convex() {
        return None;
    }
    let axes = square_axes(mesh.triangles.iter().filter_map(normal))?;
    let reach = |axis: &DVec3| {
        let along = || (0..mesh.positions.len() as u32).map(|v| axis.dot(place(v)));
        [along().fold(f64::MAX, f64::min), along().fold(f64::MIN, f64::max)]
    };
    let ends = axes.each_ref().map(reach);
    let in_middle = ends.iter().all(|[low, high]| (low + high).abs() < SQUARE);
    in_middle.then(|| Cuboid { half_edges: std::array::from_fn(|i| 0.5 * (ends[i][1] - ends[i][0]) * axes[i]) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate::{self, cuboid, plane};
    use glam::{Quat, Vec3};

    fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
        Mesh::new("test", positions, Vec::new(), None, triangles).unwrap()
    }

    fn halves(mesh: &Mesh) -> Option<[f64; 2]> {
        mesh.rectangle().map(|rectangle| {
            let [a, b] = rectangle.half_m;
            [a.min(b), a.max(b)]
        })
    }

    #[test]
    fn rectangles_are_found_however_they_lie_and_are_cut() {
        for cells in [1, 2, 7, 60] {
            for [width, depth] in [[1.0, 1.0], [0.01, 1.0], [3.0, 40.0]] {
                let place = |p: &Vec3| {
                    Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.0) * (*p * Vec3::new(width, 0.0, depth)) + 7.0
                };
                let square = plane(1.0, cells);
                let turned = mesh(square.positions.iter().map(place).collect(), square.triangles.clone());
                let [a, b] = halves(&turned).unwrap_or_else(|| panic!("{cells} cells, {width} m by {depth} m"));
                assert!((a - f64::from(width) / 2.0).abs() < 1e-4 * a.max(0.1), "{a} for {width}");
                assert!((b - f64::from(depth) / 2.0).abs() < 1e-4 * b, "{b} for {depth}");
                let rectangle = turned.rectangle().unwrap();
                assert!(rectangle.axes[0].dot(rectangle.axes[1]).abs() < 1e-9);
                let tilt = turned.plane_normal().unwrap();
                assert!(rectangle.axes.iter().all(|axis| axis.dot(tilt).abs() < 1e-6 && axis.is_normalized()));
            }
        }
    }

    #[test]
    fn boxes_are_found_however_they_are_turned() {
        let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.0);
        for (size, cells) in [(Vec3::ONE, 1), (Vec3::new(3.0, 0.02, 1.0), 3)] {
            let solid = cuboid(size, cells);
            let place = |p: &Vec3| turn * *p + Vec3::new(4.0, -1.0, 2.0);
            let turned = mesh(solid.positions.iter().map(place).collect(), solid.triangles.clone());
            let mut found = turned.cuboid().unwrap().half_edges.map(|edge| 2.0 * edge.length());
            let mut wanted = size.as_dvec3().to_array().map(|edge| 2.0 * edge / size.as_dvec3().length());
            found.sort_by(f64::total_cmp);
            wanted.sort_by(f64::total_cmp);
            assert!((0..3).all(|i| (found[i] - wanted[i]).abs() < 1e-4), "{found:?} {wanted:?}");
        }
        let skewed = cuboid(Vec3::ONE, 1);
        let positions = skewed.positions.iter().map(|p| Vec3::new(p.x + 0.1 * p.y, p.y, p.z)).collect();
        assert!(mesh(positions, skewed.triangles.clone()).cuboid().is_none(), "skewed");
        assert!(generate::sphere(1.0, 2).cuboid().is_none(), "a ball");
        let wedge = skewed.positions.iter().map(|p| Vec3::new(p.x * (0.6 + p.y), p.y, p.z)).collect();
        assert!(mesh(wedge, skewed.triangles).cuboid().is_none(), "a wedge");
    }

    #[test]
    fn both_sides_may_have_triangles() {
        let square = plane(1.0, 2);
        let backs = square.triangles.iter().map(|&[a, b, c]| [c, b, a]);
        let both = square.triangles.iter().copied().chain(backs).collect();
        assert_eq!(halves(&mesh(square.positions.clone(), both)), Some([0.5, 0.5]));
        let twice = [square.triangles.clone(), square.triangles.clone()].concat();
        assert_eq!(halves(&mesh(square.positions.clone(), twice)), None, "covered twice from one side");
    }

    #[test]
    fn other_outlines_are_no_rectangles() {
        let corners = |places: &[[f32; 2]]| places.iter().map(|[x, z]| Vec3::new(*x, 0.0, *z)).collect::<Vec<_>>();
        let fan = |n: u32| (2..n).map(|k| [0, k, k - 1]).collect::<Vec<_>>();
        let skewed = corners(&[[0.0, 0.0], [1.0, 0.0], [1.3, 1.0], [0.3, 1.0]]);
        let cut = corners(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.9], [0.9, 1.0], [0.0, 1.0]]);
        let ring: Vec<[f32; 2]> = (0..40).map(|i| [(i as f32 * 0.157).cos(), (i as f32 * 0.157).sin()]).collect();
        for (name, places) in [("a parallelogram", skewed), ("a cut corner", cut), ("a disc", corners(&ring))] {
            let count = places.len() as u32;
            assert_eq!(halves(&mesh(places, fan(count))), None, "{name}");
        }
        let square = plane(1.0, 10);
        let hole = square.triangles.iter().enumerate().filter(|(i, _)| i / 2 != 44).map(|(_, t)| *t).collect();
        assert_eq!(halves(&mesh(square.positions.clone(), hole)), None, "a hole");
        assert_eq!(halves(&cuboid(Vec3::ONE, 2)), None, "a solid");
    }
}
