//! Keys and the pointer give the commands that the help names.

use super::{SMALL, from_text, picture_place};
use glam::DVec3;
use shadow_fields::view::input::{Button, CONTROLS, Event, Input, Key, help};
use shadow_fields::view::{Command, Editor};

#[test]
fn every_control_has_its_command() {
    let editor = from_text(SMALL);
    let mut input = Input::new(1.0);
    let mut key = |key, control, repeat| input.commands(Event::Key { key, control, repeat }, &editor);
    for (k, control, expected) in [
        (Key::Q, false, Command::SelectNext),
        (Key::A, false, Command::SelectPrevious),
        (Key::Escape, false, Command::SelectNone),
        (Key::E, false, Command::ToggleLight),
        (Key::Z, false, Command::NextScene),
        (Key::Z, true, Command::Undo),
        (Key::Y, true, Command::Redo),
        (Key::S, true, Command::Save),
        (Key::Q, true, Command::Quit),
        (Key::Space, false, Command::ToggleRunning),
        (Key::G, false, Command::ToggleReference),
        (Key::X, false, Command::ToggleError),
        (Key::H, false, Command::ToggleOverlay),
        (Key::F1, false, Command::ToggleKeys),
        (Key::F12, false, Command::Screenshot),
        (Key::Home, false, Command::Home),
    ] {
        assert_eq!(key(k, control, false), [expected], "{k:?}");
        // Held, a toggle does not flutter and undo goes on.
        let repeated = key(k, control, true);
        match expected {
            Command::Undo | Command::Redo | Command::SelectNext | Command::SelectPrevious => {
                assert_eq!(repeated, [expected])
            }
            _ => assert_eq!(repeated, []),
        }
    }
    for unbound in [Key::W, Key::Num5, Key::F3] {
        assert_eq!(key(unbound, false, false), []);
    }
    assert_eq!(key(Key::S, false, false), [], "s alone does not save");
    // Every row of the help is one line, short enough for the overlay.
    let text = help();
    assert_eq!(text.lines().count(), CONTROLS.len());
    assert!(text.lines().all(|line| line.len() <= 90), "{text}");
}

#[test]
fn the_pointer_clicks_turns_pans_and_drags() {
    let mut editor = from_text(SMALL);
    editor.apply(Command::ToggleRunning);
    let mut input = Input::new(2.0);
    let ball = picture_place(&editor, DVec3::new(0.0, 0.5, 0.5));
    let near = [ball[0] + 5.0, ball[1]];
    // A press that hardly moves is a click where it began.
    assert_eq!(input.commands(Event::Press(Button::Left, ball), &editor), []);
    assert_eq!(input.commands(Event::Move(near), &editor), []);
    assert_eq!(input.commands(Event::Release(Button::Left), &editor), [Command::Pick(ball)]);
    // Not selected: a drag turns the camera, by all of the way.
    let far = [ball[0] + 20.0, ball[1] + 6.0];
    input.commands(Event::Press(Button::Left, ball), &editor);
    assert_eq!(input.commands(Event::Move(far), &editor), [Command::Orbit([20.0, 6.0])]);
    assert_eq!(input.commands(Event::Move([far[0] + 1.0, far[1]]), &editor), [Command::Orbit([1.0, 0.0])]);
    assert_eq!(input.commands(Event::Release(Button::Left), &editor), []);
    assert_eq!(input.commands(Event::Move(ball), &editor), []);
    // Selected: it is dragged from where it was grabbed.
    editor.apply(Command::Pick(ball));
    assert_eq!(editor.selection, Some(1));
    input.commands(Event::Press(Button::Left, ball), &editor);
    assert_eq!(input.commands(Event::Move(far), &editor), [Command::DragStart(ball), Command::DragTo(far)]);
    assert!(input.is_dragging());
    assert_eq!(input.commands(Event::Lost, &editor), [Command::DragEnd]);
    assert!(!input.is_dragging());
    assert_eq!(input.commands(Event::Release(Button::Left), &editor), []);
    // The other buttons move the camera, and a click of theirs is nothing.
    for button in [Button::Right, Button::Middle] {
        input.commands(Event::Press(button, ball), &editor);
        assert_eq!(input.commands(Event::Move(far), &editor), [Command::Pan([20.0, 6.0])]);
        assert_eq!(input.commands(Event::Release(Button::Left), &editor), [], "not the button that is held");
        assert_eq!(input.commands(Event::Release(button), &editor), []);
        input.commands(Event::Press(button, ball), &editor);
        assert_eq!(input.commands(Event::Release(button), &editor), []);
    }
    assert_eq!(input.commands(Event::Wheel(-2.0), &editor), [Command::Zoom(-2.0)]);
    // A place in the reference stands for that of the picture beside it, and so does a drag from there.
    let beside = |[x, y]: [f32; 2]| [x + 200.0, y];
    input.commands(Event::Press(Button::Left, beside(ball)), &editor);
    assert_eq!(input.commands(Event::Move(far), &editor).len(), 2);
    assert_eq!(input.commands(Event::Move(beside(far)), &editor), [Command::DragTo(far)]);
    assert_eq!(input.commands(Event::Release(Button::Left), &editor), [Command::DragEnd]);
    input.commands(Event::Press(Button::Left, beside(near)), &editor);
    assert_eq!(input.commands(Event::Release(Button::Left), &editor), [Command::Pick(near)]);
    // A second button ends what the first began.
    input.commands(Event::Press(Button::Left, ball), &editor);
    input.commands(Event::Move(far), &editor);
    assert_eq!(input.commands(Event::Press(Button::Right, far), &editor), [Command::DragEnd]);
}

#[test]
fn switches_are_said_to_have_changed() {
    let mut editor = from_text(SMALL);
    for command in [Command::Screenshot, Command::Save, Command::Quit] {
        assert!(!editor.apply(command).changed.any(), "the window's own");
    }
    let flags = |e: &Editor| [e.running, e.reference, e.error, e.overlay];
    let before = flags(&editor);
    for command in [Command::ToggleRunning, Command::ToggleReference, Command::ToggleError, Command::ToggleOverlay] {
        assert!(editor.apply(command).changed.display);
    }
    assert_eq!(flags(&editor), before.map(|flag| !flag));
    assert!(!editor.apply(Command::Resize([0, 0])).changed.any(), "a minimised window has no picture");
    assert_eq!((editor.window(), editor.size()), ([200, 100], [100, 100]), "beside a reference");
}
