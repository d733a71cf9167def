//! One run of capture and project over the eyes of a field or a transfer: far eyes on simplified meshes, and from where a cancelled
//! bake was.

use super::capture::{Capture, Model, NO_SLOT, Slots, unit_positions};
use super::partial::Partial;
use super::project::{Job, Project, Projection};
use super::simplify::{self, Level};
use super::{Baker, LevelReport, Progress, Report};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::gpu::{Access, Buffer, BufferKind, Commands};
use glam::Vec3;

/// What all captures of one bake share.
pub(super) struct Sweep<'s> {
    pub baker: &'s Baker,
    pub mesh: &'s Mesh,
    pub bands: usize,
    pub projection: Projection,
    pub face_px: u32,
    pub partial: &'s Partial,
}

/// A mesh that stands for the swept one, and its colour in radiance captures.
type StandIn<'s> = Option<(&'s Level, Option<Vec3>)>;

/// An eye and what is made of what it sees.
pub(super) type Aim = (Vec3, Job);

/// What one device needs to work.
struct Worker {
    capture: Capture,
    project: Project,
    model: Model,
    jobs: Buffer,
    /// Whether backs of closed meshes are left out, which only an eye inside would see.
    culls: bool,
    /// Projected samples of one batch, on the device and on their way to the host.
    samples: [Buffer; 2],
}

impl Sweep<'_> {
    fn sample_floats(&self) -> usize {
        self.projection.channels() * channel_stride(self.bands)
    }

    /// Captures every eye, an atlas at a time, and puts what is projected into `values`, samples in the order of their numbers.
    /// `begun` of `all` targets were done before.
    fn run(
        &self,
        stand_in: StandIn<'_>,
        targets: &[Aim],
        values: &mut [f32],
        (begun, all): (u32, u32),
        progress: Progress<'_>,
    ) -> Result<Report> {
        let mut worker = Worker::new(self, stand_in)?;
        let mut report = Report::default();
        let mut rest = targets;
        while !rest.is_empty() {
            rest = worker.capture(rest, self.sample_floats(), values, &mut report)?;
            let done = begun + (targets.len() - rest.len()) as u32;
            self.partial.save(values, done, all);
            progress(done, all);
        }
        Ok(report)
    }

    /// Captures every target from the full mesh.
    pub fn alone(&self, targets: &[Aim], values: &mut [f32], progress: Progress<'_>) -> Result<Report> {
        let all = targets.len() as u32;
        let begun = self.partial.load(values, all);
        let report = self.run(None, &targets[begun as usize..], values, (begun, all), progress)?;
        self.partial.remove();
        Ok(report)
    }

    /// Captures every target, those far off from simplified meshes.
    pub fn at_levels(&self, targets: &[Aim], values: &mut [f32], progress: Progress<'_>) -> Result<Report> {
        let (mesh, radiance) = (self.mesh, self.projection == Projection::Radiance);
        // Colours that vary over the surface would have to be simplified with it.
        let color = mesh.colors.as_ref().map_or(Some(Vec3::ONE), |c| c.iter().all(|x| *x == c[0]).then_some(c[0]));
        let eyes: Vec<Vec3> = targets.iter().map(|(eye, _)| *eye).collect();
        let levels = match color {
            None if radiance => Vec::new(),
            _ => simplify::levels(&unit_positions(mesh), &mesh.triangles, &eyes, self.face_px),
        };
        let chosen = simplify::choose(&levels, &eyes, self.face_px);
        let all = targets.len() as u32;
        let begun = self.partial.load(values, all);
        let (mut done, mut report) = (0, Report::default());
        for level in (0..levels.len()).map(Some).chain([None]) {
            let part: Vec<Aim> =
                targets.iter().zip(&chosen).filter(|(_, of)| **of == level).map(|(target, _)| *target).collect();
            let triangles = level.map_or(mesh.triangles.len(), |i| levels[i].triangles.len());
            report.levels.push(LevelReport { triangles, samples: part.len() as u32 });
            // What a cancelled bake has done comes first.
            let kept = begun.saturating_sub(done).min(part.len() as u32);
            done += kept;
            let part = &part[kept as usize..];
            if part.is_empty() {
                continue;
            }
            let stand_in = level.map(|i| (&levels[i], color.filter(|_| radiance)));
            let of_part = self.run(stand_in, part, values, (done, all), progress)?;
            report.faces += of_part.faces;
            report.capture_ms += of_part.capture_ms;
            report.project_ms += of_part.project_ms;
            done += part.len() as u32;
        }
        self.partial.remove();
        Ok(report)
    }
}

impl Worker {
    fn new(sweep: &Sweep<'_>, stand_in: StandIn<'_>) -> Result<Self> {
        let radiance = sweep.projection == Projection::Radiance;
        let (device, library) = (sweep.baker.device(), sweep.baker.library());
        let mut capture = Capture::new(device, library, sweep.face_px, radiance)?;
        capture.skips = sweep.baker.faces;
        let bytes = 4 * u64::from(capture.capacity()) * sweep.sample_floats() as u64;
        let columns = capture.columns;
        Ok(Worker {
            project: Project::new(device, library, sweep.bands, sweep.projection, sweep.face_px, columns)?,
            model: match stand_in {
                Some((level, color)) => Model::stand_in(device, level, color)?,
                None => Model::new(device, sweep.mesh, radiance)?,
            },
            jobs: Project::job_buffer(device, capture.capacity())?,
            culls: sweep.baker.inside,
            samples: [
                Buffer::new(device, "batch samples", BufferKind::Device, bytes)?,
                Buffer::new(device, "batch results", BufferKind::Readback, bytes)?,
            ],
            capture,
        })
    }

    /// Captures and projects as many of the targets as fit into one atlas, and returns the others.
    fn capture<'t>(
        &mut self,
        targets: &'t [Aim],
        floats: usize,
        values: &mut [f32],
        report: &mut Report,
    ) -> Result<&'t [Aim]> {
        let eyes: Vec<Vec3> = targets.iter().map(|(eye, _)| *eye).collect();
        let plan: Vec<Slots> = self.capture.plan(&self.model, &eyes);
        let (batch, rest) = targets.split_at(plan.len());
        let numbered = batch.iter().zip(&plan).enumerate();
        let jobs: Vec<Job> =
            numbered.map(|(i, ((_, job), slots))| Job { slots: *slots, target: i as u32, ..*job }).collect();
        self.jobs.write(0, &jobs);
        report.add(&self.batch(&eyes[..plan.len()], &plan, floats)?);
        report.faces += plan.iter().flatten().filter(|slot| **slot != NO_SLOT).count() as u32;
        let found: Vec<f32> = self.samples[1].read(0, plan.len() * floats);
        for ((_, job), sample) in batch.iter().zip(found.chunks_exact(floats)) {
            values[job.target as usize * floats..][..floats].copy_from_slice(sample);
        }
        Ok(rest)
    }

    fn batch(&self, eyes: &[Vec3], plan: &[Slots], floats: usize) -> Result<Vec<crate::gpu::Timing>> {
        let atlas = &self.capture.atlas;
        let [samples, results] = &self.samples;
        let texels = self.project.texel_view()?;
        let mut commands = Commands::new(samples.device(), "bake batch")?;
        commands.image_barrier(atlas, None, Access::ColorWrite);
        if let Some(depth) = self.capture.depth() {
            commands.image_barrier(depth, None, Access::DepthWrite);
        }
        commands.pass("capture", |c| self.capture.record(c, &self.model, eyes, plan, self.culls))?;
        commands.image_barrier(atlas, Some(Access::ColorWrite), Access::ComputeSampled);
        commands.pass("project", |c| self.project.record(c, atlas, &self.jobs, &texels, samples, plan.len() as u32))?;
        commands.barrier(Access::ComputeWrite, Access::TransferRead);
        commands.copy_range(samples, 0..4 * (plan.len() * floats) as u64, results, 0);
        commands.barrier(Access::TransferWrite, Access::HostRead);
        commands.submit()
    }
}
