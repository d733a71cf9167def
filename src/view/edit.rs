//! Changes of the scene, all of which can be undone.

use super::command::{Changed, Command, Effect};
use super::editor::Editor;
use crate::asset::environment::EnvironmentData;
use crate::scene::data::{Data, EntityData, MeshData};
use crate::scene::motion::{Motion, Node};
use crate::scene::values::POSITION_LIMIT_M;
use glam::{DQuat, DVec3, Vec3};

/// Largest number of changes that are kept.
pub const STEP_LIMIT: usize = 256;
/// Largest number of entities that all changes together keep: at least 100 MB.
const ENTITY_LIMIT: usize = 1 << 18;

/// Kind of a change. Consecutive changes of the same kind may be undone as one.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum EditKind {
    Drag,
    /// Change between occluder and light.
    Role,
    /// Angle of the distant light.
    SkyTurn,
    /// Strength of the distant light.
    Sky,
    Light,
    Exposure,
}

/// The changes that can be undone and redone.
#[derive(Default)]
pub(super) struct History {
    /// The scene before each change.
    pub done: Vec<Data>,
    undone: Vec<Data>,
    /// Kind and selection of the last change, while further changes of this kind may join it.
    open: Option<(EditKind, Option<usize>)>,
}

impl History {
    /// Notes that a change of `kind` follows. If `joins`, and the last change had the same kind and selection, the change
    /// becomes part of the last one.
    pub fn note(&mut self, kind: EditKind, selection: Option<usize>, joins: bool, before: &Data) {
        if joins && self.open == Some((kind, selection)) {
            return;
        }
        self.open = Some((kind, selection));
        self.undone.clear();
        self.done.push(before.clone());
        let most = (ENTITY_LIMIT / before.entities.len().max(1)).clamp(1, STEP_LIMIT);
        if self.done.len() > most {
            self.done.remove(0);
        }
    }

    /// Ends the last change, so that no further change joins it.
    pub fn close(&mut self) {
        self.open = None;
    }

    /// The scene before the last change, or after the one that was undone last; `None` if there was none.
    pub fn travel(&mut self, forth: bool, now: &Data) -> Option<Data> {
        self.open = None;
        let (from, to) = if forth { (&mut self.undone, &mut self.done) } else { (&mut self.done, &mut self.undone) };
        let there = from.pop()?;
        to.push(now.clone());
        Some(there)
    }
}

impl Editor {
    pub(super) fn change(&mut self, command: Command) -> Effect {
        self.drag = None;
        match command {
            Command::ToggleLight => self.toggle_light(),
            Command::Undo => self.travel(false),
            Command::Redo => self.travel(true),
            Command::SetSkyTurn(turn_deg) => {
                self.set_environment(EditKind::SkyTurn, |e| e.turn_deg = wrapped(turn_deg))
            }
            Command::SetSky(strength) => self.set_environment(EditKind::Sky, |e| e.strength = strength),
            Command::SetLight(ev) => self.set_light(ev),
            Command::SetExposure(ev) => self.set_exposure(ev),
            _ => Effect::default(),
        }
    }

    fn toggle_light(&mut self) -> Effect {
        let Some(index) = self.selection else {
            return Effect::said("select an entity first: click it, or Q / A");
        };
        self.history.note(EditKind::Role, self.selection, false, &self.scene.data);
        let mut data = self.scene.data.entities[index].clone();
        if self.scene.entities[index].emits {
            self.former_emission[index] = Some(data.emission).filter(|e| *e != Vec3::ZERO);
            (data.emits, data.occludes, data.emission) = (Some(false), Some(true), Vec3::ZERO);
        } else {
            if data.emission == Vec3::ZERO {
                data.emission = self.former_emission[index].unwrap_or_else(|| self.fitting_emission(index));
            }
            (data.emits, data.occludes) = (Some(true), Some(false));
        }
        self.scene.put_entity(index, data);
        Changed { emission: true, roles: true, ..Changed::default() }.into()
    }

    /// Emission in the entity's colour that lights a white surface at the distance of the scene's size to a radiance of
    /// about 1: a Lambertian sphere of radius r gives the irradiance pi L (r / d)^2 at distance d.
    fn fitting_emission(&self, index: usize) -> Vec3 {
        let (_, radius_m) = self.sphere(index, &self.placements()[index]);
        let (_, distance_m) = self.bounds();
        let white = self.white();
        let needed = f64::from(white) * (distance_m / radius_m).powi(2);
        let hue = self.scene.entities[index].albedo.max(Vec3::splat(0.02));
        hue / hue.max_element() * (needed.clamp(1.0, 1e4) as f32)
    }

    /// Emission that [`Command::SetLight`] changes, in stops: the largest channel of the lights concerned; `None` if
    /// there are none.
    pub fn light_ev(&self) -> Option<f32> {
        let lights = self.lights();
        let largest = lights.iter().map(|i| self.scene.entities[*i].emission.max_element()).fold(0.0, f32::max);
        (largest > 0.0).then(|| largest.log2())
    }

    /// The selected entity if it emits; all emitting entities if nothing is selected.
    fn lights(&self) -> Vec<usize> {
        let concerned = |i: &usize| self.scene.entities[*i].emits && self.selection.is_none_or(|s| s == *i);
        (0..self.scene.data.entities.len()).filter(concerned).collect()
    }

    fn set_light(&mut self, ev: f32) -> Effect {
        let Some(now) = self.light_ev().filter(|_| (-16.0..=32.0).contains(&ev)) else { return Effect::default() };
        let lights = self.lights();
        let factor = (ev - now).exp2();
        self.history.note(EditKind::Light, self.selection, true, &self.scene.data);
        for index in lights {
            let mut data = self.scene.data.entities[index].clone();
            data.emission *= factor;
            self.scene.put_entity(index, data);
        }
        Changed { emission: true, ..Changed::default() }.into()
    }

    fn set_exposure(&mut self, ev: f32) -> Effect {
        if !(-32.0..=32.0).contains(&ev) || ev == self.scene.data.output.exposure_ev() {
            return Effect::default();
        }
        self.history.note(EditKind::Exposure, None, true, &self.scene.data);
        self.scene.data.output.exposure_ev = Some(ev);
        Changed { exposure: true, ..Changed::default() }.into()
    }

    fn set_environment(&mut self, kind: EditKind, change: impl FnOnce(&mut EnvironmentData)) -> Effect {
        let before = self.scene.data.clone();
        let mut after = before.environment.clone();
        change(&mut after);
        if after == before.environment {
            return Effect::default();
        }
        if let Err(error) = self.scene.set_environment(&after) {
            return Effect::said(error.to_string());
        }
        self.history.note(kind, None, true, &before);
        Changed { sky: true, ..Changed::default() }.into()
    }

    fn travel(&mut self, forth: bool) -> Effect {
        let Some(there) = self.history.travel(forth, &self.scene.data) else {
            return Effect::said(format!("nothing to {}", if forth { "redo" } else { "undo" }));
        };
        let mut changed = Changed::default();
        let scene = &mut self.scene;
        for (index, data) in there.entities.into_iter().enumerate() {
            if data == scene.data.entities[index] {
                continue;
            }
            let before = scene.entities[index].clone();
            scene.put_entity(index, data);
            let after = &scene.entities[index];
            changed.roles |= (before.emits, before.occludes) != (after.emits, after.occludes);
            changed.emission |= before.emission != after.emission;
            changed.placements = true;
        }
        if there.environment != scene.data.environment {
            // The scene had this environment before, with the same picture.
            changed.sky = scene.set_environment(&there.environment).is_ok();
        }
        changed.exposure = there.output.exposure_ev != scene.data.output.exposure_ev;
        scene.data.output.exposure_ev = there.output.exposure_ev;
        changed.into()
    }
}

/// An angle within -180 to 180 degrees.
fn wrapped(angle_deg: f32) -> f32 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}

/// The entity moved by `by` metres at all times; `None` if that leaves the range of a scene file.
pub fn moved(entity: &EntityData, by: DVec3) -> Option<EntityData> {
    let mut out = entity.clone();
    let shift = |p: &mut Vec3| {
        *p = (p.as_dvec3() + by).as_vec3();
        p.abs().max_element() <= POSITION_LIMIT_M
    };
    // Parts in a node move with the outermost one, or with a still one around it where keys move that. Keyframes
    // replace what was before them, nodes too.
    let mut fits = true;
    let placed = out.motion.iter().rposition(|motion| matches!(motion, Motion::Node(_) | Motion::Keyframes { .. }));
    let mut first = 0;
    match placed.map(|last| (last, &mut out.motion[last])) {
        Some((last, Motion::Node(node))) => {
            first = last + 1;
            if node.position_keys.is_none() {
                fits &= shift(&mut node.position);
            } else {
                let around = Node::still(by.as_vec3(), DQuat::IDENTITY, 1.0);
                fits &= around.position.abs().max_element() <= POSITION_LIMIT_M;
                out.motion.insert(first, Motion::Node(Box::new(around)));
            }
        }
        _ => fits &= shift(&mut out.position),
    }
    for motion in &mut out.motion[first..] {
        match motion {
            Motion::Orbit { centre, .. } => fits &= shift(centre),
            Motion::Keyframes { keys, .. } => {
                keys.iter_mut().filter_map(|k| k.position.as_mut()).for_each(|p| fits &= shift(p));
            }
            Motion::Spin { .. } | Motion::Bob { .. } | Motion::Node(_) => {}
        }
    }
    fits.then_some(out)
}

/// The entities that are pieces of the same thing as one of them, in order: that one alone where its mesh is whole.
pub fn pieces(data: &Data, entity: usize) -> Vec<usize> {
    let own = &data.entities[entity];
    let mesh_of = |entity: &EntityData| data.meshes.iter().find(|mesh| mesh.name == entity.mesh);
    let Some(mesh) = mesh_of(own).filter(|mesh| mesh.piece.is_some()) else { return vec![entity] };
    let stands_with = |other: &EntityData| {
        (other.position, other.rotation, other.scale) == (own.position, own.rotation, own.scale)
            && (&other.motion, other.movable) == (&own.motion, own.movable)
    };
    let is_cut_from_it = |other: &MeshData| {
        other.piece.is_some() && (&other.file, other.part, other.pose) == (&mesh.file, mesh.part, mesh.pose)
    };
    let is_piece = |other: &EntityData| stands_with(other) && mesh_of(other).is_some_and(is_cut_from_it);
    (0..data.entities.len()).filter(|&other| is_piece(&data.entities[other])).collect()
}
