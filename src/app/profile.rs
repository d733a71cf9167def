//! `shadow-fields profile` times every pass and every variant of the merge shader.

use super::bench::common::bench;
use super::context::Context;
use super::{Global, output, outputs};
use crate::asset::Mesh;
use crate::bench::ceilings::{self, Ceilings};
use crate::bench::profile::{self, ProfileRow, Tenths};
use crate::error::Result;
use crate::frame::picture_size;
use crate::merge::calibrate;
use crate::merge::variant::{VARIANTS, Variant};
use crate::merge::workload::Workload;
use crate::scene::{self, Scene};
use crate::text;
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Arguments of `profile`.
#[derive(Args)]
pub struct Arguments {
    /// Scene file, or the name of a built-in scene, whose passes are timed; without one a made-up merge of known size
    scene: Option<PathBuf>,
    /// Time the passes of a bake of this mesh instead: capture, project and assemble of an occlusion field, of a
    /// radiance field and of transfers
    #[arg(long, value_name = "MESH.obj", conflicts_with_all = ["scene", "variant", "compare"])]
    bake: Option<PathBuf>,
    /// Size of the scene's pictures
    #[arg(long, default_value = "1280x720", value_parser = picture_size, value_name = "WxH")]
    size: [u32; 2],
    /// Vertices of the made-up merge
    #[arg(long, default_value_t = 65_536, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=4_194_304))]
    grid: u32,
    /// Occluders that each vertex of the made-up merge meets; several numbers with commas
    #[arg(long, default_value = "4,16", value_delimiter = ',', value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    occluders: Vec<u32>,
    /// Time only this variant of the merge shader; an unknown name lists them
    #[arg(long, value_name = "NAME", conflicts_with = "compare", value_parser = Variant::named)]
    variant: Option<Variant>,
    /// Time two variants in turns, and print the ratio of their times
    #[arg(long, num_args = 2, value_names = ["A", "B"], value_parser = Variant::named)]
    compare: Option<Vec<Variant>>,
    /// Number of timed runs of each, after one that warms up
    #[arg(long, default_value_t = 15, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    runs: u32,
    /// Write profile.csv and profile.json into this folder
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: Option<PathBuf>,
}

enum Subject {
    Bake(Mesh),
    Scene(String, Scene),
    MadeUp,
}

impl Arguments {
    fn subject(&self) -> Result<Subject> {
        Ok(match (&self.bake, &self.scene) {
            (Some(path), _) => Subject::Bake(scene::load_mesh(path)?.0),
            (None, Some(path)) => {
                let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
                Subject::Scene(name, Scene::load(path)?)
            }
            (None, None) => Subject::MadeUp,
        })
    }
}

/// Measures and prints.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let inputs: Vec<PathBuf> = arguments.scene.iter().flat_map(|path| scene::files::of_scene(path)).collect();
    if let Some(folder) = &arguments.out {
        outputs::check_folder("--output", folder, &inputs)?;
    }
    let subject = arguments.subject()?;
    let context = Context::new(global)?;
    let chosen = match (arguments.variant, &arguments.compare) {
        (Some(variant), _) => vec![variant],
        (_, Some(variants)) => variants.clone(),
        _ => VARIANTS.to_vec(),
    };
    let library = context.baker.library();
    let small = Workload::new(&context.device, 64, 1)?;
    let at_best = ceilings::measure(&context.device, library, small.field_bytes())?;
    let cases = time_cases(global, arguments, &subject, &context, &chosen, &at_best)?;
    let ratios = if arguments.compare.is_some() { ratios(&cases) } else { Vec::new() };
    let rows: Vec<ProfileRow> = cases.into_iter().flatten().map(|(row, _)| row).collect();
    if arguments.variant.is_none() && arguments.compare.is_none() && arguments.bake.is_none() {
        context.learn(global)?;
    }
    let usual = calibrate::best_known(&context.device).name;
    let document = json!({
        "origin": context.origin(global),
        "ceilings": at_best,
        "passes": rows,
        "ratios": ratios.iter().map(|(what, ratio)| json!({ "what": what, "ratio": ratio })).collect::<Vec<_>>(),
        "usual_variant": usual,
    });
    if let Some(folder) = &arguments.out {
        write(folder, &document)?;
    }
    if global.json {
        output::say(document.to_string());
    } else {
        print_passes(&at_best, &rows, &ratios);
        output::say(format!("\nwithout --variant this device merges with \"{usual}\""));
    }
    context.finish()
}

/// Rows with all of their times.
type Case = Vec<(ProfileRow, Vec<f64>)>;

/// Times what is asked for: a bake, a scene, or made-up merges.
fn time_cases(
    global: &Global,
    arguments: &Arguments,
    subject: &Subject,
    context: &Context,
    chosen: &[Variant],
    at_best: &Ceilings,
) -> Result<Vec<Case>> {
    let show = |what: &str| output::note(global, what);
    let bench = bench(context, global, false, &show);
    let made_up = |&occluders: &u32| {
        let workload = Workload::new(&context.device, arguments.grid, occluders)?;
        profile::made_up(&bench, &workload, chosen, arguments.runs, at_best)
    };
    match subject {
        Subject::Bake(mesh) => Ok(vec![profile::bake(&bench, mesh, arguments.runs)?]),
        Subject::Scene(name, scene) => {
            Ok(vec![profile::scene(&bench, name, scene, arguments.size, chosen, arguments.runs, at_best)?])
        }
        Subject::MadeUp => arguments.occluders.iter().map(made_up).collect(),
    }
}

/// Time of the first row over that of the second, run by run, of each case.
fn ratios(cases: &[Case]) -> Vec<(String, Tenths)> {
    let ratio = |case: &Case| {
        let [(a, first), (b, second), ..] = &case[..] else { return None };
        let each: Vec<f64> = first.iter().zip(second).map(|(a, b)| a / b).collect();
        Some((format!("{}: {} over {}", a.case, a.variant, b.variant), Tenths::new(&each)))
    };
    cases.iter().filter_map(ratio).collect()
}

/// Writes profile.csv and profile.json.
fn write(folder: &Path, document: &Value) -> Result<()> {
    text::make_folder(folder)?;
    text::write(&folder.join("profile.csv"), text::csv(&document["origin"], &document["passes"]))?;
    text::write(&folder.join("profile.json"), format!("{document:#}\n"))
}

fn print_passes(at_best: &Ceilings, rows: &[ProfileRow], ratios: &[(String, Tenths)]) {
    output::say(format!(
        "at best: {:.0} GFLOP/s; {:.2} G texels/s of four halves, {:.2} of 16 bytes; {:.2} G storage \
         reads/s of 8 bytes; triad {:.1} GB/s",
        at_best.gflops, at_best.texel_halves_giga, at_best.texel_packed_giga, at_best.storage_giga, at_best.triad_gb_s
    ));
    let header = [
        "pass",
        "ms",
        "p10",
        "p90",
        "ns/pair",
        "flops",
        "texels",
        "bytes",
        "GFLOP/s",
        "GB/s",
        "arithmetic",
        "reads",
        "both",
    ];
    output::table(&header, &rows.iter().map(cells).collect::<Vec<_>>());
    if rows.iter().any(|row| row.pass == "merge" && row.ns_a_pair.is_none()) {
        output::say(format!(
            "A dispatch that does nothing takes {:.3} ms here. What takes less than five times that is mostly its start: no rates and \
             no shares.",
            at_best.dispatch_ms
        ));
    }
    for (what, ratio) in ratios {
        output::say(format!("{what}: {:.3} ({:.3} - {:.3})", ratio.median, ratio.p10, ratio.p90));
    }
}

/// Cells of a pass: times, work of a pair, rates and shares of the ceilings, empty where nothing is known.
fn cells(row: &ProfileRow) -> Vec<String> {
    let number = |value: Option<f64>, digits: usize| value.map_or_else(String::new, |v| format!("{v:.digits$}"));
    let percent = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{:.0} %", 100.0 * v));
    let count = |f: fn(&profile::Work) -> u32| row.work.as_ref().map_or_else(String::new, |w| f(w).to_string());
    let both = row.arithmetic_share.zip(row.read_share).map(|(a, r)| a + r);
    let mut cells = vec![format!("{} {} {}", row.case, row.pass, row.variant)];
    cells.extend([row.ms.median, row.ms.p10, row.ms.p90].map(|ms| format!("{ms:.2}")));
    cells.extend([number(row.ns_a_pair, 1), count(|w| w.flops), count(|w| w.fetches), count(|w| w.bytes)]);
    cells.extend([number(row.gflops, 0), number(row.gb_s, 1)]);
    cells.extend([row.arithmetic_share, row.read_share, both].map(percent));
    cells
}
