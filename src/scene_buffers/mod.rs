//! The data that a scene keeps on the device from frame to frame: fields, transfer vectors, vertices, and meshes to
//! draw. Only what its entities need is uploaded.

pub mod clusters;
mod field_atlas;
pub mod limits;
pub mod silhouettes;
mod textures;

use crate::bake::cluster_order::{ClusterOrder, RunEnds};
use crate::bake::ensure::Baked;
use crate::bake::{self, BakedScene, BakedSurface};
use crate::draw::DrawnMesh;
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::{self, BYTES, CELLS};
use crate::field::sheet::Rectangle;
use crate::field::sky_view::{SkyFit, SkyViews};
use crate::field::visibility_volume::SceneVolume;
use crate::field::{Area, ShadowField};
use crate::gpu::{Buffer, Device, Texture};
pub use crate::layout::ALIGNMENT;
use crate::layout::{CLUSTER_VERTICES, NONE};
use crate::lists::gather::ClusterBounds;
use crate::lists::sight::TriangleRun;
use crate::scene::groups::Groups;
use crate::scene::{Lights, MapIndices, Placement, Scene};
use field_atlas::FieldAtlas;
pub use field_atlas::FieldSlot;
use glam::{DQuat, DVec3};
use rayon::prelude::*;
pub use silhouettes::{MeshSlots, Silhouettes, Slot};
use std::ops::Range;
use std::sync::{Arc, LazyLock};

/// A mesh of the scene as it shades and shines: its fields.
pub struct DeviceMesh {
    /// Occlusion field, if an entity needs one.
    pub blocked: Option<FieldSlot>,
    /// Radiance field, if an entity needs one.
    pub radiance: Option<FieldSlot>,
    /// What sharp lights read.
    pub slots: MeshSlots,
    /// The rectangle that blocks in place of fields, if the mesh is one.
    pub rectangle: Option<Rectangle>,
    /// Centre of the bounding sphere, metres.
    pub centre_m: DVec3,
    pub radius_m: f64,
    /// Least and largest corner of its box, metres.
    pub extent_m: [DVec3; 2],
}

impl DeviceMesh {
    /// What it fills of its bounding sphere's disc from afar: that of its field, else of its outline if that shines.
    pub fn area(&self) -> Option<Area> {
        self.blocked.as_ref().map(|slot| slot.area).or(self.slots.lamp_area)
    }

    /// Corners of its box, metres.
    pub fn corners_m(&self) -> [DVec3; 8] {
        std::array::from_fn(|k| DVec3::from_array(std::array::from_fn(|axis| self.extent_m[k >> axis & 1][axis])))
    }
}

/// A mesh as it is lit and drawn: where its vertices and their own visibility lie. Entities share it where both are
/// equal.
pub struct DeviceSurface {
    /// The range of its vertices in the vertex buffer.
    pub vertices: Range<u32>,
    /// Which vertex of the mesh stands at each place of that range. Neighbours stand together.
    pub order: Vec<u32>,
    /// The runs of every cluster.
    pub(crate) runs: Vec<RunEnds>,
    /// Bounds of every cluster of [`crate::layout::CLUSTER_VERTICES`] vertices.
    pub clusters: Vec<ClusterBounds>,
    /// The faces around each cluster, which decide whether a camera sees it.
    pub faces: Vec<TriangleRun>,
    /// First quad of its transfer vectors, or [`NONE`] where the cosine lobe of the normal is exact.
    pub transfer_first: u32,
    /// What its vertices see of the sky, and their transfer vectors before they are fitted to it, in the mesh's order; `None`
    /// where they stay as they are.
    own_view: Option<(Arc<SkyViews>, Arc<Vec<f32>>)>,
    /// First cell of its self-visibility, or [`NONE`] where it needs none.
    pub self_first: u32,
    /// Self-visibility in the mesh's order of vertices, if it needs any.
    pub self_maps: Option<Arc<Vec<u8>>>,
    /// See [`BakedSurface::told_suns`].
    pub told_suns: Option<Arc<Vec<u32>>>,
    pub drawn: DrawnMesh,
    /// How far a point of a triangle may lie from a vertex of it, metres.
    pub reach_m: f32,
}

/// The data of a scene on the device.
pub struct SceneBuffers {
    pub fields: Buffer,
    pub silhouettes: Silhouettes,
    /// Cells of self-visibility, [`self_visibility::CELLS`] of two words a vertex of the lit meshes that can shadow
    /// themselves.
    pub self_cells: Buffer,
    pub transfers: Buffer,
    /// Positions and normals of all meshes, one quad for each.
    pub vertices: Buffer,
    pub meshes: Vec<DeviceMesh>,
    /// What all that rests blocks where other things move.
    pub volume: Option<Arc<SceneVolume>>,
    /// Where it begins among the fields, in units of [`ALIGNMENT`].
    volume_first: u32,
    pub surfaces: Vec<DeviceSurface>,
    /// The scene's textures; those that are equal are shared.
    pub textures: Vec<Arc<Texture>>,
    surface_of: Vec<usize>,
    /// For each entity which way it stood when its transfer vectors were fitted to the sky; `None` where they are not.
    fitted: Vec<Option<DQuat>>,
    /// The bakes that were not found in the cache.
    pub baked: Vec<Baked>,
    /// SH bands of radiance fields and transfers.
    pub bands: usize,
}

/// Vertices and their own visibility on their way into the buffers of a scene.
struct Packing {
    /// Two quads a vertex: its position about the centre of the mesh's bounding sphere and how far its farthest
    /// neighbour is, metres; and its normal, and what it tells of suns ([`crate::layout::pack_suns`]), as a number.
    vertices: Vec<[f32; 4]>,
    transfers: Vec<f32>,
    self_cells: Vec<[u32; 2]>,
    /// Floats of one transfer vector.
    stride: usize,
    /// Number of vertices of all entities.
    drawn: usize,
}

impl Packing {
    /// Adds one surface in the order of its clusters.
    fn add(&mut self, device: &Arc<Device>, baked: &BakedSurface, by_triangles: bool) -> Result<DeviceSurface> {
        let Packing { vertices, transfers, self_cells, stride, drawn } = self;
        let mesh = &baked.mesh;
        let (centre, _) = mesh.bounding_sphere();
        let vertex_first = vertices.len() as u32;
        let ClusterOrder { vertices: order, runs } = baked.order();
        let drawn = DrawnMesh::new(device, mesh, &order, *drawn, by_triangles)?;
        let steps = drawn.grid().map_or_else(|| mesh.steps(), |grid| vec![grid.step_m; order.len()]);
        let longest = || steps.iter().copied().fold(0.0, f32::max);
        let reach_m = drawn.grid().map_or_else(longest, |grid| grid.reach_m);
        for &v in &order {
            vertices.push((mesh.positions[v as usize] - centre).extend(steps[v as usize]).to_array());
            let told = baked.told_suns.as_ref().map_or(0, |told| told[v as usize]);
            vertices.push(mesh.normals[v as usize].extend(told as f32).to_array());
        }
        let transfer_first = baked.transfer.as_ref().map_or(NONE, |floats| {
            let first = (transfers.len() / 4) as u32;
            transfers.extend(order.iter().flat_map(|&v| &floats[v as usize * *stride..][..*stride]));
            first
        });
        let self_first = baked.self_visibility.as_ref().map_or(NONE, |maps| {
            let first = self_cells.len() as u32;
            self_cells.resize(self_cells.len() + CELLS * order.len(), [0; 2]);
            let cells = self_cells[first as usize..].par_chunks_exact_mut(CELLS);
            cells.zip(&order).for_each(|(cells, &v)| {
                self_visibility::write_cells(&maps[v as usize * BYTES..][..BYTES], cells);
            });
            first
        });
        Ok(DeviceSurface {
            self_first,
            self_maps: baked.self_visibility.clone(),
            told_suns: baked.told_suns.clone(),
            vertices: vertex_first / 2..vertices.len() as u32 / 2,
            clusters: clusters::bounds(mesh, &order),
            faces: TriangleRun::around(mesh, &order, CLUSTER_VERTICES as usize),
            transfer_first,
            own_view: baked.sky.clone().zip(baked.transfer.clone()),
            drawn,
            reach_m,
            order,
            runs,
        })
    }
}

impl SceneBuffers {
    /// Uploads what was baked of a scene with `options`, and its meshes.
    pub fn new(device: &Arc<Device>, scene: &Scene, options: &bake::Options, baked: BakedScene) -> Result<Self> {
        let volume = baked.volume.as_ref().map(|volume| &*volume.volume);
        let FieldAtlas { fields, slots, volume_first } =
            field_atlas::field_atlas(device, scene, &baked.meshes, volume, options)?;
        let casters: Vec<_> = (0..scene.meshes.len()).map(|mesh| scene.caster(mesh)).collect();
        // A field tells the area of what has one.
        let shines = |mesh: usize| scene.entities.iter().any(|entity| entity.mesh == mesh && entity.emits);
        let wants_area = |mesh: usize| slots[mesh][0].is_none() && shines(mesh);
        let (silhouettes, mesh_slots) = Silhouettes::new(device, &baked.meshes, &casters, wants_area)?;
        let meshes = casters.into_iter().zip(slots).zip(mesh_slots).map(|((caster, [blocked, radiance]), slots)| {
            let (centre, radius_m) = caster.bounding_sphere();
            DeviceMesh {
                blocked,
                radiance,
                slots,
                rectangle: caster.rectangle(),
                centre_m: centre.as_dvec3(),
                radius_m: f64::from(radius_m),
                extent_m: caster.extent().map(|corner| corner.as_dvec3()),
            }
        });
        let meshes = meshes.collect();
        // The vertices are reserved at once. Growing by halves would hold up to three times as much.
        let quads = 2 * baked.surfaces.iter().map(|surface| surface.mesh.positions.len()).sum::<usize>();
        let mut packing = Packing {
            vertices: Vec::with_capacity(quads),
            transfers: Vec::new(),
            self_cells: Vec::new(),
            stride: channel_stride(options.bands),
            drawn: baked.surface_of.iter().map(|&surface| baked.surfaces[surface].mesh.positions.len()).sum(),
        };
        let by_triangles = |surface: usize| {
            let has_maps = baked.surfaces[surface].self_visibility.is_some();
            let mut entities = scene.entities.iter().zip(&baked.surface_of);
            has_maps
                || entities.any(|(entity, of)| *of == surface && (entity.reflection().is_some() || entity.transparent))
        };
        let surfaces = baked.surfaces.iter().enumerate();
        let surfaces = surfaces.map(|(index, surface)| packing.add(device, surface, by_triangles(index)));
        let surfaces = surfaces.collect::<Result<_>>()?;
        let Packing { vertices, mut transfers, mut self_cells, .. } = packing;
        // A buffer may not be empty.
        self_cells.resize(self_cells.len().max(2), [0; 2]);
        transfers.resize(transfers.len().max(4), 0.0);
        Ok(SceneBuffers {
            fields,
            silhouettes,
            self_cells: Buffer::with_data(device, "self-visibility", &self_cells)?,
            transfers: Buffer::with_data(device, "transfers", &transfers)?,
            vertices: Buffer::with_data(device, "vertices", &vertices)?,
            meshes,
            volume: baked.volume.map(Arc::new),
            volume_first,
            surfaces,
            textures: textures::upload(device, &scene.textures, |index| {
                let is_number = |maps: MapIndices| maps.gloss == Some(index) || maps.normal == Some(index);
                scene.entities.iter().any(|entity| is_number(entity.maps))
            })?,
            fitted: vec![None; baked.surface_of.len()],
            surface_of: baked.surface_of,
            baked: baked.baked,
            bands: options.bands,
        })
    }

    /// Fits the transfer vectors of what rests to the sky of the scene ([`crate::field::sky_view`]), where they are not yet.
    pub fn fit_sky(&mut self, scene: &Scene, placements: &[Placement]) -> Result<()> {
        let environment = &scene.environment;
        let sky = |turn: DQuat| {
            let radiance = |toward: DVec3| DVec3::from_array(environment.radiance(toward));
            SkyFit::new(&radiance, environment.coefficients(self.bands), turn)
        };
        let wanted = |entity: usize| {
            let (views, _) = self.surfaces[self.surface_of[entity]].own_view.as_ref()?;
            let turn = placements[entity].turn();
            // What a member of a group saw from where it stood tells nothing once it is turned. No band blurs an even sky.
            let is_known = !views.of_world || turn == scene.data.entities[entity].fixed().turn();
            (is_known && !environment.is_uniform()).then_some(turn)
        };
        let wanted: Vec<Option<DQuat>> = (0..self.surface_of.len()).map(wanted).collect();
        let stale = |entity: &usize| self.fitted.get(*entity) != Some(&wanted[*entity]);
        let stale: Vec<usize> = (0..wanted.len()).filter(stale).collect();
        if stale.is_empty() {
            return Ok(());
        }
        let of_world = LazyLock::new(|| sky(DQuat::IDENTITY));
        let stride = channel_stride(self.bands);
        let fitted = |entity: usize| {
            let surface = &self.surfaces[self.surface_of[entity]];
            let (views, transfer) = surface.own_view.as_ref()?;
            let in_order = surface.order.iter().flat_map(|&v| &transfer[v as usize * stride..][..stride]);
            let mut fitted: Vec<f32> = in_order.copied().collect();
            match wanted[entity] {
                Some(turn) if views.of_world => of_world.fit(views, turn, &mut fitted, stride),
                Some(turn) => sky(turn).fit(views, turn, &mut fitted, stride),
                None => {}
            }
            Some((u64::from(surface.transfer_first) * 16, fitted))
        };
        let all: Vec<(u64, Vec<f32>)> = stale.into_par_iter().filter_map(fitted).collect();
        self.fitted = wanted;
        all.iter().try_for_each(|(at, fitted)| self.transfers.fill(*at, fitted))
    }

    /// Forgets to which sky transfer vectors are fitted.
    pub fn forget_sky(&mut self) {
        self.fitted.clear();
    }

    /// The volume as `take_volume` in `glsl/merge.comp` reads it: the first node and 1 / step; how many nodes there are
    /// along each axis, and where they begin.
    pub fn volume_quads(&self) -> Option<[[f32; 4]; 2]> {
        let nodes = self.volume.as_ref()?.volume.nodes;
        let counts = nodes.counts.as_vec3().extend(self.volume_first as f32);
        Some([nodes.low.extend(1.0 / nodes.step_m).to_array(), counts.to_array()])
    }

    pub fn has_self_shadows(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.self_first != NONE)
    }

    /// Whether an entity has an occlusion field that holds anything.
    pub fn shadows(&self, scene: &Scene, entity: usize) -> bool {
        let blocked = &self.meshes[scene.entities[entity].mesh].blocked;
        blocked.as_ref().is_some_and(|slot| !slot.is_empty)
    }

    pub fn surface(&self, entity: usize) -> &DeviceSurface {
        &self.surfaces[self.surface_of[entity]]
    }

    /// What the pass of sharp lights reads: nodes and cells of silhouettes, and cells of self-visibility.
    pub fn sharp(&self) -> [&Buffer; 3] {
        [&self.silhouettes.nodes, &self.silhouettes.cells, &self.self_cells]
    }

    /// Whether every field that `scene` needs is here. The scene must have the meshes that these buffers were made for.
    pub fn cover_fields(&self, scene: &Scene, lights: Lights, groups: &Groups) -> bool {
        self.meshes.iter().enumerate().all(|(mesh, device_mesh)| {
            let needed = bake::needs(scene, mesh, lights, groups);
            let [blocked, radiance] = needed.fields.map(|kind| kind.is_some());
            (device_mesh.blocked.is_some() || !blocked)
                && (device_mesh.radiance.is_some() || !radiance)
                && (device_mesh.slots.silhouette.is_some() || !needed.silhouette)
                && (device_mesh.slots.lamp_colors.is_some() || !needed.lamp_colors)
        })
    }

    /// A copy of one field in host memory, for the CPU twin.
    pub fn field(&self, slot: &FieldSlot) -> Result<ShadowField> {
        let payload = self.fields.download_range(slot.bytes.clone())?;
        Ok(ShadowField { header: slot.header.clone(), payload })
    }

    /// As [`SceneBuffers::transfer`], before they were fitted to the sky.
    pub fn baked_transfer(&self, surface: &DeviceSurface) -> Result<Option<(Vec<f32>, usize)>> {
        match &surface.own_view {
            Some((_, transfer)) => Ok(Some((transfer.to_vec(), channel_stride(self.bands)))),
            None => self.transfer(surface),
        }
    }

    /// A copy of a surface's transfer vectors, in the mesh's order of vertices, and the floats of each.
    pub fn transfer(&self, surface: &DeviceSurface) -> Result<Option<(Vec<f32>, usize)>> {
        if surface.transfer_first == NONE {
            return Ok(None);
        }
        let stride = channel_stride(self.bands);
        let first = u64::from(surface.transfer_first) * 16;
        let size = surface.vertices.len() as u64 * stride as u64 * 4;
        let stored: Vec<f32> = self.transfers.download_range(first..first + size)?;
        let mut floats = vec![0.0; stored.len()];
        for (place, &v) in surface.order.iter().enumerate() {
            floats[v as usize * stride..][..stride].copy_from_slice(&stored[place * stride..][..stride]);
        }
        Ok(Some((floats, stride)))
    }
}
