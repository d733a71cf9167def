//! A scatter plot with logarithmic axes as SVG: numbered points, their Pareto front, and curves for comparison.

use std::fmt::Write;

const WIDTH: f64 = 980.0;
const HEIGHT: f64 = 620.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 600.0;
const TOP: f64 = 60.0;
const BOTTOM: f64 = 550.0;
const COLORS: [&str; 9] =
    ["#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#7f7f7f", "#e69f00", "#56b4e9", "#8c564b"];

/// A point with its place in the legend.
pub struct Dot {
    /// For the legend.
    pub label: String,
    /// Points of one group have one colour.
    pub group: String,
    /// Greater than 0.
    pub x: f64,
    /// Greater than 0.
    pub y: f64,
}

/// A line through points.
pub struct Curve {
    /// Written at its last point within the plot.
    pub label: String,
    /// (x, y), both greater than 0.
    pub points: Vec<(f64, f64)>,
}

/// A plot.
pub struct Plot {
    /// Above it.
    pub title: String,
    /// Below the x axis, unit included.
    pub x_label: String,
    /// Beside the y axis, unit included.
    pub y_label: String,
    /// Numbered from 1.
    pub dots: Vec<Dot>,
    /// Indices into `dots`, joined by a step line.
    pub front: Vec<usize>,
    /// Other lines.
    pub curves: Vec<Curve>,
}

/// A logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = values.filter(|v| *v > 0.0).fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.1, 10.0) };
        Axis { low: (low / 1.3).ln(), high: (high * 1.3).ln(), from, to }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (value.ln() - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// 1, 2 and 5 times the powers of ten within.
    fn ticks(&self) -> Vec<f64> {
        let decades = (self.low / 10_f64.ln()).floor() as i32..=(self.high / 10_f64.ln()).ceil() as i32;
        let all = decades.flat_map(|d| [1.0, 2.0, 5.0].map(|m| m * 10_f64.powi(d)));
        all.filter(|t| (self.low..=self.high).contains(&t.ln())).collect()
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Plot {
    /// The plot as an SVG document.
    pub fn svg(&self) -> String {
        let curves = || self.curves.iter().flat_map(|c| &c.points);
        let x = Axis::new(self.dots.iter().map(|d| d.x).chain(curves().map(|p| p.0)), LEFT, RIGHT);
        let y = Axis::new(self.dots.iter().map(|d| d.y).chain(curves().map(|p| p.1)), BOTTOM, TOP);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        );
        // Writing to a string cannot fail.
        let mut text = |x: f64, y: f64, extra: &str, words: &str| {
            let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" {extra}>{}</text>", escape(words));
        };
        text(LEFT, 30.0, "font-size=\"16\"", &self.title);
        text((LEFT + RIGHT) / 2.0, BOTTOM + 40.0, "text-anchor=\"middle\"", &self.x_label);
        let turned = format!("text-anchor=\"middle\" transform=\"rotate(-90 20 {})\"", (TOP + BOTTOM) / 2.0);
        text(20.0, (TOP + BOTTOM) / 2.0, &turned, &self.y_label);
        for tick in x.ticks() {
            text(x.at(tick), BOTTOM + 18.0, "text-anchor=\"middle\"", &tick_label(tick));
        }
        for tick in y.ticks() {
            text(LEFT - 6.0, y.at(tick) + 4.0, "text-anchor=\"end\"", &tick_label(tick));
        }
        for (i, dot) in self.dots.iter().enumerate() {
            let color = self.color(&dot.group);
            text(
                x.at(dot.x) + 6.0,
                y.at(dot.y) - 5.0,
                &format!("fill=\"{color}\" font-size=\"10\""),
                &format!("{}", i + 1),
            );
            let legend = format!("{}  {}", i + 1, dot.label);
            text(RIGHT + 24.0, TOP + 15.0 * i as f64, &format!("fill=\"{color}\" font-size=\"11\""), &legend);
        }
        for curve in &self.curves {
            if let Some(&(at_x, at_y)) = curve.points.last() {
                text(x.at(at_x) - 4.0, y.at(at_y) - 8.0, "text-anchor=\"end\" fill=\"#a00000\"", &curve.label);
            }
        }
        for tick in x.ticks() {
            let at = x.at(tick);
            let _ = writeln!(out, "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"#dddddd\" fill=\"none\"/>");
        }
        for tick in y.ticks() {
            let at = y.at(tick);
            let _ = writeln!(out, "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"#dddddd\" fill=\"none\"/>");
        }
        let front = self.front.iter().map(|&i| (x.at(self.dots[i].x), y.at(self.dots[i].y)));
        let steps: String = front
            .enumerate()
            .map(|(i, (x, y))| if i == 0 { format!("M{x:.1} {y:.1}") } else { format!("H{x:.1}V{y:.1}") })
            .collect();
        if !steps.is_empty() {
            let _ = writeln!(out, "<path d=\"{steps}\" stroke=\"#0072b2\" stroke-dasharray=\"5 3\" fill=\"none\"/>");
        }
        for curve in &self.curves {
            let points = curve.points.iter().map(|p| format!("{:.1},{:.1}", x.at(p.0), y.at(p.1)));
            let points: Vec<String> = points.collect();
            let _ = writeln!(out, "<polyline points=\"{}\" stroke=\"#a00000\" fill=\"none\"/>", points.join(" "));
        }
        for dot in &self.dots {
            let (x, y, color) = (x.at(dot.x), y.at(dot.y), self.color(&dot.group));
            let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{color}\"/>");
        }
        out + "</svg>\n"
    }

    fn color(&self, group: &str) -> &'static str {
        let mut groups: Vec<&str> = Vec::new();
        for dot in &self.dots {
            if !groups.contains(&dot.group.as_str()) {
                groups.push(&dot.group);
            }
        }
        COLORS[groups.iter().position(|g| *g == group).unwrap_or(0) % COLORS.len()]
    }
}

fn tick_label(value: f64) -> String {
    if (1e-3..1e5).contains(&value) { format!("{value}") } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_names_what_it_shows() {
        let dot = |label: &str, x, y| Dot { label: label.into(), group: label.into(), x, y };
        let plot = Plot {
            title: "a < b".into(),
            x_label: "milliseconds".into(),
            y_label: "error".into(),
            dots: vec![dot("fast", 1.0, 0.1), dot("exact", 10.0, 0.001)],
            front: vec![0, 1],
            curves: vec![Curve { label: "rival".into(), points: vec![(100.0, 0.1), (1000.0, 0.01)] }],
        };
        let svg = plot.svg();
        for word in ["a &lt; b", "milliseconds", "1  fast", "2  exact", "rival", ">1000<"] {
            assert!(svg.contains(word), "{word} in {svg}");
        }
        assert!(!svg.contains("NaN") && svg.matches("<circle").count() == 2);
        let empty = Plot { dots: vec![], front: vec![], curves: vec![], ..plot };
        assert!(!empty.svg().contains("NaN"));
    }
}
