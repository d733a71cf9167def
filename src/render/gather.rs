//! Step "gather", on the host: which lookups each cluster of vertices needs, in which order.
//!
//! Inputs: bounding spheres of the entities, their switches, bounds of the clusters. Output: a list of [`Step`]s a cluster.
//! A step is left off when it changes no vertex of the cluster (an occluder farther than the light from all of them, or one
//! that the skips in `merge_cone.glsl` weigh with zero everywhere), and, with a threshold `eps`, when the light that it could
//! take or bring is bounded below it (`Scope::weight`). Neighbouring clusters are gathered together: a tree of the
//! occluders finds what may matter to any of them, so that the work grows with that and not with what exists. The lists do
//! not depend on the tree: what it leaves out, each cluster would leave off by itself.

pub use super::moment::{Body, Bounds, Counts, Moment, Pose};
use super::tree::Crowd;
use super::variant::SKIP_FADE_RAD;
use crate::layout::Step;
use glam::DVec3;

/// What becomes of an entity in a chain.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Listed,
    BelowHorizon,
    BehindLight,
    Apart,
    FacingAway,
    /// With a bound of the radiosity that goes with it.
    BelowEps(f64),
}

/// An entity as seen from a cluster.
struct View {
    index: u32,
    to: DVec3,
    distance: f64,
    /// Largest half-angle from any vertex, with the turn of the direction between vertices; `None` when a vertex may be inside.
    spread_rad: Option<f64>,
    below: bool,
    /// See `Scope::weight`.
    weight: f64,
}

/// Slack on angles, for the shader's single precision.
const SLACK_RAD: f64 = 1e-3;
/// Slack on what holds for a group and then for each of its clusters, for rounding.
const SLACK: f64 = 1.0 + 1e-9;

/// Share of the irradiance under a uniform sky that a small cap takes whose nearest point to the normal stands at this cosine,
/// per cap of the same size at the zenith. The chain's cosine lobe has few bands and does not vanish at the horizon: .094 with
/// four (Ramamoorthi, Hanrahan 2001, section 5).
fn lobe(cosine: f64) -> f64 {
    let c = cosine.max(0.0);
    c.max(0.09375 + c * (0.5 + c * 0.46875))
}

/// A cluster of a receiver, or a group of them, at one moment.
struct Scope<'m> {
    moment: &'m Moment,
    pose: &'m Pose,
    region: Bounds,
}

/// The chains that a group of clusters may need: each light (`None`: the sky) with its occluders in the order in which they are
/// multiplied: near to far from the receiver's centre, ties by index, itself left out. One order for the whole receiver:
/// products truncated in another order differ (by up to .006 over twelve occluders), which would show as seams.
pub struct Chains(Vec<(Option<u32>, Vec<u32>)>);

impl Chains {
    /// What may matter to any cluster of a group with these bounds (in its mesh's frame).
    pub fn of_group(moment: &Moment, pose: &Pose, bounds: &Bounds) -> Self {
        let scope = Scope { moment, pose, region: bounds.placed(pose) };
        Self::new(moment, pose, |light| scope.candidates(light))
    }

    /// Occluders of all chains together.
    pub fn occluder_count(&self) -> usize {
        self.0.iter().map(|(_, occluders)| occluders.len()).sum()
    }

    /// Everything.
    pub fn all(moment: &Moment, pose: &Pose) -> Self {
        Self::new(moment, pose, |_| Some(moment.occluders.clone()))
    }

    fn new(moment: &Moment, pose: &Pose, candidates: impl Fn(Option<u32>) -> Option<Vec<u32>>) -> Self {
        let lights = moment.lights.iter().filter(|&&l| l as usize != pose.entity).map(|&l| Some(l));
        let chains = lights.chain(moment.sky.map(|_| None)).filter_map(|light| {
            let others = candidates(light)?.into_iter().filter(|&j| j as usize != pose.entity && Some(j) != light);
            let distance = |j: u32| moment.bodies[j as usize].centre.distance(pose.centre);
            let mut keyed: Vec<(f64, u32)> = others.map(|j| (distance(j), j)).collect();
            keyed.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            Some((light, keyed.into_iter().map(|(_, j)| j).collect()))
        });
        Chains(chains.collect())
    }
}

/// Appends the steps of one cluster. `chains` are those of a group that the cluster belongs to.
pub fn steps(moment: &Moment, pose: &Pose, bounds: &Bounds, chains: &Chains, out: &mut Vec<u32>) {
    Scope { moment, pose, region: bounds.placed(pose) }.walk(chains, out, &mut |_, _| ());
}

/// What of all that exists is left off the list of one cluster, and why.
pub fn counts(moment: &Moment, pose: &Pose, bounds: &Bounds) -> Counts {
    let (mut counts, mut dropped) = (Counts::default(), 0.0);
    let scope = Scope { moment, pose, region: bounds.placed(pose) };
    scope.walk(&Chains::all(moment, pose), &mut Vec::new(), &mut |fate, lookups| {
        counts.considered += lookups;
        match fate {
            Fate::Listed => {}
            Fate::BelowHorizon => counts.below_horizon += lookups,
            Fate::BehindLight => counts.behind_light += lookups,
            Fate::Apart => counts.apart += lookups,
            Fate::FacingAway => counts.facing_away += lookups,
            Fate::BelowEps(bound) => {
                counts.below_eps += lookups;
                dropped += bound;
            }
        }
    });
    Counts { dropped_bound: dropped, ..counts }
}

/// Whether an entity may stand on the list of a cluster, or of any cluster in a group.
pub fn may_matter(moment: &Moment, pose: &Pose, bounds: &Bounds, body: &Body) -> bool {
    let scope = Scope { moment, pose, region: bounds.placed(pose) };
    let crowd = Crowd { centre: body.centre, reach_m: 0.0, radius_m: body.radius_m };
    let brightest = moment.lights.iter().map(|&l| moment.bodies[l as usize].radiance).fold(body.radiance, f64::max);
    !scope.negligible(scope.crowd_weight(&crowd) * brightest.max(moment.sky.unwrap_or(0.0)))
}

impl Scope<'_> {
    /// Goes through all chains; tells of every entity and channel what becomes of it.
    fn walk(&self, chains: &Chains, out: &mut Vec<u32>, tell: &mut dyn FnMut(Fate, u64)) {
        for (light, occluders) in &chains.0 {
            let shines = light.map(|l| (l, self.view(l)));
            if let Some((l, light)) = &shines {
                let channels = if self.moment.bodies[*l as usize].coloured { 3 } else { 1 };
                let fate = self.light_fate(light);
                tell(fate, channels);
                if fate != Fate::Listed {
                    let fate = if let Fate::BelowEps(_) = fate { Fate::BelowEps(0.0) } else { fate };
                    tell(fate, occluders.len() as u64);
                    continue;
                }
            }
            let radiance = light.map_or(self.moment.sky.unwrap_or(0.0), |l| self.moment.bodies[l as usize].radiance);
            for &j in occluders {
                let fate = self.occluder_fate(j, shines.as_ref().map(|(_, view)| view), radiance);
                tell(fate, 1);
                if fate == Fate::Listed {
                    out.push(Step::Occlude { entity: j, light: *light }.pack());
                }
            }
            if let Some((l, _)) = &shines {
                self.shine(*l, out);
            }
        }
    }

    fn shine(&self, light: u32, out: &mut Vec<u32>) {
        let coloured = self.moment.bodies[light as usize].coloured;
        let channels = if coloured { 3 } else { 1 };
        for channel in 0..channels {
            let last = channel + 1 == channels;
            out.push(Step::Shine { entity: light, channel: coloured.then_some(channel), last }.pack());
        }
    }

    fn light_fate(&self, light: &View) -> Fate {
        let body = &self.moment.bodies[light.index as usize];
        let bound = self.pose.reflectance * body.radiance * light.weight;
        if light.below {
            return Fate::BelowHorizon;
        }
        if let Some((axis, half_angle)) = body.facing.filter(|_| self.moment.skip.facing)
            && light.distance > self.region.radius_m
        {
            let turn = (self.region.radius_m / light.distance).asin();
            if (-light.to).angle_between(axis) > half_angle + turn + SLACK_RAD {
                return Fate::FacingAway;
            }
        }
        if self.negligible(body.radiance * light.weight) { Fate::BelowEps(bound) } else { Fate::Listed }
    }

    /// An occluder takes at most what comes from its part of the view, and at most what the light brings.
    fn occluder_fate(&self, occluder: u32, light: Option<&View>, radiance: f64) -> Fate {
        let view = self.view(occluder);
        let most = view.weight.min(light.map_or(f64::INFINITY, |light| light.weight));
        if view.below {
            return Fate::BelowHorizon;
        }
        if let Some(light) = light {
            let margin = self.region.radius_m;
            if self.moment.skip.behind && view.distance - margin > light.distance + margin {
                return Fate::BehindLight;
            }
            if self.moment.skip.cones && apart(&view, light) {
                return Fate::Apart;
            }
        }
        let bound = self.pose.reflectance * radiance * most;
        if self.negligible(radiance * most) { Fate::BelowEps(bound) } else { Fate::Listed }
    }

    /// Whether so much radiance, reflected, stays below eps.
    fn negligible(&self, radiance: f64) -> bool {
        self.pose.reflectance * radiance < self.moment.eps
    }

    fn view(&self, index: u32) -> View {
        let (region, body) = (&self.region, &self.moment.bodies[index as usize]);
        let to = body.centre - region.centre;
        let distance = to.length();
        let nearest = distance - region.radius_m;
        let angle = to.angle_between(region.axis) - region.spread_rad;
        // The highest that any vertex sees the centre above its horizon, against the threshold of the shader.
        let highest = distance * angle.max(0.0).cos() + region.radius_m;
        let threshold = -body.radius_m - SKIP_FADE_RAD.sin() * (distance + region.radius_m);
        let below = self.moment.skip.horizon && distance > 0.0 && highest < threshold * (1.0 + SLACK_RAD);
        let outside = nearest > body.radius_m && distance > region.radius_m;
        if !outside {
            return View { index, to, distance, spread_rad: None, below, weight: f64::INFINITY };
        }
        let (half_angle, turn) = ((body.radius_m / nearest).asin(), (region.radius_m / distance).asin());
        let weight = weight(half_angle, angle - turn);
        View { index, to, distance, spread_rad: Some(half_angle + turn), below, weight }
    }

    /// At least the weight of every member of a crowd, from every cluster within the region.
    fn crowd_weight(&self, crowd: &Crowd) -> f64 {
        let (region, to) = (&self.region, crowd.centre - self.region.centre);
        let distance = to.length();
        let (nearest, blur) = (distance - region.radius_m - crowd.reach_m, region.radius_m + crowd.reach_m);
        if nearest <= crowd.radius_m || nearest <= region.radius_m {
            return f64::INFINITY;
        }
        // Directions differ by at most asin(blur / distance) between member and crowd; a cluster adds its own turn.
        let turn = (blur / distance).asin() + (region.radius_m / nearest).asin();
        let angle = to.angle_between(region.axis) - region.spread_rad - turn;
        SLACK * weight((crowd.radius_m / nearest).asin(), angle - 1e-9)
    }

    /// Occluders that a chain may need in any cluster within the region; `None` where none needs the chain.
    fn candidates(&self, light: Option<u32>) -> Option<Vec<u32>> {
        let (region, moment) = (&self.region, self.moment);
        let light = light.map(|l| &moment.bodies[l as usize]);
        let radiance = light.map_or(moment.sky.unwrap_or(0.0), |l| l.radiance);
        if let Some(light) = light {
            let alone = Crowd { centre: light.centre, reach_m: 0.0, radius_m: light.radius_m };
            if self.negligible(self.crowd_weight(&alone) * radiance) {
                return None;
            }
        }
        let leave = |crowd: &Crowd| {
            let (to, blur) = (crowd.centre - region.centre, region.radius_m + crowd.reach_m);
            let distance = to.length();
            if self.negligible(self.crowd_weight(crowd) * radiance) {
                return true;
            }
            let Some(light) = light else { return false };
            let to_light = light.centre - region.centre;
            let light_distance = to_light.length();
            if moment.skip.behind && distance - blur > SLACK * (light_distance + region.radius_m) {
                return true;
            }
            let (nearest, light_nearest) = (distance - blur, light_distance - region.radius_m);
            if !moment.skip.cones
                || nearest <= crowd.radius_m.max(region.radius_m)
                || light_nearest <= light.radius_m.max(region.radius_m)
            {
                return false;
            }
            let turn = (blur / distance).asin() + (region.radius_m / nearest).asin();
            let light_turn = (region.radius_m / light_distance).asin() + (region.radius_m / light_nearest).asin();
            let reach = (crowd.radius_m / nearest).asin() + (light.radius_m / light_nearest).asin();
            to.angle_between(to_light) > SLACK * (reach + turn + light_turn + SKIP_FADE_RAD + SLACK_RAD)
        };
        let mut found = Vec::new();
        moment.tree.find(leave, |j| found.push(j));
        Some(found)
    }
}

/// What a sphere takes at most of the light of a uniform distant light of radiance 1, or sends with that radiance, as radiosity
/// of a white surface: its form factor with a bound of the cosine. `half_angle` is at least that of the sphere, `angle` at most
/// that between its centre and the normal. It bounds true visibility, and the chain's own change to first order, since
/// the lobe is that of the chain.
fn weight(half_angle: f64, angle: f64) -> f64 {
    let sine = (half_angle / 2.0).sin();
    4.0 * sine * sine * lobe((angle - half_angle).max(0.0).cos())
}

/// Whether no vertex sees the two spheres within the fade of one another.
fn apart(a: &View, b: &View) -> bool {
    let (Some(spread_a), Some(spread_b)) = (a.spread_rad, b.spread_rad) else { return false };
    a.to.angle_between(b.to) > spread_a + spread_b + SKIP_FADE_RAD + SLACK_RAD
}
