//! Bakes the visibility volume of a group at rest, by rays on all cores.

use super::own_visibility::sphere;
use super::surfaces::{BURIED_BACKS, BURIED_BLOCKED, Group, GroupPlan};
use super::{BakeReport, Progress};
use crate::field::quantity::channel_stride;
use crate::field::visibility_volume::{DEPTHS, NodeBox, VisibilityVolume, depth_texel};
use crate::sh::basis::coefficient_count;
use glam::{DVec3, Mat3A, UVec3, Vec3A};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Counts in every name of the cache: another number where a bake computes something else.
const VERSION: u32 = 3;
/// Most nodes of a volume.
const NODES: u32 = 10_000;
/// So many members, each of which takes [`LEAST`] of the view, are seen on average where a volume is of use. Sky alone,
/// relative RMS of what moves by single fields and by the volume: between walls (6 to 8 members) 0.20 to 0.46 and 0.05 to
/// 0.08, in a garden (5) 0.06 and 0.025, past a post and a teapot on a floor (2) 0.012 and 0.020.
const CROWD: f64 = 4.0;
/// It is of use too where so much of the view is blocked: there walls hide what lights what moves.
const ENCLOSED: f64 = 0.7;
const LEAST: f64 = 0.01;
/// One node in so many tells whether it is.
const PROBE: usize = 29;

/// A volume as it is to be baked.
#[derive(Clone, Debug)]
pub struct VolumePlan {
    pub nodes: NodeBox,
    bands: usize,
    /// Name in the cache.
    pub key: String,
}

impl VolumePlan {
    /// In a group of that name, around a box of the world in which things up to that radius move. `None` where nodes
    /// would be farther apart than that, as along a road through a town: then fields know more of what is near.
    pub fn new(group: &str, wanted: [DVec3; 2], radius_m: f64, bands: usize) -> Option<Self> {
        let nodes = NodeBox::around(wanted, NODES);
        if f64::from(nodes.step_m) > radius_m {
            return None;
        }
        let numbers = format!("{VERSION} {CROWD} {ENCLOSED} {LEAST} {PROBE} {bands} {nodes:?} {group}");
        Some(VolumePlan { nodes, bands, key: blake3::hash(numbers.as_bytes()).to_hex()[..32].to_owned() })
    }
}

#[derive(Clone)]
struct Node {
    blocked: Vec<f32>,
    depths: Vec<f32>,
    /// How many members take [`LEAST`] of its view.
    crowd: usize,
    /// Share of its view that is blocked.
    enclosed: f64,
    buried: bool,
}

impl GroupPlan {
    /// What the group blocks at every node; nothing where fields serve as well.
    pub fn bake_volume(&self, plan: &VolumePlan, progress: Progress<'_>) -> (VisibilityVolume, BakeReport) {
        let started = Instant::now();
        let group = Group::new(self);
        // The same rays leave every node, so that what is left of their error is smooth.
        let rays = sphere();
        let toward: Vec<Vec3A> = rays.iter().map(|ray| ray.local).collect();
        let texels: Vec<usize> = toward.iter().map(|ray| depth_texel(ray.as_dvec3())).collect();
        let blocks = self.occluders();
        let stride = channel_stride(plan.bands);
        let coefficients = coefficient_count(plan.bands);
        let look = |number: u32| {
            let origin = group.place(plan.nodes.node(number));
            let hits = group.blockers.first(origin, &Mat3A::IDENTITY, &toward, &blocks);
            let mut blocked = vec![0.0; stride];
            let mut met = vec![0; blocks.len()];
            let mut behind = 0;
            let mut depths = vec![0.0_f32; DEPTHS];
            for ((ray, texel), hit) in rays.iter().zip(&texels).zip(&hits) {
                let depth = hit.as_ref().map_or(f32::MAX, |hit| group.metres(hit.distance));
                depths[*texel] = depths[*texel].max(depth);
                let Some(hit) = hit else { continue };
                blocked[..coefficients].iter_mut().zip(&ray.share).for_each(|(sum, share)| *sum += share);
                met[hit.member as usize] += 1;
                behind += usize::from(hit.from_behind);
            }
            let share = |met: usize| met as f64 / rays.len() as f64;
            let enclosed = share(met.iter().sum());
            let buried = enclosed > BURIED_BLOCKED && share(behind) > BURIED_BACKS * enclosed;
            let crowd = met.into_iter().filter(|met| share(*met) >= LEAST).count();
            Node { blocked, depths, crowd, enclosed, buried }
        };
        let count = plan.nodes.count();
        let probed: Vec<Node> = (0..count as u32).into_par_iter().step_by(PROBE).map(look).collect();
        let free: Vec<&Node> = probed.iter().filter(|node| !node.buried).collect();
        let mean = |of: &dyn Fn(&Node) -> f64| free.iter().map(|node| of(node)).sum::<f64>() / free.len().max(1) as f64;
        let report =
            |samples: usize| BakeReport { samples: samples as u32, total: started.elapsed(), ..Default::default() };
        let volume = |blocked, depths| VisibilityVolume { nodes: plan.nodes, stride, blocked, depths };
        if mean(&|node| node.crowd as f64) < CROWD && mean(&|node| node.enclosed) < ENCLOSED {
            return (volume(Vec::new(), Vec::new()), report(probed.len()));
        }
        let mut nodes: Vec<Node> = Vec::with_capacity(count);
        let row = plan.nodes.counts.x * plan.nodes.counts.y;
        for first in (0..count as u32).step_by(row as usize) {
            nodes.par_extend((first..first + row).into_par_iter().map(look));
            progress(nodes.len() as u32, count as u32);
        }
        fill(&mut nodes, plan.nodes.counts);
        let depths = nodes.iter().flat_map(|node| node.depths.iter().copied()).collect();
        let blocked = nodes.into_iter().flat_map(|node| node.blocked).collect();
        (volume(blocked, depths), report(count))
    }
}

/// Gives buried nodes the mean of their neighbours that are not, and the largest depths, from the surface inwards.
fn fill(nodes: &mut [Node], counts: UVec3) {
    let strides = [1, counts.x as usize, (counts.x * counts.y) as usize];
    let beside = |i: usize| {
        strides.into_iter().zip(counts.to_array()).flat_map(move |(stride, count)| {
            let at = i / stride % count as usize;
            [(at > 0).then(|| i - stride), (at + 1 < count as usize).then(|| i + stride)].into_iter().flatten()
        })
    };
    loop {
        let mean = |i: usize| {
            let free: Vec<&Node> = beside(i).map(|other| &nodes[other]).filter(|other| !other.buried).collect();
            let sum = |k: usize| free.iter().map(|node| node.blocked[k]).sum::<f32>() / free.len() as f32;
            let blocked = || (0..nodes[i].blocked.len()).map(sum).collect();
            let farthest = |texel: usize| free.iter().map(|node| node.depths[texel]).fold(0.0, f32::max);
            let depths = || (0..DEPTHS).map(farthest).collect();
            (!free.is_empty())
                .then(|| (i, Node { blocked: blocked(), depths: depths(), crowd: 0, enclosed: 0.0, buried: false }))
        };
        let buried = (0..nodes.len()).filter(|&i| nodes[i].buried);
        let filled: Vec<(usize, Node)> = buried.filter_map(mean).collect();
        if filled.is_empty() {
            return;
        }
        filled.into_iter().for_each(|(i, node)| nodes[i] = node);
    }
}

/// How a volume is kept in the cache; its coefficients are the payload, and all else follows from the plan.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredVolume {
    key: String,
}

impl VolumePlan {
    pub(super) fn store(&self, volume: &VisibilityVolume) -> (StoredVolume, Vec<u8>) {
        let floats = [&volume.blocked[..], &volume.depths].concat();
        (StoredVolume { key: self.key.clone() }, bytemuck::cast_slice(&floats).to_vec())
    }

    /// What header and payload hold; `None` where they hold something else.
    pub(super) fn restore(&self, header: &StoredVolume, payload: &[u8]) -> Option<VisibilityVolume> {
        let nodes = self.nodes;
        let stride = channel_stride(self.bands);
        let floats: Vec<f32> = bytemuck::pod_collect_to_vec(payload);
        let fits = floats.is_empty() || floats.len() == nodes.count() * (stride + DEPTHS);
        let (blocked, depths) = floats.split_at_checked(floats.len() / (stride + DEPTHS) * stride)?;
        let volume = || VisibilityVolume { nodes, stride, blocked: blocked.to_vec(), depths: depths.to_vec() };
        (header.key == self.key && fits).then(volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_stand_closer_than_what_moves_is_large() {
        let along = |length_m: f64| [DVec3::ZERO, DVec3::new(length_m, 1.0, 3.0)];
        let plan = VolumePlan::new("room", along(5.0), 0.3, 4).expect("a volume");
        assert!(plan.nodes.step_m < 0.3 && plan.nodes.count() <= NODES as usize);
        assert!(VolumePlan::new("road", along(1000.0), 0.3, 4).is_none());
        assert_ne!(plan.key, VolumePlan::new("hall", along(5.0), 0.3, 4).expect("a volume").key);
    }
}
