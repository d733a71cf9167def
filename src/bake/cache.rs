//! The cache of what is baked: fields, silhouette fields, and surfaces with their own visibility. Names are hashes of the
//! mesh's content and of everything else that decides the numbers. A `Shelf` says where one kind is kept.

pub use super::names::field_name;
use super::names::{identity, silhouette_identity, silhouette_name};
use super::silhouette::{bake_silhouette, silhouette_header};
use super::surfaces::{BakedSurface, GroupPlan, StoredGroup};
use super::{BakeReport, Baker, Options, Progress};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, SURFACES_MAGIC};
use crate::field::silhouette::{SilhouetteField, SilhouetteHeader};
use crate::field::{FieldHeader, ShadowField};
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
    surfaces: HashMap<String, Arc<Vec<BakedSurface>>>,
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
const SURFACES: Shelf<Vec<BakedSurface>> = Shelf { ending: "view", memory: |all| &mut all.surfaces };
/// What the cache held or a bake has made, and the report of the bake, if there was one.
pub type CacheAnswer<T> = (Arc<T>, Option<BakeReport>);

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

    /// Whether the surfaces of a group are there.
    pub fn has_surfaces(&self, group: &GroupPlan) -> bool {
        group.key.as_ref().is_none_or(|key| self.has(&SURFACES, key))
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

    /// The surfaces of a group, one a member, and the report of their bake, which is `None` if the cache held them.
    pub fn surfaces(&self, group: &GroupPlan, progress: Progress<'_>) -> CacheAnswer<Vec<BakedSurface>> {
        let Some(key) = &group.key else { return (Arc::new(group.plain()), None) };
        let read = |path: &Path| {
            let fits = |found: &Option<Vec<BakedSurface>>| found.is_some();
            let restore = |(header, payload): (StoredGroup, Vec<u8>)| group.restore(&header, &payload);
            fitting(path, |path| file::read(path, SURFACES_MAGIC).map(restore), fits).flatten()
        };
        if let Some(found) = self.look(&SURFACES, key, read) {
            return (found, None);
        }
        let (made, report) = group.bake(progress);
        let write = |path: &Path, surfaces: &Vec<BakedSurface>| {
            let (header, payload) = group.store(surfaces);
            file::write(path, SURFACES_MAGIC, &header, &payload)
        };
        (self.keep(&SURFACES, key.clone(), made, write), Some(report))
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
