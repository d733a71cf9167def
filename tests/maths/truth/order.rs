//! What stands before a light: what a ray meets before the light's surface.

use super::{ball, bulb, floor_positions, scene};
use shadow_fields::truth::{RayCast, Vertex, World, receiver_vertices};

/// Radiosity of the floor below a light of `radius_m` upright at `height_m`: albedo 0.6, radiance 9.
fn below(radius_m: f64, height_m: f64) -> f64 {
    0.6 * 9.0 * (radius_m / height_m).powi(2)
}

/// Radiosity of the floor's middle with entities `rest`.
fn middle(rest: &str) -> f64 {
    let scene = scene(rest);
    let world = World::of(&scene, &scene.at(0.0));
    let (middle, _) = floor_positions(&scene).into_iter().find(|(_, at)| at.length() < 1e-6).unwrap();
    let found = RayCast::default().run(&world, &[middle])[0].radiosity[0];
    assert!(found.is_finite(), "{found} of {rest}");
    found
}

/// Whether two radiosities agree but for the tessellation's 0.3 % and the rays' noise.
fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 5e-3 * expected
}

#[test]
fn an_occluder_between_two_lights_hides_the_farther_one() {
    let (first, second) = (bulb(0.1, [0.0, 1.0, 0.0]), bulb(0.1, [0.0, 3.0, 0.0]));
    let between = ball(0.5, [0.0, 2.0, 0.0]);
    let found = middle(&format!("{first}{second}"));
    assert!(near(found, below(0.1, 1.0) + below(0.1, 3.0)), "lights are transparent for one another: {found}");
    let found = middle(&format!("{first}{between}{second}"));
    assert!(near(found, below(0.1, 1.0)), "{found}");
    // A light that occludes hides what lies behind it, and not itself.
    let solid = first.replace("receives", "occludes = true\nreceives");
    let found = middle(&format!("{solid}{second}"));
    assert!(near(found, below(0.1, 1.0)), "{found}");
}

#[test]
fn what_lies_behind_a_lights_surface_hides_nothing_though_its_centre_is_nearer() {
    let light = bulb(1.0, [0.0, 3.0, 0.0]);
    let found = middle(&format!("{light}{}", ball(0.2, [0.0, 2.5, 0.0])));
    assert!(near(found, below(1.0, 3.0)), "{found}");
    // It counts by the part that a ray meets first: a cap that looks out of the light.
    let found = middle(&format!("{light}{}", ball(0.2, [0.0, 2.0, 0.0])));
    assert!(found > below(1.0, 3.0) - below(0.2, 2.0), "less than its disc: {found}");
    // The circle in which the two spheres meet: 1 and 0.2 m around centres 1 m apart, seen from 2 and 3 m below.
    let along = (1.0 - 0.04 + 1.0) / 2.0;
    let radius_squared = 1.0 - along * along;
    let height = 3.0 - along;
    let cap = 0.6 * 9.0 * radius_squared / (radius_squared + height * height);
    assert!((found - (below(1.0, 3.0) - cap)).abs() < 5e-3 * below(1.0, 3.0), "{found} less {cap}");
}

#[test]
fn a_big_occluder_hides_a_light_though_its_centre_is_farther() {
    let plate = "[[mesh]]\nname = \"plate\"\ncuboid = { size_m = [3, 0.1, 3], cells = 2 }\n";
    let entity = "[[entity]]\nmesh = \"plate\"\nposition = [1.3, 1.6, 0]\nreceives = false\n";
    let light = bulb(0.1, [0.0, 2.0, 0.0]);
    assert_eq!(middle(&format!("{light}{entity}{plate}")), 0.0);
    // The same plate above the light.
    let found = middle(&format!("{light}{}{plate}", entity.replace("1.6", "2.4")));
    assert!(near(found, below(0.1, 2.0)), "{found}");
}

#[test]
fn a_light_in_the_hole_of_a_torus_shines_through_the_hole_alone() {
    let torus = "[[mesh]]\nname = \"torus\"\ntorus = { major_m = 1, minor_m = 0.2, segments = 96, sides = 48 }\n\
        [[entity]]\nmesh = \"torus\"\nposition = [0, 2, 0]\nreceives = false\n";
    // A hair to either side of the torus's centre, and in it.
    for height in [1.99, 2.0, 2.01] {
        let light = bulb(0.1, [0.0, height, 0.0]);
        let found = middle(&format!("{torus}{light}"));
        assert!(near(found, below(0.1, height)), "flat, seen through its hole: {found}");
        let upright = torus.replace("receives", "rotation = { axis = [1, 0, 0], angle_deg = 90 }\nreceives");
        assert_eq!(middle(&format!("{upright}{light}")), 0.0, "on edge, behind its tube");
    }
}

#[test]
fn a_receiver_is_lit_across_its_own_hole_by_a_light_within() {
    let torus = "[[mesh]]\nname = \"torus\"\ntorus = { major_m = 1, minor_m = 0.4, segments = 96, sides = 48 }\n\
        [[entity]]\nmesh = \"torus\"\nposition = [0, 9, 0]\nalbedo = [0.6, 0.6, 0.6]\n";
    let scene = scene(&format!("{torus}{}", bulb(0.1, [0.0, 9.0, 0.0])));
    let world = World::of(&scene, &scene.at(0.0));
    let mesh = &scene.meshes[scene.entities[1].mesh];
    let inner = |v: &Vertex| v.entity == 1 && mesh.positions[v.index].length() < 0.601;
    let vertices: Vec<Vertex> = receiver_vertices(&scene).into_iter().filter(inner).collect();
    assert!(vertices.len() >= 96, "{}", vertices.len());
    for lit in RayCast::default().run(&world, &vertices) {
        assert!(near(lit.radiosity[0], below(0.1, 0.6)), "{lit:?}");
    }
}

#[test]
fn surfaces_that_touch_and_coincide_stay_bounded() {
    let light = bulb(0.5, [0.0, 2.0, 0.0]);
    let open = below(0.5, 2.0);
    for occluder in ["", "rotation = { axis = [1, 2, 3], angle_deg = 40 }\n"] {
        let same = format!("{}{occluder}", ball(0.5, [0.0, 2.0, 0.0]));
        let found = middle(&format!("{light}{same}"));
        // Turned, the facets of one pierce those of the other.
        let expected = if occluder.is_empty() { open } else { found };
        assert!(near(found, expected) && found <= open, "the light's surface is the nearer one: {found}");
    }
    for place in [[0.0, 1.0, 0.0], [0.0, 3.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0]] {
        let touching = ball(0.5, place);
        let found = middle(&format!("{light}{touching}"));
        assert!((0.0..=open * 1.005).contains(&found), "{found} beside {place:?}");
    }
    // A light that touches the floor, and the floor within a light.
    for height in [0.5, 0.3, 0.0] {
        let found = middle(&bulb(0.5, [0.0, height, 0.0]));
        assert!((0.0..=0.6 * 9.0 * 1.001).contains(&found), "{found} at {height}");
    }
}

#[test]
fn a_tiny_light_far_away_has_its_size() {
    // Half angles of 0.05 to 0.5 degrees: 1 146 to 115 radii away.
    for half_angle_deg in [0.05_f64, 0.2, 0.5] {
        let radius = 100.0 * half_angle_deg.to_radians().sin();
        let found = middle(&bulb(radius, [0.0, 100.0, 0.0]));
        assert!(near(found, below(radius, 100.0)), "{half_angle_deg}: {found}, not {}", below(radius, 100.0));
    }
}
