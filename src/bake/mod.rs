//! The bake: from a mesh to its field and to its transfer, every stage on the device.
//!
//! ```text
//! sample points -> capture -> project -> (all batches) -> assemble -> field in the store
//! vertices      -> capture -> project (times cosine)               -> transfer
//! ```

pub mod assemble;
pub mod cache;
pub mod capture;
pub mod chunk;
pub mod inside;
pub mod orbit;
pub mod partial;
pub mod project;
pub mod report;
pub mod simplify;
pub mod snapshot;
pub mod surface;
mod sweep;
pub mod symmetry;

use crate::asset::mesh::Mesh;
use crate::error::{Error, Result};
use crate::field::lattice::{OUTSIDE_INNER, ROOMY_INNER};
use crate::field::quantity::{FieldKind, Storage, channel_stride};
use crate::field::{FieldHeader, Fit, Lattice, ShadowField, growth};
use crate::gpu::{Buffer, Commands, Device};
use crate::shaders::Library;
use assemble::{Assemble, Sources};
use capture::unit_positions;
use glam::{DVec3, Vec3};
use orbit::{Plan, Twin};
use partial::Partial;
use project::{Job, Projection};
pub use report::{LevelReport, Report};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;
use surface::Surface;
use sweep::Sweep;
use symmetry::Symmetry;

/// What decides a field besides the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// SH bands of transfers and radiance fields.
    pub bands: usize,
    /// SH bands of occlusion fields; `None`: as many.
    pub field_bands: Option<usize>,
    /// Number format.
    pub storage: Storage,
    /// Sample points; the first shell may be left to the bake.
    pub lattice: Lattice,
    /// Edge of a captured face in texels.
    pub face_px: u32,
}

impl Default for Options {
    /// 4 bands, f16, the default lattice, 64 px: a binary cap's error is .0033 at 64 px (DESIGN, section 3).
    fn default() -> Self {
        Options { bands: 4, field_bands: None, storage: Storage::default(), lattice: Lattice::default(), face_px: 64 }
    }
}

impl Options {
    /// SH bands of occlusion fields.
    pub fn occlusion_bands(&self) -> usize {
        self.field_bands.unwrap_or(self.bands)
    }

    /// SH bands of what has the most.
    pub fn most_bands(&self) -> usize {
        self.bands.max(self.occlusion_bands())
    }
}

/// Where the eye of a transfer capture stands: this share of r off the surface, along the normal. Large enough that the
/// surface's own facets stay below the horizon, small enough that contact shadows do not move visibly.
pub const TRANSFER_OFFSET: f32 = 2e-3;

/// Told how many of how many samples are done.
pub type Progress<'p> = &'p dyn Fn(u32, u32);

/// First shell that an object needs, in the lattice's space: just off a ball if the object fills one; the distance of its surface
/// from the centre if that is inside the solid, since no receiver comes nearer; else well inside.
pub fn first_shell(fit: &Fit, positions: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let placed: Vec<Vec3> = positions.iter().map(|p| fit.apply(p.as_dvec3()).as_vec3()).collect();
    let surface = Surface::new(&placed, triangles);
    if !surface.encloses(DVec3::ZERO) {
        return ROOMY_INNER;
    }
    let nearest = surface.distance(DVec3::ZERO);
    let farthest = placed.iter().map(|p| f64::from(p.length())).fold(0.0, f64::max);
    // A tessellated sphere's facets lie a few percent inside it.
    if nearest > 0.93 * farthest { OUTSIDE_INNER * farthest.max(1.0) } else { nearest.max(ROOMY_INNER) }
}

/// Share of its box above which a solid counts as one.
const BOXED: f64 = 0.9;

/// Whether samples on the edges of a cube's faces serve a solid: most, but not one that fills its box. Its edges lie where those are,
/// and what is captured below an edge, off one of two sides at random, serves neither (a cube on a floor: .034 for .023).
fn is_served_by_edges(positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    let boxed = (high - low).as_dvec3().element_product();
    let corner = |i: u32| positions[i as usize].as_dvec3();
    let volume: f64 = triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum();
    volume.abs() < BOXED * boxed
}

/// The hash of a mesh's contents as headers hold it.
pub fn hash_text(mesh: &Mesh) -> String {
    mesh.content_hash().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Header of the field that a bake of `mesh` would make.
pub fn header(mesh: &Mesh, kind: FieldKind, options: &Options) -> FieldHeader {
    let (centre, radius_m) = mesh.bounding_sphere();
    let positions = unit_positions(mesh);
    let first = |fit: &Fit| first_shell(fit, &positions, &mesh.triangles);
    let mut lattice = options.lattice.fitted(Fit::new(&positions), first);
    lattice.edges.get_or_insert_with(|| is_served_by_edges(&positions, &mesh.triangles));
    let brightest = mesh.colors.iter().flatten().map(|c| c.max_element()).fold(0.0, f32::max);
    FieldHeader {
        kind,
        bands: if kind == FieldKind::Occlusion { options.occlusion_bands() } else { options.bands },
        storage: options.storage,
        lattice,
        face_px: options.face_px,
        filled_samples: 0,
        captured_samples: 0,
        symmetry: String::new(),
        growth: 0.0,
        centre_m: centre.to_array(),
        radius_m,
        radiance_scale: if kind == FieldKind::Radiance && mesh.colors.is_some() { brightest } else { 1.0 },
        mesh: mesh.name.clone(),
        mesh_hash: hash_text(mesh),
    }
}

/// Bytes of the samples of a field before they are put into its stored order and number format.
fn captured_bytes(header: &FieldHeader) -> u64 {
    4 * u64::from(header.lattice.sample_count()) * header.sample_stride() as u64
}

/// Bakes on one device.
pub struct Baker {
    device: Arc<Device>,
    library: Library,
    /// Whether eyes far from a large mesh see a simplified one. Not by default: of the default lattice's samples too few stand far
    /// off, and making the levels costs more than they save (102 400 triangles: 39.3 s with, 34.7 s without).
    pub simplify: bool,
    /// Whether of samples that a symmetry of the mesh carries into one another only one is captured.
    pub orbit: bool,
    /// Whether only faces that the object reaches are drawn, of these only what reaches into them, and of closed meshes no backs.
    pub faces: bool,
    /// Whether samples inside a solid are captured off its nearest surface, or left out and filled from their neighbours where that
    /// sees nothing either. If not, they are captured where they stand, from where both sides of every face are drawn: all dark.
    pub inside: bool,
}

impl Baker {
    /// A baker that compiles its shaders from `library`.
    pub fn new(device: &Arc<Device>, library: &Library) -> Self {
        let (device, library) = (device.clone(), library.clone());
        Baker { device, library, simplify: false, orbit: true, faces: true, inside: true }
    }

    /// Checks that the device can bind the field that `header` describes, and what it is baked from.
    ///
    /// # Errors
    /// `Input` with both numbers of bytes.
    pub fn fits(&self, header: &FieldHeader) -> Result<()> {
        let (needed, most) = (
            header.payload_bytes().max(captured_bytes(header)),
            u64::from(self.device.limits.max_storage_buffer_range),
        );
        if needed > most {
            return Err(Error::Input(format!(
                "lattice {}: {needed} bytes while it is baked, the device can bind {most}: use a smaller --lattice",
                header.lattice
            )));
        }
        Ok(())
    }

    /// Bakes the field that `header` describes (see [`header`]) into `store` at `offset_bytes`, a multiple of 256.
    ///
    /// # Errors
    /// `Input` when no sample point can see the object, or a buffer is larger than the device can hold or bind.
    pub fn field(
        &self,
        mesh: &Mesh,
        header: &mut FieldHeader,
        target: (&Buffer, u64),
        progress: Progress<'_>,
    ) -> Result<Report> {
        self.field_from(&Partial::new(None), mesh, header, target, progress)
    }

    /// As [`Baker::field`], going on from what a cancelled bake of the same field has kept.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn field_from(
        &self,
        partial: &Partial,
        mesh: &Mesh,
        header: &mut FieldHeader,
        (store, offset_bytes): (&Buffer, u64),
        progress: Progress<'_>,
    ) -> Result<Report> {
        header.validate()?;
        let started = Instant::now();
        let lattice = header.lattice;
        self.fits(header)?;
        let positions: Vec<DVec3> = (0..lattice.sample_count()).map(|i| lattice.position(i)).collect();
        let surface = Surface::new(&unit_positions(mesh), &mesh.triangles);
        let mut inside = if self.inside { inside::inside(&surface, &positions) } else { vec![false; positions.len()] };
        let pushed = inside::pushed_out(&surface, &positions, &inside);
        let mut unseen: Vec<bool> = inside.iter().zip(&pushed).map(|(inside, eye)| *inside && eye.is_none()).collect();
        let plan = self.plan(mesh, header, &surface, &inside);
        let twins = &plan.twins;
        for (sample, twin) in twins.iter().enumerate().filter_map(|(sample, twin)| Some((sample, twin.as_ref()?))) {
            inside[sample] = inside[twin.of as usize];
            unseen[sample] = unseen[twin.of as usize];
        }
        header.filled_samples = inside.iter().filter(|i| **i).count() as u32;
        let sources = Sources::new(&lattice, &inside, &unseen)?;

        let radiance = header.kind == FieldKind::Radiance;
        let mut values = vec![0.0_f32; captured_bytes(header) as usize / 4];
        let mut targets = Vec::new();
        let seen = positions.iter().enumerate().filter(|(index, _)| !unseen[*index] && twins[*index].is_none());
        for (index, position) in seen {
            let eye = pushed[index].unwrap_or(*position);
            let scale = lattice.scale(lattice.distance(eye).max(lattice.inner)) as f32;
            targets.push((eye.as_vec3(), Job { normal: [0.0; 4], slots: [0; 6], target: index as u32, scale }));
        }
        let projection = if radiance { Projection::Radiance } else { Projection::Blocked };
        let sweep = Sweep { baker: self, mesh, bands: header.bands, projection, face_px: header.face_px, partial };
        let mut report = if self.simplify {
            sweep.at_levels(&targets, &mut values, progress)?
        } else {
            sweep.alone(&targets, &mut values, progress)?
        };
        orbit::spread(&mut values, &plan, &lattice, header.bands, header.kind.channels());
        header.captured_samples = targets.len() as u32;
        report.turned = twins.iter().flatten().count() as u32;
        report.filled = header.filled_samples;
        report.samples = lattice.sample_count() - report.filled;

        let captured = Buffer::with_data(&self.device, "captured samples", &values)?;
        let assemble = Assemble::new(&self.device, &self.library, header.storage)?;
        let offsets = Buffer::with_data(&self.device, "assemble offsets", &sources.offsets)?;
        let list = Buffer::with_data(&self.device, "assemble sources", &sources.list)?;
        let quads = (header.sample_stride() / 4) as u32;
        let factor = if header.radiance_scale > 0.0 { 1.0 / header.radiance_scale } else { 1.0 };
        let range = offset_bytes..offset_bytes + header.payload_bytes();
        let mut commands = Commands::new(&self.device, "assemble")?;
        commands.pass("assemble", |commands| {
            let inputs = [&captured, &offsets, &list];
            assemble.record(commands, inputs, (store, range), (lattice.stored_count(), quads), factor)
        })?;
        report.add(&commands.submit()?);
        if header.kind == FieldKind::Occlusion {
            let payload = store.download_range(offset_bytes..offset_bytes + header.payload_bytes())?;
            header.growth = growth::growth(&ShadowField { header: header.clone(), payload });
        }
        report.total = started.elapsed();
        Ok(report)
    }

    /// Bakes the transfer vector of every vertex: `channel_stride(bands)` floats each, object's frame. A flat or convex mesh
    /// has none to bake: there the cosine lobe of the normal is exact.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn transfer(
        &self,
        mesh: &Mesh,
        bands: usize,
        face_px: u32,
        progress: Progress<'_>,
    ) -> Result<(Vec<f32>, Report)> {
        self.transfer_from(&Partial::new(None), mesh, bands, face_px, progress)
    }

    /// As [`Baker::transfer`], going on from what a cancelled bake of the same transfer has kept.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn transfer_from(
        &self,
        partial: &Partial,
        mesh: &Mesh,
        bands: usize,
        face_px: u32,
        progress: Progress<'_>,
    ) -> Result<(Vec<f32>, Report)> {
        let started = Instant::now();
        let mut transfer = vec![0.0_f32; mesh.positions.len() * channel_stride(bands)];
        let positions = unit_positions(mesh);
        let targets: Vec<(Vec3, Job)> = positions
            .iter()
            .zip(&mesh.normals)
            .enumerate()
            .map(|(index, (position, normal))| {
                let job =
                    Job { normal: normal.extend(0.0).to_array(), slots: [0; 6], target: index as u32, scale: 1.0 };
                (position + TRANSFER_OFFSET * normal, job)
            })
            .collect();
        let twins = self.vertex_twins(mesh, face_px);
        let (targets, _): (Vec<_>, Vec<_>) =
            targets.into_iter().partition(|(_, job)| twins[job.target as usize].is_none());
        // A vertex sees its own surface from nearby: no simplified mesh will do.
        let projection = Projection::Transfer;
        let sweep = Sweep { baker: self, mesh, bands, projection, face_px, partial };
        let mut report = sweep.alone(&targets, &mut transfer, progress)?;
        orbit::turn_all(&mut transfer, &twins, bands, 1);
        report.samples = positions.len() as u32;
        report.turned = twins.iter().flatten().count() as u32;
        report.total = started.elapsed();
        Ok((transfer, report))
    }

    /// Which samples are turned from which others; says in the header by what symmetries.
    fn plan(&self, mesh: &Mesh, header: &mut FieldHeader, surface: &Surface, inside: &[bool]) -> Plan {
        if !self.orbit {
            header.symmetry = "off".to_owned();
            return Plan { twins: orbit::same(&header.lattice), round: Vec::new() };
        }
        let symmetry = Symmetry::of(mesh, surface, header.kind == FieldKind::Radiance).kept_by(&header.lattice.fit());
        header.symmetry = symmetry.describe();
        let distance = |sample: u32| {
            let position = header.lattice.position(sample);
            match inside[sample as usize] {
                true => f64::from(TRANSFER_OFFSET),
                // A bound will do for those far off.
                false if position.length() > 2.0 => position.length() - 1.0,
                false => surface.distance(position),
            }
        };
        let plan = orbit::plan(&header.lattice, &symmetry, header.face_px, distance);
        let turned = plan.twins.iter().flatten().count();
        log::info!("{}: symmetries: {}; {turned} of {} samples turned", mesh.name, header.symmetry, inside.len());
        plan
    }

    /// Which vertices' transfer vectors are turned from which others'.
    fn vertex_twins(&self, mesh: &Mesh, face_px: u32) -> Vec<Option<Twin>> {
        if !self.orbit {
            return vec![None; mesh.positions.len()];
        }
        orbit::plan_vertices(mesh, &Symmetry::of_vertices(mesh, None), face_px, f64::from(TRANSFER_OFFSET))
    }

    /// The library that shaders come from.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// The device that the baker works on.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }
}
