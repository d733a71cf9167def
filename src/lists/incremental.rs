//! Which clusters a frame merges, and their entries: a cluster is merged again only when its receiver or an entity that
//! stands on its list, before or after the change, has changed.
//!
//! What a cluster's merge reads is its receiver, its list and the entities on it, and nothing else that ever changes;
//! and what keeps an entity on or off a list is that entity, the receiver and, for an occluder, a light that stands
//! there itself. So a cluster for which none of these has changed would come to the same bits again.

use crate::layout::{self, DeviceEntity, ENTRY_ENTITIES, ListEntry, OWN_MAPS};
use crate::lists::far::{self, Cut, FarRuns};
use crate::lists::gather::{self, Candidates, ClusterBounds, GROUP_CLUSTERS, SceneBounds};
use crate::lists::scope::Scope;
use crate::lists::sight::{Sight, TriangleRun};
use crate::scene::Placement;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// All that cluster lists and merge depend on at one time.
pub(crate) struct State {
    pub scene_bounds: SceneBounds,
    /// The entities as shaders read them, and then the boxes of some of them.
    pub entities: Vec<DeviceEntity>,
    /// Where the entities are; all of the above follows from this.
    pub placements: Vec<Placement>,
}

/// Neighbouring clusters of one receiver.
struct WatchedGroup {
    receiver: usize,
    clusters: Range<usize>,
    bounds: ClusterBounds,
}

/// Clusters of one group that are to be merged.
pub(crate) struct Dirty {
    group: usize,
    pub clusters: Vec<usize>,
}

pub(crate) struct Member {
    /// The cluster; its list follows separately.
    pub cluster: layout::Cluster,
    pub bounds: ClusterBounds,
    /// The triangles by which its light is seen.
    pub faces: TriangleRun,
    /// Entities whose shadows of sharp lights are in its own maps.
    pub near: Vec<u32>,
    /// Whether the maps of a cluster beside it, of whose vertices its triangles may have some, have others.
    pub differs: bool,
}

/// The clusters of all receivers, and which of them have changed since they were merged.
#[derive(Default)]
pub(crate) struct ClusterLists {
    threads: usize,
    pub members: Vec<Member>,
    groups: Vec<WatchedGroup>,
    now: Option<State>,
    /// Every cluster has changed since the last update by something that no [`State`] holds, as the sky.
    pub renewed: bool,
}

/// Words before the runs of a list of [`ClusterLists::reflectors`].
pub(crate) const CUT_HEADER: usize = 9;

/// Most pairs of a cluster and a mover that it sees from afar: 40 MB for each frame in flight, and a dispatch that every
/// device takes.
const MOST_PAIRS: usize = 1 << 20;

/// From which entities light bounces onto those of other groups.
pub(crate) struct Reflectors<'r, I> {
    pub movers: I,
    /// Of every entity, whether it has a field by which others see it.
    pub reflects: &'r [bool],
    /// Whether it never moves.
    pub rests: &'r [bool],
    /// Those that hide links between what rests.
    pub boxes: &'r [usize],
    /// All that rests, as what moves sees it.
    pub far: &'r FarRuns,
}

/// What light bounces from onto all clusters: see [`ClusterLists::reflectors`].
#[derive(Default)]
pub(crate) struct Reflected {
    /// The clusters, which know their place among the entries.
    pub clusters: Vec<layout::Cluster>,
    pub entries: Vec<u32>,
    /// A cluster and an entity below its weight, for each that is seen from afar.
    pub pairs: Vec<[u32; 2]>,
    /// The cuts of whole entities that move: first entry and how many.
    pub cuts: Vec<[u32; 2]>,
}

/// What one cluster sees of others.
struct Sighted {
    middle: Vec3,
    cut: Cut,
    near: Vec<u32>,
    distant: Vec<u32>,
    /// How many of either begin the list because they hide links.
    boxes: [usize; 2],
}

/// What a frame did about its clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Merged {
    pub clusters: usize,
    /// Clusters that were merged; the others kept their light.
    pub merged_clusters: usize,
    /// Lookups in the lists of those, one for 64 vertices.
    pub merged_entries: usize,
}

impl ClusterLists {
    /// None yet. `threads` is among how many threads the device divides the workgroups of a dispatch, each its run of
    /// neighbours, as llvmpipe does; 1 where it hands them out one by one.
    pub fn new(threads: usize) -> Self {
        ClusterLists { threads, ..ClusterLists::default() }
    }

    /// Adds the clusters of one receiver, neighbours beside each other.
    pub fn add(&mut self, receiver: usize, members: Vec<Member>) {
        let first = self.members.len();
        let all: Vec<ClusterBounds> = members.iter().map(|member| member.bounds).collect();
        let mut start = 0;
        while start < all.len() {
            let mut end = start + 1;
            while end < all.len() && end - start < GROUP_CLUSTERS && gather::compact(&all[start..=end]) {
                end += 1;
            }
            let clusters = first + start..first + end;
            self.groups.push(WatchedGroup { receiver, clusters, bounds: ClusterBounds::union(&all[start..end]) });
            start = end;
        }
        self.members.extend(members);
    }

    /// Says of each cluster of the receiver that was added last which entities' shadows its maps have. The corners of a
    /// triangle are at most `side_m` apart, in the mesh's frame.
    pub fn set_near(&mut self, near: Vec<Vec<u32>>, side_m: f32) {
        let first = self.members.len() - near.len();
        let members = &mut self.members[first..];
        let beside = |a: usize, b: usize| {
            let [a, b] = [a, b].map(|cluster| &members[cluster].bounds);
            a.centre.distance(b.centre) <= a.radius_m + b.radius_m + side_m
        };
        let differs =
            |cluster: usize| (0..near.len()).any(|other| near[other] != near[cluster] && beside(cluster, other));
        let differs: Vec<bool> = (0..near.len()).into_par_iter().map(differs).collect();
        for ((member, near), differs) in members.iter_mut().zip(near).zip(differs) {
            member.near = near;
            member.differs = differs;
        }
    }

    /// The same for all clusters of a receiver, in order.
    pub fn near_of(&self, receiver: usize) -> impl Iterator<Item = &[u32]> {
        let of_receiver = move |member: &&Member| member.cluster.receiver as usize == receiver;
        self.members.iter().filter(of_receiver).map(|member| &member.near[..])
    }

    /// Forgets what was merged: the next update takes every cluster.
    pub fn forget(&mut self) {
        self.now = None;
    }

    /// Brings the lists to this time and returns the clusters to merge: all at first, and then those that have changed.
    pub fn update(&mut self, now: State) -> Vec<Dirty> {
        let renewed = std::mem::take(&mut self.renewed);
        let before = self.now.take();
        let before = before.filter(|before| !renewed && now.scene_bounds.is_like(&before.scene_bounds));
        // Without the skip all clusters count as changed.
        let before = before.filter(|_| now.scene_bounds.skip.unmoved);
        let moved = before.as_ref().map(|before| Moved::new(before, &now));
        let dirty = if moved.as_ref().is_some_and(|moved| moved.list.is_empty()) {
            Vec::new()
        } else {
            let groups = (0..self.groups.len()).into_par_iter();
            groups.filter_map(|group| self.changed(group, &now, moved.as_ref())).collect()
        };
        self.now = Some(now);
        dirty
    }

    /// Clusters of these receivers, those alone that may be seen where `sights` are given.
    pub fn clusters_of(
        &self,
        receives: &[bool],
        sights: Option<&[Vec<Sight>]>,
    ) -> impl Iterator<Item = &layout::Cluster> {
        let wanted = move |member: &&Member| {
            let receiver = member.cluster.receiver as usize;
            let may_see = |sights: &[Vec<Sight>]| sights[receiver].iter().any(|sight| sight.may_see(&member.faces));
            receives[receiver] && sights.is_none_or(may_see)
        };
        self.members.iter().filter(wanted).map(|member| &member.cluster)
    }

    /// Whether there was an update, and nothing was forgotten since.
    pub fn is_updated(&self) -> bool {
        self.now.is_some()
    }

    /// The time of the last update, which there must have been.
    pub fn now(&self) -> &State {
        self.now.as_ref().expect("updated before")
    }

    /// Clusters of a group that have changed since they were merged, if any have.
    fn changed(&self, index: usize, now: &State, moved: Option<&Moved<'_>>) -> Option<Dirty> {
        let group = &self.groups[index];
        let mut clusters: Vec<usize> = group.clusters.clone().collect();
        if let Some(moved) = moved.filter(|moved| !(moved.merges_all || moved.flags[group.receiver])) {
            let near = moved.near(now, group.receiver, &group.bounds);
            let on_list = |cluster: usize| {
                !near.is_empty() && moved.any_on_list(now, group.receiver, &self.members[cluster].bounds, &near)
            };
            clusters.retain(|&cluster| on_list(cluster));
        }
        (!clusters.is_empty()).then_some(Dirty { group: index, clusters })
    }

    /// What may matter to a group at a time.
    fn candidates(state: &State, group: &WatchedGroup) -> Candidates {
        let entity = &state.entities[group.receiver];
        Candidates::of_group(&state.scene_bounds, group.receiver as u32, entity, &group.bounds)
    }

    /// The rule of one cluster's list at a time.
    fn scope<'s>(&'s self, state: &'s State, receiver: usize, cluster: usize) -> Scope<'s> {
        let Member { bounds, near, .. } = &self.members[cluster];
        Scope::new(&state.scene_bounds, receiver, &state.entities[receiver], bounds, near)
    }

    /// The entries of clusters at the last update's time: clusters that know their place among the entries, and the
    /// entries.
    pub fn gather(&self, dirty: &[Dirty]) -> (Vec<layout::Cluster>, Vec<u32>) {
        let now = self.now();
        let of_group = |dirty: &Dirty| {
            let group = &self.groups[dirty.group];
            let candidates = Self::candidates(now, group);
            let mut entries = Vec::new();
            let of_cluster = |&cluster: &usize| {
                let entry_first = entries.len() as u32;
                let sharp = gather::gather(&self.scope(now, group.receiver, cluster), &candidates, &mut entries);
                let entry_count = entries.len() as u32 - entry_first;
                let sharp_count = sharp as u32;
                layout::Cluster { entry_first, entry_count, sharp_count, ..self.members[cluster].cluster }
            };
            let clusters: Vec<layout::Cluster> = dirty.clusters.iter().map(of_cluster).collect();
            (clusters, entries)
        };
        let found: Vec<(Vec<layout::Cluster>, Vec<u32>)> = dirty.par_iter().map(of_group).collect();
        let mut clusters = Vec::new();
        let mut all = Vec::with_capacity(found.iter().map(|(_, s)| s.len()).sum());
        for (of_group, entries) in found {
            let before = all.len() as u32;
            clusters.extend(of_group.into_iter().map(|c| layout::Cluster { entry_first: before + c.entry_first, ..c }));
            all.extend(entries);
        }
        (self.deal(clusters), all)
    }

    /// Clusters in such an order that each of the device's threads gets its share of every entity's: in the order of
    /// entities one thread lit the floor and was done in half the time that the others took for what stands on it.
    fn deal<T: Copy>(&self, clusters: Vec<T>) -> Vec<T> {
        let count = self.threads.max(1);
        (0..count).flat_map(|thread| clusters.iter().skip(thread).step_by(count)).copied().collect()
    }

    /// What light bounces from onto each cluster at the last update's time. A list begins with [`CUT_HEADER`] words: the
    /// middle of the cluster in the world, from its entity's centre; how many near and far runs of what rests it sees, if
    /// it moves; its first pair and their number; how many entities nearby, and how many pairs, are of boxes that hide its
    /// links. The runs follow, and then entities nearby, such boxes first. All entries but those of the header are below
    /// their weights.
    ///
    /// The cuts of whole entities that move, of those in `of.movers`, come last.
    pub fn reflectors(&self, of: &Reflectors<'_, impl Iterator<Item = usize> + Clone + Sync>) -> Reflected {
        let State { scene_bounds, entities, .. } = self.now();
        let of_group = |group: &WatchedGroup| {
            let receiver = group.receiver;
            let entity = &entities[receiver];
            let rests = of.rests[receiver];
            let scope = Scope::new(scene_bounds, receiver, entity, &group.bounds, &[]);
            let mut candidates = Vec::new();
            let reflects = |j: u32| {
                let index = j as usize;
                // Boxes of entities reflect nothing by themselves.
                if index >= of.reflects.len() {
                    return false;
                }
                let together = scene_bounds.groups.as_ref().is_some_and(|groups| groups.are_one(receiver, index));
                of.reflects[index] && !together && index != receiver && (rests || !of.rests[index])
            };
            let keep = |j| candidates.extend(reflects(j).then_some(j));
            scene_bounds.tree.find(|crowd| scope.leaves_dark(crowd), keep);
            let is_box = |j: &u32| rests && of.boxes.contains(&(*j as usize));
            candidates.sort_by_key(|j| !is_box(j));
            let of_cluster = |cluster: usize| {
                let scope = Scope::new(scene_bounds, receiver, entity, &self.members[cluster].bounds, &[]);
                let Scope { centre, radius_m, .. } = scope;
                let cut = if rests { Cut::default() } else { of.far.cut(centre.as_vec3(), radius_m as f32) };
                let middle = (centre - scene_bounds.entities[receiver].centre).as_vec3();
                let mut sighted = Sighted { middle, cut, near: Vec::new(), distant: Vec::new(), boxes: [0, 0] };
                for &j in candidates.iter().filter(|&&j| scope.meets(j as usize)) {
                    let bounds = &scene_bounds.entities[j as usize];
                    let distant = far::distant(bounds.centre.distance(centre), bounds.radius_m, radius_m);
                    sighted.distant.extend(far::pack(distant, j));
                    sighted.near.extend(far::pack(1.0 - distant, j));
                    if is_box(&j) {
                        sighted.boxes = [sighted.near.len(), sighted.distant.len()];
                    }
                }
                sighted
            };
            group.clusters.clone().map(of_cluster).collect::<Vec<_>>()
        };
        let found: Vec<Vec<Sighted>> = self.groups.par_iter().map(of_group).collect();
        let found: Vec<&Sighted> = found.iter().flatten().collect();
        let clusters = self.members.iter().map(|member| member.cluster).collect();
        let mut all = Reflected { clusters: self.deal(clusters), ..Reflected::default() };
        for (number, sighted) in self.deal(found).into_iter().enumerate() {
            let Sighted { middle, cut, near, distant, boxes: [near_boxes, distant_boxes] } = sighted;
            let entry_first = all.entries.len() as u32;
            // Where there are too many pairs, vertices look up the rest.
            let seen = distant.len().min(MOST_PAIRS - all.pairs.len());
            let (distant, rest) = distant.split_at(seen);
            let counts = [cut.near.len(), cut.far.len(), all.pairs.len(), seen, *near_boxes, seen.min(*distant_boxes)];
            all.entries.extend(middle.to_array().map(f32::to_bits));
            all.entries.extend(counts.map(|count| count as u32));
            all.entries.extend(cut.near.iter().chain(&cut.far).chain(near).chain(rest));
            all.pairs.extend(distant.iter().map(|packed| [number as u32, *packed]));
            let entry_count = all.entries.len() as u32 - entry_first;
            all.clusters[number] = layout::Cluster { entry_first, entry_count, ..all.clusters[number] };
        }
        for entity in of.movers.clone() {
            let first = all.entries.len();
            if !of.rests[entity] {
                let sphere = scene_bounds.spheres[entity];
                let Cut { near, far } = of.far.cut(sphere.truncate(), sphere.w);
                all.entries.extend([near, far].concat());
            }
            all.cuts.push([first, all.entries.len() - first].map(|place| place as u32));
        }
        all
    }

    /// The chains of sharp lights of all clusters of a receiver at the last update's time, for what lies as far as
    /// `margin_m` (mesh's frame) around their vertices. For each cluster the first of its entries and how many they
    /// are, with [`OWN_MAPS`] where only maps of its own vertices go with them: none where neither an occluder nor a spot
    /// stands on them and no light is near, so that light changes there no faster than vertices show.
    pub fn sharp_chains(&self, receiver: usize, margin_m: f32) -> (Vec<[u32; 2]>, Vec<u32>) {
        let now = self.now();
        let entity = &now.entities[receiver];
        let around = |bounds: &ClusterBounds| ClusterBounds { radius_m: bounds.radius_m + margin_m, ..*bounds };
        let of_group = |group: &&WatchedGroup| {
            let bounds = around(&group.bounds);
            let candidates = Candidates::of_group(&now.scene_bounds, receiver as u32, entity, &bounds);
            let chains = |cluster: usize| {
                let mut entries = Vec::new();
                let Member { bounds, near, .. } = &self.members[cluster];
                let bounds = around(bounds);
                let scope = Scope::new(&now.scene_bounds, receiver, entity, &bounds, near);
                let sharp = gather::gather(&scope, &candidates, &mut entries);
                entries.truncate(sharp);
                let entries = without_mapped(&entries, &now.entities);
                let has_edge = |&entry: &u32| {
                    let [entity, _] = ListEntry::entities(entry);
                    let light = &now.entities[entity as usize];
                    !ListEntry::is_light(entry) || light.is_spot() || light.light_maps != 0 || scope.may_be_at(light)
                };
                if entries.iter().any(has_edge) { entries } else { Vec::new() }
            };
            group.clusters.clone().map(chains).collect::<Vec<_>>()
        };
        let groups: Vec<&WatchedGroup> = self.groups.iter().filter(|group| group.receiver == receiver).collect();
        let found: Vec<Vec<Vec<u32>>> = groups.par_iter().map(of_group).collect();
        let mut places = Vec::new();
        let mut all = Vec::new();
        let clusters = groups.iter().flat_map(|group| group.clusters.clone());
        for (entries, cluster) in found.into_iter().flatten().zip(clusters) {
            let own_maps = if self.members[cluster].differs { OWN_MAPS } else { 0 };
            places.push([all.len() as u32, entries.len() as u32 | own_maps]);
            all.extend(entries);
        }
        (places, all)
    }

    /// The entries of each of a receiver's clusters at a time.
    pub fn entries_of(&self, state: &State, receiver: usize) -> Vec<Vec<u32>> {
        let mut lists = Vec::new();
        for group in self.groups.iter().filter(|group| group.receiver == receiver) {
            let candidates = Self::candidates(state, group);
            for cluster in group.clusters.clone() {
                let mut entries = Vec::new();
                gather::gather(&self.scope(state, receiver, cluster), &candidates, &mut entries);
                lists.push(entries);
            }
        }
        lists
    }
}

struct Moved<'b> {
    before: &'b State,
    flags: Vec<bool>,
    list: Vec<usize>,
    /// Whether so many have changed that to ask of each whether it matters costs more than to merge every cluster.
    merges_all: bool,
}

impl<'b> Moved<'b> {
    fn new(before: &'b State, now: &State) -> Self {
        let same = |i: usize| {
            now.placements.get(i) == before.placements.get(i)
                && bytemuck::bytes_of(&now.entities[i]) == bytemuck::bytes_of(&before.entities[i])
                && now.scene_bounds.entities[i] == before.scene_bounds.entities[i]
        };
        let flags: Vec<bool> = (0..now.entities.len()).map(|i| !same(i)).collect();
        let list: Vec<usize> = (0..flags.len()).filter(|&i| flags[i]).collect();
        Moved { before, merges_all: list.len() * 8 > flags.len().max(64), flags, list }
    }

    /// Moved entities that may stand on the list of a cluster within these bounds, before or now; its receiver has not
    /// moved.
    fn near(&self, now: &State, receiver: usize, bounds: &ClusterBounds) -> Vec<usize> {
        let both = [&self.before.scene_bounds, &now.scene_bounds];
        let scopes = both.map(|scene| Scope::new(scene, receiver, &now.entities[receiver], bounds, &[]));
        let near = |j: usize| j != receiver && scopes.iter().any(|scope| scope.may_list(j));
        self.list.iter().copied().filter(|&j| near(j)).collect()
    }

    /// Whether any of `list` stands on the list of a cluster, before or now.
    fn any_on_list(&self, now: &State, receiver: usize, bounds: &ClusterBounds, list: &[usize]) -> bool {
        let on = |scene: &SceneBounds| {
            // Which members are near does not matter here: those of one group move together or not at all.
            let scope = Scope::new(scene, receiver, &now.entities[receiver], bounds, &[]);
            list.iter().any(|&j| scope.lists(j))
        };
        on(&self.before.scene_bounds) || on(&now.scene_bounds)
    }
}

/// Chains of sharp lights less the occluders that stand in the maps of these lights.
fn without_mapped(entries: &[u32], entities: &[DeviceEntity]) -> Vec<u32> {
    let mut kept = Vec::with_capacity(entries.len());
    let mut occluders = 0;
    for &entry in entries {
        let [entity, light] = ListEntry::entities(entry);
        if ListEntry::is_light(entry) {
            kept.push(entry & !ENTRY_ENTITIES | occluders);
            occluders = 0;
        } else if entities[entity as usize].light_maps & entities[light as usize].light_maps == 0 {
            kept.push(entry);
            occluders += 1;
        }
    }
    kept
}
