//! Small scenes on the shared device: what the tests of merge and draw have in common.

#![allow(dead_code)] // every test binary uses its own part

use super::common::{parse, relative_rms};
use glam::{EulerRot, Quat, Vec3};
use shadow_fields::asset::texture::{Texels, Texture, Wrap};
use shadow_fields::frame;
use shadow_fields::scene::{EntityData, Placement, Scene};
use shadow_fields::truth::{Estimate, Vertex};
use std::sync::Arc;

/// Few samples of few texels in f32: quick, and all that a comparison with a twin needs. The variant is pinned.
pub fn small() -> frame::Options {
    shadow_fields::check::merge::options()
}

/// A scene from the text of its meshes, entities and sky; a camera is added.
pub fn scene(text: &str) -> Scene {
    parse(&format!("{text}\n[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n"))
}

/// An object upright at a place in its own size.
pub fn at(x: f32, y: f32, z: f32) -> Placement {
    Placement { position: Vec3::new(x, y, z), rotation: Quat::IDENTITY, scale: 1.0 }
}

/// A thing that stands somewhere.
pub fn stands(mesh: &str, position: [f32; 3]) -> EntityData {
    EntityData { position: position.into(), ..EntityData::of_mesh(mesh) }
}

/// A lamp of that radiance.
pub fn shines(mesh: &str, position: [f32; 3], radiance: f32) -> EntityData {
    EntityData { emission: Vec3::splat(radiance), ..stands(mesh, position) }
}

/// A square texture of that many texels along a side, with holes where their alpha is below a half.
pub fn holed(side: usize, rgba: Vec<[u8; 4]>) -> Texture {
    let texels = Some(Arc::new(Texels { width: side, height: side, rgba }));
    Texture { texels, wrap: [Wrap::Clamp; 2], factor: Vec3::ONE, alpha_cutoff: Some(0.5), alpha_blend: false }
}

/// The same a little further on, by at most `reach_m` level and a fifth of that upwards, and turned.
pub fn jostled(place: &Placement, rng: &mut fastrand::Rng, reach_m: f32) -> Placement {
    let mut step = || (rng.f32() - 0.5) * 2.0 * reach_m;
    let position = place.position + Vec3::new(step(), 0.2 * step(), step());
    let rotation = (Quat::from_euler(EulerRot::XYZ, step(), step(), step()) * place.rotation).normalize();
    Placement { position, rotation, scale: place.scale }
}

/// Largest of all differences, and the largest magnitude of `b`.
pub fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> (f32, f32) {
    assert_eq!(a.len(), b.len(), "vertices");
    let pairs = || a.iter().flatten().zip(b.iter().flatten());
    assert!(pairs().all(|(a, b)| a.is_finite() && b.is_finite()), "a radiosity is not finite");
    (pairs().fold(0.0, |m, (a, b)| m.max((a - b).abs())), pairs().fold(0.0, |m, (_, b)| m.max(b.abs())))
}

/// Relative root mean square error of the light on vertices, of every entity in turn, against what rays bring there.
pub fn against_rays(light: &[Vec<[f32; 3]>], vertices: &[Vertex], rays: &[Estimate]) -> f64 {
    let found = vertices.iter().flat_map(|vertex| light[vertex.entity][vertex.index]).map(f64::from);
    relative_rms(found.zip(rays.iter().flat_map(|truth| truth.radiosity)))
}
