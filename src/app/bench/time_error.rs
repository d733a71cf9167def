//! `shadow-fields bench time-error` splits the error of pictures into its causes and compares methods at equal error.

use super::common::start;
use crate::app::source::GltfArguments;
use crate::app::{Global, output};
use crate::bench::cases::Case;
use crate::bench::time_error::{self, Selection, TimeErrorOutcome};
use crate::error::Result;
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench time-error`.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  shadow-fields bench time-error --quick --out out/errors\n  shadow-fields bench time-error my_scene.toml \
    --axis lookup --out out/my_scene\n  shadow-fields bench time-error --case \"torus, near light\" --axis lookup --out out/torus\n\n\
    Cases that run only when --case names them: teapot, torus and animal (a body on thin legs), each over a floor under a \"near\" \
    light (5 bounding radii away)\nor a \"distant\" one (1 000) of half angles of 1, 3, 8, 15 and 30 degrees, and \"32 small lights, 24 moving \
    objects\"."
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
    /// Sweep only this axis, with all its settings (each may need bakes of its own); may be given again; an unknown name lists them
    #[arg(long, value_name = "NAME")]
    axis: Vec<String>,
    /// Folder for budget.csv, sweep.csv, rival.csv, time-error.json, time-error.txt (which setting is the default and why), a plot of
    /// time against error for every case, error pictures, and the picture of the merge beside that of ray casting
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    gltf: GltfArguments,
}

/// Measures and prints the budget and the comparison.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let own =
        arguments.scene.as_deref().map(|path| Case::of_file(path, arguments.gltf.scene(global, path)?)).transpose()?;
    let selection =
        Selection { scene: arguments.scene.clone(), cases: arguments.case.clone(), axes: arguments.axis.clone() };
    let (context, outcome) =
        start(global, arguments.quick, |bench| time_error::run(bench, &arguments.out, &selection, own))?;
    if global.json {
        output::say(serde_json::to_value(&outcome).expect("results are plain data").to_string());
        return context.finish();
    }
    say_budgets(&outcome);
    say_comparisons(&outcome);
    let folder = output::shown(&arguments.out);
    output::say(format!("\n{folder}: {} settings measured, {}", outcome.points.len(), outcome.took()));
    output::say(format!("{folder}/time-error.txt says which setting is the default and why"));
    context.finish()
}

fn say_budgets(outcome: &TimeErrorOutcome) {
    output::say(
        "Relative RMS error over vertices, by cause (p99 and max of the total); mean FLIP of the picture lit by vertex; error and mean FLIP at pixels",
    );
    let rows: Vec<Vec<String>> = outcome
        .budgets
        .iter()
        .zip(&outcome.pictures)
        .map(|(b, p)| {
            let mut row = vec![b.case.clone()];
            row.extend(
                [b.centre_rule.rms, b.bands.rms, b.sampling.rms, b.arithmetic_and_storage.rms, b.total.rms].map(three),
            );
            row.push(b.sharp_total.map_or("-".into(), |d| three(d.rms)));
            row.extend(
                [b.total.p99, b.total.max, b.t0_error, p.mean_flip, p.pixels.rms, p.pixels.mean_flip].map(three),
            );
            row
        })
        .collect();
    output::table(
        &[
            "scene",
            "centre rule",
            "bands",
            "sampling",
            "storage",
            "total in SH",
            "sharp lights",
            "p99",
            "max",
            "T0 error",
            "mean FLIP",
            "pixel RMS",
            "pixel FLIP",
        ],
        &rows,
    );
}

fn say_comparisons(outcome: &TimeErrorOutcome) {
    output::say(
        "\nFrame against ray casting with as many threads, and against shadow maps: the quickest that errs no more, and what the best errs (without \
         drawing at vertices, with it at pixels)",
    );
    let rows: Vec<Vec<String>> = outcome
        .comparisons
        .iter()
        .map(|c| {
            let or_none = |x: Option<f64>| x.map_or("-".into(), three);
            let mut row = vec![c.title()];
            row.extend([c.frame_wall_ms.median, c.merge_error.rms].map(three));
            row.extend([c.rays_at_equal_rms, c.rival_ms_at_equal_rms].map(or_none));
            row.extend([c.speed_up_at_equal_rms, c.merge_speed_up_at_equal_rms].map(or_none));
            let best = c.maps.iter().map(|p| p.error.rms).min_by(f64::total_cmp);
            row.extend([c.map_ms_at_equal_rms, best].map(or_none));
            row
        })
        .collect();
    output::table(
        &["scene", "frame ms", "error", "rays", "rays ms", "times faster", "merge alone", "map ms", "best map error"],
        &rows,
    );
}
