//! Rays from one point against hierarchies of triangles, sixteen at a time: what a box or a triangle costs is shared by
//! all, and vector instructions take eight of them where the processor has AVX2, or all where it has AVX-512.
//!
//! One hierarchy has all triangles, and each member of a group has its own: rays that ask for a few members pass by no
//! others. Nodes have four children: a ray takes a third less time than with two.

use super::triangles::weights;
use crate::asset::Mesh;
use crate::asset::texture::{Texture, Wrap};
use glam::{Mat3A, Vec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::triangle::Triangle;
use pulp::{Arch, Simd, WithSimd};
use std::time::Duration;

const LANES: usize = 16;
/// How far beyond its sides a triangle reaches, as a share of them: no ray slips between two neighbours.
const SLACK: f32 = 1e-5;
const MIXED: u32 = u32::MAX;
const CHILDREN: usize = 4;

/// Triangles that block, each of one member of a group.
pub struct Blockers {
    /// Of the hierarchy of all triangles, which begins with the first, and of those of members.
    nodes: Vec<Node>,
    /// For each member the first node of its own hierarchy; `None` where it has no triangles.
    of_member: Vec<Option<u32>>,
    /// In the order of the hierarchies' leaves, of one after the other.
    triangles: Vec<Corners>,
    members: Vec<u32>,
    /// Which triangle of the member's mesh each is.
    numbers: Vec<u32>,
    /// Holes of each member's surface; empty where none has any.
    masks: Vec<Option<Mask>>,
    /// Of each member whose backs are triangles too, which do not stand here: how far behind its fronts they come.
    backs: Vec<Option<u32>>,
}

#[derive(Clone)]
pub struct Mask {
    /// For each triangle the place of its first corner in texels, and the ways from there to the others.
    corners: Vec<[Vec2; 3]>,
    size: [i32; 2],
    wrap: [Wrap; 2],
    /// Of every texel.
    is_hole: Vec<bool>,
}

impl Mask {
    /// The holes that a texture makes in a mesh; `None` where it makes none.
    pub fn new(mesh: &Mesh, texture: &Texture) -> Option<Self> {
        let (texels, uvs) = texture.texels.as_ref().zip(mesh.uvs.as_ref())?;
        let cutoff = texture.alpha_cutoff?;
        let size = Vec2::new(texels.width as f32, texels.height as f32);
        // Rows run downwards.
        let place = |v: u32| Vec2::new(uvs[v as usize].x, 1.0 - uvs[v as usize].y) * size;
        let corners = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(place);
            [a, b - a, c - a]
        };
        Some(Mask {
            corners: mesh.triangles.iter().map(corners).collect(),
            size: [texels.width as i32, texels.height as i32],
            wrap: texture.wrap,
            is_hole: texels.rgba.iter().map(|texel| f32::from(texel[3]) / 255.0 < cutoff).collect(),
        })
    }

    /// Whether a place of a triangle, given by the weights of its second and third corner, is a hole.
    fn is_hole(&self, triangle: u32, [v, w]: [f32; 2]) -> bool {
        let [first, second, third] = self.corners[triangle as usize];
        let place = first + v * second + w * third;
        let texel = |at: f32, axis: usize| {
            let below = at as i32;
            self.wrap[axis].whole(below - i32::from((below as f32) > at), self.size[axis]) as usize
        };
        self.is_hole[texel(place.y, 1) * self.size[0] as usize + texel(place.x, 0)]
    }
}

#[derive(Clone, Copy, Debug)]
pub struct BlockerTriangle {
    pub member: u32,
    /// Which triangle of the member's mesh it is.
    pub number: u32,
    pub corners: [Vec3; 3],
}

#[derive(Clone, Copy)]
struct Child {
    low: Vec3A,
    high: Vec3A,
    /// A node, or the first of a leaf's triangles.
    first: u32,
    /// Triangles of a leaf; 0 for a node.
    count: u32,
    /// The member that all of its triangles belong to; [`MIXED`] for those of several.
    owner: u32,
}

#[derive(Clone, Copy)]
struct Node {
    children: [Child; CHILDREN],
    /// How many of them there are.
    count: usize,
}

/// A child whose box rays enter.
#[derive(Clone, Copy)]
struct Entered {
    node: u32,
    child: u32,
    /// How far along the rays it lies.
    along: f32,
    /// How many leaves had been met before its box was tested.
    leaves: u32,
}

#[derive(Clone, Copy)]
struct Corners {
    corner: Vec3A,
    edges: [Vec3A; 2],
    normal: Vec3A,
}

/// The first triangle on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockerHit {
    pub distance: f32,
    pub member: u32,
    /// Its place among the triangles.
    index: u32,
    /// Whether the ray meets its back, where that is no triangle too.
    pub from_behind: bool,
    on_back: bool,
}

impl BlockerHit {
    /// Whether the ray meets the back of a surface.
    pub fn is_behind(&self) -> bool {
        self.from_behind || self.on_back
    }
}

struct Packet {
    direction: [[f32; LANES]; 3],
    inverse: [[f32; LANES]; 3],
    distance: [f32; LANES],
    triangle: [u32; LANES],
    middle: Vec3A,
}

impl Packet {
    /// Up to [`LANES`] directions that `turn` brings into the triangles' frame. Lanes without a ray repeat the last one.
    #[inline(always)]
    fn new(turn: &Mat3A, directions: &[Vec3A]) -> Self {
        let mut packet = Packet {
            direction: [[0.0; LANES]; 3],
            inverse: [[0.0; LANES]; 3],
            distance: [f32::INFINITY; LANES],
            triangle: [u32::MAX; LANES],
            middle: Vec3A::ZERO,
        };
        for lane in 0..LANES {
            let direction = *turn * directions[lane.min(directions.len() - 1)];
            packet.middle += direction;
            for axis in 0..3 {
                packet.direction[axis][lane] = direction[axis];
            }
        }
        for axis in 0..3 {
            for lane in 0..LANES {
                let d = packet.direction[axis][lane];
                // No infinity: a box that begins in the plane of such a ray would give no number.
                packet.inverse[axis][lane] = 1.0 / if d.abs() < 1e-12 { 1e-12_f32.copysign(d) } else { d };
            }
        }
        packet
    }

    fn toward(&self, lane: usize) -> Vec3A {
        Vec3A::new(self.direction[0][lane], self.direction[1][lane], self.direction[2][lane])
    }

    /// Whether any ray enters a box, given from the rays' origin, nearer than what it has met.
    #[inline(always)]
    fn enters<S: Simd>(&self, simd: S, low: Vec3A, high: Vec3A) -> bool {
        let distance = vectors::<S>(&self.distance);
        for i in 0..distance.len() {
            let mut from = simd.splat_f32s(0.0);
            let mut to = distance[i];
            for k in 0..3 {
                let inverse = vectors::<S>(&self.inverse[k])[i];
                let a = simd.mul_f32s(simd.splat_f32s(low[k]), inverse);
                let b = simd.mul_f32s(simd.splat_f32s(high[k]), inverse);
                from = simd.max_f32s(from, simd.min_f32s(a, b));
                to = simd.min_f32s(to, simd.max_f32s(a, b));
            }
            if simd.first_true_m32s(simd.less_than_or_equal_f32s(from, to)) < S::F32_LANES {
                return true;
            }
        }
        false
    }

    /// Möller, Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*, 1997, with the products that all rays from
    /// one origin share.
    #[inline(always)]
    fn meet<S: Simd>(&mut self, simd: S, origin: Vec3A, corners: &Corners, index: u32) {
        let to_corner = corners.corner - origin;
        let second = corners.edges[1].cross(to_corner);
        let first = to_corner.cross(corners.edges[0]);
        let along = simd.splat_f32s(corners.normal.dot(to_corner));
        let least = simd.splat_f32s(-SLACK);
        let most = simd.splat_f32s(1.0 + SLACK);
        let along_rays =
            [vectors::<S>(&self.direction[0]), vectors::<S>(&self.direction[1]), vectors::<S>(&self.direction[2])];
        let (distances, _) = S::as_mut_simd_f32s(&mut self.distance);
        let (triangles, _) = S::as_mut_simd_u32s(&mut self.triangle);
        for i in 0..distances.len() {
            let direction = [along_rays[0][i], along_rays[1][i], along_rays[2][i]];
            let inverse = simd.div_f32s(simd.splat_f32s(1.0), dot(simd, direction, corners.normal));
            let u = simd.mul_f32s(dot(simd, direction, second), inverse);
            let v = simd.mul_f32s(dot(simd, direction, first), inverse);
            let distance = simd.mul_f32s(along, inverse);
            let within = simd.and_m32s(
                simd.and_m32s(simd.greater_than_or_equal_f32s(u, least), simd.greater_than_or_equal_f32s(v, least)),
                simd.less_than_or_equal_f32s(simd.add_f32s(u, v), most),
            );
            let nearer = simd.and_m32s(
                simd.greater_than_f32s(distance, simd.splat_f32s(0.0)),
                simd.less_than_f32s(distance, distances[i]),
            );
            let meets = simd.and_m32s(within, nearer);
            distances[i] = simd.select_f32s(meets, distance, distances[i]);
            triangles[i] = simd.select_u32s(meets, simd.splat_u32s(index), triangles[i]);
        }
    }
}

#[inline(always)]
fn vectors<S: Simd>(lanes: &[f32; LANES]) -> &[S::f32s] {
    S::as_simd_f32s(lanes).0
}

/// A function and no closure: what is not inlined does not get the processor's instructions.
#[inline(always)]
fn dot<S: Simd>(simd: S, direction: [S::f32s; 3], of: Vec3A) -> S::f32s {
    let sum = simd.mul_f32s(direction[0], simd.splat_f32s(of.x));
    let sum = simd.add_f32s(sum, simd.mul_f32s(direction[1], simd.splat_f32s(of.y)));
    simd.add_f32s(sum, simd.mul_f32s(direction[2], simd.splat_f32s(of.z)))
}

/// Which members rays ask for.
#[derive(Clone, Copy)]
enum Asked<'c> {
    /// Those that count, of all.
    Counted(&'c [bool]),
    /// A few.
    Members(&'c [u32]),
}

/// All packets of one origin, as they are dispatched to what the processor has.
struct Cast<'c> {
    blockers: &'c Blockers,
    origin: Vec3A,
    turn: &'c Mat3A,
    directions: &'c [Vec3A],
    asked: Asked<'c>,
}

impl WithSimd for Cast<'_> {
    type Output = Vec<Option<BlockerHit>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Cast { blockers, origin, turn, directions, asked } = self;
        let mut hits = Vec::with_capacity(directions.len());
        let mut open = Vec::with_capacity(64);
        for rays in directions.chunks(LANES) {
            let mut packet = Packet::new(turn, rays);
            match asked {
                Asked::Counted(counts) if !blockers.nodes.is_empty() => {
                    blockers.traverse(simd, 0, origin, &mut packet, Some(counts), &mut open);
                }
                Asked::Counted(_) => {}
                Asked::Members(members) => {
                    let root = |member: &u32| *blockers.of_member.get(*member as usize)?;
                    for root in members.iter().filter_map(root) {
                        blockers.traverse(simd, root, origin, &mut packet, None, &mut open);
                    }
                }
            }
            for lane in 0..rays.len() {
                hits.push(blockers.hit(&packet, lane));
            }
        }
        hits
    }
}

impl Blockers {
    /// Builds the hierarchies; those of no triangles block nothing. `masks` and `backs` are of each member, or empty.
    pub fn new(
        triangles: impl IntoIterator<Item = BlockerTriangle>,
        masks: Vec<Option<Mask>>,
        backs: Vec<Option<u32>>,
    ) -> Self {
        let mut all: Vec<BlockerTriangle> = triangles.into_iter().collect();
        let masks = if masks.iter().any(Option::is_some) { masks } else { Vec::new() };
        let mut blockers = Blockers {
            nodes: Vec::new(),
            of_member: Vec::new(),
            triangles: Vec::new(),
            members: Vec::new(),
            numbers: Vec::new(),
            masks,
            backs,
        };
        let whole = blockers.add(&all);
        all.sort_by_key(|triangle| triangle.member);
        let members = all.last().map_or(0, |last| last.member as usize + 1);
        blockers.of_member = vec![None; members];
        for own in all.chunk_by(|a, b| a.member == b.member) {
            let member = own[0].member as usize;
            // That of an only member is the whole.
            blockers.of_member[member] = if own.len() == all.len() { whole } else { blockers.add(own) };
        }
        blockers
    }

    /// Adds a hierarchy of triangles. Returns its first node; `None` without any.
    fn add(&mut self, of: &[BlockerTriangle]) -> Option<u32> {
        if of.is_empty() {
            return None;
        }
        let triangle = |BlockerTriangle { corners: [a, b, c], .. }: &BlockerTriangle| Triangle {
            v0: (*a).into(),
            v1: (*b).into(),
            v2: (*c).into(),
        };
        let unsorted: Vec<Triangle> = of.iter().map(triangle).collect();
        let mut binary = build_bvh2_from_tris(&unsorted, BvhBuildParams::slow_build(), &mut Duration::default());
        binary.reorder_in_stack_traversal_order();
        let corners = |&i: &u32| {
            let Triangle { v0, v1, v2 } = unsorted[i as usize];
            let edges = [v1 - v0, v2 - v0];
            Corners { corner: v0, edges, normal: edges[0].cross(edges[1]) }
        };
        let first_triangle = self.triangles.len() as u32;
        self.triangles.extend(binary.primitive_indices.iter().map(corners));
        self.members.extend(binary.primitive_indices.iter().map(|&i| of[i as usize].member));
        self.numbers.extend(binary.primitive_indices.iter().map(|&i| of[i as usize].number));
        let owners = owners(&binary, &self.members[first_triangle as usize..]);
        Some(self.widen(&binary, &owners, first_triangle, 0))
    }

    /// Adds a node of a binary hierarchy as one of up to [`CHILDREN`] children: the largest is replaced by its own until
    /// there are so many. Returns its number.
    fn widen(&mut self, binary: &Bvh2, owners: &[u32], first_triangle: u32, root: u32) -> u32 {
        let area = |of: &u32| {
            let size = binary.nodes[*of as usize].aabb.diagonal();
            size.x * size.y + size.y * size.z + size.z * size.x
        };
        let mut below = vec![root];
        while below.len() < CHILDREN {
            let inner = (0..below.len()).filter(|&at| binary.nodes[below[at] as usize].prim_count == 0);
            let Some(largest) = inner.max_by(|&a, &b| area(&below[a]).total_cmp(&area(&below[b]))) else { break };
            let first = binary.nodes[below.swap_remove(largest) as usize].first_index;
            below.extend([first, first + 1]);
        }
        let number = self.nodes.len();
        let none = Child { low: Vec3A::ZERO, high: Vec3A::ZERO, first: 0, count: 0, owner: MIXED };
        self.nodes.push(Node { children: [none; CHILDREN], count: below.len() });
        for (slot, of) in below.into_iter().enumerate() {
            let node = &binary.nodes[of as usize];
            let first = match node.prim_count {
                0 => self.widen(binary, owners, first_triangle, of),
                _ => first_triangle + node.first_index,
            };
            self.nodes[number].children[slot] = Child {
                low: node.aabb.min,
                high: node.aabb.max,
                first,
                count: node.prim_count,
                owner: owners[of as usize],
            };
        }
        number as u32
    }

    /// A triangle that has holes, for rays that meet it elsewhere.
    #[inline(always)]
    fn meet_masked<S: Simd>(&self, simd: S, origin: Vec3A, packet: &mut Packet, mask: &Mask, index: u32) {
        let distances = packet.distance;
        let triangles = packet.triangle;
        packet.meet(simd, origin, &self.triangles[index as usize], index);
        for lane in 0..LANES {
            if packet.triangle[lane] != index {
                continue;
            }
            let Corners { corner, edges, .. } = self.triangles[index as usize];
            let place = origin + packet.distance[lane] * packet.toward(lane) - corner;
            if mask.is_hole(self.numbers[index as usize], weights(edges, place)) {
                packet.distance[lane] = distances[lane];
                packet.triangle[lane] = triangles[lane];
            }
        }
    }

    /// The first triangle on each ray of those whose members count. `turn` brings the directions into the triangles'
    /// frame.
    pub fn first(&self, origin: Vec3A, turn: &Mat3A, directions: &[Vec3A], counts: &[bool]) -> Vec<Option<BlockerHit>> {
        Arch::new().dispatch(Cast { blockers: self, origin, turn, directions, asked: Asked::Counted(counts) })
    }

    /// The first triangle on each ray of a few members.
    pub fn first_of(
        &self,
        origin: Vec3A,
        turn: &Mat3A,
        directions: &[Vec3A],
        members: &[u32],
    ) -> Vec<Option<BlockerHit>> {
        Arch::new().dispatch(Cast { blockers: self, origin, turn, directions, asked: Asked::Members(members) })
    }

    /// Meets the triangles below a node; `counts` tells of each member whether it counts, `None` that all do.
    #[inline(always)]
    fn traverse<S: Simd>(
        &self,
        simd: S,
        root: u32,
        origin: Vec3A,
        packet: &mut Packet,
        counts: Option<&[bool]>,
        open: &mut Vec<Entered>,
    ) {
        let is_left_out = |member: u32| counts.is_some_and(|counts| !counts[member as usize]);
        let mut leaves = 0;
        let mut number = root;
        loop {
            let node = &self.nodes[number as usize];
            let first = open.len();
            for (slot, child) in (0..).zip(&node.children[..node.count]) {
                if child.owner != MIXED && is_left_out(child.owner) {
                    continue;
                }
                let [low, high] = [child.low - origin, child.high - origin];
                if packet.enters(simd, low, high) {
                    let along = (low + high).dot(packet.middle);
                    open.push(Entered { node: number, child: slot, along, leaves });
                    // The child that lies nearest along the rays comes last, and is visited first.
                    let mut at = open.len() - 1;
                    while at > first && open[at - 1].along < along {
                        open.swap(at, at - 1);
                        at -= 1;
                    }
                }
            }
            // The next node, past leaves.
            loop {
                let Some(Entered { node, child, leaves: before, .. }) = open.pop() else { return };
                let child = &self.nodes[node as usize].children[child as usize];
                if before != leaves && !packet.enters(simd, child.low - origin, child.high - origin) {
                    continue;
                }
                if child.count == 0 {
                    number = child.first;
                    break;
                }
                for triangle in child.first..child.first + child.count {
                    let member = self.members[triangle as usize];
                    if is_left_out(member) {
                        continue;
                    }
                    match self.masks.get(member as usize) {
                        Some(Some(mask)) => self.meet_masked(simd, origin, packet, mask, triangle),
                        _ => packet.meet(simd, origin, &self.triangles[triangle as usize], triangle),
                    }
                }
                leaves += 1;
            }
        }
    }

    #[inline(always)]
    fn hit(&self, packet: &Packet, lane: usize) -> Option<BlockerHit> {
        let triangle = packet.triangle[lane];
        if triangle == u32::MAX {
            return None;
        }
        let member = self.members[triangle as usize];
        let is_behind = self.triangles[triangle as usize].normal.dot(packet.toward(lane)) > 0.0;
        let has_back = self.backs.get(member as usize).is_some_and(Option::is_some);
        Some(BlockerHit {
            distance: packet.distance[lane],
            member,
            index: triangle,
            from_behind: is_behind && !has_back,
            on_back: is_behind && has_back,
        })
    }

    /// Which triangle of the member's mesh a ray meets, and where: the weights of its second and third corner.
    pub fn place(&self, origin: Vec3A, direction: Vec3A, hit: &BlockerHit) -> (u32, [f32; 2]) {
        let Corners { corner, edges, .. } = self.triangles[hit.index as usize];
        let number = self.numbers[hit.index as usize];
        let [second, third] = weights(edges, origin + hit.distance * direction - corner);
        match self.backs.get(hit.member as usize) {
            // A back runs around the other way.
            Some(Some(count)) if hit.on_back => (number + count, [third, second]),
            _ => (number, [second, third]),
        }
    }
}

/// The owner of each node of a hierarchy whose children come after their parents.
fn owners(hierarchy: &Bvh2, members: &[u32]) -> Vec<u32> {
    let mut owners = vec![MIXED; hierarchy.nodes.len()];
    for (index, node) in hierarchy.nodes.iter().enumerate().rev() {
        let first = node.first_index as usize;
        let below = match node.prim_count {
            0 => &owners[first..first + 2],
            count => &members[first..first + count as usize],
        };
        let is_one = below.iter().all(|member| *member == below[0]);
        owners[index] = if is_one { below[0] } else { MIXED };
    }
    owners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::asset::texture::{half_solid, square};
    use crate::sh::quadrature::random_direction;
    use std::sync::Arc;

    /// Against every triangle by itself, where leaves mix two members and where they do not.
    #[test]
    fn packets_find_the_first_triangle() {
        find_the_first_triangle(|number| number % 2);
        find_the_first_triangle(|number| u32::from(number >= 288));
    }

    fn find_the_first_triangle(member_of: impl Fn(u32) -> u32) {
        let mesh = generate::torus(1.0, 0.3, 24, 12);
        let corners: Vec<[Vec3; 3]> = mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect();
        let triangle = |(number, corners): (u32, &[Vec3; 3])| {
            let member = member_of(number);
            BlockerTriangle { member, number, corners: *corners }
        };
        let blockers = Blockers::new((0..).zip(&corners).map(triangle), Vec::new(), Vec::new());
        let mut rng = fastrand::Rng::with_seed(3);
        let mut met = 0;
        for _ in 0..50 {
            let origin = 1.5 * random_direction(&mut rng).as_vec3a();
            let directions: Vec<Vec3A> = (0..37).map(|_| random_direction(&mut rng).as_vec3a()).collect();
            for only_second in [false, true] {
                let hits = blockers.first(origin, &Mat3A::IDENTITY, &directions, &[!only_second, true]);
                let of = if only_second { &[1][..] } else { &[1, 0] };
                let of_members = blockers.first_of(origin, &Mat3A::IDENTITY, &directions, of);
                let distances = |hits: &[Option<BlockerHit>]| -> Vec<Option<f32>> {
                    hits.iter().map(|hit| hit.map(|hit| hit.distance)).collect()
                };
                assert_eq!(distances(&hits), distances(&of_members));
                assert_eq!(hits.len(), directions.len());
                for (direction, hit) in directions.iter().zip(&hits) {
                    let counted = corners.iter().enumerate().filter(|(i, _)| !only_second || member_of(*i as u32) == 1);
                    let distance = |(_, t): (usize, &[Vec3; 3])| {
                        let [v0, v1, v2] = t.map(Vec3A::from);
                        Triangle { v0, v1, v2 }.intersect(&obvhs::ray::Ray::new_inf(origin, *direction))
                    };
                    let wanted = counted.map(distance).fold(f32::INFINITY, f32::min);
                    let found = hit.map_or(f32::INFINITY, |hit| hit.distance);
                    assert!(found == wanted || (found - wanted).abs() < 1e-4, "{found} {wanted}");
                    if let Some(hit) = hit {
                        let (number, [v, w]) = blockers.place(origin, *direction, hit);
                        let [a, b, c] = corners[number as usize].map(Vec3A::from);
                        let place = a + v * (b - a) + w * (c - a);
                        assert!(place.distance(origin + found * *direction) < 1e-4, "{hit:?}");
                    }
                    met += usize::from(hit.is_some());
                }
            }
        }
        assert!((300..3300).contains(&met), "{met}");
        let nothing = Blockers::new([], Vec::new(), Vec::new());
        assert_eq!(nothing.first(Vec3A::ZERO, &Mat3A::IDENTITY, &[Vec3A::X], &[]), [None]);
    }

    /// A ray passes the holes of squares that stand one behind the other, up to the first place that is none.
    #[test]
    fn rays_pass_holes() {
        let mesh = Arc::new(square());
        let texture = half_solid(4, 2);
        let placed = |member: u32, z: f32| {
            let mesh = &mesh;
            (0..2).map(move |number: u32| {
                let corners = mesh.triangles[number as usize].map(|v| mesh.positions[v as usize] + z * Vec3::Z);
                BlockerTriangle { member, number, corners }
            })
        };
        let mask = Mask::new(&mesh, &texture);
        let blockers = Blockers::new(
            placed(0, 1.0).chain(placed(1, 2.0)).chain(placed(2, 3.0)),
            vec![mask.clone(), mask, None],
            Vec::new(),
        );
        for (x, distance) in [(0.3, 1.0), (0.7, 3.0)] {
            let hits = blockers.first(Vec3A::new(x, 0.5, 0.0), &Mat3A::IDENTITY, &[Vec3A::Z], &[true; 3]);
            assert!((hits[0].unwrap().distance - distance).abs() < 1e-5, "{x}: {hits:?}");
        }
    }
}
