//! Rooms that people build and their lamps: pictures beside rays.

use crate::common::{Gpu, generate, gpu, inside_out, of_cells, of_quads, part, relative_rms, reshaped};
use crate::stage::{against_rays, shines, stands};
use glam::{DQuat, Vec2, Vec3};
use shadow_fields::asset::disc::Sun;
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::asset::{Generator, Mesh};
use shadow_fields::bounce::Bounces;
use shadow_fields::scene::motion::{Node, RotationData};
use shadow_fields::scene::{Camera, EntityData, Motion, Scene, SceneBuilder};
use shadow_fields::truth::{RayCast, Vertex, World, pixels, receiver_vertices};
use shadow_fields::{bake, frame};
use std::f32::consts::TAU;

/// Pixels of pictures beside rays.
const SIZE: [u32; 2] = [96, 64];

fn turned(axis: Vec3, angle_deg: f64) -> RotationData {
    RotationData::AxisAngle { axis, angle_deg }
}

/// A slab that stands upright.
fn wall(position: [f32; 3]) -> EntityData {
    EntityData { rotation: turned(Vec3::X, 90.0), ..stands("slab", position) }
}

/// A sun of one grey, and a uniform sky of another.
fn sunny(toward: impl Into<Vec3>, angle_deg: f32, radiance: f32, sky: f32) -> EnvironmentData {
    let sun = Sun { toward: toward.into(), angle_deg, radiance: Vec3::splat(radiance) };
    let uniform = (sky > 0.0).then(|| Vec3::splat(sky));
    EnvironmentData { uniform, sun: Some(sun), ..EnvironmentData::default() }
}

/// A place around the y axis, the `i`th of `sides`.
fn around(i: u32, sides: u32, radius: f32, y: f32) -> Vec3 {
    let [x, z] = (radius * Vec2::from_angle(TAU * i as f32 / sides as f32)).to_array();
    Vec3::new(x, y, z)
}

/// Asserts that a scene's picture is off rays by less than `most`, direct light alone.
#[track_caller]
fn assert_near_rays(scene: SceneBuilder, most: f64) {
    let Some(gpu) = gpu() else { return };
    let error = error(&gpu, &scene.build().unwrap(), Bounces::None);
    assert!(error < most, "{error}");
}

/// Pictures of a scene that is refined to so many vertices.
fn options(vertices: u32) -> frame::Options {
    let bake = bake::Options { groups: true, vertices, ..bake::Options::default() };
    frame::Options { size: SIZE, bake, ..frame::Options::default() }
}

/// Relative RMS of a scene's picture against rays through its pixels.
fn error(gpu: &Gpu, scene: &Scene, bounces: Bounces) -> f64 {
    let found = gpu.picture(scene, frame::Options { bounces, ..options(12_000) }, f32::INFINITY);
    let placements = scene.at(0.0);
    let world = World::of(scene, &placements);
    let bounces = u32::from(bounces != Bounces::None);
    let cast = RayCast { rays: 512, runs: 2, bounces, ..RayCast::default() };
    let rays = pixels::picture(&world, SIZE, true, &cast, &|_| ());
    // The lamp itself is brighter than all that it lights.
    let pairs = found.into_iter().zip(rays.linear);
    relative_rms(pairs.filter(|(found, truth)| found.max(*truth) < 0.6))
}

/// A lamp hangs 1 cm below the ceiling of a room of one mesh with few vertices: nothing behind the lamp hides it.
#[test]
fn a_room_of_one_mesh_is_lit_by_its_ceiling_lamp() {
    let solid = generate::cuboid(Vec3::splat(2.0), 1);
    let open = part(&solid, |corners| corners.iter().any(|&v| solid.normals[v as usize].z < 0.5));
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 0.0, 4.0], [0.0; 3]))
        .mesh("room", inside_out(&open))
        .mesh("box", generate::cuboid(Vec3::new(0.6, 1.2, 0.6), 1))
        .mesh("lamp", Generator::Rectangle { size_m: [0.6, 0.5] })
        .entity(EntityData { albedo: Vec3::splat(0.7).into(), ..EntityData::of_mesh("room") })
        .entity(EntityData { rotation: turned(Vec3::Y, 17.0), ..stands("box", [-0.35, -0.4, -0.3]) })
        .entity(EntityData { rotation: turned(Vec3::X, 180.0), ..shines("lamp", [0.0, 0.99, 0.0], 10.0) });
    assert_near_rays(scene, 0.06);
}

/// Half of a dome's section: radii and heights.
const DOME: [[f32; 2]; 6] = [[0.28, -0.15], [0.05, 0.15], [0.002, 0.15], [0.002, 0.14], [0.045, 0.14], [0.27, -0.15]];

/// A bulb within a shade lights what lies below, and nothing beside it.
#[test]
fn no_light_comes_through_a_lamp_shade() {
    let Some(gpu) = gpu() else { return };
    // A ring that is open above and below, and a dome with the bulb up to 0.4 radii above the middle of its sphere: the
    // highest lies before its rim as seen from above, and shone through its top.
    let ring = [[0.28, -0.15], [0.16, 0.15], [0.15, 0.15], [0.27, -0.15]];
    let dome_heights = [(0.5, 0.03), (0.58, 0.03), (0.64, 0.15)];
    let in_dome = dome_heights.map(|(height, most)| (&DOME[..], height, most));
    for (profile, height, most) in [(&ring[..], 0.62, 0.03)].into_iter().chain(in_dome) {
        let error = error(&gpu, &under_a_shade(profile, height).build().unwrap(), Bounces::None);
        assert!(error < most, "{height}: {error}");
    }
}

/// A cord of eight corners is dark above the shade that its lower end hangs in.
#[test]
fn a_cord_is_not_lit_from_its_end() {
    let Some(gpu) = gpu() else { return };
    let scene = under_a_shade(&DOME, 0.58)
        .camera(Camera::new([0.1, 1.35, 1.3], [0.0, 1.25, 0.0]))
        .mesh("cord", generate::cuboid(Vec3::new(0.03, 1.2, 0.03), 1))
        .entity(stands("cord", [0.0, 1.23, 0.0]));
    let options = frame::Options { bounces: Bounces::None, ..options(12_000) };
    let found = gpu.picture(&scene.build().unwrap(), options, f32::INFINITY);
    let (above, below) = found.split_at(3 * (52 * SIZE[0]) as usize);
    let brightest = |pixels: &[f32]| pixels.iter().copied().fold(0.0, f32::max);
    assert!(brightest(above) < 0.01 * brightest(below), "{} of {}", brightest(above), brightest(below));
}

/// A globe of glass around a bulb takes its share once of all that leaves it, whether ball or box.
#[test]
fn glass_around_a_bulb_takes_its_share() {
    let Some(gpu) = gpu() else { return };
    let ball = generate::sphere(0.18, 3);
    let lantern = generate::cuboid(Vec3::splat(0.3), 1);
    for (name, glass) in [("ball", ball), ("lantern", lantern)] {
        let scene = Scene::builder()
            .camera(Camera::new([0.2, 0.8, 1.9], [0.0, 0.3, 0.0]))
            .mesh("slab", generate::cuboid(Vec3::new(3.0, 0.1, 3.0), 1))
            .mesh("glass", glass)
            .mesh("bulb", Generator::Sphere { radius_m: 0.05, subdivisions: 2 })
            .mesh("post", generate::cuboid(Vec3::new(0.06, 0.3, 0.06), 1))
            .entity(stands("slab", [0.0, -0.05, 0.0]))
            .entity(stands("post", [0.4, 0.15, 0.1]))
            .entity(EntityData { opacity: 0.4, ..stands("glass", [0.0, 0.4, 0.0]) })
            .entity(shines("bulb", [0.0, 0.4, 0.02], 10.0));
        let error = error(&gpu, &scene.build().unwrap(), Bounces::None);
        // 0.068 where vertices alone evaluate lights, and 0.3 or more without a share.
        assert!(error < 0.08, "{name}: {error}");
    }
}

/// What one node carries looks as if it stood there at rest.
#[test]
fn what_is_carried_together_shades_itself_as_at_rest() {
    let Some(gpu) = gpu() else { return };
    let node = Node::still(Vec3::new(-0.2, 0.1, 0.0), DQuat::from_rotation_y(0.3), 0.9);
    let picture = |motion: Vec<Motion>| {
        let at = |mesh: &str, position: [f32; 3]| {
            let entity = EntityData { motion: motion.clone(), ..stands(mesh, position) };
            let place = EntityData { motion: vec![Motion::Node(Box::new(node.clone()))], ..entity.clone() }.at(0.0);
            let [x, y, z, w] = place.rotation.to_array();
            let rotation = RotationData::Quaternion([x, y, z, w]);
            let at_rest = EntityData { position: place.position, rotation, scale: place.scale, ..entity.clone() };
            if motion.is_empty() { at_rest } else { entity }
        };
        let scene = Scene::builder()
            .camera(Camera::new([0.3, 0.9, 2.2], [-0.1, 0.6, 0.0]))
            .environment(EnvironmentData { uniform: Some(Vec3::splat(0.5)), ..EnvironmentData::default() })
            .mesh("plate", generate::cuboid(Vec3::new(0.9, 0.04, 0.9), 4))
            .mesh("back", generate::cuboid(Vec3::new(0.9, 1.0, 0.04), 4))
            .mesh("ring", generate::torus(0.2, 0.08, 24, 12))
            .mesh("bulb", Generator::Sphere { radius_m: 0.05, subdivisions: 2 })
            .entity(at("plate", [0.0, 0.02, 0.0]))
            .entity(at("plate", [0.0, 1.06, 0.0]))
            .entity(at("back", [0.0, 0.54, -0.43]))
            .entity(at("ring", [0.0, 0.12, 0.0]))
            .entity(EntityData { emission: Vec3::splat(10.0), ..at("bulb", [0.1, 0.85, 0.05]) });
        gpu.picture(&scene.build().unwrap(), options(0), f32::INFINITY)
    };
    let pairs = picture(vec![Motion::Node(Box::new(node.clone()))]).into_iter().zip(picture(Vec::new()));
    let error = relative_rms(pairs);
    // Rays are cast in the frame of the group.
    assert!(error < 0.015, "{error}");
}

/// A bulb that high within a shade, which is a profile (radius, height) turned around.
fn under_a_shade(profile: &[[f32; 2]], height: f32) -> SceneBuilder {
    let sides = 24_u32;
    let count = profile.len() as u32;
    let place = |i: u32| {
        let [radius, y] = profile[(i % count) as usize];
        around(i / count, sides, radius, y)
    };
    let mut corners = Vec::new();
    for i in 0..count * sides {
        let next = i / count * count + (i + 1) % count;
        corners.extend([i, next, next + count, i + count].map(|i| place(i % (count * sides))));
    }
    let shade = of_quads("shade", corners);
    Scene::builder()
        .camera(Camera::new([0.2, 1.1, 2.6], [0.0, 0.4, 0.0]))
        .mesh("slab", generate::cuboid(Vec3::new(4.0, 0.1, 4.0), 1))
        .mesh("shade", shade)
        .mesh("bulb", Generator::Sphere { radius_m: 0.04, subdivisions: 2 })
        .entity(stands("slab", [0.0, -0.05, 0.0]))
        .entity(wall([0.0, 1.9, -1.0]))
        .entity(stands("shade", [0.0, 0.65, 0.0]))
        .entity(shines("bulb", [0.0, height, 0.0], 150.0))
}

/// A wall with a window cut out of it, in one piece: twelve quads from front to back, and the faces within.
fn wall_with_window() -> Mesh {
    // Outer and inner corners, around.
    let outer = [[-1.5, 0.0], [1.5, 0.0], [1.5, 1.6], [-1.5, 1.6]];
    let inner = [[-0.4, 0.6], [0.6, 0.6], [0.6, 1.2], [-0.4, 1.2]];
    let place = |[x, y]: [f32; 2], z: f32| Vec3::new(x, y, z);
    let mut corners = Vec::new();
    for i in 0..4 {
        let next = (i + 1) % 4;
        let (a, b, c, d) = (outer[i], outer[next], inner[next], inner[i]);
        corners.extend([place(a, 0.05), place(b, 0.05), place(c, 0.05), place(d, 0.05)]);
        corners.extend([place(b, -0.05), place(a, -0.05), place(d, -0.05), place(c, -0.05)]);
        corners.extend([place(b, 0.05), place(a, 0.05), place(a, -0.05), place(b, -0.05)]);
        corners.extend([place(d, 0.05), place(c, 0.05), place(c, -0.05), place(d, -0.05)]);
    }
    of_quads("wall", corners)
}

/// Sunlight through a window on a glossy floor of two triangles: patch and highlight have the edges of rays.
#[test]
fn a_window_casts_a_patch_of_sunlight_and_its_highlight() {
    let gloss = Some(toml::from_str("roughness = 0.4").unwrap());
    for gloss in [None, gloss] {
        let scene = Scene::builder()
            .camera(Camera::new([0.0, 1.6, 3.4], [0.0, 0.3, 0.0]))
            .environment(sunny([0.3, 0.8, -0.9], 2.0, 900.0, 0.0))
            .mesh("wall", wall_with_window())
            .mesh("floor", generate::cuboid(Vec3::new(4.0, 0.1, 4.0), 1))
            .entity(EntityData { gloss, ..stands("floor", [0.0, -0.05, 0.0]) })
            .entity(EntityData::of_mesh("wall"));
        assert_near_rays(scene, 0.11);
    }
}

/// Sun through the window of a house of one mesh: as boxes it blocks light in closed form; maps blur the patch (0.55).
#[test]
fn a_house_of_one_mesh_has_a_patch_of_sunlight() {
    let planes =
        [&[-2.2_f32, -2.0, -0.6, 0.5, 2.0, 2.2][..], &[-0.2, 0.0, 0.8, 1.7, 2.4, 2.6], &[-1.7, -1.5, 1.5, 1.7]];
    let is_wall = |[x, y, z]: [usize; 3]| {
        let is_window = (x, y, z) == (2, 2, 0);
        !is_window && (x == 0 || x == 4 || y == 0 || y == 4 || z == 0)
    };
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 1.4, 3.4], [0.0, 0.9, 0.0]))
        .environment(sunny([0.3, 0.6, -0.8], 2.0, 900.0, 0.0))
        .mesh("house", of_cells(planes, is_wall))
        .entity(EntityData::of_mesh("house"));
    assert_near_rays(scene, 0.09);
}

/// Rods of one mesh have shadows as wide as they are: maps of 32 texels across all of them leave dots (0.066).
#[test]
fn thin_bars_of_one_mesh_cast_whole_shadows() {
    let rod = |x: f32, lean: f32| {
        let place = move |i: u32, end: f32| around(i, 8, 0.03, 2.0 * end) + (x + lean * end) * Vec3::X;
        (0..8).flat_map(move |i| [place(i, 0.0), place(i, 1.0), place(i + 1, 1.0), place(i + 1, 0.0)])
    };
    let rods = (0..6).flat_map(|k| rod(0.4 * k as f32 - 1.0, 0.1 * k as f32 - 0.2));
    let scene = Scene::builder()
        .camera(Camera::new([-1.3, 2.2, 1.3], [-1.3, 0.0, 1.1]))
        .environment(sunny([0.5, 0.8, -0.4], 1.0, 6000.0, 0.2))
        .mesh("rods", of_quads("rods", rods.collect()))
        .mesh("ground", Generator::Plane { size_m: 8.0, cells: 16 })
        .entity(EntityData::of_mesh("rods"))
        .entity(EntityData::of_mesh("ground"));
    assert_near_rays(scene, 0.04);
}

/// Sun through the window of a round tower and past thin rods: the patch is sharp, not as coarse as vertices (0.34).
#[test]
fn a_round_tower_has_a_patch_of_sunlight() {
    let place = |i: u32, y: f32| around(i, 24, 2.0, y);
    let heights = [0.0, 1.5, 2.5, 3.0];
    let rows = heights.iter().zip(&heights[1..]);
    let wall = rows.flat_map(|(&low, &high)| {
        let is_window = move |i: &u32| low == 1.5 && [0, 23].contains(i);
        (0..24)
            .filter(move |i| !is_window(i))
            .flat_map(move |i| [place(i, low), place(i + 1, low), place(i + 1, high), place(i, high)])
    });
    let wall: Vec<Vec3> = wall.collect();
    let rod = |z: f32| [[0.0, z], [0.0, z + 0.04], [3.0, z + 0.04], [3.0, z]].map(|[y, z]| Vec3::new(1.2, y, z));
    let rods: Vec<Vec3> = [-0.4, -0.2, 0.0, 0.2, 0.4].into_iter().flat_map(rod).collect();
    let scene = Scene::builder()
        .camera(Camera { fov_deg: 60.0, ..Camera::new([0.5, 1.4, 0.0], [-2.0, 0.9, 0.0]) })
        .environment(sunny([1.0, 0.35, 0.05], 0.6, 9000.0, 0.0))
        .mesh("tower", of_quads("tower", wall))
        .mesh("rods", of_quads("rods", rods))
        .entity(EntityData::of_mesh("tower"))
        .entity(EntityData::of_mesh("rods"));
    assert_near_rays(scene, 0.1);
}

/// A vault of one sheet ends in a higher wall: no sun comes in along the line where they meet (0.55).
#[test]
fn no_sunlight_comes_in_where_a_vault_meets_a_wall() {
    let place = |i: u32, z: f32| {
        let turn = std::f32::consts::PI * i as f32 / 24.0;
        Vec3::new(1.5 * turn.cos(), 1.5 * turn.sin(), z)
    };
    let wall = [[-2.0, -1.0], [2.0, -1.0], [2.0, 3.0], [-2.0, 3.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let sheet = (0..24).flat_map(|i| [place(i, 4.0), place(i + 1, 4.0), place(i + 1, 0.0), place(i, 0.0)]);
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 0.9, 1.6], [0.0, 1.2, 0.0]))
        .environment(sunny([0.5, 0.8, 0.3], 1.0, 3000.0, 0.02))
        .mesh("vault", of_quads("vault", sheet.collect()))
        .mesh("wall", of_quads("wall", wall.to_vec()))
        .entity(EntityData::of_mesh("vault"))
        .entity(EntityData::of_mesh("wall"));
    assert_near_rays(scene, 0.15);
}

/// A bulb in a thin open shade, past which a ball swings: its edge on the wall is soft as by rays (0.044 by outlines).
#[test]
fn a_lampshade_has_a_soft_edge() {
    let place = |i: u32, radius: f32, y: f32| around(i, 32, radius, y);
    let shade = (0..32)
        .flat_map(|i| [place(i, 0.1, 0.15), place(i + 1, 0.1, 0.15), place(i + 1, 0.25, -0.15), place(i, 0.25, -0.15)]);
    let swings = Motion::Orbit { centre: Vec3::ZERO, axis: Vec3::Y, period_s: 5.0 };
    let scene = Scene::builder()
        .camera(Camera { fov_deg: 50.0, ..Camera::new([0.0, 1.6, 3.2], [0.0, 0.9, 0.0]) })
        .mesh("slab", generate::cuboid(Vec3::new(5.0, 0.1, 5.0), 1))
        .mesh("shade", of_quads("shade", shade.collect()))
        .mesh("bulb", Generator::Sphere { radius_m: 0.05, subdivisions: 2 })
        .mesh("ball", Generator::Sphere { radius_m: 0.2, subdivisions: 3 })
        .entity(stands("slab", [0.0, -0.05, 0.0]))
        .entity(wall([0.0, 2.0, -1.2]))
        .entity(stands("shade", [0.0, 1.5, -0.3]))
        .entity(shines("bulb", [0.0, 1.48, -0.3], 20.0))
        .entity(EntityData { motion: vec![swings], ..stands("ball", [0.6, 0.7, 0.0]) });
    assert_near_rays(scene, 0.036);
}

/// A tube that shines down from a bent sheet, between slabs of so many cells.
fn tube_below_a_reflector(cells: u32) -> SceneBuilder {
    let profile = [[-0.16, -0.05], [-0.05, 0.07], [0.05, 0.07], [0.16, -0.05]];
    let at = |x: f32, [z, y]: [f32; 2]| Vec3::new(x, y, z);
    let sheets = profile.iter().zip(&profile[1..]);
    let reflector = sheets.flat_map(|(&a, &b)| [at(-0.65, a), at(0.65, a), at(0.65, b), at(-0.65, b)]);
    Scene::builder()
        .camera(Camera { fov_deg: 60.0, ..Camera::new([0.4, 1.0, 2.6], [0.0, 1.1, 0.0]) })
        .mesh("slab", generate::cuboid(Vec3::new(4.0, 0.1, 4.0), cells))
        .mesh("reflector", of_quads("reflector", reflector.collect()))
        .mesh("tube", generate::cuboid(Vec3::new(1.2, 0.03, 0.03), 1))
        .entity(stands("slab", [0.0, -0.05, 0.0]))
        .entity(stands("slab", [0.0, 2.3, 0.0]))
        .entity(wall([0.0, 1.1, -1.5]))
        .entity(stands("reflector", [0.0, 1.9, 0.0]))
        .entity(shines("tube", [0.0, 1.9, 0.0], 8.0))
}

/// None of its light comes through the sheet (0.27 with outlines).
#[test]
fn no_light_comes_through_the_reflector_of_a_tube() {
    assert_near_rays(tube_below_a_reflector(1), 0.22);
}

/// The same of vertices: by outlines the slab above, which should be dark, has a third of the light below (0.016 by maps).
#[test]
fn no_light_comes_through_a_reflector_to_vertices() {
    let Some(gpu) = gpu() else { return };
    let scene = tube_below_a_reflector(24).build().unwrap();
    let light = gpu.lit(&scene, frame::Options { bounces: Bounces::None, ..options(0) });
    let vertices = receiver_vertices(&scene);
    let below = |v: &&Vertex| v.entity == 0 && scene.meshes[0].normals[v.index].y > 0.5;
    let floor: Vec<Vertex> = vertices.iter().filter(below).step_by(3).copied().collect();
    let rays = RayCast { rays: 512, ..RayCast::default() }.run(&World::of(&scene, &scene.at(0.0)), &floor);
    let error = against_rays(&light, &floor, &rays);
    let mean =
        |entity: usize| light[entity].iter().map(|rgb| f64::from(rgb[0])).sum::<f64>() / light[entity].len() as f64;
    let above = mean(1) / mean(0);
    assert!(error < 0.24 && above < 0.03, "{error}, above {above} of below");
}

/// A lamp in a thin box hangs right below a slab: nothing of its light gets above that.
#[test]
fn no_light_comes_through_the_slab_above_a_lamp() {
    let scene = Scene::builder()
        .camera(Camera::new([0.2, 2.4, 3.2], [0.0, 0.8, 0.0]))
        .mesh("slab", generate::cuboid(Vec3::new(2.4, 0.1, 2.4), 1))
        .mesh("lamp", generate::cuboid(Vec3::new(0.6, 0.03, 0.6), 1))
        .entity(stands("slab", [0.0, -0.05, 0.0]))
        .entity(stands("slab", [0.0, 1.2, 0.0]))
        .entity(wall([0.0, 1.1, -1.2]))
        .entity(shines("lamp", [0.0, 1.08, 0.0], 3.0));
    assert_near_rays(scene, 0.04);
}

/// Below a table all lamps above it are hidden, though they are no balls.
#[test]
fn several_lamps_leave_a_table_its_shadow() {
    let mut scene = Scene::builder()
        .camera(Camera::new([0.0, 2.0, 2.2], [0.0, 0.0, -0.2]))
        .mesh("floor", Generator::Plane { size_m: 4.0, cells: 24 })
        .mesh("top", generate::cuboid(Vec3::new(1.4, 0.05, 0.8), 1))
        .mesh("lamp", generate::torus(0.03, 0.012, 16, 8))
        .entity(EntityData::of_mesh("floor"))
        .entity(stands("top", [0.0, 0.75, -0.3]));
    for x in [-0.45, 0.0, 0.4] {
        scene = scene.entity(shines("lamp", [x, 1.95, -0.2], 9.0));
    }
    assert_near_rays(scene, 0.05);
}

/// A slab of a roof lies on a gable: the box around this reaches to above the slab, its faces do not (0.34).
#[test]
fn a_gable_casts_no_shadow_on_the_roof_above_it() {
    let solid = generate::cuboid(Vec3::ONE, 1);
    let gable = reshaped(&solid, |p| Vec3::new(4.0 * p.x * (0.5 - p.y), 0.9 * (0.5 + p.y), 6.0 * p.z));
    let slab = reshaped(&solid, |p| Vec3::new(2.0 * (0.5 + p.x), 0.9 * (0.5 - p.x) + 0.1 * (0.5 + p.y), 6.0 * p.z));
    assert!(gable.is_convex() && slab.is_convex());
    let scene = Scene::builder()
        .camera(Camera::new([4.0, 4.0, 4.0], [0.0, 0.4, 0.0]))
        .environment(sunny([0.8, 0.6, 0.3], 1.0, 6000.0, 0.2))
        .mesh("gable", gable)
        .mesh("slab", slab)
        .entity(EntityData::of_mesh("gable"))
        .entity(EntityData::of_mesh("slab"));
    assert_near_rays(scene, 0.05);
}

/// A rug lies exactly in its floor's plane: neither is dark there (0.5).
#[test]
fn what_lies_in_a_floor_takes_no_light_from_it() {
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 1.2, 2.6], [0.0, 0.1, 0.0]))
        .environment(EnvironmentData { uniform: Some(Vec3::splat(0.1)), ..EnvironmentData::default() })
        .mesh("floor", Generator::Plane { size_m: 3.0, cells: 20 })
        .mesh("rug", Generator::Plane { size_m: 1.0, cells: 10 })
        .mesh("lamp", Generator::Sphere { radius_m: 0.1, subdivisions: 2 })
        .entity(EntityData::of_mesh("floor"))
        .entity(EntityData::of_mesh("rug"))
        .entity(shines("lamp", [0.8, 0.7, 0.0], 5.0));
    assert_near_rays(scene, 0.04);
}

/// Walls of one square each throw the light of a lamp before their middles, though their corners are dark.
#[test]
fn walls_of_one_square_throw_light_on_each_other() {
    let Some(gpu) = gpu() else { return };
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 1.0, 4.0], [0.0, 0.8, 0.0]))
        .mesh("wall", Generator::Plane { size_m: 3.0, cells: 1 })
        .mesh("lamp", Generator::Sphere { radius_m: 0.1, subdivisions: 2 })
        .entity(EntityData::of_mesh("wall"))
        .entity(EntityData { rotation: turned(Vec3::X, 90.0), ..stands("wall", [0.0, 1.5, -1.5]) })
        .entity(EntityData { rotation: turned(Vec3::X, 180.0), ..stands("wall", [0.0, 2.2, 0.0]) })
        .entity(shines("lamp", [0.0, 0.5, 0.0], 6.0));
    let error = error(&gpu, &scene.build().unwrap(), Bounces::One);
    assert!(error < 0.05, "{error}");
}

/// The top of a pole reaches into a bulb, whose lower part it hides from the wall behind (0.21).
#[test]
fn a_pole_hides_the_part_of_its_lamp_that_it_reaches_into() {
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 0.6, 2.0], [0.0, 0.6, 0.0]))
        .mesh("wall", Generator::Plane { size_m: 4.0, cells: 40 })
        .mesh("pole", Generator::Cuboid { size_m: Vec3::new(0.03, 1.5, 0.03), cells: 2 })
        .mesh("lamp", Generator::Sphere { radius_m: 0.03, subdivisions: 3 })
        .entity(EntityData { rotation: turned(Vec3::X, 90.0), ..stands("wall", [0.0, 0.8, -0.4]) })
        .entity(EntityData { receives: Some(false), ..stands("pole", [0.0, 0.75, 0.0]) })
        .entity(shines("lamp", [0.0, 1.52, 0.0], 30.0));
    assert_near_rays(scene, 0.1);
}

/// A strip of sun 0.2 m wide comes through a roof. It throws light by its area, not by the vertices that it meets, and
/// none of the sun on walls above the roof gets in (4.8 times the light of rays).
#[test]
fn a_hall_is_lit_by_the_strip_of_sun_on_its_floor() {
    let Some(gpu) = gpu() else { return };
    let slab = |x: f32, y: f32, z: f32| Generator::Cuboid { size_m: Vec3::new(x, y, z), cells: 1 };
    let turn = turned(Vec3::Y, 90.0);
    let scene = Scene::builder()
        .environment(sunny([0.5, 1.0, 0.1], 1.0, 3e4, 0.0))
        .camera(Camera { fov_deg: 60.0, ..Camera::new([-7.0, 1.2, 5.0], [1.0, 1.6, -1.0]) })
        .mesh("floor", slab(16.4, 0.2, 12.4))
        .mesh("long wall", slab(16.4, 5.0, 0.2))
        .mesh("wall", slab(12.4, 5.0, 0.2))
        .mesh("roof", slab(7.8, 0.5, 12.0))
        .entity(stands("floor", [0.0, -0.1, 0.0]))
        .entity(stands("long wall", [0.0, 2.5, -6.1]))
        .entity(stands("long wall", [0.0, 2.5, 6.1]))
        .entity(EntityData { rotation: turn.clone(), ..stands("wall", [-8.1, 2.5, 0.0]) })
        .entity(EntityData { rotation: turn, ..stands("wall", [8.1, 2.5, 0.0]) })
        .entity(stands("roof", [-4.1, 4.0, 0.0]))
        .entity(stands("roof", [4.1, 4.0, 0.0]))
        .build()
        .unwrap();
    let options = frame::Options { bounces: Bounces::One, ..options(20_000) };
    let found = gpu.picture(&scene, options, f32::INFINITY);
    let world = World::of(&scene, &scene.at(0.0));
    let cast = RayCast { rays: 256, runs: 2, bounces: 1, ..RayCast::default() };
    let rays = pixels::picture(&world, SIZE, true, &cast, &|_| ());
    let dark = found.iter().zip(&rays.linear).filter(|(found, truth)| found.max(**truth) < 0.05);
    let [mine, theirs] = dark.fold([0.0, 0.0], |[a, b], (found, truth)| [a + found, b + truth]);
    let ratio = mine / theirs;
    assert!((0.6..1.6).contains(&ratio), "{ratio}");
}

/// A carpet ends in a wall's plane in a closed room: sun on the wall's outside lit its vertices (0.0008 of 60 000).
#[test]
fn a_closed_room_in_the_sun_is_dark() {
    let Some(gpu) = gpu() else { return };
    let slab = |x: f32, y: f32, z: f32| generate::cuboid(Vec3::new(x, y, z), 1);
    let corners = [[-0.8, 5.0], [0.8, 5.0], [0.8, -5.0], [-0.8, -5.0]].map(|[x, z]| Vec3::new(x, 0.01, z));
    let scene = Scene::builder()
        .environment(sunny(Vec3::new(0.3, 0.7, -0.6).normalize(), 0.53, 6e4, 0.0))
        .camera(Camera { fov_deg: 60.0, ..Camera::new([2.5, 1.6, -4.5], [-0.5, 1.0, 4.0]) })
        .mesh("wall", slab(6.2, 3.0, 0.1))
        .mesh("side", slab(0.1, 3.0, 10.0))
        .mesh("floor", slab(6.2, 0.1, 10.2))
        .mesh("carpet", of_quads("carpet", corners.to_vec()))
        .entity(stands("wall", [0.0, 1.5, -5.05]))
        .entity(stands("wall", [0.0, 1.5, 5.05]))
        .entity(stands("side", [-3.05, 1.5, 0.0]))
        .entity(stands("side", [3.05, 1.5, 0.0]))
        .entity(stands("floor", [0.0, -0.05, 0.0]))
        .entity(stands("floor", [0.0, 3.05, 0.0]))
        .entity(EntityData::of_mesh("carpet"))
        .build()
        .unwrap();
    let shown = gpu.picture(&scene, options(20_000), f32::INFINITY);
    let mean = shown.iter().sum::<f32>() / shown.len() as f32;
    assert!(mean < 5e-4, "{mean}");
}

/// Sun through a hole in a cave onto a pool, which is a grid: the outline of the cave around it hid the half (0.55).
#[test]
fn sun_through_the_hole_of_a_cave_lights_a_pool() {
    let ball = generate::sphere(2.0, 4);
    let toward = Vec3::new(0.3, 1.0, 0.2).normalize();
    let is_hole = |corners: &[u32; 3]| {
        let middle = corners.iter().map(|&v| ball.positions[v as usize]).sum::<Vec3>();
        middle.normalize().dot(toward) > 20.0_f32.to_radians().cos()
    };
    let scene = Scene::builder()
        .environment(sunny(toward, 1.0, 9e3, 0.0))
        .camera(Camera { fov_deg: 70.0, ..Camera::new([-1.2, 0.3, 1.2], [0.2, -0.8, -0.1]) })
        .mesh("cave", inside_out(&part(&ball, |corners| !is_hole(corners))))
        .mesh("pool", Generator::Plane { size_m: 2.4, cells: 12 })
        .entity(EntityData::of_mesh("cave"))
        .entity(stands("pool", [0.0, -0.8, 0.0]));
    assert_near_rays(scene, 0.35);
}
