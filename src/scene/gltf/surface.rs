//! Materials as surfaces that may be painted, reflect and glow.

use ::gltf::json::material::{AlphaMode, Material, NormalTexture};
use ::gltf::json::mesh::Semantic;
use ::gltf::json::texture::Info;
use ::gltf::json::validation::Checked;
use glam::{Vec2, Vec3};

use super::document::Document;
use super::notes::Notes;
use super::shape::Shape;
use super::texture::{Applied, Glow, Textures};
use crate::asset::environment::RADIANCE_LIMIT;
use crate::asset::mesh::Attributes;
use crate::asset::texture::{Texture, Wrap};
use crate::error::Result;
use crate::scene::Gloss;
use crate::scene::values::SLOPE_LIMIT;

/// Colours that differ by less than this share of the brightest are one.
const EVEN: f32 = 0.01;

/// A base colour that varies over a surface.
#[derive(Clone, Debug)]
pub struct Paint {
    /// Number of the image, if there is one.
    pub image: Option<usize>,
    pub texture: Texture,
}

/// A texture besides that of the base colour, which has the same coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Map {
    /// Number of the image.
    pub image: usize,
    pub wrap: [Wrap; 2],
}

impl Map {
    /// The map that a texture becomes, where a shape has coordinates and those of the texture are the same. The first
    /// one decides them.
    fn of(applied: &Applied, uvs: &mut Option<Vec<Vec2>>) -> Option<Self> {
        let own = applied.uvs.as_ref()?;
        (uvs.get_or_insert_with(|| own.clone()) == own).then_some(Map { image: applied.image, wrap: applied.wrap })
    }
}

/// What a primitive looks like.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Linear reflectance, 0 to 1, where no paint varies it.
    pub albedo: Vec3,
    pub paint: Option<Paint>,
    /// How it reflects besides; an unlit surface does not.
    pub gloss: Option<Gloss>,
    pub is_double_sided: bool,
    /// Whether an open shape that this covers has two sides in any case: it is cut out by a texture, as leaves are, or lets
    /// light through, as panes do.
    pub has_backs: bool,
    /// Share of light that does not pass; a texture may be another factor.
    pub opacity: f32,
    /// Its textures for that: gloss, normal and emission.
    pub maps: [Option<Map>; 3],
    /// Factor on the slope of normals, where it is not 1.
    pub normal_scale: Option<f32>,
    /// Linear radiance; candela per square metre are taken as W m^-2 sr^-1.
    pub emission: Vec3,
    /// Colours are a factor on the emission, where a texture varies it.
    pub attributes: Attributes,
}

impl Surface {
    /// Whether a texture cuts it out or lets light through it.
    pub fn has_alpha(&self) -> bool {
        let paint = self.paint.as_ref();
        paint.is_some_and(|paint| paint.texture.alpha_cutoff.is_some() || paint.texture.alpha_blend)
    }

    /// Whether it lets no light through and does not glow.
    pub fn is_solid(&self) -> bool {
        self.opacity == 1.0 && !self.has_alpha() && self.emission == Vec3::ZERO
    }

    /// Whether it glows in one colour.
    pub fn is_lamp(&self) -> bool {
        let is_even = self.attributes.colors.is_none() && self.maps[2].is_none();
        self.emission != Vec3::ZERO && is_even && self.opacity == 1.0 && !self.has_alpha()
    }

    /// The surface that a material gives a shape.
    pub fn new(
        document: &Document,
        material: Option<usize>,
        shape: &Shape,
        textures: &mut Textures,
        notes: &mut Notes,
    ) -> Result<Self> {
        let default = Material::default();
        let json = material.map_or(&default, |index| &document.root.materials[index]);
        let place = material.map_or("the default material".to_owned(), |index| format!("materials[{index}]"));
        let pbr = &json.pbr_metallic_roughness;
        let extensions = json.extensions.as_ref();
        let alpha_blend = matches!(json.alpha_mode, Checked::Valid(AlphaMode::Blend));
        let [r, g, b, mut alpha] = pbr.base_color_factor.0;
        let mut albedo = Vec3::new(r, g, b);
        let mut attributes = Attributes::default();
        if let Some(colors) = shape.attribute(document, &Semantic::Colors(0), &[3, 4])? {
            if alpha_blend {
                // An entity has one opacity.
                alpha *= colors.chunks_exact(4).map(|c| c[3]).sum::<f32>() / (colors.len() / 4) as f32;
            }
            let colors: Vec<Vec3> = colors.chunks_exact(4).map(Vec3::from_slice).collect();
            if is_even(&colors) {
                albedo *= colors[0];
            } else {
                attributes.tints = Some(colors.iter().map(|c| c.clamp(Vec3::ZERO, Vec3::ONE)).collect());
            }
        }
        if !(albedo.is_finite() && albedo.min_element() >= 0.0) {
            return Err(document.fail(place, "its base colour is negative or not finite"));
        }
        let metal = textures.applied(pbr.metallic_roughness_texture.as_ref(), shape, notes)?;
        let share_of_metal = metal.as_ref().map_or(1.0, |applied| applied.texels.mean_bytes()[2]);
        let transmission = extensions.and_then(|e| e.transmission.as_ref());
        let passes = transmission.and_then(|t| t.transmission_texture.as_ref());
        let passes = textures.applied(passes, shape, notes)?.map_or(1.0, |applied| applied.texels.mean_bytes()[0]);
        let passes = passes * transmission.map_or(0.0, |t| t.transmission_factor.0.clamp(0.0, 1.0));
        // A metal lets nothing through.
        let passes = passes * (1.0 - share_of_metal * pbr.metallic_factor.0.clamp(0.0, 1.0));
        let (kept, albedo) = kept_back(passes, albedo.min(Vec3::ONE));
        let opacity = if alpha_blend { alpha.clamp(0.0, 1.0) * kept } else { kept };
        let base = textures.applied(pbr.base_color_texture.as_ref(), shape, notes)?;
        // The factor's alpha is another factor of what is compared.
        let alpha_cutoff = matches!(json.alpha_mode, Checked::Valid(AlphaMode::Mask))
            .then(|| (json.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0) / alpha.max(1e-6)).clamp(0.0, 1.0));
        let shows_backs = opacity < 1.0 || base.is_some() && (alpha_blend || alpha_cutoff.is_some());
        let has_backs = json.double_sided && shows_backs;
        let paint = (base.is_some() || attributes.tints.is_some()).then(|| Paint {
            image: base.as_ref().map(|base| base.image),
            texture: Texture {
                texels: base.as_ref().map(|base| base.texels.clone()),
                wrap: base.as_ref().map_or_else(Default::default, |base| base.wrap),
                factor: albedo,
                alpha_cutoff,
                alpha_blend: alpha_blend && base.as_ref().is_some_and(|base| base.texels.has_alpha()),
            },
        });
        attributes.uvs = base.and_then(|base| base.uvs);
        let is_unlit = extensions.is_some_and(|e| e.unlit.is_some());
        let normal_scale = json.normal_texture.as_ref().map(|normal| normal.scale).filter(|scale| *scale != 1.0);
        if normal_scale.is_some_and(|scale| !(scale.abs() <= SLOPE_LIMIT)) {
            return Err(document.fail(place, "the scale of its normals is not within -100 to 100"));
        }
        let normal = json.normal_texture.as_ref().filter(|_| !is_unlit).map(info).transpose();
        let normal = normal.map_err(|error| document.fail(&place, format!("its normal texture: {error}")))?;
        let normal = textures.applied(normal.as_ref(), shape, notes)?;
        let light = textures.applied(json.emissive_texture.as_ref(), shape, notes)?;
        let mut map = |applied: Option<&Applied>| {
            let applied = applied.filter(|_| !is_unlit)?;
            let map = Map::of(applied, &mut attributes.uvs);
            if map.is_none() {
                notes.leave_out("textures with coordinates of their own (their means, or vertices, have their place)");
            }
            map
        };
        let mut maps = [map(metal.as_ref()), map(normal.as_ref()), map(light.as_ref())];
        let gloss = match metal.filter(|_| maps[0].is_none()) {
            _ if is_unlit => None,
            varies => Some(gloss(document, json, &place, varies.as_ref())?),
        };
        let mut emission = emission(document, json, &place)?;
        if emission == Vec3::ZERO {
            maps[2] = None;
        } else if let Some(applied) = light {
            match textures.glow(shape, &applied)? {
                Glow::Even(color) => emission *= color,
                Glow::Varied(colors) => attributes.colors = Some(colors),
            }
        }
        Ok(Surface {
            albedo,
            paint,
            gloss,
            is_double_sided: json.double_sided,
            has_backs,
            opacity,
            maps,
            normal_scale,
            emission,
            attributes,
        })
    }
}

/// A texture of normals as other textures are described: its extensions are left as they are written.
fn info(normal: &NormalTexture) -> serde_json::Result<Info> {
    let written = normal.extensions.as_ref().map(|extensions| extensions.others.clone());
    let extensions = written.map(|written| serde_json::from_value(written.into())).transpose()?;
    Ok(Info { index: normal.index, tex_coord: normal.tex_coord, extensions, extras: Default::default() })
}

/// The share of light that a material keeps back, and its base colour less what passes in place of being reflected.
fn kept_back(passes: f32, albedo: Vec3) -> (f32, Vec3) {
    let kept = 1.0 - passes * albedo.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    // An entity's opacity counts in what it reflects too.
    (kept, if kept > 0.0 { ((1.0 - passes) / kept * albedo).min(Vec3::ONE) } else { Vec3::ZERO })
}

/// Metallic-roughness reflection; a texture that is no map counts by its mean.
fn gloss(document: &Document, json: &Material, place: &str, texture: Option<&Applied>) -> Result<Gloss> {
    let extensions = json.extensions.as_ref();
    let pbr = &json.pbr_metallic_roughness;
    let mut roughness = pbr.roughness_factor.0;
    let mut metallic = pbr.metallic_factor.0;
    if let Some(applied) = texture {
        let [_, g, b] = applied.texels.mean_bytes();
        roughness *= g;
        metallic *= b;
    }
    let ior = f64::from(extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |ior| ior.ior.0));
    let specular = extensions.and_then(|e| e.specular.as_ref()).map_or(1.0, |specular| specular.specular_factor.0);
    // An index of 0 stands for infinity.
    let faced = if ior == 0.0 { 1.0 } else { (ior - 1.0) / (ior + 1.0) };
    let f0 = (f64::from(specular) * faced * faced) as f32;
    if ![roughness, metallic, f0].iter().all(|share| (0.0..=1.0).contains(share)) {
        return Err(document.fail(place, "its roughness, metal or specular reflection is not within 0 to 1"));
    }
    Ok(Gloss { roughness, metallic, f0 })
}

/// Whether all colours are the same, nearly.
fn is_even(colors: &[Vec3]) -> bool {
    let (low, high) = colors.iter().fold((Vec3::INFINITY, Vec3::ZERO), |(low, high), c| (low.min(*c), high.max(*c)));
    (high - low).max_element() <= EVEN * high.max_element()
}

/// Emission where no texture varies it.
fn emission(document: &Document, json: &Material, place: &str) -> Result<Vec3> {
    let strength = json.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |s| s.emissive_strength.0);
    let emission = Vec3::from(json.emissive_factor.0) * strength;
    if !emission.to_array().iter().all(|c| (0.0..=RADIANCE_LIMIT).contains(c)) {
        return Err(document.fail(place, "its emission is negative, not finite or beyond 1e15"));
    }
    Ok(emission)
}
