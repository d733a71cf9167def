//! Where time goes: the merge in each of its variants and the draw, against what the device can do at best.

use super::Bench;
use super::ceilings::Ceilings;
use super::figures::{Spread, spread};
use crate::draw::Antialias;
use crate::error::{Error, Result};
use crate::frame::{self, Frame, RenderOptions};
use crate::gpu::census;
use crate::merge::variant::Variant;
use crate::merge::workload::Workload;
use crate::scene::{Lights, Scene};
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Instant;

/// One variant of one pass.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ProfileRow {
    /// Scene, or vertices and occluders of the made-up merge.
    pub case: String,
    /// A pass of a frame, or "frame": from placements to the picture on the device, by the host's clock.
    pub pass: String,
    /// Of the merge its variant, of passes of pictures how their edges are smoothed.
    pub variant: String,
    /// Device time.
    pub ms: Spread,
    /// Nanoseconds a pair of vertex and occluder. Only merges have this and the values below, and only where the time
    /// is not mostly that of starting a dispatch (see [`Ceilings::resolve`]).
    pub ns_a_pair: Option<f64>,
    /// Float multiplications and additions a pair, counted in the SPIR-V of the loop's body.
    pub flops: Option<u32>,
    /// Multiplications and additions reached, in 10^9 a second.
    pub gflops: Option<f64>,
    /// Time that the arithmetic alone would take at the device's ceiling, as a share of the time taken.
    pub arithmetic_share: Option<f64>,
}

impl ProfileRow {
    /// A pass whose work is not counted.
    fn timed(case: &str, pass: &str, variant: &str, times: &[f64]) -> Self {
        ProfileRow {
            case: case.to_owned(),
            pass: pass.to_owned(),
            variant: variant.to_owned(),
            ms: spread(times),
            ..ProfileRow::default()
        }
    }

    /// A merge of so many pairs of vertex and occluder.
    fn merge(case: &str, variant: &str, times: &[f64], pairs: u64, flops: u32, at_best: &Ceilings) -> Self {
        let row = ProfileRow::timed(case, "merge", variant, times);
        // Per pair: one a nanosecond is 10^9 a second.
        let ns = row.ms.median * 1e6 / pairs.max(1) as f64;
        let gflops = f64::from(flops) / ns;
        // Rates are unknown where a scene has few vertices.
        let rate = |value: f64| (at_best.resolve(row.ms.median) && pairs > 0).then_some(value);
        ProfileRow {
            ns_a_pair: rate(ns),
            flops: Some(flops),
            gflops: rate(gflops),
            arithmetic_share: rate(gflops / at_best.gflops),
            ..row
        }
    }
}

/// Times made-up merges in turns, after one run each to warm up.
pub fn made_up(
    bench: &Bench<'_>,
    workload: &Workload,
    chosen: &[Variant],
    runs: u32,
    at_best: &Ceilings,
) -> Result<Vec<ProfileRow>> {
    let library = bench.baker.library();
    let case = format!("{} x {}", workload.vertex_count, workload.occluder_count);
    let mut rows = Vec::new();
    for (variant, times) in chosen.iter().zip(workload.time(library, chosen, runs)?) {
        let times = times.ok_or_else(|| Error::Failed(format!("the driver does not compile {}", variant.name)))?;
        let flops = census::flops(&library.unrolled(&workload.permutation(*variant).row())?)?;
        rows.push(ProfileRow::merge(&case, variant.name, &times, workload.pairs(), flops, at_best));
    }
    Ok(rows)
}

/// Times a scene that moves: its merge in each variant, in turns, everything merged in every frame; then all passes of
/// frames as a window shows them, with each way to smooth edges.
pub fn scene(
    bench: &Bench<'_>,
    name: &str,
    scene: &Scene,
    size: [u32; 2],
    chosen: &[Variant],
    runs: u32,
    at_best: &Ceilings,
) -> Result<Vec<ProfileRow>> {
    let in_bands = frame::Options { lights: Lights::Sh, ..super::default_options() };
    let mut merges = Vec::new();
    for &variant in chosen {
        // A pair of the merge is one of harmonics, so all lights are in bands here.
        match bench.frame(scene, frame::Options { variant: Some(variant), ..in_bands }) {
            Ok(frame) => merges.push((variant, frame, Vec::new())),
            // Frames have the shadows of hundreds of different things from outlines, which are smaller.
            Err(Error::Input(why)) => {
                (bench.progress)(&format!("merges in bands are not timed: {why}"));
                break;
            }
            Err(error) => return Err(error),
        }
    }
    for run in 0..=runs {
        let placements = scene.at(f64::from(run) / 30.0);
        for (_, frame, times) in &mut merges {
            let passes = frame.render(&placements, None)?;
            if run > 0 {
                times.extend(passes.iter().filter(|timed| timed.pass == "merge").map(|timed| timed.milliseconds));
            }
        }
    }
    let mut rows = Vec::new();
    for (variant, frame, times) in &merges {
        let flops = census::flops(&bench.baker.library().unrolled(&frame.permutation().row())?)?;
        let pairs = 64 * frame.merged().merged_entries as u64;
        rows.push(ProfileRow::merge(name, variant.name, times, pairs, flops, at_best));
    }
    let shown = RenderOptions { size: Some(size), skip: in_bands.skip, ..RenderOptions::default() };
    let mut frame = bench.frame(scene, shown.frame(scene)?)?;
    let ways = [Antialias::Samples, Antialias::Outlines, Antialias::None];
    for (antialias, way) in ways.into_iter().zip(["4 samples", "1 sample, outlines", "1 sample"]) {
        let times = frame_times(&mut frame, scene, antialias, runs)?;
        rows.extend(times.iter().map(|(pass, times)| ProfileRow::timed(name, pass, way, times)));
    }
    Ok(rows)
}

/// Times of frames of a scene that moves, as a window shows them, in milliseconds: device time of every pass, and "frame"
/// by the host's clock. Two frames before these warm up.
pub fn frame_times(
    frame: &mut Frame,
    scene: &Scene,
    antialias: Antialias,
    frames: u32,
) -> Result<BTreeMap<String, Vec<f64>>> {
    const WARM_UP: u32 = 2;
    frame.set_antialias(antialias)?;
    let mut times: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for index in 0..WARM_UP + frames {
        let placements = scene.at(f64::from(index) / 30.0);
        let started = Instant::now();
        let passes = frame.show(&placements, scene.data.output.white())?;
        let wall_ms = started.elapsed().as_secs_f64() * 1e3;
        if index >= WARM_UP {
            times.entry("frame".to_owned()).or_default().push(wall_ms);
            for timed in passes {
                times.entry(timed.pass).or_default().push(timed.milliseconds);
            }
        }
    }
    Ok(times)
}
