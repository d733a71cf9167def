//! The ray-cast reference beside the picture. A background task casts it, first coarsely, then more finely while
//! nothing changes.

use super::task::{BackgroundTask, TaskWorker};
use crate::error::Result;
use crate::scene::{Placement, Scene};
use crate::truth::{EntityRadiosity, RayCast, RayMeshes, World, raycast, receiver_vertices};

/// Rays per vertex and light in each round; a round does not reuse the previous one.
const ROUNDS: [u32; 3] = [32, 256, 2048];
/// Independent runs per round, for the standard error.
const RUNS: u32 = 4;
/// Number of vertices between two checks whether to stop.
const CHUNK: usize = 512;

/// The result of a round.
pub struct Reference {
    /// Version of the light for which it was cast, as the caller counts versions.
    pub version: u64,
    /// Rays per vertex and light.
    pub rays: u32,
    /// Relative standard error.
    pub error: f64,
    pub radiosity: Vec<EntityRadiosity>,
}

/// Starts casting for the current state of a scene.
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
