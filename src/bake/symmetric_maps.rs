//! Maps of a silhouette field that need no capture, because a turn or a mirror moves the mesh onto itself and another map onto them.

use super::levels::TEXEL_SHARE;
use super::symmetry::Symmetry;
use crate::asset::mesh::Mesh;
use crate::field::silhouette::{MapFrame, Side, SilhouetteHeader};
use crate::field::silhouette_nodes::NodeGrid;
use glam::{DMat3, DVec2, DVec3};

/// Least cosine of the angle between axes that count as one.
const SAME_AXIS: f64 = 1.0 - 1e-9;

/// How a map follows from another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Copied {
    /// The map that it follows from, which is captured.
    pub of: usize,
    /// For each axis of the map, the other map's axis that a symmetry moves onto it.
    axes: [usize; 2],
    /// 1 or -1 for each axis of the map, where the moved axis points the other way.
    signs: [f64; 2],
    /// Whether the symmetry moves the other map's direction onto the opposite one, from which the object is seen from behind.
    behind: bool,
}

impl Copied {
    /// How `frame` follows from map `of`, whose frame a symmetry moves: not at all, unless axes fall on axes.
    fn new(of: usize, moved: &[DVec3; 2], behind: bool, frame: &MapFrame) -> Option<Self> {
        let along = |axis: DVec3| {
            let dots = moved.map(|m| m.dot(axis));
            (0..2).find(|i| dots[*i].abs() > SAME_AXIS).map(|i| (i, dots[i].signum()))
        };
        let [(a, sign_a), (b, sign_b)] = [along(frame.axes[0])?, along(frame.axes[1])?];
        Some(Copied { of, axes: [a, b], signs: [sign_a, sign_b], behind })
    }

    /// The map's rectangle, from that of the other map.
    pub fn frame(&self, frame: &MapFrame, other: &MapFrame) -> MapFrame {
        let [a, b] = self.axes;
        let centre = DVec2::from_array(self.signs) * DVec2::new(other.centre[a], other.centre[b]);
        MapFrame { centre, half: DVec2::new(other.half[a], other.half[b]), ..*frame }
    }

    /// The other map's side that shows a side of this one.
    pub fn side(&self, side: Side) -> Side {
        if self.behind { side.mirrored() } else { side }
    }

    /// The map's texels, `px` along an edge, from the other map's: two bytes each, of distance and depth.
    pub fn texels<'t>(&'t self, other: &'t [u8], px: usize) -> impl Iterator<Item = u8> + 't {
        (0..px * px).flat_map(move |texel| {
            let mut place = [0; 2];
            for (k, at) in [texel % px, texel / px].into_iter().enumerate() {
                place[self.axes[k]] = if self.signs[k] > 0.0 { at } else { px - 1 - at };
            }
            let texel = &other[2 * (place[1] * px + place[0])..][..2];
            let depth = if self.behind { texel[1].cast_signed().saturating_neg().cast_unsigned() } else { texel[1] };
            [texel[0], depth]
        })
    }
}

/// For each map whether it follows from an earlier one, and how, by symmetries that miss the mesh by at most
/// [`TEXEL_SHARE`] of `pixel`, the edge of the smallest pixel of the views, in r.
pub fn plan(mesh: &Mesh, nodes: &NodeGrid, frames: &[MapFrame], pixel: f64) -> Vec<Option<Copied>> {
    let operations = Symmetry::of_vertices(mesh, None).operations;
    let close: Vec<DMat3> =
        operations.iter().filter(|o| o.deviation <= TEXEL_SHARE * pixel).map(|o| o.matrix).collect();
    let mut plan = vec![None; frames.len()];
    for (of, other) in frames.iter().enumerate() {
        if plan[of].is_some() {
            continue;
        }
        for matrix in &close {
            let moved = other.axes.map(|axis| *matrix * axis);
            let Some((map, behind)) = nodes.node_at(*matrix * other.direction) else { continue };
            if map > of && plan[map].is_none() {
                plan[map] = Copied::new(of, &moved, behind, &frames[map]);
            }
        }
    }
    plan
}

/// The payload of a field: each map's rectangle before the texels of its sides, of which `sides` holds those of captured maps.
pub fn joined(header: &SilhouetteHeader, frames: &[MapFrame], plan: &[Option<Copied>], sides: &[Vec<u8>]) -> Vec<u8> {
    let mut place = Vec::with_capacity(plan.len());
    let mut count = 0;
    for copied in plan {
        place.push(copied.map_or(count, |copied| place[copied.of]));
        count += usize::from(copied.is_none());
    }
    let mut payload = Vec::with_capacity(header.payload_bytes());
    for (map, frame) in frames.iter().enumerate() {
        for number in [frame.centre.x, frame.centre.y, frame.half.x, frame.half.y] {
            payload.extend((number as f32).to_le_bytes());
        }
        for &side in &Side::ALL[..sides.len()] {
            let from = plan[map].map_or(side, |copied| copied.side(side));
            let bytes = header.texel_bytes(side);
            let texels = &sides[from as usize][place[map] * bytes..][..bytes];
            match &plan[map] {
                Some(copied) => payload.extend(copied.texels(texels, header.edge_px(side))),
                None => payload.extend(texels),
            }
        }
    }
    payload
}
