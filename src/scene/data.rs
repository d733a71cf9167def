//! The tables of a scene file. `docs/scene.md` has a table of all keys with units, ranges and defaults; a test compares
//! it with this file.
//!
//! ```toml
//! [camera]
//! eye = [0, 2, 5]
//! target = [0, 0.5, 0]
//! fov_deg = 40                               # vertical
//! [output]                                   # every key may be left out
//! width = 960
//! exposure_ev = -0.5
//! time_s = 0                                 # time of the first picture
//! [environment]                              # the parts add up, are multiplied by strength and turned about +y
//! strength = 1
//! turn_deg = 30
//! uniform = [0.02, 0.02, 0.03]
//! gradient = { radiance = [0.1, 0.12, 0.16] }                              # brighter towards the zenith
//! key = { radiance = [3, 3, 2], toward = [1, 2, 1], sharpness = 8 }        # a soft directional light
//! sun = { toward = [1, 2, 1], angle_deg = 0.53, radiance = [9e4, 8e4, 7e4] } # a distant disc, whose shadows are sharp
//! sky = { sun_elevation_deg = 40, turbidity = 3, radiance = 0.35 }         # generated daylight; sky = {} takes the defaults
//! image = { file = "studio.hdr", scale = 0.5 }                             # equirectangular HDR, EXR or PNG
//! [[texture]]                                # what varies an albedo over a surface
//! name = "wood"
//! file = "wood.png"
//! [[mesh]]
//! name = "ball"
//! sphere = { radius_m = 0.5, subdivisions = 4 }  # or plane, cuboid, torus, torus_two_colour, disc, rectangle
//! [[entity]]
//! mesh = "ball"
//! position = [0, 0.6, 0]
//! rotation = { axis = [0, 1, 0], angle_deg = 30 }
//! scale = 1
//! albedo = [0.7, 0.4, 0.2]                   # or the name of a texture
//! emission = [40, 36, 30]                    # makes it a light; emits, occludes and receives override the defaults
//! spot = { inner_deg = 20, outer_deg = 35 }  # its light shines along its own +y alone
//! motion = [                                 # applied from first to last; each is a function of time alone
//!     { keyframes = { repeat = true, interpolation = "smooth", keys = [  # Catmull-Rom or "linear"; rotations use slerp
//!         { time_s = 0, position = [0, 0.6, 0] }, { time_s = 2, position = [1, 0.9, 0] },
//!         { time_s = 4, position = [0, 0.6, 0] } ] } },
//!     { orbit = { centre = [0, 0, 0], period_s = 8 } }, { spin = { axis = [0, 1, 0], period_s = 4 } },
//!     { bob = { amplitude_m = 0.1, period_s = 3 } },
//!     { node = { position = [0, 1, 0], rotation_keys = { times_s = [0, 1], period_s = 2, values = [
//!         [0, 0, 0, 1], [0, 1, 0, 0] ] } } },
//! ]                                          # a node carries what stands in it; keys are "step", "linear" or "cubic"
//! ```

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::gloss::{Gloss, Maps};
use super::light::{self, Spot};
use super::motion::{Motion, Placement, PlacementF64, RotationData};
use super::{check_counts, values};
use crate::asset::environment::EnvironmentData;
use crate::asset::texture::{Texture, Wrap};
use crate::asset::{Generator, line_of};
use crate::error::{Error, Result, one_line};

/// Largest width or height of a picture, in pixels.
pub const PICTURE_LIMIT_PX: u32 = 16_384;

/// Holds a picture's width and height to [`PICTURE_LIMIT_PX`].
pub(crate) fn check_picture([width, height]: [u32; 2]) -> std::result::Result<(), String> {
    if [width, height].iter().all(|px| (1..=PICTURE_LIMIT_PX).contains(px)) {
        return Ok(());
    }
    Err(format!("a picture of {width} x {height} pixels: each is 1 to {PICTURE_LIMIT_PX}"))
}

/// A scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// The viewpoint.
    pub camera: Camera,
    /// Size and exposure of pictures.
    #[serde(default)]
    pub output: Output,
    /// Distant light. Without it the sky is black.
    #[serde(default)]
    pub environment: EnvironmentData,
    /// Textures, each with a name that albedos refer to.
    #[serde(default, rename = "texture", skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<TextureData>,
    /// Meshes, each with a name that entities refer to.
    #[serde(default, rename = "mesh")]
    pub meshes: Vec<MeshData>,
    /// Entities: each has a mesh, a placement and a surface.
    #[serde(default, rename = "entity")]
    pub entities: Vec<EntityData>,
}

/// A perspective camera at `eye` that looks towards `target`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, try_from = "CameraWritten")]
pub struct Camera {
    /// Position in metres.
    pub eye: Vec3,
    /// Position in metres; it must differ from the eye.
    pub target: Vec3,
    /// Vertical field of view in degrees, 1 to 170. The default is 40.
    pub fov_deg: f32,
}

impl Camera {
    /// A camera with a vertical field of view of 40 degrees.
    pub fn new(eye: impl Into<Vec3>, target: impl Into<Vec3>) -> Self {
        Camera { eye: eye.into(), target: target.into(), fov_deg: 40.0 }
    }

    /// Refuses a camera that a scene file could not have.
    ///
    /// # Errors
    /// [`Error::Input`] in one line.
    pub fn check(&self) -> Result<()> {
        check("camera", self)
    }

    /// Half the height of the picture at a distance of 1.
    pub(crate) fn half_height(&self) -> f64 {
        (f64::from(self.fov_deg).to_radians() / 2.0).tan()
    }

    /// The direction that points up in the picture: +y, or -z for a camera that looks straight up or down.
    pub fn up(&self) -> Vec3 {
        let ahead = (self.target.as_dvec3() - self.eye.as_dvec3()).normalize();
        if ahead.x.hypot(ahead.z) < 1e-3 { Vec3::NEG_Z } else { Vec3::Y }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraWritten {
    #[serde(deserialize_with = "values::position")]
    eye: Vec3,
    #[serde(deserialize_with = "values::position")]
    target: Vec3,
    fov_deg: Option<f32>,
}

impl TryFrom<CameraWritten> for Camera {
    type Error = String;

    fn try_from(written: CameraWritten) -> std::result::Result<Self, String> {
        let CameraWritten { eye, target, fov_deg } = written;
        let fov_deg = fov_deg.unwrap_or(40.0);
        if eye.distance(target) < 1e-6 {
            return Err("the camera's eye and target are the same".into());
        }
        if !(1.0..=170.0).contains(&fov_deg) {
            return Err(format!("fov_deg {fov_deg} is not within 1 to 170"));
        }
        Ok(Self { eye, target, fov_deg })
    }
}

/// Size, exposure and time of pictures. The command line overrides them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, try_from = "OutputWritten")]
pub struct Output {
    /// Width in pixels, 1 to 16 384. The default is 960.
    pub width: u32,
    /// Height in pixels, 1 to 16 384. The default is 640.
    pub height: u32,
    /// Stops by which radiance is brightened before it is encoded, -32 to 32. Where it is left out, the program finds
    /// it from the light of the first picture, and the library takes 0.
    pub exposure_ev: Option<f32>,
    /// Scene time of the first picture in seconds. The default is 0.
    #[serde(skip_serializing_if = "crate::field::is_default")]
    pub time_s: f64,
}

impl Output {
    /// Radiance that the exposure shows as white.
    pub fn white(&self) -> f32 {
        (-self.exposure_ev()).exp2()
    }

    /// The exposure in stops, 0 where it is left out.
    pub fn exposure_ev(&self) -> f32 {
        self.exposure_ev.unwrap_or(0.0)
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }
}

impl Default for Output {
    fn default() -> Self {
        Self { width: 960, height: 640, exposure_ev: None, time_s: 0.0 }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutputWritten {
    width: Option<u32>,
    height: Option<u32>,
    exposure_ev: Option<f32>,
    #[serde(default, deserialize_with = "values::number")]
    time_s: f64,
}

impl TryFrom<OutputWritten> for Output {
    type Error = String;

    fn try_from(written: OutputWritten) -> std::result::Result<Self, String> {
        let usual = Self::default();
        let width = written.width.unwrap_or(usual.width);
        let height = written.height.unwrap_or(usual.height);
        check_picture([width, height])?;
        if let Some(beyond) = written.exposure_ev.filter(|ev| !(-32.0..=32.0).contains(ev)) {
            return Err(format!("exposure_ev {beyond} is not within -32 to 32"));
        }
        Ok(Self { width, height, exposure_ev: written.exposure_ev, time_s: written.time_s })
    }
}

/// A reflectance that varies over a surface: `factor`, times a picture where the mesh has texture coordinates, times the
/// tints of the mesh's vertices if it has any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureData {
    /// The name that albedos use; it is unique.
    pub name: String,
    /// A picture in PNG, JPEG, WebP or KTX2, relative to the scene file, or a glTF file that has it. The default is white.
    pub file: Option<PathBuf>,
    /// Which of a glTF file's images it is, counted from 0.
    pub image: Option<usize>,
    /// How it goes on beyond its edges along u and v: `"repeat"`, which is the default, `"mirror"` or `"clamp"`.
    #[serde(default, skip_serializing_if = "crate::field::is_default")]
    pub wrap: [Wrap; 2],
    /// Linear, 0 to 1. The default is 1.
    #[serde(default = "white", deserialize_with = "values::albedo")]
    pub factor: Vec3,
    /// Places whose alpha is less are holes, 0 to 1. By default there are none.
    pub alpha_cutoff: Option<f32>,
    /// Whether its alpha is the opacity of a place, in place of a cutoff. By default it is not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub alpha_blend: bool,
}

impl TextureData {
    /// A texture without the file of its picture.
    pub(super) fn of(name: String, texture: &Texture) -> Self {
        TextureData {
            name,
            file: None,
            image: None,
            wrap: texture.wrap,
            factor: texture.factor,
            alpha_cutoff: texture.alpha_cutoff,
            alpha_blend: texture.alpha_blend,
        }
    }

    /// A name that is not taken by textures before, an image of a glTF file alone, and an alpha within 0 to 1.
    pub(super) fn check(&self, before: &[TextureData]) -> std::result::Result<(), String> {
        if before.iter().any(|other| other.name == self.name) {
            return Err("another has that name".into());
        }
        if self.image.is_some() != self.file.as_deref().is_some_and(super::gltf::is_gltf) {
            return Err("`image` says which image of a glTF file it is, and of no other file".into());
        }
        if self.alpha_cutoff.is_some_and(|alpha| !(0.0..=1.0).contains(&alpha)) {
            return Err("alpha_cutoff is not within 0 to 1".into());
        }
        if self.alpha_blend && self.alpha_cutoff.is_some() {
            return Err("it has either an alpha_cutoff or alpha_blend".into());
        }
        Ok(())
    }
}

fn white() -> Vec3 {
    Vec3::ONE
}

/// The linear reflectance of an entity.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Albedo {
    /// It is the same everywhere, 0 to 1.
    Color(Vec3),
    /// The name of a texture.
    Texture(String),
}

impl<T: Into<Vec3>> From<T> for Albedo {
    fn from(color: T) -> Self {
        Albedo::Color(color.into())
    }
}

impl<'de> Deserialize<'de> for Albedo {
    fn deserialize<D: serde::Deserializer<'de>>(source: D) -> std::result::Result<Self, D::Error> {
        struct ColorOrName;
        impl<'de> serde::de::Visitor<'de> for ColorOrName {
            type Value = Albedo;
            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("an albedo: three numbers from 0 to 1, or the name of a texture")
            }
            fn visit_str<E>(self, name: &str) -> std::result::Result<Albedo, E> {
                Ok(Albedo::Texture(name.to_owned()))
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, list: A) -> std::result::Result<Albedo, A::Error> {
                values::albedo(serde::de::value::SeqAccessDeserializer::new(list)).map(Albedo::Color)
            }
        }
        source.deserialize_any(ColorOrName)
    }
}

/// A mesh, read from a file or made by a generator. In a scene that was put together in code it may be neither: then only
/// [`super::Scene::meshes`] has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshData {
    /// The name that entities use; it is unique.
    pub name: String,
    /// A Wavefront OBJ file or a glTF file, relative to the scene file. If there is no such file, a built-in mesh of that
    /// name is taken, such as `assets/meshes/torus.obj`. Of a glTF file all triangles are taken at rest, or one `part`.
    pub file: Option<PathBuf>,
    /// Mesh and primitive of a glTF file, counted from 0.
    pub part: Option<[usize; 2]>,
    /// One of the pieces of the part, or of an OBJ file, counted from 0: loose solids, thin bars together, walls of rooms, and last the
    /// rest; of what glows, lamps that stand apart. The default takes all.
    pub piece: Option<u32>,
    /// Columns of a matrix that scales, mirrors or shears the part. The default leaves it as it is.
    pub bend: Option<[f64; 9]>,
    /// The pose of the part's skin and morph targets. The default leaves it as it is stored.
    pub pose: Option<PoseData>,
    /// Primitives at rest of a glTF file that are one mesh, in the file's world: place and number of each. Places are
    /// the nodes of the file's scene, those that carry before those that are carried, and each instance of a node.
    pub joined: Option<Vec<[usize; 2]>>,
    /// A generator, written as `plane = {...}`, `sphere = {...}` and so on.
    #[serde(flatten, deserialize_with = "generator")]
    pub generator: Option<Generator>,
}

/// The pose of a part of a glTF file. With a skin, its vertices are in the file's world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseData {
    /// Number of the node that holds the mesh.
    pub node: usize,
    /// Time of the file's animations, seconds.
    pub time_s: f64,
}

impl MeshData {
    /// A mesh that a generator makes, or that neither a file nor a generator gives.
    pub fn new(name: impl Into<String>, generator: Option<Generator>) -> Self {
        MeshData { name: name.into(), generator, ..MeshData::default() }
    }

    /// Refuses keys that do not go together.
    pub(super) fn check(&self) -> std::result::Result<(), &'static str> {
        let of_gltf = self.file.as_deref().is_some_and(super::gltf::is_gltf);
        let of_obj = self.file.as_deref().is_some_and(super::single::is_obj);
        let is_of_part = self.piece.is_some() && !of_obj || self.bend.is_some() || self.pose.is_some();
        if self.part.is_some() && !of_gltf || is_of_part && self.part.is_none() {
            return Err(
                "it takes a part of a glTF file alone, a bend and a pose of a part, and a piece of a part or an OBJ file",
            );
        }
        if self.joined.is_some() && (!of_gltf || self.part.is_some()) {
            return Err("it takes either a part of a glTF file or several joined");
        }
        if self.pose.is_some_and(|pose| !pose.time_s.is_finite()) {
            return Err("it has a pose at a time that is not finite");
        }
        if self.bend.is_some_and(|bend| !usable_bend(&bend)) {
            return Err("it has a bend that is not finite, beyond 1e7, or flat");
        }
        Ok(())
    }
}

/// Reads what is left of a mesh's keys as its generator: serde's own flattening would accept unknown keys.
fn generator<'de, D: serde::Deserializer<'de>>(source: D) -> std::result::Result<Option<Generator>, D::Error> {
    use serde::de::Error as _;
    let rest = toml::Table::deserialize(source)?;
    let generator = (!rest.is_empty()).then(|| Generator::deserialize(toml::Value::Table(rest))).transpose();
    generator.map_err(|error| D::Error::custom(error.message()))
}

/// Whether a matrix of finite numbers within [`values::SCALE_LIMIT`] keeps what it bends from being flat.
fn usable_bend(bend: &[f64; 9]) -> bool {
    bend.iter().all(|x| x.abs() <= f64::from(values::SCALE_LIMIT))
        && glam::DMat3::from_cols_array(bend).determinant() != 0.0
}

/// An entity of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EntityData {
    /// A name for messages and tables. The default is `entity N`, counted from 0.
    pub name: Option<String>,
    /// The name of its mesh.
    pub mesh: String,
    /// Position in metres. The default is the origin.
    #[serde(default, deserialize_with = "values::position")]
    pub position: Vec3,
    /// The default is no rotation.
    #[serde(default)]
    pub rotation: RotationData,
    /// A uniform factor, 1e-7 to 1e7. The default is 1.
    #[serde(default = "values::one", deserialize_with = "values::scale")]
    pub scale: f32,
    /// Linear reflectance. The default is a grey of 0.7.
    #[serde(default = "grey")]
    pub albedo: Albedo,
    /// How it reflects besides diffusely. By default it does not.
    pub gloss: Option<Gloss>,
    /// Textures of a glossy surface besides its albedo.
    #[serde(default, skip_serializing_if = "crate::field::is_default")]
    pub maps: Maps,
    /// Share of light that does not pass, 0 to 1, and a factor on the albedo: less than 1 for glass and for what is
    /// blended with what lies behind it. The default is 1.
    #[serde(default = "values::one", deserialize_with = "values::share", skip_serializing_if = "values::is_one")]
    pub opacity: f32,
    /// Linear radiance in W m^-2 sr^-1, at most 1e15. It multiplies the colours of a mesh that has them. The default is
    /// 0.
    #[serde(default, deserialize_with = "values::radiance")]
    pub emission: Vec3,
    /// Makes its light a spot along its own +y.
    #[serde(default, deserialize_with = "light::checked")]
    pub spot: Option<Spot>,
    /// Whether it lights others. By default it does if it has emission.
    pub emits: Option<bool>,
    /// Whether it casts shadows. By default it does unless it emits.
    pub occludes: Option<bool>,
    /// Whether it is lit. By default it is.
    pub receives: Option<bool>,
    /// Movements, which are applied from first to last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<Motion>,
    /// Whether a program may place it anywhere, so that nothing is baked of how it stands among others. The default is
    /// `false`: it moves as `motion` has it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub movable: bool,
}

fn grey() -> Albedo {
    Albedo::Color(Vec3::splat(0.7))
}

impl EntityData {
    /// An entity with that mesh and every other key left out.
    pub fn of_mesh(mesh: &str) -> Self {
        EntityData {
            name: None,
            mesh: mesh.to_owned(),
            position: Vec3::ZERO,
            rotation: RotationData::default(),
            scale: values::one(),
            albedo: grey(),
            gloss: None,
            maps: Maps::default(),
            opacity: values::one(),
            emission: Vec3::ZERO,
            spot: None,
            emits: None,
            occludes: None,
            receives: None,
            motion: Vec::new(),
            movable: false,
        }
    }

    /// The placement without its motion: within what carries it.
    pub(crate) fn fixed(&self) -> Placement {
        PlacementF64::new(self.position, self.rotation, self.scale).rounded()
    }

    /// The placement at `time_s` seconds.
    pub fn at(&self, time_s: f64) -> Placement {
        let rest = PlacementF64::new(self.position, self.rotation, self.scale);
        self.motion.iter().fold(rest, |place, motion| place.moved(motion, rest, time_s)).rounded()
    }
}

impl Data {
    /// Reads and checks the text of a scene file, without reading the meshes that it names. Messages name `path`.
    ///
    /// # Errors
    /// [`Error::Input`] in one line, which names the file and the line.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let data: Data = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |span| line_of(text.as_bytes(), span.start));
            Error::input_at(path, line, plain(&flat(e.message())))
        })?;
        check_counts(data.meshes.len(), data.entities.len()).map_err(|what| Error::input(path, what))?;
        Ok(data)
    }

    /// The scene as TOML, which reads back as equal data.
    ///
    /// # Errors
    /// [`Error::Failed`] where the path of a file is not UTF-8, which TOML cannot hold.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|error| Error::Failed(format!("no scene file can hold this scene: {error}")))
    }
}

/// Holds data that was made in code to the rules of a scene file: it is written, and read again. A refusal starts with
/// `what`.
pub(super) fn check<T: Serialize + serde::de::DeserializeOwned>(what: impl std::fmt::Display, data: &T) -> Result<()> {
    let fail = |message: &str| Error::Input(format!("{what}: {}", plain(&flat(message))));
    let text = toml::to_string(data).map_err(|error| fail(&error.to_string()))?;
    toml::from_str::<T>(&text).map(|_| ()).map_err(|error| fail(error.message()))
}

/// A message of the TOML reader on one line: its own lines are joined, those of a key in backquotes are escaped.
fn flat(message: &str) -> String {
    let part = |(index, part): (usize, &str)| {
        if index % 2 == 1 { one_line(part) } else { part.replace('\n', ", ") }
    };
    message.trim().split('`').enumerate().map(part).collect::<Vec<_>>().join("`")
}

/// Replaces the name of one of this program's types in a message by "a table", which is what the file has to hold
/// there.
fn plain(message: &str) -> String {
    let Some((before, rest)) = message.split_once("expected struct ") else { return message.to_owned() };
    let after = rest.find(|c: char| !c.is_alphanumeric() && c != '_').map_or("", |end| &rest[end..]);
    format!("{before}expected a table {{ ... }}{after}")
}
