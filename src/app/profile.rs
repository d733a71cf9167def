//! `shadow-fields profile`
use super::context::Context;
use super::{Global, output};
use crate::error::Result;
use crate::render::merge::Merge;
use crate::render::variant::{VARIANTS, Variant};
use crate::render::workload::Workload;
use clap::Args;

/// Arguments of `profile`.
#[derive(Args)]
pub struct Arguments {
    /// Vertices
    #[arg(long, default_value_t = 65536)]
    grid: u32,
    /// Occluders
    #[arg(long, default_value_t = 4)]
    occluders: u32,
    /// One variant
    #[arg(long, value_parser = Variant::named)]
    variant: Option<Variant>,
    /// Runs
    #[arg(long, default_value_t = 20)]
    runs: u32,
}

/// Profiles.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let context = Context::new(global)?;
    let workload = Workload::new(&context.device, arguments.grid, arguments.occluders)?;
    let mut all = Vec::new();
    for &v in VARIANTS.iter().filter(|v| arguments.variant.is_none_or(|w| w == **v)) {
        let merge = Merge::new(&context.device, context.baker.library(), workload.form(v))?;
        all.push((v, merge, workload.inputs(v)?, vec![]));
    }
    for run in 0..=arguments.runs {
        for (_, merge, inputs, times) in &mut all {
            let ms = workload.run(merge, inputs)?;
            if run > 0 {
                times.push(ms)
            }
        }
    }
    for (v, _, _, times) in &mut all {
        times.sort_by(f64::total_cmp);
        let m = output::median(times);
        output::say(format!(
            "{:24} {:8.2} ms  p10 {:8.2} p90 {:8.2}  {:6.1} ns/pair",
            v.name,
            m,
            times[times.len() / 10],
            times[times.len() * 9 / 10],
            m * 1e6 / workload.pairs() as f64
        ));
    }
    context.finish()
}
