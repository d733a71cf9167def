//! What is shown of a scene while it is baked: first its shapes without shadows, then its light on surfaces as coarse as
//! they come, as it stands.

use super::Editor;
use crate::asset::environment::EnvironmentData;
use crate::bake::cache::Cache;
use crate::bake::{self, Baker};
use crate::error::Result;
use crate::frame::{Frame, Options, RadiositySource, Viewport};
use crate::scene::motion::RotationData;
use crate::scene::{EntityData, Placement, Scene};
use glam::Vec3;

/// Towards the light that shapes are seen by.
const TOWARD: Vec3 = Vec3::new(0.4, 0.8, 0.45);

/// A frame of the editor's scene that needs nothing baked, since nothing in it shines or casts a shadow. Vertices show
/// the entity's colour, the brighter the more they face one light; lights show their own.
pub(super) fn shapes(baker: &Baker, cache: &Cache, editor: &Editor, options: Options) -> Result<Frame> {
    let scene = editor.scene();
    let mut dark = scene.clone();
    for (index, data) in scene.data.entities.iter().enumerate() {
        let emits = Some(false);
        let occludes = Some(false);
        let emission = Vec3::ZERO;
        dark.put_entity(index, EntityData { emits, occludes, emission, ..data.clone() });
    }
    dark.set_environment(&EnvironmentData { strength: 0.0, ..scene.data.environment.clone() })?;
    let mut frame = Frame::new(baker, cache, &dark, options, &|_, _, _| ())?;
    let toward = TOWARD.normalize();
    let mut colors = Vec::new();
    for (index, placement) in editor.placements().iter().enumerate().take(dark.entities.len()) {
        let entity = &scene.entities[index];
        let color = |normal: &Vec3| {
            let cosine = (placement.rotation * *normal).dot(toward).max(0.0);
            let shown =
                if entity.emits { entity.emission } else { entity.albedo * (0.3 + 0.6 * cosine) * editor.white() };
            shown.to_array()
        };
        colors.push((index, frame.scene().surface(index).normals.iter().map(color).collect()));
    }
    frame.set_comparison(0, &colors, [0.0; 3])?;
    Ok(frame)
}

/// Options of a bake that leaves surfaces as coarse as they come.
pub(super) fn coarse(bake: bake::Options) -> bake::Options {
    bake::Options { vertices: 0, ..bake }
}

/// A scene as it stands: nothing that rests needs the fields of what never moves against it.
pub(super) fn still(scene: &Scene, placements: &[Placement]) -> Scene {
    let mut still = scene.clone();
    for (index, (data, placement)) in scene.data.entities.iter().zip(placements).enumerate() {
        let Placement { position, rotation, scale } = *placement;
        let rotation = RotationData::Quaternion(rotation.to_array());
        still.put_entity(index, EntityData { position, rotation, scale, motion: Vec::new(), ..data.clone() });
    }
    still.rejoin();
    still
}

/// A frame of the editor's scene as it stands, lit. Its coarse surfaces are in the cache.
pub(super) fn lit(baker: &Baker, cache: &Cache, editor: &Editor, options: Options) -> Result<Frame> {
    let placements = editor.placements();
    let scene = still(editor.scene(), &placements);
    let options = Options { bake: coarse(options.bake), ..options };
    let mut frame = Frame::new(baker, cache, &scene, options, &|_, _, _| ())?;
    frame.render(&placements, None)?;
    Ok(frame)
}

/// The viewport of a frame without shadows.
pub(super) fn viewport([width, height]: [u32; 2]) -> Viewport {
    Viewport {
        radiosity: RadiositySource::Comparison(0),
        adds_emission: false,
        by_vertex: true,
        ..Viewport::merged([0, 0, width, height])
    }
}
