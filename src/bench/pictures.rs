//! A case as a person sees it: the program's picture beside that of rays, and the error of every vertex.

use super::cases::Case;
use super::judged::PIXEL_SIZE;
use super::{Bench, default_options};
use crate::asset::picture;
use crate::draw::{Antialias, Shading};
use crate::error::Result;
use crate::frame;
use crate::truth::error_map::ErrorPicture;
use crate::truth::flip::mean_flip;
use crate::truth::pixels::pixels;
use crate::truth::raycast::{Estimate, relative_error};
use crate::truth::{self, ErrorMap, RayCast, error_map};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Rays of a reference in a quick and in a thorough run, a few seconds on two cores. Points and lights share them, so a
/// scene with fewer vertices gets more rays per vertex.
const RAYS: [usize; 2] = [8_000_000, 32_000_000];
/// Size of the error pictures in pixels, without their scale bars.
const ERROR_SIZE: [u32; 2] = [720, 480];

/// The pictures of a case and what they show.
#[derive(Clone, Debug, Serialize)]
pub struct CasePicture {
    /// Scene and light.
    pub case: String,
    /// The error of every lit vertex in false colour.
    #[serde(flatten)]
    pub errors: ErrorPicture,
    /// The program's own picture against rays that are cast from what each pixel shows.
    pub pixels: PixelError,
}

/// The error of a picture against ray-cast pixels.
#[derive(Clone, Debug, Serialize)]
pub struct PixelError {
    /// Path of the program's picture with that of ray-cast pixels at its right.
    pub beside: String,
    /// Pixels that show a lit surface; the others are the same in both.
    pub lit_count: usize,
    /// Root mean square difference of linear radiance over lit pixels, relative to that of the rays.
    #[serde(rename = "rms_relative")]
    pub rms: f64,
    /// The rays' own standard error, relative to the same.
    #[serde(rename = "reference_error_relative")]
    pub reference_error: f64,
    /// Mean FLIP between the two over all pixels as a screen shows them, 0 to 1.
    #[serde(rename = "mean_flip_ratio")]
    pub mean_flip: f64,
}

/// Writes `error-CASE.png` and `pixels-CASE.png` into `folder`.
pub fn pictures(bench: &Bench<'_>, case: &Case, folder: &Path) -> Result<CasePicture> {
    let placements = case.scene.at(case.time_s);
    let options = frame::Options { size: ERROR_SIZE, antialias: Antialias::Samples, ..default_options() };
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, None)?;
    let cast = cast(bench, case, frame.receiver_vertex_count());
    let (reference, noise) = truth::picture(&case.scene, &placements, &cast);
    let map = ErrorMap::new(&error_map::radiosity(&frame)?, &reference);
    let errors = map.write(&named(folder, "error", case), &mut frame, &placements, None, noise)?;
    Ok(CasePicture { case: case.name.clone(), errors, pixels: pixel_error(bench, case, folder)? })
}

/// Ray casting with as many rays a point as [`RAYS`] allows.
fn cast(bench: &Bench<'_>, case: &Case, points: usize) -> RayCast {
    let lights = 1 + case.scene.entities.iter().filter(|e| e.emits).count();
    let share = RAYS[usize::from(!bench.quick)] / points.max(1) / lights;
    let rays = (share.clamp(64, 4096) as u32).next_power_of_two();
    RayCast { rays, runs: 2, seed: bench.seed, distant: case.distant, ..Default::default() }
}

/// The program's picture, one sample a pixel, against rays from what each pixel shows.
fn pixel_error(bench: &Bench<'_>, case: &Case, folder: &Path) -> Result<PixelError> {
    let placements = case.scene.at(case.time_s);
    let options = frame::Options {
        size: PIXEL_SIZE,
        antialias: Antialias::None,
        shading: Some(Shading::Pixel),
        ..default_options()
    };
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, Some(f32::INFINITY))?;
    let found = frame.picture();
    let cast = cast(bench, case, found.len() / 3);
    let lit = pixels(&case.scene, &placements, PIXEL_SIZE, &cast);
    let mut wanted = found.clone();
    let mut apart = 0.0;
    let mut whole = f64::MIN_POSITIVE;
    for (pixel, estimate) in &lit {
        for (c, radiance) in estimate.radiosity.iter().enumerate() {
            wanted[3 * pixel + c] = *radiance as f32;
            apart += (f64::from(found[3 * pixel + c]) - radiance).powi(2);
            whole += radiance * radiance;
        }
    }
    let estimates: Vec<Estimate> = lit.iter().map(|(_, estimate)| *estimate).collect();

    let exposure_ev = case.scene.data.output.exposure_ev();
    let exposed = |linear: &[f32]| -> Vec<f32> { linear.iter().map(|c| c * exposure_ev.exp2()).collect() };
    let [width, height] = PIXEL_SIZE;
    let row = 3 * width as usize;
    let rows = found.chunks(row).zip(wanted.chunks(row));
    let both: Vec<f32> = rows.flat_map(|(left, right)| [left, right]).flatten().copied().collect();
    let path = named(folder, "pixels", case);
    picture::write_png(&path, 2 * width, height, &both, exposure_ev)?;
    Ok(PixelError {
        beside: path.display().to_string(),
        lit_count: lit.len(),
        rms: (apart / whole).sqrt(),
        reference_error: relative_error(&estimates),
        mean_flip: mean_flip(width as usize, &exposed(&found), &exposed(&wanted)),
    })
}

/// A picture's path, with dashes for what a file's name should not have.
fn named(folder: &Path, kind: &str, case: &Case) -> PathBuf {
    let words = case.name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    folder.join(format!("{kind}-{}.png", words.collect::<Vec<_>>().join("-")))
}
