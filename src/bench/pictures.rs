//! A case as a person sees it: the picture of the merge beside that of ray casting, and the error of every vertex.

use super::cases::Case;
use super::{Bench, default_options};
use crate::asset::false_color::Scheme;
use crate::asset::picture;
use crate::draw::Antialias;
use crate::error::Result;
use crate::frame::{Frame, Options};
use crate::scene::Placement;
use crate::truth::error_map::ErrorPicture;
use crate::truth::flip::mean_flip;
use crate::truth::{self, ErrorMap, RayCast, error_map};
use serde::Serialize;
use std::path::Path;

/// Rays of a reference in a quick and in a thorough run, a few seconds on two cores. Vertices and lights share them, so a scene
/// with fewer vertices gets more rays per vertex.
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
    /// Path of the merge's picture with that of ray casting at its right.
    pub beside: String,
    /// Mean FLIP between the two as a screen shows them, 0 to 1.
    #[serde(rename = "mean_flip_ratio")]
    pub mean_flip: f64,
}

/// Writes `error-CASE.png` and `beside-CASE.png` into `folder`. Ray casting lights vertices, as the merge does, and both are drawn
/// alike, with the scene's exposure.
///
/// # Errors
/// As [`Frame::new`] and [`Frame::render`], and `Failed` when a file cannot be written.
pub fn pictures(bench: &Bench<'_>, case: &Case, folder: &Path) -> Result<CasePicture> {
    let placements = case.scene.at(case.time_s);
    let options = Options { size: SIZE, antialias: Antialias::Samples, ..default_options() };
    let mut frame = bench.frame(&case.scene, options)?;
    frame.render(&placements, None)?;
    let found = error_map::radiosity(&frame)?;
    // By vertex, as the reference below: what pixels evaluate by themselves is not what vertices are judged by.
    frame.redraw(&placements, case.scene.data.output.white())?;
    let merged = frame.picture();

    let share = RAYS[usize::from(!bench.quick)] / frame.receiver_vertex_count().max(1);
    let lights = 1 + case.scene.entities.iter().filter(|e| e.emits).count();
    let rays = ((share / lights).clamp(64, 4096) as u32).next_power_of_two();
    let cast = RayCast { rays, runs: 2, seed: bench.seed, distant: case.distant, ..Default::default() };
    let (reference, noise) = truth::picture(&case.scene, &placements, &cast);
    for (entity, radiosity) in &reference {
        frame.set_radiosity(*entity, radiosity)?;
    }
    let (beside, mean_flip) = flipped(case, &mut frame, &placements, &merged, &named(folder, "beside", case))?;

    let map = ErrorMap::new(&found, &reference, Scheme::Signed);
    let errors = map.write(&named(folder, "error", case), &mut frame, &placements, None, noise)?;
    Ok(CasePicture { case: case.name.clone(), errors, beside, mean_flip })
}

/// Draws the frame as it is lit now and writes it at the right of another picture. Returns the path, and the mean FLIP of the two.
fn flipped(
    case: &Case,
    frame: &mut Frame,
    placements: &[Placement],
    left: &[f32],
    path: &Path,
) -> Result<(String, f64)> {
    let output = &case.scene.data.output;
    frame.redraw(placements, output.white())?;
    let [width, height] = frame.size();
    let right = frame.picture();
    let row = 3 * width as usize;
    let both: Vec<f32> = left.chunks(row).zip(right.chunks(row)).flat_map(|(l, r)| [l, r]).flatten().copied().collect();
    picture::write_png(path, 2 * width, height, &both, output.exposure_ev)?;
    let exposed = |linear: &[f32]| -> Vec<f32> { linear.iter().map(|c| c * output.exposure_ev.exp2()).collect() };
    Ok((path.display().to_string(), mean_flip(width as usize, &exposed(left), &exposed(&right))))
}

/// `KIND-CASE.png` in a folder, with dashes for what a file's name should not have.
fn named(folder: &Path, kind: &str, case: &Case) -> std::path::PathBuf {
    let words: Vec<&str> = case.name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    folder.join(format!("{kind}-{}.png", words.join("-")))
}
