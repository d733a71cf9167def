//! Maps keys and pointer events to commands, independent of a window, and lists them as help.

use super::command::Command;
use super::editor::Editor;
pub use egui::Key;
use std::fmt::Write;
pub use winit::event::MouseButton as Button;

/// A press is a click if the pointer moves less than this, in pixels of a 96 dpi screen.
const CLICK_SLACK_PX: f32 = 4.0;

/// An event of the window. Positions are in pixels of the window, x to the right, y down; the edited picture is at its
/// left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A key was pressed, or repeats because it is held.
    Key {
        key: Key,
        control: bool,
        repeat: bool,
    },
    /// A button was pressed at a position.
    Press(Button, [f32; 2]),
    /// The pointer moved to a position.
    Move([f32; 2]),
    Release(Button),
    /// Notches of the wheel, positive away from the user.
    Wheel(f32),
    /// The window lost the pointer or the keyboard, so everything held is released.
    Lost,
}

/// One line of the help with its key bindings.
pub struct KeyHelp {
    pub keys: &'static str,
    pub what: &'static str,
    /// Each key, whether with Ctrl, and its command. Empty for lines about the pointer.
    pub bindings: &'static [(Key, bool, Command)],
}

const fn row(keys: &'static str, what: &'static str, bindings: &'static [(Key, bool, Command)]) -> KeyHelp {
    KeyHelp { keys, what, bindings }
}

/// All controls, in the order of the help.
pub const CONTROLS: &[KeyHelp] = &[
    row("drag", "turn the camera", &[]),
    row("right drag", "move the camera", &[]),
    row("wheel", "nearer, farther", &[]),
    row("Home", "show the whole scene", &[(Key::Home, false, Command::Home)]),
    row("click", "select", &[]),
    row(
        "Q / A",
        "select the next, the previous",
        &[(Key::Q, false, Command::SelectNext), (Key::A, false, Command::SelectPrevious)],
    ),
    row("Esc", "select nothing", &[(Key::Escape, false, Command::SelectNone)]),
    row("drag the selected", "move it in the ground plane", &[]),
    row("E", "turn an occluder into a light and back", &[(Key::E, false, Command::ToggleLight)]),
    row("Space", "run, pause", &[(Key::Space, false, Command::ToggleRunning)]),
    row("Z", "next demo scene", &[(Key::Z, false, Command::NextScene)]),
    row("G", "ray-cast reference on the right", &[(Key::G, false, Command::ToggleReference)]),
    row("X", "error in false colour", &[(Key::X, false, Command::ToggleError)]),
    row("F12", "write PNG and EXR", &[(Key::F12, false, Command::Screenshot)]),
    row("Ctrl-S", "save as NAME-edited.toml (then NAME-edited-2.toml)", &[(Key::S, true, Command::Save)]),
    row("Ctrl-Z / Ctrl-Y", "undo, redo", &[(Key::Z, true, Command::Undo), (Key::Y, true, Command::Redo)]),
    row("drop a file", "open a scene, a glTF or an OBJ file", &[]),
    row("F1", "fold, unfold this list", &[(Key::F1, false, Command::ToggleKeys)]),
    row("H", "hide, show all panels", &[(Key::H, false, Command::ToggleOverlay)]),
    row("Ctrl-Q", "close", &[(Key::Q, true, Command::Quit)]),
];

/// The controls as text, one line each, for `--help` and README.
pub fn help() -> String {
    let width = CONTROLS.iter().map(|row| row.keys.len()).max().unwrap_or(0);
    CONTROLS.iter().fold(String::new(), |mut text, row| {
        let _ = writeln!(text, "  {:width$}  {}", row.keys, row.what);
        text
    })
}

/// Effect of dragging with a held button.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Held {
    Turn,
    Pan,
    Grab,
}

/// The pointer between press and release.
#[derive(Clone, Copy, Debug)]
struct PointerDrag {
    button: Button,
    held: Held,
    start: [f32; 2],
    last: [f32; 2],
    /// Left edge of the half of the window in which the press began.
    left: f32,
    /// Whether it moved farther than a click may.
    moved: bool,
}

#[derive(Debug)]
pub struct Input {
    drag: Option<PointerDrag>,
    scale: f32,
}

impl Input {
    /// Input with nothing held. `scale` is the number of screen pixels per pixel of a 96 dpi screen.
    pub fn new(scale: f32) -> Self {
        Input { drag: None, scale: if scale.is_finite() { scale.max(0.1) } else { 1.0 } }
    }

    /// Whether the pointer drags something. Events then belong to the scene, even over the overlay.
    pub fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    pub fn commands(&mut self, event: Event, editor: &Editor) -> Vec<Command> {
        match event {
            Event::Key { key, control, repeat } => of_key(key, control, repeat).into_iter().collect(),
            Event::Press(button @ (Button::Left | Button::Right | Button::Middle), at) => {
                let out = self.let_go();
                // The reference beside the picture has the same camera, so positions in it are used as positions in the
                // picture.
                let width = editor.size()[0] as f32;
                let left = if at[0] >= width { width } else { 0.0 };
                let at = [at[0] - left, at[1]];
                let held = match button {
                    Button::Left if editor.grabs(at) => Held::Grab,
                    Button::Left => Held::Turn,
                    _ => Held::Pan,
                };
                self.drag = Some(PointerDrag { button, held, start: at, last: at, left, moved: false });
                out
            }
            Event::Move(to) => self.moved(to),
            Event::Release(button) if self.drag.is_some_and(|drag| drag.button == button) => {
                let click = self.drag.filter(|drag| !drag.moved && drag.button == Button::Left);
                let mut out = self.let_go();
                out.extend(click.map(|drag| Command::Pick(drag.start)));
                out
            }
            Event::Press(..) | Event::Release(_) => Vec::new(),
            Event::Wheel(notches) => vec![Command::Zoom(notches)],
            Event::Lost => self.let_go(),
        }
    }

    fn moved(&mut self, to: [f32; 2]) -> Vec<Command> {
        let Some(drag) = &mut self.drag else { return Vec::new() };
        let to = [to[0] - drag.left, to[1]];
        let mut out = Vec::new();
        if !drag.moved {
            let [x, y] = [to[0] - drag.start[0], to[1] - drag.start[1]];
            if x.hypot(y) <= CLICK_SLACK_PX * self.scale {
                return out;
            }
            drag.moved = true;
            if drag.held == Held::Grab {
                out.push(Command::DragStart(drag.start));
            }
        }
        let by = [to[0] - drag.last[0], to[1] - drag.last[1]];
        drag.last = to;
        out.push(match drag.held {
            Held::Turn => Command::Orbit(by),
            Held::Pan => Command::Pan(by),
            Held::Grab => Command::DragTo(to),
        });
        out
    }

    fn let_go(&mut self) -> Vec<Command> {
        let ended = self.drag.take().is_some_and(|drag| drag.held == Held::Grab && drag.moved);
        if ended { vec![Command::DragEnd] } else { Vec::new() }
    }
}

/// The command of a key. Held keys repeat undo, redo and selection; other commands do not repeat.
fn of_key(key: Key, control: bool, repeat: bool) -> Option<Command> {
    let mut bindings = CONTROLS.iter().flat_map(|row| row.bindings);
    let (.., command) = bindings.find(|(k, c, _)| (*k, *c) == (key, control))?;
    match *command {
        other @ (Command::Undo | Command::Redo | Command::SelectNext | Command::SelectPrevious) => Some(other),
        other => (!repeat).then_some(other),
    }
}
