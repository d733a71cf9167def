//! Placements of entities and their motion, as functions of time alone.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3, DVec4, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::keys::{self, Keys, hermite};
use super::values;

/// Object to world: scale, then rotation, then position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Position in metres.
    pub position: Vec3,
    /// Unit quaternion.
    pub rotation: Quat,
    /// Uniform and positive.
    pub scale: f32,
}

impl Placement {
    /// The rotation in double precision, of unit length there too.
    pub fn turn(&self) -> DQuat {
        self.rotation.as_dquat().normalize()
    }

    /// Where a point of the object is in the world, metres.
    pub fn point(&self, object: DVec3) -> DVec3 {
        self.position.as_dvec3() + self.turn() * (object * f64::from(self.scale))
    }

    /// Where a point of the world is in the object.
    pub fn local(&self, world: DVec3) -> DVec3 {
        self.turn().inverse() * (world - self.position.as_dvec3()) / f64::from(self.scale)
    }

    /// Centre and radius in the world of a sphere of the object, metres.
    pub fn sphere(&self, (centre, radius_m): (Vec3, f32)) -> (DVec3, f64) {
        (self.point(centre.as_dvec3()), f64::from(radius_m) * f64::from(self.scale))
    }
}

/// A rotation in a scene file: `{ axis = [0, 1, 0], angle_deg = 30 }` (right-handed) or `{ quaternion = [x, y, z, w] }`
/// of any length but zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum RotationData {
    /// Turn about an axis of any length but zero.
    AxisAngle {
        /// Direction of the axis.
        axis: Vec3,
        /// Degrees.
        angle_deg: f64,
    },
    /// x, y, z, w; not necessarily unit.
    Quaternion([f32; 4]),
}

impl Default for RotationData {
    fn default() -> Self {
        RotationData::Quaternion([0.0, 0.0, 0.0, 1.0])
    }
}

impl RotationData {
    /// The unit quaternion.
    pub fn unit(self) -> DQuat {
        match self {
            RotationData::AxisAngle { axis, angle_deg } => {
                DQuat::from_axis_angle(axis.as_dvec3().normalize(), angle_deg.to_radians())
            }
            RotationData::Quaternion(q) => DQuat::from_array(q.map(f64::from)).normalize(),
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    axis: Option<Vec<f32>>,
    angle_deg: Option<f64>,
    quaternion: Option<Vec<f32>>,
}

impl TryFrom<Written> for RotationData {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let usable =
            |v: &[f32]| v.iter().all(|x| x.abs() <= values::POSITION_LIMIT_M) && v.iter().any(|x| x.abs() > 1e-12);
        match (written.axis.as_deref(), written.angle_deg, written.quaternion.as_deref()) {
            (Some(&[x, y, z]), Some(angle_deg), None) if usable(&[x, y, z]) && angle_deg.abs() <= values::NUMBER_LIMIT => {
                Ok(RotationData::AxisAngle { axis: Vec3::new(x, y, z), angle_deg })
            }
            (None, None, Some(&[x, y, z, w])) if usable(&[x, y, z, w]) => Ok(RotationData::Quaternion([x, y, z, w])),
            _ => Err("a rotation is { axis = [x, y, z], angle_deg = a } or { quaternion = [x, y, z, w] }, finite and not zero".into()),
        }
    }
}

impl From<RotationData> for Written {
    fn from(rotation: RotationData) -> Self {
        match rotation {
            RotationData::AxisAngle { axis, angle_deg } => {
                Written { axis: Some(axis.to_array().to_vec()), angle_deg: Some(angle_deg), quaternion: None }
            }
            RotationData::Quaternion(q) => Written { axis: None, angle_deg: None, quaternion: Some(q.to_vec()) },
        }
    }
}

/// One movement. The movements of an entity are applied in order, each to the placement that the previous ones give.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Motion {
    /// Replaces the placement by an interpolated one, which is constant before the first and after the last keyframe.
    Keyframes {
        /// At least one, times increasing.
        #[serde(deserialize_with = "keyframes")]
        keys: Vec<Keyframe>,
        /// Whether the motion repeats; its period is the time from the first to the last keyframe.
        #[serde(default)]
        repeat: bool,
        /// Interpolation between keys.
        #[serde(default, skip_serializing_if = "crate::field::is_default")]
        interpolation: Interpolation,
    },
    /// Moves the position around a line; the rotation does not change.
    Orbit {
        /// A point on the line, metres.
        #[serde(deserialize_with = "values::position")]
        centre: Vec3,
        /// The line's direction; the turn is right-handed about it.
        #[serde(default = "up", deserialize_with = "values::direction")]
        axis: Vec3,
        /// Seconds per turn; negative reverses the direction.
        #[serde(deserialize_with = "values::period")]
        period_s: f64,
    },
    /// Turns the entity in place about a world axis through its origin.
    Spin {
        /// Direction of the axis.
        #[serde(default = "up", deserialize_with = "values::direction")]
        axis: Vec3,
        /// Seconds per turn; negative reverses the direction.
        #[serde(deserialize_with = "values::period")]
        period_s: f64,
    },
    /// Moves the position to and fro: amplitude * sin(2 pi t / period + phase).
    Bob {
        /// Direction of the movement.
        #[serde(default = "up", deserialize_with = "values::direction")]
        axis: Vec3,
        /// Metres to either side.
        #[serde(deserialize_with = "values::number")]
        amplitude_m: f64,
        /// Seconds.
        #[serde(deserialize_with = "values::period")]
        period_s: f64,
        /// Degrees.
        #[serde(default, deserialize_with = "values::number")]
        phase_deg: f64,
    },
    /// Places the entity in the space of a node that stands still or moves.
    Node(Box<Node>),
}

impl Motion {
    /// From when to when, in seconds, it goes everywhere that it goes.
    pub(super) fn span_s(&self) -> [f64; 2] {
        match self {
            Motion::Keyframes { keys, .. } => [keys[0].time_s, keys[keys.len() - 1].time_s],
            Motion::Orbit { period_s, .. } | Motion::Spin { period_s, .. } | Motion::Bob { period_s, .. } => {
                [0.0, period_s.abs()]
            }
            Motion::Node(node) => [node.times_s().fold(0.0, f64::min), node.times_s().fold(0.0, f64::max)],
        }
    }
}

/// A node that carries what stands in it: what is placed in its space is scaled, turned and moved as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Position in metres where no keys give it. The default is the origin.
    #[serde(default, deserialize_with = "values::position")]
    pub position: Vec3,
    /// Rotation where no keys give it. The default is none.
    #[serde(default)]
    pub rotation: RotationData,
    /// Scale where no keys give it, 1e-7 to 1e7. The default is 1.
    #[serde(default = "values::one", deserialize_with = "values::scale")]
    pub scale: f32,
    /// Keys of the position in metres.
    #[serde(default, deserialize_with = "keys::checked")]
    pub position_keys: Option<Keys<Vec3>>,
    /// Keys of the rotation: quaternions x, y, z, w.
    #[serde(default, deserialize_with = "keys::checked")]
    pub rotation_keys: Option<Keys<[f32; 4]>>,
    /// Keys of the scale.
    #[serde(default, deserialize_with = "keys::checked")]
    pub scale_keys: Option<Keys<f32>>,
}

impl Node {
    /// A node that stands still.
    pub fn still(position: Vec3, rotation: DQuat, scale: f32) -> Self {
        let rotation = RotationData::Quaternion(rotation.as_quat().to_array());
        Node { position, rotation, scale, position_keys: None, rotation_keys: None, scale_keys: None }
    }

    /// Times of all its keys, seconds.
    pub(super) fn times_s(&self) -> impl Iterator<Item = f64> {
        let position = self.position_keys.as_ref().map(|keys| &keys.times_s);
        let rotation = self.rotation_keys.as_ref().map(|keys| &keys.times_s);
        let scale = self.scale_keys.as_ref().map(|keys| &keys.times_s);
        [position, rotation, scale].into_iter().flatten().flatten().copied()
    }

    /// Where it stands at `time_s` seconds. Cubic keys that leave the range of a scene file end at its limits.
    fn at(&self, time_s: f64) -> PlacementF64 {
        let mut out = PlacementF64::new(self.position, self.rotation, self.scale);
        let limit = f64::from(values::POSITION_LIMIT_M);
        if let Some(keys) = &self.position_keys {
            out.position = keys.at(time_s).truncate().clamp(DVec3::splat(-limit), DVec3::splat(limit));
        }
        if let Some(keys) = &self.rotation_keys {
            let turn = DQuat::from_vec4(keys.at(time_s));
            out.rotation = if turn.length_squared() > 1e-24 { turn.normalize() } else { DQuat::IDENTITY };
        }
        if let Some(keys) = &self.scale_keys {
            let limit = f64::from(values::SCALE_LIMIT);
            out.scale = keys.at(time_s).x.clamp(1.0 / limit, limit);
        }
        out
    }
}

/// Interpolation of positions and scales between keys. Rotations always take the short way at a constant rate
/// (spherical linear interpolation).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Straight lines at a constant rate.
    #[default]
    Linear,
    /// A Catmull-Rom spline through the keys: Hermite cubics whose slope at a key is the difference of the neighbouring
    /// keys over the difference of their times. The first and last slopes are those of the first and last stretch,
    /// unless the motion repeats and its last key equals its first. The spline may overshoot the keys; scales stay
    /// above a tenth of their keys' scales.
    Smooth,
}

fn up() -> Vec3 {
    Vec3::Y
}

/// A placement at a time; parts that are left out keep the entity's placement at rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Seconds.
    #[serde(deserialize_with = "values::number")]
    pub time_s: f64,
    /// Position in metres, interpolated as [`Interpolation`] says.
    #[serde(default, deserialize_with = "values::maybe_position")]
    pub position: Option<Vec3>,
    /// Rotation, interpolated the short way at a constant rate.
    pub rotation: Option<RotationData>,
    /// Scale, interpolated as [`Interpolation`] says.
    #[serde(default, deserialize_with = "values::maybe_scale")]
    pub scale: Option<f32>,
}

fn keyframes<'de, D: serde::Deserializer<'de>>(source: D) -> Result<Vec<Keyframe>, D::Error> {
    let keys = Vec::<Keyframe>::deserialize(source)?;
    if keys.is_empty() {
        return Err(serde::de::Error::custom("keyframes need at least one key"));
    }
    if let Some(before) = keys.windows(2).position(|k| k[1].time_s <= k[0].time_s) {
        return Err(serde::de::Error::custom(format!(
            "keyframes need times that increase: key {} of {} is at {} s, the one before at {} s",
            before + 2,
            keys.len(),
            keys[before + 1].time_s,
            keys[before].time_s
        )));
    }
    Ok(keys)
}

/// [`Placement`] in f64, for intermediate results between movements.
#[derive(Clone, Copy)]
pub(super) struct PlacementF64 {
    position: DVec3,
    rotation: DQuat,
    scale: f64,
}

impl PlacementF64 {
    pub(super) fn new(position: Vec3, rotation: RotationData, scale: f32) -> Self {
        Self { position: position.as_dvec3(), rotation: rotation.unit(), scale: f64::from(scale) }
    }

    pub(super) fn rounded(self) -> Placement {
        Placement {
            position: self.position.as_vec3(),
            rotation: self.rotation.normalize().as_quat(),
            scale: self.scale as f32,
        }
    }

    fn position_and_scale(self) -> DVec4 {
        self.position.extend(self.scale)
    }

    /// This placement after `motion`; `rest` supplies the parts that keyframes leave out.
    pub(super) fn moved(mut self, motion: &Motion, rest: PlacementF64, time_s: f64) -> Self {
        // Taking the fraction of a turn first keeps the angle small, so late times lose no precision.
        let turn = |axis: Vec3, period_s: f64| {
            DQuat::from_axis_angle(axis.as_dvec3().normalize(), TAU * (time_s / period_s).fract())
        };
        match motion {
            Motion::Keyframes { keys, repeat, interpolation } => {
                return interpolate(keys, *repeat, *interpolation, rest, time_s);
            }
            Motion::Orbit { centre, axis, period_s } => {
                let centre = centre.as_dvec3();
                self.position = centre + turn(*axis, *period_s) * (self.position - centre);
            }
            Motion::Spin { axis, period_s } => self.rotation = turn(*axis, *period_s) * self.rotation,
            Motion::Bob { axis, amplitude_m, period_s, phase_deg } => {
                let angle = TAU * (time_s / period_s).fract() + phase_deg.to_radians();
                self.position += axis.as_dvec3().normalize() * (amplitude_m * angle.sin());
            }
            Motion::Node(node) => {
                let node = node.at(time_s);
                self.position = node.position + node.rotation * (self.position * node.scale);
                self.rotation = node.rotation * self.rotation;
                self.scale *= node.scale;
            }
        }
        self
    }
}

fn interpolate(
    keys: &[Keyframe],
    repeat: bool,
    interpolation: Interpolation,
    rest: PlacementF64,
    time_s: f64,
) -> PlacementF64 {
    let first = keys[0].time_s;
    let last = keys[keys.len() - 1].time_s;
    let time = if repeat && last > first { first + (time_s - first).rem_euclid(last - first) } else { time_s };
    let place = |key: &Keyframe| PlacementF64 {
        position: key.position.map_or(rest.position, |p| p.as_dvec3()),
        rotation: key.rotation.map_or(rest.rotation, RotationData::unit),
        scale: key.scale.map_or(rest.scale, f64::from),
    };
    let next = keys.partition_point(|k| k.time_s <= time);
    if next == 0 || next == keys.len() {
        return place(&keys[next.saturating_sub(1)]);
    }
    let from = place(&keys[next - 1]);
    let to = place(&keys[next]);
    let span_s = keys[next].time_s - keys[next - 1].time_s;
    let part = (time - keys[next - 1].time_s) / span_s;
    let rotation = from.rotation.slerp(to.rotation, part);
    let [a, b] = [from, to].map(PlacementF64::position_and_scale);
    let between = match interpolation {
        Interpolation::Linear => a.lerp(b, part),
        Interpolation::Smooth => {
            let closed =
                repeat && place(&keys[0]).position_and_scale() == place(&keys[keys.len() - 1]).position_and_scale();
            // Slope at a key from its neighbours, in units of this stretch.
            let slope = |key: usize| {
                let end = keys.len() - 1;
                // The first and the last key of a closed path are the same; its neighbours lie on both sides of the
                // seam.
                let at = |key: usize| place(&keys[key]).position_and_scale();
                let (before, after, took_s) = match key {
                    _ if closed && (key == 0 || key == end) => {
                        (at(end - 1), at(1), (last - keys[end - 1].time_s) + (keys[1].time_s - first))
                    }
                    0 => (at(0), at(1), keys[1].time_s - first),
                    _ if key == end => (at(end - 1), at(end), last - keys[end - 1].time_s),
                    _ => (at(key - 1), at(key + 1), keys[key + 1].time_s - keys[key - 1].time_s),
                };
                (after - before) * (span_s / took_s)
            };
            let spline = hermite([a, b], [slope(next - 1), slope(next)], part);
            spline.with_w(spline.w.max(0.1 * a.w.min(b.w)))
        }
    };
    PlacementF64 { position: between.truncate(), rotation, scale: between.w }
}
