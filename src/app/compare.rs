//! `shadow-fields compare` measures how two pictures differ.

use super::outputs::{self, Output};
use super::{Global, output};
use crate::asset::decode::Picture;
use crate::asset::false_color::{ColorScale, NEUTRAL, Scheme};
use crate::asset::picture::write_png;
use crate::error::{Error, Result};
use crate::text::number;
use crate::truth::difference::{PictureDifference, PixelDifference, Values};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "FLIP (Andersson et al. 2020) is how different two pictures look when one flips between them, 0 to 1 a pixel: \
    colours are blurred as the eye blurs them 0.7 m from a screen of 0.7 m and 3 840 pixels. A mean of 0.01 is hard to see, 0.1 is \
    plain.\nRMS and the largest difference are of sRGB values from 0 to 1 as a screen shows them (1 of 255 steps is 0.0039), or of \
    linear values where both pictures are EXR or HDR. Alpha is not compared. A pixel that is not finite in one picture alone is \
    beyond every bound.\n\nExamples:\n  shadow-fields compare expected.png out/teapot.png --max-flip 0.01 -o difference.png\n  \
    shadow-fields compare a.exr b.exr --max-rms 0.001 --mask without_clock.png --json\n\nExit codes: 0 within the bounds (or none is \
    given), 1 beyond one, 2 usage, 4 a file that is no picture, or pictures of different sizes"
)]
pub struct Arguments {
    /// Picture in PNG, JPEG, EXR or HDR, made by this program or not; the first picture of an animated PNG is compared
    #[arg(value_name = "A")]
    first: PathBuf,
    /// Picture of the same size
    #[arg(value_name = "B")]
    second: PathBuf,
    /// Also write a picture of FLIP in false colour: dark where the two look alike
    #[arg(short, long, value_name = "DIFF.png")]
    output: Option<PathBuf>,
    /// End with exit code 1 where mean FLIP is above this
    #[arg(long, value_name = "0..1", value_parser = number::<f64>(0.0..=1.0), allow_negative_numbers = true)]
    max_flip: Option<f64>,
    /// End with exit code 1 where the root mean square difference is above this
    #[arg(long, value_name = "X", value_parser = number::<f64>(0.0..), allow_negative_numbers = true)]
    max_rms: Option<f64>,
    /// Compare only pixels that are light in this picture of the same size (green at least half of white)
    #[arg(long, value_name = "MASK.png")]
    mask: Option<PathBuf>,
    /// Stops by which EXR and HDR pictures are brightened before FLIP, and before they are compared with a PNG or JPEG
    #[arg(long, default_value_t = 0.0, value_name = "STOPS", value_parser = number::<f32>(-32.0..=32.0), allow_negative_numbers = true)]
    exposure_ev: f32,
}

pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if let Some(path) = &arguments.output {
        let inputs = [&arguments.first, &arguments.second].into_iter().chain(&arguments.mask).cloned();
        outputs::check(&inputs.collect::<Vec<_>>(), &[Output::new("--output", path, "png")])?;
    }
    let a = Picture::read(&arguments.first)?;
    let b = Picture::read(&arguments.second)?;
    for (picture, path) in [(&a, &arguments.first), (&b, &arguments.second)] {
        if picture.is_transparent {
            output::note(
                global,
                format!("note: {}: some pixels are transparent; only colours are compared", path.display()),
            );
        }
    }
    let mask = arguments.mask.as_ref().map(|path| {
        let mask = Picture::read(path)?;
        if (mask.width, mask.height) != (a.width, a.height) {
            let sizes = format!("{} x {} pixels for pictures of {} x {}", mask.width, mask.height, a.width, a.height);
            return Err(Error::input(path, format!("the mask has another size: {sizes}")));
        }
        let counts: Vec<bool> = mask.shown(0.0).chunks_exact(3).map(|rgb| rgb[1] >= 0.5).collect();
        if counts.contains(&true) { Ok(counts) } else { Err(Error::input(path, "the mask is dark everywhere")) }
    });
    let mask = mask.transpose()?;
    let found = PictureDifference::new(&a, &b, mask.as_deref(), arguments.exposure_ev)
        .map_err(|error| error.context(arguments.second.display()))?;
    if let Some(path) = &arguments.output {
        let (rgb, height) = picture(&found, mask.as_deref());
        write_png(path, found.width as u32, height as u32, &rgb, 0.0)?;
    }
    let beyond = beyond(arguments, &found);
    if global.json {
        let mut report = json!(found);
        report["a"] = json!(arguments.first.display().to_string());
        report["b"] = json!(arguments.second.display().to_string());
        report["passed"] = json!(beyond.is_empty());
        output::say(format!("{report:#}"));
    } else {
        say(&found);
    }
    if beyond.is_empty() {
        return Ok(());
    }
    let first = arguments.first.display();
    let second = arguments.second.display();
    Err(Error::Failed(format!("{second} differs from {first}: {}", beyond.join(", "))))
}

/// A picture of FLIP in linear RGB with a labelled bar below, and its height in pixels: dark where the two look alike.
/// Pixels that do not count are grey.
fn picture(found: &PictureDifference, mask: Option<&[bool]>) -> (Vec<f32>, usize) {
    let scale = ColorScale::fitting(Scheme::Absolute, std::iter::once(found.largest_flip.difference.max(1e-3)));
    let color = |(pixel, flip): (usize, &f64)| {
        if mask.is_none_or(|mask| mask[pixel]) { scale.color(*flip) } else { NEUTRAL }
    };
    let rgb: Vec<f32> = found.flip.iter().enumerate().flat_map(color).collect();
    scale.with_bar(&rgb, found.width, "FLIP: how different the two pictures look")
}

/// Names of the measures that are above their bounds.
fn beyond(arguments: &Arguments, found: &PictureDifference) -> Vec<String> {
    let measures = [
        ("mean FLIP", found.mean_flip, arguments.max_flip, "--max-flip"),
        ("RMS", found.rms, arguments.max_rms, "--max-rms"),
    ];
    let above = measures.into_iter().filter_map(|(what, value, bound, option)| {
        let bound = bound.filter(|bound| value > *bound || found.not_finite_count > 0)?;
        Some(format!("{what} {value:.3e} is over {option} {bound}"))
    });
    let mut above: Vec<String> = above.collect();
    if !above.is_empty() && found.not_finite_count > 0 {
        above.push(format!("{} pixels are not finite in one of them alone", found.not_finite_count));
    }
    above
}

fn say(found: &PictureDifference) {
    let unit = match found.values {
        Values::Srgb => "sRGB values from 0 to 1",
        Values::Linear => "linear values",
    };
    let at = |place: &PixelDifference| {
        let rgb = |c: [f32; 3]| c.map(|c| format!("{c:.4}")).join(" ");
        format!("at x {}, y {}: {} against {}", place.x, place.y, rgb(place.a), rgb(place.b))
    };
    output::say(format!("{} x {} pixels, {} compared, {unit}", found.width, found.height, found.pixel_count));
    let row = |name: &str, value: f64, place: String| vec![name.to_owned(), format!("{value:.6}"), place];
    let rows = [
        row("mean FLIP", found.mean_flip, String::new()),
        row("largest FLIP", found.largest_flip.difference, at(&found.largest_flip)),
        row("RMS", found.rms, String::new()),
        row("largest", found.largest.difference, at(&found.largest)),
    ];
    rows.iter().for_each(|row| output::say(format!("{:13} {:>10}  {}", row[0], row[1], row[2]).trim_end()));
    if found.not_finite_count > 0 {
        output::say(format!("{} pixels are not finite in one of them alone", found.not_finite_count));
    }
}
