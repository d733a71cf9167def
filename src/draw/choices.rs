//! A user's choices of how pictures are drawn.

use crate::gpu::Device;
use ash::vk;

/// How the edges of what is drawn are kept from showing as stairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Antialias {
    /// One sample a pixel; edges show as stairs.
    None,
    /// One sample a pixel, and outlines and creases smoothed by pass "smooth".
    Outlines,
    /// Four samples a pixel where the device can.
    #[default]
    Samples,
}

impl Antialias {
    /// Default at interactive rates. On a GPU four samples cost little; a software device stores and
    /// averages each.
    pub fn usual(device: &Device) -> Self {
        if device.info.is_software() { Antialias::Outlines } else { Antialias::Samples }
    }

    /// Samples a pixel on a device.
    pub(super) fn samples(self, device: &Device) -> u32 {
        let limits = &device.limits;
        let offered = limits.framebuffer_color_sample_counts & limits.framebuffer_depth_sample_counts;
        if self == Antialias::Samples && offered.contains(vk::SampleCountFlags::TYPE_4) { 4 } else { 1 }
    }
}

/// Where the light of sharp lights is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Shading {
    /// At vertices only; pixels interpolate.
    Vertex,
    /// At pixels near shadow edges that are finer than the mesh's triangles; else at vertices.
    Pixel,
}

impl Shading {
    /// Default of the shading: pixels where they have several samples, as on a GPU and in files, else vertices. A
    /// pixel that evaluates lights takes about 1 us of a core on llvmpipe, so frames full of shadow edges take up to 10
    /// times as long as with vertices.
    pub fn usual(antialias: Antialias) -> Self {
        if antialias == Antialias::Samples { Shading::Pixel } else { Shading::Vertex }
    }
}
