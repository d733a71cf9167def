//! What a user would pick instead of shadow fields: soft shadows a vertex by ray casting on the processor's threads.
//!
//! The rival is [`RayCast`] in one run: an 8-wide hierarchy a mesh, bounding spheres before it, scrambled Sobol points, the
//! sky sampled by cosine, local lights in their cone, occluders that cannot lie between left out, all threads busy. Its
//! hierarchies are built beforehand, as fields are baked beforehand.

use super::Bench;
use super::budget::{Truth, device_radiosity};
use super::cases::Case;
use super::default_options;
use super::figures::{Difference, Radiosity, Spread, along, crossing, spread};
use super::sweep;
use crate::error::Result;
use crate::truth::{RayCast, RayMeshes, World};
use serde::Serialize;
use std::time::Instant;

/// The rival at one number of rays.
#[derive(Clone, Debug, Serialize)]
pub struct RivalPoint {
    /// Rays a vertex for the sky and for each light.
    #[serde(rename = "ray_count")]
    pub rays: u32,
    /// Wall time for all lit vertices, in proportion from the judged ones, milliseconds.
    pub wall_ms: Spread,
    /// Difference to T0.
    pub error: Difference,
}

/// Merge and rival on one case.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Scene and light.
    pub case: String,
    /// What lights it, in words.
    pub light: String,
    /// Lit vertices.
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// Threads of the rival.
    #[serde(rename = "thread_count")]
    pub threads: usize,
    /// Wall time of a frame without drawing, milliseconds.
    pub frame_wall_ms: Spread,
    /// Device time of the merge in it, milliseconds.
    pub merge_ms: Spread,
    /// Merge against T0.
    pub merge_error: Difference,
    /// The rival at rising numbers of rays.
    pub rival: Vec<RivalPoint>,
    /// Wall time in which the rival has the merge's root mean square error, milliseconds: between its points, beyond its last,
    /// or at one ray where that is already better.
    pub rival_ms_at_equal_rms: Option<f64>,
    /// Rays at which it has it.
    #[serde(rename = "rays_at_equal_rms_count")]
    pub rays_at_equal_rms: Option<f64>,
    /// How many times faster a frame of the merge is at equal root mean square error.
    #[serde(rename = "speed_up_at_equal_rms_ratio")]
    pub speed_up_at_equal_rms: Option<f64>,
    /// The same of the merge's device time alone, without lists, uploads and waiting.
    #[serde(rename = "merge_speed_up_at_equal_rms_ratio")]
    pub merge_speed_up_at_equal_rms: Option<f64>,
}

impl Comparison {
    /// The case with its light, once.
    pub fn title(&self) -> String {
        if self.case.contains(", (") { self.case.clone() } else { format!("{} ({})", self.case, self.light) }
    }
}

/// Runs both in turns.
///
/// # Errors
/// As [`crate::frame::Frame::new`] and [`crate::frame::Frame::render`].
pub fn compare(bench: &Bench<'_>, case: &Case, truth: &Truth) -> Result<Comparison> {
    let placements = case.scene.at(case.time_s);
    let mut frame = bench.frame(&case.scene, default_options())?;
    let shapes = RayMeshes::new(&case.scene);
    let rays: &[u32] = if bench.quick { &[1, 4, 16, 64, 256] } else { &[1, 4, 16, 64, 256, 1024, 4096] };
    let vertices = frame.receiver_vertex_count();
    let share = vertices as f64 / truth.vertices.len() as f64;
    let (mut walls, mut merges) = (Vec::new(), Vec::new());
    let mut rival_walls = vec![Vec::new(); rays.len()];
    let mut found: Vec<Vec<Radiosity>> = vec![Vec::new(); rays.len()];
    frame.render(&placements, None)?;
    for round in 0..if bench.quick { 3 } else { 7 } {
        // The first frame after the rays finds threads asleep and caches full of triangles: it warms up.
        for warm in [false, true, true, true] {
            // All is merged, as if everything had moved.
            frame.forget();
            let started = Instant::now();
            let timings = frame.render(&placements, None)?;
            if warm {
                walls.push(started.elapsed().as_secs_f64() * 1e3);
                merges.push(sweep::merge_ms(&timings));
            }
        }
        for (index, &rays) in rays.iter().enumerate() {
            // Long runs need fewer repetitions.
            if round >= 3 && rays > 256 {
                continue;
            }
            let cast = RayCast { rays, runs: 1, seed: bench.seed + 77, distant: case.distant, shadows: true };
            let started = Instant::now();
            let world = World::new(&case.scene, &shapes, &placements);
            let lit = cast.run(&world, &truth.vertices);
            rival_walls[index].push(started.elapsed().as_secs_f64() * 1e3 * share);
            found[index] = lit.iter().map(|e| e.radiosity).collect();
        }
    }
    let merge_error = truth.error(&device_radiosity(&frame, &truth.vertices)?);
    let rival: Vec<RivalPoint> = rays
        .iter()
        .enumerate()
        .map(|(i, &rays)| RivalPoint { rays, wall_ms: spread(&rival_walls[i]), error: truth.error(&found[i]) })
        .collect();
    let rays_at_equal_rms =
        crossing(&rival.iter().map(|p| (f64::from(p.rays), p.error.rms)).collect::<Vec<_>>(), merge_error.rms);
    let (frame_wall_ms, merge_ms) = (spread(&walls), spread(&merges));
    let times: Vec<(f64, f64)> = rival.iter().map(|p| (f64::from(p.rays), p.wall_ms.median)).collect();
    let rival_ms = rays_at_equal_rms.map(|rays| along(&times, rays));
    (bench.progress)(&format!("{}: merge against ray casting measured", case.name));
    Ok(Comparison {
        case: case.name.clone(),
        light: case.light.clone(),
        vertices,
        threads: rayon::current_num_threads(),
        merge_error,
        rival_ms_at_equal_rms: rival_ms,
        rays_at_equal_rms,
        speed_up_at_equal_rms: rival_ms.map(|ms| ms / frame_wall_ms.median),
        merge_speed_up_at_equal_rms: rival_ms.map(|ms| ms / merge_ms.median),
        frame_wall_ms,
        merge_ms,
        rival,
    })
}
