//! What all that rests blocks together, at nodes of a box in which other things move.
//!
//! Between walls a chain of single fields lets too much light through: each wall blocks up to half of the view, and
//! every product is cut to a few bands. What moves there reads all of it in one lookup instead. How far the nodes see in
//! each direction tells what moves which surfaces it sees.

use super::lattice::Corners;
use super::octahedron;
use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count};
use glam::{DVec3, UVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Texels along a side of a node's map of depths.
const DEPTH_SIDE: usize = 8;
/// Texels of the map.
pub const DEPTHS: usize = DEPTH_SIDE * DEPTH_SIDE;
/// Beyond so many depths of a texel nothing is seen, and all up to a depth: what lies on a surface that a texel shows may
/// be farther off than its farthest ray came.
const HIDDEN_FROM: f64 = 1.25;

/// The texel of a direction on a node's map of depths.
pub fn depth_texel(direction: DVec3) -> usize {
    let [x, y] = (octahedron::place(direction) * DEPTH_SIDE as f64).to_array().map(|at| at as usize);
    y.min(DEPTH_SIDE - 1) * DEPTH_SIDE + x.min(DEPTH_SIDE - 1)
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeBox {
    /// The first node in the world, metres.
    pub low: Vec3,
    /// Distance between neighbours, metres.
    pub step_m: f32,
    /// How many there are along each axis, at least 4; those along x are neighbours.
    pub counts: UVec3,
}

impl NodeBox {
    /// At most `limit` nodes around a box of the world, with one step of them to spare on every side.
    pub fn around([low, high]: [DVec3; 2], limit: u32) -> Self {
        let size = (high - low).max(DVec3::splat(1e-3 * (high - low).max_element().max(1e-6)));
        let counts = |step_m: f64| (size / step_m).ceil().as_uvec3() + 3;
        let mut step_m = (size.element_product() / f64::from(limit)).cbrt();
        while counts(step_m).element_product() > limit {
            step_m *= 1.02;
        }
        NodeBox { low: (low - step_m).as_vec3(), step_m: step_m as f32, counts: counts(step_m) }
    }

    pub fn count(&self) -> usize {
        self.counts.element_product() as usize
    }

    /// The place of a node, by its number, in the world.
    pub fn node(&self, number: u32) -> DVec3 {
        let UVec3 { x, y, .. } = self.counts;
        let at = UVec3::new(number % x, number / x % y, number / (x * y));
        self.low.as_dvec3() + at.as_dvec3() * f64::from(self.step_m)
    }

    /// A place of the world in steps from the first node.
    fn at(&self, position: DVec3) -> DVec3 {
        (position - self.low.as_dvec3()) / f64::from(self.step_m)
    }

    fn last(&self) -> DVec3 {
        self.counts.as_dvec3() - 1.0
    }

    /// How far a place lies within the box, in steps; negative outside.
    pub fn depth(&self, position: DVec3) -> f64 {
        let at = self.at(position);
        at.min(self.last() - at).min_element()
    }

    fn corners(&self, position: DVec3) -> Corners {
        let at = self.at(position).clamp(DVec3::ZERO, self.last());
        let UVec3 { x, y, z } = self.counts;
        Corners::new(0, [(at.x, x - 1, 1), (at.y, y - 1, x), (at.z, z - 1, x * y)])
    }
}

/// The blocked part of the view at every node.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibilityVolume {
    pub nodes: NodeBox,
    /// Floats of one node.
    pub stride: usize,
    /// SH coefficients in the world's frame, node by node; empty where a chain of fields serves as well.
    pub blocked: Vec<f32>,
    /// [`DEPTHS`] of each node, metres: how far the farthest ray of a texel came, [`f32::MAX`] where one met nothing.
    pub depths: Vec<f32>,
}

impl VisibilityVolume {
    /// The blocked part at a place, and how much it counts there: all of it but within a step of the box's sides. The
    /// twin of `take_volume` in `glsl/merge.comp`.
    pub fn lookup(&self, position: DVec3, bands: usize) -> (f64, [f64; MAX_COEFFICIENTS]) {
        let mut out = [0.0; MAX_COEFFICIENTS];
        let Corners { index, weight } = self.nodes.corners(position);
        for (index, weight) in index.into_iter().zip(weight) {
            let node = &self.blocked[index as usize * self.stride..][..coefficient_count(bands)];
            out.iter_mut().zip(node).for_each(|(sum, b)| *sum += weight * f64::from(*b));
        }
        (self.counts_at(position), out)
    }

    fn counts_at(&self, position: DVec3) -> f64 {
        let depth = self.nodes.depth(position).clamp(0.0, 1.0);
        depth * depth * (3.0 - 2.0 * depth)
    }

    /// How much of what stands at a target the nodes around a position see, 0 to 1.
    pub fn sees(&self, position: DVec3, target: DVec3) -> f64 {
        let Corners { index, weight } = self.nodes.corners(position);
        let of_node = |(node, weight): (u32, f64)| {
            let to = target - self.nodes.node(node);
            let depth = f64::from(self.depths[node as usize * DEPTHS + depth_texel(to)]);
            weight * ((HIDDEN_FROM - to.length() / depth.max(1e-9)) / (HIDDEN_FROM - 1.0)).clamp(0.0, 1.0)
        };
        let seen: f64 = index.into_iter().zip(weight).map(of_node).sum();
        1.0 + self.counts_at(position) * (seen - 1.0)
    }
}

/// A volume among the entities of a scene.
#[derive(Clone, Debug)]
pub struct SceneVolume {
    pub volume: Arc<VisibilityVolume>,
    /// Of every entity whether the volume has its shadow.
    pub has: Vec<bool>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sh::quadrature::even_directions;

    /// A linear function comes back as it is, and counts in full wherever the box was wanted.
    #[test]
    fn nodes_are_interpolated() {
        let wanted = [DVec3::new(-1.0, 0.5, 2.0), DVec3::new(1.0, 0.9, 7.0)];
        let nodes = NodeBox::around(wanted, 500);
        assert!(nodes.count() <= 500 && nodes.count() > 200, "{nodes:?}");
        let value = |p: DVec3| [0.3 + p.dot(DVec3::new(0.1, -0.2, 0.3)), p.x, p.y, p.z];
        let blocked = (0..nodes.count()).flat_map(|i| value(nodes.node(i as u32)).map(|v| v as f32)).collect();
        let volume = VisibilityVolume { nodes, stride: 4, blocked, depths: Vec::new() };
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            let place = DVec3::from_array(std::array::from_fn(|_| rng.f64()));
            let place = wanted[0] + place * (wanted[1] - wanted[0]);
            let (share, found) = volume.lookup(place, 2);
            assert_eq!(share, 1.0);
            value(place).iter().zip(found).for_each(|(a, b)| assert!((a - b).abs() < 1e-5, "{a} {b}"));
        }
        let beside = nodes.low.as_dvec3() - DVec3::X;
        assert_eq!(volume.lookup(beside, 2).0, 0.0);
    }

    /// Before a wall, nodes see what stands on their side of it and the wall itself, and nothing behind it.
    #[test]
    fn nothing_is_seen_through_a_wall() {
        const WALL_X: f64 = 1.0;
        let nodes = NodeBox::around([DVec3::new(-1.0, 0.0, 0.0), DVec3::new(0.7, 2.0, 2.0)], 200);
        let depth = |from: DVec3, ray: DVec3| if ray.x > 1e-9 { ((WALL_X - from.x) / ray.x) as f32 } else { f32::MAX };
        let mut depths = vec![0.0_f32; nodes.count() * DEPTHS];
        for node in 0..nodes.count() {
            let from = nodes.node(node as u32);
            for ray in even_directions(512) {
                let texel = &mut depths[node * DEPTHS + depth_texel(ray)];
                *texel = texel.max(depth(from, ray));
            }
        }
        let volume = VisibilityVolume { nodes, stride: 4, blocked: Vec::new(), depths };
        let mut rng = fastrand::Rng::with_seed(4);
        let mut means = [0.0; 3];
        for _ in 0..300 {
            let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
            let place = DVec3::new(within(-0.9, 0.6), within(0.1, 1.9), within(0.1, 1.9));
            for (mean, x) in means.iter_mut().zip([-0.5, WALL_X, 2.5]) {
                let target = DVec3::new(x, within(0.0, 2.0), within(0.0, 2.0));
                *mean += volume.sees(place, target) / 300.0;
            }
        }
        let [before, on, behind] = means;
        assert!(before > 0.999 && on > 0.93 && behind < 0.05, "{means:?}");
    }
}
