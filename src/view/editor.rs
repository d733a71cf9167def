//! The state of the editor behind the window.

use super::command::{Changed, Command, Effect};
use super::edit::History;
use super::orbit_camera::OrbitCamera;
use super::pick::{EntityDrag, Shapes, unbuilt_shapes};
use crate::asset::enclose::around_spheres;
use crate::asset::environment::EnvironmentData;
use crate::asset::sky::Sky;
use crate::scene::{Camera, Data, Entity, Placement, Scene, framing};
use glam::{DVec3, Vec3};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The state that `view` shows and that commands change.
pub struct Editor {
    pub(super) scene: Scene,
    path: PathBuf,
    pub(super) orbit: OrbitCamera,
    /// Width and height of the window, pixels.
    window: [u32; 2],
    /// The selected entity; `None` if none is selected.
    pub selection: Option<usize>,
    pub time_s: f64,
    pub running: bool,
    /// Whether the ray-cast reference is shown beside the merged picture.
    pub reference: bool,
    /// Whether the error is shown in false colour.
    pub error: bool,
    pub overlay: bool,
    /// Whether the list of keys is unfolded.
    pub(super) shows_keys: bool,
    /// Whether the figures are unfolded; `None` where the user has not chosen.
    pub(super) shows_figures: Option<bool>,
    pub(super) history: History,
    /// Emission of each entity before it stopped being a light.
    pub(super) former_emission: Vec<Option<Vec3>>,
    pub(super) shapes: Shapes,
    pub(super) drag: Option<EntityDrag>,
    /// Files that were written since the start, for any scene.
    pub(super) saved: HashSet<PathBuf>,
    /// The scene as it was opened or saved last.
    pub(super) kept: Data,
}

/// Gives a scene without distant light a generated sky.
pub(crate) fn add_sky(scene: &mut Scene) {
    if scene.data.environment.is_empty() {
        let source = EnvironmentData { sky: Some(Sky::default()), ..scene.data.environment.clone() };
        if let Err(error) = scene.set_environment(&source) {
            log::warn!("no generated sky: {error}");
        }
    }
}

impl Editor {
    /// The state in which a scene is first shown: running, with nothing selected. `path` is the scene's file. A scene
    /// without distant light gets a generated sky, which is saved with it; one without exposure gets 0 stops.
    pub fn new(mut scene: Scene, path: &Path) -> Self {
        add_sky(&mut scene);
        scene.data.output.exposure_ev.get_or_insert(0.0);
        Editor {
            orbit: OrbitCamera::new(&scene.data.camera),
            window: [scene.data.output.width, scene.data.output.height],
            selection: None,
            time_s: scene.data.output.time_s,
            running: true,
            reference: false,
            error: false,
            overlay: true,
            shows_keys: false,
            shows_figures: None,
            history: History::default(),
            former_emission: vec![None; scene.entities.len()],
            shapes: unbuilt_shapes(&scene),
            drag: None,
            saved: HashSet::new(),
            kept: scene.data.clone(),
            path: path.to_owned(),
            scene,
        }
    }

    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn camera(&self) -> &Camera {
        &self.scene.data.camera
    }

    pub fn placements(&self) -> Vec<Placement> {
        self.scene.at(self.time_s)
    }

    /// Width and height of the window, pixels: those of the saved picture.
    pub fn window(&self) -> [u32; 2] {
        self.window
    }

    /// Those of the merged picture.
    pub fn size(&self) -> [u32; 2] {
        self.size_in(self.window)
    }

    /// The same in a window of another size: its left half beside a reference.
    pub(super) fn size_in(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        [if self.reference { (width / 2).max(1) } else { width }, height]
    }

    /// Radiance that the exposure shows as white.
    pub fn white(&self) -> f32 {
        self.scene.data.output.white()
    }

    pub fn undo_count(&self) -> usize {
        self.history.done.len()
    }

    /// Advances the time by `dt_s` seconds if the motion runs. Placements depend only on the sum of all `dt_s`.
    pub fn advance(&mut self, dt_s: f64) -> Effect {
        if !(self.running && dt_s.is_finite() && dt_s > 0.0) {
            return Effect::default();
        }
        self.time_s += dt_s;
        let moves = self.scene.data.entities.iter().any(|e| !e.motion.is_empty());
        Changed { placements: moves, ..Changed::default() }.into()
    }

    pub fn apply(&mut self, command: Command) -> Effect {
        let unchanged = Changed::default();
        match command {
            Command::Resize(size) if size.contains(&0) || size == self.window => Effect::default(),
            Command::Resize(size) => {
                self.window = size;
                Changed { camera: true, ..unchanged }.into()
            }
            Command::Orbit(drag) => self.see(|orbit, [_, height], _| orbit.turn(drag, height)),
            Command::Pan(drag) => self.see(|orbit, [_, height], _| orbit.pan(drag, height)),
            Command::Zoom(notches) => self.see(|orbit, _, (_, radius_m)| orbit.zoom(notches, radius_m)),
            Command::Home => {
                // Suns stand behind the entities of the file.
                let entities = self.scene.entities[..self.scene.data.entities.len()].iter().zip(self.placements());
                let things = entities.map(|(entity, place)| (&*self.scene.meshes[entity.mesh], place));
                let points = framing::points(things);
                self.see(|orbit, [width, height], (_, radius_m)| {
                    orbit.frame(&points, radius_m, f64::from(width) / f64::from(height));
                })
            }
            Command::SelectNext => self.cycle(1),
            Command::SelectPrevious => self.cycle(-1),
            Command::SelectNone => self.select(None),
            Command::Pick(at) => {
                let seen = self.hit(at).map(|(entity, _)| entity);
                self.select(seen)
            }
            Command::DragStart(at) => self.grab(at),
            Command::DragTo(at) => self.drag_to(at),
            Command::DragEnd => self.let_go(),
            Command::NextScene => self.next_scene(),
            Command::ToggleRunning => toggle(&mut self.running),
            Command::ToggleReference => {
                self.reference = !self.reference;
                Changed { display: true, camera: true, ..unchanged }.into()
            }
            Command::ToggleError => toggle(&mut self.error),
            Command::ToggleOverlay => toggle(&mut self.overlay),
            Command::ToggleKeys => {
                self.shows_keys = !(self.shows_keys && self.overlay);
                self.overlay = true;
                Changed { display: true, ..unchanged }.into()
            }
            Command::ShowFigures(shows) => {
                self.shows_figures = Some(shows);
                Changed { display: true, ..unchanged }.into()
            }
            Command::EndSlide => {
                self.history.close();
                Effect::default()
            }
            // The window's own.
            Command::Screenshot | Command::Save | Command::Quit => Effect::default(),
            edit => self.change(edit),
        }
    }

    /// Centre and radius in metres of a sphere around all lights and all occluders but flat ones, as floors are; around
    /// all entities if there are none.
    pub fn bounds(&self) -> (DVec3, f64) {
        let placements = self.placements();
        // Suns stand behind the entities of the file.
        let entities = &self.scene.entities[..self.scene.data.entities.len()];
        let is_flat = |entity: &Entity| self.scene.meshes[entity.mesh].is_flat();
        let acts = |entity: &Entity| entity.emits || entity.occludes && !is_flat(entity);
        let any = entities.iter().any(acts);
        let shown = (0..entities.len()).filter(|i| !any || acts(&entities[*i]));
        let spheres: Vec<(DVec3, f64)> = shown.map(|i| self.sphere(i, &placements[i])).collect();
        around_spheres(&spheres).unwrap_or((self.orbit.target, self.orbit.distance_m))
    }

    /// Bounding sphere of an entity at a placement, metres.
    pub fn sphere(&self, entity: usize, placement: &Placement) -> (DVec3, f64) {
        placement.sphere(self.scene.meshes[self.scene.entities[entity].mesh].bounding_sphere())
    }

    fn see(&mut self, change: impl FnOnce(&mut OrbitCamera, [u32; 2], (DVec3, f64))) -> Effect {
        let size = self.size();
        let bounds = self.bounds();
        let before = self.orbit;
        change(&mut self.orbit, size, bounds);
        if self.orbit == before {
            return Effect::default();
        }
        self.scene.data.camera = self.orbit.camera();
        Changed { camera: true, ..Changed::default() }.into()
    }

    pub(super) fn select(&mut self, selection: Option<usize>) -> Effect {
        let changed = self.selection != selection;
        self.selection = selection;
        self.drag = None;
        self.history.close();
        Changed { selection: changed, ..Changed::default() }.into()
    }

    fn cycle(&mut self, by: isize) -> Effect {
        let count = self.scene.data.entities.len();
        if count == 0 {
            return Effect::default();
        }
        let next = match self.selection {
            Some(now) => now.wrapping_add_signed(by).wrapping_add(count) % count,
            None if by > 0 => 0,
            None => count - 1,
        };
        self.select(Some(next))
    }

    /// Replaces the scene and keeps the window's state.
    pub(super) fn replace(&mut self, next: Editor) {
        *self = Editor {
            window: self.window,
            running: self.running,
            reference: self.reference,
            error: self.error,
            overlay: self.overlay,
            shows_keys: self.shows_keys,
            shows_figures: self.shows_figures,
            saved: std::mem::take(&mut self.saved),
            ..next
        };
    }
}

fn toggle(switch: &mut bool) -> Effect {
    *switch = !*switch;
    Changed { display: true, ..Changed::default() }.into()
}
