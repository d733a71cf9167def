//! The sun of an environment picture, taken out as a disc.
//!
//! Four bands spread a sun of half a degree over half the sky. What stands out of its surroundings in a small spot
//! becomes a [`Disc`] instead, which casts sharp shadows, and the picture keeps the rest. Together they send as much
//! light as the whole picture.

use super::disc::Disc;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Angular radius within which the peak lies, radians (4 degrees).
const REACH_RAD: f64 = 4.0 * PI / 180.0;
/// The surroundings end at this angle from the peak, radians (7 degrees).
const AROUND_RAD: f64 = 7.0 * PI / 180.0;
/// Share of all light that a peak sends at least; a smaller one stays in the picture.
const LEAST_SHARE: f64 = 0.05;
/// Share of the light within [`REACH_RAD`] that stands out at least: a broad glow is no peak.
const LEAST_EXCESS: f64 = 0.5;
/// Texels across [`REACH_RAD`] at least, so that the picture can tell a peak from its surroundings.
const LEAST_TEXELS: f64 = 2.0;
/// Least half diameter of the disc, radians: the sun's.
const LEAST_HALF_RAD: f64 = 0.265 * PI / 180.0;

/// Takes the peak out of a picture of `width` x `height` texels, rows from +y, if it has one. `direction` gives the
/// middle of a texel by column and row.
pub(super) fn take_out(
    texels: &mut [[f32; 3]],
    [width, height]: [usize; 2],
    direction: &dyn Fn(usize, usize) -> DVec3,
) -> Option<Disc> {
    let row_rad = PI / height as f64;
    if row_rad * LEAST_TEXELS > REACH_RAD {
        return None;
    }
    let solid_angle = |y: usize| {
        let [north, south] = [y, y + 1].map(|y| (y as f64 * row_rad).cos());
        (north - south) * TAU / width as f64
    };
    let rgb = |texel: &[f32; 3]| DVec3::from_array(texel.map(f64::from));
    let gray = |texel: &[f32; 3]| rgb(texel).element_sum();
    let whole: f64 =
        texels.chunks_exact(width).enumerate().map(|(y, row)| row.iter().map(gray).sum::<f64>() * solid_angle(y)).sum();
    // The first of the brightest.
    let brightest =
        (0..texels.len()).reduce(|best, i| if gray(&texels[i]) > gray(&texels[best]) { i } else { best })?;
    let x = brightest % width;
    let y = brightest / width;
    let middle = direction(x, y);
    let rows = (AROUND_RAD / row_rad).ceil() as usize + 1;
    let near: Vec<(usize, f64, DVec3)> = (y.saturating_sub(rows)..(y + rows + 1).min(height))
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| (y * width + x, solid_angle(y), direction(x, y)))
        .filter(|(_, _, toward)| toward.angle_between(middle) < AROUND_RAD)
        .collect();
    let (inner, outer): (Vec<_>, Vec<_>) = near.into_iter().partition(|(_, _, d)| d.angle_between(middle) < REACH_RAD);
    if outer.is_empty() {
        return None;
    }
    // Radiance of the surroundings: the median of each channel.
    let median = |channel: usize| {
        let mut values: Vec<f32> = outer.iter().map(|(i, _, _)| texels[*i][channel]).collect();
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    };
    let around = [0, 1, 2].map(median);
    let excess = |texel: &[f32; 3]| [0, 1, 2].map(|c| (texel[c] - around[c]).max(0.0));
    let mut taken = DVec3::ZERO;
    let mut within = 0.0;
    let mut toward = DVec3::ZERO;
    for (i, solid, at) in &inner {
        let over = rgb(&excess(&texels[*i])) * *solid;
        taken += over;
        within += gray(&texels[*i]) * solid;
        toward += *at * over.element_sum();
    }
    let amount = taken.element_sum();
    if !(amount > LEAST_SHARE * whole && amount > LEAST_EXCESS * within) {
        return None;
    }
    let toward = toward.normalize();
    // A disc has half the square of its radius as the mean square of the distance from its middle.
    let spread: f64 = inner
        .iter()
        .map(|(i, solid, at)| rgb(&excess(&texels[*i])).element_sum() * solid * at.angle_between(toward).powi(2))
        .sum::<f64>()
        / amount;
    let half_angle_rad = (2.0 * spread).sqrt().clamp(LEAST_HALF_RAD, REACH_RAD);
    for (i, _, _) in &inner {
        let over = excess(&texels[*i]);
        texels[*i].iter_mut().zip(over).for_each(|(texel, over)| *texel -= over);
    }
    Some(Disc {
        name: "sun of the picture",
        toward,
        half_angle_rad,
        radiance: taken / Disc::solid_angle(half_angle_rad),
    })
}
