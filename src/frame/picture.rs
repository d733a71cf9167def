//! Pictures of a frame: prepared, drawn into images of one size, read back.

use super::memory::READBACK_PIXEL_BYTES;
use super::permutation::pixel_shading;
use super::record::PictureWork;
use super::viewport::Viewport;
use super::{Frame, Options, gloss, mirror};
use crate::asset::edges::Edges;
use crate::draw::pixel_light::PixelLight;
use crate::draw::smooth::Lines;
use crate::draw::triangles::DrawnSurface;
use crate::draw::{Antialias, Draw, DrawnViewport, EVERYWHERE, PictureLights};
use crate::error::Result;
use crate::gpu::{Buffer, BufferKind, Device, Image};
use crate::scene::{Placement, Scene};
use crate::scene_buffers::SceneBuffers;
use crate::shaders::Library;
use half::f16;
use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

/// The pass "draw" with its images and buffers.
pub(super) struct FramePicture {
    pub draw: Draw,
    /// Whether pictures are refined ([`Frame::refine`]).
    pub refined: bool,
    /// The other of the coarse and the refined way, once both were wanted.
    pub other: Option<Draw>,
    /// Where the host reads a picture.
    pub readback: Buffer,
    /// Outlines and creases of the picture that was prepared last.
    pub lines: Lines,
    /// Its viewports, and which of the lines belong to each.
    pub prepared: Vec<(Viewport, Range<u32>)>,
    /// What mirrors in it.
    pub mirrors: Vec<mirror::Mirror>,
    /// Edges of each mesh, once a picture wants its outlines.
    pub edges: Vec<Edges>,
}

impl FramePicture {
    /// Makes pictures of the size in `options`.
    pub fn new(device: &Arc<Device>, library: &Library, options: &Options, lights: PictureLights) -> Result<Self> {
        Ok(FramePicture {
            draw: Draw::new(device, library, options.size, options.antialias, lights)?,
            refined: false,
            other: None,
            readback: readback(device, options.size)?,
            lines: Lines::new(device)?,
            prepared: Vec::new(),
            mirrors: Vec::new(),
            edges: Vec::new(),
        })
    }

    /// Makes the pipelines of all that pictures of a scene show. `glossy`: whether they show its gloss.
    pub fn make_pipelines(&self, scene: &Scene, buffers: &SceneBuffers, glossy: bool) -> Result<()> {
        let is_grid = |entity: &usize| buffers.surface(*entity).drawn.grid().is_some();
        let (grids, triangles): (Vec<usize>, Vec<usize>) = (0..scene.entities.len()).partition(is_grid);
        let surface = |index: usize| {
            let paint = scene.paint(index);
            DrawnSurface {
                painted: paint.is_some(),
                detail: gloss::detail(&scene.entities[index]).filter(|_| glossy),
                transparent: scene.entities[index].transparent,
                holes: paint.is_some_and(|texture| texture.alpha_cutoff.is_some_and(|cutoff| cutoff > 0.0)),
            }
        };
        let surfaces: HashSet<DrawnSurface> = triangles.into_iter().map(surface).collect();
        self.draw.make(&surfaces, !grids.is_empty(), !scene.environment.is_uniform())
    }
}

fn readback(device: &Arc<Device>, [width, height]: [u32; 2]) -> Result<Buffer> {
    Buffer::new(device, "readback", BufferKind::Readback, READBACK_PIXEL_BYTES * u64::from(width) * u64::from(height))
}

impl Frame {
    /// Input of [`super::record()`] for the picture that was prepared last; `white` as in [`Frame::render`].
    pub fn picture_work(&self, placements: &[Placement], white: f32) -> PictureWork<'_> {
        let viewport = |(viewport, lines): &(Viewport, Range<u32>)| DrawnViewport {
            area: viewport.area,
            drawn: viewport.area,
            entities: self.drawn_in(placements, viewport),
            radiosity: self.radiosity.source(viewport.radiosity),
            gloss: self.drawn_reflections().filter(|_| viewport.shows_light()),
            pixel: self.pixel_light().filter(|_| viewport.shows_light()),
            sky: self
                .sky
                .drawn()
                .filter(|_| viewport.shows_light())
                .map(|sky| sky.seen(&self.scene.data.camera, viewport.area)),
            lines: lines.clone(),
            edges: EVERYWHERE,
        };
        PictureWork {
            draw: &self.picture.draw,
            viewports: self.picture.prepared.iter().map(viewport).collect(),
            mirrored: self.mirrored(placements),
            background: self.sky.background,
            white,
            lines: &self.picture.lines,
            gloss: self
                .gloss_work()
                .filter(|_| self.picture.prepared.iter().any(|(viewport, _)| viewport.shows_light())),
        }
    }

    /// The picture that was recorded last: linear or encoded, white as it was recorded with.
    pub fn shown(&self) -> &Image {
        self.picture.draw.finished()
    }

    /// The last picture: linear RGB, three floats a pixel, rows from the top.
    pub fn picture(&self) -> Vec<f32> {
        let shape = self.picture.draw.picture.shape;
        let pixels = (shape.width * shape.height) as usize;
        let halves: Vec<f16> = self.picture.readback.read(0, 4 * pixels);
        halves.chunks_exact(4).flat_map(|p| [p[0].to_f32(), p[1].to_f32(), p[2].to_f32()]).collect()
    }

    /// What makes pictures with these options.
    fn draw(&self, options: &Options) -> Result<Draw> {
        let sharp = self.sharp.as_ref().map(|sharp| sharp.permutation);
        let pixels = pixel_shading(&self.device, options, &self.buffers, self.radiosity.soft(), sharp);
        let lights = self.reflectors.lights(options.bounces, pixels, sharp);
        Draw::new(&self.device, &self.library, options.size, options.antialias, lights)
    }

    /// What makes refined pictures, whatever the options say of their edges.
    fn refined_draw(&self) -> Result<Draw> {
        self.draw(&Options { antialias: Antialias::Samples, ..self.options })
    }

    /// Makes pictures with these options from now on, and no others.
    fn set_pictures(&mut self, options: Options) -> Result<()> {
        self.picture.draw = self.draw(&options)?;
        self.options = options;
        self.picture.other = None;
        self.picture.refined = false;
        Ok(())
    }

    /// Makes pictures of four samples a pixel whose pixels evaluate sharp lights from now on, or those of the options
    /// again. What makes the others is kept. Returns whether the vertices have to be lit anew, because they have not
    /// told pixels where edges are so far.
    pub fn refine(&mut self, refined: bool) -> Result<bool> {
        if refined == self.picture.refined {
            return Ok(false);
        }
        let draw = match self.picture.other.take() {
            Some(draw) => draw,
            None => self.refined_draw()?,
        };
        self.picture.other = Some(std::mem::replace(&mut self.picture.draw, draw));
        self.picture.refined = refined;
        Ok(self.sharp.as_ref().is_some_and(|sharp| sharp.permutation.edges != self.wants_edges()))
    }

    pub fn is_refined(&self) -> bool {
        self.picture.refined
    }

    /// Whether pixels of any pictures evaluate sharp lights.
    pub(super) fn wants_edges(&self) -> bool {
        self.picture.draw.evaluates_pixels() || self.picture.other.as_ref().is_some_and(Draw::evaluates_pixels)
    }

    /// Input of pixels that evaluate sharp lights.
    pub(super) fn pixel_light(&self) -> Option<PixelLight<'_>> {
        let chains = self.chains.as_ref().filter(|chains| chains.is_ready())?;
        let (irradiances, _) = self.radiosity.irradiances()?;
        let sharp = self.sharp.as_ref()?.permutation;
        self.picture.draw.evaluates_pixels().then(|| PixelLight {
            receivers: &chains.receivers,
            entities: &chains.entities,
            silhouettes: [&self.buffers.silhouettes.nodes, &self.buffers.silhouettes.cells],
            entries: &chains.entries,
            chains: &chains.chains,
            soft: self.radiosity.soft(),
            self_cells: &self.buffers.self_cells,
            vertices: &self.buffers.vertices,
            shown: self.kept_for_gloss().map(|[_, lights, shares]| [lights, shares]),
            irradiances,
            sun_maps: self.sun_maps.as_ref().filter(|_| sharp.sun_maps),
            lamp_maps: self.lamp_maps.as_ref().filter(|_| sharp.lamp_maps),
        })
    }

    /// Makes pictures of another size from now on.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<()> {
        if size != self.options.size {
            self.set_pictures(Options { size, ..self.options })?;
            self.picture.readback = readback(&self.device, size)?;
        }
        Ok(())
    }

    /// Smooths edges another way from now on.
    pub fn set_antialias(&mut self, antialias: Antialias) -> Result<()> {
        if antialias != self.options.antialias {
            self.set_pictures(Options { antialias, ..self.options })?;
        }
        Ok(())
    }

    /// The picture at full quality, whatever is shown: multisampled where the device can, linear RGB, three floats a
    /// pixel, rows from the top; `white` as in [`Frame::render`]. Waits.
    pub fn still(&mut self, placements: &[Placement], white: f32) -> Result<Vec<f32>> {
        self.device.settle();
        let refined = self.refined_draw()?;
        let before = std::mem::replace(&mut self.picture.draw, refined);
        let outcome = self.render(placements, Some(white)).map(|_| self.picture());
        self.picture.draw = before;
        outcome
    }
}
