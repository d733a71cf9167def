//! What stands behind the window, without a window: events in, state out.

use glam::{DVec3, DVec4, Vec3};
use proptest::prelude::*;
use shadow_fields::asset::embedded;
use shadow_fields::frame::camera::clip_from_world;
use shadow_fields::scene::{Data, Scene};
use shadow_fields::view::input::{Button, CONTROLS, Event, Input, Key, help};
use shadow_fields::view::{Command, Editor, Request, Step};
use std::path::Path;

fn built_in(name: &str) -> Editor {
    let (_, text) = embedded::scenes().into_iter().find(|(found, _)| *found == name).unwrap();
    let path = format!("assets/scenes/{name}.toml");
    Editor::new(Scene::parse(text, Path::new(&path), &embedded::read).unwrap(), Path::new(&path))
}

fn from_text(text: &str) -> Editor {
    let read = |path: &Path| Err(shadow_fields::Error::input(path, "this test has no files"));
    Editor::new(Scene::parse(text, Path::new("t.toml"), &read).unwrap(), Path::new("t.toml"))
}

/// A ball, a lamp and a floor.
const SMALL: &str = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n[output]\nwidth = 200\nheight = 100\n\
    [environment]\nuniform = [0.1, 0.1, 0.1]\n\
    [[mesh]]\nname = \"floor\"\nplane = { size_m = 8, cells = 2 }\n\
    [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 2 }\n\
    [[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"ball\"\nposition = [0, 0.5, 0]\nalbedo = [0.8, 0.4, 0.2]\n\
    [[entity]]\nname = \"lamp\"\nmesh = \"ball\"\nposition = [1.5, 2, 0]\nscale = 0.5\nemission = [40, 40, 30]\n\
    motion = [{ orbit = { centre = [0, 2, 0], period_s = 4 } }]\n";

fn step(step: Step) -> Command {
    Command::Step { step, repeat: false }
}

fn picture_place(editor: &Editor, point: DVec3) -> [f32; 2] {
    let [width, height] = editor.size().map(f64::from);
    let clip = clip_from_world(editor.camera(), width / height) * point.extend(1.0);
    [((clip.x / clip.w + 1.0) * width / 2.0) as f32, ((clip.y / clip.w + 1.0) * height / 2.0) as f32]
}

#[test]
fn the_first_picture_is_the_files() {
    for (name, _) in embedded::scenes() {
        let editor = built_in(name);
        let scene = Scene::load(Path::new(&format!("assets/scenes/{name}.toml"))).unwrap();
        assert_eq!(editor.camera(), &scene.data.camera, "{name}");
        assert_eq!((editor.placements(), editor.selection()), (scene.at(0.0), None));
        assert!(editor.is_running() && editor.undo_count() == 0 && editor.shows_overlay());
    }
}

#[test]
fn a_scene_without_distant_light_gets_a_sky_that_is_saved() {
    let dark = SMALL.replace("[environment]\nuniform = [0.1, 0.1, 0.1]\n", "");
    let mut editor = from_text(&dark);
    assert!(editor.scene().data.environment.sky.is_some() && !editor.scene().environment.is_none());
    let saved = Data::parse(&editor.data(Path::new("")).unwrap().to_toml(), Path::new("d.toml")).unwrap();
    assert_eq!(saved.environment, editor.scene().data.environment);
    // Turned off, it stays off when it is saved.
    assert!(editor.apply(Command::SetSky(0.0)).changed.sky && editor.scene().environment.is_none());
    let saved = editor.data(Path::new("")).unwrap().to_toml();
    let read = |path: &Path| Err(shadow_fields::Error::input(path, "this test has no files"));
    let again = Editor::new(Scene::parse(&saved, Path::new("d.toml"), &read).unwrap(), Path::new("d.toml"));
    assert!(again.scene().environment.is_none());
    // A scene that has its light keeps it.
    assert!(from_text(SMALL).scene().data.environment.sky.is_none());
}

#[test]
fn orbiting_keeps_distance_and_target_and_never_flips() {
    let mut editor = from_text(SMALL);
    let before = editor.camera().clone();
    let distance = before.eye.distance(before.target);
    // Half a turn: x and z of the eye change sign.
    assert!(editor.apply(Command::Orbit([100.0, 0.0])).changed.camera);
    let eye = editor.camera().eye;
    assert!(eye.distance(Vec3::new(0.0, 2.0, -5.0)) < 1e-5, "{eye}");
    for drag in [[0.0, 1e6], [0.0, 500.0], [3.0, -1e9], [f32::NAN, 1.0], [f32::INFINITY, 0.0], [1e30, -1e38]] {
        editor.apply(Command::Orbit(drag));
        let camera = editor.camera();
        assert!((camera.eye.distance(camera.target) - distance).abs() < 1e-4 && camera.target == before.target);
        assert!(camera.eye.is_finite() && camera.up() == Vec3::Y, "{camera:?}: up is up even at the limit");
    }
    // Down all the way, then sideways: the eye stays below.
    assert!(editor.camera().eye.y < editor.camera().target.y);
    // A drag to the right turns the scene with the pointer: what is in front moves right.
    let mut editor = from_text(SMALL);
    let front = DVec3::new(0.0, 0.5, 0.5);
    let was = picture_place(&editor, front);
    editor.apply(Command::Orbit([10.0, 10.0]));
    let now = picture_place(&editor, front);
    assert!(now[0] > was[0] + 1.0 && now[1] > was[1] + 0.5, "{was:?} {now:?}");
}

#[test]
fn a_camera_from_straight_above_or_below_turns_on() {
    for (eye, lean) in [("[0, 5, 0]", 1.0), ("[0, -5, 0]", -1.0)] {
        let mut editor = from_text(
            &SMALL
                .replace("eye = [0, 2, 5]", &format!("eye = {eye}"))
                .replace("[0, 0.5, 0]\n[output]", "[0, 0, 0]\n[output]"),
        );
        // What is up in the picture stays up when the eye leans back.
        let up = picture_place(&editor, DVec3::new(0.0, 0.0, -1.0));
        assert!((up[0] - 100.0).abs() < 1e-3 && up[1] < 50.0, "{up:?}");
        editor.apply(Command::Orbit([0.0, if lean > 0.0 { -1.0 } else { 1.0 }]));
        let eye = editor.camera().eye;
        assert!(eye.x.abs() < 1e-5 && eye.z * lean > 0.01, "{eye}");
        let up = picture_place(&editor, DVec3::new(0.0, 0.0, -1.0));
        assert!((up[0] - 100.0).abs() < 1e-3 && up[1] < 50.0, "{up:?}");
    }
}

#[test]
fn panning_keeps_the_target_plane_under_the_pointer() {
    let mut editor = from_text(SMALL);
    let point = editor.camera().target.as_dvec3();
    let was = picture_place(&editor, point);
    editor.apply(Command::Pan([17.0, -9.0]));
    let now = picture_place(&editor, point);
    assert!((now[0] - was[0] - 17.0).abs() < 1e-3 && (now[1] - was[1] + 9.0).abs() < 1e-3, "{was:?} {now:?}");
    for _ in 0..50 {
        editor.apply(Command::Pan([1e30, -1e30]));
    }
    let camera = editor.camera();
    assert!(camera.eye.is_finite() && camera.target.abs().max_element() < 1e7, "{camera:?}");
}

#[test]
fn zoom_is_bounded_and_home_frames_what_matters() {
    let mut editor = from_text(SMALL);
    editor.apply(Command::Zoom(f32::NAN));
    for notches in [1e30, -1e30, 1e30] {
        for _ in 0..300 {
            editor.apply(Command::Zoom(notches));
        }
        let camera = editor.camera();
        assert!(camera.eye.is_finite() && camera.eye.distance(camera.target) > 1e-6, "{camera:?}");
        assert!(Data::parse(&editor.scene().to_toml(), Path::new("z.toml")).is_ok());
    }
    for size in [[200, 100], [100, 200], [10, 1000]] {
        editor.apply(Command::Resize(size));
        editor.apply(Command::Home);
        let placements = editor.placements();
        let mut farthest = 0.0_f32;
        for (entity, place) in placements.iter().enumerate().skip(1) {
            let mesh = &editor.scene().meshes[editor.scene().entities[entity].mesh];
            for p in &mesh.positions {
                let [x, y] = picture_place(&editor, (place.rotation * (*p * place.scale) + place.position).as_dvec3());
                let across = [x / size[0] as f32, y / size[1] as f32].map(|c| (c - 0.5).abs());
                farthest = across.into_iter().fold(farthest, f32::max);
            }
        }
        assert!(farthest <= 0.5 && farthest > 0.3, "{size:?}: {farthest} of the picture, and not too small in it");
    }
}

#[test]
fn selection_walks_around() {
    let mut editor = from_text(SMALL);
    let mut walk = |command| {
        editor.apply(command);
        editor.selection()
    };
    assert_eq!([(); 4].map(|()| walk(Command::SelectNext)), [Some(0), Some(1), Some(2), Some(0)]);
    assert_eq!([(); 3].map(|()| walk(Command::SelectPrevious)), [Some(2), Some(1), Some(0)]);
    assert_eq!(walk(Command::SelectNone), None);
    assert_eq!(walk(Command::SelectPrevious), Some(2));
    let empty = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n";
    let mut editor = from_text(empty);
    for command in [Command::SelectNext, Command::Home, Command::Pick([3.0, 3.0]), step(Step::Left), Command::Undo] {
        editor.apply(command);
    }
    assert_eq!(editor.selection(), None);
}

#[test]
fn steps_go_where_the_camera_sees_them_go_at_all_times() {
    let ways = [
        (Step::Left, [-1, 0]),
        (Step::Right, [1, 0]),
        (Step::Up, [0, -1]),
        (Step::Down, [0, 1]),
        (Step::Forth, [0, -1]),
        (Step::Back, [0, 1]),
    ];
    for turn in [0.0, 30.0, 120.0, 190.0] {
        for (way, [right, down]) in ways {
            let mut editor = from_text(SMALL);
            editor.apply(Command::Orbit([turn, 3.0]));
            editor.apply(Command::SelectPrevious);
            let times = [0.0, 1.3, 77.7];
            let before = times.map(|t| editor.scene().at(t));
            assert!(editor.apply(step(way)).changed.placements);
            let after = times.map(|t| editor.scene().at(t));
            let moved = after[0][2].position - before[0][2].position;
            for (a, b) in after.iter().zip(&before) {
                assert_eq!(a[..2], b[..2], "the others stay");
                // The whole path moves along.
                assert!((a[2].position - b[2].position).distance(moved) < 1e-5);
                assert_eq!((a[2].rotation, a[2].scale), (b[2].rotation, b[2].scale));
            }
            // At the target, so that a step along the line of sight is not seen as one across it.
            let target = editor.camera().target.as_dvec3();
            let (was, now) = (picture_place(&editor, target), picture_place(&editor, target + moved.as_dvec3()));
            let across = [now[0] - was[0], now[1] - was[1]];
            for (axis, sign) in [(0, right), (1, down)] {
                let seen = across[axis];
                assert!(if sign == 0 { seen.abs() < 1e-2 } else { seen * sign as f32 > 0.3 }, "{way:?} {across:?}");
            }
        }
    }
}

#[test]
fn nothing_selected_moves_all_but_mere_ground() {
    let mut editor = from_text(SMALL);
    let before = editor.placements();
    editor.apply(step(Step::Up));
    editor.apply(step(Step::Larger));
    let after = editor.placements();
    assert_eq!(before[0], after[0], "the floor stays");
    for (a, b) in after.iter().zip(&before).skip(1) {
        assert!(a.position.y > b.position.y && (a.scale / b.scale - 1.05).abs() < 1e-6);
    }
    // The floor can be moved by itself.
    editor.apply(Command::SelectNext);
    editor.apply(step(Step::Down));
    assert!(editor.placements()[0].position.y < 0.0);
}

#[test]
fn turning_turns_in_place_at_all_times() {
    let text = format!(
        "{SMALL}[[entity]]\nmesh = \"ball\"\nposition = [1, 1, 1]\nmotion = [{{ spin = {{ axis = [1, 0.2, 0], period_s = 3 }} }}, \
        {{ bob = {{ amplitude_m = 0.3, period_s = 2 }} }}]\n"
    );
    let mut editor = from_text(&text);
    editor.apply(Command::SelectPrevious);
    for time in [0.0, 0.4, 2.9, 50.0] {
        let before = editor.scene().at(time)[3];
        editor.apply(step(Step::TurnLeft));
        let after = editor.scene().at(time)[3];
        let turn = glam::Quat::from_rotation_y(5.0_f32.to_radians());
        assert!((turn * before.rotation).dot(after.rotation).abs() > 1.0 - 1e-6);
        assert_eq!(after.position, before.position);
    }
}

#[test]
fn a_step_beyond_the_limits_of_a_scene_does_nothing() {
    let mut editor = from_text(&SMALL.replace("scale = 0.5", "scale = 9.9e6"));
    editor.apply(Command::SelectPrevious);
    let before = editor.scene().data.clone();
    let effect = editor.apply(step(Step::Larger));
    assert!(effect.message.is_some() && !effect.changed.any() && editor.undo_count() == 0);
    assert_eq!(editor.scene().data, before);
}

#[test]
fn an_occluder_becomes_a_light_and_back() {
    let mut editor = from_text(SMALL);
    assert!(editor.apply(Command::ToggleLight).message.is_some(), "nothing selected");
    editor.apply(Command::SelectNext);
    editor.apply(Command::SelectNext);
    let before = editor.scene().entities[1].clone();
    let effect = editor.apply(Command::ToggleLight);
    assert!(effect.changed.roles && effect.changed.emission);
    let light = editor.scene().entities[1].clone();
    assert!(light.emits && !light.occludes && light.emission.max_element() >= 1.0);
    let hue = light.emission / light.emission.max_element();
    assert!(hue.distance(Vec3::new(1.0, 0.5, 0.25)) < 1e-5, "its light has its colour: {hue}");
    editor.apply(Command::SetLight(5.0));
    editor.apply(Command::ToggleLight);
    assert_eq!(editor.scene().entities[1], before);
    editor.apply(Command::ToggleLight);
    assert!((editor.scene().entities[1].emission.max_element() - 32.0).abs() < 1e-3, "it is as bright as it was");
    // A lamp that stops shining casts a shadow, and its field is the occlusion field that it had.
    editor.apply(Command::SelectNext);
    let fields = editor.needs(1);
    editor.apply(Command::ToggleLight);
    let lamp = &editor.scene().entities[2];
    assert!(!lamp.emits && lamp.occludes && lamp.emission == Vec3::ZERO);
    assert_eq!(editor.needs(1), fields);
    // The floor needs a field that it did not have.
    assert_eq!(editor.needs(0), [None, None]);
    editor.apply(Command::SelectNext);
    editor.apply(Command::ToggleLight);
    assert!(editor.needs(0)[0].is_some());
    // A torus of two colours needs the other kind.
    let mut editor = built_in("glowing_torus");
    let glowing = editor.scene().entities.iter().position(|e| e.name == "glowing").unwrap();
    while editor.selection() != Some(glowing) {
        editor.apply(Command::SelectNext);
    }
    let mesh = editor.scene().entities[glowing].mesh;
    let before = editor.needs(mesh);
    editor.apply(Command::ToggleLight);
    assert!(
        before[0].is_none()
            && before[1].is_some()
            && editor.needs(mesh)[0].is_some()
            && editor.needs(mesh)[1].is_none()
    );
}

#[test]
fn sliders_change_the_scene_and_undo_as_one() {
    let mut editor = from_text(SMALL);
    let before = editor.scene().data.clone();
    assert!((editor.light_ev().unwrap() - 40.0_f32.log2()).abs() < 1e-6);
    for i in 0..20 {
        assert!(editor.apply(Command::SetLight(1.0 + i as f32 * 0.2)).changed.emission);
    }
    assert!((editor.light_ev().unwrap() - 4.8).abs() < 1e-5);
    let hue = editor.scene().entities[2].emission;
    assert!((hue.z / hue.x - 0.75).abs() < 1e-5, "the colour stays");
    editor.apply(Command::EndSlide);
    for i in 2..9 {
        assert!(editor.apply(Command::SetSky(i as f32)).changed.sky);
    }
    assert!((editor.scene().environment.radiance(DVec3::Y)[0] - 0.8).abs() < 1e-6);
    for i in 1..9 {
        assert!(editor.apply(Command::SetSkyTurn(100.0 * i as f32)).changed.sky);
    }
    assert!((editor.sky_turn_deg() - 80.0).abs() < 1e-3);
    for i in 1..9 {
        assert!(editor.apply(Command::SetExposure(i as f32 / 4.0)).changed.exposure);
    }
    for bad in [
        Command::SetSky(-1.0),
        Command::SetSky(f32::NAN),
        Command::SetExposure(f32::NAN),
        Command::SetLight(f32::NAN),
        Command::SetExposure(99.0),
        Command::SetLight(1e9),
        Command::SetSkyTurn(f32::INFINITY),
    ] {
        let (now, count) = (editor.scene().data.clone(), editor.undo_count());
        assert!(!editor.apply(bad).changed.any(), "{bad:?}");
        assert_eq!((&editor.scene().data, editor.undo_count()), (&now, count), "{bad:?}");
    }
    assert_eq!(editor.undo_count(), 4);
    for _ in 0..4 {
        assert!(editor.apply(Command::Undo).changed.any());
    }
    assert_eq!(editor.scene().data, before);
    assert!(editor.apply(Command::Undo).message.is_some());
}

#[test]
fn a_held_key_is_one_step_of_undo_and_two_presses_are_two() {
    let mut editor = from_text(SMALL);
    editor.apply(Command::SelectNext);
    editor.apply(Command::SelectNext);
    let start = editor.scene().data.clone();
    editor.apply(step(Step::Left));
    for _ in 0..9 {
        editor.apply(Command::Step { step: Step::Left, repeat: true });
    }
    let first = editor.scene().data.clone();
    editor.apply(step(Step::Left));
    assert_eq!(editor.undo_count(), 2);
    editor.apply(Command::Undo);
    assert_eq!(editor.scene().data, first);
    editor.apply(Command::Undo);
    assert_eq!(editor.scene().data, start);
    editor.apply(Command::Redo);
    assert_eq!(editor.scene().data, first);
    // A new change forgets what was taken back.
    editor.apply(step(Step::Up));
    assert!(editor.apply(Command::Redo).message.is_some());
}

#[test]
fn history_is_bounded() {
    let mut editor = from_text(SMALL);
    for _ in 0..2000 {
        editor.apply(step(Step::TurnLeft));
    }
    assert_eq!(editor.undo_count(), shadow_fields::view::history::STEP_LIMIT);
}

/// First hit of a ray with all triangles of a scene, in f64 (Moeller and Trumbore).
fn brute_force(editor: &Editor, origin: DVec3, direction: DVec3) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (index, (entity, place)) in editor.scene().entities.iter().zip(editor.placements()).enumerate() {
        let mesh = &editor.scene().meshes[entity.mesh];
        let at = |i: u32| {
            place.rotation.as_dquat().normalize() * (mesh.positions[i as usize].as_dvec3() * f64::from(place.scale))
                + place.position.as_dvec3()
        };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(at);
            let (e, f) = (b - a, c - a);
            let p = direction.cross(f);
            let determinant = e.dot(p);
            let t = origin - a;
            let (u, v) = (t.dot(p) / determinant, direction.dot(t.cross(e)) / determinant);
            let along = f.dot(t.cross(e)) / determinant;
            if determinant != 0.0
                && u >= 0.0
                && v >= 0.0
                && u + v <= 1.0
                && along > 0.0
                && best.is_none_or(|b| along < b.1)
            {
                best = Some((index, along));
            }
        }
    }
    best
}

#[test]
fn picking_finds_what_is_seen() {
    for name in ["torus_over_plane", "twelve_instances", "teapot_lights"] {
        let mut editor = built_in(name);
        editor.apply(Command::Resize([96, 64]));
        editor.advance(1.7);
        editor.apply(Command::Orbit([5.0, -3.0]));
        let (mut hits, mut disagree, mut seen) = (0, 0, std::collections::BTreeSet::new());
        // Every pixel of a coarse grid against all triangles, the ray made from the camera by itself.
        let camera = editor.camera().clone();
        let (eye, ahead) = (camera.eye.as_dvec3(), (camera.target - camera.eye).as_dvec3().normalize());
        let right = ahead.cross(DVec3::Y).normalize();
        let up = right.cross(ahead);
        let half = (f64::from(camera.fov_deg).to_radians() / 2.0).tan();
        for y in (0..64).step_by(9) {
            for x in (0..96).step_by(9) {
                let at = [x as f32 + 0.5, y as f32 + 0.5];
                let (h, v) = ((f64::from(at[0]) - 48.0) / 32.0, (32.0 - f64::from(at[1])) / 32.0);
                let direction = (ahead + half * (h * right + v * up)).normalize();
                let expected = brute_force(&editor, eye, direction);
                let found = editor.hit(at);
                match (expected, found) {
                    (Some((entity, along)), Some((picked, point))) if entity == picked => {
                        hits += 1;
                        seen.insert(entity);
                        assert!((point - eye - along * direction).length() < 1e-4 * along, "{name} {at:?}");
                    }
                    (None, None) => {}
                    // A ray along an edge may fall to either side.
                    _ => disagree += 1,
                }
                if let Some((_, point)) = found {
                    let back = picture_place(&editor, point);
                    assert!((back[0] - at[0]).hypot(back[1] - at[1]) < 1e-2, "{back:?} is not {at:?}");
                }
            }
        }
        assert!(hits > 30 && disagree == 0, "{name}: {hits} hits, {disagree} not");
        assert!(seen.len() >= 3, "{name}: {seen:?}");
    }
}

#[test]
fn picking_is_exact_from_far_and_at_odd_scales() {
    for scale in [1e-6, 1.0, 1e4] {
        let text = format!(
            "[camera]\neye = [0, {0}, {1}]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"b\"\nsphere = {{ radius_m = 1, subdivisions = 3 }}\n\
             [[entity]]\nmesh = \"b\"\nscale = {2}\n",
            0.0,
            900.0 * scale,
            scale
        );
        let mut editor = from_text(
            &text.replace("[[mesh]]", "[output]\nwidth = 20000\nheight = 20000\n[[mesh]]").replace("20000", "16384"),
        );
        // The ball's rim: 1 / 900 of the distance.
        let rim = 8192.0 / (20.0_f32.to_radians().tan()) / 900.0;
        assert_eq!(editor.hit([8192.0, 8192.0 - 0.98 * rim]).map(|h| h.0), Some(0), "{scale}");
        assert_eq!(editor.hit([8192.0, 8192.0 - 1.02 * rim]), None, "{scale}");
        assert!(editor.apply(Command::Pick([8192.0, 8192.0])).changed.selection);
    }
}

#[test]
fn a_dragged_entity_follows_the_pointer_in_the_ground_plane() {
    let mut editor = built_in("teapot_lights");
    let amber = editor.scene().entities.iter().position(|e| e.name == "amber").unwrap();
    editor.apply(Command::ToggleRunning);
    editor.advance(5.0);
    let (centre, _) = editor.sphere(amber, &editor.placements()[amber]);
    let at = picture_place(&editor, centre);
    assert!(!editor.grabs(at), "not selected yet: a drag turns the camera");
    editor.apply(Command::Pick(at));
    assert_eq!(editor.selection(), Some(amber));
    assert!(editor.grabs(at) && !editor.grabs([at[0] + 200.0, at[1] + 100.0]));
    let (before, data) = (editor.placements()[amber], editor.scene().data.clone());
    let (_, grabbed) = editor.hit(at).unwrap();
    editor.apply(Command::DragStart(at));
    for i in 1..=30 {
        let to = [at[0] - 4.0 * i as f32, at[1] + 3.0 * i as f32];
        assert!(editor.apply(Command::DragTo(to)).changed.placements);
        // What was grabbed is under the pointer.
        let moved = (editor.placements()[amber].position - before.position).as_dvec3();
        let seen = picture_place(&editor, grabbed + moved);
        assert!((seen[0] - to[0]).hypot(seen[1] - to[1]) < 0.05, "{seen:?} {to:?}");
        assert_eq!(moved.y, 0.0);
    }
    // Above the horizon there is no ground: it stays where it was.
    let before_sky = editor.placements();
    assert!(!editor.apply(Command::DragTo([at[0], -1e5])).changed.any());
    assert!(!editor.apply(Command::DragTo([f32::NAN, 3.0])).changed.any());
    assert_eq!(editor.placements(), before_sky);
    editor.apply(Command::DragEnd);
    assert_eq!(editor.undo_count(), 1, "a drag is one step");
    editor.apply(Command::DragTo(at));
    assert_eq!(editor.placements(), before_sky, "let go");
    editor.apply(Command::Undo);
    assert_eq!(editor.scene().data, data);
}

#[test]
fn time_passes_by_its_sum_alone() {
    let mut coarse = built_in("twelve_instances");
    let mut fine = built_in("twelve_instances");
    let steps: Vec<f64> = (0..400).map(|i| f64::from(1 + i % 7) / 64.0).collect();
    steps.iter().for_each(|dt| drop(fine.advance(*dt)));
    coarse.advance(steps.iter().sum());
    // Binary fractions, so that the sums are equal to the bit, and so must be the scenes.
    assert_eq!(coarse.time_s(), fine.time_s());
    assert_eq!(coarse.placements(), fine.placements());
    assert_eq!(coarse.placements(), coarse.scene().at(coarse.time_s()));
    coarse.apply(Command::ToggleRunning);
    for dt in [1.0, f64::NAN, -1.0, f64::INFINITY] {
        assert!(!coarse.advance(dt).changed.any());
    }
    coarse.apply(Command::ToggleRunning);
    for dt in [f64::NAN, -1.0, f64::INFINITY, 0.0] {
        assert!(!coarse.advance(dt).changed.any());
    }
    assert_eq!(coarse.time_s(), fine.time_s());
    assert!(coarse.advance(0.5).changed.placements);
    // Where nothing moves, time changes nothing.
    let mut still = from_text(&SMALL.replace("motion", "# motion"));
    assert!(!still.advance(0.5).changed.any());
}

#[test]
fn the_next_scene_comes_round() {
    let mut editor = built_in("glowing_torus");
    editor.apply(Command::Resize([300, 200]));
    editor.apply(step(Step::Left));
    editor.apply(Command::ToggleRunning);
    let mut names = Vec::new();
    for _ in 0..6 {
        let effect = editor.apply(Command::NextScene);
        assert!(effect.changed.scene && effect.message.is_none());
        assert_eq!((editor.size(), editor.undo_count(), editor.selection()), ([300, 200], 0, None));
        assert!(!editor.is_running() && editor.hit([150.0, 120.0]).is_some());
        names.push(editor.path().file_stem().unwrap().to_str().unwrap().to_owned());
    }
    assert_eq!(
        names,
        [
            "sphere_over_plane",
            "teapot_lights",
            "torus_over_plane",
            "twelve_instances",
            "glowing_torus",
            "sphere_over_plane"
        ]
    );
    let mut own = from_text(SMALL);
    own.apply(step(Step::Left));
    let data = own.scene().data.clone();
    own.apply(Command::NextScene);
    assert_eq!(own.path(), Path::new("assets/scenes/glowing_torus.toml"));
    // Changes are not lost to it: undo leads back to them, and then takes them back.
    own.apply(Command::Resize([90, 60]));
    let effect = own.apply(Command::Undo);
    assert!(effect.changed.scene && effect.message.unwrap().contains("t.toml"));
    assert_eq!((own.path(), &own.scene().data, own.size()), (Path::new("t.toml"), &data, [90, 60]));
    assert!(own.apply(Command::Undo).changed.placements && own.apply(Command::Undo).message.is_some());
    // An unchanged scene leaves nothing to go back to.
    own.apply(Command::NextScene);
    assert!(!own.apply(Command::Undo).changed.any());
}

#[test]
fn a_saved_scene_reads_back_as_the_state() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _) in embedded::scenes() {
        let mut editor = built_in(name);
        for command in [
            Command::Resize([321, 123]),
            Command::Orbit([30.0, 12.0]),
            Command::Zoom(3.0),
            Command::SelectNext,
            Command::SelectNext,
            step(Step::Left),
            step(Step::TurnRight),
            step(Step::Larger),
            Command::ToggleLight,
            Command::SetSky(1.7),
            Command::TurnSky { by_deg: 33.0, repeat: false },
            Command::SetExposure(0.3),
        ] {
            editor.apply(command);
        }
        editor.advance(1.234_567);
        // Anywhere: built-in meshes are found by their built-in names.
        let path = folder.path().join(format!("{name}-edited.toml"));
        editor.save(&path).unwrap();
        let scene = Scene::load(&path).unwrap();
        assert_eq!(scene.data.output.time_s, editor.time_s());
        assert_eq!([scene.data.output.width, scene.data.output.height], [321, 123]);
        assert_eq!(scene.data.output.exposure_ev, 0.3);
        assert_eq!(scene.data.camera, *editor.camera());
        assert_eq!(scene.data.environment, editor.scene().data.environment);
        assert_eq!(scene.data.entities, editor.scene().data.entities);
        assert_eq!(scene.entities, editor.scene().entities);
        assert_eq!(scene.at(scene.data.output.time_s), editor.placements());
        for (a, b) in scene.meshes.iter().zip(&editor.scene().meshes) {
            assert_eq!((a.content_hash(), &a.name), (b.content_hash(), &b.name));
        }
        assert_eq!(scene.environment.coefficients(4), editor.scene().environment.coefficients(4));
        // And it can be edited on, and saved over.
        let mut again = Editor::new(scene, &path);
        assert_eq!((again.placements(), again.save_path()), (editor.placements(), path.clone()));
        again.save(&path).unwrap();
        assert_eq!(Scene::load(&path).unwrap().data, again.scene().data);
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 5, "nothing but the scenes: {left:?}");
    let nowhere = folder.path().join("no/such/s.toml");
    let error = built_in("glowing_torus").save(&nowhere).unwrap_err();
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().starts_with(&nowhere.display().to_string()), "{error}");
}

#[test]
fn saved_files_are_found_from_other_folders() {
    let folder = tempfile::tempdir().unwrap();
    let (here, there) = (folder.path().join("here"), folder.path().join("there"));
    std::fs::create_dir_all(here.join("meshes")).unwrap();
    std::fs::create_dir_all(&there).unwrap();
    std::fs::write(here.join("meshes/t.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    shadow_fields::asset::picture::write_exr(&here.join("sky.exr"), 2, 1, &[1.0; 6]).unwrap();
    let text = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[environment]\nimage = { file = \"sky.exr\" }\n\
                [[mesh]]\nname = \"m\"\nfile = \"meshes/t.obj\"\n[[mesh]]\nname = \"b\"\nfile = \"assets/meshes/torus.obj\"\n[[entity]]\nmesh = \"m\"\n";
    std::fs::write(here.join("s.toml"), text).unwrap();
    let open = |path: &Path| Editor::new(Scene::load(path).unwrap(), path);
    let mut editor = open(&here.join("s.toml"));
    assert_eq!(editor.save_path(), here.join("s-edited.toml"));
    editor.save(&editor.save_path()).unwrap();
    assert_eq!(editor.save_path(), here.join("s-edited.toml"), "its own file is written over");
    let beside = Scene::load(&here.join("s-edited.toml")).unwrap();
    assert_eq!(beside.data, editor.scene().data, "beside it, names stay as they are");
    editor.save(&there.join("s.toml")).unwrap();
    editor.save(&folder.path().join("s.toml")).unwrap();
    for path in [there.join("s.toml"), folder.path().join("s.toml")] {
        let scene = Scene::load(&path).unwrap();
        assert_eq!(scene.meshes[0].content_hash(), editor.scene().meshes[0].content_hash());
        assert_eq!(scene.environment.radiance(DVec3::X), [1.0; 3]);
    }
    let moved = Scene::load(&folder.path().join("s.toml")).unwrap();
    assert_eq!(moved.data.meshes[0].file.as_deref(), Some(Path::new("here/meshes/t.obj")), "relative where it can be");
    assert_eq!(moved.data.meshes[1].file.as_deref(), Some(Path::new("assets/meshes/torus.obj")));
}

#[test]
fn what_an_earlier_session_saved_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("s.toml"), SMALL).unwrap();
    let open = |name: &str| Editor::new(Scene::load(&at(name)).unwrap(), &at(name));
    let mut saved = Vec::new();
    for name in ["s-edited.toml", "s-edited-2.toml", "s-edited-3.toml"] {
        let mut editor = open("s.toml");
        editor.advance(0.1 * (1 + saved.len()) as f64);
        for _ in 0..2 {
            assert_eq!(editor.save_path(), at(name));
            editor.save(&editor.save_path()).unwrap();
        }
        saved.push((name, std::fs::read(at(name)).unwrap()));
    }
    for (name, bytes) in &saved {
        assert_eq!(&std::fs::read(at(name)).unwrap(), bytes, "{name}");
        assert_eq!(open(name).save_path(), at(name), "opened, it is written over");
    }
    // The same scene loaded again in one session is still that session.
    let mut editor = open("s.toml");
    editor.save(&editor.save_path()).unwrap();
    editor.apply(Command::Step { step: Step::Right, repeat: false });
    editor.apply(Command::NextScene);
    editor.apply(Command::Undo);
    assert_eq!((editor.path(), editor.save_path()), (&*at("s.toml"), at("s-edited-4.toml")));
}

#[test]
fn every_control_has_its_command() {
    let editor = from_text(SMALL);
    let mut input = Input::new(1.0);
    let mut key = |key, control, repeat| input.commands(Event::Key { key, control, repeat }, &editor);
    let letter = |c| Key::Letter(c);
    for (k, control, expected) in [
        (letter('q'), false, Command::SelectNext),
        (letter('a'), false, Command::SelectPrevious),
        (Key::Escape, false, Command::SelectNone),
        (letter('j'), false, step(Step::Left)),
        (letter('l'), false, step(Step::Right)),
        (letter('i'), false, step(Step::Up)),
        (letter('k'), false, step(Step::Down)),
        (letter('o'), false, step(Step::Back)),
        (letter('p'), false, step(Step::Forth)),
        (letter('n'), false, step(Step::Larger)),
        (letter('m'), false, step(Step::Smaller)),
        (letter('r'), false, step(Step::TurnLeft)),
        (letter('t'), false, step(Step::TurnRight)),
        (letter('e'), false, Command::ToggleLight),
        (letter('z'), false, Command::NextScene),
        (letter('z'), true, Command::Undo),
        (letter('y'), true, Command::Redo),
        (letter('s'), true, Command::Save),
        (letter('q'), true, Command::Quit),
        (Key::Space, false, Command::ToggleRunning),
        (letter('g'), false, Command::ToggleReference),
        (letter('x'), false, Command::ToggleError),
        (letter('h'), false, Command::ToggleOverlay),
        (Key::Function(1), false, Command::ToggleOverlay),
        (Key::Function(12), false, Command::Screenshot),
        (Key::Home, false, Command::Home),
    ] {
        assert_eq!(key(k, control, false), [expected], "{k:?}");
        // Held, a toggle does not flutter and a step goes on.
        let repeated = key(k, control, true);
        match expected {
            Command::Step { step, .. } => assert_eq!(repeated, [Command::Step { step, repeat: true }]),
            Command::Undo | Command::Redo | Command::SelectNext | Command::SelectPrevious => {
                assert_eq!(repeated, [expected])
            }
            _ => assert_eq!(repeated, []),
        }
    }
    for unbound in [letter('w'), letter('5'), Key::Function(3)] {
        assert_eq!(key(unbound, false, false), []);
    }
    assert_eq!(key(letter('s'), false, false), [], "s alone does not save");
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
    assert_eq!(editor.selection(), Some(1));
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
    // In the reference beside the picture, a place stands for the same place of the picture, and so does a drag from there.
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
fn requests_reach_the_window() {
    let mut editor = from_text(SMALL);
    for (command, request) in
        [(Command::Screenshot, Request::Screenshot), (Command::Save, Request::Save), (Command::Quit, Request::Quit)]
    {
        let effect = editor.apply(command);
        assert!(effect.request == Some(request) && !effect.changed.any());
    }
    let flags = |e: &Editor| [e.is_running(), e.shows_reference(), e.shows_error(), e.shows_overlay()];
    let before = flags(&editor);
    for command in [Command::ToggleRunning, Command::ToggleReference, Command::ToggleError, Command::ToggleOverlay] {
        assert!(editor.apply(command).changed.display);
    }
    assert_eq!(flags(&editor), before.map(|flag| !flag));
    assert!(editor.apply(Command::SetVariant(Some("texel"))).changed.variant);
    assert_eq!(editor.variant(), Some("texel"));
    assert!(!editor.apply(Command::Resize([0, 0])).changed.any(), "a minimised window has no picture");
    assert_eq!(editor.size(), [200, 100]);
}

fn any_command() -> impl Strategy<Value = Command> {
    let number = || prop_oneof![-300.0_f32..300.0, Just(f32::NAN), Just(f32::INFINITY), Just(-1e30), Just(0.0)];
    let place = move || [number(), number()];
    prop_oneof![
        place().prop_map(Command::Orbit),
        place().prop_map(Command::Pan),
        number().prop_map(Command::Zoom),
        place().prop_map(Command::Pick),
        place().prop_map(Command::DragStart),
        place().prop_map(Command::DragTo),
        number().prop_map(Command::SetSkyTurn),
        number().prop_map(Command::SetSky),
        number().prop_map(Command::SetLight),
        number().prop_map(Command::SetExposure),
        (number(), any::<bool>()).prop_map(|(by_deg, repeat)| Command::TurnSky { by_deg, repeat }),
        [0_u32..2000, 0_u32..2000].prop_map(Command::Resize),
        (0_usize..CONTROLS.len(), any::<bool>()).prop_flat_map(|(row, repeat)| {
            let keys: Vec<Command> = row_commands(row).into_iter().map(|c| repeated(c, repeat)).collect();
            proptest::sample::select(keys)
        }),
        (0_usize..10, any::<bool>()).prop_map(|(i, repeat)| repeated(
            step(
                [
                    Step::Left,
                    Step::Right,
                    Step::Up,
                    Step::Down,
                    Step::Forth,
                    Step::Back,
                    Step::Larger,
                    Step::Smaller,
                    Step::TurnLeft,
                    Step::TurnRight
                ][i]
            ),
            repeat
        )),
    ]
}

fn repeated(command: Command, repeat: bool) -> Command {
    match command {
        Command::Step { step, .. } => Command::Step { step, repeat },
        other => other,
    }
}

fn row_commands(row: usize) -> Vec<Command> {
    let commands = CONTROLS[row].commands();
    if commands.is_empty() { vec![Command::DragEnd, Command::EndSlide] } else { commands }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, rng_seed: proptest::test_runner::RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever is done: everything stays finite and within what a scene file holds, undo takes it all back, redo brings it again.
    #[test]
    fn any_commands(commands in prop::collection::vec(any_command(), 1..60)) {
        let mut editor = from_text(SMALL);
        let start = editor.scene().clone();
        let mut done = 0;
        for command in commands.into_iter().filter(|c| *c != Command::NextScene) {
            let before = editor.scene().data.clone();
            let effect = editor.apply(command);
            editor.advance(0.01);
            let after = &editor.scene().data;
            // What is said to have changed is what changed.
            let changed = effect.changed;
            prop_assert!(changed.placements || changed.emission || changed.roles || before.entities == after.entities, "{command:?}");
            prop_assert_eq!(changed.sky, before.environment != after.environment, "{:?}", command);
            prop_assert_eq!(changed.exposure, before.output != after.output, "{:?}", command);
            prop_assert!(changed.camera || before.camera == after.camera);
            prop_assert!(editor.placements().iter().all(|p| p.position.is_finite() && p.scale > 0.0 && p.rotation.is_normalized()));
            done += 1;
        }
        prop_assert!(done < shadow_fields::view::history::STEP_LIMIT);
        let saved = Data::parse(&editor.data(Path::new("")).unwrap().to_toml(), Path::new("p.toml"));
        prop_assert!(saved.is_ok(), "{saved:?}");
        let end = editor.scene().data.clone();
        let mut undone = 0;
        while editor.undo_count() > 0 {
            editor.apply(Command::Undo);
            undone += 1;
        }
        prop_assert_eq!(&editor.scene().data.entities, &start.data.entities);
        prop_assert_eq!(&editor.scene().entities, &start.entities);
        prop_assert_eq!(&editor.scene().data.environment, &start.data.environment);
        prop_assert_eq!(editor.exposure_ev(), start.data.output.exposure_ev);
        (0..undone).for_each(|_| drop(editor.apply(Command::Redo)));
        prop_assert_eq!(&editor.scene().data.entities, &end.entities);
        prop_assert_eq!(&editor.scene().data.environment, &end.environment);
    }
}

#[test]
fn rays_pass_through_their_pixels() {
    let mut editor = from_text(SMALL);
    editor.apply(Command::Orbit([13.0, 7.0]));
    for at in [[0.5, 0.5], [100.0, 50.0], [199.5, 3.25]] {
        let ray = editor.ray(at);
        let clip: DVec4 = clip_from_world(editor.camera(), 2.0) * (ray.origin + 3.0 * ray.direction).extend(1.0);
        let back = [(clip.x / clip.w + 1.0) * 100.0, (clip.y / clip.w + 1.0) * 50.0];
        assert!((back[0] - f64::from(at[0])).abs() < 1e-6 && (back[1] - f64::from(at[1])).abs() < 1e-6);
    }
}
