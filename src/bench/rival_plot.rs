//! Plots of `bench time-error`: each case's time against error, and all cases beside ray casting.

use super::judged::JudgedAt;
use super::plot::{AxisScale, Curve, Dot, Gap, Plot, PlotColumn, PlotPanel, RowGroup, Rows};
use super::rival::Comparison;
use super::shadow_map::Filter;
use super::sweep::{Point, pareto};
use crate::text::three;

/// Label of the axis of errors.
const ERROR: &str = "RMS error of radiosity against ray casting, relative";

/// The plot of a case: every way to take the lights beside all rivals, at vertices and at pixels, after the settings of the merge with
/// their Pareto front where the case was swept.
pub fn case_plot(case: &str, points: &[Point], comparisons: &[Comparison]) -> Plot {
    let points: Vec<&Point> = points.iter().filter(|p| p.case == case).collect();
    let settings = (!points.is_empty()).then(|| settings(&points));
    let rivals = [JudgedAt::Vertices, JudgedAt::Pixels].into_iter().filter_map(|place| {
        let of = comparisons.iter().filter(|c| c.case == case && c.place == place);
        rivals(&of.collect::<Vec<_>>())
    });
    Plot { title: format!("{case}: time against error"), panels: settings.into_iter().chain(rivals).collect() }
}

fn settings(points: &[&Point]) -> PlotPanel {
    let places: Vec<(f64, f64)> = points.iter().map(|p| (p.merge_ms.median, p.total.rms)).collect();
    let dot = |p: &&Point| Dot {
        label: if p.axis == "default" { format!("default: {}", p.name) } else { format!("{}: {}", p.axis, p.name) },
        group: p.axis.into(),
        x: p.merge_ms.median,
        y: p.total.rms,
        x_range: Some((p.merge_ms.lower, p.merge_ms.upper)),
    };
    PlotPanel {
        title: "Every setting of the merge, at vertices".into(),
        x_label: "merge on the device, milliseconds (median, quartiles)".into(),
        y_label: ERROR.into(),
        dots: points.iter().map(dot).collect(),
        front: pareto(&places),
        ..PlotPanel::default()
    }
}

/// The panel of comparisons that share their rivals; the first of them has its lead marked.
fn rivals(comparisons: &[&Comparison]) -> Option<PlotPanel> {
    let first = comparisons.first()?;
    let (title, includes) = match first.place {
        JudgedAt::Vertices => ("A frame and its rivals, at vertices", "without drawing"),
        JudgedAt::Pixels => ("A picture and its rivals, at pixels", "with drawing"),
    };
    let gap = first.speed_up_at_equal_rms.zip(first.rival_ms_at_equal_rms).map(|(lead, to)| {
        let label = if lead >= 1.0 { "faster" } else { "slower" };
        let label = format!("{} times {label}", three(lead.max(1.0 / lead)));
        Gap { from: first.frame_wall_ms.median, to, y: first.merge_error.rms, label }
    });
    let ours = comparisons.iter().map(|c| Curve {
        label: c.merge_title().into(),
        points: vec![(c.frame_wall_ms.median, c.merge_error.rms)],
        notes: Vec::new(),
    });
    Some(PlotPanel {
        title: title.into(),
        x_label: format!("milliseconds {includes} (median); numbers: rays a light, texels across"),
        y_label: ERROR.into(),
        curves: rival_curves(first).into_iter().chain(ours).collect(),
        gap,
        ..PlotPanel::default()
    })
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
pub fn rival_plot(comparisons: &[Comparison]) -> Rows {
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
        series: vec!["merge (a frame; at vertices without drawing)".into(), "ray casting on as many threads".into()],
        groups: vec![RowGroup { heading: String::new(), rows: comparisons.iter().map(Comparison::title).collect() }],
        columns: vec![
            column("wall time, milliseconds (median)", times, None),
            column("how many times faster the merge is", lead, Some((1.0, "equal".into()))),
        ],
    }
}
