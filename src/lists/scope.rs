//! What a cluster of vertices, or a group of them, sees of spheres: whether a light or an occluder may be left off its list.
//!
//! In f32 and by [`crate::lists::repeatable`] alone, as `glsl/gather_scope.glsl` has it: host and device decide alike to the bit.

use crate::layout;
use crate::lists::repeatable::{Angle, dot, inverse, inverse_root};
use crate::lists::scene_bounds::{Bounds, EntityBounds, Lamp, SceneBounds};
use crate::lists::skip::{CAP_SINES, SKIP_FADE_RAD};
use crate::lists::tree::Crowd;

/// Slack on angles, for the rounding of cosines near 0 and pi and of the merge's own.
pub const SLACK_RAD: f64 = 1e-3;
/// Slack on lengths and weights of one cluster.
pub const SLACK: f32 = 1.0 + 1e-5;
/// Slack on what holds for a group and then for each of its clusters.
pub const GROUP_SLACK: f32 = 1.0 + 1e-4;
/// The weight of what may be anywhere: more than any light makes negligible.
pub const EVERYTHING: f32 = 1e30;
/// What is multiplied onto the merge's threshold of the horizon.
pub const BELOW: f32 = -1.0 - SLACK_RAD as f32;
/// Sine of the fade of skips.
pub fn fade_sine() -> f32 {
    SKIP_FADE_RAD.sin() as f32
}
/// What a radius is compared with per distance, for whether a vertex may see a sphere so large that its field is looked up, and so
/// small that it is a cap.
pub fn cap_sines() -> [f32; 2] {
    [(CAP_SINES[0] * (1.0 - 1e-4)) as f32, (CAP_SINES[1] * (1.0 + 1e-4)) as f32]
}
/// Fade and slack together.
pub fn fade() -> Angle {
    let angle = SKIP_FADE_RAD + SLACK_RAD;
    Angle { cosine: angle.cos() as f32, sine: angle.sin() as f32 }
}

/// What becomes of an entity in a chain.
#[derive(Clone, Copy, PartialEq)]
pub enum CullResult {
    /// It stands on the list.
    Listed,
    /// It stands there as a cap alone.
    Cap,
    /// No vertex sees it above its horizon.
    BelowHorizon,
    /// It is farther than the light from every vertex.
    BehindLight,
    /// Its cone meets the light's from no vertex.
    Apart,
    /// No vertex is on the side to which it shines.
    FacingAway,
    /// With a bound of the radiosity that goes with it.
    BelowEps(f32),
}

/// A sphere as seen from a cluster.
pub struct View {
    to: [f32; 3],
    inverse: f32,
    distance: f32,
    /// Its half-angle at most and the turn of the direction between vertices; `None` when a vertex may be inside.
    spread: Option<Angle>,
    /// Of the turn alone.
    turn: Angle,
    below: bool,
    weight: f32,
    /// Whether a vertex may see it too large for a cap.
    pub whole: bool,
    /// Whether a vertex may see it small enough for one.
    pub cap: bool,
}

/// Share of the irradiance under a uniform sky that a small cap takes whose nearest point to the normal stands at this cosine,
/// per cap of the same size at the zenith. The chain's cosine lobe has few bands and does not vanish at the horizon: .094 with
/// four (Ramamoorthi, Hanrahan 2001, section 5).
fn lobe(cosine: f32) -> f32 {
    let c = cosine.max(0.0);
    c.max(0.09375 + c * (0.5 + c * 0.46875))
}

/// What a sphere takes at most of the light of a uniform distant light of radiance 1, or sends with that radiance, as radiosity
/// of a white surface: its form factor with a bound of the cosine. `half` is at least its half-angle, `cosine` at least that of
/// the angle between its nearest point and the normal. It bounds true visibility, and the chain's own change to first order,
/// since the lobe is that of the chain.
fn weight(half: Angle, cosine: f32) -> f32 {
    let cap = 2.0 * half.sine * half.sine * inverse(1.0 + half.cosine);
    cap * lobe((cosine + SLACK_RAD as f32).min(1.0)) * SLACK
}

fn less(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// A cluster of a receiver, or a group of them, at one moment. Places are world axes from the receiver's centre.
pub struct Scope<'m> {
    scene_bounds: &'m SceneBounds,
    receiver: &'m layout::Entity,
    centre: [f32; 3],
    radius: f32,
    axis: [f32; 3],
    spread: Angle,
}

impl<'m> Scope<'m> {
    /// Places bounds of a receiver's mesh in the world.
    pub fn new(scene_bounds: &'m SceneBounds, receiver: &'m layout::Entity, bounds: &Bounds) -> Self {
        let scale = receiver.albedo[3];
        let [x, y, z] = bounds.centre;
        Scope {
            scene_bounds,
            receiver,
            centre: to_world(receiver, [x * scale, y * scale, z * scale]),
            radius: bounds.radius_m * scale,
            axis: to_world(receiver, bounds.axis),
            spread: Angle::of_cosine(bounds.cosine),
        }
    }

    /// Whether so much radiance, reflected, stays below eps.
    pub fn negligible(&self, radiance: f32) -> bool {
        self.reflected(radiance) < self.scene_bounds.eps
    }

    fn reflected(&self, radiance: f32) -> f32 {
        self.receiver.emission[3] * radiance
    }

    /// A sphere of the moment: centre in the world, radius.
    pub fn view(&self, [x, y, z, radius]: [f32; 4]) -> View {
        let [cx, cy, cz, _] = self.receiver.centre;
        let to = less(less([x, y, z], [cx, cy, cz]), self.centre);
        let square = dot(to, to).max(1e-30);
        let inverse_distance = inverse_root(square);
        let distance = square * inverse_distance;
        let toward = Angle::of_cosine(dot(to, self.axis) * inverse_distance);
        let turn = Angle::of_sine((self.radius * inverse_distance).min(1.0));
        // The highest that any vertex sees the centre above its horizon, against the threshold of the shader.
        let highest = distance * toward.cosine_less(self.spread) + self.radius;
        let threshold = radius + fade_sine() * (distance + self.radius);
        let below = self.scene_bounds.skip.horizon && highest < threshold * BELOW;
        let nearest = distance - self.radius;
        let [least, most] = cap_sines();
        let caps = self.scene_bounds.skip.caps;
        let (whole, cap) = (!caps || radius > least * nearest, caps && radius < most * (distance + self.radius));
        let inside =
            View { to, inverse: inverse_distance, distance, spread: None, turn, below, weight: EVERYTHING, whole, cap };
        if nearest <= radius.max(1e-15) {
            return inside;
        }
        let half = Angle::of_sine((radius * inverse(nearest)).min(1.0));
        let spread = half.plus(turn);
        let weight = weight(half, toward.cosine_less(self.spread.plus(spread)));
        View { spread: Some(spread), weight, ..inside }
    }

    /// What becomes of a light.
    pub fn light_result(&self, lamp: &Lamp, light: &View) -> CullResult {
        if light.below {
            return CullResult::BelowHorizon;
        }
        if self.scene_bounds.skip.facing && lamp.facing[3] >= -1.0 && light.distance > self.radius {
            let [x, y, z, cosine] = lamp.facing;
            let away = -dot(light.to, [x, y, z]) * light.inverse;
            if away < Angle::of_cosine(cosine).plus(light.turn).cosine {
                return CullResult::FacingAway;
            }
        }
        self.of_weight(lamp.radiance * light.weight)
    }

    fn of_weight(&self, radiance: f32) -> CullResult {
        if self.negligible(radiance) { CullResult::BelowEps(self.reflected(radiance)) } else { CullResult::Listed }
    }

    /// An occluder takes at most what comes from its part of the view, and at most what the light brings.
    pub fn occluder_result(&self, view: &View, light: Option<&View>, radiance: f32) -> CullResult {
        if view.below {
            return CullResult::BelowHorizon;
        }
        let Some(light) = light else { return self.of_weight(radiance * view.weight) };
        if self.scene_bounds.skip.behind && view.distance > (light.distance + 2.0 * self.radius) * SLACK {
            return CullResult::BehindLight;
        }
        if self.scene_bounds.skip.cones && apart(view, light) {
            return CullResult::Apart;
        }
        self.of_weight(radiance * view.weight.min(light.weight))
    }

    /// At least the weight of every member of a crowd, from every cluster within the bounds.
    pub fn crowd_weight(&self, crowd: &Crowd) -> f32 {
        let (_, _, weight) = self.crowd(crowd);
        weight
    }

    /// Way to a crowd, inverse of its length, and its weight.
    fn crowd(&self, crowd: &Crowd) -> ([f32; 3], f32, f32) {
        let [cx, cy, cz, _] = self.receiver.centre;
        let to = less(less(crowd.centre, [cx, cy, cz]), self.centre);
        let square = dot(to, to).max(1e-30);
        let inverse_distance = inverse_root(square);
        let blur = self.radius + crowd.reach_m;
        let nearest = square * inverse_distance - blur;
        if nearest <= crowd.radius_m.max(self.radius).max(1e-15) {
            return (to, inverse_distance, EVERYTHING);
        }
        let toward = Angle::of_cosine(dot(to, self.axis) * inverse_distance);
        let inverse_nearest = inverse(nearest);
        let half = Angle::of_sine((crowd.radius_m * inverse_nearest).min(1.0));
        // Directions differ by at most asin(blur / distance) between member and crowd; a cluster adds its own turn.
        let between = Angle::of_sine((blur * inverse_distance).min(1.0));
        let turn = Angle::of_sine((self.radius * inverse_nearest).min(1.0));
        let reach = self.spread.plus(half.plus(turn)).plus(between);
        (to, inverse_distance, weight(half, toward.cosine_less(reach)) * GROUP_SLACK)
    }

    /// Occluders that a chain may need in any cluster within the bounds; `None` where none needs the chain.
    pub fn candidates(&self, lamp: Option<&Lamp>) -> Option<Vec<u32>> {
        let scene_bounds = self.scene_bounds;
        let radiance = lamp.map_or(scene_bounds.sky.unwrap_or(0.0), |lamp| lamp.radiance);
        let light = lamp.map(|lamp| {
            let [x, y, z, radius_m] = scene_bounds.spheres[lamp.entity as usize];
            let (to, inverse, weight) = self.crowd(&Crowd { centre: [x, y, z], reach_m: 0.0, radius_m });
            (to, dot(to, to).max(1e-30) * inverse, weight)
        });
        if light.is_some_and(|(_, _, weight)| self.negligible(weight * radiance)) {
            return None;
        }
        let leave = |crowd: &Crowd| {
            let (to, inverse, weight) = self.crowd(crowd);
            if self.negligible(weight * radiance) {
                return true;
            }
            let distance = dot(to, to).max(1e-30) * inverse;
            light.is_some_and(|(_, to_light, _)| {
                let blur = self.radius + crowd.reach_m;
                scene_bounds.skip.behind && distance - blur > (to_light + self.radius) * GROUP_SLACK
            })
        };
        let mut found = Vec::new();
        scene_bounds.tree.find(leave, |j| found.push(j));
        Some(found)
    }

    /// Whether an entity may stand on the list of any cluster within the bounds.
    pub fn may_list(&self, body: &EntityBounds, [x, y, z, radius_m]: [f32; 4]) -> bool {
        let weight = self.crowd_weight(&Crowd { centre: [x, y, z], reach_m: 0.0, radius_m });
        (body.occludes || body.emits) && !self.negligible(weight * self.scene_bounds.brightest)
    }

    /// Whether an entity stands on the list of the cluster.
    pub fn lists(&self, index: u32, body: &EntityBounds, receiver: u32) -> bool {
        let scene_bounds = self.scene_bounds;
        let view = body.occludes.then(|| self.view(scene_bounds.spheres[index as usize]));
        let mut chains = scene_bounds.lamps.iter().filter(|lamp| lamp.entity != receiver);
        chains.any(|lamp| {
            let light = self.view(scene_bounds.spheres[lamp.entity as usize]);
            let needs = |view: &View| self.occluder_result(view, Some(&light), lamp.radiance) == CullResult::Listed;
            self.light_result(lamp, &light) == CullResult::Listed
                && (lamp.entity == index || view.as_ref().is_some_and(needs))
        }) || scene_bounds.sky.is_some_and(|sky| {
            view.as_ref().is_some_and(|view| self.occluder_result(view, None, sky) == CullResult::Listed)
        })
    }
}

/// Whether no vertex sees the two spheres within the fade of one another.
fn apart(a: &View, b: &View) -> bool {
    let (Some(spread_a), Some(spread_b)) = (a.spread, b.spread) else { return false };
    let cosine = (dot(a.to, b.to) * a.inverse * b.inverse).clamp(-1.0, 1.0);
    cosine < spread_a.plus(spread_b.plus(fade())).cosine
}

/// The rotation of an entity, as `to_world` in `merge_layout.glsl`.
fn to_world(entity: &layout::Entity, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let turn = |[c, s]: [f32; 2], [a, b]: [f32; 2]| [c * a - s * b, s * a + c * b];
    let [cos_a, sin_a, cos_b, sin_b] = entity.alpha_beta;
    let [x, y] = turn(entity.gamma, [x, y]);
    let [z, x] = turn([cos_b, sin_b], [z, x]);
    let [x, y] = turn([cos_a, sin_a], [x, y]);
    [x, y, z]
}
