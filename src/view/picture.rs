//! Draws the viewer's frames into a window, an image or files.

use super::outline::outline;
use super::save::unedited;
use super::status::HISTORY;
use super::viewer::{ERROR, REFERENCE, Viewer};
use crate::asset::edges::Edges;
use crate::asset::picture;
use crate::draw::camera::clip_from_world;
use crate::error::{Error, Result};
use crate::frame::{self, RadiositySource, Viewport, record};
use crate::gpu::{Access, Commands, FLIGHTS, Image, Window};
use glam::DVec2;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time without events after which hidden clusters are lit. It is longer than the interval between events of a drag, and short
/// enough not to be noticed.
const REST: Duration = Duration::from_millis(100);

/// The target of a frame.
pub enum FrameTarget<'c> {
    /// A window, which presents the frame.
    Window(&'c mut Window),
    /// An image of the setup's format; it is left ready to be copied from.
    Image(&'c Image),
}

impl Viewer {
    /// Draws a frame. Returns false if the target has no image, as in a minimised window.
    ///
    /// # Errors
    /// `Device` when the device or the surface was lost.
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
            FrameTarget::Window(window) => match window.acquire()? {
                Some(shot) => Some(shot),
                None => return Ok(false),
            },
            FrameTarget::Image(_) => None,
        };
        let target = match (&canvas, &shot) {
            (FrameTarget::Image(image), _) => *image,
            (_, Some(shot)) => &*shot.image,
            (FrameTarget::Window(_), None) => unreachable!("a window gave a shot"),
        };
        let size = [target.shape.width, target.shape.height];
        let resized = self.frame.as_ref().is_some_and(|frame| frame.size() != size);
        let viewports = self.viewports(size);
        let placements = self.editor.placements();
        let white = self.editor.white();
        let pending = std::mem::take(&mut self.pending);
        // Clusters that were hidden during motion are lit when motion has ended.
        let stale = self.frame.as_ref().is_some_and(|frame| frame.stale_count() > 0);
        let light = pending.light() || pending.variant || stale;
        let draws = pending.any() || resized;
        if let Some(frame) = &mut self.frame {
            frame.resize(size)?;
            if light {
                // The error needs all clusters, not only the visible ones.
                frame.prepare_light(&placements, if self.editor.shows_error() { &[] } else { &viewports })?;
            }
            if draws {
                frame.prepare_picture(&placements, &viewports)?;
            }
        }
        let (frame, show, overlay, paint) = (self.frame.as_ref(), &self.show, &mut self.overlay, &self.paint);
        let merge = frame.filter(|_| light).map_or(Ok(None), |frame| frame.merge_work())?;
        let picture = frame.filter(|_| draws).map(|frame| frame.picture_work(&placements, white));
        let mut overlay = Some(overlay);
        let screen = frame::PictureTarget::Screen {
            image: target,
            clear: [0.02, 0.02, 0.025, 1.0],
            show: &mut |drawing| {
                if let Some(frame) = frame {
                    show.record(drawing, frame.shown(), white)?;
                }
                overlay.take().map_or(Ok(()), |overlay| drawing.overlay(overlay, target, paint))
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
        if self.frame.as_ref().is_some_and(|frame| frame.stale_count() > 0) {
            let soon = Instant::now() + REST;
            self.repaint_at = Some(self.repaint_at.map_or(soon, |at| at.min(soon)));
        }
        assert!(self.setup.device.flight_count() <= FLIGHTS, "more than {FLIGHTS} frames are queued");
        self.frame_count += 1;
        Ok(true)
    }

    /// Waits for all frames.
    ///
    /// # Errors
    /// `Device` when the device was lost.
    pub fn settle(&mut self) -> Result<()> {
        while !self.flights.is_empty() {
            self.land()?;
        }
        Ok(())
    }

    /// Waits for the oldest flight and keeps its times.
    pub(super) fn land(&mut self) -> Result<()> {
        if let Some(flight) = self.flights.pop_front() {
            self.timings.push_back(flight.wait()?);
            if self.timings.len() > HISTORY {
                self.timings.pop_front();
            }
        }
        Ok(())
    }

    /// Viewports of the picture: the merged light or its error, and the reference on the right of it.
    fn viewports(&self, [width, height]: [u32; 2]) -> Vec<Viewport> {
        let [own_width, _] = self.own_size_of([width, height]);
        let mut own = Viewport::merged([0, 0, own_width, height]);
        if self.editor.shows_error() && self.error_shown.is_some() {
            own = Viewport { radiosity: RadiositySource::Comparison(ERROR), adds_emission: false, ..own };
        }
        let mut viewports = vec![own];
        if self.editor.shows_reference() && self.reference.is_some() && width > own_width {
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
        let (placements, ev, white) = (self.editor.placements(), self.editor.exposure_ev(), self.editor.white());
        let png = free_name(&self.editor.save_path());
        let exr = png.with_extension("exr");
        for flight in self.flights.drain(..) {
            flight.wait()?;
        }
        picture::write_png(&png, width, height, &frame.still(&placements, white)?, ev)?;
        picture::write_exr(&exr, width, height, &frame.still(&placements, f32::INFINITY)?)?;
        Ok(format!("wrote {} and {}", png.display(), exr.display()))
    }

    /// The outline of the selected entity in points.
    pub(super) fn outline(&mut self) -> Vec<[egui::Pos2; 2]> {
        let Some(selected) = self.editor.selection() else { return Vec::new() };
        let scene = self.editor.scene();
        let mesh = scene.entities[selected].mesh;
        let edges = self.edges.entry(mesh).or_insert_with(|| Edges::new(&scene.meshes[mesh]));
        let centre = scene.meshes[mesh].bounding_sphere().0.as_dvec3();
        let [width, height] = self.editor.size().map(f64::from);
        let camera = self.editor.camera();
        let size = DVec2::new(width, height) / f64::from(self.paint.pixels_per_point);
        let placement = self.editor.placements()[selected];
        let clip = clip_from_world(camera, width / height);
        let lines = outline(edges, centre, &placement, clip, camera.eye.as_dvec3(), size);
        let point = |p: DVec2| egui::pos2(p.x as f32, p.y as f32);
        lines.into_iter().map(|line| line.map(point)).collect()
    }
}

/// `NAME-001.png` beside a path, or the next number that is free.
fn free_name(beside: &Path) -> PathBuf {
    let stem = beside.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stem = unedited(&stem);
    let name = |number: u32| beside.with_file_name(format!("{stem}-{number:03}.png"));
    (1..).map(name).find(|path| !path.exists() && !path.with_extension("exr").exists()).expect("numbers do not end")
}
