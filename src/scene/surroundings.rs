//! Distant light by name, for any scene.

use super::{Scene, read_named};
use crate::asset::disc::Sun;
use crate::asset::environment::{Environment, EnvironmentData, EnvironmentImage, Gradient};
use crate::asset::sky::Sky;
use crate::error::{Error, Result};
use glam::Vec3;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Endings of equirectangular pictures.
const ENDINGS: [&str; 3] = ["hdr", "exr", "png"];

/// Distant light that takes the place of a scene's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// A clear sky with a sun behind the left shoulder of a viewer who looks along -z.
    Daylight,
    /// Bright neutral surroundings, brighter from above, and a large soft light from the upper left.
    Studio,
    /// Darkness.
    None,
    /// An equirectangular HDR, OpenEXR or PNG picture, as [`EnvironmentImage`] says.
    Picture(PathBuf),
}

impl Surroundings {
    /// Reads `daylight`, `studio`, `none` or the name of a picture.
    ///
    /// # Errors
    /// One line, where it is neither.
    pub fn parse(text: &OsStr) -> std::result::Result<Self, String> {
        let path = PathBuf::from(text);
        let ending = path.extension().unwrap_or_default();
        match text.to_str() {
            Some("daylight") => Ok(Self::Daylight),
            Some("studio") => Ok(Self::Studio),
            Some("none") => Ok(Self::None),
            _ if ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)) => Ok(Self::Picture(path)),
            _ => Err("expected daylight, studio, none or a picture (.hdr, .exr or .png)".into()),
        }
    }

    /// The same as a scene file has it.
    pub fn data(&self) -> EnvironmentData {
        let sky = Sky { sun_elevation_deg: 42.0, sun_azimuth_deg: 200.0, ..Sky::default() };
        let none = EnvironmentData::default();
        match self {
            Self::Daylight => EnvironmentData { sky: Some(sky), ..none },
            // Turned off, not left out: the window adds a sky to a scene that has none.
            Self::None => EnvironmentData { strength: 0.0, sky: Some(Sky { sun: 0.0, ..sky }), ..none },
            Self::Studio => EnvironmentData {
                gradient: Some(Gradient { radiance: Vec3::splat(0.7), base: 0.5, rise: 0.5 }),
                // A white surface that faces it has a radiance of 0.6.
                sun: Some(Sun { toward: Vec3::new(-0.6, 1.0, 0.8), angle_deg: 36.0, radiance: Vec3::splat(6.3) }),
                ..none
            },
            Self::Picture(file) => {
                EnvironmentData { image: Some(EnvironmentImage { file: file.clone(), scale: 1.0 }), ..none }
            }
        }
    }
}

impl Scene {
    /// Puts other distant light in place of all of the scene's, suns included, which its exposure does not fit: that is
    /// found anew.
    ///
    /// # Errors
    /// [`Error::Input`] in one line that names the picture: it cannot be read, or is none.
    pub fn surround(&mut self, with: &Surroundings) -> Result<()> {
        let mut source = with.data();
        let read = |_: &Path| match with {
            Surroundings::Picture(file) => read_named(file),
            _ => unreachable!("only a picture is read"),
        };
        if let Some(image) = &mut source.image {
            // Scene files name pictures from where they lie.
            image.file = std::path::absolute(&image.file).map_err(|error| Error::input(&image.file, error))?;
        }
        self.environment = Environment::new(&source, &read)?;
        self.data.environment = source;
        self.data.output.exposure_ev = None;
        self.place_suns();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_pictures_are_told_apart() {
        let parse = |text: &str| Surroundings::parse(OsStr::new(text));
        assert_eq!(parse("studio"), Ok(Surroundings::Studio));
        assert_eq!(parse("a/none.HDR"), Ok(Surroundings::Picture("a/none.HDR".into())));
        for wrong in ["", "Daylight", "sky.jpg", "exr"] {
            assert!(parse(wrong).is_err_and(|what| what.contains("daylight") && !what.contains('\n')), "{wrong}");
        }
    }

    #[test]
    fn every_scene_takes_them() {
        let mut scene = Scene::load(Path::new("assets/scenes/teapot_lights.toml")).unwrap();
        let count = scene.data.entities.len();
        for (with, suns) in [(Surroundings::Daylight, 1), (Surroundings::Studio, 1), (Surroundings::None, 0)] {
            scene.surround(&with).unwrap();
            assert_eq!(scene.entities.len(), count + suns, "{with:?}");
            assert_eq!(scene.environment.is_none(), with == Surroundings::None);
            assert!(!scene.data.environment.is_empty() && scene.data.output.exposure_ev.is_none());
        }
        let missing = scene.surround(&Surroundings::Picture("no/such.hdr".into())).unwrap_err();
        assert!(missing.exit_code() == 4 && missing.to_string().contains("no/such.hdr"), "{missing}");
    }
}
