//! Cost and error of the choices in bake and merge, one axis at a time round the default.

use super::budget::{Truth, device_radiosity};
use super::cases::Case;
use super::figures::{Radiosity, Spread, VertexDifference, difference, spread};
use super::{Bench, default_options};
use crate::error::Result;
use crate::field::{Lattice, Storage};
use crate::frame::{self, Frame};
use crate::gpu::Timing;
use crate::scene::{Lights, Placement};
use serde::Serialize;
use std::time::Instant;

/// Frames that are thrown away before any is timed, the first dispatch apart.
const WARM_UP: usize = 2;

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
    /// Device time of the first merge, shader compilation by the driver included, milliseconds.
    pub first_merge_ms: f64,
    /// Device time of the merge pass, milliseconds.
    pub merge_ms: Spread,
    /// Merge time over that of the default in the same round: median over rounds.
    #[serde(rename = "time_per_default_ratio")]
    pub time_per_default: f64,
    /// T0 to T3.
    pub total: VertexDifference,
    /// T1 (of 4 bands) to T3.
    pub below_bands: VertexDifference,
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
        add_bands(&mut add);
        add_sets(&mut add);
    }
    all
}

/// Takes an axis, a name, and the change from the default.
type Add<'a> = dyn FnMut(&'static str, &str, &dyn Fn(&mut frame::Options)) + 'a;

fn lattice(text: &str) -> Lattice {
    text.parse().expect("a lattice in the table")
}

/// Other numbers of bands, of everything and of stored visibility alone.
fn add_bands(add: &mut Add<'_>) {
    for bands in [3, 5, 6] {
        add("bands", &format!("{bands} bands"), &|o| o.bake.bands = bands);
    }
    for bands in [5, 6, 7] {
        add("stored bands", &format!("{bands} of visibility"), &|o| o.bake.field_bands = Some(bands));
    }
    add("stored bands", "3 of transfer, 4 of visibility", &|o| (o.bake.bands, o.bake.field_bands) = (3, Some(4)));
}

/// Settings that change together.
fn add_sets(add: &mut Add<'_>) {
    add("together", "small: cube:8x5, 16 px", &|o| (o.bake.lattice, o.bake.face_px) = (lattice("cube:8x5"), 16));
    add("together", "fine: cube:24x9,edges=auto, f32, 128 px", &|o| {
        (o.bake.lattice, o.bake.storage, o.bake.face_px) = (lattice("cube:24x9,edges=auto"), Storage::F32, 128);
    });
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

/// Raw numbers of one variation.
struct Measured {
    field_bytes: u64,
    bake_ms: Option<f64>,
    first_merge_ms: f64,
    times_ms: Vec<f64>,
    found: Vec<Radiosity>,
}

pub fn sweep(bench: &Bench<'_>, case: &Case, truth: &Truth, variations: &[Variation]) -> Result<Vec<Point>> {
    let measured = by_device(bench, case, truth, variations)?;
    let default_ms = measured[0].times_ms.clone();
    let point = |(variation, m): (&Variation, Measured)| {
        let merge_ms = spread(&m.times_ms);
        let ratios: Vec<f64> = m.times_ms.iter().zip(&default_ms).map(|(t, default)| t / default).collect();
        Point {
            case: case.name.clone(),
            axis: variation.axis,
            name: variation.name.clone(),
            field_bytes: m.field_bytes,
            bake_ms: m.bake_ms,
            first_merge_ms: m.first_merge_ms,
            time_per_default: spread(&ratios).median,
            merge_ms,
            total: truth.error(&m.found),
            below_bands: difference(&m.found, &truth.t1, truth.unit),
        }
    };
    Ok(variations.iter().zip(measured).map(point).collect())
}

fn by_device(bench: &Bench<'_>, case: &Case, truth: &Truth, variations: &[Variation]) -> Result<Vec<Measured>> {
    let placements = case.scene.at(case.time_s);
    let mut frames = Vec::new();
    let mut first = Vec::new();
    for variation in variations {
        let started = Instant::now();
        let mut frame = bench.frame(&case.scene, variation.options)?;
        first.push(merge_ms(&frame.render(&placements, None)?));
        frames.push(frame);
        let seconds = started.elapsed().as_secs_f64();
        (bench.progress)(&format!("{}: {} {} prepared in {seconds:.1} s", case.name, variation.axis, variation.name));
    }
    let times = interleaved(&mut frames, &placements, if bench.quick { 15 } else { 31 })?;
    let measured = frames.iter().zip(first).zip(times).map(|((frame, first_merge_ms), times_ms)| {
        let baked = &frame.buffers.baked;
        let bake_ms = baked.iter().map(|b| b.report.capture_ms + b.report.project_ms + b.report.assemble_ms);
        Ok(Measured {
            field_bytes: frame.buffers.fields.size_bytes,
            bake_ms: (!baked.is_empty()).then(|| bake_ms.sum()),
            first_merge_ms,
            times_ms,
            found: device_radiosity(frame, &truth.vertices)?,
        })
    });
    measured.collect()
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
