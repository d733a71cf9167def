//! A baked field: its sample points ([`lattice`]), its stored numbers, and its file ([`mod@file`]).

pub mod area;
pub mod cuboid;
mod directions;
pub mod file;
pub mod fit;
pub mod lamp_colors;
pub mod lattice;
pub(crate) mod octahedron;
pub mod quantity;
pub mod self_visibility;
pub mod sheet;
pub mod silhouette;
pub mod silhouette_header;
pub mod silhouette_nodes;
pub mod sky_view;
pub mod sub_light;
pub mod visibility_volume;

pub use area::Area;
pub use fit::Fit;
pub use lattice::Lattice;
pub use quantity::{FieldKind, Storage};

use crate::error::{Error, Result};
use crate::sh::basis::coefficient_count;
use glam::DVec3;
use half::f16;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldHeader {
    pub kind: FieldKind,
    /// SH bands; bands^2 coefficients a channel.
    pub bands: usize,
    pub storage: Storage,
    pub lattice: Lattice,
    /// Edge of the captured cube faces in texels.
    pub face_px: u32,
    /// Share of a texel by which what was captured may miss the mesh, since fewer and larger triangles stood for what
    /// was far off; 0 where all triangles were drawn.
    #[serde(default, skip_serializing_if = "is_default")]
    pub level_texels: f64,
    /// Number of sample points inside the solid. They hold captures from just outside the nearest surface.
    pub filled_samples: u32,
    /// Number of captured samples; the others lie at the same places, or see nothing and follow from their neighbours.
    pub captured_samples: u32,
    /// Centre of the bounding sphere in the mesh's own frame, metres.
    pub centre_m: [f32; 3],
    pub radius_m: f32,
    /// Radiance fields: factor on the stored coefficients, so that f16 can represent any brightness. Occlusion fields:
    /// 1.
    pub radiance_scale: f32,
    pub mesh: String,
    /// Content hash of the mesh, hexadecimal.
    pub mesh_hash: String,
}

/// Whether a value may be left out of a file, where its default stands for it.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl FieldHeader {
    /// Coefficients of one channel as stored: rounded up to a multiple of four, so that shaders read whole quads.
    pub fn channel_stride(&self) -> usize {
        quantity::channel_stride(self.bands)
    }

    pub fn sample_stride(&self) -> usize {
        self.kind.channels() * self.channel_stride()
    }

    pub fn payload_bytes(&self) -> u64 {
        u64::from(self.lattice.stored_count()) * (self.sample_stride() * self.storage.bytes()) as u64
    }

    pub fn validate(&self) -> Result<()> {
        self.lattice.validate()?;
        let bad = |what: String| Err(Error::Input(what));
        if !(2..=7).contains(&self.bands) {
            return bad(format!("{} bands, a field has 2 to 7", self.bands));
        }
        if !(4..=1024).contains(&self.face_px) {
            return bad(format!("faces of {} px, a field has 4 to 1024", self.face_px));
        }
        let finite = self.centre_m.iter().all(|c| c.is_finite()) && self.radiance_scale.is_finite();
        let usable = finite && self.radius_m > 0.0 && self.radius_m.is_finite() && self.radiance_scale >= 0.0;
        if !usable {
            return bad("centre, radius or radiance scale is not a usable number".into());
        }
        Ok(())
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ShadowField {
    pub header: FieldHeader,
    /// Stored coefficients, little-endian: samples in stored order, channels within a sample, coefficients within a
    /// channel.
    pub payload: Vec<u8>,
}

impl ShadowField {
    /// Stored coefficient by stored sample, channel and coefficient, in the field's unit (blocked part or radiance),
    /// still multiplied by [`Lattice::scale`].
    pub fn stored(&self, sample: u32, channel: usize, coefficient: usize) -> f64 {
        let header = &self.header;
        let at = sample as usize * header.sample_stride() + channel * header.channel_stride() + coefficient;
        let bytes = &self.payload[at * header.storage.bytes()..][..header.storage.bytes()];
        let raw = match header.storage {
            Storage::F32 => f64::from(bytemuck::pod_read_unaligned::<f32>(bytes)),
            Storage::F16 => bytemuck::pod_read_unaligned::<f16>(bytes).to_f64(),
        };
        raw * f64::from(header.radiance_scale)
    }

    /// Whether every stored number is zero: its object blocks or emits nothing.
    pub fn is_empty(&self) -> bool {
        let numbers = self.header.sample_stride();
        (0..self.header.lattice.stored_count())
            .all(|sample| (0..numbers).all(|number| self.stored(sample, 0, number) == 0.0))
    }

    /// The same field in floats, which hold every half exactly and are read sooner.
    pub fn widened(&self) -> Self {
        let payload = match self.header.storage {
            Storage::F32 => self.payload.clone(),
            Storage::F16 => {
                let halves = self.payload.as_chunks::<2>().0.iter().map(|bytes| f16::from_le_bytes(*bytes));
                halves.flat_map(|half| half.to_f32().to_le_bytes()).collect()
            }
        };
        ShadowField { header: FieldHeader { storage: Storage::F32, ..self.header.clone() }, payload }
    }

    /// The field at `position` (object's frame, in r from the sphere's centre): coefficients of one channel. The twin
    /// of `glsl/field.glsl`.
    pub fn lookup(&self, position: DVec3, channel: usize, out: &mut [f64]) {
        let lattice = &self.header.lattice;
        let corners = lattice.corners(position);
        let unscale = lattice.unscale(lattice.distance(position));
        for (coefficient, value) in out.iter_mut().enumerate().take(coefficient_count(self.header.bands)) {
            let at = |(index, weight): (u32, f64)| weight * self.stored(index, channel, coefficient);
            *value = corners.index.into_iter().zip(corners.weight).map(at).sum::<f64>() * unscale;
        }
    }
}
