//! The overlay: help, times, counts, sliders, messages. It reads the state and returns the commands of its widgets.

use super::Editor;
use super::command::{Command, Panel};
use super::figures::{FIGURES_WIDTH, figures};
use super::input::CONTROLS;
use super::notes;
use super::status::{LEAST_TEXT, MARGIN, Status};
use egui::collapsing_header::paint_default_icon;
use egui::{
    Color32, Context, FontId, Frame, Id, Label, Pos2, Rect, RichText, Sense, Stroke, TextStyle, Ui, pos2, vec2,
};

/// Width of a folded panel, points.
const FOLDED_WIDTH: f32 = 104.0;
/// Width of the unfolded list of keys, points.
const KEYS_WIDTH: f32 = 306.0;
/// Height of the unfolded panel of figures without its details, points, about.
const FIGURES_HEIGHT: f32 = 300.0;
/// Share of the window in which the panel of figures starts unfolded.
const SHARE: f32 = 0.2;
const OUTLINE: Color32 = Color32::from_rgb(255, 200, 60);

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
        notes::halves(context, editor);
        let screen = context.content_rect();
        if panel(context, "Keys (F1)", screen.left() + MARGIN, KEYS_WIDTH, editor.panels.keys, help) {
            commands.push(Command::Fold(Panel::Keys, editor.panels.keys));
        }
        let open = unfolds_figures(editor, screen);
        let width = if open { FIGURES_WIDTH } else { FOLDED_WIDTH };
        let left = (screen.right() - MARGIN - width).max(screen.left() + MARGIN);
        let add = |ui: &mut Ui| figures(ui, editor, status, &mut commands);
        if panel(context, "Figures", left, FIGURES_WIDTH, open, add) {
            commands.push(Command::Fold(Panel::Figures, open));
        }
    }
    notes::notes(context, editor, status);
    commands
}

/// Whether the panel of figures is unfolded: as the user has chosen, or where it leaves enough of the window free.
fn unfolds_figures(editor: &Editor, screen: Rect) -> bool {
    editor.panels.figures.unwrap_or(FIGURES_WIDTH * FIGURES_HEIGHT <= SHARE * screen.area())
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
