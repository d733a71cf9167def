//! Thousands of frames of a small scene that moves and changes: memory, pictures and speed stay as they are.

mod common;

use common::{cache_dir, library, parse, report, shown, skip};
use glam::Vec3;
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::{self, Baker};
use shadow_fields::draw::Antialias;
use shadow_fields::frame::{self, Frame};
use shadow_fields::gpu::{Device, DeviceOptions};
use shadow_fields::lists::skip::Skip;
use shadow_fields::scene::Scene;
use std::path::Path;

const SIZE_PX: u32 = 64;
/// Moments of the scene's period, and states of its entities; each pair is seen again and again.
const MOMENTS: u64 = 24;
const STATES: u64 = 4;
/// Frames between two states.
const STATE_FRAMES: u64 = 7;
/// Share of the frames that may still take memory for the first time.
const WARM_UP: f64 = 0.2;
/// Largest growth of the process's memory after that.
const MOST_GROWTH: f64 = 0.02;

const SCENE: &str = r#"
camera = { eye = [0, 1.5, 4], target = [0, 0, 0] }
environment = { gradient = { radiance = [0.3, 0.35, 0.4] } }
mesh = [
    { name = "floor", plane = { size_m = 4, cells = 12 } },
    { name = "ball", sphere = { radius_m = 0.5, subdivisions = 2 } },
    { name = "ring", torus = { major_m = 0.5, minor_m = 0.15, segments = 16, sides = 8 } },
]
entity = [
    { mesh = "floor", position = [0, -0.6, 0] },
    { mesh = "ball", position = [-0.8, 0, 0], motion = [{ bob = { amplitude_m = 0.2, period_s = 4 } }] },
    { mesh = "ring", position = [0.6, 0, 0], motion = [{ spin = { axis = [1, 1, 0], period_s = 4 } }] },
    { mesh = "ball", position = [0, 1.2, 1], scale = 0.3, emission = [30, 24, 12], motion = [
        { orbit = { centre = [0, 1.2, 0], period_s = 4 } },
    ] },
]
"#;
const PERIOD_S: f64 = 4.0;

/// The scene in one of its states: other colours, a lamp that is brighter, goes out or casts shadows instead.
fn changed(scene: &Scene, state: u64) -> Scene {
    let mut data = scene.data.clone();
    data.entities[1].albedo = Vec3::new(0.7, 0.7 - 0.15 * state as f32, 0.3).into();
    let lamp = &mut data.entities[3];
    match state {
        0 => {}
        1 => lamp.emission *= 2.0,
        2 => {
            lamp.emission = Vec3::ZERO;
            lamp.emits = Some(false);
            lamp.occludes = Some(true);
        }
        _ => lamp.scale = 0.2,
    }
    let text = data.to_toml().unwrap();
    let mut changed = parse(&text);
    changed.meshes = scene.meshes.clone();
    changed
}

/// Memory of this process that is in use, where the system says it.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(1024 * line.split_whitespace().next()?.parse::<u64>().ok()?)
}

/// The variable says how many frames; without it there are 2 500.
#[test]
fn frames_neither_drift_nor_take_more_memory() {
    let frames = std::env::var("SHADOW_FIELDS_SOAK").map_or(2500, |text| text.parse().expect("a number of frames"));
    // Not under the validation layer, which keeps what it has seen.
    let options = DeviceOptions { cache_dir: Some(cache_dir()), ..DeviceOptions::default() };
    let device = match Device::new(&options) {
        Ok(device) => device,
        Err(error) => return skip(&error.to_string()),
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fields-soak");
    let scene = parse(SCENE);
    let options = frame::Options {
        bake: bake::Options { lattice: "cube:6x5".parse().unwrap(), face_px: 16, ..Default::default() },
        skip: Skip::ALL,
        size: [SIZE_PX; 2],
        antialias: Antialias::Outlines,
        ..shadow_fields::bench::default_options()
    };
    let states: Vec<Scene> = (0..STATES).map(|state| changed(&scene, state)).collect();
    let baker = Baker::new(&device, &library());
    let cache = Cache::new(Some(&folder));
    let mut frame = Frame::new(&baker, &cache, &scene, options, &|_, _, _| ()).unwrap();

    let warm_up = ((frames as f64 * WARM_UP) as u64).max(2 * MOMENTS * STATES * STATE_FRAMES);
    let mut first: Vec<Option<Vec<f32>>> = vec![None; (MOMENTS * STATES) as usize];
    let mut memory: Option<[u64; 2]> = None;
    let mut compared = 0;
    for index in 0..frames {
        let moment = index % MOMENTS;
        let state = index / STATE_FRAMES % STATES;
        if index % STATE_FRAMES == 0 {
            frame.set_scene(&states[state as usize]).unwrap();
        }
        let placements = states[state as usize].at(moment as f64 * PERIOD_S / MOMENTS as f64);
        let picture = shown(&mut frame, &placements, 1.0);
        match &first[(moment * STATES + state) as usize] {
            None => first[(moment * STATES + state) as usize] = Some(picture),
            Some(known) => {
                compared += 1;
                assert!(*known == picture, "frame {index} is another than one of the same moment and state before");
            }
        }
        if index >= warm_up && index % 256 == 0 {
            let now = resident_bytes();
            memory = now.map(|now| memory.map_or([now, now], |[before, most]| [before, most.max(now)]));
        }
    }
    report(&format!("{compared} pictures compared; bytes in use after the warm-up, and the most later: {memory:?}"));
    assert!(compared > frames / 2);
    if let Some([before, most]) = memory {
        assert!(most as f64 <= before as f64 * (1.0 + MOST_GROWTH), "memory grew from {before} to {most} bytes");
    }
}
