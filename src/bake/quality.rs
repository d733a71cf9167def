//! What decides a bake as a user says it: a quality, and what overrides parts of it.

use super::{Options, Quality};
use crate::error::{Error, Result};
use crate::field::{Lattice, Storage};

/// What decides a bake: a quality, and what overrides parts of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args), command(next_help_heading = "Baking"))]
pub struct BakeOptions {
    /// How finely fields are sampled and stored
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value = "normal", value_name = "QUALITY"))]
    pub quality: Quality,
    /// Sample points in place of the quality's: cube:SHELLSxCELLS, with an odd number of cells. Words may follow after
    /// commas: inner=R, outer=R (in bounding radii), round (no fit to the mesh's box), edges (samples on the edges of
    /// cube faces: finer steps in as many bytes, not for boxes), edges=auto (the mesh decides). Example:
    /// cube:20x7,edges=auto
    #[cfg_attr(feature = "cli", arg(long, value_name = "LATTICE"))]
    pub lattice: Option<Lattice>,
    /// Edge of a captured cube face in texels, in place of the quality's
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=1024)))]
    pub face_px: Option<u32>,
    /// SH bands of light, transfer and what is stored, 2 to 7, in place of the quality's; N bands are N*N coefficients
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=7)))]
    pub bands: Option<u32>,
    /// SH bands of occlusion fields if other than --bands; more bands make shadows of many occluders more exact, and
    /// slower
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=7)))]
    pub field_bands: Option<u32>,
    /// Number format of stored coefficients
    #[cfg_attr(feature = "cli", arg(long, value_name = "f16|f32"))]
    pub storage: Option<Storage>,
}

impl From<Quality> for BakeOptions {
    fn from(quality: Quality) -> Self {
        BakeOptions { quality, ..Default::default() }
    }
}

impl BakeOptions {
    /// What the bake does: the quality, and what is said of each part.
    ///
    /// # Errors
    /// `Input` where a number is out of its range.
    pub fn resolve(self) -> Result<Options> {
        let of_quality = self.quality.options();
        let bands = [self.bands, self.field_bands].into_iter().flatten();
        if bands.into_iter().any(|bands| !(2..=7).contains(&bands)) {
            return Err(Error::Input("expected 2 to 7 bands".into()));
        }
        let face_px = self.face_px.unwrap_or(of_quality.face_px);
        if !(4..=1024).contains(&face_px) {
            return Err(Error::Input(format!("expected faces of 4 to 1024 px, got {face_px}")));
        }
        Ok(Options {
            lattice: self.lattice.unwrap_or(of_quality.lattice),
            face_px,
            bands: self.bands.map_or(of_quality.bands, |bands| bands as usize),
            field_bands: self.field_bands.map(|bands| bands as usize),
            storage: self.storage.unwrap_or(of_quality.storage),
            ..of_quality
        })
    }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;
    use clap::{Parser, ValueEnum};

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        bake: BakeOptions,
    }

    fn parsed(words: &[&str]) -> Options {
        CommandLine::try_parse_from([&["line"], words].concat()).unwrap().bake.resolve().unwrap()
    }

    #[test]
    fn every_quality_is_a_row_of_options() {
        assert_eq!(parsed(&[]), Quality::Normal.options());
        let all: Vec<Options> = ["draft", "normal", "high"].map(|word| parsed(&["--quality", word])).to_vec();
        assert_eq!(all, Quality::value_variants().iter().map(|quality| quality.options()).collect::<Vec<_>>());
        assert_eq!(all[1], parsed(&[]), "normal is what there is without the option");
        assert_eq!("cube:20x7,edges=auto".parse(), Ok(Lattice::default()), "as help texts write it");
        for pair in all.windows(2) {
            let samples = pair.iter().map(|o| o.lattice.stored_count()).collect::<Vec<_>>();
            assert!(pair[0].face_px < pair[1].face_px && pair[0].bands < pair[1].bands && samples[0] < samples[1]);
        }
    }

    #[test]
    fn a_single_switch_overrides_the_quality() {
        let high = Quality::High.options();
        for words in [&["--quality", "high", "--bands", "4"], &["--bands", "4", "--quality", "high"]] {
            assert_eq!(parsed(words), Options { bands: 4, ..high });
        }
        let lattice = "cube:9x5".parse().unwrap();
        assert_eq!(
            parsed(&["--quality=draft", "--lattice=cube:9x5", "--face-px=40", "--storage=f32", "--field-bands=5"]),
            Options { lattice, face_px: 40, storage: Storage::F32, field_bands: Some(5), ..Quality::Draft.options() }
        );
    }
}
