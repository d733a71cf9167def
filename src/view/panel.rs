//! The overlay: help, times, sliders, messages, the scale of the error. It reads the state and returns the commands of its
//! widgets.

use super::command::Command;
use super::editor::Editor;
use super::figures::{FIGURES_WIDTH, figures};
use super::input::CONTROLS;
use super::task::TaskProgress;
use crate::asset::false_color::{ColorScale, Scheme};
use crate::asset::picture::srgb_from_linear;
use crate::gpu::Timing;
use crate::scene::Lights;
use egui::collapsing_header::paint_default_icon;
use egui::{
    Align2, Color32, Context, FontId, Frame, Id, Label, Pos2, Rect, RichText, Sense, Stroke, TextStyle, Ui, pos2, vec2,
};
use std::collections::VecDeque;

/// Size of the smallest text, points: pixels at a scale of 1.
pub(super) const LEAST_TEXT: f32 = 12.0;
/// Margin around panels, points.
const MARGIN: f32 = 8.0;
/// Colour of warnings.
const WARNING: Color32 = Color32::from_rgb(255, 190, 90);
/// Width of a folded panel, points.
const FOLDED_WIDTH: f32 = 104.0;
/// Width of the unfolded list of keys, points.
const KEYS_WIDTH: f32 = 306.0;
/// Height of the unfolded panel of figures without its details, points, about.
const FIGURES_HEIGHT: f32 = 300.0;
/// Share of the window in which the panel of figures starts unfolded.
const SHARE: f32 = 0.2;
const OUTLINE: Color32 = Color32::from_rgb(255, 200, 60);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    /// Root mean square of the error, relative to that of the reference.
    pub rms: f64,
    /// Error at the ends of the colour scale, in the same unit.
    pub limit: f64,
}

/// The viewer's state that the overlay shows besides the editor's.
pub struct Status<'s> {
    pub device: &'s str,
    pub driver: &'s str,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Whether the picture is refined; `None` where it never is.
    pub refined: Option<bool>,
    /// Times of the passes of the last frames, oldest first.
    pub timings: &'s VecDeque<Vec<Timing>>,
    /// Number of lit vertices; `None` before the first frame of a scene.
    pub vertices: Option<usize>,
    pub lights: Lights,
    pub bake: Option<TaskProgress>,
    pub rays: Option<TaskProgress>,
    /// Reference: rays per vertex, relative standard error, and whether it is up to date.
    pub reference: Option<(u32, f64, bool)>,
    /// Error, and whether it is up to date.
    pub error: Option<(ErrorScale, bool)>,
    /// Messages for the user, oldest first.
    pub messages: Vec<&'s str>,
}

/// A number with spaces between groups of three digits: 12 345.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join(" ")
}

/// Sets a dark style with translucent panels, in which no text is smaller than 12 points.
pub fn style(context: &Context) {
    context.set_theme(egui::Theme::Dark);
    context.all_styles_mut(|style| {
        style.visuals = egui::Visuals::dark();
        style.visuals.window_fill = Color32::from_black_alpha(246);
        style.visuals.override_text_color = Some(Color32::from_gray(230));
        style.visuals.window_shadow = egui::Shadow::NONE;
        style.text_styles.insert(TextStyle::Small, FontId::proportional(LEAST_TEXT));
        style.text_styles.insert(TextStyle::Heading, FontId::proportional(14.0));
    });
}

/// Draws the outline of the selected entity, below all panels.
pub fn outline(context: &Context, lines: &[[Pos2; 2]]) {
    let painter = context.layer_painter(egui::LayerId::background());
    for (width, color) in [(4.0, Color32::from_black_alpha(160)), (2.0, OUTLINE)] {
        for line in lines {
            painter.line_segment(*line, Stroke::new(width, color));
        }
    }
}

/// Lays out the overlay and returns the commands of its widgets. A hidden overlay shows only a bake in progress and
/// messages that must be read.
pub fn show(context: &Context, editor: &Editor, status: &Status<'_>) -> Vec<Command> {
    let mut commands = Vec::new();
    if editor.overlay {
        halves(context, editor);
        let screen = context.content_rect();
        if panel(context, "Keys (F1)", screen.left() + MARGIN, KEYS_WIDTH, editor.shows_keys, help) {
            commands.push(Command::ToggleKeys);
        }
        // At first they are unfolded where that leaves enough of the window free.
        let open = editor.shows_figures.unwrap_or(FIGURES_WIDTH * FIGURES_HEIGHT <= SHARE * screen.area());
        let width = if open { FIGURES_WIDTH } else { FOLDED_WIDTH };
        let left = (screen.right() - MARGIN - width).max(screen.left() + MARGIN);
        let add = |ui: &mut Ui| figures(ui, editor, status, &mut commands);
        if panel(context, "Figures", left, FIGURES_WIDTH, open, add) {
            commands.push(Command::ShowFigures(!open));
        }
    }
    notes(context, editor, status);
    commands
}

/// A panel below the window's upper edge. Returns whether its title was clicked, anywhere along its line. Its size is
/// set anew in every turn, so that it grows back after the window was small.
fn panel(context: &Context, title: &str, left: f32, width: f32, open: bool, add: impl FnOnce(&mut Ui)) -> bool {
    let screen = context.content_rect();
    let place = pos2(left, screen.top() + MARGIN);
    let size = vec2(if open { width } else { FOLDED_WIDTH }, (screen.height() - 2.0 * MARGIN).max(60.0));
    let area = egui::Area::new(Id::new(title)).fixed_pos(place).constrain(false).fade_in(false);
    let shown = area.show(context, |ui| {
        ui.set_max_size(size);
        Frame::window(&context.global_style()).show(ui, |ui| {
            ui.set_width(ui.available_width());
            let line = ui.horizontal(|ui| {
                let icon = ui.allocate_response(vec2(12.0, 16.0), Sense::hover());
                paint_default_icon(ui, if open { 1.0 } else { 0.0 }, &icon);
                ui.add(Label::new(RichText::new(title).heading()).selectable(false));
                ui.set_width(ui.available_width());
            });
            let header = ui.interact(line.response.rect, Id::new(title).with("header"), Sense::click());
            if open {
                egui::ScrollArea::vertical().max_height(size.y - 44.0).show(ui, add);
            }
            header.clicked()
        })
    });
    shown.inner.inner
}

fn help(ui: &mut Ui) {
    ui.spacing_mut().interact_size.y = 0.0; // rows as high as their text
    egui::Grid::new("controls").num_columns(2).spacing([10.0, 1.0]).show(ui, |ui| {
        for row in CONTROLS {
            ui.label(RichText::new(row.keys).small().strong().color(OUTLINE));
            ui.add(Label::new(RichText::new(row.what).small()).wrap());
            ui.end_row();
        }
    });
}

/// Labels the two halves beside the line where they meet.
fn halves(context: &Context, editor: &Editor) {
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

/// Draws the notes at the bottom: messages, and unless the overlay is hidden, reference and error.
fn notes(context: &Context, editor: &Editor, status: &Status<'_>) {
    let mut lines: Vec<(String, Color32)> = Vec::new();
    let shows = editor.overlay;
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
    if lines.is_empty() && status.bake.is_none() {
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
