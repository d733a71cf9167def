//! The shadow-map rival against rays: without occluders, in full shadow, and how its error falls.

use crate::common::relative_rms;
use crate::stage;
use shadow_fields::bench::shadow_map::{Filter, ShadowMaps, maps_apply};
use shadow_fields::scene::Scene;
use shadow_fields::truth::{RayCast, RayMeshes, World, receiver_vertices};
use stage::{Stage, scene, stage};

/// A floor of 4 x 4 m below lights and occluders.
fn floor(entities: &str) -> Scene {
    scene(&format!(
        "[[mesh]]\nname = \"floor\"\nplane = {{ size_m = 4, cells = 64 }}\n\
         [[mesh]]\nname = \"ball\"\nsphere = {{ radius_m = 0.5, subdivisions = 4 }}\n[[entity]]\nmesh = \"floor\"\n{entities}"
    ))
}

fn entity(at: [f64; 3], scale: f64, rest: &str) -> String {
    format!("[[entity]]\nmesh = \"ball\"\nposition = {at:?}\nscale = {scale}\nreceives = false\n{rest}\n")
}

fn light(at: [f64; 3], scale: f64) -> String {
    entity(at, scale, "emission = [9, 6, 3]")
}

/// Radiosity of all vertices by maps and by rays.
fn both(stage: &Stage, scene: &Scene, filter: Filter, map_px: u32) -> [Vec<[f64; 3]>; 2] {
    let placements = scene.at(0.0);
    let shapes = RayMeshes::new(scene);
    let world = World::new(scene, &shapes, &placements);
    let points: Vec<_> = receiver_vertices(scene).into_iter().map(|vertex| (vertex, world.view(vertex))).collect();
    let gpu = (&stage.gpu.device, &stage.gpu.library);
    let maps = ShadowMaps::new(gpu, scene, &placements, &points, (filter, map_px)).unwrap();
    // Twice: nothing of a run is left to the next.
    maps.run(scene, &placements).unwrap();
    maps.run(scene, &placements).unwrap();
    let cast = RayCast { rays: 512, runs: 1, ..Default::default() };
    let rays = cast.run_at(&world, &points).iter().map(|e| e.radiosity).collect();
    [maps.radiosity().unwrap(), rays]
}

/// Relative root mean square difference.
fn error([found, truth]: &[Vec<[f64; 3]>; 2]) -> f64 {
    relative_rms(found.iter().flatten().copied().zip(truth.iter().flatten().copied()))
}

#[test]
fn lights_shine_as_rays_find_them() {
    let Some(stage) = stage() else { return };
    // Above, low beside, and half below the floor, where the facets' edges show.
    let places = [([0.0, 2.0, 0.0], 0.4, 0.01), ([1.5, 0.4, 0.3], 0.7, 0.01), ([0.3, 0.1, 0.2], 0.6, 0.06)];
    for (at, scale, limit) in places {
        let found = error(&both(&stage, &floor(&light(at, scale)), Filter::Pcss, 64));
        assert!(found < limit, "{at:?}: {found}");
    }
    let two: String = places[..2].iter().map(|(at, scale, _)| light(*at, *scale)).collect();
    assert!(error(&both(&stage, &floor(&two), Filter::Hard, 64)) < 0.01);
}

#[test]
fn shadows_are_those_of_rays_but_for_their_edges() {
    let Some(stage) = stage() else { return };
    let below = entity([0.2, 0.7, 0.1], 1.0, "");
    let scenes = [
        ("one view", floor(&format!("{}{below}", light([0.5, 3.0, 0.4], 0.3)))),
        ("six views", floor(&format!("{}{below}{}", light([0.0, 1.6, 0.0], 0.2), entity([0.3, 2.6, 0.2], 1.0, "")))),
    ];
    for (name, scene) in &scenes {
        let hard = [64, 256, 1024].map(|px| error(&both(&stage, scene, Filter::Hard, px)));
        let soft = error(&both(&stage, scene, Filter::Pcss, 1024));
        assert!(hard[2] < hard[0] && hard[2] < 0.25, "{name}: {hard:?}");
        assert!(soft < 0.6 * hard[2] && soft < 0.1, "{name}: {soft} against {hard:?}");
        // What lies deep in shadow has none of the light that casts it.
        let [found, rays] = both(&stage, scene, Filter::Pcss, 1024);
        let dark = rays.iter().zip(&found).filter(|(r, _)| r[0] == 0.0).map(|(_, f)| f[0]);
        let brightest = rays.iter().map(|r| r[0]).fold(0.0, f64::max);
        assert!(
            dark.clone().count() > 20 && dark.clone().sum::<f64>() / dark.count() as f64 <= 0.02 * brightest,
            "{name}"
        );
    }
}

#[test]
fn a_receiver_shadows_itself_and_no_more() {
    let Some(stage) = stage() else { return };
    let text = "[[mesh]]\nname = \"torus\"\ntorus = { major_m = 1, minor_m = 0.4, segments = 64, sides = 32 }\n\
        [[mesh]]\nname = \"ball\"\nsphere = { radius_m = 0.5, subdivisions = 3 }\n[[entity]]\nmesh = \"torus\"\n";
    let scene = scene(&format!("{text}{}", light([2.0, 1.5, 0.5], 0.4)));
    let soft = error(&both(&stage, &scene, Filter::Pcss, 1024));
    assert!(soft < 0.08, "{soft}");
}

#[test]
fn only_balls_of_one_colour_are_mapped() {
    assert!(maps_apply(&floor(&light([0.0, 2.0, 0.0], 1.0))));
    assert!(!maps_apply(&floor("")), "no light");
    let torus = "[[mesh]]\nname = \"torus\"\ntorus = { major_m = 1, minor_m = 0.4, segments = 16, sides = 8 }\n\
        [[entity]]\nmesh = \"torus\"\nemission = [1, 1, 1]\n";
    assert!(!maps_apply(&floor(&format!("{torus}{}", light([0.0, 2.0, 0.0], 1.0)))));
}
