//! A frame on one screen: upload, passes in order, the barriers between them.
//!
//! ```text
//! placements -> entities, rotations, occluder lists (host) -> merge (a dispatch a receiver and group of lights)
//!            -> radiosity -> draw -> picture -> read back
//! ```

pub mod camera;
pub mod store;

use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::error::Result;
use crate::field::Lookup;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device, TexelView, Timing};
use crate::layout;
use crate::render::calibrate;
use crate::render::draw::{Draw, Item};
use crate::render::merge::{Inputs, Job, Merge, Readable, rotation_stride};
use crate::render::reference::{Object, Task};
use crate::render::variant::{Form, MAX_LIGHTS, UNIFORM_ENTITIES, Variant};
use crate::scene::{Placement, Scene};
use crate::sh::basis::{Y00, coefficient_count};
use crate::sh::rotation::Rotation;
use crate::{bake, field};
use ash::vk;
use glam::{DMat4, DVec3, Vec3};
use half::f16;
use std::f64::consts::PI;
use std::sync::Arc;
use store::{ALIGNMENT, Progress, Store};

/// What decides a frame besides the scene.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Fields and transfers.
    pub bake: bake::Options,
    /// Which samples a lookup takes.
    pub lookup: Lookup,
    /// How the merge is done; `None` takes what was measured to be the device's fastest.
    pub variant: Option<Variant>,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// Whether pictures are multisampled where the device can.
    pub multisample: bool,
}

/// Reads of one merge, as bytes of its receivers in the radiosity buffer.
#[derive(Clone, Debug)]
struct Receiver {
    entity: usize,
    jobs: std::ops::Range<usize>,
}

/// A scene on a device, ready to be lit and drawn at any time.
pub struct Frame {
    device: Arc<Device>,
    scene: Scene,
    options: Options,
    /// Baked and uploaded data.
    pub store: Store,
    /// Variant in use.
    pub variant: Variant,
    merge: Merge,
    draw: Draw,
    entities: Buffer,
    rotations: Buffer,
    list: Buffer,
    sky: Buffer,
    radiosity: Buffer,
    radiosity_offsets: Vec<u64>,
    readback: Buffer,
    receivers: Vec<Receiver>,
    jobs: Vec<Job>,
    background: Vec3,
}

impl Frame {
    /// Bakes or finds what the scene needs and builds the passes.
    ///
    /// # Errors
    /// As [`Store::new`], [`Merge::new`] and [`Draw::new`].
    pub fn new(baker: &Baker, cache: &Cache, scene: &Scene, options: Options, progress: Progress<'_>) -> Result<Self> {
        let (device, library) = (baker.device(), baker.library());
        let store = Store::new(baker, cache, scene, &options.bake, progress)?;
        let wanted = options.variant.map_or_else(|| calibrate::fastest(device, library), Ok)?;
        let variant = usable(device, &store, scene.entities.len(), wanted);

        let lights: Vec<u32> = indices(scene, |e| e.emits);
        let occluder_count = scene.entities.iter().filter(|e| e.occludes).count() as u32;
        let mut radiosity_offsets = Vec::new();
        let (mut radiosity_size, mut jobs, mut receivers) = (0, Vec::new(), Vec::new());
        for (index, entity) in scene.entities.iter().enumerate() {
            let geometry = &store.geometries[entity.mesh];
            radiosity_offsets.push(radiosity_size);
            let bytes = radiosity_size..radiosity_size + 16 * geometry.vertices.len() as u64;
            radiosity_size = bytes.end.next_multiple_of(ALIGNMENT);
            let first = jobs.len();
            if entity.receives {
                let list = occluder_count * receivers.len() as u32;
                let base = Job {
                    receiver: index as u32,
                    vertices: geometry.vertices.clone(),
                    transfer_first: geometry.transfer_first,
                    occluders: list..list + occluder_count - u32::from(entity.occludes),
                    lights: Vec::new(),
                    sky: !scene.environment.is_none(),
                    accumulate: false,
                    radiosity: bytes,
                };
                jobs.extend(split_lights(&base, &lights));
                receivers.push(Receiver { entity: index, jobs: first..jobs.len() });
            }
        }

        let kinds: Vec<_> = jobs.iter().map(|job| (job.lights.len(), job.sky)).collect();
        let merge = Merge::new(device, library, form(&options, variant), &kinds)?;
        let draw = Draw::new(device, library, options.size, options.multisample)?;
        let count = scene.entities.len().max(UNIFORM_ENTITIES as usize) as u64;
        let upload = |name: &str, bytes: u64| Buffer::new(device, name, BufferKind::Upload, bytes);
        let bands = options.bake.bands;
        let mut radiosity = Buffer::new(device, "radiosity", BufferKind::Device, radiosity_size.max(16))?;
        radiosity.fill(0, &vec![0.0_f32; radiosity.size_bytes as usize / 4])?;
        let mut sky = upload("sky", 16 * coefficient_count(bands) as u64)?;
        let channels = scene.environment.coefficients(bands);
        let quads: Vec<[f32; 4]> = (0..coefficient_count(bands))
            .map(|k| [channels[0][k] as f32, channels[1][k] as f32, channels[2][k] as f32, 0.0])
            .collect();
        sky.write(0, &quads);
        Ok(Frame {
            device: device.clone(),
            scene: scene.clone(),
            options,
            variant,
            merge,
            draw,
            entities: upload("entities", count * size_of::<layout::Entity>() as u64)?,
            rotations: upload("rotations", count * 4 * rotation_stride(bands) as u64)?,
            list: upload("list", 4 * u64::from(occluder_count) * receivers.len().max(1) as u64)?,
            sky,
            radiosity,
            radiosity_offsets,
            readback: Buffer::new(
                device,
                "readback",
                BufferKind::Readback,
                8 * u64::from(options.size[0]) * u64::from(options.size[1]),
            )?,
            receivers,
            jobs,
            background: Vec3::from_array(channels.map(|c| (c[0] * Y00) as f32)),
            store,
        })
    }

    /// Lights every receiver, and draws the picture where `white` is given: radiance above it is brought down to it, hue kept,
    /// before samples are averaged, so that edges of lights are smooth; infinity leaves radiance as it is. Returns each
    /// pass's duration.
    ///
    /// # Errors
    /// `Device` when the device was lost, `Failed` when a barrier is missing.
    pub fn render(&mut self, placements: &[Placement], white: Option<f32>) -> Result<Vec<Timing>> {
        self.upload(placements);
        let inputs = self.inputs()?;
        let items = self.items(placements);
        let mut commands = Commands::new(&self.device, "frame")?;
        commands.pass("merge", |commands| {
            for round in 0..self.receivers.iter().map(|r| r.jobs.len()).max().unwrap_or(0) {
                if round > 0 {
                    // The next group of lights adds to what this one left.
                    commands.barrier(Access::ComputeWrite, Access::ComputeWrite);
                }
                for job in self.receivers.iter().filter_map(|r| self.jobs[r.jobs.clone()].get(round)) {
                    self.merge.record(commands, &inputs, &self.radiosity, job)?;
                }
            }
            Ok(())
        })?;
        if let Some(white) = white {
            commands.barrier(Access::ComputeWrite, Access::VertexRead);
            for image in self.draw.attachments() {
                let depth = image.shape.format == vk::Format::D32_SFLOAT;
                commands.image_barrier(image, None, if depth { Access::DepthWrite } else { Access::ColorWrite });
            }
            commands.pass("draw", |c| self.draw.record(c, &items, &self.radiosity, self.background, white))?;
            let picture = &self.draw.picture;
            commands.image_barrier(picture, Some(Access::ColorWrite), Access::TransferRead);
            commands.pass("read back", |commands| {
                commands.copy_image(picture, &self.readback);
                Ok(())
            })?;
            commands.barrier(Access::TransferWrite, Access::HostRead);
        }
        commands.submit()
    }

    /// The last picture: linear RGB, three floats a pixel, rows from the top.
    pub fn picture(&self) -> Vec<f32> {
        let pixels = (self.options.size[0] * self.options.size[1]) as usize;
        let halves: Vec<f16> = self.readback.read(0, 4 * pixels);
        halves.chunks_exact(4).flat_map(|p| [p[0].to_f32(), p[1].to_f32(), p[2].to_f32()]).collect()
    }

    /// Radiosity of an entity's vertices: linear RGB radiance that leaves the surface, without emission; zero where it does
    /// not receive.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn radiosity(&self, entity: usize) -> Result<Vec<[f32; 3]>> {
        let first = self.radiosity_offsets[entity];
        let count = self.store.geometries[self.scene.entities[entity].mesh].vertices.len() as u64;
        let quads: Vec<[f32; 4]> = self.radiosity.download_range(first..first + 16 * count)?;
        Ok(quads.into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
    }

    /// The scene that the frame was built for.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Vertices that are lit.
    pub fn receiver_vertex_count(&self) -> usize {
        self.receivers.iter().map(|r| self.store.geometries[self.scene.entities[r.entity].mesh].vertices.len()).sum()
    }

    fn inputs(&self) -> Result<Inputs<'_>> {
        let floats = vk::Format::R32G32B32A32_SFLOAT;
        Ok(Inputs {
            entities: &self.entities,
            rotations: &self.rotations,
            list: &self.list,
            fields: Readable::new(&self.store.fields, self.variant, self.store.field_format())?,
            transfers: Readable::new(&self.store.transfers, self.variant, floats)?,
            vertices: Readable::new(&self.store.vertices, self.variant, floats)?,
            sky: &self.sky,
        })
    }

    /// Writes entities, rotations and the occluder lists of this moment.
    fn upload(&mut self, placements: &[Placement]) {
        let bands = self.options.bake.bands;
        let stride = rotation_stride(bands);
        let mut entities = Vec::new();
        let mut rotations = vec![0.0_f32; stride * placements.len()];
        for (index, placement) in placements.iter().enumerate() {
            entities.push(self.entity(index, placement));
            let blocks = Rotation::new(bands, placement.rotation.as_dquat().normalize());
            for (to, from) in rotations[index * stride..].iter_mut().zip(blocks.blocks()) {
                *to = *from as f32;
            }
        }
        let list: Vec<u32> = self
            .receivers
            .iter()
            .flat_map(|receiver| {
                let mut order = self.occluders(placements, receiver.entity);
                order.resize(self.scene.entities.iter().filter(|e| e.occludes).count(), 0);
                order.into_iter().map(|j| j as u32)
            })
            .collect();
        self.entities.write(0, &entities);
        self.rotations.write(0, &rotations);
        self.list.write(0, &list);
    }

    fn entity(&self, index: usize, placement: &Placement) -> layout::Entity {
        let entity = &self.scene.entities[index];
        let geometry = &self.store.geometries[entity.mesh];
        let rotation = placement.rotation.as_dquat().normalize();
        let rows = glam::DMat3::from_quat(rotation.inverse()).transpose();
        let centre = self.centre(index, placement).as_vec3();
        let radius_m = geometry.radius_m * f64::from(placement.scale);
        let (emission, separate) = match &geometry.radiance {
            Some(slot) if entity.emits => (entity.emission * slot.header.radiance_scale, 1.0),
            _ => (entity.emission, 0.0),
        };
        let slot = geometry.blocked.as_ref().or(geometry.radiance.as_ref());
        // Both fields of a mesh have the same shells.
        let radial = slot.map_or([0.0; 4], |slot| {
            let lattice = slot.header.lattice;
            let (slope, offset) = lattice.radial_map();
            [slope as f32, offset as f32, lattice.inner as f32, lattice.outer as f32]
        });
        layout::Entity {
            centre: centre.extend((1.0 / radius_m) as f32).to_array(),
            to_object_x: rows.x_axis.as_vec3().extend(0.0).to_array(),
            to_object_y: rows.y_axis.as_vec3().extend(0.0).to_array(),
            to_object_z: rows.z_axis.as_vec3().extend(0.0).to_array(),
            emission: emission.extend(separate).to_array(),
            albedo: (entity.albedo.as_dvec3() / PI).as_vec3().extend(placement.scale).to_array(),
            radial,
            blocked_base: geometry.blocked.as_ref().map_or(0, store::Slot::quad),
            radiance_base: geometry.radiance.as_ref().map_or(0, store::Slot::quad),
            rank: index as u32,
            spare: 0,
        }
    }

    /// Centre of an entity's bounding sphere in the world, metres.
    fn centre(&self, index: usize, placement: &Placement) -> DVec3 {
        let centre_m = self.store.geometries[self.scene.entities[index].mesh].centre_m;
        let rotation = placement.rotation.as_dquat().normalize();
        placement.position.as_dvec3() + rotation * (centre_m * f64::from(placement.scale))
    }

    /// Occluders of a receiver, near to far from its bounding sphere's centre, ties by index; itself left out.
    fn occluders(&self, placements: &[Placement], receiver: usize) -> Vec<usize> {
        let from = self.centre(receiver, &placements[receiver]);
        let mut order: Vec<(f64, usize)> = (0..placements.len())
            .filter(|&j| self.scene.entities[j].occludes && j != receiver)
            .map(|j| (self.centre(j, &placements[j]).distance(from), j))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().map(|(_, j)| j).collect()
    }

    fn items(&self, placements: &[Placement]) -> Vec<Item<'_>> {
        let [width, height] = self.options.size;
        let clip_from_world = camera::clip_from_world(&self.scene.data.camera, f64::from(width) / f64::from(height));
        let items = placements.iter().enumerate().map(|(index, placement)| {
            let entity = &self.scene.entities[index];
            let world_from_object = DMat4::from_scale_rotation_translation(
                DVec3::splat(placement.scale.into()),
                placement.rotation.as_dquat().normalize(),
                self.centre(index, placement),
            );
            Item {
                drawable: &self.store.geometries[entity.mesh].drawable,
                clip_from_object: (clip_from_world * world_from_object).as_mat4(),
                emission: entity.emission,
                radiosity_offset: self.radiosity_offsets[index],
            }
        });
        items.collect()
    }

    /// The CPU twin of the merge in f64: radiosity of every receiver's vertices, by entity. Reads the fields back.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn reference(&self, placements: &[Placement]) -> Result<Vec<(usize, Vec<[f64; 3]>)>> {
        let mut fields: Vec<[Option<field::ShadowField>; 2]> = Vec::new();
        for geometry in &self.store.geometries {
            let load = |slot: &Option<store::Slot>| slot.as_ref().map(|slot| self.store.field(slot)).transpose();
            fields.push([load(&geometry.blocked)?, load(&geometry.radiance)?]);
        }
        let objects: Vec<Object<'_>> = placements
            .iter()
            .enumerate()
            .map(|(index, placement)| {
                let entity = &self.scene.entities[index];
                let [blocked, radiance] = &fields[entity.mesh];
                let over_pi = entity.albedo.as_dvec3() / PI;
                Object {
                    centre: self.centre(index, placement),
                    rotation: placement.rotation.as_dquat().normalize(),
                    scale: placement.scale.into(),
                    radius_m: self.store.geometries[entity.mesh].radius_m * f64::from(placement.scale),
                    albedo_over_pi: over_pi.to_array(),
                    emission: entity.emission.as_dvec3().to_array(),
                    blocked: blocked.as_ref(),
                    radiance: radiance.as_ref().filter(|_| entity.emits),
                }
            })
            .collect();
        let lights: Vec<usize> = indices(&self.scene, |e| e.emits).into_iter().map(|i| i as usize).collect();
        let sky = self.scene.environment.coefficients(self.options.bake.bands);
        let mut out = Vec::new();
        for receiver in &self.receivers {
            let mesh_index = self.scene.entities[receiver.entity].mesh;
            let mesh = &self.scene.meshes[mesh_index];
            let geometry = &self.store.geometries[mesh_index];
            let positions: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_dvec3() - geometry.centre_m).collect();
            let normals: Vec<DVec3> = mesh.normals.iter().map(|n| n.as_dvec3()).collect();
            let transfer = self.store.transfer(geometry)?;
            let task = Task {
                objects: &objects,
                receiver: receiver.entity,
                occluders: &self.occluders(placements, receiver.entity),
                lights: &lights,
                sky: (!self.scene.environment.is_none()).then_some(&sky),
                positions: &positions,
                normals: &normals,
                transfer: transfer.as_ref().map(|(floats, stride)| (&floats[..], *stride)),
                bands: self.options.bake.bands,
                lookup: self.options.lookup,
            };
            out.push((receiver.entity, task.run()));
        }
        Ok(out)
    }
}

/// Entities that satisfy a condition.
fn indices(scene: &Scene, condition: impl Fn(&crate::scene::Entity) -> bool) -> Vec<u32> {
    (0..scene.entities.len() as u32).filter(|&i| condition(&scene.entities[i as usize])).collect()
}

/// A dispatch for every group of lights; the sky goes with the first.
fn split_lights(base: &Job, lights: &[u32]) -> Vec<Job> {
    let mut groups: Vec<Vec<u32>> = lights.chunks(MAX_LIGHTS as usize).map(<[u32]>::to_vec).collect();
    if groups.is_empty() && base.sky {
        groups.push(Vec::new());
    }
    let job = |(i, lights)| Job { lights, sky: base.sky && i == 0, accumulate: i > 0, ..base.clone() };
    groups.into_iter().enumerate().map(job).collect()
}

/// The variant, less the texel views or uniform blocks that cannot hold the scene.
fn usable(device: &Device, store: &Store, entity_count: usize, variant: Variant) -> Variant {
    let floats = vk::Format::R32G32B32A32_SFLOAT;
    let fits = TexelView::fits(device, store.field_format(), store.fields.size_bytes)
        && TexelView::fits(device, floats, store.transfers.size_bytes)
        && TexelView::fits(device, floats, store.vertices.size_bytes);
    let chosen = variant.restricted(fits, entity_count <= UNIFORM_ENTITIES as usize);
    if chosen != variant {
        log::info!("the scene is too large for the variant \"{}\"; using \"{}\"", variant.name, chosen.name);
    }
    chosen
}

/// The form of the merge shader but for lights and sky.
fn form(options: &Options, variant: Variant) -> Form {
    Form {
        variant,
        bands: options.bake.bands,
        storage: options.bake.storage,
        lattice: options.bake.lattice,
        lookup: options.lookup,
        lights: 0,
        sky: false,
    }
}
