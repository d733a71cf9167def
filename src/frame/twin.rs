//! The CPU twin of a frame's merge.

use super::Frame;
use crate::bounce::twin::{TwinInput, TwinVertex};
use crate::error::Result;
use crate::field::cuboid::PlacedCuboid;
use crate::field::{Area, ShadowField, self_visibility};
use crate::gpu::Buffer;
use crate::layout::{CLUSTER_VERTICES, Cluster, ENTRY_ENTITIES, ListEntry, MOST_SUNS};
use crate::lists::gather::Globe;
use crate::merge::twin::{MergeObject, MergeTwin};
use crate::scene::{LightMethod, Placement};
use crate::scene_buffers::{self, DeviceSurface};
use crate::sh::basis::coefficient_count;
use crate::sharp::twin::{SharpLight, SharpObject, SharpTwin, SurfacePoint};
use glam::DVec3;
use std::collections::{BTreeSet, HashSet};
use std::f64::consts::PI;

impl Frame {
    /// Entities that stand on the list of any cluster of a receiver at this time, also by their boxes.
    pub fn listed(&self, placements: &[Placement], receiver: usize) -> BTreeSet<usize> {
        let lists = self.work.lists.entries_of(&self.state(placements), receiver);
        let of_box = |j: usize| j.checked_sub(placements.len()).map_or(j, |i| self.boxes[i][0]);
        lists.into_iter().flatten().map(|entry| of_box(ListEntry::entities(entry)[0] as usize)).collect()
    }

    /// The CPU twin of the merge in f64: radiosity of every receiver's vertices, by entity. Reads the fields back.
    pub fn twin(&self, placements: &[Placement]) -> Result<Vec<(usize, Vec<[f64; 3]>)>> {
        Ok(self.frame_twin(placements)?.run())
    }

    fn lights(&self, wanted: impl Fn(LightMethod) -> bool) -> Vec<usize> {
        let emits = |&index: &usize| self.scene.entities[index].emits && wanted(self.light_method(index));
        (0..self.scene.entities.len()).filter(emits).collect()
    }

    /// Everything that the CPU twin of a merge reads.
    fn frame_twin<'f>(&'f self, placements: &'f [Placement]) -> Result<FrameTwin<'f>> {
        let mut fields: Vec<[Option<ShadowField>; 2]> = Vec::new();
        for device_mesh in &self.buffers.meshes {
            let load = |slot: &Option<scene_buffers::FieldSlot>| {
                slot.as_ref().map(|slot| self.buffers.field(slot)).transpose()
            };
            fields.push(
                [load(&device_mesh.blocked)?, load(&device_mesh.radiance)?]
                    .map(|field| field.as_ref().map(ShadowField::widened)),
            );
        }
        let state = self.state(placements);
        let mut receivers = Vec::new();
        for index in (0..self.scene.entities.len()).filter(|&index| self.scene.entities[index].receives) {
            let mesh = self.scene.surface(index);
            let surface = self.buffers.surface(index);
            let entities = |list: Vec<u32>| list.into_iter().map(|entry| ListEntry::entities(entry).into()).collect();
            let lists = || self.work.lists.entries_of(&state, index).into_iter().map(entities).collect();
            let listed = (self.options.eps > 0.0).then(lists);
            let centre_m = self.buffers.meshes[self.scene.entities[index].mesh].centre_m;
            receivers.push(Receiver {
                index,
                occluders: self.occluders(&state.scene_bounds, index),
                positions: mesh.positions.iter().map(|p| p.as_dvec3() - centre_m).collect(),
                normals: mesh.normals.iter().map(|n| n.as_dvec3()).collect(),
                transfer: self.buffers.transfer(surface)?,
                // Without a threshold the twin looks at everything, which is what the lists are held against.
                clusters: (cluster_of(surface), listed),
                near: self.work.lists.near_of(index).map(<[u32]>::to_vec).collect(),
            });
        }
        Ok(FrameTwin {
            frame: self,
            placements,
            fields,
            receivers,
            lights: self.lights(|method| !method.is_sharp()),
            sharp_lights: self.lights(LightMethod::is_sharp),
            globes: state.scene_bounds.globes,
            sky: self.scene.environment.coefficients(self.options.bake.bands),
        })
    }
}

/// The CPU twin of a merge, ready to run.
struct FrameTwin<'f> {
    frame: &'f Frame,
    placements: &'f [Placement],
    /// Occlusion and radiance by mesh.
    fields: Vec<[Option<ShadowField>; 2]>,
    receivers: Vec<Receiver>,
    lights: Vec<usize>,
    sharp_lights: Vec<usize>,
    globes: Vec<Globe>,
    sky: [Vec<f64>; 3],
}

/// A lit entity with the data that its twin borrows.
struct Receiver {
    index: usize,
    occluders: Vec<usize>,
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    transfer: Option<(Vec<f32>, usize)>,
    /// The cluster of every vertex, and what stands on each cluster's list where some may be left out.
    clusters: (Vec<usize>, Option<Listed>),
    /// For each cluster the entities whose shadows of sharp lights its maps have.
    near: Vec<Vec<u32>>,
}

impl FrameTwin<'_> {
    /// Every entity as the merge sees it.
    fn objects(&self) -> Vec<MergeObject<'_>> {
        let Frame { scene, buffers, .. } = self.frame;
        let object = |(index, placement): (usize, &Placement)| {
            let entity = &scene.entities[index];
            let [blocked, radiance] = &self.fields[entity.mesh];
            MergeObject {
                centre: self.frame.centre(index, placement),
                rotation: placement.turn(),
                scale: placement.scale.into(),
                radius_m: buffers.meshes[entity.mesh].radius_m * f64::from(placement.scale),
                albedo_over_pi: (entity.albedo.as_dvec3() / PI).to_array(),
                emission: entity.emission.as_dvec3().to_array(),
                blocked: blocked.as_ref(),
                area: buffers.meshes[entity.mesh].blocked.as_ref().map_or(Area::default(), |slot| slot.area),
                radiance: radiance.as_ref().filter(|_| entity.emits),
                sheet: self.frame.sheet(index, placement),
                opacity: entity.opacity.into(),
            }
        };
        self.placements.iter().enumerate().map(object).collect()
    }

    fn receiver(&self, index: usize) -> &Receiver {
        self.receivers.iter().find(|receiver| receiver.index == index).expect("only receivers have clusters")
    }

    /// Radiosity of every receiver's vertices, by entity, on all threads.
    pub fn run(&self) -> Vec<(usize, Vec<[f64; 3]>)> {
        let Frame { scene, options, .. } = self.frame;
        let objects = self.objects();
        let outlines = objects.iter().enumerate().map(|o| self.outline(o));
        let outlines: Vec<SharpObject<'_>> = outlines
            .chain(self.frame.boxes.iter().map(|[entity, number]| self.box_outline(*entity, *number)))
            .collect();
        let lit = |receiver: &Receiver| {
            let leaves = |v: usize, j: usize, light: Option<usize>| {
                let (cluster_of, listed) = &receiver.clusters;
                let is_own = j < objects.len()
                    && self.frame.groups.is_own(receiver.index, j)
                    && light.is_none_or(|l| {
                        let is_sharp = self.frame.light_method(l).is_sharp() && l != j;
                        is_sharp && receiver.near[cluster_of[v]].binary_search(&(j as u32)).is_ok()
                    });
                if is_own {
                    return true;
                }
                let Some(listed) = listed else { return false };
                !listed[cluster_of[v]].contains(&(j as u32, light.map_or(ENTRY_ENTITIES, |l| l as u32)))
            };
            let with_field =
                |j: &usize| objects.get(*j).is_some_and(|object| object.blocked.is_some() || object.sheet.is_some());
            let occluders: Vec<usize> = receiver.occluders.iter().copied().filter(with_field).collect();
            let twin = MergeTwin {
                objects: &objects,
                receiver: receiver.index,
                occluders: &occluders,
                lights: &self.lights,
                sky: (!scene.environment.is_none()).then_some(&self.sky),
                volume: self
                    .frame
                    .buffers
                    .volume
                    .as_deref()
                    .filter(|volume| self.frame.groups.moves_among(receiver.index, &volume.has)),
                positions: &receiver.positions,
                normals: &receiver.normals,
                transfer: receiver.transfer.as_ref().map(|(floats, stride)| (&floats[..], *stride)),
                bands: options.bake.bands,
                skip: options.skip,
                leaves: &leaves,
            };
            let mut lit = twin.run();
            self.add_sharp(receiver, &objects[receiver.index], &outlines, &leaves, &mut lit);
            (receiver.index, lit)
        };
        self.receivers.iter().map(lit).collect()
    }

    /// An object as the pass of sharp lights sees it.
    fn outline<'o>(&'o self, (index, object): (usize, &MergeObject<'o>)) -> SharpObject<'o> {
        let device_mesh = &self.frame.buffers.meshes[self.frame.scene.entities[index].mesh];
        let by_boxes = self.frame.scene.casts_as_boxes(index);
        SharpObject {
            centre: object.centre,
            rotation: object.rotation,
            radius_m: object.radius_m,
            silhouette: device_mesh.slots.silhouette.as_ref().filter(|_| !by_boxes).map(|slot| &*slot.content),
            area: device_mesh.area(),
            cuboid: self.frame.cuboid(index).map(|slot| slot.content),
            sheet: object.sheet,
            opacity: object.opacity,
        }
    }

    /// A box of an entity as that pass sees it.
    fn box_outline(&self, entity: usize, number: usize) -> SharpObject<'_> {
        let placement = &self.placements[entity];
        let PlacedCuboid { centre_m, radius_m, cuboid } = self.frame.box_slot(entity, number).content;
        SharpObject {
            centre: placement.point(centre_m),
            rotation: placement.turn(),
            radius_m: radius_m * f64::from(placement.scale),
            silhouette: None,
            area: None,
            cuboid: Some(cuboid).filter(|_| self.frame.scene.casts_as_boxes(entity)),
            sheet: None,
            opacity: 1.0,
        }
    }

    fn add_sharp(
        &self,
        receiver: &Receiver,
        object: &MergeObject<'_>,
        outlines: &[SharpObject<'_>],
        leaves: &(dyn Fn(usize, usize, Option<usize>) -> bool + Sync),
        lit: &mut [[f64; 3]],
    ) {
        let light = |&entity: &usize| SharpLight {
            entity,
            emission: self.frame.scene.entities[entity].emission.as_dvec3(),
            colors: self.frame.buffers.meshes[self.frame.scene.entities[entity].mesh]
                .slots
                .lamp_colors
                .as_ref()
                .map(|slot| &*slot.content),
            method: self.frame.light_method(entity),
            spot: self.frame.scene.entities[entity].spot,
        };
        let lights: Vec<SharpLight<'_>> =
            self.sharp_lights.iter().filter(|l| **l != receiver.index).map(light).collect();
        let has_edge = |j: &usize| {
            let SharpObject { silhouette, cuboid, sheet, .. } = &outlines[*j];
            silhouette.is_some() || cuboid.is_some() || sheet.is_some()
        };
        let occluders: Vec<usize> = receiver.occluders.iter().copied().filter(has_edge).collect();
        let self_maps = &self.frame.buffers.surface(receiver.index).self_maps;
        let point = |(position, normal): (&DVec3, &DVec3)| SurfacePoint {
            position: object.centre + object.rotation * (*position * object.scale),
            normal: object.rotation * *normal,
            own_normal: *normal,
        };
        let points: Vec<SurfacePoint> = receiver.positions.iter().zip(&receiver.normals).map(point).collect();
        let told_suns = &self.frame.buffers.surface(receiver.index).told_suns;
        let sun_bits = self.frame.sun_bits(self.placements);
        let twin = SharpTwin {
            objects: outlines,
            occluders: &occluders,
            receiver: receiver.index,
            self_maps: self_maps.as_deref().map(|maps| &maps[..]),
            lights: &lights,
            leaves: &|v, j, light| leaves(v, j, Some(light)),
            sees: &|v, light| {
                let told = told_suns.as_ref().map_or(0, |told| told[v]);
                let told = told & sun_bits.get(&light).copied().unwrap_or(0);
                let is_free = told >> (2 * MOST_SUNS) != 0;
                if told & ((1 << MOST_SUNS) - 1) != 0 { Some(false) } else { is_free.then_some(true) }
            },
            encloses: &|v, j, light| {
                let is_around = |globe: &&Globe| [globe.occluder, globe.light] == [j as u32, light as u32];
                let globe = self.globes.iter().find(is_around);
                globe.is_some_and(|globe| !globe.mesh.holds(globe.placement.local(points[v].position)))
            },
        };
        let albedo = self.frame.scene.entities[receiver.index].albedo.as_dvec3();
        for (to, from) in lit.iter_mut().zip(twin.run(&points)) {
            *to = (DVec3::from_array(*to) + albedo * from).to_array();
        }
    }
}

impl Frame {
    /// The light of all vertices after bounces, as they are stored, and what the twin finds from the same direct light;
    /// `None` where light does not bounce.
    pub fn bounced_beside_twin(&self, placements: &[Placement]) -> Result<Option<[Vec<DVec3>; 2]>> {
        let Some(bounce) = &self.bounce else { return Ok(None) };
        let vector = |[x, y, z, _]: [f32; 4]| DVec3::new(x.into(), y.into(), z.into());
        let light = |buffer: &Buffer| -> Result<Vec<DVec3>> {
            Ok(buffer.download((buffer.size_bytes / 16) as usize)?.into_iter().map(vector).collect())
        };
        let twin = self.frame_twin(placements)?;
        let objects = twin.objects();
        let vertex = |cluster: &Cluster, v: usize| {
            let receiver = twin.receiver(cluster.receiver as usize);
            let surface = self.buffers.surface(receiver.index);
            let v = surface.order[cluster.vertex_first as usize - surface.vertices.start as usize + v] as usize;
            let object = &objects[receiver.index];
            let count = coefficient_count(self.options.bake.bands);
            TwinVertex {
                position: object.centre + object.rotation * (receiver.positions[v] * object.scale),
                normal: receiver.normals[v],
                transfer: receiver.transfer.as_ref().map(|(floats, stride)| &floats[v * stride..][..count]),
                map: surface
                    .self_maps
                    .as_ref()
                    .map(|maps| &maps[v * self_visibility::BYTES..][..self_visibility::BYTES]),
            }
        };
        let direct = light(self.radiosity.direct())?;
        let passes = match self.radiosity.lamps() {
            Some(lamps) => lamps.download::<f32>(direct.len())?.iter().map(|share| 1.0 - f64::from(*share)).collect(),
            None => vec![1.0; direct.len()],
        };
        let input =
            TwinInput { direct: &direct, passes: &passes, objects: &objects, skip: self.options.skip, vertex: &vertex };
        let wanted = bounce.twin(&input, &bounce.steps(self.options.bounces))?;
        Ok(Some([light(&self.radiosity.merged)?, wanted]))
    }
}

/// What stands on each cluster's list: entity and light, or the sky's number.
type Listed = Vec<HashSet<(u32, u32)>>;

/// The cluster of every vertex of a surface.
fn cluster_of(surface: &DeviceSurface) -> Vec<usize> {
    let mut cluster_of = vec![0; surface.order.len()];
    for (place, &v) in surface.order.iter().enumerate() {
        cluster_of[v as usize] = place / CLUSTER_VERTICES as usize;
    }
    cluster_of
}
