//! What an entity is to the merge at one time: its place, rotation and light; and the clusters of a receiver.

use super::Frame;
use crate::field::cuboid::{Cuboid, PlacedCuboid};
use crate::field::quantity::channel_stride;
use crate::field::sheet::{Rectangle, Sheet};
use crate::field::sub_light::LampFace;
use crate::field::{Fit, self_visibility};
use crate::layout::{self, CLUSTER_VERTICES, LAMP_AT_REST, MOST_SUN_MAPS, NONE, pack_suns};
use crate::lists::gather::{ClusterBounds, EntityBounds, Globe, Occludes, OutlineShape, OutlineView, SceneBounds};
use crate::lists::incremental::{Member, State};
use crate::lists::sight::TriangleRun;
use crate::scene::{LightMethod, Placement};
use crate::scene_buffers::{self, FieldSlot, Slot};
use crate::sh::rotation::turns;
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::PI;

impl Frame {
    /// All that lists and merge depend on at this time.
    pub(super) fn state(&self, placements: &[Placement]) -> State {
        let of_entities = || placements.iter().enumerate();
        let of_boxes = || self.boxes.iter().map(|[entity, number]| (*entity, *number, &placements[*entity]));
        let sun_bits = self.sun_bits(placements);
        let light_maps = self.light_map_bits(placements);
        let lamp_maps = |entity: usize| light_maps[entity] >> MOST_SUN_MAPS;
        let bounds = of_entities()
            .map(|(index, p)| EntityBounds { lamp_maps: lamp_maps(index), ..self.entity_bounds(index, p) });
        let bounds = bounds.chain(of_boxes().map(|(entity, number, p)| EntityBounds {
            lamp_maps: lamp_maps(entity),
            ..self.box_bounds(entity, number, p)
        }));
        let bounds: Vec<EntityBounds> = bounds.collect();
        let entities = of_entities().map(|(index, p)| {
            let lamp_bit = if self.ends_links(index, p) { LAMP_AT_REST } else { 0 };
            let sun_bits = sun_bits.get(&index).copied().unwrap_or(lamp_bit);
            layout::DeviceEntity { sun_bits, light_maps: light_maps[index], ..self.entity(index, p) }
        });
        let entities = entities.chain(of_boxes().map(|(entity, number, p)| layout::DeviceEntity {
            light_maps: light_maps[entity],
            ..self.box_entity(entity, number, p)
        }));
        let white = f64::from(self.scene.data.output.white());
        let sky = (!self.scene.environment.is_none()).then_some(self.sky.brightest);
        let eps = f64::from(self.options.eps) * white;
        State {
            entities: entities.collect(),
            scene_bounds: SceneBounds {
                outlines: self.outlines_at(placements),
                globes: self.globes_at(placements),
                groups: Some(self.groups.clone()),
                volume: self.buffers.volume.clone(),
                ..SceneBounds::new(bounds, sky, self.options.skip, eps)
            },
            placements: placements.to_vec(),
        }
    }

    /// Outlines of all entities and their boxes, if any light is sharp.
    fn outlines_at(&self, placements: &[Placement]) -> Vec<Option<OutlineView>> {
        let outline = |(index, placement): (usize, &Placement)| {
            let entity = &self.scene.entities[index];
            let shape = match (self.cuboid(index), &self.buffers.meshes[entity.mesh].slots.silhouette) {
                (Some(slot), _) => OutlineShape::Cuboid(slot.content),
                (_, Some(slot)) if entity.occludes && !self.scene.casts_as_boxes(index) => {
                    OutlineShape::Maps(slot.content.clone())
                }
                _ => return None,
            };
            Some(OutlineView { shape, to_object: placement.turn().inverse(), opaque: entity.opacity >= 1.0 })
        };
        let of_box = |[entity, number]: &[usize; 2]| {
            let shape = OutlineShape::Cuboid(self.box_slot(*entity, *number).content.cuboid);
            Some(OutlineView { shape, to_object: placements[*entity].turn().inverse(), opaque: true })
        };
        let all = || placements.iter().enumerate().map(outline).chain(self.boxes.iter().map(of_box)).collect();
        self.sharp.as_ref().map_or(Vec::new(), |_| all())
    }

    /// Globes of glass and the sharp lights within.
    fn globes_at(&self, placements: &[Placement]) -> Vec<Globe> {
        let count = self.scene.entities.len();
        let shines = |light: &usize| self.scene.entities[*light].emits && self.light_method(*light).is_sharp();
        let of_globe = |occluder: usize| {
            let mesh = self.scene.caster(self.scene.entities[occluder].mesh);
            let placement = placements[occluder];
            let is_within = move |light: &usize| {
                let place = self.centre(*light, &placements[*light]);
                *light != occluder && mesh.holds(placement.local(place))
            };
            let globe = move |light: usize| Globe {
                occluder: occluder as u32,
                light: light as u32,
                mesh: mesh.clone(),
                placement,
            };
            (0..count).filter(shines).filter(is_within).map(globe)
        };
        (0..count).filter(|&occluder| self.scene.is_globe(occluder)).flat_map(of_globe).collect()
    }

    fn entity_bounds(&self, index: usize, placement: &Placement) -> EntityBounds {
        let entity = &self.scene.entities[index];
        let device_mesh = &self.buffers.meshes[entity.mesh];
        // A field that nobody needs was not baked, and one of zeros changes nothing.
        let holds = |slot: &Option<FieldSlot>| slot.as_ref().is_some_and(|slot| !slot.is_empty);
        let sharp = entity.emits && self.light_method(index).is_sharp();
        let coloured = device_mesh.radiance.is_some() && entity.emits && !sharp;
        let source = if coloured { &device_mesh.radiance } else { &device_mesh.blocked };
        let facing = entity.spot.map(|spot| (placement.turn() * DVec3::Y, f64::from(spot.outer_deg).to_radians()));
        let brightest = match &device_mesh.slots.lamp_colors {
            Some(slot) if sharp => slot.content.brightest,
            _ => device_mesh.radiance.as_ref().filter(|_| coloured).map_or(1.0, |s| s.header.radiance_scale.into()),
        };
        let blocks_soft = holds(&device_mesh.blocked) || device_mesh.rectangle.is_some();
        let blocks_sharp = device_mesh.slots.silhouette.is_some()
            || device_mesh.rectangle.is_some()
            || (self.sharp.is_some() && self.cuboid(index).is_some());
        let occludes = match entity.occludes {
            true if self.scene.casts_as_boxes(index) && blocks_soft => Occludes::Soft,
            true if !self.scene.casts_as_boxes(index) && (blocks_soft || blocks_sharp) => Occludes::All,
            _ => Occludes::Nothing,
        };
        EntityBounds {
            centre: self.centre(index, placement),
            radius_m: self.radius_m(index, placement),
            reflectance: entity.reflection().map_or(f64::from(entity.albedo.max_element()), |_| 1.0),
            occludes,
            emits: entity.emits && (sharp || holds(source)),
            sharp,
            coloured,
            sheet: self.sheet(index, placement).filter(|_| entity.occludes),
            radiance: f64::from(entity.emission.max_element()) * brightest,
            facing,
            lamp_maps: 0,
        }
    }

    /// Whether all that occludes and rested when it was baked stands where it stood.
    pub(super) fn has_rested(&self, placements: &[Placement]) -> bool {
        self.stood.iter().all(|(entity, stood)| placements[*entity] == *stood)
    }

    /// Of each sun that stands where it stood when that was baked, its bits of what vertices tell: the last where all that
    /// occludes is known; none where something that rested has moved.
    pub(super) fn sun_bits(&self, placements: &[Placement]) -> HashMap<usize, u32> {
        if self.told_suns.is_empty() || !self.has_rested(placements) {
            return HashMap::new();
        }
        let blocks = |entity: &usize| self.scene.entities[*entity].occludes;
        let is_known = (0..self.scene.entities.len()).filter(blocks).all(|entity| self.scene.rests_opaque(entity));
        let suns = self.told_suns.iter().enumerate().filter(|(_, told)| placements[told.entity] == told.stood);
        let bits = |place: usize| pack_suns(1 << place, 1 << place, u32::from(is_known) << place);
        suns.map(|(place, told)| (told.entity, bits(place))).collect()
    }

    fn entity(&self, index: usize, placement: &Placement) -> layout::DeviceEntity {
        let entity = &self.scene.entities[index];
        let device_mesh = &self.buffers.meshes[entity.mesh];
        let rotation = placement.turn();
        let [cos_a, sin_a, cos_b, sin_b, cos_c, sin_c] = turns(rotation).map(|x| x as f32);
        let centre = self.centre(index, placement).as_vec3();
        let radius_m = self.radius_m(index, placement);
        let method = self.light_method(index);
        let is_sharp = entity.emits && method.is_sharp();
        let emission = match (&device_mesh.radiance, &device_mesh.slots.lamp_colors) {
            (_, Some(slot)) if is_sharp => entity.emission * slot.content.mean.as_vec3(),
            (Some(slot), _) if entity.emits && !is_sharp => entity.emission * slot.header.radiance_scale,
            _ => entity.emission,
        };
        let radiance_base = match (&device_mesh.radiance, &device_mesh.slots.lamp_colors) {
            (_, colors) if is_sharp => colors.as_ref().map_or(NONE, |slot| slot.first_quad),
            (field, _) => field.as_ref().map_or(0, FieldSlot::quad),
        };
        let slot = device_mesh.blocked.as_ref().or(device_mesh.radiance.as_ref());
        // Both fields of a mesh have the same shells.
        let radial = slot.map_or([0.0; 4], |slot| {
            let lattice = slot.header.lattice;
            let (slope, offset) = lattice.radial_map();
            [slope as f32, offset as f32, lattice.inner as f32, lattice.outer as f32]
        });
        let area = device_mesh.area().unwrap_or_default();
        let sheet = self.sheet(index, placement).map(|sheet| sheet.rectangle);
        let axes = sheet.map_or(area.axes.map(|axis| rotation * axis), |rectangle| rectangle.axes);
        let [area_x, area_y] = axes.map(|axis| axis.as_vec3());
        let terms = area.terms.map(|term| term as f32);
        let [light_size, light_ratio] = match method {
            LightMethod::Ball(share) | LightMethod::LampFace(LampFace::Disc(share)) => [share, 0.0],
            LightMethod::LampFace(face) => [face.half().x, face.half().y / face.half().x],
            LightMethod::Harmonics | LightMethod::Outline => [0.0; 2],
        };
        let shift = slot.map_or(Fit::ROUND.packed(), |slot| slot.header.lattice.packed());
        let maps = device_mesh.slots.silhouette.as_ref().map(|slot| slot.first_quad);
        layout::DeviceEntity {
            centre: centre.extend((1.0 / radius_m) as f32).to_array(),
            alpha_beta: [cos_a, sin_a, cos_b, sin_b],
            gamma: [cos_c, sin_c],
            emission: emission.to_array(),
            opacity: entity.opacity,
            shift,
            albedo: (entity.albedo.as_dvec3() / PI).as_vec3().to_array(),
            scale: placement.scale,
            radial,
            area_x: area_x.extend(terms[0]).to_array(),
            area_y: area_y.extend(terms[1]).to_array(),
            area_terms: [terms[2], terms[3], terms[4], terms[5]],
            silhouette: self.cuboid(index).map(|slot| slot.first_quad).or(maps).unwrap_or(0),
            light_kind: method.kind() as u32,
            light_size: light_size as f32,
            light_ratio: light_ratio as f32,
            light_thin: if let LightMethod::LampFace(LampFace::Tube { thin, .. }) = method { thin as f32 } else { 0.0 },
            light_ramp: entity.spot.map_or([0.0, 1.0], |spot| spot.ramp().map(|x| x as f32)),
            half_sides: sheet.map_or([0.0; 2], |rectangle| rectangle.half_m.map(|half| half as f32)),
            blocked_base: device_mesh.blocked.as_ref().map_or(0, FieldSlot::quad),
            radiance_base,
            irradiance_first: self.radiosity.irradiance_first(index).unwrap_or(NONE),
            ..layout::DeviceEntity::default()
        }
    }

    /// Whether links of what rests end at a lamp.
    fn ends_links(&self, index: usize, placement: &Placement) -> bool {
        self.scene.is_lamp_at_rest(index)
            && self.groups.is_seen_by_own(index)
            && *placement == self.scene.data.entities[index].fixed()
    }

    pub(super) fn box_slot(&self, entity: usize, number: usize) -> Slot<PlacedCuboid> {
        self.buffers.meshes[self.scene.entities[entity].mesh].slots.boxes[number]
    }

    fn box_bounds(&self, entity: usize, number: usize, placement: &Placement) -> EntityBounds {
        let PlacedCuboid { centre_m, radius_m, .. } = self.box_slot(entity, number).content;
        let stands = self.sharp.is_some() && self.scene.casts_as_boxes(entity);
        EntityBounds {
            centre: placement.point(centre_m),
            radius_m: radius_m * f64::from(placement.scale),
            occludes: if stands { Occludes::Sharp } else { Occludes::Nothing },
            ..EntityBounds::default()
        }
    }

    fn box_entity(&self, entity: usize, number: usize, placement: &Placement) -> layout::DeviceEntity {
        let Slot { first_quad, content: PlacedCuboid { centre_m, radius_m, .. } } = self.box_slot(entity, number);
        let [cos_a, sin_a, cos_b, sin_b, cos_c, sin_c] = turns(placement.turn()).map(|x| x as f32);
        let inverse_radius = (1.0 / (radius_m * f64::from(placement.scale))) as f32;
        layout::DeviceEntity {
            centre: placement.point(centre_m).as_vec3().extend(inverse_radius).to_array(),
            alpha_beta: [cos_a, sin_a, cos_b, sin_b],
            gamma: [cos_c, sin_c],
            opacity: 1.0,
            scale: placement.scale,
            silhouette: first_quad,
            irradiance_first: NONE,
            ..layout::DeviceEntity::default()
        }
    }

    /// Radius of an entity's bounding sphere in the world, metres.
    pub(super) fn radius_m(&self, index: usize, placement: &Placement) -> f64 {
        self.buffers.meshes[self.scene.entities[index].mesh].radius_m * f64::from(placement.scale)
    }

    /// Centre of an entity's bounding sphere in the world, metres.
    pub(super) fn centre(&self, index: usize, placement: &Placement) -> DVec3 {
        placement.point(self.buffers.meshes[self.scene.entities[index].mesh].centre_m)
    }

    /// How the light of an entity is computed.
    pub fn light_method(&self, index: usize) -> LightMethod {
        self.methods[index]
    }

    /// Whether an entity, or a box of one, occludes and something sees it.
    fn may_occlude(&self, index: usize) -> bool {
        let Some(entity) = self.scene.entities.get(index) else { return true };
        let device_mesh = &self.buffers.meshes[entity.mesh];
        let blocks = device_mesh.rectangle.is_some() || device_mesh.blocked.is_some();
        entity.occludes && (blocks || device_mesh.slots.silhouette.is_some() || self.cuboid(index).is_some())
    }

    /// The box as which an entity blocks sharp lights.
    pub(super) fn cuboid(&self, index: usize) -> Option<Slot<Cuboid>> {
        let slot = self.buffers.meshes[self.scene.entities[index].mesh].slots.cuboid;
        slot.filter(|_| self.scene.casts_as_box(index))
    }

    /// The rectangle that an entity is in the world, if its mesh is one.
    pub(super) fn sheet(&self, index: usize, placement: &Placement) -> Option<Sheet> {
        let Rectangle { axes, half_m } = self.buffers.meshes[self.scene.entities[index].mesh].rectangle?;
        let rotation = placement.turn();
        let scale = f64::from(placement.scale);
        let half = |axis: usize| scale * (half_m[axis] + self.reaches[index][axis]);
        let rectangle = Rectangle { axes: axes.map(|axis| rotation * axis), half_m: [half(0), half(1)] };
        Some(Sheet { centre: self.centre(index, placement), rectangle })
    }

    /// Occluders of a receiver, entities and their boxes, in their order, [`SceneBounds::order`]; itself left out.
    pub(super) fn occluders(&self, scene_bounds: &SceneBounds, receiver: usize) -> Vec<usize> {
        let mut order: Vec<usize> =
            (0..scene_bounds.spheres.len()).filter(|&j| self.may_occlude(j) && j != receiver).collect();
        order.sort_by_cached_key(|&j| scene_bounds.order(receiver as u32, j as u32));
        order
    }
}

/// Clusters of one receiver, without entries; `radiosity_first` is its first vertex in the radiosity buffer.
pub(super) fn clusters(
    receiver: usize,
    surface: &scene_buffers::DeviceSurface,
    radiosity_first: u64,
    bands: usize,
) -> Vec<Member> {
    let transfer_quads = (channel_stride(bands) / 4) as u32;
    let cluster = |(i, (bounds, faces)): (usize, (&ClusterBounds, &TriangleRun))| {
        let first = i as u32 * CLUSTER_VERTICES;
        let cluster = layout::Cluster {
            receiver: receiver as u32,
            vertex_first: surface.vertices.start + first,
            vertex_count: (surface.vertices.len() as u32 - first).min(CLUSTER_VERTICES),
            transfer_first: match surface.transfer_first {
                NONE => NONE,
                quad => quad + first * transfer_quads,
            },
            radiosity_first: radiosity_first as u32 + first,
            self_first: match surface.self_first {
                NONE => NONE,
                word => word + first * self_visibility::CELLS as u32,
            },
            ..Default::default()
        };
        Member { cluster, bounds: *bounds, faces: *faces, near: Vec::new(), differs: false }
    };
    surface.clusters.iter().zip(&surface.faces).enumerate().map(cluster).collect()
}
