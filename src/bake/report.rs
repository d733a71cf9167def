//! What a bake did, and where its time went.

use serde::Serialize;
use std::time::Duration;

/// Where the time of a bake went.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BakeReport {
    /// Samples that stand at their own place.
    pub samples: u32,
    /// Of these, samples that were not captured but turned from others (see [`super::symmetric_samples`]).
    pub turned: u32,
    /// Cube faces that were drawn; six a captured sample where none is left out.
    pub faces: u32,
    /// Samples inside the solid, captured off the nearest surface or, where that sees nothing, filled from neighbours.
    pub filled: u32,
    /// Device time in capture passes.
    pub capture_ms: f64,
    /// Device time in project passes.
    pub project_ms: f64,
    /// Device time in the assemble pass.
    pub assemble_ms: f64,
    /// Wall time of the whole bake.
    pub total: Duration,
}

impl BakeReport {
    pub(super) fn add(&mut self, timings: &[crate::gpu::Timing]) {
        for timing in timings {
            match timing.pass.as_str() {
                "capture" => self.capture_ms += timing.milliseconds,
                "project" => self.project_ms += timing.milliseconds,
                _ => self.assemble_ms += timing.milliseconds,
            }
        }
    }
}
