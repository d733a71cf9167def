//! Distant light as a frame reads it.

use crate::draw::sky::DrawnSky;
use crate::error::Result;
use crate::field::quantity::channel_stride;
use crate::gpu::{Device, Upload};
use crate::scene::Scene;
use crate::sh::basis::{MAX_COEFFICIENTS, Y00, coefficient_count, evaluate};
use crate::sh::cube::{self, FACE_COUNT, texel_st};
use glam::Vec3;
use std::sync::Arc;

/// The sky's projection on SH.
pub(super) struct SkyLight {
    /// For the merge: coefficients of one colour after the other, [`channel_stride`] floats apart, and then the quads of
    /// the visibility volume, if there is one.
    pub coefficients: Upload,
    volume: Option<[[f32; 4]; 2]>,
    /// Its largest radiance of any colour.
    pub brightest: f64,
    /// Its mean radiance, which pictures show behind the scene where it is the same in all directions.
    pub background: Vec3,
    /// What pictures show instead, once one has been prepared.
    drawn: Option<Option<DrawnSky>>,
}

impl SkyLight {
    /// A sky that has still to be written.
    pub fn new(device: &Arc<Device>, bands: usize, volume: Option<[[f32; 4]; 2]>) -> Result<Self> {
        let bytes = 12 * channel_stride(bands) + volume.as_ref().map_or(0, size_of_val);
        let coefficients = Upload::new(device, "sky", bytes as u64)?;
        Ok(SkyLight { coefficients, volume, brightest: 0.0, background: Vec3::ZERO, drawn: None })
    }

    /// Takes over a scene's environment.
    pub fn write(&mut self, scene: &Scene, bands: usize) -> Result<()> {
        let channels = scene.environment.coefficients(bands);
        let stride = channel_stride(bands);
        let mut floats = vec![0.0_f32; 3 * stride];
        for (to, from) in floats.chunks_exact_mut(stride).zip(&channels) {
            to.iter_mut().zip(&from[..coefficient_count(bands)]).for_each(|(to, from)| *to = *from as f32);
        }
        self.brightest = brightest(&channels, bands);
        self.background = Vec3::from_array(channels.map(|c| (c[0] * Y00) as f32));
        self.drawn = None;
        floats.extend(self.volume.iter().flatten().flatten());
        self.coefficients.write(&floats)
    }

    /// Makes ready to be drawn behind a scene that has been taken over.
    pub fn prepare(&mut self, device: &Arc<Device>, scene: &Scene) -> Result<()> {
        if self.drawn.is_none() {
            self.drawn = Some(DrawnSky::new(device, &scene.environment)?);
        }
        Ok(())
    }

    /// What pictures show behind the scene besides `background`.
    pub fn drawn(&self) -> Option<&DrawnSky> {
        self.drawn.as_ref()?.as_ref()
    }
}

/// Largest value of a projected sky, of any colour, on a grid of directions that is fine against its bands; at least 0.
fn brightest(channels: &[Vec<f64>; 3], bands: usize) -> f64 {
    let mut basis = [0.0; MAX_COEFFICIENTS];
    let mut most = 0.0_f64;
    for (face, y, x) in (0..FACE_COUNT).flat_map(|face| (0..256).map(move |i| (face, i / 16, i % 16))) {
        evaluate(bands, cube::direction(face, texel_st(x, 16), texel_st(y, 16)), &mut basis);
        for channel in channels {
            most = most.max(channel.iter().zip(&basis).map(|(c, y)| c * y).sum());
        }
    }
    most
}
