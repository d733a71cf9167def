//! `bench time-error`: error budgets, run time against error, and ray casting beside it.

use super::budget::{Budget, Effort, Truth, budget};
use super::cases::{self, Case};
use super::plot::{Curve, Dot, Plot};
use super::rival::{Comparison, compare};
use super::sweep::{Point, pareto, sweep, variations};
use super::text::{csv, three, write};
use super::{Bench, default_options};
use crate::asset::false_color::Scheme;
use crate::error::{Error, Result};
use crate::frame::Options;
use crate::truth::error_map::Shown;
use crate::truth::{self, ErrorMap, RayCast, error_map};
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// What was measured.
#[derive(Serialize)]
pub struct Outcome {
    /// A row a scene and light.
    pub budgets: Vec<Budget>,
    /// A picture a scene and light.
    pub pictures: Vec<Shown>,
    /// A row a case and variation.
    pub points: Vec<Point>,
    /// A row a case.
    pub comparisons: Vec<Comparison>,
}

/// Measures, and writes `budget.csv`, `sweep.csv`, `rival.csv`, `time-error.json`, an error picture a case, a plot a swept case
/// and `time-error.txt` into `folder`.
///
/// # Errors
/// `Failed` when the folder cannot be written; else as [`crate::frame::Frame::new`].
pub fn run(bench: &Bench<'_>, folder: &Path) -> Result<Outcome> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::Failed(format!("{}: cannot be made: {error}", folder.display())))?;
    let mut outcome =
        Outcome { budgets: Vec::new(), pictures: Vec::new(), points: Vec::new(), comparisons: Vec::new() };
    let effort = Effort::new(bench.quick);
    let all = variations(bench.quick);
    for case in chosen(bench.quick)? {
        (bench.progress)(&format!("{}: casting rays", case.name));
        let truth = Truth::new(&case, effort, bench.seed);
        outcome.budgets.push(budget(bench, &case, &truth)?);
        outcome.pictures.push(error_picture(bench, &case, folder)?);
        outcome.comparisons.push(compare(bench, &case, &truth)?);
        if is_swept(&case, bench.quick) {
            outcome.points.extend(sweep(bench, &case, &truth, &all)?);
        }
    }
    write_all(bench, folder, &outcome)?;
    Ok(outcome)
}

/// Rays of an error picture in a quick and a thorough run, a few seconds on two cores: shared by its vertices and lights, so that
/// what has few vertices, and errs little, is judged by more of them.
const PICTURE_RAYS: [usize; 2] = [8_000_000, 32_000_000];
/// Size of the error pictures, less their scale bars.
const PICTURE_SIZE: [u32; 2] = [720, 480];

/// Writes the error of every lit vertex in false colour, as `error-` and the case's name.
fn error_picture(bench: &Bench<'_>, case: &Case, folder: &Path) -> Result<Shown> {
    let placements = case.scene.at(case.time_s);
    let options = Options { size: PICTURE_SIZE, multisample: true, ..default_options() };
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, None)?;
    let share = PICTURE_RAYS[usize::from(!bench.quick)] / frame.receiver_vertex_count().max(1);
    let lights = 1 + case.scene.entities.iter().filter(|e| e.emits).count();
    let rays = ((share / lights).clamp(64, 4096) as u32).next_power_of_two();
    let cast = RayCast { rays, runs: 2, seed: bench.seed, distant: case.distant, shadows: true };
    let (reference, noise) = truth::picture(&case.scene, &placements, &cast);
    let map = ErrorMap::new(&error_map::radiosity(&frame)?, &reference, Scheme::Signed);
    let words: Vec<&str> = case.name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    map.write(&folder.join(format!("error-{}.png", words.join("-"))), &mut frame, &placements, None, noise)
}

/// The quick run leaves out what takes ten seconds and more to bake on two cores, and takes the teapot under one light, as an
/// occluder alone.
fn chosen(quick: bool) -> Result<Vec<Case>> {
    if quick {
        let teapot = cases::teapot_lights()?.into_iter().nth(1);
        let scenes = ["sphere_over_plane", "torus_over_plane"].into_iter().map(cases::scene);
        return scenes.chain(teapot.map(Ok)).collect();
    }
    Ok(cases::teapot_lights()?.into_iter().chain(cases::scenes()?).collect())
}

/// Variations are baked anew, so few cases are swept: one object under a sky, and one with a local light.
fn is_swept(case: &Case, quick: bool) -> bool {
    case.name == "torus_over_plane" || (!quick && case.name.contains("(b)"))
}

fn write_all(bench: &Bench<'_>, folder: &Path, outcome: &Outcome) -> Result<()> {
    fn rows(of: &[impl Serialize]) -> Vec<Value> {
        of.iter().map(|row| serde_json::to_value(row).expect("rows are plain data")).collect()
    }
    let origin = json!({
        "origin": bench.origin, "quick": bench.quick, "seed": bench.seed,
        "errors": "relative to the root mean square of T0 over the judged vertices",
    });
    write(&folder.join("budget.csv"), &csv(&origin, &rows(&outcome.budgets)))?;
    write(&folder.join("sweep.csv"), &csv(&origin, &rows(&outcome.points)))?;
    let rivals: Vec<Value> = outcome.comparisons.iter().flat_map(rival_rows).collect();
    write(&folder.join("rival.csv"), &csv(&origin, &rivals))?;
    write(&folder.join("time-error.json"), &format!("{:#}\n", json!({ "origin": origin, "outcome": outcome })))?;
    let mut swept: Vec<&str> = outcome.points.iter().map(|p| p.case.as_str()).collect();
    swept.dedup();
    for (index, case) in swept.iter().enumerate() {
        let svg = plot(case, outcome).svg();
        write(&folder.join(format!("time-error-{}.svg", index + 1)), &svg)?;
    }
    write(&folder.join("time-error.txt"), &page(outcome))
}

/// A row for the merge and one for each number of rays.
fn rival_rows(comparison: &Comparison) -> Vec<Value> {
    let row = |what: String, wall_ms: f64, error| {
        json!({
            "case": comparison.case, "what": what, "vertex_count": comparison.vertices, "thread_count": comparison.threads,
            "wall_ms": wall_ms, "error": error,
            "speed_up_at_equal_rms_ratio": comparison.speed_up_at_equal_rms, "rays_at_equal_rms": comparison.rays_at_equal_rms,
        })
    };
    let merge = row("merge".into(), comparison.frame_wall_ms.median, comparison.merge_error);
    let cast = comparison.rival.iter().map(|p| row(format!("{} rays", p.rays), p.wall_ms.median, p.error));
    std::iter::once(merge).chain(cast).collect()
}

fn plot(case: &str, outcome: &Outcome) -> Plot {
    let points: Vec<&Point> = outcome.points.iter().filter(|p| p.case == case).collect();
    let places: Vec<(f64, f64)> = points.iter().map(|p| (p.merge_ms.median, p.total.rms)).collect();
    let rival = outcome.comparisons.iter().filter(|c| c.case == case);
    Plot {
        title: format!("{case}: time against error"),
        x_label: "merge, milliseconds (median)".into(),
        y_label: "relative RMS error against ray casting".into(),
        dots: points
            .iter()
            .zip(&places)
            .map(|(p, &(x, y))| Dot { label: format!("{}: {}", p.axis, p.name), group: p.axis.into(), x, y })
            .collect(),
        front: pareto(&places),
        curves: rival
            .map(|c| Curve {
                label: format!("ray casting, {} threads", c.threads),
                points: c.rival.iter().map(|p| (p.wall_ms.median, p.error.rms)).collect(),
            })
            .collect(),
    }
}

/// One page: where the default stands and why, from the numbers.
fn page(outcome: &Outcome) -> String {
    let mut text = String::from(
        "Time against error\n\nErrors are root mean squares over vertices relative to that of the ray-cast radiosity (T0).\n\n\
         What a picture's error is made of\n",
    );
    for b in &outcome.budgets {
        let _ = writeln!(
            text,
            "  {}: bands {}, sampling {}, arithmetic and storage {}, total {} (worst vertex {}); T0 itself {}",
            b.case,
            three(b.bands.rms),
            three(b.sampling.rms),
            three(b.arithmetic_and_storage.rms),
            three(b.total.rms),
            three(b.total.max),
            three(b.t0_error),
        );
    }
    text += "\nWhat run time buys\n";
    let mut swept: Vec<&str> = outcome.points.iter().map(|p| p.case.as_str()).collect();
    swept.dedup();
    for case in swept {
        let points: Vec<&Point> = outcome.points.iter().filter(|p| p.case == case).collect();
        let places: Vec<(f64, f64)> = points.iter().map(|p| (p.merge_ms.median, p.total.rms)).collect();
        let front = pareto(&places);
        let Some(default) = points.first() else { continue };
        let _ = writeln!(
            text,
            "  {case}: the default ({}) takes {} ms and is off by {}; it is {} the front of what nothing beats in both:",
            default.name,
            three(default.merge_ms.median),
            three(default.total.rms),
            if front.contains(&0) { "on" } else { "off" },
        );
        for (i, point) in points.iter().enumerate().skip(1) {
            let _ = writeln!(
                text,
                "   {} {} {}: {} times the time, error {}, below the bands {}, {} kB",
                if front.contains(&i) { "*" } else { " " },
                point.axis,
                point.name,
                three(point.time_per_default),
                three(point.total.rms),
                three(point.below_bands.rms),
                point.field_bytes / 1024,
            );
        }
        text += &verdict(default, &points);
    }
    text += "\nMerge against ray casting at equal error\n";
    for c in &outcome.comparisons {
        let _ = match (c.speed_up_at_equal_rms, c.rays_at_equal_rms) {
            (Some(times), Some(rays)) => writeln!(
                text,
                "  {}: {} times {} ({} ms a frame; the rays that reach its error {}: {} a vertex and light, {} ms)",
                c.case,
                three(if times >= 1.0 { times } else { 1.0 / times }),
                if times >= 1.0 { "faster" } else { "SLOWER" },
                three(c.frame_wall_ms.median),
                three(c.merge_error.rms),
                three(rays),
                three(c.rival_ms_at_equal_rms.unwrap_or(f64::NAN)),
            ),
            _ => writeln!(text, "  {}: the rival's error does not fall; no comparison", c.case),
        };
    }
    text
}

/// The reason for the default, as far as the numbers carry it.
fn verdict(default: &Point, points: &[&Point]) -> String {
    let better: Vec<&&Point> = points[1..]
        .iter()
        .filter(|p| {
            p.time_per_default < 1.02 && p.total.rms < 0.98 * default.total.rms && p.field_bytes <= default.field_bytes
        })
        .collect();
    let faster = points[1..]
        .iter()
        .filter(|p| p.time_per_default < 0.98 && p.total.rms < 1.1 * default.total.rms)
        .map(|p| format!("{} {}", p.axis, p.name));
    let faster: Vec<String> = faster.collect();
    let mut text = match better.is_empty() {
        true => "    Nothing is as fast, as small and more than 2 % nearer to the truth than the default.\n".to_owned(),
        false => {
            let names: Vec<String> = better.iter().map(|p| format!("{} {}", p.axis, p.name)).collect();
            format!("    As fast, as small and nearer to the truth than the default here: {}.\n", names.join("; "))
        }
    };
    text += &match faster.is_empty() {
        true => "    Nothing is more than 2 % faster within a tenth of its error.\n".to_owned(),
        false => format!("    Faster within a tenth of its error: {}.\n", faster.join("; ")),
    };
    text
}
