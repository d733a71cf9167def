//! The tables of a scene file.
//!
//! ```toml
//! [camera]                                   # fov_deg is vertical
//! eye = [0, 2, 5]
//! target = [0, 0.5, 0]
//! [output]                                   # all may be left out; time_s is that of the first picture
//! width = 960
//! exposure_ev = -0.5
//! time_s = 0
//! [environment]                              # what is given adds up, times strength, turned about +y
//! strength = 1
//! turn_deg = 30
//! uniform = [0.02, 0.02, 0.03]
//! gradient = { radiance = [0.1, 0.12, 0.16] }                              # brighter towards the zenith
//! key = { radiance = [3, 3, 2], toward = [1, 2, 1], sharpness = 8 }        # a soft directional light
//! sky = { sun_elevation_deg = 40, turbidity = 3, radiance = 0.35 }         # generated daylight; sky = {} will do
//! image = { file = "studio.hdr", scale = 0.5 }                             # equirectangular HDR, EXR or PNG
//! [[mesh]]
//! name = "ball"
//! sphere = { radius_m = 0.5, subdivisions = 4 }                            # or plane, cuboid, torus, teapot
//! [[entity]]
//! mesh = "ball"
//! position = [0, 0.6, 0]
//! rotation = { axis = [0, 1, 0], angle_deg = 30 }
//! scale = 1
//! albedo = [0.7, 0.4, 0.2]
//! emission = [40, 36, 30]                    # makes it a light; emits, occludes, receives = true | false say otherwise
//! motion = [                                 # one after the other, functions of time alone
//!     { keyframes = { repeat = true, interpolation = "smooth", keys = [    # Catmull-Rom; or "linear"; rotations by slerp
//!         { time_s = 0, position = [0, 0.6, 0] }, { time_s = 2, position = [1, 0.9, 0] }, { time_s = 4, position = [0, 0.6, 0] } ] } },
//!     { orbit = { centre = [0, 0, 0], period_s = 8 } }, { spin = { axis = [0, 1, 0], period_s = 4 } },
//!     { bob = { amplitude_m = 0.1, period_s = 3 } },
//! ]
//! ```

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::motion::{Motion, Placement, PlacementF64, RotationData};
use super::{ENTITY_LIMIT, MESH_LIMIT, values};
use crate::asset::Mesh;
use crate::asset::environment::EnvironmentData;
use crate::asset::generate::Generator;
use crate::error::{Error, Result};

/// Largest width or height of a picture.
pub const PICTURE_LIMIT_PX: u32 = 16_384;

/// A scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// From where it is seen.
    pub camera: Camera,
    /// Size and exposure of pictures.
    #[serde(default)]
    pub output: Output,
    /// Distant light; darkness if left out.
    #[serde(default)]
    pub environment: EnvironmentData,
    /// Shapes, by name.
    #[serde(default, rename = "mesh")]
    pub meshes: Vec<MeshData>,
    /// Things with a shape, a place and a surface.
    #[serde(default, rename = "entity")]
    pub entities: Vec<EntityData>,
}

/// Perspective from `eye` towards `target`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, try_from = "CameraWritten")]
pub struct Camera {
    /// Metres.
    pub eye: Vec3,
    /// Metres; not the eye.
    pub target: Vec3,
    /// Vertical field of view in degrees, 1 to 170; 40 if left out.
    pub fov_deg: f32,
}

impl Camera {
    /// A direction that is up in the picture: +y, or -z for a camera that looks straight up or down.
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

/// Pictures of a scene, where the command line does not say otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, try_from = "OutputWritten")]
pub struct Output {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Stops by which radiance is brightened before it is encoded.
    pub exposure_ev: f32,
    /// Scene time of the first picture, seconds.
    #[serde(skip_serializing_if = "is_zero")]
    pub time_s: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Default for Output {
    fn default() -> Self {
        Self { width: 960, height: 640, exposure_ev: 0.0, time_s: 0.0 }
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
        let exposure_ev = written.exposure_ev.unwrap_or(usual.exposure_ev);
        let (width, height) = (written.width.unwrap_or(usual.width), written.height.unwrap_or(usual.height));
        if [width, height].iter().any(|px| !(1..=PICTURE_LIMIT_PX).contains(px)) {
            return Err(format!("a picture of {width} x {height} pixels: each is 1 to {PICTURE_LIMIT_PX}"));
        }
        if !(-32.0..=32.0).contains(&exposure_ev) {
            return Err(format!("exposure_ev {exposure_ev} is not within -32 to 32"));
        }
        Ok(Self { width, height, exposure_ev, time_s: written.time_s })
    }
}

/// A shape: a file or a generator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshData {
    /// What entities call it; unique.
    pub name: String,
    /// Wavefront OBJ file, relative to the scene file; where there is none, a built-in mesh as `assets/meshes/torus.obj`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Its generator, written as `plane = {...}`, `sphere = {...}` and so on.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub generator: Option<Generator>,
}

// By hand, because serde's flattening would accept unknown keys.
impl<'de> Deserialize<'de> for MeshData {
    fn deserialize<D: serde::Deserializer<'de>>(source: D) -> std::result::Result<Self, D::Error> {
        use serde::de::Error as _;
        let mut table = toml::Table::deserialize(source)?;
        let text = |value: toml::Value| match value {
            toml::Value::String(text) => Ok(text),
            _ => Err(D::Error::custom("name and file of a mesh are strings")),
        };
        let name = text(table.remove("name").ok_or_else(|| D::Error::missing_field("name"))?)?;
        let file = table.remove("file").map(text).transpose()?.map(PathBuf::from);
        if file.is_some() != table.is_empty() {
            return Err(D::Error::custom(format!("mesh {name:?} has either a file or one generator")));
        }
        let generator = (!table.is_empty()).then(|| Generator::deserialize(toml::Value::Table(table))).transpose();
        let generator = generator.map_err(|e| D::Error::custom(format!("mesh {name:?}: {}", e.message())))?;
        Ok(Self { name, file, generator })
    }
}

impl MeshData {
    /// Reads or makes the mesh.
    pub(super) fn build(&self, folder: &Path, read: &dyn Fn(&Path) -> Result<Vec<u8>>) -> Result<Mesh> {
        let mut mesh = match (&self.file, &self.generator) {
            (Some(file), None) => Mesh::parse(&read(file)?, &folder.join(file))?,
            (None, Some(generator)) => generator.build()?,
            _ => return Err(Error::Input("a mesh has either a file or one generator".into())),
        };
        mesh.name.clone_from(&self.name);
        Ok(mesh)
    }
}

/// A thing in the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EntityData {
    /// For messages and tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Name of its mesh.
    pub mesh: String,
    /// Metres; the origin if left out.
    #[serde(default, deserialize_with = "values::position")]
    pub position: Vec3,
    /// None if left out.
    #[serde(default)]
    pub rotation: RotationData,
    /// Uniform and positive; 1 if left out.
    #[serde(default = "one", deserialize_with = "values::scale")]
    pub scale: f32,
    /// Linear reflectance, 0 to 1; .7 grey if left out.
    #[serde(default = "grey", deserialize_with = "values::albedo")]
    pub albedo: Vec3,
    /// Linear radiance in W m^-2 sr^-1; it multiplies the colours of a mesh that has them.
    #[serde(default, deserialize_with = "values::radiance")]
    pub emission: Vec3,
    /// Whether it lights others; if left out, whether it has emission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emits: Option<bool>,
    /// Whether it casts shadows; if left out, unless it emits or is flat.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occludes: Option<bool>,
    /// Whether it is lit; if left out, it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receives: Option<bool>,
    /// Movements, applied from first to last.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<Motion>,
}

fn one() -> f32 {
    1.0
}

fn grey() -> Vec3 {
    Vec3::splat(0.7)
}

impl EntityData {
    /// Where it is at `time_s` seconds.
    pub fn at(&self, time_s: f64) -> Placement {
        let rest = PlacementF64::new(self.position, self.rotation, self.scale);
        self.motion.iter().fold(rest, |place, motion| place.moved(motion, rest, time_s)).rounded()
    }
}

impl Data {
    /// Reads and checks the text of a scene file; meshes are not looked at. `path` is for messages.
    ///
    /// # Errors
    /// [`Error::Input`], one line with file and line.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let data: Data = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |span| line_of(text, span.start));
            Error::input_at(path, line, plain(&e.message().trim().replace('\n', ", ")))
        })?;
        for (what, count, limit) in
            [("meshes", data.meshes.len(), MESH_LIMIT), ("entities", data.entities.len(), ENTITY_LIMIT)]
        {
            if count > limit {
                return Err(Error::input(path, format!("{count} {what} are over the limit of {limit}")));
            }
        }
        Ok(data)
    }

    /// TOML that reads back as equal data.
    pub fn to_toml(&self) -> String {
        // All fields are plain values, tables and lists of them, which TOML can hold.
        toml::to_string(self).unwrap_or_else(|e| panic!("scene data does not fit TOML: {e}"))
    }
}

/// A message without the names of this program's types: where it expected one of them, a table is wanted.
fn plain(message: &str) -> String {
    let Some((before, rest)) = message.split_once("expected struct ") else { return message.to_owned() };
    let after = rest.find(|c: char| !c.is_alphanumeric() && c != '_').map_or("", |end| &rest[end..]);
    format!("{before}expected a table {{ ... }}{after}")
}

/// Line, counted from 1, of a byte of `text`.
pub(super) fn line_of(text: &str, byte: usize) -> usize {
    1 + text.as_bytes()[..byte.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}
