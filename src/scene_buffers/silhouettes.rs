//! All silhouette fields and boxes of a scene in two buffers, and where each begins; and the colours of its lamps.

use super::ALIGNMENT;
use crate::asset::Mesh;
use crate::bake::BakedMesh;
use crate::error::Result;
use crate::field::Area;
use crate::field::cuboid::{Cuboid, PlacedCuboid};
use crate::field::lamp_colors::LampColors;
use crate::field::silhouette::SilhouetteField;
use crate::gpu::{Buffer, Device};
use crate::layout::HAS_HALVES;
use std::collections::HashMap;
use std::sync::Arc;

/// The silhouette fields of a scene. Where it has none, the buffers hold a little of nothing.
pub struct Silhouettes {
    /// Mesh by mesh two quads of its field and three a node, three of each box, and the colours of a lamp, see
    /// `glsl/silhouette_field.glsl`.
    pub nodes: Buffer,
    /// Two words a cell.
    pub cells: Buffer,
}

/// Where something of a mesh lies among the nodes.
#[derive(Clone, Copy)]
pub struct Slot<T> {
    /// Its first quad; of a silhouette field with bit 31 where that has maps of halves.
    pub first_quad: u32,
    pub content: T,
}

/// That of a mesh which sharp lights read.
pub struct MeshSlots {
    /// Silhouette field, if an entity needs one.
    pub silhouette: Option<Slot<Arc<SilhouetteField>>>,
    /// The outline's area from afar, of what shines and has no field.
    pub lamp_area: Option<Area>,
    /// The box that it is, if it is one.
    pub cuboid: Option<Slot<Cuboid>>,
    /// Where each of the boxes begins that it consists of.
    pub boxes: Vec<Slot<PlacedCuboid>>,
    /// Its colours, if it is a lamp with colours of its parts.
    pub lamp_colors: Option<Slot<Arc<LampColors>>>,
}

impl Silhouettes {
    /// Uploads the fields of a scene's meshes and the boxes that `casters` are or consist of, and returns each mesh's
    /// place. Meshes that share a field share its place. `wants_area` tells which meshes need their area from afar.
    pub fn new(
        device: &Arc<Device>,
        baked: &[BakedMesh],
        casters: &[&Arc<Mesh>],
        wants_area: impl Fn(usize) -> bool,
    ) -> Result<(Self, Vec<MeshSlots>)> {
        let mut nodes = Vec::<[f32; 4]>::new();
        let mut cells = Vec::<[u32; 2]>::new();
        let mut fields = HashMap::<*const SilhouetteField, u32>::new();
        let mut colors = HashMap::<*const LampColors, u32>::new();
        let of_mesh = |(mesh, (baked, caster)): (usize, (&BakedMesh, &&Arc<Mesh>))| {
            let silhouette = baked.silhouette.as_ref().map(|field| {
                let first_quad = *fields.entry(Arc::as_ptr(field)).or_insert_with(|| {
                    let first = add(&mut nodes, field.node_quads(cells.len() as u32));
                    cells.extend(field.cells());
                    first + field.header.faces.len() as u32
                });
                let halves = if field.has_halves() { HAS_HALVES } else { 0 };
                Slot { first_quad: first_quad | halves, content: field.clone() }
            });
            let lamp = silhouette.as_ref().filter(|_| wants_area(mesh));
            let lamp_area = lamp.map(|slot| slot.content.area());
            let cuboid = caster.cuboid().map(|content| Slot { first_quad: add(&mut nodes, content.quads()), content });
            let slot = |content: &PlacedCuboid| Slot {
                first_quad: add(&mut nodes, content.cuboid.quads()),
                content: *content,
            };
            let boxes = caster.boxes().iter().map(slot).collect();
            let lamp_colors = baked.lamp_colors.as_ref().map(|of| {
                let first_quad = *colors.entry(Arc::as_ptr(of)).or_insert_with(|| add(&mut nodes, of.quads()));
                Slot { first_quad, content: of.clone() }
            });
            MeshSlots { silhouette, lamp_area, cuboid, boxes, lamp_colors }
        };
        let slots = baked.iter().zip(casters).enumerate().map(of_mesh).collect();
        nodes.resize(nodes.len().max(ALIGNMENT as usize / 16), [0.0; 4]);
        cells.resize(cells.len().max(ALIGNMENT as usize / 8), [0; 2]);
        let nodes = Buffer::with_data(device, "silhouette nodes", &nodes)?;
        Ok((Silhouettes { nodes, cells: Buffer::with_data(device, "silhouette cells", &cells)? }, slots))
    }
}

/// Appends quads and returns the place of the first.
fn add(nodes: &mut Vec<[f32; 4]>, quads: impl IntoIterator<Item = [f32; 4]>) -> u32 {
    let first = nodes.len() as u32;
    nodes.extend(quads);
    first
}
