//! Scenes: plain data read from TOML, checked, with the meshes and the distant light that it names.
//!
//! [`Data`] is the file as it stands and goes back to TOML; [`Scene`] adds what follows from it.

pub mod data;
pub mod motion;
pub mod values;

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use serde::Deserialize;
use toml::Spanned;

use crate::asset::environment::{Environment, EnvironmentData};
use crate::asset::{Mesh, embedded, obj, read_file};
use crate::error::{Error, Result};
pub use data::{Camera, Data, EntityData, MeshData, Output};
pub use motion::{Motion, Placement};

/// Most entities in a scene.
pub const ENTITY_LIMIT: usize = 4096;
/// Most meshes in a scene.
pub const MESH_LIMIT: usize = 1024;
/// Largest scene file in bytes.
pub const FILE_LIMIT_BYTES: usize = 16 << 20;

/// A checked scene, ready to be baked and drawn.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The file as it stands.
    pub data: Data,
    /// Meshes in the file's order.
    pub meshes: Vec<Arc<Mesh>>,
    /// Entities in the file's order, switches resolved. Where they are is [`Scene::at`].
    pub entities: Vec<Entity>,
    /// Distant light.
    pub environment: Environment,
}

/// What an entity is at all times.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// Its name, or `entity N` counted from 0.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Linear reflectance, 0 to 1.
    pub albedo: Vec3,
    /// Linear radiance in W m^-2 sr^-1; multiplies the colours of a mesh that has them.
    pub emission: Vec3,
    /// Whether it lights others.
    pub emits: bool,
    /// Whether it casts shadows.
    pub occludes: bool,
    /// Whether it is lit.
    pub receives: bool,
}

impl Scene {
    /// Reads a scene and the files it names, relative to it. A path that does not exist but is embedded in the binary
    /// (`assets/scenes/NAME.toml`, or NAME alone) is taken from there.
    ///
    /// # Errors
    /// [`Error::Input`], one line that starts with the file and, where one is to blame, the line.
    pub fn load(path: &Path) -> Result<Self> {
        let named = embedded::scene_path(path).filter(|_| !path.exists());
        let path = named.as_deref().unwrap_or(path);
        if !path.exists() && embedded::find(path).is_some() {
            let bytes = embedded::read(path)?;
            return Self::parse(utf8(path, &bytes)?, path, &embedded::read);
        }
        let bytes = read_file(path, FILE_LIMIT_BYTES as u64)?;
        Self::parse(utf8(path, &bytes)?, path, &read_named)
    }

    /// Reads a scene from text. `path` names it in messages; `read` is given the paths of files, which already start with
    /// the folder of `path`. A file that it does not have is looked for among the embedded ones, as `assets/meshes/torus.obj`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse(text: &str, path: &Path, read: &dyn Fn(&Path) -> Result<Vec<u8>>) -> Result<Self> {
        let data = Data::parse(text, path)?;
        let lines = TableLines::read(text);
        let folder = path.parent().unwrap_or(Path::new(""));
        // What is not on disk may be in the binary, under its own name from wherever the scene stands.
        let read = |file: &Path| {
            let full = folder.join(file);
            read(&full)
                .or_else(|error| embedded::find(file).filter(|_| !full.exists()).map(<[u8]>::to_vec).ok_or(error))
        };

        let mut meshes: Vec<Arc<Mesh>> = Vec::with_capacity(data.meshes.len());
        for (i, mesh) in data.meshes.iter().enumerate() {
            let at = |what: String| Error::input_at(path, lines.mesh(i), what);
            if data.meshes[..i].iter().any(|m| m.name == mesh.name) {
                return Err(at(format!("there are two meshes {:?}", mesh.name)));
            }
            let built = mesh.build(folder, &read).map_err(|e| at(format!("mesh {:?}: {e}", mesh.name)))?;
            meshes.push(Arc::new(built));
        }
        let entity = |(i, entity): (usize, &EntityData)| {
            let mesh = data.meshes.iter().position(|m| m.name == entity.mesh);
            let mesh = mesh
                .ok_or_else(|| Error::input_at(path, lines.entity(i), format!("there is no mesh {:?}", entity.mesh)))?;
            Ok(resolve(i, entity, mesh, &meshes[mesh]))
        };
        let entities = data.entities.iter().enumerate().map(entity).collect::<Result<Vec<_>>>()?;
        let environment =
            Environment::new(&data.environment, &read).map_err(|e| Error::input_at(path, lines.environment(), e))?;
        Ok(Self { data, meshes, entities, environment })
    }

    /// Where every entity is at `time_s` seconds, in order. It depends on the time alone, not on the frames before.
    pub fn at(&self, time_s: f64) -> Vec<Placement> {
        self.data.entities.iter().map(|e| e.at(time_s)).collect()
    }

    /// Replaces what the file says of an entity, whose mesh stays.
    pub fn set_entity(&mut self, index: usize, data: EntityData) {
        let mesh = self.entities[index].mesh;
        self.entities[index] = resolve(index, &data, mesh, &self.meshes[mesh]);
        self.data.entities[index] = data;
    }

    /// Replaces what the file says of the distant light; its picture stays.
    ///
    /// # Errors
    /// As [`Environment::new`].
    pub fn set_environment(&mut self, source: &EnvironmentData) -> Result<()> {
        self.environment = self.environment.with(source)?;
        self.data.environment = source.clone();
        Ok(())
    }

    /// The scene file as text, which reads back as equal [`Data`]; comments are not kept.
    pub fn to_toml(&self) -> String {
        self.data.to_toml()
    }
}

/// Defaults of the switches: it emits if it has emission; a light does not occlude, all else does, except that flat ground
/// only receives.
fn resolve(index: usize, data: &EntityData, mesh: usize, shape: &Mesh) -> Entity {
    let emits = data.emits.unwrap_or(data.emission != Vec3::ZERO);
    Entity {
        name: data.name.clone().unwrap_or_else(|| format!("entity {index}")),
        mesh,
        albedo: data.albedo,
        emission: data.emission,
        emits,
        occludes: data.occludes.unwrap_or(!emits && !shape.is_flat()),
        receives: data.receives.unwrap_or(true),
    }
}

/// Files that a scene names: meshes and pictures.
fn read_named(path: &Path) -> Result<Vec<u8>> {
    read_file(path, obj::FILE_LIMIT_BYTES)
}

fn utf8<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a str> {
    if bytes.len() > FILE_LIMIT_BYTES {
        return Err(Error::input(path, format!("over the limit of {} MiB for a scene file", FILE_LIMIT_BYTES >> 20)));
    }
    std::str::from_utf8(bytes).map_err(|e| {
        Error::input_at(path, 1 + bytes[..e.valid_up_to()].iter().filter(|&&b| b == b'\n').count(), "not UTF-8 text")
    })
}

/// Where the tables of a scene file begin, for messages about what is only known after reading it.
struct TableLines<'a> {
    text: &'a str,
    tables: Tables,
}

#[derive(Default, Deserialize)]
struct Tables {
    #[serde(default, rename = "mesh")]
    meshes: Vec<Spanned<toml::Table>>,
    #[serde(default, rename = "entity")]
    entities: Vec<Spanned<toml::Table>>,
    environment: Option<Spanned<toml::Table>>,
}

impl<'a> TableLines<'a> {
    fn read(text: &'a str) -> Self {
        Self { text, tables: toml::from_str(text).unwrap_or_default() }
    }

    fn line(&self, table: Option<&Spanned<toml::Table>>) -> usize {
        table.map_or(1, |t| data::line_of(self.text, t.span().start))
    }

    fn mesh(&self, index: usize) -> usize {
        self.line(self.tables.meshes.get(index))
    }

    fn entity(&self, index: usize) -> usize {
        self.line(self.tables.entities.get(index))
    }

    fn environment(&self) -> usize {
        self.line(self.tables.environment.as_ref())
    }
}
