//! Cuts the holes of a texture out of a mesh, so that captures see what is left of it as of any other shape.

use super::mesh::{Attributes, Mesh};
use super::texture::Texture;
use glam::{Vec2, Vec3};

/// Edge of a part at least, in bounding radii: silhouettes have texels of 0.06.
const LEAST_EDGE: f32 = 0.02;
/// Edge of a part, in texels of the texture.
const TEXELS: f32 = 1.5;
/// Parts of all triangles together, about.
const PARTS: f32 = 60_000.0;
/// Parts along a side of a triangle at least, so that what is painted on a few large texels keeps its shape.
const LEAST_CUTS: f32 = 4.0;

/// The parts of a mesh that are no holes; `None` where a texture makes none in it, or leaves nothing.
pub fn pierced(mesh: &Mesh, texture: &Texture) -> Option<Mesh> {
    // What shines in colours keeps them.
    let uvs = mesh.uvs.as_ref().filter(|_| mesh.colors.is_none())?;
    let texels = texture.texels.as_ref().filter(|texels| texture.alpha_cutoff.is_some() && texels.has_alpha())?;
    let size = Vec2::new(texels.width as f32, texels.height as f32);
    let (_, radius_m) = mesh.bounding_sphere();
    let sides_of = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| v as usize);
        [[a, b], [b, c], [c, a]]
    };
    let wanted = |triangle: &[u32; 3]| {
        let longest =
            |length: &dyn Fn([usize; 2]) -> f32| sides_of(triangle).map(length).into_iter().fold(0.0, f32::max);
        let in_texels = longest(&|[a, b]| ((uvs[a] - uvs[b]) * size).length()) / TEXELS;
        let in_radii = longest(&|[a, b]| mesh.positions[a].distance(mesh.positions[b])) / (LEAST_EDGE * radius_m);
        in_texels.min(in_radii.max(LEAST_CUTS)).max(1.0)
    };
    let total: f32 = mesh.triangles.iter().map(|triangle| wanted(triangle).powi(2)).sum();
    let coarser = (PARTS / total).sqrt().min(1.0);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut holes = 0;
    // Backs cover nothing more.
    let sides = if mesh.is_two_sided() { 2 } else { 1 };
    for triangle in &mesh.triangles[..mesh.triangles.len() / sides] {
        let cuts = (wanted(triangle) * coarser).ceil() as usize;
        let corners = triangle.map(|v| mesh.positions[v as usize]);
        let first = positions.len() as u32;
        // Rows of points from the first corner to the side that faces it.
        let row = |i: usize| first + (i * (i + 1) / 2) as u32;
        for i in 0..=cuts {
            for j in 0..=i {
                let weights = Vec3::new((cuts - i) as f32, (i - j) as f32, j as f32) / cuts as f32;
                positions.push(weights.x * corners[0] + weights.y * corners[1] + weights.z * corners[2]);
            }
        }
        let mut add = |part: [u32; 3], points: [[usize; 2]; 3]| {
            let middle = points.iter().fold([0.0; 3], |sum, [i, j]| {
                [sum[0] + (cuts - i) as f32, sum[1] + (i - j) as f32, sum[2] + *j as f32]
            });
            let weights = middle.map(|weight| weight / (3 * cuts) as f32);
            if texture.opacity_at(mesh, *triangle, weights) >= 0.5 { triangles.push(part) } else { holes += 1 }
        };
        for i in 0..cuts {
            for j in 0..=i {
                let [upper, lower] = [row(i) + j as u32, row(i + 1) + j as u32];
                add([upper, lower, lower + 1], [[i, j], [i + 1, j], [i + 1, j + 1]]);
                if j < i {
                    add([upper, lower + 1, upper + 1], [[i, j], [i + 1, j + 1], [i, j + 1]]);
                }
            }
        }
    }
    (holes > 0 && !triangles.is_empty()).then(|| {
        let normals = vec![Vec3::Y; positions.len()];
        mesh.refined(positions, normals, Attributes::default(), triangles).opened()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::texture::{half_solid, square};

    #[test]
    fn a_half_that_is_not_there_is_cut_off() {
        let mesh = square();
        let mut texture = half_solid(64, 24);
        let left = pierced(&mesh, &texture).unwrap();
        assert!((left.area_m2() - 0.375).abs() < 0.02, "{}", left.area_m2());
        assert_eq!(left.bounding_sphere(), mesh.bounding_sphere());
        assert!(left.rectangle().is_none() && mesh.rectangle().is_some() && left.is_flat());
        texture.alpha_cutoff = None;
        assert!(pierced(&mesh, &texture).is_none(), "without a cutoff nothing is a hole");
    }
}
