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
//! | instances (`EXT_mesh_gpu_instancing`) | an entity each |
//! | more than 2 048 primitives, or 1 023 meshes | small ones at rest are joined with neighbours of their material |
//! | convex solids that are loose, walls of rooms, lamps that stand apart | entities of their own |
//! | skins and morph targets | their shape at one time ([`Options::time_s`]) |
//! | meshes compressed by Draco and meshoptimizer; KTX2 and WebP | as if they were not |
//! | base colour factor | albedo |
//! | base colour texture, colours of vertices, alpha mask | texture; tints of the mesh's vertices |
//! | double-sided surfaces that alpha cuts out, or that something in the scene sees from behind | backs of their own; all others are lit from their fronts |
//! | alpha blending with the mean of vertices, transmission | opacity, of transmission less the luminance of what passes: glass is thin and grey |
//! | roughness, metal, index of refraction, specular factor | gloss |
//! | textures of roughness and metal, of normals | maps |
//! | emissive factor and strength | emission |
//! | emissive texture | of flat shapes the mean and a map, of others colours of the mesh's vertices and a map |
//! | point and spot lights | glowing balls; those of spots shine within a cone |
//! | the first directional light | the sun of the distant light |
//! | no light | daylight; a dim uniform sky beside lamps and suns |
//! | the first perspective camera, or that of a name | the camera; without one, a camera that sees everything |

mod accessor;
mod animation;
mod backs;
mod camera;
mod compressed;
mod document;
mod join;
mod lamp;
mod notes;
pub(super) mod pieces;
mod pose;
mod shape;
mod surface;
mod texture;
mod tree;

use std::cell::OnceCell;
use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat3, DQuat, Vec3};

use crate::asset::Mesh;
use crate::asset::environment::{EnvironmentData, RADIANCE_LIMIT};
use crate::asset::mesh::Attributes;
use crate::asset::texture::{Texels, Texture};
use crate::error::{Error, Result};
use crate::scene::data::{Albedo, Data, EntityData, MeshData, Output, PoseData, TextureData};
use crate::scene::motion::RotationData;
use crate::scene::values::{POSITION_LIMIT_M, SCALE_LIMIT};
use crate::scene::{ENTITY_LIMIT, MESH_LIMIT, Maps, Surroundings, check_counts, framing};
use animation::Tracks;
use backs::{Onlookers, Owner, Sides};
use document::Document;
#[cfg(feature = "cli")]
pub(super) use document::{FILE_LIMIT_BYTES, split};
use join::{Candidate, Joined};
use lamp::Lamps;
pub use notes::Notes;
use pose::Pose;
use shape::Shape;
use surface::{Map, Surface};
use texture::Textures;
use tree::{SplitTransform, Stand};

/// Radiance of the sky that is added to lights, as a share of what they make a white surface in the middle shine.
const FILL_SHARE: f64 = 0.1;
/// What is said of poses.
const POSES: &str = "movements of skins and morph targets (they stand in one pose)";
/// Most entities that primitives of several pieces may become, in all; beyond that every primitive stays whole.
const PIECES_LIMIT: u32 = 512;
/// Most parts of a file of which each is an entity; of more, neighbours at rest are joined. A frame of 4 000 boxes takes
/// 6.3 s alone and 0.6 s joined, with 1.1 times the error.
const PARTS_LIMIT: usize = ENTITY_LIMIT / 2;
/// Most different meshes of theirs. Lamps need one.
const MESHES_LIMIT: usize = MESH_LIMIT - 1;
/// About how many meshes those that are joined become.
const JOINED_MESHES: usize = 192;
/// Most triangles of each.
const JOINED_TRIANGLES: usize = 1 << 16;
/// Most triangles of a primitive that is joined with others.
const SMALL_TRIANGLES: usize = 4096;

/// A file as a scene.
pub struct Import {
    /// The scene; it names the file's meshes and images by the file's name without its folder.
    pub data: Data,
    /// Meshes in the order of the data.
    pub meshes: Vec<Arc<Mesh>>,
    /// Textures in the order of the data.
    pub textures: Vec<Arc<Texture>>,
    /// Whether the file has no camera, so that the scene's was added.
    pub camera_added: bool,
    /// What a reader has to know.
    pub notes: Notes,
}

/// Whether a path names a glTF file, by its ending.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
}

/// What is taken of a file.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Time of the pose of skins and morph targets, seconds.
    pub time_s: f64,
    /// The name of the camera, or of the node that holds it; the default is the first with perspective.
    pub camera: Option<String>,
}

/// Reads a scene from a `.glb` or `.gltf` file and the buffers and textures beside it.
///
/// # Errors
/// [`Error::Input`] in one line, which names the file and a place of its JSON.
pub fn load(path: &Path, options: &Options) -> Result<Import> {
    let import = Builder::new(Document::load(path)?, path, options).build()?;
    let data = &import.data;
    check_counts(data.meshes.len(), data.entities.len()).map_err(|what| Error::input(path, what))?;
    Ok(import)
}

/// All triangles of a file's scene as one mesh, as it stands at rest.
pub fn load_mesh(path: &Path) -> Result<(Mesh, Notes)> {
    let document = Document::load(path)?;
    let mut notes = Notes::default();
    notes.leave_out_many("animations (the mesh is as it stands at rest)", document.root.animations.len());
    let tracks = vec![None; document.root.nodes.len()];
    let stage = Stage { stands: tree::stands(&document, &tracks, &mut notes)?, tracks };
    let mut joined = Joined::default();
    for Placed { stand, part: Part { mesh, at, pose, .. }, .. } in stage.parts(&document, 0.0) {
        let pose = pose.map(|_| Pose::at(&document, &stage, stand.node, 0.0)).transpose()?;
        let Some(shape) = Shape::read(&document, mesh, at, pose.as_ref(), &mut notes)? else { continue };
        joined.add(&document, &shape, stand.rest, &Attributes::default())?;
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let mesh = joined.mesh(&name).map_err(|error| error.context(path.display()))?;
    Ok((mesh, notes))
}

struct Primitive {
    shape: Shape,
    surface: Surface,
    material: Option<usize>,
    name: String,
    pieces: OnceCell<Vec<u32>>,
}

impl Primitive {
    /// The mesh of all pieces or one under a bend.
    fn mesh(&self, document: &Document, piece: Option<u32>, bend: DMat3, name: &str) -> Result<Mesh> {
        let keeps = |triangle: usize| piece.is_none_or(|piece| self.pieces()[triangle] == piece);
        self.shape.mesh(document, name, bend, self.surface.attributes.clone(), keeps)
    }

    /// The number of the piece that each triangle belongs to. Surfaces that let light through stay whole, and so do the
    /// many cards of a plant, and what glows in a pattern.
    fn pieces(&self) -> &[u32] {
        self.pieces.get_or_init(|| {
            let Shape { positions, triangles, .. } = &self.shape;
            match &self.surface {
                surface if surface.is_solid() => pieces::solids(positions, triangles),
                surface if surface.is_lamp() => pieces::lamps(positions, triangles),
                _ => vec![0; triangles.len()],
            }
        })
    }
}

/// A primitive of a mesh, in a pose if it is given, or one piece of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub mesh: usize,
    pub at: usize,
    pub pose: Option<PoseData>,
    pub piece: Option<u32>,
}

impl Part {
    /// What tells its primitive from others.
    fn key(&self) -> PartKey {
        (self.mesh, self.at, self.pose.map(|pose| (pose.node, pose.time_s.to_bits())))
    }
}

type PartKey = (usize, usize, Option<(usize, u64)>);

struct Placed {
    /// Number of the node or instance among all of the file's scene.
    place: usize,
    stand: Stand,
    part: Part,
}

/// What tells meshes apart: primitive, piece and bend, the bend as bits.
type MeshKey = (PartKey, Option<u32>, [u64; 9]);

fn mesh_key(part: Part, bend: DMat3) -> MeshKey {
    (part.key(), part.piece, bend.to_cols_array().map(|x| (x + 0.0).to_bits()))
}

/// Where nodes stand and how they move.
struct Stage {
    stands: Vec<Stand>,
    tracks: Vec<Option<Tracks>>,
}

impl Stage {
    /// All primitives, those of meshes with a pose in that of `time_s`.
    fn parts(&self, document: &Document, time_s: f64) -> impl Iterator<Item = Placed> {
        let of_stand = move |(place, stand): (usize, &Stand)| {
            let node = &document.root.nodes[stand.node];
            let mesh = node.mesh?.value();
            let pose = pose::is_posed(document, self, stand.node).then_some(PoseData { node: stand.node, time_s });
            // A skin's vertices are in the world.
            let in_world = node.skin.map(|_| Stand { node: stand.node, ..Stand::default() });
            let stand = in_world.unwrap_or_else(|| stand.clone());
            let part = move |at| Part { mesh, at, pose, piece: None };
            let count = document.root.meshes[mesh].primitives.len();
            Some((0..count).map(move |at| Placed { place, stand: stand.clone(), part: part(at) }))
        };
        self.stands.iter().enumerate().filter_map(of_stand).flatten()
    }
}

/// Primitives and images of a file, each read once.
pub(super) struct Reader {
    document: Rc<Document>,
    stage: Option<Rc<Stage>>,
    textures: Textures,
    primitives: HashMap<PartKey, Option<Rc<Primitive>>>,
    /// What sees the backs of surfaces that have no pose, and of those with the pose of a time; `None` for a scene that
    /// is too large.
    onlookers: HashMap<Option<u64>, Option<Rc<Onlookers>>>,
    /// What they have seen of parts, solids and others.
    sides: HashMap<(PartKey, Option<u32>, bool), Sides>,
    triangle_count: usize,
    notes: Notes,
}

impl Reader {
    fn new(document: Document) -> Self {
        let document = Rc::new(document);
        Reader {
            textures: Textures::new(&document),
            document,
            stage: None,
            primitives: HashMap::new(),
            onlookers: HashMap::new(),
            sides: HashMap::new(),
            triangle_count: 0,
            notes: Notes::default(),
        }
    }

    /// Where nodes stand, found once.
    fn stage(&mut self) -> Result<Rc<Stage>> {
        if let Some(stage) = &self.stage {
            return Ok(stage.clone());
        }
        let tracks = animation::tracks(&self.document, &mut self.notes)?;
        let stands = tree::stands(&self.document, &tracks, &mut self.notes)?;
        Ok(self.stage.insert(Rc::new(Stage { stands, tracks })).clone())
    }

    pub fn texels(&mut self, image: usize) -> Result<Arc<Texels>> {
        let fail = |what: &str| self.document.fail(format!("images[{image}]"), what);
        if image >= self.document.root.images.len() {
            return Err(fail("there is no such image"));
        }
        self.textures.texels(image)?.ok_or_else(|| fail("its format is not read"))
    }

    /// The mesh of a part under a bend.
    pub fn part(&mut self, part: Part, bend: DMat3, name: &str) -> Result<Mesh> {
        let Part { mesh, at, .. } = part;
        let fail = |document: &Document, what| document.fail(format!("meshes[{mesh}].primitives[{at}]"), what);
        let count = self.document.root.meshes.get(mesh).map_or(0, |mesh| mesh.primitives.len());
        if at >= count {
            return Err(fail(&self.document, "there is no such primitive"));
        }
        let primitive = self.primitive(part)?.ok_or_else(|| fail(&self.document, "it has no triangles"))?;
        let mesh = primitive.mesh(&self.document, part.piece, bend, name)?;
        self.counted(&[part], &primitive, mesh)
    }

    /// The mesh of primitives at rest, each given by its place, a node or an instance of it, and its number.
    pub fn joined(&mut self, members: &[[usize; 2]], name: &str) -> Result<Mesh> {
        let document = self.document.clone();
        let stage = self.stage()?;
        let mut joined = Joined::default();
        let mut first: Option<Rc<Primitive>> = None;
        let mut parts = Vec::new();
        for &[place, at] in members {
            let fail = |what| document.fail(format!("place {place}, primitive {at}"), what);
            let stand = stage.stands.get(place).ok_or_else(|| fail("there is no such place"))?;
            let mesh = document.root.nodes[stand.node].mesh.map(|mesh| mesh.value());
            let has = |mesh: &usize| at < document.root.meshes[*mesh].primitives.len();
            let mesh = mesh.filter(has).ok_or_else(|| fail("there is no such primitive"))?;
            let part = Part { mesh, at, pose: None, piece: None };
            let primitive = self.primitive(part)?.ok_or_else(|| fail("it has no triangles"))?;
            let attributes = &primitive.surface.attributes;
            if first.as_ref().is_some_and(|first| first.surface.attributes.kinds() != attributes.kinds()) {
                return Err(fail("its vertices have other attributes than those of the others"));
            }
            joined.add(&document, &primitive.shape, stand.rest, attributes)?;
            first.get_or_insert(primitive);
            parts.push(part);
        }
        let first = first.ok_or_else(|| document.fail("meshes", "a joined mesh has no primitives"))?;
        let mesh = joined.mesh(name).map_err(|error| document.fail(&first.shape.place, error))?;
        self.counted(&parts, &first, mesh)
    }

    /// Counts the triangles of a mesh that the scene keeps, and gives it the sides that are seen of the parts it is made
    /// of, which look as `primitive` does.
    fn counted(&mut self, parts: &[Part], primitive: &Primitive, mesh: Mesh) -> Result<Mesh> {
        self.triangle_count += mesh.triangles.len();
        join::check_triangles(&self.document, &primitive.shape, self.triangle_count)?;
        let surface = &primitive.surface;
        if surface.has_backs {
            return Ok(if mesh.is_closed() { mesh } else { mesh.with_backs() });
        }
        if !surface.is_double_sided || !surface.is_solid() {
            return Ok(mesh);
        }
        let sides: Vec<Sides> = parts.iter().map(|part| self.sides(*part, mesh.is_solid())).collect::<Result<_>>()?;
        if sides.iter().all(|sides| *sides == Sides::Front) {
            Ok(mesh)
        } else if sides.iter().all(|sides| *sides == Sides::Back) {
            mesh.turned_over()
        } else {
            Ok(mesh.with_backs())
        }
    }

    /// The sides of a part that are seen.
    fn sides(&mut self, part: Part, is_solid: bool) -> Result<Sides> {
        let key = (part.key(), part.piece, is_solid);
        if let Some(known) = self.sides.get(&key) {
            return Ok(*known);
        }
        let onlookers = self.onlookers(part.pose.map(|pose| pose.time_s))?;
        let sides = onlookers.map_or(Sides::Front, |all| all.sides([part.mesh, part.at], part.piece, is_solid));
        self.sides.insert(key, sides);
        Ok(sides)
    }

    /// What sees the backs of surfaces, among them the ones that have a pose at `time_s`; found once. `None` for a scene
    /// that is too large.
    fn onlookers(&mut self, time_s: Option<f64>) -> Result<Option<Rc<Onlookers>>> {
        let key = time_s.map(f64::to_bits);
        if let Some(known) = self.onlookers.get(&key) {
            return Ok(known.clone());
        }
        let document = self.document.clone();
        let stage = self.stage()?;
        let mut surfaces = Vec::new();
        let parts = stage.parts(&document, time_s.unwrap_or_default());
        for Placed { stand, part, .. } in parts.filter(|of| time_s.is_some() || of.part.pose.is_none()) {
            // A primitive that cannot be read is refused where it is wanted.
            let Ok(Some(primitive)) = self.primitive(part) else { continue };
            if primitive.surface.opacity < 1.0 || primitive.surface.has_alpha() {
                continue;
            }
            if surfaces.len() + primitive.shape.triangles.len() > backs::TRIANGLES_LIMIT {
                return Ok(self.onlookers.entry(key).or_insert(None).clone());
            }
            let corners = primitive.shape.corners(stand.rest);
            let owners =
                primitive.pieces().iter().map(|piece| Owner { primitive: [part.mesh, part.at], piece: *piece });
            // Others are refused as well.
            let is_in_range = |corner: &Vec3| corner.abs().cmple(Vec3::splat(POSITION_LIMIT_M)).all();
            surfaces.extend(owners.zip(corners).filter(|(_, corners)| corners.iter().all(is_in_range)));
        }
        let is_camera = |stand: &&Stand| document.root.nodes[stand.node].camera.is_some();
        let cameras: Vec<Vec3> =
            stage.stands.iter().filter(is_camera).map(|stand| stand.rest.translation.as_vec3()).collect();
        let onlookers = (!surfaces.is_empty()).then(|| Rc::new(Onlookers::new(&surfaces, &cameras)));
        Ok(self.onlookers.entry(key).or_insert(onlookers).clone())
    }

    /// The primitive of a part, if it has triangles; each is read once.
    fn primitive(&mut self, part: Part) -> Result<Option<Rc<Primitive>>> {
        if let Some(known) = self.primitives.get(&part.key()) {
            return Ok(known.clone());
        }
        let Part { mesh, at, pose, .. } = part;
        let pose = pose.map(|pose| self.pose(mesh, pose)).transpose()?;
        let document = self.document.clone();
        let json = &document.root.meshes[mesh];
        let shape = Shape::read(&document, mesh, at, pose.as_ref(), &mut self.notes)?;
        let primitive = shape.map(|shape| {
            let material = json.primitives[at].material.map(|material| material.value());
            let surface = Surface::new(&document, material, &shape, &mut self.textures, &mut self.notes)?;
            let own = json.name.clone().unwrap_or_else(|| format!("mesh {mesh}"));
            let name = if json.primitives.len() > 1 { format!("{own} {at}") } else { own };
            Ok(Rc::new(Primitive { shape, surface, material, name, pieces: OnceCell::new() }))
        });
        let primitive = primitive.transpose()?;
        self.primitives.insert(part.key(), primitive.clone());
        Ok(primitive)
    }

    fn pose(&mut self, mesh: usize, PoseData { node, time_s }: PoseData) -> Result<Pose> {
        let stage = self.stage()?;
        let holds = self.document.root.nodes.get(node).and_then(|node| node.mesh).map(|mesh| mesh.value());
        if holds != Some(mesh) {
            return Err(self.document.fail(format!("nodes[{node}]"), format!("it does not hold mesh {mesh}")));
        }
        Pose::at(&self.document, &stage, node, time_s)
    }
}

/// The glTF files of which a scene file takes parts, each opened once.
pub(super) struct Readers<'f> {
    folder: &'f Path,
    readers: HashMap<PathBuf, Reader>,
}

impl<'f> Readers<'f> {
    /// For a scene file in `folder`.
    pub fn new(folder: &'f Path) -> Self {
        Readers { folder, readers: HashMap::new() }
    }

    pub fn get(&mut self, file: &Path) -> Result<&mut Reader> {
        match self.readers.entry(file.to_owned()) {
            Entry::Occupied(known) => Ok(known.into_mut()),
            Entry::Vacant(place) => Ok(place.insert(Reader::new(Document::load(&self.folder.join(file))?))),
        }
    }
}

/// What is known of a scene while it is made.
struct Builder {
    reader: Reader,
    options: Options,
    made: HashMap<MeshKey, Made>,
    meshes: Vec<(MeshData, Arc<Mesh>)>,
    /// Names of textures by material and colour.
    painted: HashMap<(Option<usize>, [u32; 3]), String>,
    /// Names of the textures that maps became.
    mapped: HashMap<Map, String>,
    textures: Vec<(TextureData, Arc<Texture>)>,
    names: BTreeSet<String>,
    bent_count: usize,
    /// The file's name, by which a scene file beside it refers to it.
    file: PathBuf,
}

/// The name of a mesh that was made, and the rotation that its entity has besides.
#[derive(Clone)]
struct Made {
    name: String,
    turn: DQuat,
}

impl Builder {
    fn new(document: Document, path: &Path, options: &Options) -> Self {
        Builder {
            reader: Reader::new(document),
            options: options.clone(),
            made: HashMap::new(),
            meshes: Vec::new(),
            painted: HashMap::new(),
            mapped: HashMap::new(),
            textures: Vec::new(),
            names: BTreeSet::new(),
            bent_count: 0,
            file: path.file_name().map_or_else(|| path.to_owned(), PathBuf::from),
        }
    }

    fn build(mut self) -> Result<Import> {
        let document = self.reader.document.clone();
        let stage = self.reader.stage()?;
        let time_s = self.options.time_s;
        let mut posed = 0;
        for stand in stage.stands.iter().filter(|stand| pose::is_posed(&document, &stage, stand.node)) {
            posed += 1;
            let skin = document.root.nodes[stand.node].skin.iter();
            let joints = skin.flat_map(|skin| &document.root.skins[skin.value()].joints);
            let follows = |node: usize| stage.stands.iter().any(|s| s.node == node && !s.motion.is_empty());
            let moves = joints.map(|joint| joint.value()).any(follows);
            if moves || stage.tracks[stand.node].as_ref().is_some_and(|tracks| !tracks.weights.is_empty()) {
                self.reader.notes.leave_out(POSES);
            }
        }
        let entities = self.entities(stage.parts(&document, time_s).collect())?;
        if posed > 0 {
            self.reader.notes.say(format!("skins and morph targets ({posed}) stand in their pose at {time_s} s"));
        }
        self.finish(&stage.stands, entities)
    }

    /// The entities of parts and where they stand, their pieces as entities of their own.
    fn entities(&mut self, mut parts: Vec<Placed>) -> Result<Vec<EntityData>> {
        let bend = |stand: &Stand| SplitTransform::new(stand.fixed.matrix3).map(|split| split.baked());
        let key = |placed: &Placed| Some(mesh_key(placed.part, bend(&placed.stand)?));
        let meshes: HashSet<MeshKey> = parts.iter().filter_map(key).collect();
        let mut entities = Vec::new();
        if parts.len() > PARTS_LIMIT || meshes.len() > MESHES_LIMIT {
            entities = self.joined(&mut parts)?;
        }
        let counts: Vec<u32> = parts.iter().map(|part| self.piece_count(part)).collect::<Result<_>>()?;
        let mut left = PIECES_LIMIT.min((MESHES_LIMIT - meshes.len().min(MESHES_LIMIT)) as u32);
        for (placed, count) in parts.iter().zip(counts) {
            if count == 1 || count > left {
                entities.extend(self.entity(&placed.stand, placed.part)?);
            } else {
                left -= count;
                for piece in 0..count {
                    entities.extend(self.entity(&placed.stand, Part { piece: Some(piece), ..placed.part })?);
                }
            }
            if entities.len() > ENTITY_LIMIT {
                let what = format!("over the limit of {ENTITY_LIMIT} entities");
                return Err(self.reader.document.fail("nodes", what));
            }
        }
        Ok(entities)
    }

    /// Takes small parts at rest and makes entities of neighbours of one material.
    fn joined(&mut self, parts: &mut Vec<Placed>) -> Result<Vec<EntityData>> {
        let candidates = self.candidates(parts)?;
        let groups = join::neighbours(candidates, JOINED_MESHES, JOINED_TRIANGLES);
        let mut entities = Vec::with_capacity(groups.len());
        for group in &groups {
            let first = &parts[group[0]];
            let Some(primitive) = self.reader.primitive(first.part)? else { continue };
            let members: Vec<[usize; 2]> =
                group.iter().map(|part| [parts[*part].place, parts[*part].part.at]).collect();
            let name = free_name(&format!("{} and others", primitive.name), |name| !self.names.contains(name));
            let mesh = self.reader.joined(&members, &name)?;
            self.names.insert(name.clone());
            let data = MeshData { file: Some(self.file.clone()), joined: Some(members), ..MeshData::new(&name, None) };
            self.meshes.push((data, Arc::new(mesh)));
            entities.push(EntityData { name: Some(name.clone()), ..self.looks(&primitive, &name) });
        }
        let taken: HashSet<usize> = groups.iter().flatten().copied().collect();
        let mut numbers = 0..;
        parts.retain(|_| !numbers.next().is_some_and(|number| taken.contains(&number)));
        let members = taken.len();
        let what = format!("primitives at rest ({members}) are joined with neighbours of their material");
        self.reader.notes.say(format!("{what}, to {} meshes", groups.len()));
        Ok(entities)
    }

    /// The parts that may be joined. Only those of one material and of equal attributes are.
    fn candidates(&mut self, parts: &[Placed]) -> Result<Vec<Candidate<(Option<usize>, bool, [bool; 3])>>> {
        let mut candidates = Vec::new();
        for (number, placed) in parts.iter().enumerate() {
            let Some(primitive) = self.reader.primitive(placed.part)? else { continue };
            let Primitive { shape, surface, .. } = &*primitive;
            let stand = &placed.stand;
            let rests = stand.motion.is_empty() && placed.part.pose.is_none();
            let is_small = shape.triangles.len() <= SMALL_TRIANGLES;
            let is_flat = SplitTransform::new(stand.rest.matrix3).is_none();
            if rests && surface.is_solid() && is_small && !is_flat {
                let (centre, radius_m) = shape.sphere(stand.rest);
                candidates.push(Candidate {
                    part: number,
                    kind: (primitive.material, surface.paint.is_some(), surface.attributes.kinds()),
                    centre,
                    radius_m,
                    triangle_count: shape.triangles.len(),
                });
            }
        }
        Ok(candidates)
    }

    /// How many pieces a part is cut into. Of what moves the field of each solid that is not convex would take a second.
    fn piece_count(&mut self, placed: &Placed) -> Result<u32> {
        let Some(primitive) = self.reader.primitive(placed.part)? else { return Ok(1) };
        let Primitive { shape, surface, .. } = &*primitive;
        let any_concave = || pieces::any_concave(&shape.positions, &shape.triangles, primitive.pieces());
        let stays_whole = !placed.stand.motion.is_empty() && surface.is_solid() && any_concave();
        Ok(if stays_whole { 1 } else { primitive.pieces().iter().max().map_or(1, |last| last + 1) })
    }

    /// The entity of a part, if it has triangles.
    fn entity(&mut self, stand: &Stand, part: Part) -> Result<Option<EntityData>> {
        let Some(primitive) = self.reader.primitive(part)? else { return Ok(None) };
        let Some(parts) = SplitTransform::new(stand.fixed.matrix3) else {
            self.reader.notes.leave_out("shapes that a scale of 0 makes flat");
            return Ok(None);
        };
        let document = self.reader.document.clone();
        let place = format!("nodes[{}]", stand.node);
        let scale = parts.uniform_scale().map(|scale| scale as f32);
        if scale.is_some_and(|scale| !(1.0 / SCALE_LIMIT..=SCALE_LIMIT).contains(&scale)) {
            return Err(document.fail(place, "its scale is not within 1e-7 to 1e7"));
        }
        if stand.fixed.translation.abs().max_element() > f64::from(POSITION_LIMIT_M) {
            return Err(document.fail(place, "it stands beyond the limit of 1e7 m"));
        }
        let made = self.mesh(part, &primitive, parts.baked())?;
        let mut name = document.root.nodes[stand.node].name.clone().unwrap_or_else(|| format!("node {}", stand.node));
        if document.root.meshes[part.mesh].primitives.len() > 1 {
            name = format!("{name} {}", part.at);
        }
        if let Some(piece) = part.piece {
            name = format!("{name}, piece {piece}");
        }
        Ok(Some(EntityData {
            name: Some(name),
            position: stand.fixed.translation.as_vec3(),
            rotation: RotationData::Quaternion((parts.rotation * made.turn).as_quat().to_array()),
            scale: scale.unwrap_or(1.0),
            motion: stand.motion.clone(),
            ..self.looks(&primitive, &made.name)
        }))
    }

    /// An entity of a mesh that looks as a primitive does.
    fn looks(&mut self, primitive: &Primitive, mesh: &str) -> EntityData {
        let Surface { emission, gloss, maps, normal_scale, opacity, .. } = primitive.surface;
        let albedo = self.albedo(primitive);
        let [gloss_map, normal_map, glow_map] = maps.map(|map| map.map(|map| self.map(map)));
        let has_pattern = primitive.surface.attributes.colors.is_some() || maps[2].is_some();
        EntityData {
            albedo,
            gloss,
            maps: Maps {
                gloss: gloss_map,
                normal_scale: normal_map.as_ref().and(normal_scale),
                normal: normal_map,
                glow: glow_map,
            },
            opacity,
            emission,
            // What glows in places casts a shadow, and lights others where it is brighter than white on a screen.
            emits: (has_pattern && emission.max_element() <= 1.0).then_some(false),
            occludes: has_pattern.then_some(true),
            ..EntityData::of_mesh(mesh)
        }
    }

    /// The albedo of a primitive; a paint becomes one of the scene's textures.
    fn albedo(&mut self, primitive: &Primitive) -> Albedo {
        let Primitive { surface, material, .. } = primitive;
        let Some(paint) = &surface.paint else { return Albedo::Color(surface.albedo) };
        let key = (*material, surface.albedo.to_array().map(f32::to_bits));
        let name = self.painted.get(&key).cloned().unwrap_or_else(|| {
            let own = material.and_then(|index| self.reader.document.root.materials[index].name.clone());
            let own = own.unwrap_or_else(|| material.map_or("paint".into(), |index| format!("material {index}")));
            self.add_texture(&own, paint.image, paint.texture.clone())
        });
        self.painted.insert(key, name.clone());
        Albedo::Texture(name)
    }

    /// The name of the scene's texture that a map becomes.
    fn map(&mut self, map: Map) -> String {
        let name = self.mapped.get(&map).cloned().unwrap_or_else(|| {
            let texels = self.reader.texels(map.image).ok();
            let texture = Texture { texels, wrap: map.wrap, factor: Vec3::ONE, alpha_cutoff: None, alpha_blend: false };
            self.add_texture(&format!("image {}", map.image), Some(map.image), texture)
        });
        self.mapped.insert(map, name.clone());
        name
    }

    /// Adds a texture of an image of the file, if there is one, and returns its name.
    fn add_texture(&mut self, wanted: &str, image: Option<usize>, texture: Texture) -> String {
        let name = free_name(wanted, |name| self.textures.iter().all(|(data, _)| data.name != *name));
        let file = image.map(|_| self.file.clone());
        let data = TextureData { file, image, ..TextureData::of(name.clone(), &texture) };
        self.textures.push((data, Arc::new(texture)));
        name
    }

    /// The mesh of a part under a bend. A rectangle that glows in one colour is turned to where lamps lie.
    fn mesh(&mut self, part: Part, primitive: &Primitive, mut bend: DMat3) -> Result<Made> {
        let key = mesh_key(part, bend);
        if let Some(made) = self.made.get(&key) {
            return Ok(made.clone());
        }
        let document = self.reader.document.clone();
        if self.meshes.len() >= MESH_LIMIT {
            let what = format!("over the limit of {MESH_LIMIT} meshes, scaled copies included");
            return Err(document.fail("meshes", what));
        }
        let is_bent = !((bend.transpose() * bend).abs_diff_eq(DMat3::IDENTITY, 1e-9) && bend.determinant() > 0.0);
        self.bent_count += usize::from(is_bent);
        // Meshes of lamps have names of their own.
        let own = primitive.name.strip_prefix(lamp::BALL).map(|rest| format!("a {}{rest}", lamp::BALL));
        let own = own.unwrap_or_else(|| primitive.name.clone());
        let wanted = if is_bent { format!("{own} scaled") } else { own };
        let wanted = part.piece.map_or(wanted.clone(), |piece| format!("{wanted}, piece {piece}"));
        let name = free_name(&wanted, |name| !self.names.contains(name));
        let mut mesh = primitive.mesh(&document, part.piece, bend, &name)?;
        let mut turn = DQuat::IDENTITY;
        let Surface { emission, attributes, .. } = &primitive.surface;
        if *emission != Vec3::ZERO
            && attributes.colors.is_none()
            && let Some(rectangle) = mesh.rectangle()
        {
            let frame = rectangle.frame();
            turn = DQuat::from_mat3(&frame);
            bend = frame.transpose() * bend;
            mesh = primitive.mesh(&document, part.piece, bend, &name)?;
        }
        let mesh = self.reader.counted(&[part], primitive, mesh)?;
        self.names.insert(name.clone());
        let data = MeshData {
            file: Some(self.file.clone()),
            part: Some([part.mesh, part.at]),
            piece: part.piece,
            pose: part.pose,
            bend: (bend != DMat3::IDENTITY).then(|| bend.to_cols_array()),
            ..MeshData::new(&name, None)
        };
        self.meshes.push((data, Arc::new(mesh)));
        let made = Made { name, turn };
        self.made.insert(key, made.clone());
        Ok(made)
    }

    /// Adds lamps, the camera, and light where nothing shines.
    fn finish(mut self, stands: &[Stand], mut entities: Vec<EntityData>) -> Result<Import> {
        let document = &*self.reader.document.clone();
        let mut notes = std::mem::take(&mut self.reader.notes);
        if self.bent_count > 0 {
            let copies = self.bent_count;
            notes.say(format!("baked into copies of meshes ({copies}): scales that are not uniform, or mirror"));
        }
        let meshes: HashMap<&str, &Mesh> =
            self.meshes.iter().map(|(data, mesh)| (data.name.as_str(), &**mesh)).collect();
        let things = || entities.iter().filter_map(|entity| Some((*meshes.get(entity.mesh.as_str())?, entity)));
        let bounds = camera::bounds(things());
        let lamps = Lamps::new(document, stands, bounds, &mut notes)?;
        let camera = camera::camera(document, stands, self.options.camera.as_deref(), bounds, &mut notes)?;
        let camera_added = camera.is_none();
        let (camera, output) = camera.unwrap_or_else(|| {
            let things = things().map(|(mesh, entity)| (mesh, entity.at(0.0)));
            let output = Output::default();
            (framing::camera(&framing::points(things), output.aspect()), output)
        });
        // A surface of radiance 1 is white on a screen; only a brighter one is meant as a lamp.
        let glow = things().filter(|(_, entity)| entity.emission.max_element() > 1.0).map(|(mesh, entity)| {
            let (centre, radius_m) = entity.at(0.0).sphere(mesh.bounding_sphere());
            let distance_m = centre.distance(bounds.0).max(0.3 * bounds.1);
            f64::from(entity.emission.max_element()) * (radius_m / distance_m).powi(2).min(1.0)
        });
        let radiance = lamps.radiance + glow.sum::<f64>();
        let environment = if radiance > 0.0 {
            notes.say("the file has lights but no sky: a dim one is added, so that shadows are not black".into());
            let fill = Vec3::splat((FILL_SHARE * radiance) as f32).min(Vec3::splat(RADIANCE_LIMIT));
            EnvironmentData { sun: lamps.sun, uniform: Some(fill), ..EnvironmentData::default() }
        } else {
            notes.say("no light in the file is bright enough to see by: daylight is added".into());
            Surroundings::Daylight.data()
        };
        entities.extend(lamps.entities);
        self.meshes.extend(lamps.ball.map(|(data, mesh)| (data, Arc::new(mesh))));
        let (meshes, built) = self.meshes.into_iter().unzip();
        let (textures, painted) = self.textures.into_iter().unzip();
        let data = Data { camera, output, environment, textures, meshes, entities };
        Ok(Import { data, meshes: built, textures: painted, camera_added, notes })
    }
}

/// A name, or the first with a number that is free.
fn free_name(wanted: &str, is_free: impl Fn(&String) -> bool) -> String {
    let all = std::iter::once(wanted.to_owned()).chain((2..).map(|n| format!("{wanted} {n}")));
    all.into_iter().find(is_free).expect("numbers do not end")
}
