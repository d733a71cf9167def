//! Scenes that are put together in code, held to the same rules as scene files.

use super::data::{Camera, Data, EntityData, MeshData, Output, TextureData, check};
use super::{Scene, check_counts, read_named, resolve_all};
use crate::asset::environment::{Environment, EnvironmentData};
use crate::asset::texture::Texture;
use crate::asset::{Generator, Mesh};
use crate::error::{Error, Result};
use std::sync::Arc;

/// Where a mesh of a [`SceneBuilder`] comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// It is generated.
    Generated(Generator),
    /// It is there already.
    Mesh(Arc<Mesh>),
}

impl From<Generator> for Shape {
    fn from(generator: Generator) -> Self {
        Shape::Generated(generator)
    }
}

impl From<Mesh> for Shape {
    fn from(mesh: Mesh) -> Self {
        Shape::Mesh(Arc::new(mesh))
    }
}

impl From<Arc<Mesh>> for Shape {
    fn from(mesh: Arc<Mesh>) -> Self {
        Shape::Mesh(mesh)
    }
}

/// A scene in the making; [`Scene::builder`] starts one. Lengths are in metres, radiance is linear, in W m^-2 sr^-1.
#[derive(Clone, Debug)]
pub struct SceneBuilder {
    camera: Camera,
    output: Output,
    environment: EnvironmentData,
    textures: Vec<(String, Texture)>,
    meshes: Vec<(String, Shape)>,
    entities: Vec<EntityData>,
}

impl Default for SceneBuilder {
    /// No entity, a black sky, pictures of 960 x 640 pixels, and a camera at (0, 2, 6) that looks towards (0, 0.5, 0).
    fn default() -> Self {
        SceneBuilder {
            camera: Camera::new([0.0, 2.0, 6.0], [0.0, 0.5, 0.0]),
            output: Output::default(),
            environment: EnvironmentData::default(),
            textures: Vec::new(),
            meshes: Vec::new(),
            entities: Vec::new(),
        }
    }
}

impl SceneBuilder {
    /// The viewpoint of pictures.
    pub fn camera(mut self, camera: Camera) -> Self {
        self.camera = camera;
        self
    }

    /// Size, exposure and time of pictures.
    pub fn output(mut self, output: Output) -> Self {
        self.output = output;
        self
    }

    /// The distant light.
    pub fn environment(mut self, environment: EnvironmentData) -> Self {
        self.environment = environment;
        self
    }

    /// Adds a texture under a name of its own, for albedos to refer to.
    pub fn texture(mut self, name: impl Into<String>, texture: Texture) -> Self {
        self.textures.push((name.into(), texture));
        self
    }

    /// Adds a mesh under a name of its own, for entities to refer to.
    pub fn mesh(mut self, name: impl Into<String>, shape: impl Into<Shape>) -> Self {
        self.meshes.push((name.into(), shape.into()));
        self
    }

    /// Adds an entity. [`EntityData::of_mesh`] has all that is not said.
    pub fn entity(mut self, entity: EntityData) -> Self {
        self.entities.push(entity);
        self
    }

    /// Checks everything and builds the meshes.
    ///
    /// # Errors
    /// [`Error::Input`] in one line that names the mesh, the entity or the table: a number out of the range that
    /// docs/scene.md states for scene files, two meshes of one name, an entity without its mesh, a mesh that its
    /// generator refuses, or more of either than a scene may have.
    pub fn build(self) -> Result<Scene> {
        let SceneBuilder { camera, output, environment, textures: painted, meshes: shapes, entities } = self;
        check_counts(shapes.len(), entities.len()).map_err(Error::Input)?;
        camera.check()?;
        check("output", &output)?;
        let (mut meshes, mut named): (Vec<Arc<Mesh>>, Vec<MeshData>) = Default::default();
        for (name, shape) in shapes {
            if named.iter().any(|mesh| mesh.name == name) {
                return Err(Error::Input(format!("there are two meshes {name:?}")));
            }
            let (mut mesh, generator) = match shape {
                Shape::Generated(generator) => {
                    let mesh = generator.build().map_err(|error| error.context(format!("mesh {name:?}")))?;
                    (Arc::new(mesh), Some(generator))
                }
                Shape::Mesh(mesh) => (mesh, None),
            };
            Arc::make_mut(&mut mesh).name.clone_from(&name);
            meshes.push(mesh);
            named.push(MeshData::new(name, generator));
        }
        let mut textures: Vec<TextureData> = Vec::with_capacity(painted.len());
        for (name, texture) in &painted {
            let data = TextureData::of(name.clone(), texture);
            let fail = |what| Error::Input(format!("texture {:?}: {what}", data.name));
            data.check(&textures).map_err(fail)?;
            textures.push(data);
        }
        let painted: Vec<Arc<Texture>> = painted.into_iter().map(|(_, texture)| Arc::new(texture)).collect();
        let data = Data { camera, output, environment, textures, meshes: named, entities };
        let what = |index: usize| match &data.entities[index].name {
            Some(name) => format!("entity {name:?}"),
            None => format!("entity {index}"),
        };
        data.entities.iter().enumerate().try_for_each(|(index, entity)| check(what(index), entity))?;
        let fail = |index, error: String| Error::Input(format!("{}: {error}", what(index)));
        let resolved = resolve_all(&data, &meshes, &painted, fail)?;
        let light = Environment::new(&data.environment, &read_named)?;
        Ok(Scene::assemble(data, meshes, painted, resolved, light))
    }
}
