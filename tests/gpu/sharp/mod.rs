//! Sharp lights: the pass against its twin, and scenes against rays that stop at a light's surface.

mod change;

use crate::common::{Gpu, gpu, parse};
use crate::stage::against_rays;
use shadow_fields::check::sharp as check;
use shadow_fields::draw::{Antialias, Shading};
use shadow_fields::frame::{self};
use shadow_fields::lists::skip::Skip;
use shadow_fields::scene::{Lights, Scene};
use shadow_fields::truth::{RayCast, World, sample_vertices};

/// Relative root mean square error of the light on vertices against rays.
fn error(gpu: &Gpu, scene: &Scene, options: frame::Options, rays: u32) -> f64 {
    let light = gpu.lit(scene, options);
    let vertices = sample_vertices(scene, 800, 3);
    let cast = RayCast { rays, runs: 2, ..Default::default() };
    against_rays(&light, &vertices, &cast.run(&World::of(scene, &scene.at(0.0)), &vertices))
}

const HEAD: &str = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0.5, 0]\n\
    [[mesh]]\nname = \"floor\"\nplane = { size_m = 6, cells = 60 }\n\
    [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 4 }\n\
    [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.7, minor_m = 0.25, segments = 48, sides = 24 }\n\
    [[entity]]\nmesh = \"floor\"\n";

const LAMPS: &str = "[[mesh]]\nname = \"disc\"\ndisc = { radius_m = 0.3 }\n\
    [[mesh]]\nname = \"window\"\nrectangle = { size_m = [0.4, 0.6] }\n\
    [[mesh]]\nname = \"quad\"\nplane = { size_m = 0.5, cells = 1 }\n\
    [[mesh]]\nname = \"strip\"\nrectangle = { size_m = [1.6, 0.2] }\n\
    [[mesh]]\nname = \"tube\"\ncuboid = { size_m = [0.07, 0.05, 1.6], cells = 1 }\n\
    [[mesh]]\nname = \"two\"\ntorus_two_colour = { major_m = 0.6, minor_m = 0.2, segments = 48, sides = 24 }\n";
const UP: &str = "rotation = { axis = [0.3, 0, 1], angle_deg = -30 }\nemission = [60, 50, 40]\nreceives = false";
const DOWN: &str = "rotation = { axis = [0.3, 0, 1], angle_deg = 150 }\nemission = [60, 50, 40]\nreceives = false";

const BALL_UNDER_BULB: &str = "[[entity]]\nmesh = \"ball\"\nposition = [0, 0.6, 0]\n\
    [[entity]]\nmesh = \"ball\"\nposition = [1.2, 2.6, 0.8]\nscale = 0.1\nemission = [900, 900, 900]\n";

fn entity(mesh: &str, place: [f64; 3], rest: &str) -> String {
    format!("[[entity]]\nmesh = \"{mesh}\"\nposition = {place:?}\n{rest}\n")
}

/// A scene, and what sharp lights may err by in it at most.
fn scenes() -> Vec<(&'static str, Scene, f64)> {
    let bulb = |place, scale: f64, radiance: f64| {
        entity("ball", place, &format!("scale = {scale}\nemission = [{radiance}, {radiance}, {radiance}]"))
    };
    let ball = entity("ball", [0.0, 0.6, 0.0], "");
    let ring = entity("ring", [0.0, 0.9, 0.0], "rotation = { axis = [1, 0.2, 0.1], angle_deg = 65 }");
    let around = entity("ring", [0.0, 0.9, 0.0], "");
    let lamp = |mesh, place, rest| format!("{LAMPS}{ball}{}", entity(mesh, place, rest));
    let glow = "rotation = { axis = [1, 0, 0.3], angle_deg = 20 }\nemission = [9, 9, 9]";
    let two_bulbs = bulb([2.2, 0.9, 0.1], 0.2, 90.0) + &bulb([-2.2, 0.9, 0.1], 0.2, 90.0);
    let sun = "[environment]\nsun = { toward = [1, 1.4, 0.5], angle_deg = 3, radiance = [900, 800, 700] }\n";
    let rows = [
        ("a ball", ball.clone() + &bulb([1.2, 2.6, 0.8], 0.3, 90.0), 0.02),
        ("a ring", ring + &bulb([1.2, 2.6, 0.8], 0.3, 90.0), 0.035),
        ("an occluder between two lights", ball.clone() + &two_bulbs, 0.03),
        ("a light in a ring's hole", around + &bulb([0.0, 0.9, 0.0], 0.2, 60.0), 0.02),
        ("a sun", ball.clone() + sun, 0.01),
        ("a disc", lamp("disc", [1.2, 2.4, 0.8], DOWN), 0.02),
        ("a wide disc", lamp("disc", [1.0, 1.5, 0.4], DOWN), 0.02),
        ("a rectangle", lamp("window", [1.2, 2.4, 0.8], DOWN), 0.02),
        ("a quad from its front", lamp("quad", [1.2, 2.4, 0.8], DOWN), 0.02),
        ("a quad from its back", lamp("quad", [1.2, 2.4, 0.8], UP), 0.02),
        ("a strip", lamp("strip", [0.9, 2.1, 0.2], DOWN), 0.03),
        // A box is up to a tenth narrower or wider than the mean of its widths.
        ("a tube", lamp("tube", [0.9, 1.3, 0.2], DOWN), 0.09),
        ("a ring of two colours", lamp("two", [1.1, 1.5, 0.4], DOWN), 0.07),
        ("a ring that glows", lamp("ring", [0.9, 2.4, 0.4], glow), 0.035),
    ];
    rows.into_iter().map(|(name, rest, limit)| (name, parse(&format!("{HEAD}{rest}")), limit)).collect()
}

/// Options whose errors the tests below bound, with faces of few pixels.
fn options() -> frame::Options {
    let base = check::sharp_options();
    let bake = shadow_fields::bake::Options { silhouette: Default::default(), face_px: 32, ..base.bake };
    frame::Options { bake, ..base }
}

#[test]
fn scenes_are_lit_as_by_rays() {
    let Some(gpu) = gpu() else { return };
    let sharp = options();
    for (name, scene, limit) in scenes() {
        // Few of the rays into its bounding sphere meet a lamp that is long and thin.
        let rays = if ["a strip", "a tube"].contains(&name) { 8192 } else { 1024 };
        let found = error(&gpu, &scene, sharp, rays);
        let harmonics = error(&gpu, &scene, frame::Options { lights: Lights::Sh, ..sharp }, 256);
        assert!(found < limit.min(harmonics), "{name}: {found}, in spherical harmonics {harmonics}");
    }
}

/// A ball under a lamp that shines down on it: in a cone, if one is named.
fn under_a_spot(spot: &str) -> String {
    format!(
        "[[entity]]\nmesh = \"ball\"\nposition = [0, 0.6, 0]\n[[entity]]\nmesh = \"ball\"\nposition = [1.2, 2.6, 0.8]\n\
        rotation = {{ axis = [0.4, 0, 1], angle_deg = 155 }}\nscale = 0.1\nemission = [900, 800, 700]\n{spot}"
    )
}

/// Spots of any fade are as near to rays as the lamp without a cone, also where all other lights are in harmonics.
#[test]
fn spots_are_lit_as_by_rays() {
    let Some(gpu) = gpu() else { return };
    let sharp = options();
    for (name, spot) in [
        ("no spot", ""),
        ("a spot of 15 to 40 degrees", "spot = { inner_deg = 15, outer_deg = 40 }"),
        ("a spot of 0 to 20 degrees", "spot = { outer_deg = 20 }"),
        ("a spot of 30 degrees without a fade", "spot = { inner_deg = 30, outer_deg = 30 }"),
        ("a spot of 90 degrees", "spot = { inner_deg = 45, outer_deg = 90 }"),
    ] {
        let scene = parse(&format!("{HEAD}{}", under_a_spot(spot)));
        let found = error(&gpu, &scene, sharp, 1024);
        assert!(found < 0.03, "{name}: {found}");
        if !spot.is_empty() {
            let harmonics = error(&gpu, &scene, frame::Options { lights: Lights::Sh, ..sharp }, 1024);
            assert_eq!(harmonics, found, "{name}");
        }
    }
}

/// A picture of a scene, linear RGB, and how many of its pixels evaluated lights, if pixels do.
fn picture(gpu: &Gpu, scene: &Scene, shading: Shading) -> (Vec<f32>, Option<u32>) {
    let options = frame::Options {
        shading: Some(shading),
        size: [160, 120],
        antialias: Antialias::None,
        ..check::sharp_options()
    };
    let mut frame = gpu.frame(scene, options);
    let timings = frame.render(&scene.at(0.0), Some(4.0)).unwrap();
    (frame.picture(), timings.iter().find_map(|timing| timing.counted))
}

/// On coarse floors and slabs pixels show what vertices of a fine floor do and their own do not: rims of shadows and
/// spots, lamps and occluders apart, a lamp that is near.
#[test]
fn pixels_carry_edges_that_vertices_do_not() {
    let Some(gpu) = gpu() else { return };
    let rim = under_a_spot("spot = { inner_deg = 19, outer_deg = 20 }");
    let lamp = |place| entity("ball", place, "scale = 0.1\nemission = [600, 600, 600]");
    let wall = [
        "[[mesh]]\nname = \"wall\"\nplane = { size_m = 1, cells = 1 }\n",
        &entity("wall", [0.9, 0.5, 0.0], "rotation = { axis = [0, 0, 1], angle_deg = 80 }\nreceives = false"),
        &entity("ball", [-0.8, 0.6, 0.0], ""),
        &lamp([-2.0, 2.4, 0.9]),
        &lamp([2.2, 1.9, 0.7]),
    ]
    .concat();
    let near = "[[mesh]]\nname = \"lamp\"\nplane = { size_m = 0.5, cells = 1 }\n\
        [[entity]]\nmesh = \"lamp\"\nposition = [0.3, 0.4, 0.2]\nemission = [5, 5, 5]\nreceives = false\n";
    let ring = (0..7).map(|i| (0.9 * f64::from(i)).sin_cos());
    let ring: String = ring.map(|(x, z)| lamp([2.0 * x, 2.4, 2.0 * z])).collect();
    let ring = ring + &entity("ball", [0.0, 0.6, 0.0], "");
    let sun = "[environment]\nsun = { toward = [1, 0.15, 0.2], angle_deg = 0.02, radiance = [2e7, 2e7, 2e7] }\n";
    let low_sun = format!("{BALL_UNDER_BULB}{sun}");
    let plane = "plane = { size_m = 6";
    let slab = "cuboid = { size_m = [6, 0.0001, 6]";
    for (name, rest, receiver, cells, share, least) in [
        ("a spot", rim.as_str(), plane, 12, 0.2, 0.004),
        ("a bulb", BALL_UNDER_BULB, plane, 12, 0.2, 0.004),
        ("a bulb on a slab", BALL_UNDER_BULB, slab, 12, 0.2, 0.004),
        ("two lamps and a wall", &wall, plane, 12, 0.2, 0.004),
        ("seven lamps around a ball", &ring, plane, 12, 0.3, 0.004),
        ("a bulb beside a faint sun that is low", &low_sun, plane, 12, 0.2, 0.004),
        ("a lamp that is near", near, plane, 8, 0.1, 0.01),
    ] {
        let show = |receiver: &str, cells: usize, shading| {
            let head = HEAD.replace("plane = { size_m = 6, cells = 60", &format!("{receiver}, cells = {cells}"));
            picture(&gpu, &parse(&format!("{head}{rest}")), shading).0
        };
        let fine = show(plane, 300, Shading::Vertex);
        let [pixels, vertices] = [Shading::Pixel, Shading::Vertex].map(|shading| {
            let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
            (show(receiver, cells, shading).iter().zip(&fine).map(square).sum::<f64>() / fine.len() as f64).sqrt()
        });
        assert!(pixels < share * vertices && vertices > least, "{name}: {pixels} and {vertices}");
    }
}

/// Pixels at the edge of a small light's shadow evaluate it, but not where a bright sky drowns it.
#[test]
fn faint_edges_are_left_to_vertices() {
    let Some(gpu) = gpu() else { return };
    let evaluated = |flood: &str| {
        let scene = parse(&format!("{HEAD}{BALL_UNDER_BULB}{flood}"));
        picture(&gpu, &scene, Shading::Pixel).1
    };
    let alone = evaluated("").unwrap();
    let drowned = evaluated("[environment]\nuniform = [500, 500, 500]\n").unwrap();
    assert!(alone > 300 && drowned < alone / 10, "{alone} and {drowned}");
}

/// Where nothing blocks a light, pixels of a mesh that shadows itself blend what its vertices see, as vertices do: a
/// speck that hangs before a coarse ring has its pixels evaluate a sun, and only those that it shades differ. Light that is
/// interpolated between every fourth pixel smooths the kinks between triangles of ten, which takes 0.012 of 0.15 at most.
#[test]
fn pixels_that_nothing_shades_look_as_vertices_show_them() {
    let Some(gpu) = gpu() else { return };
    let scene = parse(
        "[camera]\neye = [0, 1.5, 3]\ntarget = [0, 0, 0]\n\
        [environment]\nsun = { toward = [0.6, 1, 0.8], angle_deg = 6, radiance = [90, 80, 70] }\n\
        [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.9, minor_m = 0.3, segments = 12, sides = 8 }\n\
        [[mesh]]\nname = \"speck\"\nsphere = { radius_m = 0.04, subdivisions = 1 }\n\
        [[entity]]\nmesh = \"ring\"\nrotation = { axis = [1, 0, 0], angle_deg = 50 }\n\
        [[entity]]\nmesh = \"speck\"\nposition = [1.26, 0.6, 0.48]\nreceives = false\n",
    );
    let [(vertices, none), (pixels, evaluated)] =
        [Shading::Vertex, Shading::Pixel].map(|shading| picture(&gpu, &scene, shading));
    let differ = |(a, b): &(&[f32], &[f32])| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 0.015);
    let differing = vertices.chunks_exact(3).zip(pixels.chunks_exact(3)).filter(differ).count() as u32;
    assert_eq!(none, None);
    let few = evaluated.is_some_and(|evaluated| evaluated > 300 && differing < evaluated / 10);
    assert!(few, "{evaluated:?} pixels evaluate the sun, {differing} differ");
    assert!(differing > 0, "the speck shades nothing");
}

/// Of many clusters all rays pass a ring's hole or miss it, and in the middle of its shadow a ball covers the light.
#[test]
fn what_outlines_leave_off_lists_changes_nothing() {
    let Some(gpu) = gpu() else { return };
    let [ball, ring] = [0, 1].map(|i| scenes().swap_remove(i).1);
    let fine = parse(&HEAD.replace("cells = 60", "cells = 200"));
    let mut small_clusters = ball.clone();
    small_clusters.meshes[0] = fine.meshes[0].clone();
    for (scene, name) in [(ring, "passed"), (small_clusters, "covered")] {
        let placements = scene.at(0.0);
        let lit = |skip| {
            let options = frame::Options { skip, ..check::sharp_options() };
            let mut frame = gpu.frame(&scene, options);
            frame.render(&placements, None).unwrap();
            (frame.merged().merged_entries, frame.radiosity(0).unwrap())
        };
        let (listed, light) = lit(Skip::ALL);
        let (without, kept) = lit(Skip::without(name));
        assert!(listed < without, "{name}: {listed} entries, {without} without the skip");
        assert!(light == kept, "{name}: what is left off blocks exactly nothing or everything");
    }
}

/// Under several lights points leave out what stands outside a light's cone, under one they do not: lights of all forms
/// add up, and a light that reaches nothing changes no pixel.
#[test]
fn lights_add_up_where_points_leave_out_what_stands_beside() {
    let Some(gpu) = gpu() else { return };
    let lamp = "receives = false\noccludes = false\nemission";
    let at = |height_m: f64| {
        parse(&format!(
            "{HEAD}{LAMPS}[[entity]]\nmesh = \"ring\"\nposition = [-0.6, 0.9, 0]\nrotation = {{ axis = [1, 0, 0], angle_deg = 60 }}\n\
        [[entity]]\nmesh = \"ball\"\nposition = [0.9, 0.5, 0.4]\n\
        [[entity]]\nmesh = \"ball\"\nposition = [1.2, 3.2, 0.8]\nscale = 0.2\n{lamp} = [200, 100, 100]\n\
        [[entity]]\nmesh = \"ball\"\nposition = [-1.6, {height_m}, 0]\nscale = 0.9\n{lamp} = [9, 20, 9]\n\
        [[entity]]\nmesh = \"tube\"\nposition = [0, 3, -1]\nrotation = {{ axis = [1, 0, 0], angle_deg = 170 }}\n{lamp} = [30, 30, 60]\n\
        [[entity]]\nmesh = \"ring\"\nposition = [0, 3.5, 1]\nscale = 0.5\n{lamp} = [20, 20, 20]\n"
        ))
    };
    let scene = at(3.0);
    let lights: Vec<usize> = (0..scene.entities.len()).filter(|&j| scene.entities[j].emits).collect();
    let under = |shining: &[usize]| {
        let mut lit = scene.clone();
        lights.iter().for_each(|&j| lit.entities[j].emits = shining.contains(&j));
        gpu.lit(&lit, check::sharp_options())[..3].concat().concat()
    };
    let all = under(&lights);
    let mut sum = vec![0.0; all.len()];
    for light in &lights {
        sum.iter_mut().zip(under(&[*light])).for_each(|(sum, of)| *sum += of);
    }
    let brightest = all.iter().copied().fold(0.0, f32::max);
    let apart = all.iter().zip(&sum).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / brightest;
    assert!(lights.len() == 4 && apart < 2e-6, "{apart}");

    // A lamp below the floor, which alone is lit here.
    let mut two = at(-3.0);
    lights[2..].iter().for_each(|&j| two.entities[j].emits = false);
    two.entities[1..].iter_mut().for_each(|entity| entity.receives = false);
    let mut one = two.clone();
    one.entities[lights[1]].emits = false;
    let [one, two] = [one, two].map(|scene| picture(&gpu, &scene, Shading::Pixel));
    assert!(one.1.is_some_and(|evaluated| evaluated > 200), "{:?}", one.1);
    // Pictures are half floats.
    let differs = |(a, b): (&f32, &f32)| (a - b).abs() > 0.0011 * a.max(*b);
    let differing: Vec<_> = one.0.iter().zip(&two.0).filter(|pair| differs(*pair)).collect();
    assert!(differing.is_empty(), "{differing:?}");
}

/// A sun on a bare floor, against its closed form: radiance * sin^2(a / 2) * cosine of a white surface.
#[test]
fn a_sun_lights_as_its_closed_form() {
    let Some(gpu) = gpu() else { return };
    for (angle_deg, toward) in
        [(0.01, [0.0, 1.0, 0.0]), (0.53, [1.0, 1.0, 0.0]), (3.0, [0.0, 1.0, -2.0]), (40.0, [0.0, 1.0, 0.0])]
    {
        let scene = parse(&format!(
            "{HEAD}albedo = [1, 1, 1]\n[environment]\nsun = {{ toward = {toward:?}, angle_deg = {angle_deg:?}, radiance = [4, 2, 1] }}\n"
        ));
        let light = gpu.lit(&scene, check::sharp_options()).swap_remove(0);
        let [x, y, z] = toward;
        let cosine = y / f64::sqrt(x * x + y * y + z * z);
        let wanted = 4.0 * (f64::to_radians(angle_deg) / 2.0).sin().powi(2) * cosine;
        for [red, green, blue] in light.into_iter().map(|rgb| rgb.map(f64::from)) {
            assert!((red / wanted - 1.0).abs() < 2e-3, "{angle_deg} degrees: {red} for {wanted}");
            assert!((red - 2.0 * green).abs() < 1e-5 * red && (red - 4.0 * blue).abs() < 1e-5 * red);
        }
    }
}
