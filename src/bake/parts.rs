//! What is baked of a mesh, kind by kind, whole or in parts that other processes make: the slices of a farm.
//!
//! A part holds the reduced samples of a run of targets. The targets keep the places that the plan of the whole bake gives them, so
//! all parts together are the samples of an undivided bake. To join them, they are written as what a cancelled bake has kept, of
//! which nothing is left to capture.

use super::batches::{CaptureTarget, Captures, Reduction};
use super::cache::Cache;
use super::kinds::Kind;
use super::levels;
use super::partial::{self, Partial};
use super::project::Projection;
use super::samples::FieldSamples;
use super::vertices::{self, Wanted};
use super::{Baker, Options, Progress, captured_bytes, header};
use crate::asset::Mesh;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The part `index` of `count` parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BakePart {
    /// 0 to `count` - 1.
    pub index: u32,
    /// At least 1.
    pub count: u32,
}

impl BakePart {
    /// The undivided whole.
    pub const WHOLE: BakePart = BakePart { index: 0, count: 1 };

    fn of(self, all: usize) -> Range<usize> {
        let at = |part: u32| (all as u64 * u64::from(part) / u64::from(self.count)) as usize;
        at(self.index)..at(self.index + 1)
    }
}

/// Bakes one kind of thing of a mesh, or finds it, so that the cache holds it then.
///
/// # Errors
/// As [`Baker::field`].
pub fn bake(
    baker: &Baker,
    cache: &Cache,
    (mesh, options): (&Mesh, &Options),
    kind: Kind,
    progress: Progress<'_>,
) -> Result<()> {
    match kind {
        Kind::Shadow | Kind::Light => {
            cache.field(baker, mesh, &header(mesh, kind.field(), options), progress).map(|_| ())
        }
        Kind::Silhouette => cache.silhouette(baker, mesh, options, progress).map(|_| ()),
        Kind::Vertices => cache.vertices(baker, mesh, options, Wanted::BOTH, progress).map(|_| ()),
    }
}

/// How a kind of thing is reduced, and the bytes of all its samples in their places.
fn reduction(mesh: &Mesh, options: &Options, kind: Kind) -> Result<(Reduction, u64)> {
    let vertices = mesh.positions.len() as u64;
    Ok(match kind {
        Kind::Shadow | Kind::Light => {
            let header = header(mesh, kind.field(), options);
            header.validate()?;
            let projection = if kind == Kind::Light { Projection::Radiance } else { Projection::Blocked };
            (Reduction::Project { bands: header.bands, projection }, captured_bytes(&header))
        }
        Kind::Vertices => {
            let reduction = Wanted::BOTH.reduction(options.bands);
            (reduction, vertices * reduction.sample_bytes() as u64)
        }
        Kind::Silhouette => return Err(Error::Failed("a silhouette field has no parts".into())),
    })
}

/// What is captured for a kind of thing.
fn targets(baker: &Baker, mesh: &Mesh, options: &Options, kind: Kind) -> Result<Vec<CaptureTarget>> {
    Ok(match kind {
        Kind::Vertices => vertices::targets(mesh, options, Wanted::BOTH).0,
        _ => {
            let mut header = header(mesh, kind.field(), options);
            baker.fits(&header)?;
            FieldSamples::new(mesh, &mut header)?.targets
        }
    })
}

/// Captures one part of a kind of thing that can be cut: for each of its targets the number of its place, in four bytes, and its reduced
/// sample. The bytes are for [`join`].
///
/// # Errors
/// As [`Baker::field`].
pub fn bake_part(
    baker: &Baker,
    (mesh, options): (&Mesh, &Options),
    kind: Kind,
    part: BakePart,
    progress: Progress<'_>,
) -> Result<Vec<u8>> {
    let (reduction, _) = reduction(mesh, options, kind)?;
    let targets = targets(baker, mesh, options, kind)?;
    let partial = Partial::new(None);
    let Options { face_px, shortcuts, .. } = *options;
    let levels = kind != Kind::Light && levels::are_used(mesh, options.levels);
    let setup = Captures { mesh, reduction, face_px, shortcuts, levels, partial: &partial };
    let range = part.of(targets.len());
    let samples = setup.run_part(baker, &targets, range.clone(), progress)?;
    let samples = samples.chunks_exact(reduction.sample_bytes());
    let placed = targets[range].iter().zip(samples);
    Ok(placed.flat_map(|(target, sample)| [&target.job.target.to_le_bytes(), sample].concat()).collect())
}

/// Bakes a kind of thing from all its parts, so that the cache holds it then. Nothing is captured.
///
/// # Errors
/// `Failed` where the parts are not those of this bake, or where the cache has no folder or cannot be written.
pub fn join(
    baker: &Baker,
    cache: &Cache,
    (mesh, options): (&Mesh, &Options),
    kind: Kind,
    parts: &[Vec<u8>],
) -> Result<()> {
    let broken = || Error::Failed(format!("the parts of {} of {} do not fit together", kind.name(), mesh.name));
    let path = cache.unfinished(mesh, options, kind).ok_or_else(|| Error::Failed("the cache has no folder".into()))?;
    let (reduction, bytes) = reduction(mesh, options, kind)?;
    let (sample_bytes, mut all) = (reduction.sample_bytes(), 0);
    let mut values = vec![0_u8; bytes as usize];
    for part in parts {
        let placed = part.chunks_exact(4 + sample_bytes);
        if !placed.remainder().is_empty() {
            return Err(broken());
        }
        all += placed.len() as u32;
        for (number, sample) in placed.map(|bytes| bytes.split_at(4)) {
            let number = u32::from_le_bytes(number.try_into().expect("four bytes")) as usize;
            values.chunks_exact_mut(sample_bytes).nth(number).ok_or_else(broken)?.copy_from_slice(sample);
        }
    }
    let numbers = if kind == Kind::Vertices { values.len() } else { values.len() / 4 };
    partial::write_done(&path, all, numbers, &values)?;
    bake(baker, cache, (mesh, options), kind, &|_, _| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_all_of_it_once() {
        for (all, count) in [(10, 3), (2, 5), (0, 2), (7, 1)] {
            let ranges: Vec<_> = (0..count).map(|index| BakePart { index, count }.of(all)).collect();
            assert!(ranges.iter().flat_map(Clone::clone).eq(0..all), "{ranges:?}");
        }
    }
}
