//! The panel of figures: what is shown, its times as a graph by pass, sliders, and details.

use super::command::Command;
use super::editor::Editor;
use super::panel::{LEAST_TEXT, Status, grouped};
use crate::bench::figures::quantiles;
use crate::check::PASSES;
use crate::gpu::Timing;
use crate::scene::{Data, light};
use egui::{Align2, Color32, FontId, Pos2, Rect, RichText, Sense, Stroke, Ui, pos2, vec2};
use std::collections::VecDeque;

/// Width of the panel, points.
pub(super) const FIGURES_WIDTH: f32 = 268.0;
/// Number of frames whose times are kept for the graph.
pub(super) const HISTORY: usize = 120;
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

/// Adds the figures: scene, times, sliders, details.
pub(super) fn figures(ui: &mut Ui, editor: &Editor, status: &Status<'_>, commands: &mut Vec<Command>) {
    ui.set_width(FIGURES_WIDTH - ui.spacing().window_margin.sum().x - 2.0);
    let [width, height] = status.size;
    let name = editor.path().file_stem().unwrap_or_default().to_string_lossy();
    let paused = if editor.running { "" } else { ", paused" };
    ui.label(format!("{name}, {width} x {height}, {:.2} s{paused}", editor.time_s));
    if let Some(refined) = status.refined {
        ui.label(if refined { "picture: refined" } else { "picture: coarse while things move" });
    }
    let selected = editor.selection.map_or("nothing".to_owned(), |i| {
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
    graph(ui, status.timings);
    ui.separator();
    sliders(ui, editor, commands);
    ui.separator();
    egui::CollapsingHeader::new("Details").show_unindented(ui, |ui| details(ui, editor, status));
}

fn details(ui: &mut Ui, editor: &Editor, status: &Status<'_>) {
    ui.label(RichText::new(status.device).strong());
    ui.label(RichText::new(status.driver).small());
    if let Some(vertices) = status.vertices {
        ui.label(format!("{} entities, {} lit vertices", editor.scene().entities.len(), grouped(vertices as u64)));
    }
    // How many lights are computed one way and the other; each with its name where the pointer rests.
    let listed = light::listed(editor.scene(), status.lights);
    let sharp = listed.iter().filter(|(_, method)| method.is_sharp()).count();
    let names: Vec<String> = listed.iter().map(|(name, method)| format!("{name}: {}", method.name())).collect();
    let label = ui.label(format!("lights: {sharp} sharp, {} in bands", listed.len() - sharp));
    label.on_hover_text(names.join("\n"));
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
        // The slider rounds its value, so small differences are no changes.
        if response.changed() && (now - value).abs() > 0.006 {
            commands.push(command(now));
        }
        if response.drag_stopped() || response.lost_focus() {
            commands.push(Command::EndSlide);
        }
    };
    let Data { output, environment, .. } = &editor.scene().data;
    slide(ui, "exposure", output.exposure_ev(), -8.0..=8.0, " EV", Command::SetExposure);
    if let Some(ev) = editor.light_ev() {
        slide(ui, "light", ev, -4.0..=24.0, " EV", Command::SetLight);
    }
    slide(ui, "sky", environment.strength, 0.0..=4.0, "", Command::SetSky);
    slide(ui, "sky turned", environment.turn_deg, -180.0..=180.0, "°", Command::SetSkyTurn);
}

/// Time of a pass in a frame, ms.
pub(super) fn pass_ms(passes: &[Timing], name: &str) -> f64 {
    passes.iter().filter(|timing| timing.pass == name).map(|timing| timing.milliseconds).sum()
}

/// Draws stacked times of the passes in milliseconds, the newest at the right.
fn graph(ui: &mut Ui, timings: &VecDeque<Vec<Timing>>) {
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
            let milliseconds = pass_ms(frame, name);
            let height = ((milliseconds / top) as f32 * area.height()).min(bottom - area.top());
            let bar = Rect::from_min_max(pos2(right - step, bottom - height), pos2(right, bottom));
            painter.rect_filled(bar, 0.0, PASS_COLORS[index % PASS_COLORS.len()]);
            bottom -= height;
        }
    }
    let label = |at: Pos2, align: Align2, text: String| {
        let text = painter.layout_no_wrap(text, FontId::proportional(LEAST_TEXT), Color32::WHITE);
        let room = vec2(6.0, 0.0);
        let place = align.anchor_size(at, text.size() + room);
        painter.rect_filled(place, 2.0, Color32::from_black_alpha(230));
        painter.galley(place.min + room / 2.0, text, Color32::WHITE);
    };
    label(area.right_top(), Align2::RIGHT_TOP, format!("{top} ms"));
    // Labels stay within the graph and apart.
    let mut free = area.y_range().shrink(0.75 * LEAST_TEXT);
    for (limit, text) in MARKS {
        let y = area.bottom() - (limit / top) as f32 * area.height();
        if free.contains(y) {
            painter.hline(area.x_range(), y, Stroke::new(1.0, Color32::from_white_alpha(70)));
            label(pos2(area.left(), y), Align2::LEFT_CENTER, text.to_owned());
            free.min = y + 1.25 * LEAST_TEXT;
        }
    }
    ui.horizontal_wrapped(|ui| {
        for (index, name) in names.iter().enumerate() {
            let of = |frame: &Vec<Timing>| frame.iter().any(|t| t.pass == *name).then(|| pass_ms(frame, name));
            let [median] = quantiles(&timings.iter().filter_map(of).collect::<Vec<_>>(), [0.5]);
            let text = format!("{name} {median:.1} ms");
            ui.label(RichText::new(text).color(PASS_COLORS[index % PASS_COLORS.len()]));
        }
    });
}
