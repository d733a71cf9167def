//! A tree of spheres over the entities of a scene, so that a group of clusters finds those that matter to it without
//! looking at the rest.

use glam::{Vec3, Vec4};
use std::ops::Range;

/// Entities in a leaf: below this, looking at each costs less than another level.
const LEAF_ENTITIES: usize = 4;

/// Several entities as one: their centres lie within `reach_m` of `centre`, none is larger than `radius_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crowd {
    /// World, metres.
    pub centre: Vec3,
    pub reach_m: f32,
    pub radius_m: f32,
}

impl Crowd {
    pub fn of(sphere: Vec4) -> Self {
        Crowd { centre: sphere.truncate(), reach_m: 0.0, radius_m: sphere.w }
    }

    pub fn around(spheres: impl Iterator<Item = Vec4> + Clone) -> Self {
        let places = spheres.clone().map(Vec4::truncate);
        let (low, high) = places
            .clone()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| (low.min(place), high.max(place)));
        let centre = low.midpoint(high);
        let reach_m = places.map(|p| p.as_dvec3().distance_squared(centre.as_dvec3())).fold(0.0, f64::max).sqrt();
        Crowd {
            centre,
            // Rounding must not make it smaller.
            reach_m: (reach_m * (1.0 + 1e-6)) as f32,
            radius_m: spheres.map(|sphere| sphere.w).fold(0.0, f32::max),
        }
    }
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
    /// A tree over the given entities: index, and sphere of centre and radius.
    pub fn new(entities: impl Iterator<Item = (u32, Vec4)>) -> Self {
        let mut entities: Vec<(u32, Vec4)> = entities.collect();
        let mut tree = Tree::default();
        if !entities.is_empty() {
            let count = entities.len();
            tree.split(&mut entities, 0..count);
        }
        tree.members = entities.iter().map(|entity| entity.0).collect();
        tree
    }

    fn split(&mut self, entities: &mut [(u32, Vec4)], members: Range<usize>) {
        let of = &mut entities[members.clone()];
        let crowd = Crowd::around(of.iter().map(|entity| entity.1));
        let at = self.nodes.len();
        let leaf = of.len() <= LEAF_ENTITIES;
        self.nodes.push(Node { crowd, members: members.clone(), next: 0, leaf });
        if !leaf {
            let along = |axis: usize| {
                let (low, high) = of.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), entity| {
                    (low.min(entity.1[axis]), high.max(entity.1[axis]))
                });
                high - low
            };
            let axis = (0..3).max_by(|&a, &b| along(a).total_cmp(&along(b))).unwrap_or(0);
            let middle = of.len() / 2;
            of.select_nth_unstable_by(middle, |a, b| a.1[axis].total_cmp(&b.1[axis]));
            self.split(entities, members.start..members.start + middle);
            self.split(entities, members.start + middle..members.end);
        }
        self.nodes[at].next = self.nodes.len();
    }

    /// The entities in no crowd that `leave` leaves out, in no order.
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
