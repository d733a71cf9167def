//! Edits of an entity hold at all times, whatever its motion.

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use shadow_fields::scene::EntityData;
use shadow_fields::scene::keys::{Between, Keys};
use shadow_fields::scene::motion::{Interpolation, Keyframe, Motion, Node, RotationData};
use shadow_fields::view::edit;

fn place() -> impl Strategy<Value = Vec3> {
    [-3.0_f32..3.0, -3.0_f32..3.0, -3.0_f32..3.0].prop_map(Vec3::from)
}

fn axis() -> impl Strategy<Value = Vec3> {
    place().prop_filter("a direction", |v| v.length() > 0.1)
}

fn rotation() -> impl Strategy<Value = RotationData> {
    (axis(), -400.0_f64..400.0).prop_map(|(axis, angle_deg)| RotationData::AxisAngle { axis, angle_deg })
}

fn motion() -> impl Strategy<Value = Motion> {
    let period = || prop_oneof![0.5_f64..9.0, -9.0_f64..-0.5];
    let key = (prop::option::of(place()), prop::option::of(rotation()), prop::option::of(0.3_f32..3.0));
    let keys = prop::collection::vec((key, 0.1_f64..2.0), 1..5).prop_map(|keys| {
        let mut time_s = 0.0;
        let key = |((position, rotation, scale), after)| {
            time_s += after;
            Keyframe { time_s, position, rotation, scale }
        };
        keys.into_iter().map(key).collect()
    });
    let between = prop_oneof![Just(Interpolation::Linear), Just(Interpolation::Smooth)];
    prop_oneof![
        (keys, any::<bool>(), between).prop_map(|(keys, repeat, interpolation)| Motion::Keyframes {
            keys,
            repeat,
            interpolation
        }),
        (place(), axis(), period()).prop_map(|(centre, axis, period_s)| Motion::Orbit { centre, axis, period_s }),
        (axis(), period()).prop_map(|(axis, period_s)| Motion::Spin { axis, period_s }),
        (axis(), -1.0_f64..1.0, period(), -180.0_f64..180.0).prop_map(|(axis, amplitude_m, period_s, phase_deg)| {
            Motion::Bob { axis, amplitude_m, period_s, phase_deg }
        }),
    ]
}

/// Three keys of a position.
fn keys() -> impl Strategy<Value = Keys<Vec3>> {
    let three = || [place(), place(), place()].prop_map(|three| three.to_vec());
    let between = prop_oneof![Just(Between::Step), Just(Between::Linear), Just(Between::Cubic)];
    (three(), three(), between, prop::option::of(0.5_f64..9.0)).prop_map(|(values, slopes, interpolation, period_s)| {
        let slopes = if interpolation == Between::Cubic { slopes } else { Vec::new() };
        let in_slopes = slopes.clone();
        let out_slopes = slopes;
        let times_s = vec![-1.0, 0.5, 3.0];
        Keys { times_s, values, interpolation, in_slopes, out_slopes, period_s }
    })
}

fn node() -> impl Strategy<Value = Motion> {
    (place(), rotation(), 0.3_f32..2.0, prop::option::of(keys())).prop_map(
        |(position, rotation, scale, position_keys)| {
            let still = Node::still(position, rotation.unit(), scale);
            Motion::Node(Box::new(Node { position_keys, ..still }))
        },
    )
}

fn entity() -> impl Strategy<Value = EntityData> {
    let motion = prop::collection::vec(prop_oneof![motion(), node()], 0..4);
    (place(), rotation(), 0.2_f32..4.0, motion).prop_map(|(position, rotation, scale, motion)| EntityData {
        position,
        rotation,
        scale,
        motion,
        ..EntityData::of_mesh("m")
    })
}

fn time() -> impl Strategy<Value = f64> {
    -20.0_f64..20.0
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 400,
        rng_seed: proptest::test_runner::RngSeed::Fixed(11),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn moving_moves_the_whole_path(entity in entity(), by in place(), time in time()) {
        let (before, after) = (entity.at(time), edit::moved(&entity, by.as_dvec3()).unwrap().at(time));
        prop_assert!((after.position - before.position).distance(by) < 1e-4);
        prop_assert!(after.rotation.dot(before.rotation).abs() > 1.0 - 1e-6);
        prop_assert!((after.scale / before.scale - 1.0).abs() < 1e-6);
    }
}

#[test]
fn what_leaves_the_range_of_a_scene_file_is_refused() {
    let text = "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[[entity]]\nmesh = \"m\"\nmotion = [{ keyframes = { keys = \
                [{ time_s = 0, position = [9e6, 0, 0], scale = 1e6 }] } }, { orbit = { centre = [0, 0, -9e6], period_s = 1 } }]\n";
    let data = shadow_fields::scene::Data::parse(text, std::path::Path::new("t.toml")).unwrap();
    let entity = &data.entities[0];
    assert!(edit::moved(entity, DVec3::new(5e5, 0.0, 0.0)).is_some());
    assert!(edit::moved(entity, DVec3::new(2e6, 0.0, 0.0)).is_none(), "a key");
    assert!(edit::moved(entity, DVec3::new(0.0, 0.0, -2e6)).is_none(), "the centre of an orbit");
    assert!(edit::moved(entity, DVec3::splat(f64::NAN)).is_none());
}
