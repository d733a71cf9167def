//! Materials as diffuse surfaces that may glow.

use ::gltf::json::material::{AlphaMode, Material};
use ::gltf::json::mesh::Semantic;
use ::gltf::json::validation::Checked;
use glam::{DVec3, Vec3};

use super::document::Document;
use super::notes::Notes;
use super::shape::Shape;
use super::texture::Textures;
use crate::asset::environment::RADIANCE_LIMIT;
use crate::error::Result;

/// Colours that differ by less than this share of the brightest are one.
const EVEN: f32 = 0.01;

/// What a primitive looks like.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Linear reflectance, 0 to 1: the mean over the surface.
    pub albedo: Vec3,
    /// Linear radiance; candela per square metre are taken as W m^-2 sr^-1.
    pub emission: Vec3,
    /// A factor on the emission for every vertex, where a texture varies it.
    pub colors: Option<Vec<Vec3>>,
}

impl Surface {
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
        let weights = shape.weights();
        let mean = |colors: &[Vec3]| {
            if colors.len() != weights.len() {
                return colors.first().map_or(DVec3::ONE, |color| color.as_dvec3());
            }
            let sum: DVec3 = colors.iter().zip(&weights).map(|(color, weight)| color.as_dvec3() * *weight).sum();
            sum / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE)
        };
        let [r, g, b, _] = json.pbr_metallic_roughness.base_color_factor.0;
        let mut albedo = DVec3::new(r.into(), g.into(), b.into());
        if let Some(info) = &json.pbr_metallic_roughness.base_color_texture
            && let Some(colors) = textures.at_vertices(info, shape, notes)?
        {
            albedo *= mean(&colors);
            notes.leave_out("base colour textures (their mean over the vertices is the albedo)");
        }
        if let Some(colors) = shape.attribute(document, &Semantic::Colors(0), &[3, 4], 3)? {
            let colors: Vec<Vec3> = colors.chunks_exact(3).map(Vec3::from_slice).collect();
            albedo *= mean(&colors);
            if !is_even(&colors) {
                notes.leave_out("colours of vertices (their mean is the albedo)");
            }
        }
        if !(albedo.is_finite() && albedo.min_element() >= 0.0) {
            return Err(document.fail(place, "its base colour is negative or not finite"));
        }
        let (emission, colors) = glow(document, json, &place, shape, textures, notes)?;
        Ok(Surface { albedo: albedo.min(DVec3::ONE).as_vec3(), emission, colors })
    }
}

/// Whether all colours are the same, nearly.
fn is_even(colors: &[Vec3]) -> bool {
    let (low, high) = colors.iter().fold((Vec3::INFINITY, Vec3::ZERO), |(low, high), c| (low.min(*c), high.max(*c)));
    (high - low).max_element() <= EVEN * high.max_element()
}

/// Emission, and the pattern that a texture gives it.
fn glow(
    document: &Document,
    json: &Material,
    place: &str,
    shape: &Shape,
    textures: &mut Textures,
    notes: &mut Notes,
) -> Result<(Vec3, Option<Vec<Vec3>>)> {
    let strength = json.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |s| s.emissive_strength.0);
    let mut emission = Vec3::from(json.emissive_factor.0) * strength;
    if !emission.to_array().iter().all(|c| (0.0..=RADIANCE_LIMIT).contains(c)) {
        return Err(document.fail(place, "its emission is negative, not finite or beyond 1e15"));
    }
    let Some(info) = json.emissive_texture.as_ref().filter(|_| emission != Vec3::ZERO) else {
        return Ok((emission, None));
    };
    let Some(colors) = textures.at_vertices(info, shape, notes)? else { return Ok((emission, None)) };
    notes.leave_out("emissive textures (vertices have their colours)");
    if colors.len() != shape.vertex_count() || is_even(&colors) {
        emission *= colors[0];
        return Ok((emission, None));
    }
    Ok((emission, Some(colors)))
}

/// Counts what no surface of this program has, once a material that is used.
pub fn note(json: &Material, notes: &mut Notes) {
    let transmits = json.extensions.as_ref().is_some_and(|e| e.transmission.is_some());
    if transmits || matches!(json.alpha_mode, Checked::Valid(AlphaMode::Blend | AlphaMode::Mask)) {
        notes.leave_out("transparent materials (they are opaque)");
    }
    let pbr = &json.pbr_metallic_roughness;
    // A file that says nothing means a metal; an unlit material shows its colour, whatever else it says.
    let is_unlit = json.extensions.as_ref().is_some_and(|e| e.unlit.is_some());
    if !is_unlit && (pbr.metallic_factor.0 > 0.0 || pbr.roughness_factor.0 < 1.0) {
        notes.leave_out("metallic or glossy materials (they are diffuse)");
    }
    let others =
        [json.normal_texture.is_some(), json.occlusion_texture.is_some(), pbr.metallic_roughness_texture.is_some()];
    let others = others.into_iter().filter(|used| *used).count();
    notes.leave_out_many("textures of normals, roughness, metal or occlusion", others);
}
