//! The steps of every cluster, kept from frame to frame: a cluster is merged again only when its receiver, its list or an
//! entity on its list has changed since.
//!
//! What a cluster's merge reads is its receiver, its list and the entities on it, and nothing else that ever changes. So one
//! for which they are as before would give the same bits again.

use crate::layout::{self, Step};
use crate::render::gather::{self, Bounds, Chains, Counts, Moment, Pose};
use crate::scene::Placement;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ops::Range;

/// Neighbouring clusters that are gathered together: enough to share a walk through the tree, few enough to stay near.
const GROUP_CLUSTERS: usize = 32;

/// All that lists and merge depend on at one moment.
pub(super) struct State {
    /// For the lists.
    pub moment: Moment,
    /// Of every entity.
    pub poses: Vec<Pose>,
    /// As the device sees them.
    pub entities: Vec<layout::Entity>,
    /// From which all of the above follows.
    pub placements: Vec<Placement>,
}

/// Neighbouring clusters of one receiver.
struct Group {
    receiver: usize,
    clusters: Range<usize>,
    bounds: Bounds,
}

/// Clusters with their lists.
#[derive(Default)]
pub(super) struct Lists {
    /// All clusters, without their steps.
    pub clusters: Vec<layout::Cluster>,
    bounds: Vec<Bounds>,
    groups: Vec<Group>,
    steps: Vec<Vec<u32>>,
    now: Option<State>,
}

/// What a frame did about its clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Merged {
    /// Clusters of all receivers.
    pub clusters: usize,
    /// Those that were merged; the others kept their light.
    pub merged_clusters: usize,
    /// Lookups in the lists of those, one for 64 vertices.
    pub merged_steps: usize,
}

impl Lists {
    /// Adds the clusters of one receiver, neighbours beside each other.
    pub fn add(&mut self, receiver: usize, clusters: Vec<(layout::Cluster, Bounds)>) {
        let first = self.clusters.len();
        for (index, run) in clusters.chunks(GROUP_CLUSTERS).enumerate() {
            let start = first + index * GROUP_CLUSTERS;
            let bounds: Vec<Bounds> = run.iter().map(|(_, bounds)| *bounds).collect();
            let clusters = start..start + run.len();
            self.groups.push(Group { receiver, clusters, bounds: Bounds::union(&bounds) });
        }
        self.bounds.extend(clusters.iter().map(|(_, bounds)| *bounds));
        self.clusters.extend(clusters.into_iter().map(|(cluster, _)| cluster));
        self.steps.resize(self.clusters.len(), Vec::new());
    }

    /// Forgets what was merged: the next update takes every cluster.
    pub fn forget(&mut self) {
        self.now = None;
    }

    /// Keeps what the lists were brought to.
    pub fn keep(&mut self, now: State) {
        self.now = Some(now);
    }

    /// Entities as last kept.
    pub fn entities(&self) -> &[layout::Entity] {
        self.now.as_ref().map_or(&[], |now| &now.entities)
    }

    /// Brings the lists to this moment and returns the clusters to merge.
    pub fn update(&mut self, now: &State) -> Vec<usize> {
        let skip = now.moment.skip.unmoved;
        let before = self.now.take().filter(|before| skip && now.moment.is_like(&before.moment));
        let moved: Option<Moved<'_>> = before.as_ref().map(|before| Moved::new(before, now));
        if moved.as_ref().is_some_and(|moved| moved.list.is_empty()) {
            return Vec::new();
        }
        let found: Vec<Vec<(usize, Vec<u32>)>> =
            self.groups.par_iter().map(|group| self.regather(group, now, moved.as_ref())).collect();
        let mut dirty = Vec::new();
        for (cluster, steps) in found.into_iter().flatten() {
            self.steps[cluster] = steps;
            dirty.push(cluster);
        }
        dirty
    }

    /// Clusters of a group that must be merged again, with their lists.
    fn regather(&self, group: &Group, now: &State, moved: Option<&Moved<'_>>) -> Vec<(usize, Vec<u32>)> {
        let pose = &now.poses[group.receiver];
        let whole = moved.is_none_or(|moved| moved.flags[group.receiver]);
        let movers = match moved {
            Some(moved) if !whole => moved.near(now, pose, &group.bounds, &moved.list),
            _ => Vec::new(),
        };
        if !whole && movers.is_empty() {
            return Vec::new();
        }
        let chains = Chains::of_group(&now.moment, pose, &group.bounds);
        let mut out = Vec::new();
        for cluster in group.clusters.clone() {
            let bounds = &self.bounds[cluster];
            if let Some(moved) = moved
                && !whole
                && moved.near(now, pose, bounds, &movers).is_empty()
            {
                continue;
            }
            let mut steps = Vec::new();
            gather::steps(&now.moment, pose, bounds, &chains, &mut steps);
            let same = |moved: &Moved<'_>| steps == self.steps[cluster] && !moved.any_on(&steps);
            if whole || !moved.is_some_and(same) {
                out.push((cluster, steps));
            }
        }
        out
    }

    /// The steps of a cluster.
    pub fn steps(&self, cluster: usize) -> &[u32] {
        &self.steps[cluster]
    }

    /// What all lists of the last moment leave off, and why.
    pub fn counts(&self, state: &State) -> Counts {
        let of_group = |group: &Group| {
            let pose = &state.poses[group.receiver];
            let clusters = self.bounds[group.clusters.clone()].iter();
            clusters.fold(Counts::default(), |mut counts, bounds| {
                counts += gather::counts(&state.moment, pose, bounds);
                counts
            })
        };
        self.groups.par_iter().map(of_group).reduce(Counts::default, |mut a, b| {
            a += b;
            a
        })
    }

    /// Entities on the lists of a receiver's clusters at a moment.
    pub fn entities_on(&self, state: &State, receiver: usize) -> BTreeSet<usize> {
        let (mut steps, pose) = (Vec::new(), &state.poses[receiver]);
        for group in self.groups.iter().filter(|group| group.receiver == receiver) {
            let chains = Chains::of_group(&state.moment, pose, &group.bounds);
            let clusters = &self.bounds[group.clusters.clone()];
            clusters.iter().for_each(|bounds| gather::steps(&state.moment, pose, bounds, &chains, &mut steps));
        }
        steps.into_iter().map(|step| Step::entities(step)[0] as usize).collect()
    }

    /// Host memory of the lists, bytes.
    pub fn size_bytes(&self) -> u64 {
        let of_steps: usize = self.steps.iter().map(|steps| size_of::<Vec<u32>>() + 4 * steps.capacity()).sum();
        (of_steps + self.clusters.len() * (size_of::<layout::Cluster>() + size_of::<Bounds>())) as u64
    }
}

/// Entities that have changed.
struct Moved<'b> {
    before: &'b State,
    flags: Vec<bool>,
    list: Vec<usize>,
    /// So many that asking for each whether it matters costs more than gathering anew.
    most: bool,
}

impl<'b> Moved<'b> {
    fn new(before: &'b State, now: &State) -> Self {
        let same = |i: usize| {
            now.placements[i] == before.placements[i]
                && bytemuck::bytes_of(&now.entities[i]) == bytemuck::bytes_of(&before.entities[i])
                && now.moment.bodies[i] == before.moment.bodies[i]
        };
        let flags: Vec<bool> = (0..now.placements.len()).map(|i| !same(i)).collect();
        let list: Vec<usize> = (0..flags.len()).filter(|&i| flags[i]).collect();
        Moved { before, most: list.len() * 8 > flags.len().max(64), flags, list }
    }

    /// Those of `list` that may stand on the list of a cluster with these bounds, before or now; its receiver has not moved.
    fn near(&self, now: &State, pose: &Pose, bounds: &Bounds, list: &[usize]) -> Vec<usize> {
        if self.most {
            return list.to_vec();
        }
        let at = |moment: &Moment, j: usize| {
            let body = &moment.bodies[j];
            (body.occludes || body.emits) && gather::may_matter(moment, pose, bounds, body)
        };
        let near = |&j: &usize| j != pose.entity && (at(&self.before.moment, j) || at(&now.moment, j));
        list.iter().copied().filter(near).collect()
    }

    fn any_on(&self, steps: &[u32]) -> bool {
        let flag = |e: u32| self.flags.get(e as usize).copied().unwrap_or(false);
        steps.iter().any(|&step| Step::entities(step).into_iter().any(flag))
    }
}
