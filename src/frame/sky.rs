//! Distant light as a frame reads it.

use super::pose;
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::gpu::{Device, Upload};
use crate::scene::Scene;
use crate::sh::basis::{Y00, coefficient_count};
use glam::Vec3;
use std::sync::Arc;

/// The sky's projection on SH.
pub(super) struct SkyLight {
    /// For the merge: coefficients of one colour after the other, [`channel_stride`] floats apart.
    pub coefficients: Upload,
    /// Its largest radiance of any colour.
    pub brightest: f64,
    /// Its mean radiance, which pictures show behind the scene.
    pub background: Vec3,
}

impl SkyLight {
    /// A sky that has still to be written.
    pub fn new(device: &Arc<Device>, bands: usize) -> Result<Self> {
        let coefficients = Upload::new(device, "sky", 12 * channel_stride(bands) as u64)?;
        Ok(SkyLight { coefficients, brightest: 0.0, background: Vec3::ZERO })
    }

    /// Takes over a scene's environment.
    pub fn write(&mut self, scene: &Scene, bands: usize) -> Result<()> {
        let channels = scene.environment.coefficients(bands);
        let stride = channel_stride(bands);
        let mut floats = vec![0.0_f32; 3 * stride];
        for (to, from) in floats.chunks_exact_mut(stride).zip(&channels) {
            to.iter_mut().zip(&from[..coefficient_count(bands)]).for_each(|(to, from)| *to = *from as f32);
        }
        self.brightest = pose::brightest(&channels, bands);
        self.background = Vec3::from_array(channels.map(|c| (c[0] * Y00) as f32));
        self.coefficients.write(&floats)
    }
}
