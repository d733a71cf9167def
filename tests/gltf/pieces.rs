//! Primitives of several loose pieces, and lamps that are one quad.

use crate::common::{generate, inside_out, joined, part};
use crate::model::{Model, bench};
use glam::{Mat3, Quat, Vec2, Vec3};
use serde_json::json;
use shadow_fields::asset::Mesh;
use shadow_fields::scene::gltf::{self, Import};
use shadow_fields::scene::{Entity, LightMethod, Lights, Scene};
use std::f32::consts::TAU;
use std::sync::Arc;

fn load(model: &Model) -> (Import, Scene) {
    let folder = tempfile::tempdir().unwrap();
    let path = model.write(folder.path(), "m");
    let import = gltf::load(&path, &gltf::Options::default()).unwrap_or_else(|error| panic!("{error}"));
    // The scene file names the pieces, and finds them again.
    let text = toml::to_string(&import.data).unwrap();
    let file = folder.path().join("m.toml");
    std::fs::write(&file, text).unwrap();
    let scene = Scene::load(&file).unwrap();
    for (here, there) in import.meshes.iter().zip(&scene.meshes) {
        assert_eq!(here.content_hash(), there.content_hash());
    }
    (import, scene)
}

/// Entities of the node with that name, which leaves out the sun that is added.
fn of<'s>(scene: &'s Scene, node: &str) -> Vec<&'s Entity> {
    scene.entities.iter().filter(|entity| entity.name.starts_with(node)).collect()
}

#[test]
fn loose_pieces_become_entities() {
    let (_, scene) = load(&bench(json!({})));
    let names: Vec<_> = of(&scene, "bench").iter().map(|entity| entity.name.as_str()).collect();
    assert_eq!(names, ["bench, piece 0", "bench, piece 1", "bench, piece 2", "bench, piece 3"]);
    let counts: Vec<_> = scene.meshes[..4].iter().map(|mesh| mesh.triangles.len()).collect();
    assert_eq!(counts, [12, 12, 12, 3], "three boxes, and the specks together");
    assert!(scene.meshes[..3].iter().all(|mesh| mesh.is_convex()));
}

/// Boxes that share a face, an edge or a corner are pieces, whether the face is there twice or lies within.
#[test]
fn boxes_that_touch_are_pieces() {
    let cube = generate::cuboid(Vec3::ONE, 1);
    let places = [Vec3::ZERO, Vec3::X, Vec3::new(2.0, 1.0, 0.0), Vec3::new(3.0, 2.0, 1.0)];
    let mut model = Model::default();
    let mesh = model.shape(&joined(&places.map(|place| (&cube, place))), None);
    model.node(json!({ "mesh": mesh, "name": "boxes" }));
    let (_, scene) = load(&model);
    let meshes: Vec<_> = of(&scene, "boxes").iter().map(|entity| &scene.meshes[entity.mesh]).collect();
    assert_eq!(meshes.len(), 4);
    assert!(meshes.iter().all(|mesh| mesh.triangles.len() == 12 && mesh.is_convex()));
}

#[test]
fn what_lets_light_through_stays_whole() {
    let glass = json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.3] } });
    let (_, scene) = load(&bench(glass));
    let [entity] = of(&scene, "bench")[..] else { panic!("{:?}", scene.entities) };
    assert_eq!(entity.name, "bench");
}

/// The meshes of a file whose one primitive is of that material.
fn meshes(parts: &[(&Mesh, Vec3)], material: serde_json::Value) -> Vec<Arc<Mesh>> {
    let mut model = Model::default();
    let material = model.push("materials", material);
    let mesh = model.shape(&joined(parts), Some(material));
    model.node(json!({ "mesh": mesh, "name": "one" }));
    let (_, scene) = load(&model);
    of(&scene, "one").iter().map(|entity| scene.meshes[entity.mesh].clone()).collect()
}

/// Bulbs apart are lamps, up to 32; of more, neighbours are one. What touches is one; a neon ring is cut.
#[test]
fn lamps_of_several_bulbs_are_several_lamps() {
    let glow = || json!({ "emissiveFactor": [1, 1, 1] });
    let bulb = generate::sphere(0.05, 2);
    let row = |count: usize, step_m: f32| -> Vec<(&Mesh, Vec3)> {
        (0..count).map(|i| (&bulb, i as f32 * step_m * Vec3::X)).collect()
    };
    let bulbs = meshes(&row(6, 0.4), glow());
    assert_eq!(bulbs.len(), 6);
    assert!(bulbs.iter().all(|mesh| mesh.ball_share().is_some()));
    let many = meshes(&row(100, 0.4), glow());
    assert!((16..=32).contains(&many.len()), "{}", many.len());
    assert_eq!(many.iter().map(|mesh| mesh.triangles.len()).sum::<usize>(), 100 * bulb.triangles.len());
    assert!(many.iter().all(|mesh| mesh.bounding_sphere().1 < 1.5), "neighbours");
    let filament = generate::cuboid(Vec3::splat(0.02), 1);
    assert_eq!(meshes(&[(&bulb, Vec3::ZERO), (&filament, Vec3::ZERO)], glow()).len(), 1);
    assert_eq!(meshes(&row(4, 0.1), glow()).len(), 1, "they touch");

    let ring = generate::torus(0.4, 0.02, 64, 8);
    let parts = meshes(&[(&ring, Vec3::ZERO)], glow());
    assert!((8..=16).contains(&parts.len()), "{}", parts.len());
    assert!(parts.iter().all(|mesh| mesh.bounding_sphere().1 < 0.2));
    let thick = generate::torus(0.4, 0.3, 64, 32);
    assert_eq!(meshes(&[(&thick, Vec3::ZERO)], glow()).len(), 1, "a thick ring is not bent");
    // Its triangles are as long as itself.
    let ring = |z: f32| (0..16).map(move |k| (0.016 * Vec2::from_angle(TAU / 16.0 * k as f32)).extend(z));
    let sides = (0..16).flat_map(|k| [[k, (k + 1) % 16, k + 16], [(k + 1) % 16, (k + 1) % 16 + 16, k + 16]]);
    let caps = (1..15).flat_map(|k| [[0, k + 1, k], [16, k + 16, k + 17]]);
    let tube = Mesh::new("tube", ring(0.0).chain(ring(1.2)).collect(), vec![], None, sides.chain(caps).collect());
    let tube = tube.unwrap();
    assert_eq!(meshes(&[(&tube, Vec3::ZERO)], glow()).len(), 1, "a tube is not bent");
}

/// The walls of a room are rectangles of their own; a box that is open, seen from outside, is none.
#[test]
fn rooms_are_cut_into_their_walls() {
    let solid = generate::cuboid(Vec3::new(4.0, 2.5, 3.0), 2);
    let open = part(&solid, |corners| corners.iter().any(|&v| solid.normals[v as usize].z < 0.5));
    let walls = meshes(&[(&inside_out(&open), Vec3::ZERO)], json!({}));
    assert_eq!(walls.len(), 5);
    assert!(walls.iter().all(|mesh| mesh.rectangle().is_some()));
    assert_eq!(meshes(&[(&open, Vec3::ZERO)], json!({})).len(), 1);
    let ring = generate::torus(0.4, 0.1, 24, 12);
    let both = meshes(&[(&inside_out(&solid), Vec3::ZERO), (&ring, 9.0 * Vec3::X)], json!({}));
    assert_eq!(both.len(), 2, "a box that may be inside out is a solid");
    assert!(both.iter().all(|mesh| mesh.rectangle().is_none()));
}

/// A ring, a ball and bars of one mesh: solids are apart, bars are together.
#[test]
fn solids_are_cut_off_and_bars_stay_together() {
    let ring = generate::torus(0.4, 0.1, 24, 12);
    let ball = generate::sphere(0.3, 3);
    let bar = generate::cuboid(Vec3::new(2.0, 0.03, 0.03), 1);
    let bars = (0..5).map(|i| (&bar, Vec3::new(0.0, 0.2 * i as f32, 2.0)));
    let parts: Vec<(&Mesh, Vec3)> = [(&ring, 3.0 * Vec3::X), (&ball, 5.0 * Vec3::X)].into_iter().chain(bars).collect();
    let found = meshes(&parts, json!({}));
    assert_eq!(found.len(), 3);
    assert_eq!(found.iter().map(|mesh| mesh.boxes().len()).collect::<Vec<_>>(), [5, 0, 0]);
}

/// What moves and has solids that are not convex stays whole.
#[test]
fn concave_solids_that_move_stay_together() {
    let ring = generate::torus(0.4, 0.1, 24, 12);
    let mut model = Model::default();
    let mesh = model.shape(&joined(&[(&ring, Vec3::ZERO), (&ring, 3.0 * Vec3::X)]), None);
    let node = model.node(json!({ "mesh": mesh, "name": "rings" }));
    let count = |model: &Model| of(&load(model).1, "rings").len();
    assert_eq!(count(&model), 2);
    model.animate(0, node, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    assert_eq!(count(&model), 1);
}

#[test]
fn pieces_move_with_their_node() {
    let mut model = bench(json!({}));
    model.animate(0, 0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let (_, scene) = load(&model);
    assert_eq!(of(&scene, "bench").len(), 4);
    let before = scene.at(0.0);
    let after = scene.at(0.5);
    let pieces = scene.entities.iter().zip(before.iter().zip(&after)).filter(|(e, _)| e.name.starts_with("bench"));
    for (entity, (before, after)) in pieces {
        assert_eq!(after.position - before.position, 0.5 * Vec3::X, "{}", entity.name);
    }
}

/// However a quad that glows lies in its mesh and its node, it is a rectangle of light where the file has it.
#[test]
fn a_quad_that_glows_is_a_rectangle_that_shines_from_both_sides() {
    let tilt = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.9);
    let place = |x: f32, z: f32| tilt * Vec3::new(x, 0.0, z) + Vec3::new(0.1, 0.2, 0.3);
    let corners = [place(-1.0, -0.25), place(1.0, -0.25), place(1.0, 0.25), place(-1.0, 0.25)];
    for scale in [[2.0, 2.0, 2.0], [3.0, 3.0, 3.0]] {
        let mut model = Model::default();
        let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 9 } });
        let glow = model.push("materials", json!({ "emissiveFactor": [1, 1, 1], "extensions": strength }));
        let positions = model.positions(&corners.map(|corner| corner.to_array()).concat());
        let indices = model.indices(&[0, 2, 1, 0, 3, 2]);
        let mesh = model.mesh(json!({ "POSITION": positions }), Some(indices), Some(glow));
        let turn = Quat::from_rotation_x(0.4);
        let node = json!({ "mesh": mesh, "translation": [1, 2, 3], "rotation": turn.to_array(), "scale": scale });
        model.node(node);
        let (_, scene) = load(&model);
        let LightMethod::LampFace(face) = LightMethod::of(&scene, 0, Lights::Sharp) else {
            panic!("{:?}", LightMethod::of(&scene, 0, Lights::Sharp))
        };
        let ratio = face.half().x / face.half().y;
        assert!((ratio - 4.0).abs() < 1e-4 || (ratio - 0.25).abs() < 1e-4, "{face:?}");
        let stretch = Mat3::from_diagonal(Vec3::from(scale));
        let expected = corners.map(|corner| Vec3::new(1.0, 2.0, 3.0) + turn * (stretch * corner));
        let placement = scene.at(0.0)[0];
        for position in &scene.meshes[0].positions {
            let found = placement.point(position.as_dvec3()).as_vec3();
            let off = expected.iter().map(|corner| corner.distance(found)).fold(f32::INFINITY, f32::min);
            assert!(off < 1e-5, "{found} is none of {expected:?}");
        }
    }
}

/// Of more nodes than a scene has entities, neighbours at rest are one mesh; what moves, glows or is wide stays alone.
#[test]
fn many_nodes_are_joined() {
    let mut model = Model::default();
    let corners: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.4]];
    let positions = model.positions(corners.as_flattened());
    let indices = model.indices(&[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
    let materials = [json!({}), json!({ "doubleSided": true }), json!({ "emissiveFactor": [1, 1, 1] })];
    let kinds = materials.map(|material| {
        let material = model.push("materials", material);
        model.mesh(json!({ "POSITION": positions }), Some(indices), Some(material))
    });
    let place = |i: usize| Vec3::new((i % 80) as f32, 0.0, (i / 80) as f32);
    for i in 0..4400 {
        let turn = Quat::from_rotation_y(i as f32);
        let scale = if i % 5 == 0 { [1.0, -2.0, 1.0] } else { [1.0; 3] };
        let node = json!({ "mesh": kinds[i % 2], "translation": place(i).to_array(), "rotation": turn.to_array(),
            "scale": scale, "name": format!("node {i}") });
        model.node(node);
    }
    model.node(json!({ "mesh": kinds[0], "scale": [500, 1, 500], "name": "ground" }));
    model.node(json!({ "mesh": kinds[2], "translation": [3, 5, 3], "name": "lamp" }));
    model.animate(0, 7, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let (import, scene) = load(&model);
    assert!((100..400).contains(&scene.entities.len()), "{} entities", scene.entities.len());
    for alone in ["node 7", "ground", "lamp"] {
        assert_eq!(scene.entities.iter().filter(|entity| entity.name == alone).count(), 1, "{alone}");
    }
    let joined = || scene.entities.iter().filter(|entity| entity.name.contains("and others"));
    let triangles: usize = joined().map(|entity| scene.meshes[entity.mesh].triangles.len()).sum();
    assert_eq!(triangles, 4 * 4399);
    for entity in joined() {
        let mesh = &scene.meshes[entity.mesh];
        assert!(mesh.is_closed(), "{}: its mirrored ones too", mesh.name);
        assert!(mesh.bounding_sphere().1 < 20.0, "{}: {:?}", mesh.name, mesh.bounding_sphere());
    }
    // Each stands where its node does: the corner at its origin is a vertex there.
    let vertices: Vec<Vec3> = joined().flat_map(|entity| scene.meshes[entity.mesh].positions.clone()).collect();
    for i in (0..4400).step_by(97) {
        assert!(vertices.iter().any(|vertex| vertex.distance(place(i)) < 1e-4), "node {i}");
    }
    assert!(import.notes.left_out().is_empty(), "{:?}", import.notes.left_out());
}

/// What names no place or primitive of the file is refused in one line.
#[test]
fn joined_primitives_that_are_not_there_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    bench(json!({})).write(folder.path(), "m");
    for (joined, what) in [
        ("[[9, 0]]", "place 9, primitive 0: there is no such place"),
        ("[[0, 3]]", "place 0, primitive 3: there is no such primitive"),
        ("[]", "a joined mesh has no primitives"),
        ("[[0, 0]]\npart = [0, 0]", "takes either a part of a glTF file or several joined"),
    ] {
        let file = folder.path().join("m.toml");
        let camera = "[camera]\neye = [0, 2, 5]\ntarget = [0, 0, 0]\n";
        let text =
            format!("{camera}[[mesh]]\nname = \"m\"\nfile = \"m.glb\"\njoined = {joined}\n[[entity]]\nmesh = \"m\"\n");
        std::fs::write(&file, text).unwrap();
        let error = Scene::load(&file).unwrap_err();
        assert!(error.exit_code() == 4 && error.to_string().contains(what), "{joined}: {error}");
        assert!(!error.to_string().trim_end().contains('\n'), "{error}");
    }
}
