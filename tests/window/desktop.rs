//! A real window on a virtual display: a key of each kind, resizing, minimising, a screenshot against `render`, a clean end.

use crate::cli::{COARSE, Folder, finish};
use crate::viewing::{OPTIONS, SIZE, View, desk, open, until};
use crate::{model, room};
use std::time::Duration;

#[test]
fn a_window_does_what_its_controls_say() {
    let Some((folder, display)) = desk() else { return };
    let mut view = open(&display, &folder);
    let first = view.picture(SIZE);
    assert!(first.iter().any(|p| *p != first[0]), "the window is of one colour");

    // A letter, a function key and those that have names.
    for (key, text) in [
        ("q", "SelectNext"),
        ("F1", "ToggleKeys"),
        ("h", "ToggleOverlay"),
        ("Escape", "SelectNone"),
        ("space", "ToggleRunning"),
        ("space", "ToggleRunning"),
        ("Home", "Home"),
    ] {
        view.key(key, text);
    }

    // The pointer: turn, pan, wheel, pick, and drag what was picked.
    view.drag("1", [30, 30], [90, 60]);
    view.drag("3", [30, 30], [40, 20]);
    display.xdotool(&["click", "4"]);
    view.hears("command Zoom(1.0)");
    view.key("Home", "command Home");
    let places = view.picture(SIZE);
    display.xdotool(&["mousemove", "240", "170", "sleep", "0.1", "click", "1"]);
    view.hears("command Pick");
    let picked = view.picture(SIZE);
    assert!(places != picked, "what is picked is outlined");
    view.drag("1", [240, 170], [300, 190]);
    view.hears("command DragStart");
    view.hears("command DragEnd");
    view.key("e", "command ToggleLight");
    view.key("e", "command ToggleLight");

    // Resized ten times, at last back to the first size, and minimised in between.
    for round in 0..10 {
        let (width, height) = (480 - 16 * (9 - round), 320 + 8 * (9 - round));
        display.xdotool(&["windowsize", &view.window.clone(), &width.to_string(), &height.to_string()]);
        view.hears(&format!("resized to {width}x{height}"));
        if round == 4 {
            display.xdotool(&["windowunmap", "--sync", &view.window.clone()]);
            std::thread::sleep(Duration::from_millis(300));
            display.xdotool(&["windowmap", "--sync", &view.window.clone()]);
            display.xdotool(&["windowfocus", "--sync", &view.window.clone()]);
        }
    }

    // Saved, looked at, and rendered from the file.
    view.key("Escape", "command SelectNone");
    view.key("ctrl+s", "wrote");
    view.key("F12", "wrote");
    let shown = view.picture(SIZE);
    let heard = view.close();
    let swapchains = heard.iter().filter(|line| line.contains("swapchain of")).count();
    assert!(swapchains >= 8, "{swapchains} swapchains for ten sizes");
    folder.good(&format!("render scene-edited.toml -o again.png {COARSE}"));
    let again = image::open(folder.at("again.png")).unwrap().into_rgb8();
    assert_eq!([again.width() as usize, again.height() as usize], SIZE, "the saved scene has the window's size");
    let again: Vec<[u8; 3]> = again.pixels().map(|p| p.0).collect();
    assert_eq!(room::apart(&shown, &again), 0, "pixels of the window that `render` makes otherwise");
    let kept = image::open(folder.at("scene-001.png")).unwrap().into_rgb8();
    assert!(kept.pixels().zip(&again).all(|(a, b)| a.0 == *b), "F12 writes what `render` does");
    assert!(folder.at("scene-001.exr").exists());
}

/// A GLB file with three parts that move and two lamps, with no scene file.
#[test]
fn a_gltf_file_moves_in_the_window() {
    let Some((folder, display)) = desk() else { return };
    model::robot().write(folder.path(), "robot");
    let view = View::open(&display, &folder, &format!("view robot.glb {OPTIONS} {COARSE}"));
    // Once the first picture is there, another follows.
    for _ in 0..2 {
        let first = display.look(SIZE);
        until("nothing moves in the window", 100, || room::apart(&first, &display.look(SIZE)) > 50);
    }
    assert!(folder.names().iter().all(|name| !name.ends_with(".toml")), "no scene file was written");
    view.close();
}

#[test]
fn the_next_scene_is_baked_and_shown_and_closing_ends_a_bake() {
    let Some((folder, display)) = desk() else { return };
    let mut view = open(&display, &folder);
    view.key("z", "command NextScene");
    // In the middle of what may be its bake.
    view.close();
}

#[test]
fn without_a_display_one_line_names_render() {
    let Some(folder) = Folder::with_device() else { return };
    let mut view = folder.command("view assets/scenes/sphere_over_plane.toml");
    let ran = finish(view.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET"));
    let ran = ran.ended(3, &["no display", "shadow-fields render"]);
    assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
}
