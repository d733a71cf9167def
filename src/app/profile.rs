//! `shadow-fields profile` times every pass and every variant of the merge shader.

use super::bench::{bench, table};
use super::context::Context;
use super::{Global, output, outputs};
use crate::bench::ceilings;
use crate::bench::profile::{self, ProfileRow};
use crate::error::Result;
use crate::frame::picture_size;
use crate::merge::calibrate;
use crate::merge::variant::{VARIANTS, Variant};
use crate::merge::workload::Workload;
use crate::scene::{self, Scene};
use crate::text;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

#[derive(Args)]
pub struct Arguments {
    /// Scene file, or the name of a built-in scene, whose passes are timed; without one a made-up merge of known size
    scene: Option<PathBuf>,
    /// Size of the scene's pictures
    #[arg(long, default_value = "1280x720", value_parser = picture_size, value_name = "WxH")]
    size: [u32; 2],
    /// Vertices of the made-up merge
    #[arg(long, default_value_t = 65_536, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=4_194_304))]
    grid: u32,
    /// Occluders that each vertex of the made-up merge meets; several numbers with commas
    #[arg(long, default_value = "4,16", value_delimiter = ',', value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    occluders: Vec<u32>,
    /// Time only this variant of the merge shader; may be given again; an unknown name lists them
    #[arg(long, value_name = "NAME", value_parser = Variant::named)]
    variant: Vec<Variant>,
    /// Number of timed runs of each, after one that warms up
    #[arg(long, default_value_t = 15, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    runs: u32,
    /// Write profile.json into this folder
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let inputs: Vec<PathBuf> = arguments.scene.iter().flat_map(|path| scene::files::of_scene(path)).collect();
    if let Some(folder) = &arguments.out {
        outputs::check_folder("--output", folder, &inputs)?;
    }
    let scene = arguments.scene.as_deref().map(Scene::load).transpose()?;
    let context = Context::new(global)?;
    let all = arguments.variant.is_empty();
    let chosen = if all { VARIANTS } else { &arguments.variant[..] };
    let small = Workload::new(&context.device, 64, 1)?;
    let at_best = ceilings::measure(&context.device, context.baker.library(), small.field_bytes())?;
    let show = |what: &str| output::note(global, what);
    let bench = bench(&context, global, false, &show);
    let mut rows: Vec<ProfileRow> = Vec::new();
    if let (Some(scene), Some(path)) = (&scene, &arguments.scene) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        rows = profile::scene(&bench, &name, scene, arguments.size, chosen, arguments.runs, &at_best)?;
    } else {
        for &occluders in &arguments.occluders {
            let workload = Workload::new(&context.device, arguments.grid, occluders)?;
            rows.extend(profile::made_up(&bench, &workload, chosen, arguments.runs, &at_best)?);
        }
    }
    if all {
        context.learn(global)?;
    }
    let usual = calibrate::best_known(&context.device).name;
    let document = json!({
        "origin": context.origin(global), "ceilings": at_best, "passes": rows, "usual_variant": usual,
    });
    if let Some(folder) = &arguments.out {
        text::make_folder(folder)?;
        text::write(&folder.join("profile.json"), format!("{document:#}\n"))?;
    }
    if global.json {
        output::say(document.to_string());
        return context.finish();
    }
    output::say(format!(
        "at best: {:.0} GFLOP/s; {:.2} G texels/s of four halves, {:.2} of 16 bytes; {:.2} G storage reads/s of 8 bytes",
        at_best.gflops, at_best.texel_halves_giga, at_best.texel_packed_giga, at_best.storage_giga
    ));
    let columns = [
        ("of", "/case"),
        ("pass", "/pass"),
        ("variant", "/variant"),
        ("ms", "/ms/median"),
        ("lower", "/ms/lower"),
        ("upper", "/ms/upper"),
        ("ns/pair", "/ns_a_pair"),
        ("flops", "/flops"),
        ("GFLOP/s", "/gflops"),
        ("arithmetic's share", "/arithmetic_share"),
    ];
    table(&rows, &columns);
    if rows.iter().any(|row| row.pass == "merge" && row.ns_a_pair.is_none()) {
        output::say(format!(
            "A dispatch that does nothing takes {:.3} ms here. What takes less than five times that is mostly its start: no rates and \
             no shares.",
            at_best.dispatch_ms
        ));
    }
    output::say(format!("\nwithout --variant this device merges with \"{usual}\""));
    context.finish()
}
