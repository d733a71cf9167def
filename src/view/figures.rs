//! The panel of figures: what is shown, its times, sliders, and details for those who tune it.

use super::Editor;
use super::command::Command;
use super::graph;
use super::status::{Status, grouped};
use crate::merge::variant::VARIANTS;
use crate::scene::light;
use egui::{RichText, Ui};

/// Width of the panel, points.
pub(super) const FIGURES_WIDTH: f32 = 268.0;

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
    graph::graph(ui, status.timings);
    ui.separator();
    sliders(ui, editor, commands);
    ui.separator();
    egui::CollapsingHeader::new("Details").show_unindented(ui, |ui| details(ui, editor, status, commands));
}

fn details(ui: &mut Ui, editor: &Editor, status: &Status<'_>, commands: &mut Vec<Command>) {
    ui.label(RichText::new(status.device).strong());
    ui.label(RichText::new(status.driver).small());
    let entities = editor.scene().entities.len();
    ui.label(format!("{entities} entities, {} lit vertices", grouped(status.vertices as u64)));
    if let Some((merged, all)) = status.merged {
        ui.label(format!("clusters merged again {} of {}", grouped(merged as u64), grouped(all as u64)));
    }
    lights(ui, editor, status);
    variants(ui, editor, status, commands);
}

/// How many lights are computed one way and the other; each with its name where the pointer rests.
fn lights(ui: &mut Ui, editor: &Editor, status: &Status<'_>) {
    let listed = light::listed(editor.scene(), status.lights);
    let sharp = listed.iter().filter(|(_, method)| method.is_sharp()).count();
    let names: Vec<String> = listed.iter().map(|(name, method)| format!("{name}: {}", method.name())).collect();
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
        slide(ui, "light", ev, -4.0..=24.0, " EV", Command::SetLight);
    }
    slide(ui, "sky", editor.sky(), 0.0..=4.0, "", Command::SetSky);
    slide(ui, "sky turned", editor.sky_turn_deg(), -180.0..=180.0, "°", Command::SetSkyTurn);
}
