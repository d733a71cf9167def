//! Captures samples and projects their faces, batch after batch.

use super::BakeReport;
use super::Progress;
use super::capture::{Capture, Drawn, Model, NO_SLOT, Slots, Way};
use super::project::{Project, SampleFaces};
use super::samples::Sample;
use crate::error::Result;
use crate::field::FieldHeader;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device};
use crate::shaders::Library;
use glam::Vec3;
use std::sync::Arc;

/// The passes, and the coefficients of one batch on the device and on their way to the host.
pub(super) struct Batches {
    capture: Capture,
    samples: Buffer,
    project: Project,
    coefficients: Buffer,
    results: Buffer,
    stride: usize,
}

impl Batches {
    /// Batches for the samples of the field that `header` describes.
    pub fn new(device: &Arc<Device>, library: &Library, model: Model, header: &FieldHeader) -> Result<Self> {
        let capture = Capture::new(device, library, model, header.face_px, header.kind, Way::usual(device))?;
        let project = Project::new(device, library, header.bands, header.kind, header.face_px, capture.columns)?;
        let stride = header.sample_stride();
        let bytes = 4 * u64::from(capture.capacity()) * stride as u64;
        Ok(Batches {
            samples: Project::sample_buffer(device, capture.capacity())?,
            coefficients: Buffer::new(device, "batch samples", BufferKind::Device, bytes)?,
            results: Buffer::new(device, "batch results", BufferKind::Readback, bytes)?,
            project,
            capture,
            stride,
        })
    }

    /// Coefficients of samples, one after another; `progress` hears of each batch.
    pub fn run(mut self, samples: &[Sample], report: &mut BakeReport, progress: Progress<'_>) -> Result<Vec<f32>> {
        let eyes: Vec<Vec3> = samples.iter().map(|sample| sample.eye).collect();
        let mut coefficients = Vec::new();
        let mut done = 0;
        for slots in self.capture.plan(&eyes) {
            let batch = done..done + slots.len();
            done = batch.end;
            let drawn = self.capture.choose(&eyes[batch.clone()], &slots)?;
            self.submit(&samples[batch], &slots, &drawn, report)?;
            coefficients.extend(self.results.read::<f32>(0, slots.len() * self.stride));
            progress(done as u32, samples.len() as u32);
        }
        Ok(coefficients)
    }

    fn submit(&mut self, samples: &[Sample], slots: &[Slots], drawn: &Drawn, report: &mut BakeReport) -> Result<()> {
        let faces: Vec<SampleFaces> =
            samples.iter().zip(slots).map(|(sample, slots)| SampleFaces::new(sample, *slots)).collect();
        self.samples.write(0, &faces);
        let mut commands = Commands::new(self.samples.device(), "bake batch")?;
        self.record(&mut commands, drawn, samples.len() as u32)?;
        report.add(&commands.submit()?);
        report.faces += slots.iter().flatten().filter(|slot| **slot != NO_SLOT).count() as u32;
        report.triangles += drawn.triangles();
        Ok(())
    }

    /// Records one batch: captures its faces, projects them, and copies the coefficients to the host.
    fn record<'r>(&'r self, commands: &mut Commands<'r>, drawn: &'r Drawn, sample_count: u32) -> Result<()> {
        let Batches { capture, samples, project, coefficients, .. } = self;
        capture.record(commands, drawn, Access::ComputeSampled)?;
        commands.pass("project", |c| project.record(c, &capture.atlas, samples, coefficients, sample_count))?;
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        let bytes = 4 * u64::from(sample_count) * self.stride as u64;
        commands.copy_range(coefficients, 0..bytes, &self.results, 0);
        commands.barrier(Access::TransferWrite, Access::HostRead);
        Ok(())
    }
}
