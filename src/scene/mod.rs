//! Scenes: checked data from TOML, with the meshes and the distant light that they name.
//!
//! [`Data`] has the content of the file and can be written as TOML; [`Scene`] adds derived data.

pub mod builder;
pub mod data;
mod export;
#[cfg(feature = "cli")]
pub(crate) mod files;
pub(crate) mod framing;
mod gloss;
pub mod gltf;
pub mod groups;
pub mod keys;
pub mod light;
pub mod motion;
pub mod single;
mod sun;
pub mod surroundings;
pub mod values;

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use serde::Deserialize;
use toml::Spanned;

use crate::asset::enclose::around_boxes;
use crate::asset::environment::{Environment, EnvironmentData};
use crate::asset::pierce::pierced;
use crate::asset::texture::{Texels, Texture};
use crate::asset::{Mesh, embedded, line_of, obj, read_file, utf8};
use crate::error::{Error, Result};
pub use builder::{SceneBuilder, Shape};
pub use data::{Albedo, Camera, Data, EntityData, MeshData, Output, TextureData};
pub use gloss::{Gloss, MapIndices, Maps};
pub use light::{LightMethod, Lights, Spot};
pub use motion::{Motion, Placement};
use single::Apart;
pub use surroundings::Surroundings;

/// Largest number of entities in a scene.
pub const ENTITY_LIMIT: usize = 4096;
/// Largest number of meshes in a scene.
pub const MESH_LIMIT: usize = 1024;
/// Most boxes in a scene as which solids block sharp lights, and how many entities remain for suns.
const BOXES_LIMIT: usize = 512;
const ROOM_FOR_SUNS: usize = 64;
/// Largest scene file in bytes.
pub const FILE_LIMIT_BYTES: u64 = 16 << 20;

/// A checked scene with its meshes. The fields are public to read; methods change them together.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The content of the scene file.
    pub data: Data,
    /// Meshes in the file's order.
    pub meshes: Vec<Arc<Mesh>>,
    /// Textures in the file's order.
    pub textures: Vec<Arc<Texture>>,
    /// What textures leave of meshes in which they make holes.
    casters: HashMap<usize, Arc<Mesh>>,
    /// Meshes that block sharp lights as their boxes.
    pub(crate) boxed: BTreeSet<usize>,
    /// Entities in the file's order, with their switches resolved, and then suns. [`Scene::at`] gives their placements.
    pub entities: Vec<Entity>,
    /// The surface of each entity ([`Scene::surface`]); empty where all are the meshes themselves.
    pub(crate) surfaces: Vec<Arc<Mesh>>,
    /// Entities at rest that were taken out of their group.
    loose: BTreeSet<usize>,
    /// Where the suns stand, which are the last of the entities and do not stand in the file.
    suns: Vec<Placement>,
    /// Distant light.
    pub environment: Environment,
    /// Whether the file has no camera, so that the scene's was added.
    camera_added: bool,
}

/// Most boxes that move of which it is known which links of light between what rests they hide.
pub(crate) const MOST_SCREENS: usize = 8;

/// The properties of an entity that do not depend on time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entity {
    /// Its name, or `entity N` counted from 0.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Linear reflectance, 0 to 1; where a texture varies it, the mean over the surface.
    pub albedo: Vec3,
    /// Index into [`Scene::textures`].
    pub texture: Option<usize>,
    /// How it reflects besides, if it is glossy; where a texture varies it, the mean over the picture.
    pub gloss: Option<Gloss>,
    /// Its textures besides the albedo's, if it is glossy and has texture coordinates.
    pub maps: MapIndices,
    /// Share of light that it keeps back within its outline, 0 to 1; where a texture varies it, the mean over the
    /// surface.
    pub opacity: f32,
    /// Whether it is drawn over what lies behind it, because light passes places of it that are no holes.
    pub transparent: bool,
    /// Linear radiance in W m^-2 sr^-1. It is multiplied by the mesh's colours, if there are any.
    pub emission: Vec3,
    /// The cone of its light, if it is a spot.
    pub spot: Option<Spot>,
    /// Whether it lights other entities.
    pub emits: bool,
    /// Whether it casts shadows.
    pub occludes: bool,
    /// Whether it is lit.
    pub receives: bool,
}

impl Entity {
    /// How it reflects besides diffusely, where it is lit.
    pub(crate) fn reflection(&self) -> Option<Gloss> {
        self.gloss.filter(|_| self.receives)
    }
}

impl Scene {
    /// A scene that is put together in code.
    pub fn builder() -> SceneBuilder {
        SceneBuilder::default()
    }

    /// Reads a scene and the files that it names, relative to it. If the path does not exist, an embedded scene is read
    /// (`assets/scenes/NAME.toml`, or NAME alone). A `.glb` or `.gltf` file is read as [`gltf`] says; what is left out
    /// of it is logged. An `.obj` file becomes the scene that [`single`] says.
    ///
    /// # Errors
    /// [`Error::Input`], one line that starts with the file and, where one is to blame, the line.
    pub fn load(path: &Path) -> Result<Self> {
        Self::load_at(path, 0.0)
    }

    /// As [`Scene::load`]; skins and morph targets of a glTF file stand in their pose at `time_s` seconds.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_at(path: &Path, time_s: f64) -> Result<Self> {
        let (scene, notes) = Self::load_with_notes(path, &gltf::Options { time_s, camera: None })?;
        notes.left_out().iter().for_each(|line| log::warn!("{}: {line}", path.display()));
        notes.said().iter().for_each(|line| log::info!("{}: {line}", path.display()));
        Ok(scene)
    }

    /// As [`Scene::load`], with what is taken of a glTF file and what a reader of it has to know, which is nothing of
    /// other files.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_with_notes(path: &Path, options: &gltf::Options) -> Result<(Self, gltf::Notes)> {
        if single::is_obj(path) {
            return Ok((single::load(path)?, gltf::Notes::default()));
        }
        if !gltf::is_gltf(path) {
            return Ok((Self::load_toml(path)?, gltf::Notes::default()));
        }
        let gltf::Import { data, meshes, textures, camera_added, notes } = gltf::load(path, options)?;
        let entities = resolve_all(&data, &meshes, &textures, |_, what| Error::input(path, what))?;
        let environment = Environment::new(&data.environment, &read_named).map_err(|e| e.context(path.display()))?;
        let scene = Self { camera_added, ..Self::assemble(data, meshes, textures, entities, environment) };
        Ok((scene, notes))
    }

    fn load_toml(path: &Path) -> Result<Self> {
        let named = embedded::scene_path(path).filter(|_| !path.exists());
        let path = named.as_deref().unwrap_or(path);
        if !path.exists() && embedded::find(path).is_some() {
            let bytes = embedded::read(path)?;
            return Self::parse(utf8(path, &bytes, FILE_LIMIT_BYTES, "scene")?, path, &embedded::read);
        }
        let bytes = read_file(path, FILE_LIMIT_BYTES)?;
        if bytes.contains(&0) && path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("toml")) {
            return Err(Error::input(path, "scenes are .toml, .glb, .gltf or .obj files: export it as one of these"));
        }
        Self::parse(utf8(path, &bytes, FILE_LIMIT_BYTES, "scene")?, path, &read_named)
    }

    /// Reads a scene from text. `path` names it in messages; `read` is given the paths of files, which already start
    /// with the folder of `path`. If `read` fails, the file is searched among the embedded ones, such as
    /// `assets/meshes/torus.obj`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse(text: &str, path: &Path, read: &dyn Fn(&Path) -> Result<Vec<u8>>) -> Result<Self> {
        let data = Data::parse(text, path)?;
        // For messages about what is found after parsing.
        let tables: Tables = toml::from_str(text).unwrap_or_default();
        let line = |table: Option<&Spanned<toml::Table>>| {
            table.map_or(1, |table| line_of(text.as_bytes(), table.span().start))
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        // A file that is not on disk may be embedded under its own name, wherever the scene file lies.
        let read = |file: &Path| {
            let full = folder.join(file);
            read(&full)
                .or_else(|error| embedded::find(file).filter(|_| !full.exists()).map(<[u8]>::to_vec).ok_or(error))
        };

        let mut readers = gltf::Readers::new(folder);
        let mut apart = HashMap::new();
        let textures = read_textures(&data, &read, &mut readers)
            .map_err(|(i, what)| Error::input_at(path, line(tables.textures.get(i)), what))?;
        let mut meshes: Vec<Arc<Mesh>> = Vec::with_capacity(data.meshes.len());
        for (i, mesh) in data.meshes.iter().enumerate() {
            let at = |what: String| Error::input_at(path, line(tables.meshes.get(i)), what);
            if data.meshes[..i].iter().any(|m| m.name == mesh.name) {
                return Err(at(format!("there are two meshes {:?}", mesh.name)));
            }
            let built = build_mesh(mesh, folder, &read, &mut readers, &mut apart)
                .map_err(|e| at(format!("mesh {:?}: {e}", mesh.name)))?;
            meshes.push(Arc::new(built));
        }
        let fail = |i, what| Error::input_at(path, line(tables.entities.get(i)), what);
        let entities = resolve_all(&data, &meshes, &textures, fail)?;
        let environment = Environment::new(&data.environment, &read)
            .map_err(|e| Error::input_at(path, line(tables.environment.as_ref()), e))?;
        Ok(Self::assemble(data, meshes, textures, entities, environment))
    }

    fn assemble(
        data: Data,
        meshes: Vec<Arc<Mesh>>,
        textures: Vec<Arc<Texture>>,
        entities: Vec<Entity>,
        environment: Environment,
    ) -> Self {
        let mut scene = Self {
            data,
            meshes,
            textures,
            casters: HashMap::new(),
            boxed: BTreeSet::new(),
            entities,
            surfaces: Vec::new(),
            loose: BTreeSet::new(),
            suns: Vec::new(),
            environment,
            camera_added: false,
        };
        scene.cut_casters();
        scene.place_suns();
        scene
    }

    /// Cuts the holes of masked entities out of what casts their shadows. Where entities of one mesh have other masks, or
    /// none, the whole mesh casts them, each by its mean.
    fn cut_casters(&mut self) {
        let mut masks: HashMap<usize, Vec<Option<usize>>> = HashMap::new();
        for (index, entity) in self.entities.iter().enumerate() {
            masks.entry(entity.mesh).or_default().push(entity.texture.filter(|_| self.mask(index).is_some()));
        }
        let cut = |(mesh, textures): (usize, Vec<Option<usize>>)| {
            let texture = textures[0].filter(|_| textures.iter().all(|texture| *texture == textures[0]))?;
            Some((mesh, Arc::new(pierced(&self.meshes[mesh], &self.textures[texture])?)))
        };
        self.casters = masks.into_iter().filter_map(cut).collect();
        for index in 0..self.entities.len() {
            let mesh = self.entities[index].mesh;
            let Some(mask) = self.mask(index) else { continue };
            let share = if self.casters.contains_key(&mesh) { 1.0 } else { mask.mean_opacity(&self.meshes[mesh]) };
            self.entities[index].opacity = self.opacity(index) * share;
        }
        self.choose_boxed();
    }

    /// Chooses the meshes that block sharp lights as their boxes, those of the largest entities first.
    fn choose_boxed(&mut self) {
        let mut counts: HashMap<usize, (usize, f32)> = HashMap::new();
        for (entity, data) in self.entities.iter().zip(&self.data.entities) {
            let mesh = self.caster(entity.mesh);
            let (count, radius_m) = counts.entry(entity.mesh).or_default();
            *count += mesh.boxes().len();
            *radius_m = radius_m.max(data.scale * mesh.bounding_sphere().1);
        }
        let mut counts: Vec<_> = counts.into_iter().filter(|(_, (count, _))| *count > 0).collect();
        counts.sort_by(|(a, (_, of_a)), (b, (_, of_b))| of_b.total_cmp(of_a).then(a.cmp(b)));
        let mut left = BOXES_LIMIT.min(ENTITY_LIMIT.saturating_sub(self.entities.len() + ROOM_FOR_SUNS));
        let fits = |(mesh, (count, _)): (usize, (usize, f32))| {
            let fits = count <= left;
            left -= if fits { count } else { 0 };
            fits.then_some(mesh)
        };
        self.boxed = counts.into_iter().filter_map(fits).collect();
    }

    /// The boxes as which entities block sharp lights: the entity, and the number of its box.
    pub(crate) fn boxes(&self) -> Vec<[usize; 2]> {
        let of_entity = |(index, entity): (usize, &Entity)| {
            let is_boxed = self.boxed.contains(&entity.mesh);
            let count = if is_boxed { self.caster(entity.mesh).boxes().len() } else { 0 };
            (0..count).map(move |number| [index, number])
        };
        self.entities.iter().enumerate().flat_map(of_entity).collect()
    }

    /// The mesh that casts the shadows of entities of a mesh: itself, or what a texture leaves of it.
    pub(crate) fn caster(&self, mesh: usize) -> &Arc<Mesh> {
        self.casters.get(&mesh).unwrap_or(&self.meshes[mesh])
    }

    /// Whether an entity blocks sharp lights as a box in closed form: a lamp's own outline is that of its silhouettes.
    pub(crate) fn casts_as_box(&self, entity: usize) -> bool {
        let Entity { mesh, occludes, emits, .. } = self.entities[entity];
        occludes && !emits && self.caster(mesh).cuboid().is_some()
    }

    /// Whether it does so as the boxes that its mesh consists of. Where these overlap, light may pass neither.
    pub(crate) fn casts_as_boxes(&self, entity: usize) -> bool {
        let Entity { mesh, occludes, emits, transparent, opacity, .. } = self.entities[entity];
        occludes && !emits && !transparent && opacity >= 1.0 && self.boxed.contains(&mesh)
    }

    /// Whether an entity is a closed surface that lets light through.
    pub(crate) fn is_globe(&self, entity: usize) -> bool {
        let Entity { mesh, transparent, occludes, .. } = self.entities[entity];
        transparent && occludes && self.caster(mesh).is_closed()
    }

    /// The mesh of an entity as it is lit and drawn: its own, or a finer one of the same shape.
    pub fn surface(&self, entity: usize) -> &Arc<Mesh> {
        self.surfaces.get(entity).unwrap_or_else(|| &self.meshes[self.entities[entity].mesh])
    }

    /// Places the camera anew for pictures of that width over height, where the file has none.
    pub fn fit_added_camera(&mut self, aspect: f64) {
        if self.camera_added {
            // Lamps are no part of what is looked at.
            let shown = |(at, _): &(usize, &EntityData)| self.entities[*at].receives;
            let things = self.data.entities.iter().enumerate().filter(shown);
            let things = things.map(|(at, data)| (&*self.meshes[self.entities[at].mesh], data.at(0.0)));
            self.data.camera = framing::camera(&framing::points(things), aspect);
        }
    }

    /// Whether an entity has no motion and belongs to the group of all that rest.
    pub(crate) fn is_at_rest(&self, entity: usize) -> bool {
        self.carriers(entity).is_some_and(<[Motion]>::is_empty)
    }

    /// Whether it rests and keeps all light back where it blocks.
    pub(crate) fn rests_opaque(&self, entity: usize) -> bool {
        let Entity { transparent, opacity, .. } = self.entities[entity];
        self.is_at_rest(entity) && !transparent && opacity >= 1.0
    }

    /// Whether an entity is a lamp at rest, which light that bounces within its group does not pass.
    pub(crate) fn is_lamp_at_rest(&self, entity: usize) -> bool {
        let Entity { emits, transparent, .. } = self.entities[entity];
        emits && !transparent && self.is_at_rest(entity)
    }

    /// The nodes that carry an entity, none where it rests: entities with the same ones never move against each other.
    /// `None` of one that has movements of its own, is movable or was taken out of its group.
    pub(crate) fn carriers(&self, entity: usize) -> Option<&[Motion]> {
        let EntityData { motion, movable, .. } = self.data.entities.get(entity)?;
        let is_carried = motion.iter().all(|motion| matches!(motion, Motion::Node(_)));
        (is_carried && !movable && !self.loose.contains(&entity)).then_some(motion)
    }

    /// Puts all entities that were taken out back into their groups. Returns whether there were any.
    pub(crate) fn rejoin(&mut self) -> bool {
        !std::mem::take(&mut self.loose).is_empty()
    }

    /// Takes an entity out of its group, as one that was moved: it may be moved again.
    pub(crate) fn loosen(&mut self, entity: usize) {
        self.loose.insert(entity);
    }

    /// The texture of an entity whose reflectance varies over its surface.
    pub(crate) fn paint(&self, entity: usize) -> Option<&Texture> {
        let Entity { mesh, texture, .. } = self.entities[entity];
        let mesh = &self.meshes[mesh];
        let texture = &self.textures[texture?];
        (texture.texels.is_some() && mesh.uvs.is_some() || mesh.tints.is_some()).then_some(texture)
    }

    /// The texture whose holes light passes, of an entity that has such.
    pub(crate) fn mask(&self, entity: usize) -> Option<&Arc<Texture>> {
        let Entity { mesh, texture, .. } = self.entities[entity];
        let texture = &self.textures[texture?];
        (texture.alpha_cutoff.is_some() && texture.texels.is_some() && self.meshes[mesh].uvs.is_some())
            .then_some(texture)
    }

    /// Reflectance of an entity at a place of a triangle of its mesh over the entity's mean, by colour.
    pub(crate) fn over_mean(&self, entity: usize, corners: [u32; 3], weights: [f32; 3]) -> Vec3 {
        let Some(texture) = self.paint(entity) else { return Vec3::ONE };
        let Entity { mesh, albedo: mean, .. } = self.entities[entity];
        // What passes is not reflected: the mean of what blends is over the whole surface.
        let alpha = if texture.alpha_blend { texture.opacity_at(&self.meshes[mesh], corners, weights) } else { 1.0 };
        let found = self.opacity(entity) * alpha * texture.at(&self.meshes[mesh], corners, weights);
        Vec3::from_array(std::array::from_fn(|c| if mean[c] > 0.0 { found[c] / mean[c] } else { 0.0 }))
    }

    /// Share of light that an entity keeps back, but for its texture.
    pub(crate) fn opacity(&self, entity: usize) -> f32 {
        self.data.entities.get(entity).map_or(1.0, |data| data.opacity)
    }

    /// Share of light that an entity keeps back at a place of a triangle of its mesh.
    pub(crate) fn opacity_at(&self, entity: usize, corners: [u32; 3], weights: [f32; 3]) -> f32 {
        let Entity { mesh, texture, .. } = self.entities[entity];
        self.opacity(entity)
            * texture.map_or(1.0, |index| self.textures[index].opacity_at(&self.meshes[mesh], corners, weights))
    }

    /// Emission of an entity at a place of a triangle of its mesh over the entity's own, by its map.
    pub(crate) fn glow_at(&self, entity: usize, corners: [u32; 3], weights: [f32; 3]) -> Vec3 {
        let Entity { mesh, maps, .. } = self.entities[entity];
        let mesh = &self.meshes[mesh];
        let Some(index) = maps.glow.filter(|_| mesh.colors.is_none()) else { return Vec3::ONE };
        maps.glow_scale * Texture { factor: Vec3::ONE, ..(*self.textures[index]).clone() }.at(mesh, corners, weights)
    }

    /// How an entity reflects at a place of a triangle of its mesh, whose normal there is `normal`, and the normal as its
    /// map tilts it.
    pub(crate) fn gloss_at(
        &self,
        entity: usize,
        corners: [u32; 3],
        weights: [f32; 3],
        normal: Vec3,
    ) -> (Option<Gloss>, Vec3) {
        let Entity { mesh, gloss, maps, .. } = self.entities[entity];
        let mesh = &self.meshes[mesh];
        let (Some(mut gloss), Some(uvs)) = (gloss, &mesh.uvs) else { return (gloss, normal) };
        let [a, b, c] = corners.map(|v| v as usize);
        let uv = weights[0] * uvs[a] + weights[1] * uvs[b] + weights[2] * uvs[c];
        let numbers = |map: Option<usize>| {
            let texture = &self.textures[map?];
            Some(texture.texels.as_ref()?.numbers_at(uv, texture.wrap))
        };
        if let (Some(found), Some(data)) = (numbers(maps.gloss), self.data.entities[entity].gloss) {
            gloss.roughness = data.roughness * found.y;
            gloss.metallic = data.metallic * found.z;
        }
        let Some(found) = numbers(maps.normal) else { return (Some(gloss), normal) };
        let [along, across] = [b, c].map(|v| mesh.positions[v] - mesh.positions[a]);
        let [first, second] = [b, c].map(|v| uvs[v] - uvs[a]);
        let turn = first.perp_dot(second).signum();
        let right = turn * (along * second.y - across * first.y);
        let up = turn * (across * first.x - along * second.x);
        let flat = |axis: Vec3| (axis - normal * normal.dot(axis)).normalize_or_zero();
        let found = 2.0 * found - 1.0;
        let slope = maps.normal_scale * (found.x * flat(right) + found.y * up.normalize_or_zero());
        let tilted = slope + found.z.max(0.0) * normal;
        (Some(gloss), tilted.normalize_or(normal))
    }

    /// Placements of all entities at `time_s` seconds, in order. They depend on the time alone, not on earlier frames.
    pub fn at(&self, time_s: f64) -> Vec<Placement> {
        self.data.entities.iter().map(|e| e.at(time_s)).chain(self.suns.iter().copied()).collect()
    }

    /// The box in the world that an entity stays in as it moves, metres; `None` where it may be put anywhere.
    pub(crate) fn reach(&self, entity: usize) -> Option<[DVec3; 2]> {
        const TIMES: usize = 128;
        let data = self.data.entities.get(entity).filter(|data| !data.motion.is_empty() && !data.movable)?;
        let spans = data.motion.iter().map(Motion::span_s);
        let [from_s, to_s] = spans.fold([f64::MAX, f64::MIN], |[low, high], [from, to]| [low.min(from), high.max(to)]);
        let extent = self.meshes[self.entities[entity].mesh].extent();
        let corner = |i: usize| Vec3::new(extent[i & 1].x, extent[i >> 1 & 1].y, extent[i >> 2].z).as_dvec3();
        // Movements of several periods are at many places together.
        let place = |i: usize| from_s + 2.0 * (to_s - from_s) * i as f64 / TIMES as f64;
        let places = (0..=TIMES).map(|i| data.at(place(i)));
        around_boxes(places.flat_map(|place| (0..8).map(move |i| [place.point(corner(i)); 2])))
    }

    /// The largest boxes that move and keep light back, at most [`MOST_SCREENS`].
    pub(crate) fn screens(&self) -> Vec<usize> {
        let radius_m = |entity: &usize| {
            let radius = self.meshes[self.entities[*entity].mesh].bounding_sphere().1;
            radius * self.data.entities[*entity].scale
        };
        let moves = |entity: &usize| self.casts_as_box(*entity) && !self.is_at_rest(*entity);
        let mut screens: Vec<usize> = (0..self.data.entities.len()).filter(moves).collect();
        screens.sort_by(|a, b| radius_m(b).total_cmp(&radius_m(a)));
        screens.truncate(MOST_SCREENS);
        screens
    }

    /// Replaces the data of an entity; its mesh stays the same.
    ///
    /// # Errors
    /// [`Error::Input`] in one line: a number out of the range that `docs/scene.md` states, or no such entity.
    pub fn set_entity(&mut self, index: usize, data: EntityData) -> Result<()> {
        if index >= self.data.entities.len() {
            return Err(Error::Input(format!("there is no entity {index}")));
        }
        data::check(format!("entity {index}"), &data)?;
        check_textures(&data, &self.data).map_err(|what| Error::Input(format!("entity {index}: {what}")))?;
        self.put_entity(index, data);
        Ok(())
    }

    /// As [`Scene::set_entity`], of numbers in range.
    pub(crate) fn put_entity(&mut self, index: usize, data: EntityData) {
        let before = &self.data.entities[index];
        let opacity = before.opacity;
        let is_repainted = before.albedo != data.albedo || opacity != data.opacity || opacity == 0.0;
        if (before.position, before.rotation, before.scale) != (data.position, data.rotation, data.scale) {
            self.loosen(index);
        }
        let mesh = self.entities[index].mesh;
        let paint = if is_repainted {
            Paint::new(&data.albedo, &self.data, &self.textures, &self.meshes[mesh])
        } else {
            let &Entity { texture, albedo, opacity: whole, .. } = &self.entities[index];
            Paint { texture, mean: albedo / opacity, opacity: whole / opacity }
        };
        let coat = coat(&data, &self.data, &self.textures, &self.meshes[mesh]);
        self.entities[index] = resolve(index, &data, mesh, paint, coat, &self.textures);
        self.data.entities[index] = data;
        if is_repainted {
            self.cut_casters();
        }
    }

    /// Replaces the data of the distant light; its picture stays the same.
    ///
    /// # Errors
    /// As [`Environment::new`].
    pub fn set_environment(&mut self, source: &EnvironmentData) -> Result<()> {
        self.environment = self.environment.with(source)?;
        self.data.environment = source.clone();
        self.place_suns();
        Ok(())
    }

    /// The scene file as text, which parses to equal [`Data`]; comments are lost.
    ///
    /// # Errors
    /// As [`Data::to_toml`].
    pub fn to_toml(&self) -> Result<String> {
        self.data.to_toml()
    }
}

/// Says which number is over the limit of a scene.
fn check_counts(meshes: usize, entities: usize) -> std::result::Result<(), String> {
    let counts = [("meshes", meshes, MESH_LIMIT), ("entities", entities, ENTITY_LIMIT)];
    let over = counts.into_iter().find(|(_, count, limit)| count > limit);
    over.map_or(Ok(()), |(what, count, limit)| Err(format!("{count} {what} are over the limit of {limit}")))
}

/// The entities of `data` with their meshes found by name. `fail` is given the number of an entity that names none, and
/// the message.
fn resolve_all(
    data: &Data,
    meshes: &[Arc<Mesh>],
    textures: &[Arc<Texture>],
    fail: impl Fn(usize, String) -> Error,
) -> Result<Vec<Entity>> {
    let mut paints: HashMap<(&str, &str), Paint> = HashMap::new();
    let mut entities = Vec::with_capacity(data.entities.len());
    for (i, entity) in data.entities.iter().enumerate() {
        let mesh = data.meshes.iter().position(|mesh| mesh.name == entity.mesh);
        let mesh = mesh.ok_or_else(|| fail(i, format!("there is no mesh {:?}", entity.mesh)))?;
        check_textures(entity, data).map_err(|what| fail(i, what))?;
        let paint = match &entity.albedo {
            Albedo::Color(_) => Paint::new(&entity.albedo, data, textures, &meshes[mesh]),
            Albedo::Texture(name) => *paints
                .entry((name, &entity.mesh))
                .or_insert_with(|| Paint::new(&entity.albedo, data, textures, &meshes[mesh])),
        };
        let coat = coat(entity, data, textures, &meshes[mesh]);
        entities.push(resolve(i, entity, mesh, paint, coat, textures));
    }
    Ok(entities)
}

/// Refuses the names of textures that there are not.
fn check_textures(entity: &EntityData, data: &Data) -> std::result::Result<(), String> {
    let albedo = if let Albedo::Texture(name) = &entity.albedo { Some(name) } else { None };
    let is_missing = |name: &&String| data.textures.iter().all(|texture| texture.name != **name);
    let missing = albedo.into_iter().chain(entity.maps.names()).find(is_missing);
    missing.map_or(Ok(()), |name| Err(format!("there is no texture {name:?}")))
}

/// The texture of an entity, its mean reflectance and its mean opacity.
#[derive(Clone, Copy)]
struct Paint {
    texture: Option<usize>,
    mean: Vec3,
    opacity: f32,
}

impl Paint {
    /// The paint that an albedo is on a mesh. One that names no texture is grey.
    fn new(albedo: &Albedo, data: &Data, textures: &[Arc<Texture>], mesh: &Mesh) -> Self {
        match albedo {
            Albedo::Color(color) => Paint { texture: None, mean: *color, opacity: 1.0 },
            Albedo::Texture(name) => {
                let texture = data.textures.iter().position(|texture| texture.name == *name);
                let mean = texture.map_or(Vec3::splat(0.7), |texture| textures[texture].mean(mesh));
                let opacity = texture.map_or(1.0, |texture| textures[texture].mean_opacity(mesh));
                Paint { texture, mean: mean.min(Vec3::ONE), opacity }
            }
        }
    }
}

/// How an entity reflects besides diffusely, and its textures for that.
fn coat(entity: &EntityData, data: &Data, textures: &[Arc<Texture>], mesh: &Mesh) -> (Option<Gloss>, MapIndices) {
    let Some(mut gloss) = entity.gloss else { return (None, MapIndices::default()) };
    let number = |name: &Option<String>| {
        let name = name.as_ref().filter(|_| mesh.uvs.is_some())?;
        data.textures.iter().position(|texture| texture.name == *name && texture.file.is_some())
    };
    let Maps { gloss: varies, normal, normal_scale, glow } = &entity.maps;
    let glow = number(glow);
    let glow_scale = glow.map_or(Vec3::ZERO, |index| {
        let mean = || Texture { factor: Vec3::ONE, ..(*textures[index]).clone() }.mean(mesh).max(Vec3::splat(1e-6));
        if mesh.colors.is_some() { Vec3::ONE } else { mean().recip() }
    });
    let normal = number(normal);
    let normal_scale = normal.map_or(0.0, |_| normal_scale.unwrap_or(1.0));
    let maps = MapIndices { gloss: number(varies), normal, normal_scale, glow, glow_scale };
    if let Some(texels) = maps.gloss.and_then(|index| textures[index].texels.as_ref()) {
        let [_, roughness, metallic] = texels.mean_bytes();
        gloss.roughness *= roughness;
        gloss.metallic *= metallic;
    }
    (Some(gloss), maps)
}

/// Resolves the switches. By default, an entity emits if it has emission, occludes unless it emits, and receives.
fn resolve(
    index: usize,
    data: &EntityData,
    mesh: usize,
    paint: Paint,
    (gloss, maps): (Option<Gloss>, MapIndices),
    textures: &[Arc<Texture>],
) -> Entity {
    let emits = data.emits.unwrap_or(data.emission != Vec3::ZERO);
    Entity {
        name: data.name.clone().unwrap_or_else(|| format!("entity {index}")),
        mesh,
        albedo: data.opacity * paint.mean,
        texture: paint.texture,
        gloss,
        maps,
        opacity: data.opacity * paint.opacity,
        transparent: data.opacity < 1.0 || paint.texture.is_some_and(|texture| textures[texture].alpha_blend),
        emission: data.emission,
        spot: data.spot,
        emits,
        // A mask may leave nothing of it.
        occludes: data.occludes.unwrap_or(!emits) && paint.opacity > 0.0,
        receives: data.receives.unwrap_or(true),
    }
}

/// Reads a mesh: all triangles of a glTF file's scene at rest, or a Wavefront OBJ file, with what a reader of the
/// former has to know.
///
/// # Errors
/// As [`gltf::load_mesh`] and [`Mesh::load`].
pub fn load_mesh(path: &Path) -> Result<(Mesh, gltf::Notes)> {
    if gltf::is_gltf(path) { gltf::load_mesh(path) } else { Ok((Mesh::load(path)?, gltf::Notes::default())) }
}

/// Reads the pictures of a scene's textures; those of one picture share it. An error comes with the number of the texture.
fn read_textures(
    data: &Data,
    read: &dyn Fn(&Path) -> Result<Vec<u8>>,
    readers: &mut gltf::Readers,
) -> std::result::Result<Vec<Arc<Texture>>, (usize, Error)> {
    let mut pictures: HashMap<(&Path, Option<usize>), Arc<Texels>> = HashMap::new();
    let mut textures = Vec::with_capacity(data.textures.len());
    for (i, texture) in data.textures.iter().enumerate() {
        let fail = |error: Error| (i, error.context(format!("texture {:?}", texture.name)));
        texture.check(&data.textures[..i]).map_err(|what| fail(Error::Input(what)))?;
        let texels = texture.file.as_deref().map(|file| {
            if let Some(known) = pictures.get(&(file, texture.image)) {
                return Ok(known.clone());
            }
            let texels = match texture.image {
                Some(image) => readers.get(file)?.texels(image)?,
                None => Arc::new(Texels::decode(&read(file)?).map_err(|error| error.context(file.display()))?),
            };
            pictures.insert((file, texture.image), texels.clone());
            Ok(texels)
        });
        let &TextureData { wrap, factor, alpha_cutoff, alpha_blend, .. } = texture;
        let texels = texels.transpose().map_err(fail)?;
        textures.push(Arc::new(Texture { texels, wrap, factor, alpha_cutoff, alpha_blend }));
    }
    Ok(textures)
}

/// Reads the file of a scene's mesh or runs its generator.
fn build_mesh(
    data: &MeshData,
    folder: &Path,
    read: &dyn Fn(&Path) -> Result<Vec<u8>>,
    readers: &mut gltf::Readers,
    apart: &mut HashMap<PathBuf, Apart>,
) -> Result<Mesh> {
    data.check().map_err(|what| Error::Input(what.into()))?;
    let mut mesh = match (&data.file, &data.generator) {
        (Some(file), None) if data.part.is_some() => {
            let [mesh, at] = data.part.unwrap_or_default();
            let bend = data.bend.map_or(DMat3::IDENTITY, |bend| DMat3::from_cols_array(&bend));
            let part = gltf::Part { mesh, at, pose: data.pose, piece: data.piece };
            readers.get(file)?.part(part, bend, &data.name)?
        }
        (Some(file), None) if data.joined.is_some() => {
            readers.get(file)?.joined(data.joined.as_deref().unwrap_or_default(), &data.name)?
        }
        (Some(file), None) if gltf::is_gltf(file) => {
            let path = folder.join(file);
            let (mesh, notes) = gltf::load_mesh(&path)?;
            notes.left_out().iter().for_each(|line| log::warn!("{}: {line}", path.display()));
            mesh
        }
        (Some(file), None) => {
            let whole = || Mesh::parse(&read(file)?, &folder.join(file));
            match (data.piece, apart.get(file)) {
                (None, _) => whole()?,
                (Some(piece), Some(known)) => known.piece(piece)?,
                (Some(piece), None) => apart.entry(file.clone()).or_insert(Apart::new(whole()?)).piece(piece)?,
            }
        }
        (None, Some(generator)) => generator.build()?,
        _ => return Err(Error::Input("it has either a file or one generator".into())),
    };
    mesh.name.clone_from(&data.name);
    Ok(mesh)
}

/// Reads a file that a scene names: a mesh or a picture.
fn read_named(path: &Path) -> Result<Vec<u8>> {
    read_file(path, obj::FILE_LIMIT_BYTES)
}

/// Where the tables of a scene file begin.
#[derive(Default, Deserialize)]
struct Tables {
    #[serde(default, rename = "texture")]
    textures: Vec<Spanned<toml::Table>>,
    #[serde(default, rename = "mesh")]
    meshes: Vec<Spanned<toml::Table>>,
    #[serde(default, rename = "entity")]
    entities: Vec<Spanned<toml::Table>>,
    environment: Option<Spanned<toml::Table>>,
}
