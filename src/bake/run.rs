//! The loop over the captures of a bake: shares out its units, gathers the samples, and tells and keeps how far it is.

use super::batches::{Batches, CaptureTarget, Captures, Unit};
use super::partial::Partial;
use super::workers;
use super::{BakeReport, Baker, Progress};
use crate::error::Result;
use bytemuck::Pod;
use std::ops::Range;

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
