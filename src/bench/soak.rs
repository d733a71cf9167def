//! `bench soak`: very many frames of a small moving scene whose entities change: whether memory grows, pictures drift or frames slow.

use super::{Bench, default_options};
use crate::bake;
use crate::draw::Antialias;
use crate::error::{Error, Result};
use crate::frame::{self, Frame};
use crate::lists::skip::Skip;
use crate::scene::Scene;
use crate::text::write;
use glam::Vec3;
use serde::Serialize;
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// Edge of the pictures in pixels.
const SIZE_PX: u32 = 64;
/// Moments of the scene's period, and states of its entities; each pair is seen again and again.
const MOMENTS: u64 = 24;
const STATES: u64 = 4;
/// Frames between two states.
const STATE_FRAMES: u64 = 7;
/// Share of the frames that may still take memory and time for the first time.
const WARM_UP: f64 = 0.2;
/// Largest growth of the process's memory after that.
pub const MOST_GROWTH: f64 = 0.02;
/// Tenths of all frames that follow the warm-up.
pub const TENTHS: usize = 8;
/// Largest slowdown of the quicker frames from the first two tenths after that to the last two. A machine changes its own speed by 1.4.
pub const MOST_SLOWDOWN: f64 = 1.5;

const SCENE: &str = r#"
[camera]
eye = [0, 1.5, 4]
target = [0, 0, 0]
[environment]
gradient = { radiance = [0.3, 0.35, 0.4] }
[[mesh]]
name = "floor"
plane = { size_m = 4, cells = 12 }
[[mesh]]
name = "ball"
sphere = { radius_m = 0.5, subdivisions = 2 }
[[mesh]]
name = "ring"
torus = { major_m = 0.5, minor_m = 0.15, segments = 16, sides = 8 }
[[entity]]
mesh = "floor"
position = [0, -0.6, 0]
[[entity]]
mesh = "ball"
position = [-0.8, 0, 0]
motion = [{ bob = { amplitude_m = 0.2, period_s = 4 } }]
[[entity]]
mesh = "ring"
position = [0.6, 0, 0]
motion = [{ spin = { axis = [1, 1, 0], period_s = 4 } }]
[[entity]]
mesh = "ball"
position = [0, 1.2, 1]
scale = 0.3
emission = [30, 24, 12]
motion = [{ orbit = { centre = [0, 1.2, 0], period_s = 4 } }]
"#;
const PERIOD_S: f64 = 4.0;

/// What was measured.
#[derive(Clone, Debug, Serialize)]
pub struct SoakOutcome {
    /// Frames drawn.
    pub frames: u64,
    /// Seconds that they took.
    pub seconds: f64,
    /// Memory of the process in bytes when the warm-up ended, and the most after it; `None` where the system does not say.
    pub memory_bytes: Option<[u64; 2]>,
    /// Pictures that were compared with the first of the same moment and state.
    pub compared: u64,
    /// Compared pictures that were not the same to the bit.
    pub differing: u64,
    /// Milliseconds of the quicker frames (the tenth percentile) in each tenth of all frames after the warm-up.
    pub quicker_ms: [f64; TENTHS],
}

impl SoakOutcome {
    /// What is wrong, a line each.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if let Some([before, most]) = self.memory_bytes
            && most as f64 > before as f64 * (1.0 + MOST_GROWTH)
        {
            faults.push(format!("memory grew from {before} to {most} bytes after the warm-up"));
        }
        if self.differing > 0 || self.compared == 0 {
            faults.push(format!("{} of {} pictures of the same moment differ", self.differing, self.compared));
        }
        let [a, b, .., y, z] = self.quicker_ms;
        let (first, last) = (a.min(b), y.min(z));
        if last > first * MOST_SLOWDOWN {
            faults.push(format!("frames slowed from {first:.2} to {last:.2} ms"));
        }
        faults
    }
}

/// Draws `frames` frames and writes what was seen as `soak.json` into a folder, if one is given.
///
/// # Errors
/// As [`Frame::new`] and [`Frame::render`]; `Failed` when the file cannot be written.
pub fn run(bench: &Bench<'_>, frames: u64, out: Option<&Path>) -> Result<SoakOutcome> {
    let scene = Scene::parse(SCENE, Path::new("soak.toml"), &crate::asset::embedded::read)?;
    let options = frame::Options {
        bake: bake::Options { lattice: "cube:6x4".parse().map_err(Error::Failed)?, face_px: 16, ..Default::default() },
        skip: Skip::ALL,
        size: [SIZE_PX; 2],
        antialias: Antialias::Outlines,
        ..default_options()
    };
    let states = (0..STATES).map(|state| changed(&scene, state)).collect::<Vec<_>>();
    let mut frame = bench.frame(&scene, options)?;
    let outcome = soak(&mut frame, &states, frames, bench.progress)?;
    if let Some(folder) = out {
        let report = json!({ "origin": bench.origin, "outcome": outcome, "faults": outcome.faults() });
        write(&folder.join("soak.json"), format!("{report:#}\n"))?;
    }
    Ok(outcome)
}

/// The scene in one of its states: other colours, a lamp that is brighter, goes out or casts shadows instead.
fn changed(scene: &Scene, state: u64) -> Scene {
    let mut scene = scene.clone();
    let mut ball = scene.data.entities[1].clone();
    ball.albedo = Vec3::new(0.7, 0.7 - 0.15 * state as f32, 0.3);
    scene.put_entity(1, ball);
    let mut lamp = scene.data.entities[3].clone();
    match state {
        0 => {}
        1 => lamp.emission *= 2.0,
        2 => (lamp.emission, lamp.emits, lamp.occludes) = (Vec3::ZERO, Some(false), Some(true)),
        _ => lamp.scale = 0.2,
    }
    scene.put_entity(3, lamp);
    scene
}

fn soak(frame: &mut Frame, states: &[Scene], frames: u64, progress: &dyn Fn(&str)) -> Result<SoakOutcome> {
    let start = Instant::now();
    let warm_up = ((frames as f64 * WARM_UP) as u64).max(2 * MOMENTS * STATES * STATE_FRAMES);
    let mut first: Vec<Option<Vec<f32>>> = vec![None; (MOMENTS * STATES) as usize];
    let (mut memory, mut compared, mut differing) = (None, 0, 0);
    // Filled here, so that its memory does not seem to grow with the frames.
    let mut times = vec![f32::INFINITY; frames.saturating_sub(warm_up) as usize];
    for index in 0..frames {
        let (moment, state) = (index % MOMENTS, index / STATE_FRAMES % STATES);
        let began = Instant::now();
        if index % STATE_FRAMES == 0 {
            frame.set_scene(&states[state as usize])?;
        }
        let placements = states[state as usize].at(moment as f64 * PERIOD_S / MOMENTS as f64);
        frame.render(&placements, Some(1.0))?;
        let picture = frame.picture();
        if index >= warm_up {
            times[(index - warm_up) as usize] = began.elapsed().as_secs_f32() * 1e3;
        }
        match &first[(moment * STATES + state) as usize] {
            None => first[(moment * STATES + state) as usize] = Some(picture),
            Some(known) => {
                compared += 1;
                differing += u64::from(*known != picture);
            }
        }
        if index >= warm_up && index % 256 == 0 {
            let now = resident_bytes();
            memory = now.map(|now| memory.map_or([now, now], |[before, most]: [u64; 2]| [before, most.max(now)]));
        }
        if index > 0 && index % 10_000 == 0 {
            progress(&format!("{index} of {frames} frames, {differing} differ, {:?} bytes", memory.map(|m| m[1])));
        }
    }
    let length = times.len();
    let quicker_ms = std::array::from_fn(|tenth| {
        let of = &mut times[tenth * length / TENTHS..(tenth + 1) * length / TENTHS];
        of.sort_by(f32::total_cmp);
        of.get(of.len() / 10).copied().map_or(0.0, f64::from)
    });
    let seconds = start.elapsed().as_secs_f64();
    Ok(SoakOutcome { frames, seconds, memory_bytes: memory, compared, differing, quicker_ms })
}

/// Memory of this process that is in use, where the system says it.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(1024 * line.split_whitespace().next()?.parse::<u64>().ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_drift_and_slowing_are_faults() {
        let good = SoakOutcome {
            frames: 9,
            seconds: 1.0,
            memory_bytes: Some([1000, 1019]),
            compared: 5,
            differing: 0,
            quicker_ms: [1.2, 1.0, 9.0, 9.0, 9.0, 9.0, 9.0, 1.4],
        };
        assert_eq!(good.faults(), [""; 0]);
        assert_eq!(SoakOutcome { memory_bytes: None, ..good.clone() }.faults(), [""; 0]);
        for (bad, word) in [
            (SoakOutcome { memory_bytes: Some([1000, 1021]), ..good.clone() }, "memory"),
            (SoakOutcome { differing: 1, ..good.clone() }, "1 of 5"),
            (SoakOutcome { compared: 0, ..good.clone() }, "0 of 0"),
            (SoakOutcome { quicker_ms: [1.0, 9.0, 1.0, 1.0, 1.0, 1.0, 1.7, 1.6], ..good.clone() }, "slowed"),
        ] {
            let faults = bad.faults();
            assert!(faults.len() == 1 && faults[0].contains(word), "{faults:?}");
        }
    }
}
