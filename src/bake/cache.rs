//! The cache of what is baked: fields, silhouette fields, and surfaces with their own visibility. Names are hashes of the
//! mesh's content and of everything else that decides the numbers. A `Shelf` says where one kind is kept.

pub use super::names::field_name;
use super::names::{identity, silhouette_identity, silhouette_name};
use super::silhouette::{bake_silhouette, silhouette_header};
use super::surfaces::{BakedSurface, GroupPlan};
use super::visibility_volume::VolumePlan;
use super::{BakeReport, Baker, Options, Progress};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, SURFACES_MAGIC, VOLUME_MAGIC};
use crate::field::silhouette::SilhouetteField;
use crate::field::visibility_volume::VisibilityVolume;
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
    volumes: HashMap<String, Arc<VisibilityVolume>>,
}

struct Shelf<T> {
    ending: &'static str,
    memory: fn(&mut InMemory) -> &mut HashMap<String, Arc<T>>,
}

const FIELDS: Shelf<ShadowField> = Shelf { ending: "sf", memory: |all| &mut all.fields };
const SILHOUETTES: Shelf<SilhouetteField> = Shelf { ending: "outlines", memory: |all| &mut all.silhouettes };
const SURFACES: Shelf<Vec<BakedSurface>> = Shelf { ending: "view", memory: |all| &mut all.surfaces };
const VOLUMES: Shelf<VisibilityVolume> = Shelf { ending: "volume", memory: |all| &mut all.volumes };

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

    fn memory(&self) -> MutexGuard<'_, InMemory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has<T>(&self, shelf: &Shelf<T>, key: &str) -> bool {
        (shelf.memory)(&mut self.memory()).contains_key(key)
            || self.path(key, shelf.ending).is_some_and(|path| path.exists())
    }

    /// What a shelf holds under `key`. `read` reads it where it is on disk, and finds nothing in a file that holds
    /// something else than its name says.
    fn look<T>(&self, shelf: &Shelf<T>, key: &str, read: impl FnOnce(&Path) -> Result<Option<T>>) -> Option<Arc<T>> {
        let found = (shelf.memory)(&mut self.memory()).get(key).cloned();
        if found.is_some() {
            return found;
        }
        let path = self.path(key, shelf.ending).filter(|path| path.exists())?;
        let why = match read(&path) {
            Ok(Some(found)) => return Some(Arc::new(found)),
            Ok(None) => "it does not fit its name".into(),
            Err(error) => error.to_string(),
        };
        log::warn!("{}: {why}; baking anew", path.display());
        None
    }

    /// Puts what was made on a shelf: by `write`, or in memory where it cannot be written.
    fn keep<T>(&self, shelf: &Shelf<T>, key: String, made: T, write: impl FnOnce(&Path, &T) -> Result<()>) -> Arc<T> {
        let made = Arc::new(made);
        if let Some(path) = self.path(&key, shelf.ending) {
            match write(&path, &made) {
                Ok(()) => return made,
                Err(error) => log::warn!("{error}; it is kept in memory only"),
            }
        }
        (shelf.memory)(&mut self.memory()).insert(key, made.clone());
        made
    }

    pub fn has_field(&self, header: &FieldHeader) -> bool {
        self.has(&FIELDS, &field_name(header))
    }

    pub fn has_silhouette(&self, mesh: &Mesh, options: &Options) -> bool {
        self.has(&SILHOUETTES, &silhouette_name(mesh, options))
    }

    pub fn has_surfaces(&self, group: &GroupPlan) -> bool {
        group.key.as_ref().is_none_or(|key| self.has(&SURFACES, key))
    }

    pub fn has_volume(&self, plan: &VolumePlan) -> bool {
        self.has(&VOLUMES, &plan.key)
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
        let read = |path: &Path| {
            let mut found = ShadowField::read(path)?;
            let fits = identity(&found.header) == identity(header);
            // The mesh may have another name by now.
            found.header.mesh.clone_from(&header.mesh);
            Ok(fits.then_some(found))
        };
        if let Some(found) = self.look(&FIELDS, &name, read) {
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
        let read = |path: &Path| {
            let mut found = SilhouetteField::read(path)?;
            let fits = silhouette_identity(&found.header) == silhouette_identity(&header);
            found.header.mesh.clone_from(&header.mesh);
            Ok(fits.then_some(found))
        };
        if let Some(found) = self.look(&SILHOUETTES, &name, read) {
            return Ok((found, None));
        }
        let (made, report) = bake_silhouette(baker, mesh, options, progress)?;
        Ok((self.keep(&SILHOUETTES, name, made, |path, field| field.write(path)), Some(report)))
    }

    /// The surfaces of a group, one a member, and the report of their bake, which is `None` if the cache held them.
    pub fn surfaces(&self, group: &GroupPlan, progress: Progress<'_>) -> CacheAnswer<Vec<BakedSurface>> {
        let Some(key) = &group.key else { return (Arc::new(group.plain()), None) };
        let read = |path: &Path| {
            let (header, payload) = file::read(path, SURFACES_MAGIC)?;
            Ok(group.restore(&header, &payload))
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

    /// The visibility volume of a group, and the report of its bake, which is `None` if the cache held it.
    pub fn volume(
        &self,
        group: &GroupPlan,
        plan: &VolumePlan,
        progress: Progress<'_>,
    ) -> CacheAnswer<VisibilityVolume> {
        let read = |path: &Path| {
            let (header, payload) = file::read(path, VOLUME_MAGIC)?;
            Ok(plan.restore(&header, &payload))
        };
        if let Some(found) = self.look(&VOLUMES, &plan.key, read) {
            return (found, None);
        }
        let (made, report) = group.bake_volume(plan, progress);
        let write = |path: &Path, volume: &VisibilityVolume| {
            let (header, payload) = plan.store(volume);
            file::write(path, VOLUME_MAGIC, &header, &payload)
        };
        (self.keep(&VOLUMES, plan.key.clone(), made, write), Some(report))
    }
}
