//! Plots as SVG: numbered points with a list, their Pareto front and curves ([`Plot`]), and named rows with one mark per series
//! ([`Rows`]). Series differ by colour and by shape; the colours are those of Okabe and Ito and a grey, which colour-blind
//! readers can distinguish.

mod axis;
mod points;
mod rows;

pub use axis::AxisScale;
pub use points::{Curve, Dot, Gap, Plot, PlotPanel};
pub use rows::{PlotColumn, RowGroup, Rows};

use std::fmt::Write;

/// Colours of series in order; after the last colour they repeat with other shapes.
const COLORS: [&str; 8] = ["#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a8a8a"];
/// Width in pixels of a letter of 11 px, a little above the average.
const LETTER: f64 = 6.3;

/// An SVG document that grows.
struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    fn new(width: f64, height: f64) -> Self {
        Svg { width, height, body: String::new() }
    }

    /// Appends one element. Writing to a string cannot fail.
    fn put(&mut self, element: std::fmt::Arguments<'_>) {
        let _ = writeln!(self.body, "{element}");
    }

    fn text(&mut self, x: f64, y: f64, extra: &str, words: &str) {
        let words = words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        self.put(format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" {extra}>{words}</text>"));
    }

    /// Grey text with a white outline, readable where it crosses a line.
    fn noted(&mut self, x: f64, y: f64, extra: &str, words: &str) {
        let halo = "stroke=\"white\" stroke-width=\"4\" stroke-linejoin=\"round\" fill=\"white\"";
        self.text(x, y, &format!("{extra} {halo}"), words);
        self.text(x, y, &format!("{extra} fill=\"#333333\""), words);
    }

    fn line(&mut self, [x1, y1, x2, y2]: [f64; 4], extra: &str) {
        self.put(format_args!("<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" fill=\"none\" {extra}/>"));
    }

    /// A mark of a series: its colour and its shape.
    fn mark(&mut self, x: f64, y: f64, series: usize, size: f64) {
        let color = color(series);
        let corners: &[(f64, f64)] = match series % 6 {
            0 => &[],
            1 => &[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
            2 => &[(0.0, -1.15), (1.05, 0.8), (-1.05, 0.8)],
            3 => &[(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)],
            4 => &[(0.0, 1.15), (1.05, -0.8), (-1.05, -0.8)],
            _ => &[(0.0, -1.2), (1.15, -0.35), (0.7, 1.0), (-0.7, 1.0), (-1.15, -0.35)],
        };
        let edge = "stroke=\"white\" stroke-width=\"0.8\"";
        if corners.is_empty() {
            self.put(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{size:.1}\" fill=\"{color}\" {edge}/>"));
        } else {
            let at = |(dx, dy): &(f64, f64)| format!("{:.1},{:.1}", x + size * dx, y + size * dy);
            let at: Vec<String> = corners.iter().map(at).collect();
            self.put(format_args!("<polygon points=\"{}\" fill=\"{color}\" {edge}/>", at.join(" ")));
        }
    }

    fn finish(self) -> String {
        let (width, height) = (self.width.ceil(), self.height.ceil());
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }
}

fn color(series: usize) -> &'static str {
    COLORS[series % COLORS.len()]
}

/// Index of a name among the names in order of appearance.
fn place(names: &mut Vec<String>, name: &str) -> usize {
    names.iter().position(|n| n == name).unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    })
}
