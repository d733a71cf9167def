//! The scene without shadows, which is shown while they are computed.

use super::Editor;
use crate::asset::environment::EnvironmentData;
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::error::Result;
use crate::frame::{Frame, Options, RadiositySource, Viewport};
use crate::scene::EntityData;
use glam::Vec3;

/// Towards the light that shapes are seen by.
const TOWARD: Vec3 = Vec3::new(0.4, 0.8, 0.45);

/// A frame of the editor's scene that needs nothing baked, since nothing in it shines or casts a shadow. Vertices show
/// the entity's colour, the brighter the more they face one light; lights show their own.
pub(super) fn preview(baker: &Baker, cache: &Cache, editor: &Editor, options: Options) -> Result<Frame> {
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

/// The viewport of such a frame.
pub(super) fn viewport([width, height]: [u32; 2]) -> Viewport {
    Viewport {
        radiosity: RadiositySource::Comparison(0),
        adds_emission: false,
        by_vertex: true,
        ..Viewport::merged([0, 0, width, height])
    }
}
