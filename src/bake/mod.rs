//! The bake makes the field and the transfer vectors of a mesh. Everything that shows a scene calls [`ensure()`].
//!
//! ```text
//! samples -> capture -> project -> assemble -> field  (of convex solids of few faces: samples -> closed form -> assemble)
//! group -> refine -> rays -> surfaces with transfer vectors and self-visibility
//! ```
//!
//! [`Baker::field`] goes along the first line, with every barrier.
//! [`surfaces::GroupPlan::bake`] goes along the second, on the host. Silhouette fields have a pass of their own
//! ([`silhouette`]).
//!
//! - A **sample** is what is captured from one eye at a point of a lattice, and what that is projected to.
//! - A **face** is one of the six cube faces around an eye. Its **slot** is its place in the atlas.
//! - A **batch** is the samples whose faces fill the atlas once. It is one submission.
//! - A **chunk** is neighbouring triangles that are drawn or left out together.
//! - A **level** is the mesh with fewer and larger triangles, for what is far from the eye.

pub mod assemble;
pub mod cache;
pub mod capture;
pub mod chunk;
pub(crate) mod cluster_order;
pub mod ensure;
mod lamp_colors;
pub mod levels;
pub mod links;
pub mod model;
mod options;
pub mod own_visibility;
mod packet;
mod polyhedron;
pub mod project;
pub mod raster;
mod refine;
mod samples;
pub mod silhouette;
pub mod surface;
pub mod surfaces;
pub mod triangles;
mod visibility_volume;

use crate::asset::mesh::Mesh;
use crate::error::{Error, Result};
use crate::field::quantity::FieldKind;
use crate::field::{FieldHeader, ShadowField};
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device, Timing};
use crate::sh::polygon::POLYGON_BANDS;
use crate::shaders::Library;
use assemble::{Assemble, Sources};
use capture::{Capture, NO_SLOT, Way};
pub use ensure::{BakedMesh, BakedScene, SceneNeeds, bakes_transfer, ensure, needs};
use glam::Vec3;
use levels::Leveled;
use model::Model;
pub use options::{BakeOptions, Options, Quality, first_shell, hash_text, header};
use polyhedron::Polyhedron;
use project::{Project, SampleFaces};
use samples::FieldSamples;
use serde::Serialize;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
pub use surfaces::BakedSurface;

/// Distance of a transfer capture's eye from the surface along the normal, in r. It is large enough that the surface's
/// own facets stay below the horizon, and small enough that contact shadows do not move visibly.
pub const TRANSFER_OFFSET: f32 = 2e-3;

/// The program's name, version and revision. Results of programs with equal text may be mixed.
pub const PROGRAM: &str = concat!("shadow-fields ", env!("CARGO_PKG_VERSION"), " ", env!("SHADOW_FIELDS_REVISION"));

/// A function that is told how many samples are done, and how many there are.
pub type Progress<'p> = &'p dyn Fn(u32, u32);

/// What a bake did, and where its time went.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BakeReport {
    /// Number of samples that stand at their own place, of maps of a silhouette field, or of lit vertices.
    pub samples: u32,
    /// Number of samples inside the solid. They were captured off the nearest surface or, if that sees nothing, filled
    /// from neighbours.
    pub filled: u32,
    /// Number of cube faces that were drawn: six for each captured sample where none is left out.
    pub faces: u32,
    /// Number of triangles that were drawn, each as often as faces showed it.
    pub triangles: u64,
    pub capture_ms: f64,
    pub project_ms: f64,
    pub assemble_ms: f64,
    pub total: Duration,
}

impl BakeReport {
    fn add(&mut self, timings: &[Timing]) {
        for timing in timings {
            match timing.pass.as_str() {
                "capture" => self.capture_ms += timing.milliseconds,
                "project" => self.project_ms += timing.milliseconds,
                _ => self.assemble_ms += timing.milliseconds,
            }
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    pub transfer: bool,
    pub self_visibility: bool,
}

impl Wanted {
    pub const BOTH: Wanted = Wanted { transfer: true, self_visibility: true };
    pub const TRANSFER: Wanted = Wanted { transfer: true, self_visibility: false };
}

/// Bakes on one device. A baker has no options of its own: everything that decides a stored number stands in
/// [`Options`].
pub struct Baker {
    device: Arc<Device>,
    library: Library,
    /// The levels of the mesh that was baked last, by its hash: fields, silhouettes and vertices of one mesh draw them.
    leveled: Mutex<Option<([u8; 32], Arc<Leveled>)>>,
}

impl Baker {
    pub fn new(device: &Arc<Device>, library: &Library) -> Self {
        Baker { device: device.clone(), library: library.clone(), leveled: Mutex::default() }
    }

    /// Checks that the device can bind the field that `header` describes, and the samples that it is baked from:
    /// `Input` with the bytes that are needed and the bytes that the device can bind.
    pub fn fits(&self, header: &FieldHeader) -> Result<()> {
        let captured = 4 * u64::from(header.lattice.sample_count()) * header.sample_stride() as u64;
        let needed = header.payload_bytes().max(captured);
        let limit = u64::from(self.device.limits.max_storage_buffer_range);
        if needed > limit {
            return Err(Error::Input(format!(
                "lattice {}: {needed} bytes while it is baked, the device can bind {limit}: use a smaller --lattice",
                header.lattice
            )));
        }
        Ok(())
    }

    /// Bakes the field that `header` describes (see [`header()`]).
    pub fn field(
        &self,
        mesh: &Mesh,
        mut header: FieldHeader,
        progress: Progress<'_>,
    ) -> Result<(ShadowField, BakeReport)> {
        header.validate()?;
        self.fits(&header)?;
        let started = Instant::now();
        triangles::tell_repeated(mesh);
        let radiance = header.kind == FieldKind::Radiance;
        let closed_form = !radiance && header.bands <= POLYGON_BANDS;
        let mut report = BakeReport::default();
        let (samples, coefficients) = match closed_form.then(|| Polyhedron::new(mesh)).flatten() {
            Some(solid) => {
                let samples = FieldSamples::new(mesh, &header.lattice)?;
                let coefficients = solid.coefficients(&samples.captured, header.bands, header.sample_stride());
                (samples, coefficients)
            }
            None => self.capture(mesh, &header, &mut report, progress)?,
        };
        let FieldSamples { captured, inside_count, sources } = samples;

        let stride = header.sample_stride();
        let mut values = vec![0.0_f32; header.lattice.sample_count() as usize * stride];
        for (sample, captured) in captured.iter().zip(coefficients.chunks_exact(stride)) {
            values[sample.number as usize * stride..][..stride].copy_from_slice(captured);
        }
        header.captured_samples = captured.len() as u32;
        header.filled_samples = inside_count;
        let payload = self.assemble(&header, &values, &sources, &mut report)?;
        let field = ShadowField { header, payload };
        report.filled = inside_count;
        report.samples = field.header.lattice.sample_count() - inside_count;
        report.total = started.elapsed();
        Ok((field, report))
    }

    /// The samples of a field and their coefficients: captured and projected batch after batch, of which `progress`
    /// hears.
    fn capture(
        &self,
        mesh: &Mesh,
        header: &FieldHeader,
        report: &mut BakeReport,
        progress: Progress<'_>,
    ) -> Result<(FieldSamples, Vec<f32>)> {
        let make_model = || {
            if header.level_texels > 0.0 {
                Model::with_levels(&self.device, mesh, self.leveled(mesh)?)
            } else {
                Model::new(&self.device, mesh, header.kind)
            }
        };
        // They take about equally long, each mostly on one thread, so they are made side by side.
        let (samples, model) = rayon::join(|| FieldSamples::new(mesh, &header.lattice), make_model);
        let samples = samples?;
        let device = &self.device;
        let capture = Capture::new(device, &self.library, model?, header.face_px, header.kind, Way::usual(device))?;
        let project = Project::new(device, &self.library, header.bands, &capture)?;
        let most = capture.capacity() as usize;
        let stride = header.sample_stride();
        let bytes = |count: usize| 4 * (count * stride) as u64;
        let face_bytes = (most * size_of::<SampleFaces>()) as u64;
        let mut sample_faces = Buffer::new(device, "samples with faces", BufferKind::Upload, face_bytes)?;
        let projected = Buffer::new(device, "batch samples", BufferKind::Device, bytes(most))?;
        let results = Buffer::new(device, "batch results", BufferKind::Readback, bytes(most))?;

        let eyes: Vec<Vec3> = samples.captured.iter().map(|sample| sample.eye).collect();
        let mut coefficients = Vec::new();
        let mut done = 0;
        for slots in capture.plan(&eyes) {
            let count = slots.len();
            let batch = done..done + count;
            done = batch.end;
            let drawn = capture.choose(&eyes[batch.clone()], &slots)?;
            let faces = samples.captured[batch].iter().zip(&slots);
            let faces = faces.map(|(sample, slots)| SampleFaces { slots: *slots, scale: sample.scale });
            sample_faces.write(0, &faces.collect::<Vec<_>>());
            let mut commands = Commands::new(device, "bake batch")?;
            capture.record(&mut commands, &drawn, Access::ComputeSampled)?;
            commands.pass("project", |c| project.record(c, &capture.atlas, &sample_faces, &projected, count as u32))?;
            commands.barrier(Access::ComputeWrite, Access::TransferRead);
            commands.copy_range(&projected, 0..bytes(count), &results, 0);
            commands.barrier(Access::TransferWrite, Access::HostRead);
            report.add(&commands.submit()?);
            report.faces += slots.iter().flatten().filter(|slot| **slot != NO_SLOT).count() as u32;
            report.triangles += drawn.triangles();
            coefficients.extend(results.read::<f32>(0, count * stride));
            progress(done as u32, samples.captured.len() as u32);
        }
        Ok((samples, coefficients))
    }

    /// The payload of a field from its captured samples, which are put into the stored order and number format.
    fn assemble(
        &self,
        header: &FieldHeader,
        values: &[f32],
        sources: &Sources,
        report: &mut BakeReport,
    ) -> Result<Vec<u8>> {
        let device = &self.device;
        let bytes = header.payload_bytes();
        let assemble = Assemble::new(device, &self.library, header.storage)?;
        let captured = Buffer::with_data(device, "captured samples", values)?;
        let offsets = Buffer::with_data(device, "assemble offsets", &sources.offsets)?;
        let list = Buffer::with_data(device, "assemble sources", &sources.list)?;
        let field = Buffer::new(device, "baked field", BufferKind::Device, bytes)?;
        let counts = (header.lattice.stored_count(), (header.sample_stride() / 4) as u32);
        let factor = if header.radiance_scale > 0.0 { 1.0 / header.radiance_scale } else { 1.0 };
        let mut commands = Commands::new(device, "assemble")?;
        let inputs = [&captured, &offsets, &list];
        commands.pass("assemble", |c| assemble.record(c, inputs, (&field, 0..bytes), counts, factor))?;
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        report.add(&commands.submit()?);
        field.download(bytes as usize)
    }

    /// The levels of a mesh, which are made when they are first asked for.
    fn leveled(&self, mesh: &Mesh) -> Result<Arc<Leveled>> {
        let mut known = self.leveled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, leveled)) = known.as_ref().filter(|(hash, _)| *hash == mesh.content_hash()) {
            return Ok(leveled.clone());
        }
        let leveled = Arc::new(Leveled::new(mesh)?);
        *known = Some((mesh.content_hash(), leveled.clone()));
        Ok(leveled)
    }

    fn rest(&self) {
        *self.leveled.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    pub fn library(&self) -> &Library {
        &self.library
    }

    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }
}
