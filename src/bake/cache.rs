//! The cache of baked fields and transfer vectors. Their names are hashes of the mesh's content and of everything else that decides
//! them.

use super::partial::Partial;
use super::{BakeReport, Baker, Options, Progress, TRANSFER_OFFSET};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, TRANSFER_MAGIC, VERSION};
use crate::field::quantity::channel_stride;
use crate::field::{FieldHeader, ShadowField, Shortcuts};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A folder of baked fields and transfer vectors. Where there is no folder or no room on disk, they are kept in memory as long as any
/// clone of the cache exists. Nothing is baked twice.
#[derive(Clone, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
    memory: Arc<Mutex<InMemory>>,
}

/// What is not on disk, by name.
#[derive(Default)]
struct InMemory {
    fields: HashMap<String, Arc<ShadowField>>,
    transfers: HashMap<String, Arc<Vec<f32>>>,
}

/// The header of a cached transfer file: everything that decides transfer vectors.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct TransferHeader {
    mesh_hash: String,
    bands: usize,
    face_px: u32,
    #[serde(default, skip_serializing_if = "Shortcuts::are_default")]
    shortcuts: Shortcuts,
    offset: f32,
    vertex_count: usize,
}

impl TransferHeader {
    fn new(mesh: &Mesh, options: &Options) -> Self {
        TransferHeader {
            mesh_hash: super::hash_text(mesh),
            bands: options.bands,
            face_px: options.face_px,
            shortcuts: options.shortcuts,
            offset: TRANSFER_OFFSET,
            vertex_count: mesh.positions.len(),
        }
    }
}

fn key(header: &impl Serialize) -> String {
    let text = serde_json::to_vec(header).expect("headers are plain data");
    blake3::Hasher::new().update(&VERSION.to_le_bytes()).update(&text).finalize().to_hex()[..32].to_owned()
}

/// What decides a field: its header without the mesh's name and without what only the bake finds out.
fn identity(header: &FieldHeader) -> FieldHeader {
    FieldHeader {
        mesh: String::new(),
        filled_samples: 0,
        captured_samples: 0,
        symmetry: String::new(),
        growth: 0.0,
        ..header.clone()
    }
}

/// The name of a field in the cache. Fields with equal content have equal names.
pub fn field_name(header: &FieldHeader) -> String {
    key(&identity(header))
}

impl Cache {
    /// A cache below `folder`, or in memory if there is none.
    pub fn new(folder: Option<&Path>) -> Self {
        Cache { folder: folder.map(|f| f.join("fields")), memory: Arc::default() }
    }

    fn path(&self, key: &str, ending: &str) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(format!("{key}.{ending}")))
    }

    fn exists(&self, key: &str, ending: &str) -> bool {
        self.path(key, ending).is_some_and(|path| path.exists())
    }

    fn memory(&self) -> MutexGuard<'_, InMemory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the field that `header` describes is there.
    pub fn has_field(&self, header: &FieldHeader) -> bool {
        let key = field_name(header);
        self.memory().fields.contains_key(&key) || self.exists(&key, "sf")
    }

    /// Whether the transfer vectors of a mesh are there.
    pub fn has_transfer(&self, mesh: &Mesh, options: &Options) -> bool {
        let key = key(&TransferHeader::new(mesh, options));
        self.memory().transfers.contains_key(&key) || self.exists(&key, "transfer")
    }

    /// The field that `header` describes, and the report of its bake, which is `None` if the cache held the field.
    ///
    /// # Errors
    /// As [`Baker::field`]. A damaged or unreadable cache file is baked anew.
    pub fn field(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        header: &FieldHeader,
        progress: Progress<'_>,
    ) -> Result<(Arc<ShadowField>, Option<BakeReport>)> {
        let key = field_name(header);
        let path = self.path(&key, "sf");
        if let Some(found) = self.memory().fields.get(&key) {
            return Ok((found.clone(), None));
        }
        if let Some(found) = path.as_deref().and_then(|path| read_field(path, header)) {
            return Ok((Arc::new(found), None));
        }
        let partial = Partial::new(path.as_ref().map(|path| path.with_extension("part")));
        let (field, report) = baker.field_from(&partial, mesh, header.clone(), progress)?;
        let field = Arc::new(field);
        if !is_kept(path.as_deref(), |path| field.write(path)) {
            self.memory().fields.insert(key, field.clone());
        }
        Ok((field, Some(report)))
    }

    /// The transfer vectors of a mesh, and the report of their bake, which is `None` if the cache held them.
    ///
    /// # Errors
    /// As [`Baker::transfer`]. A damaged or unreadable cache file is baked anew.
    pub fn transfer(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<(Arc<Vec<f32>>, Option<BakeReport>)> {
        let header = TransferHeader::new(mesh, options);
        let key = key(&header);
        let path = self.path(&key, "transfer");
        if let Some(found) = self.memory().transfers.get(&key) {
            return Ok((found.clone(), None));
        }
        if let Some(found) = path.as_deref().and_then(|path| read_transfer(path, &header)) {
            return Ok((Arc::new(found), None));
        }
        let partial = Partial::new(path.as_ref().map(|path| path.with_extension("transfer-part")));
        let (transfer, report) = baker.transfer_from(&partial, mesh, options, progress)?;
        let transfer = Arc::new(transfer);
        let write = |path: &Path| file::write(path, TRANSFER_MAGIC, &header, bytemuck::cast_slice(&transfer));
        if !is_kept(path.as_deref(), write) {
            self.memory().transfers.insert(key, transfer.clone());
        }
        Ok((transfer, Some(report)))
    }
}

/// Writes to a path, if there is one. Answers whether the content is on disk now.
fn is_kept(path: Option<&Path>, write: impl FnOnce(&Path) -> Result<()>) -> bool {
    let Some(path) = path else { return false };
    match write(path) {
        Ok(()) => true,
        Err(error) => {
            log::warn!("{error}; it is kept in memory only");
            false
        }
    }
}

/// The field in a file, with the mesh's present name. `None` if the file is missing or damaged or holds another field.
fn read_field(path: &Path, header: &FieldHeader) -> Option<ShadowField> {
    match path.exists().then(|| ShadowField::read(path))? {
        Ok(found) if identity(&found.header) == identity(header) => {
            Some(ShadowField { header: FieldHeader { mesh: header.mesh.clone(), ..found.header }, ..found })
        }
        Ok(_) => doubt(path, &"it does not fit its name"),
        Err(error) => doubt(path, &error),
    }
}

/// The transfer vectors in a file. `None` if the file is missing or damaged or holds others.
fn read_transfer(path: &Path, header: &TransferHeader) -> Option<Vec<f32>> {
    let bytes = 4 * header.vertex_count * channel_stride(header.bands);
    match path.exists().then(|| file::read::<TransferHeader>(path, TRANSFER_MAGIC))? {
        Ok((found, payload)) if found == *header && payload.len() == bytes => {
            Some(payload.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect())
        }
        Ok(_) => doubt(path, &"it does not fit its name"),
        Err(error) => doubt(path, &error),
    }
}

fn doubt<T>(path: &Path, why: &dyn std::fmt::Display) -> Option<T> {
    log::warn!("{}: {why}; baking anew", path.display());
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::field::{FieldKind, Storage};
    use std::collections::BTreeSet;

    /// Names of occlusion field, radiance field and transfer vectors.
    fn names(mesh: &Mesh, options: &Options) -> [String; 3] {
        let field = |kind| field_name(&crate::bake::header(mesh, kind, options));
        [field(FieldKind::Occlusion), field(FieldKind::Radiance), key(&TransferHeader::new(mesh, options))]
    }

    /// Each option that is flipped changes the names of what it decides, and no other names.
    #[test]
    fn every_option_is_part_of_the_names_that_it_decides() {
        let mesh = generate::torus_two_colour(1.0, 0.3, 12, 6);
        let base = Options::default();
        // A new option does not compile here until it has a row below.
        let Options { bands, field_bands, storage, lattice, face_px, shortcuts } = base;
        let Shortcuts { symmetry, faces, inside } = shortcuts;
        assert!(field_bands.is_none() && storage == Storage::F16);
        let shortcuts = |shortcuts| Options { shortcuts, ..base };
        let all = [true; 3];
        let flipped: Vec<(&str, Options, [bool; 3])> = vec![
            ("bands", Options { bands: bands + 1, ..base }, all),
            ("field_bands", Options { field_bands: Some(bands + 2), ..base }, [true, false, false]),
            ("storage", Options { storage: Storage::F32, ..base }, [true, true, false]),
            ("lattice", Options { lattice: "cube:4x3".parse().unwrap(), ..base }, [true, true, false]),
            ("face_px", Options { face_px: face_px / 2, ..base }, all),
            ("symmetry", shortcuts(Shortcuts { symmetry: !symmetry, faces, inside }), all),
            ("faces", shortcuts(Shortcuts { symmetry, faces: !faces, inside }), all),
            ("inside", shortcuts(Shortcuts { symmetry, faces, inside: !inside }), all),
        ];
        assert_ne!(lattice, flipped[3].1.lattice);
        let usual = names(&mesh, &base);
        let mut distinct = BTreeSet::new();
        for (option, options, decides) in flipped {
            let found = names(&mesh, &options);
            for ((name, usual), decides) in found.iter().zip(&usual).zip(decides) {
                assert_eq!(name != usual, decides, "{option}");
                assert!(!decides || distinct.insert(name.clone()), "{option}: the name of another option's change");
            }
        }
    }

    /// Fields that were baked before shortcuts had a place in headers are still found: with all shortcuts on, the name is the old one.
    #[test]
    fn headers_leave_out_shortcuts_that_are_all_on() {
        let header = crate::bake::header(&generate::sphere(1.0, 1), FieldKind::Occlusion, &Options::default());
        let text = serde_json::to_string(&header).unwrap();
        assert!(!text.contains("shortcuts"), "{text}");
        assert_eq!(serde_json::from_str::<FieldHeader>(&text).unwrap(), header);
        let shortcuts = Shortcuts { symmetry: false, ..Shortcuts::default() };
        let changed = FieldHeader { shortcuts, ..header };
        let text = serde_json::to_string(&changed).unwrap();
        assert_eq!(serde_json::from_str::<FieldHeader>(&text).unwrap(), changed);
    }
}
