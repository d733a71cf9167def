//! What a scene keeps on the device from frame to frame: fields, transfer vectors, vertices, drawables. Only what its
//! entities need is baked and uploaded.

pub mod clusters;
pub mod limits;

use crate::asset::mesh::Mesh;
use crate::bake::cache::{Cache, field_name};
use crate::bake::{self, Baker, Report};
use crate::draw::DrawnMesh;
use crate::error::Result;
use crate::field::extent::{Extent, extent};
use crate::field::quantity::{FieldKind, Storage, channel_stride};
use crate::field::{Area, FieldHeader, ShadowField};
use crate::gpu::{Buffer, BufferKind, Volume};
use crate::layout::{CLUSTER_VERTICES, NONE};
use crate::lists::gather::Bounds;
use crate::lists::sight::Faces;
use crate::lists::skip::Skip;
use crate::merge::shelf::Shelf;
use crate::scene::{Entity, Scene};
use crate::scene_buffers::limits::Needs;
use glam::DVec3;
use std::collections::HashMap;
use std::ops::Range;

/// Alignment of everything that a pass may bind as a range: the largest that Vulkan lets a device ask for.
pub const ALIGNMENT: u64 = 256;

/// Told what is being baked and how far it is: name, samples done, samples in all.
pub type Progress<'p> = &'p dyn Fn(&str, u32, u32);

/// A field in the store.
pub struct Slot {
    /// Its parameters.
    pub header: FieldHeader,
    /// Its bytes in the store.
    pub bytes: Range<u64>,
    /// Number of its first channel among those of all fields, as they stand in an image.
    pub channel: u32,
    /// Directions in which it is not zero.
    pub extent: Extent,
    /// What its object covers from afar, if it is an occlusion field.
    pub area: Area,
}

impl Slot {
    /// First quad of the field, as shaders count.
    pub fn quad(&self) -> u32 {
        (self.bytes.start / (4 * self.header.storage.bytes() as u64)) as u32
    }
}

/// One mesh of the scene.
pub struct Geometry {
    /// Its vertices in the vertex buffer.
    pub vertices: Range<u32>,
    /// Which vertex of the mesh stands at each place of that range: neighbours stand together.
    pub order: Vec<u32>,
    /// Bounds of every run of [`crate::layout::CLUSTER_VERTICES`] of them.
    pub clusters: Vec<Bounds>,
    /// What each of these runs is seen by.
    pub faces: Vec<Faces>,
    /// First quad of its transfer vectors, or [`NONE`] where the cosine of the normal is exact.
    pub transfer_first: u32,
    /// Occlusion field, if an entity needs one.
    pub blocked: Option<Slot>,
    /// Radiance field, if an entity needs one.
    pub radiance: Option<Slot>,
    /// For drawing.
    pub drawn: DrawnMesh,
    /// Centre of the bounding sphere, metres.
    pub centre_m: DVec3,
    /// Bounding radius, metres.
    pub radius_m: f64,
}

impl Geometry {
    /// Whether the field that an entity casts shadows with, or shines with, is there and holds nothing but zeros.
    pub fn is_empty(&self, emits: bool) -> bool {
        let source = if emits && self.radiance.is_some() { &self.radiance } else { &self.blocked };
        source.as_ref().is_some_and(|slot| slot.extent == Extent::Nothing)
    }
}

/// What one bake cost.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Baked {
    /// Mesh and kind.
    pub what: String,
    /// Report of the bake.
    pub report: Report,
}

/// Device-resident data of a scene.
pub struct Store {
    /// All fields.
    pub fields: Buffer,
    /// Transfer vectors of all receivers' meshes.
    pub transfers: Buffer,
    /// Position and normal of all meshes, a quad each.
    pub vertices: Buffer,
    /// The scene's meshes.
    pub geometries: Vec<Geometry>,
    /// Bakes that were not found in the cache.
    pub baked: Vec<Baked>,
    /// Number format of the fields.
    pub storage: Storage,
    /// SH bands of radiance fields and transfers.
    pub bands: usize,
    /// SH bands of occlusion fields.
    pub field_bands: usize,
}

/// Which fields the entities of a mesh need: none for what only receives or what nothing else can see, none for shadows where
/// there is no light, no radiance field for a light of one colour.
pub fn needs(scene: &Scene, mesh: usize, skip: Skip) -> [Option<FieldKind>; 2] {
    let matters = |e: &&Entity| !skip.unseen || is_seen(scene, e);
    let entities = || scene.entities.iter().filter(|e| e.mesh == mesh).filter(matters);
    let coloured = scene.meshes[mesh].colors.is_some();
    let light = !scene.environment.is_none() || scene.entities.iter().any(|e| e.emits);
    let blocked = entities().any(|e| (e.occludes && light) || (e.emits && !coloured));
    let radiance = coloured && entities().any(|e| e.emits);
    [blocked.then_some(FieldKind::Occlusion), radiance.then_some(FieldKind::Radiance)]
}

/// Whether anything but itself is lit, so that its shadow or light can fall on it.
pub fn is_seen(scene: &Scene, entity: &Entity) -> bool {
    scene.entities.iter().filter(|e| e.receives).count() > usize::from(entity.receives)
}

impl Store {
    /// Bakes or finds everything that `scene` needs.
    ///
    /// # Errors
    /// `Input` when the fields together are larger than the device can bind, or a mesh cannot be baked.
    pub fn new(
        baker: &Baker,
        cache: &Cache,
        scene: &Scene,
        options: &bake::Options,
        skip: Skip,
        progress: Progress<'_>,
    ) -> Result<Self> {
        let device = baker.device();
        let (mut total, mut channels) = (0, 0);
        // Meshes that are the same under two names share what is baked.
        let mut places = HashMap::<String, (Range<u64>, u32)>::new();
        let mut slots: Vec<[Option<Slot>; 2]> = Vec::new();
        for (index, mesh) in scene.meshes.iter().enumerate() {
            slots.push(needs(scene, index, skip).map(|kind| {
                kind.map(|kind| {
                    let header = bake::header(mesh, kind, options);
                    let new = || {
                        let bytes = total..total + header.payload_bytes();
                        total = bytes.end.next_multiple_of(ALIGNMENT);
                        channels += kind.channels() as u32;
                        (bytes, channels - kind.channels() as u32)
                    };
                    let (bytes, channel) = places.entry(field_name(&header)).or_insert_with(new).clone();
                    Slot { header, bytes, channel, extent: Extent::All, area: Area::default() }
                })
            }));
        }
        Needs::of(scene, total, options.bands).check(&device.limits, device.heap_bytes())?;
        // Where bands differ, the shader reads as much of any sample as the larger kind has: at the end, past the last.
        let overrun = 8 * channel_stride(options.most_bands()) as u64;
        let mut fields = Buffer::new(
            device,
            "fields",
            BufferKind::Device,
            total.max(ALIGNMENT) + if options.field_bands.is_some() { overrun } else { 0 },
        )?;
        let mut baked = Vec::new();
        let mut ready = HashMap::<u64, (FieldHeader, Extent, Area)>::new();
        for (mesh, slot) in slots
            .iter_mut()
            .zip(&scene.meshes)
            .flat_map(|(pair, mesh)| pair.iter_mut().flatten().map(move |slot| (mesh, slot)))
        {
            if let Some((header, extent, area)) = ready.get(&slot.bytes.start) {
                slot.header = FieldHeader { mesh: slot.header.mesh.clone(), ..header.clone() };
                (slot.extent, slot.area) = (*extent, *area);
                continue;
            }
            let what =
                format!("{} {}", mesh.name, if slot.header.kind == FieldKind::Radiance { "light" } else { "shadow" });
            let done = |now, all| progress(&what, now, all);
            let target = (&mut fields, slot.bytes.start);
            if let Some(report) = cache.field(baker, mesh, &mut slot.header, target, &done)? {
                baked.push(Baked { what, report });
            }
            let field = download(&fields, slot)?;
            slot.extent = extent(&field);
            if slot.header.kind == FieldKind::Occlusion {
                slot.area = Area::new(&field);
            }
            ready.insert(slot.bytes.start, (slot.header.clone(), slot.extent, slot.area));
        }

        // All at once: growing by halves would hold up to three times as much.
        let quads = 2 * scene.meshes.iter().map(|mesh| mesh.positions.len()).sum::<usize>();
        let (mut transfers, mut vertices, mut geometries) =
            (Vec::new(), Vec::<[f32; 4]>::with_capacity(quads), Vec::new());
        let mut transfer_of = HashMap::<[u8; 32], u32>::new();
        let drawn = scene.entities.iter().map(|entity| scene.meshes[entity.mesh].positions.len()).sum();
        for (index, (mesh, [blocked, radiance])) in scene.meshes.iter().zip(slots).enumerate() {
            let (centre, radius_m) = mesh.bounding_sphere();
            let vertex_first = vertices.len() as u32;
            let order = clusters::order(mesh);
            for &v in &order {
                vertices.push((mesh.positions[v as usize] - centre).extend(0.0).to_array());
                vertices.push(mesh.normals[v as usize].extend(0.0).to_array());
            }
            let receives = scene.entities.iter().any(|e| e.mesh == index && e.receives);
            let bakes = receives && bakes_transfer(mesh);
            let known = transfer_of.get(&mesh.content_hash()).copied().filter(|_| bakes);
            let transfer_first = if let Some(first) = known {
                first
            } else if bakes {
                let what = format!("{} transfer", mesh.name);
                let done = |now, all| progress(&what, now, all);
                let (floats, report) = cache.transfer(baker, mesh, options.bands, options.face_px, &done)?;
                baked.extend(report.map(|report| Baked { what, report }));
                let first = (transfers.len() / 4) as u32;
                transfer_of.insert(mesh.content_hash(), first);
                let stride = channel_stride(options.bands);
                transfers.extend(order.iter().flat_map(|&v| &floats[v as usize * stride..][..stride]));
                first
            } else {
                NONE
            };
            geometries.push(Geometry {
                vertices: vertex_first / 2..vertices.len() as u32 / 2,
                clusters: clusters::bounds(mesh, &order),
                faces: Faces::around(mesh, &order, CLUSTER_VERTICES as usize),
                transfer_first,
                blocked,
                radiance,
                drawn: DrawnMesh::new(device, mesh, &order, drawn)?,
                order,
                centre_m: centre.as_dvec3(),
                radius_m: f64::from(radius_m),
            });
        }
        if transfers.is_empty() {
            transfers.resize(4, 0.0);
        }
        Ok(Store {
            fields,
            transfers: Buffer::with_data(device, "transfers", &transfers)?,
            vertices: Buffer::with_data(device, "vertices", &vertices)?,
            geometries,
            baked,
            storage: options.storage,
            bands: options.bands,
            field_bands: options.occlusion_bands(),
        })
    }

    /// Whether every field that `scene` needs is here; it has the meshes that the store was made for.
    pub fn covers(&self, scene: &Scene) -> bool {
        self.geometries.iter().enumerate().all(|(mesh, geometry)| {
            let [blocked, radiance] = needs(scene, mesh, Skip::ALL).map(|kind| kind.is_some());
            (geometry.blocked.is_some() || !blocked) && (geometry.radiance.is_some() || !radiance)
        })
    }

    /// Whether everything that `scene` needs is in the cache.
    pub fn is_cached(cache: &Cache, scene: &Scene, options: &bake::Options) -> bool {
        scene.meshes.iter().enumerate().all(|(index, mesh)| {
            let fields = needs(scene, index, Skip::ALL).into_iter().flatten();
            let receives = scene.entities.iter().any(|e| e.mesh == index && e.receives);
            fields.map(|kind| bake::header(mesh, kind, options)).all(|header| cache.has_field(&header))
                && (!receives || !bakes_transfer(mesh) || cache.has_transfer(mesh, options.bands, options.face_px))
        })
    }

    /// A copy of one field in host memory, for the CPU twin.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn field(&self, slot: &Slot) -> Result<ShadowField> {
        download(&self.fields, slot)
    }

    /// All fields as one image; `None` where the device or their shape rules that out.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn image(&self) -> Result<Option<Volume>> {
        let device = self.fields.device();
        let slots = self.geometries.iter().flat_map(|g| [&g.blocked, &g.radiance]).flatten();
        let fields = slots.map(|slot| self.field(slot)).collect::<Result<Vec<_>>>()?;
        let Some(lattice) = fields.first().map(|field| field.header.lattice) else { return Ok(None) };
        let count = fields.iter().map(|field| field.header.kind.channels() as u32).sum();
        let Some(shelf) = Shelf::new(device, lattice, self.bands, count) else { return Ok(None) };
        type Quads<'f> = Box<dyn Fn(usize, usize) -> [u16; 4] + 'f>;
        let channels = fields.iter().flat_map(|field| {
            (0..field.header.kind.channels()).map(move |channel| {
                let stride = field.header.channel_stride();
                Box::new(move |sample: usize, quad: usize| {
                    let first = sample * field.header.sample_stride() + channel * stride + 4 * quad;
                    [0, 1, 2, 3]
                        .map(|k| 2 * (first + k))
                        .map(|at| u16::from_le_bytes([field.payload[at], field.payload[at + 1]]))
                }) as Quads<'_>
            })
        });
        Ok(Some(shelf.fill(device, channels)?))
    }

    /// A copy of a mesh's transfer vectors in the mesh's order of vertices: floats and their stride.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn transfer(&self, geometry: &Geometry) -> Result<Option<(Vec<f32>, usize)>> {
        if geometry.transfer_first == NONE {
            return Ok(None);
        }
        let stride = channel_stride(self.bands);
        let first = u64::from(geometry.transfer_first) * 16;
        let size = geometry.vertices.len() as u64 * stride as u64 * 4;
        let stored: Vec<f32> = self.transfers.download_range(first..first + size)?;
        let mut floats = vec![0.0; stored.len()];
        for (place, &v) in geometry.order.iter().enumerate() {
            floats[v as usize * stride..][..stride].copy_from_slice(&stored[place * stride..][..stride]);
        }
        Ok(Some((floats, stride)))
    }
}

fn download(fields: &Buffer, slot: &Slot) -> Result<ShadowField> {
    Ok(ShadowField { header: slot.header.clone(), payload: fields.download_range(slot.bytes.clone())? })
}

/// Whether a mesh can shadow itself; if not, its transfer is the cosine of the normal.
pub fn bakes_transfer(mesh: &Mesh) -> bool {
    !mesh.is_flat() && !mesh.is_convex()
}
