//! The rule that keeps an entity off a cluster's list: what a cluster of vertices, or a group of clusters, sees of
//! bounding spheres.
//!
//! It lists what may change a vertex of the cluster and leaves off what cannot: the weights of cone, horizon and cap in
//! the merge have faded to exactly zero where the rule ends, and what is bounded below eps may be missing.

use crate::field::sheet::{CONTACT, Sheet};
use crate::field::silhouette::{INSIDE, REACH, Side};
use crate::field::sub_light::NEAR_LIGHT_STEPS;
use crate::field::visibility_volume::SceneVolume;
use crate::layout::{self, COSINE_LOBE, EVERYTHING};
use crate::lists::scene_bounds::{
    CONE_ROUNDING_RAD, ClusterBounds, EntityBounds, Globe, Occludes, OutlineShape, SceneBounds,
};
use crate::lists::skip::{CAP_SINES, SKIP_FADE_RAD};
use crate::lists::tree::Crowd;
use glam::{DVec2, DVec3, Vec4};
use std::f64::consts::PI;

/// What an outline's distance may be off by, in r: more than the step of a map and what blending four of them errs by.
const OUTLINE_MARGIN: f64 = 0.06;

/// How far f32 may misplace a vertex against a visibility volume, metres.
const VOLUME_MARGIN_M: f64 = 1e-4;

/// Share of a vertex's view, times its albedo, below which the light that an entity reflects is left out.
const LEAST_TAKEN: f64 = 1.0 / 96.0;

/// What becomes of an occluder in a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CullResult {
    Listed,
    LeftOff,
    /// It blocks every ray from the cluster to the sharp light, which is left off with its chain.
    Covers,
    /// All rays from the cluster pass it once: it is a globe around the light.
    Encloses,
}

/// An angle from 0 to pi as its cosine and sine. Sums beyond pi stay there.
#[derive(Clone, Copy)]
struct Angle {
    cosine: f64,
    sine: f64,
}

impl Angle {
    /// From its sine, up to a right angle.
    fn of_sine(sine: f64) -> Self {
        let sine = sine.min(1.0);
        Angle { cosine: (1.0 - sine * sine).sqrt(), sine }
    }

    fn of_cosine(cosine: f64) -> Self {
        let cosine = cosine.clamp(-1.0, 1.0);
        Angle { cosine, sine: (1.0 - cosine * cosine).sqrt() }
    }

    fn plus(self, other: Angle) -> Angle {
        // cos a + cos b = 2 cos((a + b) / 2) cos((a - b) / 2) is negative where the sum exceeds pi.
        if self.cosine + other.cosine < 0.0 {
            return Angle { cosine: -1.0, sine: 0.0 };
        }
        let sine = self.sine * other.cosine + self.cosine * other.sine;
        Angle { cosine: self.cosine * other.cosine - self.sine * other.sine, sine: sine.max(0.0) }
    }

    /// Cosine of the difference; 1 where the other is larger.
    fn cosine_less(self, other: Angle) -> f64 {
        if self.cosine >= other.cosine { 1.0 } else { self.cosine * other.cosine + self.sine * other.sine }
    }
}

pub struct SphereView {
    /// Unit direction from the cluster's centre to the sphere's.
    toward: DVec3,
    /// Least and largest distance of the sphere's centre from a vertex, metres.
    nearest: f64,
    farthest: f64,
    radius: f64,
    /// Its half-angle at most, with the turn; `None` when a vertex may be inside.
    spread: Option<Angle>,
    /// The angle between the directions from the cluster's centre and from a vertex, at most.
    turn: Angle,
    below: bool,
    weight: f64,
    /// Whether a vertex may see it too large for a cap.
    pub whole: bool,
    /// Whether a vertex may see it small enough for one.
    pub cap: bool,
    sheet: Option<SheetSides>,
}

/// The plane of a sheet, and which side of it all vertices of a cluster are on.
struct SheetSides {
    /// Unit normal; away from the vertices, if that is known.
    normal: DVec3,
    /// Height of the cluster's centre along it, metres.
    height: f64,
    /// Whether all vertices lie on one side.
    known: bool,
}

/// Share of the irradiance under a uniform sky that a small cap takes whose nearest point to the normal stands at this
/// cosine, per cap of the same size at the zenith. The chain's cosine lobe has few bands and does not vanish at the
/// horizon: it is 0.094 there with four bands (Ramamoorthi, Hanrahan 2001, section 5).
fn lobe(cosine: f64) -> f64 {
    let c = cosine.max(0.0);
    let [at_0, slope, bend] = COSINE_LOBE;
    c.max(at_0 + c * (slope + c * bend))
}

/// What a sphere takes at most of the light of a uniform distant light of radiance 1, or sends with that radiance, as
/// radiosity of a white surface: its form factor with a bound of the cosine. `half` is at least its half-angle,
/// `cosine` at least that of the angle between its nearest point and the normal. It bounds true visibility, and the
/// chain's own change to first order, since the lobe is that of the chain.
fn weight(half: Angle, cosine: f64) -> f64 {
    2.0 * half.sine * half.sine / (1.0 + half.cosine) * lobe(cosine)
}

/// A cluster of a receiver, or a group of clusters, at one time.
pub struct Scope<'m> {
    /// What the rule looks at.
    pub scene: &'m SceneBounds,
    /// The receiver.
    pub index: usize,
    /// Entities whose shadows of sharp lights are in the cluster's maps.
    near: &'m [u32],
    /// Share of light that the receiver reflects at most.
    reflectance: f64,
    /// The sphere around its vertices in the world, metres.
    pub centre: DVec3,
    pub radius_m: f64,
    axis: DVec3,
    spread: Angle,
    /// Centre of the receiver's bounding sphere in the world, and how near to a sheet it touches it, metres.
    receiver: (DVec3, f64),
}

impl<'m> Scope<'m> {
    /// Whether a light may be so near one of the vertices that light bends between it and the next.
    pub fn may_be_at(&self, light: &layout::DeviceEntity) -> bool {
        let [x, y, z, inverse_radius] = light.centre.map(f64::from);
        let gap_m = self.centre.distance(DVec3::new(x, y, z)) - 1.0 / inverse_radius - self.radius_m;
        gap_m < NEAR_LIGHT_STEPS * 2.0 * self.radius_m
    }

    /// Places bounds of a receiver's mesh in the world.
    pub fn new(
        scene: &'m SceneBounds,
        index: usize,
        receiver: &layout::DeviceEntity,
        bounds: &ClusterBounds,
        near: &'m [u32],
    ) -> Self {
        let scale = f64::from(receiver.scale);
        let [x, y, z, inverse_radius] = receiver.centre.map(f64::from);
        let middle = DVec3::new(x, y, z);
        Scope {
            scene,
            index,
            near,
            reflectance: scene.entities[index].reflectance,
            centre: middle + to_world(receiver, bounds.centre.as_dvec3() * scale),
            radius_m: f64::from(bounds.radius_m) * scale,
            axis: to_world(receiver, bounds.axis.as_dvec3()),
            spread: Angle::of_cosine(bounds.cosine.into()),
            receiver: (middle, CONTACT / inverse_radius),
        }
    }

    /// Whether the own visibility of the cluster has the shadows of an occluder, those of sharp lights or all others.
    pub fn is_own(&self, occluder: usize, sharp: bool) -> bool {
        (!sharp || self.near.binary_search(&(occluder as u32)).is_ok())
            && self.scene.groups.as_ref().is_some_and(|groups| groups.is_own(self.index, occluder))
    }

    /// The volume whose sky's shadows some vertex reads, and whether all vertices read nothing else of it.
    pub fn volume(&self) -> Option<(&'m SceneVolume, bool)> {
        let volume = self.scene.volume.as_deref()?;
        let moves = self.scene.groups.as_ref()?.moves_among(self.index, &volume.has);
        let nodes = &volume.volume.nodes;
        let depth = nodes.depth(self.centre);
        let reach = (self.radius_m + VOLUME_MARGIN_M) / f64::from(nodes.step_m);
        (moves && depth > -reach).then_some((volume, depth > 1.0 + reach))
    }

    /// A sphere of the scene: centre in the world, radius.
    pub fn view(&self, sphere: Vec4) -> SphereView {
        let skip = self.scene.skip;
        let sphere_radius = f64::from(sphere.w);
        let to = sphere.truncate().as_dvec3() - self.centre;
        let distance = to.length().max(1e-15);
        let toward = to / distance;
        let nearest = distance - self.radius_m;
        let farthest = distance + self.radius_m;
        let from_axis = Angle::of_cosine(toward.dot(self.axis));
        let turn = Angle::of_sine(self.radius_m / distance);
        // The highest that any vertex sees the centre above its horizon, against what `above_horizon` in the merge asks
        // for.
        let highest = distance * from_axis.cosine_less(self.spread) + self.radius_m;
        let below = skip.horizon && highest < -(sphere_radius + SKIP_FADE_RAD.sin() * farthest);
        let half = (nearest > sphere_radius).then(|| Angle::of_sine(sphere_radius / nearest));
        let spread = half.map(|half| half.plus(turn));
        let weight = half
            .zip(spread)
            .map_or(EVERYTHING, |(half, spread)| weight(half, from_axis.cosine_less(self.spread.plus(spread))));
        let whole = !skip.caps || sphere_radius > CAP_SINES[0] * nearest;
        let cap = skip.caps && sphere_radius < CAP_SINES[1] * farthest;
        SphereView {
            toward,
            nearest,
            farthest,
            radius: sphere_radius,
            spread,
            turn,
            below,
            weight,
            whole,
            cap,
            sheet: None,
        }
    }

    /// The sphere of an occluder, and what more is known where it is a sheet.
    pub fn view_of(&self, occluder: usize) -> SphereView {
        let view = self.view(self.scene.spheres[occluder]);
        let Some(sheet) = &self.scene.entities[occluder].sheet else { return view };
        SphereView { below: self.scene.skip.horizon && self.is_below(sheet), sheet: Some(self.sides(sheet)), ..view }
    }

    /// Whether no vertex sees any corner of a sheet above its horizon.
    fn is_below(&self, sheet: &Sheet) -> bool {
        sheet.corners().into_iter().all(|corner| {
            let to = corner - self.centre;
            let distance = to.length().max(1e-15);
            let from_axis = Angle::of_cosine(to.dot(self.axis) / distance);
            // A vertex in contact counts as up to twice as far off.
            distance * from_axis.cosine_less(self.spread) + self.radius_m + 2.0 * self.receiver.1 < 0.0
        })
    }

    fn sides(&self, sheet: &Sheet) -> SheetSides {
        let up = sheet.up();
        let height = up.dot(self.centre - sheet.centre);
        let (centre, contact) = self.receiver;
        let of_centre = up.dot(centre - sheet.centre);
        // As in `height_over`: who is in contact counts as on the side of the receiver's centre, if that is off it.
        let above = |height: f64, of_centre: f64| {
            let lowest = height - self.radius_m;
            lowest > 1.01 * contact || (of_centre > 2.1 * contact && lowest > -0.99 * contact)
        };
        let known = [above(height, of_centre), above(-height, -of_centre)];
        let normal = if known[1] { up } else { -up };
        SheetSides { normal, height: normal.dot(self.centre - sheet.centre), known: known[0] || known[1] }
    }

    /// Whether a light may reach a vertex: it stands above the horizon, shines to this side, and brings enough.
    pub fn may_light(&self, light: &EntityBounds, view: &SphereView) -> bool {
        if view.below {
            return false;
        }
        if let Some((axis, half_angle)) = light.facing.filter(|_| view.nearest > 0.0) {
            let cone = Angle::of_cosine((half_angle + CONE_ROUNDING_RAD).min(PI).cos());
            if -view.toward.dot(axis) < cone.plus(view.turn).cosine {
                return false;
            }
        }
        self.is_enough(light.radiance * view.weight)
    }

    /// Whether the radiosity that goes with an irradiance is not bounded below eps.
    fn is_enough(&self, radiance: f64) -> bool {
        self.reflectance * radiance >= self.scene.eps
    }

    /// Whether an occluder may take light in the chain of a light (`None`: of the sky). It takes at most what comes from
    /// its part of the view, and at most what the light brings.
    ///
    /// Before a sharp light an occluder counts where any part of it may be nearer than any part of the light's middle
    /// plane, and where their cones meet, without the fade that bands need. A sheet blocks what lies beyond its plane:
    /// in bands a light whose centre does, and of a sharp light the parts that do.
    pub fn may_block(&self, view: &SphereView, light: Option<&SphereView>, sharp: bool, radiance: f64) -> bool {
        if view.below {
            return false;
        }
        let Some(light) = light else { return self.is_enough(radiance * view.weight) };
        let reach = |sphere: &SphereView| if sharp { sphere.radius } else { 0.0 };
        let (is_behind, fade_rad) = match &view.sheet {
            Some(sides) => {
                let height = sides.height + sides.normal.dot(light.toward) * (light.nearest + self.radius_m);
                // The shares of the four sides of a sheet that is seen at a grazing angle end less than the fade from it.
                (sides.known && height + reach(light) < 0.0, sharp.then_some(SKIP_FADE_RAD))
            }
            None => (view.nearest - reach(view) > light.farthest, Some(if sharp { 0.0 } else { SKIP_FADE_RAD })),
        };
        let skip = self.scene.skip;
        if skip.behind && is_behind || skip.cones && fade_rad.is_some_and(|fade_rad| apart(view, light, fade_rad)) {
            return false;
        }
        self.is_enough(radiance * view.weight.min(light.weight))
    }

    /// What becomes of an occluder whose cone meets that of a sharp light. All rays from the cluster to the light stay
    /// within a cone around the ray between the two middles. Where the object's outline is farther from that ray than
    /// the cone is wide beside the object, all of them miss the object, or all of them meet it.
    pub fn outline_result(&self, occluder: usize, light: u32) -> CullResult {
        let skip = self.scene.skip;
        let sphere = self.scene.spheres[light as usize].as_dvec4();
        let is_around = |globe: &&Globe| globe.occluder as usize == occluder && globe.light == light;
        if let Some(Globe { mesh, placement, .. }) = self.scene.globes.iter().find(is_around)
            && !mesh.holds(placement.local(self.centre))
        {
            return CullResult::Encloses;
        }
        let Some(Some(outline)) = self.scene.outlines.get(occluder).filter(|_| skip.passed || skip.covered) else {
            return CullResult::Listed;
        };
        let EntityBounds { centre, radius_m, .. } = self.scene.entities[occluder];
        let to_light = sphere.truncate() - self.centre;
        let distance = to_light.length().max(1e-15);
        let toward = to_light / distance;
        let width = |way: f64| self.radius_m + (sphere.w - self.radius_m) * (way / distance).clamp(0.0, 1.0);
        let along = (centre - self.centre).dot(toward);
        let clear = width(along - radius_m).max(width(along + radius_m)) / radius_m + OUTLINE_MARGIN;
        let point = outline.to_object * (self.centre - centre) / radius_m;
        let ray = outline.to_object * toward;
        let found = match &outline.shape {
            // Maps hold no larger distance.
            OutlineShape::Maps(_) if clear > REACH => return CullResult::Listed,
            OutlineShape::Maps(field) => field.outline(&field.near(point, ray), Side::Whole, ray).distance,
            OutlineShape::Cuboid(cuboid) => cuboid.ray(point, ray).nearest().0,
        };
        // An object covers a light only if all of it lies between.
        let between = along - INSIDE[1] * radius_m - self.radius_m > 0.0
            && distance - along - INSIDE[1] * radius_m - sphere.w > 0.0;
        match found {
            found if skip.passed && found < -clear => CullResult::LeftOff,
            found if skip.covered && outline.opaque && between && found > clear => CullResult::Covers,
            _ => CullResult::Listed,
        }
    }

    /// Whether no member of a crowd matters to any cluster within the bounds: their weight under the brightest light is
    /// negligible.
    pub fn leaves_out(&self, crowd: &Crowd) -> bool {
        !self.is_enough(self.crowd_weight(crowd) * self.scene.brightest)
    }

    /// The same for light that its members reflect: each takes less of the view than counts.
    pub fn leaves_dark(&self, crowd: &Crowd) -> bool {
        self.reflectance * self.crowd_weight(crowd) < LEAST_TAKEN
    }

    /// Whether light that an entity reflects counts at any vertex of the cluster.
    pub fn meets(&self, index: usize) -> bool {
        let view = self.view_of(index);
        !view.below && self.reflectance * view.weight >= LEAST_TAKEN
    }

    /// A bound of the weight of every member at every cluster within the bounds.
    fn crowd_weight(&self, crowd: &Crowd) -> f64 {
        let reach = f64::from(crowd.reach_m);
        let largest = f64::from(crowd.radius_m);
        let to = crowd.centre.as_dvec3() - self.centre;
        let distance = to.length().max(1e-15);
        let blur = self.radius_m + reach;
        let nearest = distance - blur;
        if nearest > largest.max(self.radius_m) {
            // Directions differ by at most asin(blur / distance) between member and crowd; a cluster adds its own turn.
            let turn = Angle::of_sine(self.radius_m / nearest).plus(Angle::of_sine(blur / distance));
            let half = Angle::of_sine(largest / nearest);
            let from_axis = Angle::of_cosine(to.dot(self.axis) / distance);
            weight(half, from_axis.cosine_less(self.spread.plus(half.plus(turn))))
        } else {
            EVERYTHING
        }
    }

    /// Whether an entity may stand on the list of any cluster within the bounds.
    pub fn may_list(&self, index: usize) -> bool {
        let EntityBounds { occludes, emits, .. } = self.scene.entities[index];
        (occludes != Occludes::Nothing || emits) && !self.leaves_out(&Crowd::of(self.scene.spheres[index]))
    }

    /// Whether an entity stands on the list of the cluster.
    pub fn lists(&self, index: usize) -> bool {
        let scene = self.scene;
        let occludes = scene.entities[index].occludes;
        let view = self.view_of(index);
        let blocks = |light: Option<&SphereView>, sharp, radiance: f64| {
            occludes.stands_before(sharp) && !self.is_own(index, sharp) && self.may_block(&view, light, sharp, radiance)
        };
        let mut lights = scene.lights.iter().map(|&light| light as usize).filter(|&light| light != self.index);
        scene.sky.is_some_and(|sky| blocks(None, false, sky))
            || lights.any(|light| {
                let light_view = self.view(scene.spheres[light]);
                let EntityBounds { sharp, radiance, .. } = scene.entities[light];
                self.may_light(&scene.entities[light], &light_view)
                    && (light == index || blocks(Some(&light_view), sharp, radiance))
            })
    }
}

/// Whether no vertex sees the two spheres within that angle of one another.
fn apart(a: &SphereView, b: &SphereView, fade_rad: f64) -> bool {
    let (Some(spread_a), Some(spread_b)) = (a.spread, b.spread) else { return false };
    let (sine, cosine) = fade_rad.sin_cos();
    a.toward.dot(b.toward) < spread_a.plus(spread_b.plus(Angle { cosine, sine })).cosine
}

/// The rotation of an entity, as `to_world` in `merge_layout.glsl`.
fn to_world(entity: &layout::DeviceEntity, p: DVec3) -> DVec3 {
    let turn = |cosine: f32, sine: f32, a: f64, b: f64| DVec2::new(cosine.into(), sine.into()).rotate(DVec2::new(a, b));
    let ([cos_a, sin_a, cos_b, sin_b], [cos_c, sin_c]) = (entity.alpha_beta, entity.gamma);
    let first = turn(cos_c, sin_c, p.x, p.y);
    let second = turn(cos_b, sin_b, p.z, first.x);
    let third = turn(cos_a, sin_a, second.y, first.y);
    DVec3::new(third.x, third.y, second.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_add_up_to_half_a_turn() {
        let mut rng = fastrand::Rng::with_seed(6);
        for _ in 0..10_000 {
            let a = PI * rng.f64();
            let b = PI * rng.f64();
            let sum = Angle::of_cosine(a.cos()).plus(Angle::of_cosine(b.cos()));
            assert!((sum.cosine - (a + b).min(PI).cos()).abs() < 1e-12, "{a} {b}");
            let less = Angle::of_cosine(a.cos()).cosine_less(Angle::of_cosine(b.cos()));
            assert!((less - (a - b).max(0.0).cos()).abs() < 1e-12, "{a} {b}");
        }
    }
}
