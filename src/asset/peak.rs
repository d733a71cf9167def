//! The sun and the bright windows of an environment picture, taken out as discs.
//!
//! Four bands spread a sun of half a degree over half the sky. What stands out of its surroundings in a small spot
//! becomes a [`Disc`] instead, which casts sharp shadows, and so does a window whose edges differ by less than 3 to 1.
//! The picture keeps the rest. Together they send as much light as the whole picture.

use super::disc::Disc;
use super::equirect::{Equirect, direction};
use glam::DVec3;
use std::f64::consts::PI;

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

/// Radiance of a window at least: of the picture's median, and of its brightest texel.
const WINDOW: [f64; 2] = [4.0, 0.1];
/// Solid angles of windows, steradians: of discs with diameters of 4 and of 60 degrees.
const WINDOW_SR: [f64; 2] = [0.0038, 0.84];
/// Share of all light that a window sends at least.
const LEAST_WINDOW: f64 = 0.08;
/// Solid angle of a window over that of the disc with its second moments, at least. A rectangle has as much up to
/// edges of 3 to 1.
const LEAST_FILLED: f64 = 0.55;
/// Name of the light that a window becomes.
pub(super) const WINDOW_NAME: &str = "window of the picture";
/// Windows that are taken out at most: each is a light.
const MOST_WINDOWS: usize = 3;

impl Equirect {
    fn solid_angle(&self, index: usize) -> f64 {
        self.solid_angles[index / self.width]
    }

    /// Unit direction of the middle of a texel.
    fn toward(&self, index: usize) -> DVec3 {
        let column = (index % self.width) as f64 + 0.5;
        let row = (index / self.width) as f64 + 0.5;
        direction(column / self.width as f64, row / self.height as f64)
    }

    fn whole(&self) -> f64 {
        (0..self.texels.len()).map(|i| gray(&self.texels[i]) * self.solid_angle(i)).sum()
    }

    /// The medians of the channels of some texels.
    fn median(&self, of: impl Iterator<Item = usize> + Clone) -> [f32; 3] {
        [0, 1, 2].map(|channel| {
            let mut values: Vec<f32> = of.clone().map(|i| self.texels[i][channel]).collect();
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f32::total_cmp).1
        })
    }

    /// Takes from some texels what is over `around`, as a disc whose half diameter lies within `half_rad`. `counts` decides
    /// whether, by its light and by the solid angle of the texels over that of the disc.
    fn take_out(
        &mut self,
        name: &'static str,
        texels: &[usize],
        around: [f32; 3],
        half_rad: [f64; 2],
        counts: impl FnOnce(f64, f64) -> bool,
    ) -> Option<Disc> {
        let excess = |texel: &[f32; 3]| [0, 1, 2].map(|c| (texel[c] - around[c]).max(0.0));
        let over = |i: usize| DVec3::from_array(excess(&self.texels[i]).map(f64::from)) * self.solid_angle(i);
        let taken: DVec3 = texels.iter().map(|&i| over(i)).sum();
        let amount = taken.element_sum();
        let toward = texels.iter().map(|&i| over(i).element_sum() * self.toward(i)).sum::<DVec3>().try_normalize()?;
        // A disc has half the square of its radius as the mean square of the distance from its middle. A square texel
        // adds a sixth of its area.
        let square = |&i: &usize| {
            over(i).element_sum() * (self.toward(i).angle_between(toward).powi(2) + self.solid_angle(i) / 6.0)
        };
        let spread = texels.iter().map(square).sum::<f64>() / amount;
        let half_angle_rad = (2.0 * spread).sqrt().clamp(half_rad[0], half_rad[1]);
        let solid_angle = Disc::solid_angle(half_angle_rad);
        if !counts(amount, texels.iter().map(|&i| self.solid_angle(i)).sum::<f64>() / solid_angle) {
            return None;
        }
        for &i in texels {
            let over = excess(&self.texels[i]);
            self.texels[i].iter_mut().zip(over).for_each(|(texel, over)| *texel -= over);
            self.taken.push((i, over));
        }
        Some(Disc { name, toward, half_angle_rad, radiance: taken / solid_angle })
    }

    /// Takes the sun and bright windows out.
    pub(super) fn take_out_lights(&mut self) {
        let sun = self.take_out_sun();
        self.lights = sun.into_iter().chain(self.take_out_windows()).collect();
    }

    fn take_out_windows(&mut self) -> Vec<Disc> {
        let whole = self.whole();
        // An odd step meets all columns.
        let around = self.median((0..self.texels.len()).step_by(self.texels.len() >> 16 | 1));
        let brightest = self.texels.iter().map(gray).fold(0.0, f64::max);
        let least = (WINDOW[0] * gray(&around)).max(WINDOW[1] * brightest);
        let mut windows: Vec<(f64, Vec<usize>)> = Vec::new();
        let mut is_known: Vec<bool> = self.texels.iter().map(|texel| gray(texel) <= least).collect();
        for first in 0..self.texels.len() {
            if std::mem::replace(&mut is_known[first], true) {
                continue;
            }
            // All bright texels that are connected with it.
            let mut window = vec![first];
            let mut at = 0;
            while at < window.len() {
                let x = window[at] % self.width;
                let y = window[at] / self.width;
                let row = y * self.width;
                let sides = [row + (x + 1) % self.width, row + (x + self.width - 1) % self.width];
                let above = (y > 0).then(|| window[at] - self.width);
                let below = (y + 1 < self.height).then(|| window[at] + self.width);
                for next in sides.into_iter().chain(above).chain(below) {
                    if !std::mem::replace(&mut is_known[next], true) {
                        window.push(next);
                    }
                }
                at += 1;
            }
            let solid_angle: f64 = window.iter().map(|&i| self.solid_angle(i)).sum();
            if (WINDOW_SR[0]..WINDOW_SR[1]).contains(&solid_angle) {
                windows.push((window.iter().map(|&i| gray(&self.texels[i]) * self.solid_angle(i)).sum(), window));
            }
        }
        windows.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let mut take_out = |window: &[usize]| {
            self.take_out(WINDOW_NAME, window, around, [LEAST_HALF_RAD, PI / 4.0], |amount, filled| {
                amount > LEAST_WINDOW * whole && filled > LEAST_FILLED
            })
        };
        windows.iter().filter_map(|(_, window)| take_out(window)).take(MOST_WINDOWS).collect()
    }

    /// Takes out what stands out in a small spot, if anything does.
    fn take_out_sun(&mut self) -> Option<Disc> {
        let row_rad = PI / self.height as f64;
        if row_rad * LEAST_TEXELS > REACH_RAD {
            return None;
        }
        let whole = self.whole();
        // The first of the brightest.
        let brightest = (0..self.texels.len())
            .reduce(|best, i| if gray(&self.texels[i]) > gray(&self.texels[best]) { i } else { best })?;
        let middle = self.toward(brightest);
        let rows = (AROUND_RAD / row_rad).ceil() as usize + 1;
        let y = brightest / self.width;
        let near = y.saturating_sub(rows) * self.width..(y + rows + 1).min(self.height) * self.width;
        let near = near.map(|i| (i, self.toward(i).angle_between(middle))).filter(|(_, angle)| *angle < AROUND_RAD);
        let (inner, outer): (Vec<_>, Vec<_>) = near.partition(|(_, angle)| *angle < REACH_RAD);
        if outer.is_empty() {
            return None;
        }
        let around = self.median(outer.iter().map(|(i, _)| *i));
        let inner: Vec<usize> = inner.into_iter().map(|(i, _)| i).collect();
        let within: f64 = inner.iter().map(|&i| gray(&self.texels[i]) * self.solid_angle(i)).sum();
        self.take_out("sun of the picture", &inner, around, [LEAST_HALF_RAD, REACH_RAD], |amount, _| {
            amount > LEAST_SHARE * whole && amount > LEAST_EXCESS * within
        })
    }
}

fn gray(texel: &[f32; 3]) -> f64 {
    DVec3::from_array(texel.map(f64::from)).element_sum()
}
