//! The files that scenes and glTF files name, read or not, so that no output replaces one of them.

use super::{Data, FILE_LIMIT_BYTES, gltf, single};
use crate::asset::{embedded, read_file};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// The file names in a glTF file.
#[derive(Default, Deserialize)]
#[serde(default)]
struct GltfFile {
    buffers: Vec<Map<String, Value>>,
    images: Vec<Map<String, Value>>,
}

/// A scene's file (or one that is taken as a scene), the files that it names, and those that they name.
pub fn of_scene(path: &Path) -> Vec<PathBuf> {
    if gltf::is_gltf(path) || single::is_obj(path) {
        return of_mesh(path);
    }
    let path = embedded::scene_path(path).filter(|_| !path.exists()).unwrap_or(path.to_owned());
    let mut all = vec![path.clone()];
    // A pipe can be read only once. Of a file that is no scene nothing is written.
    let text = if path.is_file() { read_file(&path, FILE_LIMIT_BYTES).unwrap_or_default() } else { Vec::new() };
    if let Ok(mut data) = Data::parse(&String::from_utf8_lossy(&text), &path) {
        let folder = path.parent().unwrap_or(Path::new(""));
        all.extend(data.files_mut().flat_map(|file| of_mesh(&folder.join(file))));
    }
    all
}

/// A mesh's or picture's file, and the files that it names, if it is a glTF file.
pub fn of_mesh(path: &Path) -> Vec<PathBuf> {
    let mut all = vec![path.to_owned()];
    if gltf::is_gltf(path) && path.is_file() {
        let bytes = read_file(path, gltf::FILE_LIMIT_BYTES).unwrap_or_default();
        let (json, _) = gltf::split(&bytes).unwrap_or_default();
        let file: GltfFile = serde_json::from_slice(json).unwrap_or_default();
        let folder = path.parent().unwrap_or(Path::new(""));
        let uris = file.buffers.iter().chain(&file.images).filter_map(|linked| linked.get("uri")?.as_str());
        let names = uris.filter(|uri| !uri.starts_with("data:"));
        all.extend(names.map(|uri| folder.join(&*percent_encoding::percent_decode_str(uri).decode_utf8_lossy())));
    }
    all
}
