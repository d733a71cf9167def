//! Plots of named rows with one mark per series, in one or more columns.

use super::axis::{Axis, AxisScale};
use super::{LETTER, Svg, color};

const ROW: f64 = 17.0;
const COLUMN: f64 = 330.0;
const GAP: f64 = 40.0;
const TOP: f64 = 84.0;

/// Rows under one heading.
pub struct RowGroup {
    /// Heading above the rows; may be empty.
    pub heading: String,
    /// Names of the rows.
    pub rows: Vec<String>,
}

/// A quantity that is shown for every row.
pub struct PlotColumn {
    /// Label below the column, with its unit.
    pub x_label: String,
    /// Scale of the values.
    pub scale: AxisScale,
    /// A marked limit with its label.
    pub limit: Option<(f64, String)>,
    /// Values by row (over all groups) and by series.
    pub values: Vec<Vec<Option<f64>>>,
}

/// A table as a plot.
pub struct Rows {
    /// Title above the plot.
    pub title: String,
    /// Names of the series.
    pub series: Vec<String>,
    /// The rows.
    pub groups: Vec<RowGroup>,
    /// Columns from left to right.
    pub columns: Vec<PlotColumn>,
}

impl Rows {
    /// The plot as an SVG document.
    pub fn svg(&self) -> String {
        let names = self.groups.iter().flat_map(|g| g.rows.iter().map(String::len));
        let left = 30.0 + LETTER * names.max().unwrap_or(0) as f64;
        let headings = self.groups.iter().filter(|g| !g.heading.is_empty()).count();
        let lines = headings + self.groups.iter().map(|g| g.rows.len()).sum::<usize>();
        let bottom = TOP + ROW * lines as f64 + 6.0;
        let width = left + (COLUMN + GAP) * self.columns.len() as f64;
        let mut svg = Svg::new(width.max(LETTER * 1.5 * self.title.len() as f64), bottom + 56.0);
        svg.text(20.0, 28.0, "font-size=\"16\"", &self.title);
        let mut x = left;
        for (i, name) in self.series.iter().enumerate() {
            svg.mark(x, 52.0, i, 4.5);
            svg.text(x + 10.0, 56.0, "", name);
            x += 40.0 + 7.0 * name.len() as f64;
        }
        // Heights of the rows.
        let (mut heights, mut y) = (Vec::new(), TOP + ROW / 2.0);
        for group in &self.groups {
            if !group.heading.is_empty() {
                svg.text(12.0, y + 4.0, "font-weight=\"bold\"", &group.heading);
                y += ROW;
            }
            for row in &group.rows {
                svg.text(left - 12.0, y + 4.0, "text-anchor=\"end\" font-size=\"11\"", row);
                heights.push(y);
                y += ROW;
            }
        }
        for (i, column) in self.columns.iter().enumerate() {
            self.column(&mut svg, column, left + (COLUMN + GAP) * i as f64, bottom, &heights);
        }
        svg.finish()
    }

    fn column(&self, svg: &mut Svg, column: &PlotColumn, left: f64, bottom: f64, heights: &[f64]) {
        assert_eq!(column.values.len(), heights.len(), "values of every row");
        let limit = column.limit.iter().map(|(value, _)| *value);
        let values = column.values.iter().flatten().flatten().copied().chain(limit);
        let axis = Axis::new(column.scale, values, left, left + COLUMN);
        svg.put(format_args!(
            "<rect x=\"{left:.1}\" y=\"{TOP}\" width=\"{COLUMN}\" height=\"{:.1}\" fill=\"none\" stroke=\"#999999\"/>",
            bottom - TOP
        ));
        svg.text(left + COLUMN / 2.0, bottom + 38.0, "text-anchor=\"middle\"", &column.x_label);
        for (value, name) in axis.ticks(45.0) {
            let at = axis.at(value);
            svg.line([at, TOP, at, bottom], "stroke=\"#e4e4e4\"");
            svg.text(at, bottom + 17.0, "text-anchor=\"middle\" font-size=\"11\"", &name);
        }
        if let Some((value, word)) = &column.limit {
            let at = axis.at(*value);
            svg.line([at, TOP - 4.0, at, bottom], "stroke=\"#d55e00\" stroke-dasharray=\"5 3\" stroke-width=\"1.5\"");
            svg.text(at, TOP - 8.0, "text-anchor=\"end\" font-size=\"11\" fill=\"#a04000\"", word);
        }
        for (values, y) in column.values.iter().zip(heights) {
            let places: Vec<Option<f64>> = values.iter().map(|v| v.map(|v| axis.at(v))).collect();
            let within = || places.iter().flatten();
            let (low, high) = within().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
            if low < high {
                svg.line([low, *y, high, *y], "stroke=\"#aaaaaa\" stroke-width=\"2\"");
            }
            // Marks of later series are smaller, so that earlier marks remain visible.
            for (series, x) in places.iter().enumerate() {
                let Some(x) = x else { continue };
                svg.mark(*x, *y, series, 5.5 - 1.5 * series.min(2) as f64);
                if column.scale == AxisScale::Log && values[series].is_some_and(|v| v <= 0.0) {
                    let extra = format!("font-size=\"10\" fill=\"{}\"", color(series));
                    svg.text(x + 8.0 + 10.0 * series as f64, y + 4.0, &extra, "0");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_their_names_and_marks() {
        let values = vec![vec![Some(1.0), Some(2.0)], vec![Some(0.0), None], vec![Some(3.0), Some(3.0)]];
        let rows = Rows {
            title: "skips".into(),
            series: vec!["off".into(), "on".into()],
            groups: vec![
                RowGroup { heading: "one".into(), rows: vec!["a".into()] },
                RowGroup { heading: "two".into(), rows: vec!["b".into(), "c".into()] },
            ],
            columns: vec![PlotColumn {
                x_label: "frame, ms".into(),
                scale: AxisScale::Log,
                limit: Some((10.0, "limit".into())),
                values,
            }],
        };
        let svg = rows.svg();
        for word in ["skips", ">one<", ">c<", ">on<", "frame, ms", "limit", ">0<"] {
            assert!(svg.contains(word), "{word} in {svg}");
        }
        // Three marks of the first series and its key; two of the second and its key.
        assert_eq!((svg.matches("<circle").count(), svg.matches("<polygon").count()), (4, 3));
        assert!(!svg.contains("NaN"));
    }
}
