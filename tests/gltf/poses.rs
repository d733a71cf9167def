//! Skins, morph targets, instances and named cameras of models that the tests make.

use crate::model::{Model, QUARTER, U8, load, read, refusal, world};
use glam::{DQuat, DVec3, Vec3};
use serde_json::{Value, json};
use shadow_fields::scene::{Scene, gltf};

/// A mesh in the world, at time 0 of a file at a time.
fn posed(model: &Model, time_s: f64) -> (Vec<DVec3>, gltf::Import) {
    let import = read(model, &gltf::Options { time_s, ..gltf::Options::default() }).unwrap();
    (world(&import, 0, 0.0), import)
}

fn assert_near(points: &[DVec3], expected: &[[f64; 3]]) {
    assert_eq!(points.len(), expected.len());
    for (point, expected) in points.iter().zip(expected) {
        assert!(point.distance(DVec3::from(*expected)) < 1e-5, "{points:?}, not {expected:?}");
    }
}

/// A triangle along x whose last corner follows the second of two joints, half of its middle one; and the node of that
/// joint. The node that holds it stands elsewhere, which does not count.
fn arm() -> (Model, usize) {
    let mut model = Model::default();
    let positions = model.positions(&[0., 0., 0., 1., 0., 0., 2., 0.1, 0.]);
    let normals = model.floats(3, &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let joints = model.accessor(U8, 4, 3, &[0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]);
    let weights = model.floats(4, &[1., 0., 0., 0., 0.5, 0.5, 0., 0., 2., 0., 0., 0.]);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "JOINTS_0": joints, "WEIGHTS_0": weights });
    let mesh = model.mesh(attributes, None, None);
    let holder = model.node(json!({ "mesh": mesh, "translation": [0, 7, 0] }));
    let root = model.node(json!({ "translation": [0, 0, 5] }));
    let elbow = model.child(root, json!({ "translation": [1, 0, 0] }));
    let shift = |x: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -x, 0., 0., 1.];
    let view: Vec<u8> = [shift(0.0), shift(1.0)].concat().iter().flat_map(|x: &f32| x.to_le_bytes()).collect();
    let view = model.view(&view);
    let inverse = json!({ "bufferView": view, "componentType": 5126, "count": 2, "type": "MAT4" });
    let inverse = model.push("accessors", inverse);
    let skin = model.push("skins", json!({ "joints": [root, elbow], "inverseBindMatrices": inverse }));
    model.json["nodes"][holder]["skin"] = json!(skin);
    (model, elbow)
}

#[test]
fn vertices_follow_their_joints() {
    let (mut model, elbow) = arm();
    assert_near(&posed(&model, 0.0).0, &[[0., 0., 5.], [1., 0., 5.], [2., 0.1, 5.]]);
    // The elbow turns by 90 degrees about z within a second.
    let turn = [0., 0., 0., 1., 0., 0., QUARTER, QUARTER, 0., 0., 0., 1.];
    model.animate(0, elbow, "rotation", "LINEAR", &[0., 1., 2.], &turn);
    let (points, import) = posed(&model, 1.0);
    assert_near(&points, &[[0., 0., 5.], [1., 0., 5.], [0.9, 1., 5.]]);
    let said = [import.notes.left_out(), import.notes.said().to_vec()].concat().join("\n");
    assert!(said.contains("left out (1): movements of skins and morph targets"), "{said}");
    assert!(said.contains("skins and morph targets (1) stand in their pose at 1 s"), "{said}");
    let entity = &import.data.entities[0];
    assert!(entity.motion.is_empty() && entity.position == Vec3::ZERO);
    assert!(import.meshes[0].normals.iter().all(|n| n.distance(Vec3::Z) < 1e-5));

    // A scene file keeps the pose.
    let folder = tempfile::tempdir().unwrap();
    let path = model.write(folder.path(), "m");
    let options = gltf::Options { time_s: 1.0, ..gltf::Options::default() };
    let (scene, _) = Scene::load_with_notes(&path, &options).unwrap();
    let saved = folder.path().join("saved.toml");
    std::fs::write(&saved, scene.to_toml().unwrap()).unwrap();
    assert_eq!(Scene::load(&saved).unwrap().meshes, scene.meshes);

    // All triangles as one mesh stand at rest.
    let (mesh, _) = shadow_fields::scene::load_mesh(&path).unwrap();
    assert!(mesh.positions[2].distance(Vec3::new(2.0, 0.1, 5.0)) < 1e-5, "{:?}", mesh.positions);
}

#[test]
fn a_posed_cloth_has_the_sides_that_are_seen() {
    let (mut model, _) = arm();
    let material = model.push("materials", json!({ "doubleSided": true }));
    model.json["meshes"][0]["primitives"][0]["material"] = json!(material);
    let camera = model.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    // The cloth stands at z = 5 and faces +z.
    model.node(json!({ "camera": camera, "translation": [1, 0, 9] }));
    assert!(!posed(&model, 0.0).1.meshes[0].is_two_sided());
    model.node(json!({ "camera": camera, "translation": [1, 0, 1] }));
    let (points, import) = posed(&model, 0.0);
    assert!(import.meshes[0].is_two_sided());
    assert_near(&points[..3], &[[0., 0., 5.], [1., 0., 5.], [2., 0.1, 5.]]);
}

#[test]
fn morph_targets_move_vertices_by_their_shares() {
    let mut model = Model::default();
    let positions = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let up = model.positions(&[0., 0., 0., 0., 0., 0., 0., 2., 0.]);
    let out = model.positions(&[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let mesh = model.mesh(json!({ "POSITION": positions }), None, None);
    model.json["meshes"][mesh]["primitives"][0]["targets"] = json!([{ "POSITION": up }, { "POSITION": out }]);
    let node = model.node(json!({ "mesh": mesh, "translation": [3, 0, 0] }));
    assert_near(&posed(&model, 0.0).0, &[[3., 0., 0.], [4., 0., 0.], [3., 1., 0.]]);
    model.json["meshes"][mesh]["weights"] = json!([0.5, 0]);
    assert_near(&posed(&model, 0.0).0, &[[3., 0., 0.], [4., 0., 0.], [3., 2., 0.]]);
    model.json["nodes"][node]["weights"] = json!([0, 2]);
    assert_near(&posed(&model, 0.0).0, &[[3., 0., 2.], [4., 0., 2.], [3., 1., 2.]]);
    // Keys: two shares a time.
    let times = model.floats(1, &[0., 2.]);
    let shares = model.floats(1, &[0., 0., 1., 1.]);
    let channel = json!({ "sampler": 0, "target": { "node": node, "path": "weights" } });
    model.push("animations", json!({ "channels": [channel], "samplers": [{ "input": times, "output": shares }] }));
    assert_near(&posed(&model, 1.0).0, &[[3., 0., 0.5], [4., 0., 0.5], [3., 2., 0.5]]);
}

#[test]
fn instances_stand_where_their_attributes_say() {
    let mut model = Model::default();
    let cube = model.cuboid([-0.5; 3], [0.5; 3], None);
    let positions = model.floats(3, &[0., 0., 0., 2., 0., 0., 4., 0., 0.]);
    let rotations = model.floats(4, &[0., 0., 0., 1., 0., QUARTER, 0., QUARTER, 0., 0., 0., 1.]);
    let scales = model.floats(3, &[1., 1., 1., 2., 2., 2., 1., 3., 1.]);
    let attributes = json!({ "TRANSLATION": positions, "ROTATION": rotations, "SCALE": scales });
    let extensions = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    let node = model.node(json!({ "name": "tree", "mesh": cube, "translation": [0, 1, 0], "extensions": extensions }));
    model.child(node, json!({ "name": "nest", "mesh": cube }));
    model.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    model.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let import = load(&model);
    let entities = &import.data.entities;
    let names: Vec<&str> = entities.iter().map(|e| e.name.as_deref().unwrap()).collect();
    assert_eq!(names, ["tree", "tree", "tree", "nest"]);
    for (i, entity) in entities[..3].iter().enumerate() {
        assert_eq!(entity.position, Vec3::new(2.0 * i as f32, 1.0, 0.0));
    }
    assert_eq!((entities[1].scale, entities[3].position), (2.0, Vec3::Y), "a child has one instance");
    let turn = entities[1].at(0.0).turn();
    assert!(turn.angle_between(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)) < 1e-5);
    // An uneven scale is a copy of the mesh.
    assert_eq!(import.meshes.len(), 2);
    assert_eq!((&entities[0].mesh, &entities[1].mesh), (&entities[3].mesh, &entities[3].mesh));
}

#[test]
fn a_camera_is_taken_by_its_name() {
    let mut model = crate::model::room();
    let camera = json!({ "type": "perspective", "name": "attic", "perspective": { "yfov": 1.0, "znear": 0.1 } });
    let camera = model.push("cameras", camera);
    model.node(json!({ "name": "stairs", "camera": camera, "translation": [0, 9, 0] }));
    let seen = |name: Option<&str>| {
        let options = gltf::Options { camera: name.map(str::to_owned), ..gltf::Options::default() };
        read(&model, &options).map(|import| import.data.camera.eye.y)
    };
    assert_eq!(seen(None).unwrap(), 1.2);
    assert_eq!((seen(Some("attic")).unwrap(), seen(Some("stairs")).unwrap()), (9.0, 9.0));
    let error = seen(Some("cellar")).unwrap_err().to_string();
    assert!(error.contains("there is no camera \"cellar\" with perspective: \"stairs\", \"attic\""), "{error}");
}

/// Every number that a pose or an instance may get wrong.
#[test]
fn bad_poses_and_instances_are_refused_in_one_line() {
    let refused = |model: &Model, message: &str| {
        let line = refusal(read(model, &gltf::Options::default()));
        assert!(line.contains(message), "{line} for {message}");
    };
    let changed = |change: &dyn Fn(&mut Value), message: &str| {
        let (mut model, _) = arm();
        change(&mut model.json);
        refused(&model, message);
    };
    changed(&|json| json["skins"][0]["joints"] = json!([1]), "joint 1 is out of range: there are 1");
    changed(&|json| json["skins"][0]["joints"] = json!([1, 2, 0]), "skins[0]: 3 joints have 2 matrices");
    changed(&|json| json["skins"][0]["joints"] = json!([1, 99]), "out of range");
    changed(&|json| json["nodes"][0]["skin"] = json!(4), "out of range");
    changed(&|json| json["accessors"][2]["count"] = json!(2), "there are not as many JOINTS_0 as positions");
    changed(
        &|json| {
            json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 4 }]);
            json["nodes"][0]["weights"] = json!([1]);
        },
        "accessors[4]",
    );
    let mut model = Model::default();
    let cube = model.cuboid([-0.5; 3], [0.5; 3], None);
    let two = model.floats(3, &[0.; 6]);
    let one = model.floats(3, &[1.; 3]);
    for (attributes, message) in [
        (json!({ "TRANSLATION": two, "SCALE": one }), "its attributes have different numbers of instances"),
        (json!({ "TRANSLATION": 99 }), "TRANSLATION: there is no accessor 99"),
        (json!({ "TRANSLATION": "x" }), "TRANSLATION: there is no accessor \"x\""),
    ] {
        let extension = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
        model.json["nodes"] = json!([{ "mesh": cube, "extensions": extension }]);
        model.json["scenes"][0]["nodes"] = json!([0]);
        refused(&model, message);
    }
}
