//! Draws the graph of frame times by pass.

use super::status::{HISTORY, LEAST_TEXT};
use crate::bench::figures::quantiles;
use crate::check::PASSES;
use crate::gpu::Timing;
use egui::{Align2, Color32, FontId, Rect, RichText, Sense, Stroke, Ui, Vec2, pos2, vec2};
use std::collections::VecDeque;

/// Colours of the passes in the graph, in their order.
const PASS_COLORS: [Color32; 6] = [
    Color32::from_rgb(240, 170, 70),
    Color32::from_rgb(90, 160, 240),
    Color32::from_rgb(120, 200, 130),
    Color32::from_rgb(200, 120, 200),
    Color32::from_rgb(235, 110, 105),
    Color32::from_rgb(110, 210, 215),
];

/// Height of the graph, points.
const HEIGHT: f32 = 76.0;
/// Times of a frame that are marked by lines, in milliseconds, the more important first.
const MARKS: [(f64, &str); 2] = [(1000.0 / 30.0, "30/s"), (1000.0 / 60.0, "60/s")];
/// Ranges of the graph, in milliseconds.
const RANGES: [f64; 9] = [5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 1280.0];

/// Labels and where they stand: that of the range at the top right, and those of marks on their lines at the left. A
/// mark whose label would overlap another or leave the graph is left out. `size` measures a text.
fn labels(area: Rect, top: f64, size: impl Fn(&str) -> Vec2) -> Vec<(Rect, String)> {
    let range = format!("{top} ms");
    let corner = Align2::RIGHT_TOP.anchor_size(area.right_top(), size(&range));
    let mut placed = vec![(corner, range)];
    for (limit, text) in MARKS {
        let y = area.bottom() - (limit / top) as f32 * area.height();
        let place = Align2::LEFT_CENTER.anchor_size(pos2(area.left(), y), size(text));
        if area.contains_rect(place) && placed.iter().all(|(other, _)| !other.intersects(place)) {
            placed.push((place, text.to_owned()));
        }
    }
    placed
}

/// Draws stacked times of the passes in milliseconds, the newest at the right.
pub(super) fn graph(ui: &mut Ui, timings: &VecDeque<Vec<Timing>>) {
    let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), HEIGHT), Sense::hover());
    let area = response.rect;
    painter.rect_filled(area, 2.0, Color32::from_black_alpha(120));
    let mut names: Vec<&str> = Vec::new();
    for timing in timings.iter().flatten() {
        if !names.contains(&timing.pass.as_str()) {
            names.push(&timing.pass);
        }
    }
    names.sort_by_key(|name| PASSES.iter().position(|(pass, _)| pass == name).unwrap_or(PASSES.len()));
    let total = |frame: &Vec<Timing>| frame.iter().map(|t| t.milliseconds).sum::<f64>();
    // The range leaves out the slowest few frames, because the first frame compiles shaders.
    let [most] = quantiles(&timings.iter().map(total).collect::<Vec<_>>(), [0.95]);
    let top = RANGES.into_iter().find(|t| *t >= most).unwrap_or(RANGES[RANGES.len() - 1]);
    let step = area.width() / HISTORY as f32;
    for (column, frame) in timings.iter().rev().enumerate() {
        let right = area.right() - column as f32 * step;
        let mut bottom = area.bottom();
        for (index, name) in names.iter().enumerate() {
            let milliseconds: f64 = frame.iter().filter(|t| t.pass == *name).map(|t| t.milliseconds).sum();
            let height = ((milliseconds / top) as f32 * area.height()).min(bottom - area.top());
            let bar = Rect::from_min_max(pos2(right - step, bottom - height), pos2(right, bottom));
            painter.rect_filled(bar, 0.0, PASS_COLORS[index % PASS_COLORS.len()]);
            bottom -= height;
        }
    }
    let font = FontId::proportional(LEAST_TEXT);
    let lay = |text: &str| painter.layout_no_wrap(text.to_owned(), font.clone(), Color32::WHITE);
    let room = vec2(6.0, 0.0);
    for (index, (place, text)) in labels(area, top, |text| lay(text).size() + room).into_iter().enumerate() {
        if index > 0 {
            painter.hline(area.x_range(), place.center().y, Stroke::new(1.0, Color32::from_white_alpha(70)));
        }
        painter.rect_filled(place, 2.0, Color32::from_black_alpha(230));
        painter.galley(place.min + room / 2.0, lay(&text), Color32::WHITE);
    }
    ui.horizontal_wrapped(|ui| {
        for (index, name) in names.iter().enumerate() {
            let of = |frame: &Vec<Timing>| {
                frame
                    .iter()
                    .any(|t| t.pass == *name)
                    .then(|| frame.iter().filter(|t| t.pass == *name).map(|t| t.milliseconds).sum())
            };
            let [median] = quantiles(&timings.iter().filter_map(of).collect::<Vec<_>>(), [0.5]);
            let text = format!("{name} {median:.1} ms");
            ui.label(RichText::new(text).color(PASS_COLORS[index % PASS_COLORS.len()]));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_stand_apart_inside_the_graph() {
        let area = Rect::from_min_size(pos2(100.0, 50.0), vec2(250.0, HEIGHT));
        // A line of text is at most 1.4 times as high as its size.
        let size = |text: &str| vec2(0.6 * LEAST_TEXT * text.len() as f32 + 6.0, 1.4 * LEAST_TEXT);
        let marked: Vec<usize> = RANGES.map(|top| labels(area, top, size).len() - 1).to_vec();
        assert_eq!(marked, [0, 0, 1, 2, 1, 1, 0, 0, 0], "marks in each range");
        for top in RANGES {
            let labels = labels(area, top, size);
            for (index, (place, text)) in labels.iter().enumerate() {
                assert!(area.contains_rect(*place), "{text} of {top} ms: {place}");
                assert!(labels[..index].iter().all(|(other, _)| !other.intersects(*place)), "{text} of {top} ms");
            }
        }
    }
}
