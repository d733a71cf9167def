//! Writes a scene with those of its meshes that no file has.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::FILE_LIMIT_BYTES;
use super::data::Data;
use crate::asset::Mesh;
use crate::asset::{check_size, obj};
use crate::error::{Error, Result};
use crate::files;

/// A scene file with the meshes that neither have a file nor a generator: OBJ files in the folder `NAME_meshes` beside
/// it.
pub struct Export {
    /// The scene with the names of those files.
    pub data: Data,
    path: PathBuf,
    meshes: Vec<(PathBuf, Arc<Mesh>)>,
}

impl Export {
    /// The files of a scene, not yet written.
    pub fn new(data: &Data, meshes: &[Arc<Mesh>], path: &Path) -> Result<Self> {
        let mut data = data.clone();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let folder = PathBuf::from(format!("{stem}_meshes"));
        let beside = path.parent().unwrap_or(Path::new(""));
        let mut taken = HashSet::new();
        let mut own = Vec::new();
        for (mesh, built) in data.meshes.iter_mut().zip(meshes) {
            if mesh.file.is_some() || mesh.generator.is_some() {
                continue;
            }
            let file = folder.join(file_name(&mesh.name, &mut taken));
            own.push((beside.join(&file), built.clone()));
            mesh.file = Some(file);
        }
        if data.meshes.iter().filter_map(|mesh| mesh.file.as_ref()).any(|file| file.to_str().is_none()) {
            return Err(Error::Failed(format!("{}: a scene file can only name UTF-8 paths", path.display())));
        }
        Ok(Export { data, path: path.to_owned(), meshes: own })
    }

    /// The files of meshes that are to be written.
    pub fn mesh_files(&self) -> impl Iterator<Item = &Path> {
        self.meshes.iter().map(|(path, _)| path.as_path())
    }

    /// Writes all files, each with the comment `head` (without `#`) in its first line. The scene file comes last, so
    /// that it never names what is not there.
    pub fn write(&self, head: &str) -> Result<()> {
        let text = format!("# {head}\n\n{}", self.data.to_toml()?);
        check_size(&self.path, text.len(), FILE_LIMIT_BYTES, "scene")?;
        Data::parse(&text, &self.path)?;
        for (path, mesh) in &self.meshes {
            let text = format!("# {head}\n{}", obj::write_obj(mesh));
            check_size(path, text.len(), obj::FILE_LIMIT_BYTES, "mesh")?;
            crate::text::write(path, text)?;
        }
        // Unlike meshes, it makes no folder.
        files::replace_with(&self.path, |file| file.write_all(text.as_bytes())).map_err(|error: std::io::Error| {
            Error::Failed(format!("{}: cannot be written: {error}", self.path.display()))
        })
    }
}

/// A name that every file system takes and that is not taken, also where case does not count.
fn file_name(name: &str, taken: &mut HashSet<String>) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let stem: String = name.chars().take(60).map(safe).collect();
    let stem = if stem.is_empty() { "mesh".to_owned() } else { stem };
    let all = std::iter::once(stem.clone()).chain((2..).map(|n| format!("{stem}_{n}")));
    let free = all.into_iter().find(|name| taken.insert(name.to_lowercase())).unwrap_or(stem);
    format!("{free}.obj")
}
