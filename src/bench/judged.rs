//! Where the merge and its rivals are compared: at vertices, which the merge lights, and at pixels, which a person
//! sees.

use super::Bench;
use super::budget::{Effort, Reference};
use super::cases::Case;
use super::figures::{Radiosity, VertexDifference, difference, rms};
use crate::truth::pixels::lit_points;
use crate::truth::raycast::Distant;
use crate::truth::world::VertexView;
use crate::truth::{RayCast, RayMeshes, Vertex, World, receiver_vertices};
use serde::Serialize;

/// Size of the pictures that are compared with ray-cast pixels: each of them costs what a vertex does.
pub const PIXEL_SIZE: [u32; 2] = [360, 240];
/// Rays of the sky's part, which both the truth and shadow maps have.
const SKY_RAYS: u32 = 1024;

/// Points that are lit and compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JudgedAt {
    Vertices,
    /// Pixels of a picture of [`PIXEL_SIZE`] that show a lit surface.
    Pixels,
}

impl JudgedAt {
    pub fn name(self) -> &'static str {
        if self == JudgedAt::Pixels { "pixels" } else { "vertices" }
    }
}

/// All points to light, and the truth of those that are compared.
pub struct Judged {
    pub place: JudgedAt,
    /// All points: an entity with the number of its vertex or of the pixel, and the view from there.
    pub points: Vec<(Vertex, VertexView)>,
    /// Points that are compared, as indices of `points`.
    pub chosen: Vec<usize>,
    t0: Vec<Radiosity>,
    /// Root mean square of `t0`: the unit of errors.
    unit: f64,
}

impl Judged {
    pub fn vertices(world: &World<'_>, reference: &Reference) -> Self {
        let points: Vec<_> = receiver_vertices(world.scene).into_iter().map(|v| (v, world.view(v))).collect();
        let at = |vertex| points.binary_search_by_key(vertex, |(key, _)| *key).expect("it is lit");
        let chosen = reference.vertices.iter().map(at).collect();
        Judged { place: JudgedAt::Vertices, points, chosen, t0: reference.t0.clone(), unit: reference.unit }
    }

    /// Pixels, chosen at random; `None` where the camera sees nothing that is lit.
    pub fn pixels(bench: &Bench<'_>, world: &World<'_>, distant: Distant) -> Option<Self> {
        let effort = Effort::new(bench.quick);
        let points = lit_points(world, PIXEL_SIZE);
        let mut chosen: Vec<usize> = (0..points.len()).collect();
        fastrand::Rng::with_seed(bench.seed).shuffle(&mut chosen);
        chosen.truncate(effort.vertices);
        chosen.sort_unstable();
        let cast = RayCast { rays: effort.t0_rays, seed: bench.seed, distant, ..Default::default() };
        let mut judged = Judged { place: JudgedAt::Pixels, points, chosen, t0: Vec::new(), unit: 0.0 };
        judged.t0 = judged.cast(world, &cast);
        judged.unit = rms(&judged.t0);
        (judged.unit > 0.0).then_some(judged)
    }

    /// Radiosity of the compared points by rays.
    pub fn cast(&self, world: &World<'_>, cast: &RayCast) -> Vec<Radiosity> {
        let points: Vec<_> = self.chosen.iter().map(|&i| self.points[i]).collect();
        cast.run_at(world, &points).iter().map(|e| e.radiosity).collect()
    }

    /// Radiosity of the compared points under the sky alone.
    pub fn sky(&self, bench: &Bench<'_>, case: &Case, shapes: &RayMeshes) -> Vec<Radiosity> {
        let mut world = World::new(&case.scene, shapes, &case.scene.at(case.time_s));
        world.lights.clear();
        let cast = RayCast { rays: SKY_RAYS, runs: 1, seed: bench.seed, distant: case.distant, ..Default::default() };
        self.cast(&world, &cast)
    }

    /// The compared points' keys.
    pub fn keys(&self) -> impl Iterator<Item = Vertex> {
        self.chosen.iter().map(|&i| self.points[i].0)
    }

    /// Difference of the compared points' radiosity to T0, relative to its root mean square.
    pub fn error(&self, found: &[Radiosity]) -> VertexDifference {
        difference(found, &self.t0, self.unit)
    }
}
