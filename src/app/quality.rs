//! `--quality` and the single options that override it.

use crate::bake;
use crate::bake::Quality;
use crate::field::{Lattice, Storage};
use clap::Args;

/// Options of a bake.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Baking")]
pub struct BakeArguments {
    /// How finely fields are sampled and stored
    #[arg(long, value_enum, default_value = "normal", value_name = "QUALITY")]
    pub quality: Quality,
    #[command(flatten)]
    single: SingleArguments,
}

/// The parts of a quality.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Baking: settings that override --quality")]
struct SingleArguments {
    /// Sample points: cube:SHELLSxCELLS or latlon:SHELLSxLATITUDESxLONGITUDES. Words may follow after commas: linear,raw (equal steps
    /// between shells, as in the paper), inner=R, outer=R (in bounding radii), round (no fit to the mesh's box), edges (samples on the
    /// edges of cube faces: finer steps in as many bytes, not for boxes), edges=auto (the mesh decides). Example: cube:18x7,edges=auto
    #[arg(long, value_name = "LATTICE")]
    lattice: Option<Lattice>,
    /// Edge of a captured cube face in texels
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=1024))]
    face_px: Option<u32>,
    /// SH bands of light, transfer and what is stored, 2 to 7; N bands are N*N coefficients
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=7))]
    bands: Option<u32>,
    /// SH bands of occlusion fields if other than --bands; more bands make shadows of many occluders more exact, and slower
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=7))]
    field_bands: Option<u32>,
    /// Number format of stored coefficients
    #[arg(long, value_name = "f16|f32")]
    storage: Option<Storage>,
}

impl BakeArguments {
    /// As the bake wants them: the quality, and what is said of each part.
    pub fn options(&self) -> bake::Options {
        let (mut options, single) = (self.quality.options(), self.single);
        options.lattice = single.lattice.unwrap_or(options.lattice);
        options.face_px = single.face_px.unwrap_or(options.face_px);
        options.bands = single.bands.map_or(options.bands, |bands| bands as usize);
        options.field_bands = single.field_bands.map(|bands| bands as usize);
        options.storage = single.storage.unwrap_or(options.storage);
        options
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser, ValueEnum};

    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        bake: BakeArguments,
    }

    fn parsed(words: &[&str]) -> bake::Options {
        CommandLine::try_parse_from([&["line"], words].concat()).unwrap().bake.options()
    }

    #[test]
    fn every_quality_is_a_row_of_options() {
        assert_eq!(parsed(&[]), bake::Options::default());
        let all: Vec<bake::Options> = ["draft", "normal", "high"].map(|word| parsed(&["--quality", word])).to_vec();
        assert_eq!(all, Quality::value_variants().iter().map(|quality| quality.options()).collect::<Vec<_>>());
        assert_eq!(all[1], bake::Options::default(), "normal is what there is without the option");
        assert_eq!("cube:18x7,edges=auto".parse(), Ok(Lattice::default()), "as help texts write it");
        for pair in all.windows(2) {
            let samples = pair.iter().map(|o| o.lattice.starting_at(1.0).stored_count()).collect::<Vec<_>>();
            assert!(pair[0].face_px < pair[1].face_px && pair[0].bands < pair[1].bands && samples[0] < samples[1]);
        }
    }

    #[test]
    fn a_single_switch_overrides_the_quality() {
        let high = Quality::High.options();
        for words in [&["--quality", "high", "--bands", "4"], &["--bands", "4", "--quality", "high"]] {
            assert_eq!(parsed(words), bake::Options { bands: 4, ..high });
        }
        let lattice = "cube:9x5".parse().unwrap();
        assert_eq!(
            parsed(&["--quality=draft", "--lattice=cube:9x5", "--face-px=40", "--storage=f32", "--field-bands=5"]),
            bake::Options {
                lattice,
                face_px: 40,
                storage: Storage::F32,
                field_bands: Some(5),
                ..Quality::Draft.options()
            }
        );
    }

    #[test]
    fn help_has_the_single_switches_under_a_heading_of_their_own() {
        let help = CommandLine::command().render_help().to_string();
        let [before, after] = help.split("Baking: settings that override --quality:").collect::<Vec<_>>()[..] else {
            panic!("one heading in {help}")
        };
        assert!(before.contains("--quality") && before.contains("draft") && !before.contains("--lattice <"), "{help}");
        for switch in ["--lattice", "--face-px", "--bands", "--field-bands", "--storage"] {
            assert!(after.contains(switch), "{switch} in {after}");
        }
    }
}
