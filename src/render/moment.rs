//! What the lists of step "gather" are made from at one moment: bounds of clusters, bodies of entities, poses of receivers; and
//! counts of what they leave off.

use super::tree::Tree;
use super::variant::Skip;
use glam::{DQuat, DVec3, Vec3};
use serde::Serialize;
use std::f64::consts::PI;

/// Where a cluster's vertices are and where they face: in its mesh's frame (metres from the bounding sphere's centre), or
/// in the world once [placed](Bounds::placed).
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
        let spheres = positions.iter().map(|p| (p.as_dvec3(), 0.0));
        let cones = normals.iter().map(|n| (n.as_dvec3(), 0.0));
        Self::around(spheres.collect(), cones.collect())
    }

    /// Bounds of neighbouring clusters.
    pub fn union(parts: &[Bounds]) -> Self {
        let spheres = parts.iter().map(|b| (b.centre, b.radius_m));
        Self::around(spheres.collect(), parts.iter().map(|b| (b.axis, b.spread_rad)).collect())
    }

    fn around(spheres: Vec<(DVec3, f64)>, cones: Vec<(DVec3, f64)>) -> Self {
        let (low, high) = spheres
            .iter()
            .fold((DVec3::MAX, DVec3::MIN), |(low, high), (centre, _)| (low.min(*centre), high.max(*centre)));
        let centre = (low + high) / 2.0;
        let radius_m = spheres.iter().map(|(c, radius)| c.distance(centre) + radius).fold(0.0, f64::max);
        let axis = cones.iter().map(|(axis, _)| *axis).sum::<DVec3>().normalize_or_zero();
        let widest = cones.iter().map(|(a, spread)| a.angle_between(axis) + spread).fold(0.0, f64::max);
        // No angle to a direction that is none.
        let unknown = axis == DVec3::ZERO || cones.iter().any(|(a, _)| *a == DVec3::ZERO);
        let spread_rad = if unknown { PI } else { widest.min(PI) };
        Bounds { centre, radius_m, axis, spread_rad }
    }

    /// In the world.
    pub fn placed(&self, pose: &Pose) -> Self {
        Bounds {
            centre: pose.centre + pose.rotation * (self.centre * pose.scale),
            radius_m: self.radius_m * pose.scale,
            axis: pose.rotation * self.axis,
            spread_rad: self.spread_rad,
        }
    }
}

/// One entity as the gather sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Centre of the bounding sphere in the world, metres.
    pub centre: DVec3,
    /// Its radius in the world, metres.
    pub radius_m: f64,
    /// Whether it casts shadows.
    pub occludes: bool,
    /// Whether it shines.
    pub emits: bool,
    /// Whether it shines through a radiance field of its own rather than through its occlusion field.
    pub coloured: bool,
    /// Largest radiance that it shines with, of any colour.
    pub radiance: f64,
    /// Axis (world) and half-angle of a cone of directions outside of which its radiance field is zero.
    pub facing: Option<(DVec3, f64)>,
}

/// A receiver's place and surface.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Index of the entity.
    pub entity: usize,
    /// Centre of its bounding sphere in the world, metres.
    pub centre: DVec3,
    /// Rotation to the world.
    pub rotation: DQuat,
    /// Uniform scale.
    pub scale: f64,
    /// Albedo, of its brightest colour.
    pub reflectance: f64,
}

/// What the lists are made from at one moment.
pub struct Moment {
    /// All entities.
    pub bodies: Vec<Body>,
    /// Those that occlude.
    pub tree: Tree,
    /// Indices of those that occlude.
    pub occluders: Vec<u32>,
    /// Indices of those that shine.
    pub lights: Vec<u32>,
    /// Largest radiance of distant light, if there is any.
    pub sky: Option<f64>,
    /// What is left off.
    pub skip: Skip,
    /// Radiance below which a contribution is left off; 0 leaves nothing off.
    pub eps: f64,
}

impl Moment {
    /// Sorts `bodies` for the lists.
    pub fn new(bodies: Vec<Body>, sky: Option<f64>, skip: Skip, eps: f64) -> Self {
        let having = |switch: &dyn Fn(&Body) -> bool| -> Vec<u32> {
            (0..bodies.len()).filter(|&j| switch(&bodies[j])).map(|j| j as u32).collect()
        };
        let (occluders, lights) = (having(&|b| b.occludes), having(&|b| b.emits));
        let tree = Tree::new(occluders.iter().map(|&j| {
            let body = &bodies[j as usize];
            (j as usize, body.centre, body.radius_m)
        }));
        Moment { tree, occluders, lights, sky, skip, eps, bodies }
    }

    /// Whether lists of the other moment hold here too where no body has changed.
    pub fn is_like(&self, other: &Moment) -> bool {
        self.bodies.len() == other.bodies.len() && (self.sky, self.skip, self.eps) == (other.sky, other.skip, other.eps)
    }
}

/// What was considered and left off, in (cluster, chain, entity) triples, and a bound of the light in what was left off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Counts {
    /// Lookups that a merge without lists would make.
    pub considered: u64,
    /// Occluders that lie behind the light for the whole cluster.
    pub behind_light: u64,
    /// Lights and occluders below the horizon of the whole cluster.
    pub below_horizon: u64,
    /// Occluders whose cones do not meet the light's anywhere in the cluster.
    pub apart: u64,
    /// Lights whose field is zero on the side of the cluster, and occluders in front of them.
    pub facing_away: u64,
    /// Lights and occluders bounded below eps.
    pub below_eps: u64,
    /// Bound of the radiosity that was left off as below eps, of the cluster where it is largest.
    pub dropped_bound: f64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.considered += other.considered;
        self.behind_light += other.behind_light;
        self.below_horizon += other.below_horizon;
        self.apart += other.apart;
        self.facing_away += other.facing_away;
        self.below_eps += other.below_eps;
        self.dropped_bound = self.dropped_bound.max(other.dropped_bound);
    }
}
