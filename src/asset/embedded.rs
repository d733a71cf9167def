//! Scenes and meshes compiled into the binary, so that it runs without this repository's folder.

use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};

/// Paths below `assets/` and contents of all meshes and scenes there, as the build script lists them.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// The folder that embedded paths stand in: `assets/scenes/NAME.toml`.
pub const ROOT: &str = "assets";

/// The contents of an embedded file, by its path from the repository's root, such as `assets/meshes/torus.obj`. The
/// path may contain `..`, as a scene's relative paths do.
pub fn find(path: &Path) -> Option<&'static [u8]> {
    entry(path).map(|(_, bytes)| *bytes)
}

/// The plain path of an embedded file, without `..`: `assets/meshes/torus.obj`.
pub fn name(path: &Path) -> Option<String> {
    entry(path).map(|(name, _)| format!("{ROOT}/{name}"))
}

fn entry(path: &Path) -> Option<&'static (&'static str, &'static [u8])> {
    let mut parts: Vec<&str> = Vec::new();
    for component in path.components() {
        match component {
            Component::Normal(part) => parts.push(part.to_str()?),
            Component::ParentDir => drop(parts.pop()?),
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    let wanted = parts.join("/");
    let below = wanted.strip_prefix(ROOT)?.strip_prefix('/')?;
    FILES.iter().find(|(name, _)| *name == below)
}

pub fn read(path: &Path) -> Result<Vec<u8>> {
    find(path).map(<[u8]>::to_vec).ok_or_else(|| Error::input(path, "no such embedded file"))
}

/// Path of the built-in scene with this bare name: `assets/scenes/NAME.toml`. `None` if there is no such scene.
pub fn scene_path(name: &Path) -> Option<PathBuf> {
    let path = Path::new(ROOT).join("scenes").join(name).with_extension("toml");
    (name.components().count() == 1 && name.extension().is_none() && find(&path).is_some()).then_some(path)
}

/// Name (without folder and extension) and text of every embedded scene.
pub fn scenes() -> Vec<(&'static str, &'static str)> {
    let scene = |&(path, bytes): &(&'static str, &'static [u8])| {
        let name = path.strip_prefix("scenes/")?.strip_suffix(".toml")?;
        Some((name, std::str::from_utf8(bytes).ok()?))
    };
    FILES.iter().filter_map(scene).collect()
}
