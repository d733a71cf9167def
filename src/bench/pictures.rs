//! A case as a person sees it: the picture of the merge beside that of ray casting, by vertex and by pixel, and the
//! error of every vertex.

use super::cases::Case;
use super::judged::PIXEL_SIZE;
use super::{Bench, default_options};
use crate::asset::false_color::Scheme;
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
use std::path::Path;

/// Rays of a reference in a quick and in a thorough run, a few seconds on two cores. Vertices and lights share them, so
/// a scene with fewer vertices gets more rays per vertex.
const RAYS: [usize; 2] = [8_000_000, 32_000_000];
/// Size of the pictures in pixels, error pictures without their scale bars.
const SIZE: [u32; 2] = [720, 480];

/// The pictures of a case and what they show.
#[derive(Clone, Debug, Serialize)]
pub struct CasePicture {
    /// Scene and light.
    pub case: String,
    /// The error of every lit vertex in false colour.
    #[serde(flatten)]
    pub errors: ErrorPicture,
    /// Path of the merge's picture with that of ray casting at its right, both lit by vertex.
    pub beside: String,
    /// Mean FLIP between the two as a screen shows them, 0 to 1.
    #[serde(rename = "mean_flip_ratio")]
    pub mean_flip: f64,
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

/// Writes `error-CASE.png`, `beside-CASE.png` and `pixels-CASE.png` into `folder`. For the first two ray casting lights
/// vertices, as the merge does, and both are drawn alike, with the scene's exposure; for the last the program draws as
/// it always does.
pub fn pictures(bench: &Bench<'_>, case: &Case, folder: &Path) -> Result<CasePicture> {
    let placements = case.scene.at(case.time_s);
    let options = frame::Options { size: SIZE, antialias: Antialias::Samples, ..default_options() };
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, None)?;
    let found = error_map::radiosity(&frame)?;
    // By vertex, as the reference below: what pixels evaluate by themselves is not what vertices are judged by.
    frame.redraw(&placements, case.scene.data.output.white())?;
    let merged = frame.picture();

    let cast = cast(bench, case, frame.receiver_vertex_count());
    let (reference, noise) = truth::picture(&case.scene, &placements, &cast);
    for (entity, radiosity) in &reference {
        frame.set_radiosity(*entity, radiosity)?;
    }
    frame.redraw(&placements, case.scene.data.output.white())?;
    let (beside, mean_flip) = beside(case, SIZE, [&merged, &frame.picture()], &named(folder, "beside", case))?;

    let map = ErrorMap::new(&found, &reference, Scheme::Signed);
    let errors = map.write(&named(folder, "error", case), &mut frame, &placements, None, noise)?;
    let pixels = pixel_error(bench, case, folder)?;
    Ok(CasePicture { case: case.name.clone(), errors, beside, mean_flip, pixels })
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
    let (beside, mean_flip) = beside(case, PIXEL_SIZE, [&found, &wanted], &named(folder, "pixels", case))?;
    let rms = (apart / whole).sqrt();
    Ok(PixelError { beside, lit_count: lit.len(), rms, reference_error: relative_error(&estimates), mean_flip })
}

/// Writes two pictures beside each other with the scene's exposure. Returns the path, and their mean FLIP.
fn beside(case: &Case, size: [u32; 2], [left, right]: [&[f32]; 2], path: &Path) -> Result<(String, f64)> {
    let exposure_ev = case.scene.data.output.exposure_ev();
    let [width, height] = size;
    let row = 3 * width as usize;
    let both: Vec<f32> = left.chunks(row).zip(right.chunks(row)).flat_map(|(l, r)| [l, r]).flatten().copied().collect();
    picture::write_png(path, 2 * width, height, &both, exposure_ev)?;
    let exposed = |linear: &[f32]| -> Vec<f32> { linear.iter().map(|c| c * exposure_ev.exp2()).collect() };
    Ok((path.display().to_string(), mean_flip(width as usize, &exposed(left), &exposed(right))))
}

fn named(folder: &Path, kind: &str, case: &Case) -> std::path::PathBuf {
    folder.join(format!("{kind}-{}.png", dashed(&case.name)))
}

/// The name of a case, with dashes for what a file's name should not have.
fn dashed(name: &str) -> String {
    let words: Vec<&str> = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    words.join("-")
}
