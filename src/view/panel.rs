//! The overlay: help, times, counts, sliders, messages. It reads the state and returns what its widgets ask for.

use super::Editor;
use super::command::Command;
use super::input::CONTROLS;
use super::task::Progress;
use super::viewer::HISTORY;
use crate::gpu::Timing;
use crate::render::gather::Counts;
use crate::render::variant::VARIANTS;
use egui::{Align2, Color32, Context, FontId, Pos2, Rect, RichText, Sense, Stroke, Ui, pos2, vec2};
use std::collections::VecDeque;

/// Space around panels, points.
const MARGIN: f32 = 8.0;
/// Width of the panel of figures, points.
const FIGURES_WIDTH: f32 = 268.0;
/// Width of the help, points.
const HELP_WIDTH: f32 = 350.0;
/// Colours of the passes in the graph, in their order.
const PASS_COLORS: [Color32; 4] = [
    Color32::from_rgb(240, 170, 70),
    Color32::from_rgb(90, 160, 240),
    Color32::from_rgb(120, 200, 130),
    Color32::from_rgb(200, 120, 200),
];
const WARNING: Color32 = Color32::from_rgb(255, 190, 90);
const ERROR: Color32 = Color32::from_rgb(255, 120, 110);
const OUTLINE: Color32 = Color32::from_rgb(255, 200, 60);

/// Colours of the error as they are shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    /// Root mean square relative to that of the reference.
    pub rms: f64,
    /// Error of the ends of the scale, in the same unit.
    pub limit: f64,
}

/// What the overlay shows besides the editor's state.
pub struct Status<'s> {
    /// Name of the device.
    pub device: &'s str,
    /// Its driver.
    pub driver: &'s str,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Passes of the last frames, oldest first.
    pub timings: &'s VecDeque<Vec<Timing>>,
    /// Lookups of the last merge.
    pub counts: Option<Counts>,
    /// Clusters that the last frame merged, and all.
    pub merged: (usize, usize),
    /// Vertices that are lit.
    pub vertices: usize,
    /// Merge variant in use.
    pub variant: &'s str,
    /// The bake in the background.
    pub bake: Option<Progress>,
    /// The rays that are being cast.
    pub rays: Option<Progress>,
    /// Rays a vertex, relative standard error, whether it belongs to the state shown.
    pub reference: Option<(u32, f64, bool)>,
    /// The error's colours and whether they belong to the state shown.
    pub error: Option<(ErrorScale, bool)>,
    /// The compiler's lines.
    pub shader_error: Option<&'s str>,
    /// Lines for the user, oldest first.
    pub messages: Vec<&'s str>,
}

/// Dark, and clear enough to see the scene through.
pub fn visuals() -> egui::Visuals {
    let mut visuals = egui::Visuals::dark();
    visuals.window_fill = Color32::from_black_alpha(246);
    visuals.override_text_color = Some(Color32::from_gray(230));
    visuals.window_shadow = egui::Shadow::NONE;
    visuals
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

/// Lays the overlay out and returns what is asked for. Hidden, it shows nothing but a bake in progress.
pub fn show(context: &Context, editor: &Editor, status: &Status<'_>) -> Vec<Command> {
    let mut commands = Vec::new();
    let screen = context.content_rect();
    if let Some(bake) = &status.bake {
        baking(context, bake);
    }
    if !editor.shows_overlay() {
        return commands;
    }
    let height = (screen.height() - 2.0 * MARGIN).max(60.0);
    let panel = |title: &str, align: Align2, width: f32| {
        let offset = if align == Align2::LEFT_TOP { vec2(MARGIN, MARGIN) } else { vec2(-MARGIN, MARGIN) };
        egui::Window::new(title.to_owned()).anchor(align, offset).auto_sized().default_width(width).max_width(width)
    };
    // Two panels side by side need room; in a narrow window the help starts folded away.
    let narrow = screen.width() < FIGURES_WIDTH + HELP_WIDTH + 100.0;
    panel("Controls", Align2::LEFT_TOP, HELP_WIDTH).default_open(!narrow).show(context, |ui| {
        scrolled(ui, height, help);
    });
    panel("Figures", Align2::RIGHT_TOP, FIGURES_WIDTH).default_open(!narrow).show(context, |ui| {
        scrolled(ui, height, |ui| figures(ui, editor, status, &mut commands));
    });
    notes(context, editor, status);
    commands
}

/// As high as its content, but within the window.
fn scrolled(ui: &mut Ui, height: f32, add: impl FnOnce(&mut Ui)) {
    egui::ScrollArea::vertical().max_height(height - 44.0).show(ui, add);
}

fn help(ui: &mut Ui) {
    egui::Grid::new("controls").num_columns(2).spacing([10.0, 2.0]).show(ui, |ui| {
        for row in CONTROLS {
            ui.label(RichText::new(row.keys).strong().color(OUTLINE));
            ui.add(egui::Label::new(row.what).wrap());
            ui.end_row();
        }
    });
}

fn baking(context: &Context, bake: &Progress) {
    let share = bake.done as f32 / bake.all.max(1) as f32;
    egui::Window::new("baking").title_bar(false).resizable(false).anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).show(
        context,
        |ui| {
            ui.label(format!("Baking in the background: {}", bake.what));
            ui.add(egui::ProgressBar::new(share).desired_width(320.0).text(format!("{} of {}", bake.done, bake.all)));
        },
    );
}

fn figures(ui: &mut Ui, editor: &Editor, status: &Status<'_>, commands: &mut Vec<Command>) {
    ui.set_width(FIGURES_WIDTH - 20.0);
    ui.label(RichText::new(status.device).strong());
    ui.label(RichText::new(status.driver).small());
    let [width, height] = status.size;
    let name = editor.path().file_stem().unwrap_or_default().to_string_lossy();
    let paused = if editor.is_running() { "" } else { ", paused" };
    ui.label(format!("{name}, {width} x {height}, {:.2} s{paused}", editor.time_s()));
    let selected = editor.selection().map_or("all".to_owned(), |i| {
        let entity = &editor.scene().entities[i];
        let role = if entity.emits {
            "light"
        } else if entity.occludes {
            "occluder"
        } else {
            "receiver"
        };
        format!("{} ({role})", entity.name)
    });
    ui.label(format!("selected: {selected}"));
    ui.separator();
    graph(ui, status.timings);
    ui.separator();
    if let Some(counts) = status.counts {
        let skipped = counts.behind_light + counts.below_horizon + counts.apart + counts.facing_away + counts.below_eps;
        ui.label(format!(
            "{} entities, {} lit vertices",
            editor.scene().entities.len(),
            grouped(status.vertices as u64)
        ));
        let share = 100.0 * skipped as f64 / (counts.considered.max(1)) as f64;
        ui.label(format!("lookups considered {}, skipped {share:.0} %", grouped(counts.considered)));
        let of = |count: u64| 100.0 * count as f64 / counts.considered.max(1) as f64;
        ui.label(
            RichText::new(format!(
                "behind light {:.0} %, horizon {:.0} %, apart {:.0} %, away {:.0} %, eps {:.0} %",
                of(counts.behind_light),
                of(counts.below_horizon),
                of(counts.apart),
                of(counts.facing_away),
                of(counts.below_eps)
            ))
            .small(),
        );
    }
    let (merged, all) = status.merged;
    ui.label(format!("clusters merged again {} of {}", grouped(merged as u64), grouped(all as u64)));
    variants(ui, editor, status, commands);
    ui.separator();
    sliders(ui, editor, commands);
}

fn variants(ui: &mut Ui, editor: &Editor, status: &Status<'_>, commands: &mut Vec<Command>) {
    ui.horizontal(|ui| {
        ui.label("merge");
        let chosen = editor.variant();
        let text = if chosen.is_some() { status.variant.to_owned() } else { format!("fastest: {}", status.variant) };
        egui::ComboBox::from_id_salt("variant").width(180.0).selected_text(text).show_ui(ui, |ui| {
            let choices = std::iter::once(None).chain(VARIANTS.iter().map(|v| Some(v.name)));
            for choice in choices {
                let picked = ui.selectable_label(chosen == choice, choice.unwrap_or("the device's fastest"));
                if picked.clicked() && chosen != choice {
                    commands.push(Command::SetVariant(choice));
                }
            }
        });
    });
}

fn sliders(ui: &mut Ui, editor: &Editor, commands: &mut Vec<Command>) {
    let mut slide = |ui: &mut Ui,
                     name: &str,
                     value: f32,
                     range: std::ops::RangeInclusive<f32>,
                     unit: &str,
                     command: fn(f32) -> Command| {
        let mut now = value;
        ui.spacing_mut().slider_width = 110.0;
        let slider = egui::Slider::new(&mut now, range).suffix(unit).text(name).max_decimals(2);
        let response = ui.add(slider);
        // The slider itself rounds what it shows.
        if response.changed() && (now - value).abs() > 0.006 {
            commands.push(command(now));
        }
        if response.drag_stopped() || response.lost_focus() {
            commands.push(Command::EndSlide);
        }
    };
    slide(ui, "exposure", editor.exposure_ev(), -8.0..=8.0, " EV", Command::SetExposure);
    if let Some(ev) = editor.light_ev() {
        slide(ui, "light", ev, -4.0..=14.0, " EV", Command::SetLight);
    }
    slide(ui, "sky", editor.sky(), 0.0..=4.0, "", Command::SetSky);
    slide(ui, "sky turned", editor.sky_turn_deg(), -180.0..=180.0, "°", Command::SetSkyTurn);
}

/// Stacked times of the passes, newest at the right.
fn graph(ui: &mut Ui, timings: &VecDeque<Vec<Timing>>) {
    let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), 64.0), Sense::hover());
    let area = response.rect;
    painter.rect_filled(area, 2.0, Color32::from_black_alpha(120));
    let mut names: Vec<&str> = Vec::new();
    for timing in timings.iter().flatten() {
        if !names.contains(&timing.pass.as_str()) {
            names.push(&timing.pass);
        }
    }
    let order = ["merge", "draw", "show"];
    names.sort_by_key(|name| order.iter().position(|o| o == name).unwrap_or(order.len()));
    let total = |frame: &Vec<Timing>| frame.iter().map(|t| t.milliseconds).sum::<f64>();
    // All but the slowest few: the first frame compiles shaders.
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
        // Apart enough to be read.
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

/// What is to be told at the bottom: reference and error, shader errors, messages.
fn notes(context: &Context, editor: &Editor, status: &Status<'_>) {
    let mut lines: Vec<(String, Color32)> = Vec::new();
    if editor.shows_reference() || editor.shows_error() {
        lines.push(match status.reference {
            Some((rays, error, true)) => {
                (format!("reference: {rays} rays a vertex, {:.1} % standard error", 100.0 * error), Color32::WHITE)
            }
            Some((rays, ..)) => {
                (format!("reference: {rays} rays a vertex, of an earlier moment (Space pauses)"), WARNING)
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
    if editor.shows_error() {
        lines.push(match status.error {
            Some((scale, fresh)) => (
                format!(
                    "error: blue too dark, red too bright, ends at ±{:.3} of the RMS radiosity; RMS {:.4}{}",
                    scale.limit,
                    scale.rms,
                    if fresh { "" } else { ", of an earlier moment (Space pauses)" }
                ),
                if fresh { Color32::WHITE } else { WARNING },
            ),
            None => ("error: waits for the reference of a scene that stands still (Space pauses)".to_owned(), WARNING),
        });
    }
    lines.extend(status.messages.iter().map(|text| ((*text).to_owned(), Color32::WHITE)));
    if lines.is_empty() && status.shader_error.is_none() {
        return;
    }
    egui::Window::new("notes")
        .title_bar(false)
        .resizable(false)
        .anchor(Align2::CENTER_BOTTOM, vec2(0.0, -MARGIN))
        .max_width((context.content_rect().width() - 4.0 * MARGIN).max(100.0))
        .show(context, |ui| {
            for (text, color) in lines {
                ui.colored_label(color, text);
            }
            if let Some(error) = status.shader_error {
                ui.colored_label(WARNING, "a shader does not compile; the one before stays in use");
                ui.label(RichText::new(error.trim()).monospace().color(ERROR));
            }
        });
}

/// 12345 as 12 345.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_in_threes() {
        assert_eq!(["0", "999", "1 000", "12 345 678"], [0, 999, 1000, 12_345_678].map(grouped)[..]);
    }

    #[test]
    fn the_median_of_nothing_is_nothing() {
        assert_eq!(median(vec![]), 0.0);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }
}
