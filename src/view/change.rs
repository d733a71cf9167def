//! The editor's changes of the scene, all of which can be undone.

use super::command::{Changed, Command, Effect, Step};
use super::edit;
use super::editor::Editor;
use super::history::{EditKind, Slider, Snapshot};
use crate::asset::environment::EnvironmentData;
use crate::scene::EntityData;
use glam::{DQuat, DVec3, Vec3};

/// Angle in degrees of a step that turns an entity or the sky.
pub const TURN_STEP_DEG: f64 = 5.0;
/// Scale factor of a step that enlarges.
pub const SCALE_STEP: f64 = 1.05;
/// Length of a step, as a share of the distance from eye to target, so that steps look the same in scenes of any size.
pub const MOVE_STEP: f64 = 0.02;

impl Editor {
    /// Executes a command that changes the scene.
    pub(super) fn change(&mut self, command: Command) -> Effect {
        self.drag = None;
        match command {
            Command::Step { step, repeat } => self.step(step, repeat),
            Command::ToggleLight => self.toggle_light(),
            Command::Undo => self.travel(false),
            Command::Redo => self.travel(true),
            Command::TurnSky { by_deg, repeat } => {
                let turn_deg = wrapped(self.sky_turn_deg() + by_deg);
                self.set_environment(EditKind::SkyTurn, repeat, |e| e.turn_deg = turn_deg)
            }
            Command::SetSkyTurn(turn_deg) => {
                self.set_environment(EditKind::Slide(Slider::SkyTurn), true, |e| e.turn_deg = wrapped(turn_deg))
            }
            Command::SetSky(strength) => {
                self.set_environment(EditKind::Slide(Slider::Sky), true, |e| e.strength = strength)
            }
            Command::SetLight(ev) => self.set_light(ev),
            Command::SetExposure(ev) => self.set_exposure(ev),
            _ => Effect::default(),
        }
    }

    fn step(&mut self, step: Step, repeat: bool) -> Effect {
        let length_m = MOVE_STEP * self.orbit.distance_m;
        let turn = |deg: f64| DQuat::from_rotation_y(deg.to_radians());
        let (right, ahead) = (self.orbit.right(), self.orbit.ahead());
        let change = |entity: &EntityData| match step {
            Step::Left => edit::moved(entity, -length_m * right),
            Step::Right => edit::moved(entity, length_m * right),
            Step::Up => edit::moved(entity, length_m * DVec3::Y),
            Step::Down => edit::moved(entity, -length_m * DVec3::Y),
            Step::Forth => edit::moved(entity, length_m * ahead),
            Step::Back => edit::moved(entity, -length_m * ahead),
            Step::Larger => edit::scaled(entity, SCALE_STEP),
            Step::Smaller => edit::scaled(entity, 1.0 / SCALE_STEP),
            Step::TurnLeft => Some(edit::turned(entity, turn(TURN_STEP_DEG))),
            Step::TurnRight => Some(edit::turned(entity, turn(-TURN_STEP_DEG))),
        };
        let entities: Vec<usize> = self.affected_of(self.selection).collect();
        let after: Option<Vec<EntityData>> = entities.iter().map(|i| change(&self.scene.data.entities[*i])).collect();
        let Some(after) = after else {
            return Effect {
                message: Some("this step would leave the range of a scene file".into()),
                ..Effect::default()
            };
        };
        self.note_entities(EditKind::Step(step), repeat, &entities);
        for (index, data) in entities.into_iter().zip(after) {
            self.scene.put_entity(index, data);
        }
        Changed { placements: true, ..Changed::default() }.into()
    }

    fn toggle_light(&mut self) -> Effect {
        let Some(index) = self.selection else {
            return Effect { message: Some("select an entity first: click it, or Q / A".into()), ..Effect::default() };
        };
        self.note_entities(EditKind::Role, false, &[index]);
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

    /// Emission in the entity's colour that lights a white surface at the distance of the scene's size to a radiance of about 1:
    /// a Lambertian sphere of radius r gives the irradiance pi L (r / d)^2 at distance d.
    fn fitting_emission(&self, index: usize) -> Vec3 {
        let (_, radius_m) = self.sphere(index, &self.placements()[index]);
        let (_, distance_m) = self.bounds();
        let white = self.white();
        let needed = f64::from(white) * (distance_m / radius_m).powi(2);
        let hue = self.scene.entities[index].albedo.max(Vec3::splat(0.02));
        hue / hue.max_element() * (needed.clamp(1.0, 1e4) as f32)
    }

    /// Emission that [`Command::SetLight`] changes, in stops: the largest channel of the lights concerned; `None` if there are none.
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
        let (lights, factor) = (self.lights(), (ev - now).exp2());
        self.note_entities(EditKind::Slide(Slider::Light), true, &lights);
        for index in lights {
            let mut data = self.scene.data.entities[index].clone();
            data.emission *= factor;
            self.scene.put_entity(index, data);
        }
        Changed { emission: true, ..Changed::default() }.into()
    }

    fn set_exposure(&mut self, ev: f32) -> Effect {
        if !(-32.0..=32.0).contains(&ev) || ev == self.exposure_ev() {
            return Effect::default();
        }
        let before = Snapshot { exposure_ev: Some(self.exposure_ev()), ..Snapshot::default() };
        self.history.note(EditKind::Slide(Slider::Exposure), None, true, || before);
        self.scene.data.output.exposure_ev = ev;
        Changed { exposure: true, ..Changed::default() }.into()
    }

    fn set_environment(&mut self, kind: EditKind, joins: bool, change: impl FnOnce(&mut EnvironmentData)) -> Effect {
        let before = self.scene.data.environment.clone();
        let mut after = before.clone();
        change(&mut after);
        if after == before {
            return Effect::default();
        }
        if let Err(error) = self.scene.set_environment(&after) {
            return Effect { message: Some(error.to_string()), ..Effect::default() };
        }
        self.history.note(kind, None, joins, || Snapshot { environment: Some(before), ..Snapshot::default() });
        Changed { sky: true, ..Changed::default() }.into()
    }

    fn note_entities(&mut self, kind: EditKind, joins: bool, entities: &[usize]) {
        let data = &self.scene.data.entities;
        self.history.note(kind, self.selection, joins, || Snapshot {
            entities: entities.iter().map(|&i| (i, data[i].clone())).collect(),
            ..Snapshot::default()
        });
    }

    /// Undo or redo.
    fn travel(&mut self, forth: bool) -> Effect {
        let mut changed = Changed::default();
        let scene = &mut self.scene;
        let swap = |snapshot: Snapshot| {
            let mut back = Snapshot::default();
            for (index, data) in snapshot.entities {
                back.entities.push((index, scene.data.entities[index].clone()));
                let before = scene.entities[index].clone();
                scene.put_entity(index, data);
                let after = &scene.entities[index];
                changed.roles |= (before.emits, before.occludes) != (after.emits, after.occludes);
                changed.emission |= before.emission != after.emission;
                changed.placements = true;
            }
            if let Some(source) = snapshot.environment {
                back.environment = Some(scene.data.environment.clone());
                // The scene had this environment before, with the same picture.
                changed.sky = scene.set_environment(&source).is_ok();
            }
            if let Some(ev) = snapshot.exposure_ev {
                back.exposure_ev = Some(scene.data.output.exposure_ev);
                scene.data.output.exposure_ev = ev;
                changed.exposure = true;
            }
            back
        };
        let found = if forth { self.history.redo(swap) } else { self.history.undo(swap) };
        if !found
            && !forth
            && let Some(effect) = self.return_to_former()
        {
            return effect;
        }
        let message = (!found).then(|| format!("nothing to {}", if forth { "redo" } else { "undo" }));
        Effect { changed, message, request: None }
    }
}

/// An angle within -180 to 180 degrees.
fn wrapped(angle_deg: f32) -> f32 {
    (angle_deg + 180.0).rem_euclid(360.0) - 180.0
}
