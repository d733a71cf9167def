//! The editor with everything that is needed to show it: commands and files come in, the overlay is run, messages are
//! shown for a while.
//!
//! A frame is drawn into a window or into an image, so everything here also runs without a display.

use super::command::{Changed, Command, Effect};
use super::compare::Reference;
use super::editor::{Editor, add_sky};
use super::follow::Pace;
use super::input::{Event, Input};
use super::overlay::{Overlay, Paint};
use super::panel::{self, ErrorScale, Status};
use super::task::{BackgroundTask, TaskProgress};
use crate::asset::edges::Edges;
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::draw::show::Show;
use crate::error::{Error, Result};
use crate::frame::{self, Frame};
use crate::gpu::{self, Device, Flight, Timing};
use crate::scene::{Scene, gltf};
use crate::shaders::Library;
use crate::truth::exposure;
use ash::vk;
use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Additional radiosity buffers of the frame: the reference, and the colours of the error.
pub(super) const REFERENCE: usize = 0;
pub(super) const ERROR: usize = 1;

pub struct Setup {
    pub device: Arc<Device>,
    /// Options with which background bakes open their own device.
    pub options: gpu::DeviceOptions,
    pub library: Library,
    /// Where bakes are kept: on disk, or in memory.
    pub cache: Cache,
    /// Options of bake and merge; the picture's size is the window's.
    pub frame: frame::Options,
    /// Whether pictures are refined while nothing moves, and while things move as far as time allows.
    pub refines: bool,
    /// Format of the frame's target.
    pub format: vk::Format,
    /// Seed of the reference's rays.
    pub seed: u64,
    /// Whether a glTF file of which something is left out is refused.
    pub strict: bool,
    /// Time of a bake after which the scene is shown without shadows.
    pub preview_after: Duration,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Previewed {
    Nothing,
    /// Shapes without shadows.
    Shapes,
    /// Light on coarse surfaces.
    Light,
}

/// Time for which a message is shown.
const SHOWN: Duration = Duration::from_secs(6);

pub(super) struct Message {
    since: Instant,
    text: String,
    /// It is shown although the overlay is hidden, because something is at stake that the picture does not show.
    insists: bool,
}

/// A way to leave a scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Leave {
    ForGood,
    ForNext,
    For(PathBuf),
}

/// An editor with everything that is needed to show it.
pub struct Viewer {
    pub(super) setup: Setup,
    pub editor: Editor,
    pub input: Input,
    pub(super) baker: Baker,
    /// The frame, once its fields are baked.
    pub frame: Option<Frame>,
    /// The scene without shadows, or lit on coarse surfaces, while the first bake takes longer than a moment.
    pub(super) preview: Option<Frame>,
    /// What is shown in place of the frame until its fields are baked.
    pub previewed: Previewed,
    pub(super) show: Show,
    pub(super) overlay: Overlay,
    pub egui: egui::Context,
    pub(super) paint: Paint,
    pub(super) flights: VecDeque<Flight>,
    /// Changes that no frame shows yet.
    pub(super) pending: Changed,
    /// Whether the frame cannot show the editor's scene, and neither rebuild nor bake has begun.
    pub(super) outgrown: bool,
    pub(super) bake: Option<BackgroundTask<()>>,
    pub(super) rays: Option<BackgroundTask<Reference>>,
    /// Version of the light for which rays are being cast.
    pub(super) rays_version: u64,
    pub(super) reference: Option<Reference>,
    pub(super) error_shown: Option<(u64, u32, ErrorScale)>,
    /// Counts every change of the light on vertices.
    pub(super) version: u64,
    pub(super) messages: VecDeque<Message>,
    pub(super) timings: VecDeque<Vec<Timing>>,
    pub(super) edges: HashMap<usize, Edges>,
    /// Whether the window is to close.
    pub quit: bool,
    /// Of which way to leave the scene it was said that it loses edits, since the last edit.
    pub(super) asked_to_leave: Option<Leave>,
    /// Time at which the picture is refined, unless anything moves before.
    pub(super) refine_at: Option<Instant>,
    pub(super) pace: Pace,
    /// Time at which egui wants to be drawn again without an event.
    pub(super) repaint_at: Option<Instant>,
    /// The progress that was shown last.
    pub(super) told: [Option<TaskProgress>; 2],
    pub(super) frame_count: u64,
    /// Scenes prepared for drawing so far, the same one anew where lights became occluders.
    pub build_count: u64,
    /// Frames that were drawn before the last build, until what that freed is given back.
    pub(super) drawn_before: Option<u64>,
}

impl Viewer {
    /// Starts with a scene; missing fields are baked in the background.
    pub fn new(setup: Setup, editor: Editor, scale: f32) -> Result<Self> {
        let device = &setup.device;
        let egui = egui::Context::default();
        panel::style(&egui);
        let mut viewer = Viewer {
            baker: Baker::new(device, &setup.library),
            show: Show::new(device, &setup.library, setup.format)?,
            overlay: Overlay::new(device, &setup.library, setup.format)?,
            egui,
            paint: Paint { primitives: Vec::new(), pixels_per_point: scale },
            input: Input::new(scale),
            frame: None,
            preview: None,
            previewed: Previewed::Nothing,
            flights: VecDeque::new(),
            pending: Changed { scene: true, ..Changed::default() },
            outgrown: false,
            bake: None,
            rays: None,
            rays_version: 0,
            reference: None,
            error_shown: None,
            version: 0,
            messages: VecDeque::new(),
            timings: VecDeque::new(),
            edges: HashMap::new(),
            quit: false,
            asked_to_leave: None,
            refine_at: None,
            pace: Pace::default(),
            repaint_at: Some(Instant::now()),
            told: [None, None],
            frame_count: 0,
            build_count: 0,
            drawn_before: None,
            editor,
            setup,
        };
        viewer.follow(Changed { scene: true, ..Changed::default() })?;
        viewer.catch_up()?;
        Ok(viewer)
    }

    /// Whether a background bake is running, or may have to.
    pub fn is_baking(&self) -> bool {
        self.bake.is_some() || self.outgrown
    }

    /// The latest reference: rays per vertex, and whether it is up to date.
    pub fn reference(&self) -> Option<(u32, bool)> {
        self.reference.as_ref().map(|r| (r.rays, r.version == self.version))
    }

    /// Names of the passes of the last frame that has ended.
    pub fn last_passes(&self) -> Vec<&str> {
        self.timings.back().map_or(Vec::new(), |passes| passes.iter().map(|t| t.pass.as_str()).collect())
    }

    /// Whether the error's colours are up to date.
    pub fn shows_error_colors(&self) -> bool {
        self.editor.error && self.error_shown.as_ref().is_some_and(|(version, ..)| *version == self.version)
    }

    pub fn wants_frame(&self) -> bool {
        let moves = self.editor.running && self.editor.scene().data.entities.iter().any(|e| !e.motion.is_empty());
        let is_due = |at: Option<Instant>| at.is_some_and(|at| at <= Instant::now());
        self.pending.any() || moves && self.frame.is_some() || is_due(self.repaint_at) || is_due(self.refine_at)
    }

    /// Time until [`Viewer::update`] should run again; `None` if it can wait for an event.
    pub fn idle(&self) -> Option<Duration> {
        let busy = self.bake.is_some() || self.rays.as_ref().is_some_and(BackgroundTask::is_running);
        let poll = (busy || !self.messages.is_empty()).then_some(Duration::from_millis(100));
        let wakes = self.repaint_at.into_iter().chain(self.refine_at);
        let wakes = wakes.map(|at| at.saturating_duration_since(Instant::now()));
        poll.into_iter().chain(wakes).min()
    }

    /// Handles an event of the window that egui does not use.
    pub fn event(&mut self, event: Event) -> Result<()> {
        for command in self.input.commands(event, &self.editor) {
            self.apply(command)?;
        }
        Ok(())
    }

    /// Executes a command, including the files that it writes.
    pub fn apply(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Orbit(_) | Command::Pan(_) | Command::DragTo(_) | Command::Resize(_) => {
                log::debug!("command {command:?}");
            }
            _ => log::info!("frame {}: command {command:?}", self.frame_count),
        }
        match command {
            Command::NextScene if !self.may_leave(Leave::ForNext) => return Ok(()),
            Command::Quit => self.quit = self.may_leave(Leave::ForGood),
            Command::Save => self.save(),
            Command::Screenshot => {
                let outcome = self.screenshot();
                let said = self.tolerate(outcome)?;
                self.say(said);
            }
            _ => {}
        }
        let Effect { changed, message } = self.editor.apply(command);
        if changed.light() || changed.exposure {
            self.asked_to_leave = None;
        }
        self.say(message);
        self.follow(changed)
    }

    fn save(&mut self) {
        let path = self.editor.save_path();
        let outcome = self.editor.save(&path).map(|()| format!("wrote {}", path.display()));
        self.say(Some(outcome.unwrap_or_else(|error| error.to_string())));
    }

    /// Advances the time by `dt_s` seconds and receives results of background tasks.
    pub fn update(&mut self, dt_s: f64) -> Result<()> {
        self.catch_up()?;
        self.give_back();
        let message_count = self.messages.len();
        self.messages.retain(|message| message.since.elapsed() < SHOWN);
        let progress =
            [self.bake.as_ref().map(BackgroundTask::progress), self.rays.as_ref().map(BackgroundTask::progress)];
        if message_count != self.messages.len() || progress != self.told {
            self.told = progress;
            self.pending.display = true;
        }
        if self.frame.is_some() {
            let changed = self.editor.advance(dt_s).changed;
            self.follow(changed)?;
        }
        if let Some(ended) = self.bake.as_mut().and_then(BackgroundTask::ended) {
            self.bake = None;
            if self.tolerate(ended)?.is_some() {
                self.build()?;
            }
        }
        self.preview()?;
        self.look_at_rays()
    }

    /// Shows another scene in place of this one: a scene file, a glTF file or an OBJ file, such as one that was dropped
    /// on the window. What is left out of it is said. A file that cannot be opened is one line over the picture, and
    /// the scene stays, as it does at the first time where it has edits that are not saved.
    pub fn open(&mut self, path: &Path) -> Result<()> {
        let (scene, notes) = match self.read(path) {
            Ok(read) => read,
            Err(error) => {
                self.insist(format!("not opened: {error}"));
                return Ok(());
            }
        };
        if !self.may_leave(Leave::For(path.to_owned())) {
            return Ok(());
        }
        self.asked_to_leave = None;
        notes.iter().for_each(|note| self.insist(format!("{}: {note}", path.display())));
        let effect = self.editor.open(scene, path);
        self.insist(format!("opened {}", path.display()));
        self.input.commands(Event::Lost, &self.editor);
        self.follow(effect.changed)
    }

    /// A scene, and what a reader of its glTF file has to know.
    fn read(&self, path: &Path) -> Result<(Scene, Vec<String>)> {
        let (mut scene, notes) = Scene::load_with_notes(path, &gltf::Options::default())?;
        let left_out = notes.left_out();
        if self.setup.strict && !left_out.is_empty() {
            return Err(Error::input(path, format!("--strict: {}", left_out.join("; "))));
        }
        add_sky(&mut scene);
        let [width, height] = self.editor.window().map(f64::from);
        scene.fit_added_camera(width / height);
        let time_s = scene.data.output.time_s;
        let exposed = exposure::settle(&mut scene, time_s, width / height);
        Ok((scene, left_out.into_iter().chain(notes.said().iter().cloned()).chain(exposed).collect()))
    }

    /// Whether the scene may go: if it has edits that are not saved, at the second time of the same way.
    fn may_leave(&mut self, leave: Leave) -> bool {
        if !self.editor.is_edited() || self.asked_to_leave.as_ref() == Some(&leave) {
            return true;
        }
        self.asked_to_leave = Some(leave);
        let path = self.editor.path().display();
        self.insist(format!("unsaved edits of {path}: Ctrl-S saves them; do it again to go on without them"));
        false
    }

    /// Runs the overlay on egui's input and executes the commands of its widgets.
    pub fn ui(&mut self, input: egui::RawInput) -> Result<egui::PlatformOutput> {
        let lines = self.outline();
        let status = self.status();
        let context = self.egui.clone();
        let mut commands = Vec::new();
        let output = context.run_ui(input, |ui| {
            panel::outline(ui.ctx(), &lines);
            commands.extend(panel::show(ui.ctx(), &self.editor, &status));
        });
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

    fn status(&self) -> Status<'_> {
        let info = &self.setup.device.info;
        Status {
            device: &info.name,
            driver: &info.driver,
            size: self.editor.window(),
            refined: self.setup.refines.then(|| self.is_refined()),
            timings: &self.timings,
            vertices: self.frame.as_ref().map(Frame::receiver_vertex_count),
            lights: self.setup.frame.lights,
            bake: self.bake.as_ref().map(BackgroundTask::progress),
            rays: self.rays.as_ref().filter(|rays| rays.is_running()).map(BackgroundTask::progress),
            reference: self.reference.as_ref().map(|r| (r.rays, r.error, r.version == self.version)),
            error: self.error_shown.as_ref().map(|(version, _, scale)| (*scale, *version == self.version)),
            messages: self.messages(),
        }
    }

    pub fn message(&self) -> Option<&str> {
        self.messages.back().map(|message| message.text.as_str())
    }

    /// The messages that are shown, oldest first.
    pub fn messages(&self) -> Vec<&str> {
        let shown = self.messages.iter().filter(|message| message.insists || self.editor.overlay);
        shown.map(|message| message.text.as_str()).collect()
    }

    pub(super) fn say(&mut self, message: Option<String>) {
        if let Some(text) = message {
            self.add(text, false);
        }
    }

    /// As [`Viewer::say`], also where the overlay is hidden.
    pub fn insist(&mut self, text: String) {
        self.add(text, true);
    }

    fn add(&mut self, text: String, insists: bool) {
        log::info!("message: {text}");
        self.messages.push_back(Message { since: Instant::now(), text, insists });
        self.pending.display = true;
    }

    /// Returns `Device` and `Unsupported` errors; all other errors become messages.
    pub(super) fn tolerate<T>(&mut self, outcome: Result<T>) -> Result<Option<T>> {
        match outcome {
            Ok(value) => Ok(Some(value)),
            Err(error @ (Error::Device(_) | Error::Unsupported(_))) => Err(error),
            Err(error) => {
                self.say(Some(error.to_string()));
                Ok(None)
            }
        }
    }
}
