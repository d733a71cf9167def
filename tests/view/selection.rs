//! What is selected, by keys and by the pointer.

use super::{SMALL, built_in, from_text, picture_place};
use glam::DVec3;
use shadow_fields::view::{Command, Editor};

#[test]
fn selection_walks_around() {
    let mut editor = from_text(SMALL);
    let mut walk = |command| {
        editor.apply(command);
        editor.selection
    };
    assert_eq!([(); 4].map(|()| walk(Command::SelectNext)), [Some(0), Some(1), Some(2), Some(0)]);
    assert_eq!([(); 3].map(|()| walk(Command::SelectPrevious)), [Some(2), Some(1), Some(0)]);
    assert_eq!(walk(Command::SelectNone), None);
    assert_eq!(walk(Command::SelectPrevious), Some(2));
    let empty = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n";
    let mut editor = from_text(empty);
    for command in [Command::SelectNext, Command::Home, Command::Pick([3.0, 3.0]), Command::Undo] {
        editor.apply(command);
    }
    assert_eq!(editor.selection, None);
}

/// First hit of a ray with all triangles of a scene, in f64 (Moeller and Trumbore).
fn brute_force(editor: &Editor, origin: DVec3, direction: DVec3) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (index, (entity, place)) in editor.scene().entities.iter().zip(editor.placements()).enumerate() {
        let mesh = &editor.scene().meshes[entity.mesh];
        let at = |i: u32| {
            place.turn() * (mesh.positions[i as usize].as_dvec3() * f64::from(place.scale)) + place.position.as_dvec3()
        };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(at);
            let e = b - a;
            let f = c - a;
            let p = direction.cross(f);
            let determinant = e.dot(p);
            let t = origin - a;
            let (u, v) = (t.dot(p) / determinant, direction.dot(t.cross(e)) / determinant);
            let along = f.dot(t.cross(e)) / determinant;
            let is_inside = determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0;
            if is_inside && along > 0.0 && best.is_none_or(|b| along < b.1) {
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
        let mut hits = 0;
        let mut disagree = 0;
        let mut seen = std::collections::BTreeSet::new();
        // Every pixel of a coarse grid against all triangles, the ray made from the camera by itself.
        let camera = editor.camera().clone();
        let eye = camera.eye.as_dvec3();
        let ahead = (camera.target - camera.eye).as_dvec3().normalize();
        let right = ahead.cross(DVec3::Y).normalize();
        let up = right.cross(ahead);
        let half = (f64::from(camera.fov_deg).to_radians() / 2.0).tan();
        for y in (0..64).step_by(9) {
            for x in (0..96).step_by(9) {
                let at = [x as f32 + 0.5, y as f32 + 0.5];
                let h = (f64::from(at[0]) - 48.0) / 32.0;
                let v = (32.0 - f64::from(at[1])) / 32.0;
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
            "camera = {{ eye = [0, 0, {}], target = [0, 0, 0] }}\noutput = {{ width = 16384, height = 16384 }}\n\
             mesh = [{{ name = \"b\", sphere = {{ radius_m = 1, subdivisions = 3 }} }}]\n\
             entity = [{{ mesh = \"b\", scale = {scale} }}]\n",
            900.0 * scale
        );
        let mut editor = from_text(&text);
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
    assert_eq!(editor.selection, Some(amber));
    assert!(editor.grabs(at) && !editor.grabs([at[0] + 200.0, at[1] + 100.0]));
    let before = editor.placements()[amber];
    let data = editor.scene().data.clone();
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
