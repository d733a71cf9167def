//! Edits of an entity hold at all times, whatever its motion.

use glam::{DVec3, Vec3};
use shadow_fields::scene::{Data, EntityData};
use shadow_fields::view::edit;
use std::path::Path;

fn entity(lines: &str) -> EntityData {
    let text = format!("[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[[entity]]\nmesh = \"m\"\n{lines}\n");
    Data::parse(&text, Path::new("t.toml")).unwrap().entities.remove(0)
}

/// Every kind of motion, with keys of some parts or none.
const MOTIONS: [&str; 8] = [
    "{ orbit = { centre = [1, -2, 0.5], axis = [0.3, 1, 0.2], period_s = 3 } }",
    "{ spin = { axis = [1, 2, 0], period_s = -4 } }",
    "{ bob = { axis = [0, 1, 1], amplitude_m = 0.7, period_s = 2, phase_deg = 30 } }",
    "{ keyframes = { keys = [{ time_s = 0.5, position = [1, 2, -1], rotation = { axis = [0, 1, 1], angle_deg = 50 } }, \
     { time_s = 2, scale = 0.5 }], repeat = true, interpolation = \"smooth\" } }",
    "{ keyframes = { keys = [{ time_s = 1, scale = 2 }, { time_s = 3, position = [0, -1, 2] }] } }",
    "{ node = { position = [2, 0, 1], rotation = { axis = [1, 0, 0], angle_deg = 130 }, scale = 0.6 } }",
    "{ node = { position_keys = { times_s = [-1, 3], values = [[1, 0, 2], [0, 2, 0]], period_s = 5 } } }",
    "{ node = { scale = 2, position_keys = { times_s = [0, 2], values = [[1, 1, 0], [0, 0, 2]], \
     in_slopes = [[0, 1, 0], [1, 0, 0]], out_slopes = [[2, 0, 0], [0, 0, 1]], interpolation = \"cubic\" } } }",
];

#[test]
fn moving_moves_the_whole_path() {
    let still = entity("position = [1, 0, -2]\nrotation = { axis = [1, 1, 0], angle_deg = 200 }\nscale = 1.5");
    let motions: Vec<_> =
        MOTIONS.iter().map(|motion| entity(&format!("motion = [{motion}]")).motion.remove(0)).collect();
    // One, two and three of them after one another, or none.
    let count = motions.len() + 1;
    for turn in 0..count.pow(3) {
        let chosen = [turn % count, turn / count % count, turn / count.pow(2)];
        let motion = chosen.iter().filter_map(|&index| motions.get(index).cloned()).collect();
        let entity = EntityData { motion, ..still.clone() };
        let by = Vec3::new(0.7, -2.5, 1.3);
        let moved = edit::moved(&entity, by.as_dvec3()).unwrap();
        for time_s in [-7.3, 0.0, 0.4, 1.6, 2.9, 18.0] {
            let [before, after] = [&entity, &moved].map(|entity| entity.at(time_s));
            assert!((after.position - before.position).distance(by) < 1e-4, "{:?} at {time_s} s", entity.motion);
            assert!(after.rotation.dot(before.rotation).abs() > 1.0 - 1e-6, "{:?} at {time_s} s", entity.motion);
            assert!((after.scale / before.scale - 1.0).abs() < 1e-6, "{:?} at {time_s} s", entity.motion);
        }
    }
}

#[test]
fn what_leaves_the_range_of_a_scene_file_is_refused() {
    let keys = "{ keyframes = { keys = [{ time_s = 0, position = [9e6, 0, 0], scale = 1e6 }] } }";
    let entity = &entity(&format!("motion = [{keys}, {{ orbit = {{ centre = [0, 0, -9e6], period_s = 1 }} }}]"));
    assert!(edit::moved(entity, DVec3::new(5e5, 0.0, 0.0)).is_some());
    assert!(edit::moved(entity, DVec3::new(2e6, 0.0, 0.0)).is_none(), "a key");
    assert!(edit::moved(entity, DVec3::new(0.0, 0.0, -2e6)).is_none(), "the centre of an orbit");
    assert!(edit::moved(entity, DVec3::splat(f64::NAN)).is_none());
}
