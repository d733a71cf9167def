//! Own visibility: what a vertex sees past everything that never moves against it, by rays on all cores.
//!
//! One set of rays a vertex gives both forms in which it is stored. They leave in one pattern about every normal, so
//! that what is left of the error is smooth over a surface.
//!
//! - The transfer vector is the clamped cosine, in closed form, less what the blocked rays take: where nothing blocks it
//!   is exact.
//! - The map of [`crate::field::self_visibility`] holds for every node the angle to the nearest ray of the other state.
//!   Further rays halve the gap between the two until the edge is known to a fraction of a degree.

use crate::field::quantity::channel_stride;
use crate::field::self_visibility::{BYTES, LIMIT_RAD, NODES, encode_angle, encode_distance, frame, node_direction};
use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count, evaluate};
use crate::sh::lobe::clamped_cosine;
use glam::{DMat3, DVec3, Mat3A, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;
use std::time::Duration;

/// Rays of the pattern along an edge of the square that is mapped to the hemisphere. 1 024 rays leave a transfer vector
/// wrong by 0.004 next to a ball, relative to the clamped cosine.
const PATTERN_SIDE: usize = 32;
pub(super) const PATTERN: usize = PATTERN_SIDE * PATTERN_SIDE;
/// Times that the gap between a node and the nearest ray of the other state is halved. The pattern's rays stand 5
/// degrees apart.
const HALVINGS: usize = 4;

/// A ray of the pattern.
struct PatternRay {
    /// z along the normal.
    local: Vec3A,
    /// Cosine to the normal times solid angle.
    weight: f64,
}

/// The rays, and for every node of a map the rays within reach, near to far: angle and ray.
struct Pattern {
    rays: Vec<PatternRay>,
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

fn rays(side: usize) -> Vec<PatternRay> {
    let middle = |i: usize| (0.5 + i as f64) / side as f64;
    let ray = |i: usize| {
        let local = hemisphere(middle(i % side), middle(i / side));
        PatternRay { local: local.as_vec3a(), weight: local.z * TAU / (side * side) as f64 }
    };
    (0..side * side).map(ray).collect()
}

static FEW_RAYS: LazyLock<Vec<PatternRay>> = LazyLock::new(|| rays(PATTERN_SIDE / 2));

static MANY_RAYS: LazyLock<Pattern> = LazyLock::new(|| {
    let rays = rays(PATTERN_SIDE);
    let nodes: Vec<Vec3A> = (0..NODES).map(|node| node_direction(node).as_vec3a()).collect();
    let near = |node: &Vec3A| {
        let angles = rays.iter().enumerate().map(|(i, ray)| (node.angle_between(ray.local), i as u16));
        let mut near: Vec<(f32, u16)> = angles.filter(|(angle, _)| *angle < LIMIT_RAD as f32 + 0.1).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near
    };
    Pattern { near_nodes: nodes.iter().map(near).collect(), nodes, rays }
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

/// Triangles that block, each of one member of a group.
pub struct Blockers {
    hierarchy: CwBvh,
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    members: Vec<u32>,
}

/// The first triangle on a ray.
#[derive(Clone, Copy)]
pub struct BlockerHit {
    pub distance: f32,
    pub member: u32,
    /// Whether the ray meets its back.
    pub from_behind: bool,
}

impl Blockers {
    /// Builds the hierarchy; one of no triangles blocks nothing.
    pub fn new(corners: impl IntoIterator<Item = (u32, [Vec3; 3])>) -> Self {
        let (members, unsorted): (Vec<u32>, Vec<Triangle>) = corners
            .into_iter()
            .map(|(member, [a, b, c])| (member, Triangle { v0: a.into(), v1: b.into(), v2: c.into() }))
            .unzip();
        let hierarchy = build_cwbvh_from_tris(&unsorted, BvhBuildParams::medium_build(), &mut Duration::default());
        let order = || hierarchy.primitive_indices.iter().map(|&i| i as usize);
        Blockers {
            triangles: order().map(|i| unsorted[i]).collect(),
            members: order().map(|i| members[i]).collect(),
            hierarchy,
        }
    }

    /// The first triangle of the members that `counts` keeps.
    pub fn first(&self, origin: Vec3A, direction: Vec3A, counts: impl Fn(u32) -> bool) -> Option<BlockerHit> {
        if self.triangles.is_empty() {
            return None;
        }
        let mut hit = RayHit::none();
        let meets = |ray: &Ray, id: usize| match counts(self.members[id]) {
            true => self.triangles[id].intersect(ray),
            false => f32::INFINITY,
        };
        self.hierarchy.ray_traverse(Ray::new_inf(origin, direction), &mut hit, meets).then(|| {
            let id = hit.primitive_id as usize;
            let Triangle { v0, v1, v2 } = self.triangles[id];
            let from_behind = (v1 - v0).cross(v2 - v0).dot(direction) > 0.0;
            BlockerHit { distance: hit.t, member: self.members[id], from_behind }
        })
    }
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

/// What blocks a point.
#[derive(Clone, Copy)]
pub struct Counts<'c> {
    /// Members that block at all.
    pub blocks: &'c (dyn Fn(u32) -> bool + Sync),
    /// Those of them whose shadows the map has; `None` for no map.
    pub in_map: Option<&'c (dyn Fn(u32) -> bool + Sync)>,
}

/// Casts the rays of one point.
pub fn see(blockers: &Blockers, standing: &Standing, eye: &Eye, bands: usize, rays: Rays, counts: Counts<'_>) -> Seen {
    let normal = eye.normal.as_dvec3();
    let to_object = frame(normal);
    let to_blockers = Mat3A::from((standing.rotation * to_object).as_mat3());
    let origin = Vec3A::from(eye.origin);
    let cast = |local: Vec3A| blockers.first(origin, to_blockers * local, counts.blocks);
    // The distance at which a direction is blocked for the map; infinity where it is free.
    let map_distance = |hit: Option<BlockerHit>, local: Vec3A, in_map: &dyn Fn(u32) -> bool| match hit {
        Some(hit) if in_map(hit.member) => hit.distance,
        Some(_) => blockers.first(origin, to_blockers * local, in_map).map_or(f32::INFINITY, |hit| hit.distance),
        None => f32::INFINITY,
    };
    let mut seen = Seen::default();
    let mut blocked = [0.0; MAX_COEFFICIENTS];
    let mut distances = [f32::INFINITY; PATTERN];
    let mut basis = [0.0; MAX_COEFFICIENTS];
    for (ray, distance) in rays.pattern().iter().zip(&mut distances) {
        let hit = cast(ray.local);
        if let Some(found) = hit {
            evaluate(bands, to_object * ray.local.as_dvec3(), &mut basis);
            blocked.iter_mut().zip(&basis).for_each(|(sum, y)| *sum += ray.weight * y);
            seen.blocked += ray.weight / PI;
            seen.behind += if found.from_behind { ray.weight / PI } else { 0.0 };
            if let Some(in_map) = counts.in_map {
                *distance = map_distance(hit, ray.local, in_map);
            }
        }
    }
    seen.transfer = vec![0.0; channel_stride(bands)];
    let lobe = clamped_cosine(bands, normal);
    for k in 0..coefficient_count(bands) {
        seen.transfer[k] = (lobe[k] - blocked[k]) as f32;
    }
    if let Some(in_map) = counts.in_map {
        assert_eq!(rays, Rays::Many, "maps take all rays");
        seen.map = map_of(&MANY_RAYS, &distances, standing, |local| map_distance(cast(local), local, in_map));
    }
    seen
}

/// The map for the rays' distances; `cast` casts one more ray.
fn map_of(pattern: &Pattern, distances: &[f32; PATTERN], standing: &Standing, cast: impl Fn(Vec3A) -> f32) -> Vec<u8> {
    let mut map = vec![u8::MAX; BYTES];
    for (node, (&toward, near)) in pattern.nodes.iter().zip(&pattern.near_nodes).enumerate() {
        let here = cast(toward);
        let free = here.is_infinite();
        let other = near.iter().find(|(_, ray)| distances[*ray as usize].is_infinite() != free);
        let Some(&(angle, ray)) = other else {
            map[node] = encode_angle(if free { LIMIT_RAD } else { -LIMIT_RAD });
            if !free {
                map[NODES + node] = encode_distance(f64::from(here) / standing.radius);
            }
            continue;
        };
        // The edge lies between the node and that ray, and near the ray.
        let far = pattern.rays[ray as usize].local;
        let mut away = if free { distances[ray as usize] } else { here };
        let mut low = (1.0 - 0.15 / angle.max(0.15)).max(0.0);
        let mut high = 1.0;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let found = cast(toward.lerp(far, middle).normalize());
            if found.is_infinite() == free {
                low = middle;
            } else {
                high = middle;
                away = if free { found } else { away };
            }
        }
        let edge = toward.angle_between(toward.lerp(far, 0.5 * (low + high)).normalize());
        map[node] = encode_angle(if free { f64::from(edge) } else { -f64::from(edge) });
        map[NODES + node] = encode_distance(f64::from(away) / standing.radius);
    }
    map
}
