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
use crate::field::self_visibility::NODES;
use serde::{Deserialize, Serialize};
use std::ops::Range;

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
        Kind::SelfVisibility => (vertex_targets(mesh).collect(), Reduction::SelfVisibility, vertices * NODES as u64),
        Kind::Transfer => {
            let reduction = Reduction::Project { bands: options.bands, projection: Projection::Transfer };
            (transfer_targets(mesh, options).0, reduction, 4 * vertices * channel_stride(options.bands) as u64)
        }
        Kind::Silhouette => return Err(Error::Failed("a silhouette field has no parts".into())),
    })
}

/// Captures one part of a kind of thing that can be cut: its reduced samples, which are for [`join`].
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
    let (targets, reduction, _) = captures(baker, mesh, options, kind)?;
    let partial = Partial::new(None);
    let Options { face_px, shortcuts, .. } = *options;
    let setup = Captures { mesh, reduction, face_px, shortcuts, partial: &partial };
    setup.run_part(baker, &targets, part.of(targets.len()), progress)
}

/// Bakes a kind of thing from all its parts, in their order, so that the cache holds it then. Nothing is captured.
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
    let path = cache.unfinished(mesh, options, kind).ok_or_else(|| Error::Failed("the cache has no folder".into()))?;
    let (targets, reduction, bytes) = captures(baker, mesh, options, kind)?;
    let sample_bytes = reduction.sample_bytes();
    let fits = |(index, samples): (usize, &Vec<u8>)| {
        let part = Part { index: index as u32, count: parts.len() as u32 };
        samples.len() == part.of(targets.len()).len() * sample_bytes
    };
    if parts.is_empty() || !parts.iter().enumerate().all(fits) {
        return Err(Error::Failed(format!("the parts of {} of {} do not fit together", kind.name(), mesh.name)));
    }
    let mut values = vec![0_u8; bytes as usize];
    for (target, sample) in targets.iter().zip(parts.iter().flat_map(|part| part.chunks_exact(sample_bytes))) {
        values[target.job.target as usize * sample_bytes..][..sample_bytes].copy_from_slice(sample);
    }
    let numbers = if kind == Kind::SelfVisibility { values.len() } else { values.len() / 4 };
    partial::write_done(&path, targets.len() as u32, numbers, &values)?;
    bake(baker, cache, (mesh, options), kind, &|_, _| ())
}
