//! `shadow-fields demo` bakes and renders the built-in scenes and times them.

use super::bench::table;
use super::context::Context;
use super::{Global, output, outputs};
use crate::asset::picture::write_png;
use crate::bench::cases;
use crate::bench::figures::spread;
use crate::bench::profile::frame_times;
use crate::draw::Antialias;
use crate::error::Result;
use crate::frame::RenderOptions;
use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
pub struct Arguments {
    /// Folder for the pictures
    #[arg(short, long, default_value = "out", value_name = "DIR")]
    output: PathBuf,
    /// Frames that are timed, after two to warm up
    #[arg(long, default_value_t = 8, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    timed_frames: u32,
    #[command(flatten)]
    options: RenderOptions,
}

/// The scenes in the order of the table.
const SCENES: [&str; 7] = [
    "room",
    "sphere_over_plane",
    "torus_over_plane",
    "small_lights",
    "teapot_lights",
    "glowing_torus",
    "twelve_instances",
];

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let started = Instant::now();
    outputs::check_folder("--output", &arguments.output, &[])?;
    let context = Context::new(global)?;
    crate::text::make_folder(&arguments.output)?;
    let mut rows = Vec::new();
    for name in SCENES {
        let row = still(&context, arguments, name, started)?;
        output::note(global, format!("{}: {:.0} ms a frame", output::shown(&row.picture), row.frame_ms));
        rows.push(row);
    }
    let origin = context.origin(global);
    if arguments.options.variant.is_none() {
        context.learn(global)?;
    }
    context.finish()?;
    if global.json {
        let files: Vec<_> = rows.iter().map(|row| row.picture.display().to_string()).collect();
        output::say(json!({ "origin": origin, "scenes": rows, "pictures": files }).to_string());
        return Ok(());
    }
    let columns = [
        ("scene", "/scene"),
        ("vertices", "/vertices"),
        ("entities", "/entities"),
        ("bake, s", "/bake_s"),
        ("merge, ms", "/merge_ms"),
        ("draw, ms", "/draw_ms"),
        ("frame, ms", "/frame_ms"),
        ("frames/s", "/frames_per_s"),
        ("at 4 samples", "/frames_per_s_at_4_samples"),
        ("at 1 sample", "/frames_per_s_at_1_sample"),
    ];
    table(&rows, &columns);
    output::say(
        "Draw, frame and frames/s: one sample a pixel, outlines smoothed. The last two columns are frames/s as well.",
    );
    let first = rows.first().map_or(0.0, |row| row.first_picture_s);
    output::say(format!("first picture after {first:.2} s, all after {:.1} s", started.elapsed().as_secs_f64()));
    rows.iter().for_each(|row| output::say(output::shown(&row.picture)));
    Ok(())
}

/// One line of the table.
#[derive(serde::Serialize)]
struct DemoRow {
    scene: &'static str,
    vertices: usize,
    entities: usize,
    /// `None` where all was in the cache.
    bake_s: Option<f64>,
    merge_ms: f64,
    draw_ms: f64,
    frame_ms: f64,
    frames_per_s: f64,
    frames_per_s_at_4_samples: f64,
    frames_per_s_at_1_sample: f64,
    first_picture_s: f64,
    variant: &'static str,
    #[serde(skip)]
    picture: PathBuf,
}

/// The scene's picture, and its frame time while it moves: frames as a window shows them, not read back, edges smoothed
/// one way and another.
fn still(context: &Context, arguments: &Arguments, name: &'static str, started: Instant) -> Result<DemoRow> {
    let scene = cases::scene(name)?.scene;
    let options = arguments.options.frame(&scene)?;
    let mut frame = context.frame(&scene, options)?;
    let picture = arguments.output.join(format!("{name}.png"));
    let [width, height] = options.size;
    frame.render(&scene.at(0.0), Some(scene.data.output.white()))?;
    write_png(&picture, width, height, &frame.picture(), scene.data.output.exposure_ev())?;
    let first_picture_s = started.elapsed().as_secs_f64();

    let mut timed = |antialias| frame_times(&mut frame, &scene, antialias, arguments.timed_frames);
    let outlines = timed(Antialias::Outlines)?;
    let samples = timed(Antialias::Samples)?;
    let single = timed(Antialias::None)?;
    let median = |times: &BTreeMap<String, Vec<f64>>, passes: &[&str]| -> f64 {
        let all: f64 = passes.iter().filter_map(|pass| times.get(*pass)).map(|times| spread(times).median).sum();
        all + 0.0 // the sum of none is -0
    };
    let baked = &frame.buffers.baked;
    Ok(DemoRow {
        scene: name,
        vertices: frame.receiver_vertex_count(),
        entities: scene.entities.len(),
        bake_s: (!baked.is_empty()).then(|| baked.iter().map(|b| b.report.total.as_secs_f64()).sum()),
        merge_ms: median(&outlines, &["merge", "sharp"]),
        draw_ms: median(&outlines, &["mirror", "draw", "smooth"]),
        frame_ms: median(&outlines, &["frame"]),
        frames_per_s: 1e3 / median(&outlines, &["frame"]),
        frames_per_s_at_4_samples: 1e3 / median(&samples, &["frame"]),
        frames_per_s_at_1_sample: 1e3 / median(&single, &["frame"]),
        first_picture_s,
        variant: frame.variant().name,
        picture,
    })
}
