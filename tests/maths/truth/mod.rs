//! Ray casting against closed forms.

mod order;

use crate::common::{generate, parse};
use glam::{DVec3, Vec3};
use shadow_fields::scene::Scene;
use shadow_fields::truth::raycast::{Distant, RayCast, relative_error};
use shadow_fields::truth::{Vertex, World, pixels, receiver_vertices, sample_vertices};

/// A ball of radius 0.5 m, 1 m above a floor of 81 vertices and albedo 0.6.
fn scene(rest: &str) -> Scene {
    parse(&text(rest))
}

fn text(rest: &str) -> String {
    format!(
        "[camera]\neye = [0, 3, 6]\ntarget = [0, 0, 0]\n\
         [[mesh]]\nname = \"floor\"\nplane = {{ size_m = 4, cells = 8 }}\n\
         [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.5, subdivisions = 5 }}\n\
         [[entity]]\nmesh = \"floor\"\nalbedo = [0.6, 0.6, 0.6]\n{rest}"
    )
}

const BALL: &str = "[[entity]]\nmesh = \"ball\"\nposition = [0, 1, 0]\nreceives = false\n";
const SKY: &str = "[environment]\nuniform = [1, 2, 3]\n";

/// A light (mesh `ball` of radius 0.5 m) of a given radius and place.
fn bulb(radius_m: f64, place: [f64; 3]) -> String {
    format!("{}emission = [9, 9, 9]\n", ball(radius_m, place))
}

fn ball(radius_m: f64, place: [f64; 3]) -> String {
    let scale = radius_m / 0.5;
    format!("[[entity]]\nmesh = \"ball\"\nposition = {place:?}\nscale = {scale}\nreceives = false\n")
}

fn floor_positions(scene: &Scene) -> Vec<(Vertex, DVec3)> {
    let place = |v: Vertex| (v, scene.meshes[0].positions[v.index].as_dvec3());
    receiver_vertices(scene).into_iter().filter(|v| v.entity == 0).map(place).collect()
}

/// Share of an even sky's irradiance that a sphere above a level plane takes: sin^2 of its half-angle times the cosine.
fn taken(position: DVec3) -> f64 {
    let to = DVec3::Y - position;
    0.25 / to.length_squared() * to.normalize().y
}

#[test]
fn a_ball_under_a_uniform_sky_takes_its_closed_form() {
    let scene = scene(&format!("{BALL}{SKY}"));
    let mut world = World::of(&scene, &scene.at(0.0));
    let (vertices, positions): (Vec<_>, Vec<_>) = floor_positions(&scene).into_iter().unzip();
    let lit = RayCast::default().run(&world, &vertices);
    for (position, estimate) in positions.iter().zip(&lit) {
        for (channel, radiance) in [1.0, 2.0, 3.0].into_iter().enumerate() {
            let truth = 0.6 * radiance * (1.0 - taken(*position));
            // 0.5 % of what is taken for the tessellation, and five standard errors.
            let tolerance = 0.005 * 0.6 * radiance * taken(*position) + 5.0 * estimate.error[channel];
            assert!((estimate.radiosity[channel] - truth).abs() < tolerance, "{position}: {estimate:?}, {truth}");
        }
    }
    assert!(relative_error(&lit) < 2e-3 && relative_error(&lit) > 1e-6, "{}", relative_error(&lit));
    world.occluders.clear();
    let unoccluded = RayCast::default().run(&world, &vertices);
    // The albedo 0.6 is an f32.
    assert!(unoccluded.iter().all(|e| (e.radiosity[1] - 1.2).abs() < 1e-7), "a uniform sky has no noise");
}

#[test]
fn runs_repeat_and_seeds_differ() {
    let scene = scene(&format!("{BALL}{SKY}"));
    let world = World::of(&scene, &scene.at(0.0));
    let vertices = sample_vertices(&scene, 40, 9);
    assert_eq!(vertices.len(), 40);
    assert_eq!(vertices, sample_vertices(&scene, 40, 9));
    let run = |seed| {
        RayCast { rays: 64, runs: 4, seed, distant: Distant::Bands(4), ..Default::default() }.run(&world, &vertices)
    };
    let text = |lit: &[shadow_fields::truth::Estimate]| format!("{lit:?}");
    assert_eq!(text(&run(3)), text(&run(3)));
    assert_ne!(text(&run(3)), text(&run(4)));
}

#[test]
fn a_ray_meets_the_nearest_side_first() {
    let side = generate::torus_two_colour(0.5, 0.2, 64, 32);
    let shape = shadow_fields::truth::ray_mesh::RayMesh::new(&side);
    // Along x both colours lie behind one another; in units of the bounding radius, 0.7 m.
    for (sign, color) in [(1.0, generate::WARM), (-1.0, generate::COOL)] {
        for height in [0.0, 0.05, 0.15] {
            let origin = Vec3::new(sign * 3.0, height / 0.7, 0.01);
            let direction = Vec3::new(-sign, 0.0, 0.0);
            let found = shape.emission(origin.into(), direction.into()).unwrap();
            assert!(found.distance(color) < 1e-3, "{found} is not {color}");
            let surface = (0.5 + (0.04_f32 - height * height).sqrt()) / 0.7;
            let along = shape.first_hit(origin.into(), direction.into()).unwrap();
            assert!((along - (3.0 - surface)).abs() < 5e-3, "{along}");
        }
    }
    assert!(shape.first_hit(Vec3::new(3.0, 1.0, 0.0).into(), Vec3::NEG_X.into()).is_none());
}

#[test]
fn a_limited_ray_is_blocked_by_what_lies_before_its_end() {
    let mesh = generate::torus_two_colour(0.5, 0.2, 64, 32);
    let shape = shadow_fields::truth::ray_mesh::RayMesh::new(&mesh);
    let mut random = fastrand::Rng::with_seed(5);
    let mut on_sphere = || loop {
        let at = Vec3::from_array(std::array::from_fn(|_| random.f32() * 2.0 - 1.0));
        if at.length() < 1.0 && at.length() > 0.1 {
            break at.normalize();
        }
    };
    let mut met = 0;
    for distance in [1.5, 8.0, 100.0] {
        for _ in 0..400 {
            let (from, to) = (on_sphere() * distance, on_sphere() * 0.6);
            let (origin, direction) = (from.into(), (to - from).normalize().into());
            let blocks = |limit| shape.blocks(origin, direction, limit);
            let Some(first) = shape.first_hit(origin, direction) else {
                assert!(!blocks(f32::INFINITY) && !blocks(1e6), "nothing there: {from} {to}");
                continue;
            };
            met += 1;
            assert!(!blocks(first * (1.0 - 1e-5)) && blocks(first * (1.0 + 1e-5)), "{from} {to}: {first}");
            assert!(blocks(f32::INFINITY) && !blocks(0.0) && !blocks(-1.0), "{from} {to}");
        }
    }
    assert!(met > 300, "{met}");
}

#[test]
fn a_pixel_is_lit_where_its_middle_meets_the_floor() {
    use shadow_fields::draw::camera::clip_from_world;
    let light = bulb(0.2, [0.3, 1.5, 0.4]);
    let scene = scene(&format!("{light}{}", ball(0.3, [-1.0, 0.3, 0.5])));
    let size = [48, 32];
    let cast = RayCast { rays: 64, runs: 1, ..Default::default() };
    let world = World::of(&scene, &scene.at(0.0));
    let points = pixels::lit_points(&world, size);
    let lit = cast.run_at(&world, &points);
    let to_world = clip_from_world(&scene.data.camera, 1.5).inverse();
    let eye = scene.data.camera.eye.as_dvec3();
    let mut near_form = 0;
    for ((key, _), estimate) in points.iter().zip(&lit) {
        let at = [key.index % 48, key.index / 48].map(|i| i as f64 + 0.5);
        let toward = to_world.project_point3(DVec3::new(at[0] / 24.0 - 1.0, at[1] / 16.0 - 1.0, 1.0)) - eye;
        let place = eye - toward * (eye.y / toward.y);
        let to = DVec3::new(0.3, 1.5, 0.4) - place;
        let open = 0.6 * 9.0 * 0.04 / to.length_squared() * to.normalize().y;
        assert!(place.x.abs() < 2.0 && place.z.abs() < 2.0, "the floor alone is lit: {place}");
        assert!(estimate.radiosity[0] <= open * 1.01, "{estimate:?} at {place}, {open}");
        near_form += usize::from((estimate.radiosity[0] / open - 1.0).abs() < 0.01);
    }
    assert!(lit.len() > 300 && near_form > lit.len() * 8 / 10 && near_form < lit.len(), "{near_form} of {}", lit.len());
}

/// A patch that stands on a floor sees half of the sky, also at its rim, which lies within rounding of the floor.
#[test]
fn a_floor_blocks_the_light_from_below() {
    for sunk in [-1e-6, 0.0, 1e-6] {
        let patch = format!(
            "[[mesh]]\nname = \"patch\"\nplane = {{ size_m = 0.02, cells = 2 }}\n[[entity]]\nmesh = \"patch\"\n\
             albedo = [1, 1, 1]\nposition = [0, {}, 0]\nrotation = {{ axis = [0, 0, 1], angle_deg = -90 }}\n",
            0.01 - sunk
        );
        let scene = scene(&format!("{patch}{SKY}"));
        let world = World::of(&scene, &scene.at(0.0));
        let vertices: Vec<Vertex> = (0..9).map(|index| Vertex { entity: 1, index }).collect();
        for (vertex, estimate) in vertices.iter().zip(RayCast::default().run(&world, &vertices)) {
            // The floor ends 2 m away, 0.6 degrees below the horizon.
            let [position, normal] = [world.view(*vertex).position, world.view(*vertex).normal];
            let seen = format!("{vertex:?} at {position}, {normal}, {sunk} m below: {estimate:?}");
            assert!((estimate.radiosity[0] - 0.5).abs() < 0.01, "{seen}");
        }
    }
}

/// A picture by rays through pixels shows what they find, with its hue.
#[test]
fn pictures_by_rays_keep_hues() {
    let text = text(&format!("{BALL}{}{SKY}", bulb(0.3, [1.5, 3.0, 0.5])));
    let scene = parse(&text.replace("[0, 3, 6]", "[0, 5, 0.5]"));
    let world = World::of(&scene, &scene.at(0.0));
    let size = [48, 32];
    let rows = std::cell::Cell::new(0);
    let cast = RayCast { rays: 256, ..Default::default() };
    let picture = pixels::picture(&world, size, false, &cast, &|done| rows.set(done));
    assert_eq!((rows.get(), picture.linear.len()), (size[1], 3 * 48 * 32));
    assert!(picture.error < 0.02, "{}", picture.error);
    for (shown, linear) in picture.shown.chunks_exact(3).zip(picture.linear.chunks_exact(3)) {
        let most = linear.iter().fold(1.0, |most: f32, c| most.max(*c));
        let is_same = |(shown, linear): (&f32, &f32)| (shown - linear / most).abs() < 1e-6;
        assert!(shown.iter().zip(linear).all(is_same), "white is 1, hue kept: {shown:?} of {linear:?}");
    }
}
