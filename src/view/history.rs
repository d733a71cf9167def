//! Undo history: earlier states of changed parts of the scene, bounded in number and size.

use crate::asset::environment::EnvironmentData;
use crate::scene::data::EntityData;

/// Largest number of changes that are kept.
pub const STEP_LIMIT: usize = 256;
/// Largest number of entities that all changes together keep: at least 100 MB.
pub const ENTITY_LIMIT: usize = 1 << 18;

/// The parts of a scene that a change concerns, at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    pub entities: Vec<(usize, EntityData)>,
    /// Distant light.
    pub environment: Option<EnvironmentData>,
    pub exposure_ev: Option<f32>,
}

/// Kind of a change. Consecutive changes of the same kind may be undone as one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EditKind {
    Drag,
    /// Change between occluder and light.
    Role,
    Slide(Slider),
}

/// Sliders that change the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slider {
    /// Angle of the distant light.
    SkyTurn,
    /// Strength of the distant light.
    Sky,
    Light,
    Exposure,
}

/// The changes that can be undone and redone.
#[derive(Clone, Debug, Default)]
pub struct History {
    done: Vec<Snapshot>,
    undone: Vec<Snapshot>,
    /// Kind and selection of the last change, while further changes of this kind may join it.
    open: Option<(EditKind, Option<usize>)>,
}

impl History {
    /// Notes that a change of `kind` follows; `before` makes a snapshot of what it will change. If `joins`, and the
    /// last change had the same kind and selection, the change becomes part of the last one.
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

    /// Ends the last change, so that no further change joins it.
    pub fn close(&mut self) {
        self.open = None;
    }

    /// Undoes the last change, or redoes the one that was undone last: `swap` restores a snapshot and returns the
    /// replaced state. Returns whether there was one.
    pub fn travel(&mut self, forth: bool, swap: impl FnOnce(Snapshot) -> Snapshot) -> bool {
        self.open = None;
        let (from, to) = if forth { (&mut self.undone, &mut self.done) } else { (&mut self.done, &mut self.undone) };
        let Some(snapshot) = from.pop() else { return false };
        to.push(swap(snapshot));
        true
    }

    /// Number of changes that can be undone.
    pub fn undo_count(&self) -> usize {
        self.done.len()
    }
}
