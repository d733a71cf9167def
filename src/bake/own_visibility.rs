//! Own visibility: what a vertex sees past everything that never moves against it, by rays on all cores.
//!
//! One set of rays a vertex gives both forms in which it is stored. They leave in one pattern about every normal, so
//! that what is left of the error is smooth over a surface.
//!
//! - The transfer vector is the clamped cosine, in closed form, less what the blocked rays take: where nothing blocks it
//!   is exact.
//! - The map of [`crate::field::self_visibility`] holds for every node the angle to the nearest ray of the other state.
//!   Further rays halve the gap between the two until the edge is known to a fraction of a degree.

use super::packet::{BlockerHit, Blockers};
use crate::field::quantity::channel_stride;
use crate::field::self_visibility::{BYTES, LIMIT_RAD, NODES, encode_angle, encode_distance, frame, node_direction};
use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count, evaluate};
use crate::sh::lobe::clamped_cosine;
use glam::{DMat3, DVec3, Mat3A, Vec3, Vec3A};
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Rays of the pattern along an edge of the square that is mapped to the hemisphere.
const PATTERN_SIDE: usize = 32;
pub(super) const PATTERN: usize = PATTERN_SIDE * PATTERN_SIDE;
/// Cuts, along each side, of a cell of the pattern that the edge of a blocker may cross: beside it a neighbour's ray is of
/// the other state. 1 024 rays alone leave a transfer vector wrong by 0.004 to 0.013 next to a ball, relative to the free
/// one.
const CUTS: usize = 3;
/// Rays just above the horizon, for maps alone, and the sine of their height: the lowest places of the pattern lie 3
/// degrees above it.
const HORIZON: usize = 64;
const HORIZON_HEIGHT: f64 = 0.01;
/// Times that the gap between a node and the nearest ray of the other state is halved. The pattern's rays stand 5
/// degrees apart.
const HALVINGS: usize = 4;
/// Rays of the other state that are tried for each node.
const CANDIDATES: usize = 4;

/// A ray of the pattern.
#[derive(Clone, Copy)]
struct PatternRay {
    /// z along the normal.
    local: Vec3A,
    /// Cosine to the normal times solid angle.
    weight: f64,
}

/// The rays, and for every node of a map the rays within reach, near to far: angle and ray.
struct Pattern {
    rays: Vec<PatternRay>,
    /// Of the rays of cells: the rays of the cell's cuts, and the rays of neighbouring cells.
    cuts: Vec<[PatternRay; CUTS * CUTS]>,
    neighbours: Vec<Vec<u16>>,
    nodes: Vec<Vec3A>,
    near_nodes: Vec<Vec<(f32, u16)>>,
}

/// How many rays a point casts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rays {
    /// 256, to tell whether a surface is fine enough.
    Few,
    Many,
}

impl Rays {
    fn pattern(self) -> &'static [PatternRay] {
        match self {
            Rays::Few => &FEW_RAYS,
            Rays::Many => &MANY_RAYS.rays,
        }
    }
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

/// Ray number `i` of those of a square of `side` by `side`. It lies anywhere in its cell, by the plastic number's sequence:
/// rows of rays would all meet a straight edge at once (Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*,
/// 2018).
fn ray_of([x, y]: [usize; 2], i: usize, side: usize) -> PatternRay {
    let place = |cell: usize, step: f64| (cell as f64 + (0.5 + step * i as f64).fract()) / side as f64;
    let local = hemisphere(place(x, 0.754_877_666_246_692_7), place(y, 0.569_840_290_998_053_3));
    PatternRay { local: local.as_vec3a(), weight: local.z * TAU / (side * side) as f64 }
}

fn rays(side: usize) -> Vec<PatternRay> {
    cells(side).enumerate().map(|(i, cell)| ray_of(cell, i, side)).collect()
}

/// The rays of the cuts of each cell, and the rays of its neighbours.
fn cuts_and_neighbours() -> (Vec<[PatternRay; CUTS * CUTS]>, Vec<Vec<u16>>) {
    const SIDE: usize = PATTERN_SIDE;
    let mut ray_at = [[0; SIDE]; SIDE];
    cells(SIDE).enumerate().for_each(|(i, [x, y])| ray_at[y][x] = i as u16);
    let cuts = cells(SIDE).enumerate().map(|(i, [x, y])| {
        let cut = |k: usize| [x * CUTS + k % CUTS, y * CUTS + k / CUTS];
        std::array::from_fn(|k| ray_of(cut(k), i * CUTS * CUTS + k, SIDE * CUTS))
    });
    let neighbours = cells(SIDE).map(|[x, y]| {
        let steps = [(-1, 0), (1, 0), (0, -1), (0, 1)];
        let within = |at: usize, step: isize| at.checked_add_signed(step).filter(|at| *at < SIDE);
        steps.into_iter().filter_map(|(dx, dy)| Some(ray_at[within(y, dy)?][within(x, dx)?])).collect()
    });
    (cuts.collect(), neighbours.collect())
}

static FEW_RAYS: LazyLock<Vec<PatternRay>> = LazyLock::new(|| rays(PATTERN_SIDE / 2));

static MANY_RAYS: LazyLock<Pattern> = LazyLock::new(|| {
    let mut rays = rays(PATTERN_SIDE);
    // Edges that reach the horizon: these rays weigh nothing in the cosine.
    rays.extend((0..HORIZON).map(|i| {
        let turn = TAU * i as f64 / HORIZON as f64;
        PatternRay { local: DVec3::new(turn.cos(), turn.sin(), HORIZON_HEIGHT).normalize().as_vec3a(), weight: 0.0 }
    }));
    let nodes: Vec<Vec3A> = (0..NODES).map(|node| node_direction(node).as_vec3a()).collect();
    let near = |node: &Vec3A| {
        let angles = rays.iter().enumerate().map(|(i, ray)| (node.angle_between(ray.local), i as u16));
        let mut near: Vec<(f32, u16)> = angles.filter(|(angle, _)| *angle < LIMIT_RAD as f32 + 0.1).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near
    };
    let (cuts, neighbours) = cuts_and_neighbours();
    Pattern { near_nodes: nodes.iter().map(near).collect(), nodes, rays, cuts, neighbours }
});

/// A direction of the hemisphere about +z for a point of the unit square; equal areas stay equal.
///
/// Shirley, Chiu, *A Low Distortion Map Between Disk and Square*, 1997, with the disc lifted to the hemisphere.
fn hemisphere(u: f64, v: f64) -> DVec3 {
    let a = 2.0 * u - 1.0;
    let b = 2.0 * v - 1.0;
    let (radius, angle) = if a.abs() > b.abs() {
        (a, PI / 4.0 * b / a)
    } else if b != 0.0 {
        (b, PI / 2.0 - PI / 4.0 * a / b)
    } else {
        return DVec3::Z;
    };
    let flat = radius * (2.0 - radius * radius).sqrt();
    DVec3::new(flat * angle.cos(), flat * angle.sin(), 1.0 - radius * radius)
}

/// A point of a surface from which rays leave.
#[derive(Clone, Copy)]
pub struct Eye {
    /// Just off the surface, in the blockers' frame.
    pub origin: Vec3,
    /// Unit normal in the object's frame.
    pub normal: Vec3,
}

/// How a receiver stands among its blockers.
#[derive(Clone, Copy)]
pub struct Standing {
    /// Rotation from the object's frame to the blockers'.
    pub rotation: DMat3,
    /// The receiver's bounding radius in the blockers' frame.
    pub radius: f64,
}

/// Own visibility of one point.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// `channel_stride(bands)` floats, in the object's frame.
    pub transfer: Vec<f32>,
    pub map: Vec<u8>,
    /// Share of the cosine-weighted hemisphere that is blocked.
    pub blocked: f64,
    /// Share that is blocked by backs of triangles.
    pub behind: f64,
    /// Whether the point lies inside a solid or below a sheet.
    pub buried: bool,
}

impl Seen {
    /// Takes all light from the point.
    pub fn cover(&mut self) {
        self.transfer.fill(0.0);
        self.blocked = 1.0;
        if let Some((angles, distances)) = self.map.split_at_mut_checked(NODES) {
            angles.fill(encode_angle(-LIMIT_RAD));
            distances.fill(encode_distance(0.0));
        }
    }
}

/// What blocks a point.
#[derive(Clone, Copy)]
pub struct Counts<'c> {
    /// Members that block at all.
    pub blocks: &'c (dyn Fn(u32) -> bool + Sync),
    /// Those of them whose shadows the map has; `None` for no map.
    pub in_map: Option<&'c (dyn Fn(u32) -> bool + Sync)>,
}

/// Rays that leave one point, in the frame of its hemisphere.
struct Caster<'c> {
    blockers: &'c Blockers,
    origin: Vec3A,
    to_blockers: Mat3A,
    counts: Counts<'c>,
}

impl Caster<'_> {
    fn cast(&self, locals: impl Iterator<Item = Vec3A>, hits: &mut Vec<Option<BlockerHit>>) {
        let directions: Vec<Vec3A> = locals.map(|local| self.to_blockers * local).collect();
        self.blockers.first(self.origin, &directions, self.counts.blocks, hits);
    }

    /// How far each ray comes past all that the map counts; infinity where it is free.
    fn map_distances(&self, locals: &[Vec3A], hits: &[Option<BlockerHit>]) -> Vec<f32> {
        let in_map = self.counts.in_map.expect("asked for maps alone");
        let mut distances: Vec<f32> = hits.iter().map(|hit| hit.map_or(f32::INFINITY, |hit| hit.distance)).collect();
        let other = |i: &usize| hits[*i].is_some_and(|hit| !in_map(hit.member));
        let others: Vec<usize> = (0..hits.len()).filter(other).collect();
        if !others.is_empty() {
            let directions: Vec<Vec3A> = others.iter().map(|&i| self.to_blockers * locals[i]).collect();
            let mut behind = Vec::new();
            self.blockers.first(self.origin, &directions, in_map, &mut behind);
            for (&i, hit) in others.iter().zip(&behind) {
                distances[i] = hit.map_or(f32::INFINITY, |hit| hit.distance);
            }
        }
        distances
    }
}

/// Casts the rays of one point.
pub fn see(blockers: &Blockers, standing: &Standing, eye: &Eye, bands: usize, rays: Rays, counts: Counts<'_>) -> Seen {
    let normal = eye.normal.as_dvec3();
    let to_object = frame(normal);
    let caster = Caster {
        blockers,
        origin: Vec3A::from(eye.origin),
        to_blockers: Mat3A::from((standing.rotation * to_object).as_mat3()),
        counts,
    };
    let pattern = rays.pattern();
    let mut hits = Vec::with_capacity(pattern.len());
    caster.cast(pattern.iter().map(|ray| ray.local), &mut hits);
    let mut seen = Seen::default();
    let mut blocked = [0.0; MAX_COEFFICIENTS];
    let mut basis = [0.0; MAX_COEFFICIENTS];
    let mut add = |ray: &PatternRay, hit: &Option<BlockerHit>| {
        let Some(found) = hit else { return };
        evaluate(bands, to_object * ray.local.as_dvec3(), &mut basis);
        blocked.iter_mut().zip(&basis).for_each(|(sum, y)| *sum += ray.weight * y);
        seen.blocked += ray.weight / PI;
        seen.behind += if found.from_behind { ray.weight / PI } else { 0.0 };
    };
    let mut cut: Vec<PatternRay> = Vec::new();
    for (i, (ray, hit)) in pattern.iter().zip(&hits).enumerate() {
        let mut beside = MANY_RAYS.neighbours.get(i).filter(|_| rays == Rays::Many).into_iter().flatten();
        if beside.any(|&other| hits[usize::from(other)].is_some() != hit.is_some()) {
            cut.extend(&MANY_RAYS.cuts[i]);
        } else {
            add(ray, hit);
        }
    }
    let mut hits_of_cuts = Vec::with_capacity(cut.len());
    caster.cast(cut.iter().map(|ray| ray.local), &mut hits_of_cuts);
    cut.iter().zip(&hits_of_cuts).for_each(|(ray, hit)| add(ray, hit));
    seen.transfer = vec![0.0; channel_stride(bands)];
    let lobe = clamped_cosine(bands, normal);
    for k in 0..coefficient_count(bands) {
        seen.transfer[k] = (lobe[k] - blocked[k]) as f32;
    }
    if counts.in_map.is_some() {
        assert_eq!(rays, Rays::Many, "maps take all rays");
        seen.map = map_of(&caster, standing, &hits);
    }
    seen
}

/// A node of a map on its way: where the ray of the other state lies, and how near to the edge it has come.
struct NodeSearch {
    node: usize,
    free: bool,
    far: Vec3A,
    low: f32,
    high: f32,
    away: f32,
}

impl NodeSearch {
    fn middle(&self, toward: Vec3A) -> Vec3A {
        toward.lerp(self.far, 0.5 * (self.low + self.high)).normalize()
    }
}

/// The map of a point whose pattern of rays had these hits.
fn map_of(caster: &Caster<'_>, standing: &Standing, pattern_hits: &[Option<BlockerHit>]) -> Vec<u8> {
    let Pattern { rays, nodes, near_nodes, .. } = &*MANY_RAYS;
    let locals: Vec<Vec3A> = rays.iter().map(|ray| ray.local).collect();
    let distances = caster.map_distances(&locals, pattern_hits);
    let mut map = vec![u8::MAX; BYTES];
    if distances.iter().all(|distance| distance.is_infinite()) {
        map[..NODES].fill(encode_angle(LIMIT_RAD));
        return map;
    }
    let mut hits = Vec::new();
    caster.cast(nodes.iter().copied(), &mut hits);
    let here = caster.map_distances(nodes, &hits);
    let distance_byte = |distance: f32| encode_distance(f64::from(distance) / standing.radius);
    let mut searches = Vec::new();
    for (node, near) in near_nodes.iter().enumerate() {
        let free = here[node].is_infinite();
        let others = near.iter().filter(|(_, ray)| distances[*ray as usize].is_infinite() != free);
        // The edge lies between the node and such a ray, and near the ray.
        searches.extend(others.take(CANDIDATES).map(|&(angle, ray)| NodeSearch {
            node,
            free,
            far: rays[ray as usize].local,
            low: (1.0 - 0.15 / angle.max(0.15)).max(0.0),
            high: 1.0,
            away: if free { distances[ray as usize] } else { here[node] },
        }));
    }
    for _ in 0..HALVINGS {
        let middles: Vec<Vec3A> = searches.iter().map(|search| search.middle(nodes[search.node])).collect();
        caster.cast(middles.iter().copied(), &mut hits);
        for (search, found) in searches.iter_mut().zip(caster.map_distances(&middles, &hits)) {
            let middle = 0.5 * (search.low + search.high);
            if found.is_infinite() == search.free {
                search.low = middle;
            } else {
                search.high = middle;
                search.away = if search.free { found } else { search.away };
            }
        }
    }
    let edges: Vec<(Vec3A, f32)> =
        searches.iter().map(|search| (search.middle(nodes[search.node]), search.away)).collect();
    for (node, &toward) in nodes.iter().enumerate() {
        let nearest = edges.iter().max_by(|a, b| a.0.dot(toward).total_cmp(&b.0.dot(toward)));
        let angle = nearest.map_or(LIMIT_RAD, |(edge, _)| f64::from(toward.angle_between(*edge)));
        let free = here[node].is_infinite();
        map[node] = encode_angle(if free { angle } else { -angle });
        let away = if free { nearest.map_or(f32::INFINITY, |(_, away)| *away) } else { here[node] };
        map[NODES + node] = distance_byte(away);
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::field::self_visibility::decode_angle;

    /// A receiver at the origin that looks up at a ball of radius 1 whose centre lies `toward`.
    fn under_a_ball(toward: DVec3, with_map: bool) -> Seen {
        let ball = generate::sphere(1.0, 5);
        let corners = ball.triangles.iter().map(|t| (7, t.map(|i| ball.positions[i as usize] + toward.as_vec3())));
        let eye = Eye { origin: Vec3::ZERO, normal: Vec3::Y };
        let counts = Counts { blocks: &|_| true, in_map: with_map.then_some(&|member| member == 7) };
        let standing = Standing { rotation: DMat3::IDENTITY, radius: 1.0 };
        see(&Blockers::new(corners), &standing, &eye, 4, Rays::Many, counts)
    }

    /// Directions all over the sphere, of equal areas: a Fibonacci lattice.
    fn lattice(count: usize) -> impl Iterator<Item = DVec3> {
        (0..count).map(move |i| {
            let height = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let across = (1.0 - height * height).sqrt();
            let turn = 2.399963229728653 * i as f64;
            DVec3::new(across * turn.cos(), across * turn.sin(), height)
        })
    }

    /// Against the cosine over all that the ball leaves free.
    #[test]
    fn a_ball_takes_its_cap_from_the_cosine() {
        for toward in [DVec3::new(0.0, 2.0, 0.0), DVec3::new(1.5, 1.5, 0.3), DVec3::new(3.0, 0.5, -2.0)] {
            let seen = under_a_ball(toward, false);
            let mut wanted = [0.0; MAX_COEFFICIENTS];
            let mut basis = [0.0; MAX_COEFFICIENTS];
            const COUNT: usize = 400_000;
            for direction in lattice(COUNT) {
                let off = toward.length_squared() - direction.dot(toward).powi(2);
                let blocked = direction.dot(toward) > 0.0 && off < 1.0;
                if !blocked && direction.y > 0.0 {
                    evaluate(4, direction, &mut basis);
                    let weight = 2.0 * TAU * direction.y / COUNT as f64;
                    wanted.iter_mut().zip(&basis).for_each(|(sum, y)| *sum += weight * y);
                }
            }
            let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
            let error = square(&mut seen.transfer.iter().zip(&wanted).map(|(a, b)| f64::from(*a) - b));
            let whole = square(&mut wanted.iter().copied());
            println!("{toward}: {:.4}", error / whole);
            assert!(error < 0.005 * whole, "{toward}: {error} of {whole}");
        }
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
        let eye = Eye { origin: Vec3::ZERO, normal: Vec3::Y };
        let standing = Standing { rotation: DMat3::IDENTITY, radius: 1.0 };
        let see_with = |in_map: &(dyn Fn(u32) -> bool + Sync), corners: &[(u32, [Vec3; 3])]| {
            let counts = Counts { blocks: &|_| true, in_map: Some(in_map) };
            see(&Blockers::new(corners.iter().copied()), &standing, &eye, 4, Rays::Many, counts)
        };
        // The member that the map leaves out stands in front of the one that it has.
        let both = see_with(&|member| member == 0, &[&near[..], &far[..]].concat());
        assert!(both.blocked > 0.98, "{}", both.blocked);
        assert_eq!(both.map, see_with(&|_| true, &near).map);
        let free = see_with(&|_| false, &near);
        assert!(free.map[..NODES].iter().all(|angle| decode_angle(*angle) > 0.7) && free.blocked > 0.98);
        assert!(free.behind < 0.01 || free.behind > 0.9);
    }
}
