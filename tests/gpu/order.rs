//! The order of a chain where distances are nearly equal: which occluders lie before a light is decided vertex by
//! vertex, though a cluster has one list; among occluders there is one order for a whole receiver, by the distance from
//! its centre in f32, ties by index, and what that differs from an order of each vertex's own is bounded here.

use crate::common::{Gpu, gpu};
use crate::stage::{difference, scene, small};
use glam::DVec3;
use shadow_fields::check::merge::ARITHMETIC;
use shadow_fields::field::ShadowField;
use shadow_fields::frame::Frame;
use shadow_fields::lists::gather::{EntityBounds, SceneBounds};
use shadow_fields::lists::skip::Skip;
use shadow_fields::merge::twin::{MergeObject, MergeTwin};
use shadow_fields::scene::Scene;
use std::collections::BTreeMap;

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
const LIGHT: usize = 1;

/// Puts occluders into an order, given the distance of each.
type Sort<'s> = dyn Fn(&dyn Fn(usize) -> f64, &mut [usize]) + 's;

/// Light on the patch by the twin, vertex by vertex, the occluders of each in the order that `sorted` gives them; and
/// how many vertices have which entities, light included, in which order by their own distances.
fn by_vertex(frame: &Frame, sorted: &Sort<'_>) -> (Vec<[f64; 3]>, BTreeMap<Vec<usize>, usize>) {
    let scene = frame.scene();
    let placements = scene.at(0.0);
    let fields: Vec<Option<ShadowField>> = frame
        .buffers
        .meshes
        .iter()
        .map(|g| g.blocked.as_ref().map(|slot| frame.buffers.field(slot).unwrap()))
        .collect();
    let object = |(entity, place): (&shadow_fields::scene::Entity, &shadow_fields::scene::Placement)| {
        let device_mesh = &frame.buffers.meshes[entity.mesh];
        let rotation = place.turn();
        let scale = f64::from(place.scale);
        MergeObject {
            centre: place.position.as_dvec3() + rotation * (device_mesh.centre_m * scale),
            rotation,
            scale,
            radius_m: device_mesh.radius_m * scale,
            albedo_over_pi: (entity.albedo.as_dvec3() / std::f64::consts::PI).to_array(),
            emission: entity.emission.as_dvec3().to_array(),
            blocked: fields[entity.mesh].as_ref(),
            area: device_mesh.blocked.as_ref().map_or(Default::default(), |slot| slot.area),
            radiance: None,
            opacity: 1.0,
            sheet: None,
        }
    };
    let objects: Vec<MergeObject<'_>> = scene.entities.iter().zip(&placements).map(object).collect();
    let sky = scene.environment.coefficients(4);
    let mesh = &scene.meshes[0];
    let mut out = Vec::new();
    let mut orders = BTreeMap::new();
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let (position, normal) = (position.as_dvec3() - frame.buffers.meshes[0].centre_m, normal.as_dvec3());
        let distance = |j: usize| objects[j].centre.distance(objects[0].centre + position);
        let mut all: Vec<usize> = (1..objects.len()).collect();
        all.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
        *orders.entry(all).or_default() += 1;
        let mut occluders: Vec<usize> = (2..objects.len()).collect();
        sorted(&distance, &mut occluders);
        let twin = MergeTwin {
            objects: &objects,
            receiver: 0,
            occluders: &occluders,
            lights: &[LIGHT],
            sky: Some(&sky),
            volume: None,
            positions: &[position],
            normals: &[normal],
            transfer: None,
            bands: 4,
            skip: small().skip,
            leaves: &|_, _, _| false,
        };
        out.extend(twin.run());
    }
    (out, orders)
}

/// Near to far from each vertex, ties by index.
fn own(distance: &dyn Fn(usize) -> f64, occluders: &mut [usize]) {
    occluders.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
}

/// Largest difference, as a share of the brightest.
fn apart(found: &[[f32; 3]], expected: &[[f64; 3]]) -> f64 {
    let pairs = || found.iter().flatten().map(|f| f64::from(*f)).zip(expected.iter().flatten().copied());
    pairs().map(|(f, e)| (f - e).abs()).fold(0.0, f64::max) / pairs().map(|(_, e)| e).fold(0.0, f64::max)
}

fn lit(gpu: &Gpu, occluders: &[[f64; 3]]) -> (Frame, Vec<[f32; 3]>) {
    let scene = patch(occluders);
    let mut frame = gpu.frame(&scene, small());
    let light = gpu.light(&mut frame, &scene.at(0.0)).swap_remove(0);
    assert_eq!((light.len(), frame.merged().clusters), (64, 1), "one cluster, one list");
    (frame, light)
}

/// One occluder that is nearer than the light to some vertices of a cluster and farther than it from others: each
/// vertex is right.
#[test]
fn before_or_behind_a_light_is_decided_by_the_vertex() {
    let Some(gpu) = gpu() else { return };
    for place in [A, B, [0.02, 0.9995, 0.3], [-0.1, 0.995, 0.0]] {
        let (frame, light) = lit(&gpu, &[place]);
        let (expected, orders) = by_vertex(&frame, &own);
        assert_eq!(orders.len(), 2, "before the light for some, behind it for others: {orders:?}");
        assert!(apart(&light, &expected) < ARITHMETIC, "{place:?}: {:e}", apart(&light, &expected));
        let (without, _) = lit(&gpu, &[]);
        let (open, _) = by_vertex(&without, &own);
        assert!(apart(&light, &open) > 0.01, "the occluder counts at all");
    }
}

/// Two occluders on either side of the light, equally far from the patch's centre: all six orders but two are met
/// within the one cluster. Which of them lie before the light is right at each vertex; their products stand in one
/// order, which is the stated one.
#[test]
fn two_occluders_about_as_far_as_a_light() {
    let Some(gpu) = gpu() else { return };
    let (frame, light) = lit(&gpu, &[A, B]);
    let (expected, orders) = by_vertex(&frame, &own);
    let from_own = apart(&light, &expected);
    let (stated, _) = by_vertex(&frame, &|_, occluders| occluders.sort_unstable());
    let (other, _) = by_vertex(&frame, &|_, occluders| occluders.reverse());
    let [stated, other] = [stated, other].map(|expected| apart(&light, &expected));
    assert!(orders.len() >= 4, "{orders:?}");
    assert!(stated < ARITHMETIC, "at a tie, by index: {stated:e}");
    assert!(other > 2.0 * ARITHMETIC, "the order can be told apart: {other:e}");
    // Products truncated to four bands do not quite commute.
    assert!(from_own < 2e-3, "{from_own:e}");

    // A hair nearer, the second comes first; and nobody sees it.
    let (frame, turned) = lit(&gpu, &[A, [B[0], B[1] - 1e-6, B[2]]]);
    let (expected, _) = by_vertex(&frame, &|_, occluders| occluders.reverse());
    assert!(apart(&turned, &expected) < ARITHMETIC, "by distance from the receiver's centre");
    let (step, brightest) = difference(&turned, &light);
    assert!(step < 2e-3 * brightest, "{step} of {brightest}");
}

/// The key is in f32: what differs by less comes as equal, and by index, for the merge, for its twin and for the exact
/// chain alike.
#[test]
fn equal_keys_go_by_index() {
    let entity = |x: f64| EntityBounds {
        sharp: false,
        centre: DVec3::new(x, 2.0, 3.0),
        radius_m: 0.5,
        reflectance: 0.7,
        occludes: true,
        emits: false,
        coloured: false,
        radiance: 0.0,
        facing: None,
        sheet: None,
    };
    let scene_bounds =
        SceneBounds::new(vec![entity(0.0), entity(1.0 + 1e-12), entity(1.0), entity(1.0 - 1e-5)], None, Skip::ALL, 0.0);
    let mut order = [1, 2, 3];
    order.sort_by_key(|&j| scene_bounds.order(0, j));
    assert_eq!(order, [3, 1, 2]);
}
