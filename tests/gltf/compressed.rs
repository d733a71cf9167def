//! Meshes by Draco and meshoptimizer, textures in KTX2 and WebP: as if not packed, or refused in one line.

use crate::model::{Model, load, read, refusal};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use shadow_fields::asset::Mesh;
use shadow_fields::asset::picture::linear_from_srgb;
use std::path::Path;

/// A model from which mutation of inputs starts.
fn corpus(name: &str) -> Model {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus/glb");
    let file = std::fs::read(folder.join(format!("{name}.glb"))).unwrap();
    let (json, rest) = file[20..].split_at(u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize);
    Model { json: serde_json::from_slice(json).unwrap(), bytes: rest[8..].to_vec() }
}

/// Both packed meshes are a box from -1 to 2.
fn assert_box(mesh: &Mesh, tolerance: f32) {
    assert_eq!((mesh.triangles.len(), mesh.is_solid()), (12, true));
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let is_side = |x: f32| (x + 1.0).abs() <= tolerance || (x - 2.0).abs() <= tolerance;
        assert!(position.to_array().into_iter().all(is_side), "{position}");
        assert!((normal.abs().max_element() - 1.0).abs() <= 10.0 * tolerance, "{normal}");
    }
}

#[test]
fn a_packed_box_is_the_box() {
    assert_box(&load(&corpus("draco")).meshes[0], 1e-3);
    // Positions and normals have filters of meshoptimizer's, of which the box loses nothing.
    assert_box(&load(&corpus("meshopt")).meshes[0], 0.0);
}

/// A picture of 16 x 16 texels: its left half is red, its right half green above blue.
#[test]
fn textures_of_basis_and_webp_show_their_colours() {
    for name in ["etc1s", "uastc", "webp"] {
        let import = load(&corpus(name));
        assert_eq!(import.notes.left_out(), [""; 0]);
        let texture = &import.textures[0];
        let texels = texture.texels.as_ref().unwrap();
        assert_eq!((texels.width, texels.height), (16, 16));
        for (uv, rgb) in [([0.2, 0.5], [220, 30, 30]), ([0.8, 0.8], [30, 200, 40]), ([0.8, 0.2], [40, 60, 210])] {
            let linear = Vec3::from(rgb.map(|byte: u8| linear_from_srgb(f32::from(byte) / 255.0)));
            let found = texels.at(Vec2::from(uv), texture.wrap).truncate();
            assert!((found - linear).abs().max_element() < 0.05, "{name}: {found}, not {linear}");
        }
    }
}

#[test]
fn bad_data_are_refused_in_one_line() {
    let refused = |name: &str, path: &str, value: Value, message: &str| {
        let mut model = corpus(name);
        *model.json.pointer_mut(path).unwrap() = value;
        let line = refusal(read(&model, &Default::default()));
        assert!(line.contains(message), "{name}: {line} for {message}");
    };
    for (path, value, message) in [
        ("", json!({}), "missing field"),
        ("/bufferView", json!(9), "there is no bufferView 9"),
        ("/attributes/POSITION", json!(9), "there is no attribute 9"),
    ] {
        let draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
        refused("draco", &format!("{draco}{path}"), value, message);
    }
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
        refused("meshopt", &format!("/bufferViews/0/extensions/EXT_meshopt_compression{path}"), value, message);
    }
    for (name, length, message) in [
        ("draco", 314, "its data are damaged"),
        ("etc1s", 200, "images[0]: not a KTX2 picture that is read"),
        ("webp", 30, "images[0]: "),
    ] {
        refused(name, "/bufferViews/0/byteLength", json!(length), message);
    }
}
