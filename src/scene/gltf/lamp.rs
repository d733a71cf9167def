//! Punctual lights as glowing balls, of which spots shine within a cone, and a directional light as a distant disc.
//!
//! A point has no size, so a lamp gets one, which is said: a hundredth of the scene's radius, at most a bulb's. Candela
//! are taken as W sr^-1 but for those of Blender ([`lumens_a_watt`]), and the ball's radiance is the intensity over its
//! mean outline, so that what is lit from afar does not depend on the radius.

use ::gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use ::gltf::json::validation::Checked;
use glam::{DMat3, DQuat, DVec3, Vec3};

use super::document::Document;
use super::notes::Notes;
use super::tree::Stand;
use crate::asset::disc::{SUN_DEG, Sun};
use crate::asset::environment::RADIANCE_LIMIT;
use crate::asset::{Generator, Mesh};
use crate::error::Result;
use crate::scene::data::{EntityData, MeshData};
use crate::scene::light::Spot;
use crate::scene::motion::{Motion, RotationData};

/// Radius of a lamp, as a share of the scene's, and the most in metres, that of a bulb: a larger ball would reach into the
/// shade around it.
const RADIUS_SHARE: f64 = 0.01;
const RADIUS_M: f64 = 0.03;
/// Cuts of the icosahedron that stands for a ball: 320 triangles.
const SUBDIVISIONS: u32 = 2;
/// What Blender takes a watt of its lamps for.
const BLENDER_LUMENS_A_WATT: f32 = 683.0;
pub const BALL: &str = "lamp";

/// What stands for the lights of a file that shine.
pub struct Lamps {
    /// The mesh of all lamps, if there are any.
    pub ball: Option<(MeshData, Mesh)>,
    pub entities: Vec<EntityData>,
    pub sun: Option<Sun>,
    /// About the radiance of a white surface in the middle of the scene, lit by all of them.
    pub radiance: f64,
}

impl Lamps {
    /// The lights that nodes hold, for a scene with that bounding sphere (metres).
    pub fn new(
        document: &Document,
        stands: &[Stand],
        (centre, scene_radius_m): (DVec3, f64),
        notes: &mut Notes,
    ) -> Result<Self> {
        let all = document.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let all = all.map_or(&[][..], |e| &e.lights);
        let lumens_a_watt = lumens_a_watt(document);
        let intensity = |light: &Light| Vec3::from(light.color) * light.intensity / lumens_a_watt;
        let mut lights = Vec::new();
        let mut sun = None;
        for stand in stands {
            let of = document.root.nodes[stand.node].extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
            let Some(index) = of.map(|e| e.light.value()) else { continue };
            let light = &all[index];
            let usable = |x: &f32| (0.0..=1e12).contains(x);
            if !usable(&light.intensity) || !light.color.iter().all(usable) {
                let place = format!("extensions.KHR_lights_punctual.lights[{index}]");
                return Err(document.fail(place, "its intensity or colour is negative, not finite or beyond 1e12"));
            }
            if light.range.is_some() {
                notes.leave_out("ranges of lights (their light reaches any distance)");
            }
            match light.type_ {
                _ if intensity(light) == Vec3::ZERO => {}
                Checked::Valid(Type::Directional) if sun.is_none() => {
                    sun = Some(distant(document, intensity(light), stand, notes)?)
                }
                Checked::Valid(Type::Directional) => notes.leave_out("further directional lights"),
                Checked::Invalid => notes.leave_out("lights of unknown types"),
                _ => lights.push((light, stand)),
            }
        }
        let irradiance = |(light, stand): &(&Light, &Stand)| {
            let distance_m = centre.distance(stand.rest.translation).max(0.3 * scene_radius_m);
            f64::from(intensity(light).max_element()) / distance_m.powi(2)
        };
        let of_sun = |sun: &Sun| f64::from(sun.radiance.max_element()) * disc_sr(sun.angle_deg);
        let irradiance = lights.iter().map(irradiance).sum::<f64>() + sun.as_ref().map_or(0.0, of_sun);
        if irradiance > 0.0 && lumens_a_watt != 1.0 {
            notes.say(format!(
                "Blender wrote its lamps as {lumens_a_watt} lumens a watt, and what else shines in watts: they are watts again"
            ));
        }
        let mut lamps = Lamps { ball: None, entities: Vec::new(), sun, radiance: irradiance / std::f64::consts::PI };
        if lights.is_empty() {
            return Ok(lamps);
        }
        let generator = Generator::Sphere { radius_m: 1.0, subdivisions: SUBDIVISIONS };
        let mesh = generator.build()?;
        let radius_m = (scene_radius_m * RADIUS_SHARE).clamp(1e-4, RADIUS_M);
        // A convex body's mean outline is its area over four.
        let outline_m2 = mesh.area_m2() / 4.0 * radius_m.powi(2);
        for (light, stand) in &lights {
            let emission = intensity(light) / outline_m2 as f32;
            if emission.max_element() > RADIANCE_LIMIT {
                return Err(document.fail(format!("nodes[{}]", stand.node), "its light is too bright for its size"));
            }
            let name = document.root.nodes[stand.node].name.clone().or_else(|| light.name.clone());
            let is_spot = matches!(light.type_, Checked::Valid(Type::Spot));
            let spot = light.spot.as_ref().filter(|_| is_spot).map(|spot| {
                let outer_deg = spot.outer_cone_angle.to_degrees().clamp(0.01, 90.0);
                Spot { inner_deg: spot.inner_cone_angle.to_degrees().clamp(0.0, outer_deg), outer_deg }
            });
            lamps.entities.push(EntityData { emission, name, spot, ..ball(stand, radius_m, spot.is_some()) });
        }
        lamps.ball = Some((MeshData::new(BALL, Some(generator)), mesh));
        notes.say(format!("point and spot lights ({}) are balls of radius {radius_m:.3} m", lights.len()));
        Ok(lamps)
    }
}

/// What a surface that faces a disc of that angular diameter gets, for a radiance of 1: pi sin^2 of half the diameter.
fn disc_sr(angle_deg: f32) -> f64 {
    std::f64::consts::PI * (f64::from(angle_deg).to_radians() / 2.0).sin().powi(2)
}

/// A directional light of that irradiance as a disc as wide as the sun.
fn distant(document: &Document, irradiance: Vec3, stand: &Stand, notes: &mut Notes) -> Result<Sun> {
    let place = || format!("nodes[{}]", stand.node);
    if !stand.motion.is_empty() {
        notes.leave_out("movements of directional lights (they shine as they do at rest)");
    }
    let toward = stand.rest.matrix3.z_axis.try_normalize();
    let toward =
        toward.ok_or_else(|| document.fail(place(), "it squeezes space flat, so its light has no direction"))?;
    let radiance = irradiance / disc_sr(SUN_DEG) as f32;
    if radiance.max_element() > RADIANCE_LIMIT {
        return Err(document.fail(place(), "its light is too bright for a disc as wide as the sun"));
    }
    notes.say(format!("the directional light is a distant disc, {SUN_DEG} degrees across"));
    Ok(Sun { toward: toward.as_vec3(), angle_deg: SUN_DEG, radiance })
}

/// A ball of that radius in metres where a light stands. A spot's own +y is the light's axis.
fn ball(stand: &Stand, radius_m: f64, is_spot: bool) -> EntityData {
    // Lights look along -z, whatever mirrors them.
    let linear = stand.fixed.matrix3;
    let z = linear.z_axis.try_normalize().unwrap_or(DVec3::Z);
    let y = (linear.y_axis - z * z.dot(linear.y_axis)).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
    let axes = if is_spot { DMat3::from_cols(y.cross(z), -z, y) } else { DMat3::from_cols(y.cross(z), y, z) };
    let rotation = DQuat::from_mat3(&axes).normalize();
    // Nor do they grow with the nodes that carry them.
    let size = |motion: &Motion| if let Motion::Node(node) = motion { f64::from(node.scale) } else { 1.0 };
    let carried: f64 = stand.motion.iter().map(size).product();
    EntityData {
        position: stand.fixed.translation.as_vec3(),
        rotation: RotationData::Quaternion(rotation.as_quat().to_array()),
        scale: ((radius_m / carried) as f32).clamp(1e-7, 1e7),
        receives: Some(false),
        motion: stand.motion.clone(),
        ..EntityData::of_mesh(BALL)
    }
}

/// What the file's candela and lux are of W sr^-1 and W m^-2. Blender's exporter turns the watts of its lamps into
/// lumens, and leaves the radiance of surfaces as it is; its importer turns lamps back.
fn lumens_a_watt(document: &Document) -> f32 {
    let generator = document.root.asset.generator.as_deref();
    let is_of_blender = generator.is_some_and(|name| name.contains("Blender I/O"));
    if is_of_blender { BLENDER_LUMENS_A_WATT } else { 1.0 }
}
