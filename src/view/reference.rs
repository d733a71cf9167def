//! The ray-cast reference beside the picture: cast in the background, coarse first, then finer while nothing changes.

use super::task::{BackgroundTask, TaskWorker};
use crate::error::Result;
use crate::scene::{Placement, Scene};
use crate::truth::{EntityRadiosity, RayCast, RayMeshes, World, raycast, receiver_vertices};

/// Rays a vertex and light of each round; each round starts anew.
const ROUNDS: [u32; 3] = [32, 256, 2048];
/// Runs of a round, for the standard error.
const RUNS: u32 = 4;
/// Vertices between two looks at whether to stop.
const CHUNK: usize = 512;

/// What a round found.
pub struct Reference {
    /// State of the light it was cast for, as the caller counts them.
    pub version: u64,
    /// Rays a vertex and light.
    pub rays: u32,
    /// Relative standard error.
    pub error: f64,
    /// Radiosity by entity.
    pub radiosity: Vec<EntityRadiosity>,
}

/// Starts the rounds for a scene as it stands.
pub fn cast(scene: Scene, placements: Vec<Placement>, version: u64, seed: u64) -> BackgroundTask<Reference> {
    BackgroundTask::new(move |worker: &TaskWorker<Reference>| {
        let shapes = RayMeshes::new(&scene);
        let world = World::new(&scene, &shapes, &placements);
        for rays in ROUNDS {
            worker.send(round(
                &scene,
                &world,
                RayCast { rays, runs: RUNS, seed, ..RayCast::default() },
                version,
                worker,
            )?);
        }
        Ok(())
    })
}

fn round(
    scene: &Scene,
    world: &World<'_>,
    cast: RayCast,
    version: u64,
    worker: &TaskWorker<Reference>,
) -> Result<Reference> {
    let vertices = receiver_vertices(scene);
    let mut lit = Vec::with_capacity(vertices.len());
    for chunk in vertices.chunks(CHUNK) {
        worker.report(&format!("{} rays a vertex", cast.rays), lit.len() as u32, vertices.len() as u32);
        lit.extend(cast.run(world, chunk));
    }
    let mut radiosity: Vec<EntityRadiosity> = Vec::new();
    for (vertex, estimate) in vertices.iter().zip(&lit) {
        if radiosity.last().is_none_or(|(entity, _)| *entity != vertex.entity) {
            radiosity.push((vertex.entity, Vec::new()));
        }
        radiosity.last_mut().expect("just pushed").1.push(estimate.radiosity.map(|c| c as f32));
    }
    Ok(Reference { version, rays: cast.rays, error: raycast::relative_error(&lit), radiosity })
}
