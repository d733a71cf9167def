//! Which double-sided surfaces are seen from behind.
//!
//! Most exporters mark every material as double-sided, so the mark says little: nobody sees a floor from below. Places
//! all over the scene and its cameras look at each primitive. One that shows them its backs gets backs that are lit by
//! themselves, as an awning or a page; one that shows them nothing else was wound inside out and is turned over.

use std::collections::HashMap;
use std::f32::consts::FRAC_PI_4;
use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

/// Largest number of triangles of a scene in which this is found out. In a larger one all surfaces are lit from their
/// fronts.
pub const TRIANGLES_LIMIT: usize = 4_000_000;
/// Places on surfaces that look at others.
const PLACES: usize = 1024;
/// Looks at a surface from such places, and from cameras.
const LOOKS: [usize; 2] = [192, 64];
/// Where there is no camera, viewers walk around the scene at these angles above its middle.
const AROUND_DEG: [f32; 2] = [15.0, 45.0];
/// Least cosine between a look and the normal where it ends: the wall behind a picture sees its back, at grazing angles.
const LEAST_COSINE: f32 = 0.1;
/// Least share of looks that end at backs, of solids and of other shapes: what reaches into a solid sees its backs.
const LEAST_BACKS: [f64; 2] = [0.6, 0.1];
/// From this share on, the surface was wound inside out, if anything within the scene sees it: from around a room all
/// sees its outside.
const INSIDE_OUT: f64 = 0.95;
/// Radius of the scene in the units of the hierarchy, which leaves out boxes that a ray has left 1e-4 after its start.
const RADIUS: f32 = 1024.0;
/// Looks begin so far from the surface that they leave, in the same units.
const START: f32 = 0.05;

/// Which sides of a surface are lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    Front,
    Both,
    /// The other side is the front.
    Back,
}

/// A primitive by its mesh and number, and the number of one of its pieces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Owner {
    pub primitive: [usize; 2],
    pub piece: u32,
}

/// What lets no light through in a scene, and the places that look at it.
pub struct Onlookers {
    hierarchy: CwBvh,
    /// Triangles in the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    owners: Vec<Owner>,
    /// Of each primitive.
    indices: HashMap<[usize; 2], Vec<u32>>,
    /// Places on surfaces, and the primitive of each.
    places: Vec<(Vec3A, [usize; 2])>,
    /// Cameras of the scene, or places around it where it has none.
    cameras: Vec<Vec3A>,
    has_cameras: bool,
}

impl Onlookers {
    /// Of triangles in the world and the places of cameras, both in metres.
    pub fn new(surfaces: &[(Owner, [Vec3; 3])], cameras: &[Vec3]) -> Self {
        let corners = || surfaces.iter().flat_map(|(_, corners)| corners);
        let low = corners().fold(Vec3::MAX, |low, corner| low.min(*corner));
        let high = corners().fold(Vec3::MIN, |high, corner| high.max(*corner));
        let centre = (low + high) / 2.0;
        let radius_m = low.distance(high) / 2.0;
        let local = |place: Vec3| Vec3A::from(RADIUS / radius_m * (place - centre));
        let triangle = |(_, [a, b, c]): &(Owner, [Vec3; 3])| Triangle { v0: local(*a), v1: local(*b), v2: local(*c) };
        let unsorted: Vec<Triangle> = surfaces.iter().map(triangle).collect();
        let hierarchy = build_cwbvh_from_tris(&unsorted, BvhBuildParams::fast_build(), &mut Duration::default());
        let order = || hierarchy.primitive_indices.iter().map(|&i| i as usize);
        let triangles: Vec<Triangle> = order().map(|i| unsorted[i]).collect();
        let owners: Vec<Owner> = order().map(|i| surfaces[i].0).collect();
        let mut indices: HashMap<[usize; 2], Vec<u32>> = HashMap::new();
        (0..).zip(&owners).for_each(|(index, owner)| indices.entry(owner.primitive).or_default().push(index));
        let all: Vec<u32> = (0..triangles.len() as u32).collect();
        let places = Area::new(&triangles, &all);
        let places = (0..PLACES).map(|number| places.place(&triangles, (number as f64 + 0.5) / PLACES as f64, number));
        let around = AROUND_DEG.iter().flat_map(|above_deg| {
            (0_u8..8).map(move |eighth| {
                let (up, level) = above_deg.to_radians().sin_cos();
                let (z, x) = (f32::from(eighth) * FRAC_PI_4).sin_cos();
                3.0 * RADIUS * Vec3A::new(level * x, up, level * z)
            })
        });
        Onlookers {
            places: places.map(|(place, triangle)| (place, owners[triangle as usize].primitive)).collect(),
            has_cameras: !cameras.is_empty(),
            cameras: if cameras.is_empty() { around.collect() } else { cameras.iter().map(|at| local(*at)).collect() },
            hierarchy,
            triangles,
            owners,
            indices,
        }
    }

    /// The sides that are seen of a primitive, or of one piece of it.
    pub fn sides(&self, primitive: [usize; 2], piece: Option<u32>, is_solid: bool) -> Sides {
        let owns = |owner: Owner| owner.primitive == primitive && piece.is_none_or(|piece| owner.piece == piece);
        let mut own = self.indices.get(&primitive).cloned().unwrap_or_default();
        own.retain(|index| owns(self.owners[*index as usize]));
        if own.is_empty() {
            return Sides::Front;
        }
        let area = Area::new(&self.triangles, &own);
        let others: Vec<Vec3A> = self.places.iter().filter(|(_, of)| *of != primitive).map(|(at, _)| *at).collect();
        let mut fronts = 0;
        let mut backs = 0;
        let mut from_scene = 0;
        let viewers = [(&others, true), (&self.cameras, self.has_cameras)];
        for ((from, is_of_scene), looks) in viewers.into_iter().zip(LOOKS) {
            for look in 0..if from.is_empty() { 0 } else { looks } {
                // Places and targets in orders that have nothing to do with each other.
                let (target, _) = area.place(&self.triangles, golden(look), look);
                let eye = from[look * from.len().max(looks) / looks % from.len()];
                let Some(is_back) = self.seen(eye, target, &owns) else { continue };
                backs += u32::from(is_back);
                fronts += u32::from(!is_back);
                from_scene += u32::from(is_of_scene);
            }
        }
        let share = f64::from(backs) / f64::from((backs + fronts).max(1));
        if share < LEAST_BACKS[usize::from(!is_solid)] {
            Sides::Front
        } else if share >= INSIDE_OUT && from_scene > 0 {
            Sides::Back
        } else {
            Sides::Both
        }
    }

    /// Whether a look ends at a back; `None` where it ends at a triangle that does not count, or at a grazing angle.
    fn seen(&self, eye: Vec3A, target: Vec3A, counts: &impl Fn(Owner) -> bool) -> Option<bool> {
        let direction = (target - eye).try_normalize()?;
        let mut hit = RayHit::none();
        let ray = Ray::new(eye, direction, START, f32::INFINITY);
        self.hierarchy.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray)).then_some(())?;
        let triangle = hit.primitive_id as usize;
        let cosine = self.triangles[triangle].compute_normal().dot(direction);
        (counts(self.owners[triangle]) && cosine.abs() >= LEAST_COSINE).then_some(cosine > 0.0)
    }
}

/// Triangles by their area.
struct Area<'t> {
    triangles: &'t [u32],
    /// Areas of all triangles up to each.
    until: Vec<f64>,
}

impl<'t> Area<'t> {
    fn new(all: &[Triangle], triangles: &'t [u32]) -> Self {
        let area = |index: &u32| {
            let Triangle { v0, v1, v2 } = all[*index as usize];
            f64::from((v1 - v0).cross(v2 - v0).length())
        };
        let until = triangles.iter().map(area).scan(0.0, |sum, area| {
            *sum += area;
            Some(*sum)
        });
        Area { triangles, until: until.collect() }
    }

    /// A place on the triangle at a share of the area, and that triangle. Places of different numbers differ.
    fn place(&self, all: &[Triangle], share: f64, number: usize) -> (Vec3A, u32) {
        let at = share * self.until.last().copied().unwrap_or_default();
        let index = self.triangles[self.until.partition_point(|until| *until <= at).min(self.until.len() - 1)];
        let Triangle { v0, v1, v2 } = all[index as usize];
        let side = golden(3 * number + 1).sqrt() as f32;
        let along = golden(7 * number + 2) as f32;
        (v0 + side * ((v1 - v0) + along * (v2 - v1)), index)
    }
}

/// Multiples of the golden ratio, less their whole parts: they spread evenly over 0 to 1.
fn golden(number: usize) -> f64 {
    (0.5 + 0.618_033_988_749_895 * number as f64).fract()
}
