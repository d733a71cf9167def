//! Textures: pictures that colour a surface, by its texture coordinates.

#[cfg(feature = "decoders")]
use super::decode::check_size;
use super::decode::decode;
use super::mesh::{Mesh, twice_area_m2};
use super::picture::{linear_from_srgb, srgb_from_linear};
#[cfg(feature = "decoders")]
use crate::error::Error;
use crate::error::Result;
use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, LazyLock};

/// How a texture goes on beyond its edges, as in glTF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wrap {
    #[default]
    Repeat,
    Mirror,
    /// The texels of the edge.
    Clamp,
}

impl Wrap {
    /// The texel of a row of `count` that a whole number of texels from its start stands for.
    pub fn whole(self, at: i32, count: i32) -> i32 {
        match self {
            Wrap::Repeat => at.rem_euclid(count),
            Wrap::Clamp => at.clamp(0, count - 1),
            Wrap::Mirror => {
                let within = at.rem_euclid(2 * count);
                within.min(2 * count - 1 - within)
            }
        }
    }

    /// The texel of a row of `count` that a coordinate falls into.
    fn texel(self, at: f32, count: usize) -> usize {
        let within = match self {
            Wrap::Repeat => at - at.floor(),
            Wrap::Clamp => at.clamp(0.0, 1.0),
            Wrap::Mirror => 1.0 - (at.rem_euclid(2.0) - 1.0).abs(),
        };
        ((within * count as f32) as usize).min(count - 1)
    }
}

static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb(byte as f32 / 255.0)));

pub const KTX2: &[u8] = b"\xABKTX 20\xBB\r\n\x1A\n";

/// Texels of 8 bits, sRGB and alpha; rows from the top.
#[derive(Debug, PartialEq)]
pub struct Texels {
    pub width: usize,
    pub height: usize,
    pub rgba: Vec<[u8; 4]>,
}

impl Texels {
    /// Decodes a picture in PNG, JPEG, WebP, KTX2 (Basis Universal), OpenEXR or Radiance HDR; linear ones are cut off
    /// at 1.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        #[cfg(feature = "decoders")]
        if bytes.starts_with(KTX2) {
            return Self::transcode(bytes);
        }
        let (picture, is_linear) = decode(bytes)?;
        let rgba: Vec<[u8; 4]> = if is_linear {
            let encode = |linear: f32| (255.0 * srgb_from_linear(linear.clamp(0.0, 1.0))).round() as u8;
            let texel = |[r, g, b, a]: [f32; 4]| [encode(r), encode(g), encode(b), (255.0 * a).round() as u8];
            picture.to_rgba32f().pixels().map(|pixel| texel(pixel.0)).collect()
        } else {
            picture.to_rgba8().pixels().map(|pixel| pixel.0).collect()
        };
        Ok(Texels { width: picture.width() as usize, height: picture.height() as usize, rgba })
    }

    #[cfg(feature = "decoders")]
    fn transcode(bytes: &[u8]) -> Result<Self> {
        use basisu::{DecodeFlags, TargetFormat, Transcoder};
        let damaged = |error: basisu::Error| Error::Input(format!("not a KTX2 picture that is read: {error:?}"));
        // The transcoder trusts the lengths of keys and values, of which none is needed: their size stands at byte 60.
        let mut bytes = bytes.to_vec();
        bytes.get_mut(60..64).ok_or_else(|| Error::Input("a KTX2 picture that is cut off".into()))?.fill(0);
        let texture = Transcoder::new(&bytes).map_err(damaged)?;
        let (width, height) = texture.base_dimensions();
        check_size((width, height))?;
        // The transcoder trusts the unpacked size of the first level, which stands at byte 96.
        let unpacked = bytes.get(96..104).and_then(|size| size.try_into().ok()).map_or(0, u64::from_le_bytes);
        if unpacked > 16 * u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4)) {
            return Err(Error::Input(format!("{unpacked} bytes of KTX2 are no picture of {width} x {height} pixels")));
        }
        if !texture.supports(TargetFormat::Rgba32) {
            return Err(Error::Input("not a KTX2 picture that is read: its colours have no 8 bits".into()));
        }
        let bytes = texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(damaged)?;
        let width = width as usize;
        let height = height as usize;
        let rgba = bytes.as_chunks().0.to_vec();
        if rgba.len() != width * height {
            return Err(Error::Input(format!("{} texels are not {width} x {height}", rgba.len())));
        }
        Ok(Texels { width, height, rgba })
    }

    /// The texel at texture coordinates, v upwards.
    fn texel(&self, uv: Vec2, wrap: [Wrap; 2]) -> [u8; 4] {
        let [x, y] = [wrap[0].texel(uv.x, self.width), wrap[1].texel(1.0 - uv.y, self.height)];
        self.rgba[y * self.width + x]
    }

    pub fn at(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        linear(&self.texel(uv, wrap))
    }

    /// What is stored at texture coordinates, 0 to 1: of a picture that holds no colours.
    pub fn numbers_at(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        Vec4::from_array(self.texel(uv, wrap).map(|byte| f32::from(byte) / 255.0))
    }

    /// Whether any texel lets light through.
    pub fn has_alpha(&self) -> bool {
        self.rgba.iter().any(|texel| texel[3] < u8::MAX)
    }

    /// The mean colour of a triangle with corners of these coordinates.
    pub fn mean_between(&self, corners: [Vec2; 3], wrap: [Wrap; 2]) -> Vec3 {
        let cuts = self.cuts(corners);
        let color = |[a, b, c]: [f32; 3]| self.at(a * corners[0] + b * corners[1] + c * corners[2], wrap).truncate();
        middles(cuts).map(color).sum::<Vec3>() / (cuts * cuts) as f32
    }

    /// Into how many parts a side of a triangle with corners of these coordinates is cut for its mean: one for eight
    /// texels, at most 8.
    fn cuts(&self, corners: [Vec2; 3]) -> usize {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let sides = [0, 1, 2].map(|k| ((corners[k] - corners[(k + 1) % 3]) * size).length());
        (sides.into_iter().fold(0.0, f32::max) / 8.0).clamp(1.0, 8.0) as usize
    }

    pub fn mean(&self) -> Vec3 {
        let sum: DVec3 = self.rgba.iter().map(|texel| linear(texel).truncate().as_dvec3()).sum();
        (sum / self.rgba.len() as f64).as_vec3()
    }

    /// The means of red, green and blue as they are stored, 0 to 1: of a picture that holds no colours.
    pub fn mean_bytes(&self) -> [f32; 3] {
        let sum = |channel: usize| self.rgba.iter().map(|texel| u64::from(texel[channel])).sum::<u64>();
        [0, 1, 2].map(|channel| (sum(channel) as f64 / self.rgba.len() as f64 / 255.0) as f32)
    }

    /// The next level of detail of a picture that holds numbers: the mean of two by two texels.
    pub fn halved_numbers(&self) -> Texels {
        self.halved_by(|texels| {
            let sum = |channel: usize| texels.iter().map(|texel| u32::from(texel[channel])).sum::<u32>();
            std::array::from_fn(|channel| ((sum(channel) + 2) / 4) as u8)
        })
    }

    /// The next level of detail, half as wide and high: the mean of two by two texels, of linear colour by alpha.
    pub fn halved(&self) -> Texels {
        self.halved_by(|four| {
            let texels = four.map(|texel| linear(&texel));
            let alpha: f32 = texels.iter().map(|texel| texel.w).sum();
            // Texels that are not seen have a colour only where none is seen.
            let weight = |texel: &Vec4| if alpha > 0.0 { texel.w / alpha } else { 0.25 };
            let mean: Vec3 = texels.iter().map(|texel| weight(texel) * texel.truncate()).sum();
            let [r, g, b] = mean.to_array().map(|c| (255.0 * srgb_from_linear(c)).round() as u8);
            [r, g, b, (255.0 * alpha / 4.0).round() as u8]
        })
    }

    /// Half as wide and high, each texel from two by two.
    fn halved_by(&self, mean: impl Fn([[u8; 4]; 4]) -> [u8; 4] + Sync) -> Texels {
        let width = (self.width / 2).max(1);
        let height = (self.height / 2).max(1);
        let from = |i: usize, k: usize| {
            let x = (2 * (i % width) + k % 2).min(self.width - 1);
            let y = (2 * (i / width) + k / 2).min(self.height - 1);
            self.rgba[y * self.width + x]
        };
        let texel = |i: usize| mean([0, 1, 2, 3].map(|k| from(i, k)));
        Texels { width, height, rgba: (0..width * height).into_par_iter().map(texel).collect() }
    }
}

fn linear([r, g, b, a]: &[u8; 4]) -> Vec4 {
    Vec3::from_array([r, g, b].map(|byte| LINEAR[usize::from(*byte)])).extend(f32::from(*a) / 255.0)
}

/// The reflectance that varies over a surface: `factor`, times a texture, times the colours of the mesh's vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    pub texels: Option<Arc<Texels>>,
    pub wrap: [Wrap; 2],
    pub factor: Vec3,
    /// Places whose alpha is less are holes.
    pub alpha_cutoff: Option<f32>,
    /// Whether its alpha is the opacity of a place, in place of a cutoff.
    pub alpha_blend: bool,
}

impl Texture {
    /// The reflectance at a place of a triangle of a mesh. A texture without coordinates counts as white.
    pub fn at(&self, mesh: &Mesh, corners: [u32; 3], weights: [f32; 3]) -> Vec3 {
        let corners = corners.map(|v| v as usize);
        let color = self.texels.as_ref().zip(mesh.uvs.as_ref()).map_or(Vec3::ONE, |(texels, uvs)| {
            let uv: Vec2 = corners.iter().zip(weights).map(|(&v, weight)| weight * uvs[v]).sum();
            texels.at(uv, self.wrap).truncate()
        });
        let tint = mesh
            .tints
            .as_ref()
            .map_or(Vec3::ONE, |tints| corners.iter().zip(weights).map(|(&v, weight)| weight * tints[v]).sum());
        self.factor * color * tint
    }

    /// The share of light that a place of a triangle of a mesh keeps back.
    pub fn opacity_at(&self, mesh: &Mesh, corners: [u32; 3], weights: [f32; 3]) -> f32 {
        let varies = self.alpha_blend || self.alpha_cutoff.is_some();
        let Some((texels, uvs)) = self.texels.as_ref().zip(mesh.uvs.as_ref()).filter(|_| varies) else { return 1.0 };
        let uv: Vec2 = corners.iter().zip(weights).map(|(&v, weight)| weight * uvs[v as usize]).sum();
        let alpha = f32::from(texels.texel(uv, self.wrap)[3]) / 255.0;
        self.alpha_cutoff.map_or(alpha, |cutoff| if alpha < cutoff { 0.0 } else { 1.0 })
    }

    /// The mean share of light that a mesh's surface keeps back.
    pub fn mean_opacity(&self, mesh: &Mesh) -> f32 {
        if !self.alpha_blend && self.alpha_cutoff.is_none() {
            return 1.0;
        }
        self.mean_of(mesh, |corners, weights| Vec3::splat(self.opacity_at(mesh, corners, weights))).x.min(1.0)
    }

    pub fn mean(&self, mesh: &Mesh) -> Vec3 {
        let blended = |corners, weights| if self.alpha_blend { self.opacity_at(mesh, corners, weights) } else { 1.0 };
        let mean = self.mean_of(mesh, |corners, weights| blended(corners, weights) * self.at(mesh, corners, weights));
        match &self.texels {
            Some(texels) if mesh.uvs.is_none() => mean * texels.mean(),
            _ => mean,
        }
    }

    /// The mean over a mesh's surface of a value at places of its triangles.
    fn mean_of(&self, mesh: &Mesh, at: impl Fn([u32; 3], [f32; 3]) -> Vec3) -> Vec3 {
        let coordinates = self.texels.as_ref().zip(mesh.uvs.as_ref());
        let mut sum = DVec3::ZERO;
        let mut whole = 0.0;
        for triangle in &mesh.triangles {
            let area = twice_area_m2(&mesh.positions, triangle).length();
            let cuts = coordinates.map_or(1, |(texels, uvs)| texels.cuts(triangle.map(|v| uvs[v as usize])));
            let color: Vec3 = middles(cuts).map(|weights| at(*triangle, weights)).sum();
            sum += area * (color / (cuts * cuts) as f32).as_dvec3();
            whole += area;
        }
        (sum / whole.max(f64::MIN_POSITIVE)).as_vec3()
    }
}

/// Barycentric middles of the triangles into which lines cut a triangle, `cuts` to a side.
fn middles(cuts: usize) -> impl Iterator<Item = [f32; 3]> {
    let row = move |i: usize| {
        (0..cuts - i).flat_map(move |j| {
            let at = |shift: f32| {
                let a = (i as f32 + shift) / cuts as f32;
                let b = (j as f32 + shift) / cuts as f32;
                [a, b, 1.0 - a - b]
            };
            let upper = (j + 1 < cuts - i).then(|| at(2.0 / 3.0));
            std::iter::once(at(1.0 / 3.0)).chain(upper)
        })
    };
    (0..cuts).flat_map(row)
}

/// A square of one metre whose texture coordinates are its x and y.
#[cfg(test)]
pub(crate) fn square() -> Mesh {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
    let attributes = super::mesh::Attributes { uvs: Some(corners.to_vec()), ..Default::default() };
    let positions = corners.map(|corner| corner.extend(0.0)).to_vec();
    Mesh::with_attributes("square", positions, Vec::new(), attributes, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
}

/// A texture of so many white texels in both directions, with holes in the columns from `solid` on.
#[cfg(test)]
pub(crate) fn half_solid(size: usize, solid: usize) -> Texture {
    let rgba = (0..size * size).map(|i| [255, 255, 255, if i % size < solid { 255 } else { 0 }]).collect();
    let texels = Some(Arc::new(Texels { width: size, height: size, rgba }));
    Texture { texels, wrap: [Wrap::Repeat; 2], factor: Vec3::ONE, alpha_cutoff: Some(0.5), alpha_blend: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_half_white_texture_is_half_its_factor() {
        let rgba = (0..64 * 64).map(|i| if i % 64 < 32 { [255; 4] } else { [0, 0, 0, 255] }).collect();
        let texels = Some(Arc::new(Texels { width: 64, height: 64, rgba }));
        let factor = Vec3::new(1.0, 0.5, 0.0);
        let wrap = [Wrap::Repeat; 2];
        let mean = Texture { texels, wrap, factor, alpha_cutoff: None, alpha_blend: false }.mean(&square());
        assert!((mean - Vec3::new(0.5, 0.25, 0.0)).abs().max_element() < 0.01, "{mean}");
    }

    #[test]
    fn v_points_up() {
        // The upper row is white.
        let texels = Texels { width: 1, height: 2, rgba: vec![[255; 4], [0, 0, 0, 255]] };
        assert_eq!(texels.at(Vec2::new(0.5, 0.9), [Wrap::Repeat; 2]).x, 1.0);
        assert_eq!(texels.at(Vec2::new(0.5, 0.1), [Wrap::Repeat; 2]).x, 0.0);
        assert_eq!(texels.at(Vec2::new(0.5, 1.1), [Wrap::Repeat; 2]).x, 0.0);
        assert_eq!(texels.at(Vec2::new(0.5, 1.1), [Wrap::Clamp; 2]).x, 1.0);
        assert_eq!(texels.at(Vec2::new(0.5, 1.1), [Wrap::Mirror; 2]).x, 1.0);
    }

    #[test]
    fn halves_are_means_of_light_and_ignore_what_is_not_seen() {
        let texels = Texels { width: 2, height: 1, rgba: vec![[255; 4], [0, 0, 0, 255]] };
        assert_eq!(texels.halved().rgba, [[188, 188, 188, 255]]);
        let cut = Texels { width: 2, height: 1, rgba: vec![[255; 4], [0, 0, 0, 0]] };
        assert_eq!(cut.halved().rgba, [[255, 255, 255, 128]]);
    }
}
