//! The bake makes the field and the transfer vectors of a mesh. Everything that shows a scene calls [`ensure()`].
//!
//! ```text
//! sample points -> capture -> project -> host (all batches) -> turned samples -> assemble -> field
//! vertices      -> capture -> project -> host (all batches) -> turned vertices -> transfer vectors
//!                       `---> self_visibility -> host (all batches) -> a map for each vertex
//! ```
//!
//! `record_captures`, `record_batch` and `record_assembly` hold every pass and every barrier of a bake in order; `Captures::run` is the
//! loop over its batches.

pub mod assemble;
mod batches;
pub mod cache;
pub mod capture;
pub mod chunk;
pub mod ensure;
mod header;
pub mod kinds;
pub mod levels;
pub mod model;
mod names;
pub mod partial;
pub mod parts;
pub mod project;
pub mod quality;
pub mod raster;
pub mod report;
mod samples;
pub mod self_visibility;
pub mod silhouette;
pub mod snapshot;
pub mod surface;
pub mod symmetric_maps;
pub mod symmetric_samples;
pub mod symmetry;
pub mod triangles;
pub mod vertices;
mod wire;
pub mod worker;
pub mod workers;

use crate::asset::mesh::Mesh;
use crate::error::{Error, Result};
use crate::field::quantity::FieldKind;
use crate::field::{FieldHeader, ShadowField, growth};
use crate::gpu::memory::TexelView;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device};
use crate::shaders::Library;
use assemble::{Assemble, Sources};
use batches::{Batch, Batches, CaptureTarget, Captures, Reduce, Reduction, Unit};
use bytemuck::Pod;
use capture::{Capture, Drawn, Model};
pub use ensure::{BakedMesh, BakedScene, SceneNeeds, bakes_transfer, ensure, is_seen, needs};
pub use header::{Options, first_shell, hash_text, header};
use levels::Leveled;
use partial::Partial;
use project::Projection;
pub use quality::Quality;
pub use report::BakeReport;
use samples::FieldSamples;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
pub use workers::{WorkerOptions, Workers};

/// Distance of a transfer capture's eye from the surface along the normal, in r. It is large enough that the surface's own facets
/// stay below the horizon, and small enough that contact shadows do not move visibly.
pub const TRANSFER_OFFSET: f32 = 2e-3;

/// The program's name, version and revision. Results of programs with equal text may be mixed.
pub const PROGRAM: &str = concat!("shadow-fields ", env!("CARGO_PKG_VERSION"), " ", env!("SHADOW_FIELDS_REVISION"));

/// A function that is told how many samples are done, and how many there are.
pub type Progress<'p> = &'p dyn Fn(u32, u32);

/// Bytes of the samples of a field before they are put into its stored order and number format.
fn captured_bytes(header: &FieldHeader) -> u64 {
    4 * u64::from(header.lattice.sample_count()) * header.sample_stride() as u64
}

/// Records captures of what was chosen, with the barriers before them and the one for what reads the atlas next.
pub(crate) fn record_captures<'r>(
    commands: &mut Commands<'r>,
    capture: &'r Capture,
    model: &'r Model,
    drawn: &'r Drawn,
    reader: Access,
) -> Result<()> {
    commands.image_barrier(&capture.atlas, None, drawn.access());
    if let Some(depth) = capture.depth() {
        commands.image_barrier(depth, None, Access::DepthWrite);
    }
    commands.pass("capture", |c| capture.record(c, model, drawn))?;
    commands.image_barrier(&capture.atlas, Some(drawn.access()), reader);
    Ok(())
}

/// Records one batch of a bake: captures the eyes, reduces their faces, and copies the samples to the host.
fn record_batch<'r>(
    commands: &mut Commands<'r>,
    batches: &'r Batches,
    batch: &'r Batch,
    texels: Option<&'r TexelView<'r>>,
) -> Result<()> {
    let Batches { capture, project, self_visibility, model, jobs, .. } = batches;
    let count = batch.count;
    record_captures(commands, capture, model, &batch.drawn, Access::ComputeSampled)?;
    let (atlas, jobs_now) = (&capture.atlas, count as u32);
    if let Some(Reduce { pass, samples, .. }) = project {
        let texels = texels.expect("a projection has a view of texels");
        commands.pass("project", |c| pass.record(c, atlas, jobs, texels, samples, jobs_now))?;
    }
    if let Some(Reduce { pass, samples, .. }) = self_visibility {
        commands.pass("self_visibility", |c| pass.record(c, atlas, jobs, samples, jobs_now))?;
    }
    commands.barrier(Access::ComputeWrite, Access::TransferRead);
    let mut copy = |samples, results, bytes: usize| commands.copy_range(samples, 0..(count * bytes) as u64, results, 0);
    if let Some(project) = project {
        copy(&project.samples, &project.results, project.sample_bytes);
    }
    if let Some(maps) = self_visibility {
        copy(&maps.samples, &maps.results, maps.sample_bytes);
    }
    commands.barrier(Access::TransferWrite, Access::HostRead);
    Ok(())
}

/// Reduced samples on their way to their places, and how far the bake is.
struct Gathered<'g, T: Pod> {
    values: &'g mut [T],
    targets: &'g [CaptureTarget],
    units: &'g [Unit],
    /// Whether the samples of each unit are in their places.
    done: Vec<bool>,
    /// Number of targets that are done.
    count: u32,
    partial: &'g Partial,
    numbers: usize,
}

impl<T: Pod> Gathered<'_, T> {
    /// Puts the samples of a unit into their places. Then tells how many targets are done, and keeps those up to the first that is not.
    fn put(&mut self, unit: usize, samples: &[u8], progress: Progress<'_>) {
        let targets = &self.targets[self.units[unit].targets()];
        let bytes = self.numbers * size_of::<T>();
        for (target, sample) in targets.iter().zip(samples.chunks_exact(bytes)) {
            let place = &mut self.values[target.job.target as usize * self.numbers..][..self.numbers];
            bytemuck::cast_slice_mut(place).copy_from_slice(sample);
        }
        self.done[unit] = true;
        self.count += targets.len() as u32;
        let whole = self.units.iter().zip(&self.done).find(|(_, done)| !**done);
        let all = self.targets.len();
        let kept = whole.map_or(all, |(unit, _)| unit.targets().start);
        self.partial.save(self.values, kept as u32, all as u32);
        progress(self.count, all as u32);
    }
}

impl Captures<'_> {
    /// The reduced samples of a run of the targets, one after another, captured by this process alone.
    ///
    /// # Errors
    /// As [`Captures::run`].
    pub fn run_part(
        &self,
        baker: &Baker,
        targets: &[CaptureTarget],
        part: Range<usize>,
        progress: Progress<'_>,
    ) -> Result<Vec<u8>> {
        let mut batches = Batches::new(baker, self)?;
        let (targets, units) = batches.plan(targets, 1);
        let (mut samples, mut report) = (Vec::new(), BakeReport::default());
        for unit in units.iter().map(Unit::targets) {
            let now = unit.start.max(part.start)..unit.end.min(part.end);
            if !now.is_empty() {
                let done = (now.end - part.start) as u32;
                samples.extend(batches.run_unit(&targets[now], &mut report)?);
                progress(done, part.len() as u32);
            }
        }
        Ok(samples)
    }

    /// Captures every target and puts the reduced samples into `values`, in the order of their numbers. It goes on from what a
    /// cancelled bake has kept.
    pub fn run<T: Pod>(
        &self,
        baker: &Baker,
        targets: &[CaptureTarget],
        values: &mut [T],
        progress: Progress<'_>,
    ) -> Result<BakeReport> {
        let numbers = self.reduction.sample_bytes() / size_of::<T>();
        assert_eq!(numbers * size_of::<T>(), self.reduction.sample_bytes(), "numbers of another size");
        let mut batches = Batches::new(baker, self)?;
        let computes = batches.capture.computes(&batches.model);
        let (targets, units) = batches.plan(targets, baker.workers().map_or(1, |workers| workers.most(computes)));
        let begun = self.partial.load(values, targets.len() as u32);
        let done: Vec<bool> = units.iter().map(|unit| unit.targets().end <= begun as usize).collect();
        let count = units.iter().zip(&done).filter(|(_, done)| **done).map(|(unit, _)| unit.count).sum();
        let (mut report, left) =
            (BakeReport::default(), (0..units.len()).filter(|&unit| !done[unit]).collect::<Vec<_>>());
        let partial = self.partial;
        let mut gathered = Gathered { values, targets: &targets, units: &units, done, count, partial, numbers };
        let seconds = left.iter().map(|&unit| units[unit].seconds).sum();
        let work = workers::Work { setup: self, targets: &targets, units: &units, left: &left, seconds, computes };
        let mut own = |unit: &Unit, report: &mut BakeReport| batches.run_unit(&targets[unit.targets()], report);
        workers::share(baker.workers(), &work, &mut own, &mut report, &mut |unit, samples: &[u8]| {
            gathered.put(unit, samples, progress);
        })?;
        self.partial.remove();
        Ok(report)
    }
}

/// The pass and buffers that end the bake of a field.
struct Assembly {
    assemble: Assemble,
    captured: Buffer,
    offsets: Buffer,
    list: Buffer,
    /// The field's payload on the device.
    field: Buffer,
    /// The payload on its way to the host.
    payload: Buffer,
}

/// Records the end of a field's bake. All samples have been on the host by then and are back on the device. They are put into the
/// stored order and number format, and the payload is copied to the host.
fn record_assembly<'r>(commands: &mut Commands<'r>, assembly: &'r Assembly, header: &FieldHeader) -> Result<()> {
    let Assembly { assemble, captured, offsets, list, field, payload } = assembly;
    let bytes = 0..header.payload_bytes();
    let counts = (header.lattice.stored_count(), (header.sample_stride() / 4) as u32);
    let factor = if header.radiance_scale > 0.0 { 1.0 / header.radiance_scale } else { 1.0 };
    commands
        .pass("assemble", |c| assemble.record(c, [captured, offsets, list], (field, bytes.clone()), counts, factor))?;
    commands.barrier(Access::ComputeWrite, Access::TransferRead);
    commands.copy_range(field, bytes, payload, 0);
    commands.barrier(Access::TransferWrite, Access::HostRead);
    Ok(())
}

/// Bakes on one device. A baker has no options of its own: everything that decides a stored number stands in [`Options`].
pub struct Baker {
    device: Arc<Device>,
    library: Library,
    workers: Option<Arc<Workers>>,
    /// The levels of the mesh that was baked last, by its hash: all kinds of things of one mesh draw them.
    leveled: Mutex<Option<([u8; 32], Arc<Leveled>)>>,
}

impl Baker {
    /// A baker that compiles its shaders from `library` and works in this process alone.
    pub fn new(device: &Arc<Device>, library: &Library) -> Self {
        Baker { device: device.clone(), library: library.clone(), workers: None, leveled: Mutex::default() }
    }

    /// A baker that shares its captures out among processes, which makes the same bytes in less time.
    pub fn with_workers(device: &Arc<Device>, library: &Library, options: WorkerOptions) -> Self {
        Baker { workers: Some(Workers::new(options, device, library)), ..Self::new(device, library) }
    }

    /// Checks that the device can bind the field that `header` describes, and the samples that it is baked from.
    ///
    /// # Errors
    /// `Input` with the bytes that are needed and the bytes that the device can bind.
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

    /// Bakes the field that `header` describes (see [`header()`]).
    ///
    /// # Errors
    /// `Input` when no sample point can see the object, or a buffer is larger than the device can hold or bind.
    pub fn field(&self, mesh: &Mesh, header: FieldHeader, progress: Progress<'_>) -> Result<(ShadowField, BakeReport)> {
        self.field_from(&Partial::new(None), mesh, header, progress)
    }

    /// As [`Baker::field`], but goes on from what a cancelled bake of the same field has kept.
    ///
    /// # Errors
    /// As [`Baker::field`].
    pub fn field_from(
        &self,
        partial: &Partial,
        mesh: &Mesh,
        mut header: FieldHeader,
        progress: Progress<'_>,
    ) -> Result<(ShadowField, BakeReport)> {
        header.validate()?;
        self.fits(&header)?;
        let started = Instant::now();
        triangles::tell_repeated(mesh);
        let levels = header.level_texels > 0.0;
        // Samples and levels take about equally long, each mostly on one thread, so they are made side by side.
        let ahead = || if levels { self.leveled(mesh).map(|_| ()) } else { Ok(()) };
        let (samples, ahead) = rayon::join(|| FieldSamples::new(mesh, &mut header), ahead);
        let (FieldSamples { targets, plan, sources }, ()) = (samples?, ahead?);
        let projection = if header.kind == FieldKind::Radiance { Projection::Radiance } else { Projection::Blocked };
        let FieldHeader { bands, face_px, shortcuts, .. } = header;
        let reduction = Reduction::Project { bands, projection };
        let captures = Captures { mesh, reduction, face_px, shortcuts, levels, partial };
        let mut values = vec![0.0_f32; captured_bytes(&header) as usize / 4];
        let mut report = captures.run(self, &targets, &mut values, progress)?;
        symmetric_samples::spread(&mut values, &plan, &header.lattice, bands, header.kind.channels());
        header.captured_samples = targets.len() as u32;
        report.turned = plan.turned.iter().flatten().count() as u32;
        report.filled = header.filled_samples;
        report.samples = header.lattice.sample_count() - report.filled;
        let payload = self.assemble(&header, &values, &sources, &mut report)?;
        let mut field = ShadowField { header, payload };
        if field.header.kind == FieldKind::Occlusion {
            field.header.growth = growth::growth(&field);
        }
        report.total = started.elapsed();
        Ok((field, report))
    }

    /// The payload of a field from its samples.
    fn assemble(
        &self,
        header: &FieldHeader,
        values: &[f32],
        sources: &Sources,
        report: &mut BakeReport,
    ) -> Result<Vec<u8>> {
        let (device, bytes) = (&self.device, header.payload_bytes());
        let assembly = Assembly {
            assemble: Assemble::new(device, &self.library, header.storage)?,
            captured: Buffer::with_data(device, "captured samples", values)?,
            offsets: Buffer::with_data(device, "assemble offsets", &sources.offsets)?,
            list: Buffer::with_data(device, "assemble sources", &sources.list)?,
            field: Buffer::new(device, "baked field", BufferKind::Device, bytes)?,
            payload: Buffer::new(device, "baked payload", BufferKind::Readback, bytes)?,
        };
        let mut commands = Commands::new(device, "assemble")?;
        record_assembly(&mut commands, &assembly, header)?;
        report.add(&commands.submit()?);
        Ok(assembly.payload.read(0, bytes as usize))
    }

    /// The levels of a mesh, which are made at its first question.
    fn leveled(&self, mesh: &Mesh) -> Result<Arc<Leveled>> {
        let mut known = self.leveled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, leveled)) = known.as_ref().filter(|(hash, _)| *hash == mesh.content_hash()) {
            return Ok(leveled.clone());
        }
        let leveled = Arc::new(Leveled::new(mesh)?);
        *known = Some((mesh.content_hash(), leveled.clone()));
        Ok(leveled)
    }

    /// Gives back what idle workers hold, and what is kept of the last mesh.
    fn rest(&self) {
        self.workers.iter().for_each(|workers| workers.dismiss());
        *self.leveled.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Worker processes, if it has any.
    pub fn workers(&self) -> Option<&Arc<Workers>> {
        self.workers.as_ref()
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
