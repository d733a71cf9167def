//! What the measurements of `bench` have in common.

use crate::app::context::Context;
use crate::app::{Global, output};
use crate::bench::Bench;
use crate::error::Result;
use std::time::Instant;

/// Opens the device, measures with progress on stderr, and hands both back.
pub fn start<T>(global: &Global, quick: bool, measure: impl FnOnce(&Bench<'_>) -> Result<T>) -> Result<(Context, T)> {
    let context = Context::new(global)?;
    let started = Instant::now();
    let show = |what: &str| {
        if !global.no_progress {
            output::note(global, format!("{:6.1} s  {what}", started.elapsed().as_secs_f64()));
        }
    };
    let outcome = measure(&bench(&context, global, quick, &show))?;
    Ok((context, outcome))
}

/// What measurements need of an open device.
pub fn bench<'b>(context: &'b Context, global: &Global, quick: bool, progress: &'b dyn Fn(&str)) -> Bench<'b> {
    let origin = context.origin(global);
    Bench { baker: &context.baker, cache: &context.cache, progress, quick, seed: global.seed, origin }
}
