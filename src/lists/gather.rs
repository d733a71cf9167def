//! Cluster lists: which lookups each cluster of vertices needs, in which order.
//!
//! A list has a [`ListEntry`] for each lookup. An entry is left off when it changes no vertex of the cluster (an
//! occluder farther than the light from all of them, or one that the skips in `merge_cone.glsl` weigh with zero
//! everywhere), when it stands in the light's map, and, with a threshold `eps`, when the light that it could take or
//! bring is bounded below it. [`crate::lists::scope`] has the rule. The order in which occluders are multiplied is the
//! same everywhere ([`SceneBounds::order`]).
//!
//! Neighbouring clusters are gathered together: their group searches a tree of the occluders once, so that the work
//! grows with what may matter to any of them and not with what exists. What a group leaves out, each cluster would
//! leave off by itself.

pub use crate::layout::GROUP_CLUSTERS;
use crate::layout::{self, ListEntry};
pub use crate::lists::scene_bounds::{
    ClusterBounds, EntityBounds, Globe, Occludes, OutlineShape, OutlineView, SceneBounds,
};
use crate::lists::scope::{CullResult, Scope, SphereView};

/// Whether clusters are as near one another as neighbours on a surface are, so that they make a group: a space-filling
/// curve leaps at times. It does not help against a single cluster that spans a leap.
pub fn compact(clusters: &[ClusterBounds]) -> bool {
    let largest = clusters.iter().map(|bounds| bounds.radius_m).fold(0.0, f32::max);
    ClusterBounds::union(clusters).radius_m <= 2.0 * largest * (clusters.len() as f32).sqrt()
}

/// What may matter to any cluster of a group.
pub struct Candidates {
    /// Occluders in the order in which they are multiplied ([`SceneBounds::order`]), the receiver left out.
    pub occluders: Vec<u32>,
    /// Lights in the order of entities, the receiver left out.
    lights: Vec<u32>,
}

impl Candidates {
    /// What may matter to any cluster of a group with these bounds.
    pub fn of_group(scene: &SceneBounds, receiver: u32, entity: &layout::DeviceEntity, bounds: &ClusterBounds) -> Self {
        let scope = Scope::new(scene, receiver as usize, entity, bounds, &[]);
        let mut occluders = Vec::new();
        scene.tree.find(|crowd| scope.leaves_out(crowd), |j| occluders.push(j));
        Self::new(scene, receiver, occluders, |light| scope.may_list(light as usize))
    }

    /// Of these occluders, and of those lights that `keeps` says.
    pub fn new(scene: &SceneBounds, receiver: u32, mut occluders: Vec<u32>, keeps: impl Fn(u32) -> bool) -> Self {
        occluders.retain(|&j| j != receiver);
        occluders.sort_by_cached_key(|&j| scene.order(receiver, j));
        let lights = scene.lights.iter().copied().filter(|&light| light != receiver && keeps(light));
        Candidates { occluders, lights: lights.collect() }
    }
}

/// Appends the entries of one cluster, light by light and at last the sky. `candidates` are those of a group that the
/// cluster belongs to, or all. Returns how many of the entries, at the front, are for sharp lights.
pub fn gather(scope: &Scope<'_>, candidates: &Candidates, out: &mut Vec<u32>) -> usize {
    let first = out.len();
    let mut sharp_count = 0;
    let spheres = &scope.scene.spheres;
    let views: Vec<SphereView> = candidates.occluders.iter().map(|&j| scope.view_of(j as usize)).collect();
    // What becomes of each occluder in a light's chain.
    let chain = |light: Option<(u32, &SphereView)>, sharp, radiance: f64, results: &mut Vec<CullResult>| {
        let (light, light_view) = light.unzip();
        results.clear();
        results.extend(candidates.occluders.iter().zip(&views).map(|(&occluder, view)| {
            let stands_before = scope.scene.entities[occluder as usize].occludes.stands_before(sharp);
            if !stands_before
                || scope.is_own(occluder as usize, sharp)
                || !scope.may_block(view, light_view, sharp, radiance)
            {
                return CullResult::LeftOff;
            }
            let Some(light) = light.filter(|light| sharp && *light != occluder) else { return CullResult::Listed };
            match scope.outline_result(occluder as usize, light) {
                CullResult::Listed | CullResult::Encloses if scope.scene.is_mapped(occluder, light) => {
                    CullResult::LeftOff
                }
                result => result,
            }
        }));
    };
    let occlude =
        |light: Option<u32>, sharp, chosen: &dyn Fn(u32) -> bool, results: &[CullResult], out: &mut Vec<u32>| {
            let occluders = candidates.occluders.iter().zip(views.iter().zip(results));
            let is_listed = |result| matches!(result, CullResult::Listed | CullResult::Encloses);
            let listed = occluders.filter(|(j, (_, result))| light != Some(**j) && chosen(**j) && is_listed(**result));
            let start = out.len();
            for (&entity, (view, result)) in listed {
                if *result == CullResult::Encloses {
                    out.push(ListEntry::Globe { entity, light }.pack());
                } else if sharp && scope.scene.is_cuboid(entity as usize) {
                    out.push(ListEntry::Cuboid { entity, light }.pack());
                } else if scope.scene.entities[entity as usize].sheet.is_some() {
                    out.push(ListEntry::Sheet { entity, light }.pack());
                } else {
                    out.extend((view.whole || sharp).then(|| ListEntry::Occlude { entity, light }.pack()));
                    out.extend((view.cap && !sharp).then(|| ListEntry::Cap { entity, light }.pack()));
                }
            }
            // Those of one kind are evaluated one after another.
            if sharp {
                out[start..].sort_by_key(|entry| ListEntry::kind(*entry));
            }
        };
    let mut results = Vec::with_capacity(views.len());
    for &entity in &candidates.lights {
        let light = &scope.scene.entities[entity as usize];
        let view = scope.view(spheres[entity as usize]);
        let channels = if light.coloured { 3 } else { 1 };
        let sharp = light.sharp;
        if !scope.may_light(light, &view) {
            continue;
        }
        chain(Some((entity, &view)), sharp, light.radiance, &mut results);
        // One occluder that takes all of its light is enough.
        if results.contains(&CullResult::Covers) {
            continue;
        }
        let start = out.len();
        occlude(Some(entity), sharp, &|_| true, &results, out);
        if sharp {
            let occluders = (out.len() - start) as u32;
            out.push(ListEntry::Sharp { entity, occluders }.pack());
            sharp_count = out.len() - first;
            continue;
        }
        out.extend((0..channels).map(|channel| {
            let last = channel + 1 == channels;
            ListEntry::Shine { entity, channel: light.coloured.then_some(channel), last }.pack()
        }));
    }
    if let Some(sky) = scope.scene.sky {
        chain(None, false, sky, &mut results);
        let Some((volume, is_within)) = scope.volume() else {
            occlude(None, false, &|_| true, &results, out);
            return sharp_count;
        };
        let has = |j: u32| volume.has.get(j as usize).is_some_and(|has| *has);
        let of_volume = candidates.occluders.iter().zip(&mut results).filter(|(j, _)| is_within && has(**j));
        of_volume.for_each(|(_, result)| *result = CullResult::LeftOff);
        occlude(None, false, &has, &results, out);
        out.push(ListEntry::Volume { receiver: scope.index as u32 }.pack());
        occlude(None, false, &|j| !has(j), &results, out);
    }
    sharp_count
}
