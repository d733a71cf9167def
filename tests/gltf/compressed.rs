//! Meshes compressed by Draco and meshoptimizer and textures in KTX2 and WebP: as if they were not, or refused in one
//! line.

use crate::model::{self, F32, I8, Model, U16, cuboid, load, refusal};
use base64::Engine as _;
use draco_core::{DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use shadow_fields::scene::gltf;

/// A box, packed by Draco or not, and the place of its data.
fn draco_box() -> (Model, Vec<u8>) {
    let (positions, normals, indices) = cuboid([-1.0; 3], [2.0; 3]);
    let mut mesh = Mesh::new();
    for (kind, numbers) in [(GeometryAttributeType::Position, &positions), (GeometryAttributeType::Normal, &normals)] {
        let mut attribute = PointAttribute::new();
        attribute.init(kind, 3, DataType::Float32, false, numbers.len() / 3);
        let bytes: Vec<u8> = numbers.iter().flat_map(|x: &f32| x.to_le_bytes()).collect();
        attribute.buffer_mut().write(0, &bytes);
        mesh.add_attribute(attribute);
    }
    mesh.set_num_faces(indices.len() / 3);
    let corners: Vec<u32> = indices.iter().map(|i| u32::from(*i)).collect();
    mesh.set_faces_from_flat_indices(&corners);
    let mut out = EncoderBuffer::new();
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    encoder.encode(&EncoderOptions::default(), &mut out).unwrap();
    let packed = out.data().to_vec();

    let mut model = Model::default();
    let view = model.view(&packed);
    let mut accessor = |component: u32, kind: &str, count: usize| {
        let bounds = json!([0, 0, 0]);
        model.push(
            "accessors",
            json!({ "componentType": component, "type": kind, "count": count, "min": bounds, "max": bounds }),
        )
    };
    let count = positions.len() / 3;
    let attributes = json!({ "POSITION": accessor(F32, "VEC3", count), "NORMAL": accessor(F32, "VEC3", count) });
    let indices = accessor(U16, "SCALAR", indices.len());
    let mesh = model.mesh(attributes, Some(indices), None);
    model.json["meshes"][mesh]["primitives"][0]["extensions"] = json!({ "KHR_draco_mesh_compression":
        { "bufferView": view, "attributes": { "POSITION": 0, "NORMAL": 1 } } });
    model.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    model.node(json!({ "mesh": mesh }));
    (model, packed)
}

#[test]
fn a_box_packed_by_draco_is_the_box() {
    let import = load(&draco_box().0);
    let mesh = &import.meshes[0];
    assert_eq!((mesh.triangles.len(), mesh.is_solid()), (12, true));
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        assert!(position.to_array().iter().all(|x| (x + 1.0).abs() < 1e-3 || (x - 2.0).abs() < 1e-3), "{position}");
        assert!((normal.abs().max_element() - 1.0).abs() < 1e-2, "{normal}");
    }
}

/// A box of quantised positions and normals, packed by meshoptimizer with a filter for each.
fn meshopt_box() -> Model {
    let (positions, normals, indices) = cuboid([-1.0; 3], [2.0; 3]);
    let count = positions.len() / 3;
    let triples: Vec<[f32; 3]> = positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    let exact = meshopt::encode_filter_exp::<3>(&triples, 12, meshopt::EncodeExpMode::Separate);
    let octahedral: Vec<[f32; 4]> = normals.chunks_exact(3).map(|n| [n[0], n[1], n[2], 0.0]).collect();
    let octahedral = meshopt::encode_filter_oct::<i8>(&octahedral, 8);
    let corners: Vec<u32> = indices.iter().map(|i| u32::from(*i)).collect();

    let mut model = Model::default();
    let mut packed = |bytes: &[u8], count: usize, stride: usize, mode: &str, filter: &str| {
        let view = model.view(bytes);
        let stored = model.json["bufferViews"][view].clone();
        let extension = json!({ "buffer": 0, "byteOffset": stored["byteOffset"], "byteLength": bytes.len(),
            "byteStride": stride, "count": count, "mode": mode, "filter": filter });
        // Where it is not read, the view is of another buffer, which has no bytes.
        let json = &mut model.json["bufferViews"][view];
        *json = json!({ "buffer": 1, "byteLength": count * stride,
            "extensions": { "EXT_meshopt_compression": extension } });
        if mode == "ATTRIBUTES" {
            json["byteStride"] = json!(stride);
        }
        view
    };
    let of_positions = meshopt::encode_vertex_buffer(&exact).unwrap();
    let of_positions = packed(&of_positions, count, 12, "ATTRIBUTES", "EXPONENTIAL");
    let of_normals = meshopt::encode_vertex_buffer(&octahedral).unwrap();
    let of_normals = packed(&of_normals, count, 4, "ATTRIBUTES", "OCTAHEDRAL");
    let of_corners = meshopt::encode_index_buffer(&corners, count).unwrap();
    let of_corners = packed(&of_corners, corners.len(), 2, "TRIANGLES", "NONE");
    let bounds = json!([0, 0, 0]);
    let positions = json!({ "bufferView": of_positions, "componentType": F32, "type": "VEC3", "count": count,
        "min": bounds, "max": bounds });
    let positions = model.push("accessors", positions);
    let normals =
        json!({ "bufferView": of_normals, "componentType": I8, "type": "VEC3", "count": count, "normalized": true });
    let normals = model.push("accessors", normals);
    let indices = json!({ "bufferView": of_corners, "componentType": U16, "type": "SCALAR", "count": corners.len() });
    let indices = model.push("accessors", indices);
    let mesh = model.mesh(json!({ "POSITION": positions, "NORMAL": normals }), Some(indices), None);
    model.node(json!({ "mesh": mesh }));
    model.json["extensionsRequired"] = json!(["EXT_meshopt_compression", "KHR_mesh_quantization"]);
    model
}

/// A model with a second buffer that has no bytes.
fn read(model: &Model) -> shadow_fields::Result<gltf::Import> {
    let folder = tempfile::tempdir().unwrap();
    let mut json = model.json.clone();
    let fallback = json!({ "EXT_meshopt_compression": { "fallback": true } });
    json["buffers"] = json!([{ "byteLength": model.bytes.len() }, { "byteLength": 1 << 20, "extensions": fallback }]);
    let path = folder.path().join("m.glb");
    std::fs::write(&path, model::glb(json.to_string().as_bytes(), &model.bytes)).unwrap();
    gltf::load(&path, &gltf::Options::default())
}

#[test]
fn a_box_packed_by_meshoptimizer_is_the_box() {
    let import = read(&meshopt_box()).unwrap();
    let mesh = &import.meshes[0];
    assert_eq!((mesh.triangles.len(), mesh.is_solid()), (12, true));
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        assert!(position.to_array().iter().all(|x| *x == -1.0 || *x == 2.0), "{position}");
        assert_eq!(normal.abs().max_element(), 1.0, "{normal}");
    }
}

/// A picture of 16 x 16 texels: its left half is red, its right half green above blue.
const KTX2: [&str; 2] = [
    "q0tUWCAyMLsNChoKAAAAAAEAAAAQAAAAEAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAAAAAAkAAAAAAAAABIAQAAAAAA\
    AAQAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVy\
    c2FsIDIuNTAAAAMAAgAvAAAACQAAADAAAAAAAAAAAAAAAAAAAAAEAAAAAAAAAAAAAAAWwIQAAQAAABCEH6oCmBIAAAAAAEAGqB6AGQAAAAAAAKQNBGAK\
    AAAAAAAEYiVvDKyqqqpSVVVVBRTAhAABAAAAALJBBoAJAAAAAAAQZENAlIABAABA2LhEEoEoRwBmAAAAAAAAkAQEANOVwwo=",
    "q0tUWCAyMLsNChoKAAAAAAEAAAAQAAAAEAAAAAAAAAAAAAAAAQAAAAEAAAACAAAAaAAAACwAAACUAAAAJAAAAAAAAAAAAAAAAAAAAAAAAAC4AAAAAAAA\
    ADMAAAAAAAAAAAEAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AAAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVy\
    c2FsIDIuNTAAACi1L/1gAABNAQC4l9vD4z/ahADXAxnlfzD6F4VH+l8NYgEGAAUSmAG5BzwFsNhMBAjABQ==",
];

fn textured(picture: &[u8], extension: &str) -> Model {
    let mut model = Model::default();
    let view = model.view(picture);
    let image = model.push("images", json!({ "bufferView": view, "mimeType": "image/other" }));
    let texture = model.push("textures", json!({ "extensions": { extension: { "source": image } } }));
    let material = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } });
    let material = model.push("materials", material);
    let positions = model.positions(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let places = model.floats(2, &[0., 0., 1., 0., 0., 1.]);
    let mesh = model.mesh(json!({ "POSITION": positions, "TEXCOORD_0": places }), None, Some(material));
    model.node(json!({ "mesh": mesh }));
    model.json["extensionsRequired"] = json!([extension]);
    model
}

fn webp() -> Vec<u8> {
    let mut bytes = Vec::new();
    let texel = |i: usize| {
        if i % 16 < 8 {
            [220, 30, 30]
        } else if i < 128 {
            [30, 200, 40]
        } else {
            [40, 60, 210]
        }
    };
    let texels: Vec<u8> = (0..256).flat_map(texel).collect();
    image::codecs::webp::WebPEncoder::new_lossless(&mut bytes)
        .encode(&texels, 16, 16, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

#[test]
fn textures_of_basis_and_webp_show_their_colours() {
    let ktx2 = KTX2.map(|text| base64::engine::general_purpose::STANDARD.decode(text).unwrap());
    for (picture, extension) in
        [(ktx2[0].clone(), "KHR_texture_basisu"), (ktx2[1].clone(), "KHR_texture_basisu"), (webp(), "EXT_texture_webp")]
    {
        let import = load(&textured(&picture, extension));
        assert_eq!(import.notes.left_out(), [""; 0]);
        let texture = &import.textures[0];
        let texels = texture.texels.as_ref().unwrap();
        assert_eq!((texels.width, texels.height), (16, 16));
        for (uv, rgb) in [([0.2, 0.5], [220, 30, 30]), ([0.8, 0.8], [30, 200, 40]), ([0.8, 0.2], [40, 60, 210])] {
            let linear = Vec3::from(rgb.map(|c: u8| picture_linear(c)));
            let found = texels.at(Vec2::from(uv), texture.wrap).truncate();
            assert!((found - linear).abs().max_element() < 0.05, "{extension}: {found}, not {linear}");
        }
    }
}

fn picture_linear(byte: u8) -> f32 {
    shadow_fields::asset::picture::linear_from_srgb(f32::from(byte) / 255.0)
}

#[test]
fn bad_data_are_refused_in_one_line() {
    let of = |model: &Model| refusal(model::read(model, &gltf::Options::default()));
    let changed = |model: &mut Model, path: &str, value: Value| *model.json.pointer_mut(path).unwrap() = value;
    let draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    for (path, value, message) in [
        ("", json!({}), "missing field"),
        ("/bufferView", json!(9), "there is no bufferView 9"),
        ("/attributes/POSITION", json!(9), "there is no attribute 9"),
    ] {
        let (mut model, _) = draco_box();
        changed(&mut model, &format!("{draco}{path}"), value);
        let line = of(&model);
        assert!(line.contains(message), "{line}");
    }
    let (mut model, packed) = draco_box();
    changed(&mut model, "/bufferViews/0/byteLength", json!(packed.len() / 2));
    assert!(of(&model).contains("its data are damaged"), "{}", of(&model));
    let meshopt = "/bufferViews/0/extensions/EXT_meshopt_compression";
    for (path, value, message) in [
        ("/mode", json!("OTHER"), "unknown variant"),
        ("/filter", json!("OCTAHEDRAL"), "12 bytes do not fit its filter"),
        ("/byteStride", json!(13), "do not fit its mode"),
        ("/byteStride", json!(260), "260 bytes are not within"),
        ("/count", json!(4_000_000_000_u64), "4000000000 elements"),
        ("/byteLength", json!(1_000_000), "leave a buffer of"),
        ("/buffer", json!(7), "there is no buffer 7"),
        ("/byteLength", json!(20), "its data are damaged"),
    ] {
        let mut model = meshopt_box();
        changed(&mut model, &format!("{meshopt}{path}"), value);
        let line = refusal(read(&model));
        assert!(line.contains(message), "{line} for {message}");
    }
    let mut cut = base64::engine::general_purpose::STANDARD.decode(KTX2[0]).unwrap();
    cut.truncate(200);
    let line = of(&textured(&cut, "KHR_texture_basisu"));
    assert!(line.contains("images[0]: not a KTX2 picture that is read"), "{line}");
    let mut cut = webp();
    cut.truncate(30);
    assert!(
        of(&textured(&cut, "EXT_texture_webp")).contains("images[0]: "),
        "{}",
        of(&textured(&cut, "EXT_texture_webp"))
    );
}
