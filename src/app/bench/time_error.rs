//! `shadow-fields bench time-error` splits the error of pictures into its causes and compares methods at equal error.

use super::common::{start, table};
use crate::app::source::GltfSceneArguments;
use crate::app::{Global, output, outputs};
use crate::bench::cases::Case;
use crate::bench::time_error::{self, Selection};
use crate::error::Result;
use crate::scene;
use crate::truth::exposure;
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `bench time-error`.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  shadow-fields bench time-error --quick --output out/errors\n  shadow-fields bench time-error my_scene.toml \
    --axis lattice --output out/my_scene\n  shadow-fields bench time-error --case torus --axis lattice --output out/torus"
)]
pub struct Arguments {
    /// Scene file or glTF file to measure and sweep instead of the built-in cases, at the time_s of its [output]
    #[arg(value_name = "SCENE", conflicts_with = "case")]
    scene: Option<PathBuf>,
    /// A minute on two cores instead of a quarter of an hour: fewer scenes, settings and rays
    #[arg(long)]
    quick: bool,
    /// Measure and sweep only cases that have TEXT in their names; may be given again; a text that none has lists them
    #[arg(long, value_name = "TEXT")]
    case: Vec<String>,
    /// Sweep only this axis, with all its settings (each may need bakes of its own); may be given again; an unknown
    /// name lists them
    #[arg(long, value_name = "NAME")]
    axis: Vec<String>,
    /// Folder for budget.csv, sweep.csv, rival.csv, time-error.json, a plot of time against error for every case, error
    /// pictures, and the picture of the merge beside that of ray casting
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    gltf: GltfSceneArguments,
}

/// Measures and prints the budget, the comparison and the sweep.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let own = |path: &Path| {
        let mut scene = arguments.gltf.scene(global, path, 0.0)?;
        let output = scene.data.output.clone();
        exposure::settle(&mut scene, output.time_s, output.aspect());
        Case::of_file(path, scene)
    };
    let own = arguments.scene.as_deref().map(own).transpose()?;
    let inputs: Vec<PathBuf> = arguments.scene.iter().flat_map(|path| scene::files::of_scene(path)).collect();
    outputs::check_folder("--output", &arguments.out, &inputs)?;
    let selection =
        Selection { scene: arguments.scene.clone(), cases: arguments.case.clone(), axes: arguments.axis.clone() };
    let (context, outcome) = start(global, arguments.quick, &arguments.out, |bench| {
        time_error::run(bench, &arguments.out, &selection, own)
    })?;
    if global.json {
        output::say(serde_json::to_value(&outcome).expect("results are plain data").to_string());
        return context.finish();
    }
    output::say("Relative RMS error over vertices against rays from them, by cause (p99 and max of the total)");
    let columns = [
        ("scene", "/case"),
        ("centre rule", "/centre_rule/rms_relative"),
        ("bands", "/bands/rms_relative"),
        ("sampling", "/sampling/rms_relative"),
        ("storage", "/arithmetic_and_storage/rms_relative"),
        ("total in SH", "/total/rms_relative"),
        ("sharp lights", "/sharp_total/rms_relative"),
        ("p99", "/total/p99_relative"),
        ("max", "/total/max_relative"),
        ("T0 error", "/t0_error_relative"),
    ];
    table(&outcome.budgets, &columns);
    output::say(
        "\nPictures: mean FLIP against rays from vertices; against rays from pixels mean FLIP and relative RMS error",
    );
    let columns = [
        ("scene", "/case"),
        ("FLIP", "/mean_flip_ratio"),
        ("pixel FLIP", "/pixels/mean_flip_ratio"),
        ("pixel RMS", "/pixels/rms_relative"),
    ];
    table(&outcome.pictures, &columns);
    output::say(
        "\nA frame, everything merged, against ray casting with as many threads at equal error, and the quickest shadow map that errs no \
         more\n(at vertices without drawing, at pixels with it)",
    );
    let columns = [
        ("scene", "/title"),
        ("frame ms", "/frame_wall_ms/median"),
        ("error", "/merge_error/rms_relative"),
        ("rays", "/rays_at_equal_rms_count"),
        ("rays ms", "/rival_ms_at_equal_rms"),
        ("times faster", "/speed_up_at_equal_rms_ratio"),
        ("merge alone", "/merge_speed_up_at_equal_rms_ratio"),
        ("map ms", "/map_ms_at_equal_rms"),
    ];
    table(&outcome.comparisons, &columns);
    if !outcome.points.is_empty() {
        output::say("\nSettings, one at a time round the default");
        let columns = [
            ("scene", "/case"),
            ("axis", "/axis"),
            ("setting", "/name"),
            ("merge ms", "/merge_ms/median"),
            ("over default", "/time_per_default_ratio"),
            ("error", "/total/rms_relative"),
            ("field bytes", "/field_bytes"),
        ];
        table(&outcome.points, &columns);
    }
    output::say(format!("\n{}: this run took {}", output::shown(&arguments.out), outcome.took()));
    context.finish()
}
