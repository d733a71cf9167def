//! glTF 2.0 and GLB as scenes.
//!
//! Every primitive of a mesh that a node holds is an entity. Lengths are in metres, +y is up and light is linear
//! Rec.709, as in this program, so numbers are taken as they are; candela per square metre become W m^-2 sr^-1. What
//! the program has no form for is left out and listed with counts ([`Notes`]).
//!
//! | glTF | here |
//! |---|---|
//! | translation, rotation, uniform scale | placement |
//! | other scales, mirrors, shears | a copy of the mesh with the scale baked in |
//! | animations of nodes | motion `node`, one for every moving node that carries the entity |
//! | base colour factor, texture, colours of vertices | albedo, a mean over the surface |
//! | emissive factor and strength; texture | emission; colours of the mesh's vertices |
//! | point and spot lights | glowing balls; those of spots shine within a cone |
//! | the first directional light | the sun of the distant light |
//! | no light | daylight; a dim uniform sky beside lamps and suns |
//! | the first perspective camera | the camera; without one, a camera that sees everything |

mod accessor;
mod animation;
mod camera;
mod document;
mod lamp;
mod notes;
mod shape;
mod surface;
mod texture;
mod tree;

use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, Vec3};

use crate::asset::Mesh;
use crate::asset::environment::{EnvironmentData, RADIANCE_LIMIT};
use crate::error::{Error, Result};
use crate::scene::data::{Data, EntityData, MeshData, Output};
use crate::scene::framing;
use crate::scene::motion::RotationData;
use crate::scene::values::{POSITION_LIMIT_M, SCALE_LIMIT};
use crate::scene::{ENTITY_LIMIT, MESH_LIMIT, Surroundings, check_counts};
use document::Document;
#[cfg(feature = "cli")]
pub(crate) use document::FILE_LIMIT_BYTES;
use lamp::Lamps;
pub use notes::Notes;
use shape::Shape;
use surface::Surface;
use texture::Textures;
use tree::{SplitTransform, Stand};

/// Radiance of the sky that is added to lights, as a share of what they make a white surface in the middle shine.
const FILL_SHARE: f64 = 0.1;
/// What is said of skins.
const SKINS: &str = "nodes with a skin (their meshes stand still as they are stored)";
/// Largest number of triangles of all meshes of a scene.
const TRIANGLES_LIMIT: usize = 16_000_000;

/// A file as a scene.
pub struct Import {
    /// The scene. A mesh of the file has neither a file nor a generator.
    pub data: Data,
    /// Meshes in the order of the data.
    pub meshes: Vec<Arc<Mesh>>,
    /// Whether the file has no camera, so that the scene's was added.
    pub camera_added: bool,
    /// What a reader has to know.
    pub notes: Notes,
}

/// Whether a path names a glTF file, by its ending.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
}

/// Reads a scene from a `.glb` or `.gltf` file and the buffers and textures beside it.
pub fn load(path: &Path) -> Result<Import> {
    let document = Document::load(path)?;
    let mut import = Builder::new(&document)?.build()?;
    let meshes = import.data.meshes.len();
    let entities = import.data.entities.len();
    check_counts(meshes, entities).map_err(|what| Error::input(path, what))?;
    import.meshes.shrink_to_fit();
    Ok(import)
}

/// All triangles of a file's scene as one mesh, as it stands at rest.
pub fn load_mesh(path: &Path) -> Result<(Mesh, Notes)> {
    let document = Document::load(path)?;
    let mut notes = Notes::default();
    notes.leave_out_many("animations (the mesh is as it stands at rest)", document.root.animations.len());
    let none = vec![None; document.root.nodes.len()];
    let mut positions = Vec::new();
    let mut normals = Vec::new();
    let mut triangles = Vec::new();
    for stand in tree::stands(&document, &none, &mut notes)? {
        if document.root.nodes[stand.node].skin.is_some() {
            notes.leave_out(SKINS);
        }
        let Some(mesh) = document.root.nodes[stand.node].mesh.map(|mesh| mesh.value()) else { continue };
        for at in 0..document.root.meshes[mesh].primitives.len() {
            let Some(shape) = Shape::read(&document, mesh, at, &mut notes)? else { continue };
            let (more, of_more, faces) = shape.bent(stand.rest.matrix3, stand.rest.translation);
            let first = positions.len() as u32;
            positions.extend(more);
            normals.extend(of_more);
            triangles.extend(faces.iter().map(|t| t.map(|i| i + first)));
            if triangles.len() > TRIANGLES_LIMIT {
                return Err(
                    document.fail(&shape.place, format!("over the limit of {TRIANGLES_LIMIT} triangles in all"))
                );
            }
        }
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let mesh = Mesh::new(name, positions, normals, None, triangles).map_err(|error| error.context(path.display()))?;
    Ok((mesh, notes))
}

/// A primitive that was read.
struct Primitive {
    shape: Shape,
    surface: Surface,
    name: String,
}

/// What is known of a scene while it is made.
struct Builder<'a> {
    document: &'a Document,
    stands: Vec<Stand>,
    textures: Textures<'a>,
    primitives: HashMap<(usize, usize), Option<Primitive>>,
    /// Meshes by primitive and bend, the bend as bits.
    made: HashMap<(usize, usize, [u64; 9]), usize>,
    meshes: Vec<(String, Arc<Mesh>)>,
    names: BTreeSet<String>,
    materials: BTreeSet<usize>,
    triangle_count: usize,
    bent_count: usize,
    notes: Notes,
}

impl<'a> Builder<'a> {
    fn new(document: &'a Document) -> Result<Self> {
        let mut notes = Notes::default();
        let tracks = animation::tracks(document, &mut notes)?;
        let stands = tree::stands(document, &tracks, &mut notes)?;
        Ok(Builder {
            document,
            stands,
            textures: Textures::new(document),
            primitives: HashMap::new(),
            made: HashMap::new(),
            meshes: Vec::new(),
            names: BTreeSet::new(),
            materials: BTreeSet::new(),
            triangle_count: 0,
            bent_count: 0,
            notes,
        })
    }

    fn build(mut self) -> Result<Import> {
        let document = self.document;
        let stands = std::mem::take(&mut self.stands);
        let mut entities = Vec::new();
        for stand in &stands {
            let node = &document.root.nodes[stand.node];
            if node.skin.is_some() {
                self.notes.leave_out(SKINS);
            }
            let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { continue };
            for at in 0..document.root.meshes[mesh].primitives.len() {
                entities.extend(self.entity(stand, mesh, at)?);
            }
            if entities.len() > ENTITY_LIMIT {
                return Err(document.fail("nodes", format!("over the limit of {ENTITY_LIMIT} entities")));
            }
        }
        self.finish(&stands, entities)
    }

    /// The entity of a primitive, if it has triangles.
    fn entity(&mut self, stand: &Stand, mesh: usize, at: usize) -> Result<Option<EntityData>> {
        self.read(mesh, at)?;
        let Some(Some(primitive)) = self.primitives.get(&(mesh, at)) else { return Ok(None) };
        let Some(parts) = SplitTransform::new(stand.fixed.matrix3) else {
            self.notes.leave_out("shapes that a scale of 0 makes flat");
            return Ok(None);
        };
        let place = format!("nodes[{}]", stand.node);
        let albedo = primitive.surface.albedo;
        let emission = primitive.surface.emission;
        let scale = parts.uniform_scale().map(|scale| scale as f32);
        if scale.is_some_and(|scale| !(1.0 / SCALE_LIMIT..=SCALE_LIMIT).contains(&scale)) {
            return Err(self.document.fail(place, "its scale is not within 1e-7 to 1e7"));
        }
        if stand.fixed.translation.abs().max_element() > f64::from(POSITION_LIMIT_M) {
            return Err(self.document.fail(place, "it stands beyond the limit of 1e7 m"));
        }
        let bend = if scale.is_some() { DMat3::IDENTITY } else { parts.bend };
        let made = self.mesh(mesh, at, bend)?;
        let several = self.document.root.meshes[mesh].primitives.len() > 1;
        let own = self.document.root.nodes[stand.node].name.clone().unwrap_or_else(|| format!("node {}", stand.node));
        Ok(Some(EntityData {
            name: Some(if several { format!("{own} {at}") } else { own }),
            position: stand.fixed.translation.as_vec3(),
            rotation: RotationData::Quaternion(parts.rotation.as_quat().to_array()),
            scale: scale.unwrap_or(1.0),
            albedo,
            emission,
            motion: stand.motion.clone(),
            ..EntityData::of_mesh(&self.meshes[made].0)
        }))
    }

    /// Reads a primitive once.
    fn read(&mut self, mesh: usize, at: usize) -> Result<()> {
        if self.primitives.contains_key(&(mesh, at)) {
            return Ok(());
        }
        let json = &self.document.root.meshes[mesh];
        let shape = Shape::read(self.document, mesh, at, &mut self.notes)?;
        let primitive = shape.map(|shape| {
            let material = json.primitives[at].material.map(|material| material.value());
            let notes = &mut self.notes;
            if let Some(material) = material.filter(|material| self.materials.insert(*material)) {
                surface::note(&self.document.root.materials[material], notes);
            }
            let surface = Surface::new(self.document, material, &shape, &mut self.textures, notes)?;
            let own = json.name.clone().unwrap_or_else(|| format!("mesh {mesh}"));
            let name = if json.primitives.len() > 1 { format!("{own} {at}") } else { own };
            Ok(Primitive { shape, surface, name })
        });
        self.primitives.insert((mesh, at), primitive.transpose()?);
        Ok(())
    }

    /// Index of the mesh of a primitive under a bend.
    fn mesh(&mut self, mesh: usize, at: usize, bend: DMat3) -> Result<usize> {
        let key = (mesh, at, bend.to_cols_array().map(|x| (x + 0.0).to_bits()));
        if let Some(made) = self.made.get(&key) {
            return Ok(*made);
        }
        let Some(Some(primitive)) = self.primitives.get(&(mesh, at)) else { unreachable!("the primitive was read") };
        self.triangle_count += primitive.shape.triangle_count();
        if self.triangle_count > TRIANGLES_LIMIT {
            let what = format!("over the limit of {TRIANGLES_LIMIT} triangles in all");
            return Err(self.document.fail(&primitive.shape.place, what));
        }
        if self.meshes.len() >= MESH_LIMIT {
            return Err(self
                .document
                .fail("meshes", format!("over the limit of {MESH_LIMIT} meshes, scaled copies included")));
        }
        let is_bent = bend != DMat3::IDENTITY;
        self.bent_count += usize::from(is_bent);
        // Meshes of lamps have names of their own.
        let own = primitive.name.strip_prefix(lamp::BALL).map(|rest| format!("a {}{rest}", lamp::BALL));
        let own = own.unwrap_or_else(|| primitive.name.clone());
        let wanted = if is_bent { format!("{own} scaled") } else { own };
        let free = |name: &String| !self.names.contains(name);
        let name = std::iter::once(wanted.clone()).chain((2..).map(|n| format!("{wanted} {n}"))).find(free);
        let name = name.unwrap_or(wanted);
        let colors = primitive.surface.colors.clone();
        let made = primitive.shape.mesh(self.document, &name, bend, colors)?;
        self.names.insert(name.clone());
        self.meshes.push((name, Arc::new(made)));
        self.made.insert(key, self.meshes.len() - 1);
        Ok(self.meshes.len() - 1)
    }

    /// Adds lamps, the camera, and light where nothing shines.
    fn finish(mut self, stands: &[Stand], mut entities: Vec<EntityData>) -> Result<Import> {
        let document = self.document;
        if self.bent_count > 0 {
            let copies = self.bent_count;
            self.notes.say(format!("baked into copies of meshes ({copies}): scales that are not uniform, or mirror"));
        }
        let spheres: HashMap<&str, (Vec3, f32)> =
            self.meshes.iter().map(|(name, mesh)| (name.as_str(), mesh.bounding_sphere())).collect();
        let spheres = || entities.iter().filter_map(|entity| Some((*spheres.get(entity.mesh.as_str())?, entity)));
        let bounds = camera::bounds(spheres());
        let lamps = Lamps::new(document, stands, bounds.1, &mut self.notes)?;
        let fittings = lamps.entities(document, &mut self.notes)?;
        let camera = camera::camera(document, stands, bounds, &mut self.notes)?;
        let camera_added = camera.is_none();
        let (camera, output) = camera.unwrap_or_else(|| {
            let meshes: HashMap<&str, &Mesh> = self.meshes.iter().map(|(name, mesh)| (&**name, &**mesh)).collect();
            let things = entities.iter().filter_map(|e| Some((*meshes.get(e.mesh.as_str())?, e.at(0.0))));
            let output = Output::default();
            (framing::camera(&framing::points(things), output.aspect()), output)
        });
        // A surface of radiance 1 is white on a screen; only a brighter one is meant as a lamp.
        let glow = spheres().filter(|(_, entity)| entity.emission.max_element() > 1.0).map(|(sphere, entity)| {
            let (centre, radius_m) = entity.at(0.0).sphere(sphere);
            let distance_m = centre.distance(bounds.0).max(0.3 * bounds.1);
            f64::from(entity.emission.max_element()) * (radius_m / distance_m).powi(2).min(1.0)
        });
        let radiance = lamps.radiance(bounds.0, bounds.1) + glow.sum::<f64>();
        let environment = if radiance > 0.0 {
            self.notes.say("the file has lights but no sky: a dim one is added, so that shadows are not black".into());
            let fill = Vec3::splat((FILL_SHARE * radiance) as f32).min(Vec3::splat(RADIANCE_LIMIT));
            EnvironmentData { sun: lamps.sun.clone(), uniform: Some(fill), ..EnvironmentData::default() }
        } else {
            self.notes.say("no light in the file is bright enough to see by: daylight is added".into());
            Surroundings::Daylight.data()
        };
        entities.extend(fittings.entities);
        let of_file = |(name, _): &(String, _)| MeshData { name: name.clone(), file: None, generator: None };
        let mut meshes: Vec<MeshData> = self.meshes.iter().map(of_file).collect();
        let mut built: Vec<Arc<Mesh>> = self.meshes.into_iter().map(|(_, mesh)| mesh).collect();
        for (data, mesh) in fittings.meshes {
            meshes.push(data);
            built.push(Arc::new(mesh));
        }
        let data = Data { camera, output, environment, meshes, entities };
        Ok(Import { data, meshes: built, camera_added, notes: self.notes })
    }
}
