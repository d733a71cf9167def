//! Lamps that shine from one flat side: discs and rectangles. A panel is a thin closed body whose upper face alone has
//! a colour, so that everything that reads meshes sees it as it is. The mesh also says that it is a panel
//! ([`Mesh::panel`]), for light that is computed from its shape.

use super::generate::cuboid;
use super::mesh::Mesh;
use crate::error::Result;
use crate::field::sub_light::LampFace;
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// Thickness of a panel, of its radius.
const THICKNESS: f32 = 1e-3;
/// Pieces of a disc's rim. Their area is 0.9984 of the circle's.
const SEGMENTS: u32 = 64;
/// The body with its upper face white and all others black.
fn lamp(name: &str, body: Mesh, panel: LampFace) -> Result<Mesh> {
    let color = |normal: &Vec3| if normal.y > 0.5 { Vec3::ONE } else { Vec3::ZERO };
    let colors = body.normals.iter().map(color).collect();
    let mut mesh = Mesh::new(name, body.positions, body.normals, Some(colors), body.triangles)?;
    mesh.panel = Some(panel);
    Ok(mesh)
}

/// A disc of `radius_m` around the origin, which shines towards +y.
pub fn disc(radius_m: f32) -> Result<Mesh> {
    let mut positions = Vec::new();
    let mut normals = Vec::new();
    let mut triangles = Vec::new();
    let height = THICKNESS * radius_m / 2.0;
    let around = |i: u32| {
        let angle = TAU * f64::from(i % SEGMENTS) / f64::from(SEGMENTS);
        Vec3::new(angle.cos() as f32, 0.0, -angle.sin() as f32)
    };
    for side in [1.0, -1.0] {
        let middle = positions.len() as u32;
        positions.push(Vec3::Y * side * height);
        positions.extend((0..SEGMENTS).map(|i| radius_m * around(i) + Vec3::Y * side * height));
        normals.extend([Vec3::Y * side; SEGMENTS as usize + 1]);
        let rim = |i: u32| middle + 1 + i % SEGMENTS;
        triangles.extend((0..SEGMENTS).map(|i| {
            let (a, b) = if side > 0.0 { (i, i + 1) } else { (i + 1, i) };
            [middle, rim(a), rim(b)]
        }));
    }
    let first = positions.len() as u32;
    for i in 0..SEGMENTS {
        positions.extend([-height, height].map(|y| radius_m * around(i) + Vec3::Y * y));
        normals.extend([around(i); 2]);
        let [low, high, next_low, next_high] = [0, 1, 2, 3].map(|k| first + (2 * i + k) % (2 * SEGMENTS));
        triangles.extend([[low, next_low, next_high], [low, next_high, high]]);
    }
    let body = Mesh::new("disc", positions, normals, None, triangles)?;
    let share = f64::from(SEGMENTS) / 2.0 * (TAU / f64::from(SEGMENTS)).sin() / PI;
    lamp("disc", body, LampFace::Disc(share))
}

/// A rectangle around the origin with edges of those lengths along x and z, which shines towards +y.
pub fn rectangle([width_m, depth_m]: [f32; 2]) -> Result<Mesh> {
    let height = THICKNESS * width_m.hypot(depth_m) / 2.0;
    let body = cuboid(Vec3::new(width_m, height, depth_m), 1);
    lamp("rectangle", body, LampFace::Rectangle(f64::from(depth_m) / f64::from(width_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_are_thin_bodies_that_shine_from_one_side() {
        for mesh in [disc(0.5).unwrap(), rectangle([0.3, 0.4]).unwrap(), rectangle([3.0, 0.1]).unwrap()] {
            assert!(mesh.is_solid() && mesh.is_convex(), "{}", mesh.name);
            let (centre, radius) = mesh.bounding_sphere();
            assert!(centre.length() < 1e-6, "{}: {centre}", mesh.name);
            let colors = mesh.colors.as_ref().unwrap();
            let shines = |t: &[u32; 3]| t.iter().all(|v| colors[*v as usize] == Vec3::ONE);
            let corner = |v: u32| mesh.positions[v as usize].as_dvec3();
            let area: f64 = mesh
                .triangles
                .iter()
                .filter(|t| shines(t))
                .map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).y / 2.0)
                .sum();
            let panel = mesh.panel().unwrap();
            let half = panel.half() * f64::from(radius);
            let expected = half.x * half.y * if matches!(panel, LampFace::Disc(_)) { PI } else { 4.0 };
            assert!((area / expected - 1.0).abs() < 1e-5, "{}: {area} {expected}", mesh.name);
        }
    }
}
