//! Pass "assemble": makes the stored field from captured samples. It lowers them by their curvature, which suits
//! interpolation. It copies the borders of cube faces from neighbouring faces, and it fills samples that see nothing
//! from valid ones around them. It rounds to f16 where the field is stored so.
//!
//! Input: `captured`, floats of one sample after another. Output: the field's payload at a byte offset of `field`.

use crate::error::{Error, Result};
use crate::field::lattice::Lattice;
use crate::field::quantity::Storage;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device};
use crate::shaders::{Library, ShaderPermutation};
use bytemuck::{Pod, Zeroable};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// A captured sample and its share in a stored sample.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Source {
    pub sample: u32,
    /// The share. The shares in a stored sample sum to 1.
    pub weight: f32,
}

/// Every stored sample is a weighted sum of captured samples. This lists those of all stored samples, one list after
/// another.
#[derive(Clone, Debug, PartialEq)]
pub struct Sources {
    /// Where each stored sample's list begins, and at last where the last list ends.
    pub offsets: Vec<u32>,
    pub list: Vec<Source>,
}

/// The mean height of the chord between two samples above the function, in units of the second difference. Where f'' is
/// constant, the chord over a step h is too high by f'' t (h - t) / 2 at t, and the mean of that is f'' h^2 / 12. If
/// every sample is lowered by the mean, the mean square error is least: its root falls from 0.0913 to 0.0373 h^2 f''.
const SAG: f64 = 1.0 / 12.0;

impl Sources {
    /// Plans the assembly of a lattice of which `unseen` marks the captured samples that may not be used.
    ///
    /// An unusable sample is replaced by the mean of the usable samples that are fewest steps away. A step leads to the
    /// next shell or to the next direction. `inside` marks samples that were captured elsewhere (see
    /// [`super::surface::pushed_out`]); no second difference is taken across them. Every other sample is lowered by
    /// `SAG` of its second differences along shells and along both directions.
    pub fn new(lattice: &Lattice, inside: &[bool], unseen: &[bool]) -> Result<Self> {
        if inside.iter().all(|&i| i) {
            return Err(Error::Input("every sample point lies inside the solid: nothing can see the object".into()));
        }
        let fitted = |sample: u32| {
            if !unseen[sample as usize] {
                return fit(lattice, inside, sample);
            }
            let around = nearest_usable(lattice, unseen, sample);
            let share = 1.0 / around.len() as f64;
            around.into_iter().map(|other| (other, share)).collect()
        };
        let fitted: Vec<BTreeMap<u32, f64>> = (0..unseen.len() as u32).map(fitted).collect();
        let directions = lattice.direction_count();
        let planes = lattice.sources();
        let mut offsets = vec![0];
        let mut list = Vec::new();
        for shell in 0..lattice.shells {
            for cells in &planes {
                let mut sum = BTreeMap::<u32, f64>::new();
                for cell in cells {
                    for (&sample, weight) in &fitted[(shell * directions + cell) as usize] {
                        *sum.entry(sample).or_default() += weight / cells.len() as f64;
                    }
                }
                list.extend(sum.into_iter().map(|(sample, weight)| Source { sample, weight: weight as f32 }));
                offsets.push(list.len() as u32);
            }
        }
        Ok(Sources { offsets, list })
    }
}

/// A sample less `SAG` of its second differences.
fn fit(lattice: &Lattice, inside: &[bool], sample: u32) -> BTreeMap<u32, f64> {
    let mut out = BTreeMap::from([(sample, 1.0)]);
    for pair in opposite(lattice, sample) {
        if [pair[0], pair[1], sample].iter().all(|&s| !inside[s as usize]) {
            *out.entry(sample).or_default() += 2.0 * SAG;
            for other in pair {
                *out.entry(other).or_default() -= SAG;
            }
        }
    }
    out
}

/// Fewest shells, and fewest cells along a face's edge, whose second differences measure curvature. Fewer are too far
/// apart.
const FEWEST: u32 = 4;

/// Pairs of samples between which a sample lies: the shells below and above, and the neighbours on both sides along
/// both axes of a face.
fn opposite(lattice: &Lattice, sample: u32) -> Vec<[u32; 2]> {
    let directions = lattice.direction_count();
    let shell = sample / directions;
    let direction = sample % directions;
    let mut out = Vec::new();
    if lattice.shells >= FEWEST && shell > 0 && shell + 1 < lattice.shells {
        out.push([sample - directions, sample + directions]);
    }
    if lattice.cells >= FEWEST {
        let around = lattice.cell_neighbours(direction).into_iter().map(|d| shell * directions + d).collect::<Vec<_>>();
        out.extend(around.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
    }
    out
}

/// The usable samples at the least number of steps, by breadth-first search.
fn nearest_usable(lattice: &Lattice, unseen: &[bool], start: u32) -> Vec<u32> {
    let mut seen = vec![false; unseen.len()];
    seen[start as usize] = true;
    let mut ring = vec![start];
    loop {
        let mut next = Vec::new();
        for neighbour in ring.iter().flat_map(|&sample| neighbours(lattice, sample)) {
            if !std::mem::replace(&mut seen[neighbour as usize], true) {
                next.push(neighbour);
            }
        }
        let usable: Vec<u32> = next.iter().copied().filter(|&s| !unseen[s as usize]).collect();
        if !usable.is_empty() {
            return usable;
        }
        ring = next;
    }
}

/// The samples one step away: the shells above and below, and the four directions around.
fn neighbours(lattice: &Lattice, sample: u32) -> Vec<u32> {
    let directions = lattice.direction_count();
    let shell = sample / directions;
    let direction = sample % directions;
    let around = lattice.cell_neighbours(direction);
    let mut out: Vec<u32> = around.into_iter().map(|d| shell * directions + d).collect();
    out.extend((shell > 0).then(|| sample - directions));
    out.extend((shell + 1 < lattice.shells).then(|| sample + directions));
    out
}

const WORKGROUP: u32 = 64;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    quad_count: u32,
    sample_quads: u32,
    factor: f32,
}

pub struct Assemble {
    pipeline: ComputePipeline,
}

impl Assemble {
    pub fn row(storage: Storage) -> ShaderPermutation {
        ShaderPermutation::new("assemble.comp", 4)
            .define("HALF", storage == Storage::F16)
            .define("WORKGROUP", WORKGROUP)
    }

    pub fn new(device: &Arc<Device>, library: &Library, storage: Storage) -> Result<Self> {
        let shader = library.shader(&Self::row(storage))?;
        Ok(Assemble { pipeline: ComputePipeline::new(device, "assemble", &shader)? })
    }

    /// Writes `stored_count` samples of `sample_quads` quads, each multiplied by `factor`, into a byte range of
    /// `field`.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        [captured, offsets, list]: [&'r Buffer; 3],
        (field, range): (&'r Buffer, Range<u64>),
        (stored_count, sample_quads): (u32, u32),
        factor: f32,
    ) -> Result<()> {
        let push = Push { quad_count: stored_count * sample_quads, sample_quads, factor };
        let resources = [Bind::Buffer(captured), Bind::Buffer(offsets), Bind::Buffer(list), Bind::Range(field, range)];
        commands.dispatch(&self.pipeline, &resources, &push, [push.quad_count, 1, 1])
    }
}

/// The CPU twin of the pass, before values are rounded to the storage format.
pub fn twin(captured: &[f32], sources: &Sources, sample_stride: usize, factor: f32) -> Vec<f64> {
    let lists = sources.offsets.windows(2).map(|w| &sources.list[w[0] as usize..w[1] as usize]);
    let number = |(list, k): (&[Source], usize)| {
        let part = |s: &Source| f64::from(s.weight) * f64::from(captured[s.sample as usize * sample_stride + k]);
        list.iter().map(part).sum::<f64>() * f64::from(factor)
    };
    lists.flat_map(|list| (0..sample_stride).map(move |k| (list, k))).map(number).collect()
}
