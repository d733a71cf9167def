//! Fields as one image of three dimensions, for variants that let a sampler interpolate: where each channel of a field stands in
//! it. `glsl/field.glsl` finds them in the same way.

use crate::error::Result;
use crate::field::Lattice;
use crate::field::lattice::Directions;
use crate::field::quantity::channel_stride;
use crate::gpu::{Device, Volume};
use std::sync::Arc;

/// Places of channels of one lattice. A channel takes a box of texels: a coefficient quad after the other along x, the cells of
/// a face's row within each; rows of all six faces along y; shells along z. Boxes stand along z as far as the device's images
/// reach, then along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageShelf {
    lattice: Lattice,
    /// Cells of a face's row as stored, border included.
    columns: u32,
    quads: u32,
    /// Boxes along z and y.
    along: [u32; 2],
}

impl ImageShelf {
    /// A shelf for `channels` channels of `bands` bands; `None` where directions are no cube, or the device's images are too small.
    pub fn new(device: &Device, lattice: Lattice, bands: usize, channels: u32) -> Option<Self> {
        let Directions::Cube { cells } = lattice.directions else { return None };
        let most = Volume::most(device);
        let (columns, quads) = (cells + 2, (channel_stride(bands) / 4) as u32);
        let deep = channels.clamp(1, (most / lattice.shells).max(1));
        let shelf = ImageShelf { lattice, columns, quads, along: [deep, channels.max(1).div_ceil(deep)] };
        shelf.size().iter().all(|&n| n <= most).then_some(shelf)
    }

    /// Texels along x, y and z.
    pub fn size(&self) -> [u32; 3] {
        let [deep, high] = self.along;
        [self.quads * self.columns, 6 * self.columns * high, self.lattice.shells * deep]
    }

    /// The image. `channels` are the stored numbers of each in order: four halves a quad, quads within a sample, samples in stored
    /// order.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn fill<'c>(
        &self,
        device: &Arc<Device>,
        channels: impl Iterator<Item = Box<dyn Fn(usize, usize) -> [u16; 4] + 'c>>,
    ) -> Result<Volume> {
        let [width, height, depth] = self.size().map(|n| n as usize);
        let (columns, rows) = (self.columns as usize, 6 * self.columns as usize);
        let (quads, shells) = (self.quads as usize, self.lattice.shells as usize);
        let mut texels = vec![[0; 4]; width * height * depth];
        for (number, quad_of) in channels.enumerate() {
            let (y0, z0) = (number / self.along[0] as usize * rows, number % self.along[0] as usize * shells);
            for sample in 0..shells * rows * columns {
                let (shell, y, x) = (sample / (rows * columns), sample / columns % rows, sample % columns);
                let row = ((z0 + shell) * height + y0 + y) * width;
                (0..quads).for_each(|quad| texels[row + quad * columns + x] = quad_of(sample, quad));
            }
        }
        Volume::with_data(device, "fields", self.size(), &texels)
    }
}
