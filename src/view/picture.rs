//! Draws the viewer's frames into a window, an image or files.

use super::command::Changed;
use super::figures::HISTORY;
use super::follow::unlit_viewport;
use super::scenes::unedited;
use super::viewer::{ERROR, Previewed, REFERENCE, Viewer};
use crate::asset::edges::Edges;
use crate::asset::picture;
use crate::draw::camera::{clip_from_world, world_from_centred};
use crate::error::{Error, Result};
use crate::frame::{self, RadiositySource, Viewport, record};
use crate::gpu::{Access, Commands, FLIGHTS, Image, Window};
use glam::{DVec2, DVec4};
use std::path::{Path, PathBuf};
use std::time::Instant;

pub enum FrameTarget<'c> {
    Window(&'c mut Window),
    /// An image of the setup's format; it is left ready to be copied from.
    Image(&'c Image),
}

impl Viewer {
    /// Draws a frame. Returns false if the target has no image, as in a minimised window.
    pub fn draw(&mut self, canvas: FrameTarget<'_>) -> Result<bool> {
        self.catch_up()?;
        let pending = self.pending;
        let drawn = self.draw_pending(canvas);
        if drawn.is_err() {
            // The recorded merge may not have run, so the next frame merges everything again.
            if let Some(frame) = &mut self.frame {
                frame.forget();
            }
            self.pending |= pending;
        }
        drawn
    }

    fn draw_pending(&mut self, mut canvas: FrameTarget<'_>) -> Result<bool> {
        while self.flights.len() >= FLIGHTS {
            self.land()?;
        }
        let shot = match &mut canvas {
            FrameTarget::Window(window) => window.acquire()?,
            FrameTarget::Image(_) => None,
        };
        let target = match (&canvas, &shot) {
            (FrameTarget::Image(image), _) => *image,
            (FrameTarget::Window(_), Some(shot)) => &*shot.image,
            (FrameTarget::Window(_), None) => return Ok(false),
        };
        let size = [target.shape.width, target.shape.height];
        let viewports = self.viewports(size);
        let mut placements = self.editor.placements();
        let white = self.editor.white();
        let pending = std::mem::take(&mut self.pending);
        let changed = Changed { display: false, selection: false, ..pending }.any();
        let resizes = self.frame.as_ref().is_some_and(|frame| frame.size() != size);
        let [redraws, relights] = self.refine(changed || resizes)?;
        let light = self.frame.is_some() && (pending.light() || relights);
        let mut frame = self.frame.as_mut();
        if let (None, Some(preview)) = (&frame, &mut self.preview) {
            // One without shadows has no suns, which stand behind the entities of the file.
            placements.truncate(preview.scene().entities.len());
            frame = Some(preview);
        }
        let resized = frame.as_ref().is_some_and(|frame| frame.size() != size);
        // Nothing but the overlay has changed where a refined picture stands.
        let stands = frame.as_ref().is_some_and(|frame| frame.is_refined()) && !changed && !redraws;
        let draws = pending.any() && !stands || resized || redraws;
        if let Some(frame) = &mut frame {
            frame.resize(size)?;
            frame.prepare(&placements, if draws { &viewports } else { &[] }, light)?;
        }
        self.overlay.prepare(&self.paint, size)?;
        let frame = frame.as_deref();
        let show = &self.show;
        let overlay = &self.overlay;
        let merge = frame.filter(|_| light).map_or(Ok(None), |frame| frame.merge_work())?;
        let picture = frame.filter(|_| draws).map(|frame| frame.picture_work(&placements, white));
        let screen = frame::PictureTarget::Screen {
            image: target,
            clear: [0.02, 0.02, 0.025, 1.0],
            show: &mut |drawing| {
                if let Some(frame) = frame {
                    show.record(drawing, frame.shown(), white)?;
                }
                overlay.record(drawing)
            },
            next: if shot.is_some() { Access::Present } else { Access::TransferRead },
        };
        let mut commands = Commands::new(&self.setup.device, "frame")?;
        record(&mut commands, merge.as_ref(), picture.as_ref(), screen)?;
        let (flight, is_shown) = match (canvas, &shot) {
            (FrameTarget::Window(window), Some(shot)) => window.present(commands, shot)?,
            _ => (commands.launch()?, true),
        };
        self.flights.push_back(flight);
        if !is_shown {
            self.repaint_at = Some(Instant::now());
        }
        assert!(self.setup.device.flight_count() <= FLIGHTS, "more than {FLIGHTS} frames are queued");
        self.frame_count += 1;
        Ok(true)
    }

    /// Waits for all frames.
    pub fn settle(&mut self) -> Result<()> {
        while !self.flights.is_empty() {
            self.land()?;
        }
        Ok(())
    }

    /// Waits for the oldest flight and keeps its times.
    pub(super) fn land(&mut self) -> Result<()> {
        if let Some(flight) = self.flights.pop_front() {
            let passes = flight.wait()?;
            self.pace.note(&passes, self.is_refined());
            self.timings.push_back(passes);
            if self.timings.len() > HISTORY {
                self.timings.pop_front();
            }
        }
        Ok(())
    }

    /// Viewports of the picture: the merged light or its error, and the reference on the right of it.
    fn viewports(&self, [width, height]: [u32; 2]) -> Vec<Viewport> {
        if self.frame.is_none() {
            return vec![match self.previewed {
                Previewed::Light => Viewport::merged([0, 0, width, height]),
                Previewed::Shapes | Previewed::Nothing => unlit_viewport([width, height]),
            }];
        }
        let [own_width, _] = self.editor.size_in([width, height]);
        let mut own = Viewport::merged([0, 0, own_width, height]);
        if self.editor.error && self.error_shown.is_some() {
            own = Viewport { radiosity: RadiositySource::Comparison(ERROR), adds_emission: false, ..own };
        }
        let mut viewports = vec![own];
        if self.editor.reference && self.reference.is_some() && width > own_width {
            let right = Viewport::merged([own_width, 0, width - own_width, height]);
            viewports.push(Viewport { radiosity: RadiositySource::Comparison(REFERENCE), ..right });
        }
        viewports
    }

    /// Writes the picture beside the saved scene, at full quality and without the overlay.
    pub(super) fn screenshot(&mut self) -> Result<String> {
        self.catch_up()?;
        let Some(frame) = &mut self.frame else { return Err(Error::Failed("no picture has been drawn yet".into())) };
        let [width, height] = frame.size();
        let placements = self.editor.placements();
        let ev = self.editor.scene().data.output.exposure_ev();
        let white = self.editor.white();
        let png = free_name(&self.editor.save_path());
        let exr = png.with_extension("exr");
        for flight in self.flights.drain(..) {
            flight.wait()?;
        }
        picture::write_png(&png, width, height, &frame.still(&placements, white)?, ev)?;
        picture::write_exr(&exr, width, height, &frame.still(&placements, f32::INFINITY)?)?;
        Ok(format!("wrote {} and {}", png.display(), exr.display()))
    }

    /// The outline of the selected entity as the camera sees it, in points: its silhouette edges.
    pub(super) fn outline(&mut self) -> Vec<[egui::Pos2; 2]> {
        let Some(selected) = self.editor.selection else { return Vec::new() };
        let scene = self.editor.scene();
        let mesh = scene.entities[selected].mesh;
        let edges = self.edges.entry(mesh).or_insert_with(|| Edges::new(&scene.meshes[mesh]));
        let centre = scene.meshes[mesh].bounding_sphere().0.as_dvec3();
        let [width, height] = self.editor.size().map(f64::from);
        let camera = self.editor.camera();
        let size = DVec2::new(width, height) / f64::from(self.paint.pixels_per_point);
        let world = world_from_centred(&self.editor.placements()[selected], centre);
        let eye = world.inverse().transform_point3(camera.eye.as_dvec3());
        let lines = edges.lines(clip_from_world(camera, width / height) * world, eye, false);
        let point = |c: DVec4| {
            let place = (DVec2::new(c.x, c.y) / c.w + 1.0) / 2.0 * size;
            egui::pos2(place.x as f32, place.y as f32)
        };
        lines.into_iter().map(|line| line.ends.map(point)).collect()
    }
}

/// `NAME-001.png` beside a path, or the next number that is free.
fn free_name(beside: &Path) -> PathBuf {
    let stem = beside.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stem = unedited(&stem);
    let name = |number: u32| beside.with_file_name(format!("{stem}-{number:03}.png"));
    (1..).map(name).find(|path| !path.exists() && !path.with_extension("exr").exists()).expect("numbers do not end")
}
