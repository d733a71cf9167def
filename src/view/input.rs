//! Keys and pointer to commands, whatever library they come from, and the help that lists them.

use super::command::{Command, Step};
use super::editor::Editor;
use std::fmt::Write;

/// Pointer travel in pixels of a 96 dpi screen below which a press is a click.
const CLICK_SLACK_PX: f32 = 4.0;
/// Angle by which a key turns the distant light.
const SKY_STEP_DEG: f32 = 5.0;

/// A key, by what it types without Shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// A lower-case letter.
    Letter(char),
    /// Space bar.
    Space,
    /// Esc.
    Escape,
    /// Home.
    Home,
    /// A function key by its number.
    Function(u8),
}

/// A button of the pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// Picks, grabs, turns the camera.
    Left,
    /// Moves the camera.
    Right,
    /// As the right one.
    Middle,
}

/// What a window hears. Places are in pixels of the window, x to the right, y down; the picture that is edited is at its left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A key went down, or was said again because it is held.
    Key {
        /// Which.
        key: Key,
        /// Whether Ctrl is held.
        control: bool,
        /// Whether it is held since an earlier event.
        repeat: bool,
    },
    /// A button went down.
    Press(Button, [f32; 2]),
    /// The pointer is there now.
    Move([f32; 2]),
    /// A button went up.
    Release(Button),
    /// Notches of the wheel, positive away from the user.
    Wheel(f32),
    /// The window lost the pointer or the keyboard: whatever was held is let go.
    Lost,
}

/// One line of the help, and what stands behind it.
pub struct KeyHelp {
    /// Keys as they are shown.
    pub keys: &'static str,
    /// What they do.
    pub what: &'static str,
    /// The keys, whether with Ctrl, and their command. Empty for the pointer's rows.
    bindings: &'static [(Key, bool, Command)],
}

impl KeyHelp {
    /// What its keys ask for.
    pub fn commands(&self) -> Vec<Command> {
        self.bindings.iter().map(|(.., command)| *command).collect()
    }
}

const fn step(key: char, step: Step) -> (Key, bool, Command) {
    (Key::Letter(key), false, Command::Step { step, repeat: false })
}

const fn letter(key: char, command: Command) -> (Key, bool, Command) {
    (Key::Letter(key), false, command)
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
    row("click", "select; nothing selected means all that casts shadows or shines", &[]),
    row(
        "Q / A",
        "select the next, the previous",
        &[letter('q', Command::SelectNext), letter('a', Command::SelectPrevious)],
    ),
    row("Esc", "select nothing", &[(Key::Escape, false, Command::SelectNone)]),
    row("drag the selected", "move it in the ground plane", &[]),
    row("J / L", "left, right as the camera sees it", &[step('j', Step::Left), step('l', Step::Right)]),
    row("I / K", "up, down in the world", &[step('i', Step::Up), step('k', Step::Down)]),
    row("O / P", "back, forth as the camera sees it", &[step('o', Step::Back), step('p', Step::Forth)]),
    row("N / M", "larger, smaller", &[step('n', Step::Larger), step('m', Step::Smaller)]),
    row("R / T", "turn left, right about the vertical", &[step('r', Step::TurnLeft), step('t', Step::TurnRight)]),
    row("E", "occluder to light and back", &[letter('e', Command::ToggleLight)]),
    row(
        "C / V",
        "turn the sky left, right",
        &[
            letter('c', Command::TurnSky { by_deg: SKY_STEP_DEG, repeat: false }),
            letter('v', Command::TurnSky { by_deg: -SKY_STEP_DEG, repeat: false }),
        ],
    ),
    row("Space", "run, pause", &[(Key::Space, false, Command::ToggleRunning)]),
    row("Z", "next demo scene", &[letter('z', Command::NextScene)]),
    row("G", "ray-cast reference beside the picture", &[letter('g', Command::ToggleReference)]),
    row("X", "error in false colour", &[letter('x', Command::ToggleError)]),
    row("F12", "write PNG and EXR", &[(Key::Function(12), false, Command::Screenshot)]),
    row("Ctrl-S", "write NAME-edited.toml, then -2, -3", &[(Key::Letter('s'), true, Command::Save)]),
    row(
        "Ctrl-Z / Ctrl-Y",
        "undo, redo",
        &[(Key::Letter('z'), true, Command::Undo), (Key::Letter('y'), true, Command::Redo)],
    ),
    row(
        "H / F1",
        "this help",
        &[letter('h', Command::ToggleOverlay), (Key::Function(1), false, Command::ToggleOverlay)],
    ),
    row("Ctrl-Q", "close", &[(Key::Letter('q'), true, Command::Quit)]),
];

/// The controls as text, a line each, for `--help` and README.
pub fn help() -> String {
    let width = CONTROLS.iter().map(|row| row.keys.len()).max().unwrap_or(0);
    CONTROLS.iter().fold(String::new(), |mut text, row| {
        let _ = writeln!(text, "  {:width$}  {}", row.keys, row.what);
        text
    })
}

/// What a held button does.
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
    /// Left edge of the part of the window that it began in.
    left: f32,
    /// Whether it went farther than a click does.
    moved: bool,
}

/// Turns events into commands.
#[derive(Debug)]
pub struct Input {
    drag: Option<PointerDrag>,
    scale: f32,
}

impl Input {
    /// Nothing held. `scale` is the screen's pixels per pixel of a 96 dpi screen.
    pub fn new(scale: f32) -> Self {
        Input { drag: None, scale: if scale.is_finite() { scale.max(0.1) } else { 1.0 } }
    }

    /// Whether the pointer holds something: events are the scene's then, even over the overlay.
    pub fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// What an event asks for, in order.
    pub fn commands(&mut self, event: Event, editor: &Editor) -> Vec<Command> {
        match event {
            Event::Key { key, control, repeat } => of_key(key, control, repeat).into_iter().collect(),
            Event::Press(button, at) => {
                let out = self.let_go();
                // The reference beside the picture shows the same scene from the same eye: a place in it is that place.
                let width = editor.size()[0] as f32;
                let left = if at[0] >= width { width } else { 0.0 };
                let at = [at[0] - left, at[1]];
                let held = match button {
                    Button::Left if editor.grabs(at) => Held::Grab,
                    Button::Left => Held::Turn,
                    Button::Right | Button::Middle => Held::Pan,
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
            Event::Release(_) => Vec::new(),
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

/// The command of a key. Held keys repeat where that makes sense: steps, turns, undo and the walk through entities.
fn of_key(key: Key, control: bool, repeat: bool) -> Option<Command> {
    let mut bindings = CONTROLS.iter().flat_map(|row| row.bindings);
    let (.., command) = bindings.find(|(k, c, _)| (*k, *c) == (key, control))?;
    match *command {
        Command::Step { step, .. } => Some(Command::Step { step, repeat }),
        Command::TurnSky { by_deg, .. } => Some(Command::TurnSky { by_deg, repeat }),
        other @ (Command::Undo | Command::Redo | Command::SelectNext | Command::SelectPrevious) => Some(other),
        other => (!repeat).then_some(other),
    }
}
