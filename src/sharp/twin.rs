//! The CPU twin of "sharp", in f64 and vertex by vertex, from the same stored numbers.

use crate::field::Area;
use crate::field::cuboid::Cuboid;
use crate::field::lamp_colors::{LampColors, color_at};
use crate::field::self_visibility::{self, BYTES};
use crate::field::sheet::{BEYOND, Sheet, SheetEye, SheetShadow};
use crate::field::silhouette::{Near, SilhouetteField};
use crate::field::sub_light::{BLOCK, LightPart, SeenLight};
use crate::scene::LightMethod;
use crate::scene::light::Spot;
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// One object, as the pass sees it.
pub struct SharpObject<'f> {
    /// Centre of the bounding sphere in the world, metres.
    pub centre: DVec3,
    pub rotation: DQuat,
    /// Bounding radius after scaling, metres.
    pub radius_m: f64,
    pub silhouette: Option<&'f SilhouetteField>,
    /// Its area from afar, if it is known.
    pub area: Option<Area>,
    /// The box that blocks in place of an outline.
    pub cuboid: Option<Cuboid>,
    /// The rectangle that blocks in place of an outline.
    pub sheet: Option<Sheet>,
    /// Share of light that it keeps back where it blocks.
    pub opacity: f64,
}

impl SharpObject<'_> {
    /// A direction of the world in the object's frame.
    fn turned(&self, direction: DVec3) -> DVec3 {
        self.rotation.inverse() * direction
    }

    /// A place of the world in the object's frame, in its bounding radii from its centre.
    fn local(&self, place: DVec3) -> DVec3 {
        self.turned(place - self.centre) / self.radius_m
    }
}

#[derive(Clone, Copy, Debug)]
pub struct SharpLight<'f> {
    pub entity: usize,
    /// Linear RGB radiance.
    pub emission: DVec3,
    /// The colours of its parts, if they have any: factors on the emission.
    pub colors: Option<&'f LampColors>,
    /// How its light is computed: as a sharp light's.
    pub method: LightMethod,
    /// Its cone, if it is a spot.
    pub spot: Option<Spot>,
}

/// One receiver under all sharp lights.
pub struct SharpTwin<'t> {
    pub objects: &'t [SharpObject<'t>],
    /// The object that is lit.
    pub receiver: usize,
    /// Objects that occlude the receiver.
    pub occluders: &'t [usize],
    /// Self-visibility of its points, [`BYTES`] each, if it can shadow itself.
    pub self_maps: Option<&'t [u8]>,
    pub lights: &'t [SharpLight<'t>],
    /// Whether a vertex leaves out an occluder before a light, or the light itself where both are the same.
    pub leaves: &'t (dyn Fn(usize, usize, usize) -> bool + Sync),
    /// Whether a vertex is known to see all of a light, or nothing; `None` where occluders decide.
    pub sees: &'t (dyn Fn(usize, usize) -> Option<bool> + Sync),
    /// Whether, to a vertex, an occluder is a globe around a light.
    pub encloses: &'t (dyn Fn(usize, usize, usize) -> bool + Sync),
}

/// A vertex in the world.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    pub position: DVec3,
    pub normal: DVec3,
    /// Unit normal in the receiver's own frame.
    pub own_normal: DVec3,
}

impl SharpTwin<'_> {
    /// Irradiance of every vertex over pi: to be multiplied by the albedo.
    pub fn run(&self, points: &[SurfacePoint]) -> Vec<DVec3> {
        points.par_iter().enumerate().map(|(v, point)| self.vertex(v, point)).collect()
    }

    fn vertex(&self, v: usize, point: &SurfacePoint) -> DVec3 {
        let cone = |light: &SharpLight<'_>| {
            let shining = &self.objects[light.entity];
            light.spot.map_or(1.0, |spot| spot.share(shining.rotation, shining.centre - point.position))
        };
        let lit = |light: &SharpLight<'_>| light.emission * cone(light) * self.irradiance(v, point, light) / PI;
        let shines = |light: &&SharpLight<'_>| {
            !(self.leaves)(v, light.entity, light.entity) && (self.sees)(v, light.entity) != Some(false)
        };
        self.lights.iter().filter(shines).map(lit).sum()
    }

    /// Irradiance of a light of emission 1.
    fn irradiance(&self, v: usize, point: &SurfacePoint, light: &SharpLight<'_>) -> DVec3 {
        let shining = &self.objects[light.entity];
        let to = shining.centre - point.position;
        let radius = shining.radius_m;
        // The light's parts, and the share of each that shines; `None` where its own outline tells.
        let (seen, share) = match light.method {
            LightMethod::Ball(share) => (SeenLight::new(to, radius), Some(share)),
            LightMethod::LampFace(panel) => (SeenLight::panel(to, radius, panel, shining.rotation), Some(1.0)),
            LightMethod::Outline => {
                let field = shining.silhouette.expect("what shines by its outline has a silhouette field");
                let seen = SeenLight::outlined(to, radius);
                let corners = field.extent().map(|corner| radius * corner);
                (if field.has_box() { seen.boxed(corners, shining.rotation) } else { seen }, None)
            }
            LightMethod::Harmonics => return DVec3::ZERO,
        };
        let is_free = (self.sees)(v, light.entity) == Some(true);
        let between = |j: &&usize| !is_free && **j != light.entity && !(self.leaves)(v, **j, light.entity);
        let (globes, between): (Vec<usize>, Vec<usize>) =
            self.occluders.iter().filter(between).partition(|j| (self.encloses)(v, **j, light.entity));
        let past_globes: f64 = globes.iter().map(|&j| 1.0 - self.objects[j].opacity).product();
        let between = between.into_iter().map(|j| &self.objects[j]);
        let (sheets, occluders): (Vec<&SharpObject<'_>>, Vec<_>) = between.partition(|object| object.sheet.is_some());
        let (cuboids, occluders): (Vec<_>, Vec<_>) = occluders.into_iter().partition(|object| object.cuboid.is_some());
        let receiver = &self.objects[self.receiver];
        let eye =
            SheetEye { position: point.position, normal: point.normal, receiver: (receiver.centre, receiver.radius_m) };
        let sheets: Vec<_> =
            sheets.iter().flat_map(|object| Some((object.sheet?.seen(&eye), object.opacity))).collect();
        let near = |object: &SharpObject<'_>, toward: DVec3| {
            let field = object.silhouette.expect("what blocks or shines by its outline has a silhouette field");
            field.near(object.local(point.position), object.turned(toward))
        };
        let blocked = |object: &SharpObject<'_>, near: &Near, part: &LightPart, distance_m: f64| {
            let field = object.silhouette.expect("as in `near`");
            field.blocked(near, object.turned(part.toward), distance_m / object.radius_m, part.tangent())
        };
        let colors = light.colors.map(|colors| (colors.mean, colors.seen(shining.turned(seen.toward), seen.sine)));
        let color = |part: &LightPart| {
            let Some((mean, plane)) = &colors else { return DVec3::ONE };
            let aside = (part.toward - part.toward.dot(seen.toward) * seen.toward) / seen.sine;
            *mean * color_at(plane, shining.turned(aside))
        };
        let block = |(number, (toward, parts)): (usize, (DVec3, [LightPart; BLOCK]))| -> DVec3 {
            let between: Vec<Near> = occluders.iter().map(|object| near(object, toward)).collect();
            // From afar the light is one block, which its area covers.
            let is_whole = number == 0 && seen.fine < 1.0;
            let area = shining.area.filter(|_| share.is_none() && is_whole);
            let share = share.or(area.map(|area| area.at(shining.turned(seen.toward))));
            let own = share.is_none().then(|| near(shining, toward));
            let part = |part: &LightPart| {
                let pairs = occluders.iter().zip(&between);
                let through: f64 = pairs
                    .map(|(object, near)| 1.0 - object.opacity * blocked(object, near, part, part.distance))
                    .product();
                let past_cuboid = |object: &&SharpObject<'_>| {
                    let Some(cuboid) = object.cuboid else { return 1.0 };
                    let toward = object.turned(part.toward);
                    let distance = part.distance / object.radius_m;
                    let blocked = cuboid.blocked(object.local(point.position), toward, distance, part.tangent());
                    1.0 - object.opacity * blocked
                };
                let past_cuboids: f64 = cuboids.iter().map(past_cuboid).product();
                let past_sheets = sheets.iter().fold(SheetShadow::NONE, |shadow, (sheet, opacity)| {
                    let slope = sheet.slope(seen.facing().unwrap_or(part.toward));
                    let least_m = BEYOND * seen.sine * seen.distance;
                    let mut own = sheet.shadow(part.toward, part.distance, part.sine, slope, least_m);
                    own.free = 1.0 - opacity * (1.0 - own.free);
                    shadow.behind(own)
                });
                let covers =
                    share.unwrap_or(0.0) + own.as_ref().map_or(0.0, |near| blocked(shining, near, part, f64::INFINITY));
                let sees = self.self_maps.filter(|_| !is_free).map_or(1.0, |maps| {
                    let map = &maps[v * BYTES..][..BYTES];
                    let distance = part.distance / receiver.radius_m;
                    self_visibility::visible(map, point.own_normal, receiver.turned(part.toward), part.sine, distance)
                });
                part.share(point.normal) * sees * covers * through * past_cuboids * past_sheets.free * color(part)
            };
            parts.iter().map(part).sum()
        };
        past_globes * seen.over_parts(point.normal) * seen.blocks().into_iter().enumerate().map(block).sum::<DVec3>()
    }
}
