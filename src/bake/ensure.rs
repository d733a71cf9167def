//! Bakes or finds in the cache every field and transfer vector that a scene needs. Everything that shows a scene calls [`ensure()`].

use super::cache::{Cache, field_name};
use super::{BakeReport, Baker, Options, header};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::{FieldHeader, FieldKind, ShadowField};
use crate::scene::{Entity, Scene};
use std::collections::{HashMap, HashSet};
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
    /// For every mesh of the scene: headers of its occlusion and radiance fields.
    fields: Vec<[Option<FieldHeader>; 2]>,
    /// For every mesh of the scene: whether it needs transfer vectors.
    transfers: Vec<bool>,
    /// Options of the bakes.
    pub options: Options,
}

impl SceneNeeds {
    /// The needs of a scene whose fields and transfers are baked with `options`. A field that nothing sees is not needed.
    pub fn of(scene: &Scene, options: &Options) -> Self {
        let fields = |index: usize| {
            let kinds = needs(scene, index);
            kinds.map(|kind| kind.map(|kind| header(&scene.meshes[index], kind, options)))
        };
        let receives = |index: usize| scene.entities.iter().any(|e| e.mesh == index && e.receives);
        SceneNeeds {
            fields: (0..scene.meshes.len()).map(fields).collect(),
            transfers: scene.meshes.iter().enumerate().map(|(i, mesh)| receives(i) && bakes_transfer(mesh)).collect(),
            options: *options,
        }
    }

    /// Bytes of the fields, each rounded up to a multiple of `alignment`. Equal fields count once.
    pub fn field_bytes(&self, alignment: u64) -> u64 {
        let mut known = HashSet::new();
        let headers = self.fields.iter().flatten().flatten();
        let distinct = headers.filter(|header| known.insert(field_name(header)));
        distinct.map(|header| header.payload_bytes().next_multiple_of(alignment)).sum()
    }

    /// Whether everything is in the cache, so that [`ensure()`] bakes nothing.
    pub fn are_cached(&self, scene: &Scene, cache: &Cache) -> bool {
        let mut fields = self.fields.iter().flatten().flatten();
        let mut transfers = scene.meshes.iter().zip(&self.transfers).filter(|(_, needed)| **needed);
        fields.all(|header| cache.has_field(header))
            && transfers.all(|(mesh, _)| cache.has_transfer(mesh, &self.options))
    }
}

/// Which fields the entities of a mesh need. An entity that only receives, or that nothing else can see, needs none. Without light
/// no shadows are needed, and a light of one colour needs no radiance field.
pub fn needs(scene: &Scene, mesh: usize) -> [Option<FieldKind>; 2] {
    let entities = || scene.entities.iter().filter(|e| e.mesh == mesh && is_seen(scene, e));
    let coloured = scene.meshes[mesh].colors.is_some();
    let light = !scene.environment.is_none() || scene.entities.iter().any(|e| e.emits);
    let blocked = entities().any(|e| (e.occludes && light) || (e.emits && !coloured));
    let radiance = coloured && entities().any(|e| e.emits);
    [blocked.then_some(FieldKind::Occlusion), radiance.then_some(FieldKind::Radiance)]
}

/// Whether the shadow or light of an entity can fall on another entity, because one other at least is lit.
pub fn is_seen(scene: &Scene, entity: &Entity) -> bool {
    scene.entities.iter().filter(|e| e.receives).count() > usize::from(entity.receives)
}

/// Whether a mesh can shadow itself. If it cannot, its transfer is the cosine lobe of the normal.
pub fn bakes_transfer(mesh: &Mesh) -> bool {
    !mesh.is_flat() && !mesh.is_convex()
}

/// Bakes or finds in the cache every field and transfer of `needs`, which are those of `scene`. What is baked is kept in the cache.
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
    let mut out = BakedScene { meshes: vec![BakedMesh::default(); scene.meshes.len()], baked: Vec::new() };
    // Meshes that are equal under two names share what is baked.
    let mut known = HashMap::<String, Arc<ShadowField>>::new();
    for ((mesh, headers), to) in scene.meshes.iter().zip(&needs.fields).zip(&mut out.meshes) {
        for (header, to) in headers.iter().zip([&mut to.blocked, &mut to.radiance]) {
            let Some(header) = header else { continue };
            let name = field_name(header);
            if !known.contains_key(&name) {
                let kind = if header.kind == FieldKind::Radiance { "light" } else { "shadow" };
                let what = format!("{} {kind}", mesh.name);
                let done = |now, all| progress(&what, now, all);
                let (field, report) = cache.field(baker, mesh, header, &done)?;
                out.baked.extend(report.map(|report| Baked { what, report }));
                known.insert(name.clone(), field);
            }
            *to = known.get(&name).cloned();
        }
    }
    let mut known = HashMap::<[u8; 32], Arc<Vec<f32>>>::new();
    for ((mesh, needed), to) in scene.meshes.iter().zip(&needs.transfers).zip(&mut out.meshes) {
        if !needed {
            continue;
        }
        if !known.contains_key(&mesh.content_hash()) {
            let what = format!("{} transfer", mesh.name);
            let done = |now, all| progress(&what, now, all);
            let (transfer, report) = cache.transfer(baker, mesh, &needs.options, &done)?;
            out.baked.extend(report.map(|report| Baked { what, report }));
            known.insert(mesh.content_hash(), transfer);
        }
        to.transfer = known.get(&mesh.content_hash()).cloned();
    }
    Ok(out)
}
