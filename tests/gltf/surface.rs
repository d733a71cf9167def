//! Materials of glTF files: textures, emission, colours of vertices, and what is left out.

use crate::common::{generate, gpu, inside_out, joined};
use crate::model;
use glam::{Mat3, Vec3};
use model::{Model, U8, cuboid, load};
use serde_json::json;
use shadow_fields::asset::Mesh;
use shadow_fields::asset::picture::{linear_from_srgb, write_png};
use shadow_fields::scene::{Gloss, Maps, Scene};
use shadow_fields::truth::{RayCast, Vertex, World};
use shadow_fields::{bake, frame};

/// A square of 2 x 2 m with coordinates of textures, of a material that is no metal unless it says so.
fn square(model: &mut Model, mut material: serde_json::Value, with_uv: bool) -> usize {
    let metallic = &mut material["pbrMetallicRoughness"]["metallicFactor"];
    *metallic = if metallic.is_null() { 0.into() } else { metallic.clone() };
    let material = model.push("materials", material);
    let positions = model.positions(&[-1., -1., 0., 1., -1., 0., 1., 1., 0., -1., 1., 0.]);
    let mut attributes = json!({ "POSITION": positions });
    if with_uv {
        // The lower half of the picture.
        attributes["TEXCOORD_0"] = json!(model.floats(2, &[0.1, 0.9, 0.9, 0.9, 0.9, 0.6, 0.1, 0.6]));
    }
    let indices = model.indices(&[0, 1, 2, 0, 2, 3]);
    let mesh = model.mesh(attributes, Some(indices), Some(material));
    model.node(json!({ "mesh": mesh }))
}

/// A texture of 2 x 2 texels in linear colours: red, green; blue, white.
fn texture(model: &mut Model) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.png");
    write_png(&path, 2, 2, &[1., 0., 0., 0., 1., 0., 0., 0., 1., 1., 1., 1.], 0.0).unwrap();
    model.texture("image/png", &std::fs::read(path).unwrap())
}

#[test]
fn textures_paint_surfaces() {
    let mut model = Model::default();
    let texture = texture(&mut model);
    let material = |factor: [f32; 4], more: serde_json::Value| {
        let mut info = json!({ "index": texture });
        info.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        json!({ "pbrMetallicRoughness": { "baseColorFactor": factor, "baseColorTexture": info } })
    };
    square(&mut model, material([1.0, 0.5, 1.0, 1.0], json!({})), true);
    square(&mut model, material([1.0; 4], json!({})), false);
    let up = json!({ "extensions": { "KHR_texture_transform": { "offset": [0, -0.5] } } });
    square(&mut model, material([1.0; 4], up), true);
    // A quarter turn: what stands below stands at the right, green and white.
    let turn = json!({ "extensions": { "KHR_texture_transform": { "rotation": std::f32::consts::FRAC_PI_2 } } });
    square(&mut model, material([1.0; 4], turn), true);
    let (scene, notes) = model::scene(&model);
    assert_eq!(notes.left_out(), [""; 0]);
    let close = |a: Vec3, b: [f32; 3]| assert!((a - Vec3::from(b)).length() < 1e-3, "{a} for {b:?}");
    // What a place of the square's left and right halves shows, and the mean of what it shows.
    let shown = |i: usize, x: f32| {
        let entity = &scene.entities[i];
        let texture = &scene.textures[entity.texture.unwrap()];
        let mesh = &scene.meshes[entity.mesh];
        let uvs = mesh.uvs.as_ref().unwrap();
        let v = mesh.positions.iter().position(|p| p.x * x > 0.0).unwrap();
        texture.factor * texture.texels.as_ref().unwrap().at(uvs[v], texture.wrap).truncate()
    };
    close(shown(0, -1.0), [0.0, 0.0, 1.0]);
    close(shown(0, 1.0), [1.0, 0.5, 1.0]);
    close(scene.entities[0].albedo, [0.5, 0.25, 1.0]);
    close(scene.entities[1].albedo, [0.5, 0.5, 0.5]);
    assert!(scene.meshes[1].uvs.is_none(), "without coordinates its mean is shown");
    close(shown(2, -1.0), [1.0, 0.0, 0.0]);
    close(shown(2, 1.0), [0.0, 1.0, 0.0]);
    close(scene.entities[3].albedo, [0.5, 1.0, 0.5]);
}

/// A scene file that `import` writes names meshes and images of the glTF file, and reads as the same scene.
#[test]
fn an_imported_scene_has_the_same_textures_and_parts() {
    let mut model = Model::default();
    let texture = texture(&mut model);
    let info = json!({ "index": texture });
    let material = json!({ "pbrMetallicRoughness": { "baseColorTexture": info }, "alphaMode": "MASK", "name": "leaf" });
    let node = square(&mut model, material, true);
    model.json["nodes"][node]["scale"] = json!([1, 2, -3]);
    let folder = tempfile::tempdir().unwrap();
    let path = model.write(folder.path(), "model");
    let scene = Scene::load(&path).unwrap();
    let texture = &scene.data.textures[0];
    assert_eq!((texture.name.as_str(), texture.image, texture.alpha_cutoff), ("leaf", Some(0), Some(0.5)));
    let text = scene.to_toml().unwrap();
    let saved = folder.path().join("saved.toml");
    std::fs::write(&saved, &text).unwrap();
    let again = Scene::load(&saved).unwrap();
    assert_eq!((&again.data, &again.textures), (&scene.data, &scene.textures));
    assert_eq!(again.meshes[0], scene.meshes[0]);
    assert_eq!(again.entities, scene.entities);

    for (from, to, message) in [
        ("part = [0, 0]", "part = [0, 7]", "meshes[0].primitives[7]: there is no such primitive"),
        ("part = [0, 0]\n", "", "a piece of a part or an OBJ file"),
        ("image = 0", "image = 3", "images[3]: there is no such image"),
        ("image = 0", "", "`image` says which image of a glTF file it is"),
        ("albedo = \"leaf\"", "albedo = \"bark\"", "there is no texture \"bark\""),
        ("albedo = \"leaf\"", "albedo = 0.5", "an albedo: three numbers from 0 to 1, or the name of a texture"),
        ("alpha_cutoff = 0.5", "alpha_cutoff = 1.5", "alpha_cutoff is not within 0 to 1"),
        ("bend = [1.0", "bend = [0.0", "has a bend that is not finite, beyond 1e7, or flat"),
    ] {
        assert!(text.contains(from), "{from} in {text}");
        std::fs::write(&saved, text.replace(from, to)).unwrap();
        let error = Scene::load(&saved).unwrap_err();
        let line = error.to_string();
        assert!(error.exit_code() == 4 && line.contains(message) && !line.contains('\n'), "{line} for {message}");
    }
}

#[test]
fn a_jpeg_texture_without_coordinates_becomes_its_mean() {
    let mut model = Model::default();
    // Two halves of one colour each: blocks of JPEG lie within them.
    let halves = [[200, 80, 40], [40, 120, 220]];
    let picture = image::RgbImage::from_fn(64, 32, |x, _| image::Rgb(halves[(x / 32) as usize]));
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(&picture).unwrap();
    let texture = model.texture("image/jpeg", &bytes);
    square(&mut model, json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } }), false);
    let linear = |byte: u8| linear_from_srgb(f32::from(byte) / 255.0);
    let [left, right] = halves.map(|half| Vec3::from(half.map(linear)));
    let found = model::scene(&model).0.entities[0].albedo;
    let expected = (left + right) / 2.0;
    // A step of 8 bits is at most 0.009 in linear light here, and JPEG of this quality is off by about one.
    assert!((found - expected).abs().max_element() < 0.01, "{found} for {expected}");
}

#[test]
fn materials_reflect_as_they_say() {
    let mut model = Model::default();
    let mut add = |material: serde_json::Value| square(&mut model, material, false);
    add(json!({ "pbrMetallicRoughness": { "metallicFactor": 0.3, "roughnessFactor": 0.5 } }));
    // One that says nothing is a rough metal.
    let silent = add(json!({}));
    add(json!({ "extensions": { "KHR_materials_unlit": {} } }));
    let more = json!({ "KHR_materials_ior": { "ior": 2 }, "KHR_materials_specular": { "specularFactor": 0.5 } });
    add(json!({ "pbrMetallicRoughness": { "metallicFactor": 0 }, "extensions": more }));
    model.json["materials"][silent] = json!({});
    let import = load(&model);
    let gloss = |roughness, metallic, f0| Some(Gloss { roughness, metallic, f0 });
    let found: Vec<Option<Gloss>> = import.data.entities.iter().map(|entity| entity.gloss).collect();
    assert_eq!(found[..3], [gloss(0.5, 0.3, 0.04), gloss(1.0, 1.0, 0.04), None]);
    assert!((found[3].unwrap().f0 - 0.5 / 9.0).abs() < 1e-6, "half of (1 / 3)^2");
    assert_eq!(import.notes.left_out(), [""; 0]);
}

/// Textures of roughness, normals and emission are maps where their coordinates are those of the surface.
#[test]
fn textures_become_maps() {
    let mut model = Model::default();
    let texture = texture(&mut model);
    let info = json!({ "index": texture });
    let material = json!({
        "pbrMetallicRoughness": { "metallicRoughnessTexture": info, "roughnessFactor": 0.5 },
        "normalTexture": { "index": texture, "scale": 0.5 }, "emissiveTexture": info, "emissiveFactor": [1, 1, 1],
    });
    square(&mut model, material.clone(), true);
    let mut moved = material;
    moved["normalTexture"] = json!({ "index": texture, "texCoord": 1 });
    square(&mut model, moved, true);
    // Without coordinates the mean counts.
    let rough = json!({ "metallicRoughnessTexture": info, "metallicFactor": 1 });
    square(&mut model, json!({ "pbrMetallicRoughness": rough }), false);
    let shift = json!({ "KHR_texture_transform": { "offset": [0, -0.5] } });
    let shifted = json!({ "index": texture, "extensions": shift });
    let material = json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": shifted }, "normalTexture": shifted });
    square(&mut model, material, true);
    let import = load(&model);
    let [all, other, plain, shifted] = [0, 1, 2, 3].map(|index| &import.data.entities[index]);
    assert_eq!((all.maps.normal_scale, shifted.maps.normal_scale), (Some(0.5), None));
    assert!(shifted.maps.gloss.is_some() && shifted.maps.gloss == shifted.maps.normal);
    assert!(all.maps.gloss.is_some() && all.maps.gloss == all.maps.normal && all.maps.gloss == all.maps.glow);
    assert_eq!((all.gloss.unwrap().roughness, all.emits), (0.5, Some(false)));
    assert!(other.maps.normal.is_none() && other.maps.gloss == all.maps.gloss);
    assert_eq!(plain.maps, Maps::default());
    let [_, green, blue] = import.textures[0].texels.as_ref().unwrap().mean_bytes();
    let gloss = plain.gloss.unwrap();
    assert_eq!((gloss.roughness, gloss.metallic), (green, blue));
    let left_out = import.notes.left_out();
    assert_eq!(left_out.len(), 1, "{left_out:?}");
    assert!(left_out[0].starts_with("left out (2): textures with coordinates of their own"), "{left_out:?}");
}

#[test]
fn emission_has_its_strength_and_pattern() {
    let mut model = Model::default();
    let texture = texture(&mut model);
    let glow = |more: serde_json::Value| {
        let mut json = json!({ "emissiveFactor": [1, 0.5, 0.25] });
        json.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        json
    };
    let strong = json!({ "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 40 } } });
    square(&mut model, glow(json!({})), true);
    square(&mut model, glow(strong), true);
    square(&mut model, glow(json!({ "emissiveTexture": { "index": texture } })), true);
    square(&mut model, json!({ "emissiveTexture": { "index": texture } }), true);
    let import = load(&model);
    let entities = &import.data.entities;
    assert_eq!(entities[0].emission, Vec3::new(1.0, 0.5, 0.25));
    assert_eq!(entities[1].emission, Vec3::new(40.0, 20.0, 10.0));
    // A flat shape is one lamp of its mean: half of it is blue, and half white.
    let mean = entities[2].emission / Vec3::new(1.0, 0.5, 0.25);
    assert!((mean - Vec3::new(0.5, 0.5, 1.0)).abs().max_element() < 0.1, "{mean}");
    assert_eq!(entities[3].emission, Vec3::ZERO);
    assert!(import.meshes[2].colors.is_none() && entities[2].maps.glow.is_some());
    assert!(import.meshes[0].colors.is_none());
    let fill = import.data.environment.uniform.expect("a dim sky beside the lamp of radiance 40");
    assert!(fill.x > 0.01 && fill.x <= 4.0 && import.data.environment.sky.is_none(), "{fill}");
    assert_eq!(import.data.output.exposure_ev, None);
    assert_eq!(import.notes.left_out(), [""; 0]);
}

/// A screen with a black frame, folded once, is as bright as its picture and not as its corners.
#[test]
fn what_is_not_flat_glows_as_its_picture_does_on_average() {
    let mut model = Model::default();
    let picture = image::GrayImage::from_fn(64, 64, |x, y| {
        let is_frame = [x, y].iter().any(|at| !(8..56).contains(at));
        image::Luma([if is_frame { 0 } else { 255 }])
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let texture = model.texture("image/png", bytes.get_ref());
    let glow = json!({ "emissiveFactor": [9, 9, 9], "emissiveTexture": { "index": texture } });
    let material = model.push("materials", glow);
    let positions = model.positions(&[-1., 0., 0., 0., 0., 0., 1., 0., -1., -1., 1., 0., 0., 1., 0., 1., 1., -1.]);
    let uvs = model.floats(2, &[0., 1., 0.5, 1., 1., 1., 0., 0., 0.5, 0., 1., 0.]);
    let indices = model.indices(&[0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4]);
    model.placed(json!({ "POSITION": positions, "TEXCOORD_0": uvs }), Some(indices), Some(material));
    let (scene, _) = model::scene(&model);
    let mesh = &scene.meshes[0];
    let colors = mesh.colors.as_ref().unwrap();
    let mean = mesh.triangles.iter().flatten().map(|&v| colors[v as usize].x).sum::<f32>() / 12.0;
    assert!((mean - 0.5625).abs() < 0.03, "{mean}: the frame leaves 0.75 x 0.75");
}

#[test]
fn colours_of_vertices_tint_a_surface() {
    let mut model = Model::default();
    // A triangle of 3 m^2 in black and, at its side, one of 1 m^2 in white.
    let third = 1.0 / 3.0;
    let positions = model.positions(&[0., 0., 0., 6., 0., 0., 0., 1., 0., 6., 0., 0., 0., 0., 0., 0., 0., third]);
    let colors =
        model.accessor(U8, 4, 6, &[[0, 0, 0, 255]; 3].into_iter().chain([[255; 4]; 3]).flatten().collect::<Vec<u8>>());
    model.json["accessors"][colors]["normalized"] = json!(true);
    model.placed(json!({ "POSITION": positions, "COLOR_0": colors }), None, None);
    let (scene, _) = model::scene(&model);
    assert!((scene.entities[0].albedo - Vec3::splat(0.25)).length() < 1e-6, "the mean by area");
    let tints = scene.meshes[0].tints.as_ref().unwrap();
    assert_eq!(*tints, [[Vec3::ZERO; 3], [Vec3::ONE; 3]].concat());
}

/// The alpha of its vertices is a factor on a surface's own.
#[test]
fn alphas_of_vertices_blend_a_surface() {
    let mut model = Model::default();
    let positions = model.positions(&[0., 0., 0., 6., 0., 0., 0., 1., 0.]);
    let colors = model.floats(4, &[1., 1., 1., 0.2, 1., 1., 1., 0.4, 1., 1., 1., 0.6]);
    for mode in ["BLEND", "OPAQUE"] {
        let color = json!({ "baseColorFactor": [1, 1, 1, 0.5] });
        let material = model.push("materials", json!({ "alphaMode": mode, "pbrMetallicRoughness": color }));
        model.placed(json!({ "POSITION": positions, "COLOR_0": colors }), None, Some(material));
    }
    let (scene, _) = model::scene(&model);
    assert!((scene.entities[0].opacity - 0.2).abs() < 1e-6, "{}", scene.entities[0].opacity);
    assert_eq!(scene.entities[1].opacity, 1.0);
}

/// Of blending the alpha is the opacity; glass keeps back and reflects only what its colour does not pass.
#[test]
fn blended_and_transmissive_surfaces_let_light_through() {
    let mut model = Model::default();
    let color = |alpha: f32| json!({ "baseColorFactor": [0.5, 0.5, 0.5, alpha], "metallicFactor": 0 });
    square(&mut model, json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": color(0.25) }), false);
    square(&mut model, json!({ "alphaMode": "OPAQUE", "pbrMetallicRoughness": color(0.25) }), false);
    let glass = json!({ "KHR_materials_transmission": { "transmissionFactor": 0.8 } });
    square(&mut model, json!({ "pbrMetallicRoughness": color(1.0), "extensions": glass }), false);
    // Half of it is red.
    let texture = texture(&mut model);
    let half = json!({ "transmissionFactor": 0.8, "transmissionTexture": { "index": texture } });
    let glass = json!({ "KHR_materials_transmission": half });
    square(&mut model, json!({ "pbrMetallicRoughness": color(1.0), "extensions": glass }), false);
    let pane = json!({ "alphaMode": "BLEND", "doubleSided": true, "pbrMetallicRoughness": color(0.25) });
    square(&mut model, pane, false);
    let (scene, _) = model::scene(&model);
    // Both sides of a pane are lit.
    let has_backs = |entity: usize| scene.meshes[scene.entities[entity].mesh].is_two_sided();
    assert!(!has_backs(0) && has_backs(4));
    for (entity, opacity, albedo) in [(0, 0.25, 0.125), (1, 1.0, 0.5), (2, 0.6, 0.1), (3, 0.8, 0.3)] {
        let found = &scene.entities[entity];
        assert!((found.opacity - opacity).abs() < 1e-6 && (found.albedo.x - albedo).abs() < 1e-6, "{found:?}");
        assert_eq!(found.transparent, opacity < 1.0);
    }
}

/// A room, wound to face inwards or outwards, with things in it, all of them double-sided, and a lamp behind a page.
fn study(outwards: bool) -> Model {
    let mut model = Model::default();
    // A square that stands upright and faces +z.
    let page = |size_m: f32, at: [f32; 3]| {
        let flat = generate::plane(size_m, 8);
        let up = |v: &Vec3| Mat3::from_rotation_x(std::f32::consts::FRAC_PI_2) * *v;
        let positions = flat.positions.iter().map(up).collect();
        let normals = flat.normals.iter().map(up).collect();
        joined(&[(&Mesh::new("page", positions, normals, None, flat.triangles).unwrap(), Vec3::from(at))])
    };
    let room = cuboid([-2., 0., -2.], [2., 3., 2.]);
    let crate_ = cuboid([1., 0., -1.], [1.5, 0.5, -0.5]);
    let shapes = [
        ("room", if outwards { room } else { inside_out(&room) }),
        ("crate", crate_.clone()),
        ("crate, inside out", joined(&[(&inside_out(&crate_), Vec3::new(-2.5, 0.0, 0.0))])),
        ("page", page(0.8, [0., 1., 0.3])),
        ("picture", page(1.0, [0., 1.5, -1.98])),
    ];
    let pbr = json!({ "baseColorFactor": [0.7, 0.6, 0.5, 1.0], "metallicFactor": 0 });
    for (name, mesh) in shapes {
        let material = model.push("materials", json!({ "doubleSided": true, "pbrMetallicRoughness": pbr }));
        let mesh = model.shape(&mesh, Some(material));
        model.node(json!({ "name": name, "mesh": mesh }));
    }
    let lamp = model.light(json!({ "type": "point", "intensity": 20 }));
    model.node(json!({ "name": "lamp", "translation": [0.8, 1.5, -0.6], "extensions": lamp }));
    let camera = json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } });
    let camera = model.push("cameras", camera);
    model.node(json!({ "camera": camera, "translation": [0, 1.2, 1.8] }));
    model
}

#[test]
fn double_sided_shapes_have_the_sides_that_are_seen() {
    for outwards in [false, true] {
        let (scene, notes) = model::scene(&study(outwards));
        assert_eq!(notes.left_out(), [""; 0]);
        let of = |name: &'static str| {
            let entities = scene.entities.iter().filter(move |entity| entity.name.starts_with(name));
            entities.map(|entity| &scene.meshes[entity.mesh])
        };
        let faces = |mesh: &Mesh, middle: Vec3, outwards: bool| {
            mesh.positions.iter().zip(&mesh.normals).all(|(at, normal)| (normal.dot(*at - middle) > 0.0) == outwards)
        };
        assert!(of("room").all(|mesh| faces(mesh, mesh.bounding_sphere().0, false) && mesh.triangles.len() == 12));
        for mesh in of("crate") {
            assert!(faces(mesh, mesh.bounding_sphere().0, true) && mesh.is_solid(), "{}", mesh.name);
        }
        assert_eq!(of("crate").count(), 2);
        assert!(of("page").all(|mesh| mesh.is_two_sided()) && !of("picture").any(|mesh| mesh.is_two_sided()));
    }

    // One side of the page is in the lamp's light.
    let Some(gpu) = gpu() else { return };
    let (scene, _) = model::scene(&study(false));
    let page = scene.entities.iter().position(|entity| entity.name == "page").unwrap();
    let options =
        frame::Options { bake: bake::Options { groups: true, ..bake::Quality::Draft.options() }, ..Default::default() };
    let mut frame = gpu.frame(&scene, options);
    let placements = scene.at(0.0);
    let light = gpu.light(&mut frame, &placements).swap_remove(page);
    let vertices: Vec<Vertex> = (0..light.len()).map(|index| Vertex { entity: page, index }).collect();
    let rays =
        RayCast { rays: 256, bounces: 24, ..Default::default() }.run(&World::of(frame.scene(), &placements), &vertices);
    let normals = &frame.scene().surface(page).normals;
    let side = |all: &[f64], back: bool| {
        let of: Vec<f64> = all.iter().zip(normals).filter(|(_, n)| (n.z < 0.0) == back).map(|(x, _)| *x).collect();
        of.iter().sum::<f64>() / of.len() as f64
    };
    let found: Vec<f64> = light.iter().map(|rgb| f64::from(rgb[0])).collect();
    let expected: Vec<f64> = rays.iter().map(|estimate| estimate.radiosity[0]).collect();
    let sides = [false, true].map(|back| (side(&found, back), side(&expected, back)));
    for (found, expected) in sides {
        assert!((found / expected - 1.0).abs() < 0.1, "{sides:?}");
    }
    assert!(sides[1].1 > 2.0 * sides[0].1, "the lamp stands behind the page: {sides:?}");
}
