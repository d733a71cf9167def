//! `shadow-fields bench`: the measurements behind the documentation's figures.

use super::context::Context;
use super::source::GltfSceneArguments;
use super::{Global, output, outputs};
use crate::bench::cases::{self, Case};
use crate::bench::stability::{self, NEAR_TWIN, Trial};
use crate::bench::time_error::{self, TimeErrorOutcome};
use crate::bench::{Bench, scaling, skips};
use crate::error::{Error, Result};
use crate::scene;
use crate::text::{self, three};
use crate::truth::exposure;
use clap::{Args, Subcommand};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Split the error of pictures into its causes, and compare with ray casting
    #[command(
        after_help = "Examples:\n  shadow-fields bench time-error --quick --output out/errors\n  shadow-fields bench time-error my_scene.toml \
        --output out/my_scene\n  shadow-fields bench time-error --case torus --output out/torus"
    )]
    TimeError {
        /// Scene file or glTF file to measure instead of the built-in cases, at the time_s of its [output]
        #[arg(value_name = "SCENE", conflicts_with = "case")]
        scene: Option<PathBuf>,
        /// Measure only cases that have TEXT in their names; may be given again; a text that none has lists
        /// them
        #[arg(long, value_name = "TEXT")]
        case: Vec<String>,
        #[command(flatten)]
        gltf: GltfSceneArguments,
        #[command(flatten)]
        run: RunArguments,
    },
    /// Test the merge with many occluders, extreme places and extreme numbers; exit code 1 where a trial fails
    Stability(RunArguments),
    /// Measure what each skip saves and how it changes the error
    Skip {
        /// Measure only scenes that have TEXT in their names; may be given again; a text that none has lists them
        #[arg(long, value_name = "TEXT")]
        case: Vec<String>,
        #[command(flatten)]
        run: RunArguments,
    },
    /// Measure time and memory for growing numbers of vertices, entities and lights
    Scaling {
        /// Measure only this axis; may be given again; an unknown name lists them
        #[arg(long, value_name = "NAME")]
        axis: Vec<String>,
        #[command(flatten)]
        run: RunArguments,
    },
}

#[derive(Args)]
struct RunArguments {
    /// A minute on two cores instead of five, or a quarter of an hour for time-error: fewer and smaller scenes and rays
    #[arg(long)]
    quick: bool,
    /// Folder for the results, as JSON and their tables as CSV
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: PathBuf,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::TimeError { scene, case, gltf, run } => {
            let own = scene.as_deref().map(|path| own_case(global, gltf, path)).transpose()?;
            let inputs: Vec<PathBuf> = scene.iter().flat_map(|path| scene::files::of_scene(path)).collect();
            let cases = own.map_or_else(|| time_error::chosen(run.quick, case), |case| Ok(vec![case]))?;
            let measured = |bench: &Bench<'_>| time_error::run(bench, &cases);
            measure(global, run, "time-error", &inputs, measured, tell_time_error)?;
        }
        What::Stability(run) => {
            let trials =
                measure(global, run, "stability", &[], stability::run, |trials, to| tell_stability(trials, to))?;
            let failed = trials.iter().filter(|trial| !trial.passed).count();
            if failed > 0 {
                return Err(Error::Failed(format!("{failed} of {} trials failed", trials.len())));
            }
        }
        What::Skip { case, run } => {
            let scenes = cases::named(skips::all(run.quick)?, case)?;
            measure(global, run, "skip", &[], |bench| skips::run(bench, &scenes), |rows, to| tell_skips(rows, to))?;
        }
        What::Scaling { axis, run } => {
            measure(global, run, "scaling", &[], |bench| scaling::run(bench, axis), |rows, to| tell_scaling(rows, to))?;
        }
    }
    Ok(())
}

/// Opens the device, measures with progress on stderr, writes the outcome as NAME.json, and the tables that `tell` makes
/// of it as CSV; prints either. The folder of results must not hold any of the inputs.
fn measure<T: Serialize>(
    global: &Global,
    run: &RunArguments,
    name: &str,
    inputs: &[PathBuf],
    measured: impl FnOnce(&Bench<'_>) -> Result<T>,
    tell: impl FnOnce(&T, &Tables<'_>) -> Result<()>,
) -> Result<T> {
    outputs::check_folder("--output", &run.out, inputs)?;
    let context = Context::new(global)?;
    let started = Instant::now();
    let show = |what: &str| {
        if !global.no_progress {
            output::note(global, format!("{:6.1} s  {what}", started.elapsed().as_secs_f64()));
        }
    };
    let outcome = measured(&bench(&context, global, run.quick, &show))?;
    let document = json!({ "origin": context.origin(global), "quick": run.quick, "outcome": outcome });
    text::make_folder(&run.out)?;
    text::write(&run.out.join(format!("{name}.json")), format!("{document:#}\n"))?;
    if global.json {
        output::say(document["outcome"].to_string());
    }
    tell(&outcome, &Tables { folder: &run.out, prints: !global.json })?;
    context.finish()?;
    Ok(outcome)
}

/// The measurements' view of an open device.
pub fn bench<'b>(context: &'b Context, global: &Global, quick: bool, progress: &'b (dyn Fn(&str) + Sync)) -> Bench<'b> {
    Bench { baker: &context.baker, cache: &context.cache, progress, quick, seed: global.seed }
}

/// The case of a scene file.
fn own_case(global: &Global, gltf: &GltfSceneArguments, path: &Path) -> Result<Case> {
    let mut scene = gltf.scene(global, path, 0.0)?;
    let output = scene.data.output.clone();
    exposure::settle(&mut scene, output.time_s, output.aspect());
    Case::of_file(path, scene)
}

/// Where the tables of results go.
struct Tables<'t> {
    folder: &'t Path,
    prints: bool,
}

impl Tables<'_> {
    /// Writes a table as NAME.csv, with all digits, and prints it below a title. Columns are as those of [`table`].
    fn add(&self, name: &str, title: &str, rows: &impl Serialize, columns: &[(&str, &str)]) -> Result<()> {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let line = |cells: Vec<String>| cells.join(",") + "\n";
        let mut csv = line(columns.iter().map(|(title, _)| quoted(title)).collect());
        for row in json!(rows).as_array().map_or(&[][..], Vec::as_slice) {
            let cell = |(_, pointer): &(&str, &str)| match row.pointer(pointer) {
                None | Some(Value::Null) => String::new(),
                Some(Value::String(text)) => quoted(text),
                Some(other) => other.to_string(),
            };
            csv += &line(columns.iter().map(cell).collect());
        }
        text::write(&self.folder.join(format!("{name}.csv")), csv)?;
        if self.prints {
            output::say(title);
            table(rows, columns);
        }
        Ok(())
    }
}

/// Prints rows of results: each column is its header and the JSON pointer of its value in a row.
pub fn table(rows: &impl Serialize, columns: &[(&str, &str)]) {
    let rows = json!(rows);
    let rows = rows.as_array().map_or(&[][..], Vec::as_slice);
    let cell = |row: &Value, pointer: &str| match row.pointer(pointer) {
        None | Some(Value::Null) => "-".to_owned(),
        Some(Value::Bool(yes)) => if *yes { "yes" } else { "NO" }.to_owned(),
        Some(Value::Number(number)) if number.is_f64() => three(number.as_f64().expect("it is f64")),
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    };
    let cells = rows.iter().map(|row| columns.iter().map(|(_, pointer)| cell(row, pointer)).collect());
    let header: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    output::table(&header, &cells.collect::<Vec<_>>());
}

fn tell_time_error(outcome: &TimeErrorOutcome, to: &Tables<'_>) -> Result<()> {
    let title = "Relative RMS error over vertices against rays from them, by cause (p99 and max of the total)";
    let columns = [
        ("scene", "/case"),
        ("bands and sampling", "/bands_and_sampling/rms_relative"),
        ("storage", "/arithmetic_and_storage/rms_relative"),
        ("total in SH", "/total/rms_relative"),
        ("sharp lights", "/sharp_total/rms_relative"),
        ("p99", "/total/p99_relative"),
        ("max", "/total/max_relative"),
        ("T0 error", "/t0_error_relative"),
    ];
    to.add("budgets", title, &outcome.budgets, &columns)?;
    let title = "\nTime of the merge, and error, by --quality";
    let columns = [
        ("scene", "/case"),
        ("quality", "/quality"),
        ("merge ms", "/merge_ms/median"),
        ("error", "/error/rms_relative"),
        ("bytes of fields", "/field_bytes"),
    ];
    to.add("qualities", title, &outcome.qualities, &columns)?;
    let title = "\nA frame, everything merged, against ray casting with as many threads at equal error\n(at vertices without drawing, at \
         pixels with it)";
    let columns = [
        ("scene", "/title"),
        ("frame ms", "/frame_wall_ms/median"),
        ("error", "/merge_error/rms_relative"),
        ("rays", "/rays_at_equal_rms_count"),
        ("rays ms", "/rival_ms_at_equal_rms"),
        ("times faster", "/speed_up_at_equal_rms_ratio"),
        ("merge alone", "/merge_speed_up_at_equal_rms_ratio"),
    ];
    to.add("comparisons", title, &outcome.comparisons, &columns)
}

fn tell_stability(trials: &[Trial], to: &Tables<'_>) -> Result<()> {
    let title = format!(
        "Odd scenes: everything finite, the same bytes when merged again, radiosity within its bound, and within {NEAR_TWIN:e} \
         of the f64 twin"
    );
    let columns = [
        ("scene", "/name"),
        ("fields", "/storage"),
        ("finite", "/finite"),
        ("repeatable", "/repeatable"),
        ("largest", "/largest_radiosity"),
        ("bound", "/bound_radiosity"),
        ("against f64", "/twin_error_relative"),
        ("passed", "/passed"),
    ];
    to.add("stability", &title, &trials, &columns)
}

fn tell_skips(rows: &[skips::SkipCost], to: &Tables<'_>) -> Result<()> {
    let title = "Times of a frame without drawing, in turns without and with the skip (for \"hidden\" with drawing, at 1280x720).\nErrors \
         and changes are relative to the RMS radiosity.";
    let columns = [
        ("scene", "/case"),
        ("skip", "/skip"),
        ("off ms", "/off/frame_ms/median"),
        ("on ms", "/on/frame_ms/median"),
        ("times faster", "/speed_up_ratio"),
        ("off lookups", "/off/entry_count"),
        ("on lookups", "/on/entry_count"),
        ("off error", "/off/error/rms_relative"),
        ("on error", "/on/error/rms_relative"),
        ("most change", "/change/max_relative"),
    ];
    to.add("skip", title, &rows, &columns)
}

fn tell_scaling(points: &[scaling::ScalingPoint], to: &Tables<'_>) -> Result<()> {
    let title = "Frames without drawing, in milliseconds: everything moves, one entity moves, nothing moves";
    let columns = [
        ("axis", "/axis"),
        ("vertices", "/vertices"),
        ("entities", "/entities"),
        ("lights", "/lights"),
        ("all move", "/all_move_ms/median"),
        ("merge", "/merge_ms/median"),
        ("one moves", "/one_moves_ms/median"),
        ("at rest", "/rest_ms/median"),
        ("ns/vertex", "/merge_ns_a_vertex"),
        ("lookups/vertex", "/entries_a_vertex"),
        ("error", "/error"),
        ("device bytes", "/device_bytes"),
    ];
    to.add("scaling", title, &points, &columns)
}
