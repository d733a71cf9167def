//! How two pictures differ: mean FLIP, root mean square, and the worst place.

use super::flip;
use crate::asset::decode::Picture;
use crate::error::{Error, Result};

/// What root mean squares and largest differences are taken of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Values {
    /// What a screen shows, sRGB from 0 to 1: where one of the pictures is stored so.
    Srgb,
    /// Linear values without a limit: where both are stored so.
    Linear,
}

/// A pixel, counted from 0 at the upper left, and how two pictures differ there.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PixelDifference {
    pub x: usize,
    pub y: usize,
    pub difference: f64,
    /// Red, green and blue of the first picture there.
    pub a: [f32; 3],
    /// Red, green and blue of the second.
    pub b: [f32; 3],
}

/// The difference of two pictures over the pixels that count.
#[derive(Clone, Debug, serde::Serialize)]
pub struct PictureDifference {
    pub width: usize,
    pub height: usize,
    pub pixel_count: usize,
    /// Pixels that count and have a value that is not finite in one picture and another value in the other.
    pub not_finite_count: usize,
    /// Mean FLIP, 0 to 1 (see [`flip`]); pixels of `not_finite_count` have 1.
    #[serde(rename = "mean_flip_ratio")]
    pub mean_flip: f64,
    /// Root mean square over all channels; infinite (null in JSON) where `not_finite_count` is not 0.
    pub rms: f64,
    /// What `rms` and the two places are in.
    pub values: Values,
    /// Where a channel differs most; its difference may be infinite.
    pub largest: PixelDifference,
    /// Where FLIP is largest, with FLIP as the difference.
    pub largest_flip: PixelDifference,
    /// FLIP of every pixel, row by row; 0 where a pixel does not count.
    #[serde(skip)]
    pub flip: Vec<f64>,
}

impl PictureDifference {
    /// Compares two pictures where `mask` is true, or everywhere. Pixels that do not count have no effect on those that
    /// do. Linear pictures are brightened by `exposure_ev` stops where they are shown: for FLIP, and beside a picture
    /// that is stored in sRGB.
    pub fn new(a: &Picture, b: &Picture, mask: Option<&[bool]>, exposure_ev: f32) -> Result<Self> {
        let width = a.width;
        let height = a.height;
        if (b.width, b.height) != (width, height) {
            let sizes = format!("{} x {} pixels against {width} x {height}", b.width, b.height);
            return Err(Error::Input(format!("the pictures have different sizes: {sizes}")));
        }
        let counts = |pixel: usize| mask.is_none_or(|mask| mask[pixel]);
        let pixel_count = (0..width * height).filter(|pixel| counts(*pixel)).count();
        if pixel_count == 0 {
            return Err(Error::Input("the mask is dark everywhere, so no pixel is compared".into()));
        }
        let both_linear = a.is_linear && b.is_linear;
        let values = if both_linear { Values::Linear } else { Values::Srgb };
        let [of_a, of_b] = [a, b].map(|p| if both_linear { p.rgb.clone() } else { p.shown(exposure_ev) });
        let rgb = |of: &[f32], pixel: usize| [0, 1, 2].map(|c| of[3 * pixel + c]);
        let apart = |pixel: usize| {
            let channels = rgb(&a.rgb, pixel).into_iter().zip(rgb(&b.rgb, pixel));
            if channels.into_iter().any(|(a, b)| a.is_nan() != b.is_nan() || both_linear && differ_beyond_numbers(a, b))
            {
                return (f64::INFINITY, f64::INFINITY);
            }
            let mut square = 0.0;
            let mut largest = 0.0_f64;
            for (a, b) in rgb(&of_a, pixel).into_iter().zip(rgb(&of_b, pixel)) {
                // A pixel that is not finite is so in both pictures; it counts as equal.
                let difference = if a.is_finite() { f64::from(a) - f64::from(b) } else { 0.0 };
                square += difference * difference;
                largest = largest.max(difference.abs());
            }
            (square, largest)
        };
        let mut flip = flips(a, b, mask, exposure_ev);
        let mut not_finite_count = 0;
        let mut square = 0.0;
        let mut largest = (0, -1.0);
        let mut largest_flip = (0, -1.0);
        for pixel in (0..width * height).filter(|pixel| counts(*pixel)) {
            let (own, most) = apart(pixel);
            if own.is_infinite() {
                not_finite_count += 1;
                flip[pixel] = 1.0;
            }
            square += own;
            if most > largest.1 {
                largest = (pixel, most);
            }
            if flip[pixel] > largest_flip.1 {
                largest_flip = (pixel, flip[pixel]);
            }
        }
        let place = |(pixel, difference): (usize, f64)| PixelDifference {
            x: pixel % width,
            y: pixel / width,
            difference,
            a: rgb(&of_a, pixel),
            b: rgb(&of_b, pixel),
        };
        Ok(PictureDifference {
            width,
            height,
            pixel_count,
            not_finite_count,
            mean_flip: flip.iter().sum::<f64>() / pixel_count as f64,
            rms: (square / (3 * pixel_count) as f64).sqrt(),
            values,
            largest: place(largest),
            largest_flip: place(largest_flip),
            flip,
        })
    }
}

/// Whether one of two values that are not both NaN is infinite and the other is not the same.
fn differ_beyond_numbers(a: f32, b: f32) -> bool {
    (a.is_infinite() || b.is_infinite()) && a != b
}

/// FLIP of every pixel, 0 where the mask is dark. The second picture takes the first one's pixels where the mask is
/// dark, so that these look alike and blur nothing into their neighbours.
fn flips(a: &Picture, b: &Picture, mask: Option<&[bool]>, exposure_ev: f32) -> Vec<f64> {
    let [of_a, mut of_b] = [a, b].map(|picture| picture.linear(exposure_ev));
    for (pixel, _) in mask.unwrap_or_default().iter().enumerate().filter(|(_, counts)| !**counts) {
        of_b[3 * pixel..3 * pixel + 3].copy_from_slice(&of_a[3 * pixel..3 * pixel + 3]);
    }
    let mut flip = flip::flip(a.width, &of_a, &of_b);
    flip.iter_mut().zip(mask.unwrap_or_default()).filter(|(_, counts)| !**counts).for_each(|(flip, _)| *flip = 0.0);
    flip
}
