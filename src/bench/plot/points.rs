//! Plots of numbered points with a list, their Pareto front, and curves.

use super::axis::{Axis, AxisScale};
use super::{LETTER, Svg, color, place};

const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 460.0;
const MARGIN: f64 = 84.0;
const TOP: f64 = 74.0;
const BOTTOM: f64 = TOP + HEIGHT;
const LEGEND_ROW: f64 = 14.5;

/// A point, and its line in the list.
#[derive(Clone)]
pub struct Dot {
    /// Text in the list.
    pub label: String,
    /// Points of one group have the same colour and shape.
    pub group: String,
    /// Value on the x axis.
    pub x: f64,
    /// Value on the y axis.
    pub y: f64,
    /// Range of x, drawn as a line.
    pub x_range: Option<(f64, f64)>,
}

/// A line through points.
#[derive(Clone, Default)]
pub struct Curve {
    /// Text in the list.
    pub label: String,
    /// Values (x, y).
    pub points: Vec<(f64, f64)>,
    /// Text at each point; may be empty.
    pub notes: Vec<String>,
}

/// A marked distance along x.
#[derive(Clone)]
pub struct Gap {
    /// Start on the x axis.
    pub from: f64,
    /// End on the x axis.
    pub to: f64,
    /// Value on the y axis.
    pub y: f64,
    /// Text at the end of the marked distance.
    pub label: String,
}

/// A pair of axes.
#[derive(Clone)]
pub struct PlotPanel {
    /// Title above the panel.
    pub title: String,
    /// Label below the x axis, with its unit.
    pub x_label: String,
    /// Label beside the y axis, with its unit.
    pub y_label: String,
    /// Scales of x and y.
    pub scales: [AxisScale; 2],
    /// Points.
    pub dots: Vec<Dot>,
    /// Whether points are numbered as in the list.
    pub numbered: bool,
    /// Indices into `dots` in order of x; they are joined by steps.
    pub front: Vec<usize>,
    /// Lines.
    pub curves: Vec<Curve>,
    /// A distance between points and curves.
    pub gap: Option<Gap>,
}

impl Default for PlotPanel {
    /// An empty panel with logarithmic axes.
    fn default() -> Self {
        PlotPanel {
            title: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            scales: [AxisScale::Log; 2],
            dots: Vec::new(),
            numbered: true,
            front: Vec::new(),
            curves: Vec::new(),
            gap: None,
        }
    }
}

/// Panels side by side and one list of what they show.
pub struct Plot {
    /// Title above the panels.
    pub title: String,
    /// Panels from left to right; the first one's points are listed.
    pub panels: Vec<PlotPanel>,
}

/// Names of groups and curves in order of appearance, which determines colours and shapes.
struct Names {
    groups: Vec<String>,
    curves: Vec<String>,
}

impl Plot {
    /// The plot as an SVG document.
    pub fn svg(&self) -> String {
        let mut names = Names { groups: Vec::new(), curves: Vec::new() };
        for panel in &self.panels {
            panel.dots.iter().for_each(|dot| _ = place(&mut names.groups, &dot.group));
            panel.curves.iter().for_each(|curve| _ = place(&mut names.curves, &curve.label));
        }
        let listed: &[Dot] = self.panels.first().map_or(&[], |p| if p.numbered { &p.dots } else { &[] });
        let front = self.panels.iter().any(|p| !p.front.is_empty());
        let lines = listed.len() + names.curves.len() + usize::from(front);
        let longest = listed.iter().map(|d| d.label.len()).chain(names.curves.iter().map(String::len)).max();
        let legend = 60.0 + 1.06 * LETTER * longest.unwrap_or(0).max(if front { 46 } else { 0 }) as f64;
        let left = (MARGIN + WIDTH) * self.panels.len() as f64 + 30.0;
        let mut svg = Svg::new(left + legend, (TOP + LEGEND_ROW * lines as f64 + 20.0).max(BOTTOM + 60.0));
        svg.text(20.0, 30.0, "font-size=\"16\"", &self.title);
        for (i, panel) in self.panels.iter().enumerate() {
            let left = MARGIN + (MARGIN + WIDTH) * i as f64;
            PanelDrawing::new(panel, &names, left).draw(&mut svg);
        }
        let mut y = TOP + 8.0;
        for (i, dot) in listed.iter().enumerate() {
            let series = place(&mut names.groups, &dot.group);
            svg.text(left + 22.0, y, "text-anchor=\"end\" font-size=\"11\"", &format!("{}", i + 1));
            svg.mark(left + 33.0, y - 4.0, series, 4.0);
            let weight = if self.panels[0].front.contains(&i) { "font-weight=\"bold\"" } else { "" };
            svg.text(left + 43.0, y, &format!("font-size=\"11\" {weight}"), &dot.label);
            y += LEGEND_ROW;
        }
        if front {
            svg.line([left + 8.0, y - 4.0, left + 37.0, y - 4.0], FRONT);
            svg.text(left + 43.0, y, "font-size=\"11\"", "Pareto front (bold): none is faster and nearer");
            y += LEGEND_ROW;
        }
        for (i, name) in names.curves.iter().enumerate() {
            let series = names.groups.len() + i;
            svg.line([left + 8.0, y - 4.0, left + 37.0, y - 4.0], &stroke(series));
            svg.mark(left + 22.0, y - 4.0, series, 3.5);
            svg.text(left + 43.0, y, "font-size=\"11\"", name);
            y += LEGEND_ROW;
        }
        svg.finish()
    }
}

const FRONT: &str = "stroke=\"#0072b2\" stroke-width=\"1.6\" stroke-dasharray=\"6 3\"";

fn stroke(series: usize) -> String {
    format!("stroke=\"{}\" stroke-width=\"1.5\"", color(series))
}

/// A panel at its position in the plot.
struct PanelDrawing<'p> {
    panel: &'p PlotPanel,
    names: &'p Names,
    left: f64,
    x: Axis,
    y: Axis,
}

/// A rectangle: low x, low y, high x, high y.
type Rectangle = [f64; 4];

fn meet(a: &Rectangle, b: &Rectangle) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

impl<'p> PanelDrawing<'p> {
    fn new(panel: &'p PlotPanel, names: &'p Names, left: f64) -> Self {
        let curves = || panel.curves.iter().flat_map(|c| &c.points);
        let ranges = panel.dots.iter().filter_map(|d| d.x_range).flat_map(|(low, high)| [low, high]);
        let gap = panel.gap.iter().flat_map(|g| [g.from, g.to]);
        let xs = panel.dots.iter().map(|d| d.x).chain(ranges).chain(curves().map(|p| p.0)).chain(gap);
        let ys = panel.dots.iter().map(|d| d.y).chain(curves().map(|p| p.1));
        let x = Axis::new(panel.scales[0], xs, left, left + WIDTH);
        PanelDrawing { panel, names, left, x, y: Axis::new(panel.scales[1], ys, BOTTOM, TOP) }
    }

    fn draw(&self, svg: &mut Svg) {
        let (panel, left, right) = (self.panel, self.left, self.left + WIDTH);
        let middle = "text-anchor=\"middle\"";
        svg.text(left, TOP - 10.0, "font-weight=\"bold\"", &panel.title);
        svg.text(left + WIDTH / 2.0, BOTTOM + 40.0, middle, &panel.x_label);
        let (at_x, at_y) = (left - 62.0, TOP + HEIGHT / 2.0);
        svg.text(at_x, at_y, &format!("{middle} transform=\"rotate(-90 {at_x} {at_y})\""), &panel.y_label);
        for (value, name) in self.x.ticks(45.0) {
            let at = self.x.at(value);
            svg.line([at, TOP, at, BOTTOM], "stroke=\"#e4e4e4\"");
            svg.text(at, BOTTOM + 18.0, &format!("{middle} font-size=\"11\""), &name);
        }
        for (value, name) in self.y.ticks(34.0) {
            let at = self.y.at(value);
            svg.line([left, at, right, at], "stroke=\"#e4e4e4\"");
            svg.text(left - 6.0, at + 4.0, "text-anchor=\"end\" font-size=\"11\"", &name);
        }
        svg.put(format_args!(
            "<rect x=\"{left:.1}\" y=\"{TOP}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"#999999\"/>"
        ));
        self.front(svg);
        self.curves(svg);
        for &i in &panel.front {
            let (x, y) = self.at((panel.dots[i].x, panel.dots[i].y));
            svg.put(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7.5\" fill=\"none\" stroke=\"#0072b2\"/>"));
        }
        // The first point is drawn last, on top.
        for dot in panel.dots.iter().rev() {
            let (at, series) = (self.at((dot.x, dot.y)), self.series(&dot.group));
            if let Some((low, high)) = dot.x_range {
                svg.line([self.x.at(low), at.1, self.x.at(high), at.1], &stroke(series));
            }
            svg.mark(at.0, at.1, series, 4.5);
        }
        if panel.numbered {
            self.numbers(svg);
        }
        if let Some(gap) = &panel.gap {
            let (from, to, y) = (self.x.at(gap.from), self.x.at(gap.to), self.y.at(gap.y));
            svg.line([from, y, to, y], "stroke=\"#444444\" stroke-width=\"1.2\" stroke-dasharray=\"2 3\"");
            svg.line([to, y - 5.0, to, y + 5.0], "stroke=\"#444444\" stroke-width=\"1.2\"");
            // The label lies right of the gap, where a falling curve leaves room, if the gap ends early enough.
            let (at, anchor) =
                if to < self.left + 0.6 * WIDTH { (to + 9.0, "start") } else { (from.max(to) - 9.0, "end") };
            svg.noted(at, y - 7.0, &format!("text-anchor=\"{anchor}\""), &gap.label);
        }
    }

    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    fn series(&self, group: &str) -> usize {
        self.names.groups.iter().position(|g| g == group).unwrap_or(0)
    }

    /// Draws steps from the top edge over the points to the right edge.
    fn front(&self, svg: &mut Svg) {
        let points = self.panel.front.iter().map(|&i| self.at((self.panel.dots[i].x, self.panel.dots[i].y)));
        let mut steps = String::new();
        for (x, y) in points {
            steps += &if steps.is_empty() { format!("M{x:.1} {TOP}V{y:.1}") } else { format!("H{x:.1}V{y:.1}") };
        }
        if !steps.is_empty() {
            svg.put(format_args!("<path d=\"{steps}H{:.1}\" fill=\"none\" {FRONT}/>", self.left + WIDTH));
        }
    }

    fn curves(&self, svg: &mut Svg) {
        for curve in &self.panel.curves {
            let place = self.names.curves.iter().position(|name| *name == curve.label).unwrap_or(0);
            let series = self.names.groups.len() + place;
            let points: Vec<(f64, f64)> = curve.points.iter().map(|p| self.at(*p)).collect();
            let joined: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            svg.put(format_args!("<polyline points=\"{}\" fill=\"none\" {}/>", joined.join(" "), stroke(series)));
            for (i, (x, y)) in points.iter().enumerate() {
                svg.mark(*x, *y, series, 3.5);
                if let Some(note) = curve.notes.get(i) {
                    // Notes of the second curve are below it, so that notes of close curves do not overlap.
                    let y = if place == 1 { y + 14.0 } else { y - 6.0 };
                    svg.noted(x + 6.0, y, "font-size=\"10\"", note);
                }
            }
        }
    }

    /// Draws numbers beside their points where they cover neither points nor other numbers. Coinciding points share a label.
    fn numbers(&self, svg: &mut Svg) {
        let places: Vec<(f64, f64)> = self.panel.dots.iter().map(|d| self.at((d.x, d.y))).collect();
        let mut spots: Vec<Vec<usize>> = Vec::new();
        for (i, (x, y)) in places.iter().enumerate() {
            let near = |spot: &&mut Vec<usize>| (places[spot[0]].0 - x).hypot(places[spot[0]].1 - y) < 5.0;
            match spots.iter_mut().find(near) {
                Some(spot) => spot.push(i),
                None => spots.push(vec![i]),
            }
        }
        let around = |(x, y): &(f64, f64)| [x - 6.0, y - 6.0, x + 6.0, y + 6.0];
        let mut taken: Vec<Rectangle> = places.iter().map(around).collect();
        for spot in spots {
            let (x, y) = places[spot[0]];
            let words = ranges(&spot);
            let (width, height) = (5.8 * words.len() as f64, 9.0);
            let tries = [12.0, 18.0, 25.0, 35.0, 48.0, 64.0, 82.0].into_iter().flat_map(|radius| {
                (0..16).map(move |turn| (radius, std::f64::consts::PI * (f64::from(turn) / 8.0 - 0.25)))
            });
            let mut boxes = tries.map(|(radius, angle)| {
                let (cx, cy) = (x + (radius + width / 2.0 - 3.0) * angle.cos(), y + radius * angle.sin());
                (radius, [cx - width / 2.0, cy - height / 2.0, cx + width / 2.0, cy + height / 2.0])
            });
            let free = |(_, at): &(f64, Rectangle)| {
                let inside = at[0] > self.left + 2.0 && at[2] < self.left + WIDTH - 2.0;
                inside && at[1] > TOP + 2.0 && at[3] < BOTTOM - 2.0 && !taken.iter().any(|other| meet(at, other))
            };
            let found = boxes.find(free);
            let (radius, at) = found.unwrap_or((0.0, [x + 7.0, y - 14.0, x + 7.0 + width, y - 5.0]));
            if radius > 13.0 {
                let (to_x, to_y) = (x.clamp(at[0], at[2]), y.clamp(at[1], at[3]));
                svg.line([x, y, to_x, to_y], "stroke=\"#888888\" stroke-width=\"0.7\"");
            }
            svg.noted(at[0], at[3], "font-size=\"10\"", &words);
            taken.push(at);
        }
    }
}

/// Numbers counted from 1; runs of three or more are written as a range.
fn ranges(indices: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &i in indices {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == i => *last = i,
            _ => runs.push((i, i)),
        }
    }
    let name = |(first, last): (usize, usize)| match last - first {
        0 => format!("{}", first + 1),
        1 => format!("{} {}", first + 1, last + 1),
        _ => format!("{}-{}", first + 1, last + 1),
    };
    runs.into_iter().map(name).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_names_what_it_shows() {
        let dot =
            |label: &str, x, y| Dot { label: label.into(), group: label.into(), x, y, x_range: Some((x, 2.0 * x)) };
        let rival = Curve {
            label: "rival".into(),
            points: vec![(100.0, 0.1), (1000.0, 0.01)],
            notes: vec!["1".into(), "16 rays".into()],
        };
        let panel = PlotPanel {
            title: "here".into(),
            x_label: "milliseconds".into(),
            y_label: "error".into(),
            dots: vec![dot("fast", 1.0, 0.1), dot("exact", 10.0, 0.001), dot("the same", 10.0, 0.001)],
            front: vec![0, 1],
            curves: vec![rival],
            gap: Some(Gap { from: 1.0, to: 100.0, y: 0.1, label: "100 times".into() }),
            ..PlotPanel::default()
        };
        let svg = Plot { title: "a < b".into(), panels: vec![panel] }.svg();
        let words =
            ["a &lt; b", "milliseconds", ">fast<", ">2 3<", "rival", ">1000<", "16 rays", "100 times", "Pareto"];
        for word in words {
            assert!(svg.contains(word), "{word} in {svg}");
        }
        assert!(!svg.contains("NaN"));
        let empty = Plot { title: String::new(), panels: vec![PlotPanel::default()] };
        assert!(!empty.svg().contains("NaN"));
    }

    #[test]
    fn runs_of_numbers_are_shortened() {
        assert_eq!(ranges(&[0, 3, 4, 7, 8, 9]), "1 4 5 8-10");
    }
}
