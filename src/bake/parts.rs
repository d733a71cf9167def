//! What is baked of a mesh, kind by kind, whole or in parts that other processes make: the slices of a farm.
//!
//! A part holds the reduced samples of a run of targets. The targets keep the places that the plan of the whole bake gives them, so
//! all parts together are the samples of an undivided bake. To join them, they are written as what a cancelled bake has kept, of
//! which nothing is left to capture.

use super::batches::{CaptureTarget, Captures, Reduction};
use super::cache::Cache;
use super::kinds::Kind;
use super::partial::{self, Partial};
use super::project::Projection;
use super::samples::FieldSamples;
use super::{Baker, Options, Progress, captured_bytes, header, transfer_targets, vertex_targets};
use crate::asset::Mesh;
use crate::error::{Error, Result};
use crate::field::FieldHeader;
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::BYTES;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Bytes before the samples of a part: five numbers of eight bytes.
const PROLOGUE: usize = 40;

/// The part `index` of `count` parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// 0 to `count` - 1.
    pub index: u32,
    /// At least 1.
    pub count: u32,
}

impl Part {
    /// The undivided whole.
    pub const WHOLE: Part = Part { index: 0, count: 1 };

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
        Kind::SelfVisibility => cache.self_visibility(baker, mesh, options, progress).map(|_| ()),
        Kind::Transfer => cache.transfer(baker, mesh, options, progress).map(|_| ()),
    }
}

/// What is captured for a kind of thing, how it is reduced, and the bytes of all its samples in their places.
fn captures(baker: &Baker, mesh: &Mesh, options: &Options, kind: Kind) -> Result<(Vec<CaptureTarget>, Reduction, u64)> {
    let vertices = mesh.positions.len() as u64;
    Ok(match kind {
        Kind::Shadow | Kind::Light => {
            let mut header: FieldHeader = header(mesh, kind.field(), options);
            header.validate()?;
            baker.fits(&header)?;
            let targets = FieldSamples::new(mesh, &mut header)?.targets;
            let projection = if kind == Kind::Light { Projection::Radiance } else { Projection::Blocked };
            (targets, Reduction::Project { bands: header.bands, projection }, captured_bytes(&header))
        }
        Kind::SelfVisibility => (vertex_targets(mesh).collect(), Reduction::SelfVisibility, vertices * BYTES as u64),
        Kind::Transfer => {
            let reduction = Reduction::Project { bands: options.bands, projection: Projection::Transfer };
            (transfer_targets(mesh, options).0, reduction, 4 * vertices * channel_stride(options.bands) as u64)
        }
        Kind::Silhouette => return Err(Error::Failed("a silhouette field has no parts".into())),
    })
}

/// Captures one part of a kind of thing that can be cut. The bytes are for [`join`].
///
/// # Errors
/// As [`Baker::field`].
pub fn bake_part(
    baker: &Baker,
    (mesh, options): (&Mesh, &Options),
    kind: Kind,
    part: Part,
    progress: Progress<'_>,
) -> Result<Vec<u8>> {
    let (targets, reduction, bytes) = captures(baker, mesh, options, kind)?;
    let partial = Partial::new(None);
    let Options { face_px, shortcuts, .. } = *options;
    let setup = Captures { mesh, reduction, face_px, shortcuts, partial: &partial };
    let range = part.of(targets.len());
    let samples = setup.run_part(baker, &targets, range.clone(), progress)?;
    let prologue = [targets.len(), range.start, range.len(), reduction.sample_bytes(), bytes as usize];
    let mut out: Vec<u8> = prologue.iter().flat_map(|number| (*number as u64).to_le_bytes()).collect();
    out.extend(targets[range].iter().flat_map(|target| target.job.target.to_le_bytes()));
    out.extend(samples);
    Ok(out)
}

/// Bakes a kind of thing from all its parts, in their order, so that the cache holds it then. Nothing is captured.
///
/// # Errors
/// `Failed` where parts are missing or are not of one whole, or where the cache has no folder or cannot be written.
pub fn join(
    baker: &Baker,
    cache: &Cache,
    (mesh, options): (&Mesh, &Options),
    kind: Kind,
    parts: &[Vec<u8>],
) -> Result<()> {
    let broken = || Error::Failed(format!("the parts of {} of {} do not fit together", kind.name(), mesh.name));
    let path = cache.unfinished(mesh, options, kind).ok_or_else(|| Error::Failed("the cache has no folder".into()))?;
    let number = |part: &[u8], index: usize| {
        let bytes = part.get(8 * index..8 * index + 8)?;
        Some(u64::from_le_bytes(bytes.try_into().ok()?) as usize)
    };
    let mut numbers = [0; 5];
    for (index, to) in numbers.iter_mut().enumerate() {
        *to = parts.first().and_then(|part| number(part, index)).ok_or_else(broken)?;
    }
    let [all, _, _, sample_bytes, bytes] = numbers;
    let (mut values, mut next) = (vec![0_u8; bytes], 0);
    for part in parts {
        let (first, count) = (number(part, 1).ok_or_else(broken)?, number(part, 2).ok_or_else(broken)?);
        let same = [0, 3, 4].iter().all(|&index| number(part, index) == Some(numbers[index]));
        if !same || first != next || part.len() != PROLOGUE + count * (4 + sample_bytes) {
            return Err(broken());
        }
        next += count;
        let (targets, samples) = part[PROLOGUE..].split_at(4 * count);
        for (target, sample) in targets.chunks_exact(4).zip(samples.chunks_exact(sample_bytes)) {
            let target = u32::from_le_bytes(target.try_into().expect("four bytes")) as usize;
            let place = values.get_mut(target * sample_bytes..(target + 1) * sample_bytes).ok_or_else(broken)?;
            place.copy_from_slice(sample);
        }
    }
    if next != all {
        return Err(broken());
    }
    let numbers = if kind == Kind::SelfVisibility { bytes } else { bytes / 4 };
    partial::write_done(&path, all as u32, numbers, &values)?;
    bake(baker, cache, (mesh, options), kind, &|_, _| ())
}
