//! Data that a program hands to the library: whatever the numbers are, nothing panics, and what is refused is one line.

use glam::Vec3;
use shadow_fields::Error;
use shadow_fields::asset::disc::Sun;
use shadow_fields::asset::environment::{EnvironmentData, EnvironmentImage, Gradient, KeyLight};
use shadow_fields::asset::sky::Sky;
use shadow_fields::asset::{Generator, Mesh, obj, picture};
use shadow_fields::scene::keys::Keys;
use shadow_fields::scene::motion::{Interpolation, Keyframe, Node, RotationData};
use shadow_fields::scene::{Camera, EntityData, Motion, Output, Scene, SceneBuilder};
use std::path::Path;

/// Numbers at and beyond every edge, and usual ones between them, so that some scenes are good.
const FLOATS: [f32; 16] = [
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
    0.5,
    1.0,
    2.0,
];
/// Counts at the edges; those between the small and the refused ones would only take time.
const COUNTS: [u32; 8] = [0, 1, 2, 3, 9, 1 << 21, 1 << 31, u32::MAX];

/// Draws numbers.
struct Draw(fastrand::Rng);

impl Draw {
    /// Mostly usual numbers: each scene has a few odd ones.
    fn float(&mut self) -> f32 {
        if self.0.u32(..4) == 0 { FLOATS[self.0.usize(..FLOATS.len())] } else { self.0.f32() + 0.1 }
    }

    fn double(&mut self) -> f64 {
        f64::from(self.float()) * if self.0.u32(..8) == 0 { 1e300 } else { 1.0 }
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    fn count(&mut self) -> u32 {
        if self.0.u32(..3) == 0 { COUNTS[self.0.usize(..COUNTS.len())] } else { 3 + self.0.u32(..4) }
    }

    fn name(&mut self) -> &'static str {
        ["a", "b", "", "sun", "line\nbreak", "\0"][self.0.usize(..6)]
    }

    fn maybe<T>(&mut self, make: impl FnOnce(&mut Self) -> T) -> Option<T> {
        self.0.bool().then(|| make(self))
    }

    fn generator(&mut self) -> Generator {
        let size_m = self.float();
        let radius_m = self.float();
        let major_m = self.float();
        let minor_m = self.float();
        let cells = self.count();
        let subdivisions = self.count();
        let segments = self.count();
        let sides = self.count();
        match self.0.u32(..8) {
            0 => Generator::Plane { size_m, cells },
            1 => Generator::Sphere { radius_m, subdivisions },
            2 => Generator::Torus { major_m, minor_m, segments, sides },
            3 => Generator::TorusTwoColour { major_m, minor_m, segments, sides },
            4 => Generator::Cuboid { size_m: self.vector(), cells },
            5 => Generator::Disc { radius_m },
            6 => Generator::Rectangle { size_m: [size_m, radius_m] },
            _ => Generator::Teapot { subdivisions },
        }
    }

    fn rotation(&mut self) -> RotationData {
        match self.0.bool() {
            true => RotationData::AxisAngle { axis: self.vector(), angle_deg: self.double() },
            false => RotationData::Quaternion([self.float(), self.float(), self.float(), self.float()]),
        }
    }

    fn motion(&mut self) -> Motion {
        match self.0.u32(..5) {
            0 => Motion::Orbit { centre: self.vector(), axis: self.vector(), period_s: self.double() },
            1 => Motion::Spin { axis: self.vector(), period_s: self.double() },
            2 => Motion::Bob {
                axis: self.vector(),
                amplitude_m: self.double(),
                period_s: self.double(),
                phase_deg: self.double(),
            },
            3 => Motion::Keyframes {
                keys: (0..self.0.u32(..4)).map(|_| self.keyframe()).collect(),
                repeat: self.0.bool(),
                interpolation: if self.0.bool() { Interpolation::Linear } else { Interpolation::Smooth },
            },
            _ => Motion::Node(Box::new(Node {
                position: self.vector(),
                rotation: self.rotation(),
                scale: self.float(),
                position_keys: self.maybe(Self::keys),
                rotation_keys: None,
                scale_keys: None,
            })),
        }
    }

    fn keys(&mut self) -> Keys<Vec3> {
        let list = |draw: &mut Self| (0..draw.0.u32(..4)).map(|_| draw.vector()).collect::<Vec<_>>();
        let values = list(self);
        let in_slopes = list(self);
        let out_slopes = list(self);
        let times_s = (0..self.0.u32(..4)).map(|_| self.double()).collect();
        let period_s = self.maybe(Self::double);
        Keys { times_s, values, interpolation: Default::default(), in_slopes, out_slopes, period_s }
    }

    fn keyframe(&mut self) -> Keyframe {
        Keyframe {
            time_s: self.double(),
            position: self.maybe(Self::vector),
            rotation: self.maybe(Self::rotation),
            scale: self.maybe(Self::float),
        }
    }

    fn entity(&mut self) -> EntityData {
        EntityData {
            name: self.maybe(|draw| draw.name().to_owned()),
            position: self.vector(),
            rotation: self.rotation(),
            scale: self.float(),
            albedo: self.vector().into(),
            emission: self.vector(),
            emits: self.maybe(|draw| draw.0.bool()),
            occludes: self.maybe(|draw| draw.0.bool()),
            receives: self.maybe(|draw| draw.0.bool()),
            motion: (0..self.0.u32(..3)).map(|_| self.motion()).collect(),
            ..EntityData::of_mesh(self.name())
        }
    }

    fn environment(&mut self) -> EnvironmentData {
        EnvironmentData {
            strength: self.float(),
            turn_deg: self.float(),
            uniform: self.maybe(Self::vector),
            gradient: self.maybe(|draw| Gradient { radiance: draw.vector(), base: draw.float(), rise: draw.float() }),
            key: self.maybe(|draw| KeyLight {
                radiance: draw.vector(),
                toward: draw.vector(),
                sharpness: draw.float(),
            }),
            sky: self.maybe(|draw| Sky {
                sun_elevation_deg: draw.float(),
                sun_azimuth_deg: draw.float(),
                turbidity: 2.0 + draw.float(),
                radiance: draw.float(),
                sun: draw.float(),
                sun_angle_deg: draw.float(),
                ground: draw.vector(),
            }),
            image: None,
            sun: self.maybe(|draw| Sun { toward: draw.vector(), angle_deg: draw.float(), radiance: draw.vector() }),
        }
    }
}

/// One line, where something is refused.
fn one_line<T>(outcome: Result<T, Error>) -> Option<T> {
    outcome.map_err(|error| assert!(!error.to_string().contains('\n'), "{error}")).ok()
}

/// Everything that a scene is asked for without a device.
fn used(scene: &mut Scene, draw: &mut Draw) {
    for time_s in [0.0, -1e9, 1e9, f64::NAN, f64::INFINITY, f64::MAX, draw.double()] {
        assert_eq!(scene.at(time_s).len(), scene.entities.len());
    }
    scene.environment.coefficients(4);
    one_line(scene.to_toml());
    scene.data.camera.up();
    one_line(scene.set_entity(draw.0.usize(..4), draw.entity()));
    one_line(scene.set_environment(&draw.environment()));
    assert!(scene.at(0.0).iter().all(|placement| placement.position.is_finite()));
}

#[test]
fn a_builder_refuses_numbers_in_one_line() {
    let mut draw = Draw(fastrand::Rng::with_seed(14));
    let mut built = [0; 2];
    for round in 0..3000 {
        // The first half is odd in one place, the others anywhere.
        let odd = if round % 2 == 0 { 1 << draw.0.u32(..4) } else { 15 };
        let mut builder: SceneBuilder =
            Scene::builder().mesh("a", Generator::Sphere { radius_m: 1.0, subdivisions: 1 });
        if odd & 1 != 0 {
            builder = builder.mesh(draw.name(), draw.generator());
        }
        if odd & 2 != 0 {
            builder = builder.entity(draw.entity()).entity(EntityData::of_mesh("a"));
        }
        if odd & 4 != 0 {
            builder = builder.environment(draw.environment());
        }
        if odd & 8 != 0 {
            let output = Output {
                width: draw.count(),
                height: draw.count(),
                exposure_ev: Some(draw.float()),
                time_s: draw.double(),
            };
            let camera = Camera { fov_deg: 60.0 * draw.float(), ..Camera::new(draw.vector(), draw.vector()) };
            builder = builder.camera(camera).output(output);
        }
        let scene = one_line(builder.build());
        built[usize::from(scene.is_some())] += 1;
        if let Some(mut scene) = scene {
            used(&mut scene, &mut draw);
        }
    }
    assert!(built.iter().all(|count| *count > 300), "refused and built: {built:?}");
}

#[test]
fn a_generator_refuses_numbers_in_one_line() {
    let mut draw = Draw(fastrand::Rng::with_seed(7));
    let mut built = 0;
    for _ in 0..1000 {
        let generator = draw.generator();
        if let Some(mesh) = one_line(generator.build()) {
            built += 1;
            assert!(mesh.bounding_sphere().1 > 0.0 && mesh.area_m2().is_finite(), "{generator:?}");
        }
    }
    assert!((100..900).contains(&built), "{built}");
}

#[test]
fn a_mesh_refuses_arrays_that_do_not_fit() {
    let mut draw = Draw(fastrand::Rng::with_seed(3));
    for _ in 0..3000 {
        let list = |draw: &mut Draw| (0..draw.0.u32(..6)).map(|_| draw.vector()).collect::<Vec<_>>();
        let positions = list(&mut draw);
        let normals = list(&mut draw);
        let colors = list(&mut draw);
        let corner = |draw: &mut Draw| if draw.0.u32(..9) == 0 { draw.count() } else { draw.0.u32(..5) };
        let triangles =
            (0..draw.0.u32(..5)).map(|_| [corner(&mut draw), corner(&mut draw), corner(&mut draw)]).collect();
        let colors = draw.maybe(|_| colors);
        if let Some(mesh) = one_line(Mesh::new("m", positions, normals, colors, triangles)) {
            one_line(Mesh::parse(obj::write_obj(&mesh).as_bytes(), Path::new("m.obj")));
        }
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
    let image = EnvironmentImage { file: "nowhere.exr".into(), scale: f32::NAN };
    let light = EnvironmentData { image: Some(image), ..Default::default() };
    assert!(one_line(Scene::builder().environment(light).build()).is_none());
}
