//! Refines surfaces where their own visibility varies, and beside lamps, under a budget of vertices.
//!
//! An edge is split where the transfer vector at its middle differs from the mean of its ends'. Edges come in the order
//! of that difference times the area of their triangles, which is what the difference adds to a picture: by squared
//! lengths the bars of window frames take all that a wall behind a blackboard needs. A triangle is bisected at its
//! longest edge first, so that angles stay bounded (Rivara, *Mesh Refinement Processes Based on the Generalized
//! Bisection of Simplices*, 1984). Both sides of an edge are split together: there are no T-junctions.

use super::own_visibility::Rays;
use super::surfaces::{GroupSpace, Place, triangles_around};
use crate::asset::Mesh;
use crate::asset::mesh::Attributes;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// Least difference of transfer vectors, relative to the clamped cosine's, for which an edge is split.
const LEAST_DIFFERENCE: f32 = 0.03;
/// Length of the clamped cosine as a vector of four bands.
const COSINE_LENGTH: f32 = 1.445;
/// Difference that an edge counts as that passes through something, as a floor's below a wall between two rooms: what is
/// to its two sides has nothing to do with each other, though both may see the same of the sky, or none.
const CROSSED: f32 = 0.1;
/// Cosine between the normals of an edge's ends above which a line from one to the other lies along the surface.
pub(super) const FLAT: f32 = 0.9999;
/// Once all differences, each times the area at its edge, are less than this share of the surfaces' area, only large
/// ones and edges that pass through something are split. A room with its lamp has 18 300 vertices for 21 800.
const MOST_LEFT: f32 = 0.0025;
/// Of the vertices that may be added one in so many follows the shadows of suns.
const SUNS_SHARE: usize = 4;
/// Weights of a triangle's corners at the places where a sun is looked for.
pub(super) const ON_TRIANGLE: [[f32; 3]; 10] = [
    [0.96, 0.02, 0.02],
    [0.02, 0.96, 0.02],
    [0.02, 0.02, 0.96],
    [0.65, 0.33, 0.02],
    [0.33, 0.02, 0.65],
    [0.02, 0.65, 0.33],
    [0.33, 0.65, 0.02],
    [0.65, 0.02, 0.33],
    [0.02, 0.33, 0.65],
    [0.34, 0.33, 0.33],
];
/// Of the vertices that may be added one in so many stands near lamps.
const LAMPS_SHARE: usize = 8;
/// Where triangles around a vertex are held to be on one side, on the way to their middles.
const PARTED: f32 = 0.1;
/// Share of the vertices by which a round may grow a group, so that the worst edges are split first.
const GROWTH: f64 = 0.35;

/// A surface in the making. Vertices are only ever added.
pub(super) struct Refined<'g> {
    /// The space in which its points are seen.
    space: GroupSpace<'g>,
    is_flat: bool,
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub attributes: Attributes,
    pub triangles: Vec<[u32; 3]>,
    /// The triangle of the mesh that each is a part of.
    pub parents: Vec<u32>,
    /// Equal positions have equal numbers.
    places: Vec<u32>,
    place_of: HashMap<[u32; 3], u32>,
    /// Transfer vectors of the vertices; `None` where no rays are cast yet.
    transfers: Vec<Option<Vec<f32>>>,
    /// Transfer vectors at the middles of edges between two vertices, and their difference to the ends' mean.
    middles: HashMap<(u32, u32), (Vec<f32>, f32)>,
}

type Edge = (u32, u32);

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}

pub(super) fn sides([a, b, c]: [u32; 3]) -> [Edge; 3] {
    [edge(a, b), edge(b, c), edge(c, a)]
}

impl<'g> Refined<'g> {
    pub fn new(mesh: &Mesh, space: GroupSpace<'g>) -> Self {
        let mut refined = Refined {
            space,
            is_flat: mesh.is_flat(),
            positions: Vec::new(),
            normals: mesh.normals.clone(),
            attributes: mesh.attributes(),
            triangles: mesh.triangles.clone(),
            parents: (0..mesh.triangles.len() as u32).collect(),
            places: Vec::new(),
            place_of: HashMap::new(),
            transfers: vec![None; mesh.positions.len()],
            middles: HashMap::new(),
        };
        mesh.positions.iter().for_each(|&position| refined.add_position(position));
        refined
    }

    fn add_position(&mut self, position: Vec3) {
        let next = self.place_of.len() as u32;
        let key = (position + Vec3::ZERO).to_array().map(f32::to_bits);
        self.places.push(*self.place_of.entry(key).or_insert(next));
        self.positions.push(position);
    }

    /// Gives every vertex of a plane that something divides, as a roof does the wall above it from that below, a copy for
    /// each side.
    fn part(&mut self) {
        let around = triangles_around(self.positions.len(), &self.triangles);
        let nudges = self.space.nudges(&self.positions, &self.normals, &self.triangles);
        // For each vertex the triangles of every side.
        let sides = |v: usize| -> Vec<Vec<u32>> {
            let normal = self.normals[v];
            let corners = |of: u32| self.triangles[of as usize].map(|corner| self.positions[corner as usize]);
            let is_flat = |of: &u32| {
                let [a, b, c] = corners(*of);
                (b - a).cross(c - a).normalize_or_zero().dot(normal) > FLAT
            };
            let mut sides: Vec<Vec<u32>> = Vec::new();
            if !around[v].iter().all(is_flat) {
                return sides;
            }
            let inside = |of: u32| {
                let middle = corners(of).iter().sum::<Vec3>() / 3.0;
                self.positions[v].lerp(middle, PARTED) + nudges[v].dot(normal) * normal
            };
            for &of in &around[v] {
                let is_beside = |side: &&mut Vec<u32>| !self.space.is_between(inside(side[0]), inside(of));
                match sides.iter_mut().find(is_beside) {
                    Some(side) => side.push(of),
                    None => sides.push(vec![of]),
                }
            }
            sides
        };
        let sides: Vec<Vec<Vec<u32>>> = (0..self.positions.len()).into_par_iter().map(sides).collect();
        for (v, sides) in sides.into_iter().enumerate() {
            for side in sides.into_iter().skip(1) {
                let copy = self.positions.len() as u32;
                self.add_position(self.positions[v]);
                self.normals.push(self.normals[v]);
                self.attributes.add_middle(v, v);
                self.transfers.push(None);
                for of in side {
                    let corners = self.triangles[of as usize].iter_mut();
                    corners.filter(|corner| **corner as usize == v).for_each(|corner| *corner = copy);
                }
            }
        }
    }

    /// The finished mesh, of the shape and name of `mesh`.
    pub fn into_mesh(self, mesh: &Mesh) -> Mesh {
        mesh.refined(self.positions, self.normals, self.attributes, self.triangles)
    }

    fn triangle_area(&self, triangle: &[u32; 3]) -> f32 {
        let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
        0.5 * (b - a).cross(c - a).length()
    }

    fn area(&self) -> f32 {
        self.triangles.iter().map(|triangle| self.triangle_area(triangle)).sum()
    }

    fn length(&self, (a, b): Edge) -> f32 {
        self.positions[a as usize].distance(self.positions[b as usize])
    }

    /// The edge in terms of places, which both of its sides share.
    fn shared(&self, (a, b): Edge) -> Edge {
        edge(self.places[a as usize], self.places[b as usize])
    }

    fn edges(&self) -> HashSet<Edge> {
        self.triangles.iter().flat_map(|triangle| sides(*triangle)).collect()
    }

    /// Casts rays from the vertices that have no transfer vector yet, and from the middles of edges longer than
    /// `least_m`.
    fn look(&mut self, least_m: f32) {
        let nudges = self.space.nudges(&self.positions, &self.normals, &self.triangles);
        let Refined { space, transfers, positions, normals, .. } = self;
        transfers.par_iter_mut().enumerate().for_each(|(v, transfer)| {
            transfer.get_or_insert_with(|| {
                let place = Place { position: positions[v], normal: normals[v], nudge: nudges[v], edge: 0.0 };
                space.transfer(&space.see(place, Rays::Few), normals[v])
            });
        });
        let mut edges: Vec<Edge> = self.edges().into_iter().collect();
        edges.retain(|edge| !self.middles.contains_key(edge) && self.length(*edge) > least_m);
        edges.sort_unstable();
        let space = &self.space;
        let transfer_of = |v: usize| self.transfers[v].as_ref().expect("rays are cast from every vertex above");
        let middle = |&(a, b): &Edge| {
            let [a_index, b_index] = [a as usize, b as usize];
            let position = 0.5 * (self.positions[a_index] + self.positions[b_index]);
            let normal = (self.normals[a_index] + self.normals[b_index]).normalize_or(self.normals[a_index]);
            let nudge = 0.5 * (nudges[a_index] + nudges[b_index]);
            let seen = space.see(Place { position, normal, nudge, edge: 0.0 }, Rays::Few);
            let transfer = space.transfer(&seen, normal);
            let ends = transfer_of(a_index).iter().zip(transfer_of(b_index));
            let squares = transfer.iter().zip(ends).map(|(middle, (a, b))| (middle - 0.5 * (a + b)).powi(2));
            let difference = if seen.buried { 0.0 } else { squares.sum::<f32>().sqrt() / COSINE_LENGTH };
            let is_flat = self.normals[a_index].dot(self.normals[b_index]) > FLAT;
            let place = |v: usize| self.positions[v] + nudges[v];
            let is_crossed = difference < CROSSED && is_flat && space.is_between(place(a_index), place(b_index));
            let difference = if is_crossed { CROSSED } else { difference };
            ((a, b), (transfer, difference))
        };
        let found: Vec<_> = edges.par_iter().map(middle).collect();
        self.middles.extend(found);
    }

    /// Edges whose middle differs: the difference, the area of the triangles at the edge in the group, and its places.
    fn candidates(&self) -> Vec<(f32, f32, Edge)> {
        let mut worst: HashMap<Edge, (f32, f32)> = HashMap::new();
        for triangle in &self.triangles {
            let area = self.space.scale().powi(2) * self.triangle_area(triangle);
            for edge in sides(*triangle) {
                let Some((_, difference)) = self.middles.get(&edge) else { continue };
                let found = worst.entry(self.shared(edge)).or_default();
                found.0 = found.0.max(*difference);
                found.1 += area;
            }
        }
        worst.into_iter().map(|(edge, (difference, area))| (difference, area, edge)).collect()
    }

    /// The longest edges of triangles on which one of the suns shines in parts, where they are longer than `least_m`, by
    /// their places. `even` keeps triangles that were found not to be.
    fn half_lit(&self, suns: &[DVec3], least_m: f32, even: &mut HashSet<[u32; 3]>) -> HashSet<Edge> {
        let space = &self.space;
        let nudges = space.nudges(&self.positions, &self.normals, &self.triangles);
        let suns: Vec<(DVec3, Vec3)> = suns.iter().map(|sun| (*sun, space.local(*sun))).collect();
        let is_half_lit = |triangle: &[u32; 3]| {
            let corners = triangle.map(|v| self.positions[v as usize]);
            let nudges = triangle.map(|v| nudges[v as usize]);
            let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let mix = |of: [Vec3; 3], [a, b, c]: [f32; 3]| a * of[0] + b * of[1] + c * of[2];
            suns.iter().filter(|(_, local)| across.dot(*local) > 0.0).any(|(sun, _)| {
                let mut lit = ON_TRIANGLE.iter().map(|at| space.sees(mix(corners, *at) + mix(nudges, *at), *sun));
                let first = lit.next();
                lit.any(|lit| Some(lit) != first)
            })
        };
        let longest = |triangle: &[u32; 3]| self.longest(&sides(*triangle));
        let is_open = |triangle: &&[u32; 3]| self.length(longest(triangle)) > least_m && !even.contains(*triangle);
        let open: Vec<[u32; 3]> = self.triangles.iter().filter(is_open).copied().collect();
        let (half_lit, others): (Vec<_>, Vec<_>) = open.into_par_iter().partition(is_half_lit);
        even.extend(others);
        half_lit.iter().map(|triangle| self.shared(longest(triangle))).collect()
    }

    /// Edges that are longer than they are far from a lamp, and than it is wide, by their places.
    fn beside_lamps(&self, least: f32) -> HashSet<Edge> {
        let lamps = self.space.lamps();
        if lamps.is_empty() {
            return HashSet::new();
        }
        let placed: Vec<Vec3> = self.positions.iter().map(|position| self.space.placed(*position).into()).collect();
        let is_long = |&(a, b): &Edge| {
            let [from, to] = [a, b].map(|v| placed[v as usize]);
            let length = from.distance(to);
            length > least && lamps.iter().any(|lamp| length > lamp.width.max(lamp.distance(from, to)))
        };
        self.edges().into_iter().filter(is_long).map(|edge| self.shared(edge)).collect()
    }

    /// Splits edges, given by their places, and those longest edges of triangles that have to be split before them.
    fn split(&mut self, mut marked: HashSet<Edge>) {
        loop {
            let before = marked.len();
            for triangle in &self.triangles {
                let sides = sides(*triangle);
                if sides.iter().any(|side| marked.contains(&self.shared(*side))) {
                    marked.insert(self.shared(self.longest(&sides)));
                }
            }
            if marked.len() == before {
                break;
            }
        }
        let mut middle_of: HashMap<Edge, u32> = HashMap::new();
        let mut done = Vec::with_capacity(self.triangles.len());
        let mut open: Vec<([u32; 3], u32)> =
            std::mem::take(&mut self.triangles).into_iter().zip(std::mem::take(&mut self.parents)).collect();
        open.reverse();
        while let Some(([a, b, c], parent)) = open.pop() {
            let mut sides = sides([a, b, c]).to_vec();
            sides.retain(|side| marked.contains(&self.shared(*side)));
            if sides.is_empty() {
                done.push(([a, b, c], parent));
                continue;
            }
            let side = self.longest(&sides);
            let middle = *middle_of.entry(side).or_insert_with(|| self.add_middle(side));
            let [a, b, c] = match side {
                side if side == edge(a, b) => [a, b, c],
                side if side == edge(b, c) => [b, c, a],
                _ => [c, a, b],
            };
            open.push(([middle, b, c], parent));
            open.push(([a, middle, c], parent));
        }
        (self.triangles, self.parents) = done.into_iter().unzip();
    }

    /// The longest side; of equal ones that of the lower places, the same for both triangles at an edge.
    fn longest(&self, sides: &[Edge]) -> Edge {
        let key = |side: &Edge| (self.length(*side), std::cmp::Reverse(self.shared(*side)));
        let longer = |a: &Edge, b: &Edge| key(a).0.total_cmp(&key(b).0).then_with(|| key(a).1.cmp(&key(b).1));
        sides.iter().copied().max_by(longer).expect("a triangle has sides")
    }

    fn add_middle(&mut self, (a, b): Edge) -> u32 {
        let [low, high] = [a as usize, b as usize];
        self.add_position(0.5 * (self.positions[low] + self.positions[high]));
        self.normals.push((self.normals[low] + self.normals[high]).normalize_or(self.normals[low]));
        self.attributes.add_middle(low, high);
        self.transfers.push(self.middles.remove(&(a, b)).map(|(transfer, _)| transfer));
        self.positions.len() as u32 - 1
    }

    fn cut_longest(&mut self, most_m: f32, budget: usize) {
        while self.positions.len() < budget {
            let long: HashSet<Edge> =
                self.edges().into_iter().filter(|e| self.length(*e) > most_m).map(|e| self.shared(e)).collect();
            if long.is_empty() {
                break;
            }
            self.split(long);
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    /// Vertices of all surfaces together.
    pub vertices: usize,
    /// Longest edge of flat surfaces, in the group's space.
    pub flat_edge: f32,
    /// Longest edge of all others.
    pub edge: f32,
    /// Edges up to this length are never split.
    pub least_edge: f32,
    /// Longest edge of a triangle that the edge of a sun's shadow crosses.
    pub sun_edge: f32,
}

pub(super) fn vertex_count(surfaces: &[Refined<'_>]) -> usize {
    surfaces.iter().map(|refined| refined.positions.len()).sum()
}

/// Splits the edges that `mark` finds of each surface, by its index, until there are none or the budget is spent.
fn split_marked(
    surfaces: &mut [Refined<'_>],
    budget: usize,
    mut mark: impl FnMut(usize, &Refined<'_>) -> HashSet<Edge>,
) {
    loop {
        let mut is_done = true;
        for (index, refined) in surfaces.iter_mut().enumerate() {
            let marked = mark(index, refined);
            is_done &= marked.is_empty();
            refined.split(marked);
        }
        if is_done || vertex_count(surfaces) >= budget {
            break;
        }
    }
}

/// Refines the surfaces of a group together. `told` hears how many vertices there are.
pub(super) fn refine(surfaces: &mut [Refined<'_>], suns: &[DVec3], limits: &Limits, told: &dyn Fn(usize)) {
    let start = vertex_count(surfaces);
    if start >= limits.vertices {
        return;
    }
    let share = (limits.vertices - start) / 2;
    for refined in surfaces.iter_mut() {
        refined.part();
        let most = if refined.is_flat { limits.flat_edge } else { limits.edge };
        let budget = refined.positions.len() + share;
        refined.cut_longest(most / refined.space.scale(), budget);
    }
    // Light falls off by the square of the distance along edges beside lamps: the cord of one would be lit from end to end
    // by the bulb at its lower one.
    let budget = vertex_count(surfaces) + (limits.vertices - start) / LAMPS_SHARE;
    split_marked(surfaces, budget, |_, refined| refined.beside_lamps(limits.least_edge));
    let cut = vertex_count(surfaces);
    if !suns.is_empty() {
        let budget = cut + (limits.vertices - start) / SUNS_SHARE;
        // The light that bounces off a surface is that of its vertices: through a window between two of them no sun would
        // come in, and through one with a vertex it would shine on all that is nearest to that.
        let mut even = vec![HashSet::new(); surfaces.len()];
        split_marked(surfaces, budget, |index, refined| {
            refined.half_lit(suns, limits.sun_edge / refined.space.scale(), &mut even[index])
        });
    }
    log::debug!(
        "{start} vertices, {cut} with edges cut that are long or beside lamps, {} along edges of shadows, at most {}",
        vertex_count(surfaces),
        limits.vertices
    );
    let area: f32 = surfaces.iter().map(|refined| refined.area() * refined.space.scale().powi(2)).sum();
    loop {
        let before = vertex_count(surfaces);
        told(before);
        if before >= limits.vertices {
            break;
        }
        let mut candidates = Vec::new();
        for (index, refined) in surfaces.iter_mut().enumerate() {
            refined.look(limits.least_edge / refined.space.scale());
            let found = refined.candidates().into_iter();
            candidates.extend(found.filter(|(difference, ..)| *difference > LEAST_DIFFERENCE).map(|c| (index, c)));
        }
        let weight = |(_, (difference, area, _)): &(usize, (f32, f32, Edge))| difference * area;
        candidates.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then_with(|| (a.0, a.1.2).cmp(&(b.0, b.1.2))));
        if candidates.iter().map(weight).sum::<f32>() < MOST_LEFT * area {
            candidates.retain(|(_, (difference, ..))| *difference >= CROSSED);
        }
        let room = (limits.vertices - before).min((GROWTH * before as f64) as usize + 64);
        // An edge of two triangles adds one vertex or two, and as many again where longer edges go first.
        candidates.truncate((room / 2).max(1));
        if candidates.is_empty() {
            break;
        }
        for (index, refined) in surfaces.iter_mut().enumerate() {
            let marked: HashSet<Edge> = candidates.iter().filter(|c| c.0 == index).map(|c| c.1.2).collect();
            if !marked.is_empty() {
                refined.split(marked);
            }
        }
        if vertex_count(surfaces) == before {
            break;
        }
    }
}
