//! What is left out: an unmoved scene merges nothing, a moved one comes to the same bits, small things have a bound.

use crate::common::{gpu, parse};
use crate::stage::{at, difference, jostled, scene, small};
use glam::{Quat, Vec3};
use shadow_fields::asset::Mesh;
use shadow_fields::frame;
use shadow_fields::lists::skip::{Skip, TABLE};
use shadow_fields::scene::{Placement, Scene};
use shadow_fields::truth::{RayCast, Vertex, World};
use std::fmt::Write;

/// Balls and rings on a floor, some of them lights, on a grid with `step_m` between them.
fn town(edge: usize, step_m: f32, lights: usize) -> Scene {
    let size_m = edge as f32 * step_m;
    let mut text = format!(
        "environment = {{ uniform = [0.4, 0.5, 0.6] }}\n\
         [[mesh]]\nname = \"floor\"\nplane = {{ size_m = {size_m}, cells = 63 }}\n\
         [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.3, subdivisions = 1 }}\n\
         [[mesh]]\nname = \"ring\"\ntorus = {{ major_m = 0.3, minor_m = 0.1, segments = 12, sides = 6 }}\n\
         [[entity]]\nmesh = \"floor\"\n"
    );
    for i in 0..edge * edge {
        let (x, z) = ((i % edge) as f32 + 0.37, (i / edge) as f32 + 0.61);
        let (x, z) = (x * step_m - size_m / 2.0, z * step_m - size_m / 2.0);
        let light = i % (edge * edge / lights.max(1)) == 3 && lights > 0;
        let _ = writeln!(
            text,
            "[[entity]]\nmesh = \"{}\"\nposition = [{x}, {}, {z}]\n{}",
            if i % 3 == 0 { "ring" } else { "ball" },
            if light { 1.3 } else { 0.41 },
            if light { "emission = [4, 5, 6]\nscale = 0.3" } else { "" }
        );
    }
    scene(&text)
}

#[test]
fn what_moves_is_merged_again_to_the_same_bits() {
    let Some(gpu) = gpu() else { return };
    let scene = town(8, 4.0, 4);
    for eps in [1e-3, 0.0] {
        let options = frame::Options { eps, ..small() };
        let mut kept = gpu.frame(&scene, options);
        let mut anew = gpu.frame(&scene, frame::Options { skip: Skip::without("unmoved"), ..options });
        let mut placements = scene.at(0.0);
        let mut rng = fastrand::Rng::with_seed(3);
        let (mut merged, mut all) = (0, 0);
        for round in 0..12 {
            // Mostly one of 64 moves, a little or across the town; at times a light, the floor, three at once, or none.
            let movers: Vec<usize> = match round {
                0 | 5 => vec![],
                3 => vec![4],
                7 => vec![0],
                9 => vec![1, 33, 60],
                _ => vec![1 + rng.usize(0..64)],
            };
            for &j in &movers {
                placements[j] = jostled(&placements[j], &mut rng, if round % 2 == 0 { 0.2 } else { 8.0 });
            }
            let found = gpu.light(&mut kept, &placements);
            let expected = gpu.light(&mut anew, &placements);
            assert_eq!(anew.merged().merged_clusters, anew.merged().clusters);
            let bits = |v: &[Vec<[f32; 3]>]| v.iter().flatten().flatten().map(|c| c.to_bits()).collect::<Vec<_>>();
            assert!(bits(&found) == bits(&expected), "round {round}, eps {eps}");
            let now = kept.merged();
            if round > 0 && movers.is_empty() {
                assert_eq!(now.merged_clusters, 0, "nothing has moved");
            }
            if movers.len() == 1 && movers != [0] {
                merged += now.merged_clusters;
                all += now.clusters;
                assert!(now.merged_clusters > 0, "what moved is itself lit anew");
            }
        }
        if eps > 0.0 {
            assert!(3 * merged < all, "{merged} of {all} clusters when one of 64 moves");
        }
    }
}

/// Switches that say they change no number.
#[test]
fn exact_skips_change_nothing() {
    let Some(gpu) = gpu() else { return };
    let scene = town(6, 1.1, 5);
    let placements = scene.at(0.0);
    let mut all = gpu.frame(&scene, small());
    let expected = gpu.light(&mut all, &placements);
    let entries = all.merged().merged_entries;
    let approximate = ["horizon", "cones", "caps", "static"];
    for name in TABLE.iter().map(|row| row.name).filter(|name| !approximate.contains(name)) {
        let mut frame = gpu.frame(&scene, frame::Options { skip: Skip::without(name), ..small() });
        assert_eq!(gpu.light(&mut frame, &placements), expected, "without {name}");
        assert!(name != "behind" || frame.merged().merged_entries > entries);
    }
}

#[test]
fn a_light_of_zeros_is_left_off() {
    let Some(gpu) = gpu() else { return };
    let mut scene = scene(
        "[[mesh]]\nname = \"floor\"\nplane = { size_m = 6, cells = 31 }\n\
         [[mesh]]\nname = \"lamp\"\ncuboid = { size_m = [1, 0.2, 1], cells = 2 }\n\
         [[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"lamp\"\nposition = [0, 2, 0]\nemission = [3, 2, 1]\n",
    );
    let lamp = scene.meshes[1].clone();
    let black = Some(vec![Vec3::ZERO; lamp.positions.len()]);
    let painted = Mesh::new("lamp", lamp.positions.clone(), lamp.normals.clone(), black, lamp.triangles.clone());
    scene.meshes[1] = painted.unwrap().into();
    let mut frame = gpu.frame(&scene, small());
    let light = gpu.light(&mut frame, &scene.at(0.0));
    assert!(light.iter().flatten().flatten().all(|c| *c == 0.0) && frame.merged().merged_entries == 0);
}

/// The one ball that is lit shadows only itself: its field is not baked, and its light is as beside a second receiver.
#[test]
fn what_no_receiver_sees_is_not_baked() {
    let Some(gpu) = gpu() else { return };
    let ball_and_ring = "environment = { uniform = [0.4, 0.5, 0.6] }\n\
         [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.3, subdivisions = 2 }\n\
         [[mesh]]\nname = \"ring\"\ntorus = { major_m = 0.3, minor_m = 0.1, segments = 12, sides = 6 }\n\
         [[entity]]\nmesh = \"ball\"\n[[entity]]\nmesh = \"ring\"\nposition = [0, 0.5, 0]\nreceives = false\n";
    let pair = scene(&format!("{ball_and_ring}{FAR_PATCH}"));
    let scene = scene(ball_and_ring);
    let mut with = gpu.frame(&scene, small());
    let mut seen = gpu.frame(&pair, small());
    let alone = gpu.light(&mut with, &scene.at(0.0));
    let beside = gpu.light(&mut seen, &pair.at(0.0));
    assert_eq!(alone[0], beside[0]);
    let bytes = [&with, &seen].map(|frame| frame.buffers.fields.size_bytes);
    assert_eq!(2 * bytes[0], bytes[1], "one field of two alike is baked");
}

/// A patch that is lit and casts no shadow.
const FAR_PATCH: &str = "[[mesh]]\nname = \"patch\"\nplane = { size_m = 1, cells = 2 }\n\
     [[entity]]\nmesh = \"patch\"\nposition = [0, -50, 0]\noccludes = false\n";

/// One cluster in a wide town: by rays and in the merge, what dropped occluders and lights change is within the bound.
#[test]
fn what_is_dropped_stays_within_its_bound() {
    let Some(gpu) = gpu() else { return };
    let mut town = town(14, 1.5, 7);
    let mut patch = town.data.clone();
    // A small patch of floor: one cluster, so that one list holds for all its vertices.
    patch.meshes.retain(|mesh| mesh.name != "floor");
    let plane = scene("[[mesh]]\nname = \"floor\"\nplane = { size_m = 0.4, cells = 6 }\n").data.meshes.remove(0);
    patch.meshes.insert(0, plane);
    for entity in &mut patch.entities[1..] {
        entity.receives = Some(false);
    }
    town = parse(&patch.to_toml().unwrap());
    let placements = town.at(0.0);
    let mut full = gpu.frame(&town, small());
    let exact = gpu.light(&mut full, &placements);
    let all = full.listed(&placements, 0);
    let vertices: Vec<Vertex> = (0..exact[0].len()).map(|index| Vertex { entity: 0, index }).collect();
    let cast = RayCast { rays: 1 << 13, ..Default::default() };
    let truth = cast.run(&World::of(&town, &placements), &vertices);
    for eps in [1e-3, 5e-3, 2e-2] {
        let mut frame = gpu.frame(&town, frame::Options { eps, ..small() });
        let light = gpu.light(&mut frame, &placements);
        let (worst, brightest) = difference(&light[0], &exact[0]);
        // The same town without what the list leaves out, by rays.
        let listed = frame.listed(&placements, 0);
        let mut bare = town.clone();
        for (j, entity) in bare.entities.iter_mut().enumerate().skip(1) {
            entity.occludes &= listed.contains(&j);
            entity.emits &= listed.contains(&j);
        }
        let without = cast.run(&World::of(&bare, &placements), &vertices);
        let pairs = truth.iter().zip(&without);
        let by_rays = pairs
            .flat_map(|(a, b)| (0..3).map(move |c| (a.radiosity[c] - b.radiosity[c]).abs()))
            .fold(0.0_f64, f64::max);
        // Each that is left out takes or brings less than eps.
        let left_out = all.len() - listed.len();
        let bound = f64::from(eps) * left_out as f64;
        assert!(left_out > 0 && f64::from(worst) <= bound, "{worst} of {bound}");
        // Rays have noise: a hundredth of what they measure.
        assert!(by_rays <= bound + 0.01 * f64::from(brightest), "{by_rays} of {bound}");
    }
}

/// Things go away, turning, through the sizes at which caps stand for fields: light goes on as smoothly as by fields.
#[test]
fn nothing_pops_as_fields_become_caps() {
    let Some(gpu) = gpu() else { return };
    for shape in [
        "sphere = { radius_m = 0.5, subdivisions = 2 }",
        "torus = { major_m = 0.35, minor_m = 0.15, segments = 16, sides = 8 }",
        "cuboid = { size_m = [0.7, 0.5, 0.4], cells = 1 }",
    ] {
        let scene = scene(&format!(
            "environment = {{ gradient = {{ radiance = [1, 1, 1] }} }}\n[[mesh]]\nname = \"floor\"\nplane = {{ size_m = 1, cells = 7 }}\n\
             [[mesh]]\nname = \"thing\"\n{shape}\n[[mesh]]\nname = \"bulb\"\nsphere = {{ radius_m = 0.5, subdivisions = 2 }}\n\
             [[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"thing\"\n[[entity]]\nmesh = \"bulb\"\nemission = [9, 9, 9]\n",
        ));
        // Fine enough that what a lookup is off by does not hide what caps change.
        let bake = shadow_fields::bake::Options { face_px: 32, lattice: "cube:12x7".parse().unwrap(), ..small().bake };
        let options = frame::Options { bake, ..small() };
        let mut caps = gpu.frame(&scene, options);
        let mut fields = gpu.frame(&scene, frame::Options { skip: Skip::without("caps"), ..options });
        let mut walk = Vec::new();
        let mut apart = 0.0_f32;
        let mut brightest = 0.0;
        let mut kinds = std::collections::BTreeSet::new();
        for i in 0..100 {
            let d = 1.0 + 0.03 * i as f32;
            let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.02 * i as f32);
            let thing = Placement { rotation: turn, ..at(0.8 * d, 0.6 * d, 0.2) };
            let placements = [at(0.0, 0.0, 0.0), thing, at(5.0, 4.0, 0.5)];
            let by_caps = gpu.light(&mut caps, &placements).swap_remove(0);
            let by_fields = gpu.light(&mut fields, &placements).swap_remove(0);
            let (far, bright) = difference(&by_caps, &by_fields);
            (apart, brightest) = (apart.max(far), bright);
            kinds.insert(caps.merged().merged_entries);
            walk.push([by_caps, by_fields]);
        }
        // What a step changes in how far the two are apart, less what the one before it did, of any vertex: a pop is as
        // large as they are apart, what is smooth over the range of sizes a small part of it.
        let apart_at = |step: &[Vec<[f32; 3]>; 2], v: usize| step[0][v][0] - step[1][v][0];
        let kink = walk
            .windows(3)
            .flat_map(|w| (0..64).map(move |v| apart_at(&w[0], v) - 2.0 * apart_at(&w[1], v) + apart_at(&w[2], v)))
            .fold(0.0_f32, |most, kink| most.max(kink.abs()));
        assert!(kinds.len() > 1, "by the field, by both, and by the cap alone: {kinds:?}");
        assert!(apart > 1e-5 && apart < 0.01 * brightest, "{shape}: {apart} of {brightest}");
        assert!(kink < 0.3 * apart, "{shape}: {kink} of {apart}");
    }
}

#[test]
fn nothing_pops_by_more_than_eps() {
    let Some(gpu) = gpu() else { return };
    let scene = scene(
        "environment = { uniform = [1, 1, 1] }\n[[mesh]]\nname = \"floor\"\nplane = { size_m = 1, cells = 7 }\n\
         [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 2 }\n[[entity]]\nmesh = \"floor\"\n[[entity]]\nmesh = \"ball\"\n",
    );
    let eps = 4e-3;
    let mut frame = gpu.frame(&scene, frame::Options { eps, ..small() });
    let (mut before, mut largest, mut dropped): (Option<Vec<[f32; 3]>>, f32, bool) = (None, 0.0, false);
    for i in 0..120 {
        let placements = [at(0.0, 0.0, 0.0), at(4.0 + 0.02 * i as f32, 1.0, 0.3)];
        let light = gpu.light(&mut frame, &placements).swap_remove(0);
        dropped |= !frame.listed(&placements, 0).contains(&1);
        if let Some(before) = before.replace(light.clone()) {
            largest = largest.max(difference(&light, &before).0);
        }
    }
    assert!(dropped && largest <= eps, "{largest}");
    assert!(largest > eps / 5.0, "the step is seen at all: {largest}");
}
