//! Silhouette fields: what an object blocks along any ray that passes it, for lights too small for four SH bands.
//!
//! Outside an object, what a ray meets depends on the ray alone: on its direction and on its offset from the object's
//! centre. So a silhouette field has no shells. It holds one map for each direction of a [`NodeGrid`]: the object's
//! outline as parallel light of that direction sees it. A texel holds the signed distance to the outline, positive
//! inside, and the depth of the outline's nearest point along the direction. Both are in units of the bounding radius r
//! about the sphere's centre, as all lengths in this file.
//!
//! A lookup ([`SilhouetteField::outline`]) blends the four maps around a direction. Each sees an outline point that
//! lies off the centre's plane at another place, so the depth is read first and the place corrected by it (parallax).
//! How much of a small round light the outline leaves ([`blocked_share`]) follows from the distance and from how far
//! away the outline's point is.
//!
//! Within the bounding sphere a part of the object may lie behind the receiver, or beyond the light, and its outline
//! hides that of the rest. So a mesh that is not convex has maps of its two halves besides ([`Side`]), at half the
//! resolution. Well within a half's outline its map has the depth of the half itself ([`SURFACE`]). Each half counts as
//! far as its outline lies between receiver and light; where both do, the whole counts. Lights of 3 degrees in the
//! middle of a ring have errors of 0.01 with halves and of 0.26 without. Where a ray enters and leaves the object's box
//! before a light that is outside, the whole counts too: the nearest outline may lie in the receiver's own plane.
//!
//! For a convex mesh that is no ball the field keeps a box instead, and the planes of its other faces where these are few.
//! A slab's nearest rim may lie before a receiver that stands over the slab; where the ray enters and leaves them all tells
//! where the object stands. Receivers within a slab's sphere have errors of 0.05 with it and of 0.19 without; on the roof
//! that lies on a gable they have a false shadow where the box alone tells.

use super::Area;
use super::file;
pub use super::silhouette_header::{FACES_LIMIT, Side, SilhouetteHeader};
use super::silhouette_nodes::{Cell, NodeGrid};
use super::sub_light::{LIMIT_OUTLINE, SeenLight};
use crate::error::{Error, Result};
use glam::{DVec2, DVec3, Vec2};
use std::f64::consts::PI;
use std::path::Path;

pub const SILHOUETTE_MAGIC: [u8; 8] = *b"SHOUTLN\n";
/// Largest distance from the outline that a map holds, inside or outside, in r.
pub const REACH: f64 = 0.5;
/// Room that a map leaves around the object's outline, in r: distances just outside it are met by most lookups.
pub const MARGIN: f64 = 0.08;
/// Least distance of an outline from a receiver that a penumbra is computed for, in r.
pub const NEAREST: f64 = 0.02;
/// Distance from the centre, in r, of a receiver or a light up to which halves count, and from which only the whole
/// does.
pub const INSIDE: [f64; 2] = [0.9, 1.05];
/// How deep in the object a receiver or a light lies, along the ray from the centre's plane towards its own end and in
/// r, up to which only the whole counts, and from which halves do. Nearer to the rim almost all of the object lies
/// between the two.
pub const DEEP: [f64; 2] = [-0.6, -0.2];
/// How far behind the cut the middle of the far half lies, and that of the near one before it, in r: a light must lie
/// behind that for the half to count. The outline of a half that is cut there tells of the cut: a bulb right before it
/// shone through the dome around it, and one right behind was hidden by the dome's top, as seen from below.
pub const HALF_DEPTH: f64 = 0.15;
/// Distance within the outline of a half, in r, up to which its map has the depth of the outline's nearest point, and
/// from which it has that of the half's middle on the ray. A bulb high in a dome lies before the dome's rim and behind
/// its top: by the rim alone it shone through the top.
pub const SURFACE: [f64; 2] = [0.05, 0.25];
/// Coordinate in r from which on a convex object reaches so far toward its bounding sphere that a box tells nothing
/// more.
pub const ROUND: f64 = 0.9;
/// Half the edge of a box that tells nothing, in r.
pub const NO_BOX: f64 = 1e30;
/// How far from a box, in r, a ray's end may lie and yet count as on it. Rounding moves the end by less within some 80
/// r of the world's origin.
pub const TOUCHING: f64 = 1e-5;
/// Least size of a direction's parts where they divide.
pub const LEAST_STEP: f64 = 1e-7;
/// Least half-width of a penumbra, in r: it keeps a light of no size from dividing by nothing.
pub const LEAST_PENUMBRA: f64 = 1e-9;

/// Where a map lies: the plane through the sphere's centre at right angles to its direction, and a rectangle in that
/// plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapFrame {
    /// Unit direction of the parallel light.
    pub direction: DVec3,
    /// Unit axes of the plane; with the direction a right-handed frame.
    pub axes: [DVec3; 2],
    /// Centre of the rectangle along the axes.
    pub centre: DVec2,
    pub half: DVec2,
}

impl MapFrame {
    /// The frame of a direction whose rectangle encloses all positions, with [`MARGIN`].
    pub fn around(direction: DVec3, positions: &[DVec3]) -> Self {
        let axes = Self::axes_of(direction);
        let places = positions.iter().map(|p| DVec2::new(p.dot(axes[0]), p.dot(axes[1])));
        let (low, high) = places.fold((DVec2::MAX, DVec2::MIN), |(low, high), p| (low.min(p), high.max(p)));
        // Captured maps are looked up by the stored f32 values.
        let stored = |v: DVec2| v.as_vec2().as_dvec2();
        MapFrame { direction, axes, centre: stored((low + high) / 2.0), half: stored((high - low) / 2.0 + MARGIN) }
    }

    /// Turns and mirrors of a cube move the axes of a direction onto those of the moved direction, but for their order
    /// and signs: unless two of the direction's parts are equally small.
    fn axes_of(direction: DVec3) -> [DVec3; 2] {
        let across = DVec3::AXES[direction.abs().min_position()];
        let across = (across - across.dot(direction) * direction).normalize();
        [across, direction.cross(across)]
    }

    /// Place of a point on the map, -1 to 1 from edge to edge of the rectangle.
    pub fn place(&self, point: DVec3) -> DVec2 {
        (DVec2::new(point.dot(self.axes[0]), point.dot(self.axes[1])) - self.centre) / self.half
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Signed distance of the ray from the outline, in r: positive where the ray meets the object.
    pub distance: f64,
    /// Depth along the ray's direction of the outline's nearest point, in r from the sphere's centre.
    pub depth: f64,
}

/// The four maps that serve all rays through one point in directions close to each other.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    point: DVec3,
    /// Their middle, a unit vector.
    toward: DVec3,
    cell: Cell,
    maps: [NearMap; 4],
}

/// One of the four maps around a direction, as it concerns rays through one point.
#[derive(Clone, Copy, Debug)]
struct NearMap {
    map: usize,
    /// -1 where the map is seen from behind.
    sign: f64,
    /// Steps on the map, -1 to 1 from edge to edge, per r of the object's frame.
    rows: [DVec3; 2],
    place: DVec2,
    /// Place on the map of the ray's point that is nearest to the sphere's centre.
    foot: DVec2,
    /// Depth along the direction of the outline's nearest point, in r from the sphere's centre.
    depth: f64,
}

impl NearMap {
    /// The map's own side that shows a side as seen along the direction.
    fn side(&self, side: Side) -> Side {
        if self.sign < 0.0 { side.mirrored() } else { side }
    }

    /// Place on the map of what lies that far from the point along a direction.
    fn along(&self, direction: DVec3, way: f64) -> DVec2 {
        self.place + way * DVec2::new(self.rows[0].dot(direction), self.rows[1].dot(direction))
    }
}

#[derive(Clone, Debug)]
pub struct SilhouetteField {
    pub header: SilhouetteHeader,
    nodes: NodeGrid,
    pub frames: Vec<MapFrame>,
    /// Stored bytes, as [`SilhouetteField::new`] takes them.
    pub payload: Vec<u8>,
}

/// The byte of a number that lies between -`most` and `most`, rounded to nearest.
pub fn encode(value: f64, most: f64) -> u8 {
    ((value / most).clamp(-1.0, 1.0) * 127.0).round() as i8 as u8
}

/// Inverse of [`encode`]. The byte that it never gives, -128, lies a 127th beyond `most`.
pub fn decode(byte: u8, most: f64) -> f64 {
    f64::from(byte as i8) / 127.0 * most
}

impl SilhouetteField {
    /// A field from its stored bytes: maps in the order of [`NodeGrid::map_direction`], each a rectangle (centre x, y,
    /// half x, y as little-endian f32) and then texels row by row, a signed byte of distance and one of depth.
    pub fn new(header: SilhouetteHeader, payload: Vec<u8>) -> Result<Self> {
        header.validate()?;
        if payload.len() != header.payload_bytes() {
            let claimed = header.payload_bytes();
            let found = payload.len();
            return Err(Error::Input(format!("the header claims {claimed} bytes of maps, {found} are there")));
        }
        let nodes = NodeGrid::new(header.cells);
        let mut frames = Vec::with_capacity(header.map_count());
        for (index, map) in payload.chunks_exact(header.map_bytes()).enumerate() {
            let [centre, half]: [Vec2; 2] = bytemuck::pod_read_unaligned(&map[..16]);
            let [centre, half] = [centre, half].map(|of| of.as_dvec2());
            if !(centre.is_finite() && half.is_finite() && half.min_element() > 0.0 && half.max_element() < 4.0) {
                return Err(Error::Input(format!("the rectangle of map {index} is not usable")));
            }
            let direction = nodes.map_direction(index);
            frames.push(MapFrame { direction, axes: MapFrame::axes_of(direction), centre, half });
        }
        Ok(SilhouetteField { header, nodes, frames, payload })
    }

    /// The field as `glsl/silhouette_field.glsl` reads it: the planes of faces, the last one first, two quads of the box
    /// around the object with the number of these, then three of each node, which give places in texels from the middle
    /// of a map's first; the cells of the field's maps begin at `first_cell`.
    pub fn node_quads(&self, first_cell: u32) -> Vec<[f32; 4]> {
        let side_cells = |side| self.header.edge_px(side).saturating_sub(1).pow(2);
        let map_cells = Side::ALL.map(side_cells).iter().sum::<usize>() as u32;
        let node = |&(map, mirrored): &(usize, bool)| {
            let MapFrame { axes, centre, half, .. } = self.frames[map];
            let px = f64::from(self.header.map_px);
            let row = |i: usize| {
                let first = 0.5 * px * (1.0 - centre[i] / half[i]) - 0.5;
                (0.5 * px * axes[i] / half[i]).extend(first).as_vec4().to_array()
            };
            let texel = (2.0 / px * half).as_vec2();
            let cells = f32::from_bits(first_cell + map as u32 * map_cells);
            [row(0), row(1), [texel.x, texel.y, cells, if mirrored { -1.0 } else { 1.0 }]]
        };
        let count = self.header.faces.len() as f64;
        let corners = self.extent().map(|corner| corner.extend(count).as_vec4().to_array());
        let faces = self.header.faces.iter().rev().copied();
        faces.chain(corners).chain(self.nodes.nodes.iter().flat_map(node)).collect()
    }

    pub fn has_halves(&self) -> bool {
        self.header.half_px > 0
    }

    /// The cells of all maps and sides, row by row: the signed bytes of four neighbouring distances, and of their
    /// depths. The first byte of each word is the corner nearest to the map's first texel, the second is its neighbour
    /// in the row.
    pub fn cells(&self) -> Vec<[u32; 2]> {
        let mut cells = Vec::new();
        for map in 0..self.frames.len() {
            for side in Side::ALL {
                let row_bytes = 2 * self.header.edge_px(side).max(1);
                let rows = || self.texels(map, side).chunks_exact(row_bytes);
                for (low, high) in rows().zip(rows().skip(1)) {
                    let corners = low.windows(4).step_by(2).zip(high.windows(4).step_by(2));
                    cells.extend(corners.map(|(low, high)| {
                        let word = |i: usize| u32::from_le_bytes([low[i], low[i + 2], high[i], high[i + 2]]);
                        [word(0), word(1)]
                    }));
                }
            }
        }
        cells
    }

    /// The bytes of a side of a map, two a texel.
    pub fn texels(&self, map: usize, side: Side) -> &[u8] {
        let first = map * self.header.map_bytes() + self.header.texels_at(side);
        &self.payload[first..first + self.header.texel_bytes(side)]
    }

    pub fn write(&self, path: &Path) -> Result<()> {
        file::write(path, SILHOUETTE_MAGIC, &self.header, &self.payload)
    }

    pub fn read(path: &Path) -> Result<Self> {
        let (header, payload) = file::read(path, SILHOUETTE_MAGIC)?;
        Self::new(header, payload).map_err(|error| Error::input(path, error))
    }

    pub fn texel(&self, map: usize, side: Side, x: usize, y: usize) -> [f64; 2] {
        let texel = &self.texels(map, side)[2 * (y * self.header.edge_px(side) + x)..];
        [decode(texel[0], REACH), decode(texel[1], 1.0)]
    }

    /// Distance and depth of a map at a point of the plane, between four texels. Beyond the middles of the outermost
    /// texels, the distance there less the way to them.
    fn sample(&self, map: usize, side: Side, place: DVec2) -> [f64; 2] {
        let px = self.header.edge_px(side);
        let beyond = (place + 1.0) / 2.0 * px as f64 - 0.5;
        let at = beyond.clamp(DVec2::ZERO, DVec2::splat((px - 1) as f64));
        let x = (at.x as usize).min(px - 2);
        let y = (at.y as usize).min(px - 2);
        let u = at.x - x as f64;
        let v = at.y - y as f64;
        let corner = |i, j| DVec2::from_array(self.texel(map, side, x + i, y + j));
        let low = corner(0, 0).lerp(corner(1, 0), u);
        let high = corner(0, 1).lerp(corner(1, 1), u);
        let found = low.lerp(high, v);
        let way = (beyond - at) * self.frames[map].half * (2.0 / px as f64);
        [found.x - way.length(), found.y]
    }

    /// The maps for rays through `point` (object's frame, in r) in directions close to `toward`.
    pub fn near(&self, point: DVec3, toward: DVec3) -> Near {
        let cell = self.nodes.cell(toward);
        let along = point.dot(toward);
        let maps = cell.nodes.map(|(map, mirrored)| {
            let frame = &self.frames[map];
            let rows = [0, 1].map(|i| frame.axes[i] / frame.half[i]);
            let sign = if mirrored { -1.0 } else { 1.0 };
            let mut near = NearMap { map, sign, rows, place: frame.place(point), foot: DVec2::ZERO, depth: 0.0 };
            near.foot = near.along(toward, -along);
            near.depth = self.depth(&near, Side::Whole);
            near
        });
        Near { point, toward, cell, maps }
    }

    /// Depth along the direction of the nearest point of a side's outline.
    fn depth(&self, near: &NearMap, side: Side) -> f64 {
        near.sign * self.sample(near.map, near.side(side), near.foot)[1]
    }

    /// The outline of one side of the object near the ray along the unit vector `direction`. Halves are those of a
    /// field that has them.
    pub fn outline(&self, near: &Near, side: Side, direction: DVec3) -> Outline {
        let along = near.point.dot(direction);
        let mut found = Outline { distance: 0.0, depth: 0.0 };
        for (map, weight) in near.maps.iter().zip(self.nodes.weights(&near.cell, direction)) {
            let to = if side == Side::Whole { map.depth } else { self.depth(map, side) };
            let [distance, depth] = self.sample(map.map, map.side(side), map.along(direction, to - along));
            found.distance += weight * distance;
            found.depth += weight * map.sign * depth;
        }
        found
    }

    /// Least and largest corner of the box around the object, in r: a boundless one where the bounding sphere tells as
    /// much.
    pub fn extent(&self) -> [DVec3; 2] {
        let [low, high] = self.header.extent.map(|corner| DVec3::from_array(corner.map(f64::from)));
        let tells = low.max(-high).max_element() > -ROUND;
        if tells { [low, high] } else { [DVec3::splat(-NO_BOX), DVec3::splat(NO_BOX)] }
    }

    /// Share of the disc of a light with this outline that its parts cover, from the direction of its centre and its angular
    /// radius' sine.
    pub fn covered(&self, toward: DVec3, sine: f64) -> f64 {
        let mut light = SeenLight::new(toward / sine, 1.0);
        // Four blocks, however small it is.
        light.fine = 1.0;
        let mut covered = 0.0;
        let mut whole = 0.0;
        for (middle, parts) in light.blocks() {
            let near = self.near(-toward / sine, middle);
            for part in parts {
                covered += part.weight * self.blocked(&near, part.toward, f64::INFINITY, part.tangent());
                whole += part.weight;
            }
        }
        covered / whole
    }

    /// The area of a light with this outline from afar.
    pub fn area(&self) -> Area {
        Area::of(|direction| self.covered(-direction, LIMIT_OUTLINE))
    }

    /// Whether box or faces tell what neither the outline nor halves do.
    pub fn has_box(&self) -> bool {
        !self.has_halves() && (self.extent()[1].x < NO_BOX || !self.header.faces.is_empty())
    }

    /// Where a ray enters and leaves the box around the object, and the planes of its faces. If it misses one, the interval
    /// has no ends, and the outline alone decides.
    fn through_box(&self, point: DVec3, direction: DVec3) -> [f64; 2] {
        let cut = |[enters, leaves]: [f64; 2], &[x, y, z, distance]: &[f32; 4]| {
            let normal = DVec3::new(x.into(), y.into(), z.into());
            let along = normal.dot(direction);
            let at =
                (f64::from(distance) - normal.dot(point)) / if along.abs() < LEAST_STEP { LEAST_STEP } else { along };
            if along <= -LEAST_STEP { [enters.max(at), leaves] } else { [enters, leaves.min(at)] }
        };
        let [enters, leaves] = self.header.faces.iter().fold(slabs(self.extent(), point, direction), cut);
        if enters <= leaves { [enters, leaves] } else { [-NO_BOX, NO_BOX] }
    }

    /// Share of a small round light that the object blocks, as seen from the point of `near`: the light's middle lies
    /// in that unit direction, `distance` away (in r, infinite for distant light), and `tangent` is that of its angular
    /// radius.
    pub fn blocked(&self, near: &Near, direction: DVec3, distance: f64, tangent: f64) -> f64 {
        let along = near.point.dot(direction);
        let has_halves = self.has_halves();
        let in_box = self.through_box(near.point, if has_halves { near.toward } else { direction });
        if has_halves && in_box[1] < TOUCHING {
            return 0.0;
        }
        let end = near.point + distance.min(1e30) * direction;
        let outside = |place: DVec3| ((place.length() - INSIDE[0]) / (INSIDE[1] - INSIDE[0])).clamp(0.0, 1.0);
        // Halves tell how much of the object stands between, unless all of its box does before a light outside.
        let all = box_ends(in_box, distance).iter().product::<f64>() * outside(end);
        let all = if has_halves { all } else { 0.0 };
        let tells = if has_halves { [-NO_BOX, NO_BOX] } else { in_box };
        // Share that an outline blocks, and how far it counts.
        let by = |side: Side| {
            let outline = self.outline(near, side, direction);
            let away = outline.depth - along;
            let share = blocked_share(outline.distance / (away.max(NEAREST) * tangent).max(LEAST_PENUMBRA));
            let deeper = match side {
                Side::Whole => 0.0,
                Side::Far => HALF_DEPTH,
                Side::Near => -HALF_DEPTH,
            };
            (share, counts_between(away, distance - deeper, tells))
        };
        let (whole, counts) = by(Side::Whole);
        let counts = f64::max(counts, all);
        let deep = along.max(-along - distance);
        let inside = (1.0 - outside(near.point).min(outside(end)))
            * ((deep - DEEP[0]) / (DEEP[1] - DEEP[0])).clamp(0.0, 1.0)
            * (1.0 - all);
        if inside == 0.0 || !has_halves {
            return whole * counts;
        }
        let [(far, beyond), (near, before)] = [by(Side::Far), by(Side::Near)];
        let halves = beyond * before * whole + beyond * (1.0 - before) * far + before * (1.0 - beyond) * near;
        whole * counts + inside * (halves - whole * counts)
    }
}

/// Where a ray enters and leaves a box, if it meets it.
pub fn through_box(corners: [DVec3; 2], point: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let ends = slabs(corners, point, direction);
    (ends[0] <= ends[1]).then_some(ends)
}

/// Where a ray has entered all three slabs of a box and where it leaves the first, which is before that if it misses.
pub(super) fn slabs(corners: [DVec3; 2], point: DVec3, direction: DVec3) -> [f64; 2] {
    let least = DVec3::splat(LEAST_STEP);
    let step = DVec3::select(direction.abs().cmplt(least), least, direction);
    let [one, other] = corners.map(|corner| (corner - point) / step);
    [one.min(other).max_element(), one.max(other).min_element()]
}

/// How far an outline counts that lies that far away (in r): one behind the receiver or beyond the limit blocks
/// nothing. Its nearest point may lie off the ray, as of a wide thin slab below the receiver, and the object then
/// stands where the ray passes its box: all of it, where the ray enters and leaves the box between receiver and limit,
/// with a ramp where the box reaches beyond either.
pub(super) fn counts_between(away: f64, limit: f64, [enters, leaves]: [f64; 2]) -> f64 {
    let stands = away.max(enters).min(leaves);
    let [enters_between, leaves_between] = box_ends([enters, leaves], limit);
    let begins = fade(stands).max(enters_between);
    let ends = fade(limit - stands).max(leaves_between);
    let apart = leaves < TOUCHING || enters > limit - TOUCHING;
    if apart { 0.0 } else { begins * ends }
}

/// How far the place where a ray enters a box lies beyond the receiver, and that where it leaves it before the limit: 1 or
/// 0, with a ramp between.
fn box_ends([enters, leaves]: [f64; 2], limit: f64) -> [f64; 2] {
    [-enters, leaves - limit].map(|beyond| (1.0 - beyond / NEAREST).clamp(0.0, 1.0))
}

/// 1 where a length (in r) is positive and 0 where it is negative, with a ramp between that hides the depth's own
/// steps.
fn fade(length: f64) -> f64 {
    (length / NEAREST + 0.5).clamp(0.0, 1.0)
}

/// Area of a unit disc on one side of a straight edge, over pi: `x` is the signed distance of the disc's centre from
/// the edge in radii, positive on the side that counts.
pub fn blocked_share(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / PI
}
