//! Scenes: the embedded ones, defaults, motion in closed form, and TOML there and back.

use crate::common::parse;
use glam::{Quat, Vec3};
use shadow_fields::asset::embedded;
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::field::sub_light::LampFace;
use shadow_fields::scene::{Data, LightMethod, Lights, Placement, Scene};
use std::path::Path;

/// A scene of one ball with the given lines in its entity.
fn ball(lines: &str) -> Scene {
    let text = format!(
        "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"m\"\nsphere = {{ radius_m = 1, subdivisions = 1 }}\n\
         [[entity]]\nmesh = \"m\"\n{lines}\n"
    );
    parse(&text)
}

fn near(a: Placement, position: Vec3, rotation: Quat) {
    assert!(a.position.distance(position) < 1e-5, "{} is not {position}", a.position);
    // q and -q are the same rotation.
    assert!((a.rotation.dot(rotation).abs() - 1.0).abs() < 1e-6, "{} is not {rotation}", a.rotation);
}

#[test]
fn embedded_scenes_load_and_read_back() {
    for (name, text) in embedded::scenes() {
        let path = format!("assets/scenes/{name}.toml");
        let scene = Scene::parse(text, Path::new(&path), &embedded::read).unwrap();
        let again = Data::parse(&scene.to_toml().unwrap(), Path::new("again.toml")).unwrap();
        assert_eq!(again, scene.data, "{name}");
        // From disk it is the same scene.
        let disk = Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(&path)).unwrap();
        assert_eq!(disk.data, scene.data);
        assert_eq!(disk.entities, scene.entities);
        for (a, b) in disk.meshes.iter().zip(&scene.meshes) {
            assert_eq!(a.content_hash(), b.content_hash());
        }
        // Something lights, something occludes, the floor too, and nothing but the floor is below it.
        assert!(scene.entities.iter().any(|e| e.emits) && scene.entities.iter().any(|e| e.occludes), "{name}");
        assert!(scene.entities[0].occludes && scene.entities[0].receives && !scene.entities[0].emits);
        for step in 0..50 {
            for (entity, place) in scene.entities.iter().zip(scene.at(f64::from(step) * 0.37)).skip(1) {
                let turned = |p: &Vec3| (place.rotation * (*p * place.scale) + place.position).y;
                let lowest = scene.meshes[entity.mesh].positions.iter().map(turned).fold(f32::INFINITY, f32::min);
                assert!(lowest > -1e-6, "{name}: {} reaches {lowest} m at step {step}", entity.name);
            }
        }
    }
}

#[test]
fn a_missing_path_may_be_embedded() {
    assert!(Scene::load(Path::new("assets/scenes/../scenes/teapot_lights.toml")).is_ok());
    assert!(embedded::find(Path::new("assets/scenes/../meshes/torus.obj")).is_some());
    for other in ["meshes/torus.obj", "assets/../../assets/meshes/torus.obj", "/assets/meshes/torus.obj", "assets", ""]
    {
        assert!(embedded::find(Path::new(other)).is_none(), "{other}");
    }
}

#[test]
fn defaults() {
    let scene = ball("");
    let entity = &scene.entities[0];
    assert_eq!((entity.emits, entity.occludes, entity.receives), (false, true, true));
    assert_eq!((entity.albedo, entity.texture, entity.emission), (Vec3::splat(0.7), None, Vec3::ZERO));
    assert_eq!(scene.at(3.0)[0], Placement { position: Vec3::ZERO, rotation: Quat::IDENTITY, scale: 1.0 });
    assert_eq!((scene.data.camera.fov_deg, scene.data.output.width, scene.data.output.exposure_ev), (40.0, 960, None));
    assert!(scene.environment.is_none());
    let light = &ball("emission = [1, 0, 0]").entities[0];
    assert_eq!((light.emits, light.occludes, light.receives), (true, false, true));
    let forced = &ball("emission = [1, 0, 0]\nemits = false\nreceives = false").entities[0];
    assert_eq!((forced.emits, forced.occludes, forced.receives), (false, true, false));
    let both = &ball("emission = [1, 0, 0]\noccludes = true").entities[0];
    assert_eq!((both.emits, both.occludes), (true, true));
}

#[test]
fn rotations() {
    let turned = Quat::from_rotation_z(0.5);
    let angle = 0.5f64.to_degrees();
    near(ball(&format!("rotation = {{ axis = [0, 0, 7], angle_deg = {angle} }}")).at(0.0)[0], Vec3::ZERO, turned);
    let (s, c) = 0.25f64.sin_cos();
    let quaternion = format!("rotation = {{ quaternion = [0, 0, {}, {}] }}", 3.0 * s, 3.0 * c);
    near(ball(&quaternion).at(9.0)[0], Vec3::ZERO, turned);
    // Between keys of any length the turn has a constant rate.
    let (s, c) = 1.0_f64.sin_cos();
    let turning = format!(
        "motion = [{{ keyframes = {{ keys = [{{ time_s = 0, rotation = {{ quaternion = [0, 0, 0, 3] }} }}, \
         {{ time_s = 1, rotation = {{ quaternion = [0, 0, {}, {}] }} }}] }} }}]",
        3.0 * s,
        3.0 * c
    );
    near(ball(&turning).at(0.25)[0], Vec3::ZERO, turned);
}

#[test]
fn orbit_spin_and_bob_in_closed_form() {
    // Right-handed about +y: a quarter turn takes +x to -z.
    let orbit = ball("position = [3, 1, 0]\nmotion = [{ orbit = { centre = [1, 0, 0], period_s = 8 } }]");
    near(orbit.at(0.0)[0], Vec3::new(3.0, 1.0, 0.0), Quat::IDENTITY);
    near(orbit.at(2.0)[0], Vec3::new(1.0, 1.0, -2.0), Quat::IDENTITY);
    near(orbit.at(4.0)[0], Vec3::new(-1.0, 1.0, 0.0), Quat::IDENTITY);
    near(orbit.at(8e6 + 2.0)[0], Vec3::new(1.0, 1.0, -2.0), Quat::IDENTITY);
    near(orbit.at(-2.0)[0], Vec3::new(1.0, 1.0, 2.0), Quat::IDENTITY);
    let spin = ball(
        "rotation = { axis = [1, 0, 0], angle_deg = 90 }\nmotion = [{ spin = { axis = [0, 2, 0], period_s = -4 } }]",
    );
    let tilt = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    near(spin.at(1.0)[0], Vec3::ZERO, Quat::from_rotation_y(-std::f32::consts::FRAC_PI_2) * tilt);
    let bob = ball("motion = [{ bob = { axis = [0, 0, 5], amplitude_m = 0.5, period_s = 4, phase_deg = 90 } }]");
    near(bob.at(0.0)[0], Vec3::Z * 0.5, Quat::IDENTITY);
    near(bob.at(2.0)[0], Vec3::Z * -0.5, Quat::IDENTITY);
    // One after the other: the bob's offset is not orbited.
    let both = ball(
        "position = [1, 0, 0]\nmotion = [{ orbit = { centre = [0, 0, 0], period_s = 4 } }, \
         { bob = { amplitude_m = 1, period_s = 4 } }]",
    );
    near(both.at(1.0)[0], Vec3::new(0.0, 1.0, -1.0), Quat::IDENTITY);
}

#[test]
fn keyframes_interpolate_hold_and_repeat() {
    let keys = "position = [9, 9, 9]\nscale = 2\nmotion = [{ keyframes = { REPEAT keys = [{ time_s = 1, position = [0, 0, 0] }, \
                { time_s = 3, position = [4, 0, 0], rotation = { axis = [0, 1, 0], angle_deg = 90 }, scale = 4 }, \
                { time_s = 4, rotation = { axis = [0, 1, 0], angle_deg = 90 } }] } }]";
    let held = ball(&keys.replace("REPEAT", ""));
    let quarter = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    near(held.at(-5.0)[0], Vec3::ZERO, Quat::IDENTITY);
    near(held.at(2.0)[0], Vec3::X * 2.0, Quat::from_rotation_y(std::f32::consts::FRAC_PI_4));
    assert_eq!(held.at(2.0)[0].scale, 3.0);
    near(held.at(3.0)[0], Vec3::X * 4.0, quarter);
    near(held.at(99.0)[0], Vec3::splat(9.0), quarter);
    assert_eq!(held.at(99.0)[0].scale, 2.0, "what a key leaves out is as at rest");
    let repeated = ball(&keys.replace("REPEAT", "repeat = true,"));
    for time in [1.25, 2.0, 3.5] {
        for turns in [-2.0, 1.0, 5.0] {
            let (a, b) = (repeated.at(time)[0], repeated.at(time + 3.0 * turns)[0]);
            near(a, b.position, b.rotation);
        }
    }
}

#[test]
fn smooth_keyframes_are_a_spline_through_the_keys() {
    let keys = |rest: &str, points: &[[f64; 2]]| {
        let keys: Vec<String> = points
            .iter()
            .map(|[time, x]| {
                format!("{{ time_s = {time:?}, position = [{x:?}, {:?}, 0.5], scale = {:?} }}", 2.0 * x, 1.0 + x.abs())
            })
            .collect();
        ball(&format!(
            "motion = [{{ keyframes = {{ interpolation = \"smooth\", {rest} keys = [{}] }} }}]",
            keys.join(", ")
        ))
    };
    let x = |scene: &Scene, time: f64| f64::from(scene.at(time)[0].position.x);
    // Through every key, whatever their spacing, and without a kink: one-sided slopes agree.
    let points = [[0.0, 0.0], [1.0, 2.0], [1.5, 1.0], [4.0, -1.0], [5.0, 3.0]];
    let scene = keys("", &points);
    let slope = |scene: &Scene, time: f64, side: f64| (x(scene, time + side * 1e-3) - x(scene, time)) / (side * 1e-3);
    for [time, at] in points {
        assert!((x(&scene, time) - at).abs() < 1e-6);
        assert!((f64::from(scene.at(time)[0].position.y) - 2.0 * at).abs() < 1e-6);
    }
    for (k, [time, _]) in points.iter().enumerate().take(4).skip(1) {
        let (before, after) = (slope(&scene, *time, -1.0), slope(&scene, *time, 1.0));
        let expected = (points[k + 1][1] - points[k - 1][1]) / (points[k + 1][0] - points[k - 1][0]);
        let off = (before - expected).abs().max((after - expected).abs());
        assert!(off < 2e-2, "{time}: {before} {after} {expected}");
    }
    assert!((0..500).all(|i| scene.at(f64::from(i) * 0.01)[0].scale > 0.05), "a scale stays positive");
    // Equal steps: the middle of a stretch is (-a + 9 b + 9 c - d) / 16 of the four keys around it.
    let even = keys("", &[[0.0, 1.0], [1.0, 5.0], [2.0, -2.0], [3.0, 4.0]]);
    assert!((x(&even, 1.5) - (-1.0 + 45.0 - 18.0 - 4.0) / 16.0).abs() < 1e-6);
    // On a line at a steady rate it is that line.
    let line = keys("", &[[0.0, 0.0], [1.0, 1.0], [3.0, 3.0], [3.5, 3.5]]);
    assert!((0..36).all(|i| (x(&line, f64::from(i) * 0.1) - f64::from(i) * 0.1).abs() < 1e-6));
    // It holds still outside, and repeats without a kink where it closes.
    assert_eq!((x(&scene, -3.0), x(&scene, 99.0)), (0.0, 3.0));
    let ring = keys("repeat = true,", &[[0.0, 0.0], [1.0, 2.0], [2.0, 5.0], [4.0, 0.0]]);
    for seam in [0.0, 4.0, -8.0] {
        let (before, after) = (slope(&ring, seam, -1.0), slope(&ring, seam, 1.0));
        assert!((before - after).abs() < 3e-2 && (after - (2.0 - 5.0) / 3.0).abs() < 2e-2, "{before} {after}");
    }
    // It reads back, and "linear" is what is meant without it.
    let again = Data::parse(&ring.to_toml().unwrap(), Path::new("again.toml")).unwrap();
    assert_eq!(again, ring.data);
    let keys = "keys = [{ time_s = 0 }, { time_s = 1, position = [1, 0, 0] }]";
    let plain = ball(&format!("motion = [{{ keyframes = {{ {keys} }} }}]"));
    let named = ball(&format!("motion = [{{ keyframes = {{ interpolation = \"linear\", {keys} }} }}]"));
    assert_eq!(plain.data, named.data);
}

#[test]
fn built_in_meshes_are_found_from_any_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let text = |file: &str| {
        format!(
            "[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"m\"\nfile = \"{file}\"\n[[entity]]\nmesh = \"m\"\n"
        )
    };
    std::fs::write(&path, text("assets/meshes/torus.obj")).unwrap();
    let torus = Scene::load(&path).unwrap();
    let built_in = Scene::load(Path::new("assets/scenes/torus_over_plane.toml")).unwrap();
    assert!(built_in.meshes.iter().any(|m| m.content_hash() == torus.meshes[0].content_hash()));
    // A file of that name on disk comes first.
    std::fs::create_dir_all(folder.path().join("assets/meshes")).unwrap();
    std::fs::write(folder.path().join("assets/meshes/torus.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(Scene::load(&path).unwrap().meshes[0].triangles.len(), 1);
    std::fs::write(&path, text("assets/meshes/no.obj")).unwrap();
    let error = Scene::load(&path).unwrap_err().to_string();
    assert!(error.contains("no.obj") && error.contains("s.toml:4: "), "{error}");
}

/// Loads the scene that documentation shows, from a folder that has the picture it names.
fn documented(text: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    shadow_fields::asset::picture::write_exr(&folder.path().join("studio.hdr"), 2, 1, &[1.0; 6]).unwrap();
    shadow_fields::asset::picture::write_png(&folder.path().join("wood.png"), 1, 1, &[0.5; 3], 0.0).unwrap();
    std::fs::write(folder.path().join("shown.toml"), text).unwrap();
    Scene::load(&folder.path().join("shown.toml")).unwrap()
}

#[test]
fn the_scenes_of_the_documentation_load() {
    let lines = |text: &str, prefix: &str| -> String {
        text.lines().filter_map(|line| Some(line.strip_prefix(prefix)?.to_owned() + "\n")).collect()
    };
    let file = |name: &str| std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
    let scene = documented(&lines(&file("docs/scene.md"), "    "));
    assert!(scene.entities[0].emits && scene.data.entities[0].motion.len() == 4);
    assert!(scene.data.environment.sky.is_some());
    // The reference shows every part of the environment and every motion.
    let reference = file("src/scene/data.rs");
    let scene =
        documented(&lines(reference.split("//! ```toml\n").nth(1).unwrap().split("//! ```\n").next().unwrap(), "//! "));
    let EnvironmentData { uniform, gradient, key, sun, sky, image, .. } = &scene.data.environment;
    assert!(uniform.is_some() && gradient.is_some() && key.is_some() && sun.is_some() && sky.is_some());
    assert!(image.is_some() && scene.data.entities[0].motion.len() == 5);
}

#[test]
fn each_light_has_the_form_that_its_mesh_gives_it() {
    let text = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n\
        [[mesh]]\nname = \"floor\"\nplane = { size_m = 6, cells = 6 }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 4 }\n\
        [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.7, minor_m = 0.25, segments = 48, sides = 24 }\n\
        [[mesh]]\nname = \"disc\"\ndisc = { radius_m = 0.3 }\n\
        [[mesh]]\nname = \"tube\"\nrectangle = { size_m = [1.6, 0.2] }\n\
        [[mesh]]\nname = \"two\"\ntorus_two_colour = { major_m = 0.4, minor_m = 0.1, segments = 16, sides = 8 }\n\
        [[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"ball\"\nemission = [1, 1, 1]\n[[entity]]\nmesh = \"ring\"\nemission = [1, 1, 1]\n\
        [[entity]]\nmesh = \"two\"\nemission = [1, 1, 1]\n\
        [[entity]]\nmesh = \"disc\"\nemission = [1, 1, 1]\n[[entity]]\nmesh = \"tube\"\nemission = [1, 1, 1]\n";
    let scene = parse(text);
    let method = |entity, lights| LightMethod::of(&scene, entity, lights);
    let LightMethod::Ball(share) = method(1, Lights::Sharp) else { panic!("a sphere is a ball") };
    assert!((0.98..1.0).contains(&share), "{share}");
    assert_eq!(method(2, Lights::Sharp), LightMethod::Outline);
    assert_eq!(method(3, Lights::Sharp), LightMethod::Outline);
    let has_colors =
        |entity: usize| method(entity, Lights::Sharp).has_colors(&scene.meshes[scene.entities[entity].mesh]);
    assert_eq!([1, 2, 3, 4].map(has_colors), [false, true, true, false]);
    assert!(matches!(method(4, Lights::Sharp), LightMethod::LampFace(LampFace::Disc(_))));
    assert!(matches!(method(5, Lights::Sharp), LightMethod::LampFace(LampFace::Rectangle(_))));
    assert!((1..6).all(|entity| method(entity, Lights::Sh) == LightMethod::Harmonics));
}
