//! Where time goes: the merge in each of its variants and the draw, against what the device can do at best.

use super::Bench;
use super::ceilings::Ceilings;
use super::figures::quantiles;
use crate::asset::Mesh;
use crate::bake;
use crate::bake::surfaces::GroupPlan;
use crate::draw::{Antialias, Finish};
use crate::error::Result;
use crate::field::FieldKind;
use crate::frame::{self, Frame};
use crate::gpu::census::Census;
use crate::merge::Merge;
use crate::merge::variant::{MergePermutation, Variant};
use crate::merge::workload::Workload;
use crate::scene::{Lights, Scene};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// Median, and the values below and above which a tenth of all lies.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Tenths {
    /// A tenth of the values lies below it.
    pub p10: f64,
    /// The middle value.
    pub median: f64,
    /// A tenth of the values lies above it.
    pub p90: f64,
}

impl Tenths {
    /// The spread of some values; all are 0 where there are none.
    pub fn new(values: &[f64]) -> Self {
        let [p10, median, p90] = quantiles(values, [0.1, 0.5, 0.9]);
        Tenths { p10, median, p90 }
    }
}

/// Work of a merge for a pair of vertex and occluder, counted in the SPIR-V of the loop's body.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Work {
    /// Float multiplications and additions.
    pub flops: u32,
    /// Texels fetched, and samples taken by a sampler.
    pub fetches: u32,
    /// Bytes fetched and loaded.
    pub bytes: u32,
}

/// One variant of one pass.
#[derive(Clone, Debug, Serialize)]
pub struct ProfileRow {
    /// Scene, or vertices and occluders of the made-up merge.
    pub case: String,
    /// A pass of a frame, or "frame": from placements to the picture on the device, by the host's clock.
    pub pass: String,
    pub variant: String,
    /// Device time.
    pub ms: Tenths,
    /// Nanoseconds a pair of vertex and occluder. Only merges have this and the values below, and only where the time
    /// is not mostly that of starting a dispatch (see [`Ceilings::resolve`]).
    pub ns_a_pair: Option<f64>,
    pub work: Option<Work>,
    /// Multiplications and additions reached, in 10^9 a second.
    pub gflops: Option<f64>,
    /// Bytes fetched and loaded, caches included, in 10^9 a second.
    pub gb_s: Option<f64>,
    /// Time that the arithmetic alone would take at the device's ceiling, as a share of the time taken.
    pub arithmetic_share: Option<f64>,
    /// Time that the reads alone would take at the device's ceiling, as a share of the time taken.
    pub read_share: Option<f64>,
}

fn work(permutation: &MergePermutation, census: &Census) -> Work {
    let texel = |name: &str| match name {
        "field_quads" => texel_bytes(permutation),
        "entries" => 4,
        _ => 16,
    };
    let fetched: u32 = census.fetches.iter().map(|(name, count)| count * texel(name)).sum();
    let loaded: u32 = census.block_bytes.values().sum();
    Work { flops: census.flops, fetches: census.fetch_count(), bytes: fetched + loaded }
}

fn texel_bytes(permutation: &MergePermutation) -> u32 {
    if permutation.field_format() == ash::vk::Format::R16G16B16A16_SFLOAT { 8 } else { 16 }
}

fn row(
    case: &str,
    name: &str,
    pairs: u64,
    times: &[f64],
    permutation: &MergePermutation,
    census: &Census,
    at_best: &Ceilings,
) -> ProfileRow {
    let ms = Tenths::new(times);
    let work = work(permutation, census);
    // One a nanosecond is 10^9 a second.
    let ns = ms.median * 1e6 / pairs.max(1) as f64;
    let field = census.fetches.get("field_quads").copied().unwrap_or(0);
    let field_rate = if texel_bytes(permutation) == 8 { at_best.texel_halves_giga } else { at_best.texel_packed_giga };
    let other = f64::from(work.fetches - field) / at_best.texel_packed_giga;
    let loaded: u32 = census.block_bytes.values().sum();
    let reads = f64::from(field) / field_rate + other + f64::from(loaded) / 8.0 / at_best.storage_giga;
    // Rates are unknown where a scene has few vertices.
    let rate = |value: f64| (at_best.resolve(ms.median) && pairs > 0).then_some(value);
    ProfileRow {
        case: case.to_owned(),
        pass: "merge".into(),
        variant: name.to_owned(),
        ms,
        ns_a_pair: rate(ns),
        work: Some(work),
        gflops: rate(f64::from(work.flops) / ns),
        gb_s: rate(f64::from(work.bytes) / ns),
        arithmetic_share: rate(f64::from(work.flops) / at_best.gflops / ns),
        read_share: rate(reads / ns),
    }
}

/// Times made-up merges, interleaved, after one run each to warm up. Returns a row and all times of each.
pub fn made_up(
    bench: &Bench<'_>,
    workload: &Workload,
    chosen: &[Variant],
    runs: u32,
    at_best: &Ceilings,
) -> Result<Vec<(ProfileRow, Vec<f64>)>> {
    let device = bench.baker.device();
    let library = bench.baker.library();
    let mut ready = Vec::new();
    for variant in chosen {
        let permutation = workload.permutation(*variant);
        let census = Census::new(&library.shader(&permutation.row())?)?;
        let merge = Merge::new(device, library, permutation)?;
        ready.push((variant, permutation, census, merge, workload.inputs(*variant)?, Vec::new()));
    }
    for run in 0..=runs {
        for (.., merge, inputs, times) in &mut ready {
            let milliseconds = workload.run(merge, inputs)?;
            if run > 0 {
                times.push(milliseconds);
            }
        }
    }
    let case = format!("{} x {}", workload.vertex_count, workload.occluder_count);
    let rows = ready.into_iter().map(|(variant, permutation, census, _, _, times)| {
        (row(&case, variant.name, workload.pairs(), &times, &permutation, &census, at_best), times)
    });
    Ok(rows.collect())
}

/// Times a scene's merge in each variant, in turns, everything merged in every frame while it moves; its other passes,
/// the draw and whole frames for files and for a screen, with and without multisampling. Returns a row and all times of
/// each.
pub fn scene(
    bench: &Bench<'_>,
    name: &str,
    scene: &Scene,
    size: [u32; 2],
    chosen: &[Variant],
    runs: u32,
    at_best: &Ceilings,
) -> Result<Vec<(ProfileRow, Vec<f64>)>> {
    let mut rows = Vec::new();
    let mut frames = Vec::new();
    for variant in chosen {
        let options = frame::Options {
            variant: Some(*variant),
            // A pair of the merge is one of harmonics; sharp lights are timed by themselves below.
            lights: Lights::Sh,
            size,
            ..super::default_options()
        };
        frames.push((variant, bench.frame(scene, options)?, Vec::new(), 0));
    }
    let mut others: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for run in 0..=runs {
        for (_, frame, times, pairs) in &mut frames {
            for pass in frame.render(&scene.at(f64::from(run) / 30.0), None)? {
                match pass.pass.as_str() {
                    _ if run == 0 => {}
                    "merge" => times.push(pass.milliseconds),
                    other => others.entry(other.to_owned()).or_default().push(pass.milliseconds),
                }
            }
            *pairs = 64 * frame.merged().merged_entries as u64;
        }
    }
    let sharp = bench.pass_times(scene, frame::Options { size, ..super::default_options() }, "sharp", runs)?;
    if !sharp.is_empty() {
        others.insert("sharp".into(), sharp);
    }
    for (variant, frame, times, pairs) in &frames {
        let permutation = frame.permutation();
        let census = Census::new(&bench.baker.library().shader(&permutation.row())?)?;
        rows.push((row(name, variant.name, *pairs, times, &permutation, &census, at_best), times.clone()));
    }
    let mut add = |pass: &str, variant: &str, times: Vec<f64>| rows.push((plain(name, pass, variant, &times), times));
    others.into_iter().for_each(|(pass, times)| add(&pass, "", times));
    let Some((_, frame, ..)) = frames.first_mut() else { return Ok(rows) };
    for (finish, word) in [(Finish::Display, "screen"), (Finish::Linear, "file")] {
        let ways = [Antialias::Samples, Antialias::Outlines, Antialias::None];
        for (antialias, samples) in ways.into_iter().zip(["4 samples", "1 sample, outlines", "1 sample"]) {
            frame.set_finish(finish, antialias)?;
            let [draws, walls] = frame_times(frame, scene, runs)?;
            let variant = format!("{word}, {samples}");
            add("draw", &variant, draws);
            add("frame", &variant, walls);
        }
    }
    Ok(rows)
}

/// Times of pictures while a scene moves, milliseconds: of their drawing, and of whole frames.
fn frame_times(frame: &mut Frame, scene: &Scene, runs: u32) -> Result<[Vec<f64>; 2]> {
    let mut times = [Vec::new(), Vec::new()];
    for run in 0..=runs {
        let start = Instant::now();
        let passes = frame.show(&scene.at(f64::from(run) / 30.0), 1.0)?;
        if run > 0 {
            let drawn = passes.iter().filter(|t| ["draw", "smooth"].contains(&t.pass.as_str()));
            times[0].push(drawn.map(|t| t.milliseconds).sum());
            times[1].push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    Ok(times)
}

/// Bakes a mesh's occlusion field, radiance field and transfers a few times, at most three, after a small one that
/// compiles, and times the passes: device time of all of a bake's dispatches and draws together, and "bake" by the
/// host's clock.
pub fn bake(bench: &Bench<'_>, mesh: &Mesh, runs: u32) -> Result<Vec<(ProfileRow, Vec<f64>)>> {
    let options = bake::Options::default();
    // Two shells, because an inner one alone may lie inside the solid, where nothing is captured.
    let small = bake::Options { lattice: "cube:2x1".parse().expect("a lattice"), ..options };
    let mut times: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    let field = |kind: FieldKind, options: &bake::Options| -> Result<bake::BakeReport> {
        Ok(bench.baker.field(mesh, bake::header(mesh, kind, options), &|_, _| ())?.1)
    };
    let alone = GroupPlan::alone(&Arc::new(mesh.clone()), &options, bake::Wanted::TRANSFER);
    for kind in [FieldKind::Occlusion, FieldKind::Radiance] {
        field(kind, &small)?;
    }
    for _ in 0..runs.min(3) {
        let reports = [
            ("occlusion", field(FieldKind::Occlusion, &options)?),
            ("radiance", field(FieldKind::Radiance, &options)?),
            ("transfer", alone.bake(&|_, _| ()).1),
        ];
        for (what, report) in reports {
            let mut add = |pass, ms: f64| times.entry((what, pass)).or_default().push(ms);
            // Transfer vectors are the host's work alone.
            if what != "transfer" {
                add("capture", report.capture_ms);
                add("project", report.project_ms);
                add("assemble", report.assemble_ms);
            }
            add("bake", report.total.as_secs_f64() * 1e3);
            (bench.progress)(&format!("{}: {what} baked", mesh.name));
        }
    }
    let row = |((what, pass), times): ((&str, &str), Vec<f64>)| (plain(&mesh.name, pass, what, &times), times);
    Ok(times.into_iter().map(row).collect())
}

/// A row of a pass that has a time and no rates.
fn plain(case: &str, pass: &str, variant: &str, times: &[f64]) -> ProfileRow {
    ProfileRow {
        case: case.to_owned(),
        pass: pass.to_owned(),
        variant: variant.to_owned(),
        ms: Tenths::new(times),
        ns_a_pair: None,
        work: None,
        gflops: None,
        gb_s: None,
        arithmetic_share: None,
        read_share: None,
    }
}
