//! The viewer's ray-cast reference, which a background task casts, first coarsely, then more finely while nothing
//! changes; and the error of the merge against it.

use super::panel::ErrorScale;
use super::task::{BackgroundTask, TaskWorker};
use super::viewer::{ERROR, REFERENCE, Viewer};
use crate::asset::false_color::NEUTRAL;
use crate::error::Result;
use crate::scene::{Placement, Scene};
use crate::truth::error_map::{self, ErrorMap};
use crate::truth::{EntityRadiosity, RayCast, World, by_entity, raycast, receiver_vertices};

/// Rays per vertex and light in each round; a round does not reuse the previous one.
const ROUNDS: [u32; 3] = [32, 256, 2048];
/// Independent runs per round, for the standard error.
const RUNS: u32 = 4;
/// Number of vertices between two checks whether to stop.
const CHUNK: usize = 512;

pub(super) struct Reference {
    /// Version of the light for which it was cast, as the caller counts versions.
    pub(super) version: u64,
    /// Rays per vertex and light.
    pub(super) rays: u32,
    /// Relative standard error.
    pub(super) error: f64,
    pub(super) radiosity: Vec<EntityRadiosity>,
}

impl Viewer {
    /// Starts casting rays if they are wanted, receives results, and compares.
    pub(super) fn look_at_rays(&mut self) -> Result<()> {
        let wanted = self.editor.reference || self.editor.error;
        if !wanted || self.frame.is_none() {
            self.rays = None;
            return Ok(());
        }
        if let Some(found) = self.rays.as_ref().and_then(|rays| rays.results().pop()) {
            let frame = self.frame.as_mut().expect("checked above");
            frame.set_comparison(REFERENCE, &found.radiosity, [0.0; 3])?;
            self.reference = Some(found);
            self.pending.display = true;
        }
        if let Some(ended) = self.rays.as_mut().and_then(BackgroundTask::ended) {
            self.tolerate(ended)?;
        }
        let current = self.reference.as_ref().is_some_and(|r| r.version == self.version);
        // Rays for an outdated state end after their first round, so that a coarse reference is visible while entities
        // move.
        let known = self.reference.as_ref().map(|r| r.version);
        let stale = self.rays_version != self.version && known == Some(self.rays_version);
        if stale || (!current && !self.rays.as_ref().is_some_and(BackgroundTask::is_running)) {
            let scene = self.editor.scene().clone();
            let placements = self.editor.placements();
            self.rays = Some(cast(scene, placements, self.version, self.setup.seed));
            self.rays_version = self.version;
        }
        if self.editor.error && current && !self.pending.light() {
            self.compare()?;
        }
        Ok(())
    }

    /// Computes the error's colours for the last merge, unless they are known.
    pub(super) fn compare(&mut self) -> Result<()> {
        let (Some(frame), Some(reference)) = (&mut self.frame, &self.reference) else { return Ok(()) };
        let known = self.error_shown.map(|(version, rays, _)| (version, rays));
        if known == Some((self.version, reference.rays)) {
            return Ok(());
        }
        let map = ErrorMap::new(&error_map::radiosity(frame)?, &reference.radiosity);
        let scale = map.scale();
        frame.set_comparison(ERROR, &map.colors(&scale), NEUTRAL)?;
        let shown = ErrorScale { rms: map.rms(), limit: scale.limit };
        self.error_shown = Some((self.version, reference.rays, shown));
        self.pending.display = true;
        Ok(())
    }
}

fn cast(scene: Scene, placements: Vec<Placement>, version: u64, seed: u64) -> BackgroundTask<Reference> {
    BackgroundTask::new(move |worker: &TaskWorker<Reference>| {
        let world = World::of(&scene, &placements);
        let vertices = receiver_vertices(&scene);
        for rays in ROUNDS {
            let cast = RayCast { rays, runs: RUNS, seed, ..RayCast::default() };
            let mut lit = Vec::with_capacity(vertices.len());
            for chunk in vertices.chunks(CHUNK) {
                worker.report(&format!("{rays} rays a vertex"), lit.len() as u32, vertices.len() as u32);
                lit.extend(cast.run(&world, chunk));
            }
            let radiosity = by_entity(&vertices, &lit);
            worker.send(Reference { version, rays, error: raycast::relative_error(&lit), radiosity });
        }
        Ok(())
    })
}
