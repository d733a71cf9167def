//! Comparison with the alternative to shadow fields: soft shadows per vertex by ray casting on all CPU threads.
//!
//! The rival is [`RayCast`] in one run. It uses an 8-wide hierarchy per mesh behind a bounding sphere test, scrambled Sobol points,
//! cosine sampling of the sky and cone sampling of local lights, and leaves out occluders that cannot lie between vertex and light.
//! Rays stop at the light's surface; where along a ray that is, is asked only where an occluder lies beside the light.
//! Its hierarchies are built beforehand, as fields are baked beforehand.

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

/// Ray casting with one number of rays.
#[derive(Clone, Debug, Serialize)]
pub struct RivalPoint {
    /// Rays per vertex for the sky and for each light.
    #[serde(rename = "ray_count")]
    pub rays: u32,
    /// Wall time for all lit vertices, scaled from the compared ones, milliseconds.
    pub wall_ms: Spread,
    /// Difference to T0.
    pub error: Difference,
}

/// Merge and ray casting on one case.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Scene and light.
    pub case: String,
    /// What lights it, in words.
    pub light: String,
    /// Lit vertices.
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// Threads of the ray caster.
    #[serde(rename = "thread_count")]
    pub threads: usize,
    /// Wall time of a frame of the merge without drawing, milliseconds.
    pub frame_wall_ms: Spread,
    /// Device time of the merge in it, milliseconds.
    pub merge_ms: Spread,
    /// Error of the merge against T0.
    pub merge_error: Difference,
    /// Ray casting with increasing numbers of rays.
    pub rival: Vec<RivalPoint>,
    /// Wall time in which ray casting reaches the merge's root mean square error, milliseconds: interpolated, extrapolated, or the
    /// time of one ray if that already has a smaller error.
    pub rival_ms_at_equal_rms: Option<f64>,
    /// Number of rays at which it reaches that error.
    #[serde(rename = "rays_at_equal_rms_count")]
    pub rays_at_equal_rms: Option<f64>,
    /// Ratio of that wall time to a frame of the merge.
    #[serde(rename = "speed_up_at_equal_rms_ratio")]
    pub speed_up_at_equal_rms: Option<f64>,
    /// Ratio of that wall time to the merge's device time, without lists, uploads and waiting.
    #[serde(rename = "merge_speed_up_at_equal_rms_ratio")]
    pub merge_speed_up_at_equal_rms: Option<f64>,
}

impl Comparison {
    /// Name of the case with its light, unless the name contains it.
    pub fn title(&self) -> String {
        if self.case.contains(", (") { self.case.clone() } else { format!("{} ({})", self.case, self.light) }
    }
}

/// Measures merge and ray casting in turns.
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
        // The first frame after ray casting warms up threads and caches.
        for warm in [false, true, true, true] {
            // Everything is merged, as if all entities had moved.
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
            let cast = RayCast { rays, runs: 1, seed: bench.seed + 77, distant: case.distant, ..Default::default() };
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
