//! The overlay's panels in windows of any size.

use egui::{Context, Event, Id, PointerButton, Pos2, Rect, pos2};
use shadow_fields::gpu::Timing;
use shadow_fields::view::panel::{ErrorScale, Status, show, style};
use shadow_fields::view::task::TaskProgress;
use shadow_fields::view::{Command, Editor};
use std::collections::VecDeque;
use std::time::Duration;

const KEYS: &str = "Keys (F1)";
const FIGURES: &str = "Figures";

/// What is laid out in a window of that size (width and height, points), with every note, turn by turn.
struct Stand {
    context: Context,
    editor: Editor,
    screen: Rect,
    time_s: f64,
}

impl Stand {
    fn new(size: [f32; 2]) -> Self {
        let context = Context::default();
        let screen = Rect::from_min_size(Pos2::ZERO, size.into());
        style(&context);
        let mut stand = Stand { context, editor: super::built_in("twelve_instances"), screen, time_s: 0.0 };
        stand.settle();
        stand
    }

    /// Turns until everything has its place.
    fn settle(&mut self) {
        (0..5).for_each(|_| drop(self.turn(Vec::new())));
    }

    fn resize(&mut self, size: [f32; 2]) {
        self.screen = Rect::from_min_size(Pos2::ZERO, size.into());
        self.settle();
    }

    /// The shapes of one more look at it. Commands of widgets are executed.
    fn turn(&mut self, events: Vec<Event>) -> Vec<egui::epaint::ClippedShape> {
        let pass = |pass: &str, milliseconds| Timing { pass: pass.to_owned(), milliseconds, counted: None };
        let times = |i: usize| ["merge", "sharp", "draw", "show"].map(|name| pass(name, 3.0 + (i % 9) as f64)).to_vec();
        let timings: VecDeque<Vec<Timing>> = (0..120).map(times).collect();
        let progress = TaskProgress { what: "rays".into(), done: 3, all: 9, elapsed: Duration::from_secs(4) };
        let status = Status {
            device: "llvmpipe (LLVM 15.0.6, 256 bits)",
            driver: "llvmpipe, Mesa 22.3.6 (LLVM 15.0.6)",
            size: [1280, 720],
            refined: Some(true),
            timings: &timings,
            vertices: Some(70_269),
            lights: Default::default(),
            bake: Some(progress.clone()),
            rays: Some(progress),
            reference: Some((16, 0.01, true)),
            error: Some((ErrorScale { rms: 0.01, limit: 0.1 }, true)),
            messages: vec!["wrote scene-edited.toml"],
        };
        self.time_s += 0.5;
        let screen_rect = Some(self.screen);
        let time = Some(self.time_s);
        let input = egui::RawInput { screen_rect, time, events, ..Default::default() };
        let mut commands = Vec::new();
        let mut output = self.context.run_ui(input, |ui| commands.extend(show(ui.ctx(), &self.editor, &status)));
        output.textures_delta.clear();
        commands.into_iter().for_each(|command| drop(self.editor.apply(command)));
        output.shapes
    }

    fn click(&mut self, pos: Pos2) {
        let press = |pressed| {
            let modifiers = egui::Modifiers::NONE;
            Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers }
        };
        for event in [Event::PointerMoved(pos), press(true), press(false)] {
            self.turn(vec![event]);
        }
        self.settle();
    }

    fn place(&self, title: &str) -> Rect {
        self.context.memory(|memory| memory.area_rect(Id::new(title)).unwrap())
    }

    fn is_folded(&self, title: &str) -> bool {
        self.place(title).height() < 50.0
    }
}

#[test]
fn the_key_folds_the_list_and_shows_it() {
    let mut stand = Stand::new([1280.0, 720.0]);
    let mut after = |commands: &[Command]| {
        commands.iter().for_each(|command| drop(stand.editor.apply(*command)));
        stand.settle();
        (stand.editor.overlay, !stand.is_folded(KEYS))
    };
    assert_eq!(after(&[]), (true, false));
    assert_eq!(after(&[Command::ToggleKeys]), (true, true));
    assert_eq!(after(&[Command::ToggleKeys]), (true, false));
    // A hidden overlay is shown with the list.
    assert_eq!(after(&[Command::ToggleOverlay, Command::ToggleKeys]), (true, true));
    assert_eq!(after(&[Command::ToggleOverlay, Command::ToggleKeys]), (true, true));
}

#[test]
fn a_click_anywhere_on_the_title_folds() {
    for (size, open) in [([320.0, 240.0], false), ([640.0, 360.0], false), ([1280.0, 720.0], true)] {
        let mut stand = Stand::new(size);
        assert_eq!(stand.is_folded(FIGURES), !open, "{size:?}");
        // An even number, so that no panel that is left unfolded covers the other's title.
        for title in [KEYS, FIGURES] {
            for click in 0..6 {
                let panel = stand.place(title);
                assert!(stand.screen.contains_rect(panel), "{size:?}: {title} at {panel}");
                // The triangle before the title, the title, and the line's end.
                let x = [panel.left() + 14.0, panel.left() + 40.0, panel.right() - 8.0][click % 3];
                let before = stand.is_folded(title);
                stand.click(pos2(x, panel.top() + 16.0));
                assert_ne!(stand.is_folded(title), before, "{size:?}: a click at {x} of {title}, {panel}");
            }
        }
    }
}

/// Everything is again as it was, whatever the window was in between.
#[test]
fn panels_grow_back_after_the_window_was_small() {
    for small in [[150.0, 100.0], [600.0, 300.0], [1200.0, 90.0]] {
        let mut stand = Stand::new([1280.0, 720.0]);
        stand.editor.apply(Command::ToggleKeys);
        stand.settle();
        let before = stand.turn(Vec::new());
        stand.resize(small);
        stand.resize([1280.0, 720.0]);
        assert!(stand.turn(Vec::new()) == before, "{small:?}");
    }
}
