//! Updates the viewer after a change: at once, after a background bake, or by a rebuild.

use super::command::Changed;
use super::preview;
use super::task::{BackgroundTask, TaskWorker};
use super::viewer::{Previewed, Viewer};
use crate::bake::{self, Baker, SceneNeeds};
use crate::draw::show::Show;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::gpu::validation::Messages;
use crate::gpu::{Device, heap};
use crate::merge::variant::Variant;
use crate::scene_buffers::limits;

impl Viewer {
    /// Updates the frame to the editor's state.
    pub(super) fn follow(&mut self, changed: Changed) -> Result<()> {
        if !changed.any() {
            return Ok(());
        }
        self.pending |= changed;
        if changed.light() {
            self.version += 1;
        }
        if changed.scene {
            self.settle()?;
            self.frame = None;
            self.preview = None;
            self.previewed = Previewed::Nothing;
            self.reference = None;
            self.error_shown = None;
            self.rays = None;
            self.edges.clear();
            self.timings.clear();
            self.outgrown = true;
            return Ok(());
        }
        if changed.camera
            && let Some(frame) = self.frame.as_mut().or(self.preview.as_mut())
        {
            frame.set_camera(self.editor.camera());
        }
        let Some(frame) = &mut self.frame else { return Ok(()) };
        if changed.variant {
            let chosen = self.editor.variant().map(Variant::named).transpose()?.or(self.setup.frame.variant);
            let outcome = frame.set_variant(chosen);
            self.tolerate(outcome)?;
            return Ok(());
        }
        if changed.emission || changed.sky || changed.roles || changed.placements {
            if frame.covers(self.editor.scene()) {
                (self.bake, self.outgrown) = (None, false);
                frame.set_scene(self.editor.scene())?;
            } else if self.bake.is_none() || changed.roles {
                self.outgrown = true;
            }
        }
        Ok(())
    }

    /// Gives back the memory of the frame before, and of a bake. A driver frees its share when the first picture is
    /// submitted.
    pub(super) fn give_back(&mut self) {
        if self.drawn_before.is_some_and(|before| self.frame_count > before) {
            self.drawn_before = None;
            heap::give_back();
        }
    }

    /// Rebuilds a frame that changes have outgrown: once for all events that waited while the last one was built. One
    /// for each would fall behind a hand that is quicker than the driver's compiler, and Mesa 22.3 keeps what is
    /// destroyed until the next submission, which would come after the last event.
    pub(super) fn catch_up(&mut self) -> Result<()> {
        if std::mem::take(&mut self.outgrown) { self.prepare() } else { Ok(()) }
    }

    /// Builds the frame if all its fields are cached, else starts a bake.
    fn prepare(&mut self) -> Result<()> {
        self.bake = None;
        let cache = self.setup.cache.clone();
        let scene = self.editor.scene().clone();
        let needs = SceneNeeds::of(&scene, &self.setup.frame.bake, self.setup.frame.lights);
        if needs.are_cached(&scene, &cache) {
            return self.build();
        }
        let options = self.setup.options.clone();
        let library = self.setup.library.clone();
        let still = preview::still(&scene, &self.editor.placements());
        let coarse = SceneNeeds::of(&still, &preview::coarse(self.setup.frame.bake), self.setup.frame.lights);
        self.bake = Some(BackgroundTask::new(move |worker: &TaskWorker<()>| {
            let missing = needs.missing(&scene, &cache);
            let all: u32 = missing.iter().map(|(_, captures)| captures).sum();
            worker.report("shadows", 0, all);
            let device = Device::new(&options)?;
            let baker = Baker::new(&device, &library);
            limits::check(&device, &scene, &needs)?;
            let told = |what: &str, now: u32, of: u32| {
                let Some(place) = missing.iter().position(|(name, _)| name == what) else { return };
                let before: u32 = missing[..place].iter().map(|(_, captures)| captures).sum();
                let share = f64::from(now) / f64::from(of.max(1));
                worker.report("shadows", before + (share * f64::from(missing[place].1)) as u32, all);
            };
            // Coarse surfaces are not counted: a second or two.
            bake::ensure(&baker, &cache, &still, &coarse, &|_, _, _| worker.report("shadows", 0, all))?;
            worker.send(());
            bake::ensure(&baker, &cache, &scene, &needs, &told)?;
            drop(baker);
            Messages::into_result(device.take_validation_messages())
        }));
        Ok(())
    }

    /// Shows the scene without shadows where they take longer than a moment, and lit once coarse surfaces are baked.
    pub(super) fn preview(&mut self) -> Result<()> {
        let Some(bake) = self.bake.as_ref().filter(|_| self.frame.is_none()) else { return Ok(()) };
        let is_lit = !bake.results().is_empty();
        let waits = bake.elapsed() >= self.setup.preview_after && self.previewed == Previewed::Nothing;
        if !is_lit && !waits {
            return Ok(());
        }
        self.previewed = if is_lit { Previewed::Light } else { Previewed::Shapes };
        let options = frame::Options { size: self.size, ..self.setup.frame };
        let make = if is_lit { preview::lit } else { preview::shapes };
        let preview = make(&self.baker, &self.setup.cache, &self.editor, options);
        self.settle()?;
        self.preview = self.tolerate(preview)?;
        self.pending.camera = true;
        Ok(())
    }

    pub(super) fn build(&mut self) -> Result<()> {
        self.settle()?;
        let variant = self.editor.variant().map(Variant::named).transpose()?.or(self.setup.frame.variant);
        let options = frame::Options { size: self.size, variant, ..self.setup.frame };
        let built = Frame::new(&self.baker, &self.setup.cache, self.editor.scene(), options, &|_, _, _| ());
        if let Some(frame) = self.tolerate(built)? {
            log::info!("ready: the first picture of {}", self.editor.path().display());
            self.frame = Some(frame);
            self.preview = None;
            self.build_count += 1;
            self.drawn_before = Some(self.frame_count);
            self.pending |= Changed { placements: true, camera: true, ..Changed::default() };
            self.version += 1;
        }
        Ok(())
    }

    pub(super) fn reload(&mut self, files: &[String]) {
        let library = &self.setup.library;
        let uses = |entry: &str| library.files(entry).iter().any(|file| files.contains(file));
        let show = if uses("show.vert") || uses("show.frag") {
            Show::new(&self.setup.device, library, self.setup.format).map(|show| self.show = show)
        } else {
            Ok(())
        };
        let overlay = if uses("overlay.vert") || uses("overlay.frag") { self.overlay.reload(library) } else { Ok(()) };
        let frame = self.frame.as_mut().map_or(Ok(()), |frame| frame.reload(files));
        self.baker = Baker::new(&self.setup.device, library);
        let errors: Vec<String> =
            [show, overlay, frame].into_iter().filter_map(|r| r.err().map(|e| e.to_string())).collect();
        if errors.is_empty() {
            log::info!("shaders rebuilt: {}", files.join(", "));
            self.say(Some(format!("shaders rebuilt: {}", files.join(", "))));
            self.shader_error = None;
            if let Some(watch) = &mut self.watch {
                watch.compiled();
            }
        } else {
            errors.iter().flat_map(|error| error.lines()).for_each(|line| log::warn!("{line}"));
            self.shader_error = Some(errors.join("\n"));
        }
        self.pending |= Changed { placements: true, display: true, ..Changed::default() };
    }
}
