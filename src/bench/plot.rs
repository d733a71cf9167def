//! Plots of curves on logarithmic axes, as SVG.

use crate::error::{Error, Result};
use crate::text::{self, three};
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;

/// A line through points (x, y).
pub struct Curve {
    /// Text in the legend.
    pub label: String,
    /// From left to right, or in the order in which they are joined.
    pub points: Vec<(f64, f64)>,
    /// Text at each point; may be empty.
    pub notes: Vec<String>,
}

const SIZE_PX: (u32, u32) = (960, 600);
/// Palette of Okabe and Ito, which colour-blind readers can distinguish.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

pub fn write(path: &Path, title: &str, x_label: &str, y_label: &str, curves: &[Curve]) -> Result<()> {
    let mut svg = String::new();
    draw(&mut svg, title, x_label, y_label, curves)
        .map_err(|error| Error::Failed(format!("{}: cannot be drawn: {error}", path.display())))?;
    text::write(path, svg)
}

fn draw(
    svg: &mut String,
    title: &str,
    x_label: &str,
    y_label: &str,
    curves: &[Curve],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE_PX).into_drawing_area();
    root.fill(&WHITE)?;
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let x_range = range(points().map(|point| point.0)).log_scale();
    let y_range = range(points().map(|point| point.1)).log_scale();
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d(x_range, y_range)?;
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .x_label_formatter(&|x| three(*x))
        .y_label_formatter(&|y| three(*y))
        .draw()?;
    for (curve, color) in curves.iter().zip(COLORS.iter().cycle()) {
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), color.stroke_width(2)))?
            .label(&curve.label)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        chart.draw_series(curve.points.iter().map(|&point| Circle::new(point, 4, color.filled())))?;
        let notes = curve.points.iter().zip(&curve.notes);
        chart.draw_series(
            notes.map(|(&point, note)| EmptyElement::at(point) + Text::new(note.clone(), (7, -12), ("sans-serif", 12))),
        )?;
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    root.present()?;
    Ok(())
}

/// The range of some values above 0 with a margin.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| *v > 0.0 && v.is_finite())
        .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if low <= high { low / 1.3..high * 1.3 } else { 0.1..10.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_names_what_it_shows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        let curve = |label: &str, notes: &[&str]| Curve {
            label: label.into(),
            points: vec![(1.0, 0.1), (1000.0, 0.01)],
            notes: notes.iter().map(|note| (*note).to_owned()).collect(),
        };
        write(&path, "a < b", "milliseconds", "error", &[curve("ours", &[]), curve("rival", &["4", "16 rays"])])
            .unwrap();
        let svg = std::fs::read_to_string(&path).unwrap();
        for word in ["a &lt; b", "milliseconds", "error", "ours", "rival", "16 rays"] {
            assert!(svg.contains(word), "{word} in {svg}");
        }
        write(&path, "", "", "", &[]).unwrap();
        assert!(!std::fs::read_to_string(&path).unwrap().contains("NaN"));
    }
}
