//! Runs of vertices at rest as a tree, of which what moves sees a cut: small pieces nearby, large ones far away.
//!
//! A cluster of vertices sees near pieces vertex by vertex, and far ones from its middle, as SH for all its vertices.

use crate::bake::links;
use crate::field::visibility_volume::SceneVolume;
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// A run is opened where it is larger than this share of its distance.
const MOST_RADIUS: f32 = 0.8;
/// A run whose normals point all ways, so that their sum has less than this share of its area, is opened where it takes
/// more than [`LEAST_SHARE`] of the view.
const FLAT: f32 = 0.7;
const LEAST_SHARE: f32 = 0.005;
/// From this share of either bound on, the parts of a run fade in, so that no light jumps where a cut changes.
const FADE: f32 = 0.85;
/// A run nearer to a cluster than so many of the cluster's radii is seen by each of its vertices, and from the second
/// on by its middle alone.
const NEAR: [f32; 2] = [1.5, 2.0];
/// A mover is seen from the middle of a cluster where its bounding sphere is farther off than so many of the cluster's
/// radii, and its centre than so many of its own.
const DISTANT_CLUSTERS: [f32; 2] = [1.0, 1.5];
const DISTANT_RADII: [f32; 2] = [1.5, 2.0];
/// A smaller weight is left out.
const LEAST_WEIGHT: f32 = 1e-4;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct FarRun {
    /// Middle, world, metres, and how far its vertices lie from there.
    pub middle: Vec3,
    pub radius_m: f32,
    /// Sum of its normals times their areas, m^2, and the sum of the areas.
    pub across: Vec3,
    pub area_m2: f32,
    /// Numbers of the runs that it consists of.
    pub parts: Range<u32>,
}

impl FarRun {
    /// As devices read it: middle, and whether it rests; mean normal, and the area that faces that way.
    pub fn quads(&self) -> [[f32; 4]; 2] {
        let area = self.across.length();
        let rests = f32::from(u8::from(self.area_m2 > 0.0));
        [self.middle.extend(rests).to_array(), (self.across / area.max(1e-20)).extend(area).to_array()]
    }
}

/// All runs of a scene, by number; those that do not rest have no area.
#[derive(Default)]
pub struct FarRuns {
    pub runs: Vec<FarRun>,
    /// The largest runs at rest.
    pub roots: Vec<u32>,
    /// What tells which of them are seen from where; all are where there is none.
    pub volume: Option<Arc<SceneVolume>>,
}

/// What a cluster sees of all that rests: runs below their weights, packed as links are.
#[derive(Default)]
pub struct Cut {
    /// For each of its vertices.
    pub near: Vec<u32>,
    /// For its middle.
    pub far: Vec<u32>,
}

impl FarRuns {
    pub fn cut(&self, centre: Vec3, radius_m: f32) -> Cut {
        let mut cut = Cut::default();
        self.roots.iter().for_each(|&root| self.cut_below(root, 1.0, (centre, radius_m), &mut cut));
        cut
    }

    /// How much of what stands at a target is seen from a place.
    fn seen(&self, place: Vec3, target: Vec3) -> f32 {
        let sees = |volume: &Arc<SceneVolume>| volume.volume.sees(place.as_dvec3(), target.as_dvec3()) as f32;
        self.volume.as_ref().map_or(1.0, sees)
    }

    fn cut_below(&self, number: u32, weight: f32, eye: (Vec3, f32), out: &mut Cut) {
        let run = &self.runs[number as usize];
        let across = run.across.length();
        let (centre, radius_m) = eye;
        // All of a flat piece faces away.
        if across > 0.98 * run.area_m2
            && run.across.dot(centre - run.middle) < -across * (radius_m + 0.2 * run.radius_m)
        {
            return;
        }
        let gap = (run.middle.distance(centre) - radius_m).max(1e-6);
        let round = if across < FLAT * run.area_m2 { (run.area_m2 / LEAST_SHARE).sqrt() } else { 0.0 };
        let size = (run.radius_m / MOST_RADIUS).max(round) / gap;
        let opened = if run.parts.is_empty() { 0.0 } else { fade(size, [FADE, 1.0]) };
        if run.area_m2 > 0.0 && opened < 1.0 {
            let near = 1.0 - fade(gap / radius_m, NEAR);
            let seen = weight * (1.0 - opened) * self.seen(centre, run.middle);
            out.near.extend(pack(seen * near, number));
            out.far.extend(pack(seen * (1.0 - near), number));
        }
        if opened > 0.0 {
            run.parts.clone().for_each(|part| self.cut_below(part, weight * opened, eye, out));
        }
    }
}

/// A number below a weight of 0 to 1; `None` where it is too small to matter.
pub fn pack(weight: f32, number: u32) -> Option<u32> {
    if weight < LEAST_WEIGHT { None } else { links::pack(weight, number) }
}

/// How much of a mover, whose centre is `distance_m` from the middle of a cluster, is seen from there, and not from each
/// vertex: 0 to 1.
pub fn distant(distance_m: f64, radius_m: f64, cluster_radius_m: f64) -> f32 {
    let gap = (distance_m - radius_m) / cluster_radius_m.max(1e-15);
    let clear = fade(gap as f32, DISTANT_CLUSTERS);
    clear * fade((distance_m / radius_m) as f32, DISTANT_RADII)
}

fn fade(x: f32, [from, to]: [f32; 2]) -> f32 {
    ((x - from) / (to - from)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_stands_for_every_smallest_run_once() {
        // Four large runs of four, along x, 1 m each.
        let run = |x: f32, width: f32, parts| FarRun {
            middle: Vec3::X * x,
            radius_m: width / 2.0,
            across: Vec3::Y * width,
            area_m2: width,
            parts,
        };
        let large = (0..4).map(|i| run(i as f32 + 0.5, 1.0, 4 + 4 * i..8 + 4 * i));
        let small = (0..16).map(|i| run((i as f32 + 0.5) / 4.0, 0.25, 0..0));
        let tree = FarRuns { runs: large.chain(small).collect(), roots: (0..4).collect(), volume: None };
        let mut sizes = Vec::new();
        for (x, radius) in [(0.3, 0.1), (-0.6, 0.05), (1.7, 0.0), (20.0, 1.0), (-1.2, 0.2), (0.5, 9.0)] {
            let Cut { near, far } = tree.cut(Vec3::new(x, 0.1, 0.0), radius);
            let mut covered = [0.0; 16];
            for entry in near.iter().chain(&far) {
                let (number, weight) = links::unpack(*entry);
                let under = tree.runs[number].parts.clone();
                let leaves = if under.is_empty() { number as u32..number as u32 + 1 } else { under };
                leaves.for_each(|leaf| covered[leaf as usize - 4] += f64::from(weight));
            }
            assert!(covered.iter().all(|weight| (weight - 1.0).abs() < 4e-3), "{x}: {covered:?}");
            sizes.push([near.len(), far.len()]);
        }
        assert_eq!([sizes[3], sizes[5]], [[0, 4], [16, 0]], "all large from afar, all small from within");
        let [near, far] = sizes[0];
        assert!(near > 0 && far > 0 && near + far < 16, "{sizes:?}");
    }
}
