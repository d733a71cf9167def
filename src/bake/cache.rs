//! The cache of what is baked: fields, silhouette fields, transfer vectors and self-visibility. Names are hashes of the mesh's content and of everything
//! else that decides the numbers. One function, `Cache::find`, serves all kinds; a `Shelf` says where one kind is kept.

use super::kinds::Kind;
pub use super::names::field_name;
use super::names::{SelfVisibilityHeader, TransferHeader, identity, key, silhouette_identity, silhouette_name};
use super::partial::Partial;
use super::silhouette::{bake_silhouette, silhouette_header};
use super::{BakeReport, Baker, Options, Progress};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, SELF_VISIBILITY_MAGIC, TRANSFER_MAGIC};
use crate::field::quantity::channel_stride;
use crate::field::silhouette::{SilhouetteField, SilhouetteHeader};
use crate::field::{FieldHeader, FieldKind, ShadowField, self_visibility};
use serde::de::DeserializeOwned;
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

impl Cache {
    /// A cache below `folder`, or in memory if there is none.
    pub fn new(folder: Option<&Path>) -> Self {
        Cache { folder: folder.map(|f| f.join("fields")), memory: Arc::default() }
    }

    /// The folder that the program keeps its cache in: `shadow-fields` in the user's cache folder; `None` where the user has none. It may
    /// not exist yet.
    pub fn usual_folder() -> Option<PathBuf> {
        dirs::cache_dir().map(|folder| folder.join("shadow-fields"))
    }

    fn path(&self, key: &str, ending: &str) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join(format!("{key}.{ending}")))
    }

    /// The file of what a cancelled bake has kept of one kind of thing, in a cache that has a folder.
    pub(super) fn unfinished(&self, mesh: &Mesh, options: &Options, kind: Kind) -> Option<PathBuf> {
        let field = |kind| field_name(&super::header(mesh, kind, options));
        match kind {
            Kind::Shadow => self.path(&field(FieldKind::Occlusion), FIELDS.endings[1]),
            Kind::Light => self.path(&field(FieldKind::Radiance), FIELDS.endings[1]),
            Kind::Silhouette => self.path(&silhouette_name(mesh, options), SILHOUETTES.endings[1]),
            Kind::SelfVisibility => {
                self.path(&key(&SelfVisibilityHeader::new(mesh, options)), SELF_VISIBILITY.endings[1])
            }
            Kind::Transfer => self.path(&key(&TransferHeader::new(mesh, options)), TRANSFERS.endings[1]),
        }
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
        self.has(&SILHOUETTES, &silhouette_name(mesh, options))
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
            silhouette_name(mesh, options),
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
        let bytes = header.vertex_count * self_visibility::BYTES;
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
