//! The cache of what is baked: fields, silhouette fields, surfaces with their own visibility, and visibility volumes.
//! Names of files are hashes of the mesh's content and of everything else that decides the numbers; endings say of what
//! kind they are.

use super::silhouette::{bake_silhouette, silhouette_header};
use super::surfaces::{BakedSurface, GroupPlan};
use super::visibility_volume::VolumePlan;
use super::{BakeReport, Baker, Options, Progress};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::file::{self, SURFACES_MAGIC, VERSION, VOLUME_MAGIC};
use crate::field::silhouette::{SilhouetteField, SilhouetteHeader};
use crate::field::visibility_volume::VisibilityVolume;
use crate::field::{FieldHeader, ShadowField};
use serde::Serialize;
use std::any::Any;
use std::collections::HashMap;
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A folder of what is baked. Where there is no folder or no room on disk, it is kept in memory as long as any clone of
/// the cache exists. Nothing is baked twice.
#[derive(Clone, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
    memory: Arc<Mutex<InMemory>>,
}

/// What is not on disk, by the name that its file would have.
type InMemory = HashMap<String, Arc<dyn Any + Send + Sync>>;

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

    fn memory(&self) -> MutexGuard<'_, InMemory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has(&self, name: &str) -> bool {
        self.memory().contains_key(name) || self.folder.as_ref().is_some_and(|folder| folder.join(name).exists())
    }

    /// What is kept under a name, or what `make` makes and `write` keeps there. `read` finds nothing in a file that holds
    /// something else than its name says.
    fn find<T: Any + Send + Sync, E>(
        &self,
        name: String,
        read: impl FnOnce(&Path) -> Result<Option<T>>,
        make: impl FnOnce() -> std::result::Result<(T, BakeReport), E>,
        write: impl FnOnce(&Path, &T) -> Result<()>,
    ) -> std::result::Result<CacheAnswer<T>, E> {
        let known = self.memory().get(&name).cloned();
        if let Some(known) = known {
            return Ok((known.downcast().expect("the ending says what it is"), None));
        }
        let path = self.folder.as_ref().map(|folder| folder.join(&name));
        if let Some(path) = path.as_ref().filter(|path| path.exists()) {
            let why = match read(path) {
                Ok(Some(found)) => return Ok((Arc::new(found), None)),
                Ok(None) => format!("{}: it does not fit its name", path.display()),
                Err(error) => error.to_string(),
            };
            log::warn!("{why}; baking anew");
        }
        let (made, report) = make()?;
        let made = Arc::new(made);
        match path.map(|path| write(&path, &made)) {
            Some(Ok(())) => return Ok((made, Some(report))),
            Some(Err(error)) => log::warn!("{error}; it is kept in memory only"),
            None => {}
        }
        self.memory().insert(name, made.clone());
        Ok((made, Some(report)))
    }

    pub fn has_field(&self, header: &FieldHeader) -> bool {
        self.has(&field_name(header))
    }

    pub fn has_silhouette(&self, mesh: &Mesh, options: &Options) -> bool {
        self.has(&silhouette_name(&silhouette_header(mesh, options.silhouette)))
    }

    pub fn has_surfaces(&self, group: &GroupPlan) -> bool {
        group.key.as_ref().is_none_or(|key| self.has(&surfaces_name(key)))
    }

    pub fn has_volume(&self, plan: &VolumePlan) -> bool {
        self.has(&volume_name(plan))
    }

    /// The field that `header` describes, and the report of its bake, which is `None` if the cache held the field.
    pub fn field(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        header: &FieldHeader,
        progress: Progress<'_>,
    ) -> Result<CacheAnswer<ShadowField>> {
        let read = |path: &Path| {
            let mut found = ShadowField::read(path)?;
            let fits = identity(&found.header) == identity(header);
            // The mesh may have another name by now.
            found.header.mesh.clone_from(&header.mesh);
            Ok(fits.then_some(found))
        };
        let make = || baker.field(mesh, header.clone(), progress);
        self.find(field_name(header), read, make, |path, field| field.write(path))
    }

    /// The silhouette field of a mesh, and the report of its bake, which is `None` if the cache held it.
    pub fn silhouette(
        &self,
        baker: &Baker,
        mesh: &Mesh,
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<CacheAnswer<SilhouetteField>> {
        let header = silhouette_header(mesh, options.silhouette);
        let read = |path: &Path| {
            let mut found = SilhouetteField::read(path)?;
            let fits = silhouette_identity(&found.header) == silhouette_identity(&header);
            found.header.mesh.clone_from(&header.mesh);
            Ok(fits.then_some(found))
        };
        let make = || bake_silhouette(baker, mesh, options.silhouette, progress);
        self.find(silhouette_name(&header), read, make, |path, field| field.write(path))
    }

    /// The surfaces of a group, one a member, and the report of their bake, which is `None` if the cache held them.
    pub fn surfaces(&self, group: &GroupPlan, progress: Progress<'_>) -> CacheAnswer<Vec<BakedSurface>> {
        let Some(key) = &group.key else { return (Arc::new(group.plain()), None) };
        let read = |path: &Path| {
            let (header, payload) = file::read(path, SURFACES_MAGIC)?;
            Ok(group.restore(&header, &payload))
        };
        let write = |path: &Path, surfaces: &Vec<BakedSurface>| {
            let (header, payload) = group.store(surfaces);
            file::write(path, SURFACES_MAGIC, &header, &payload)
        };
        let Ok(answer) = self.find(surfaces_name(key), read, || Ok::<_, Infallible>(group.bake(progress)), write);
        answer
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
        let write = |path: &Path, volume: &VisibilityVolume| {
            let (header, payload) = plan.store(volume);
            file::write(path, VOLUME_MAGIC, &header, &payload)
        };
        let make = || Ok::<_, Infallible>(group.bake_volume(plan, progress));
        let Ok(answer) = self.find(volume_name(plan), read, make, write);
        answer
    }
}

fn key(header: &impl Serialize) -> String {
    let text = serde_json::to_vec(header).expect("headers are plain data");
    blake3::Hasher::new().update(&VERSION.to_le_bytes()).update(&text).finalize().to_hex()[..32].to_owned()
}

/// What decides a field: its header without the mesh's name and without what only the bake finds out.
fn identity(header: &FieldHeader) -> FieldHeader {
    FieldHeader { mesh: String::new(), filled_samples: 0, captured_samples: 0, ..header.clone() }
}

/// What decides a silhouette field: its header without the mesh's name.
fn silhouette_identity(header: &SilhouetteHeader) -> SilhouetteHeader {
    SilhouetteHeader { mesh: String::new(), ..header.clone() }
}

/// The name of a field in the cache. Fields with equal content have equal names.
pub fn field_name(header: &FieldHeader) -> String {
    format!("{}.sf", key(&identity(header)))
}

fn silhouette_name(header: &SilhouetteHeader) -> String {
    format!("{}.outlines", key(&silhouette_identity(header)))
}

fn surfaces_name(key: &str) -> String {
    format!("{key}.view")
}

fn volume_name(plan: &VolumePlan) -> String {
    format!("{}.volume", plan.key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::bake::Wanted;
    use crate::bake::silhouette::SilhouetteOptions;
    use crate::field::{FieldKind, Storage};
    use std::collections::BTreeSet;

    /// Names of occlusion field, radiance field, own visibility and silhouette field.
    fn names(mesh: &Mesh, options: &Options) -> [String; 4] {
        let field = |kind| field_name(&crate::bake::header(mesh, kind, options));
        let own = GroupPlan::alone(&Arc::new(mesh.clone()), options, Wanted::BOTH).key.unwrap();
        [
            field(FieldKind::Occlusion),
            field(FieldKind::Radiance),
            own,
            silhouette_name(&silhouette_header(mesh, options.silhouette)),
        ]
    }

    /// Each option that is flipped changes the names of what it decides, and no other names.
    #[test]
    fn every_option_is_part_of_the_names_that_it_decides() {
        // Large enough for levels of detail, which radiance fields of many colours are captured without.
        let mesh = generate::torus_two_colour(1.0, 0.3, 64, 32);
        let base = Options::default();
        // A new option does not compile here until it has a row below.
        let Options { bands, storage, lattice, face_px, silhouette, levels, vertices: _, groups: _ } = base;
        assert_eq!(storage, Storage::F16);
        let fields = [true, true, false, false];
        let silhouettes = |silhouette| Options { silhouette, ..base };
        let SilhouetteOptions { cells, map_px, view_px, levels: _ } = silhouette;
        let outlines = [false, false, false, true];
        let flipped: Vec<(&str, Options, [bool; 4])> = vec![
            ("bands", Options { bands: bands + 1, ..base }, [true, true, true, false]),
            ("storage", Options { storage: Storage::F32, ..base }, fields),
            ("lattice", Options { lattice: "cube:4x3".parse().unwrap(), ..base }, fields),
            ("face_px", Options { face_px: face_px / 2, ..base }, fields),
            ("cells", silhouettes(SilhouetteOptions { cells: 2 * cells, ..silhouette }), outlines),
            ("map_px", silhouettes(SilhouetteOptions { map_px: 2 * map_px, ..silhouette }), outlines),
            ("levels", Options { levels: !levels, ..base }, [true, false, false, false]),
            ("levels of outlines", silhouettes(SilhouetteOptions { levels: false, ..silhouette }), outlines),
            ("view_px", silhouettes(SilhouetteOptions { view_px: 2 * view_px, ..silhouette }), outlines),
        ];
        assert_ne!(lattice, flipped[2].1.lattice);
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
}
