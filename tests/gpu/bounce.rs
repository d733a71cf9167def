//! Light that bounces within a rigid group, against rays and the closed form of a hollow sphere.

use super::common::{Gpu, generate, gpu, inside_out, joined, parse, part, relative_rms};
use super::stage::{against_rays, small};
use glam::Vec3;
use shadow_fields::asset::Mesh;
use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::bounce::Bounces;
use shadow_fields::scene::{EntityData, Lights, Motion, Scene, SceneBuilder};
use shadow_fields::truth::{Estimate, RayCast, Vertex, World, receiver_vertices};
use shadow_fields::{bake, frame};

const ALBEDO: f32 = 0.6;

/// A lamp beside the sphere's middle.
fn lamp() -> EntityData {
    EntityData {
        position: Vec3::new(0.4, 0.2, 0.0),
        emission: Vec3::new(50.0, 30.0, 10.0),
        emits: Some(true),
        receives: Some(false),
        ..EntityData::of_mesh("lamp")
    }
}

fn hollow() -> Scene {
    Scene::builder()
        .mesh("inside", inside_out(&generate::sphere(1.0, 4)))
        .mesh("lamp", generate::sphere(0.05, 2))
        .entity(EntityData { albedo: Vec3::splat(ALBEDO).into(), ..EntityData::of_mesh("inside") })
        .entity(lamp())
        .build()
        .unwrap()
}

fn lit(gpu: &Gpu, scene: &Scene, bounces: Bounces) -> Vec<[f32; 3]> {
    gpu.lit(scene, frame::Options { bounces, lights: Lights::Sharp, ..small() }).remove(0)
}

fn by_rays(scene: &Scene, vertices: &[Vertex], rays: u32, bounces: u32) -> Vec<Estimate> {
    RayCast { rays, bounces, ..RayCast::default() }.run(&World::of(scene, &scene.at(0.0)), vertices)
}

#[test]
fn all_of_a_hollow_sphere_is_lit_by_its_mean() {
    let Some(gpu) = gpu() else { return };
    let scene = hollow();
    let areas = scene.meshes[0].vertex_areas_m2();
    let direct = lit(&gpu, &scene, Bounces::None);
    let weighed = |channel: usize| direct.iter().zip(&areas).map(move |(c, area)| f64::from(c[channel]) * area);
    let whole: f64 = areas.iter().sum();
    let mean = [0, 1, 2].map(|channel| weighed(channel).sum::<f64>() / whole);
    assert!(mean[0] > 0.01 && mean[0] > 1.5 * mean[1], "the lamp shines: {mean:?}");
    let albedo = f64::from(ALBEDO);
    for (bounces, gain) in [(Bounces::One, albedo), (Bounces::All, albedo / (1.0 - albedo))] {
        let found = lit(&gpu, &scene, bounces);
        for (v, (found, direct)) in found.iter().zip(&direct).enumerate() {
            for channel in 0..3 {
                let wanted = gain * mean[channel];
                let bounced = f64::from(found[channel] - direct[channel]);
                // Rays leave from just inside, and a mesh of 5 120 triangles is no sphere.
                assert!((bounced / wanted - 1.0).abs() < 0.03, "{bounces:?} {v}: {bounced}, not {wanted}");
            }
        }
    }
}

/// Three things that move over a floor, under a sky: a ball, a tall box and a ring, nearly touching it.
const THINGS: &str = r#"
camera = { eye = [0.5, 1.8, 3.2], target = [0, 0.3, 0] }
environment = { sky = { sun_elevation_deg = 50, sun_azimuth_deg = 60, radiance = 0.8, sun = 0 } }
mesh = [
    { name = "floor", cuboid = { size_m = [3, 0.1, 3], cells = 24 } },
    { name = "ball", sphere = { radius_m = 0.4, subdivisions = 3 } },
    { name = "ring", torus = { major_m = 0.35, minor_m = 0.13, segments = 40, sides = 20 } },
    { name = "box", cuboid = { size_m = [0.5, 0.9, 0.5], cells = 8 } },
]
entity = [
    { mesh = "floor", position = [0, -0.05, 0], albedo = [0.7, 0.7, 0.7] },
    { mesh = "ball", position = [0.7, 0.45, 0.2], albedo = [0.8, 0.15, 0.1], motion = [{ spin = { period_s = 9 } }] },
    { mesh = "ring", position = [-0.1, 0.2, 0.7], albedo = [0.15, 0.7, 0.2], motion = [{ spin = { period_s = 9 } }] },
    { mesh = "box", position = [-0.6, 0.48, -0.2], albedo = [0.8, 0.8, 0.8], motion = [{ spin = { period_s = 9 } }] },
]
"#;

/// Of these, as they are usually baked but with small captures.
fn usual(bounces: Bounces) -> frame::Options {
    let bake = bake::Options { face_px: 32, groups: true, ..bake::Options::default() };
    frame::Options { bounces, bake, lights: Lights::Sharp, ..small() }
}

/// Light between what moves and what rests, both ways, beside rays that are followed from surface to surface.
#[test]
fn what_moves_and_what_rests_light_each_other() {
    let Some(gpu) = gpu() else { return };
    let scene = parse(THINGS);
    let [direct, one, all] = [Bounces::None, Bounces::One, Bounces::All].map(|bounces| gpu.lit(&scene, usual(bounces)));
    let vertices: Vec<Vertex> = receiver_vertices(&scene).into_iter().step_by(7).collect();
    // Fronts of the floor's underside see nothing that the eye does.
    let is_above = |v: &Vertex| v.entity > 0 || scene.meshes[0].normals[v.index].y > 0.5;
    let vertices: Vec<Vertex> = vertices.into_iter().filter(is_above).collect();
    for (bounces, found, most) in [(1, &one, 0.075), (64, &all, 0.09)] {
        let rays = by_rays(&scene, &vertices, 512, bounces);
        let [without, with] = [&direct, found].map(|light| against_rays(light, &vertices, &rays));
        assert!(with < most && without > 2.4 * with, "{bounces}: {with}, {without} without");
    }
}

/// Light that a panel throws on the ceiling right above it does not pass through the panel, whether that moves or not. A
/// white one throws it back, and more of it gets out beside the panel.
#[test]
fn a_panel_below_a_ceiling_hides_what_it_lights() {
    let Some(gpu) = gpu() else { return };
    let dark = "receives = false";
    for (motion, surface, cells, bounces, most) in [
        ("", dark, 1, Bounces::One, 0.03),
        ("motion = [{ spin = { period_s = 9 } }], ", dark, 1, Bounces::One, 0.03),
        ("", dark, 1, Bounces::All, 0.05),
        // Its light varies from the middle to the rim.
        ("", "albedo = [0.9, 0.9, 0.9]", 8, Bounces::All, 0.065),
    ] {
        let text = format!(
            r#"
            camera = {{ eye = [0, 1, 4], target = [0, 1, 0] }}
            mesh = [
                {{ name = "slab", cuboid = {{ size_m = [3, 0.1, 3], cells = 48 }} }},
                {{ name = "panel", plane = {{ size_m = 0.8, cells = {cells} }} }},
            ]
            entity = [
                {{ mesh = "slab", position = [0, -0.05, 0], albedo = [0.7, 0.7, 0.7] }},
                {{ mesh = "slab", position = [0, 2.05, 0], albedo = [0.8, 0.8, 0.8] }},
                {{ mesh = "panel", {motion}position = [0, 1.96, 0], emission = [10, 8, 6], {surface} }},
            ]
            "#
        );
        let scene = parse(&text);
        let floor = receiver_vertices(&scene).into_iter().filter(|v| v.entity == 0);
        let floor: Vec<Vertex> = floor.filter(|v| scene.meshes[0].normals[v.index].y > 0.5).step_by(13).collect();
        let rays = |bounces| {
            let estimates = by_rays(&scene, &floor, 1024, bounces);
            estimates.into_iter().flat_map(|estimate| estimate.radiosity).sum::<f64>()
        };
        let [direct, all] = [0, bounces.most()].map(rays);
        let light = gpu.lit(&scene, usual(bounces));
        let found: f64 = floor.iter().flat_map(|v| light[v.entity][v.index]).map(f64::from).sum();
        // Lit through the panel the floor would have half as much again.
        let error = found / all - 1.0;
        println!("{error:.4}: {found:.3} for {direct:.3} and {all:.3}: {motion}{surface}");
        assert!(
            error.abs() < most && direct < 0.95 * all,
            "{error}: {found} for {direct} and {all}: {motion}{surface}"
        );
    }
}

/// A lamp in one of two rooms with one floor, one ceiling and a doorway between them.
fn rooms() -> SceneBuilder {
    Scene::builder()
        .mesh("shell", inside_out(&generate::cuboid(Vec3::new(6.0, 2.6, 8.0), 1)))
        .mesh("side", generate::cuboid(Vec3::new(2.5, 2.6, 0.15), 1))
        .mesh("lintel", generate::cuboid(Vec3::new(1.0, 0.48, 0.15), 1))
        .mesh("lamp", generate::sphere(0.15, 2))
        .entity(stands("shell", 0.0, 0.0))
        .entity(stands("side", -1.75, 0.0))
        .entity(stands("side", 1.75, 0.0))
        .entity(stands("lintel", 0.0, 1.06))
        .entity(EntityData { position: Vec3::new(1.0, 0.6, -2.5), ..lamp() })
}

fn stands(mesh: &str, x: f32, y: f32) -> EntityData {
    EntityData { position: Vec3::new(x, y, 0.0), albedo: Vec3::splat(0.7).into(), ..EntityData::of_mesh(mesh) }
}

fn frame_of_rooms(gpu: &Gpu, scene: &Scene) -> frame::Frame {
    let bake = bake::Options { vertices: 8000, ..usual(Bounces::One).bake };
    gpu.frame(scene, frame::Options { bake, ..usual(Bounces::One) })
}

/// Floor and ceiling of the dark room, as far as the lamp's rays do not come through the doorway.
fn dark_vertices(scene: &Scene) -> Vec<Vertex> {
    let mesh = scene.surface(0);
    let is_dark = |v: &Vertex| {
        let [place, normal] = [mesh.positions[v.index], mesh.normals[v.index]];
        v.entity == 0 && normal.y.abs() > 0.5 && place.z > 0.2 && place.x.abs() > 1.2
    };
    receiver_vertices(scene).into_iter().filter(is_dark).collect()
}

/// What moves in a dark room is not lit through the wall by the room beyond.
#[test]
fn what_moves_is_not_lit_through_walls() {
    let Some(gpu) = gpu() else { return };
    let spin = vec![Motion::Spin { axis: Vec3::Y, period_s: 9.0 }];
    let place = Vec3::new(-1.9, -0.2, 1.6);
    let ball = EntityData { position: place, motion: spin, ..stands("ball", 0.0, 0.0) };
    let scene = rooms().mesh("ball", generate::sphere(0.3, 2)).entity(ball).build().unwrap();
    let light = gpu.light(&mut frame_of_rooms(&gpu, &scene), &scene.at(0.0));
    let ball = receiver_vertices(&scene).into_iter().filter(|v| v.entity == 5);
    let ball: Vec<Vertex> = ball.step_by(3).collect();
    let rays = by_rays(&scene, &ball, 2048, 1);
    let wanted: f64 = rays.iter().map(|truth| truth.radiosity[0]).sum();
    let found: f64 = ball.iter().map(|v| f64::from(light[5][v.index][0])).sum();
    // 1.65, and 2.7 by all that rests: runs of the walls that both rooms share have vertices on both sides.
    assert!(ball.len() > 40 && found > 0.8 * wanted && found < 1.8 * wanted, "{found}, by rays {wanted}");
}

/// A door that moves shuts light out, where one that stands aside lets it in.
#[test]
fn no_light_bounces_through_a_shut_door() {
    let Some(gpu) = gpu() else { return };
    let spin = vec![Motion::Spin { axis: Vec3::Y, period_s: 9.0 }];
    let door = EntityData { motion: spin, ..stands("door", 0.0, -0.25) };
    let door_mesh = generate::cuboid(Vec3::new(1.0, 2.1, 0.05), 4);
    let scene = rooms().mesh("door", door_mesh).entity(door).build().unwrap();
    let mut frame = frame_of_rooms(&gpu, &scene);
    let mut sum = |aside: f32| {
        let mut placements = scene.at(0.0);
        placements[5].position.z -= aside;
        let light = gpu.light(&mut frame, &placements);
        let dark = dark_vertices(frame.scene());
        assert!(dark.len() > 250, "{}", dark.len());
        dark.iter().map(|v| f64::from(light[0][v.index][0])).sum::<f64>()
    };
    let [shut, open] = [0.0, 3.5].map(&mut sum);
    // 0.13: runs at the threshold have vertices on both sides.
    assert!(open > 0.0 && shut < 0.2 * open, "{shut}, with an open door {open}");
}

/// The dark room's light comes through the doorway alone, not past the wall's foot or from the far side of a wall.
#[test]
fn light_bounces_through_a_door_and_not_through_walls() {
    let Some(gpu) = gpu() else { return };
    let scene = rooms().build().unwrap();
    let mut frame = frame_of_rooms(&gpu, &scene);
    let light = gpu.light(&mut frame, &scene.at(0.0));
    let scene = frame.scene();
    let mesh = scene.surface(0);
    let dark: Vec<Vertex> = dark_vertices(scene).into_iter().step_by(5).collect();
    let rays = by_rays(scene, &dark, 2048, 1);
    let count = dark.len();
    let sums = |of: &dyn Fn(usize) -> f64| (0..count).map(of).sum::<f64>();
    let found = sums(&|i| f64::from(light[0][dark[i].index][0]));
    let wanted = sums(&|i| rays[i].radiosity[0]);
    assert!(count > 50 && (found / wanted - 1.0).abs() < 0.3, "{count} vertices: {found}, by rays {wanted}");
    // The lintel covers the upper part of the jamb. Triangles that reach below it are seen, and none has a black corner.
    let jamb = scene.surface(1);
    let seen = jamb.triangles.iter().filter(|triangle| {
        let corners = triangle.map(|v| v as usize);
        corners.iter().all(|&v| jamb.normals[v].x > 0.5) && corners.iter().any(|&v| jamb.positions[v].y < 0.815)
    });
    let black = seen.clone().flatten().filter(|v| light[1][**v as usize][0] == 0.0).count();
    assert!(seen.count() > 20 && black == 0, "{black} black corners of the jamb");
    let crosses = |[a, b]: [Vec3; 2]| a.z * b.z < 0.0 && a.x.abs().min(b.x.abs()) > 0.6 && a.distance(b) > 0.3;
    let sides = mesh.triangles.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
    let long = sides.filter(|side| crosses(side.map(|v| mesh.positions[*v as usize]))).count();
    assert_eq!(long, 0, "triangles reach from one room into the other");
}

/// The bright outside of a house does not come in, though runs of its one mesh may have vertices of both sides.
#[test]
fn a_closed_house_of_one_mesh_is_dark_within() {
    let Some(gpu) = gpu() else { return };
    let within = inside_out(&generate::cuboid(Vec3::new(4.0, 2.6, 4.0), 1));
    let house = joined(&[(&generate::cuboid(Vec3::new(4.6, 3.2, 4.6), 1), Vec3::ZERO), (&within, Vec3::ZERO)]);
    let scene = Scene::builder()
        .environment(EnvironmentData { uniform: Some(Vec3::ONE), ..Default::default() })
        .mesh("house", house)
        .entity(stands("house", 0.0, 0.0))
        .build()
        .unwrap();
    let mut frame = frame_of_rooms(&gpu, &scene);
    let light = gpu.light(&mut frame, &scene.at(0.0)).swap_remove(0);
    let positions = &frame.scene().surface(0).positions;
    let is_within = |at: &Vec3| at.abs().cmple(Vec3::new(2.01, 1.31, 2.01)).all();
    let mean = |inner: bool| {
        let shown = light.iter().zip(positions).filter(|(_, at)| is_within(at) == inner);
        let shown: Vec<f32> = shown.map(|(rgb, _)| rgb[0]).collect();
        shown.iter().sum::<f32>() / shown.len() as f32
    };
    let [within, outside] = [true, false].map(mean);
    assert!(outside > 0.5 && within < 3e-3, "{within} within, {outside} outside");
}

/// A shade around a lamp is brighter by far than all else, and small: every vertex of the room finds it by rays that are
/// aimed at it. Those that leave in one pattern meet it once or never, and light the walls in blotches.
#[test]
fn the_inside_of_a_shade_lights_walls_evenly() {
    let Some(gpu) = gpu() else { return };
    let upper = |mesh: &Mesh| part(mesh, |triangle| triangle.iter().all(|&v| mesh.positions[v as usize].y > -0.01));
    let [outer, inner] = [upper(&generate::sphere(0.21, 3)), upper(&inside_out(&generate::sphere(0.2, 3)))];
    let shade = Vec3::new(0.0, 0.5, 0.0);
    let of = |mesh: &str| EntityData { albedo: Vec3::splat(0.7).into(), ..EntityData::of_mesh(mesh) };
    let scene = Scene::builder()
        .mesh("room", inside_out(&generate::cuboid(Vec3::new(4.0, 2.6, 4.0), 24)))
        .mesh("shade", joined(&[(&outer, Vec3::ZERO), (&inner, Vec3::ZERO)]))
        .mesh("lamp", generate::sphere(0.05, 2))
        .entity(of("room"))
        .entity(EntityData { position: shade, ..of("shade") })
        .entity(EntityData { position: shade, ..lamp() })
        .build()
        .unwrap();
    let [direct, one] = [Bounces::None, Bounces::One].map(|bounces| gpu.lit(&scene, usual(bounces)));
    // Places in corners see half of what those beside them do.
    let is_wall = |v: &Vertex| {
        let mesh = &scene.meshes[0];
        let place = mesh.positions[v.index].abs();
        v.entity == 0 && mesh.normals[v.index].y == 0.0 && place.y < 1.2 && place.x.min(place.z) < 1.9
    };
    let walls: Vec<Vertex> = receiver_vertices(&scene).into_iter().filter(is_wall).step_by(41).collect();
    let rays = |bounces| by_rays(&scene, &walls, 1 << 14, bounces);
    let wanted = rays(1).into_iter().zip(rays(0)).map(|(one, direct)| one.radiosity[0] - direct.radiosity[0]);
    let found = walls.iter().map(|v| f64::from(one[0][v.index][0] - direct[0][v.index][0]));
    let error = relative_rms(found.zip(wanted));
    assert!(walls.len() > 40 && error < 0.07, "{} vertices: {error}", walls.len());
}

/// Nothing jumps where what a thing sees of the floor is cut otherwise: ten times smaller steps
/// change light ten times less. (Steps of a millimetre: 0.012 of the brightest, under the ball.)
#[test]
fn no_light_jumps_as_a_thing_moves() {
    let Some(gpu) = gpu() else { return };
    let scene = parse(THINGS);
    let mut frame = gpu.frame(&scene, usual(Bounces::One));
    let mut placements = scene.at(0.0);
    let mut before: Option<Vec<Vec<[f32; 3]>>> = None;
    let mut most = 0.0_f32;
    for _ in 0..120 {
        placements[1].position.x += 0.0001;
        let now = gpu.light(&mut frame, &placements);
        let brightest = now.iter().flatten().flatten().copied().fold(0.0, f32::max);
        if let Some(before) = &before {
            let pairs = before.iter().flatten().flatten().zip(now.iter().flatten().flatten());
            most = most.max(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / brightest);
        }
        before = Some(now);
    }
    assert!(most > 0.0 && most < 0.002, "{most}");
}

/// A second frame starts from the direct light, not from the light of the last one.
#[test]
fn frames_do_not_add_up() {
    let Some(gpu) = gpu() else { return };
    let scene = hollow();
    let mut frame = gpu.frame(&scene, frame::Options { bounces: Bounces::All, lights: Lights::Sharp, ..small() });
    let first = gpu.light(&mut frame, &scene.at(0.0));
    assert!(first[1].iter().flatten().all(|&c| c == 0.0), "the lamp receives nothing");
    frame.forget();
    assert_eq!(gpu.light(&mut frame, &scene.at(0.0)), first);
    assert_eq!(gpu.light(&mut frame, &scene.at(0.0)), first, "at rest nothing changes");
}
