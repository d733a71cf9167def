//! A window at its limits: its display goes away, and an hour of random input.
#![cfg(all(feature = "view", target_os = "linux"))]

#[path = "common/cli.rs"]
mod cli;
mod common;
#[path = "common/display.rs"]
mod display;
#[path = "common/drag.rs"]
mod drag;
#[path = "common/room.rs"]
mod room;
#[path = "common/viewing.rs"]
mod viewing;

use cli::has_device;
use common::report;
use display::Display;
use std::path::Path;
use std::time::{Duration, Instant};
use viewing::{MOTION, SIZE, View, arguments, open};

/// A window whose first entity has lost or got its light, while the scene stands still or runs.
fn edited<'d>(display: &'d Display, folder: &Path, is_still: bool) -> View<'d> {
    let mut view = open(display, folder);
    view.key("q", "SelectNext");
    view.key("e", "ToggleLight");
    if !is_still {
        view.key("space", "ToggleRunning");
    }
    view
}

/// Xlib would end the process: instead, edits are saved beside the scene, and one line says so.
#[test]
fn a_lost_display_saves_edits() {
    if !has_device() {
        return;
    }
    for is_still in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let Some(display) = Display::open(folder.path()) else { return };
        let view = edited(&display, folder.path(), is_still);
        display.end();
        let (code, heard) = view.end();
        assert_eq!(code, 5, "{heard:#?}");
        // The log, and what Xlib itself prints of a request that follows the loss, which nothing can turn off.
        let others = ["[", "note:", "Xlib:"];
        let is_said = |line: &&String| !others.iter().any(|other| line.starts_with(other));
        let said: Vec<&String> = heard.iter().filter(is_said).collect();
        assert_eq!(said, ["shadow-fields: the display was lost; the edited scene was saved as scene-edited.toml"]);
        let [before, after] = ["scene.toml", "scene-edited.toml"]
            .map(|name| shadow_fields::scene::Scene::load(&folder.path().join(name)).unwrap().entities[0].emits);
        assert_ne!(before, after, "the edit is in the file");
    }
}

/// Another program destroys the window, by its close button or at random: the same holds.
#[test]
fn a_destroyed_window_saves_edits() {
    if !has_device() {
        return;
    }
    for is_still in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let Some(display) = Display::open(folder.path()) else { return };
        let view = edited(&display, folder.path(), is_still);
        display.xdotool(&["windowclose", &view.window]);
        let (code, heard) = view.end();
        assert_eq!(code, 5, "{heard:#?}");
        let end = heard.iter().rfind(|line| line.starts_with("shadow-fields: ")).unwrap();
        assert!(end.ends_with("; the edited scene was saved as scene-edited.toml"), "{end}");
        assert!(shadow_fields::scene::Scene::load(&folder.path().join("scene-edited.toml")).is_ok());
    }
}

/// Heaps of arenas that the C library has made for threads: each is 64 MB of addresses at a multiple of that, of which
/// the first part can be written.
fn thread_heaps(view: &View<'_>) -> Vec<String> {
    const SIZE: u64 = 64 << 20;
    let maps = std::fs::read_to_string(format!("/proc/{}/maps", view.child.0.id())).unwrap();
    let of = |line: &str, access: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let (from, to) = words[0].split_once('-').expect("a range");
        let address = |text| u64::from_str_radix(text, 16).expect("an address");
        (words[1] == access && words.len() == 5).then_some([address(from), address(to)])
    };
    let lines: Vec<&str> = maps.lines().collect();
    let is_heap = |at: &usize| {
        let Some([from, middle]) = of(lines[*at], "rw-p") else { return false };
        let rest = lines.get(at + 1).and_then(|next| of(next, "---p")).filter(|[next, _]| *next == middle);
        from % SIZE == 0 && rest.map_or(middle, |[_, to]| to) % SIZE == 0
    };
    (0..lines.len()).filter(is_heap).map(|at| lines[at].to_owned()).collect()
}

/// Each arena would keep what its threads freed, for as long as the window is open.
#[test]
fn threads_have_no_memory_of_their_own() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let Some(display) = Display::open(folder.path()) else { return };
    let mut view = open(&display, folder.path());
    view.key("g", "ToggleReference");
    view.picture(SIZE);
    assert_eq!(thread_heaps(&view), [""; 0]);
    view.close();
}

/// Memory of the window's process in bytes.
fn memory(view: &View<'_>) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", view.child.0.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    1024 * line.split_whitespace().next().unwrap().parse::<u64>().unwrap()
}

/// Time that the window's process has been on processors, in seconds.
fn processor_s(view: &View<'_>) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", view.child.0.id())).unwrap();
    // Words 14 and 15, in hundredths of a second; the second word is a name in parentheses.
    let (_, words) = stat.rsplit_once(')').unwrap();
    words.split_whitespace().skip(11).take(2).map(|ticks| ticks.parse::<f64>().unwrap()).sum::<f64>() / 100.0
}

/// Processor time of a frame in milliseconds, of those that are drawn while the scene runs for three seconds.
fn frame_ms(view: &mut View<'_>) -> f64 {
    let mut frame = || {
        view.key("space", "ToggleRunning");
        let line = view.heard.last().unwrap();
        let (_, words) = line.split_once("frame ").unwrap();
        let number: f64 = words.split(':').next().unwrap().parse().unwrap();
        [number, processor_s(view)]
    };
    let before = frame();
    std::thread::sleep(Duration::from_secs(3));
    let after = frame();
    assert!(after[0] > before[0] + 10.0, "{} frames in three seconds", after[0] - before[0]);
    1e3 * (after[1] - before[1]) / (after[0] - before[0])
}

/// Keys that change the scene, the selection or the camera. Tab would give the keyboard to a panel.
const KEYS: [&str; 7] = ["q", "a", "e", "ctrl+z", "ctrl+y", "Home", "Escape"];
/// Keys that are pressed again before pictures are compared. The first shows panels, on which a pointer would change
/// more.
const TOGGLES: [&str; 4] = ["h", "g", "x", "space"];

/// Half a minute of keys, drags, wheels and sizes; then the scene is opened anew.
fn round(view: &mut View<'_>, random: &mut fastrand::Rng, scene: &Path) {
    let end = Instant::now() + Duration::from_secs(30);
    let mut pressed = [false; TOGGLES.len()];
    while Instant::now() < end {
        let place = |random: &mut fastrand::Rng| [random.i32(0..480), random.i32(0..320)];
        match random.u32(0..10) {
            0..5 => drop(view.display.xdotool(&["key", random.choice(KEYS).unwrap()])),
            5 => {
                let which = random.usize(0..TOGGLES.len());
                pressed[which] = !pressed[which];
                view.display.xdotool(&["key", TOGGLES[which]]);
            }
            6..9 if pressed[0] => {}
            6 | 7 => {
                let (button, from, to) = (random.choice(["1", "3"]).unwrap(), place(random), place(random));
                view.drag(button, from, to);
            }
            8 => drop(view.display.xdotool(&["click", random.choice(["4", "5"]).unwrap()])),
            _ => {
                let [width, height] = [random.u32(200..600), random.u32(150..440)].map(|side| side.to_string());
                view.display.xdotool(&["windowsize", &view.window, &width, &height]);
            }
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    for (key, _) in TOGGLES.iter().zip(pressed).filter(|(_, pressed)| *pressed) {
        view.display.xdotool(&["key", key]);
    }
    view.display.xdotool(&["key", "Escape", "windowsize", "--sync", &view.window, "480", "320"]);
    drag::drop_file(&view.display.name, view.window.parse().unwrap(), scene, [200, 100]);
    view.hears("message: opened ");
    // Beside the window: the server draws the pointer into the pixels that are compared.
    view.display.xdotool(&["mousemove", "630", "470"]);
    // Lines over the picture have gone by then.
    std::thread::sleep(Duration::from_secs(12));
}

/// The variable says how many seconds; an hour without it.
#[test]
#[ignore = "takes an hour"]
fn random_input_takes_no_memory_and_changes_no_picture() {
    if !has_device() {
        return;
    }
    let seconds = std::env::var("VIEW_SOAK_SECONDS").map_or(3600, |text| text.parse().expect("seconds"));
    let folder = tempfile::tempdir().unwrap();
    let Some(display) = Display::open(folder.path()) else { return };
    let scene = room::write(folder.path(), SIZE.map(|side| side as u32), MOTION);
    let mut words = arguments();
    // The validation layer keeps what it has seen.
    words.retain(|word| !["--validation", "sync"].contains(word));
    let mut view = View::open(&display, folder.path(), &words);
    let (start, mut random) = (Instant::now(), fastrand::Rng::with_seed(1));
    let (mut first, mut memories, mut times) = (None, Vec::new(), Vec::new());
    report(&format!("at first {:.1} MB", memory(&view) as f64 * 1e-6));
    while start.elapsed() < Duration::from_secs(seconds) {
        round(&mut view, &mut random, &scene);
        let (now, shown) = (memory(&view), view.picture(SIZE));
        let frame_ms = frame_ms(&mut view);
        memories.push(now);
        times.push((1e3 * frame_ms) as u64);
        let (rounds, seconds) = (memories.len(), start.elapsed().as_secs_f64());
        report(&format!("{rounds} rounds, {seconds:.0} s: {:.1} MB, {frame_ms:.2} ms a frame", now as f64 * 1e-6));
        let first: &Vec<[u8; 3]> = first.get_or_insert_with(|| shown.clone());
        if *first != shown {
            let keep = |name: &str, pixels: &[[u8; 3]]| {
                let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
                let [width, height] = SIZE.map(|side| side as u32);
                image::save_buffer(&path, pixels.as_flattened(), width, height, image::ColorType::Rgb8).unwrap();
                path
            };
            let [a, b] = [keep("view_first.png", first), keep("view_later.png", &shown)];
            let count = room::apart(first, &shown);
            panic!("round {rounds} ends with {count} other pixels: {} and {}", a.display(), b.display());
        }
    }
    // A fifth of the rounds warms up. What lies unused between what is used goes up and down by some percent from round
    // to round.
    let fifth = |all: &[u64], which: usize| {
        let mut some = all[which * all.len() / 5..((which + 1) * all.len() / 5).max(1)].to_vec();
        some.sort_unstable();
        some[some.len() / 2] as f64
    };
    let [memory, time] = [&memories, &times].map(|all| [fifth(all, 1), fifth(all, 4)]);
    report(&format!("medians of the second fifth and of the last: {memory:?} bytes, {time:?} microseconds a frame"));
    assert!(memory[1] <= 1.02 * memory[0], "memory grew: {memory:?} bytes");
    // A machine changes its own speed by 1.4.
    assert!(time[1] <= 1.5 * time[0], "frames slowed: {time:?} microseconds of processors");
    display.xdotool(&["key", "ctrl+q", "sleep", "1"]);
    view.close();
}
