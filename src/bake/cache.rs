//! The cache of what is baked: fields, silhouette fields, transfer vectors and self-visibility. Names are hashes of the mesh's content and of everything
//! else that decides the numbers. One function, [`Cache::find`], serves all kinds; a [`Shelf`] says where one kind is kept.

use super::partial::Partial;
use super::silhouette::{bake_silhouette, silhouette_header};
use super::{BakeReport, Baker, Options, Progress, TRANSFER_OFFSET};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, SELF_VISIBILITY_MAGIC, TRANSFER_MAGIC, VERSION};
use crate::field::quantity::channel_stride;
use crate::field::silhouette::{SilhouetteField, SilhouetteHeader};
use crate::field::{FieldHeader, ShadowField, Shortcuts, self_visibility};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A folder of what is baked. Where there is no folder or no room on disk, they are kept in memory as long as any
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
    silhouettes: HashMap<String, Arc<SilhouetteField>>,
    transfers: HashMap<String, Arc<Vec<f32>>>,
    self_visibility: HashMap<String, Arc<Vec<u8>>>,
}

/// Where one kind of content is kept.
struct Shelf<T> {
    /// Ending of its files, and of those of a bake that is not done.
    endings: [&'static str; 2],
    /// Its place in memory.
    memory: fn(&mut InMemory) -> &mut HashMap<String, Arc<T>>,
}

const FIELDS: Shelf<ShadowField> = Shelf { endings: ["sf", "part"], memory: |all| &mut all.fields };
const SILHOUETTES: Shelf<SilhouetteField> =
    Shelf { endings: ["outlines", "outlines-part"], memory: |all| &mut all.silhouettes };
const TRANSFERS: Shelf<Vec<f32>> = Shelf { endings: ["transfer", "transfer-part"], memory: |all| &mut all.transfers };
const SELF_VISIBILITY: Shelf<Vec<u8>> =
    Shelf { endings: ["selfvis", "selfvis-part"], memory: |all| &mut all.self_visibility };

/// What the cache held or a bake has made, and the report of the bake, if there was one.
pub type Found<T> = (Arc<T>, Option<BakeReport>);

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

/// The header of a cached file of self-visibility: everything that decides it.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct SelfVisibilityHeader {
    mesh_hash: String,
    face_px: u32,
    #[serde(default, skip_serializing_if = "Shortcuts::are_default")]
    shortcuts: Shortcuts,
    offset: f32,
    side: usize,
    rim: f64,
    limit_rad: f64,
    vertex_count: usize,
}

impl SelfVisibilityHeader {
    fn new(mesh: &Mesh, options: &Options) -> Self {
        SelfVisibilityHeader {
            mesh_hash: super::hash_text(mesh),
            face_px: options.face_px,
            // Every vertex is captured, whether the mesh has symmetries or not.
            shortcuts: Shortcuts { symmetry: true, ..options.shortcuts },
            offset: TRANSFER_OFFSET,
            side: self_visibility::SIDE,
            rim: self_visibility::RIM,
            limit_rad: self_visibility::LIMIT_RAD,
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

/// What decides a silhouette field: its header without the mesh's name.
fn silhouette_identity(header: &SilhouetteHeader) -> SilhouetteHeader {
    SilhouetteHeader { mesh: String::new(), ..header.clone() }
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

    fn has<T>(&self, shelf: &Shelf<T>, key: &str) -> bool {
        (shelf.memory)(&mut self.memory()).contains_key(key) || self.exists(key, shelf.endings[0])
    }

    /// What a shelf holds under `key`, read by `read`; else what `bake` makes, which is kept by `write`, or in memory where it cannot
    /// be written.
    fn find<T>(
        &self,
        shelf: &Shelf<T>,
        key: String,
        read: impl FnOnce(&Path) -> Option<T>,
        bake: impl FnOnce(&Partial) -> Result<(T, BakeReport)>,
        write: impl FnOnce(&Path, &T) -> Result<()>,
    ) -> Result<Found<T>> {
        let [ending, unfinished] = shelf.endings;
        let path = self.path(&key, ending);
        if let Some(found) = (shelf.memory)(&mut self.memory()).get(&key) {
            return Ok((found.clone(), None));
        }
        if let Some(found) = path.as_deref().and_then(read) {
            return Ok((Arc::new(found), None));
        }
        let partial = Partial::new(path.as_ref().map(|path| path.with_extension(unfinished)));
        let (made, report) = bake(&partial)?;
        let made = Arc::new(made);
        if !is_kept(path.as_deref(), |path| write(path, &made)) {
            (shelf.memory)(&mut self.memory()).insert(key, made.clone());
        }
        Ok((made, Some(report)))
    }

    /// Whether the field that `header` describes is there.
    pub fn has_field(&self, header: &FieldHeader) -> bool {
        self.has(&FIELDS, &field_name(header))
    }

    /// Whether the silhouette field of a mesh is there.
    pub fn has_silhouette(&self, mesh: &Mesh, options: &Options) -> bool {
        self.has(&SILHOUETTES, &key(&silhouette_identity(&silhouette_header(mesh, options.silhouette))))
    }

    /// Whether the transfer vectors of a mesh are there.
    pub fn has_transfer(&self, mesh: &Mesh, options: &Options) -> bool {
        self.has(&TRANSFERS, &key(&TransferHeader::new(mesh, options)))
    }

    /// Whether the self-visibility of a mesh is there.
    pub fn has_self_visibility(&self, mesh: &Mesh, options: &Options) -> bool {
        self.has(&SELF_VISIBILITY, &key(&SelfVisibilityHeader::new(mesh, options)))
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
    ) -> Result<Found<ShadowField>> {
        self.find(
            &FIELDS,
            field_name(header),
            |path| read_field(path, header),
            |partial| baker.field_from(partial, mesh, header.clone(), progress),
            |path, field| field.write(path),
        )
    }

    /// The silhouette field of a mesh, and the report of its bake, which is `None` if the cache held it.
    ///
    /// # Errors
    /// As [`bake_silhouette`]. A damaged or unreadable cache file is baked anew.
    pub fn silhouette(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<Found<SilhouetteField>> {
        let header = silhouette_header(mesh, options.silhouette);
        self.find(
            &SILHOUETTES,
            key(&silhouette_identity(&header)),
            |path| read_silhouette(path, &header),
            |_| bake_silhouette((baker.device(), baker.library()), mesh, options.silhouette, progress),
            |path, field| field.write(path),
        )
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
    ) -> Result<Found<Vec<f32>>> {
        let header = TransferHeader::new(mesh, options);
        let bytes = 4 * header.vertex_count * channel_stride(header.bands);
        let floats = |payload: Vec<u8>| {
            payload.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect()
        };
        self.find(
            &TRANSFERS,
            key(&header),
            |path| read_payload(path, TRANSFER_MAGIC, &header, bytes).map(floats),
            |partial| baker.transfer_from(partial, mesh, options, progress),
            |path, transfer| file::write(path, TRANSFER_MAGIC, &header, bytemuck::cast_slice(transfer)),
        )
    }

    /// The self-visibility of a mesh (see [`Baker::self_visibility_from`]), and the report of its bake, which is `None` if the cache
    /// held it.
    ///
    /// # Errors
    /// As [`Baker::field`]. A damaged or unreadable cache file is baked anew.
    pub fn self_visibility(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<Found<Vec<u8>>> {
        let header = SelfVisibilityHeader::new(mesh, options);
        let bytes = header.vertex_count * self_visibility::NODES;
        self.find(
            &SELF_VISIBILITY,
            key(&header),
            |path| read_payload(path, SELF_VISIBILITY_MAGIC, &header, bytes),
            |partial| baker.self_visibility_from(partial, mesh, options, progress),
            |path, maps| file::write(path, SELF_VISIBILITY_MAGIC, &header, maps),
        )
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

/// The silhouette field in a file, with the mesh's present name. `None` if the file is missing or damaged or holds another field.
fn read_silhouette(path: &Path, header: &SilhouetteHeader) -> Option<SilhouetteField> {
    match path.exists().then(|| SilhouetteField::read(path))? {
        Ok(mut found) if silhouette_identity(&found.header) == silhouette_identity(header) => {
            found.header.mesh.clone_from(&header.mesh);
            Some(found)
        }
        Ok(_) => doubt(path, &"it does not fit its name"),
        Err(error) => doubt(path, &error),
    }
}

/// The payload of a file. `None` if the file is missing or damaged, or if its header or length is another.
fn read_payload<H: PartialEq + DeserializeOwned>(
    path: &Path,
    magic: [u8; 8],
    header: &H,
    bytes: usize,
) -> Option<Vec<u8>> {
    match path.exists().then(|| file::read::<H>(path, magic))? {
        Ok((found, payload)) if found == *header && payload.len() == bytes => Some(payload),
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
    use crate::bake::silhouette::SilhouetteOptions;
    use crate::field::{FieldKind, Storage};
    use std::collections::BTreeSet;

    /// Names of occlusion field, radiance field, transfer vectors, self-visibility and silhouette field.
    fn names(mesh: &Mesh, options: &Options) -> [String; 5] {
        let field = |kind| field_name(&crate::bake::header(mesh, kind, options));
        let own = [key(&TransferHeader::new(mesh, options)), key(&SelfVisibilityHeader::new(mesh, options))];
        let [transfer, self_visibility] = own;
        let outlines = key(&silhouette_identity(&silhouette_header(mesh, options.silhouette)));
        [field(FieldKind::Occlusion), field(FieldKind::Radiance), transfer, self_visibility, outlines]
    }

    /// Each option that is flipped changes the names of what it decides, and no other names.
    #[test]
    fn every_option_is_part_of_the_names_that_it_decides() {
        let mesh = generate::torus_two_colour(1.0, 0.3, 12, 6);
        let base = Options::default();
        // A new option does not compile here until it has a row below.
        let Options { bands, field_bands, storage, lattice, face_px, shortcuts, silhouette } = base;
        let Shortcuts { symmetry, faces, inside } = shortcuts;
        assert!(field_bands.is_none() && storage == Storage::F16);
        let shortcuts = |shortcuts| Options { shortcuts, ..base };
        let all = [true, true, true, true, false];
        let silhouettes = |silhouette| Options { silhouette, ..base };
        let SilhouetteOptions { cells, map_px, view_px } = silhouette;
        let outlines = [false, false, false, false, true];
        let flipped: Vec<(&str, Options, [bool; 5])> = vec![
            ("bands", Options { bands: bands + 1, ..base }, [true, true, true, false, false]),
            ("field_bands", Options { field_bands: Some(bands + 2), ..base }, [true, false, false, false, false]),
            ("storage", Options { storage: Storage::F32, ..base }, [true, true, false, false, false]),
            ("lattice", Options { lattice: "cube:4x3".parse().unwrap(), ..base }, [true, true, false, false, false]),
            ("face_px", Options { face_px: face_px / 2, ..base }, all),
            ("symmetry", shortcuts(Shortcuts { symmetry: !symmetry, faces, inside }), [true, true, true, false, false]),
            ("faces", shortcuts(Shortcuts { symmetry, faces: !faces, inside }), all),
            ("inside", shortcuts(Shortcuts { symmetry, faces, inside: !inside }), all),
            ("cells", silhouettes(SilhouetteOptions { cells: 2 * cells, ..silhouette }), outlines),
            ("map_px", silhouettes(SilhouetteOptions { map_px: 2 * map_px, ..silhouette }), outlines),
            ("view_px", silhouettes(SilhouetteOptions { view_px: 2 * view_px, ..silhouette }), outlines),
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
