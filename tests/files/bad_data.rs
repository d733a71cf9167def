//! Data that a program hands to the library: whatever the numbers are, nothing panics, and what is refused is one line.

use glam::Vec3;
use shadow_fields::Error;
use shadow_fields::asset::disc::Sun;
use shadow_fields::asset::environment::{EnvironmentData, EnvironmentImage, Gradient, KeyLight};
use shadow_fields::asset::sky::Sky;
use shadow_fields::asset::{Generator, Mesh, picture};
use shadow_fields::scene::motion::{Keyframe, RotationData};
use shadow_fields::scene::{Camera, EntityData, Motion, Output, Scene};

/// Numbers at and beyond every edge.
const ODD: [f32; 14] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-45,
    0.0,
    -0.0,
    -1.0,
    1e-7,
    1e7,
    1e15,
    2.0,
];

/// One line, where something is refused.
fn one_line<T>(outcome: Result<T, Error>) -> Option<T> {
    outcome.map_err(|error| assert!(!error.to_string().contains('\n'), "{error}")).ok()
}

/// A scene of one entity, and all that is asked of it without a device.
fn try_scene(entity: EntityData, environment: EnvironmentData, camera: Camera, output: Output) -> bool {
    let ball = Generator::Sphere { radius_m: 1.0, subdivisions: 1 };
    let builder = Scene::builder().mesh("m", ball).environment(environment.clone()).camera(camera).output(output);
    let Some(mut scene) = one_line(builder.entity(entity.clone()).build()) else { return false };
    for time_s in [0.0, -1e9, 1e9, f64::NAN, f64::INFINITY, f64::MAX] {
        assert_eq!(scene.at(time_s).len(), scene.entities.len());
    }
    assert!(scene.at(0.0).iter().all(|placement| placement.position.is_finite()));
    scene.environment.coefficients(4);
    scene.data.camera.up();
    one_line(scene.to_toml());
    one_line(scene.set_entity(0, entity));
    one_line(scene.set_environment(&environment));
    true
}

#[test]
fn a_builder_refuses_numbers_in_one_line() {
    let entity = || EntityData::of_mesh("m");
    let key = |time_s| Keyframe { time_s, position: None, rotation: None, scale: None };
    let moved = |motion| EntityData { motion: vec![motion], ..entity() };
    let keys = |key| moved(Motion::Keyframes { keys: vec![key], repeat: true, interpolation: Default::default() });
    let light = EnvironmentData::default;
    let camera = || Camera::new(Vec3::Z, Vec3::ZERO);
    let mut built = [0; 2];
    for x in ODD {
        let vector = Vec3::new(0.5, x, 0.5);
        let entities = [
            EntityData { position: vector, ..entity() },
            EntityData { rotation: RotationData::AxisAngle { axis: vector, angle_deg: 10.0 }, ..entity() },
            EntityData { rotation: RotationData::AxisAngle { axis: Vec3::Y, angle_deg: x.into() }, ..entity() },
            EntityData { rotation: RotationData::Quaternion([x; 4]), ..entity() },
            EntityData { scale: x, ..entity() },
            EntityData { albedo: vector.into(), ..entity() },
            EntityData { opacity: x, ..entity() },
            EntityData { emission: vector, ..entity() },
            moved(Motion::Orbit { centre: vector, axis: Vec3::Y, period_s: 1.0 }),
            moved(Motion::Orbit { centre: Vec3::X, axis: vector, period_s: x.into() }),
            moved(Motion::Spin { axis: Vec3::Y, period_s: x.into() }),
            moved(Motion::Bob { axis: vector, amplitude_m: 1.0, period_s: 1.0, phase_deg: 0.0 }),
            moved(Motion::Bob { axis: Vec3::Y, amplitude_m: x.into(), period_s: 1.0, phase_deg: 0.0 }),
            moved(Motion::Bob { axis: Vec3::Y, amplitude_m: 1.0, period_s: 1.0, phase_deg: x.into() }),
            keys(key(x.into())),
            keys(Keyframe { position: Some(vector), ..key(0.0) }),
            keys(Keyframe { scale: Some(x), ..key(0.0) }),
        ];
        let key_light = |radiance, toward, sharpness| Some(KeyLight { radiance, toward, sharpness });
        let sun = |toward, angle_deg, radiance| Some(Sun { toward, angle_deg, radiance });
        let lights = [
            EnvironmentData { uniform: Some(Vec3::ONE), strength: x, ..light() },
            EnvironmentData { turn_deg: x, ..light() },
            EnvironmentData { uniform: Some(vector), ..light() },
            EnvironmentData { gradient: Some(Gradient { radiance: vector, base: 0.5, rise: 0.5 }), ..light() },
            EnvironmentData { gradient: Some(Gradient { radiance: Vec3::ONE, base: x, rise: 0.5 }), ..light() },
            EnvironmentData { key: key_light(vector, Vec3::Y, 1.0), ..light() },
            EnvironmentData { key: key_light(Vec3::ONE, vector, 1.0), ..light() },
            EnvironmentData { key: key_light(Vec3::ONE, Vec3::Y, x), ..light() },
            EnvironmentData { sky: Some(Sky { turbidity: x, ..Default::default() }), ..light() },
            EnvironmentData { sky: Some(Sky { sun_elevation_deg: x, ..Default::default() }), ..light() },
            EnvironmentData { sky: Some(Sky { sun: x, ground: vector, ..Default::default() }), ..light() },
            EnvironmentData { sun: sun(vector, 1.0, Vec3::ONE), ..light() },
            EnvironmentData { sun: sun(Vec3::Y, x, Vec3::ONE), ..light() },
            EnvironmentData { sun: sun(Vec3::Y, 1.0, vector), ..light() },
            EnvironmentData { image: Some(EnvironmentImage { file: "no.exr".into(), scale: x }), ..light() },
        ];
        let cameras = [
            Camera { eye: vector, ..camera() },
            Camera { target: vector, ..camera() },
            Camera { fov_deg: x, ..camera() },
        ];
        let outputs = [
            Output { width: x as u32, ..Default::default() },
            Output { exposure_ev: Some(x), ..Default::default() },
            Output { time_s: x.into(), ..Default::default() },
        ];
        let entities = entities.map(|entity| try_scene(entity, light(), camera(), Output::default()));
        let lights = lights.map(|light| try_scene(entity(), light, camera(), Output::default()));
        let cameras = cameras.map(|camera| try_scene(entity(), light(), camera, Output::default()));
        let outputs = outputs.map(|output| try_scene(entity(), light(), camera(), output));
        for is_built in entities.into_iter().chain(lights).chain(cameras).chain(outputs) {
            built[usize::from(is_built)] += 1;
        }
    }
    assert!(built.iter().all(|count| *count > 100), "refused and built: {built:?}");
}

#[test]
fn a_mesh_refuses_arrays_that_do_not_fit() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let up = vec![Vec3::Z; 3];
    let mesh = |positions: &[Vec3], normals: &[Vec3], colors: Option<Vec<Vec3>>, triangle| {
        one_line(Mesh::new("m", positions.to_vec(), normals.to_vec(), colors, vec![triangle])).is_some()
    };
    assert!(mesh(&corners, &up, Some(up.clone()), [0, 1, 2]));
    assert!(!mesh(&corners, &up, None, [0, 1, 3]), "a corner that there is not");
    assert!(!mesh(&corners, &up, None, [0, 1, u32::MAX]), "a corner far beyond");
    assert!(!mesh(&corners, &up, Some(vec![Vec3::ONE; 2]), [0, 1, 2]), "too few colours");
    assert!(!mesh(&corners, &up[..2], None, [0, 1, 2]), "too few normals");
    assert!(!mesh(&[], &[], None, [0, 1, 2]), "no positions");
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let odd = vec![Vec3::splat(x); 3];
        assert!(!mesh(&odd, &up, None, [0, 1, 2]), "positions {x}");
        assert!(!mesh(&corners, &up, Some(odd), [0, 1, 2]), "colours {x}");
    }
}

#[test]
fn pictures_of_the_wrong_length_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    for (size, count) in [([2, 2], 11), ([2, 2], 13), ([0, 5], 3), ([u32::MAX, u32::MAX], 12), ([2, 2], 0)] {
        let [width, height] = size;
        let numbers = vec![0.5; count];
        for outcome in [
            picture::write_png(&path, width, height, &numbers, 0.0),
            picture::write_exr(&path, width, height, &numbers),
            picture::write_apng(&path, width, height, vec![Ok(vec![0; count])].into_iter(), 24),
        ] {
            let error = outcome.unwrap_err();
            assert!(error.to_string().contains("p.png") && !error.to_string().contains('\n'), "{error}");
        }
        assert!(!path.exists());
    }
}
