//! What a bake leaves out: samples that faces of the lattice share, and equal meshes.

use crate::common::{generate, gpu};
use crate::stage::scene;
use shadow_fields::bake::cache::Cache;
use shadow_fields::bake::{self, SceneNeeds};
use shadow_fields::field::FieldKind;
use shadow_fields::scene::Scene;
use shadow_fields::scene_buffers::SceneBuffers;

/// A mesh and an entity of it.
fn ring(name: &str, size: &str) -> String {
    format!("[[mesh]]\nname = \"{name}\"\ntorus = {{ {size}, segments = 12 }}\n[[entity]]\nmesh = \"{name}\"\n")
}

#[test]
fn the_same_mesh_under_two_names_is_baked_once() {
    let Some(gpu) = gpu() else { return };
    let rings = |sides: [u32; 2]| {
        let [a, b] = sides.map(|sides| format!("major_m = 1, minor_m = 0.3, sides = {sides}"));
        scene(&format!("environment = {{ uniform = [1, 1, 1] }}\n{}{}", ring("a", &a), ring("b", &b)))
    };
    let options = bake::Options { lattice: "cube:3x3".parse().unwrap(), face_px: 16, ..Default::default() };
    let buffers = |scene: &Scene| {
        let needs = SceneNeeds::of(scene, &options, shadow_fields::scene::Lights::Sh);
        let baked = bake::ensure(&gpu.baker(), &Cache::new(None), scene, &needs, &|_, _, _| ()).unwrap();
        assert_eq!(baked.meshes.len(), 2);
        SceneBuffers::new(&gpu.device, scene, &options, baked).unwrap()
    };
    let same = buffers(&rings([8, 8]));
    let other = buffers(&rings([8, 10]));
    let names = |buffers: &SceneBuffers| buffers.baked.iter().map(|b| b.what.clone()).collect::<Vec<_>>();
    assert_eq!(names(&same), ["a shadow", "a view"]);
    assert_eq!(names(&other), ["a shadow", "b shadow", "a view", "b view"]);
    assert!(same.fields.size_bytes < other.fields.size_bytes);
    let [a, b] = [0, 1].map(|i| same.meshes[i].blocked.as_ref().unwrap());
    assert_eq!(a.bytes, b.bytes);
    assert_eq!(same.surface(0).transfer_first, same.surface(1).transfer_first);
}

/// Outlines of meshes that differ in size alone are baked once, and nothing is missing then.
#[test]
fn meshes_of_one_shape_share_outlines() {
    let Some(gpu) = gpu() else { return };
    let light = "environment = { sun = { toward = [0, 1, 0], radiance = [9, 9, 9] } }\n";
    let small = ring("a", "major_m = 1, minor_m = 0.25, sides = 8");
    let large = ring("b", "major_m = 2, minor_m = 0.5, sides = 8");
    let scene = scene(&format!("{light}{small}{large}"));
    let options = bake::Options::default();
    let needs = SceneNeeds::of(&scene, &options, shadow_fields::scene::Lights::default());
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::new(Some(folder.path()));
    let outlines =
        |names: Vec<String>| names.into_iter().filter(|name| name.ends_with("silhouette")).collect::<Vec<_>>();
    let missing = || needs.missing(&scene, &cache).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    assert_eq!(outlines(missing()), ["a silhouette"]);
    let baked = bake::ensure(&gpu.baker(), &cache, &scene, &needs, &|_, _, _| ()).unwrap();
    let [a, b] = [0, 1].map(|mesh| baked.meshes[mesh].silhouette.clone().unwrap());
    assert!(std::sync::Arc::ptr_eq(&a, &b));
    assert_eq!(outlines(baked.baked.into_iter().map(|baked| baked.what).collect()), ["a silhouette"]);
    assert!(missing().is_empty(), "{:?}", missing());
}

/// Samples on an edge between faces of the lattice's cube have several numbers, and are captured once.
#[test]
fn what_faces_of_the_lattice_share_is_captured_once() {
    let Some(gpu) = gpu() else { return };
    let mesh = generate::sphere(1.0, 2);
    let options = bake::Options { lattice: "cube:2x5,edges".parse().unwrap(), face_px: 32, ..Default::default() };
    let header = bake::header(&mesh, FieldKind::Occlusion, &options);
    let nodes = (header.lattice.direction_count() / 6).isqrt();
    let (field, report) = gpu.baker().field(&mesh, header, &|_, _| ()).unwrap();
    let places = 6 * (nodes - 2).pow(2) + 12 * (nodes - 2) + 8;
    assert_eq!((field.header.captured_samples, report.samples), (2 * places, 2 * 6 * nodes.pow(2)));
}
