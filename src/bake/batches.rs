//! The captures of one bake. A batch fills the atlas once. This holds the resources that batches share, and the loop over them.

use super::capture::{Capture, Model, NO_SLOT, Slots};
use super::partial::Partial;
use super::project::{Job, Project, Projection};
use super::self_visibility::SelfVisibility;
use super::{BakeReport, Baker, Progress};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::Shortcuts;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::NODES;
use crate::gpu::memory::TexelView;
use crate::gpu::{Buffer, BufferKind, Commands};
use bytemuck::Pod;
use glam::Vec3;

/// What the faces of a sample are reduced to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Reduction {
    /// SH coefficients, in floats.
    Project { bands: usize, projection: Projection },
    /// A map of self-visibility, in bytes.
    SelfVisibility,
}

impl Reduction {
    /// Whether faces hold radiance rather than coverage.
    fn is_radiance(self) -> bool {
        matches!(self, Reduction::Project { projection: Projection::Radiance, .. })
    }

    /// Numbers of a reduced sample.
    fn numbers(self) -> usize {
        match self {
            Reduction::Project { bands, projection } => projection.channels() * channel_stride(bands),
            Reduction::SelfVisibility => NODES,
        }
    }
}

/// The pass that reduces faces.
pub(super) enum Reduce {
    Project(Project),
    SelfVisibility(SelfVisibility),
}

impl Reduce {
    fn new(baker: &Baker, captures: &Captures<'_>, columns: u32) -> Result<Self> {
        let (device, library, face_px) = (baker.device(), baker.library(), captures.face_px);
        Ok(match captures.reduction {
            Reduction::Project { bands, projection } => {
                Reduce::Project(Project::new(device, library, bands, projection, face_px, columns)?)
            }
            Reduction::SelfVisibility => {
                Reduce::SelfVisibility(SelfVisibility::new(device, library, face_px, columns)?)
            }
        })
    }

    /// The view of texels that a projection records with.
    fn texel_view(&self) -> Result<Option<TexelView<'_>>> {
        match self {
            Reduce::Project(pass) => pass.texel_view().map(Some),
            Reduce::SelfVisibility(_) => Ok(None),
        }
    }
}

/// What all captures of one bake share.
pub(super) struct Captures<'c> {
    pub mesh: &'c Mesh,
    pub reduction: Reduction,
    pub face_px: u32,
    pub shortcuts: Shortcuts,
    pub partial: &'c Partial,
}

/// A sample to capture: the place of its eye, and how its faces are reduced.
#[derive(Clone, Copy)]
pub(super) struct CaptureTarget {
    /// The place of the eye, in r.
    pub eye: Vec3,
    pub job: Job,
}

/// What every batch works with.
pub(super) struct Batches {
    pub capture: Capture,
    pub reduce: Reduce,
    pub model: Model,
    pub jobs: Buffer,
    /// Whether backs of closed meshes are left out. Only an eye inside the solid would see them.
    pub culls: bool,
    /// Reduced samples of one batch on the device.
    pub samples: Buffer,
    /// The reduced samples on their way to the host.
    pub results: Buffer,
    /// Bytes of a reduced sample.
    pub sample_bytes: u64,
}

/// Eyes whose faces fit into one atlas, and where each face lies.
pub(super) struct Batch {
    pub eyes: Vec<Vec3>,
    pub slots: Vec<Slots>,
}

impl Captures<'_> {
    /// Captures every target and puts the reduced samples into `values`, in the order of their numbers. It goes on from what a
    /// cancelled bake has kept.
    pub fn run<T: Pod>(
        &self,
        baker: &Baker,
        targets: &[CaptureTarget],
        values: &mut [T],
        progress: Progress<'_>,
    ) -> Result<BakeReport> {
        let all = targets.len() as u32;
        let begun = self.partial.load(values, all);
        let numbers = self.reduction.numbers();
        let mut batches = Batches::new(baker, self, (numbers * size_of::<T>()) as u64)?;
        let mut report = BakeReport::default();
        let mut rest = &targets[begun as usize..];
        while !rest.is_empty() {
            rest = batches.run_next(rest, (&mut *values, numbers), &mut report)?;
            let done = (targets.len() - rest.len()) as u32;
            self.partial.save(values, done, all);
            progress(done, all);
        }
        self.partial.remove();
        Ok(report)
    }
}

impl Batches {
    fn new(baker: &Baker, captures: &Captures<'_>, sample_bytes: u64) -> Result<Self> {
        let radiance = captures.reduction.is_radiance();
        let (device, library) = (baker.device(), baker.library());
        let mut capture = Capture::new(device, library, captures.face_px, radiance)?;
        capture.skips = captures.shortcuts.faces;
        let bytes = u64::from(capture.capacity()) * sample_bytes;
        Ok(Batches {
            reduce: Reduce::new(baker, captures, capture.columns)?,
            model: Model::new(device, captures.mesh, radiance)?,
            jobs: Project::job_buffer(device, capture.capacity())?,
            culls: captures.shortcuts.inside,
            samples: Buffer::new(device, "batch samples", BufferKind::Device, bytes)?,
            results: Buffer::new(device, "batch results", BufferKind::Readback, bytes)?,
            sample_bytes,
            capture,
        })
    }

    /// Captures and reduces as many of the targets as fit into one atlas, and returns the others.
    fn run_next<'t, T: Pod>(
        &mut self,
        targets: &'t [CaptureTarget],
        (values, numbers): (&mut [T], usize),
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
        let texels = self.reduce.texel_view()?;
        let mut commands = Commands::new(self.samples.device(), "bake batch")?;
        super::record_batch(&mut commands, self, &batch, texels.as_ref())?;
        report.add(&commands.submit()?);
        report.faces += batch.slots.iter().flatten().filter(|slot| **slot != NO_SLOT).count() as u32;
        let found: Vec<T> = self.results.read(0, now.len() * numbers);
        for (target, sample) in now.iter().zip(found.chunks_exact(numbers)) {
            values[target.job.target as usize * numbers..][..numbers].copy_from_slice(sample);
        }
        Ok(rest)
    }
}
