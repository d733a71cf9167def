//! "gather" against its twin on the host: lists of random crowds that the device makes, held against the rule of
//! [`crate::lists::scope`] without slack and with twice the slack.

use super::CheckRow;
use crate::bake::Baker;
use crate::error::Result;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device};
use crate::layout::{Cluster, DeviceEntity, ListEntry};
use crate::lists::gather::{
    self, Candidates, ClusterBounds, EntityBounds, GROUP_CLUSTERS, Gather, GatherInputs, Group, Packed, Report, SLACK,
    SceneBounds, Scope,
};
use crate::lists::skip::Skip;
use crate::sh::quadrature::random_direction;
use crate::sh::rotation::turns;
use crate::shaders::Library;
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// A receiver among many entities, with clusters of its own.
pub struct Crowded {
    /// All entities.
    pub scene_bounds: SceneBounds,
    /// Which of them is lit.
    pub receiver: u32,
    /// It, as shaders see it.
    pub entity: DeviceEntity,
    /// Bounds of its clusters.
    pub clusters: Vec<ClusterBounds>,
}

/// How lists agree with the rule.
#[derive(Clone, Copy, Debug, Default)]
pub struct ListAgreement {
    /// Lists that miss something of the rule without slack, hold something beyond the rule with twice the slack, are out of order, or
    /// whose cluster has another number of entries for sharp lights at the front.
    pub wrong_lists: usize,
    /// Entries of all lists.
    pub entries: usize,
    /// Entries that stand there for the slack alone.
    pub extra_entries: usize,
}

/// Whether `part` is what is left of `whole` when some of its entries are taken out.
fn is_within(part: &[u32], whole: &[u32]) -> bool {
    let mut rest = whole.iter();
    part.iter().all(|entry| rest.any(|other| other == entry))
}

/// Entities near and far, of which every fifth does not occlude and every 25th shines, in harmonics, in colours or sharply.
fn random_entities(rng: &mut fastrand::Rng, count: usize, spread_m: f64, corner: DVec3) -> Vec<EntityBounds> {
    (0..count)
        .map(|i| EntityBounds {
            sharp: i % 100 == 25,
            centre: corner + DVec3::new(rng.f64() - 0.5, 0.1 * rng.f64(), rng.f64() - 0.5) * spread_m,
            radius_m: 0.1 + 0.4 * rng.f64(),
            occludes: i % 5 != 0,
            emits: i % 25 == 0,
            coloured: i % 50 == 0,
            radiance: 3.0 * rng.f64(),
            facing: (i % 50 == 25).then(|| (random_direction(rng), 1.8)),
        })
        .collect()
}

impl Crowded {
    /// A crowd with and without a sky, lights and each skip, by the round; every third one far from the world's origin.
    pub fn new(rng: &mut fastrand::Rng, round: usize, count: usize) -> Crowded {
        let spread_m = if round.is_multiple_of(2) { 60.0 } else { 8.0 };
        let corner = if round % 3 == 2 { DVec3::new(4e3, -7e3, 1e4) } else { DVec3::ZERO };
        let bounds = random_entities(rng, count, spread_m, corner);
        let receiver = rng.u32(0..count as u32);
        let rotation = DQuat::from_axis_angle(random_direction(rng), 6.0 * rng.f64());
        let turns = turns(rotation).map(|x| x as f32);
        let own = bounds[receiver as usize];
        let entity = DeviceEntity {
            centre: own.centre.as_vec3().extend(1.0 / own.radius_m as f32).to_array(),
            alpha_beta: [turns[0], turns[1], turns[2], turns[3]],
            gamma: [turns[4], turns[5]],
            emission: [0.0, 0.0, 0.0, 0.3 + 0.7 * rng.f32()],
            albedo: [0.0, 0.0, 0.0, 0.5 + rng.f32()],
            ..Default::default()
        };
        let without = ["cones", "behind", "horizon", "caps"].map(Skip::without);
        let skips: Vec<Skip> = [Skip::ALL, Skip::NONE].into_iter().chain(without).collect();
        let eps = if round % 6 == 5 { 0.0 } else { 10_f64.powf(-1.5 - 2.5 * rng.f64()) };
        let sky = (round % 4 != 3).then_some(1.2);
        let scene_bounds = SceneBounds::new(bounds, sky, skips[round % skips.len()], eps);
        let facing = random_direction(rng);
        let mut cluster = || {
            let centre = 2.0 * random_direction(rng) * rng.f64();
            let axis = (facing + 0.5 * random_direction(rng)).normalize();
            ClusterBounds::from_parts(centre, 0.3 * rng.f64(), axis, 0.4 * rng.f64())
        };
        let clusters = (0..GROUP_CLUSTERS).map(|_| cluster()).collect();
        Crowded { scene_bounds, receiver, entity, clusters }
    }

    /// Lists by a look at everything, by the rule with this slack.
    pub fn expected(&self, slack: f64) -> Vec<Vec<u32>> {
        let everything = Candidates::all(&self.scene_bounds, self.receiver);
        let of = |bounds| {
            let mut entries = Vec::new();
            gather::twin(&Scope::new(&self.scene_bounds, &self.entity, bounds, slack), &everything, &mut entries);
            entries
        };
        self.clusters.iter().map(of).collect()
    }

    /// Holds lists against the rule: each has everything of the rule without slack and nothing beyond the rule with twice the
    /// slack, in one order.
    pub fn hold(&self, lists: &[(Cluster, Vec<u32>)]) -> ListAgreement {
        let (strict, double) = (self.expected(0.0), self.expected(2.0 * SLACK));
        let mut agreement = ListAgreement::default();
        let is_sharp = |entry: &&u32| {
            let light = ListEntry::entities(**entry)[1] as usize;
            self.scene_bounds.entities.get(light).is_some_and(|light| light.emits && light.sharp)
        };
        for ((cluster, found), (least, most)) in lists.iter().zip(strict.iter().zip(&double)) {
            let sharp = found.iter().take_while(is_sharp).count();
            let told = cluster.sharp_count as usize == sharp && !found[sharp..].iter().any(|entry| is_sharp(&entry));
            agreement.wrong_lists += usize::from(!is_within(least, found) || !is_within(found, most) || !told);
            agreement.entries += found.len();
            agreement.extra_entries += found.len().saturating_sub(least.len());
        }
        agreement
    }

    /// Lists by the device with room for `capacity` entries, each with its cluster, and its report.
    ///
    /// # Errors
    /// As [`Gather::new`] and [`Gather::record`].
    pub fn on_device(
        &self,
        device: &Arc<Device>,
        library: &Library,
        texel: bool,
        capacity: u32,
    ) -> Result<(Vec<(Cluster, Vec<u32>)>, Report)> {
        let count = self.clusters.len() as u32;
        let mut bounds = self.clusters.clone();
        bounds.push(ClusterBounds::union(&self.clusters));
        let cluster = |i: u32| Cluster { receiver: self.receiver, vertex_count: 64, bounds: i, ..Default::default() };
        let clusters: Vec<Cluster> = (0..count).map(cluster).collect();
        let mut entities = vec![DeviceEntity::default(); self.scene_bounds.spheres.len()];
        entities[self.receiver as usize] = self.entity;
        // Two groups, the second of one cluster that is bounded by itself.
        let groups = [
            Group { first: 0, count: count - 1, bounds: count, left: 0 },
            Group { first: count - 1, count: 1, bounds: count - 1, left: 0 },
        ];
        let packed = Packed::new(&self.scene_bounds);
        let pass = Gather::new(device, library, texel, entities.len())?;
        let inputs = GatherInputs {
            scene_quads: &Buffer::with_data(device, "scene quads", &packed.quads)?,
            entities: &Buffer::with_data(device, "entities", &entities)?,
            bounds: &Buffer::with_data(device, "bounds", &bounds)?,
            groups: &Buffer::with_data(device, "groups", &groups)?,
            clusters: &Buffer::with_data(device, "clusters", &clusters)?,
            entries: &Buffer::new(device, "entries", BufferKind::Device, 4 * u64::from(count * capacity))?,
            report: &Buffer::with_data(device, "report", &[Report::default()])?,
        };
        let mut commands = Commands::new(device, "gather")?;
        commands.pass("gather", |c| pass.record(c, &inputs, &packed, capacity, 2))?;
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        commands.submit()?;
        let clusters: Vec<Cluster> = inputs.clusters.download(count as usize)?;
        let entries: Vec<u32> = inputs.entries.download((count * capacity) as usize)?;
        let list = |cluster: &Cluster| {
            // What no pass wrote may say anything.
            let first = (cluster.entry_first as usize).min(entries.len());
            let end = (first + cluster.entry_count as usize).min(entries.len());
            entries[first..end].to_vec()
        };
        let report = inputs.report.download(1)?[0];
        Ok((clusters.iter().map(|cluster| (*cluster, list(cluster))).collect(), report))
    }
}

/// The comparisons of `check`.
///
/// # Errors
/// As [`Crowded::on_device`].
pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let mut compare = |what: &str, texel: bool, many: bool| -> Result<()> {
        let mut rng = fastrand::Rng::with_seed(4);
        let mut all = ListAgreement::default();
        for round in 0..if many { 1 } else { 24 } {
            let mut crowded = if many {
                Crowded::new(&mut rng, 5, 2000)
            } else {
                Crowded::new(&mut rng, round, [30, 200, 700][round % 3])
            };
            if many {
                // With more lights a software device could not go through them all.
                let mut entities = std::mem::take(&mut crowded.scene_bounds.entities);
                entities.iter_mut().skip(200).for_each(|entity| entity.emits = false);
                crowded.scene_bounds = SceneBounds::new(entities, Some(1.2), Skip::ALL, 0.0);
            }
            let capacity = Packed::new(&crowded.scene_bounds).longest() as u32;
            let (lists, report) = crowded.on_device(baker.device(), baker.library(), texel, capacity)?;
            let found = crowded.hold(&lists);
            let told = report.entry_total as usize == found.entries && many == (report.left_count > 0);
            all.wrong_lists += found.wrong_lists + usize::from(!told);
            all.entries += found.entries;
        }
        let worst = if all.entries > 1000 { all.wrong_lists as f64 } else { f64::INFINITY };
        add(CheckRow::new("gather", what, "lists beyond the slack", worst, 0.0));
        Ok(())
    };
    compare("crowds, storage buffers", false, false)?;
    compare("crowds, texel views", true, false)?;
    compare("a crowd beyond a workgroup's memory", baker.device().info.is_software(), true)
}
