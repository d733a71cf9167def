//! Bounds of a mesh's clusters, which are runs of [`CLUSTER_VERTICES`] vertices in the order of
//! `bake::cluster_order`.

use crate::asset::mesh::Mesh;
use crate::layout::CLUSTER_VERTICES;
use crate::lists::gather::ClusterBounds;
use glam::Vec3;

/// Bounds of every run of [`CLUSTER_VERTICES`], relative to the bounding sphere's centre.
pub(crate) fn bounds(mesh: &Mesh, order: &[u32]) -> Vec<ClusterBounds> {
    let (centre, _) = mesh.bounding_sphere();
    let bounds = |run: &[u32]| {
        let positions: Vec<Vec3> = run.iter().map(|&v| mesh.positions[v as usize] - centre).collect();
        let normals: Vec<Vec3> = run.iter().map(|&v| mesh.normals[v as usize]).collect();
        ClusterBounds::new(&positions, &normals)
    };
    order.chunks(CLUSTER_VERTICES as usize).map(bounds).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::bake::cluster_order::cluster_order;

    fn places(mesh: &Mesh) -> Vec<u32> {
        let order = cluster_order(mesh, None).vertices;
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..mesh.positions.len() as u32), "{}: every vertex once", mesh.name);
        order
    }

    /// No cluster of a floor is much larger than a square of as many vertices, for any number of vertices.
    #[test]
    fn clusters_of_a_floor_span_no_leap() {
        for cells in [1, 7, 31, 80, 256, 331] {
            let mesh = generate::plane(1.0, cells);
            let square_m = 8.0 / cells as f32 / 2_f32.sqrt();
            let bounds = bounds(&mesh, &places(&mesh));
            let largest = bounds.iter().map(|b| b.radius_m).fold(0.0, f32::max);
            assert!(largest < 1.7 * square_m, "{cells} cells: {largest} m where a square has {square_m}");
        }
    }

    /// Each cluster of a box lies on one side.
    #[test]
    fn clusters_face_one_way() {
        let mesh = generate::cuboid(Vec3::ONE, 31);
        let bounds = bounds(&mesh, &places(&mesh));
        let mixed = bounds.iter().filter(|b| b.cosine < 0.9).count();
        assert_eq!((bounds.len(), mixed), (96, 0));
    }

    /// At most one cluster lies on both of two floors far from each other.
    #[test]
    fn parts_lie_apart() {
        let part = generate::plane(1.0, 30);
        let count = part.positions.len() as u32;
        let both = |at: Vec3| part.positions.iter().map(move |p| *p + at);
        let positions: Vec<Vec3> = both(Vec3::ZERO).chain(both(20.0 * Vec3::X)).collect();
        let triangles =
            [0, count].into_iter().flat_map(|first| part.triangles.iter().map(move |t| t.map(|v| v + first)));
        let normals = vec![Vec3::Y; positions.len()];
        let mesh = Mesh::new("parts", positions, normals, None, triangles.collect()).unwrap();
        let wide = bounds(&mesh, &places(&mesh)).iter().filter(|b| b.radius_m > 1.0).count();
        assert!(wide <= 1, "{wide} clusters");
    }
}
