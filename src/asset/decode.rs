//! Reads pictures: PNG, JPEG, WebP, OpenEXR and Radiance HDR.
//!
//! A picture's size is known before its pixels are decoded, so that a small file cannot ask for much memory.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, Limits};

use super::picture::{linear_from_srgb, srgb_from_linear};
use crate::error::{Error, Result};

/// Largest number of pixels of a picture that is read: one of 7680 x 4320 is below.
pub const PIXEL_LIMIT: u64 = 1 << 25;
/// Largest file of a picture in bytes: 512 MiB, what a picture of [`PIXEL_LIMIT`] pixels takes as uncompressed f32
/// RGBA.
const FILE_LIMIT_BYTES: u64 = 512 << 20;

const FORMATS: [ImageFormat; 5] =
    [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::OpenExr, ImageFormat::Hdr];

/// A picture as it is stored: rows from the top, pixels from the left, three channels each. Alpha is dropped.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels, at least 1.
    pub width: usize,
    /// Height in pixels, at least 1.
    pub height: usize,
    /// Red, green and blue of every pixel: sRGB from 0 to 1, or linear and of any value.
    pub rgb: Vec<f32>,
    /// Whether the values are linear, as in OpenEXR and HDR, or sRGB, as in PNG and JPEG.
    pub is_linear: bool,
    /// Whether some pixel is not opaque in the file.
    pub is_transparent: bool,
}

impl Picture {
    pub fn read(path: &Path) -> Result<Self> {
        Self::decode(&super::read_file(path, FILE_LIMIT_BYTES)?).map_err(|error| error.context(path.display()))
    }

    /// Decodes a PNG, of an animated one the first picture; JPEG; OpenEXR with red, green and blue; or Radiance HDR.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let (decoded, is_linear) = decode(bytes)?;
        let is_transparent =
            decoded.color().has_alpha() && decoded.to_rgba32f().pixels().any(|pixel| pixel.0[3] != 1.0);
        let width = decoded.width() as usize;
        let height = decoded.height() as usize;
        Ok(Picture { width, height, rgb: decoded.into_rgb32f().into_raw(), is_linear, is_transparent })
    }

    /// Linear values, multiplied by 2^`exposure_ev` if they are stored so.
    pub fn linear(&self, exposure_ev: f32) -> Vec<f32> {
        let gain = exposure_ev.exp2();
        let of = |value: &f32| if self.is_linear { value * gain } else { linear_from_srgb(*value) };
        self.rgb.iter().map(of).collect()
    }

    /// sRGB from 0 to 1 as a screen shows it; linear values are multiplied by 2^`exposure_ev`, and NaN is black.
    pub fn shown(&self, exposure_ev: f32) -> Vec<f32> {
        let gain = exposure_ev.exp2();
        let of = |value: &f32| if self.is_linear { srgb_from_linear(value * gain) } else { *value };
        self.rgb.iter().map(of).collect()
    }
}

/// The pixels of a picture file in one of [`FORMATS`], and whether their values are linear.
pub(super) fn decode(bytes: &[u8]) -> Result<(DynamicImage, bool)> {
    let damaged = |error: image::ImageError| Error::Input(error.to_string().replace('\n', " "));
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.map_err(|error| Error::Input(error.to_string()))?;
    let format = reader.format().filter(|f| FORMATS.contains(f) && f.reading_enabled());
    let format = format.ok_or_else(|| Error::Input("expected a picture in PNG, JPEG, WebP, EXR or HDR".into()))?;
    let mut limits = Limits::default();
    // Twice the largest pixel, of four f32: the decoder may hold a copy.
    limits.max_alloc = Some(PIXEL_LIMIT * 32);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(damaged)?;
    check_size(decoder.dimensions())?;
    let decoded = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    Ok((decoded, matches!(format, ImageFormat::OpenExr | ImageFormat::Hdr)))
}

/// Refuses pictures of no pixels, or of more than [`PIXEL_LIMIT`].
pub(super) fn check_size((width, height): (u32, u32)) -> Result<()> {
    if !(1..=PIXEL_LIMIT).contains(&(u64::from(width) * u64::from(height))) {
        return Err(Error::Input(format!("{width} x {height} pixels are not within 1 to {PIXEL_LIMIT}")));
    }
    Ok(())
}
