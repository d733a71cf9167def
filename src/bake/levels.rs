//! Levels of detail: in place of triangles that are far from the eye, fewer and larger ones are drawn.
//!
//! meshoptimizer builds them as in Karis, *Nanite: A Deep Dive*, SIGGRAPH 2021. Neighbouring chunks form a group; a
//! group is simplified to half of its triangles while the vertices on its rim stay in their places, and what comes out
//! is cut into new chunks for the next level. A group knows by how much its simplified triangles miss it, and a sphere
//! around it; both grow from level to level. So for any eye one rule decides each chunk, and what is drawn fits
//! together without a gap: a chunk is drawn if its group may not be drawn simplified, and if the group that it was
//! simplified from may.

use super::chunk::{Chunked, adapter};
use super::triangles::{distinct, unit_positions};
use crate::asset::Mesh;
use crate::error::Result;
use glam::Vec3;
use meshopt::{ClodBounds, ClodConfig, ClodMesh, clod_build, clod_default_config};
use std::ops::Range;

/// Largest displacement of what is captured, in texels of a face. The facets of a round body lie partly inside and
/// partly outside of it, so a displacement neither shrinks nor grows the solid.
pub const TEXEL_SHARE: f64 = 0.25;

/// Triangles from which on a mesh has levels. Below, drawing them all takes less than a third of a bake.
const FROM_TRIANGLES: usize = 4000;
/// Triangles of a chunk, and chunks of a group. Larger groups simplify better inside their rims; smaller groups follow
/// the distance more closely, and save more than twice as much in rough meshes.
const CHUNK_TRIANGLES: usize = 32;
const GROUP_CHUNKS: usize = 8;
/// Distance, in r, from which on what is drawn may miss the mesh by no more, though it is seen ever smaller. Simplified
/// bodies are a little smaller on average, and that changes the same share of a field at every distance. With 0.25 it
/// moves the coefficients of a torus of 69 696 triangles by 0.0027 (relative RMS), with 0.6 by 0.0043; a rough mesh of
/// 69 168 draws 15 % more triangles.
const FARTHEST: f32 = 0.25;

/// The share of a texel by which captures of a mesh may miss it where levels are wanted: 0 for meshes that are too
/// small to have any.
pub fn texels(mesh: &Mesh) -> f64 {
    if mesh.triangles.len() >= FROM_TRIANGLES { TEXEL_SHARE } else { 0.0 }
}

/// The distance by which drawn triangles may miss the mesh.
#[derive(Clone, Copy, Debug)]
pub(super) enum Tolerance {
    /// Seen from an eye: this share of the distance, or of [`FARTHEST`] from there on.
    Eye(Vec3, f32),
    /// Everywhere the same, in r.
    Parallel(f32),
}

impl Tolerance {
    pub fn capture(eye: Vec3, face_px: u32) -> Self {
        Tolerance::Eye(eye, (TEXEL_SHARE * 2.0) as f32 / face_px as f32)
    }

    /// Whether a group may not be drawn simplified.
    fn forbids(&self, bounds: &ClodBounds) -> bool {
        match *self {
            Tolerance::Eye(eye, share) => {
                bounds.error > share * (eye.distance(bounds.center.into()) - bounds.radius).clamp(0.0, FARTHEST)
            }
            Tolerance::Parallel(most) => bounds.error > most,
        }
    }
}

struct Group {
    /// The sphere around it, and the distance by which its simplified triangles miss it, in r.
    bounds: ClodBounds,
    siblings: Range<usize>,
}

/// Chunks of a group that were simplified from one group.
struct Siblings {
    /// That group, or `None` for the mesh's own triangles.
    from: Option<usize>,
    chunks: Range<u32>,
}

/// A mesh cut into chunks of all levels, and which chunk is drawn in whose place.
pub(super) struct Leveled {
    pub chunked: Chunked,
    groups: Vec<Group>,
    siblings: Vec<Siblings>,
}

impl Leveled {
    /// Cuts a mesh into chunks of neighbouring triangles, for all of its levels.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let positions = unit_positions(mesh);
        let adapter = adapter(&positions)?;
        // Vertices at one place become one, so that no group has a rim where only normals differ.
        let same = meshopt::generate_position_remap(&adapter);
        let triangles = distinct(mesh);
        let welded = triangles.iter().map(|t| t.map(|vertex| same[vertex as usize]));
        let welded: Vec<u32> = welded.filter(|[a, b, c]| a != b && b != c && c != a).flatten().collect();
        let config = ClodConfig {
            partition_size: GROUP_CHUNKS,
            partition_sort: true,
            optimize_clusters: false,
            // It may tear a surface that stays whole otherwise.
            simplify_fallback_sloppy: false,
            ..clod_default_config(CHUNK_TRIANGLES)
        };
        let mut chunked = Chunked::default();
        let mut siblings = Vec::new();
        let mut groups = Vec::new();
        clod_build(config, &ClodMesh::new(&welded, &adapter), |group, clusters| {
            let first = siblings.len();
            for alike in clusters.chunk_by(|a, b| a.refined == b.refined) {
                let start = chunked.chunks.len() as u32;
                alike.iter().for_each(|cluster| chunked.add(&positions, cluster.indices));
                let chunks = start..chunked.chunks.len() as u32;
                siblings.push(Siblings { from: usize::try_from(alike[0].refined).ok(), chunks });
            }
            groups.push(Group { bounds: group.simplified, siblings: first..siblings.len() });
            groups.len() as i32 - 1
        });
        Ok(Leveled { chunked, groups, siblings })
    }

    /// Puts ranges of the chunks that are drawn under a tolerance into `chosen`, in order.
    pub fn choose(&self, tolerance: Tolerance, chosen: &mut Vec<Range<u32>>) {
        chosen.clear();
        for group in self.groups.iter().filter(|group| tolerance.forbids(&group.bounds)) {
            for Siblings { from, chunks } in &self.siblings[group.siblings.clone()] {
                if !from.is_some_and(|group| tolerance.forbids(&self.groups[group].bounds)) {
                    chosen.push(chunks.clone());
                }
            }
        }
        chosen.sort_unstable_by_key(|chunks| chunks.start);
    }

    /// Adds the indices of ranges to `indices`, and returns the range that they are there.
    pub fn gathered(&self, ranges: &[Range<u32>], indices: &mut Vec<u32>) -> Vec<Range<u32>> {
        let start = indices.len() as u32;
        for range in ranges {
            let all = self.chunked.triangles.as_flattened();
            indices.extend_from_slice(&all[range.start as usize..range.end as usize]);
        }
        let end = indices.len() as u32;
        if start < end { vec![start..end] } else { Vec::new() }
    }

    /// Triangles that are drawn under a tolerance, by their corners among the mesh's vertices.
    pub fn drawn(&self, tolerance: Tolerance) -> Vec<[u32; 3]> {
        let mut chosen = Vec::new();
        self.choose(tolerance, &mut chosen);
        let drawn = chosen.into_iter().flatten().flat_map(|chunk| self.chunked.triangles_of(chunk as usize));
        drawn.map(|triangle| triangle.map(|vertex| self.chunked.vertices[vertex as usize])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use std::collections::HashMap;

    /// A closed surface with bumps of several sizes.
    fn bumpy() -> Mesh {
        let ball = generate::sphere(1.0, 5);
        let bump = |p: &Vec3| {
            let waves = |f: f32| (f * p.x).sin() * (f * p.y + 1.0).sin() * (f * p.z + 2.0).sin();
            *p * (1.0 + 0.2 * waves(3.0) + 0.05 * waves(11.0) + 0.01 * waves(40.0))
        };
        let positions = ball.positions.iter().map(bump).collect();
        Mesh::new("bumpy", positions, Vec::new(), None, ball.triangles.clone()).unwrap()
    }

    /// What is drawn under any tolerance is a closed surface: what runs along an edge one way, runs along it the other
    /// way too.
    #[test]
    fn chunks_of_all_levels_fit_together() {
        for mesh in [bumpy(), generate::torus(1.0, 0.4, 120, 60)] {
            let unit = unit_positions(&mesh);
            let leveled = Leveled::new(&mesh).unwrap();
            let mut rng = fastrand::Rng::with_seed(5);
            let mut tolerances = [0.0, 1e-4, 1e-3, 1e-2, 0.1].map(Tolerance::Parallel).to_vec();
            for (away, i) in [2e-3, 0.1, 0.4, 1.0, 3.0, 8.0].into_iter().zip((0..unit.len()).step_by(unit.len() / 6)) {
                let vertex = unit[i];
                tolerances.push(Tolerance::capture(vertex + away * mesh.normals[i], [16, 64][rng.usize(..2)]));
            }
            let mut fewest = usize::MAX;
            for tolerance in tolerances {
                let triangles = leveled.drawn(tolerance);
                fewest = fewest.min(triangles.len());
                let place = |vertex: u32| unit[vertex as usize].to_array().map(f32::to_bits);
                let mut sides = HashMap::new();
                for [a, b, c] in triangles {
                    for (a, b) in [(a, b), (b, c), (c, a)] {
                        *sides.entry((place(a), place(b))).or_insert(0) += 1;
                    }
                }
                let whole = sides.iter().all(|((a, b), count)| sides.get(&(*b, *a)) == Some(count));
                assert!(whole, "{}: gaps under {tolerance:?}", mesh.name);
            }
            let all = leveled.drawn(Tolerance::Parallel(0.0));
            assert_eq!(all.len(), mesh.triangles.len(), "nothing may be missed");
            assert!(20 * fewest < mesh.triangles.len(), "{fewest} of {} triangles at least", mesh.triangles.len());
        }
    }
}
