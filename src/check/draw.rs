//! "draw" against its twin, which casts a ray through every sample of a picture, and "smooth" against its own.

use super::CheckRow;
use super::capture::snapping;
use super::merge::{MIXED, options, scene};
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::draw::Antialias;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::scene::Placement;

/// Two half-float steps, and two roundings of interpolated f32.
const HALF: f64 = 2e-3;
/// Share of pixels whose samples may lie so near an edge that device and rays see different triangles there, or so
/// shifted a gradient: where corners snap to 1/256 of a pixel, and in proportion to that step on other devices.
const EDGES: f64 = 2e-3;

/// Draws what the last merge left, on the device and by its twin: the share of pixels that differ by more than [`HALF`]
/// of 1 + what is wanted. Infinite where the picture is of one colour.
fn against_twin(frame: &mut Frame, placements: &[Placement], white: f32) -> Result<f64> {
    frame.render(placements, Some(white))?;
    let found = frame.picture();
    let wanted = frame.twin_picture(placements, white)?;
    assert_eq!(found.len(), 3 * wanted.len(), "pixels");
    let mut differing = 0;
    for (found, [wanted, spread]) in found.chunks_exact(3).zip(&wanted) {
        let agrees =
            (0..3).all(|c| (f64::from(found[c]) - wanted[c]).abs() <= HALF * (1.0 + wanted[c].abs()) + spread[c]);
        differing += usize::from(!agrees);
    }
    let plain = wanted.iter().all(|[color, _]| *color == wanted[0][0]);
    Ok(if plain { f64::INFINITY } else { f64::from(differing as u32) / wanted.len() as f64 })
}

/// Compares pictures with one kind of antialiasing, at a white and without one. Rows are those of `pass`.
fn compare(baker: &Baker, pass: &'static str, antialias: Antialias, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    let scene = scene(MIXED)?;
    let placements = scene.at(0.0);
    let mut options = frame::Options { size: [96, 64], antialias, ..options() };
    options.bake.lattice = "cube:2x1".parse().expect("a lattice");
    let mut frame = Frame::new(baker, &Cache::default(), &scene, options, &|_, _, _| ())?;
    for white in [1.0, f32::INFINITY] {
        let worst = against_twin(&mut frame, &placements, white)?;
        let plural = if frame.samples() > 1 { "s" } else { "" };
        let what = format!("{} sample{plural} a pixel, white {white}", frame.samples());
        // Across an outline a pixel takes from its neighbour, so that a sample which differs shows in both.
        let pixels = if antialias == Antialias::Outlines { 2.0 } else { 1.0 };
        add(CheckRow::new(pass, what, "share of pixels", worst, pixels * EDGES * snapping(baker.device())));
    }
    Ok(())
}

pub fn rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    compare(baker, "draw", Antialias::None, add)?;
    compare(baker, "draw", Antialias::Samples, add)
}

/// Rows of "smooth".
pub fn smooth_rows(baker: &Baker, add: &mut dyn FnMut(CheckRow)) -> Result<()> {
    compare(baker, "smooth", Antialias::Outlines, add)
}
