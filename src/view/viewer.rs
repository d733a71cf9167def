//! What `view` shows: the editor's state turned into frames, with the overlay on top.
//!
//! A frame goes into a window or into an image, so that everything here runs without a display: events and time in, picture out.

use super::Editor;
use super::command::{Changed, Command, Effect, Request};
use super::input::{Event, Input};
use super::outline::Edges;
use super::panel::{self, Status};
use super::reference::{self, Reference};
use super::reload::Watch;
use super::task::{Progress, Task, Worker};
use crate::asset::false_color::{NEUTRAL, Scheme};
use crate::asset::picture;
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::error::{Error, Result};
use crate::frame::camera::clip_from_world;
use crate::frame::store::Store;
use crate::frame::{self, Frame, Lit, Part, is_cached};
use crate::gpu::validation::Messages;
use crate::gpu::{self, Access, Commands, Device, FLIGHTS, Flight, Image, Overlay, Paint, Target, Timing, Window};
use crate::render::show::Show;
use crate::render::variant::Variant;
use crate::shaders::Library;
use crate::truth::error_map::{self, ErrorMap};
use ash::vk;
use glam::DVec2;
use std::collections::{HashMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Frames whose times are kept for the graph.
pub const HISTORY: usize = 120;
/// How long a message stands.
const MESSAGE_S: f64 = 6.0;
/// Panels of the frame: radiosity of the reference, colours of the error.
const REFERENCE: usize = 0;
const ERROR: usize = 1;

/// What a viewer is made of.
pub struct Setup {
    /// The device that it draws on.
    pub device: Arc<Device>,
    /// How background bakes open one of their own.
    pub options: gpu::Options,
    /// Shaders.
    pub library: Library,
    /// Where bakes are kept; it needs a folder.
    pub cache: Cache,
    /// Bake and merge; the size is the window's.
    pub frame: frame::Options,
    /// Format of what is drawn into.
    pub format: vk::Format,
    /// Whether that format encodes sRGB.
    pub encodes_srgb: bool,
    /// Seed of the reference's rays.
    pub seed: u64,
}

/// What a frame is drawn into.
pub enum Canvas<'c> {
    /// A window; the frame is shown.
    Window(&'c mut Window),
    /// An image of the setup's format, left to be copied from.
    Image(&'c Image),
}

/// The editor with all that shows it.
pub struct Viewer {
    setup: Setup,
    editor: Editor,
    input: Input,
    baker: Baker,
    frame: Option<Frame>,
    show: Show,
    overlay: Overlay,
    egui: egui::Context,
    paint: Paint,
    flights: VecDeque<Flight>,
    /// What is not yet seen in a frame.
    pending: Changed,
    bake: Option<Task<()>>,
    rays: Option<Task<Reference>>,
    /// Version of the light that the rays are cast for.
    rays_version: u64,
    reference: Option<Reference>,
    error_shown: Option<(u64, u32, panel::ErrorScale)>,
    /// Counts every change of the light on vertices.
    version: u64,
    watch: Option<Watch>,
    shader_error: Option<String>,
    messages: VecDeque<(Instant, String)>,
    timings: VecDeque<Vec<Timing>>,
    edges: HashMap<usize, Edges>,
    quit: bool,
    /// Width and height of the window's picture, pixels.
    size: [u32; 2],
    /// When egui wants to be drawn again by itself.
    repaint_at: Option<Instant>,
    /// Progress that was shown last.
    told: [Option<Progress>; 2],
    frame_count: u64,
}

impl Viewer {
    /// Starts with a scene; what it needs is baked in the background.
    ///
    /// # Errors
    /// `Failed` when a shader does not compile, `Device` when memory ran out.
    pub fn new(setup: Setup, editor: Editor, scale: f32) -> Result<Self> {
        let device = &setup.device;
        let egui = egui::Context::default();
        egui.set_visuals(panel::visuals());
        let mut viewer = Viewer {
            baker: Baker::new(device, &setup.library),
            show: Show::new(device, &setup.library, setup.format, setup.encodes_srgb)?,
            overlay: Overlay::new(device, setup.format, setup.encodes_srgb)?,
            egui,
            paint: Paint { primitives: Vec::new(), pixels_per_point: scale },
            input: Input::new(scale),
            frame: None,
            flights: VecDeque::new(),
            pending: Changed { scene: true, ..Changed::default() },
            bake: None,
            rays: None,
            rays_version: 0,
            reference: None,
            error_shown: None,
            version: 0,
            watch: setup.library.shader_dir.as_deref().map(Watch::new),
            shader_error: None,
            messages: VecDeque::new(),
            timings: VecDeque::new(),
            edges: HashMap::new(),
            quit: false,
            size: editor.size(),
            repaint_at: Some(Instant::now()),
            told: [None, None],
            frame_count: 0,
            editor,
            setup,
        };
        viewer.follow(Changed { scene: true, ..Changed::default() })?;
        Ok(viewer)
    }

    /// The state that is shown.
    pub fn editor(&self) -> &Editor {
        &self.editor
    }

    /// The frame, once its fields are there.
    pub fn frame(&self) -> Option<&Frame> {
        self.frame.as_ref()
    }

    /// egui's context, for whoever feeds it.
    pub fn egui(&self) -> &egui::Context {
        &self.egui
    }

    /// Whether the window is to be closed.
    pub fn wants_to_quit(&self) -> bool {
        self.quit
    }

    /// Whether the pointer holds something of the scene.
    pub fn is_dragging(&self) -> bool {
        self.input.is_dragging()
    }

    /// Whether a bake goes on in the background.
    pub fn is_baking(&self) -> bool {
        self.bake.is_some()
    }

    /// The reference that is known: rays a vertex and whether it belongs to the state shown.
    pub fn reference(&self) -> Option<(u32, bool)> {
        self.reference.as_ref().map(|r| (r.rays, r.version == self.version))
    }

    /// The compiler's lines about the last change of a shader file.
    pub fn shader_error(&self) -> Option<&str> {
        self.shader_error.as_deref()
    }

    /// What was last said to the user.
    pub fn message(&self) -> Option<&str> {
        self.messages.back().map(|(_, text)| text.as_str())
    }

    /// Frames drawn so far.
    pub fn frame_count(&self) -> u64 {
        self.frame_count
    }

    /// Whether a frame would show something new.
    pub fn wants_frame(&self) -> bool {
        let moves = self.editor.is_running() && self.editor.scene().data.entities.iter().any(|e| !e.motion.is_empty());
        self.pending.any() || moves && self.frame.is_some() || self.repaint_at.is_some_and(|at| at <= Instant::now())
    }

    /// How soon [`Viewer::update`] may find something new by itself; `None`: not before an event.
    pub fn idle(&self) -> Option<Duration> {
        let busy = self.bake.is_some() || self.rays.as_ref().is_some_and(Task::is_running) || self.watch.is_some();
        let poll = (busy || !self.messages.is_empty()).then_some(Duration::from_millis(100));
        let repaint = self.repaint_at.map(|at| at.saturating_duration_since(Instant::now()));
        poll.into_iter().chain(repaint).min()
    }

    /// Takes an event of the window that is not egui's.
    ///
    /// # Errors
    /// As [`Viewer::apply`].
    pub fn event(&mut self, event: Event) -> Result<()> {
        for command in self.input.commands(event, &self.editor) {
            self.apply(command)?;
        }
        Ok(())
    }

    /// Does a command, down to the files that it writes.
    ///
    /// # Errors
    /// `Device` when the device was lost. What the user can do something about becomes a message instead.
    pub fn apply(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Orbit(_) | Command::Pan(_) | Command::DragTo(_) | Command::Resize(_) => {
                log::debug!("command {command:?}");
            }
            _ => log::info!("command {command:?}"),
        }
        // The editor sees the part of the window that shows what it edits.
        let command = match command {
            Command::Resize(size) => {
                self.size = if size.contains(&0) { self.size } else { size };
                Command::Resize(self.pane())
            }
            other => other,
        };
        let Effect { mut changed, request, message } = self.editor.apply(command);
        if command == Command::ToggleReference {
            changed |= self.editor.apply(Command::Resize(self.pane())).changed;
        }
        self.say(message);
        self.follow(changed)?;
        match request {
            None => {}
            Some(Request::Quit) => self.quit = true,
            Some(Request::Save) => {
                let path = self.editor.save_path();
                self.editor.apply(Command::Resize(self.size));
                let outcome = self.editor.save(&path).map(|()| format!("wrote {}", path.display()));
                self.editor.apply(Command::Resize(self.pane()));
                self.say(Some(outcome.unwrap_or_else(|error| error.to_string())));
            }
            Some(Request::Screenshot) => {
                let outcome = self.screenshot();
                let said = self.tolerate(outcome)?;
                self.say(said);
            }
        }
        Ok(())
    }

    /// Lets time pass and takes in what background work has done.
    ///
    /// # Errors
    /// As [`Viewer::apply`].
    pub fn update(&mut self, dt_s: f64) -> Result<()> {
        let count = self.messages.len();
        self.messages.retain(|(since, _)| since.elapsed().as_secs_f64() < MESSAGE_S);
        let progress = [self.bake.as_ref().map(Task::progress), self.rays.as_ref().map(Task::progress)];
        if count != self.messages.len() || progress != self.told {
            self.told = progress;
            self.pending.display = true;
        }
        if self.frame.is_some() {
            let changed = self.editor.advance(dt_s).changed;
            self.follow(changed)?;
        }
        if let Some(ended) = self.bake.as_mut().and_then(Task::ended) {
            self.bake = None;
            match ended {
                Ok(()) => self.build()?,
                Err(error) => self.tolerate(Err::<(), _>(error)).map(|_| ())?,
            }
        }
        let files = self.watch.as_mut().and_then(Watch::poll);
        if let Some(files) = files {
            self.reload(&files);
        }
        self.look_at_rays()
    }

    /// Runs the overlay on egui's input; what its widgets ask for is done.
    ///
    /// # Errors
    /// As [`Viewer::apply`].
    pub fn ui(&mut self, input: egui::RawInput) -> Result<egui::PlatformOutput> {
        let lines = self.outline();
        let status = self.status();
        let context = self.egui.clone();
        context.begin_pass(input);
        panel::outline(&context, &lines);
        let commands = panel::show(&context, &self.editor, &status);
        let output = context.end_pass();
        drop(status);
        let delay = output.viewport_output.values().map(|v| v.repaint_delay).min();
        self.repaint_at = delay.and_then(|delay| Instant::now().checked_add(delay));
        self.paint = Paint {
            primitives: context.tessellate(output.shapes, output.pixels_per_point),
            pixels_per_point: output.pixels_per_point,
        };
        self.overlay.update(output.textures_delta)?;
        for command in commands {
            self.apply(command)?;
        }
        Ok(output.platform_output)
    }

    /// Draws a frame. False where there was nothing to draw into, as in a minimised window.
    ///
    /// # Errors
    /// `Device` when the device or the surface was lost.
    pub fn draw(&mut self, mut canvas: Canvas<'_>) -> Result<bool> {
        while self.flights.len() >= FLIGHTS {
            self.land()?;
        }
        let shot = match &mut canvas {
            Canvas::Window(window) => match window.acquire()? {
                Some(shot) => Some(shot),
                None => return Ok(false),
            },
            Canvas::Image(_) => None,
        };
        let target = match (&canvas, &shot) {
            (Canvas::Image(image), _) => *image,
            (_, Some(shot)) => &*shot.image,
            (Canvas::Window(_), None) => unreachable!("a window gave a shot"),
        };
        let size = [target.shape.width, target.shape.height];
        let resized = self.frame.as_ref().is_some_and(|frame| frame.size() != size);
        let parts = self.parts(size);
        let placements = self.editor.placements();
        let white = (-self.editor.exposure_ev()).exp2();
        let pending = std::mem::take(&mut self.pending);
        let light = pending.light() || pending.variant;
        if let Some(frame) = &mut self.frame {
            frame.resize(size)?;
            if light {
                frame.prepare(&placements)?;
            }
        }
        let mut commands = Commands::new(&self.setup.device, "frame")?;
        commands.after_flights();
        if let Some(frame) = &self.frame {
            if light {
                frame.record_light(&mut commands)?;
            }
            if pending.any() || resized {
                frame.record_picture(&mut commands, &placements, &parts, white)?;
            }
        }
        commands.image_barrier(target, None, Access::ColorWrite);
        let (frame, show, overlay, paint) = (&self.frame, &self.show, &mut self.overlay, &self.paint);
        let color = Target { color: target, clear: [0.02, 0.02, 0.025, 1.0], depth: None, resolve: None };
        commands.pass("show", |c| {
            c.render(&color, |drawing| {
                if let Some(frame) = frame {
                    show.record(drawing, frame.shown(), white)?;
                }
                drawing.overlay(overlay, target, paint)
            })
        })?;
        let after = if shot.is_some() { Access::Present } else { Access::TransferRead };
        commands.image_barrier(target, Some(Access::ColorWrite), after);
        let flight = match (canvas, &shot) {
            (Canvas::Window(window), Some(shot)) => window.present(commands, shot)?,
            _ => commands.launch()?,
        };
        self.flights.push_back(flight);
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

    /// Ends the oldest flight and keeps its times.
    fn land(&mut self) -> Result<()> {
        if let Some(flight) = self.flights.pop_front() {
            self.timings.push_back(flight.wait()?);
            if self.timings.len() > HISTORY {
                self.timings.pop_front();
            }
        }
        Ok(())
    }

    /// Parts of the picture: merged or error, and the reference on the right of it.
    fn parts(&self, [width, height]: [u32; 2]) -> Vec<Part> {
        let error = self.editor.shows_error() && self.error_shown.is_some();
        let own = if error { Lit::Colors(ERROR) } else { Lit::Merged };
        if !self.editor.shows_reference() {
            return vec![Part { area: [0, 0, width, height], lit: own }];
        }
        let [half, _] = self.pane_of([width, height]);
        let mut parts = vec![Part { area: [0, 0, half, height], lit: own }];
        if self.reference.is_some() && width > half {
            parts.push(Part { area: [half, 0, width - half, height], lit: Lit::Panel(REFERENCE) });
        }
        parts
    }

    /// The part of the window that shows the merged picture: its left half beside a reference.
    fn pane(&self) -> [u32; 2] {
        self.pane_of(self.size)
    }

    fn pane_of(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        [if self.editor.shows_reference() { (width / 2).max(1) } else { width }, height]
    }

    /// Brings the frame up to what the editor says.
    fn follow(&mut self, changed: Changed) -> Result<()> {
        if !changed.any() {
            return Ok(());
        }
        self.pending |= changed;
        if changed.light() {
            self.version += 1;
        }
        if changed.scene {
            self.settle()?;
            (self.frame, self.reference, self.error_shown, self.rays) = (None, None, None, None);
            self.edges.clear();
            self.timings.clear();
            return self.prepare();
        }
        let Some(frame) = &mut self.frame else { return Ok(()) };
        if changed.variant {
            let chosen = self.editor.variant().map(Variant::named).transpose()?.or(self.setup.frame.variant);
            let outcome = frame.set_variant(chosen);
            self.tolerate(outcome)?;
            return Ok(());
        }
        if changed.camera {
            frame.set_camera(self.editor.camera());
        }
        if changed.emission || changed.sky || changed.roles || changed.placements {
            if frame.covers(self.editor.scene()) {
                self.bake = None;
                frame.set_scene(self.editor.scene())?;
            } else if self.bake.is_none() || changed.roles {
                return self.prepare();
            }
        }
        Ok(())
    }

    /// Builds the frame if all of it is in the cache, else has it baked first.
    fn prepare(&mut self) -> Result<()> {
        self.bake = None;
        let (cache, bake) = (self.setup.cache.clone(), self.setup.frame.bake);
        let scene = self.editor.scene().clone();
        if is_cached(&cache, &scene, &bake) {
            return self.build();
        }
        let (options, library) = (self.setup.options.clone(), self.setup.library.clone());
        self.bake = Some(Task::new(move |worker: &Worker<()>| {
            worker.report("opening the device for it", 0, 1);
            let device = Device::new(&options)?;
            let baker = Baker::new(&device, &library);
            let store = Store::new(&baker, &cache, &scene, &bake, &|what, done, all| worker.report(what, done, all))?;
            drop((store, baker));
            Messages::into_result(device.take_validation_messages())
        }));
        Ok(())
    }

    fn build(&mut self) -> Result<()> {
        self.settle()?;
        let variant = self.editor.variant().map(Variant::named).transpose()?.or(self.setup.frame.variant);
        let options = frame::Options { size: self.size, variant, ..self.setup.frame };
        let built = Frame::new(&self.baker, &self.setup.cache, self.editor.scene(), options, &|_, _, _| ());
        if let Some(frame) = self.tolerate(built)? {
            self.frame = Some(frame);
            self.pending |= Changed { placements: true, camera: true, ..Changed::default() };
            self.version += 1;
        }
        Ok(())
    }

    fn reload(&mut self, files: &[String]) {
        let library = &self.setup.library;
        let uses = |entry: &str| library.files(entry).iter().any(|file| files.contains(file));
        let show = if uses("show.vert") || uses("show.frag") {
            Show::new(&self.setup.device, library, self.setup.format, self.setup.encodes_srgb)
                .map(|show| self.show = show)
        } else {
            Ok(())
        };
        let frame = self.frame.as_mut().map_or(Ok(()), |frame| frame.reload(files));
        self.baker = Baker::new(&self.setup.device, library);
        let errors: Vec<String> = [show, frame].into_iter().filter_map(|r| r.err().map(|e| e.to_string())).collect();
        if errors.is_empty() {
            log::info!("shaders rebuilt: {}", files.join(", "));
            self.say(Some(format!("shaders rebuilt: {}", files.join(", "))));
            self.shader_error = None;
            if let Some(watch) = &mut self.watch {
                watch.compiled();
            }
        } else {
            log::warn!("{}", errors.join("\n"));
            self.shader_error = Some(errors.join("\n"));
        }
        self.pending |= Changed { placements: true, display: true, ..Changed::default() };
    }

    /// Starts rays where they are wanted, takes in what they found, and compares.
    fn look_at_rays(&mut self) -> Result<()> {
        let wanted = self.editor.shows_reference() || self.editor.shows_error();
        if !wanted || self.frame.is_none() {
            self.rays = None;
            return Ok(());
        }
        if let Some(found) = self.rays.as_ref().and_then(|rays| rays.results().pop()) {
            let frame = self.frame.as_mut().expect("checked above");
            frame.set_panel(REFERENCE, &found.radiosity, [0.0; 3])?;
            self.reference = Some(found);
            self.pending |= Changed { display: true, ..Changed::default() };
        }
        if let Some(Err(error)) = self.rays.as_mut().and_then(Task::ended) {
            self.tolerate(Err::<(), _>(error)).map(|_| ())?;
        }
        let current = self.reference.as_ref().is_some_and(|r| r.version == self.version);
        // Rays for a state that is gone end after their first round, so that something is seen while things move.
        let known = self.reference.as_ref().map(|r| r.version);
        let stale = self.rays_version != self.version && known == Some(self.rays_version);
        if (self.rays.is_none() && !current) || stale || (!current && !self.rays.as_ref().is_some_and(Task::is_running))
        {
            let (scene, placements) = (self.editor.scene().clone(), self.editor.placements());
            self.rays = Some(reference::cast(scene, placements, self.version, self.setup.seed));
            self.rays_version = self.version;
        }
        if self.editor.shows_error() && current && !self.pending.light() {
            self.compare()?;
        }
        Ok(())
    }

    /// Colours of the error of what was merged last, where they are not known yet.
    fn compare(&mut self) -> Result<()> {
        let (Some(frame), Some(reference)) = (&mut self.frame, &self.reference) else { return Ok(()) };
        if self
            .error_shown
            .as_ref()
            .is_some_and(|(version, rays, _)| (*version, *rays) == (self.version, reference.rays))
        {
            return Ok(());
        }
        let map = ErrorMap::new(&error_map::radiosity(frame)?, &reference.radiosity, Scheme::Signed);
        let scale = map.scale();
        frame.set_panel(ERROR, &map.colors(&scale), NEUTRAL)?;
        let shown = panel::ErrorScale { rms: map.rms(), limit: scale.limit };
        self.error_shown = Some((self.version, reference.rays, shown));
        self.pending |= Changed { display: true, ..Changed::default() };
        Ok(())
    }

    /// Writes the picture beside the saved scene, at full quality and without the overlay.
    fn screenshot(&mut self) -> Result<String> {
        let Some(frame) = &mut self.frame else { return Err(Error::Failed("nothing is shown yet".into())) };
        let [width, height] = frame.size();
        let (placements, ev) = (self.editor.placements(), self.editor.exposure_ev());
        let png = free_name(&self.editor.save_path());
        let exr = png.with_extension("exr");
        for flight in self.flights.drain(..) {
            flight.wait()?;
        }
        picture::write_png(&png, width, height, &frame.still(&placements, (-ev).exp2())?, ev)?;
        picture::write_exr(&exr, width, height, &frame.still(&placements, f32::INFINITY)?)?;
        Ok(format!("wrote {} and {}", png.display(), exr.display()))
    }

    fn say(&mut self, message: Option<String>) {
        if let Some(message) = message {
            log::info!("message: {message}");
            self.messages.push_back((Instant::now(), message));
            self.pending |= Changed { display: true, ..Changed::default() };
        }
    }

    /// Passes on what no user can mend; the rest becomes a message.
    fn tolerate<T>(&mut self, outcome: Result<T>) -> Result<Option<T>> {
        match outcome {
            Ok(value) => Ok(Some(value)),
            Err(error @ (Error::Device(_) | Error::Unsupported(_))) => Err(error),
            Err(error) => {
                self.say(Some(error.to_string()));
                Ok(None)
            }
        }
    }

    fn status(&self) -> Status<'_> {
        let info = &self.setup.device.info;
        Status {
            device: &info.name,
            driver: &info.driver,
            size: self.size,
            timings: &self.timings,
            counts: self.frame.as_ref().map(|frame| frame.counts),
            vertices: self.frame.as_ref().map_or(0, Frame::receiver_vertex_count),
            variant: self.frame.as_ref().map_or("", |frame| frame.variant.name),
            bake: self.bake.as_ref().map(Task::progress),
            rays: self.rays.as_ref().filter(|rays| rays.is_running()).map(Task::progress),
            reference: self.reference.as_ref().map(|r| (r.rays, r.error, r.version == self.version)),
            error: self.error_shown.as_ref().map(|(version, _, scale)| (*scale, *version == self.version)),
            shader_error: self.shader_error.as_deref(),
            messages: self.messages.iter().map(|(_, text)| text.as_str()).collect(),
        }
    }

    /// The outline of the selected entity in points.
    fn outline(&mut self) -> Vec<[egui::Pos2; 2]> {
        let Some(selected) = self.editor.selection() else { return Vec::new() };
        let scene = self.editor.scene();
        let mesh = scene.entities[selected].mesh;
        let edges = self.edges.entry(mesh).or_insert_with(|| Edges::new(&scene.meshes[mesh]));
        let [width, height] = self.editor.size().map(f64::from);
        let camera = self.editor.camera();
        let size = DVec2::new(width, height) / f64::from(self.paint.pixels_per_point);
        let placement = self.editor.placements()[selected];
        let lines = edges.outline(&placement, clip_from_world(camera, width / height), camera.eye.as_dvec3(), size);
        let point = |p: DVec2| egui::pos2(p.x as f32, p.y as f32);
        let inside = |l: &[DVec2; 2]| l.iter().all(|p| p.x <= size.x);
        lines.into_iter().filter(inside).map(|line| line.map(point)).collect()
    }
}

/// `NAME-001.png` beside a path, or the next number that is free.
fn free_name(beside: &std::path::Path) -> PathBuf {
    let stem = beside.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stem = stem.trim_end_matches("-edited");
    let name = |number: u32| beside.with_file_name(format!("{stem}-{number:03}.png"));
    (1..).map(name).find(|path| !path.exists() && !path.with_extension("exr").exists()).expect("numbers do not end")
}
