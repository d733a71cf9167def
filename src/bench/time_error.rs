//! `bench time-error`: error budgets, run time against error, and ray casting beside it.

use super::budget::{Budget, Effort, Truth, budget};
use super::cases::{self, Case};
use super::pictures::{CasePicture, pictures};
use super::plot::{AxisScale, Curve, Dot, Gap, Panel, Plot, PlotColumn, RowGroup, Rows};
use super::rival::{Comparison, compare};
use super::shadow_map::Filter;
use super::small_lights::SmallLight;
use super::sweep::{Point, Variation, pareto, sweep, variations};
use super::{Bench, default_options, verdict};
use crate::error::{Error, Result};
use crate::scene::Lights;
use crate::text::{csv, three, write};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The selected cases and axes; an empty list selects all, but for cases that run only when they are named.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Selection {
    /// A scene file, which is then the only case.
    pub scene: Option<PathBuf>,
    /// Parts of the names of cases; named cases are also swept.
    pub cases: Vec<String>,
    /// Axes of the sweep.
    pub axes: Vec<String>,
}

/// What was measured.
#[derive(Serialize)]
pub struct TimeErrorOutcome {
    /// One row per scene and light.
    pub budgets: Vec<Budget>,
    /// One picture per scene and light.
    pub pictures: Vec<CasePicture>,
    /// One row per case and variation.
    pub points: Vec<Point>,
    /// One row per case, and a second with lights in SH where lights can be sharp.
    pub comparisons: Vec<Comparison>,
    /// Wall time of the parts of the run, in seconds over all cases.
    pub seconds: BTreeMap<&'static str, f64>,
}

impl TimeErrorOutcome {
    /// Description of the run's wall time by parts.
    pub fn took(&self) -> String {
        let parts: Vec<String> = self.seconds.iter().map(|(part, s)| format!("{part} {s:.0}")).collect();
        format!("{:.0} s in all: {}", self.seconds.values().sum::<f64>(), parts.join(", "))
    }
}

/// Measures, and writes into `folder`: `budget.csv`, `sweep.csv`, `rival.csv`, `time-error.json`, `time-error.txt`, two pictures per
/// case, a plot per swept case, and a plot of the comparison with ray casting. `own` is the case of the selected scene file.
///
/// # Errors
/// `Usage` when a case or axis does not exist, `Failed` when the folder cannot be written, `Input` when no light reaches any of the
/// judged vertices; else as [`crate::frame::Frame::new`].
pub fn run(bench: &Bench<'_>, folder: &Path, selection: &Selection, own: Option<Case>) -> Result<TimeErrorOutcome> {
    let sweeps_all = own.is_some() || !selection.cases.is_empty();
    let cases = own.map_or_else(|| chosen(bench.quick, &selection.cases), |case| Ok(vec![case]))?;
    let all = variations_of(bench.quick, &selection.axes)?;
    crate::text::make_folder(folder)?;
    let mut outcome = TimeErrorOutcome {
        budgets: Vec::new(),
        pictures: Vec::new(),
        points: Vec::new(),
        comparisons: Vec::new(),
        seconds: BTreeMap::new(),
    };
    let effort = Effort::new(bench.quick);
    for (index, case) in cases.iter().enumerate() {
        (bench.progress)(&format!("case {} of {}, {}: casting rays", index + 1, cases.len(), case.name));
        let mut started = Instant::now();
        let mut took = |outcome: &mut TimeErrorOutcome, part| {
            *outcome.seconds.entry(part).or_default() += started.elapsed().as_secs_f64();
            started = Instant::now();
        };
        let truth = Truth::new(case, effort, bench.seed, bench.progress);
        truth.check(case)?;
        took(&mut outcome, "casting the truth's rays");
        outcome.budgets.push(budget(bench, case, &truth, default_options())?);
        took(&mut outcome, "baking and budgets");
        outcome.pictures.push(pictures(bench, case, folder)?);
        took(&mut outcome, "pictures");
        outcome.comparisons.extend(compare(bench, case, &truth)?);
        took(&mut outcome, "the rival");
        if is_swept(case) || sweeps_all {
            outcome.points.extend(sweep(bench, case, &truth, &all)?);
            took(&mut outcome, "sweeps with their bakes");
        }
    }
    write_all(bench, folder, selection, &outcome)?;
    Ok(outcome)
}

/// A case that can be named; one of small lights is made only when it is.
enum Nameable {
    Made(Box<Case>),
    Small(SmallLight, String),
}

impl Nameable {
    fn name(&self) -> &str {
        match self {
            Nameable::Made(case) => &case.name,
            Nameable::Small(_, name) => name,
        }
    }

    fn case(self) -> Result<Case> {
        match self {
            Nameable::Made(case) => Ok(*case),
            Nameable::Small(which, _) => which.case(),
        }
    }
}

/// The named cases, or all but those of small lights. A quick run without names leaves out cases that take ten seconds or more to
/// bake on two cores, and uses the teapot under one light only.
fn chosen(quick: bool, named: &[String]) -> Result<Vec<Case>> {
    let mut all: Vec<Case> = cases::teapot_lights()?.into_iter().chain(cases::scenes()?).collect();
    if named.is_empty() {
        let cheap = |name: &str| ["sphere_over_plane", "torus_over_plane"].contains(&name) || name.contains("(b)");
        all.retain(|case| !quick || cheap(&case.name));
        return Ok(all);
    }
    let small = SmallLight::all().into_iter().map(|which| Nameable::Small(which, which.name()));
    let all: Vec<Nameable> = all.into_iter().map(|case| Nameable::Made(Box::new(case))).chain(small).collect();
    cases::named(all, named, Nameable::name)?.into_iter().map(Nameable::case).collect()
}

/// The default, and the settings of the named axes, or of all axes.
fn variations_of(quick: bool, axes: &[String]) -> Result<Vec<Variation>> {
    let mut all = variations(quick && axes.is_empty());
    for axis in axes {
        if !all.iter().any(|v| v.axis == axis) {
            let mut names: Vec<&str> = all.iter().skip(1).map(|v| v.axis).collect();
            names.dedup();
            return Err(Error::Usage(format!("unknown axis \"{axis}\" ({})", names.join(", "))));
        }
    }
    all.retain(|v| axes.is_empty() || v.axis == "default" || axes.iter().any(|axis| v.axis == axis));
    Ok(all)
}

/// Variations need new bakes, so only two cases are swept by default: one occluder under a sky, and one with a local light.
fn is_swept(case: &Case) -> bool {
    case.name == "torus_over_plane" || case.name.contains("(b)")
}

fn write_all(bench: &Bench<'_>, folder: &Path, selection: &Selection, outcome: &TimeErrorOutcome) -> Result<()> {
    fn rows(of: &[impl Serialize]) -> Vec<Value> {
        of.iter().map(|row| serde_json::to_value(row).expect("rows are plain data")).collect()
    }
    let origin = json!({
        "origin": bench.origin, "quick": bench.quick, "seed": bench.seed, "selection": selection,
        "errors": "relative to the root mean square of T0 over the judged vertices",
    });
    write(&folder.join("budget.csv"), &csv(&origin, &rows(&outcome.budgets)))?;
    write(&folder.join("sweep.csv"), &csv(&origin, &rows(&outcome.points)))?;
    let rivals: Vec<Value> = outcome.comparisons.iter().flat_map(rival_rows).collect();
    write(&folder.join("rival.csv"), &csv(&origin, &rivals))?;
    write(&folder.join("time-error.json"), &format!("{:#}\n", json!({ "origin": origin, "outcome": outcome })))?;
    for (index, case) in verdict::swept(&outcome.points).iter().enumerate() {
        let svg = plot(case, outcome).svg();
        write(&folder.join(format!("time-error-{}.svg", index + 1)), &svg)?;
    }
    write(&folder.join("rival.svg"), &rival_plot(&outcome.comparisons).svg())?;
    let page = [
        verdict::defaults(&outcome.points),
        verdict::rivals(&outcome.comparisons),
        verdict::budgets(&outcome.budgets),
        verdict::pictures(&outcome.pictures),
        format!("This run took {}.\n", outcome.took()),
    ];
    write(&folder.join("time-error.txt"), &page.join("\n"))
}

/// One row for the merge, and one for each number of rays and each shadow map.
fn rival_rows(comparison: &Comparison) -> Vec<Value> {
    let row = |what: String, wall_ms: f64, error| {
        json!({
            "case": comparison.case, "light": comparison.light, "what": what, "vertex_count": comparison.vertices, "thread_count": comparison.threads,
            "wall_ms": wall_ms, "error": error,
            "speed_up_at_equal_rms_ratio": comparison.speed_up_at_equal_rms,
            "merge_speed_up_at_equal_rms_ratio": comparison.merge_speed_up_at_equal_rms, "rays_at_equal_rms_count": comparison.rays_at_equal_rms,
        })
    };
    let lights = comparison.lights.map_or(String::new(), |lights| format!(", lights {lights:?}").to_lowercase());
    let merge = row(format!("merge{lights}"), comparison.frame_wall_ms.median, comparison.merge_error);
    let cast = comparison.rival.iter().map(|p| row(format!("{} rays", p.rays), p.wall_ms.median, p.error));
    let maps = comparison.maps.iter().map(|p| row(p.title(), p.wall_ms.median, p.error));
    // A second comparison of a case is with the same rivals.
    let rivals = cast.chain(maps).filter(|_| comparison.lights != Some(Lights::Sh));
    std::iter::once(merge).chain(rivals).collect()
}

/// Plot of the settings of a case with their Pareto front, and of that front beside ray casting.
fn plot(case: &str, outcome: &TimeErrorOutcome) -> Plot {
    let points: Vec<&Point> = outcome.points.iter().filter(|p| p.case == case).collect();
    let places: Vec<(f64, f64)> = points.iter().map(|p| (p.merge_ms.median, p.total.rms)).collect();
    let dot = |p: &&Point| Dot {
        label: if p.axis == "default" { format!("default: {}", p.name) } else { format!("{}: {}", p.axis, p.name) },
        group: p.axis.into(),
        x: p.merge_ms.median,
        y: p.total.rms,
        x_range: Some((p.merge_ms.lower, p.merge_ms.upper)),
    };
    let own = Panel {
        title: "Every setting of the merge".into(),
        x_label: "merge on the device, milliseconds (median, quartiles)".into(),
        y_label: "RMS error of radiosity against ray casting, relative".into(),
        dots: points.iter().map(dot).collect(),
        front: pareto(&places),
        ..Panel::default()
    };
    let rival = outcome.comparisons.iter().find(|c| c.case == case);
    let beside = Panel {
        title: "Beside its rivals".into(),
        x_label: "milliseconds (median); numbers: rays a vertex and light, texels across a map".into(),
        dots: own.dots.iter().cloned().map(|dot| Dot { x_range: None, ..dot }).collect(),
        numbered: false,
        curves: rival.map(rival_curves).unwrap_or_default(),
        gap: rival.and_then(|c| {
            let lead = c.speed_up_at_equal_rms?;
            let (from, to, y) = (c.frame_wall_ms.median, c.rival_ms_at_equal_rms?, c.merge_error.rms);
            let label = if lead >= 1.0 { "faster" } else { "slower" };
            let label = format!("a frame: {} times {label}", three(lead.max(1.0 / lead)));
            Some(Gap { from, to, y, label })
        }),
        ..own.clone()
    };
    Plot { title: format!("{case}: time against error"), panels: vec![own, beside] }
}

/// Ray casting, and shadow maps of either filter where there are any.
fn rival_curves(c: &Comparison) -> Vec<Curve> {
    let rays = Curve {
        label: format!("ray casting, {} threads", c.threads),
        points: c.rival.iter().map(|p| (p.wall_ms.median, p.error.rms)).collect(),
        notes: c.rival.iter().map(|p| p.rays.to_string()).collect(),
    };
    let maps = |(filter, label): (Filter, &str)| {
        let of = || c.maps.iter().filter(move |p| p.filter == filter);
        Curve {
            label: label.into(),
            points: of().map(|p| (p.wall_ms.median, p.error.rms)).collect(),
            notes: of().map(|p| p.map_px.to_string()).collect(),
        }
    };
    let maps = [(Filter::Hard, "shadow maps, hard"), (Filter::Pcss, "shadow maps, PCSS")].map(maps);
    std::iter::once(rays).chain(maps.into_iter().filter(|curve| !curve.points.is_empty())).collect()
}

/// Plot of every case's times at equal error.
fn rival_plot(comparisons: &[Comparison]) -> Rows {
    let column =
        |x_label: &str, values: &dyn Fn(&Comparison) -> [Option<f64>; 2], limit: Option<(f64, String)>| PlotColumn {
            x_label: x_label.into(),
            scale: AxisScale::Log,
            limit,
            values: comparisons.iter().map(|c| values(c).to_vec()).collect(),
        };
    let times: &dyn Fn(&Comparison) -> [Option<f64>; 2] = &|c| [Some(c.frame_wall_ms.median), c.rival_ms_at_equal_rms];
    let lead: &dyn Fn(&Comparison) -> [Option<f64>; 2] = &|c| [c.speed_up_at_equal_rms, None];
    Rows {
        title: "Merge and ray casting at equal error".into(),
        series: vec!["merge (a frame without drawing)".into(), "ray casting on as many threads".into()],
        groups: vec![RowGroup { heading: String::new(), rows: comparisons.iter().map(Comparison::title).collect() }],
        columns: vec![
            column("wall time, milliseconds (median)", times, None),
            column("how many times faster the merge is", lead, Some((1.0, "equal".into()))),
        ],
    }
}
