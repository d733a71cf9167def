//! The CPU twin of the passes in f64, from the same links, lists and fields.

use super::boxes::{LEAST_COSINE, NARROWED};
use super::movers::{Movers, OUTGOING, OVER, SMOOTH, UNFACED};
use super::relaxation::MOST_STEPS;
use super::{BLOCK_CLUSTERS, Bounce, LinkBuffers, RunBlock, Steps};
use crate::bake::links::{self, COUNT_BITS, RUNS, pack, unpack, unpack_direction};
use crate::error::Result;
use crate::field::cuboid::Cuboid;
use crate::field::self_visibility;
use crate::layout::Cluster;
use crate::lists::incremental::CUT_HEADER;
use crate::lists::skip::Skip;
use crate::merge::twin::{Cone, MergeObject};
use crate::sh::basis::{MAX_COEFFICIENTS, Y00, values};
use crate::sh::lobe::clamped_cosine;
use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::iter::Sum;
use std::ops::{Mul, Range};

/// What the passes read of the scene and of light.
pub struct TwinInput<'t> {
    /// Direct light of every place of the buffers of light.
    pub direct: &'t [DVec3],
    /// Share of the light that leaves each of them and gets past lamps.
    pub passes: &'t [f64],
    pub objects: &'t [MergeObject<'t>],
    pub skip: Skip,
    /// Vertex of a cluster.
    pub vertex: &'t (dyn Fn(&Cluster, usize) -> TwinVertex<'t> + Sync),
}

/// A vertex that light bounces onto.
pub struct TwinVertex<'t> {
    /// World.
    pub position: DVec3,
    /// In the frame of its entity.
    pub normal: DVec3,
    /// Its stored transfer and its map of self-visibility, if it has any.
    pub transfer: Option<&'t [f32]>,
    pub map: Option<&'t [u8]>,
}

impl Bounce {
    /// Light of every place after these steps.
    pub fn twin(&self, input: &TwinInput<'_>, steps: &Steps) -> Result<Vec<DVec3>> {
        let mut host = self.download()?;
        if let Some(movers) = &self.movers {
            movers.hide_links_twin(input, &mut host, &self.places()?)?;
        }
        let passed: Vec<DVec3> = input.direct.iter().zip(input.passes).map(|(light, share)| *light * *share).collect();
        let direct = host.means(|v| passed[v]);
        let passes = host.means(|v| input.passes[v]);
        let mut incoming = vec![(DVec3::ZERO, 0.0); input.direct.len()];
        let mut light = host.widened(&direct);
        for (step, push) in steps.pushes().enumerate() {
            if let Some(movers) = self.movers.as_ref().filter(|_| step == steps.alone) {
                movers.twin(input, &light, true, &mut incoming)?;
            }
            let met = host.means(|v| incoming[v].0);
            let taken = host.means(|v| incoming[v].1);
            let gain = Vec3::from(push.gain).as_dvec3();
            let after = |(place, &run): (usize, &usize)| {
                let (first, entity, count) = host.of_runs.range(run);
                let albedo = DVec3::from(input.objects[entity].albedo_over_pi);
                let sum = host.of_runs.along(first, count, &light) * (1.0 - taken[place]) + met[place];
                let found = direct[place] + passes[place] * PI * albedo * sum;
                found + gain * (found - light[run])
            };
            let after: Vec<DVec3> = host.smallest.iter().enumerate().map(after).collect();
            light = host.widened(&after);
        }
        if let Some(movers) = self.movers.as_ref().filter(|_| steps.gains.len() == steps.alone) {
            movers.twin(input, &light, !steps.gains.is_empty(), &mut incoming)?;
        }
        let bounced = |(place, (met, taken)): (usize, &(DVec3, f64))| {
            let (first, entity, count) = host.of_vertices.range(place);
            let albedo = DVec3::from(input.objects[entity].albedo_over_pi);
            let sum = host.of_vertices.along(first, count, &light) * (1.0 - taken) + *met;
            input.direct[place] + (PI * albedo * sum).max(DVec3::ZERO)
        };
        Ok(incoming.iter().enumerate().map(bounced).collect())
    }

    /// What the links of these vertices lead to, as the last frame has left it.
    pub fn links_of(&self, vertices: Range<usize>) -> Result<Vec<Vec<SeenLink>>> {
        let host = self.download()?;
        let light: Vec<[f32; 4]> = self.run_light[0].download(self.run_count as usize)?;
        let places = self.places()?;
        let links: Vec<u32> = self.shown_links()[0].download(host.of_vertices.links.len())?;
        let seen = |link: &u32| {
            let (run, share) = unpack(*link);
            let [x, y, z, rests] = places[run][0].map(f64::from);
            SeenLink {
                share: f64::from(share) * rests,
                middle: DVec3::new(x, y, z),
                light: DVec3::from_slice(&light[run].map(f64::from)),
            }
        };
        let of_vertex = |vertex| {
            let (first, _, count) = host.of_vertices.range(vertex);
            links[first..][..count].iter().map(seen).collect()
        };
        Ok(vertices.map(of_vertex).collect())
    }

    /// Places of all runs, as [`crate::lists::far::FarRun::quads`] has them.
    fn places(&self) -> Result<Vec<[[f32; 4]; 2]>> {
        self.run_places.download(self.run_count as usize)
    }

    /// What the passes read of links, in host memory.
    pub(super) fn download(&self) -> Result<HostLinks> {
        let blocks: Vec<RunBlock> = self.blocks.download(self.block_count as usize)?;
        let smallest = blocks.iter().flat_map(|block| block.smallest_runs()).map(|(run, _)| run).collect();
        Ok(HostLinks {
            run_count: self.run_count as usize,
            blocks,
            smallest,
            areas: self.areas.download(self.vertex_count as usize)?,
            of_vertices: self.of_vertices.download(self.vertex_count)?,
            of_runs: self.of_runs.download(self.run_count)?,
        })
    }
}

impl LinkBuffers {
    fn download(&self, count: u32) -> Result<HostList> {
        let links = self.links.download((self.links.size_bytes / 4) as usize)?;
        Ok(HostList { ranges: self.ranges.download(count as usize)?, links })
    }
}

/// The run that a link leads to.
pub struct SeenLink {
    /// Share of the cosine-weighted hemisphere; 0 where the run does not rest.
    pub share: f64,
    /// World, metres.
    pub middle: DVec3,
    /// Mean light that leaves it.
    pub light: DVec3,
}

/// The links of all vertices and runs, as [`super::Linked`] has them.
pub(super) struct HostLinks {
    run_count: usize,
    blocks: Vec<RunBlock>,
    /// Numbers of the smallest runs.
    pub smallest: Vec<usize>,
    areas: Vec<f32>,
    of_vertices: HostList,
    of_runs: HostList,
}

struct HostList {
    ranges: Vec<[u32; 2]>,
    links: Vec<u32>,
}

impl HostList {
    /// First link, entity and number of links of a vertex or a run.
    fn range(&self, place: usize) -> (usize, usize, usize) {
        let [first, packed] = self.ranges[place];
        (first as usize, (packed >> COUNT_BITS) as usize, links::count(packed))
    }

    /// Light along links, as a share of the hemisphere times radiosity.
    fn along(&self, first: usize, count: usize, of_runs: &[DVec3]) -> DVec3 {
        let links = self.links[first..][..count].iter().map(|link| unpack(*link));
        links.map(|(run, share)| of_runs[run] * f64::from(share)).sum()
    }
}

impl HostLinks {
    /// Means of something over the vertices of the smallest runs, by their areas.
    fn means<T: Sum + Mul<f64, Output = T> + Send>(&self, of_vertex: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let mean = |(_, places): (usize, Range<usize>)| {
            let whole: f64 = places.clone().map(|v| f64::from(self.areas[v])).sum();
            places.map(|v| of_vertex(v) * (f64::from(self.areas[v]) / whole.max(1e-30))).sum()
        };
        self.blocks.par_iter().flat_map_iter(|block| block.smallest_runs().map(mean)).collect()
    }

    /// The light of all runs, from that of the smallest.
    fn widened(&self, of_smallest: &[DVec3]) -> Vec<DVec3> {
        let mut light = vec![DVec3::ZERO; self.run_count];
        for (&run, &found) in self.smallest.iter().zip(of_smallest) {
            light[run] = found;
        }
        for block in &self.blocks {
            let first = block.vertex_first as usize;
            let mut sums = [(DVec3::ZERO, 0.0); BLOCK_CLUSTERS];
            for (run, places) in block.smallest_runs() {
                let (sum, whole) = &mut sums[(places.start - first) / RUNS[1]];
                let area: f64 = self.areas[places].iter().map(|area| f64::from(*area)).sum();
                *sum += area * light[run];
                *whole += area;
            }
            let clusters = (block.vertex_count as usize).div_ceil(RUNS[1]);
            for (cluster, (sum, whole)) in sums[..clusters].iter().enumerate() {
                light[block.middle as usize + cluster] = *sum / whole.max(1e-30);
            }
            let (sum, whole) = sums.iter().fold((DVec3::ZERO, 0.0), |all, of| (all.0 + of.0, all.1 + of.1));
            light[block.large as usize] = sum / f64::max(whole, 1e-30);
        }
        light
    }

    /// Light of the smallest runs after all bounces up to the last that there may be steps for, from the first, which is
    /// what is given.
    pub fn bounces(&self, light: Vec<DVec3>, albedos: &[Vec3]) -> Vec<Vec<DVec3>> {
        let mut bounces = vec![light];
        for _ in 0..MOST_STEPS {
            let light = self.widened(&bounces[bounces.len() - 1]);
            let bounced = |&run: &usize| {
                let (first, entity, count) = self.of_runs.range(run);
                albedos[entity].as_dvec3() * self.of_runs.along(first, count, &light)
            };
            bounces.push(self.smallest.par_iter().map(bounced).collect());
        }
        bounces
    }
}

impl Movers {
    /// Leaves of all links what boxes do not hide.
    fn hide_links_twin(&self, input: &TwinInput<'_>, host: &mut HostLinks, places: &[[[f32; 4]; 2]]) -> Result<()> {
        let Some(boxes) = &self.boxes else { return Ok(()) };
        let clusters: Vec<Cluster> = self.clusters.download(self.cluster_count as usize)?;
        let left = |position: DVec3, normal: DVec3, link: u32, direction: u32| {
            let (run, share) = unpack(link);
            let [x, y, z, rests] = places[run][0].map(f64::from);
            if rests == 0.0 {
                return link;
            }
            let distance = DVec3::new(x, y, z).distance(position);
            let toward = unpack_direction(direction).as_dvec3().normalize();
            let tangent = NARROWED * (f64::from(share) / normal.dot(toward).max(LEAST_COSINE)).sqrt();
            let visible = |entity: &u32| {
                let object = &input.objects[*entity as usize];
                let cuboid = self.surfaces.cuboids[*entity as usize].expect("a box");
                let to_object = object.rotation.inverse();
                let point = to_object * (position - object.centre) / object.radius_m;
                let along = to_object * toward;
                1.0 - object.opacity * cuboid.blocked(point, along, distance / object.radius_m, tangent)
            };
            let share = f64::from(share) * boxes.push.entities().iter().map(visible).product::<f64>();
            pack(share as f32, run as u32).unwrap_or(run as u32)
        };
        let mut vertices = Vec::new();
        for cluster in &clusters {
            for v in 0..cluster.vertex_count as usize {
                let TwinVertex { position, normal, .. } = (input.vertex)(cluster, v);
                let normal = input.objects[cluster.receiver as usize].rotation * normal;
                vertices.push((cluster.radiosity_first as usize + v, position, normal));
            }
        }
        let of_run = |(run, quads): (usize, &[[f32; 4]; 2])| {
            let [middle, normal] = quads.map(|quad| Vec4::from(quad).xyz().as_dvec3());
            (run, middle, normal)
        };
        let runs: Vec<_> = places.iter().enumerate().map(of_run).collect();
        let lists = [&mut host.of_vertices, &mut host.of_runs];
        for ((list, hidden), receivers) in lists.into_iter().zip(&boxes.hidden).zip([vertices, runs]) {
            let directions: Vec<u32> = hidden.directions.download(list.links.len())?;
            let of_receiver = |&(place, position, normal): &(usize, DVec3, DVec3)| {
                let (first, _, count) = list.range(place);
                let links = (first..).take(count);
                (first, links.map(|k| left(position, normal, list.links[k], directions[k])).collect::<Vec<_>>())
            };
            let found: Vec<(usize, Vec<u32>)> = receivers.par_iter().map(of_receiver).collect();
            for (first, left) in found {
                list.links[first..][..left.len()].copy_from_slice(&left);
            }
        }
        Ok(())
    }

    /// What every vertex receives from other groups, and the share of its view that they take.
    fn twin(
        &self,
        input: &TwinInput<'_>,
        of_runs: &[DVec3],
        bounced: bool,
        incoming: &mut [(DVec3, f64)],
    ) -> Result<()> {
        let clusters: Vec<Cluster> = self.clusters.download(self.cluster_count as usize)?;
        let entries: Vec<u32> = self.entries.download((self.entries.size_bytes / 4) as usize)?;
        let pairs: Vec<[u32; 2]> = self.pairs.download(self.pair_count as usize)?;
        let some = |first: u32, count: u32| &entries[first as usize..][..count as usize];
        let mut outgoing = vec![[(DVec3::ZERO, 0.0); OUTGOING]; input.objects.len()];
        for mover in &self.surfaces.movers {
            let object = &input.objects[mover.entity as usize];
            for run in &self.surfaces.runs[mover.run_first as usize..][..mover.run_count as usize] {
                let [middle, normal] = [run.middle, run.normal].map(|quad| Vec4::from(quad).xyz().as_dvec3());
                let mut light = of_runs[run.middle[3].to_bits() as usize];
                if bounced {
                    let place = object.centre + object.rotation * (middle * object.radius_m);
                    let runs = some(mover.far_first, mover.far_count);
                    let met = within_hemisphere(self.near_light(runs, of_runs, place, object.rotation * normal));
                    light += PI * DVec3::from(object.albedo_over_pi) * met;
                }
                for ((sum, area), weight) in outgoing[mover.entity as usize].iter_mut().zip(run.areas) {
                    *sum += f64::from(weight) * light;
                    *area += f64::from(weight);
                }
            }
        }
        let of_cluster = |cluster: &Cluster| {
            let receiver = &input.objects[cluster.receiver as usize];
            let (header, list) = some(cluster.entry_first, cluster.entry_count).split_at(CUT_HEADER);
            let [near_boxes, distant_boxes] = [header[7], header[8]].map(|count| count as usize);
            let (near, list) = list.split_at(header[3] as usize);
            let (far, list) = list.split_at(header[4] as usize);
            let middle = receiver.centre + Vec3::from(std::array::from_fn(|i| f32::from_bits(header[i]))).as_dvec3();
            let far = self.far_light(far, of_runs, middle);
            let pairs = pairs[header[5] as usize..][..header[6] as usize].iter();
            let spheres: Vec<Sphere> =
                pairs.map(|[_, packed]| self.sphere(*packed, &input.objects, &outgoing, middle)).collect();
            let of_vertex = |v: usize| {
                let vertex = (input.vertex)(cluster, v);
                let normal = receiver.rotation * vertex.normal;
                let (near, near_share) = self.near_light(near, of_runs, vertex.position, normal);
                let cosine = clamped_cosine(3, normal);
                let seen_far: DVec3 = far.iter().zip(&cosine).map(|((light, _), c)| *light * *c).sum();
                let far_share: f64 = far.iter().zip(&cosine).map(|((_, share), c)| share * c).sum();
                let at_rest = within_hemisphere((near + seen_far.max(DVec3::ZERO), near_share + far_share.max(0.0)));
                let mut sum = DVec3::ZERO;
                let mut taken = 0.0;
                let mut hidden = 0.0;
                for (place, sphere) in spheres.iter().enumerate() {
                    let cone = Cone::new(sphere.centre, sphere.radius_m, vertex.position);
                    let sine = (sphere.radius_m / cone.distance).min(1.0);
                    let share = sphere.weight * sphere_share(sine, normal.dot(cone.toward));
                    let share = share * own_visible(&vertex, receiver, &cone, sphere.radius_m);
                    sum += share * sphere.light;
                    taken += share;
                    hidden += if place < distant_boxes { share } else { 0.0 };
                }
                for (place, &packed) in list.iter().enumerate() {
                    let (entity, weight) = unpack(packed);
                    let object = &input.objects[entity];
                    let cone = Cone::new(object.centre, object.radius_m, vertex.position);
                    let to_object = object.rotation.inverse();
                    let from = to_object * (vertex.position - object.centre) / object.radius_m;
                    let (blocked, direction) = blocked_from(object, from);
                    let cosine = clamped_cosine(self.permutation.bands, to_object * normal);
                    let share: f64 = blocked.iter().zip(&cosine).map(|(b, c)| b * c).sum();
                    let own = own_visible(&vertex, receiver, &cone, object.radius_m);
                    let share = share * cone.above_horizon(normal, input.skip) * object.opacity / PI * own;
                    let share = f64::from(weight) * share.max(0.0);
                    sum += share * self.seen(entity, &outgoing[entity], from, direction);
                    taken += share;
                    hidden += if place < near_boxes { share } else { 0.0 };
                }
                let scale = 1.0 / f64::max(taken, 1.0);
                (at_rest * (1.0 - taken * scale) + sum * scale, (taken - hidden) * scale)
            };
            (0..cluster.vertex_count as usize).map(of_vertex).collect::<Vec<_>>()
        };
        let found: Vec<Vec<(DVec3, f64)>> = clusters.par_iter().map(of_cluster).collect();
        for (cluster, found) in clusters.iter().zip(found) {
            incoming[cluster.radiosity_first as usize..][..found.len()].copy_from_slice(&found);
        }
        Ok(())
    }

    /// What looks from the middle of a cluster as a mover does.
    fn sphere(
        &self,
        packed: u32,
        objects: &[MergeObject<'_>],
        outgoing: &[[(DVec3, f64); OUTGOING]],
        middle: DVec3,
    ) -> Sphere {
        let (entity, weight) = unpack(packed);
        let object = &objects[entity];
        let to = object.centre - middle;
        let from = object.rotation.inverse() * -to / object.radius_m;
        let (blocked, direction) = blocked_from(object, from);
        let cosine = (1.0 - blocked[0] / (2.0 * PI * Y00)).clamp(0.0, 1.0);
        Sphere {
            centre: middle - to.length() * (object.rotation * direction),
            radius_m: (1.0 - cosine * cosine).sqrt() * to.length(),
            light: self.seen(entity, &outgoing[entity], from, direction),
            weight: object.opacity * f64::from(weight),
        }
    }

    /// Mean radiosity of those surfaces of a mover that are seen from a place in its frame, along a direction.
    fn seen(&self, entity: usize, outgoing: &[(DVec3, f64); OUTGOING], from: DVec3, direction: DVec3) -> DVec3 {
        match &self.surfaces.cuboids[entity] {
            Some(cuboid) => seen_faces(cuboid, outgoing, from),
            None => seen(outgoing, direction),
        }
    }

    /// Sums of shares of the cosine-weighted hemisphere times radiosity, and of the shares.
    fn near_light(&self, entries: &[u32], of_runs: &[DVec3], place: DVec3, normal: DVec3) -> (DVec3, f64) {
        let of_entry = |entry: &u32| {
            let run = self.seen_run(*entry, place);
            let faces = -normal.dot(run.axis);
            let aside = (run.to.length_squared() - run.height * run.height).max(1e-20);
            let beyond = (aside - OVER * run.area / PI).max(0.0);
            let cosine = faces * run.height + (normal.dot(run.to) - faces * run.height) * (beyond / aside).sqrt();
            let width = SMOOTH * (run.area / PI).sqrt();
            let smoothed = (1.0 - faces * faces).max(0.0).sqrt() * run.height * width / (run.height + width);
            let cosine = 0.5 * (cosine + cosine.hypot(smoothed));
            let square = (run.height * run.height + beyond).max(1e-20);
            let share = run.weight * cosine * run.height * run.area / (square * (PI * square + run.area));
            (share * of_runs[run.number], share)
        };
        entries.iter().map(of_entry).fold((DVec3::ZERO, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
    }

    /// The same from a middle, for any normal: three bands of SH.
    fn far_light(&self, entries: &[u32], of_runs: &[DVec3], middle: DVec3) -> [(DVec3, f64); 9] {
        let mut sums = [(DVec3::ZERO, 0.0); 9];
        for entry in entries {
            let run = self.seen_run(*entry, middle);
            let square = run.to.length_squared().max(1e-20);
            let share = run.weight * run.height * run.area / (square.sqrt() * (PI * square + run.area));
            for ((light, whole), y) in sums.iter_mut().zip(values(3, run.to / square.sqrt())) {
                *light += share * y * of_runs[run.number];
                *whole += share * y;
            }
        }
        sums
    }

    fn seen_run(&self, entry: u32, place: DVec3) -> SeenRun {
        let (number, weight) = unpack(entry);
        let run = &self.far.runs[number];
        let to = run.middle.as_dvec3() - place;
        let area = f64::from(run.across.length());
        let axis = run.across.as_dvec3() / area.max(1e-20);
        SeenRun { number, weight: weight.into(), to, axis, area, height: (-to.dot(axis)).max(0.0) }
    }
}

/// A mover far away.
struct Sphere {
    centre: DVec3,
    radius_m: f64,
    light: DVec3,
    weight: f64,
}

/// Share of the cosine-weighted hemisphere that a sphere takes.
fn sphere_share(sine: f64, cosine: f64) -> f64 {
    let above = (cosine + sine).clamp(0.0, 2.0 * sine);
    sine * sine * cosine.max(above * above / (4.0 * sine).max(1e-20))
}

/// A run at rest, seen from a place.
struct SeenRun {
    number: usize,
    weight: f64,
    to: DVec3,
    axis: DVec3,
    area: f64,
    /// Of the place over the run's plane, metres.
    height: f64,
}

fn within_hemisphere((light, share): (DVec3, f64)) -> DVec3 {
    light / share.max(1.0)
}

/// How much of a sphere the vertex's own group leaves visible.
fn own_visible(vertex: &TwinVertex<'_>, receiver: &MergeObject<'_>, cone: &Cone, radius_m: f64) -> f64 {
    let direction = receiver.rotation.inverse() * cone.toward;
    if let Some(map) = vertex.map {
        let sine = (radius_m / cone.distance).min(1.0);
        return self_visibility::visible(map, vertex.normal, direction, sine, cone.distance / receiver.radius_m);
    }
    let Some(transfer) = vertex.transfer else { return 1.0 };
    let bands = transfer.len().isqrt();
    let basis = values(bands, direction);
    let seen: f64 = transfer.iter().zip(&basis).map(|(t, y)| f64::from(*t) * y).sum();
    let open: f64 = clamped_cosine(bands, vertex.normal).iter().zip(&basis).map(|(c, y)| c * y).sum();
    (seen / open.max(0.05)).clamp(0.0, 1.0)
}

/// The blocked part of a mover from a place in its frame, in r, and the direction against its middle.
fn blocked_from(object: &MergeObject<'_>, from: DVec3) -> ([f64; MAX_COEFFICIENTS], DVec3) {
    let field = object.blocked.expect("what reflects has an occlusion field");
    let mut blocked = [0.0; MAX_COEFFICIENTS];
    field.lookup(from, 0, &mut blocked);
    (blocked, DVec3::new(blocked[3], blocked[1], -blocked[2]).normalize_or_zero())
}

/// Mean radiosity of the faces of a box that are seen from a place in its frame, in r.
fn seen_faces(cuboid: &Cuboid, faces: &[(DVec3, f64); OUTGOING], from: DVec3) -> DVec3 {
    let mut light = DVec3::ZERO;
    let mut area = 0.0;
    for (face, (of_light, of_area)) in faces[..6].iter().enumerate() {
        let edge = cuboid.half_edges[face / 2] * if face % 2 == 0 { 1.0 } else { -1.0 };
        let to = from - edge;
        let height = to.dot(edge.normalize()).max(0.0);
        let weight = (height + UNFACED) * (to.length_squared() + UNFACED).powf(-1.5);
        light += weight * *of_light;
        area += weight * of_area;
    }
    light / f64::max(area, 1e-20)
}

/// Mean radiosity of those surfaces of a mover that are seen along a direction, which comes from the mover in its frame.
fn seen(outgoing: &[(DVec3, f64); OUTGOING], direction: DVec3) -> DVec3 {
    let basis = values(3, direction);
    let mut light = DVec3::ZERO;
    let mut area = 0.0;
    for ((of_light, of_area), y) in outgoing.iter().zip(&basis) {
        light += *of_light * *y;
        area += of_area * y;
    }
    light.max(DVec3::ZERO) / f64::max(area, 0.1 * basis[0] * outgoing[0].1)
}
