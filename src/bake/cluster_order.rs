//! The order of a mesh's vertices in which every cluster of [`CLUSTER_VERTICES`] of them is small and faces one way.
//!
//! The vertices are halved, and each half again, across the longest edge of the box around their places and normals.
//! Each cut lies at a whole number of clusters, so a cluster is as compact as its neighbourhood lets it be. A
//! space-filling curve would do worse: it leaps within some clusters, and a cluster that spans a leap has half of the
//! scene on its list.
//!
//! Within a cluster the vertices of one side follow each other, in runs of [`RUN_VERTICES`] at most: the light that
//! leaves a run is one number, and the outside of a window's frame may be a hundred times as bright as its inside.

use super::triangles::unit_positions;
use crate::asset::mesh::Mesh;
use crate::asset::topology::Sets;
use crate::layout::{CLUSTER_VERTICES, GROUP_CLUSTERS};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// The distance, in bounding radii, that the length of a normal counts as. It is a little more than the edge of a cube
/// with that radius (1.15), so that the sides of a cube come apart first. Weights from 0.25 to 5 change the sum of all
/// lists by 10 % at most.
const NORMAL_WEIGHT: f32 = 1.25;
/// Most vertices of a run within a cluster.
pub const RUN_VERTICES: usize = 8;
/// Most runs of a cluster.
pub const CLUSTER_RUNS: usize = 16;
/// Sizes that stay whole: groups whose lists are gathered together, clusters, and neighbours within a cluster, which
/// share lines of the cache.
const WHOLE: [usize; 3] = [GROUP_CLUSTERS * CLUSTER_VERTICES as usize, CLUSTER_VERTICES as usize, RUN_VERTICES];
/// Cosine between two normals from which vertices are of one side.
const ONE_SIDE: f32 = 0.5;
/// Below this number of vertices another thread costs more than it saves.
const ALONE: usize = 1 << 14;

/// A vertex: its place in bounding radii and its weighted normal, and its index.
type Point = ([f32; 6], u32);

/// Where the runs of a cluster end, in vertices from its first. Those that it lacks are empty.
pub(crate) type RunEnds = [u8; CLUSTER_RUNS];

/// The runs of a cluster, in vertices from its first, without empty ones.
pub(crate) fn runs(ends: &RunEnds) -> impl Iterator<Item = Range<usize>> {
    let starts = std::iter::once(0).chain(*ends);
    starts.zip(*ends).filter(|(start, end)| start < end).map(|(start, end)| start.into()..end.into())
}

/// The vertices of a mesh in the order of its clusters.
pub(crate) struct ClusterOrder {
    /// Which of them stands at each place.
    pub vertices: Vec<u32>,
    /// The runs of every cluster.
    pub runs: Vec<RunEnds>,
}

/// Where vertices of a cluster share place and normal, as on a wall of which a roof divides the lit part from the dark
/// one, those parts, which hang together by vertices, are different sides too. So are vertices close under lamps, which
/// `under_lamps` tells: their light is the brightest, and little but the lamp sees it.
pub(crate) fn cluster_order(mesh: &Mesh, under_lamps: Option<&[u8]>) -> ClusterOrder {
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
    let runs = points
        .par_chunks_mut(CLUSTER_VERTICES as usize)
        .map(|cluster| part(mesh, cluster, &parts, under_lamps))
        .collect();
    ClusterOrder { vertices: points.into_iter().map(|(_, v)| v).collect(), runs }
}

/// Sorts the vertices of a cluster by their sides, and cuts those into runs.
fn part(mesh: &Mesh, cluster: &mut [Point], parts: &[u32], under_lamps: Option<&[u8]>) -> RunEnds {
    let divided = divided(cluster, parts);
    let mut sides: Vec<((Option<usize>, u8), Vec3, Vec<Point>)> = Vec::new();
    for point in &*cluster {
        let v = point.1 as usize;
        let of = (divided.binary_search(&parts[v]).ok(), under_lamps.map_or(0, |under| under[v]));
        let normal = mesh.normals[v];
        match sides.iter_mut().find(|(part, first, _)| *part == of && first.dot(normal) >= ONE_SIDE) {
            Some((.., points)) => points.push(*point),
            None => sides.push((of, normal, vec![*point])),
        }
    }
    let mut sides: Vec<Vec<Point>> = sides.into_iter().map(|(.., points)| points).collect();
    sides.sort_by_key(|points| std::cmp::Reverse(points.len()));
    while sides.iter().map(|points| points.len().div_ceil(RUN_VERTICES)).sum::<usize>() > CLUSTER_RUNS {
        let smallest = sides.pop().unwrap_or_default();
        sides.last_mut().expect("a cluster fits its runs").extend(smallest);
    }
    let mut ends = [cluster.len() as u8; CLUSTER_RUNS];
    let mut end = 0;
    let mut run = ends.iter_mut();
    for points in &mut sides {
        halve(points);
        cluster[end..end + points.len()].copy_from_slice(points);
        for points in points.chunks(RUN_VERTICES) {
            end += points.len();
            *run.next().expect("runs are few enough above") = end as u8;
        }
    }
    ends
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
    let Some(run) = WHOLE.into_iter().find(|run| points.len() > *run) else { return };
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

    /// The vertices of every run.
    fn all_runs(order: &ClusterOrder) -> Vec<&[u32]> {
        let clusters = order.vertices.chunks(CLUSTER_VERTICES as usize).zip(&order.runs);
        clusters.flat_map(|(vertices, ends)| runs(ends).map(move |run| &vertices[run])).collect()
    }

    /// A plane that is cut in two along a row of vertices, which each part has: no run has both parts.
    #[test]
    fn runs_are_of_one_side_of_a_cut() {
        let part = generate::plane(1.0, 20);
        let count = part.positions.len() as u32;
        let positions = [-0.5, 0.5].map(|x| part.positions.iter().map(move |p| *p + x * Vec3::X)).into_iter().flatten();
        let triangles =
            [0, count].into_iter().flat_map(|first| part.triangles.iter().map(move |t| t.map(|v| v + first)));
        let normals = vec![Vec3::Y; 2 * count as usize];
        let mesh = Mesh::new("cut", positions.collect(), normals, None, triangles.collect()).unwrap();
        let order = cluster_order(&mesh, None);
        let is_cut = |run: &&[u32]| run.iter().any(|v| mesh.positions[*v as usize].x.abs() < 1e-6);
        let has_both = |run: &&[u32]| run.iter().any(|v| *v < count) && run.iter().any(|v| *v >= count);
        let cut: Vec<&[u32]> = all_runs(&order).into_iter().filter(is_cut).collect();
        assert!(cut.len() > 5 && !cut.iter().any(has_both), "{cut:?}");
    }

    /// Many small boxes, of which each side has four vertices: no run has two sides, and each vertex is in one run.
    #[test]
    fn runs_are_of_one_side_of_a_bar() {
        let bar = generate::cuboid(Vec3::new(0.02, 1.0, 0.02), 1);
        let count = bar.positions.len() as u32;
        let at = |i: u32| Vec3::new((i % 7) as f32, 0.0, (i / 7) as f32);
        let positions = (0..40).flat_map(|i| bar.positions.iter().map(move |p| *p + at(i)));
        let normals = (0..40).flat_map(|_| bar.normals.iter().copied()).collect();
        let triangles = (0..40).flat_map(|i| bar.triangles.iter().map(move |t| t.map(|v| v + i * count)));
        let mesh = Mesh::new("bars", positions.collect(), normals, None, triangles.collect()).unwrap();
        let order = cluster_order(&mesh, None);
        let runs = all_runs(&order);
        let normal = |v: u32| mesh.normals[v as usize];
        assert!(
            runs.iter()
                .all(|run| run.len() <= RUN_VERTICES && run.iter().all(|v| normal(*v).dot(normal(run[0])) > 0.5))
        );
        assert_eq!(runs.concat(), order.vertices);
    }
}
