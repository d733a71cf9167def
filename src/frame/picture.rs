//! Pictures of a frame: prepared, drawn into images of one size, read back.

use super::record::PictureWork;
use super::room::READBACK_PIXEL_BYTES;
use super::viewport::{RadiositySource, Viewport};
use super::{Frame, Options};
use crate::asset::edges::Edges;
use crate::asset::picture::linear_from_srgb;
use crate::draw::pixel_light::PixelLight;
use crate::draw::smooth::{Lines, Strips};
use crate::draw::{Antialias, Draw, DrawnViewport, Finish};
use crate::error::Result;
use crate::gpu::{Buffer, BufferKind, Device, Image, Timing};
use crate::scene::Placement;
use crate::shaders::Library;
use crate::sharp::SharpPermutation;
use half::f16;
use std::ops::Range;
use std::sync::Arc;

/// The pass "draw" with its images and buffers.
pub(super) struct FramePicture {
    pub draw: Draw,
    /// The permutation of shaders whose pixels evaluate sharp lights, if any.
    pub sharp: Option<SharpPermutation>,
    /// Where the host reads a picture.
    pub readback: Buffer,
    /// Outlines and creases of the picture that was prepared last.
    pub lines: Lines,
    /// Its viewports, and which of the lines belong to each.
    prepared: Vec<(Viewport, Range<u32>)>,
    /// Edges of each mesh, once a picture wants its outlines.
    pub edges: Vec<Edges>,
}

impl FramePicture {
    /// Makes linear pictures of the size in `options`.
    ///
    /// # Errors
    /// As [`Draw::new`].
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        options: &Options,
        sharp: Option<SharpPermutation>,
    ) -> Result<Self> {
        Ok(FramePicture {
            draw: draw(device, library, options, Finish::Linear, sharp)?,
            sharp,
            readback: readback(device, options.size)?,
            lines: Lines::new(device)?,
            prepared: Vec::new(),
            edges: Vec::new(),
        })
    }

    /// The picture that was read back last: linear RGB, three floats a pixel.
    fn read(&self) -> Vec<f32> {
        let shape = self.draw.picture.shape;
        let pixels = (shape.width * shape.height) as usize;
        if self.draw.finish() == Finish::Display {
            let bytes: Vec<u8> = self.readback.read(0, 4 * pixels);
            let linear = |byte: u8| linear_from_srgb(f32::from(byte) / 255.0);
            return bytes.chunks_exact(4).flat_map(|p| [linear(p[0]), linear(p[1]), linear(p[2])]).collect();
        }
        let halves: Vec<f16> = self.readback.read(0, 4 * pixels);
        halves.chunks_exact(4).flat_map(|p| [p[0].to_f32(), p[1].to_f32(), p[2].to_f32()]).collect()
    }
}

/// The pass "draw" for pictures as options want them.
fn draw(
    device: &Arc<Device>,
    library: &Library,
    options: &Options,
    finish: Finish,
    sharp: Option<SharpPermutation>,
) -> Result<Draw> {
    let sharp = sharp.filter(|_| options.evaluates_pixels());
    Draw::new(device, library, options.size, options.antialias, finish, sharp.as_ref())
}

/// Room for a picture of either finish.
fn readback(device: &Arc<Device>, [width, height]: [u32; 2]) -> Result<Buffer> {
    Buffer::new(device, "readback", BufferKind::Readback, READBACK_PIXEL_BYTES * u64::from(width) * u64::from(height))
}

impl Frame {
    /// Divides the next picture into viewports, and finds the outlines and creases of each where they are smoothed. What it writes
    /// lies in buffers of that flight's own.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn prepare_picture(&mut self, placements: &[Placement], viewports: &[Viewport]) -> Result<()> {
        let smooths = self.picture.draw.smooth.is_some();
        if smooths && self.picture.edges.is_empty() {
            self.picture.edges = self.scene.meshes.iter().map(|mesh| Edges::new(mesh)).collect();
        }
        let mut strips = Strips::default();
        let mut prepared = Vec::with_capacity(viewports.len());
        for viewport in viewports {
            let first = strips.count() as u32;
            let [_, _, width, height] = viewport.area;
            if smooths {
                for (line, tag) in self.outlines(placements, f64::from(width) / f64::from(height.max(1))) {
                    strips.add(&line, [width, height], tag);
                }
            }
            prepared.push((*viewport, first..strips.count() as u32));
        }
        self.picture.prepared = prepared;
        self.picture.lines.write(&strips)
    }

    /// What [`super::record()`] needs to draw the picture that was prepared last; `white` as in [`Frame::render`].
    pub fn picture_work(&self, placements: &[Placement], white: f32) -> PictureWork<'_> {
        let viewport = |(viewport, lines): &(Viewport, Range<u32>)| DrawnViewport {
            area: viewport.area,
            entities: self.drawn_in(placements, viewport),
            radiosity: self.radiosity.source(viewport.radiosity),
            pixel: self.pixel_light(viewport),
            lines: lines.clone(),
        };
        PictureWork {
            draw: &self.picture.draw,
            viewports: self.picture.prepared.iter().map(viewport).collect(),
            background: self.sky.background,
            white,
            lines: &self.picture.lines,
        }
    }

    /// The picture that was recorded last: linear or encoded, white as it was recorded with.
    pub fn shown(&self) -> &Image {
        self.picture.draw.finished()
    }

    /// The last picture: linear RGB, three floats a pixel, rows from the top. A picture made for a screen is decoded: white is 1.
    pub fn picture(&self) -> Vec<f32> {
        self.picture.read()
    }

    /// The pass "draw" for pictures of another kind.
    pub(super) fn draw(&self, options: &Options, finish: Finish) -> Result<Draw> {
        draw(&self.device, &self.library, options, finish, self.picture.sharp)
    }

    /// Makes the chains of the time that was merged last, for pictures whose pixels evaluate sharp lights.
    pub(super) fn prepare_pixels(&mut self) -> Result<()> {
        let shows = self.options.evaluates_pixels() && self.work.lists.is_updated();
        let Some(pixel) = self.pixel.as_mut().filter(|_| shows) else { return Ok(()) };
        pixel.prepare(&self.work.lists)
    }

    /// What pixels read that evaluate sharp lights in a viewport.
    fn pixel_light(&self, viewport: &Viewport) -> Option<PixelLight<'_>> {
        let pixel = self.pixel.as_ref()?;
        let by_pixel = self.options.evaluates_pixels() && pixel.is_ready();
        let shown = by_pixel && viewport.radiosity == RadiositySource::Merged && !viewport.by_vertex;
        shown.then(|| PixelLight {
            entities: &pixel.entities,
            silhouettes: [&self.buffers.silhouettes.nodes, &self.buffers.silhouettes.cells],
            entries: &pixel.entries,
            chains: &pixel.chains,
            soft: self.radiosity.soft(),
            self_cells: &self.buffers.self_cells,
            vertices: &self.buffers.vertices,
        })
    }

    /// Pixels of a picture that evaluated sharp lights themselves, by the timings of its passes: the samples that they wrote over the
    /// samples of a pixel. `None` where the device does not count, or no pixel was to.
    pub fn pixels_evaluated(&self, timings: &[Timing]) -> Option<u64> {
        let samples = u64::from(self.picture.draw.samples());
        timings.iter().find_map(|timing| timing.samples).map(|written| written.div_ceil(samples))
    }

    /// Makes pictures of another size from now on.
    ///
    /// # Errors
    /// `Input` when it is larger than the device's images.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if size != self.options.size {
            let options = Options { size, ..self.options };
            self.picture.draw = self.draw(&options, self.picture.draw.finish())?;
            self.picture.readback = readback(&self.device, size)?;
            self.options = options;
        }
        Ok(())
    }

    /// Makes pictures for files or for a screen from now on, edges smoothed one way or another. A frame begins with linear ones.
    ///
    /// # Errors
    /// `Failed` when a shader does not compile.
    pub fn set_finish(&mut self, finish: Finish, antialias: Antialias) -> Result<()> {
        if (finish, antialias) != (self.picture.draw.finish(), self.options.antialias) {
            let options = Options { antialias, ..self.options };
            self.picture.draw = self.draw(&options, finish)?;
            self.options = options;
        }
        Ok(())
    }

    /// The picture at full quality, whatever is shown: multisampled where the device can, linear RGB, three floats a pixel, rows
    /// from the top; `white` as in [`Frame::render`]. Waits.
    ///
    /// # Errors
    /// As [`Frame::render`].
    pub fn still(&mut self, placements: &[Placement], white: f32) -> Result<Vec<f32>> {
        self.device.settle();
        let options = Options { antialias: Antialias::Samples, ..self.options };
        let fine = self.draw(&options, Finish::Linear)?;
        let usual = (std::mem::replace(&mut self.picture.draw, fine), std::mem::replace(&mut self.options, options));
        let outcome = self.render(placements, Some(white)).map(|_| self.picture());
        (self.picture.draw, self.options) = usual;
        outcome
    }
}
