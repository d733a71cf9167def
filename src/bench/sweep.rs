//! Cost and error of the choices in bake and merge, one axis at a time round the default.

use super::budget::{Truth, device_radiosity};
use super::cases::Case;
use super::figures::{Spread, VertexDifference, spread};
use super::{Bench, default_options};
use crate::error::Result;
use crate::field::{Lattice, Storage};
use crate::frame::{self, Frame};
use crate::gpu::Timing;
use crate::scene::{Lights, Placement};
use serde::Serialize;
use std::time::Instant;

/// Frames before any is timed; the first one compiles.
const WARM_UP: usize = 3;

/// One setting that is measured.
pub struct Variation {
    pub axis: &'static str,
    pub name: String,
    pub options: frame::Options,
}

/// The measurement of a variation.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Scene and light.
    pub case: String,
    pub axis: &'static str,
    pub name: String,
    /// Bytes of all fields of the scene.
    pub field_bytes: u64,
    /// Device time of the bakes, milliseconds; none where all was in the cache.
    pub bake_ms: Option<f64>,
    /// Device time of the merge pass, milliseconds.
    pub merge_ms: Spread,
    /// Merge time over that of the default in the same round: median over rounds.
    #[serde(rename = "time_per_default_ratio")]
    pub time_per_default: f64,
    /// T0 to T3.
    pub total: VertexDifference,
}

/// The lattices that are swept; a quick sweep takes the first two.
const LATTICES: [&str; 10] = [
    "cube:8x5",
    "cube:16x3",
    "cube:16x5",
    "cube:12x7",
    "cube:16x7",
    "cube:18x7,edges=auto",
    "cube:22x9,edges=auto",
    "cube:16x11",
    "cube:24x9,edges=auto",
    "cube:32x11",
];

/// The settings, the default first.
pub fn variations(quick: bool) -> Vec<Variation> {
    let base = default_options();
    let mut all = vec![Variation { axis: "default", name: base.bake.lattice.to_string(), options: base }];
    let mut add = |axis, name: &str, change: &dyn Fn(&mut frame::Options)| {
        let mut options = base;
        change(&mut options);
        all.push(Variation { axis, name: name.to_owned(), options });
    };
    add("lights", "sh", &|o| o.lights = Lights::Sh);
    add("storage", "f32", &|o| o.bake.storage = Storage::F32);
    for text in &LATTICES[..if quick { 2 } else { LATTICES.len() }] {
        add("lattice", text, &|o| o.bake.lattice = lattice(text));
    }
    let faces: &[u32] = if quick { &[16] } else { &[8, 16, 32, 128] };
    for &face_px in faces {
        add("face", &format!("{face_px} px"), &|o| o.bake.face_px = face_px);
    }
    if !quick {
        for bands in [3, 5, 6] {
            add("bands", &format!("{bands} bands"), &|o| o.bake.bands = bands);
        }
        add("together", "small: cube:8x5, 16 px", &|o| {
            o.bake.lattice = lattice("cube:8x5");
            o.bake.face_px = 16;
        });
        add("together", "fine: cube:24x9,edges=auto, f32, 128 px", &|o| {
            o.bake.lattice = lattice("cube:24x9,edges=auto");
            o.bake.storage = Storage::F32;
            o.bake.face_px = 128;
        });
    }
    all
}

fn lattice(text: &str) -> Lattice {
    text.parse().expect("a lattice in the table")
}

/// Device time of the merge in milliseconds, sharp lights included.
pub fn merge_ms(timings: &[Timing]) -> f64 {
    timings.iter().filter(|t| ["merge", "sharp"].contains(&t.pass.as_str())).map(|t| t.milliseconds).sum()
}

/// Renders one frame after another in rounds, so that whatever else the machine does meets all alike: merge times in
/// milliseconds, by frame and round.
pub fn interleaved(frames: &mut [Frame], placements: &[Placement], rounds: usize) -> Result<Vec<Vec<f64>>> {
    let mut times = vec![Vec::with_capacity(rounds); frames.len()];
    for round in 0..WARM_UP + rounds {
        for (frame, times) in frames.iter_mut().zip(&mut times) {
            // Nothing moves: a frame would not be merged again.
            frame.forget();
            let took = merge_ms(&frame.render(placements, None)?);
            if round >= WARM_UP {
                times.push(took);
            }
        }
    }
    Ok(times)
}

/// Measures all variations in turns; the first of them is the default.
pub fn sweep(bench: &Bench<'_>, case: &Case, truth: &Truth, variations: &[Variation]) -> Result<Vec<Point>> {
    let placements = case.scene.at(case.time_s);
    let mut frames = Vec::new();
    for variation in variations {
        let started = Instant::now();
        frames.push(bench.frame(&case.scene, variation.options)?);
        let seconds = started.elapsed().as_secs_f64();
        (bench.progress)(&format!("{}: {} {} prepared in {seconds:.1} s", case.name, variation.axis, variation.name));
    }
    let times_ms = interleaved(&mut frames, &placements, if bench.quick { 15 } else { 31 })?;
    let mut points = Vec::new();
    for (index, (variation, frame)) in variations.iter().zip(&frames).enumerate() {
        let baked = &frame.buffers.baked;
        let bake_ms = baked.iter().map(|b| b.report.capture_ms + b.report.project_ms + b.report.assemble_ms);
        let ratios: Vec<f64> = times_ms[index].iter().zip(&times_ms[0]).map(|(t, default)| t / default).collect();
        let found = device_radiosity(frame, &truth.vertices)?;
        points.push(Point {
            case: case.name.clone(),
            axis: variation.axis,
            name: variation.name.clone(),
            field_bytes: frame.buffers.fields.size_bytes,
            bake_ms: (!baked.is_empty()).then(|| bake_ms.sum()),
            merge_ms: spread(&times_ms[index]),
            time_per_default: spread(&ratios).median,
            total: truth.error(&found),
        });
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variation_can_be_baked_and_differs_from_the_default() {
        for quick in [true, false] {
            let all = variations(quick);
            assert_eq!(all[0].axis, "default");
            for variation in &all[1..] {
                variation.options.bake.lattice.validate().unwrap();
                assert_ne!(
                    format!("{:?}", variation.options),
                    format!("{:?}", all[0].options),
                    "{} {}",
                    variation.axis,
                    variation.name
                );
            }
        }
    }
}
