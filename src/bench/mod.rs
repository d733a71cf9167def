//! Measurements behind the figures in the documentation: what a picture's error is made of, what run time buys, and
//! what keeps the numbers bounded. `docs/measured.md` has the results.

// Fields of rows of results are keys of JSON; what their names say needs no comment.
#![allow(missing_docs)]

pub mod budget;
pub mod cases;
pub mod ceilings;
pub mod figures;
pub mod judged;
pub mod profile;
pub mod rival;
pub mod scaling;
pub mod skips;
pub mod stability;
pub mod time_error;
pub mod town;

use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::bounce::Bounces;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::gpu::Timing;
use crate::scene::Scene;

/// Shared input of all measurements.
#[derive(Clone)]
pub struct Bench<'b> {
    /// Baker on the measured device.
    pub baker: &'b Baker,
    /// Cache of baked fields and transfers.
    pub cache: &'b Cache,
    /// Receives descriptions of the current work.
    pub progress: &'b (dyn Fn(&str) + Sync),
    /// Whether to run a reduced measurement that ends within a minute on two cores.
    pub quick: bool,
    /// Seed of vertices and rays.
    pub seed: u64,
}

impl Bench<'_> {
    pub fn frame(&self, scene: &Scene, options: frame::Options) -> Result<Frame> {
        Frame::new(self.baker, self.cache, scene, options, &|what, done, all| {
            if done == all {
                (self.progress)(&format!("baked {what}"));
            }
        })
    }
}

/// Device time of the merge in milliseconds, sharp lights included.
pub fn merge_ms(timings: &[Timing]) -> f64 {
    timings.iter().filter(|t| ["merge", "sharp"].contains(&t.pass.as_str())).map(|t| t.milliseconds).sum()
}

/// The options that are measured: the program's defaults, with a picture so small that drawing costs nothing.
pub fn default_options() -> frame::Options {
    // Frames are timed at rest: each must merge everything.
    let skip = crate::lists::skip::Skip::without("unmoved");
    frame::Options {
        skip,
        size: [16, 16],
        antialias: crate::draw::Antialias::None,
        bounces: Bounces::None,
        ..frame::Options::default()
    }
}
