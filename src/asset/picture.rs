//! Writes pictures: PNG with the exact sRGB curve, animated PNG, and linear OpenEXR.
//!
//! Rows run from the top, pixels from the left, three channels each. A file appears under its name only once it is
//! complete: it is written beside it and renamed.

use std::io::Write;
use std::path::Path;

use image::ImageEncoder as _;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::files;

/// Linear Rec.709 channel to sRGB (IEC 61966-2-1), both 0 to 1. Values outside are clamped; NaN gives 0.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let x = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// sRGB channel to linear Rec.709, both 0 to 1: the inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// 8-bit sRGB of linear RGB after multiplication by 2^exposure_ev, clamped, rounded to nearest.
pub fn encode_srgb(linear_rgb: &[f32], exposure_ev: f32) -> Vec<u8> {
    let gain = exposure_ev.exp2();
    linear_rgb.par_iter().map(|c| (srgb_from_linear(c * gain) * 255.0).round() as u8).collect()
}

/// Writes linear RGB as 8-bit sRGB PNG; a text chunk `Exposure` states the exposure in stops.
pub fn write_png(path: &Path, width: u32, height: u32, linear_rgb: &[f32], exposure_ev: f32) -> Result<()> {
    check_size(path, width, height, linear_rgb.len())?;
    let pixels = encode_srgb(linear_rgb, exposure_ev);
    write_whole(path, |file| {
        let mut encoder = rgb8_encoder(file, width, height);
        encoder.add_text_chunk("Exposure".into(), format!("{exposure_ev} EV"))?;
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&pixels)?;
        Ok(writer.finish()?)
    })
}

/// Writes 8-bit sRGB frames (see [`encode_srgb`]) as an endlessly repeating animated PNG with `fps` frames per second.
/// Frames are requested one by one, and only their compressed form is kept until the file is written.
pub fn write_apng(
    path: &Path,
    width: u32,
    height: u32,
    frames: impl ExactSizeIterator<Item = Result<Vec<u8>>>,
    fps: u16,
) -> Result<()> {
    if frames.len() == 0 || fps == 0 {
        return Err(Error::Usage(format!("{}: an animation needs frames and a rate above 0", path.display())));
    }
    let fail = |e: png::EncodingError| Error::Failed(format!("{}: cannot be written: {e}", path.display()));
    let mut bytes = Vec::new();
    let mut encoder = rgb8_encoder(&mut bytes, width, height);
    encoder.set_animated(frames.len() as u32, 0).map_err(fail)?;
    encoder.set_frame_delay(1, fps).map_err(fail)?;
    let mut writer = encoder.write_header().map_err(fail)?;
    for frame in frames {
        let frame = frame?;
        check_size(path, width, height, frame.len())?;
        writer.write_image_data(&frame).map_err(fail)?;
    }
    writer.finish().map_err(fail)?;
    write_whole(path, |file| Ok(file.write_all(&bytes)?))
}

/// Writes linear RGB as OpenEXR with 32-bit floats, without any rounding.
pub fn write_exr(path: &Path, width: u32, height: u32, linear_rgb: &[f32]) -> Result<()> {
    check_size(path, width, height, linear_rgb.len())?;
    // The encoder seeks, so the file is made in memory.
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::codecs::openexr::OpenExrEncoder::new(&mut bytes)
        .write_image(bytemuck::cast_slice(linear_rgb), width, height, image::ExtendedColorType::Rgb32F)
        .map_err(|e| Error::Failed(format!("{}: {e}", path.display())))?;
    write_whole(path, |file| Ok(file.write_all(bytes.get_ref())?))
}

fn rgb8_encoder<'a, W: Write>(file: W, width: u32, height: u32) -> png::Encoder<'a, W> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    // The default makes files a quarter smaller and takes longer than a frame does: 60 ms for 1280x720 pixels.
    encoder.set_compression(png::Compression::Fast);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    encoder
}

/// Three channels for each pixel.
fn check_size(path: &Path, width: u32, height: u32, channel_count: usize) -> Result<()> {
    if channel_count as u128 != 3 * u128::from(width) * u128::from(height) {
        let what = format!("{channel_count} numbers are no picture of {width} x {height} pixels of three");
        return Err(Error::input(path, what));
    }
    Ok(())
}

/// Errors of encoders and of the file system alike.
type WriteResult = std::result::Result<(), Box<dyn std::error::Error>>;

/// Writes a file in its folder under another name and renames it, so that it is never seen half-written. If the path is
/// not a regular file (a pipe, `/dev/stdout`), it is written to directly.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> WriteResult) -> Result<()> {
    files::replace_with(path, write).map_err(|e| Error::Failed(format!("{}: cannot be written: {e}", path.display())))
}
