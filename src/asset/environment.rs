//! Distant light: radiance that depends on direction only, evaluated and projected to spherical harmonics. Its small
//! bright discs are kept apart.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::disc::{ANGLES_DEG, Disc, Sun};
use super::equirect::Equirect;
use super::peak::WINDOW_NAME;
use super::sky::{Dome, Sky};
use crate::error::{Error, Result};
use crate::sh::basis::Y00;
use crate::sh::lobe;
use crate::sh::rotation::Rotation;
use crate::text::short;

/// Largest radiance, and largest of its factors. Its square still fits f32.
pub const RADIANCE_LIMIT: f32 = 1e15;
/// Intervals of Simpson's rule for the lobe of [`key_zonal`]; its relative error is then below 1e-11.
const LOBE_INTERVALS: usize = 1 << 14;
/// Largest angle by which the light may be turned: f32 still resolves hundredths of a degree there.
const TURN_LIMIT_DEG: f32 = 1e5;

/// Distant light as data: the sum of the parts that are given, or darkness if none is. Radiances are linear RGB, W m^-2
/// sr^-1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentData {
    /// Factor on all parts, 0 to 1e15.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub strength: f32,
    /// Rotation of all parts about +y, degrees, counter-clockwise seen from above.
    #[serde(default, skip_serializing_if = "crate::field::is_default")]
    pub turn_deg: f32,
    pub uniform: Option<Vec3>,
    /// A sky that brightens towards the zenith.
    pub gradient: Option<Gradient>,
    /// A soft directional light.
    pub key: Option<KeyLight>,
    /// A generated sky; `sky = {}` takes its defaults.
    pub sky: Option<Sky>,
    pub image: Option<EnvironmentImage>,
    pub sun: Option<Sun>,
}

impl Default for EnvironmentData {
    fn default() -> Self {
        EnvironmentData {
            strength: 1.0,
            turn_deg: 0.0,
            uniform: None,
            gradient: None,
            key: None,
            sky: None,
            image: None,
            sun: None,
        }
    }
}

/// Default of factors in scene files.
pub(crate) fn one() -> f32 {
    1.0
}

pub(crate) fn is_one(value: &f32) -> bool {
    *value == 1.0
}

/// Refuses a number of an environment that is out of its range.
pub(super) fn check_range(what: &str, value: f32, range: RangeInclusive<f32>) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    let [value, low, high] = [value, *range.start(), *range.end()].map(short);
    Err(Error::Input(format!("environment {what} {value} is not within {low} to {high}")))
}

impl EnvironmentData {
    fn check(&self) -> Result<()> {
        let amount = |what: &str, values: &[f32]| {
            values.iter().try_for_each(|value| check_range(what, *value, 0.0..=RADIANCE_LIMIT))
        };
        let directed = |what: &str, toward: Vec3| match toward.as_dvec3().try_normalize() {
            Some(_) => Ok(()),
            None => Err(Error::Input(format!("environment {what} has no direction towards it"))),
        };
        amount("strength", &[self.strength])?;
        if !(-TURN_LIMIT_DEG..=TURN_LIMIT_DEG).contains(&self.turn_deg) {
            return Err(Error::Input(format!(
                "environment turn_deg {} is not within {TURN_LIMIT_DEG:e}",
                self.turn_deg
            )));
        }
        if let Some(rgb) = self.uniform {
            amount("uniform", &rgb.to_array())?;
            self.within("uniform", f64::from(rgb.max_element()))?;
        }
        if let Some(gradient) = &self.gradient {
            amount("gradient", &gradient.radiance.to_array())?;
            amount("gradient", &[gradient.base, gradient.rise])?;
            let shares = f64::from(gradient.base) + f64::from(gradient.rise);
            self.within("gradient", f64::from(gradient.radiance.max_element()) * shares)?;
        }
        if let Some(key) = &self.key {
            amount("key", &key.radiance.to_array())?;
            self.within("key", f64::from(key.radiance.max_element()))?;
            amount("key sharpness", &[key.sharpness])?;
            if key.sharpness > 1e5 {
                return Err(Error::Input("environment key sharpness is over the limit of 1e5".into()));
            }
            directed("key", key.toward)?;
        }
        if let Some(sky) = &self.sky {
            sky.check()?;
            self.within("sky", f64::from(sky.radiance) * f64::from(sky.sun.max(1.0)))?;
        }
        if let Some(sun) = &self.sun {
            amount("sun radiance", &sun.radiance.to_array())?;
            check_range("sun angle_deg", sun.angle_deg, ANGLES_DEG)?;
            directed("sun", sun.toward)?;
            self.within("sun", f64::from(sun.radiance.max_element()))?;
        }
        self.image.as_ref().map_or(Ok(()), |image| amount("image scale", &[image.scale]))
    }

    /// Refuses a radiance that exceeds the limit after multiplication by `strength`.
    fn within(&self, what: &str, radiance: f64) -> Result<()> {
        let whole = radiance * f64::from(self.strength);
        if whole <= f64::from(RADIANCE_LIMIT) * (1.0 + 1e-6) {
            return Ok(());
        }
        Err(Error::Input(format!(
            "environment {what} times strength {} is over the limit of {} for radiance",
            short(self.strength),
            short(RADIANCE_LIMIT)
        )))
    }

    /// [`EnvironmentData::within`] for the mean of a picture.
    fn check_picture(&self, picture: Option<&Arc<Equirect>>) -> Result<()> {
        let Some((picture, image)) = picture.zip(self.image.as_ref()) else { return Ok(()) };
        let mean = picture.coefficients.iter().map(|c| c[0]).fold(0.0, f64::max) / (4.0 * PI).sqrt();
        self.within("image", mean * f64::from(image.scale))
    }

    pub fn is_empty(&self) -> bool {
        self.has_at_most_a_sun() && self.sun.is_none()
    }

    fn has_at_most_a_sun(&self) -> bool {
        let bare = EnvironmentData { strength: self.strength, turn_deg: self.turn_deg, ..EnvironmentData::default() };
        *self == EnvironmentData { sun: self.sun.clone(), ..bare }
    }
}

/// radiance * (base + rise * max(0, y)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gradient {
    /// Linear RGB at the zenith if base + rise = 1.
    pub radiance: Vec3,
    /// Factor on `radiance` at and below the horizon, not negative.
    #[serde(default = "Gradient::base")]
    pub base: f32,
    /// Increase of that factor from the horizon to the zenith, not negative.
    #[serde(default = "Gradient::rise")]
    pub rise: f32,
}

impl Gradient {
    fn base() -> f32 {
        0.2
    }

    fn rise() -> f32 {
        0.8
    }
}

/// radiance * exp(sharpness * (cos - 1)), cos being that of the angle to `toward`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyLight {
    /// Linear RGB at the middle of the lobe.
    pub radiance: Vec3,
    /// Direction towards the light, of any length but 0.
    pub toward: Vec3,
    /// 0 is uniform; radiance falls to half at an angle of about sqrt(1.4 / sharpness) radians. At most 1e5.
    pub sharpness: f32,
}

/// An equirectangular HDR, OpenEXR (linear) or PNG (sRGB) picture around the scene.
///
/// The top row is +y. The middle column is -z, straight ahead for a viewer who looks along -z, and columns to its right
/// are to the right, +x; the picture's left and right edges meet at +z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentImage {
    /// Relative to the scene file.
    pub file: PathBuf,
    /// Factor on the picture's values.
    #[serde(default = "one")]
    pub scale: f32,
}

/// Checked distant light with its decoded picture.
#[derive(Clone, Debug)]
pub struct Environment {
    source: EnvironmentData,
    pub(super) picture: Option<Arc<Equirect>>,
    dome: Option<Arc<Dome>>,
}

impl Environment {
    /// Checks `source` and decodes its picture, whose bytes `read` supplies.
    pub fn new(source: &EnvironmentData, read: &dyn Fn(&Path) -> Result<Vec<u8>>) -> Result<Self> {
        source.check()?;
        let picture = source.image.as_ref().map(|image| {
            Equirect::decode(&read(&image.file)?).map(Arc::new).map_err(|e| e.context(image.file.display()))
        });
        let picture = picture.transpose()?;
        source.check_picture(picture.as_ref())?;
        let dome = source.sky.as_ref().map(|sky| Arc::new(Dome::new(sky)));
        Ok(Self { source: source.clone(), picture, dome })
    }

    /// The same picture with other data. If the data name a picture, it must be the same one.
    pub fn with(&self, source: &EnvironmentData) -> Result<Self> {
        source.check()?;
        let file = |source: &EnvironmentData| source.image.as_ref().map(|image| image.file.clone());
        if let Some(other) = file(source).filter(|other| file(&self.source).as_ref() != Some(other)) {
            return Err(Error::Input(format!("environment image {} was not read", other.display())));
        }
        let picture = self.picture.clone().filter(|_| source.image.is_some());
        source.check_picture(picture.as_ref())?;
        let dome = match &source.sky {
            same if *same == self.source.sky => self.dome.clone(),
            sky => sky.as_ref().map(|sky| Arc::new(Dome::new(sky))),
        };
        Ok(Self { source: source.clone(), picture, dome })
    }

    /// Whether the radiance is 0 in all directions, [`Environment::discs`] left out.
    pub fn is_none(&self) -> bool {
        self.source.has_at_most_a_sun() || self.source.strength == 0.0
    }

    /// Distant discs: the sun, that of the generated sky, and what was taken out of the picture ([`Equirect::lights`]).
    /// Scenes light by them as by entities, so that they cast sharp shadows.
    pub fn discs(&self) -> Vec<Disc> {
        let EnvironmentData { sun, image, strength, .. } = &self.source;
        let image_scale = f64::from(image.as_ref().map_or(1.0, |image| image.scale));
        let scaled = |disc: &Disc| Disc { radiance: disc.radiance * image_scale, ..*disc };
        let of_picture = self.picture.iter().flat_map(|picture| &picture.lights).map(scaled);
        let all = sun.iter().map(Sun::disc).chain(self.dome.iter().map(|dome| dome.sun)).chain(of_picture);
        let turn = self.turn();
        let placed = |disc: Disc| Disc {
            toward: (turn * disc.toward).normalize(),
            radiance: disc.radiance * f64::from(*strength),
            ..disc
        };
        all.filter(|disc| disc.radiance != DVec3::ZERO).map(placed).collect()
    }

    /// Whether the radiance is the same in all directions, [`Environment::discs`] left out.
    pub(crate) fn is_uniform(&self) -> bool {
        let EnvironmentData { gradient, key, .. } = &self.source;
        self.is_none() || gradient.is_none() && key.is_none() && self.dome.is_none() && self.picture.is_none()
    }

    /// Factor on the picture's radiance.
    pub(super) fn picture_scale(&self) -> f32 {
        self.source.strength * self.source.image.as_ref().map_or(1.0, |image| image.scale)
    }

    pub(super) fn turn(&self) -> DQuat {
        DQuat::from_rotation_y(f64::from(self.source.turn_deg).to_radians())
    }

    /// Linear RGB radiance from the unit vector `direction`, not projected, without [`Environment::discs`].
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let direction = if self.source.turn_deg == 0.0 { direction } else { self.turn().inverse() * direction };
        let mut sum = DVec3::ZERO;
        if let Some(rgb) = self.source.uniform {
            sum += rgb.as_dvec3();
        }
        if let Some(g) = &self.source.gradient {
            sum += g.radiance.as_dvec3() * (f64::from(g.base) + f64::from(g.rise) * direction.y.max(0.0));
        }
        if let Some(k) = &self.source.key {
            let cosine = k.toward.as_dvec3().normalize().dot(direction);
            sum += k.radiance.as_dvec3() * (f64::from(k.sharpness) * (cosine - 1.0)).exp();
        }
        if let Some(dome) = &self.dome {
            sum += dome.radiance(direction);
        }
        if let (Some(picture), Some(image)) = (&self.picture, &self.source.image) {
            sum += picture.radiance(direction) * f64::from(image.scale);
        }
        (sum * f64::from(self.source.strength)).to_array()
    }

    /// Mean radiance, linear RGB, with windows but without suns: it is shown behind a scene.
    pub(crate) fn mean(&self) -> DVec3 {
        let windows = self.discs().into_iter().filter(|disc| disc.name == WINDOW_NAME);
        let windows = windows.map(|disc| disc.radiance * Disc::solid_angle(disc.half_angle_rad) / (4.0 * PI));
        DVec3::from_array(self.coefficients(1).map(|channel| channel[0] * Y00)) + windows.sum::<DVec3>()
    }

    /// Projection of each channel to `bands` bands, bands^2 coefficients, without [`Environment::discs`]. All parts but
    /// the sky are exact: closed forms, a one-dimensional integral, and for pictures the integral over every texel.
    pub fn coefficients(&self, bands: usize) -> [Vec<f64>; 3] {
        let turn = Rotation::new(bands, self.turn());
        self.unturned(bands).map(|channel| {
            let mut out = vec![0.0; channel.len()];
            turn.apply(&channel, &mut out);
            out.iter_mut().for_each(|c| *c *= f64::from(self.source.strength));
            out
        })
    }

    /// [`Environment::coefficients`] at strength 1, not turned.
    fn unturned(&self, bands: usize) -> [Vec<f64>; 3] {
        let mut sum = [const { Vec::new() }; 3].map(|_: Vec<f64>| vec![0.0; bands * bands]);
        // Parts may have more bands, which are left out.
        let mut add = |rgb: DVec3, parts: [&[f64]; 3]| {
            for ((channel, part), amount) in sum.iter_mut().zip(parts).zip(rgb.to_array()) {
                channel.iter_mut().zip(part).for_each(|(c, p)| *c += amount * p);
            }
        };
        let one = |amount: f64| {
            let mut shape = vec![0.0; bands * bands];
            shape[0] = amount * (4.0 * PI).sqrt();
            shape
        };
        if let Some(rgb) = self.source.uniform {
            add(rgb.as_dvec3(), [&one(1.0); 3]);
        }
        if let Some(g) = &self.source.gradient {
            add(g.radiance.as_dvec3(), [&one(f64::from(g.base)); 3]);
            add((g.radiance * g.rise).as_dvec3(), [&lobe::clamped_cosine(bands, DVec3::Y); 3]);
        }
        if let Some(k) = &self.source.key {
            let zonal = key_zonal(bands, f64::from(k.sharpness));
            let shape = lobe::zonal(bands, &zonal, k.toward.as_dvec3().normalize());
            add(k.radiance.as_dvec3(), [&shape; 3]);
        }
        if let Some(dome) = &self.dome {
            add(DVec3::ONE, dome.coefficients.each_ref().map(Vec::as_slice));
        }
        if let (Some(picture), Some(image)) = (&self.picture, &self.source.image) {
            add(DVec3::splat(f64::from(image.scale)), picture.coefficients.each_ref().map(Vec::as_slice));
        }
        sum
    }
}

/// z_l = sqrt((2l + 1) / (4 pi)) * 2 pi * integral over c of exp(sharpness * (c - 1)) P_l(c), by Simpson's rule in 1 -
/// c over the part where the exponential exceeds 1e-17.
fn key_zonal(bands: usize, sharpness: f64) -> Vec<f64> {
    let end = if sharpness > 20.0 { 40.0 / sharpness } else { 2.0 };
    let step = end / LOBE_INTERVALS as f64;
    let mut z = vec![0.0; bands];
    for i in 0..=LOBE_INTERVALS {
        let weight = match i {
            0 | LOBE_INTERVALS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let below = step * i as f64;
        let value = weight * step / 3.0 * (-sharpness * below).exp();
        let c = 1.0 - below;
        let mut previous = 0.0;
        let mut legendre = 1.0;
        for (l, sum) in z.iter_mut().enumerate() {
            *sum += value * legendre;
            let degree = l as f64;
            (previous, legendre) =
                (legendre, ((2.0 * degree + 1.0) * c * legendre - degree * previous) / (degree + 1.0));
        }
    }
    z.iter().enumerate().map(|(l, sum)| ((2.0 * l as f64 + 1.0) / (4.0 * PI)).sqrt() * TAU * sum).collect()
}
