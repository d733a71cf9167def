//! Options of a frame: what decides it besides the scene.

use crate::bake;
use crate::draw::{Antialias, Shading};
use crate::field::Lookup;
use crate::lists::gather::Place;
use crate::lists::skip::{EPS, Skip};
use crate::merge::variant::Variant;
use crate::scene::Lights;

/// Options of a frame: what decides it besides the scene.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Fields and transfers.
    pub bake: bake::Options,
    /// Which lights are sharp.
    pub lights: Lights,
    /// Where their light is evaluated for pictures; `None` takes [`Shading::usual`].
    pub shading: Option<Shading>,
    /// Which samples a lookup takes.
    pub lookup: Lookup,
    /// How the merge is done; `None` takes what was measured to be the device's fastest.
    pub variant: Option<Variant>,
    /// What the merge leaves out.
    pub skip: Skip,
    /// Light that the merge leaves out: contributions to a vertex that are bounded below this share of the radiance that the
    /// scene's exposure shows as white; 0 leaves none out.
    pub eps: f32,
    /// Where the lists of clusters are made; `None` takes what is known to be quicker on the device.
    pub lists: Option<Place>,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// How edges are kept from showing as stairs.
    pub antialias: Antialias,
}

impl Options {
    /// Whether pixels of pictures evaluate sharp lights, where the device can.
    pub fn evaluates_pixels(&self) -> bool {
        self.shading.unwrap_or_else(|| Shading::usual(self.antialias)) == Shading::Pixel
    }
}

impl Default for Options {
    /// What `shadow-fields render` does without options, in 960 x 640 pixels.
    fn default() -> Self {
        Options {
            bake: bake::Options::default(),
            lights: Lights::default(),
            shading: None,
            lookup: Lookup::Trilinear,
            variant: None,
            skip: Skip::ALL,
            eps: EPS,
            lists: None,
            size: [960, 640],
            antialias: Antialias::default(),
        }
    }
}
