//! The cache of what is baked: fields, silhouette fields, transfer vectors and self-visibility. Names are hashes of the
//! mesh's content and of everything else that decides the numbers. A `Shelf` says where one kind is kept.

pub use super::names::field_name;
use super::names::{SelfVisibilityHeader, TransferHeader, identity, key, silhouette_identity, silhouette_name};
use super::silhouette::{bake_silhouette, silhouette_header};
use super::{BakeReport, Baker, Options, Progress, Wanted};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, SELF_VISIBILITY_MAGIC, TRANSFER_MAGIC};
use crate::field::quantity::channel_stride;
use crate::field::silhouette::{SilhouetteField, SilhouetteHeader};
use crate::field::{FieldHeader, ShadowField, self_visibility};
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A folder of what is baked. Where there is no folder or no room on disk, it is kept in memory as long as any clone of
/// the cache exists. Nothing is baked twice.
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
    /// Ending of its files.
    ending: &'static str,
    /// Its place in memory.
    memory: fn(&mut InMemory) -> &mut HashMap<String, Arc<T>>,
}

const FIELDS: Shelf<ShadowField> = Shelf { ending: "sf", memory: |all| &mut all.fields };
const SILHOUETTES: Shelf<SilhouetteField> = Shelf { ending: "outlines", memory: |all| &mut all.silhouettes };
const TRANSFERS: Shelf<Vec<f32>> = Shelf { ending: "transfer", memory: |all| &mut all.transfers };
const SELF_VISIBILITY: Shelf<Vec<u8>> = Shelf { ending: "selfvis", memory: |all| &mut all.self_visibility };
/// What the cache held or a bake has made, and the report of the bake, if there was one.
pub type CacheAnswer<T> = (Arc<T>, Option<BakeReport>);

/// What is baked of the vertices of a mesh, as far as it was wanted.
#[derive(Clone, Debug, Default)]
pub struct FoundVertices {
    /// Transfer vectors.
    pub transfer: Option<Arc<Vec<f32>>>,
    /// Self-visibility.
    pub self_visibility: Option<Arc<Vec<u8>>>,
    /// What was baked, and the report of that, if the cache did not hold all of it.
    pub baked: Option<(Wanted, BakeReport)>,
}

impl Cache {
    /// A cache below `folder`, or in memory if there is none.
    pub fn new(folder: Option<&Path>) -> Self {
        Cache { folder: folder.map(|f| f.join("fields")), memory: Arc::default() }
    }

    /// The folder that the program keeps its cache in: `shadow-fields` in the user's cache folder; `None` where the
    /// user has none. It may not exist yet.
    pub fn usual_folder() -> Option<PathBuf> {
        dirs::cache_dir().map(|folder| folder.join("shadow-fields"))
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
        (shelf.memory)(&mut self.memory()).contains_key(key) || self.exists(key, shelf.ending)
    }

    /// What a shelf holds under `key`, read by `read` where it is on disk.
    fn look<T>(&self, shelf: &Shelf<T>, key: &str, read: impl FnOnce(&Path) -> Option<T>) -> Option<Arc<T>> {
        let found = (shelf.memory)(&mut self.memory()).get(key).cloned();
        found.or_else(|| self.path(key, shelf.ending).as_deref().and_then(read).map(Arc::new))
    }

    /// Puts what was made on a shelf: by `write`, or in memory where it cannot be written.
    fn keep<T>(&self, shelf: &Shelf<T>, key: String, made: T, write: impl FnOnce(&Path, &T) -> Result<()>) -> Arc<T> {
        let made = Arc::new(made);
        if !is_kept(self.path(&key, shelf.ending).as_deref(), |path| write(path, &made)) {
            (shelf.memory)(&mut self.memory()).insert(key, made.clone());
        }
        made
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
    pub fn field(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        header: &FieldHeader,
        progress: Progress<'_>,
    ) -> Result<CacheAnswer<ShadowField>> {
        let name = field_name(header);
        if let Some(found) = self.look(&FIELDS, &name, |path| read_field(path, header)) {
            return Ok((found, None));
        }
        let (made, report) = baker.field(mesh, header.clone(), progress)?;
        Ok((self.keep(&FIELDS, name, made, |path, field| field.write(path)), Some(report)))
    }

    /// The silhouette field of a mesh, and the report of its bake, which is `None` if the cache held it.
    pub fn silhouette(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<CacheAnswer<SilhouetteField>> {
        let name = silhouette_name(mesh, options);
        let options = options.silhouette;
        let header = silhouette_header(mesh, options);
        if let Some(found) = self.look(&SILHOUETTES, &name, |path| read_silhouette(path, &header)) {
            return Ok((found, None));
        }
        let (made, report) = bake_silhouette(baker, mesh, options, progress)?;
        Ok((self.keep(&SILHOUETTES, name, made, |path, field| field.write(path)), Some(report)))
    }

    /// What is wanted of the vertices of a mesh (see [`Baker::vertices`]). What the cache does not hold is baked
    /// together.
    pub fn vertices(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        options: &Options,
        wanted: Wanted,
        progress: Progress<'_>,
    ) -> Result<FoundVertices> {
        let of_transfer = TransferHeader::new(mesh, options);
        let of_maps = SelfVisibilityHeader::new(mesh, options);
        let transfer_key = key(&of_transfer);
        let maps_key = key(&of_maps);
        let transfer = wanted.transfer.then(|| {
            let bytes = 4 * of_transfer.vertex_count * channel_stride(of_transfer.bands);
            let floats = |payload: Vec<u8>| bytemuck::pod_collect_to_vec(&payload);
            self.look(&TRANSFERS, &transfer_key, |path| {
                read_payload(path, TRANSFER_MAGIC, &of_transfer, bytes).map(floats)
            })
        });
        let self_visibility = wanted.self_visibility.then(|| {
            let bytes = of_maps.vertex_count * self_visibility::BYTES;
            self.look(&SELF_VISIBILITY, &maps_key, |path| read_payload(path, SELF_VISIBILITY_MAGIC, &of_maps, bytes))
        });
        let missing =
            Wanted { transfer: matches!(transfer, Some(None)), self_visibility: matches!(self_visibility, Some(None)) };
        let mut out =
            FoundVertices { transfer: transfer.flatten(), self_visibility: self_visibility.flatten(), baked: None };
        if !missing.transfer && !missing.self_visibility {
            return Ok(out);
        }
        let (made, report) = baker.vertices(mesh, options, missing, progress)?;
        if missing.transfer {
            out.transfer = Some(self.keep(&TRANSFERS, transfer_key, made.transfer, |path, floats| {
                file::write(path, TRANSFER_MAGIC, &of_transfer, bytemuck::cast_slice(floats))
            }));
        }
        if missing.self_visibility {
            let write = |path: &Path, maps: &Vec<u8>| file::write(path, SELF_VISIBILITY_MAGIC, &of_maps, maps);
            out.self_visibility = Some(self.keep(&SELF_VISIBILITY, maps_key, made.self_visibility, write));
        }
        out.baked = Some((missing, report));
        Ok(out)
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

/// What a file holds. `None` if the file is missing or damaged or holds something else than its name says.
fn fitting<T>(path: &Path, read: impl FnOnce(&Path) -> Result<T>, fits: impl FnOnce(&T) -> bool) -> Option<T> {
    let why = match path.exists().then(|| read(path))? {
        Ok(found) if fits(&found) => return Some(found),
        Ok(_) => "it does not fit its name".into(),
        Err(error) => error.to_string(),
    };
    log::warn!("{}: {why}; baking anew", path.display());
    None
}

/// The field in a file, with the mesh's present name.
fn read_field(path: &Path, header: &FieldHeader) -> Option<ShadowField> {
    let mut found = fitting(path, ShadowField::read, |found| identity(&found.header) == identity(header))?;
    found.header.mesh.clone_from(&header.mesh);
    Some(found)
}

/// The silhouette field in a file, with the mesh's present name.
fn read_silhouette(path: &Path, header: &SilhouetteHeader) -> Option<SilhouetteField> {
    let fits = |found: &SilhouetteField| silhouette_identity(&found.header) == silhouette_identity(header);
    let mut found = fitting(path, SilhouetteField::read, fits)?;
    found.header.mesh.clone_from(&header.mesh);
    Some(found)
}

/// The payload of a file with this header, of so many bytes.
fn read_payload<H: PartialEq + DeserializeOwned>(
    path: &Path,
    magic: [u8; 8],
    header: &H,
    bytes: usize,
) -> Option<Vec<u8>> {
    let read = |path: &Path| file::read::<H>(path, magic);
    fitting(path, read, |(found, payload)| found == header && payload.len() == bytes).map(|(_, payload)| payload)
}
