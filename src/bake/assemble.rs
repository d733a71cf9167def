//! Pass "assemble": captured samples to the field as stored: cube borders copied from neighbouring faces, samples inside the
//! solid filled from valid ones around them, halves where wanted.
//!
//! Input: `captured`, floats of one sample after another. Output: the field's payload at a byte offset of the store.

use crate::error::{Error, Result};
use crate::field::lattice::{Directions, Lattice};
use crate::field::quantity::Storage;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device};
use crate::shaders::{Library, Row};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;
use std::sync::Arc;

/// For every stored sample the captured ones whose mean it is, as offsets into a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sources {
    /// Where each stored sample's list begins; one more than there are samples.
    pub offsets: Vec<u32>,
    /// Captured samples.
    pub list: Vec<u32>,
}

impl Sources {
    /// Plans the assembly of a lattice of which `inside` marks the captured samples that may not be used.
    ///
    /// An unusable sample is replaced by the mean of the usable ones that are fewest steps away, a step leading to the next
    /// shell or the next direction.
    ///
    /// # Errors
    /// `Input` when no sample is usable.
    pub fn new(lattice: &Lattice, inside: &[bool]) -> Result<Self> {
        if inside.iter().all(|&i| i) {
            return Err(Error::Input("every sample point lies inside the solid: nothing can see the object".into()));
        }
        let replacements: Vec<Vec<u32>> = (0..inside.len() as u32)
            .map(|sample| if inside[sample as usize] { nearest_usable(lattice, inside, sample) } else { vec![sample] })
            .collect();
        let directions = lattice.direction_count();
        let planes = lattice.sources();
        let (mut offsets, mut list) = (vec![0], Vec::new());
        for shell in 0..lattice.shells {
            for cells in &planes {
                for cell in cells {
                    // A corner's three cells weigh the same only when each brings one sample: take their means in turn.
                    list.extend(&replacements[(shell * directions + cell) as usize]);
                }
                offsets.push(list.len() as u32);
            }
        }
        Ok(Sources { offsets, list })
    }
}

/// The usable samples at the least number of steps, by breadth-first search.
fn nearest_usable(lattice: &Lattice, inside: &[bool], start: u32) -> Vec<u32> {
    let mut seen = vec![false; inside.len()];
    seen[start as usize] = true;
    let mut ring = vec![start];
    loop {
        let mut next = Vec::new();
        for neighbour in ring.iter().flat_map(|&sample| neighbours(lattice, sample)) {
            if !std::mem::replace(&mut seen[neighbour as usize], true) {
                next.push(neighbour);
            }
        }
        let usable: Vec<u32> = next.iter().copied().filter(|&s| !inside[s as usize]).collect();
        if !usable.is_empty() {
            return usable;
        }
        ring = next;
    }
}

/// The samples one step away: the shells above and below, and the four directions around.
fn neighbours(lattice: &Lattice, sample: u32) -> Vec<u32> {
    let directions = lattice.direction_count();
    let (shell, direction) = (sample / directions, sample % directions);
    let mut out: Vec<u32> = match lattice.directions {
        Directions::Cube { .. } => lattice.cell_neighbours(direction),
        Directions::LatLon { latitudes, longitudes } => {
            let (y, x) = (direction / longitudes, direction % longitudes);
            let mut around =
                vec![y * longitudes + (x + 1) % longitudes, y * longitudes + (x + longitudes - 1) % longitudes];
            around.extend((y > 0).then(|| direction - longitudes));
            around.extend((y + 1 < latitudes).then(|| direction + longitudes));
            around
        }
    }
    .into_iter()
    .map(|d| shell * directions + d)
    .collect();
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

/// The pipeline for one storage format.
pub struct Assemble {
    pipeline: ComputePipeline,
}

impl Assemble {
    /// The row of the shader table.
    pub fn row(storage: Storage) -> Row {
        Row::new("assemble.comp", 4).define("HALF", storage == Storage::F16).define("WORKGROUP", WORKGROUP)
    }

    /// A pipeline that stores `storage`.
    ///
    /// # Errors
    /// As every pipeline.
    pub fn new(device: &Arc<Device>, library: &Library, storage: Storage) -> Result<Self> {
        let shader = library.shader(&Self::row(storage))?;
        Ok(Assemble { pipeline: ComputePipeline::new(device, "assemble", &shader, &[])? })
    }

    /// Writes `stored_count` samples of `sample_quads` quads, each multiplied by `factor`, into a byte range of `store`.
    ///
    /// # Errors
    /// `Input` when a buffer is larger than the device can bind.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        [captured, offsets, list]: [&'r Buffer; 3],
        (store, range): (&'r Buffer, Range<u64>),
        (stored_count, sample_quads): (u32, u32),
        factor: f32,
    ) -> Result<()> {
        let push = Push { quad_count: stored_count * sample_quads, sample_quads, factor };
        let resources = [Bind::Buffer(captured), Bind::Buffer(offsets), Bind::Buffer(list), Bind::Range(store, range)];
        commands.dispatch(&self.pipeline, &resources, &push, [push.quad_count, 1, 1])
    }
}

/// The CPU twin, before rounding to the storage format.
pub fn reference(captured: &[f32], sources: &Sources, sample_stride: usize, factor: f32) -> Vec<f64> {
    let lists = sources.offsets.windows(2).map(|w| &sources.list[w[0] as usize..w[1] as usize]);
    lists
        .flat_map(|list| {
            (0..sample_stride).map(move |k| {
                let sum: f64 = list.iter().map(|&s| f64::from(captured[s as usize * sample_stride + k])).sum();
                sum * f64::from(factor) / list.len() as f64
            })
        })
        .collect()
}
