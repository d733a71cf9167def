//! The order of a mesh's vertices in which every cluster of [`CLUSTER_VERTICES`] of them is small and faces one way.
//!
//! The vertices are halved, and each half again, across the longest edge of the box around their places and normals.
//! Each cut lies at a whole number of clusters, so a cluster is as compact as its neighbourhood lets it be. A
//! space-filling curve would do worse: it leaps within some clusters, and a cluster that spans a leap has half of the
//! scene on its list.

use super::triangles::unit_positions;
use crate::asset::mesh::Mesh;
use crate::layout::{CLUSTER_VERTICES, GROUP_CLUSTERS};
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
pub(crate) fn cluster_order(mesh: &Mesh) -> Vec<u32> {
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
