//! The captures of one bake. A batch fills the atlas once. This holds the resources that batches share, and the loop over them.

use super::capture::{Capture, Model, NO_SLOT, Slots};
use super::partial::Partial;
use super::project::{Job, Project, Projection};
use super::{BakeReport, Baker, Progress};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::Shortcuts;
use crate::field::quantity::channel_stride;
use crate::gpu::{Buffer, BufferKind, Commands};
use glam::Vec3;

/// What all captures of one bake share.
pub(super) struct Captures<'c> {
    pub mesh: &'c Mesh,
    pub bands: usize,
    pub projection: Projection,
    pub face_px: u32,
    pub shortcuts: Shortcuts,
    pub partial: &'c Partial,
}

/// A sample to capture: the place of its eye, and how its faces are projected.
#[derive(Clone, Copy)]
pub(super) struct CaptureTarget {
    /// The place of the eye, in r.
    pub eye: Vec3,
    pub job: Job,
}

/// What every batch works with.
pub(super) struct Batches {
    pub capture: Capture,
    pub project: Project,
    pub model: Model,
    pub jobs: Buffer,
    /// Whether backs of closed meshes are left out. Only an eye inside the solid would see them.
    pub culls: bool,
    /// Projected samples of one batch on the device.
    pub samples: Buffer,
    /// The projected samples on their way to the host.
    pub results: Buffer,
    /// Floats of a projected sample.
    pub sample_floats: usize,
}

/// Eyes whose faces fit into one atlas, and where each face lies.
pub(super) struct Batch {
    pub eyes: Vec<Vec3>,
    pub slots: Vec<Slots>,
}

impl Captures<'_> {
    /// Captures every target and puts the projected samples into `values`, in the order of their numbers. It goes on from what a
    /// cancelled bake has kept.
    pub fn run(
        &self,
        baker: &Baker,
        targets: &[CaptureTarget],
        values: &mut [f32],
        progress: Progress<'_>,
    ) -> Result<BakeReport> {
        let all = targets.len() as u32;
        let begun = self.partial.load(values, all);
        let mut batches = Batches::new(baker, self)?;
        let mut report = BakeReport::default();
        let mut rest = &targets[begun as usize..];
        while !rest.is_empty() {
            rest = batches.run_next(rest, values, &mut report)?;
            let done = (targets.len() - rest.len()) as u32;
            self.partial.save(values, done, all);
            progress(done, all);
        }
        self.partial.remove();
        Ok(report)
    }
}

impl Batches {
    fn new(baker: &Baker, captures: &Captures<'_>) -> Result<Self> {
        let radiance = captures.projection == Projection::Radiance;
        let (device, library) = (baker.device(), baker.library());
        let mut capture = Capture::new(device, library, captures.face_px, radiance)?;
        capture.skips = captures.shortcuts.faces;
        let (bands, projection) = (captures.bands, captures.projection);
        let sample_floats = projection.channels() * channel_stride(bands);
        let bytes = 4 * u64::from(capture.capacity()) * sample_floats as u64;
        Ok(Batches {
            project: Project::new(device, library, bands, projection, captures.face_px, capture.columns)?,
            model: Model::new(device, captures.mesh, radiance)?,
            jobs: Project::job_buffer(device, capture.capacity())?,
            culls: captures.shortcuts.inside,
            samples: Buffer::new(device, "batch samples", BufferKind::Device, bytes)?,
            results: Buffer::new(device, "batch results", BufferKind::Readback, bytes)?,
            sample_floats,
            capture,
        })
    }

    /// Captures and projects as many of the targets as fit into one atlas, and returns the others.
    fn run_next<'t>(
        &mut self,
        targets: &'t [CaptureTarget],
        values: &mut [f32],
        report: &mut BakeReport,
    ) -> Result<&'t [CaptureTarget]> {
        let eyes: Vec<Vec3> = targets.iter().map(|target| target.eye).collect();
        let slots = self.capture.plan(&self.model, &eyes);
        let (now, rest) = targets.split_at(slots.len());
        let numbered = now.iter().zip(&slots).enumerate();
        let jobs: Vec<Job> =
            numbered.map(|(i, (target, slots))| Job { slots: *slots, target: i as u32, ..target.job }).collect();
        self.jobs.write(0, &jobs);
        let batch = Batch { eyes: eyes[..slots.len()].to_vec(), slots };
        let texels = self.project.texel_view()?;
        let mut commands = Commands::new(self.samples.device(), "bake batch")?;
        super::record_batch(&mut commands, self, &batch, &texels)?;
        report.add(&commands.submit()?);
        report.faces += batch.slots.iter().flatten().filter(|slot| **slot != NO_SLOT).count() as u32;
        let floats = self.sample_floats;
        let found: Vec<f32> = self.results.read(0, now.len() * floats);
        for (target, sample) in now.iter().zip(found.chunks_exact(floats)) {
            values[target.job.target as usize * floats..][..floats].copy_from_slice(sample);
        }
        Ok(rest)
    }
}
