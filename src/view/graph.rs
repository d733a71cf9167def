//! Draws the graph of frame times by pass.

use super::status::HISTORY;
use crate::gpu::Timing;
use egui::{Align2, Color32, FontId, Rect, RichText, Sense, Stroke, Ui, pos2, vec2};
use std::collections::VecDeque;

/// Colours of the passes in the graph, in their order.
const PASS_COLORS: [Color32; 4] = [
    Color32::from_rgb(240, 170, 70),
    Color32::from_rgb(90, 160, 240),
    Color32::from_rgb(120, 200, 130),
    Color32::from_rgb(200, 120, 200),
];

/// Draws stacked times of the passes in milliseconds, the newest at the right.
pub(super) fn graph(ui: &mut Ui, timings: &VecDeque<Vec<Timing>>) {
    let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), 64.0), Sense::hover());
    let area = response.rect;
    painter.rect_filled(area, 2.0, Color32::from_black_alpha(120));
    let mut names: Vec<&str> = Vec::new();
    for timing in timings.iter().flatten() {
        if !names.contains(&timing.pass.as_str()) {
            names.push(&timing.pass);
        }
    }
    let order = ["merge", "sharp", "draw", "show"];
    names.sort_by_key(|name| order.iter().position(|o| o == name).unwrap_or(order.len()));
    let total = |frame: &Vec<Timing>| frame.iter().map(|t| t.milliseconds).sum::<f64>();
    // The range leaves out the slowest few frames, because the first frame compiles shaders.
    let mut totals: Vec<f64> = timings.iter().map(total).collect();
    totals.sort_by(f64::total_cmp);
    let most = totals.get((totals.len() * 19 / 20).saturating_sub(1)).copied().unwrap_or(0.0);
    let top = [5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0].into_iter().find(|t| *t >= most).unwrap_or(1000.0);
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
    for (limit, text) in [(1000.0 / 60.0, "60/s"), (1000.0 / 30.0, "30/s")] {
        // Labels that would overlap are left out.
        if limit < top && limit > top / 5.0 {
            let y = area.bottom() - (limit / top) as f32 * area.height();
            painter.hline(area.x_range(), y, Stroke::new(1.0, Color32::from_white_alpha(70)));
            let label = Rect::from_min_size(pos2(area.left(), y - 12.0), vec2(26.0, 12.0));
            painter.rect_filled(label, 2.0, Color32::from_black_alpha(230));
            painter.text(label.center(), Align2::CENTER_CENTER, text, FontId::proportional(9.0), Color32::WHITE);
        }
    }
    painter.text(
        area.right_top() + vec2(-3.0, 1.0),
        Align2::RIGHT_TOP,
        format!("{top} ms"),
        FontId::proportional(9.0),
        Color32::GRAY,
    );
    ui.horizontal_wrapped(|ui| {
        for (index, name) in names.iter().enumerate() {
            let of = |frame: &Vec<Timing>| {
                frame
                    .iter()
                    .any(|t| t.pass == *name)
                    .then(|| frame.iter().filter(|t| t.pass == *name).map(|t| t.milliseconds).sum())
            };
            let text = format!("{name} {:.1} ms", median(timings.iter().filter_map(of).collect()));
            ui.label(RichText::new(text).color(PASS_COLORS[index % PASS_COLORS.len()]));
        }
    });
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_nothing_is_nothing() {
        assert_eq!(median(vec![]), 0.0);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }
}
