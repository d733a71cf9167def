//! The overlay: help, times, counts, sliders, messages. It reads the state and returns the commands of its widgets.

use super::Editor;
use super::command::Command;
use super::figures::{DETAILS, FIGURES_WIDTH, figures};
use super::input::CONTROLS;
use super::notes;
use super::settings::Settings;
use super::status::{LEAST_TEXT, MARGIN, Status};
use super::task::TaskProgress;
use egui::collapsing_header::CollapsingState;
use egui::{Align2, Color32, Context, FontId, Id, Pos2, RichText, Stroke, TextStyle, Ui, pos2, vec2};

/// Width of the folded panel of figures, points.
const FOLDED_WIDTH: f32 = 104.0;
/// Width and height of the unfolded list of keys, points, about.
const KEYS_SIZE: [f32; 2] = [306.0, 460.0];
/// Height of the unfolded panel of figures without its details, points, about.
const FIGURES_HEIGHT: f32 = 300.0;
/// Share of the window in which the panel of figures starts unfolded, together with the list of keys.
const SHARE: f32 = 0.2;
const OUTLINE: Color32 = Color32::from_rgb(255, 200, 60);

/// Titles of the parts that fold, which are their ids as well.
const KEYS: &str = "Keys (F1)";
const FIGURES: &str = "Figures";

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

/// Whether a part is unfolded; `None` before it was shown.
fn is_unfolded(context: &Context, title: &str) -> Option<bool> {
    CollapsingState::load(context, Id::new(title).with("collapsing")).map(|state| state.is_open())
}

/// Which panels are unfolded; `None` before they were shown. The details keep their state while the figures are folded.
pub fn unfolded(context: &Context) -> Option<Settings> {
    let details = is_unfolded(context, DETAILS).unwrap_or_default();
    Some(Settings { keys: is_unfolded(context, KEYS)?, figures: is_unfolded(context, FIGURES)?, details })
}

/// Unfolds the list of keys, or folds it unless `must_show`.
pub fn fold_keys(context: &Context, must_show: bool) {
    let mut state = CollapsingState::load_with_default_open(context, Id::new(KEYS).with("collapsing"), false);
    state.set_open(must_show || !state.is_open());
    state.store(context);
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

/// Lays out the overlay and returns the commands of its widgets. A hidden overlay shows only a bake in progress and messages that
/// must be read.
pub fn show(context: &Context, editor: &Editor, status: &Status<'_>) -> Vec<Command> {
    let mut commands = Vec::new();
    let screen = context.content_rect();
    if let Some(bake) = &status.bake {
        baking(context, bake);
    }
    if !editor.shows_overlay() {
        notes::notes(context, editor, status);
        return commands;
    }
    let height = (screen.height() - 2.0 * MARGIN).max(60.0);
    let panel = |title: &str, x: f32, width: f32, open: bool| {
        let place = pos2(x, screen.top() + MARGIN);
        let window = egui::Window::new(title.to_owned()).id(Id::new(title)).fixed_pos(place);
        window.auto_sized().default_width(width).max_width(width).default_open(open)
    };
    notes::halves(context, editor);
    // In a narrow window the keys start folded, and the figures do where both would cover too much.
    let [keys_width, keys_height] = KEYS_SIZE;
    let keys = status.unfolded.keys && screen.width() >= FIGURES_WIDTH + keys_width + 100.0;
    panel(KEYS, screen.left() + MARGIN, keys_width, keys).show(context, |ui| {
        scrolled(ui, height, help);
    });
    let covered = FIGURES_WIDTH * FIGURES_HEIGHT + if keys { keys_width * keys_height } else { 0.0 };
    let open = status.unfolded.figures && covered <= SHARE * screen.area();
    // egui gives a folded window no width, so its position at the right needs a width of its own.
    let folding = CollapsingState::load_with_default_open(context, Id::new(FIGURES).with("collapsing"), open);
    let width = if folding.openness(context) > 0.0 { FIGURES_WIDTH } else { FOLDED_WIDTH };
    let x = (screen.right() - MARGIN - width).max(screen.left() + MARGIN);
    panel(FIGURES, x, FIGURES_WIDTH, open).show(context, |ui| {
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
    ui.spacing_mut().interact_size.y = 0.0; // rows as high as their text
    egui::Grid::new("controls").num_columns(2).spacing([10.0, 1.0]).show(ui, |ui| {
        for row in CONTROLS {
            ui.label(RichText::new(row.keys).small().strong().color(OUTLINE));
            ui.add(egui::Label::new(RichText::new(row.what).small()).wrap());
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

#[cfg(test)]
mod tests {
    use super::super::status::ErrorScale;
    use super::*;
    use crate::gpu::Timing;
    use crate::lists::gather::Counts;
    use egui::Rect;
    use std::collections::VecDeque;

    /// What is laid out in a window of that size (width and height, points), with every note, turn by turn.
    struct Stand {
        context: Context,
        editor: Editor,
        screen: Rect,
        unfolded: Settings,
        time_s: f64,
    }

    impl Stand {
        fn new(size: [f32; 2], unfolded: Settings) -> Self {
            let path = std::path::Path::new("twelve_instances");
            let editor = Editor::new(crate::scene::Scene::load(path).unwrap(), path);
            let (context, screen) = (Context::default(), Rect::from_min_size(Pos2::ZERO, size.into()));
            style(&context);
            let mut stand = Stand { context, editor, screen, unfolded, time_s: 0.0 };
            (0..4).for_each(|_| drop(stand.turn(Vec::new())));
            stand
        }

        /// The shapes of one more look at it.
        fn turn(&mut self, events: Vec<egui::Event>) -> Vec<egui::Shape> {
            let pass = |pass: &str, milliseconds| Timing { pass: pass.to_owned(), milliseconds, samples: None };
            let times =
                |i: usize| ["merge", "sharp", "draw", "show"].map(|name| pass(name, 3.0 + (i % 9) as f64)).to_vec();
            let timings: VecDeque<Vec<Timing>> = (0..120).map(times).collect();
            let status = Status {
                device: "llvmpipe (LLVM 15.0.6, 256 bits)",
                driver: "llvmpipe, Mesa 22.3.6 (LLVM 15.0.6)",
                size: [1280, 720],
                timings: &timings,
                counts: Some(Counts { considered: 123_456, ..Counts::default() }),
                merged: Some((1234, 5678)),
                vertices: 70_269,
                lights: Default::default(),
                variant: Some("texel-packed"),
                bake: Some(TaskProgress { what: "teapot".into(), done: 3, all: 9 }),
                rays: Some(TaskProgress { what: "rays".into(), done: 3, all: 9 }),
                reference: Some((16, 0.01, true)),
                error: Some((ErrorScale { rms: 0.01, limit: 0.1 }, true)),
                shader_error: Some("draw.frag:3: error"),
                messages: vec!["wrote scene-edited.toml"],
                unfolded: self.unfolded,
            };
            self.time_s += 0.5;
            let (screen_rect, time) = (Some(self.screen), Some(self.time_s));
            let input = egui::RawInput { screen_rect, time, events, ..Default::default() };
            let mut output = self.context.run_ui(input, |ui| drop(show(ui.ctx(), &self.editor, &status)));
            output.textures_delta.clear();
            output.shapes.into_iter().map(|clipped| clipped.shape).collect()
        }

        fn place(&self, title: &str) -> Rect {
            self.context.memory(|memory| memory.area_rect(Id::new(title)).unwrap())
        }

        fn is_folded(&self) -> bool {
            !is_unfolded(&self.context, FIGURES).unwrap()
        }
    }

    /// Sizes of all texts, points.
    fn text_sizes(shapes: &[egui::Shape]) -> Vec<(f32, String)> {
        let sizes = |shape: &egui::Shape| match shape {
            egui::Shape::Vec(shapes) => text_sizes(shapes),
            egui::Shape::Text(text) => {
                let job = &text.galley.job;
                job.sections.iter().map(|section| (section.format.font_id.size, job.text.clone())).collect()
            }
            _ => Vec::new(),
        };
        shapes.iter().flat_map(sizes).collect()
    }

    #[test]
    fn no_text_is_smaller_than_eleven_points() {
        let all = Settings { keys: true, figures: true, details: true };
        let mut stand = Stand::new([1280.0, 1000.0], all);
        stand.editor.apply(Command::ToggleReference);
        stand.editor.apply(Command::ToggleError);
        // A window whose content grows shows all of it in the next turn.
        (0..4).for_each(|_| drop(stand.turn(Vec::new())));
        let sizes = text_sizes(&stand.turn(Vec::new()));
        for part in [
            "123 456",
            "turn the camera",
            "60/s",
            "ms",
            "too bright",
            "draw.frag",
            "exposure",
            "behind light",
            "ray cast",
        ] {
            assert!(sizes.iter().any(|(_, text)| text.contains(part)), "{part:?} is not shown: {sizes:?}");
        }
        assert!(sizes.iter().all(|(size, _)| *size >= 11.0), "{sizes:?}");
    }

    #[test]
    fn panels_cover_at_most_a_fifth_of_a_window() {
        let share = |stand: &Stand| {
            // The place of a folded panel has no width of its own.
            let area = |place: Rect| place.width().max(FOLDED_WIDTH) * place.height();
            let areas = [KEYS, FIGURES].map(|title| area(stand.place(title)));
            areas.iter().sum::<f32>() / stand.screen.area()
        };
        let later = Settings { keys: false, ..Settings::default() };
        for size in [[1280.0, 720.0], [960.0, 640.0], [640.0, 360.0]] {
            let stand = Stand::new(size, later);
            assert!(share(&stand) < 0.2, "{size:?}: {}", share(&stand));
        }
        assert!(!Stand::new([1280.0, 720.0], later).is_folded() && !Stand::new([960.0, 640.0], later).is_folded());
        // The first start shows all keys, and the figures where there is room for both.
        for (size, folded) in [([1280.0, 720.0], true), ([1920.0, 1080.0], false)] {
            let first = Stand::new(size, Settings::default());
            assert_eq!(first.is_folded(), folded, "{size:?}");
            assert!(share(&first) < 0.2, "{size:?}: {}", share(&first));
            let keys = first.place(KEYS);
            assert!(first.screen.contains_rect(keys) && keys.height() > 350.0, "{keys}");
        }
    }

    #[test]
    fn the_key_folds_the_list_and_shows_it() {
        let mut stand = Stand::new([1280.0, 720.0], Settings::default());
        let mut after = |fold: &dyn Fn(&Context)| {
            fold(&stand.context);
            (0..4).for_each(|_| drop(stand.turn(Vec::new())));
            unfolded(&stand.context).unwrap()
        };
        assert!(after(&|_| ()).keys);
        assert!(!after(&|context| fold_keys(context, false)).keys);
        assert!(after(&|context| fold_keys(context, true)).keys && after(&|context| fold_keys(context, true)).keys);
        assert!(!after(&|context| fold_keys(context, false)).keys);
    }

    #[test]
    fn both_panels_can_be_reached_folded_and_open() {
        for (size, open) in [([320.0, 240.0], false), ([640.0, 360.0], false), ([1280.0, 720.0], true)] {
            let mut stand = Stand::new(size, Settings { keys: false, ..Settings::default() });
            assert_eq!(stand.is_folded(), !open, "{size:?}");
            for _ in 0..3 {
                let figures = stand.place(FIGURES);
                let title_width = if stand.is_folded() { FOLDED_WIDTH } else { figures.width() };
                let (right, end) = (figures.left() + title_width, stand.screen.right());
                assert!(right <= end && right > end - 2.0 * MARGIN, "{size:?}: {figures}");
                // The triangle before the title folds and unfolds.
                let (pos, before) = (figures.left_top() + vec2(16.0, 16.0), stand.is_folded());
                let press = |pressed| egui::Event::PointerButton {
                    pos,
                    button: egui::PointerButton::Primary,
                    pressed,
                    modifiers: egui::Modifiers::NONE,
                };
                stand.turn(vec![egui::Event::PointerMoved(pos)]);
                stand.turn(vec![press(true)]);
                stand.turn(vec![press(false)]);
                (0..4).for_each(|_| drop(stand.turn(Vec::new())));
                assert_ne!(stand.is_folded(), before, "{size:?}: a click at {pos} does nothing");
            }
        }
    }
}
