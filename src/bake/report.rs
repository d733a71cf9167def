//! What a bake did, and where its time went.

use serde::Serialize;
use std::time::Duration;

/// Where the time of a bake went.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BakeReport {
    /// Number of samples that stand at their own place, or of maps of a silhouette field.
    pub samples: u32,
    /// Number of these that were not captured but turned from others (see [`super::symmetric_samples`] and [`super::symmetric_maps`]).
    pub turned: u32,
    /// Number of cube faces that were drawn: six for each captured sample where none is left out.
    pub faces: u32,
    /// Number of triangles that were drawn, each as often as faces showed it.
    pub triangles: u64,
    /// Number of samples inside the solid. They were captured off the nearest surface or, if that sees nothing, filled from neighbours.
    pub filled: u32,
    /// Device time in capture passes, in ms.
    pub capture_ms: f64,
    /// Device time in the passes that reduce faces, project or self_visibility, in ms.
    pub project_ms: f64,
    /// Device time in the assemble pass, in ms.
    pub assemble_ms: f64,
    /// Wall time of the whole bake.
    pub total: Duration,
}

impl BakeReport {
    pub(super) fn add(&mut self, timings: &[crate::gpu::Timing]) {
        for timing in timings {
            match timing.pass.as_str() {
                "capture" => self.capture_ms += timing.milliseconds,
                "project" | "self_visibility" => self.project_ms += timing.milliseconds,
                _ => self.assemble_ms += timing.milliseconds,
            }
        }
    }
}
