//! All silhouette fields of a scene in two buffers, and where each begins.

use super::ALIGNMENT;
use crate::bake::BakedMesh;
use crate::error::Result;
use crate::field::silhouette::SilhouetteField;
use crate::gpu::{Buffer, Device};
use crate::layout::HAS_HALVES;
use std::collections::HashMap;
use std::sync::Arc;

/// The silhouette fields of a scene. Where it has none, the buffers hold a little of nothing.
pub struct Silhouettes {
    /// Two quads a field and three a node, see `glsl/silhouette_field.glsl`.
    pub nodes: Buffer,
    /// Two words a cell.
    pub cells: Buffer,
}

/// The silhouette field of a mesh.
#[derive(Clone)]
pub struct SilhouetteSlot {
    /// Its first quad, and bit 31 where it has maps of halves.
    pub first_quad: u32,
    pub field: Arc<SilhouetteField>,
}

impl Silhouettes {
    /// Uploads the fields of a scene's meshes, and returns each mesh's place. Meshes that share a field share its
    /// place.
    pub fn new(device: &Arc<Device>, baked: &[BakedMesh]) -> Result<(Self, Vec<Option<SilhouetteSlot>>)> {
        let mut nodes = Vec::<[f32; 4]>::new();
        let mut cells = Vec::<[u32; 2]>::new();
        let mut known = HashMap::<*const SilhouetteField, u32>::new();
        let mut slot = |field: &Arc<SilhouetteField>| {
            let first_quad = *known.entry(Arc::as_ptr(field)).or_insert_with(|| {
                let first = nodes.len() as u32;
                nodes.extend(field.node_quads(cells.len() as u32));
                cells.extend(field.cells());
                first
            });
            let halves = if field.has_halves() { HAS_HALVES } else { 0 };
            SilhouetteSlot { first_quad: first_quad | halves, field: field.clone() }
        };
        let slots = baked.iter().map(|mesh| mesh.silhouette.as_ref().map(&mut slot)).collect();
        nodes.resize(nodes.len().max(ALIGNMENT as usize / 16), [0.0; 4]);
        cells.resize(cells.len().max(ALIGNMENT as usize / 8), [0; 2]);
        let nodes = Buffer::with_data(device, "silhouette nodes", &nodes)?;
        Ok((Silhouettes { nodes, cells: Buffer::with_data(device, "silhouette cells", &cells)? }, slots))
    }
}
