//! Own visibility: what a vertex sees past everything that never moves against it, by rays on all cores.
//!
//! One set of rays a vertex gives both forms in which it is stored. They leave in one pattern about every normal, so
//! that what is left of the error is smooth over a surface.
//!
//! - The transfer vector is the clamped cosine, in closed form, less what the blocked rays take: where nothing blocks it
//!   is exact.
//! - The map of [`crate::field::self_visibility`] holds for every node the angle to the nearest edge: where of two rays
//!   side by side one is free and one is blocked, further rays halve the gap until the edge is known to a fraction of a
//!   degree.

use super::packet::{BlockerHit, Blockers};
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::{
    BYTES, LIMIT_RAD, NODES, encode_angle, encode_distance, frame, node_direction, octahedral,
};
use crate::field::silhouette::through_box;
use crate::field::sky_view::{self, cell};
use crate::sh::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, values};
use crate::sh::lobe::clamped_cosine;
use crate::sh::rotation::Rotation;
use glam::{DMat3, DQuat, DVec2, DVec3, Mat3A, Vec3, Vec3A};
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Rays of the pattern along an edge of the square that is mapped to the hemisphere.
const PATTERN_SIDE: usize = 24;
pub(super) const PATTERN: usize = PATTERN_SIDE * PATTERN_SIDE;
/// Cuts, along each side, of a cell of the pattern that the edge of a blocker may cross: beside it a neighbour's ray is of
/// the other state. 1 024 rays alone leave a transfer vector wrong by 0.004 to 0.013 next to a ball, relative to the free
/// one.
const CUTS: usize = 3;
/// Rays just above the horizon, for maps alone, and the sine of their height: the lowest places of the pattern lie 3
/// degrees above it.
const HORIZON: usize = 64;
const HORIZON_HEIGHT: f64 = 0.01;
/// The gap between a free ray and a blocked one is halved until it is no wider than this: 0.6 degrees. Rays of cuts stand
/// 2.4 degrees apart.
const EDGE_GAP: f32 = 0.01;
/// Places that lie on one edge, one behind the other, are this close: 4 degrees.
const CLOSE: f32 = 0.07;
/// Rays that are aimed at a target, along an edge of the square that is mapped to the cone around it.
const AIMED_SIDE: usize = 8;
/// A target that is nearer than this, in its bounding radii, is met by enough rays of the pattern.
const AIMED_FROM: f32 = 2.5;
/// Targets of a point at which rays are aimed: those that send the most light there. Others are left to the pattern.
const MOST_AIMED: usize = 8;

#[derive(Clone, Copy)]
pub(super) struct PatternRay {
    /// z along the normal.
    pub local: Vec3A,
    /// Cosine to the normal times solid angle.
    weight: f64,
    /// The SH basis times the weight, in the normal's frame.
    pub share: [f32; MAX_COEFFICIENTS],
}

impl PatternRay {
    fn new(local: DVec3, weight: f64) -> Self {
        let basis = values(MAX_BANDS, local);
        PatternRay { local: local.as_vec3a(), weight, share: basis.map(|y| (weight * y) as f32) }
    }
}

/// A cell of the pattern, which has the ray of its number.
struct Cell {
    cuts: [PatternRay; CUTS * CUTS],
    /// Cells to the left, to the right, above and below.
    neighbours: [Option<usize>; 4],
}

impl Cell {
    /// The cut beside cut `k` to the right or below, and its cell where it is another one.
    fn beside(&self, k: usize, below: bool) -> Option<(Option<usize>, usize)> {
        let (at, step) = if below { (k / CUTS, CUTS) } else { (k % CUTS, 1) };
        if at + 1 < CUTS {
            return Some((None, k + step));
        }
        let next = self.neighbours[if below { 3 } else { 1 }]?;
        Some((Some(next), k - (CUTS - 1) * step))
    }
}

/// The rays that all points cast.
struct Pattern {
    /// Those of the cells, and those above the horizon.
    rays: Vec<PatternRay>,
    cells: Vec<Cell>,
    /// Rays side by side of which one lies above the horizon.
    low_pairs: Vec<[usize; 2]>,
    nodes: Vec<Vec3A>,
}

impl Pattern {
    fn new() -> Self {
        let mut rays = rays(PATTERN_SIDE);
        // Edges that reach the horizon: these rays weigh nothing in the cosine.
        rays.extend((0..HORIZON).map(|i| {
            let turn = TAU * i as f64 / HORIZON as f64;
            PatternRay::new(DVec3::new(turn.cos(), turn.sin(), HORIZON_HEIGHT).normalize(), 0.0)
        }));
        let low_pairs = (0..HORIZON).flat_map(|i| {
            let local = rays[PATTERN + i].local;
            let nearest = |a: &usize, b: &usize| rays[*a].local.dot(local).total_cmp(&rays[*b].local.dot(local));
            let above = (0..PATTERN).max_by(nearest).expect("a pattern has rays");
            [[PATTERN + i, PATTERN + (i + 1) % HORIZON], [PATTERN + i, above]]
        });
        Pattern {
            low_pairs: low_pairs.collect(),
            cells: cells_of(PATTERN_SIDE),
            nodes: (0..NODES).map(|node| node_direction(node).as_vec3a()).collect(),
            rays,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rays {
    /// 256, to tell whether a surface is fine enough.
    Few,
    Many,
}

/// The cell, as column and row, of every ray of a square of `side` by `side`, in tiles of neighbours, which meet the same
/// boxes.
fn cells(side: usize) -> impl Iterator<Item = [usize; 2]> {
    const TILE: usize = 4;
    (0..side * side).map(move |i| {
        let tile = i / (TILE * TILE);
        let within = i % (TILE * TILE);
        [tile % (side / TILE) * TILE + within % TILE, tile / (side / TILE) * TILE + within / TILE]
    })
}

/// The ray of a cell of a square of `side` by `side`. Rows of rays in the middle of their cells would all meet a straight
/// edge at once. So each is moved within its cell, and along a row, or a column, the moves across it follow the golden
/// ratio: whatever share of a row an edge cuts off, that share of its rays lies beyond.
fn ray_of(cell: [usize; 2], side: usize) -> PatternRay {
    let local = cap(disc(moved(cell, side)), 1.0);
    PatternRay::new(local, local.z * TAU / (side * side) as f64)
}

/// The place in the unit square of the ray of a cell.
fn moved([x, y]: [usize; 2], side: usize) -> [f64; 2] {
    let moved = |at: usize, across: usize| {
        let within = (0.5 + 0.618_033_988_749_894_9 * across as f64 + 0.754_877_666_246_692_7 * at as f64).fract();
        (at as f64 + within) / side as f64
    };
    [moved(x, y), moved(y, x)]
}

fn rays(side: usize) -> Vec<PatternRay> {
    cells(side).map(|cell| ray_of(cell, side)).collect()
}

fn cells_of(side: usize) -> Vec<Cell> {
    let mut cell_at = vec![0; side * side];
    cells(side).enumerate().for_each(|(i, [x, y])| cell_at[y * side + x] = i);
    let cell = |[x, y]: [usize; 2]| {
        let cut = |k: usize| ray_of([x * CUTS + k % CUTS, y * CUTS + k / CUTS], side * CUTS);
        let beside = |x: Option<usize>, y: Option<usize>| {
            x.zip(y).filter(|(x, y)| *x < side && *y < side).map(|(x, y)| cell_at[y * side + x])
        };
        let neighbours = [
            beside(x.checked_sub(1), Some(y)),
            beside(Some(x + 1), Some(y)),
            beside(Some(x), y.checked_sub(1)),
            beside(Some(x), Some(y + 1)),
        ];
        Cell { cuts: std::array::from_fn(cut), neighbours }
    };
    cells(side).map(cell).collect()
}

static FEW_RAYS: LazyLock<Vec<PatternRay>> = LazyLock::new(|| rays(16));

/// 64 rays, to tell where lamps are.
static FEWEST_RAYS: LazyLock<Vec<PatternRay>> = LazyLock::new(|| rays(8));

/// Unit directions all over the sphere, an even number of at most 512.
pub(super) fn directions(count: usize) -> impl Iterator<Item = Vec3A> {
    let upper = FEW_RAYS.iter().map(|ray| ray.local);
    upper.clone().chain(upper.map(|toward| -toward)).step_by(2 * FEW_RAYS.len() / count)
}

/// Rays all over the sphere, each of which weighs its solid angle.
pub(super) fn sphere() -> Vec<PatternRay> {
    let solid_angle = TAU / FEW_RAYS.len() as f64;
    directions(2 * FEW_RAYS.len()).map(|toward| PatternRay::new(toward.as_dvec3(), solid_angle)).collect()
}

/// Places on the unit disc of the rays that are aimed at a target.
static AIMED: LazyLock<Vec<DVec2>> =
    LazyLock::new(|| cells(AIMED_SIDE).map(|cell| disc(moved(cell, AIMED_SIDE))).collect());

static MANY_RAYS: LazyLock<Pattern> = LazyLock::new(Pattern::new);

/// A point of the unit disc for one of the unit square; equal areas stay equal.
///
/// Shirley, Chiu, *A Low Distortion Map Between Disk and Square*, 1997.
fn disc([u, v]: [f64; 2]) -> DVec2 {
    let a = 2.0 * u - 1.0;
    let b = 2.0 * v - 1.0;
    if a.abs() > b.abs() {
        a * DVec2::from_angle(PI / 4.0 * b / a)
    } else if b != 0.0 {
        b * DVec2::from_angle(PI / 2.0 - PI / 4.0 * a / b)
    } else {
        DVec2::ZERO
    }
}

/// The disc lifted to the directions about +z of which 1 - z is at most `height`; equal areas stay equal.
fn cap(place: DVec2, height: f64) -> DVec3 {
    let below = place.length_squared() * height;
    (place * ((2.0 - below) * height).sqrt()).extend(1.0 - below)
}

/// A point of a surface from which rays leave.
#[derive(Clone, Copy)]
pub struct Eye {
    /// Just off the surface, in the blockers' frame.
    pub origin: Vec3,
    /// Unit normal in the object's frame.
    pub normal: Vec3,
    /// Distance below which a hit counts as near, in the blockers' frame.
    pub near: f32,
    /// Rotation from the object's frame to the blockers'.
    pub rotation: DMat3,
    /// The receiver's bounding radius in the blockers' frame.
    pub radius: f64,
}

#[derive(Clone, Debug)]
pub struct Seen {
    /// The point from which it is seen, in the member's frame; [`see`] leaves it 0.
    pub from: Vec3,
    /// What blocked rays take of the clamped cosine, in the normal's frame.
    taken: [f32; MAX_COEFFICIENTS],
    /// Whether no light comes here.
    is_covered: bool,
    pub map: Vec<u8>,
    /// Free shares of the view by cells of the sky, where they are asked for ([`sky_view::pack`]).
    pub sky: Vec<[u8; 2]>,
    /// Share of the cosine-weighted hemisphere that is blocked.
    pub blocked: f64,
    /// Share that is blocked by backs of triangles.
    pub behind: f64,
    /// Share that is blocked by what is near ([`Eye::near`]).
    pub near: f64,
    /// Whether the point lies inside a solid, below a sheet, or close behind something.
    pub buried: bool,
    /// Fronts that the rays met, of [`Rays::Many`] alone.
    pub fronts: Vec<Front>,
}

#[derive(Clone, Copy, Debug)]
pub struct Front {
    pub member: u32,
    /// Triangle of the member's mesh, and the weights of its second and third corner there.
    pub triangle: u32,
    pub weights: [f32; 2],
    /// Place and direction of the ray, in the blockers' frame.
    pub place: Vec3A,
    pub toward: Vec3A,
    /// Whether it lies in a target, or beyond a screen.
    pub apart: bool,
    /// Share of the cosine-weighted hemisphere.
    pub share: f32,
}

impl Seen {
    /// The transfer vector of a point that sees the same in the frame of its own normal: `channel_stride(bands)` floats in
    /// the object's frame.
    pub fn transfer(&self, bands: usize, normal: Vec3) -> Vec<f32> {
        let mut transfer = vec![0.0; channel_stride(bands)];
        if !self.is_covered {
            let normal = normal.as_dvec3();
            let lobe = clamped_cosine(bands, normal);
            let mut taken = [0.0; MAX_COEFFICIENTS];
            Rotation::new(bands, DQuat::from_mat3(&frame(normal))).apply(&self.taken.map(f64::from), &mut taken);
            let all = transfer.iter_mut().zip(&lobe[..coefficient_count(bands)]).zip(&taken);
            all.for_each(|((found, lobe), taken)| *found = (lobe - taken) as f32);
        }
        transfer
    }

    /// Takes all light from the point.
    pub fn cover(&mut self) {
        self.is_covered = true;
        self.fronts.clear();
        self.sky.clear();
        self.blocked = 1.0;
        if let Some((angles, distances)) = self.map.split_at_mut_checked(NODES) {
            angles.fill(encode_angle(-LIMIT_RAD));
            distances.fill(encode_distance(0.0));
        }
    }
}

#[derive(Clone, Copy)]
pub struct Counts<'c> {
    /// For each member whether it blocks at all.
    pub blocks: &'c [bool],
    /// For each member whether light that bounces stays behind it: those that block, and lamps.
    pub reflects: &'c [bool],
    /// Members whose shadows the map has, of those that block; `None` for no map.
    pub in_map: Option<&'c [u32]>,
    /// Whether it matters which parts of the sky are free.
    pub sky: bool,
    pub targets: &'c [Target],
    /// Boxes in the blockers' frame, their least and largest corners, in which something moves that hides what lies beyond.
    pub screens: &'c [[DVec3; 2]],
}

/// A sphere, in the blockers' frame, within which a lamp lights things from close by. They are so much brighter than all
/// else that the few rays of the pattern which meet them show as blotches; rays that are aimed at the sphere take their
/// place.
#[derive(Clone, Copy)]
pub struct Target {
    pub centre: Vec3A,
    pub radius: f32,
    /// Share of its view that the lamp fills: light on it.
    pub lit: f32,
}

impl Target {
    fn has(&self, place: Vec3A) -> bool {
        place.distance_squared(self.centre) < self.radius * self.radius
    }
}

/// The share of the cosine-weighted hemisphere of a place in which the first of all members that reflect light are such
/// as `counts` tells.
pub(super) fn share_of(
    blockers: &Blockers,
    origin: Vec3A,
    to_blockers: &Mat3A,
    reflects: &[bool],
    counts: impl Fn(u32) -> bool,
) -> f64 {
    let rays = &*FEWEST_RAYS;
    let hits = blockers.first(origin, to_blockers, &locals(rays), reflects);
    let met = rays.iter().zip(hits).filter(|(_, hit)| hit.is_some_and(|hit| counts(hit.member)));
    met.map(|(ray, _)| ray.weight / PI).sum()
}

/// Rays that leave one point, in the frame of its hemisphere.
struct Caster<'c> {
    blockers: &'c Blockers,
    origin: Vec3A,
    to_blockers: Mat3A,
    counts: Counts<'c>,
}

impl Caster<'_> {
    /// What rays meet of the members that block.
    fn cast(&self, locals: &[Vec3A]) -> Vec<Option<BlockerHit>> {
        self.blockers.first(self.origin, &self.to_blockers, locals, self.counts.blocks)
    }

    /// The first surfaces that light may bounce from.
    fn cast_at_surfaces(&self, locals: &[Vec3A]) -> Vec<Option<BlockerHit>> {
        self.blockers.first(self.origin, &self.to_blockers, locals, self.counts.reflects)
    }

    /// What rays meet of the members that block, of those whose first surfaces are known: the rays that meet a lamp are
    /// cast again.
    fn past_lamps(&self, locals: &[Vec3A], surfaces: &[Option<BlockerHit>]) -> Vec<Option<BlockerHit>> {
        let is_lamp = |hit: BlockerHit| !self.counts.blocks[hit.member as usize];
        let mut hits = surfaces.to_vec();
        replace_past(surfaces, is_lamp, locals, &mut hits, |locals| self.cast(locals));
        hits
    }

    /// The front that a ray meets, if it meets one. `weight`: cosine to the normal times solid angle.
    fn front(&self, local: Vec3A, weight: f64, hit: &Option<BlockerHit>) -> Option<Front> {
        let hit = hit.as_ref().filter(|hit| !hit.from_behind && weight > 0.0)?;
        let toward = self.to_blockers * local;
        let (triangle, weights) = self.blockers.place(self.origin, toward, hit);
        let place = self.origin + hit.distance * toward;
        let is_beyond = |screen: &[DVec3; 2]| {
            let crossed = through_box(*screen, self.origin.as_dvec3(), toward.as_dvec3());
            crossed.is_some_and(|[from, to]| to > 0.0 && from < f64::from(hit.distance))
        };
        let apart =
            self.counts.targets.iter().any(|target| target.has(place)) || self.counts.screens.iter().any(is_beyond);
        Some(Front { member: hit.member, triangle, weights, place, toward, apart, share: (weight / PI) as f32 })
    }

    /// Replaces the fronts within targets by those that rays meet which are aimed at them.
    fn aim(&self, fronts: &mut Vec<Front>) {
        let fills = |target: &Target| (target.radius / target.centre.distance(self.origin)).powi(2);
        let far = self.counts.targets.iter().filter(|target| fills(target) < AIMED_FROM.powi(-2));
        let mut aimed: Vec<(f32, &Target)> = far.map(|target| (target.lit * fills(target), target)).collect();
        if aimed.is_empty() {
            return;
        }
        aimed.sort_by(|a, b| b.0.total_cmp(&a.0));
        aimed.truncate(MOST_AIMED);
        fronts.retain(|front| !front.apart || aimed.iter().all(|(_, target)| !target.has(front.place)));
        for (number, (_, target)) in aimed.iter().enumerate() {
            let toward = target.centre - self.origin;
            let away = toward.length();
            let sine = f64::from(target.radius / away);
            let height = 1.0 - (1.0 - sine * sine).sqrt();
            let to_local = self.to_blockers.transpose() * Mat3A::from(frame((toward / away).as_dvec3()).as_mat3());
            let ray = |place: &DVec2| to_local * cap(*place, height).as_vec3a();
            let locals: Vec<Vec3A> = AIMED.iter().map(ray).filter(|local| local.z > 0.0).collect();
            let solid_angle = TAU * height / (AIMED_SIDE * AIMED_SIDE) as f64;
            let surfaces = self.cast_at_surfaces(&locals);
            let rays = locals.iter().zip(&surfaces);
            let met = rays.filter_map(|(local, hit)| self.front(*local, solid_angle * f64::from(local.z), hit));
            // What lies in two of them is met by the rays of the first.
            let is_met = |front: &Front| aimed[..number].iter().any(|(_, other)| other.has(front.place));
            fronts.extend(met.filter(|front| target.has(front.place) && !is_met(front)));
        }
    }

    /// How far each ray comes past all that the map counts; infinity where it is free.
    fn map_distances(&self, locals: &[Vec3A]) -> Vec<f32> {
        let in_map = self.counts.in_map.expect("asked for maps alone");
        self.blockers.first_of(self.origin, &self.to_blockers, locals, in_map).iter().map(distance).collect()
    }

    /// The same of rays whose first hits are known: only those that meet what the map does not count are cast again.
    fn map_distances_past(&self, locals: &[Vec3A], hits: &[Option<BlockerHit>]) -> Vec<f32> {
        let in_map = self.counts.in_map.expect("asked for maps alone");
        let is_other = |hit: BlockerHit| !in_map.contains(&hit.member);
        let mut distances: Vec<f32> = hits.iter().map(distance).collect();
        replace_past(hits, is_other, locals, &mut distances, |locals| self.map_distances(locals));
        distances
    }
}

/// Casts the rays again that meet what is passed by, and replaces what is known of them.
fn replace_past<T>(
    hits: &[Option<BlockerHit>],
    is_passed: impl Fn(BlockerHit) -> bool,
    locals: &[Vec3A],
    known: &mut [T],
    cast: impl Fn(&[Vec3A]) -> Vec<T>,
) {
    let again: Vec<usize> = (0..hits.len()).filter(|&i| hits[i].is_some_and(&is_passed)).collect();
    let behind = cast(&again.iter().map(|&i| locals[i]).collect::<Vec<_>>());
    again.into_iter().zip(behind).for_each(|(i, found)| known[i] = found);
}

fn distance(hit: &Option<BlockerHit>) -> f32 {
    hit.map_or(f32::INFINITY, |hit| hit.distance)
}

fn locals<'r>(rays: impl IntoIterator<Item = &'r PatternRay>) -> Vec<Vec3A> {
    rays.into_iter().map(|ray| ray.local).collect()
}

pub fn see(blockers: &Blockers, eye: &Eye, bands: usize, rays: Rays, counts: Counts<'_>) -> Seen {
    let to_object = frame(eye.normal.as_dvec3());
    let caster = Caster {
        blockers,
        origin: Vec3A::from(eye.origin),
        to_blockers: Mat3A::from((eye.rotation * to_object).as_mat3()),
        counts,
    };
    let mut seen = Seen {
        from: Vec3::ZERO,
        taken: [0.0; MAX_COEFFICIENTS],
        is_covered: false,
        map: Vec::new(),
        sky: Vec::new(),
        blocked: 0.0,
        behind: 0.0,
        near: 0.0,
        buried: false,
        fronts: Vec::new(),
    };
    let count = coefficient_count(bands);
    let mut add = |ray: &PatternRay, hit: &Option<BlockerHit>| {
        let Some(found) = hit else { return };
        seen.taken[..count].iter_mut().zip(&ray.share[..count]).for_each(|(sum, share)| *sum += share);
        seen.blocked += ray.weight / PI;
        seen.behind += if found.from_behind { ray.weight / PI } else { 0.0 };
        seen.near += if found.distance < eye.near { ray.weight / PI } else { 0.0 };
    };
    match rays {
        Rays::Few => FEW_RAYS.iter().zip(&caster.cast(&locals(&*FEW_RAYS))).for_each(|(ray, hit)| add(ray, hit)),
        Rays::Many => {
            let found = CellHits::new(&caster);
            let mut fronts = Vec::with_capacity(PATTERN);
            let mut free = [0.0; sky_view::CELLS];
            found.each(|ray, hit, surface| {
                add(ray, hit);
                fronts.extend(caster.front(ray.local, ray.weight, surface));
                if counts.sky && hit.is_none() {
                    free[cell(caster.to_blockers * ray.local)] += (ray.weight / PI) as f32;
                }
            });
            seen.sky = sky_view::pack(&free);
            caster.aim(&mut fronts);
            seen.fronts = fronts;
            if counts.in_map.is_some() {
                seen.map = found.map(&caster, eye.radius);
            }
        }
    }
    seen
}

struct CutCell {
    cell: usize,
    /// Whether an edge of what the map has crosses it.
    at_map_edge: bool,
}

/// What all rays of a point have met.
struct CellHits {
    hits: Vec<Option<BlockerHit>>,
    /// The first surfaces that light may bounce from.
    surfaces: Vec<Option<BlockerHit>>,
    /// Past what the map has; empty without a map, or where that is free.
    distances: Vec<f32>,
    /// First those that an edge of all that blocks crosses.
    cut: Vec<CutCell>,
    /// Of those first cut cells, one after the other.
    cut_hits: Vec<Option<BlockerHit>>,
    cut_surfaces: Vec<Option<BlockerHit>>,
    /// Of all cut cells past what the map has.
    cut_distances: Vec<f32>,
}

/// A place between a free ray and a blocked one.
struct Edge {
    free: Vec3A,
    blocked: Vec3A,
    /// Distance of what blocks.
    away: f32,
}

impl Edge {
    fn middle(&self) -> Vec3A {
        (self.free + self.blocked).normalize()
    }
}

impl CellHits {
    fn new(caster: &Caster<'_>) -> Self {
        let pattern = &*MANY_RAYS;
        // A map of no members is free, and has no edges, which rays above the horizon are for.
        let with_map = caster.counts.in_map.is_some_and(|members| !members.is_empty());
        let toward = locals(&pattern.rays[..if with_map { PATTERN + HORIZON } else { PATTERN }]);
        let surfaces = caster.cast_at_surfaces(&toward);
        let hits = caster.past_lamps(&toward, &surfaces);
        let distances = if with_map { caster.map_distances_past(&toward, &hits) } else { Vec::new() };
        let at_map_edge = |cell: usize| {
            let is_free = |i: usize| distances[i].is_infinite();
            let mut beside = pattern.cells[cell].neighbours.iter().flatten();
            with_map && beside.any(|&other| is_free(other) != is_free(cell))
        };
        // The cell's own ray has no say: where rays that miss a railing kept their cells whole and rays that meet it had
        // them cut, the railing would block too little.
        let at_edge = |cell: &usize| {
            let mut beside = pattern.cells[*cell].neighbours.iter().flatten().map(|&other| hits[other].is_none());
            let first = beside.next();
            beside.any(|free| Some(free) != first)
        };
        let (at_edges, others): (Vec<usize>, Vec<usize>) = (0..PATTERN).partition(at_edge);
        let only_in_map: Vec<usize> = others.into_iter().filter(|&cell| at_map_edge(cell)).collect();
        let cuts = |cells: &[usize]| locals(cells.iter().flat_map(|&cell| &pattern.cells[cell].cuts));
        let cut_toward = cuts(&at_edges);
        let cut_surfaces = caster.cast_at_surfaces(&cut_toward);
        let cut_hits = caster.past_lamps(&cut_toward, &cut_surfaces);
        let mut cut_distances = Vec::new();
        if with_map {
            cut_distances = caster.map_distances_past(&cut_toward, &cut_hits);
            cut_distances.extend(caster.map_distances(&cuts(&only_in_map)));
        }
        let cut = at_edges.into_iter().map(|cell| CutCell { cell, at_map_edge: at_map_edge(cell) });
        let cut = cut.chain(only_in_map.into_iter().map(|cell| CutCell { cell, at_map_edge: true })).collect();
        CellHits { hits, surfaces, distances, cut, cut_hits, cut_surfaces, cut_distances }
    }

    /// The rays that share the hemisphere: of cells, or of their cuts.
    fn each(&self, mut add: impl FnMut(&PatternRay, &Option<BlockerHit>, &Option<BlockerHit>)) {
        let pattern = &*MANY_RAYS;
        let mut whole = [true; PATTERN];
        let met = self.cut_hits.iter().zip(&self.cut_surfaces);
        let cuts = self.cut.iter().flat_map(|cut| pattern.cells[cut.cell].cuts.iter().map(|ray| (cut.cell, ray)));
        for ((cell, ray), (hit, surface)) in cuts.zip(met) {
            whole[cell] = false;
            add(ray, hit, surface);
        }
        let cells = (0..PATTERN).filter(|cell| whole[*cell]);
        cells.for_each(|cell| add(&pattern.rays[cell], &self.hits[cell], &self.surfaces[cell]));
    }

    /// Places at the edges of what the map has.
    fn edges(&self, caster: &Caster<'_>) -> Vec<Edge> {
        let pattern = &*MANY_RAYS;
        let mut edges = Vec::new();
        let mut add = |a: (Vec3A, f32), b: (Vec3A, f32)| match (a.1.is_infinite(), b.1.is_infinite()) {
            (true, false) => edges.push(Edge { free: a.0, blocked: b.0, away: b.1 }),
            (false, true) => edges.push(Edge { free: b.0, blocked: a.0, away: a.1 }),
            _ => {}
        };
        let ray = |i: usize| (pattern.rays[i].local, self.distances[i]);
        pattern.low_pairs.iter().for_each(|pair| add(ray(pair[0]), ray(pair[1])));
        let mut cut_of = [None; PATTERN];
        let at_map_edge = || self.cut.iter().enumerate().filter(|(_, cut)| cut.at_map_edge);
        at_map_edge().for_each(|(i, cut)| cut_of[cut.cell] = Some(i));
        let cut_ray = |i: usize, k: usize| {
            (pattern.cells[self.cut[i].cell].cuts[k].local, self.cut_distances[i * CUTS * CUTS + k])
        };
        for (i, CutCell { cell, .. }) in at_map_edge() {
            for k in 0..CUTS * CUTS {
                for below in [false, true] {
                    let Some((other, l)) = pattern.cells[*cell].beside(k, below) else { continue };
                    // A cell that is not cut is of one state with this one's ray: the edge runs between other cuts.
                    if let Some(j) = other.map_or(Some(i), |other| cut_of[other]) {
                        add(cut_ray(i, k), cut_ray(j, l));
                    }
                }
            }
        }
        loop {
            let is_wide = |edge: &&mut Edge| edge.free.distance_squared(edge.blocked) > EDGE_GAP * EDGE_GAP;
            let wide: Vec<&mut Edge> = edges.iter_mut().filter(is_wide).collect();
            if wide.is_empty() {
                break;
            }
            let middles: Vec<Vec3A> = wide.iter().map(|edge| edge.middle()).collect();
            let distances = caster.map_distances(&middles);
            for ((edge, middle), distance) in wide.into_iter().zip(middles).zip(distances) {
                if distance.is_infinite() {
                    edge.free = middle;
                } else {
                    edge.blocked = middle;
                    edge.away = distance;
                }
            }
        }
        edges
    }

    fn map(&self, caster: &Caster<'_>, radius: f64) -> Vec<u8> {
        let mut map = vec![u8::MAX; BYTES];
        if self.distances.iter().all(|distance| distance.is_infinite()) {
            map[..NODES].fill(encode_angle(LIMIT_RAD));
            return map;
        }
        let nodes = &MANY_RAYS.nodes;
        let here = caster.map_distances(nodes);
        let edges: Vec<(Vec3A, f32)> = self.edges(caster).iter().map(|edge| (edge.middle(), edge.away)).collect();
        let mut close = Close { nearest: usize::MAX, places: Vec::new() };
        for (node, &toward) in nodes.iter().enumerate() {
            let nearest = nearest_to(toward, &edges);
            let angle = nearest.map_or(LIMIT_RAD, |nearest| close.angle_to_edge(toward, nearest, &edges));
            let edge = nearest.map(|nearest| edges[nearest]);
            let free = here[node].is_infinite();
            map[node] = encode_angle(if free { angle } else { -angle });
            let (way, away) = if free { edge.unwrap_or((toward, f32::INFINITY)) } else { (toward, here[node]) };
            map[NODES + node] = encode_distance(f64::from(away) * octahedral(way.as_dvec3()) / radius);
        }
        map
    }
}

fn nearest_to(toward: Vec3A, places: &[(Vec3A, f32)]) -> Option<usize> {
    let mut nearest = None;
    let mut most = f32::NEG_INFINITY;
    for (index, (place, _)) in places.iter().enumerate() {
        let cosine = place.dot(toward);
        if cosine > most {
            most = cosine;
            nearest = Some(index);
        }
    }
    nearest
}

/// Places on the edge that runs through one of them: steps from there. Neighbouring nodes have the same.
struct Close {
    nearest: usize,
    places: Vec<Vec3A>,
}

impl Close {
    /// Angle from a direction to the edge that runs through its nearest place and those close to it, in radians.
    fn angle_to_edge(&mut self, toward: Vec3A, nearest: usize, edges: &[(Vec3A, f32)]) -> f64 {
        let at = edges[nearest].0;
        if self.nearest != nearest {
            self.nearest = nearest;
            self.places.clear();
            let steps = edges.iter().map(|(place, _)| *place - at);
            self.places.extend(steps.filter(|step| step.length_squared() < CLOSE * CLOSE));
        }
        let along = |step: &Vec3A| {
            let share = (toward - at).dot(*step) / step.length_squared().max(f32::MIN_POSITIVE);
            toward.dot((at + share.clamp(0.0, 1.0) * *step).normalize())
        };
        // Angles below 0.02 degrees are lost in the cosine; a map's steps are 0.35 degrees.
        f64::from(self.places.iter().map(along).fold(toward.dot(at), f32::max).min(1.0)).acos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::bake::packet::BlockerTriangle;
    use crate::field::self_visibility::decode_angle;
    use crate::sh::quadrature::even_directions;

    fn blockers(triangles: impl Iterator<Item = (u32, [Vec3; 3])>) -> Blockers {
        let triangle = |(member, corners)| BlockerTriangle { member, number: 0, corners };
        Blockers::new(triangles.map(triangle), Vec::new(), Vec::new())
    }

    /// The view from a place upwards; `in_map` are members that its map has.
    fn see_up(blockers: &Blockers, origin: Vec3, in_map: Option<&[u32]>) -> Seen {
        let eye = Eye { origin, normal: Vec3::Y, near: 0.0, rotation: DMat3::IDENTITY, radius: 1.0 };
        let all = &[true; 8];
        let counts = Counts { blocks: all, reflects: all, in_map, sky: false, targets: &[], screens: &[] };
        see(blockers, &eye, 4, Rays::Many, counts)
    }

    /// A receiver at the origin that looks up at a ball of radius 1 whose centre lies `toward`.
    fn under_a_ball(toward: DVec3, with_map: bool) -> Seen {
        let ball = generate::sphere(1.0, 5);
        let corners = ball.triangles.iter().map(|t| (7, t.map(|i| ball.positions[i as usize] + toward.as_vec3())));
        see_up(&blockers(corners), Vec3::ZERO, with_map.then_some(&[7]))
    }

    /// Against the cosine over all that the ball leaves free.
    #[test]
    fn a_ball_takes_its_cap_from_the_cosine() {
        for toward in [
            DVec3::new(0.0, 2.0, 0.0),
            DVec3::new(1.5, 1.5, 0.3),
            DVec3::new(3.0, 0.5, -2.0),
            DVec3::new(0.9, 1.9, 0.0),
            DVec3::new(0.4, 1.6, 1.4),
        ] {
            let seen = under_a_ball(toward, false);
            let mut wanted = [0.0; MAX_COEFFICIENTS];
            const COUNT: usize = 400_000;
            for direction in even_directions(COUNT) {
                let off = toward.length_squared() - direction.dot(toward).powi(2);
                let blocked = direction.dot(toward) > 0.0 && off < 1.0;
                if !blocked && direction.y > 0.0 {
                    let weight = 2.0 * TAU * direction.y / COUNT as f64;
                    wanted.iter_mut().zip(values(4, direction)).for_each(|(sum, y)| *sum += weight * y);
                }
            }
            let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
            let error = square(&mut seen.transfer(4, Vec3::Y).iter().zip(&wanted).map(|(a, b)| f64::from(*a) - b));
            let whole = square(&mut wanted.iter().copied());
            println!("{toward}: {:.4}", error / whole);
            assert!(error < 0.006 * whole, "{toward}: {error} of {whole}");
        }
    }

    /// A railing of bars 1.4 degrees wide, from places beside it.
    #[test]
    fn thin_bars_block_no_less_than_their_share() {
        let bar = |x: f32| {
            let corners = [[-0.0125, -1.0], [0.0125, -1.0], [0.0125, 2.0], [-0.0125, 2.0]];
            let [a, b, c, d] = corners.map(|[across, y]| Vec3::new(x + across, y, 1.0));
            [(0, [a, b, c]), (0, [a, c, d])]
        };
        let blockers = blockers((-20..20).flat_map(|i| bar(0.15 * i as f32)));
        let [mut mean, mut square] = [0.0; 2];
        const PLACES: usize = 400;
        for place in 0..PLACES {
            let origin = Vec3::new(0.00371 * place as f32, 0.0, 0.001 * place as f32);
            let directions: Vec<Vec3A> = even_directions(40_000).filter(|d| d.y > 0.0).map(|d| d.as_vec3a()).collect();
            let hits = blockers.first(origin.into(), &Mat3A::IDENTITY, &directions, &[true]);
            let wanted: f64 =
                directions.iter().zip(&hits).filter(|(_, hit)| hit.is_some()).map(|(d, _)| f64::from(d.y)).sum();
            let wanted = wanted / directions.iter().map(|d| f64::from(d.y)).sum::<f64>();
            let found = see_up(&blockers, origin, None).blocked;
            mean += (found / wanted - 1.0) / PLACES as f64;
            square += (found / wanted - 1.0).powi(2) / PLACES as f64;
        }
        println!("mean {mean:.4}, root mean square {:.4}", square.sqrt());
        assert!(mean.abs() < 0.03 && square.sqrt() < 0.22, "{mean} {}", square.sqrt());
    }

    #[test]
    fn maps_know_the_edge_and_the_distance_of_a_ball() {
        let toward = DVec3::new(0.0, 2.0, 0.0);
        let map = under_a_ball(toward, true).map;
        let half_rad = 0.5_f64.asin();
        let mut worst = [0.0_f64; 2];
        for node in 0..NODES {
            let direction = frame(DVec3::Y) * node_direction(node);
            let wanted = (direction.angle_between(toward) - half_rad).clamp(-LIMIT_RAD, LIMIT_RAD);
            let found = decode_angle(map[node]);
            let near = usize::from(wanted.abs() > 0.2);
            worst[near] = worst[near].max((found - wanted).abs().to_degrees());
        }
        // The nearest ray of the other state may stand aside of the nearest edge.
        assert!(worst[0] < 2.0 && worst[1] < 4.0, "{worst:?} degrees");
        let nearest = (0..NODES).min_by(|a, b| node_direction(*b).z.total_cmp(&node_direction(*a).z)).unwrap();
        let distance = crate::field::self_visibility::decode_distance(map[NODES + nearest]).exp2();
        let distance = distance / octahedral(node_direction(nearest));
        assert!((0.95..1.15).contains(&distance), "{distance}");
    }

    #[test]
    fn what_the_map_leaves_out_still_blocks_the_sky() {
        let square = |height: f32| {
            let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, z]| Vec3::new(x, height, z));
            [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
        };
        let near = square(1.0).map(|t| (0, t));
        let far = square(0.5).map(|t| (1, t));
        let see_with = |in_map: &[u32], corners: &[(u32, [Vec3; 3])]| {
            see_up(&blockers(corners.iter().copied()), Vec3::ZERO, Some(in_map))
        };
        // The member that the map leaves out stands in front of the one that it has.
        let both = see_with(&[0], &[&near[..], &far[..]].concat());
        assert!(both.blocked > 0.98, "{}", both.blocked);
        assert_eq!(both.map, see_with(&[0, 1], &near).map);
        let free = see_with(&[], &near);
        assert!(free.map[..NODES].iter().all(|angle| decode_angle(*angle) > 0.7) && free.blocked > 0.98);
        assert!(free.behind < 0.01 || free.behind > 0.9);
    }
}
