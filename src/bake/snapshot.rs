//! Captured faces as pictures, for `inspect` and its contact sheets.

use super::capture::{Capture, Model, NO_SLOT, Way};
use crate::asset::mesh::Mesh;
use crate::error::Result;
use crate::field::FieldKind;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device};
use crate::shaders::Library;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Captures six faces from every eye (in r) and brings them to the host as RGB triples: faces +X -X +Y -Y +Z -Z, each
/// in rows of `face_px`. Occlusion captures are white where nothing is hit.
pub fn snapshot(
    device: &Arc<Device>,
    library: &Library,
    mesh: &Mesh,
    eyes: &[DVec3],
    face_px: u32,
    kind: FieldKind,
) -> Result<Vec<Vec<f32>>> {
    let radiance = kind == FieldKind::Radiance;
    let model = Model::new(device, mesh, kind)?;
    let capture = Capture::new(device, library, model, face_px, kind, Way::usual(device))?;
    let eyes: Vec<Vec3> = eyes.iter().map(|eye| eye.as_vec3()).collect();
    let texel_bytes = if radiance { 16 } else { 1 };
    let edge = (capture.columns * face_px) as usize;
    let bytes = (edge * edge * texel_bytes) as u64;
    let download = Buffer::new(device, "captured faces", BufferKind::Readback, bytes)?;
    let mut out = Vec::new();
    for batch in capture.plan(&eyes) {
        let drawn = capture.choose(&eyes[out.len()..][..batch.len()], &batch)?;
        let mut commands = Commands::new(device, "snapshot")?;
        capture.record(&mut commands, &drawn, Access::TransferRead)?;
        commands.copy_image(&capture.atlas, &download);
        commands.barrier(Access::TransferWrite, Access::HostRead);
        commands.submit()?;
        let atlas: Vec<u8> = download.read(0, bytes as usize);
        let texel = |slot: u32, x: usize, y: usize| -> [f32; 3] {
            if slot == NO_SLOT {
                return [if radiance { 0.0 } else { 1.0 }; 3];
            }
            let column = (slot % capture.columns) as usize;
            let row = (slot / capture.columns) as usize;
            let at = ((row * face_px as usize + y) * edge + column * face_px as usize + x) * texel_bytes;
            if radiance {
                let float = |k: usize| f32::from_le_bytes(atlas[at + 4 * k..at + 4 * k + 4].try_into().expect("four"));
                [float(0), float(1), float(2)]
            } else {
                [f32::from(atlas[at]) / 255.0; 3]
            }
        };
        for slots in &batch {
            let px = face_px as usize;
            let faces = slots.iter().flat_map(|&slot| (0..px * px).flat_map(move |i| texel(slot, i % px, i / px)));
            out.push(faces.collect());
        }
    }
    Ok(out)
}
