//! Reflections of a frame: which entities have them, of which lights, and how the eye sees them now.

use super::{Frame, Viewport};
use crate::bounce::Bounce;
use crate::bounce::twin::SeenLink;
use crate::draw::DrawnGloss;
use crate::draw::camera::world_from_centred;
use crate::draw::triangles::Detail;
use crate::error::Result;
use crate::gloss::lobe::mean_energy;
use crate::gloss::sky_map::SkyMap;
use crate::gloss::twin::{Twin, TwinVertex};
use crate::gloss::{DrawnReflections, Glossy, PIXEL_ROUGHNESS, ReflectionInputs, Reflections};
use crate::gpu::{Buffer, Device};
use crate::layout::{Cluster, GlossEntity, NONE, SHOWN_LIGHTS};
use crate::lists::sight::Sight;
use crate::scene::{Entity, LightMethod, MapIndices, Placement, Scene};
use crate::scene_buffers::SceneBuffers;
use crate::shaders::Library;
use glam::DVec3;
use std::sync::Arc;

/// Reflections of the scene's glossy receivers; `None` where it has none, or where the device's texel views do not hold
/// them: then these are diffuse.
pub(super) fn reflections(
    device: &Arc<Device>,
    library: &Library,
    scene: &Scene,
    methods: &[LightMethod],
    buffers: &SceneBuffers,
    light_bytes: u64,
    texels: bool,
    links: bool,
) -> Result<Option<Reflections>> {
    let is_glossy = |index: &usize| scene.entities[*index].reflection().is_some();
    let lights = shown_lights(scene, methods);
    let glossy: Vec<Glossy> = (0..scene.entities.len())
        .filter(is_glossy)
        .map(|entity| Glossy {
            entity,
            vertex_count: buffers.surface(entity).vertices.len() as u32,
            lights: lights[entity],
        })
        .collect();
    if glossy.is_empty() {
        return Ok(None);
    }
    if !DrawnReflections::fit(device, light_bytes, &buffers.vertices, scene.entities.len()) {
        log::warn!("no surface is glossy: the device's texel buffers cannot hold what all vertices reflect");
        return Ok(None);
    }
    let count = scene.entities.len();
    let sky = &scene.environment;
    Reflections::new(device, library, sky, glossy, count, light_bytes, texels, links).map(Some)
}

/// The sharp lights that are strongest at the centre of each entity, at the scene's first time.
fn shown_lights(scene: &Scene, methods: &[LightMethod]) -> Vec<[u32; SHOWN_LIGHTS]> {
    let placed = scene.entities.iter().zip(scene.at(0.0));
    let spheres: Vec<(DVec3, f64)> =
        placed.map(|(entity, at)| at.sphere(scene.meshes[entity.mesh].bounding_sphere())).collect();
    let is_sharp = |index: &usize| scene.entities[*index].emits && methods[*index].is_sharp();
    let lights: Vec<usize> = (0..scene.entities.len()).filter(is_sharp).collect();
    let strongest = |receiver: usize| {
        let (centre, radius_m) = spheres[receiver];
        let strength = |&light: &usize| {
            let (at, light_radius_m) = spheres[light];
            let distance_m = at.distance(centre).max(radius_m + light_radius_m);
            let emission = f64::from(scene.entities[light].emission.element_sum());
            (emission * (light_radius_m / distance_m).powi(2), light)
        };
        let mut ranked: Vec<(f64, usize)> = lights.iter().filter(|&&light| light != receiver).map(strength).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut shown = [NONE; SHOWN_LIGHTS];
        shown.iter_mut().zip(ranked).for_each(|(slot, (_, light))| *slot = light as u32);
        shown
    };
    (0..scene.entities.len()).map(strongest).collect()
}

/// What the pixels of a glossy entity look up.
pub(super) fn detail(entity: &Entity) -> Option<Detail> {
    let gloss = entity.reflection()?;
    Some(match gloss.roughness {
        _ if entity.maps.any() => Detail::Textured,
        roughness if roughness < PIXEL_ROUGHNESS => Detail::Mirror,
        _ => Detail::Rough,
    })
}

impl Frame {
    /// The glossy entities as the scene's camera sees them, and their clusters that viewports may show.
    pub(super) fn prepare_gloss(&mut self, placements: &[Placement], viewports: &[Viewport]) -> Result<()> {
        if self.reflections.is_none() {
            return Ok(());
        }
        // How the cameras of viewports that show light see each entity.
        let shown = viewports.iter().filter(|viewport| viewport.shows_light());
        let cameras: Vec<_> = shown.map(|viewport| self.camera([viewport.area[2], viewport.area[3]])).collect();
        let seen = |(index, placement)| cameras.iter().map(|camera| self.sight(camera, index, placement)).collect();
        let sights: Option<Vec<Vec<Sight>>> = (self.options.skip.hidden && !cameras.is_empty())
            .then(|| placements.iter().enumerate().map(seen).collect());
        let Some(reflections) = &self.reflections else { return Ok(()) };
        let eye = self.scene.data.camera.eye;
        let mut entities = vec![GlossEntity::default(); placements.len()];
        for glossy in &reflections.glossy {
            let index = glossy.entity;
            let entity = &self.scene.entities[index];
            let Some(gloss) = entity.gloss else { continue };
            let factor = self.scene.data.entities[index].gloss.unwrap_or(gloss);
            let mut matrix = world_from_centred(&placements[index], self.buffers.meshes[entity.mesh].centre_m);
            matrix.w_axis -= eye.as_dvec3().extend(0.0);
            let pair = |k: usize| {
                let [low, high] = [0, 1].map(|of| glossy.lights[2 * k + of]);
                let held = |light: u32| if light == NONE { 0 } else { light };
                held(low) | held(high) << 16
            };
            let row = |row: usize| matrix.row(row).as_vec4().to_array();
            entities[index] = GlossEntity {
                row_x: row(0),
                row_y: row(1),
                row_z: row(2),
                albedo: entity.albedo.to_array(),
                roughness: gloss.roughness,
                eye: eye.to_array(),
                metallic: gloss.metallic,
                lights: std::array::from_fn(pair),
                more_lights: std::array::from_fn(|k| pair(4 + k)),
                f0: gloss.f0,
                sky_scale: reflections.sky_scale(),
                vertex_first: self.buffers.surface(index).vertices.start,
                radiosity_first: (self.radiosity.offsets[index] / 16) as u32,
                vertex_count: glossy.vertex_count,
                mean_energy: if self.options.single_scatter { 0.0 } else { mean_energy(gloss.roughness) },
                light_count: glossy.lights.iter().filter(|&&light| light != NONE).count().max(1) as u32,
                textured: u32::from(entity.maps.any()),
                glow: entity.maps.glow_scale.extend(0.0).to_array(),
                factors: [
                    factor.roughness,
                    factor.metallic,
                    entity.maps.normal_scale,
                    f32::from(u8::from(entity.maps.glow.is_some())),
                ],
                ..GlossEntity::default()
            };
        }
        self.tell_mirrors(&mut entities);
        let Some(reflections) = &mut self.reflections else { return Ok(()) };
        reflections.entities.write(&entities)?;
        let is_glossy: Vec<bool> = entities.iter().map(|entity| entity.vertex_count > 0).collect();
        let clusters = self.work.lists.clusters_of(&is_glossy, sights.as_deref());
        let first = |cluster: &Cluster| cluster.radiosity_first - entities[cluster.receiver as usize].radiosity_first;
        reflections.set_clusters(&clusters.map(|cluster| [cluster.receiver, first(cluster)]).collect::<Vec<_>>())
    }

    pub(super) fn drawn_gloss(&self, entity: &Entity) -> Option<DrawnGloss<'_>> {
        let detail = detail(entity)?;
        let MapIndices { gloss, normal, glow, .. } = entity.maps;
        let texture = |index: Option<usize>| index.map(|index| &*self.buffers.textures[index]);
        Some(DrawnGloss { detail, maps: [gloss, normal, glow].map(texture) })
    }

    pub(super) fn gloss_work(&self) -> Option<(&Reflections, ReflectionInputs<'_>)> {
        let inputs = ReflectionInputs {
            vertices: &self.buffers.vertices,
            direct: self.radiosity.direct(),
            radiosity: &self.radiosity.merged,
            linked: self.bounce.as_ref().map(Bounce::linked_light),
        };
        self.reflections.as_ref().map(|reflections| (reflections, inputs))
    }

    /// What the vertices of an entity reflect in the last picture, as they are stored, and what the twin finds by the
    /// same transfer and the same light of links. Vertices that a picture skipped are stored as they were.
    pub fn reflections_beside_twin(&self, entity: usize, placements: &[Placement]) -> Result<[Vec<[DVec3; 2]>; 2]> {
        let Some(reflections) = &self.reflections else { return Ok([Vec::new(), Vec::new()]) };
        let surface = self.buffers.surface(entity);
        let mesh = self.scene.surface(entity);
        let first = (self.radiosity.offsets[entity] / 16) as usize;
        let vertex_count = surface.order.len();
        let roughness = self.scene.entities[entity].gloss.map_or(1.0, |gloss| f64::from(gloss.roughness));
        let twin = Twin::new(SkyMap::new(&self.scene.environment));
        let placement = placements[entity];
        let eye = self.scene.data.camera.eye.as_dvec3();
        let found = reflections.read(first, vertex_count)?;
        let found = found.iter().map(|pair| pair.map(|[r, g, b, _]| DVec3::new(r.into(), g.into(), b.into())));
        let through = reflections.read_through(first, vertex_count)?;
        let bounced = self.bounced_and_links(first, entity, vertex_count)?;
        let wanted = surface.order.iter().zip(through).zip(bounced).map(|((&v, through), bounced)| {
            let place = placement.point(mesh.positions[v as usize].as_dvec3());
            let normal = (placement.turn() * mesh.normals[v as usize].as_dvec3()).normalize();
            let vertex = TwinVertex { normal, toward: (eye - place).normalize(), through, place, bounced };
            twin.vertex(&vertex, roughness)
        });
        Ok([found.collect(), wanted.collect()])
    }

    /// Of each vertex of an entity, the irradiance over pi of light that has bounced, and what its links lead to.
    fn bounced_and_links(
        &self,
        first: usize,
        entity: usize,
        vertex_count: usize,
    ) -> Result<Vec<Option<(DVec3, Vec<SeenLink>)>>> {
        let Some(bounce) = &self.bounce else { return Ok((0..vertex_count).map(|_| None).collect()) };
        let bytes = 16 * first as u64..16 * (first + vertex_count) as u64;
        let [before, after] = [self.radiosity.direct(), &self.radiosity.merged];
        let light = |buffer: &Buffer| buffer.download_range::<[f32; 4]>(bytes.clone());
        let albedo = self.scene.entities[entity].albedo.as_dvec3().max(DVec3::splat(1e-4));
        let bounced = light(before)?.into_iter().zip(light(after)?).map(|(before, after)| {
            let [before, after] = [before, after].map(|light| DVec3::from_slice(&light.map(f64::from)));
            (after - before).max(DVec3::ZERO) / albedo
        });
        Ok(bounced.zip(bounce.links_of(first..first + vertex_count)?).map(Some).collect())
    }

    pub(super) fn drawn_reflections(&self) -> Option<DrawnReflections<'_>> {
        let of = |reflections| DrawnReflections {
            reflections,
            vertices: &self.buffers.vertices,
            lights: &self.work.entities,
        };
        self.reflections.as_ref().map(of)
    }

    /// Where the merge and the pass of sharp lights leave what reflections need.
    pub(super) fn kept_for_gloss(&self) -> Option<[&Buffer; 3]> {
        let reflections = self.reflections.as_ref()?;
        Some([&reflections.through, &reflections.shown_lights, &reflections.shown_shares])
    }
}
