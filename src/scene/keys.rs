//! Keys of one property over time: of a position, a rotation or a scale, each with times of its own.

use glam::{DQuat, DVec4, Vec3};
use serde::{Deserialize, Serialize};

use super::values::{NUMBER_LIMIT, POSITION_LIMIT_M, SCALE_LIMIT};

/// Values between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Between {
    /// The value of the earlier key.
    Step,
    /// A straight line at a constant rate; rotations take the short way at a constant rate.
    #[default]
    Linear,
    /// A Hermite cubic with the slopes that the keys have on either side; rotations are brought to unit length.
    Cubic,
}

/// A property that keys give.
pub trait KeyValue: Copy + Sized {
    /// Name of the quantity, with its range.
    const WHAT: &'static str;

    /// Whether it is within its range.
    fn is_usable(&self) -> bool;

    /// Its numbers as they are; those beyond its own are 0.
    fn raw(self) -> DVec4;

    /// Its numbers as a value: a quaternion has unit length.
    fn wide(self) -> DVec4 {
        self.raw()
    }

    /// The value at a share of the way between two others.
    fn linear(from: DVec4, to: DVec4, share: f64) -> DVec4 {
        from.lerp(to, share)
    }
}

impl KeyValue for Vec3 {
    const WHAT: &'static str = "a position (finite, within 1e7 m)";

    fn is_usable(&self) -> bool {
        self.to_array().iter().all(|x| x.abs() <= POSITION_LIMIT_M)
    }

    fn raw(self) -> DVec4 {
        self.as_dvec3().extend(0.0)
    }
}

/// A quaternion x, y, z, w of any length but 0.
impl KeyValue for [f32; 4] {
    const WHAT: &'static str = "a quaternion (finite, not zero)";

    fn is_usable(&self) -> bool {
        self.iter().all(|x| x.abs() <= POSITION_LIMIT_M) && self.iter().any(|x| x.abs() > 1e-12)
    }

    fn raw(self) -> DVec4 {
        DVec4::from_array(self.map(f64::from))
    }

    fn wide(self) -> DVec4 {
        self.raw().normalize()
    }

    fn linear(from: DVec4, to: DVec4, share: f64) -> DVec4 {
        DQuat::from_vec4(from).slerp(DQuat::from_vec4(to), share).into()
    }
}

impl KeyValue for f32 {
    const WHAT: &'static str = "a scale (1e-7 to 1e7)";

    fn is_usable(&self) -> bool {
        (1.0 / SCALE_LIMIT..=SCALE_LIMIT).contains(self)
    }

    fn raw(self) -> DVec4 {
        DVec4::new(self.into(), 0.0, 0.0, 0.0)
    }
}

/// The share of a morph target.
impl KeyValue for [f32; 1] {
    const WHAT: &'static str = "a share (finite, within 1e7)";

    fn is_usable(&self) -> bool {
        self[0].abs() <= POSITION_LIMIT_M
    }

    fn raw(self) -> DVec4 {
        DVec4::new(self[0].into(), 0.0, 0.0, 0.0)
    }
}

/// The values of a property at times; before the first and after the last it is constant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keys<V> {
    /// Seconds, at least one, increasing.
    pub times_s: Vec<f64>,
    /// One a time.
    pub values: Vec<V>,
    /// Values between two keys; linear where it is left out.
    #[serde(default, skip_serializing_if = "crate::field::is_default")]
    pub interpolation: Between,
    /// With cubic keys: change a second when the key is reached, one a time.
    #[serde(default = "Vec::new", skip_serializing_if = "Vec::is_empty")]
    pub in_slopes: Vec<V>,
    /// With cubic keys: change a second when the key is left, one a time.
    #[serde(default = "Vec::new", skip_serializing_if = "Vec::is_empty")]
    pub out_slopes: Vec<V>,
    /// Seconds after which time 0 comes again.
    pub period_s: Option<f64>,
}

/// Reads keys and checks them.
pub(super) fn checked<'de, D, V>(source: D) -> Result<Option<Keys<V>>, D::Error>
where
    D: serde::Deserializer<'de>,
    V: KeyValue + Deserialize<'de>,
{
    let keys = Keys::deserialize(source)?;
    keys.check().map_err(serde::de::Error::custom)?;
    Ok(Some(keys))
}

impl<V: KeyValue> Keys<V> {
    /// Refuses what [`Keys::at`] cannot read, and values out of range.
    pub(super) fn check(&self) -> Result<(), String> {
        let Keys { times_s, values, interpolation, in_slopes, out_slopes, period_s } = self;
        if times_s.is_empty() || values.len() != times_s.len() {
            return Err(format!("keys need one value a time and at least one: {} for {}", values.len(), times_s.len()));
        }
        if let Some(bad) = times_s.iter().find(|time| time.is_nan() || time.abs() > NUMBER_LIMIT) {
            return Err(format!("the time {bad} s of a key is not finite or beyond 1e9"));
        }
        if let Some([earlier, later]) = times_s.array_windows().find(|[earlier, later]| later <= earlier) {
            return Err(format!("keys need times that increase: {later} s stands after {earlier} s"));
        }
        if let Some(bad) = values.iter().position(|value| !value.is_usable()) {
            return Err(format!("key {} of {} is not {}", bad + 1, values.len(), V::WHAT));
        }
        let slopes = if *interpolation == Between::Cubic { times_s.len() } else { 0 };
        if in_slopes.len() != slopes || out_slopes.len() != slopes {
            return Err("cubic keys, and no others, have one value of in_slopes and one of out_slopes a time".into());
        }
        let is_moderate = |slope: &V| slope.raw().to_array().iter().all(|x| x.abs() <= NUMBER_LIMIT);
        if !in_slopes.iter().chain(out_slopes).all(is_moderate) {
            return Err("a slope of cubic keys is not finite or beyond 1e9".into());
        }
        if let Some(bad) = period_s.filter(|period| !(1e-6..=NUMBER_LIMIT).contains(period)) {
            return Err(format!("period_s {bad} is not within 1e-6 to 1e9"));
        }
        Ok(())
    }

    /// The value at `time_s` seconds, in as many numbers as it has. Cubic keys may leave its range.
    pub fn at(&self, time_s: f64) -> DVec4 {
        let time_s = self.period_s.map_or(time_s, |period| time_s.rem_euclid(period));
        let next = self.times_s.partition_point(|key| *key <= time_s);
        if next == 0 || next == self.times_s.len() {
            return self.values[next.saturating_sub(1)].wide();
        }
        let [from, to] = [self.values[next - 1].wide(), self.values[next].wide()];
        let span_s = self.times_s[next] - self.times_s[next - 1];
        let share = (time_s - self.times_s[next - 1]) / span_s;
        match self.interpolation {
            Between::Step => from,
            Between::Linear => V::linear(from, to, share),
            Between::Cubic => {
                let slopes = [self.out_slopes[next - 1].raw(), self.in_slopes[next].raw()];
                hermite([from, to], slopes.map(|slope| slope * span_s), share)
            }
        }
    }
}

/// The cubic with the given values and slopes at 0 and 1.
pub(super) fn hermite([a, b]: [DVec4; 2], [from, to]: [DVec4; 2], t: f64) -> DVec4 {
    let rest = 1.0 - t;
    (a * (1.0 + 2.0 * t) + from * t) * rest * rest + (b * (1.0 + 2.0 * rest) - to * rest) * t * t
}
