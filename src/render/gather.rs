//! Step "gather", on the host: which lookups each cluster of vertices needs, in which order.
//!
//! Inputs: bounding spheres of the entities, their switches, bounds of the clusters. Output: a list of [`Step`]s a cluster.
//! A step is left off only when it changes no vertex of the cluster: an occluder farther than the light from all of them, or
//! one that the skips in `merge_cone.glsl` weigh with zero everywhere. The merge without lists gives the same numbers.

use super::variant::{SKIP_FADE_RAD, Skip};
use crate::layout::Step;
use glam::{DQuat, DVec3, Vec3};
use serde::Serialize;

/// Where a cluster's vertices are and where they face, in its mesh's frame (metres from the bounding sphere's centre).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Centre of a sphere around the vertices.
    pub centre: DVec3,
    /// Its radius in metres.
    pub radius_m: f64,
    /// Axis of a cone around the normals.
    pub axis: DVec3,
    /// Its half-angle; pi when it bounds nothing.
    pub spread_rad: f64,
}

impl Bounds {
    /// Bounds of some vertices.
    pub fn new(positions: &[Vec3], normals: &[Vec3]) -> Self {
        let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
        let centre = (low.as_dvec3() + high.as_dvec3()) / 2.0;
        let radius_m = positions.iter().map(|p| p.as_dvec3().distance(centre)).fold(0.0, f64::max);
        let sum: DVec3 = normals.iter().map(|n| n.as_dvec3()).sum();
        let axis = sum.normalize_or_zero();
        let spread_rad = if axis == DVec3::ZERO {
            std::f64::consts::PI
        } else {
            normals.iter().map(|n| n.as_dvec3().angle_between(axis)).fold(0.0, f64::max)
        };
        Bounds { centre, radius_m, axis, spread_rad }
    }
}

/// One entity as the gather sees it.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Centre of the bounding sphere in the world, metres.
    pub centre: DVec3,
    /// Its radius in the world, metres.
    pub radius_m: f64,
    /// Whether it shines.
    pub emits: bool,
    /// Whether it shines through a radiance field of its own rather than through its occlusion field.
    pub coloured: bool,
}

/// A receiver's place and the occluders that it meets.
#[derive(Clone, Debug)]
pub struct Pose {
    /// Index of the entity.
    pub entity: usize,
    /// Centre of its bounding sphere in the world, metres.
    pub centre: DVec3,
    /// Rotation to the world.
    pub rotation: DQuat,
    /// Uniform scale.
    pub scale: f64,
    /// Occluders in the order in which they are multiplied, itself left out.
    pub occluders: Vec<usize>,
}

/// What was considered and left off, in (cluster, chain, entity) triples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Lookups that a merge without lists would make.
    pub considered: u64,
    /// Occluders that lie behind the light for the whole cluster.
    pub behind_light: u64,
    /// Lights and occluders below the horizon of the whole cluster.
    pub below_horizon: u64,
    /// Occluders whose cones do not meet the light's anywhere in the cluster.
    pub apart: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.considered += other.considered;
        self.behind_light += other.behind_light;
        self.below_horizon += other.below_horizon;
        self.apart += other.apart;
    }
}

/// An entity as seen from a cluster.
struct View {
    index: usize,
    to: DVec3,
    distance: f64,
    /// Largest half-angle from any vertex, with the turn of the direction between vertices; `None` when a vertex may be inside.
    spread_rad: Option<f64>,
    below: bool,
}

/// Slack on angles, for the shader's single precision.
const SLACK_RAD: f64 = 1e-3;

/// The steps of one cluster of a receiver. `sky` says whether there is distant light.
pub fn steps(bounds: &Bounds, pose: &Pose, bodies: &[Body], sky: bool, skip: Skip, out: &mut Vec<u32>) -> Counts {
    let mut counts = Counts::default();
    let centre = pose.centre + pose.rotation * (bounds.centre * pose.scale);
    let radius_m = bounds.radius_m * pose.scale;
    let axis = pose.rotation * bounds.axis;
    let view = |index: usize| {
        let body = &bodies[index];
        let to = body.centre - centre;
        let distance = to.length();
        let nearest = distance - radius_m;
        let spread_rad = (nearest > body.radius_m && distance > radius_m)
            .then(|| (body.radius_m / nearest).asin() + (radius_m / distance).asin());
        // The highest that any vertex sees the centre above its horizon, against the threshold of the shader.
        let angle = (to.angle_between(axis) - bounds.spread_rad).max(0.0);
        let highest = distance * angle.cos() + radius_m;
        let threshold = -body.radius_m - SKIP_FADE_RAD.sin() * (distance + radius_m);
        let below = skip.horizon && distance > 0.0 && highest < threshold * (1.0 + SLACK_RAD);
        View { index, to, distance, spread_rad, below }
    };
    let occluders: Vec<View> = pose.occluders.iter().map(|&j| view(j)).collect();

    for light in (0..bodies.len()).filter(|&l| bodies[l].emits && l != pose.entity).map(view) {
        let channels = if bodies[light.index].coloured { 3 } else { 1 };
        counts.considered += occluders.len() as u64 + channels;
        if light.below {
            counts.below_horizon += occluders.len() as u64 + channels;
            continue;
        }
        for occluder in occluders.iter().filter(|o| o.index != light.index) {
            if occluder.below {
                counts.below_horizon += 1;
            } else if occluder.distance - radius_m > light.distance + radius_m {
                counts.behind_light += 1;
            } else if skip.cones && apart(occluder, &light) {
                counts.apart += 1;
            } else {
                let step = Step::Occlude { entity: occluder.index as u32, light: Some(light.index as u32) };
                out.push(step.pack());
            }
        }
        for channel in 0..channels as u32 {
            let step = Step::Shine {
                entity: light.index as u32,
                channel: (channels == 3).then_some(channel),
                last: channel + 1 == channels as u32,
            };
            out.push(step.pack());
        }
    }
    if sky {
        counts.considered += occluders.len() as u64;
        counts.below_horizon += occluders.iter().filter(|o| o.below).count() as u64;
        let steps = occluders.iter().filter(|o| !o.below);
        out.extend(steps.map(|o| Step::Occlude { entity: o.index as u32, light: None }.pack()));
    }
    counts
}

/// Whether no vertex sees the two spheres within the fade of one another.
fn apart(a: &View, b: &View) -> bool {
    let (Some(spread_a), Some(spread_b)) = (a.spread_rad, b.spread_rad) else { return false };
    a.to.angle_between(b.to) > spread_a + spread_b + SKIP_FADE_RAD + SLACK_RAD
}
