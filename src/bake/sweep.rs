//! One run of capture and project over the eyes of a field or a transfer, an atlas at a time: far eyes on simplified meshes, and
//! from where a cancelled bake was.

use super::capture::{Capture, Model, Slots, unit_positions};
use super::partial::Partial;
use super::project::{Job, Project};
use super::{LevelReport, Progress, Report, simplify};
use crate::asset::Mesh;
use crate::error::Result;
use crate::gpu::{Access, Buffer, Commands};
use glam::Vec3;

/// What all captures of one bake share.
pub(super) struct Sweep<'s> {
    pub capture: &'s Capture,
    pub project: &'s Project,
    /// The full mesh.
    pub model: &'s Model,
    pub partial: &'s Partial,
}

impl Sweep<'_> {
    /// Captures every eye and projects it into `samples`, an atlas at a time.
    fn run(&self, targets: &[(Vec3, Job)], samples: &Buffer, progress: Progress<'_>) -> Result<Report> {
        let eyes: Vec<Vec3> = targets.iter().map(|(eye, _)| *eye).collect();
        let texels = self.project.texel_view()?;
        let mut jobs = Project::job_buffer(samples.device(), self.capture.capacity())?;
        let mut report = Report::default();
        let mut done = 0;
        while done < eyes.len() {
            // An eye takes at least one job, and a job at most one capacity.
            let rest = done..eyes.len().min(done + self.capture.capacity() as usize);
            let plan: Vec<Slots> = self.capture.plan(self.model, &eyes[rest]);
            let batch = done..done + plan.len();
            let filled: Vec<Job> = targets[batch.clone()]
                .iter()
                .zip(&plan)
                .map(|((_, job), slots)| Job { slots: *slots, ..*job })
                .collect();
            jobs.write(0, &filled);
            report.add(&self.batch(&eyes[batch.clone()], &plan, &jobs, &texels, samples)?);
            done = batch.end;
            progress(done as u32, eyes.len() as u32);
        }
        Ok(report)
    }

    fn batch(
        &self,
        eyes: &[Vec3],
        plan: &[Slots],
        jobs: &Buffer,
        texels: &crate::gpu::TexelView<'_>,
        samples: &Buffer,
    ) -> Result<Vec<crate::gpu::Timing>> {
        let atlas = &self.capture.atlas;
        let mut commands = Commands::new(samples.device(), "bake batch")?;
        commands.image_barrier(atlas, None, Access::ColorWrite);
        if let Some(depth) = self.capture.depth() {
            commands.image_barrier(depth, None, Access::DepthWrite);
        }
        commands.pass("capture", |c| self.capture.record(c, self.model, eyes, plan, true))?;
        commands.image_barrier(atlas, Some(Access::ColorWrite), Access::ComputeSampled);
        commands.pass("project", |c| self.project.record(c, atlas, jobs, texels, samples, plan.len() as u32))?;
        commands.submit()
    }

    /// Captures every target from the full mesh.
    pub fn alone(&self, targets: &[(Vec3, Job)], samples: &mut Buffer, progress: Progress<'_>) -> Result<Report> {
        let floats = samples.size_bytes as usize / 4;
        let all = targets.len() as u32;
        let begun = self.partial.load(samples, floats, all)?;
        let samples = &*samples;
        let report = self.run(&targets[begun as usize..], samples, &|now, _| {
            self.partial.save(samples, floats, begun + now, all);
            progress(begun + now, all);
        })?;
        self.partial.remove();
        Ok(report)
    }

    /// Captures every target, those far off from simplified meshes.
    pub fn at_levels(
        &self,
        mesh: &Mesh,
        radiance: bool,
        targets: &[(Vec3, Job)],
        samples: &mut Buffer,
        progress: Progress<'_>,
    ) -> Result<Report> {
        // Colours that vary over the surface would have to be simplified with it.
        let color = mesh.colors.as_ref().map_or(Some(Vec3::ONE), |c| c.iter().all(|x| *x == c[0]).then_some(c[0]));
        let eyes: Vec<Vec3> = targets.iter().map(|(eye, _)| *eye).collect();
        let levels = match color {
            None if radiance => Vec::new(),
            _ => simplify::levels(&unit_positions(mesh), &mesh.triangles, &eyes, self.capture.face_px),
        };
        let chosen = simplify::choose(&levels, &eyes, self.capture.face_px);
        let floats = samples.size_bytes as usize / 4;
        let all = targets.len() as u32;
        let begun = self.partial.load(samples, floats, all)?;
        let samples = &*samples;
        let (mut done, mut report) = (0, Report::default());
        for level in (0..levels.len()).map(Some).chain([None]) {
            let part: Vec<(Vec3, Job)> =
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
            let device = samples.device();
            let color = color.filter(|_| radiance);
            let stand_in = level.map(|i| Model::stand_in(device, &levels[i], color)).transpose()?;
            let sweep = Sweep { model: stand_in.as_ref().unwrap_or(self.model), ..*self };
            let of_part = sweep.run(part, samples, &|now, _| {
                self.partial.save(samples, floats, done + now, all);
                progress(done + now, all);
            })?;
            report.capture_ms += of_part.capture_ms;
            report.project_ms += of_part.project_ms;
            done += part.len() as u32;
        }
        self.partial.remove();
        Ok(report)
    }
}
