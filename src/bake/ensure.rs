//! Bakes or finds in the cache every field and transfer vector that a scene needs. Everything that shows a scene calls [`ensure()`].

use super::cache::{Cache, CacheAnswer, FoundVertices, field_name};
use super::vertices::Wanted;
use super::{BakeReport, Baker, Options, Progress, header};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::silhouette::SilhouetteField;
use crate::field::{FieldHeader, FieldKind, ShadowField};
use crate::scene::light::{self, LightMethod, Lights};
use crate::scene::{Entity, Scene};
use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use std::sync::Arc;

/// A function that is told the name of what is being baked, the samples that are done, and the samples in all.
pub type SceneProgress<'p> = &'p dyn Fn(&str, u32, u32);

/// What one bake cost.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Baked {
    /// Name of the mesh, and the kind of field.
    pub what: String,
    /// What the bake did, and where its time went.
    pub report: BakeReport,
}

/// What is baked of one mesh, as far as the scene's entities need it. Equal meshes share it.
#[derive(Clone, Default)]
pub struct BakedMesh {
    /// Occlusion field.
    pub blocked: Option<Arc<ShadowField>>,
    /// Radiance field.
    pub radiance: Option<Arc<ShadowField>>,
    /// Silhouette field.
    pub silhouette: Option<Arc<SilhouetteField>>,
    /// Self-visibility of every vertex for sharp lights, [`crate::field::self_visibility::BYTES`] each in the mesh's order of vertices.
    pub self_visibility: Option<Arc<Vec<u8>>>,
    /// Transfer vectors in the mesh's order of vertices, or `None` where the cosine lobe of the normal is exact.
    pub transfer: Option<Arc<Vec<f32>>>,
}

/// Everything that is baked of a scene.
pub struct BakedScene {
    /// For every mesh of the scene.
    pub meshes: Vec<BakedMesh>,
    /// Bakes that were not found in the cache.
    pub baked: Vec<Baked>,
}

/// What a scene needs to have baked.
pub struct SceneNeeds {
    /// For every mesh of the scene: what it needs, and the headers of its occlusion and radiance fields.
    meshes: Vec<(Needed, [Option<FieldHeader>; 2])>,
    /// Options of the bakes.
    pub options: Options,
}

impl SceneNeeds {
    /// The needs of a scene whose fields and transfers are baked with `options`. A field that nothing sees is not needed.
    pub fn of(scene: &Scene, options: &Options, lights: Lights) -> Self {
        let of_mesh = |(index, mesh): (usize, &Arc<Mesh>)| {
            let needed = needs(scene, index, lights);
            (needed, needed.fields.map(|kind| kind.map(|kind| header(mesh, kind, options))))
        };
        SceneNeeds { meshes: scene.meshes.iter().enumerate().map(of_mesh).collect(), options: *options }
    }

    /// Bytes of the fields, each rounded up to a multiple of `alignment`. Equal fields count once.
    pub fn field_bytes(&self, alignment: u64) -> u64 {
        let mut known = HashSet::new();
        let headers = self.meshes.iter().flat_map(|(_, headers)| headers).flatten();
        let distinct = headers.filter(|header| known.insert(field_name(header)));
        distinct.map(|header| header.payload_bytes().next_multiple_of(alignment)).sum()
    }

    /// Whether everything is in the cache, so that [`ensure()`] bakes nothing.
    pub fn are_cached(&self, scene: &Scene, cache: &Cache) -> bool {
        scene.meshes.iter().zip(&self.meshes).all(|(mesh, (needed, headers))| {
            headers.iter().flatten().all(|header| cache.has_field(header))
                && (!needed.silhouette || cache.has_silhouette(mesh, &self.options))
                && (!needed.self_visibility || cache.has_self_visibility(mesh, &self.options))
                && (!needed.transfer || cache.has_transfer(mesh, &self.options))
        })
    }
}

/// What the entities of a mesh need to have baked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needed {
    /// Occlusion and radiance field.
    pub fields: [Option<FieldKind>; 2],
    /// Silhouette field.
    pub silhouette: bool,
    /// Self-visibility for sharp lights.
    pub self_visibility: bool,
    /// Transfer vectors.
    pub transfer: bool,
}

/// What the entities of a mesh need. An entity that only receives, or that nothing else can see, needs no field. Without light
/// no shadows are needed, without light in spherical harmonics no occlusion field, without sharp lights no silhouettes. A light of
/// one colour needs no radiance field.
pub fn needs(scene: &Scene, mesh: usize, lights: Lights) -> Needed {
    let entities = || (0..scene.entities.len()).filter(|&i| scene.entities[i].mesh == mesh);
    let seen = || entities().map(|i| (i, &scene.entities[i])).filter(|(_, e)| is_seen(scene, e));
    let method = |entity| LightMethod::of(scene, entity, lights);
    let coloured = scene.meshes[mesh].colors.is_some();
    let (harmonics, sharp) = (light::has_harmonics(scene, lights), light::has_sharp(scene, lights));
    let shines = |wanted: LightMethod| seen().any(|(i, e)| e.emits && method(i) == wanted);
    let blocked = seen().any(|(_, e)| e.occludes && harmonics) || (shines(LightMethod::Harmonics) && !coloured);
    let radiance = coloured && shines(LightMethod::Harmonics);
    let shades_itself = bakes_transfer(&scene.meshes[mesh]) && entities().any(|i| scene.entities[i].receives);
    Needed {
        fields: [blocked.then_some(FieldKind::Occlusion), radiance.then_some(FieldKind::Radiance)],
        silhouette: seen().any(|(_, e)| e.occludes && sharp) || shines(LightMethod::Outline),
        self_visibility: sharp && shades_itself,
        transfer: harmonics && shades_itself,
    }
}

/// Whether the shadow or light of an entity can fall on another entity, because one other at least is lit.
pub fn is_seen(scene: &Scene, entity: &Entity) -> bool {
    scene.entities.iter().filter(|e| e.receives).count() > usize::from(entity.receives)
}

/// Whether a mesh can shadow itself. If it cannot, its transfer is the cosine lobe of the normal.
pub fn bakes_transfer(mesh: &Mesh) -> bool {
    !mesh.is_flat() && !mesh.is_convex()
}

/// What a scene has so far. Meshes that are equal under two names share it.
struct Making<'m> {
    progress: SceneProgress<'m>,
    baked: Vec<Baked>,
    fields: HashMap<String, Arc<ShadowField>>,
    silhouettes: HashMap<[u8; 32], Arc<SilhouetteField>>,
    vertices: HashMap<[u8; 32], FoundVertices>,
}

impl Making<'_> {
    /// What is known under a key, or what `find` bakes or finds in the cache, under the name `what`.
    fn once<K: Eq + Hash, T>(
        &mut self,
        known: fn(&mut Self) -> &mut HashMap<K, Arc<T>>,
        (key, what): (K, String),
        find: impl FnOnce(Progress<'_>) -> Result<CacheAnswer<T>>,
    ) -> Result<Arc<T>> {
        if let Some(found) = known(self).get(&key) {
            return Ok(found.clone());
        }
        let (found, report) = find(&|now, all| (self.progress)(&what, now, all))?;
        self.baked.extend(report.map(|report| Baked { what, report }));
        known(self).insert(key, found.clone());
        Ok(found)
    }

    /// What is wanted of the vertices of a mesh. The entities of one mesh may need what those of an equal mesh do not.
    fn vertices(
        &mut self,
        mesh: &Mesh,
        wanted: Wanted,
        find: impl FnOnce(Wanted, Progress<'_>) -> Result<FoundVertices>,
    ) -> Result<FoundVertices> {
        let found = self.vertices.entry(mesh.content_hash()).or_default();
        let missing = Wanted {
            transfer: wanted.transfer && found.transfer.is_none(),
            self_visibility: wanted.self_visibility && found.self_visibility.is_none(),
        };
        if missing.transfer || missing.self_visibility {
            let what = |wanted: Wanted| format!("{} {}", mesh.name, wanted.name());
            let new = find(missing, &|now, all| (self.progress)(&what(missing), now, all))?;
            self.baked.extend(new.baked.map(|(baked, report)| Baked { what: what(baked), report }));
            found.transfer = new.transfer.or(found.transfer.take());
            found.self_visibility = new.self_visibility.or(found.self_visibility.take());
        }
        Ok(FoundVertices {
            transfer: found.transfer.clone().filter(|_| wanted.transfer),
            self_visibility: found.self_visibility.clone().filter(|_| wanted.self_visibility),
            baked: None,
        })
    }
}

/// Bakes or finds in the cache every field and transfer of `needs`, which are those of `scene`, mesh by mesh. What is baked is kept in
/// the cache.
///
/// # Errors
/// As [`Baker::field`].
pub fn ensure(
    baker: &Baker,
    cache: &Cache,
    scene: &Scene,
    needs: &SceneNeeds,
    progress: SceneProgress<'_>,
) -> Result<BakedScene> {
    let (fields, silhouettes, vertices) = (HashMap::new(), HashMap::new(), HashMap::new());
    let mut making = Making { progress, baked: Vec::new(), fields, silhouettes, vertices };
    let (mut meshes, options) = (Vec::with_capacity(scene.meshes.len()), &needs.options);
    for (mesh, (needed, headers)) in scene.meshes.iter().zip(&needs.meshes) {
        let mut to = BakedMesh::default();
        for (header, to) in headers.iter().zip([&mut to.blocked, &mut to.radiance]) {
            let Some(header) = header else { continue };
            let word = if header.kind == FieldKind::Radiance { "light" } else { "shadow" };
            let named = (field_name(header), format!("{} {word}", mesh.name));
            *to = Some(making.once(|all| &mut all.fields, named, |told| cache.field(baker, mesh, header, told))?);
        }
        if needed.silhouette {
            let named = (mesh.content_hash(), format!("{} silhouette", mesh.name));
            let find = |told: Progress<'_>| cache.silhouette(baker, mesh, options, told);
            to.silhouette = Some(making.once(|all| &mut all.silhouettes, named, find)?);
        }
        let wanted = Wanted { transfer: needed.transfer, self_visibility: needed.self_visibility };
        let find = |missing, told: Progress<'_>| cache.vertices(baker, mesh, options, missing, told);
        let found = making.vertices(mesh, wanted, find)?;
        (to.transfer, to.self_visibility) = (found.transfer, found.self_visibility);
        meshes.push(to);
    }
    // What is held for further bakes is free for pictures.
    baker.rest();
    Ok(BakedScene { meshes, baked: making.baked })
}
