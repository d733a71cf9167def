//! Keeps what is shown up with the editor: at once, after a background bake, or by a rebuild. While a scene is baked its
//! shapes are shown, then its light on coarse surfaces. Once nothing moves the picture is refined.

use super::command::Changed;
use super::editor::Editor;
use super::figures::pass_ms;
use super::task::{BackgroundTask, TaskWorker};
use super::viewer::{Previewed, Viewer};
use crate::asset::environment::EnvironmentData;
use crate::bake::cache::Cache;
use crate::bake::{self, Baker, SceneNeeds};
use crate::error::Result;
use crate::frame::{self, Frame, RadiositySource, Viewport};
use crate::gpu::validation::Messages;
use crate::gpu::{Device, Timing, process};
use crate::scene::motion::RotationData;
use crate::scene::{EntityData, Placement, Scene};
use crate::scene_buffers::limits;
use glam::Vec3;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Towards the light that shapes are seen by.
const TOWARD: Vec3 = Vec3::new(0.4, 0.8, 0.45);

/// Time without a change after which the picture is refined. A software device takes too long for four samples a pixel,
/// and for pixels that evaluate lights, while things move. It is longer than the interval between events of a drag.
const REST: Duration = Duration::from_millis(150);
/// Longest time of a refined frame while things move, ms.
const LONGEST_MS: f64 = 33.0;

/// Times of the last frames, ms.
#[derive(Default)]
pub(super) struct Pace {
    light: f64,
    refined_draw: Option<f64>,
}

impl Pace {
    /// Takes in the passes of a frame.
    pub fn note(&mut self, passes: &[Timing], refined: bool) {
        let of = |name: &str| pass_ms(passes, name);
        if passes.iter().any(|timing| timing.pass == "merge") {
            let all = passes.iter().map(|timing| timing.milliseconds).sum::<f64>();
            self.light = all - of("mirror") - of("draw") - of("smooth") - of("show");
        }
        if refined && passes.iter().any(|timing| timing.pass == "draw") {
            self.refined_draw = Some(of("mirror") + of("draw"));
        }
    }

    /// Whether frames can be refined while things move.
    fn allows(&self) -> bool {
        self.refined_draw.is_some_and(|draw| draw + self.light <= LONGEST_MS)
    }
}

impl Viewer {
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
            process::give_back();
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
        if needs.missing(&scene, &cache).is_empty() {
            return self.build();
        }
        let options = self.setup.options.clone();
        let library = self.setup.library.clone();
        let still = still(&scene, &self.editor.placements());
        let coarse = SceneNeeds::of(&still, &coarse(self.setup.frame.bake), self.setup.frame.lights);
        self.bake = Some(BackgroundTask::new(move |worker: &TaskWorker<()>| {
            let missing = needs.missing(&scene, &cache);
            let all: u32 = missing.iter().map(|(_, captures)| captures).sum();
            worker.report("shadows", 0, all);
            let device = Device::new(&options)?;
            let baker = Baker::new(&device, &library);
            limits::check(&device, &needs)?;
            let done = Mutex::new(vec![0; missing.len()]);
            let told = |what: &str, now: u32, of: u32| {
                let Some(place) = missing.iter().position(|(name, _)| name == what) else { return };
                let share = f64::from(now) / f64::from(of.max(1));
                let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
                done[place] = (share * f64::from(missing[place].1)) as u32;
                worker.report("shadows", done.iter().sum(), all);
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
        let options = frame::Options { size: self.editor.window(), ..self.setup.frame };
        let make = if is_lit { lit } else { shapes };
        let preview = make(&self.baker, &self.setup.cache, &self.editor, options);
        self.settle()?;
        self.preview = self.tolerate(preview)?;
        self.pending.camera = true;
        Ok(())
    }

    pub(super) fn build(&mut self) -> Result<()> {
        let built = self.new_frame();
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

    /// A frame of the scene, whose fields are cached.
    fn new_frame(&mut self) -> Result<Frame> {
        self.settle()?;
        let options = frame::Options { size: self.editor.window(), ..self.setup.frame };
        Frame::new(&self.baker, &self.setup.cache, self.editor.scene(), options, &|_, _, _| ())
    }

    /// Decides whether the next picture is refined; `moves` if it differs from the last in more than the overlay.
    /// Returns whether it has to be drawn for that, and whether its vertices have to be lit.
    pub(super) fn refine(&mut self, moves: bool) -> Result<[bool; 2]> {
        let due = self.refine_at.take();
        let Some(frame) = &self.frame else { return Ok([false; 2]) };
        let was = frame.is_refined();
        let is_due = due.is_some_and(|at| at <= Instant::now());
        // Beside a reference, and where the error is shown, both are of vertices.
        let can = self.setup.refines && !self.editor.error && !self.editor.reference;
        let refines = can && if moves { self.pace.allows() } else { was || is_due };
        if can && !refines {
            self.refine_at = due.filter(|_| !moves).or_else(|| Some(Instant::now() + REST));
        }
        if refines == was {
            return Ok([false; 2]);
        }
        // The overlay of this frame does not say so yet.
        self.repaint_at = Some(Instant::now());
        // The times of the frames under way are not of the new kind.
        self.settle()?;
        let Some(frame) = &mut self.frame else { return Ok([false; 2]) };
        Ok([true, frame.refine(refines)?])
    }

    pub fn is_refined(&self) -> bool {
        self.frame.as_ref().is_some_and(|frame| frame.is_refined())
    }
}

/// A frame of the editor's scene that needs nothing baked, since nothing in it shines or casts a shadow. Vertices show
/// the entity's colour, the brighter the more they face one light; lights show their own.
fn shapes(baker: &Baker, cache: &Cache, editor: &Editor, options: frame::Options) -> Result<Frame> {
    let scene = editor.scene();
    let mut dark = scene.clone();
    for (index, data) in scene.data.entities.iter().enumerate() {
        let emits = Some(false);
        let occludes = Some(false);
        let emission = Vec3::ZERO;
        dark.put_entity(index, EntityData { emits, occludes, emission, ..data.clone() });
    }
    dark.set_environment(&EnvironmentData { strength: 0.0, ..scene.data.environment.clone() })?;
    let options = frame::Options { pictures: false, ..options };
    let mut frame = Frame::new(baker, cache, &dark, options, &|_, _, _| ())?;
    let toward = TOWARD.normalize();
    let mut colors = Vec::new();
    for (index, placement) in editor.placements().iter().enumerate().take(dark.entities.len()) {
        let entity = &scene.entities[index];
        let color = |normal: &Vec3| {
            let cosine = (placement.rotation * *normal).dot(toward).max(0.0);
            let shown =
                if entity.emits { entity.emission } else { entity.albedo * (0.3 + 0.6 * cosine) * editor.white() };
            shown.to_array()
        };
        colors.push((index, frame.scene().surface(index).normals.iter().map(color).collect()));
    }
    frame.set_comparison(0, &colors, [0.0; 3])?;
    Ok(frame)
}

/// Options of a bake that leaves surfaces as coarse as they come.
fn coarse(bake: bake::Options) -> bake::Options {
    bake::Options { vertices: 0, ..bake }
}

/// A scene as it stands: nothing that rests needs the fields of what never moves against it.
fn still(scene: &Scene, placements: &[Placement]) -> Scene {
    let mut still = scene.clone();
    for (index, (data, placement)) in scene.data.entities.iter().zip(placements).enumerate() {
        let Placement { position, rotation, scale } = *placement;
        let rotation = RotationData::Quaternion(rotation.to_array());
        still.put_entity(index, EntityData { position, rotation, scale, motion: Vec::new(), ..data.clone() });
    }
    still.rejoin();
    still
}

/// A frame of the editor's scene as it stands, lit. Its coarse surfaces are in the cache.
fn lit(baker: &Baker, cache: &Cache, editor: &Editor, options: frame::Options) -> Result<Frame> {
    let placements = editor.placements();
    let scene = still(editor.scene(), &placements);
    let options = frame::Options { bake: coarse(options.bake), ..options };
    let mut frame = Frame::new(baker, cache, &scene, options, &|_, _, _| ())?;
    frame.render(&placements, None)?;
    Ok(frame)
}

/// The viewport of a frame without shadows.
pub(super) fn unlit_viewport([width, height]: [u32; 2]) -> Viewport {
    let radiosity = RadiositySource::Comparison(0);
    Viewport { radiosity, adds_emission: false, ..Viewport::merged([0, 0, width, height]) }
}
