//! Distant light as a picture shows it behind a scene: an equirectangular map.

use super::environment::Environment;
use super::equirect::direction;
use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Width and height of maps of closed forms, which are smooth but at the horizon, texels: 0.35 degrees each.
const SIZE: [usize; 2] = [1024, 512];
/// Width of maps of pictures at most, texels. A map of 4096 takes 67 MB on a device.
const WIDEST: usize = 4096;

/// Radiance by direction with what an [`Environment`] leaves to discs of a picture, the sun and windows. Rows start at
/// +y; columns as those of [`super::environment::EnvironmentImage`]; as the environment is before it is turned.
pub struct Backdrop {
    pub width: usize,
    /// Linear RGB radiance.
    pub texels: Vec<Vec3>,
    /// From the world's directions to the map's.
    pub turn: DQuat,
}

impl Backdrop {
    /// `None` for an environment that is the same in all directions.
    pub fn new(environment: &Environment) -> Option<Self> {
        if environment.is_uniform() {
            return None;
        }
        let picture = environment.picture.as_deref();
        let [wide, high] = picture.map_or(SIZE, |picture| [picture.width, picture.height]);
        // Texels of the picture along one of the map.
        let step = wide.div_ceil(WIDEST);
        let size = [wide / step, (high / step).max(1)];
        let turn = environment.turn();
        let texel = |index: usize| {
            let part = |k: usize| {
                let offset = |k: usize| (k as f64 + 0.5) / step as f64;
                let column = (index % size[0]) as f64 + offset(k % step);
                let row = (index / size[0]) as f64 + offset(k / step);
                DVec3::from_array(environment.radiance(turn * direction(column / size[0] as f64, row / size[1] as f64)))
            };
            let sum: DVec3 = (0..step * step).map(part).sum();
            (sum / (step * step) as f64).as_vec3()
        };
        let mut texels: Vec<Vec3> = (0..size[0] * size[1]).into_par_iter().map(texel).collect();
        let share = environment.picture_scale() / (step * step) as f32;
        for &(index, radiance) in picture.iter().flat_map(|picture| &picture.taken) {
            let row = (index / wide / step).min(size[1] - 1);
            let column = (index % wide / step).min(size[0] - 1);
            texels[row * size[0] + column] += share * Vec3::from(radiance);
        }
        Some(Backdrop { width: size[0], texels, turn: turn.inverse() })
    }

    /// Bilinear, but not across the horizon, which divides sky from ground.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let height = self.texels.len() / self.width;
        let direction = self.turn * direction;
        let level = direction.x.hypot(direction.z);
        let column = (0.5 + direction.x.atan2(-direction.z) / TAU) * self.width as f64 - 0.5;
        let row = (0.5 - direction.y.atan2(level) / PI) * height as f64;
        let middle = 0.5 * height as f64;
        let row = if direction.y > 0.0 { row.min(middle - 0.5) } else { row.max(middle + 0.5) } - 0.5;
        let texel = |x: f64, y: f64| {
            let x = x.rem_euclid(self.width as f64) as usize % self.width;
            let y = y.clamp(0.0, (height - 1) as f64) as usize;
            self.texels[y * self.width + x].as_dvec3()
        };
        let along = |y: f64| texel(column.floor(), y).lerp(texel(column.floor() + 1.0, y), column - column.floor());
        along(row.floor()).lerp(along(row.floor() + 1.0), row - row.floor())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::environment::{EnvironmentData, EnvironmentImage, Gradient};
    use image::codecs::hdr::HdrEncoder;

    fn gradient() -> EnvironmentData {
        let gradient = Gradient { radiance: Vec3::new(1.0, 2.0, 3.0), base: 0.2, rise: 0.8 };
        EnvironmentData { gradient: Some(gradient), strength: 2.0, turn_deg: 30.0, ..EnvironmentData::default() }
    }

    #[test]
    fn it_is_the_environment_up_to_the_horizon() {
        let data = EnvironmentData { sky: Some(Default::default()), ..gradient() };
        let environment = Environment::new(&data, &|_| unreachable!("no picture")).unwrap();
        let backdrop = Backdrop::new(&environment).unwrap();
        for i in 0..500 {
            let up = 1.0 - (f64::from(i) + 0.5) / 250.0;
            let level = (1.0 - up * up).sqrt();
            let azimuth = 2.4 * f64::from(i);
            let toward = DVec3::new(level * azimuth.cos(), up, level * azimuth.sin());
            let wanted = DVec3::from_array(environment.radiance(toward));
            let off = backdrop.radiance(toward).distance(wanted);
            assert!(off < 0.01 * wanted.length(), "{toward}: {off}");
        }
    }

    /// A window of 200 in surroundings of 1 becomes a light, and is seen nonetheless.
    #[test]
    fn it_shows_the_windows_of_a_picture() {
        let texel =
            |i: usize| if (20..28).contains(&(i % 64)) && (12..18).contains(&(i / 64)) { [200.0; 3] } else { [1.0; 3] };
        let texels: Vec<_> = (0..64 * 32).map(|i| image::Rgb(texel(i))).collect();
        let mut bytes = Vec::new();
        HdrEncoder::new(&mut bytes).encode(&texels, 64, 32).unwrap();
        let data = EnvironmentData {
            image: Some(EnvironmentImage { file: "room.hdr".into(), scale: 0.5 }),
            turn_deg: 90.0,
            ..EnvironmentData::default()
        };
        let environment = Environment::new(&data, &|_| Ok(bytes.clone())).unwrap();
        assert_eq!(environment.discs().len(), 1);
        let backdrop = Backdrop::new(&environment).unwrap();
        let turn = backdrop.turn.inverse();
        let at = |x: f64, y: f64| backdrop.radiance(turn * direction(x / 64.0, y / 32.0)).x;
        assert!((at(24.0, 15.0) - 100.0).abs() < 1.0, "{}", at(24.0, 15.0));
        assert!((at(30.0, 15.0) - 0.5).abs() < 0.01, "{}", at(30.0, 15.0));
        assert!(environment.radiance(turn * direction(24.0 / 64.0, 15.0 / 32.0))[0] < 1.0);
    }

    #[test]
    fn one_color_needs_no_map() {
        let data = EnvironmentData { uniform: Some(Vec3::ONE), ..EnvironmentData::default() };
        let environment = Environment::new(&data, &|_| unreachable!("no picture")).unwrap();
        assert!(Backdrop::new(&environment).is_none());
    }
}
