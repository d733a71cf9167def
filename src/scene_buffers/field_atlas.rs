//! All fields of a scene in one buffer, and where each of them lies.

use super::ALIGNMENT;
use crate::bake::{self, BakedMesh};
use crate::error::Result;
use crate::field::quantity::Storage;
use crate::field::visibility_volume::VisibilityVolume;
use crate::field::{Area, FieldHeader, FieldKind, ShadowField};
use crate::gpu::{Buffer, BufferKind, Device};
use crate::scene::Scene;
use half::f16;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// The place of a field in the atlas, and what a merge has to know of the field.
#[derive(Clone)]
pub struct FieldSlot {
    pub header: FieldHeader,
    /// The bytes of the field in the atlas.
    pub bytes: Range<u64>,
    /// Whether it holds nothing but zeros.
    pub is_empty: bool,
    /// The area that its object covers from afar, if this is an occlusion field.
    pub area: Area,
}

impl FieldSlot {
    /// First quad of the field, as shaders count.
    pub fn quad(&self) -> u32 {
        (self.bytes.start / (4 * self.header.storage.bytes() as u64)) as u32
    }
}

/// The fields of a scene in one buffer.
pub(super) struct FieldAtlas {
    pub fields: Buffer,
    /// The places of each mesh's occlusion and radiance fields. Meshes that share a field share its place.
    pub slots: Vec<[Option<FieldSlot>; 2]>,
    /// Where the visibility volume begins, in units of [`ALIGNMENT`].
    pub volume_first: u32,
}

/// Puts the fields of a scene's meshes into one buffer, and its visibility volume after them.
pub(super) fn field_atlas(
    device: &Arc<Device>,
    scene: &Scene,
    baked: &[BakedMesh],
    volume: Option<&VisibilityVolume>,
    options: &bake::Options,
) -> Result<FieldAtlas> {
    let mut total = 0;
    let mut known = HashMap::<*const ShadowField, FieldSlot>::new();
    let mut distinct: Vec<(Arc<ShadowField>, u64)> = Vec::new();
    let mut slot = |field: &Arc<ShadowField>, name: &str| {
        let slot = known.entry(Arc::as_ptr(field)).or_insert_with(|| {
            let bytes = total..total + field.payload.len() as u64;
            total = bytes.end.next_multiple_of(ALIGNMENT);
            distinct.push((field.clone(), bytes.start));
            let is_occlusion = field.header.kind == FieldKind::Occlusion;
            let area = if is_occlusion { Area::new(field) } else { Area::default() };
            FieldSlot { header: field.header.clone(), bytes, is_empty: field.is_empty(), area }
        });
        FieldSlot { header: FieldHeader { mesh: name.to_owned(), ..slot.header.clone() }, ..slot.clone() }
    };
    let slots = scene.meshes.iter().zip(baked).map(|(mesh, baked)| {
        [&baked.blocked, &baked.radiance].map(|field| field.as_ref().map(|field| slot(field, &mesh.name)))
    });
    let slots = slots.collect();
    let volume_at = total;
    let payload = volume.map_or(Vec::new(), |volume| match options.storage {
        Storage::F32 => bytemuck::cast_slice(&volume.blocked).to_vec(),
        Storage::F16 => volume.blocked.iter().flat_map(|b| f16::from_f32(*b).to_le_bytes()).collect(),
    });
    let total = total + payload.len() as u64;
    let mut fields = Buffer::new(device, "fields", BufferKind::Device, total.max(ALIGNMENT))?;
    for (field, first) in distinct {
        fields.fill(first, &field.payload)?;
    }
    fields.fill(volume_at, &payload)?;
    Ok(FieldAtlas { fields, slots, volume_first: (volume_at / ALIGNMENT) as u32 })
}
