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
    /// Two quads a field and three a node, then three of each box, then the colours of lamps, see
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
    /// place. Meshes that share a field share its place. `wants_area` tells of which meshes the area from afar is needed.
    pub fn new(
        device: &Arc<Device>,
        baked: &[BakedMesh],
        casters: &[&Arc<Mesh>],
        wants_area: impl Fn(usize) -> bool,
    ) -> Result<(Self, Vec<MeshSlots>)> {
        let mut nodes = Vec::<[f32; 4]>::new();
        let mut cells = Vec::<[u32; 2]>::new();
        let mut known = HashMap::<*const SilhouetteField, u32>::new();
        let mut slot = |field: &Arc<SilhouetteField>| {
            let first_quad = *known.entry(Arc::as_ptr(field)).or_insert_with(|| {
                let first = (nodes.len() + field.faces().len()) as u32;
                nodes.extend(field.node_quads(cells.len() as u32));
                cells.extend(field.cells());
                first
            });
            let halves = if field.has_halves() { HAS_HALVES } else { 0 };
            Slot { first_quad: first_quad | halves, content: field.clone() }
        };
        let silhouettes: Vec<_> = baked.iter().map(|mesh| mesh.silhouette.as_ref().map(&mut slot)).collect();
        let mut add_cuboid = |cuboid: &Cuboid| {
            let first_quad = nodes.len() as u32;
            nodes.extend(cuboid.quads());
            first_quad
        };
        let mut boxes_of = |caster: &&Arc<Mesh>| {
            let whole = caster.cuboid().map(|content| Slot { first_quad: add_cuboid(&content), content });
            let slot = |content: &PlacedCuboid| Slot { first_quad: add_cuboid(&content.cuboid), content: *content };
            (whole, caster.boxes().iter().map(slot).collect::<Vec<_>>())
        };
        let boxes: Vec<_> = casters.iter().map(&mut boxes_of).collect();
        let mut known_colors = HashMap::<*const LampColors, u32>::new();
        let mut colors_slot = |colors: &Arc<LampColors>| {
            let first_quad = *known_colors.entry(Arc::as_ptr(colors)).or_insert_with(|| {
                let first = nodes.len() as u32;
                nodes.extend(colors.quads());
                first
            });
            Slot { first_quad, content: colors.clone() }
        };
        let colors = baked.iter().map(|mesh| mesh.lamp_colors.as_ref().map(&mut colors_slot));
        let slots = silhouettes.into_iter().zip(boxes).zip(colors);
        let of_mesh = |(mesh, ((silhouette, (cuboid, boxes)), lamp_colors))| {
            let lamp: Option<&Slot<Arc<SilhouetteField>>> = Option::as_ref(&silhouette).filter(|_| wants_area(mesh));
            let lamp_area = lamp.map(|slot| slot.content.area());
            MeshSlots { silhouette, lamp_area, cuboid, boxes, lamp_colors }
        };
        let slots = slots.enumerate().map(of_mesh).collect();
        nodes.resize(nodes.len().max(ALIGNMENT as usize / 16), [0.0; 4]);
        cells.resize(cells.len().max(ALIGNMENT as usize / 8), [0; 2]);
        let nodes = Buffer::with_data(device, "silhouette nodes", &nodes)?;
        Ok((Silhouettes { nodes, cells: Buffer::with_data(device, "silhouette cells", &cells)? }, slots))
    }
}
