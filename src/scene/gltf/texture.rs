//! Textures as means over a surface: their texels where its vertices are.

use std::collections::HashMap;
use std::rc::Rc;

use ::gltf::json::mesh::Semantic;
use ::gltf::json::texture::{Info, WrappingMode};
use ::gltf::json::validation::Checked;
use glam::Vec3;

use super::document::Document;
use super::notes::Notes;
use super::shape::Shape;
use crate::asset::decode::Picture;
use crate::error::Result;

/// Largest width and height that is kept: larger textures are averaged down, since only vertices sample them.
const KEPT_PX: usize = 512;
/// Largest number of pixels of all textures.
const PIXEL_BUDGET: usize = 1 << 28;

/// The textures of a file that were needed so far.
pub struct Textures<'a> {
    document: &'a Document,
    images: HashMap<usize, Option<Rc<Texels>>>,
    pixels: usize,
}

/// Linear Rec.709 colours, rows from the top.
struct Texels {
    width: usize,
    height: usize,
    colors: Vec<Vec3>,
}

impl<'a> Textures<'a> {
    /// None so far.
    pub fn new(document: &'a Document) -> Self {
        Textures { document, images: HashMap::new(), pixels: 0 }
    }

    /// Colours of a texture at the vertices of a shape; one for all where the shape has no coordinates for it, the
    /// texture's mean. `None` where the picture has a format that is not read, which is noted.
    pub fn at_vertices(&mut self, info: &Info, shape: &Shape, notes: &mut Notes) -> Result<Option<Vec<Vec3>>> {
        let texture = &self.document.root.textures[info.index.value()];
        let Some(texels) = self.image(texture.source.value(), notes)? else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        let Some(places) = shape.attribute(self.document, &Semantic::TexCoords(set), &[2], 2)? else {
            let mean = texels.colors.iter().map(|c| c.as_dvec3()).sum::<glam::DVec3>() / texels.colors.len() as f64;
            return Ok(Some(vec![mean.as_vec3()]));
        };
        let sampler = texture.sampler.and_then(|index| self.document.root.samplers.get(index.value()));
        let wrap = sampler.map_or([WrappingMode::Repeat; 2], |s| {
            [&s.wrap_s, &s.wrap_t]
                .map(|mode| if let Checked::Valid(mode) = mode { *mode } else { WrappingMode::Repeat })
        });
        let color = |uv: &[f32]| {
            let [mut u, mut v] = [uv[0], uv[1]].map(f64::from);
            if let Some(t) = transform {
                let (sin, cos) = f64::from(t.rotation.0).sin_cos();
                [u, v] = [u * f64::from(t.scale.0[0]), v * f64::from(t.scale.0[1])];
                // The rotation is counter-clockwise as seen, with v down.
                [u, v] = [cos * u + sin * v + f64::from(t.offset.0[0]), cos * v - sin * u + f64::from(t.offset.0[1])];
            }
            texels.color([u, v], wrap)
        };
        Ok(Some(places.chunks_exact(2).map(color).collect()))
    }

    fn image(&mut self, index: usize, notes: &mut Notes) -> Result<Option<Rc<Texels>>> {
        if let Some(known) = self.images.get(&index) {
            return Ok(known.clone());
        }
        let decoded = self.decode(index)?.map(Rc::new);
        if decoded.is_none() {
            notes.leave_out("textures that are neither PNG nor JPEG (their factors alone count)");
        }
        self.images.insert(index, decoded.clone());
        Ok(decoded)
    }

    fn decode(&mut self, index: usize) -> Result<Option<Texels>> {
        let Some(image) = self.document.root.images.get(index) else { return Ok(None) };
        let place = format!("images[{index}]");
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => self.document.linked(uri, &format!("{place}.uri"))?,
            (None, Some(view)) => self.document.view(view.value())?.0.to_vec(),
            (None, None) => return Err(self.document.fail(place, "there is neither a uri nor a bufferView")),
        };
        if ![&b"\x89PNG"[..], b"\xff\xd8\xff"].iter().any(|magic| bytes.starts_with(magic)) {
            return Ok(None);
        }
        let picture = Picture::decode(&bytes).map_err(|error| self.document.fail(&place, error))?;
        self.pixels += picture.width * picture.height;
        if self.pixels > PIXEL_BUDGET {
            return Err(self.document.fail(place, format!("the textures have over {PIXEL_BUDGET} pixels in all")));
        }
        Ok(Some(Texels::new(&picture)))
    }
}

impl Texels {
    /// The picture, averaged over squares where it is larger than [`KEPT_PX`].
    fn new(picture: &Picture) -> Self {
        let square = picture.width.max(picture.height).div_ceil(KEPT_PX);
        let width = picture.width.div_ceil(square);
        let height = picture.height.div_ceil(square);
        let linear = picture.linear(0.0);
        let color = |i: usize| {
            let left = i % width * square;
            let top = i / width * square;
            let right = (left + square).min(picture.width);
            let bottom = (top + square).min(picture.height);
            let rows = (top..bottom).flat_map(|y| (left..right).map(move |x| y * picture.width + x));
            let sum: Vec3 = rows.map(|pixel| Vec3::from_slice(&linear[3 * pixel..])).sum();
            sum / ((right - left) * (bottom - top)) as f32
        };
        Texels { width, height, colors: (0..width * height).map(color).collect() }
    }

    /// The texel that a coordinate falls into.
    fn color(&self, uv: [f64; 2], wrap: [WrappingMode; 2]) -> Vec3 {
        let place = |at: f64, wrap: WrappingMode, count: usize| {
            let within = match wrap {
                WrappingMode::Repeat => at.rem_euclid(1.0),
                WrappingMode::ClampToEdge => at.clamp(0.0, 1.0),
                WrappingMode::MirroredRepeat => 1.0 - (at.rem_euclid(2.0) - 1.0).abs(),
            };
            ((within * count as f64) as usize).min(count - 1)
        };
        let [x, y] = [place(uv[0], wrap[0], self.width), place(uv[1], wrap[1], self.height)];
        self.colors[y * self.width + x]
    }
}
