//! The order of a chain where distances are nearly equal: which occluders lie before a light is decided vertex by
//! vertex, though a cluster has one list; among occluders there is one order for a whole receiver, by the distance from
//! its centre in f32, ties by index, and what that differs from an order of each vertex's own is bounded here.

use crate::common::{Gpu, gpu};
use crate::stage::{difference, scene, small};
use glam::Vec3;
use shadow_fields::check::merge::{ARITHMETIC, against_twin};
use shadow_fields::scene::Scene;
use std::collections::BTreeSet;

/// A patch of one cluster below a light, and below it an occluder on either side, both about as far from the patch as
/// the light.
fn patch(occluders: &[[f64; 3]]) -> Scene {
    let mut text = "environment = { gradient = { radiance = [0.4, 0.5, 0.6] } }\n\
        [[mesh]]\nname = \"patch\"\nplane = { size_m = 0.28, cells = 7 }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.3, subdivisions = 2 }\n[[entity]]\nmesh = \"patch\"\n\
        [[entity]]\nmesh = \"ball\"\nposition = [0, 1, 0]\nemission = [9, 7, 5]\nreceives = false\n"
        .to_owned();
    for [x, y, z] in occluders {
        text += &format!("[[entity]]\nmesh = \"ball\"\nposition = [{x}, {y}, {z}]\nreceives = false\n");
    }
    scene(&text)
}

const A: [f64; 3] = [-0.3, 0.94, 0.0];
const B: [f64; 3] = [0.3, 0.94, 0.0];

/// The orders in which vertices of the patch have the other entities by their own distances, light included.
fn orders(scene: &Scene) -> BTreeSet<Vec<usize>> {
    let placements = scene.at(0.0);
    let order = |vertex: &Vec3| {
        let mut others: Vec<usize> = (1..placements.len()).collect();
        others.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|j| placements[j].position.distance(*vertex));
            a.total_cmp(&b)
        });
        others
    };
    scene.meshes[0].positions.iter().map(order).collect()
}

/// Light on the patch, which is that of the twin.
fn lit(gpu: &Gpu, scene: &Scene) -> Vec<[f32; 3]> {
    let mut frame = gpu.frame(scene, small());
    let off = against_twin(&mut frame, &scene.at(0.0)).unwrap();
    assert!(off < ARITHMETIC, "{off:e}");
    let light = frame.radiosity(0).unwrap();
    assert_eq!((light.len(), frame.merged().clusters), (64, 1), "one cluster, one list");
    light
}

/// One occluder that is nearer than the light to some vertices of a cluster and farther than it from others: each
/// vertex is right.
#[test]
fn before_or_behind_a_light_is_decided_by_the_vertex() {
    let Some(gpu) = gpu() else { return };
    let open = lit(&gpu, &patch(&[]));
    for place in [A, B, [0.02, 0.9995, 0.3], [-0.1, 0.995, 0.0]] {
        let scene = patch(&[place]);
        assert_eq!(orders(&scene).len(), 2, "{place:?}: before the light for some, behind it for others");
        let (apart, brightest) = difference(&lit(&gpu, &scene), &open);
        assert!(apart > 0.01 * brightest, "the occluder counts at all");
    }
}

/// Two occluders on either side of the light, equally far from the patch's centre: all six orders but two are met
/// within the one cluster. Which of them lie before the light is right at each vertex; their products stand in one
/// order, by index. A hair nearer, the second comes first; and nobody sees it, so that an order of each vertex's own
/// would not be seen either.
#[test]
fn two_occluders_about_as_far_as_a_light() {
    let Some(gpu) = gpu() else { return };
    let tie = patch(&[A, B]);
    assert!(orders(&tie).len() >= 4, "{:?}", orders(&tie));
    let [first, second] = [tie, patch(&[A, [B[0], B[1] - 1e-6, B[2]]])].map(|scene| lit(&gpu, &scene));
    let (step, brightest) = difference(&second, &first);
    // Products truncated to four bands do not quite commute.
    assert!(step < 2e-3 * brightest, "{step} of {brightest}");
    assert!(f64::from(step) > 2.0 * ARITHMETIC * f64::from(brightest), "the order can be told apart: {step:e}");
}
