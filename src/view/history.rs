//! What can be undone: the parts of a scene as they were, bounded in number and size.

use crate::asset::environment::EnvironmentData;
use crate::scene::data::EntityData;

/// Most changes that are kept.
pub const STEP_LIMIT: usize = 256;
/// Most entities that all changes together keep: about 100 MB of the plainest.
pub const ENTITY_LIMIT: usize = 1 << 18;

/// Parts of a scene at one moment. Only what a change touches is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Entities by index.
    pub entities: Vec<(usize, EntityData)>,
    /// Distant light.
    pub environment: Option<EnvironmentData>,
    /// Exposure in stops.
    pub exposure_ev: Option<f32>,
}

/// What kind of change a step is: the same kind in a row may be one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EditKind {
    /// A key that moves, scales or turns.
    Step(super::Step),
    /// A drag.
    Drag,
    /// Occluder to light or back.
    Role,
    /// A turn of the distant light by key.
    SkyTurn,
    /// A slider.
    Slide(Slider),
}

/// Sliders that change the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slider {
    /// Angle of the distant light.
    SkyTurn,
    /// Strength of the distant light.
    Sky,
    /// Emission.
    Light,
    /// Exposure.
    Exposure,
}

/// The changes made and those taken back.
#[derive(Clone, Debug, Default)]
pub struct History {
    done: Vec<Snapshot>,
    undone: Vec<Snapshot>,
    /// Kind and selection of the last change, while more of the same joins it.
    open: Option<(EditKind, Option<usize>)>,
}

impl History {
    /// Notes that a change of `kind` follows; `before` makes what it touches as it is now. Where `joins` and the last change
    /// was of the same kind to the same selection, it becomes part of that.
    pub fn note(&mut self, kind: EditKind, selection: Option<usize>, joins: bool, before: impl FnOnce() -> Snapshot) {
        if joins && self.open == Some((kind, selection)) {
            return;
        }
        self.open = Some((kind, selection));
        self.undone.clear();
        self.done.push(before());
        let held = |steps: &[Snapshot]| steps.iter().map(|s| s.entities.len()).sum::<usize>();
        while self.done.len() > STEP_LIMIT || (self.done.len() > 1 && held(&self.done) > ENTITY_LIMIT) {
            self.done.remove(0);
        }
    }

    /// What follows is a change of its own.
    pub fn close(&mut self) {
        self.open = None;
    }

    /// Takes the last change back: `swap` puts a snapshot in place and returns what stood there. Whether there was one.
    pub fn undo(&mut self, swap: impl FnOnce(Snapshot) -> Snapshot) -> bool {
        self.open = None;
        let Some(snapshot) = self.done.pop() else { return false };
        self.undone.push(swap(snapshot));
        true
    }

    /// Does again what was taken back last. Whether there was anything.
    pub fn redo(&mut self, swap: impl FnOnce(Snapshot) -> Snapshot) -> bool {
        self.open = None;
        let Some(snapshot) = self.undone.pop() else { return false };
        self.done.push(swap(snapshot));
        true
    }

    /// How many changes can be taken back.
    pub fn len(&self) -> usize {
        self.done.len()
    }

    /// Whether nothing can be taken back.
    pub fn is_empty(&self) -> bool {
        self.done.is_empty()
    }
}
