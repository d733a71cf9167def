//! Text over the picture besides the panels: labels of its halves, messages, the scale of the error.

use super::Editor;
use super::status::{ERROR, LEAST_TEXT, MARGIN, Status, WARNING, grouped};
use super::task::TaskProgress;
use crate::asset::false_color::{ColorScale, Scheme};
use crate::asset::picture::srgb_from_linear;
use egui::{Align2, Color32, Context, FontId, Frame, Id, Rect, RichText, Sense, Ui, pos2, vec2};

/// Labels the two halves beside the line where they meet.
pub(super) fn halves(context: &Context, editor: &Editor) {
    if !editor.reference {
        return;
    }
    let painter = context.layer_painter(egui::LayerId::background());
    let screen = context.content_rect();
    let own = if editor.error { "error of the merge" } else { "merged" };
    for (text, align, side) in [(own, Align2::RIGHT_TOP, -1.0), ("ray cast", Align2::LEFT_TOP, 1.0)] {
        let text = painter.layout_no_wrap(text.to_owned(), FontId::proportional(14.0), Color32::WHITE);
        let place = align.anchor_size(pos2(screen.center().x + side * 10.0, screen.top() + MARGIN + 4.0), text.size());
        painter.rect_filled(place.expand2(vec2(6.0, 3.0)), 3.0, Color32::from_black_alpha(180));
        painter.galley(place.min, text, Color32::WHITE);
    }
}

/// Draws the notes at the bottom: messages, and unless the overlay is hidden, reference and error, and shader errors.
pub(super) fn notes(context: &Context, editor: &Editor, status: &Status<'_>) {
    let mut lines: Vec<(String, Color32)> = Vec::new();
    let shows = editor.overlay;
    let shader_error = status.shader_error.filter(|_| shows);
    if shows && (editor.reference || editor.error) {
        lines.push(match status.reference {
            Some((rays, error, true)) => (
                format!("reference: {rays} rays a vertex, {} % standard error", two_digits(100.0 * error)),
                Color32::WHITE,
            ),
            Some((rays, ..)) => {
                (format!("reference: {rays} rays a vertex, of an earlier time (Space pauses)"), WARNING)
            }
            None => ("reference: casting the first rays".to_owned(), WARNING),
        });
        if let Some(rays) = &status.rays {
            lines.push((
                format!("casting {}: {} of {}", rays.what, grouped(rays.done.into()), grouped(rays.all.into())),
                Color32::GRAY,
            ));
        }
    }
    if shows && editor.error {
        lines.push(match status.error {
            Some((scale, fresh)) => (
                format!(
                    "error of the merge, in RMS radiosities: RMS {}{}",
                    two_digits(scale.rms),
                    if fresh { "" } else { ", of an earlier time (Space pauses)" }
                ),
                if fresh { Color32::WHITE } else { WARNING },
            ),
            None => ("error: needs the reference of a scene at rest (Space pauses)".to_owned(), WARNING),
        });
    }
    lines.extend(status.messages.iter().map(|text| ((*text).to_owned(), Color32::WHITE)));
    if lines.is_empty() && shader_error.is_none() && status.bake.is_none() {
        return;
    }
    let screen = context.content_rect();
    let area = egui::Area::new(Id::new("notes")).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -MARGIN)).fade_in(false);
    area.show(context, |ui| {
        ui.set_max_size(vec2((screen.width() - 4.0 * MARGIN).max(100.0), screen.height()));
        Frame::window(&context.global_style()).show(ui, |ui| {
            if let Some(bake) = &status.bake {
                ui.add(egui::ProgressBar::new(bake.share()).desired_width(320.0).text(bake_text(bake)));
            }
            for (text, color) in lines {
                ui.colored_label(color, text);
            }
            if let Some((scale, _)) = status.error.filter(|_| shows && editor.error) {
                bar(ui, scale.limit);
            }
            if let Some(error) = shader_error {
                ui.colored_label(WARNING, "a shader does not compile; the previous one stays in use");
                ui.label(RichText::new(error.trim()).monospace().color(ERROR));
            }
        })
    });
}

/// How far a bake is, and how long it still takes at the pace so far.
fn bake_text(bake: &TaskProgress) -> String {
    let share = bake.share();
    if share < 0.02 {
        return "computing shadows".to_owned();
    }
    let left_s = bake.elapsed.as_secs_f32() * (1.0 - share) / share;
    format!("computing shadows: {:.0} %, {left_s:.0} s left", 100.0 * share)
}

/// Draws the colour bar of errors from -`limit` to `limit`.
fn bar(ui: &mut Ui, limit: f64) {
    let scale = ColorScale { scheme: Scheme::Signed, limit };
    let width = ui.available_width().min(420.0);
    let (response, painter) = ui.allocate_painter(vec2(width, 32.0), Sense::hover());
    let area = response.rect;
    let steps = 64;
    for step in 0..steps {
        let x = |step: u32| area.left() + area.width() * step as f32 / steps as f32;
        let [r, g, b] = scale
            .color(((f64::from(step) + 0.5) / f64::from(steps) * 2.0 - 1.0) * limit)
            .map(|c| (255.0 * srgb_from_linear(c)).round() as u8);
        let strip = Rect::from_x_y_ranges(x(step)..=x(step + 1), area.top()..=area.top() + 14.0);
        painter.rect_filled(strip, 0.0, Color32::from_rgb(r, g, b));
    }
    let limit = two_digits(limit);
    for (x, align, text) in [
        (area.left(), Align2::LEFT_BOTTOM, format!("-{limit} too dark")),
        (area.center().x, Align2::CENTER_BOTTOM, "0".to_owned()),
        (area.right(), Align2::RIGHT_BOTTOM, format!("too bright +{limit}")),
    ] {
        painter.text(pos2(x, area.bottom()), align, text, FontId::proportional(LEAST_TEXT), Color32::WHITE);
    }
}

/// A number that is not negative with two significant digits, at most nine after the point.
fn two_digits(number: f64) -> String {
    let power = if number > 0.0 { number.log10().floor() as i32 } else { 0 };
    format!("{number:.*}", (1 - power).clamp(0, 9) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_keep_two_digits() {
        let numbers = [0.0, 0.0314, 0.31, 2.0, 31.4, 314.0].map(two_digits);
        assert_eq!(numbers, ["0.0", "0.031", "0.31", "2.0", "31", "314"]);
    }
}
