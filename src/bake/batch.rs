//! Captures samples and reduces their faces, batch after batch.

use super::BakeReport;
use super::Progress;
use super::capture::{Capture, CaptureKind, Drawn, Model, NO_SLOT, Slots, Way};
use super::project::{Project, Projection, SampleFaces};
use super::samples::Sample;
use super::self_visibility::SelfVisibility;
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::BYTES;
use crate::gpu::memory::TexelView;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device};
use crate::shaders::Library;
use glam::Vec3;
use std::sync::Arc;

/// What the faces of a sample are reduced to.
#[derive(Clone, Copy)]
pub(super) struct Reduction {
    /// SH bands and kind of its coefficients, if it has any.
    pub projection: Option<(usize, Projection)>,
    /// Whether it has a map of self-visibility.
    pub self_visibility: bool,
}

impl Reduction {
    /// What faces have to hold for it.
    fn captured(self) -> CaptureKind {
        match self.projection {
            _ if self.self_visibility => CaptureKind::Distance,
            Some((_, Projection::Radiance)) => CaptureKind::Radiance,
            _ => CaptureKind::Cover,
        }
    }
}

/// Reduced samples, one after another.
#[derive(Default)]
pub(super) struct Reduced {
    pub coefficients: Vec<f32>,
    pub maps: Vec<u8>,
}

/// A pass that reduces faces, with the results of one batch on the device and on their way to the host.
struct Reduce<P> {
    pass: P,
    reduced: Buffer,
    results: Buffer,
    sample_bytes: u64,
}

impl<P> Reduce<P> {
    fn new(device: &Arc<Device>, pass: P, sample_bytes: u64, capacity: u32) -> Result<Self> {
        let bytes = u64::from(capacity) * sample_bytes;
        Ok(Reduce {
            pass,
            reduced: Buffer::new(device, "batch samples", BufferKind::Device, bytes)?,
            results: Buffer::new(device, "batch results", BufferKind::Readback, bytes)?,
            sample_bytes,
        })
    }

    fn copy_to_host<'r>(&'r self, commands: &mut Commands<'r>, sample_count: u32) {
        commands.copy_range(&self.reduced, 0..u64::from(sample_count) * self.sample_bytes, &self.results, 0);
    }
}

pub(super) struct Batches {
    capture: Capture,
    samples: Buffer,
    project: Option<Reduce<Project>>,
    self_visibility: Option<Reduce<SelfVisibility>>,
}

impl Batches {
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        model: Model,
        face_px: u32,
        reduction: Reduction,
    ) -> Result<Self> {
        let capture = Capture::new(device, library, model, face_px, reduction.captured(), Way::usual(device))?;
        let columns = capture.columns;
        let capacity = capture.capacity();
        let project = reduction.projection.map(|(bands, projection)| {
            let pass = Project::new(device, library, bands, projection, face_px, columns)?;
            Reduce::new(device, pass, 4 * (projection.channels() * channel_stride(bands)) as u64, capacity)
        });
        let self_visibility = reduction.self_visibility.then(|| {
            let pass = SelfVisibility::new(device, library, face_px, columns)?;
            Reduce::new(device, pass, BYTES as u64, capacity)
        });
        Ok(Batches {
            samples: Project::sample_buffer(device, capacity)?,
            project: project.transpose()?,
            self_visibility: self_visibility.transpose()?,
            capture,
        })
    }

    /// Captures and reduces samples; `progress` hears of each batch.
    pub fn run(mut self, samples: &[Sample], report: &mut BakeReport, progress: Progress<'_>) -> Result<Reduced> {
        let eyes: Vec<Vec3> = samples.iter().map(|sample| sample.eye).collect();
        let mut reduced = Reduced::default();
        let mut done = 0;
        for slots in self.capture.plan(&eyes) {
            let batch = done..done + slots.len();
            done = batch.end;
            let drawn = self.capture.choose(&eyes[batch.clone()], &slots)?;
            self.submit(&samples[batch], &slots, &drawn, report)?;
            if let Some(project) = &self.project {
                let floats = slots.len() * project.sample_bytes as usize / 4;
                reduced.coefficients.extend(project.results.read::<f32>(0, floats));
            }
            if let Some(maps) = &self.self_visibility {
                reduced.maps.extend(maps.results.read::<u8>(0, slots.len() * BYTES));
            }
            progress(done as u32, samples.len() as u32);
        }
        Ok(reduced)
    }

    fn submit(&mut self, samples: &[Sample], slots: &[Slots], drawn: &Drawn, report: &mut BakeReport) -> Result<()> {
        let faces: Vec<SampleFaces> =
            samples.iter().zip(slots).map(|(sample, slots)| SampleFaces::new(sample, *slots)).collect();
        self.samples.write(0, &faces);
        let texels = self.project.as_ref().map(|project| project.pass.texel_view()).transpose()?;
        let mut commands = Commands::new(self.samples.device(), "bake batch")?;
        self.record(&mut commands, drawn, samples.len() as u32, texels.as_ref())?;
        report.add(&commands.submit()?);
        report.faces += slots.iter().flatten().filter(|slot| **slot != NO_SLOT).count() as u32;
        report.triangles += drawn.triangles();
        Ok(())
    }

    /// Records one batch: captures its faces, reduces them, and copies the results to the host.
    fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        drawn: &'r Drawn,
        sample_count: u32,
        texels: Option<&'r TexelView<'r>>,
    ) -> Result<()> {
        self.capture.record(commands, drawn, Access::ComputeSampled)?;
        let atlas = &self.capture.atlas;
        if let (Some(Reduce { pass, reduced, .. }), Some(texels)) = (&self.project, texels) {
            commands.pass("project", |c| pass.record(c, atlas, &self.samples, texels, reduced, sample_count))?;
        }
        if let Some(Reduce { pass, reduced, .. }) = &self.self_visibility {
            commands.pass("self_visibility", |c| pass.record(c, atlas, &self.samples, reduced, sample_count))?;
        }
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        if let Some(project) = &self.project {
            project.copy_to_host(commands, sample_count);
        }
        if let Some(maps) = &self.self_visibility {
            maps.copy_to_host(commands, sample_count);
        }
        commands.barrier(Access::TransferWrite, Access::HostRead);
        Ok(())
    }
}
