//! glTF as scenes: shapes, placements, lights and cameras of models that the tests make.

use crate::common::generate;
use crate::model;
use glam::{DMat4, DQuat, DVec3, Quat, Vec3};
use model::{F32, I8, I16, Model, QUARTER, U8, U16, U32, corners, cuboid, load, near, world};
use serde_json::json;
use shadow_fields::scene::{Surroundings, gltf};
use shadow_fields::truth::RayCast;
use std::path::Path;

fn assert_box(points: &[DVec3], low: [f64; 3], high: [f64; 3]) {
    let [a, b] = points.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[a, b], p| [a.min(*p), b.max(*p)]);
    assert!(near(a, low.into()) && near(b, high.into()), "{a} to {b}, not {low:?} to {high:?}");
}

/// A box with a red, green and blue arrow along x, y and z.
fn arrows() -> Model {
    let mut model = Model::default();
    let grey = model.paint([0.5; 3]);
    let body = model.cuboid([-0.5; 3], [0.5; 3], Some(grey));
    let body = model.node(json!({ "name": "body", "mesh": body }));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let mut color = [0.1; 3];
        color[axis] = 0.8;
        let mut low = [-0.1; 3];
        let mut high = [0.1; 3];
        (low[axis], high[axis]) = (0.5, 2.0);
        let paint = model.paint(color);
        let mesh = model.cuboid(low, high, Some(paint));
        model.child(body, json!({ "name": name, "mesh": mesh }));
    }
    model
}

#[test]
fn axes_lengths_and_colours_are_taken_as_they_are() {
    let import = load(&arrows());
    assert_eq!(import.notes.left_out(), [""; 0]);
    let entities = &import.data.entities;
    assert_eq!(entities.iter().map(|e| e.name.as_deref().unwrap()).collect::<Vec<_>>(), ["body", "x", "y", "z"]);
    assert_box(&world(&import, 1, 0.0), [0.5, -0.1, -0.1], [2.0, 0.1, 0.1]);
    assert_box(&world(&import, 2, 0.0), [-0.1, 0.5, -0.1], [0.1, 2.0, 0.1]);
    assert_box(&world(&import, 3, 0.0), [-0.1, -0.1, 0.5], [0.1, 0.1, 2.0]);
    // Base colour factors are linear.
    assert_eq!(entities[1].albedo, Vec3::new(0.8, 0.1, 0.1).into());
    assert_eq!(entities[3].albedo, Vec3::new(0.1, 0.1, 0.8).into());
    assert!(import.meshes.iter().all(|mesh| mesh.is_solid()), "faces look outwards");
    // Nothing shines and there is no camera: both are added, and said.
    assert!(import.data.environment.sky.is_some());
    let said = import.notes.said().join("\n");
    assert!(said.contains("daylight") && said.contains("no camera"), "{said}");
}

#[test]
fn uniform_scales_are_placements_and_others_are_baked() {
    let mut model = Model::default();
    let cube = model.cuboid([0.0; 3], [1.0; 3], None);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0).normalize(), 0.7);
    let rotation = turn.as_quat().to_array();
    let outer = model.node(json!({ "scale": [2, 2, 2], "translation": [1, 0, 0] }));
    model.child(outer, json!({ "mesh": cube, "rotation": rotation, "translation": [0, 3, 0] }));
    model.child(outer, json!({ "mesh": cube, "rotation": rotation, "scale": [1, 2, 3] }));
    model.child(outer, json!({ "mesh": cube, "scale": [1, 2, 3] }));
    model.child(outer, json!({ "mesh": cube, "rotation": rotation, "scale": [-1, 1, 1] }));
    let import = load(&model);
    let unit: Vec<DVec3> = (0..8).map(|i| DVec3::new((i & 1).into(), (i >> 1 & 1).into(), (i >> 2).into())).collect();
    let outer = DMat4::from_scale_rotation_translation(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::X);
    let bends = [
        DMat4::from_scale_rotation_translation(DVec3::ONE, turn, DVec3::new(0.0, 3.0, 0.0)),
        DMat4::from_scale_rotation_translation(DVec3::new(1.0, 2.0, 3.0), turn, DVec3::ZERO),
        DMat4::from_scale(DVec3::new(1.0, 2.0, 3.0)),
        DMat4::from_scale_rotation_translation(DVec3::new(-1.0, 1.0, 1.0), turn, DVec3::ZERO),
    ];
    for (entity, own) in bends.into_iter().enumerate() {
        let found = world(&import, entity, 0.0);
        let expected: Vec<DVec3> = unit.iter().map(|p| (outer * own).transform_point3(*p)).collect();
        for point in &expected {
            assert!(found.iter().any(|p| near(*p, *point)), "entity {entity}: {point} is missing");
        }
        assert!(found.iter().all(|p| expected.iter().any(|q| near(*p, *q))), "entity {entity}");
    }
    let scales: Vec<f32> = import.data.entities.iter().map(|e| e.scale).collect();
    assert_eq!(scales, [2.0, 1.0, 1.0, 1.0]);
    // The cube itself, and one copy for each bend: instances of one scale share it, whatever their rotation.
    assert_eq!(import.meshes.len(), 3);
    assert_eq!(import.data.entities[1].mesh, import.data.entities[2].mesh);
    assert!(import.meshes.iter().all(|mesh| mesh.is_solid()), "also the mirrored one faces outwards");
    let said = import.notes.said().join("\n");
    assert!(said.contains("baked into copies of meshes (2)"), "{said}");
}

#[test]
fn normals_follow_their_surface_through_uneven_and_mirrored_scales() {
    for scale in [[1.0, 2.0, 4.0], [-1.0, 2.0, 4.0], [-1.0, -1.0, -3.0]] {
        let mut model = Model::default();
        // Slanted, so that a wrong transformation shows.
        let turn = Quat::from_axis_angle(Vec3::new(1.0, 1.0, 0.3).normalize(), 0.9);
        let mut slanted = cuboid([-1.0; 3], [1.0; 3]);
        slanted.positions.iter_mut().chain(&mut slanted.normals).for_each(|vector| *vector = turn * *vector);
        let mesh = model.shape(&slanted, None);
        model.node(json!({ "mesh": mesh, "scale": scale }));
        let mesh = load(&model).meshes[0].clone();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
            let face = (b - a).cross(c - a).normalize();
            for i in triangle {
                let cosine = face.dot(mesh.normals[*i as usize].as_dvec3());
                assert!(cosine > 1.0 - 1e-5, "{scale:?}: {cosine}");
            }
            assert!(face.dot(a) > 0.0, "{scale:?}: a face looks inwards");
        }
    }
}

#[test]
fn indexed_or_not_with_normals_or_without_it_is_the_same_box() {
    let solid = cuboid([0.0; 3], [1.0, 2.0, 3.0]);
    let indices = corners(&solid);
    let apart = |of: &[Vec3]| -> Vec<f32> { indices.iter().flat_map(|i| of[*i as usize].to_array()).collect() };
    let mut model = Model::default();
    let indexed = model.shape(&solid, None);
    let p = model.positions(&apart(&solid.positions));
    let n = model.floats(3, &apart(&solid.normals));
    let plain = model.mesh(json!({ "POSITION": p, "NORMAL": n }), None, None);
    let bare = model.mesh(json!({ "POSITION": p }), None, None);
    let shared = model.positions(bytemuck::cast_slice(&solid.positions));
    let i = model.indices(&indices);
    let bare_indexed = model.mesh(json!({ "POSITION": shared }), Some(i), None);
    let bytes: Vec<u8> = indices.iter().map(|i| *i as u8).collect();
    let small = model.accessor(U8, 1, indices.len(), &bytes);
    let small = model.mesh(json!({ "POSITION": shared }), Some(small), None);
    let bytes: Vec<u8> = indices.iter().flat_map(|i| u32::from(*i).to_le_bytes()).collect();
    let large = model.accessor(U32, 1, indices.len(), &bytes);
    let large = model.mesh(json!({ "POSITION": shared }), Some(large), None);
    for mesh in [indexed, plain, bare, bare_indexed, small, large] {
        model.node(json!({ "mesh": mesh }));
    }
    let import = load(&model);
    for (index, mesh) in import.meshes.iter().enumerate() {
        assert_eq!(mesh.triangles.len(), 12);
        assert!(mesh.is_solid() && mesh.is_convex() && (mesh.volume_m3() - 6.0).abs() < 1e-5, "{index}");
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let face = (b - a).cross(c - a).normalize();
            // Missing normals are flat.
            assert!(triangle.iter().all(|i| (mesh.normals[*i as usize] - face).length() < 1e-6), "{index}");
        }
    }
}

#[test]
fn strips_and_fans_are_triangles_and_lines_are_left_out() {
    let mut model = Model::default();
    let square = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.]);
    let round = model.positions(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    for (positions, mode) in [(square, 5), (round, 6), (square, 1), (square, 0)] {
        let mesh = model.mesh(json!({ "POSITION": positions }), None, None);
        model.json["meshes"][mesh]["primitives"][0]["mode"] = json!(mode);
        model.node(json!({ "mesh": mesh }));
    }
    let import = load(&model);
    assert_eq!(import.meshes.len(), 2);
    for mesh in &import.meshes {
        assert_eq!(mesh.triangles.len(), 2);
        assert!((mesh.area_m2() - 1.0).abs() < 1e-6 && mesh.normals.iter().all(|n| *n == Vec3::Z));
    }
    assert_eq!(import.notes.left_out(), ["left out (2): primitives of points or lines"]);
}

#[test]
fn quantised_accessors_are_numbers() {
    let mut model = Model::default();
    model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    // Three i16 and a gap an element; with and without normalisation.
    let corners: [[i16; 4]; 3] = [[0, 0, 0, 9], [16384, 0, 0, 9], [0, -32768, 32767, 9]];
    let bytes: Vec<u8> = corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    let view = model.view(&bytes);
    model.json["bufferViews"][view]["byteStride"] = json!(8);
    let accessor = |normalized: bool| {
        json!({ "bufferView": view, "componentType": I16, "count": 3, "type": "VEC3", "normalized": normalized,
            "min": [0, -32768, 0], "max": [16384, 0, 32767] })
    };
    let share = model.push("accessors", accessor(true));
    let whole = model.push("accessors", accessor(false));
    let normals: Vec<u8> = [[0_u8, 0, 127, 0]; 3].concat();
    let view = model.view(&normals);
    model.json["bufferViews"][view]["byteStride"] = json!(4);
    let json = json!({ "bufferView": view, "componentType": I8, "count": 3, "type": "VEC3", "normalized": true });
    let normals = model.push("accessors", json);
    let bytes: Vec<u8> = [0_u16, 0, 0, 65535, 0, 0, 0, 65535, 0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let unsigned = model.accessor(U16, 3, 3, &bytes);
    model.json["accessors"][unsigned]["normalized"] = json!(true);
    for positions in [share, whole, unsigned] {
        model.placed(json!({ "POSITION": positions, "NORMAL": normals }), None, None);
    }
    let import = load(&model);
    let x = 16384.0 / 32767.0;
    assert_eq!(import.meshes[0].positions, [Vec3::ZERO, Vec3::new(x, 0., 0.), Vec3::new(0., -1., 1.)]);
    assert_eq!(import.meshes[1].positions[2], Vec3::new(0., -32768., 32767.));
    assert_eq!(import.meshes[2].positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(import.meshes[0].normals, [Vec3::Z; 3]);
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut model = Model::default();
    let base = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let values: Vec<u8> = [5_f32, 0., 0., 0., 7., 0.].iter().flat_map(|x| x.to_le_bytes()).collect();
    let values = model.view(&values);
    for (component, size) in [(U8, 1), (U16, 2), (U32, 4)] {
        let bytes: Vec<u8> = [1_u32, 2].iter().flat_map(|i| i.to_le_bytes()[..size].to_vec()).collect();
        let indices = model.view(&bytes);
        let sparse = json!({ "count": 2, "indices": { "bufferView": indices, "componentType": component },
            "values": { "bufferView": values } });
        let mut with_base = model.json["accessors"][base].clone();
        with_base["sparse"] = sparse.clone();
        let over_zeros = json!({ "componentType": F32, "count": 3, "type": "VEC3", "sparse": sparse });
        for accessor in [with_base, over_zeros] {
            let positions = model.push("accessors", accessor);
            model.placed(json!({ "POSITION": positions }), None, None);
        }
    }
    let meshes = &load(&model).meshes;
    assert_eq!(meshes.len(), 6);
    for mesh in meshes {
        assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::new(5., 0., 0.), Vec3::new(0., 7., 0.)]);
    }
}

#[test]
fn buffers_may_stand_within_or_beside() {
    let model = arrows();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let glb = gltf::load(&model.write(folder.path(), "a"), &gltf::Options::default()).unwrap();
    for path in [
        model.write_embedded(folder.path(), "b"),
        model.write_beside(folder.path(), "c", "parts/my%20buffer.bin", &at("parts/my buffer.bin")),
        model.write_beside(folder.path(), "d", "./d.bin", &at("d.bin")),
    ] {
        let other = gltf::load(&path, &gltf::Options::default()).unwrap();
        let mut data = other.data.clone();
        // Each names its own file.
        data.meshes.iter_mut().zip(&glb.data.meshes).for_each(|(own, first)| own.file.clone_from(&first.file));
        assert_eq!(data, glb.data);
        let hashes = |of: &gltf::Import| of.meshes.iter().map(|m| m.content_hash()).collect::<Vec<_>>();
        assert_eq!(hashes(&other), hashes(&glb));
    }
}

#[test]
fn lights_are_balls_of_their_intensity() {
    let mut model = arrows();
    let point = model.light(json!({ "type": "point", "color": [1, 0.5, 0], "intensity": 12 }));
    let sun = model.light(json!({ "type": "directional", "intensity": 3, "color": [1, 0.5, 0] }));
    let dark = model.light(json!({ "type": "point", "intensity": 0 }));
    model.node(json!({ "name": "sun", "rotation": [-QUARTER, 0, 0, QUARTER], "extensions": sun }));
    for (light, name) in [(point, "lamp at"), (sun, "second sun"), (dark, "dark")] {
        model.node(json!({ "name": name, "translation": [1, 4, 2], "scale": [3, 3, 3], "extensions": light }));
    }
    let import = load(&model);
    let lamps: Vec<_> = import.data.entities.iter().filter(|e| e.mesh == "lamp").collect();
    let [lamp] = lamps[..] else { panic!("{} lamps", lamps.len()) };
    assert_eq!((lamp.name.as_deref(), lamp.position), (Some("lamp at"), Vec3::new(1., 4., 2.)));
    assert_eq!(lamp.receives, Some(false));
    // What a surface far away gets from a ball is its radiance times its outline over the square of the distance.
    let intensity = lamp.emission * std::f32::consts::PI * lamp.scale * lamp.scale;
    assert!((intensity - Vec3::new(12., 6., 0.)).length() < 0.3, "{intensity}");
    let said = import.notes.said().join("\n");
    assert!(said.contains(&format!("point and spot lights (1) are balls of radius {:.3} m", lamp.scale)), "{said}");
    assert!(said.contains("no sky") && import.data.environment.uniform.is_some(), "{said}");
    assert_eq!(import.data.output.exposure_ev, None);
    // Lux on a surface that faces the disc; directional lights look along -z.
    let sun = import.data.environment.sun.as_ref().unwrap();
    let share = std::f32::consts::PI * (sun.angle_deg.to_radians() / 2.0).sin().powi(2);
    assert!((sun.radiance * share - Vec3::new(3., 1.5, 0.)).length() < 1e-4, "{sun:?}");
    assert!((sun.toward - Vec3::Y).length() < 1e-6, "{sun:?}");
    assert!(said.contains("the directional light is a distant disc"), "{said}");
    assert_eq!(import.notes.left_out(), ["left out (1): further directional lights"]);
    assert!(import.data.environment.sky.is_none());
    // Blender writes lamps as 683 lumens a watt, and emission in watts.
    model.json["asset"]["generator"] = json!("Khronos glTF Blender I/O v4.5.47");
    let of_blender = load(&model);
    assert!(of_blender.notes.said().join("\n").contains("683 lumens a watt"), "{:?}", of_blender.notes.said());
    let radiance = of_blender.data.environment.sun.as_ref().unwrap().radiance;
    assert!((683.0 * radiance / sun.radiance - 1.0).truncate().length() < 1e-5, "{radiance}");
    let emission = of_blender.data.entities.iter().find(|e| e.mesh == "lamp").unwrap().emission;
    assert!((683.0 * emission / lamp.emission - 1.0).truncate().length() < 1e-5, "{emission}");
}

/// A spot 2 m above a floor, by rays: intensity over squared distance, and the falloff of KHR_lights_punctual.
#[test]
fn spots_shine_within_their_cone() {
    let mut model = Model::default();
    let paint = model.paint([1.0; 3]);
    let mesh = model.shape(&generate::plane(4.0, 12), Some(paint));
    model.node(json!({ "name": "floor", "mesh": mesh }));
    let spot = json!({ "innerConeAngle": 0.3, "outerConeAngle": 0.6 });
    let light = model.light(json!({ "type": "spot", "intensity": 10, "color": [1, 0.5, 0.25], "spot": spot }));
    let outer = model.node(json!({ "scale": [2, 2, 2], "translation": [0, 1, 0] }));
    let down = json!([-QUARTER, 0, 0, QUARTER]);
    model.child(outer, json!({ "translation": [0, 0.5, 0], "rotation": down, "extensions": light }));
    let (mut scene, notes) = model::scene(&model);
    scene.surround(&Surroundings::None).unwrap();
    assert_eq!(notes.left_out(), [""; 0]);
    assert_eq!(scene.entities.len(), 2, "a floor and a lamp: {:?}", notes.said());
    let cast = RayCast { rays: 512, seed: 3, ..Default::default() };
    let (lit, _) = shadow_fields::truth::picture(&scene, &scene.at(0.0), &cast);
    let (_, radiosity) = lit.iter().find(|(entity, _)| *entity == 0).unwrap();
    let mesh = &scene.meshes[scene.entities[0].mesh];
    let mut full = 0;
    let mut dark = 0;
    let mut between = 0;
    for (position, found) in mesh.positions.iter().zip(radiosity) {
        let to_lamp = DVec3::new(0.0, 2.0, 0.0) - position.as_dvec3();
        let cosine = to_lamp.y / to_lamp.length();
        let whole = 10.0 * cosine / to_lamp.length_squared() / std::f64::consts::PI;
        let share = f64::from(found[0]) / whole;
        assert!((found[1] / found[0].max(1e-9) - 0.5).abs() < 0.01 || found[0] < 1e-6, "{found:?}");
        let [inner, outer] = [0.3_f64, 0.6].map(f64::cos);
        let expected = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2);
        assert!((share - expected).abs() < 0.03, "{position}: {share} for {expected}");
        full += usize::from(expected == 1.0);
        dark += usize::from(expected == 0.0);
        between += usize::from((0.05..0.95).contains(&expected));
    }
    assert!(full > 3 && dark > 3 && between > 3, "{full} {dark} {between}");
}

#[test]
fn the_first_perspective_camera_is_taken() {
    let mut model = arrows();
    let flat = json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1 } });
    let view = json!({ "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.1, "aspectRatio": 1.5 } });
    let flat = model.push("cameras", flat);
    let view = model.push("cameras", view);
    model.node(json!({ "camera": flat }));
    // Turned by a quarter about +y, -z becomes -x.
    model.node(json!({ "camera": view, "translation": [9, 1, 0], "rotation": [0, QUARTER, 0, QUARTER] }));
    model.node(json!({ "camera": view }));
    let import = load(&model);
    let camera = &import.data.camera;
    assert_eq!(camera.eye, Vec3::new(9., 1., 0.));
    let ahead = (camera.target - camera.eye).normalize();
    assert!((ahead - Vec3::NEG_X).length() < 1e-5 && (camera.fov_deg - 0.5_f32.to_degrees()).abs() < 1e-4, "{ahead}");
    assert_eq!((import.data.output.width, import.data.output.height), (960, 640));
    assert_eq!(import.notes.left_out(), ["left out (1): cameras without perspective", "left out (1): further cameras"]);
}

#[test]
fn a_file_is_one_mesh_where_a_mesh_is_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = arrows();
    model.json["nodes"][0]["scale"] = json!([-1, 2, 1]);
    let (mesh, notes) = shadow_fields::scene::load_mesh(&model.write(folder.path(), "robot")).unwrap();
    assert_eq!((mesh.name.as_str(), mesh.triangles.len(), mesh.is_solid()), ("robot", 48, true));
    assert_box(&mesh.positions.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>(), [-2., -1., -0.5], [0.5, 4., 2.]);
    assert_eq!(notes, gltf::Notes::default());
    assert!(shadow_fields::scene::load_mesh(Path::new("none.glb")).is_err());
}
