//! Animations of glTF models as motion of nodes, against the specification's formulas, and in scene files.

use crate::model::{Model, QUARTER, load, near};
use glam::{DMat4, DQuat, DVec3, Vec3};
use serde_json::json;
use shadow_fields::scene::keys::{Between, Keys};
use shadow_fields::scene::motion::{Motion, Node};
use shadow_fields::scene::{Data, gltf};
use std::f32::consts::PI;
use std::path::Path;

/// Where a point of an entity's space is at a time.
fn moved(import: &gltf::Import, entity: usize, time_s: f64, point: DVec3) -> DVec3 {
    import.data.entities[entity].at(time_s).point(point)
}

/// A cube in a node.
fn cube(model: &mut Model, mut node: serde_json::Value) -> usize {
    node["mesh"] = json!(model.cuboid([-0.5; 3], [0.5; 3], None));
    model.node(node)
}

#[test]
fn translations_step_go_straight_and_follow_splines() {
    let times = [0.5, 1.0, 3.0];
    let values = [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [5.0, 0.0, -1.0]];
    // In-slope, value, out-slope of each key.
    let cubic = [
        [[9.0, 9.0, 9.0], values[0], [1.0, 0.0, 4.0]],
        [[0.0, 3.0, -2.0], values[1], [2.0, -1.0, 0.5]],
        [[1.0, 1.0, 0.0], values[2], [7.0, 7.0, 7.0]],
    ];
    let mut model = Model::default();
    for how in ["STEP", "LINEAR", "CUBICSPLINE"] {
        let node = cube(&mut model, json!({ "translation": [100, 100, 100] }));
        let numbers = if how == "CUBICSPLINE" { cubic.as_flattened().as_flattened() } else { values.as_flattened() };
        model.animate(0, node, "translation", how, &times, numbers);
    }
    let import = load(&model);
    let [a, b, c] = values.map(|v| Vec3::from(v).as_dvec3());
    let slope = |key: usize, part: usize| Vec3::from(cubic[key][part]).as_dvec3();
    // The specification's formula, in its own letters.
    let spline = |t: f64, dt: f64, k: usize| {
        let v = slope(k, 1);
        let b = slope(k, 2);
        let w = slope(k + 1, 1);
        let a = slope(k + 1, 0);
        let t2 = t * t;
        let t3 = t * t * t;
        (2.0 * t3 - 3.0 * t2 + 1.0) * v + dt * (t3 - 2.0 * t2 + t) * b + (3.0 * t2 - 2.0 * t3) * w + dt * (t3 - t2) * a
    };
    for (time_s, expected) in [
        (0.0, [a, a, a]),
        (0.5, [a, a, a]),
        (0.75, [a, a.lerp(b, 0.5), spline(0.5, 0.5, 0)]),
        (0.999, [a, a.lerp(b, 0.998), spline(0.998, 0.5, 0)]),
        (1.0, [b, b, b]),
        (1.4, [b, b.lerp(c, 0.2), spline(0.2, 2.0, 1)]),
        (2.9, [b, b.lerp(c, 0.95), spline(0.95, 2.0, 1)]),
        // The animation starts anew with its last key.
        (3.0, [a, a, a]),
        (3.75, [a, a.lerp(b, 0.5), spline(0.5, 0.5, 0)]),
        (-1.6, [b, b.lerp(c, 0.2), spline(0.2, 2.0, 1)]),
    ] {
        for (entity, expected) in expected.into_iter().enumerate() {
            let found = moved(&import, entity, time_s, DVec3::ZERO);
            assert!(near(found, expected), "entity {entity} at {time_s} s: {found}, not {expected}");
        }
    }
}

#[test]
fn rotations_take_the_short_way_and_scales_grow() {
    let mut model = Model::default();
    let node = cube(&mut model, json!({ "rotation": [0, 0, 0, 1] }));
    // A quarter about +z, its second key with the other sign.
    let quarter = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -QUARTER, -QUARTER];
    model.animate(0, node, "rotation", "LINEAR", &[0.0, 2.0], &quarter);
    model.animate(0, node, "scale", "LINEAR", &[0.0, 4.0], &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
    let import = load(&model);
    assert_eq!(import.notes.left_out(), [""; 0]);
    for (time_s, angle, scale) in [(0.0, 0.0, 1.0), (1.0, 45.0, 1.5), (1.5, 67.5, 1.75), (3.0, 90.0, 2.5)] {
        let found = moved(&import, 0, time_s, DVec3::X);
        let expected = DQuat::from_rotation_z(f64::to_radians(angle)) * DVec3::X * scale;
        assert!(near(found, expected), "{time_s} s: {found}, not {expected}");
    }
}

/// A body that turns about +y and carries a moon, which turns about its own +x, on a still arm.
fn pair() -> Model {
    let mut model = Model::default();
    let body = cube(&mut model, json!({ "name": "body", "translation": [1, 0, 0], "scale": [2, 2, 2] }));
    let arm = model.child(body, json!({ "translation": [3, 0, 0], "rotation": [0, 0, QUARTER, QUARTER] }));
    let mesh = model.cuboid([-0.2; 3], [0.2; 3], None);
    let moon = model.child(arm, json!({ "name": "moon", "mesh": mesh, "translation": [0, 0.5, 0] }));
    let turn = |axis: Vec3| -> Vec<f32> {
        let key = |i: u8| (axis * (f32::from(i) * PI / 4.0).sin()).extend((f32::from(i) * PI / 4.0).cos()).to_array();
        (0..5).flat_map(key).collect()
    };
    model.animate(0, body, "rotation", "LINEAR", &[0., 1., 2., 3., 4.], &turn(Vec3::Y));
    model.animate(1, moon, "rotation", "LINEAR", &[0., 0.5, 1., 1.5, 2.], &turn(Vec3::X));
    model
}

#[test]
fn nodes_carry_what_stands_in_them() {
    let import = load(&pair());
    assert_eq!(import.notes.left_out(), [""; 0]);
    for time_s in [0.0, 0.3, 1.0, 1.7, 3.9, 4.0, 5.3] {
        // A turn in 4 s and one in 2 s; every animation has its own period.
        let angle = |period_s: f64| (time_s / period_s).fract() * std::f64::consts::TAU;
        let turn = DQuat::from_rotation_y(angle(4.0));
        let body = DMat4::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::X);
        let arm = DMat4::from_rotation_translation(DQuat::from_rotation_z(90_f64.to_radians()), 3.0 * DVec3::X);
        let moon = DMat4::from_rotation_translation(DQuat::from_rotation_x(angle(2.0)), DVec3::new(0.0, 0.5, 0.0));
        for point in [DVec3::ZERO, DVec3::new(0.2, -0.1, 0.3)] {
            for (entity, matrix) in [(0, body), (1, body * arm * moon)] {
                let found = moved(&import, entity, time_s, point);
                let expected = matrix.transform_point3(point);
                assert!(near(found, expected), "entity {entity} at {time_s} s: {found}, not {expected}");
            }
        }
    }
}

#[test]
fn still_uneven_scales_of_moving_nodes_are_baked() {
    let mut model = Model::default();
    let node = cube(&mut model, json!({ "scale": [1, 2, 3] }));
    model.animate(0, node, "translation", "LINEAR", &[0.0, 2.0], &[0., 0., 0., 4., 0., 0.]);
    let import = load(&model);
    assert_eq!(import.notes.left_out(), [""; 0]);
    let radius_m = import.meshes[0].bounding_sphere().1;
    assert!((radius_m - Vec3::new(0.5, 1.0, 1.5).length()).abs() < 1e-5, "{radius_m}");
    assert!(near(moved(&import, 0, 1.0, DVec3::ZERO), DVec3::new(2.0, 0.0, 0.0)));
}

#[test]
fn what_placements_cannot_do_is_told() {
    let mut model = Model::default();
    let uneven = cube(&mut model, json!({}));
    model.animate(0, uneven, "scale", "LINEAR", &[0.0, 1.0], &[1., 1., 1., 1., 8., 1.]);
    let vanishing = cube(&mut model, json!({}));
    model.animate(0, vanishing, "scale", "LINEAR", &[0.0, 1.0], &[1., 1., 1., 0., 0., 0.]);
    let outer = model.node(json!({ "scale": [1, 1, 2] }));
    let mesh = model.cuboid([-0.5; 3], [0.5; 3], None);
    let inner = model.child(outer, json!({ "mesh": mesh }));
    model.animate(0, inner, "translation", "LINEAR", &[0.0, 1.0], &[0., 0., 0., 1., 0., 0.]);
    model.animate(1, inner, "translation", "STEP", &[0.0], &[5., 5., 5.]);
    let input = model.floats(1, &[0.0, 1.0]);
    let output = model.floats(1, &[0.0, 1.0]);
    let animation = &mut model.json["animations"][1];
    animation["samplers"].as_array_mut().unwrap().push(json!({ "input": input, "output": output }));
    let channel = json!({ "sampler": 1, "target": { "node": 0, "path": "weights" } });
    animation["channels"].as_array_mut().unwrap().push(channel);
    let import = load(&model);
    assert_eq!(
        import.notes.left_out(),
        [
            "left out (1): animations of scales that reach 0 or mirror (they end at 1e-7)",
            "left out (1): animations of uneven scales (one scale of the same volume stands for them)",
            "left out (1): channels of animations that move what an earlier one moves",
            "left out (1): movements of skins and morph targets (they stand in one pose)",
            "left out (1): uneven scales of nodes that carry moving ones (one scale of the same volume stands for them)",
        ]
    );
    assert!((import.data.entities[0].at(0.999_999_9).scale - 2.0).abs() < 1e-4);
    assert!(import.data.entities[1].at(0.999_999_9).scale > 0.0);
}

#[test]
fn lights_and_cameras_move_with_their_nodes() {
    let mut model = pair();
    let lamp = model.light(json!({ "type": "point", "intensity": 5 }));
    model.child(0, json!({ "name": "lamp", "translation": [0, 0, 2], "extensions": lamp }));
    let camera = model.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }));
    model.child(0, json!({ "camera": camera, "translation": [0, 1, 0] }));
    let import = load(&model);
    let lamp = import.data.entities.iter().position(|e| e.name.as_deref() == Some("lamp")).unwrap();
    // A quarter turn after 1 s, in a node of scale 2 that stands at x = 1; the lamp itself does not grow.
    assert!(near(moved(&import, lamp, 1.0, DVec3::ZERO), DVec3::new(5.0, 0.0, 0.0)));
    let said = import.notes.said().join("\n");
    let scale = import.data.entities[lamp].at(1.0).scale;
    assert!(said.contains(&format!("radius {scale:.3} m")), "{scale}: {said}");
    assert_eq!(import.data.camera.eye, Vec3::new(1.0, 2.0, 0.0));
    assert_eq!(import.notes.left_out(), ["left out (1): movements of cameras (they stand where they are at time 0)"]);
}

#[test]
fn motion_of_nodes_survives_a_scene_file() {
    let import = load(&pair());
    let data = import.data;
    let again = Data::parse(&data.to_toml().unwrap(), Path::new("again.toml")).unwrap();
    assert_eq!(again, data);
    let entity = "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"a\"\nplane = { size_m = 1, cells = 1 }\n\
        [[entity]]\nmesh = \"a\"\nposition = [1, 0, 0]\nmotion = [\n";
    let at = |motion: &str, time_s: f64| {
        let data = Data::parse(&format!("{entity}{motion}]"), Path::new("s.toml")).unwrap();
        data.entities[0].at(time_s).position
    };
    let turn = "{ node = { rotation = { axis = [0, 1, 0], angle_deg = 90 }, scale = 2 } }";
    assert!((at(turn, 0.0) - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-6);
    let keys = "{ node = { position_keys = { times_s = [0, 2], values = [[0, 0, 0], [0, 4, 0]] } } }";
    assert_eq!(at(keys, 1.0), Vec3::new(1.0, 2.0, 0.0));
    assert_eq!(at(keys, 9.0), Vec3::new(1.0, 4.0, 0.0), "without a period it stays where it ends");
    assert_eq!(at(&format!("{keys}, {keys}"), 1.0), Vec3::new(1.0, 4.0, 0.0), "nodes stand in nodes");
    for (motion, part) in [
        ("{ node = { scale = -1 } }", "uniform and positive"),
        ("{ node = { position_keys = { times_s = [0, 2], values = [[0, 0, 0]] } } }", "one value a time"),
        ("{ node = { scale_keys = { times_s = [0, 0], values = [1, 2] } } }", "times that increase"),
        ("{ node = { position_keys = { times_s = [0, nan], values = [[0, 0, 0], [1, 0, 0]] } } }", "not finite"),
        ("{ node = { position_keys = { times_s = [0], values = [[0, 1e9, 0]] } } }", "key 1 of 1 is not a position"),
        ("{ node = { rotation_keys = { times_s = [0], values = [[0, 0, 0, 0]] } } }", "not a quaternion"),
        ("{ node = { scale_keys = { times_s = [0], values = [0] } } }", "not a scale"),
        ("{ node = { scale_keys = { times_s = [0], values = [1], interpolation = \"cubic\" } } }", "in_slopes"),
        ("{ node = { scale_keys = { times_s = [0], values = [1], in_slopes = [1] } } }", "in_slopes"),
        ("{ node = { scale_keys = { times_s = [0], values = [1], period_s = 0 } } }", "period_s 0"),
        ("{ node = { scale_keys = { times_s = [], values = [] } } }", "at least one"),
    ] {
        let error = Data::parse(&format!("{entity}{motion}]"), Path::new("s.toml")).unwrap_err().to_string();
        assert!(error.starts_with("s.toml:11: ") && error.contains(part), "{motion}: {error}");
    }
}

#[test]
fn keys_stay_within_what_a_placement_may_be() {
    let keys = Keys {
        times_s: vec![0.0, 1.0],
        values: vec![1.0, 1.0],
        interpolation: Between::Cubic,
        in_slopes: vec![0.0, 100.0],
        out_slopes: vec![-100.0, 0.0],
        period_s: None,
    };
    let node = Node { scale_keys: Some(keys), ..Node::still(Vec3::ZERO, DQuat::IDENTITY, 1.0) };
    let mut entity = shadow_fields::scene::EntityData::of_mesh("a");
    entity.motion = vec![Motion::Node(Box::new(node))];
    for i in 0..=100 {
        assert!(entity.at(f64::from(i) / 100.0).scale >= 1e-7);
    }
}
