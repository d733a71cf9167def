//! A generated sky: the daylight of Preetham, Shirley and Smits, *A Practical Analytic Model for Daylight*, SIGGRAPH
//! 1999, over ground of one colour, with a sun.
//!
//! Luminance and chromaticity of the dome are the paper's equation 3 with the coefficients of its appendix A.2. The
//! brightness is not physical: [`Sky::radiance`] and [`Sky::sun`] set the radiance of a white surface, so that no
//! exposure has to be found.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::disc::{ANGLES_DEG, Disc, SUN_DEG};
use super::environment::{RADIANCE_LIMIT, check_range};
use crate::error::Result;
use crate::sh::basis::{self, MAX_BANDS, MAX_COEFFICIENTS};
use crate::sh::quadrature::gauss_legendre;

/// Nodes in the cosine and in azimuth of the rule that projects the dome. Doubling them changes every coefficient by
/// less than 2e-4 of the first one.
const RULE: (usize, usize) = (64, 128);
/// Optical depth of clear air at the zenith for red, green and blue (Rayleigh scattering, 1 / wavelength^4).
const AIR_DEPTH: DVec3 = DVec3::new(0.05, 0.10, 0.22);
/// Optical depth of haze at the zenith, per unit of turbidity above 1.
const HAZE_DEPTH: DVec3 = DVec3::new(0.035, 0.045, 0.06);

/// A clear or hazy sky as data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sky {
    /// Height of the sun, 0 to 90 degrees.
    pub sun_elevation_deg: f32,
    /// Azimuth of the sun from -z (ahead) towards +x (right), degrees.
    pub sun_azimuth_deg: f32,
    /// Haze, from 2 (clear) to 10 (hazy).
    pub turbidity: f32,
    /// Radiance of white level ground under the dome alone, W m^-2 sr^-1 (as luminance).
    pub radiance: f32,
    /// Radiance of a white surface that faces the sun, under the sun alone, as a factor on `radiance`.
    pub sun: f32,
    /// Angular diameter of the sun, 0.01 to 90 degrees.
    pub sun_angle_deg: f32,
    /// Linear reflectance of the ground below the horizon, 0 to 1.
    pub ground: Vec3,
}

impl Default for Sky {
    fn default() -> Self {
        Sky {
            sun_elevation_deg: 40.0,
            sun_azimuth_deg: 50.0,
            turbidity: 3.0,
            radiance: 0.35,
            sun: 1.0,
            sun_angle_deg: SUN_DEG,
            ground: Vec3::splat(0.2),
        }
    }
}

impl Sky {
    pub(super) fn check(&self) -> Result<()> {
        check_range("sky sun_elevation_deg", self.sun_elevation_deg, 0.0..=90.0)?;
        check_range("sky sun_azimuth_deg", self.sun_azimuth_deg, -360.0..=360.0)?;
        check_range("sky turbidity", self.turbidity, 2.0..=10.0)?;
        check_range("sky radiance", self.radiance, 0.0..=RADIANCE_LIMIT)?;
        check_range("sky sun", self.sun, 0.0..=1e6)?;
        check_range("sky sun_angle_deg", self.sun_angle_deg, ANGLES_DEG)?;
        self.ground.to_array().into_iter().try_for_each(|c| check_range("sky ground", c, 0.0..=1.0))
    }
}

#[derive(Clone, Debug)]
pub struct Dome {
    pub sun: Disc,
    /// Perez coefficients A to E of Y, x and y.
    perez: [[f64; 5]; 3],
    /// Y, x and y at the zenith, each divided by the Perez function there.
    zenith: [f64; 3],
    /// Factor on the model's luminance.
    scale: f64,
    /// Linear RGB radiance below the horizon.
    ground: DVec3,
    /// Projection to [`MAX_BANDS`] bands, a list a channel.
    pub coefficients: [Vec<f64>; 3],
}

impl Dome {
    /// Evaluates a checked sky; this takes a few milliseconds.
    pub fn new(sky: &Sky) -> Self {
        let turbidity = f64::from(sky.turbidity);
        let elevation = f64::from(sky.sun_elevation_deg).to_radians();
        let polar = FRAC_PI_2 - elevation;
        let (across, ahead) = f64::from(sky.sun_azimuth_deg).to_radians().sin_cos();
        let toward = DVec3::new(across * polar.sin(), polar.cos(), -ahead * polar.sin());
        let half_angle_rad = f64::from(sky.sun_angle_deg).to_radians() / 2.0;
        let perez = perez(turbidity);
        let mut zenith = zenith(turbidity, polar);
        zenith.iter_mut().zip(&perez).for_each(|(value, p)| *value /= distribution(p, 1.0, polar));

        let mut dome = Dome {
            sun: Disc { name: "sun of the sky", toward, half_angle_rad, radiance: DVec3::ZERO },
            perez,
            zenith,
            scale: 1.0,
            ground: DVec3::ZERO,
            coefficients: Default::default(),
        };
        let directions = rule();
        // Radiance of white level ground: the mean over the dome, weighted with the cosine.
        let white = |dome: &Dome| {
            let sum: DVec3 = directions.iter().map(|(w, weight)| dome.above(*w) * (weight * w.y)).sum();
            sum / PI
        };
        dome.scale = f64::from(sky.radiance) / luminance(white(&dome));
        // Transmittance along the air mass of Kasten and Young (1989), as a hue of luminance 1.
        let air_mass = 1.0 / (elevation.sin() + 0.50572 * (elevation.to_degrees() + 6.07995).powf(-1.6364));
        let depth = AIR_DEPTH + HAZE_DEPTH * (turbidity - 1.0);
        let hue = (-depth * air_mass).exp();
        // Irradiance of a disc of radiance 1 on a surface that faces it, over pi.
        let facing = half_angle_rad.sin().powi(2);
        dome.sun.radiance = hue / luminance(hue) * (f64::from(sky.sun * sky.radiance) / facing);
        let on_ground = white(&dome) + dome.sun.radiance * (facing * elevation.sin());
        dome.ground = sky.ground.as_dvec3() * on_ground;
        dome.coefficients = dome.project(&directions);
        dome
    }

    /// Linear RGB radiance from the unit vector `direction`, without the sun's disc.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        if direction.y > 0.0 { self.above(direction) } else { self.ground }
    }

    /// The dome without the sun, above the horizon.
    fn above(&self, direction: DVec3) -> DVec3 {
        let angle = direction.dot(self.sun.toward).clamp(-1.0, 1.0).acos();
        let cosine = direction.y.max(1e-4);
        let value = |k: usize| self.zenith[k] * distribution(&self.perez[k], cosine, angle);
        let [luminance, x, y] = [self.scale * value(0), value(1), value(2)];
        rgb_from_xyz(DVec3::new(x, y, 1.0 - x - y) * (luminance / y)).max(DVec3::ZERO)
    }

    fn project(&self, directions: &[(DVec3, f64)]) -> [Vec<f64>; 3] {
        let mut sum = [(); 3].map(|()| vec![0.0; MAX_COEFFICIENTS]);
        let mut values = [0.0; MAX_COEFFICIENTS];
        let mut add = |direction: DVec3, radiance: DVec3| {
            basis::evaluate(MAX_BANDS, direction, &mut values);
            for (channel, amount) in sum.iter_mut().zip(radiance.to_array()) {
                channel.iter_mut().zip(&values).for_each(|(c, v)| *c += amount * v);
            }
        };
        for &(direction, weight) in directions {
            add(direction, self.above(direction) * weight);
            // The ground uses the mirrored rule, which is exact because the ground has one colour.
            add(direction * DVec3::new(1.0, -1.0, 1.0), self.ground * weight);
        }
        sum
    }
}

/// Directions above the horizon and their solid angles.
fn rule() -> Vec<(DVec3, f64)> {
    let (rows, columns) = RULE;
    let mut out = Vec::with_capacity(rows * columns);
    for (node, weight) in gauss_legendre(rows) {
        let y = (node + 1.0) / 2.0;
        let level = (1.0 - y * y).sqrt();
        for k in 0..columns {
            let (sine, cosine) = (TAU * (k as f64 + 0.5) / columns as f64).sin_cos();
            out.push((DVec3::new(level * sine, y, level * cosine), weight / 2.0 * TAU / columns as f64));
        }
    }
    out
}

/// Equation 3 of the paper: (1 + A exp(B / cos theta)) (1 + C exp(D gamma) + E cos^2 gamma).
fn distribution([a, b, c, d, e]: &[f64; 5], cosine: f64, angle: f64) -> f64 {
    (1.0 + a * (b / cosine).exp()) * (1.0 + c * (d * angle).exp() + e * angle.cos().powi(2))
}

/// Appendix A.2: A to E of Y, x and y.
fn perez(t: f64) -> [[f64; 5]; 3] {
    [
        [0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771, -0.0670 * t + 0.3703],
        [-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989, -0.0033 * t + 0.0452],
        [-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537, -0.0109 * t + 0.0529],
    ]
}

/// Appendix A.2: luminance (kcd m^-2) and chromaticity overhead, the sun `polar` radians from there.
fn zenith(t: f64, polar: f64) -> [f64; 3] {
    let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * polar);
    let cubic = |[a, b, c, d]: [f64; 4]| ((a * polar + b) * polar + c) * polar + d;
    let chromaticity = |rows: [[f64; 4]; 3]| (cubic(rows[0]) * t + cubic(rows[1])) * t + cubic(rows[2]);
    [
        (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192,
        chromaticity([
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]),
        chromaticity([
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]),
    ]
}

/// Linear Rec.709 of CIE XYZ (IEC 61966-2-1).
fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    DMat3::from_cols_array(&[3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415, 1.0570]) * xyz
}

fn luminance(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}
