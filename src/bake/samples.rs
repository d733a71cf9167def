//! Decides which samples of a field are captured and from where, and what each stored sample is made of.

use super::assemble::Sources;
use super::surface::{self, Surface};
use super::triangles::{distinct, unit_positions};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::Lattice;
use glam::{DVec3, Vec3};

#[derive(Clone, Copy)]
pub(super) struct Sample {
    pub number: u32,
    /// From where it is captured, in r.
    pub eye: Vec3,
    pub scale: f32,
}

pub(super) struct FieldSamples {
    /// Those that are captured: all that see anything, once at each place.
    pub captured: Vec<Sample>,
    pub inside_count: u32,
    /// The captured samples that each stored sample is assembled from.
    pub sources: Sources,
}

impl FieldSamples {
    /// Plans the samples of a field. Those inside the solid are captured off its surface. `Input` when no sample can
    /// see the object.
    pub fn new(mesh: &Mesh, lattice: &Lattice) -> Result<Self> {
        let positions: Vec<DVec3> = (0..lattice.sample_count()).map(|i| lattice.position(i)).collect();
        let surface = Surface::new(&unit_positions(mesh), &distinct(mesh));
        let mut inside = surface::inside(&surface, &positions);
        let pushed = surface::pushed_out(&surface, &positions, &inside);
        let mut unseen: Vec<bool> = inside.iter().zip(&pushed).map(|(inside, eye)| *inside && eye.is_none()).collect();
        for sample in 0..positions.len() {
            let first = first_at_place(lattice, sample as u32) as usize;
            inside[sample] = inside[first];
            unseen[sample] = unseen[first];
        }
        let sources = Sources::new(lattice, &inside, &unseen)?;
        let is_first = |sample: usize| first_at_place(lattice, sample as u32) as usize == sample;
        let seen = (0..positions.len()).filter(|&sample| !unseen[sample] && is_first(sample));
        let captured = seen.map(|sample| {
            let eye = pushed[sample].unwrap_or(positions[sample]);
            let scale = lattice.scale(lattice.distance(eye).max(lattice.inner)) as f32;
            Sample { number: sample as u32, eye: eye.as_vec3(), scale }
        });
        let inside_count = inside.iter().filter(|inside| **inside).count() as u32;
        Ok(FieldSamples { captured: captured.collect(), inside_count, sources })
    }
}

/// The first sample at the place of this one. Samples on an edge between faces of the lattice's cube have several
/// numbers, of which the first alone is captured and assembled.
fn first_at_place(lattice: &Lattice, sample: u32) -> u32 {
    let count = lattice.direction_count();
    sample / count * count + lattice.first_of(sample % count)
}
