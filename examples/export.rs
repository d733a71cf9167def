//! Bakes the light of a scene into a model: each vertex's radiosity as its colour, and its transfer vector (spherical
//! harmonics) as attributes of its own. `cargo run --example export -- SCENE.toml light.glb`; viewers of glTF show the
//! colours.
//!
//! `COLOR_0` is linear radiance, not below 0, in units of what the scene's exposure shows as white. `_TRANSFER_0`,
//! `_TRANSFER_1` and so on hold four coefficients each, bands^2 in all, in the node's own frame: albedo / pi times
//! their product with a sky's is the radiosity under it.

use shadow_fields::prelude::*;
use shadow_fields::scene::Lights;
use std::fmt::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let scene = words.next().unwrap_or_else(|| "torus_over_plane".into());
    let path = words.next().unwrap_or_else(|| "light.glb".into());
    let scene = Scene::load(Path::new(&scene))?;
    let gpu = Gpu::own(&DeviceOptions { cache_dir: Cache::usual_folder(), ..Default::default() })?;
    // All lights go through spherical harmonics, so that every mesh has its transfer vectors.
    let options = RenderOptions { bake: Quality::Draft.into(), lights: Lights::Sh, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &scene, &options)?;
    let mut model = Model::default();
    let white = renderer.scene().data.output.white();
    let light = renderer.light()?.to_vec();
    for (index, (placement, radiosity)) in scene.at(scene.data.output.time_s).iter().zip(light).enumerate() {
        let entity = &scene.entities[index];
        let mesh = renderer.mesh(index);
        if !entity.receives {
            continue;
        }
        let colors: Vec<f32> = radiosity.iter().flatten().map(|c| c.max(0.0) / white).collect();
        let transfer = renderer.transfer(index)?;
        let mut attributes = String::new();
        let positions: Vec<f32> = mesh.positions.iter().flat_map(|p| p.to_array()).collect();
        let normals: Vec<f32> = mesh.normals.iter().flat_map(|n| n.to_array()).collect();
        for (name, kind, values) in
            [("POSITION", "VEC3", positions), ("NORMAL", "VEC3", normals), ("COLOR_0", "VEC3", colors)]
        {
            write!(attributes, "\"{name}\":{},", model.floats(kind, &values))?;
        }
        let count = transfer.bands * transfer.bands;
        for part in 0..count.div_ceil(4) {
            let quad = |vector: &[f32]| [0, 1, 2, 3].map(|i| vector.get(4 * part + i).copied().unwrap_or(0.0));
            let quads: Vec<f32> = transfer.coefficients.chunks_exact(count).flat_map(quad).collect();
            write!(attributes, "\"_TRANSFER_{part}\":{},", model.floats("VEC4", &quads))?;
        }
        let triangles: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        let indices = model.indices(&triangles);
        let attributes = attributes.trim_end_matches(',');
        let primitive = format!("{{\"attributes\":{{{attributes}}},\"indices\":{indices},\"material\":0}}");
        model.meshes.push(format!("{{\"primitives\":[{primitive}]}}"));
        let (t, r, s) = (placement.position, placement.rotation, placement.scale);
        let (mesh, name) = (model.meshes.len() - 1, entity.name.escape_default());
        model.nodes.push(format!(
            "{{\"name\":\"{name}\",\"mesh\":{mesh},\"translation\":{:?},\"rotation\":{:?},\"scale\":[{s},{s},{s}]}}",
            t.to_array(),
            r.to_array()
        ));
    }
    std::fs::write(&path, model.glb())?;
    println!("{path}: {} lit entities on {}", model.meshes.len(), gpu.device().info.name);
    Ok(())
}

/// A binary glTF file in the making.
#[derive(Default)]
struct Model {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
    meshes: Vec<String>,
    nodes: Vec<String>,
}

impl Model {
    /// Adds numbers as a buffer view; `kind` is the rest of the accessor. Returns the accessor's index.
    fn add(&mut self, bytes: impl IntoIterator<Item = u8>, kind: &str) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let (view, length) = (self.views.len(), self.bytes.len() - start);
        self.views.push(format!("{{\"buffer\":0,\"byteOffset\":{start},\"byteLength\":{length}}}"));
        self.accessors.push(format!("{{\"bufferView\":{view},{kind}}}"));
        self.accessors.len() - 1
    }

    /// Adds vectors of f32; glTF wants the bounds of positions, and takes them of all.
    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = if kind == "VEC3" { 3 } else { 4 };
        let bound = |least: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..width).map(|i| values[i..].iter().step_by(width).fold(least, |a, b| pick(a, *b))).collect()
        };
        let (low, high) = (bound(f32::MAX, f32::min), bound(f32::MIN, f32::max));
        let count = values.len() / width;
        let kind =
            format!("\"componentType\":5126,\"count\":{count},\"type\":\"{kind}\",\"min\":{low:?},\"max\":{high:?}");
        self.add(values.iter().flat_map(|value| value.to_le_bytes()), &kind)
    }

    /// Adds indices.
    fn indices(&mut self, values: &[u32]) -> usize {
        let kind = format!("\"componentType\":5125,\"count\":{},\"type\":\"SCALAR\"", values.len());
        self.add(values.iter().flat_map(|value| value.to_le_bytes()), &kind)
    }

    /// The file: a header, and two chunks whose lengths are multiples of 4.
    fn glb(&self) -> Vec<u8> {
        let list = |parts: &[String]| parts.join(",");
        let roots: Vec<String> = (0..self.nodes.len()).map(|node| node.to_string()).collect();
        // The light is in the colours: viewers show them as they are.
        let mut json = format!(
            "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"shadow-fields\"}},\"extensionsUsed\":[\"KHR_materials_unlit\"],\
             \"scene\":0,\"scenes\":[{{\"nodes\":[{}]}}],\"nodes\":[{}],\"meshes\":[{}],\"accessors\":[{}],\"bufferViews\":[{}],\
             \"materials\":[{{\"extensions\":{{\"KHR_materials_unlit\":{{}}}}}}],\"buffers\":[{{\"byteLength\":{}}}]}}",
            list(&roots),
            list(&self.nodes),
            list(&self.meshes),
            list(&self.accessors),
            list(&self.views),
            self.bytes.len()
        );
        json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(4) - json.len()));
        let length = (28 + json.len() + self.bytes.len()) as u32;
        let mut out = b"glTF".to_vec();
        out.extend([2, length, json.len() as u32].iter().flat_map(|word| word.to_le_bytes()));
        out.extend(b"JSON");
        out.extend(json.as_bytes());
        out.extend((self.bytes.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(&self.bytes);
        out
    }
}
