//! Numbers of a scene file, checked while they are read, so that a message names the line of the number.

use crate::asset::environment::RADIANCE_LIMIT;
pub(super) use crate::asset::environment::{is_one, one};
use crate::text::short;
use glam::Vec3;
use serde::de::{Deserialize, Deserializer, Error};

/// Largest magnitude of a coordinate in metres.
pub const POSITION_LIMIT_M: f32 = 1e7;
/// Scales lie between the inverse of this and this.
pub const SCALE_LIMIT: f32 = 1e7;
/// Largest factor on the slopes of normals.
pub const SLOPE_LIMIT: f32 = 100.0;
/// Largest angle in degrees and time in seconds; f64 keeps fractions of 1e-7 there.
pub const NUMBER_LIMIT: f64 = 1e9;

/// `value` if it lies in its range, or else a refusal.
fn held<T, E: Error>(value: T, in_range: bool, refusal: impl FnOnce() -> String) -> Result<T, E> {
    if in_range { Ok(value) } else { Err(E::custom(refusal())) }
}

/// Reads a list of exactly three numbers.
fn three<'de, D: Deserializer<'de>>(source: D, what: &str, in_range: impl Fn(f32) -> bool) -> Result<Vec3, D::Error> {
    let list = Vec::<f32>::deserialize(source)?;
    let three: [f32; 3] =
        list.try_into().map_err(|l: Vec<f32>| D::Error::custom(format!("{what} has 3 numbers, not {}", l.len())))?;
    match three.iter().find(|v| !in_range(**v)) {
        Some(bad) => Err(D::Error::custom(format!("{} is out of range for {what}", short(*bad)))),
        None => Ok(Vec3::from_array(three)),
    }
}

/// A position in metres.
pub fn position<'de, D: Deserializer<'de>>(source: D) -> Result<Vec3, D::Error> {
    three(source, "a position (finite, within 1e7 m)", |v| v.abs() <= POSITION_LIMIT_M)
}

/// A position that may be left out.
pub fn maybe_position<'de, D: Deserializer<'de>>(source: D) -> Result<Option<Vec3>, D::Error> {
    position(source).map(Some)
}

/// Linear reflectance.
pub fn albedo<'de, D: Deserializer<'de>>(source: D) -> Result<Vec3, D::Error> {
    three(source, "an albedo (0 to 1)", |v| (0.0..=1.0).contains(&v))
}

/// Linear radiance.
pub fn radiance<'de, D: Deserializer<'de>>(source: D) -> Result<Vec3, D::Error> {
    three(source, "a radiance (0 to 1e15)", |v| (0.0..=RADIANCE_LIMIT).contains(&v))
}

/// A direction of any length but zero, kept as written.
pub fn direction<'de, D: Deserializer<'de>>(source: D) -> Result<Vec3, D::Error> {
    let given = three(source, "a direction (finite, within 1e7)", |v| v.abs() <= POSITION_LIMIT_M)?;
    held(given, given.as_dvec3().try_normalize().is_some(), || "a direction has no length".into())
}

/// A finite number of moderate size: a time, an angle.
pub fn number<'de, D: Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(source)?;
    held(value, value.abs() <= NUMBER_LIMIT, || format!("{} is not finite or beyond 1e9", short(value)))
}

/// A factor on slopes, which may be left out.
pub fn slope<'de, D: Deserializer<'de>>(source: D) -> Result<Option<f32>, D::Error> {
    let value = f32::deserialize(source)?;
    let refusal = || format!("a factor on slopes of {} is not within -100 to 100", short(value));
    held(Some(value), value.abs() <= SLOPE_LIMIT, refusal)
}

/// Seconds per turn; negative reverses the direction.
pub fn period<'de, D: Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    let value = number(source)?;
    held(value, value.abs() >= 1e-6, || format!("a period of {} s is too short", short(value)))
}

/// One factor for all axes.
pub fn scale<'de, D: Deserializer<'de>>(source: D) -> Result<f32, D::Error> {
    const EXPECTED: &str = "expected one scale, uniform and positive (1e-7 to 1e7)";
    let value = f64::deserialize(source).map_err(|_| D::Error::custom(EXPECTED))?;
    let single = value as f32;
    let in_range = (1.0 / SCALE_LIMIT..=SCALE_LIMIT).contains(&single);
    held(single, in_range, || format!("scale {}: {EXPECTED}", short(value)))
}

/// A scale that may be left out.
pub fn maybe_scale<'de, D: Deserializer<'de>>(source: D) -> Result<Option<f32>, D::Error> {
    scale(source).map(Some)
}

/// A share, 0 to 1.
pub fn share<'de, D: Deserializer<'de>>(source: D) -> Result<f32, D::Error> {
    let value = f32::deserialize(source)?;
    let in_range = (0.0..=1.0).contains(&value);
    held(value, in_range, || format!("{} is out of range for a share (0 to 1)", short(value)))
}
