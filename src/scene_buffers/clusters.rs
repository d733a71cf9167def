//! Clusters are runs of [`CLUSTER_VERTICES`] vertices. This finds the order of a mesh's vertices in which every cluster
//! is small and faces one way, and the bounds of each.
//!
//! The vertices are halved, and each half again, across the longest edge of the box around their places and normals.
//! Each cut lies at a whole number of clusters, so a cluster is as compact as its neighbourhood lets it be. A
//! space-filling curve would do worse: it leaps within some clusters, and a cluster that spans a leap has half of the
//! scene on its list.

use crate::asset::mesh::Mesh;
use crate::bake::triangles::unit_positions;
use crate::layout::CLUSTER_VERTICES;
use crate::lists::gather::{ClusterBounds, GROUP_CLUSTERS};
use glam::Vec3;

/// The distance, in bounding radii, that the length of a normal counts as. It is a little more than the edge of a cube
/// with that radius (1.15), so that the sides of a cube come apart first. Weights from 0.25 to 5 change the sum of all
/// lists by 10 % at most.
const NORMAL_WEIGHT: f32 = 1.25;
/// Sizes of the runs that stay whole: groups whose lists are gathered together, clusters, and neighbours within a
/// cluster, which share lines of the cache.
const RUNS: [usize; 3] = [GROUP_CLUSTERS * CLUSTER_VERTICES as usize, CLUSTER_VERTICES as usize, 8];
/// Below this number of vertices another thread costs more than it saves.
const ALONE: usize = 1 << 14;

/// A vertex: its place in bounding radii and its weighted normal, and its index.
type Point = ([f32; 6], u32);

/// The order of the mesh's vertices: which of them stands at each place.
pub(crate) fn order(mesh: &Mesh) -> Vec<u32> {
    let point = |(v, p): (usize, Vec3)| {
        let n = NORMAL_WEIGHT * mesh.normals[v];
        ([p.x, p.y, p.z, n.x, n.y, n.z], v as u32)
    };
    let mut points: Vec<Point> = unit_positions(mesh).into_iter().enumerate().map(point).collect();
    halve(&mut points);
    points.into_iter().map(|(_, v)| v).collect()
}

fn halve(points: &mut [Point]) {
    let Some(run) = RUNS.into_iter().find(|run| points.len() > *run) else { return };
    let mut low = [f32::INFINITY; 6];
    let mut high = [f32::NEG_INFINITY; 6];
    for (point, _) in points.iter() {
        for axis in 0..6 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let axis = (0..6).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    let middle = run * (points.len() / 2).div_ceil(run);
    points.select_nth_unstable_by(middle, |(a, i), (b, j)| a[axis].total_cmp(&b[axis]).then(i.cmp(j)));
    let whole = points.len();
    let (below, above) = points.split_at_mut(middle);
    if whole > ALONE {
        rayon::join(|| halve(below), || halve(above));
    } else {
        halve(below);
        halve(above);
    }
}

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

    fn places(mesh: &Mesh) -> Vec<u32> {
        let order = order(mesh);
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
