//! Equirectangular pictures of distant light, and their exact projection.

use std::f64::consts::{PI, TAU};
use std::io::Cursor;

use glam::{DMat3, DQuat, DVec3};
use image::{ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use super::disc::Disc;
use super::picture::linear_from_srgb;
use crate::error::{Error, Result};
use crate::sh::basis::{self, MAX_BANDS, MAX_COEFFICIENTS};
use crate::sh::quadrature::gauss_legendre;
use crate::sh::rotation::Rotation;

/// Largest width of an environment image; its height may be half of it: 1.6 GB as f32 RGB.
pub const WIDTH_LIMIT_PX: u32 = 16_384;
/// Largest amount of memory in bytes that decoding an image may take.
const DECODE_LIMIT_BYTES: u64 = 2 << 30;
/// The same for an image of no bytes, and for each of its bytes, so that a short file cannot claim a large picture:
/// deflate packs at most 1 032 bytes into one.
const DECODE_LIMIT_BY_SIZE: [u64; 2] = [64 << 20, 4096];
/// Nodes of the rule along a row's polar angle. SH times the sine are trigonometric polynomials of degree
/// [`MAX_BANDS`]: for the worst picture, one row from pole to pole, the rule's error is below 1e-9, and for two rows it
/// is below f64 precision.
const ROW_NODES: usize = 16;

/// Linear radiance of texels. Rows start at +y; columns start behind the viewer and run from left to right: see
/// [`super::environment::EnvironmentImage`].
#[derive(Debug)]
pub struct Equirect {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) texels: Vec<[f32; 3]>,
    /// Of a texel of each row, steradians.
    pub(super) solid_angles: Vec<f64>,
    /// The sun and the bright windows of the picture, which its texels and coefficients no longer hold: a spot of at
    /// most 8 degrees that sends at least a twentieth of all light, and up to three compact patches of up to 60 degrees
    /// that stand out.
    pub lights: Vec<Disc>,
    /// Of these, by texel, row by row, the radiance that was theirs.
    pub(super) taken: Vec<(usize, [f32; 3])>,
    /// Its projection to [`MAX_BANDS`] bands, one list per channel. It is exact for a radiance that is constant over each
    /// texel: texels are integrated, not sampled at their centres.
    pub coefficients: [Vec<f64>; 3],
}

/// Unit direction of a place on a picture, both from 0 to 1.
pub(super) fn direction(u: f64, v: f64) -> DVec3 {
    let azimuth = TAU * (u - 0.5);
    let polar = PI * v;
    DVec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos())
}

/// Longest edge of the tiles that an OpenEXR file claims, in pixels: the decoder makes room for a tile before it looks
/// at the picture's size.
fn widest_tile(bytes: &[u8]) -> Option<u32> {
    const NAME: &[u8] = b"tiles\0tiledesc\0";
    const HEADER_BYTES: usize = 1 << 16;
    let header = &bytes[..bytes.len().min(HEADER_BYTES)];
    let at = header.windows(NAME.len()).position(|window| window == NAME)? + NAME.len() + 4;
    let edges = header.get(at..at + 8)?;
    edges.as_chunks::<4>().0.iter().map(|edge| u32::from_le_bytes(*edge)).max()
}

impl Equirect {
    /// Decodes an HDR, OpenEXR or PNG file and projects it.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let fail = |what: String| Error::Input(format!("environment image: {what}"));
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| fail(e.to_string()))?;
        let format = reader.format();
        if !matches!(format, Some(ImageFormat::Hdr | ImageFormat::OpenExr | ImageFormat::Png)) {
            return Err(fail("not an HDR, EXR or PNG file".into()));
        }
        if widest_tile(bytes).is_some_and(|edge| edge > WIDTH_LIMIT_PX) {
            return Err(fail(format!("tiles of more than {WIDTH_LIMIT_PX} pixels along an edge")));
        }
        let mut limits = Limits::default();
        limits.max_image_width = Some(WIDTH_LIMIT_PX);
        limits.max_image_height = Some(WIDTH_LIMIT_PX / 2);
        let [least, a_byte] = DECODE_LIMIT_BY_SIZE;
        limits.max_alloc = Some((least + a_byte * bytes.len() as u64).min(DECODE_LIMIT_BYTES));
        reader.limits(limits);
        let decoded = reader.decode().map_err(|e| {
            let what = e.to_string().replace('\n', " ");
            fail(format!("{what} (limits: {WIDTH_LIMIT_PX} x {} pixels)", WIDTH_LIMIT_PX / 2))
        })?;
        let rgb = decoded.into_rgb32f();
        let linear = |c: f32| if format == Some(ImageFormat::Png) { linear_from_srgb(c) } else { c };
        let texels: Vec<[f32; 3]> = rgb.pixels().map(|p| p.0.map(linear)).collect();
        if texels.is_empty() || texels.iter().flatten().any(|c| !(c.is_finite() && *c >= 0.0)) {
            return Err(fail("no pixels, or a pixel that is negative or not finite".into()));
        }
        let width = rgb.width() as usize;
        let height = rgb.height() as usize;
        let solid_angle = |y: usize| {
            let [north, south] = [y, y + 1].map(|y| (y as f64 * PI / height as f64).cos());
            (north - south) * TAU / width as f64
        };
        let mut picture = Self {
            width,
            height,
            texels,
            solid_angles: (0..height).map(solid_angle).collect(),
            lights: Vec::new(),
            taken: Vec::new(),
            coefficients: Default::default(),
        };
        picture.take_out_lights();
        picture.coefficients = picture.project();
        Ok(picture)
    }

    /// The texel in `direction` (unit).
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let column = (0.5 + direction.x.atan2(-direction.z) / TAU) * self.width as f64;
        let row = direction.y.clamp(-1.0, 1.0).acos() / PI * self.height as f64;
        // The right edge and the south pole round onto the last texel; a negative index saturates to 0.
        let x = (column as usize).min(self.width - 1);
        let y = (row as usize).min(self.height - 1);
        DVec3::from_array(self.texels[y * self.width + x].map(f64::from))
    }

    /// With the polar axis along z, SH are A_lm(theta) times cos(m phi) or sin(|m| phi), so the integral over a texel
    /// is the integral along its row's polar angle times the integral along its column's azimuth. A rotation from +z to
    /// +y follows.
    fn project(&self) -> [Vec<f64>; 3] {
        // Column x spans the azimuth -TAU x / width to -TAU (x + 1) / width from +z, which stands for frame +x.
        let across: Vec<[[f64; 2]; MAX_BANDS]> = (0..self.width)
            .map(|x| {
                let middle = TAU * (x as f64 + 0.5) / self.width as f64;
                let half = PI / self.width as f64;
                std::array::from_fn(|m| {
                    let m = m as f64;
                    let length = if m == 0.0 { 2.0 * half } else { 2.0 * (m * half).sin() / m };
                    [length * (m * middle).cos(), -length * (m * middle).sin()]
                })
            })
            .collect();
        let rule = gauss_legendre(ROW_NODES);
        let row = |y: usize| {
            let mut sums = [[[0.0_f64; 2]; MAX_BANDS]; 3];
            for (texel, across) in self.texels[y * self.width..][..self.width].iter().zip(&across) {
                for (sums, &c) in sums.iter_mut().zip(texel) {
                    for (sum, weight) in sums.iter_mut().zip(across) {
                        sum[0] += f64::from(c) * weight[0];
                        sum[1] += f64::from(c) * weight[1];
                    }
                }
            }
            let mut along = [0.0; MAX_COEFFICIENTS];
            let mut values = [0.0; MAX_COEFFICIENTS];
            let half = PI / 2.0 / self.height as f64;
            for (node, weight) in &rule {
                let (sine, cosine) = (half * (2.0 * y as f64 + 1.0 + node)).sin_cos();
                basis::evaluate(MAX_BANDS, DVec3::new(sine, 0.0, cosine), &mut values);
                along.iter_mut().zip(&values).for_each(|(a, v)| *a += weight * half * sine * v);
            }
            sums.map(|sums| {
                let mut out = [0.0; MAX_COEFFICIENTS];
                for l in 0..MAX_BANDS {
                    for m in 0..=l {
                        let middle = l * (l + 1);
                        out[middle + m] = along[middle + m] * sums[m][0];
                        if m > 0 {
                            out[middle - m] = along[middle + m] * sums[m][1];
                        }
                    }
                }
                out
            })
        };
        // Rows are added in order, so the result does not depend on the number of threads.
        let rows: Vec<[[f64; MAX_COEFFICIENTS]; 3]> = (0..self.height).into_par_iter().map(row).collect();
        let stood_up = DQuat::from_mat3(&DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y));
        let turn = Rotation::new(MAX_BANDS, stood_up);
        std::array::from_fn(|channel| {
            let mut lying = vec![0.0; MAX_COEFFICIENTS];
            rows.iter().for_each(|row| lying.iter_mut().zip(row[channel]).for_each(|(sum, c)| *sum += c));
            let mut out = vec![0.0; MAX_COEFFICIENTS];
            turn.apply(&lying, &mut out);
            out
        })
    }
}
