//! Textures: their pictures, and the places of a shape's vertices in them.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use ::gltf::json::mesh::Semantic;
use ::gltf::json::texture::{Info, Texture as JsonTexture, WrappingMode};
use ::gltf::json::validation::Checked;
use glam::{DMat3, Vec2, Vec3};

use super::document::Document;
use super::notes::Notes;
use super::shape::Shape;
use crate::asset::mesh::Attributes;
use crate::asset::texture::{KTX2, Texels, Texture, Wrap};
use crate::error::Result;

/// Largest width and height of a texture that vertices alone sample: larger ones are averaged down.
const SAMPLED_PX: usize = 512;
/// Largest number of pixels of all textures.
const PIXEL_BUDGET: usize = 1 << 28;

/// The textures of a file that were needed so far.
pub struct Textures {
    document: Rc<Document>,
    images: HashMap<usize, Option<Arc<Texels>>>,
    /// Of images that were asked for at most [`SAMPLED_PX`] wide and high.
    sampled: HashMap<usize, Arc<Texels>>,
    pixels: usize,
}

/// A material's texture on a shape.
pub struct Applied {
    pub image: usize,
    pub texels: Arc<Texels>,
    pub wrap: [Wrap; 2],
    /// Coordinates of the shape's vertices, v upwards, if it has any.
    pub uvs: Option<Vec<Vec2>>,
}

/// The light of a texture on a shape.
pub enum Glow {
    Even(Vec3),
    /// A colour for each vertex: the mean of the triangles around it, which keeps the light of large ones.
    Varied(Vec<Vec3>),
}

impl Textures {
    pub fn new(document: &Rc<Document>) -> Self {
        Textures { document: document.clone(), images: HashMap::new(), sampled: HashMap::new(), pixels: 0 }
    }

    /// A texture on a shape, if there is one and its picture has a format that is read; others are noted.
    pub fn applied(&mut self, info: Option<&Info>, shape: &Shape, notes: &mut Notes) -> Result<Option<Applied>> {
        let Some(info) = info else { return Ok(None) };
        let document = self.document.clone();
        let texture = &document.root.textures[info.index.value()];
        let image = source(texture);
        let Some(texels) = self.texels(image)? else {
            notes.leave_out("textures in formats that are not read (their factors alone count)");
            return Ok(None);
        };
        let sampler = texture.sampler.and_then(|index| document.root.samplers.get(index.value()));
        let wrap = sampler.map_or([Wrap::Repeat; 2], |s| {
            [&s.wrap_s, &s.wrap_t].map(|mode| match mode {
                Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
                Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
                _ => Wrap::Repeat,
            })
        });
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        let places = shape.attribute(&document, &Semantic::TexCoords(set), &[2])?;
        let place = |uv: &[f32]| {
            let [mut u, mut v] = [uv[0], uv[1]].map(f64::from);
            if let Some(t) = transform {
                let (sin, cos) = f64::from(t.rotation.0).sin_cos();
                [u, v] = [u * f64::from(t.scale.0[0]), v * f64::from(t.scale.0[1])];
                // The rotation is counter-clockwise as seen, with v down.
                [u, v] = [cos * u + sin * v + f64::from(t.offset.0[0]), cos * v - sin * u + f64::from(t.offset.0[1])];
            }
            Vec2::new(u as f32, (1.0 - v) as f32)
        };
        let uvs = places.map(|places| places.chunks_exact(2).map(place).collect());
        Ok(Some(Applied { image, texels, wrap, uvs }))
    }

    /// The light of a texture on a shape. A flat shape is one lamp, as a screen is, of the mean of what it shows.
    pub fn glow(&mut self, shape: &Shape, applied: &Applied) -> Result<Glow> {
        let texels = self.sampled(applied);
        let Some(uvs) = &applied.uvs else { return Ok(Glow::Even(texels.mean())) };
        let attributes = Attributes { uvs: applied.uvs.clone(), ..Default::default() };
        let mesh = shape.mesh(&self.document, "", DMat3::IDENTITY, attributes, |_| true)?;
        if mesh.is_flat() {
            let wrap = applied.wrap;
            let texels = Some(texels);
            let texture = Texture { texels, wrap, factor: Vec3::ONE, alpha_cutoff: None, alpha_blend: false };
            return Ok(Glow::Even(texture.mean(&mesh)));
        }
        let mean = |corners| texels.mean_between(corners, applied.wrap);
        Ok(Glow::Varied(shape.vertex_means(uvs, mean)))
    }

    fn sampled(&mut self, applied: &Applied) -> Arc<Texels> {
        let halve = || {
            let mut texels = applied.texels.clone();
            while texels.width.max(texels.height) > SAMPLED_PX {
                texels = Arc::new(texels.halved());
            }
            texels
        };
        self.sampled.entry(applied.image).or_insert_with(halve).clone()
    }

    /// The texels of an image; `None` where its format is not read.
    pub fn texels(&mut self, index: usize) -> Result<Option<Arc<Texels>>> {
        if let Some(known) = self.images.get(&index) {
            return Ok(known.clone());
        }
        let texels = self.decode(index)?.map(Arc::new);
        self.images.insert(index, texels.clone());
        Ok(texels)
    }

    fn decode(&mut self, index: usize) -> Result<Option<Texels>> {
        let document = &self.document;
        let Some(image) = document.root.images.get(index) else { return Ok(None) };
        let place = format!("images[{index}]");
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => document.linked(uri, &format!("{place}.uri"))?,
            (None, Some(view)) => document.view(view.value())?.0.to_vec(),
            (None, None) => return Err(document.fail(place, "there is neither a uri nor a bufferView")),
        };
        if !is_read(&bytes) {
            return Ok(None);
        }
        let texels = Texels::decode(&bytes).map_err(|error| document.fail(&place, error))?;
        self.pixels += texels.width * texels.height;
        if self.pixels > PIXEL_BUDGET {
            return Err(document.fail(place, format!("the textures have over {PIXEL_BUDGET} pixels in all")));
        }
        Ok(Some(texels))
    }
}

/// The image of a texture: that of an extension, where it is read.
fn source(texture: &JsonTexture) -> usize {
    let named = |name: &str| {
        let extension = texture.extensions.as_ref()?.others.get(name)?;
        usize::try_from(extension.get("source")?.as_u64()?).ok()
    };
    let decoded = ["KHR_texture_basisu", "EXT_texture_webp"].into_iter().find_map(named);
    decoded.filter(|_| cfg!(feature = "decoders")).unwrap_or_else(|| texture.source.value())
}

/// Whether the first bytes of a picture are those of a format that is read.
fn is_read(bytes: &[u8]) -> bool {
    let is_webp = || bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    let compressed = || bytes.starts_with(KTX2) || is_webp();
    bytes.starts_with(b"\x89PNG") || bytes.starts_with(b"\xff\xd8\xff") || cfg!(feature = "decoders") && compressed()
}
