//! The window's inside without a window: events and time in, pictures out, overlay included.

use crate::room::apart;
use crate::stand::{SIZE, Stand};
use shadow_fields::bake;
use shadow_fields::draw::Antialias;
use shadow_fields::scene::{Lights, Scene};
use shadow_fields::view::input::{Button, Key};
use shadow_fields::view::{Command, Event, Previewed, Setup, Viewer};
use std::collections::HashSet;
use std::time::Duration;

/// What is shown, which is what `render` makes of the same state.
fn as_rendered(stand: &mut Stand, when: &str) -> Vec<[u8; 4]> {
    let shown = stand.shown();
    let scene = stand.viewer.editor.scene().clone();
    assert_eq!(apart(&shown, &stand.rendered(&scene)), 0, "{when}");
    shown
}

#[test]
fn what_is_shown_is_what_render_makes_of_the_state() {
    let Some(mut stand) = Stand::new("state") else { return };
    assert!(stand.viewer.is_baking(), "nothing is cached, so it is baked in the background");
    assert!(stand.viewer.frame.is_none());
    stand.turn();
    stand.ready();
    let first = as_rendered(&mut stand, "at first");

    // Everything that moves the camera or an entity, one after the other; the picture follows each.
    let mut before = first;
    let mut follows = |stand: &mut Stand, what: &str| {
        let now = stand.shown();
        assert!(apart(&before, &now) > 20, "{what} is not seen");
        before = now;
    };
    stand.drag(Button::Left, [20.0, 20.0], [60.0, 40.0]);
    follows(&mut stand, "a turn");
    stand.drag(Button::Right, [20.0, 20.0], [10.0, 40.0]);
    follows(&mut stand, "a pan");
    stand.viewer.event(Event::Wheel(2.0)).unwrap();
    follows(&mut stand, "the wheel");
    stand.key(Key::Home);
    follows(&mut stand, "Home");
    "qq".chars().for_each(|letter| stand.letter(letter));
    assert_eq!(stand.viewer.editor.selection, Some(1), "the ball");
    follows(&mut stand, "the outline");
    let places = (0..SIZE[0]).flat_map(|x| (0..SIZE[1]).map(move |y| [x as f32, y as f32]));
    let at = places.into_iter().find(|at| stand.viewer.editor.grabs(*at)).unwrap();
    stand.drag(Button::Left, at, [at[0] + 30.0, at[1] + 10.0]);
    follows(&mut stand, "a drag of the ball");
    stand.viewer.apply(Command::SetExposure(0.5)).unwrap();
    follows(&mut stand, "exposure");
    stand.viewer.apply(Command::SetSky(0.5)).unwrap();
    follows(&mut stand, "the sky's strength");
    stand.key(Key::Escape);

    // A light that was none: its field is baked in the background while the old picture stays.
    "qqe".chars().for_each(|letter| stand.letter(letter));
    stand.turn();
    stand.ready();
    assert!(stand.viewer.editor.scene().entities[1].emits);
    follows(&mut stand, "a new light");
    stand.key(Key::Escape);
    as_rendered(&mut stand, "after edits");

    // Back as it was, step by step.
    while stand.viewer.editor.undo_count() > 0 {
        stand.viewer.event(Event::Key { key: Key::Z, control: true, repeat: false }).unwrap();
        stand.turn();
    }
    stand.ready();
    let shown = as_rendered(&mut stand, "after undoing everything");

    // The saved file and the picture files.
    stand.viewer.event(Event::Key { key: Key::S, control: true, repeat: false }).unwrap();
    stand.key(Key::F12);
    let written = |ending: &str| {
        let mut files = std::fs::read_dir(&stand.cache).unwrap().map(|f| f.unwrap().path());
        files.find(|f| f.extension().is_some_and(|e| e == ending) && !f.ends_with("scene.toml")).unwrap()
    };
    let [png, exr, toml] = ["png", "exr", "toml"].map(written);
    assert!(exr.metadata().unwrap().len() > 1000);
    let saved = Scene::load(&toml).unwrap();
    let picture = image::open(png).unwrap().into_rgb8();
    let picture: Vec<[u8; 4]> = picture.pixels().map(|p| [p[0], p[1], p[2], 255]).collect();
    assert_eq!(apart(&picture, &stand.rendered(&saved)), 0, "the saved scene gives the saved picture");
    assert_eq!(apart(&picture, &shown), 0, "both are what was shown");
}

#[test]
fn a_bake_shows_the_scene_without_shadows() {
    let Some(mut stand) = Stand::with("preview", |setup| setup.preview_after = Duration::ZERO) else { return };
    let shown = stand.shown();
    assert!(stand.viewer.is_baking() && stand.viewer.frame.is_none());
    let colors: HashSet<[u8; 4]> = shown.iter().copied().collect();
    assert!(colors.len() > 50, "{} colours", colors.len());
    // The camera moves while the bake goes on.
    stand.drag(Button::Left, [20.0, 20.0], [60.0, 40.0]);
    assert!(stand.viewer.frame.is_some() || apart(&shown, &stand.shown()) > 20, "a turn is not seen");
    stand.ready();
    as_rendered(&mut stand, "with its shadows");
}

/// Light on coarse surfaces of the scene as it stands comes before the fields of what moves are baked.
#[test]
fn a_bake_shows_its_light_before_it_ends() {
    // The lamp moves, and captures are so fine that its field takes much longer than the coarse surfaces.
    let finer = |setup: &mut Setup| {
        setup.frame.bake = bake::Options { groups: true, face_px: 128, ..bake::Options::default() };
        setup.frame.lights = Lights::Sharp;
    };
    let motion = ", motion = [{ spin = { period_s = 3 } }]";
    let Some(mut stand) = Stand::of("lit", motion, finer) else { return };
    stand.until("light", |viewer| viewer.previewed == Previewed::Light || viewer.frame.is_some());
    assert!(stand.viewer.frame.is_none() && stand.viewer.is_baking(), "the whole was baked before");
    let first = stand.shown();
    stand.ready();
    let whole = stand.shown();
    // The bar of the bake covers the lowest quarter.
    let compared = 3 * whole.len() / 4;
    let channels = first[..compared].iter().flatten().zip(whole.iter().flatten());
    let off: u64 = channels.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    let mean = off as f64 / (4 * compared) as f64;
    assert!(mean < 1.0, "{mean} of 255 in the mean");
}

/// At rest a window of a software device shows what four samples a pixel and lights at pixels give, and draws that once.
#[test]
fn a_picture_is_refined_once_nothing_moves() {
    let coarse = |setup: &mut Setup| {
        setup.refines = true;
        setup.frame.antialias = Antialias::Outlines;
        setup.frame.lights = Lights::Sharp;
        setup.frame.shading = None;
    };
    let Some(mut stand) = Stand::with("refined", coarse) else { return };
    stand.ready();
    assert!(!stand.viewer.is_refined());
    let scene = stand.viewer.editor.scene().clone();
    let before = stand.rendered(&scene);
    stand.until("a refined picture", Viewer::is_refined);
    let refined = stand.shown();
    assert!(apart(&before, &refined) > 20, "edges are as they were");
    stand.options.antialias = Antialias::Samples;
    as_rendered(&mut stand, "refined");
    stand.viewer.apply(Command::ToggleOverlay).unwrap();
    stand.viewer.apply(Command::ToggleOverlay).unwrap();
    stand.turn();
    stand.viewer.settle().unwrap();
    assert_eq!(stand.viewer.last_passes().join(" "), "show", "the overlay draws nothing again");
    assert!(stand.viewer.is_refined());
    // Beside the error's colours it is of vertices again.
    stand.viewer.apply(Command::ToggleReference).unwrap();
    stand.turn();
    assert!(!stand.viewer.is_refined());
    stand.viewer.apply(Command::ToggleReference).unwrap();
    stand.until("a refined picture again", Viewer::is_refined);
    assert_eq!(apart(&refined, &stand.shown()), 0);
}

#[test]
fn a_scene_that_stands_still_costs_only_its_showing() {
    let Some(mut stand) = Stand::new("still") else { return };
    stand.ready();
    stand.shown();
    let passes = |stand: &mut Stand| {
        stand.turn();
        stand.viewer.settle().unwrap();
        stand.viewer.last_passes().join(" ")
    };
    assert_eq!(passes(&mut stand), "show");
    stand.drag(Button::Left, [20.0, 20.0], [40.0, 20.0]);
    stand.viewer.event(Event::Wheel(1.0)).unwrap();
    assert_eq!(passes(&mut stand), "draw show", "a camera that moves merges nothing");
    stand.viewer.apply(Command::SelectNext).unwrap();
    stand.viewer.apply(Command::SelectNext).unwrap();
    stand.viewer.apply(Command::SetSky(0.5)).unwrap();
    assert_eq!(passes(&mut stand), "merge draw show");
    assert!(!stand.viewer.wants_frame() || stand.viewer.idle().is_some());
}

/// A hand is quicker than a compiler: what its keys ask for is built once, when all of them are known.
#[test]
fn keys_that_wait_cost_one_rebuild() {
    let sharp = |setup: &mut Setup| {
        setup.frame.lights = Lights::Sharp;
        setup.frame.bake.groups = true;
    };
    let Some(mut stand) = Stand::with("hasty", sharp) else { return };
    stand.ready();
    stand.letter('q');
    // The floor as a light and as an occluder: what rests beside it sees past another group. Both are baked here.
    let mut toggle = |count| {
        (0..count).for_each(|_| stand.letter('e'));
        stand.ready();
        stand.viewer.build_count
    };
    let counts = [1, 1, 1, 1, 9].map(&mut toggle);
    assert_eq!(counts, [2, 3, 4, 5, 6]);
    stand.key(Key::Escape); // outlines of what is selected are no part of the scene
    as_rendered(&mut stand, "after nine");
}

#[test]
fn the_overlay_and_the_reference_are_drawn() {
    let Some(mut stand) = Stand::new("overlay") else { return };
    stand.ready();
    let plain = stand.shown();
    stand.letter('h');
    stand.turn();
    let with = stand.shown();
    let covered = apart(&plain, &with);
    assert!(covered > 2000, "the overlay covers {covered} pixels");
    stand.letter('h');
    assert_eq!(apart(&plain, &stand.shown()), 0, "and goes again");

    stand.letter('g');
    stand.until("rays", |viewer| viewer.reference().is_some_and(|(_, fresh)| fresh));
    let split = stand.shown();
    let column = |x: u32| (0..SIZE[1]).map(|y| split[(y * SIZE[0] + x) as usize]).collect::<Vec<_>>();
    // The same place in both halves, lit by the merge and by rays: alike, but not the same.
    let left = column(80);
    let right = column(240);
    let distance: u32 =
        left.iter().zip(&right).map(|(a, b)| (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum::<u32>()).sum();
    assert!(distance > 0 && distance < 40 * SIZE[1], "the halves are {distance} apart");
    stand.letter('g');
    stand.letter('x');
    stand.until("an error", |viewer| viewer.shows_error_colors());
    let error = stand.shown();
    assert!(apart(&plain, &error) > 5000, "false colours replace the picture");
    stand.letter('x');
    assert_eq!(apart(&plain, &stand.shown()), 0, "and it is back");
}
