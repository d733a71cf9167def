//! A tree of spheres over the bodies of a scene, so that a group of clusters finds those that matter to it without looking at
//! the rest.

use glam::DVec3;
use std::ops::Range;

/// Bodies in a leaf: below this, looking at each costs less than another level.
const LEAF_BODIES: usize = 4;

/// Several bodies as one: their centres lie within `reach_m` of `centre`, none is larger than `radius_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crowd {
    /// World, metres.
    pub centre: DVec3,
    /// Metres.
    pub reach_m: f64,
    /// Largest bounding radius, metres.
    pub radius_m: f64,
}

/// A node: what it holds, its members, and the node that follows where it is left out.
struct Node {
    crowd: Crowd,
    members: Range<usize>,
    next: usize,
    leaf: bool,
}

/// The tree. Nodes stand in the order of a walk.
#[derive(Default)]
pub struct Tree {
    nodes: Vec<Node>,
    members: Vec<u32>,
}

impl Tree {
    /// A tree over the given bodies: index, centre and radius in metres.
    pub fn new(bodies: impl Iterator<Item = (usize, DVec3, f64)>) -> Self {
        let mut bodies: Vec<(usize, DVec3, f64)> = bodies.collect();
        let mut tree = Tree::default();
        if !bodies.is_empty() {
            let count = bodies.len();
            tree.split(&mut bodies, 0..count);
        }
        tree.members = bodies.iter().map(|body| body.0 as u32).collect();
        tree
    }

    fn split(&mut self, bodies: &mut [(usize, DVec3, f64)], members: Range<usize>) {
        let of = &mut bodies[members.clone()];
        let (low, high) = of
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), body| (low.min(body.1), high.max(body.1)));
        let centre = (low + high) / 2.0;
        let crowd = Crowd {
            centre,
            reach_m: of.iter().map(|body| body.1.distance(centre)).fold(0.0, f64::max),
            radius_m: of.iter().map(|body| body.2).fold(0.0, f64::max),
        };
        let at = self.nodes.len();
        let leaf = of.len() <= LEAF_BODIES;
        self.nodes.push(Node { crowd, members: members.clone(), next: 0, leaf });
        if !leaf {
            let axis = (high - low).max_position();
            let middle = of.len() / 2;
            of.select_nth_unstable_by(middle, |a, b| a.1[axis].total_cmp(&b.1[axis]));
            self.split(bodies, members.start..members.start + middle);
            self.split(bodies, members.start + middle..members.end);
        }
        self.nodes[at].next = self.nodes.len();
    }

    /// The bodies in no crowd that `leave` leaves out, in no order.
    pub fn find(&self, leave: impl Fn(&Crowd) -> bool, mut found: impl FnMut(u32)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let left = leave(&node.crowd);
            if node.leaf && !left {
                self.members[node.members.clone()].iter().for_each(|&member| found(member));
            }
            at = if left { node.next } else { at + 1 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_a_look_at_each_finds() {
        let mut rng = fastrand::Rng::with_seed(11);
        for count in [0, 1, 4, 5, 300] {
            let point = |rng: &mut fastrand::Rng| DVec3::new(rng.f64(), rng.f64(), rng.f64());
            let bodies: Vec<(usize, DVec3, f64)> = (0..count).map(|i| (i, point(&mut rng), 0.1 * rng.f64())).collect();
            let tree = Tree::new(bodies.iter().copied());
            let mut visited = 0;
            for _ in 0..20 {
                let (eye, reach) = (point(&mut rng), 0.3 * rng.f64());
                let far = |centre: DVec3, radius: f64| centre.distance(eye) - radius > reach;
                let mut found = Vec::new();
                tree.find(|crowd| far(crowd.centre, crowd.reach_m + crowd.radius_m), |body| found.push(body as usize));
                visited += found.len();
                for (index, centre, radius) in &bodies {
                    assert!(far(*centre, *radius) || found.contains(index), "{index} of {count}");
                }
                found.sort_unstable();
                assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "found twice");
            }
            assert!(count < 300 || visited < 20 * count / 2, "the tree leaves nothing out: {visited}");
        }
    }
}
