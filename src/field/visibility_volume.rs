//! What all that rests blocks together, at nodes of a box in which other things move.
//!
//! Between walls a chain of single fields lets too much light through: each wall blocks up to half of the view, and
//! every product is cut to a few bands. What moves there reads all of it in one lookup instead.

use super::lattice::Corners;
use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count};
use glam::{DVec3, UVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

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
        let depth = self.nodes.depth(position).clamp(0.0, 1.0);
        (depth * depth * (3.0 - 2.0 * depth), out)
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

    /// A linear function comes back as it is, and counts in full wherever the box was wanted.
    #[test]
    fn nodes_are_interpolated() {
        let wanted = [DVec3::new(-1.0, 0.5, 2.0), DVec3::new(1.0, 0.9, 7.0)];
        let nodes = NodeBox::around(wanted, 500);
        assert!(nodes.count() <= 500 && nodes.count() > 200, "{nodes:?}");
        let value = |p: DVec3| [0.3 + p.dot(DVec3::new(0.1, -0.2, 0.3)), p.x, p.y, p.z];
        let blocked = (0..nodes.count()).flat_map(|i| value(nodes.node(i as u32)).map(|v| v as f32)).collect();
        let volume = VisibilityVolume { nodes, stride: 4, blocked };
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
}
