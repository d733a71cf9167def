//! Bakes or finds in the cache every field and transfer vector that a scene needs. Everything that shows a scene calls
//! [`ensure()`].

use super::cache::{Cache, field_name};
use super::surfaces::{BakedSurface, SurfacePlan};
use super::triangles::have_one_shape;
use super::{BakeReport, Baker, Options, Wanted, header};
use crate::asset::Mesh;
use crate::error::Result;
use crate::field::lamp_colors::LampColors;
use crate::field::quantity::channel_stride;
use crate::field::silhouette::SilhouetteField;
use crate::field::silhouette_nodes::NodeGrid;
use crate::field::visibility_volume::SceneVolume;
use crate::field::{FieldHeader, FieldKind, ShadowField};
use crate::scene::Scene;
use crate::scene::groups::Groups;
use crate::scene::light::{self, LightMethod, Lights};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// A function that is told the name of what is being baked, the samples that are done, and the samples in all; fields and
/// surfaces are baked at the same time.
pub type SceneProgress<'p> = &'p (dyn Fn(&str, u32, u32) + Sync);

#[derive(Clone, Debug, serde::Serialize)]
pub struct Baked {
    /// Name of the mesh, and the kind of field.
    pub what: String,
    pub report: BakeReport,
}

/// What is baked of one mesh, as far as the scene's entities need it. Equal meshes share it.
#[derive(Clone, Default)]
pub struct BakedMesh {
    pub blocked: Option<Arc<ShadowField>>,
    pub radiance: Option<Arc<ShadowField>>,
    pub silhouette: Option<Arc<SilhouetteField>>,
    pub lamp_colors: Option<Arc<LampColors>>,
}

pub struct BakedScene {
    pub meshes: Vec<BakedMesh>,
    pub surfaces: Vec<BakedSurface>,
    pub surface_of: Vec<usize>,
    /// For each entity and each of its clusters the entities whose shadows of sharp lights its maps have.
    pub near: Vec<Vec<Vec<u32>>>,
    /// Entities that never move against each other, in the order of the members of their group.
    pub rigid: Vec<Vec<usize>>,
    /// What all that rests blocks where other things move.
    pub volume: Option<SceneVolume>,
    /// Bakes that were not found in the cache.
    pub baked: Vec<Baked>,
}

pub struct SceneNeeds {
    /// For every mesh of the scene: what it needs, and the headers of its occlusion and radiance fields.
    meshes: Vec<(Needed, [Option<FieldHeader>; 2])>,
    pub surfaces: SurfacePlan,
    pub groups: Groups,
    pub options: Options,
}

/// The rigid groups of a scene, and what is baked of its surfaces.
pub fn surfaces(scene: &Scene, options: &Options, lights: Lights) -> (Groups, SurfacePlan) {
    let groups = if options.groups { Groups::new(scene, lights) } else { Groups::alone(scene) };
    let wanted =
        Wanted { transfer: light::has_harmonics(scene, lights), self_visibility: light::has_sharp(scene, lights) };
    let surfaces = SurfacePlan::new(scene, &groups, options, wanted);
    (groups, surfaces)
}

impl SceneNeeds {
    /// The needs of a scene whose fields and transfers are baked with `options`. A field that nothing sees is not
    /// needed.
    pub fn of(scene: &Scene, options: &Options, lights: Lights) -> Self {
        let (groups, surfaces) = surfaces(scene, options, lights);
        let of_mesh = |index: usize| {
            let mesh = scene.caster(index);
            let needed = needs(scene, index, lights, &groups);
            (needed, needed.fields.map(|kind| kind.map(|kind| header(mesh, kind, options))))
        };
        let meshes = (0..scene.meshes.len()).map(of_mesh).collect();
        SceneNeeds { meshes, surfaces, groups, options: *options }
    }

    /// Bytes of the fields, each rounded up to a multiple of `alignment`, and of the visibility volume. Equal fields count
    /// once.
    pub fn field_bytes(&self, alignment: u64) -> u64 {
        let mut known = HashSet::new();
        let headers = self.meshes.iter().flat_map(|(_, headers)| headers).flatten();
        let distinct = headers.filter(|header| known.insert(field_name(header)));
        let fields: u64 = distinct.map(|header| header.payload_bytes().next_multiple_of(alignment)).sum();
        let node_bytes = channel_stride(self.options.bands) * self.options.storage.bytes();
        let volumes = self.surfaces.groups.iter().filter_map(|group| group.volume.as_ref());
        fields + volumes.map(|volume| (volume.nodes.count() * node_bytes) as u64).sum::<u64>()
    }

    /// For every mesh that needs outlines the first that has its shape, whose outlines are its own: they are about the
    /// mesh's centre, so that those of a row of columns are one.
    fn outlined_as(&self, scene: &Scene) -> Vec<Option<usize>> {
        let mut firsts: Vec<usize> = Vec::new();
        let mut first_of = |index: usize| {
            let mesh = scene.caster(index);
            let known = firsts.iter().copied().find(|first| have_one_shape(scene.caster(*first), mesh));
            known.unwrap_or_else(|| {
                firsts.push(index);
                index
            })
        };
        let needed = self.meshes.iter().enumerate();
        needed.map(|(index, (needed, _))| needed.silhouette.then(|| first_of(index))).collect()
    }

    /// The bakes that [`ensure()`] will not find in the cache, in its order: the name that progress is told by, and the
    /// number of captures.
    pub fn missing(&self, scene: &Scene, cache: &Cache) -> Vec<(String, u32)> {
        let mut missing: Vec<(String, u32)> = Vec::new();
        for ((index, (_, headers)), first) in self.meshes.iter().enumerate().zip(self.outlined_as(scene)) {
            let mesh = scene.caster(index);
            for header in headers.iter().flatten().filter(|header| !cache.has_field(header)) {
                missing.push((field_title(mesh, header), header.lattice.sample_count()));
            }
            if first == Some(index) && !cache.has_silhouette(mesh, &self.options) {
                missing.push((silhouette_title(mesh), NodeGrid::map_count(self.options.silhouette.cells) as u32));
            }
        }
        for group in self.surfaces.groups.iter().filter(|group| !cache.has_surfaces(group)) {
            missing.push((group.title(), group.vertex_count() as u32));
        }
        for volume in self.surfaces.groups.iter().filter_map(|group| group.volume.as_ref()) {
            if !cache.has_volume(volume) {
                missing.push((VOLUME_TITLE.into(), volume.nodes.count() as u32));
            }
        }
        missing
    }
}

const VOLUME_TITLE: &str = "room between things at rest";

fn field_title(mesh: &Mesh, header: &FieldHeader) -> String {
    let word = if header.kind == FieldKind::Radiance { "light" } else { "shadow" };
    format!("{} {word}", mesh.name)
}

fn silhouette_title(mesh: &Mesh) -> String {
    format!("{} silhouette", mesh.name)
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needed {
    pub fields: [Option<FieldKind>; 2],
    pub silhouette: bool,
    pub lamp_colors: bool,
}

/// What the entities of a mesh need. An entity that only receives, or that nothing else can see, needs no field, and an
/// occluder that is a rectangle none either.
/// Without light no shadows are needed, without light in spherical harmonics occlusion fields of what moves alone,
/// without sharp lights no silhouettes. A sharp light needs no radiance field, but may have colours of its parts. What
/// only members of its own group see of an occluder is in their own visibility, less the shadows of sharp lights.
pub fn needs(scene: &Scene, mesh: usize, lights: Lights, groups: &Groups) -> Needed {
    let entities = || (0..scene.entities.len()).filter(|&i| scene.entities[i].mesh == mesh);
    let seen = || entities().filter(|&e| groups.is_seen(e));
    let seen_by_others = || entities().filter(|&e| groups.is_seen_by_others(e));
    let method = |entity| LightMethod::of(scene, entity, lights);
    let coloured = scene.meshes[mesh].colors.is_some();
    let harmonics = light::has_harmonics(scene, lights);
    let sharp = light::has_sharp(scene, lights);
    let shines = |wanted: LightMethod| seen().any(|e| scene.entities[e].emits && method(e) == wanted);
    let casts = scene.caster(mesh).rectangle().is_none();
    // Light bounces from what moves by its occlusion field.
    let wanted = |e: usize| harmonics || (sharp && !scene.is_at_rest(e));
    let blocked = (casts && seen_by_others().any(|e| scene.entities[e].occludes && wanted(e)))
        || (shines(LightMethod::Harmonics) && !coloured);
    let radiance = coloured && shines(LightMethod::Harmonics);
    Needed {
        fields: [blocked.then_some(FieldKind::Occlusion), radiance.then_some(FieldKind::Radiance)],
        lamp_colors: seen().any(|e| scene.entities[e].emits && method(e).has_colors(&scene.meshes[mesh])),
        silhouette: (casts
            && sharp
            && seen().any(|e| {
                let by_boxes = scene.casts_as_box(e) || scene.casts_as_boxes(e);
                scene.entities[e].occludes && !by_boxes
            }))
            || shines(LightMethod::Outline),
    }
}

/// Whether a mesh can shadow itself. If it cannot, its transfer is the cosine lobe of the normal.
pub fn bakes_transfer(mesh: &Mesh) -> bool {
    !mesh.is_flat() && !mesh.is_convex()
}

/// Bakes or finds in the cache every field and transfer of `needs`, which are those of `scene`, mesh by mesh. What is
/// baked is kept in the cache. The device bakes fields while the host casts the rays of surfaces.
pub fn ensure(
    baker: &Baker,
    cache: &Cache,
    scene: &Scene,
    needs: &SceneNeeds,
    progress: SceneProgress<'_>,
) -> Result<BakedScene> {
    let (fields, surfaces) = std::thread::scope(|threads| {
        let fields = threads.spawn(|| ensure_fields(baker, cache, scene, needs, progress));
        let surfaces = ensure_surfaces(cache, scene, needs, progress);
        (fields.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), surfaces)
    });
    let (meshes, mut baked) = fields?;
    baked.extend(surfaces.baked);
    // What is held for further bakes is free for pictures.
    baker.rest();
    Ok(BakedScene { meshes, baked, ..surfaces })
}

fn noted(what: &str, report: Option<BakeReport>) -> Option<Baked> {
    let report = report?;
    log::info!("{what}: baked in {:.1} s", report.total.as_secs_f64());
    Some(Baked { what: what.to_owned(), report })
}

fn ensure_fields(
    baker: &Baker,
    cache: &Cache,
    scene: &Scene,
    needs: &SceneNeeds,
    progress: SceneProgress<'_>,
) -> Result<(Vec<BakedMesh>, Vec<Baked>)> {
    let options = &needs.options;
    let mut baked = Vec::new();
    // Equal meshes of two names share fields, which are looked for once.
    let mut fields: HashMap<String, Arc<ShadowField>> = HashMap::new();
    let mut silhouettes: HashMap<usize, Arc<SilhouetteField>> = HashMap::new();
    let mut lamp_colors: HashMap<[u8; 32], Arc<LampColors>> = HashMap::new();
    let mut meshes = Vec::with_capacity(scene.meshes.len());
    for ((index, (needed, headers)), first) in needs.meshes.iter().enumerate().zip(needs.outlined_as(scene)) {
        let mesh = scene.caster(index);
        let mut to = BakedMesh::default();
        for (header, to) in headers.iter().zip([&mut to.blocked, &mut to.radiance]) {
            let Some(header) = header else { continue };
            let name = field_name(header);
            if !fields.contains_key(&name) {
                let what = field_title(mesh, header);
                let (found, report) = cache.field(baker, mesh, header, &|now, all| progress(&what, now, all))?;
                baked.extend(noted(&what, report));
                fields.insert(name.clone(), found);
            }
            *to = Some(fields[&name].clone());
        }
        if first == Some(index) {
            let what = silhouette_title(mesh);
            let (found, report) = cache.silhouette(baker, mesh, options, &|now, all| progress(&what, now, all))?;
            baked.extend(noted(&what, report));
            silhouettes.insert(index, found);
        }
        to.silhouette = first.map(|first| silhouettes[&first].clone());
        if needed.lamp_colors {
            let mesh = &scene.meshes[index];
            let silhouette = to.silhouette.as_deref().filter(|_| mesh.ball_share().is_none());
            let bake = || Arc::new(LampColors::bake(mesh, options.silhouette.cells, silhouette));
            to.lamp_colors = Some(lamp_colors.entry(mesh.content_hash()).or_insert_with(bake).clone());
        }
        meshes.push(to);
    }
    Ok((meshes, baked))
}

/// The scene without its meshes.
fn ensure_surfaces(cache: &Cache, scene: &Scene, needs: &SceneNeeds, progress: SceneProgress<'_>) -> BakedScene {
    let mut baked = Vec::new();
    let count = scene.entities.len();
    let mut scene_surfaces = Vec::new();
    let mut surface_of = vec![0; count];
    let mut near = vec![Vec::new(); count];
    let mut rigid = Vec::new();
    let mut volume = None;
    for group in &needs.surfaces.groups {
        let what = group.title();
        let (found, report) = cache.surfaces(group, &|now, all| progress(&what, now, all));
        baked.extend(noted(&what, report));
        for (place, &entity) in group.entities.iter().enumerate() {
            // Entities alone share the only surface of their group.
            let member = place.min(found.len() - 1);
            surface_of[entity] = scene_surfaces.len() + member;
            near[entity] = found[member].near.iter().map(|members| group.entities_of(members)).collect();
        }
        if found.len() > 1 {
            rigid.push(group.entities.clone());
        } else {
            rigid.extend(group.entities.iter().map(|&entity| vec![entity]));
        }
        scene_surfaces.extend(found.iter().cloned());
        if let Some(plan) = &group.volume {
            let (found, report) = cache.volume(group, plan, &|now, all| progress(VOLUME_TITLE, now, all));
            baked.extend(noted(VOLUME_TITLE, report));
            let mut has = vec![false; count];
            group.entities.iter().zip(group.occluders()).for_each(|(&entity, blocks)| has[entity] = blocks);
            volume = (!found.blocked.is_empty()).then_some(SceneVolume { volume: found, has });
        }
    }
    BakedScene { meshes: Vec::new(), surfaces: scene_surfaces, surface_of, near, rigid, volume, baked }
}
