//! The order of a mesh's vertices in which every cluster of [`CLUSTER_VERTICES`] of them is small and faces one way.
//!
//! The vertices are halved, and each half again, across the longest edge of the box around their places and normals.
//! Each cut lies at a whole number of clusters, so a cluster is as compact as its neighbourhood lets it be. A
//! space-filling curve would do worse: it leaps within some clusters, and a cluster that spans a leap has half of the
//! scene on its list.

use super::triangles::unit_positions;
use crate::asset::mesh::Mesh;
use crate::asset::topology::Sets;
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
///
/// Where vertices of a cluster share place and normal, as on a wall of which a roof divides the lit part from the dark
/// one, those parts, which hang together by vertices, follow each other: neighbours have the light of one part.
pub(crate) fn cluster_order(mesh: &Mesh) -> Vec<u32> {
    let mut parts = Sets::new(mesh.positions.len());
    for [a, b, c] in &mesh.triangles {
        parts.join(*a as usize, *b as usize);
        parts.join(*a as usize, *c as usize);
    }
    let parts: Vec<u32> = (0..mesh.positions.len()).map(|v| parts.root(v) as u32).collect();
    let point = |(v, p): (usize, Vec3)| {
        let n = NORMAL_WEIGHT * mesh.normals[v];
        ([p.x, p.y, p.z, n.x, n.y, n.z], v as u32)
    };
    let mut points: Vec<Point> = unit_positions(mesh).into_iter().enumerate().map(point).collect();
    halve(&mut points);
    for cluster in points.chunks_mut(CLUSTER_VERTICES as usize) {
        let divided = divided(cluster, &parts);
        if divided.len() > 1 {
            let part = |(_, v): &Point| divided.binary_search(&parts[*v as usize]).ok();
            cluster.sort_by_key(part);
            cluster.chunk_by_mut(|a, b| part(a) == part(b)).for_each(halve);
        }
    }
    points.into_iter().map(|(_, v)| v).collect()
}

/// The parts of vertices that share place and normal with one of another part, sorted.
fn divided(points: &[Point], parts: &[u32]) -> Vec<u32> {
    let mut places: Vec<([u32; 6], u32)> =
        points.iter().map(|(point, v)| (point.map(f32::to_bits), parts[*v as usize])).collect();
    places.sort_unstable();
    let twins = places.windows(2).filter(|pair| pair[0].0 == pair[1].0 && pair[0].1 != pair[1].1);
    let mut divided: Vec<u32> = twins.flat_map(|pair| [pair[0].1, pair[1].1]).collect();
    divided.sort_unstable();
    divided.dedup();
    divided
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;

    /// A plane that is cut in two along a row of vertices, which each part has: no more runs have both parts than the one
    /// in which a part ends, of every cluster.
    #[test]
    fn neighbours_are_of_one_side_of_a_cut() {
        let part = generate::plane(1.0, 20);
        let count = part.positions.len() as u32;
        let positions = [-0.5, 0.5].map(|x| part.positions.iter().map(move |p| *p + x * Vec3::X)).into_iter().flatten();
        let triangles =
            [0, count].into_iter().flat_map(|first| part.triangles.iter().map(move |t| t.map(|v| v + first)));
        let normals = vec![Vec3::Y; 2 * count as usize];
        let mesh = Mesh::new("cut", positions.collect(), normals, None, triangles.collect()).unwrap();
        let order = cluster_order(&mesh);
        let has_both = |run: &&[u32]| run.iter().any(|v| *v < count) && run.iter().any(|v| *v >= count);
        let on_cut = |run: &[u32]| run.iter().any(|v| mesh.positions[*v as usize].x.abs() < 0.02);
        for cluster in order.chunks(CLUSTER_VERTICES as usize).filter(|cluster| on_cut(cluster)) {
            assert!(cluster.chunks(8).filter(has_both).count() <= 1, "{cluster:?}");
        }
    }
}
