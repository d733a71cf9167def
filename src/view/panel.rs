//! The overlay: help, times, counts, sliders, messages. It reads the state and returns the commands of its widgets.

use super::Editor;
use super::command::Command;
use super::graph;
use super::input::CONTROLS;
use super::notes;
use super::status::{MARGIN, Status, grouped};
use super::task::TaskProgress;
use crate::merge::variant::VARIANTS;
use crate::scene::light;
use egui::collapsing_header::CollapsingState;
use egui::{Align2, Color32, Context, Id, Pos2, RichText, Stroke, Ui, pos2, vec2};

/// Width of the panel of figures, points.
const FIGURES_WIDTH: f32 = 268.0;
/// Width of the folded panel of figures, points.
const FOLDED_WIDTH: f32 = 104.0;
/// Width of the help, points.
const HELP_WIDTH: f32 = 350.0;
const OUTLINE: Color32 = Color32::from_rgb(255, 200, 60);

/// A dark style with translucent panels.
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

/// Lays out the overlay and returns the commands of its widgets. A hidden overlay shows only a bake in progress.
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
    let panel = |title: &str, x: f32, width: f32, open: bool| {
        let place = pos2(x, screen.top() + MARGIN);
        let window = egui::Window::new(title.to_owned()).id(Id::new(title)).fixed_pos(place);
        window.auto_sized().default_width(width).max_width(width).default_open(open)
    };
    notes::halves(context, editor);
    // In a narrow window the help starts folded, and in a narrower one the figures do too.
    let wide = screen.width() >= FIGURES_WIDTH + HELP_WIDTH + 100.0;
    panel("Controls", screen.left() + MARGIN, HELP_WIDTH, wide).show(context, |ui| {
        scrolled(ui, height, help);
    });
    let open = screen.width() >= 2.0 * FIGURES_WIDTH;
    // egui gives a folded window no width, so its position at the right needs a width of its own.
    let folding = CollapsingState::load_with_default_open(context, Id::new("Figures").with("collapsing"), open);
    let width = if folding.openness(context) > 0.0 { FIGURES_WIDTH } else { FOLDED_WIDTH };
    let x = (screen.right() - MARGIN - width).max(screen.left() + MARGIN);
    panel("Figures", x, FIGURES_WIDTH, open).show(context, |ui| {
        scrolled(ui, height, |ui| figures(ui, editor, status, &mut commands));
    });
    notes::notes(context, editor, status);
    commands
}

/// Adds content with a scroll bar if it is higher than `height` points.
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

fn baking(context: &Context, bake: &TaskProgress) {
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
    ui.set_width(FIGURES_WIDTH - ui.spacing().window_margin.sum().x - 2.0);
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
    graph::graph(ui, status.timings);
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
        ui.label(RichText::new("one lookup: a cluster x a product chain x an entity").small());
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
    if let Some((merged, all)) = status.merged {
        ui.label(format!("clusters merged again {} of {}", grouped(merged as u64), grouped(all as u64)));
    }
    lights(ui, editor, status);
    variants(ui, editor, status, commands);
    ui.separator();
    sliders(ui, editor, commands);
}

/// How many lights are computed one way and the other; each with its name where the pointer rests.
fn lights(ui: &mut Ui, editor: &Editor, status: &Status<'_>) {
    let listed = light::listed(editor.scene(), status.lights);
    let sharp = listed.iter().filter(|(_, form)| form.is_sharp()).count();
    let names: Vec<String> = listed.iter().map(|(name, form)| format!("{name}: {}", form.name())).collect();
    let label = ui.label(format!("lights: {sharp} sharp, {} in bands", listed.len() - sharp));
    label.on_hover_text(names.join("\n"));
}

fn variants(ui: &mut Ui, editor: &Editor, status: &Status<'_>, commands: &mut Vec<Command>) {
    ui.horizontal(|ui| {
        ui.label("merge");
        let chosen = editor.variant();
        let text = match (chosen, status.variant) {
            (_, None) => chosen.unwrap_or("the device's fastest").to_owned(),
            (Some(_), Some(used)) => used.to_owned(),
            (None, Some(used)) => format!("fastest: {used}"),
        };
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
        // The slider rounds its value, so small differences are no changes.
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

#[cfg(test)]
mod tests {
    use super::*;
    use egui::Rect;
    use std::collections::VecDeque;

    #[test]
    fn numbers_read_in_threes() {
        assert_eq!(["0", "999", "1 000", "12 345 678"], [0, 999, 1000, 12_345_678].map(grouped)[..]);
    }

    #[test]
    fn both_panels_can_be_reached_folded_and_open() {
        let text = "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"m\"\nplane = { size_m = 1, cells = 1 }\n\
                    [[entity]]\nmesh = \"m\"\n";
        let path = std::path::Path::new("t.toml");
        let scene = crate::scene::Scene::parse(text, path, &crate::asset::embedded::read).unwrap();
        let editor = Editor::new(scene, path);
        let timings = VecDeque::new();
        let status = Status {
            device: "a device",
            driver: "a driver",
            size: [640, 480],
            timings: &timings,
            counts: None,
            merged: None,
            vertices: 0,
            lights: Default::default(),
            variant: None,
            bake: None,
            rays: None,
            reference: None,
            error: None,
            shader_error: None,
            messages: Vec::new(),
        };
        for (size, open) in [([320.0, 240.0], false), ([640.0, 480.0], true), ([1280.0, 720.0], true)] {
            let context = Context::default();
            let screen = Rect::from_min_size(Pos2::ZERO, size.into());
            let mut time = 0.0;
            let mut turn = |events: Vec<egui::Event>| {
                time += 0.5;
                let input =
                    egui::RawInput { screen_rect: Some(screen), time: Some(time), events, ..Default::default() };
                context.run_ui(input, |ui| drop(show(ui.ctx(), &editor, &status))).textures_delta.clear();
            };
            let folded = |context: &Context| {
                let id = Id::new("Figures").with("collapsing");
                !CollapsingState::load(context, id).unwrap().is_open()
            };
            (0..4).for_each(|_| turn(Vec::new()));
            assert_eq!(folded(&context), !open, "{size:?}");
            for _ in 0..3 {
                let place = |title: &str| context.memory(|m| m.area_rect(Id::new(title)).unwrap());
                let figures = place("Figures");
                let title_width = if folded(&context) { FOLDED_WIDTH } else { figures.width() };
                let right = figures.left() + title_width;
                assert!(right <= screen.right() && right > screen.right() - 2.0 * MARGIN, "{size:?}: {figures}");
                // The triangle before the title folds and unfolds.
                let (pos, before) = (figures.left_top() + vec2(16.0, 16.0), folded(&context));
                let press = |pressed| egui::Event::PointerButton {
                    pos,
                    button: egui::PointerButton::Primary,
                    pressed,
                    modifiers: egui::Modifiers::NONE,
                };
                turn(vec![egui::Event::PointerMoved(pos)]);
                turn(vec![press(true)]);
                turn(vec![press(false)]);
                (0..4).for_each(|_| turn(Vec::new()));
                assert_ne!(folded(&context), before, "{size:?}: a click at {pos} does nothing");
            }
        }
    }
}
