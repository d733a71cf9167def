//! The files that scenes and glTF files name, read or not, so that no output replaces one of them.

use super::{FILE_LIMIT_BYTES, gltf, single};
use crate::asset::{embedded, read_file};
use crate::files;
use serde::Deserialize;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The file names in a scene file.
#[derive(Default, Deserialize)]
#[serde(default)]
struct SceneFile {
    texture: Vec<Named>,
    mesh: Vec<Named>,
    environment: EnvironmentFile,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct EnvironmentFile {
    image: Named,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Named {
    file: Option<PathBuf>,
}

/// The file names in a glTF file.
#[derive(Default, Deserialize)]
#[serde(default)]
struct GltfFile {
    buffers: Vec<Linked>,
    images: Vec<Linked>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Linked {
    uri: Option<String>,
}

/// A scene's file (or one that is taken as a scene), the files that it names, and those that they name.
pub fn of_scene(path: &Path) -> Vec<PathBuf> {
    if gltf::is_gltf(path) || single::is_obj(path) {
        return of_mesh(path);
    }
    let path = embedded::scene_path(path).filter(|_| !path.exists()).unwrap_or(path.to_owned());
    // A pipe can be read only once.
    let text = if path.is_file() { read_file(&path, FILE_LIMIT_BYTES).unwrap_or_default() } else { Vec::new() };
    let scene: SceneFile = toml::from_slice(&text).unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    let named =
        scene.texture.into_iter().chain(scene.mesh).chain([scene.environment.image]).filter_map(|named| named.file);
    let named: Vec<PathBuf> = named.flat_map(|file| of_mesh(&folder.join(file))).collect();
    std::iter::once(path).chain(named).collect()
}

/// A mesh's or picture's file, and the files that it names, if it is a glTF file.
pub fn of_mesh(path: &Path) -> Vec<PathBuf> {
    let mut all = vec![path.to_owned()];
    if gltf::is_gltf(path) && path.is_file() {
        let file: GltfFile = serde_json::from_slice(&json(path).unwrap_or_default()).unwrap_or_default();
        let folder = path.parent().unwrap_or(Path::new(""));
        let uris = file.buffers.into_iter().chain(file.images).filter_map(|linked| linked.uri);
        let names = uris.filter(|uri| !uri.starts_with("data:"));
        all.extend(names.map(|uri| folder.join(&*percent_encoding::percent_decode_str(&uri).decode_utf8_lossy())));
    }
    all
}

/// The JSON of a glTF file: all of it, or the first part of a GLB file.
fn json(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = files::open(path)?.take(gltf::FILE_LIMIT_BYTES);
    let mut start = [0; 20];
    let read = file.read(&mut start)?;
    let mut bytes = Vec::new();
    if read == start.len() && start.starts_with(b"glTF") {
        let length = u32::from_le_bytes([start[12], start[13], start[14], start[15]]);
        file.take(length.into()).read_to_end(&mut bytes)?;
    } else {
        bytes.extend(&start[..read]);
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}
