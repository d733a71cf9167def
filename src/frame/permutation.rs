//! Permutations of a scene's passes: the options, restricted to features of the scene and limits of the device.

use super::{Options, light_maps};
use crate::field::silhouette::SilhouetteField;
use crate::gpu::{Buffer, Device, TexelView};
use crate::layout::{DeviceEntity, QUAD_FORMAT};
use crate::merge::variant::{MergePermutation, Variant};
use crate::scene::{LightMethod, Scene};
use crate::scene_buffers::SceneBuffers;
use crate::sharp::SharpPermutation;

/// The permutation with its variant less the texel views or uniform blocks that cannot hold the scene.
pub(super) fn usable(
    device: &Device,
    buffers: &SceneBuffers,
    entity_count: usize,
    permutation: MergePermutation,
) -> MergePermutation {
    let entity_room = entity_count.max(permutation.entity_limit as usize);
    let fits = TexelView::fits(device, permutation.field_format(), buffers.fields.size_bytes)
        && TexelView::fits(device, QUAD_FORMAT, buffers.transfers.size_bytes)
        && TexelView::fits(device, QUAD_FORMAT, buffers.vertices.size_bytes)
        && TexelView::fits(device, QUAD_FORMAT, (entity_room * size_of::<DeviceEntity>()) as u64);
    let variant = permutation.variant.restricted(fits, entity_count <= permutation.entity_limit as usize);
    if variant != permutation.variant {
        log::info!(
            "the scene is too large for the variant \"{}\"; using \"{}\"",
            permutation.variant.name,
            variant.name
        );
    }
    MergePermutation { variant, ..permutation }
}

/// The permutation of the pass of sharp lights beside that merge; `None` where no light is sharp.
pub(super) fn sharp(
    options: &Options,
    merge: &MergePermutation,
    methods: &[LightMethod],
    scene: &Scene,
    buffers: &SceneBuffers,
) -> Option<SharpPermutation> {
    let lit = scene.entities.iter().zip(methods).filter(|(entity, method)| entity.emits && method.is_sharp());
    let lights: Vec<&LightMethod> = lit.map(|(_, method)| method).collect();
    let any_field = |wanted: fn(&SilhouetteField) -> bool| {
        buffers.meshes.iter().any(|mesh| mesh.slots.silhouette.as_ref().is_some_and(|slot| wanted(&slot.content)))
    };
    let [sun_maps, lamp_maps] = light_maps::has_maps(scene, methods).map(|has| has && options.baked().groups);
    (!lights.is_empty()).then(|| SharpPermutation {
        reads: merge.variant.reads,
        entity_limit: merge.entity_limit,
        silhouette: options.bake.silhouette,
        outlines: lights.contains(&&LightMethod::Outline),
        panels: lights.iter().any(|method| matches!(method, LightMethod::LampFace(_))),
        colors: buffers.meshes.iter().any(|mesh| mesh.slots.lamp_colors.is_some()),
        halves: any_field(SilhouetteField::has_halves),
        boxes: any_field(SilhouetteField::has_box),
        sheets: merge.sheets,
        cuboids: (0..scene.entities.len()).any(|entity| scene.casts_as_box(entity) || scene.casts_as_boxes(entity)),
        globes: (0..scene.entities.len()).any(|entity| scene.is_globe(entity)),
        sun_maps,
        lamp_maps,
        gloss: merge.gloss,
        many_shown: merge.gloss && lights.len() > 4,
        self_shadows: buffers.has_self_shadows(),
        edges: false,
        lamps: false,
        rolled: false,
    })
}

/// The permutation of the shaders of pixels that evaluate sharp lights themselves, near the edges of shadows; `None`
/// where pixels interpolate what vertices evaluate. `sharp` is the permutation of the pass of sharp lights, where the
/// scene has any.
pub(super) fn pixel_shading(
    device: &Device,
    options: &Options,
    buffers: &SceneBuffers,
    soft: &Buffer,
    sharp: Option<SharpPermutation>,
) -> Option<SharpPermutation> {
    let [nodes, cells, _] = buffers.sharp();
    sharp.filter(|_| options.shades_pixels() && SharpPermutation::fits_views(device, [nodes, cells, soft]))
}

/// Whether any light of the scene meets the chains of the merge. The sky does in any case.
pub(super) fn harmonic_lights(scene: &Scene, methods: &[LightMethod]) -> bool {
    scene.entities.iter().zip(methods).any(|(entity, method)| entity.emits && !method.is_sharp())
}

/// What the merge of a scene is to be compiled for.
pub(super) fn permutation(
    options: &Options,
    variant: Variant,
    scene: &Scene,
    methods: &[LightMethod],
    entity_limit: u32,
) -> MergePermutation {
    MergePermutation {
        variant,
        bands: options.bake.bands,
        storage: options.bake.storage,
        lattice: options.bake.lattice,
        skip: options.skip,
        lights: harmonic_lights(scene, methods),
        sheets: (0..scene.meshes.len()).any(|mesh| scene.caster(mesh).rectangle().is_some()),
        volume: false,
        gloss: scene.entities.iter().any(|entity| entity.reflection().is_some()),
        entity_limit,
    }
}
