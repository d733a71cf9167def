//! The CPU twin of "merge", in f64 and vertex by vertex, from the same stored numbers.

use crate::field::sheet::{Sheet, SheetEye, SheetView};
use crate::field::visibility_volume::SceneVolume;
use crate::field::{Area, ShadowField};
use crate::lists::skip::{CAP_SINES, CAP_SPREAD, CONES_MEET_RAD, SKIP_FADE_RAD, Skip};
use crate::merge::chain::{ChainState, Multiplier};
use crate::sh::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, values};
use crate::sh::lobe::clamped_cosine;
use crate::sh::polygon::POLYGON_BANDS;
use crate::sh::rotation::Rotation;
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;

pub struct MergeObject<'f> {
    /// Centre of the bounding sphere in the world, metres.
    pub centre: DVec3,
    pub rotation: DQuat,
    pub scale: f64,
    /// Bounding radius after scaling, metres.
    pub radius_m: f64,
    pub albedo_over_pi: [f64; 3],
    pub emission: [f64; 3],
    pub blocked: Option<&'f ShadowField>,
    /// Fit of its solid angle from afar.
    pub area: Area,
    /// Radiance field, if its light varies over the surface.
    pub radiance: Option<&'f ShadowField>,
    /// The rectangle that blocks in place of a field.
    pub sheet: Option<Sheet>,
    /// Share of light that it keeps back where it blocks.
    pub opacity: f64,
}

pub struct MergeTwin<'t> {
    pub objects: &'t [MergeObject<'t>],
    pub receiver: usize,
    /// Occluders in the order in which they are multiplied.
    pub occluders: &'t [usize],
    pub lights: &'t [usize],
    /// Red, green and blue of the distant light.
    pub sky: Option<&'t [Vec<f64>; 3]>,
    /// What all that rests takes of the sky, where the receiver moves among it.
    pub volume: Option<&'t SceneVolume>,
    /// Positions in the receiver's frame, metres from its sphere's centre.
    pub positions: &'t [DVec3],
    pub normals: &'t [DVec3],
    /// Transfer vectors, `transfer_stride` floats apart; `None` for the cosine of the normal.
    pub transfer: Option<(&'t [f32], usize)>,
    /// SH bands of transfer, light and fields.
    pub bands: usize,
    pub skip: Skip,
    /// Whether a vertex leaves out an entity in the chain of a light (`None`: of the sky), or the light itself where
    /// both are the same, for another reason.
    pub leaves: &'t (dyn Fn(usize, usize, Option<usize>) -> bool + Sync),
}

type Coefficients = [f64; MAX_COEFFICIENTS];

impl MergeTwin<'_> {
    /// Radiosity of every vertex: linear RGB radiance that leaves the surface, without emission.
    pub fn run(&self) -> Vec<[f64; 3]> {
        let multiplier = Multiplier::new(self.bands);
        let rotations: Vec<Rotation> = self.objects.iter().map(|o| Rotation::new(self.bands, o.rotation)).collect();
        (0..self.positions.len()).into_par_iter().map(|v| self.vertex(v, &multiplier, &rotations)).collect()
    }

    fn vertex(&self, v: usize, multiplier: &Multiplier, rotations: &[Rotation]) -> [f64; 3] {
        let count = coefficient_count(self.bands);
        let receiver = &self.objects[self.receiver];
        let position = receiver.centre + receiver.rotation * (self.positions[v] * receiver.scale);
        let transfer = self.transfer(v, &rotations[self.receiver]);

        let normal = receiver.rotation * self.normals[v];
        let cones: Vec<Cone> = self.objects.iter().map(|o| Cone::new(o.centre, o.radius_m, position)).collect();
        let eye = SheetEye { position, normal, receiver: (receiver.centre, receiver.radius_m) };
        let sheet = |j: usize| self.objects[j].sheet.map(|sheet| sheet.seen(&eye));
        let factors: Vec<(usize, f64, Coefficients, Option<Cap>)> = self
            .occluders
            .iter()
            .map(|&j| {
                if let Some(sheet) = sheet(j) {
                    let reach = self.objects[j].opacity * sheet_above_horizon(&sheet, normal, self.skip);
                    return (j, reach, self.sheet_blocked(&sheet), None);
                }
                let share = cones[j].field_share(self.skip);
                let blocked = self.field(j, position, None, rotations).map(|b| b * share);
                let object = &self.objects[j];
                let area = || object.area.at(object.rotation.inverse() * cones[j].toward);
                let cap = (share < 1.0).then(|| cones[j].cap(area()).by(1.0 - share));
                (j, object.opacity * cones[j].above_horizon(normal, self.skip), blocked, cap)
            })
            .collect();
        // The chain of the occluders, each as much as `share` says.
        let begun = multiplier.begin(&transfer[..count]);
        let chain = |mut state: ChainState, share: &dyn Fn(usize) -> f64| {
            for (j, reach, b, cap) in &factors {
                let share = reach * share(*j);
                multiplier.multiply(&mut state, &b.map(|b| b * share));
                if let Some(cap) = cap {
                    cap.by(share).cover(multiplier, &mut state);
                }
            }
            state
        };

        let mut sum = [0.0; 3];
        if let Some(sky) = self.sky {
            let counts = |j, chosen: bool| if !chosen || (self.leaves)(v, j, None) { 0.0 } else { 1.0 };
            let t = match self.volume {
                None => chain(begun, &|j| counts(j, true)),
                Some(volume) => {
                    let one_by_one = chain(begun, &|j| counts(j, volume.has[j]));
                    let (share, blocked) = volume.volume.lookup(position, self.bands);
                    let mut at_once = begun;
                    multiplier.multiply(&mut at_once, &blocked);
                    let mixed = std::array::from_fn(|k| one_by_one[k] + share * (at_once[k] - one_by_one[k]));
                    chain(mixed, &|j| counts(j, !volume.has[j]))
                }
            };
            sum.iter_mut().zip(sky).for_each(|(sum, sky)| *sum += multiplier.meet(&t, sky));
        }
        for &light in self.lights.iter().filter(|&&l| l != self.receiver && !(self.leaves)(v, l, Some(l))) {
            let before = |j: usize| (cones[j].distance, j) < (cones[light].distance, light);
            let t = chain(begun, &|j| match sheet(j) {
                _ if (self.leaves)(v, j, Some(light)) => 0.0,
                Some(sheet) => {
                    let Cone { toward, distance, .. } = cones[light];
                    sheet_before(&sheet, distance * toward, self.objects[light].radius_m, self.skip)
                }
                None if before(j) => cones[j].overlap(&cones[light], self.skip),
                None => 0.0,
            });
            let reach = cones[light].above_horizon(normal, self.skip);
            for (channel, sum) in sum.iter_mut().enumerate() {
                let s = self.field(light, position, Some(channel), rotations);
                *sum += reach * self.objects[light].emission[channel] * multiplier.meet(&t, &s);
            }
        }
        std::array::from_fn(|channel| sum[channel] * receiver.albedo_over_pi[channel])
    }

    fn transfer(&self, v: usize, rotation: &Rotation) -> Coefficients {
        let count = coefficient_count(self.bands);
        let mut out = [0.0; MAX_COEFFICIENTS];
        match self.transfer {
            Some((floats, stride)) => {
                let mut local = [0.0; MAX_COEFFICIENTS];
                let stored = &floats[v * stride..v * stride + count];
                local.iter_mut().zip(stored).for_each(|(to, from)| *to = f64::from(*from));
                rotation.apply(&local, &mut out);
            }
            None => {
                let normal = self.objects[self.receiver].rotation * self.normals[v];
                out[..count].copy_from_slice(&clamped_cosine(self.bands, normal));
            }
        }
        out
    }

    /// What a sheet blocks, in as many bands as are both known and asked for.
    fn sheet_blocked(&self, sheet: &SheetView) -> Coefficients {
        let mut out = [0.0; MAX_COEFFICIENTS];
        let count = coefficient_count(self.bands.min(POLYGON_BANDS));
        out[..count].copy_from_slice(&sheet.blocked()[..count]);
        out
    }

    /// The field of object `j` at a world position, in the world frame: radiance of a channel, or the blocked part.
    fn field(&self, j: usize, position: DVec3, channel: Option<usize>, rotations: &[Rotation]) -> Coefficients {
        let object = &self.objects[j];
        let (field, channel) = match (object.radiance, channel) {
            (Some(field), Some(channel)) => (field, channel),
            _ => (object.blocked.expect("what blocks or shines in one colour has an occlusion field"), 0),
        };
        let local = object.rotation.inverse() * (position - object.centre) / object.radius_m;
        let mut found = [0.0; MAX_COEFFICIENTS];
        let mut out = [0.0; MAX_COEFFICIENTS];
        field.lookup(local, channel, &mut found);
        rotations[j].apply(&found, &mut out);
        out
    }
}

/// How far a light's centre lies beyond a sheet, in its bounding radii, where the sheet counts in full. A lamp that lies
/// on a ceiling is to shine.
pub const BEHIND_SHEET: f64 = 0.2;

/// Share with which a sheet counts above a horizon: 0 where none of it rises above, and all where it may rise by
/// [`SKIP_FADE_RAD`]. The twin of `glsl/merge_sheet.glsl`, as all about sheets here.
fn sheet_above_horizon(sheet: &SheetView, normal: DVec3, skip: Skip) -> f64 {
    let highest = sheet.corners().into_iter().map(|corner| corner.dot(normal)).fold(f64::NEG_INFINITY, f64::max);
    if skip.horizon { smoothstep(0.0, SKIP_FADE_RAD.sin(), highest / sheet.nearest_m()) } else { 1.0 }
}

/// Share with which a sheet counts before a light whose centre lies at `to` from the point, metres. It goes from 0 to 1
/// as that centre goes from the sheet's plane to [`BEHIND_SHEET`] beyond it. It is less where the two stand side by
/// side: 1 where the light reaches [`CONES_MEET_RAD`] into the sheet or its middle does, fading to 0 where they are
/// [`SKIP_FADE_RAD`] apart.
fn sheet_before(sheet: &SheetView, to: DVec3, radius_m: f64, skip: Skip) -> f64 {
    let beyond = smoothstep(0.0, BEHIND_SHEET, sheet.beyond_m(to) / radius_m);
    let sine = (radius_m / to.length()).min(1.0);
    let apart = -sine - SKIP_FADE_RAD.sin();
    let met = (CONES_MEET_RAD.sin() - sine).min(0.0);
    let inside = sheet.inside(to.normalize_or_zero()).min_element();
    if skip.cones { beyond * smoothstep(apart, met, inside) } else { beyond }
}

/// A bounding sphere as a cone in a vertex's view: the twin of `glsl/merge_cone.glsl`, in angles.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    pub toward: DVec3,
    pub distance: f64,
    half_angle_rad: Option<f64>,
}

impl Cone {
    /// The cone of a sphere as seen from `position`, metres.
    pub fn new(centre: DVec3, radius_m: f64, position: DVec3) -> Self {
        let to = centre - position;
        let distance = to.length();
        let sine = radius_m / distance;
        Cone { toward: to.normalize_or_zero(), distance, half_angle_rad: (sine < 1.0).then(|| sine.asin()) }
    }

    /// Share with which it counts above a horizon: 1 where any of the sphere rises above it, fading to 0 below.
    pub fn above_horizon(&self, normal: DVec3, skip: Skip) -> f64 {
        let sine = self.half_angle_rad.map_or(1.0, f64::sin);
        if skip.horizon { smoothstep(-sine - SKIP_FADE_RAD.sin(), -sine, normal.dot(self.toward)) } else { 1.0 }
    }

    /// Share of an occluder's field; the rest of it is a [`Cap`].
    pub fn field_share(&self, skip: Skip) -> f64 {
        let sine = self.half_angle_rad.map_or(1.0, f64::sin);
        if skip.caps { smoothstep(CAP_SINES[0], CAP_SINES[1], sine) } else { 1.0 }
    }

    /// An occluder as a cap whose projected area is this share of its sphere's.
    pub fn cap(&self, area: f64) -> Cap {
        let (sine, cosine) = self.half_angle_rad.map_or((1.0, 0.0), f64::sin_cos);
        let covered = area * sine * sine;
        let mut y = values(MAX_BANDS, self.toward);
        for l in 1..MAX_BANDS {
            let band = (1.0 - (l * (l + 1)) as f64 * CAP_SPREAD * covered / 4.0).max(0.0);
            y[l * l..(l + 1) * (l + 1)].iter_mut().for_each(|y| *y *= band);
        }
        Cap { solid_angle: 2.0 * PI * covered / (1.0 + cosine), y }
    }

    /// Share with which an occluder counts before a light: 1 where their cones reach
    /// [`CONES_MEET_RAD`] into one another, fading to 0 where they are [`SKIP_FADE_RAD`] apart.
    pub fn overlap(&self, other: &Cone, skip: Skip) -> f64 {
        match (self.half_angle_rad, other.half_angle_rad) {
            (Some(a), Some(b)) if skip.cones && (a + b + SKIP_FADE_RAD).cos() < (a + b).cos() => {
                let deep = (CONES_MEET_RAD.sin() * a.cos().min(b.cos())).asin();
                let met = (a + b - deep).max(0.0);
                smoothstep((a + b + SKIP_FADE_RAD).cos(), met.cos(), self.toward.dot(other.toward))
            }
            _ => 1.0,
        }
    }
}

/// An occluder as a point that blocks: the twin of `glsl/merge_cap.glsl`.
#[derive(Clone, Copy, Debug)]
pub struct Cap {
    /// Solid angle that it blocks, sr.
    pub solid_angle: f64,
    /// SH basis in its direction, each band reduced for its extent.
    y: Coefficients,
}

impl Cap {
    /// The same direction with a share of the solid angle.
    pub fn by(self, share: f64) -> Self {
        Cap { solid_angle: self.solid_angle * share, ..self }
    }

    pub fn cover(&self, multiplier: &Multiplier, state: &mut ChainState) {
        multiplier.cover(state, &self.y, self.solid_angle);
    }
}

/// 0 up to `low`, 1 from `high` on, smooth between.
fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a light passes an occluder its share goes from all to none without a step, ever less; so does a field's as it
    /// becomes a cap.
    #[test]
    fn shares_fade_without_a_step() {
        let cone = |rad: f64, sine: f64| Cone::new(DVec3::new(rad.cos(), rad.sin(), 0.0) / sine, 1.0, DVec3::ZERO);
        for (a, b) in [(0.5, 0.3), (0.2, 0.05), (0.03, 0.02), (0.99, 0.3)] {
            let share = |i: usize| cone(0.0, a).overlap(&cone(1e-3 * i as f64, b), Skip::ALL);
            let walk: Vec<f64> = (0..3000).map(share).collect();
            assert_eq!(walk[0], 1.0, "one behind the other");
            let touching = (1e3 * (a.asin() + b.asin())) as usize;
            let past = touching + (1e3 * SKIP_FADE_RAD) as usize + 2;
            assert!(past >= 3000 || walk[past] == 0.0, "{a} {b}: {}", walk[past]);
            let step =
                walk.windows(2).map(|w| w[0] - w[1]).fold((0.0, 0.0), |(l, m): (f64, f64), s| (l.min(s), m.max(s)));
            assert!(step.0 >= 0.0 && step.1 > 1e-3 && step.1 < 0.012, "{a} {b}: {step:?}");
        }
        let share = |i: usize| cone(0.0, 1.0 / (1.0 + 1e-3 * i as f64)).field_share(Skip::ALL);
        let walk: Vec<f64> = (0..8000).map(share).collect();
        let step = walk.windows(2).map(|w| w[0] - w[1]).fold(0.0, f64::max);
        assert!(walk[0] == 1.0 && walk[7999] == 0.0 && step < 2e-3, "{step}");
    }
}
