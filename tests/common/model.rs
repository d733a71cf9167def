//! Makes glTF models: JSON with accessors into one buffer, as GLB or as JSON with the buffer within or beside it.

#![allow(dead_code)] // every test binary uses its own part

use super::common::{generate, joined};
use base64::Engine as _;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use shadow_fields::Result;
use shadow_fields::asset::Mesh;
use shadow_fields::scene::{Scene, gltf};
use std::path::{Path, PathBuf};

/// Sine and cosine of 45 degrees: what quaternions of a quarter turn have.
pub const QUARTER: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Keys of half a turn about +y.
const TURN: [f32; 12] = [0., 0., 0., 1., 0., QUARTER, 0., QUARTER, 0., 1., 0., 0.];

/// Component types of accessors.
pub const I8: u32 = 5120;
pub const U8: u32 = 5121;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// A model in the making. The JSON may be changed before it is written.
#[derive(Clone)]
pub struct Model {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Default for Model {
    fn default() -> Self {
        Model { json: json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }] }), bytes: vec![] }
    }
}

/// Adds an element to a list, which may not be there yet, and returns its index.
fn push(list: &mut Value, value: Value) -> usize {
    if list.is_null() {
        *list = json!([]);
    }
    let list = list.as_array_mut().unwrap();
    list.push(value);
    list.len() - 1
}

impl Model {
    /// Adds an element to a list at the top and returns its index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        push(&mut self.json[list], value)
    }

    /// A buffer view of these bytes.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// An accessor of bytes as they stand.
    pub fn accessor(&mut self, component: u32, width: usize, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        let json = json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        self.push("accessors", json)
    }

    pub fn floats(&mut self, width: usize, numbers: &[f32]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(F32, width, numbers.len() / width, &bytes)
    }

    /// An accessor of positions, with the bounds that the specification demands.
    pub fn positions(&mut self, numbers: &[f32]) -> usize {
        let index = self.floats(3, numbers);
        let of = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..3).map(|axis| numbers.iter().skip(axis).step_by(3).copied().reduce(pick).unwrap()).collect()
        };
        self.json["accessors"][index]["min"] = json!(of(f32::min));
        self.json["accessors"][index]["max"] = json!(of(f32::max));
        index
    }

    /// An accessor of u16 indices.
    pub fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(U16, 1, indices.len(), &bytes)
    }

    pub fn mesh(&mut self, attributes: Value, indices: Option<usize>, material: Option<usize>) -> usize {
        let mut primitive = json!({ "attributes": attributes });
        if let Some(indices) = indices {
            primitive["indices"] = json!(indices);
        }
        if let Some(material) = material {
            primitive["material"] = json!(material);
        }
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    /// A mesh of one primitive, and a node that has nothing else.
    pub fn placed(&mut self, attributes: Value, indices: Option<usize>, material: Option<usize>) -> usize {
        let mesh = self.mesh(attributes, indices, material);
        self.node(json!({ "mesh": mesh }));
        mesh
    }

    /// A node that stands in no other.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        push(&mut self.json["scenes"][0]["nodes"], json!(index));
        index
    }

    /// A node that stands in another.
    pub fn child(&mut self, of: usize, node: Value) -> usize {
        let index = self.push("nodes", node);
        push(&mut self.json["nodes"][of]["children"], json!(index));
        index
    }

    /// A material of one base colour.
    pub fn paint(&mut self, rgb: [f32; 3]) -> usize {
        let pbr = json!({ "baseColorFactor": [rgb[0], rgb[1], rgb[2], 1.0], "metallicFactor": 0 });
        self.push("materials", json!({ "pbrMetallicRoughness": pbr }))
    }

    /// A mesh of one primitive with positions, normals and indices.
    pub fn shape(&mut self, mesh: &Mesh, material: Option<usize>) -> usize {
        let positions = self.positions(bytemuck::cast_slice(&mesh.positions));
        let normals = self.floats(3, bytemuck::cast_slice(&mesh.normals));
        let indices = self.indices(&corners(mesh));
        self.mesh(json!({ "POSITION": positions, "NORMAL": normals }), Some(indices), material)
    }

    /// The same of a box between two corners.
    pub fn cuboid(&mut self, low: [f32; 3], high: [f32; 3], material: Option<usize>) -> usize {
        self.shape(&cuboid(low, high), material)
    }

    /// An animation channel of a node: times and numbers, `width` a value.
    pub fn animate(&mut self, animation: usize, node: usize, path: &str, how: &str, times: &[f32], numbers: &[f32]) {
        let width = if path == "rotation" { 4 } else { 3 };
        let input = self.floats(1, times);
        let output = self.floats(width, numbers);
        while self.json["animations"].as_array().map_or(0, Vec::len) <= animation {
            self.push("animations", json!({ "channels": [], "samplers": [] }));
        }
        let json = &mut self.json["animations"][animation];
        let sampler = json!({ "input": input, "output": output, "interpolation": how });
        let sampler = push(&mut json["samplers"], sampler);
        push(&mut json["channels"], json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }

    /// Adds a light and returns the extensions of a node that holds it.
    pub fn light(&mut self, light: Value) -> Value {
        self.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        let index = push(&mut self.json["extensions"]["KHR_lights_punctual"]["lights"], light);
        json!({ "KHR_lights_punctual": { "light": index } })
    }

    /// A texture of a picture's bytes.
    pub fn texture(&mut self, mime: &str, picture: &[u8]) -> usize {
        let view = self.view(picture);
        let image = self.push("images", json!({ "bufferView": view, "mimeType": mime }));
        self.push("textures", json!({ "source": image }))
    }

    /// The JSON with its buffer.
    pub fn whole(&self) -> Value {
        let mut json = self.json.clone();
        if !self.bytes.is_empty() {
            if json["buffers"].is_null() {
                json["buffers"] = json!([{}]);
            }
            json["buffers"][0]["byteLength"] = json!(self.bytes.len());
        }
        json
    }

    /// Writes `NAME.gltf` into a folder, with its buffer at `uri`.
    fn write_json(&self, folder: &Path, name: &str, uri: &str) -> PathBuf {
        let mut json = self.whole();
        json["buffers"][0]["uri"] = json!(uri);
        let path = folder.join(format!("{name}.gltf"));
        std::fs::write(&path, json.to_string()).unwrap();
        path
    }

    pub fn glb(&self) -> Vec<u8> {
        glb(self.whole().to_string().as_bytes(), &self.bytes)
    }

    /// Writes `NAME.glb` into a folder.
    pub fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(format!("{name}.glb"));
        std::fs::write(&path, self.glb()).unwrap();
        path
    }

    /// Writes `NAME.gltf` into a folder, with its buffer as base64.
    pub fn write_embedded(&self, folder: &Path, name: &str) -> PathBuf {
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        self.write_json(folder, name, &format!("data:application/octet-stream;base64,{data}"))
    }

    /// Writes `NAME.gltf` into a folder, with its buffer in a file beside it that `uri` names.
    pub fn write_beside(&self, folder: &Path, name: &str, uri: &str, file: &Path) -> PathBuf {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, &self.bytes).unwrap();
        self.write_json(folder, name, uri)
    }
}

/// Reads a model by way of a GLB file.
pub fn read(model: &Model, options: &gltf::Options) -> Result<gltf::Import> {
    let folder = tempfile::tempdir().unwrap();
    gltf::load(&model.write(folder.path(), "m"), options)
}

/// The same of a good model.
pub fn load(model: &Model) -> gltf::Import {
    read(model, &gltf::Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// The one line with exit code 4 by which a model is refused.
pub fn refusal(read: Result<gltf::Import>) -> String {
    let error = read.map(|_| ()).unwrap_err();
    let line = error.to_string();
    assert!(error.exit_code() == 4 && !line.contains('\n'), "{line}");
    line
}

/// A model as a scene, and what is left out of it.
pub fn scene(model: &Model) -> (Scene, gltf::Notes) {
    let folder = tempfile::tempdir().unwrap();
    Scene::load_with_notes(&model.write(folder.path(), "m"), &gltf::Options::default()).unwrap()
}

/// A floor, a stretched box on it that turns, a glowing ball-like box and a lamp.
pub fn room() -> Model {
    let mut model = Model::default();
    let floor = model.paint([0.6, 0.6, 0.5]);
    let body = model.paint([0.2, 0.5, 0.8]);
    let glow = json!({ "emissiveFactor": [1, 0.4, 0.1], "pbrMetallicRoughness": { "metallicFactor": 0 },
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 30 } } });
    let glow = model.push("materials", glow);
    let mesh = model.cuboid([-3., -0.1, -3.], [3., 0., 3.], Some(floor));
    model.node(json!({ "name": "floor", "mesh": mesh }));
    let mesh = model.cuboid([-0.4; 3], [0.4; 3], Some(body));
    let box_ = model.node(json!({ "name": "box", "mesh": mesh, "translation": [0, 0.8, 0], "scale": [1, 1.6, 1] }));
    model.animate(0, box_, "rotation", "LINEAR", &[0., 1., 2.], &TURN);
    let mesh = model.cuboid([-0.1; 3], [0.1; 3], Some(glow));
    model.node(json!({ "name": "ember", "mesh": mesh, "translation": [1.2, 0.6, 0.8] }));
    let lamp = model.light(json!({ "type": "point", "color": [0.6, 0.8, 1], "intensity": 20 }));
    model.node(json!({ "name": "lamp", "translation": [-1.5, 2, 1], "extensions": lamp }));
    let camera = json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5 } });
    let camera = model.push("cameras", camera);
    model.node(json!({ "camera": camera, "translation": [0, 1.2, 6], "rotation": [-0.05, 0, 0, 0.99875] }));
    model
}

/// A board on two legs, one primitive, and specks beside them that have little area.
pub fn bench(material: Value) -> Model {
    let board = cuboid([-1.0, 0.5, -0.3], [1.0, 0.6, 0.3]);
    let leg = cuboid([-0.05, 0.0, -0.2], [0.05, 0.5, 0.2]);
    let speck = vec![Vec3::ZERO, 0.01 * Vec3::X, 0.01 * Vec3::NEG_Z];
    let speck = Mesh::new("speck", speck, Vec::new(), None, vec![[0, 1, 2]]).unwrap();
    let mut parts = vec![(&board, Vec3::ZERO), (&leg, -0.85 * Vec3::X), (&leg, 0.85 * Vec3::X)];
    parts.extend([0.0, 1.0, 2.0].map(|x| (&speck, Vec3::new(x, 1.0, 0.0))));
    let mut model = Model::default();
    let material = model.push("materials", material);
    let mesh = model.shape(&joined(&parts), Some(material));
    model.node(json!({ "name": "bench", "mesh": mesh }));
    model
}

/// Three parts that move, one in another, and two lamps.
pub fn robot() -> Model {
    let mut model = Model::default();
    let mut outer = None;
    for (name, size) in [("body", 0.5), ("arm", 0.3), ("hand", 0.1)] {
        let mesh = model.cuboid([-size; 3], [size; 3], None);
        let node = json!({ "name": name, "mesh": mesh, "translation": [0, 1, 0.5] });
        let node = if let Some(outer) = outer { model.child(outer, node) } else { model.node(node) };
        model.animate(0, node, "rotation", "LINEAR", &[0., 1., 2.], &TURN);
        outer = Some(node);
    }
    for x in [-2, 2] {
        let lamp = model.light(json!({ "type": "point", "intensity": 20 }));
        model.node(json!({ "translation": [x, 3, 1], "extensions": lamp }));
    }
    model
}

/// A GLB file of JSON and a binary part, which may be empty.
pub fn glb(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut out = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, part, fill) in [(b"JSON", json, b' '), (b"BIN\0", binary, 0)] {
        if part.is_empty() {
            continue;
        }
        let length = part.len().next_multiple_of(4);
        out.extend((length as u32).to_le_bytes());
        out.extend(kind);
        out.extend(part);
        out.resize(out.len().next_multiple_of(4), fill);
    }
    let length = (out.len() as u32).to_le_bytes();
    out[8..12].copy_from_slice(&length);
    out
}

/// A box between two corners.
pub fn cuboid(low: [f32; 3], high: [f32; 3]) -> Mesh {
    let [low, high] = [low, high].map(Vec3::from);
    joined(&[(&generate::cuboid(high - low, 1), (low + high) / 2.0)])
}

/// The vertices of triangles one after another.
pub fn corners(mesh: &Mesh) -> Vec<u16> {
    mesh.triangles.as_flattened().iter().map(|vertex| *vertex as u16).collect()
}

/// Vertices of an entity in the world at a time.
pub fn world(import: &gltf::Import, entity: usize, time_s: f64) -> Vec<DVec3> {
    let data = &import.data.entities[entity];
    let mesh = import.data.meshes.iter().position(|mesh| mesh.name == data.mesh).unwrap();
    let at = data.at(time_s);
    import.meshes[mesh].positions.iter().map(|p| at.point(p.as_dvec3())).collect()
}

pub fn near(a: DVec3, b: DVec3) -> bool {
    (a - b).length() < 1e-5 * (1.0 + b.length())
}
