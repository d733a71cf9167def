//! Where the merge and ray casting are compared: at vertices, which the merge lights, and at pixels, which a person
//! sees.

use super::Bench;
use super::budget::{Effort, Reference};
use super::figures::{Radiosity, VertexDifference, difference, rms};
use crate::truth::pixels::lit_points;
use crate::truth::raycast::Distant;
use crate::truth::world::VertexView;
use crate::truth::{RayCast, Vertex, World, receiver_vertices};
use serde::Serialize;

/// Size of the pictures that are compared with ray-cast pixels: each of them costs what a vertex does.
pub const PIXEL_SIZE: [u32; 2] = [360, 240];

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

/// The points that are compared, and their truth.
pub struct Judged {
    pub place: JudgedAt,
    /// How many there are to light, of which some are compared.
    pub all: usize,
    /// Of those that are compared: an entity with the number of its vertex or of the pixel, and the view from there.
    pub points: Vec<(Vertex, VertexView)>,
    t0: Vec<Radiosity>,
    /// Root mean square of `t0`: the unit of errors.
    unit: f64,
}

impl Judged {
    pub fn vertices(world: &World<'_>, reference: &Reference) -> Self {
        Judged {
            place: JudgedAt::Vertices,
            all: receiver_vertices(world.scene).len(),
            points: reference.vertices.iter().map(|&vertex| (vertex, world.view(vertex))).collect(),
            t0: reference.t0.clone(),
            unit: reference.unit,
        }
    }

    /// Pixels, chosen at random; `None` where the camera sees nothing that is lit.
    pub fn pixels(bench: &Bench<'_>, world: &World<'_>, distant: Distant) -> Option<Self> {
        let effort = Effort::new(bench.quick);
        let mut points = lit_points(world, PIXEL_SIZE);
        let all = points.len();
        fastrand::Rng::with_seed(bench.seed).shuffle(&mut points);
        points.truncate(effort.vertices);
        let cast = RayCast { rays: effort.t0_rays, seed: bench.seed, distant, ..Default::default() };
        let mut judged = Judged { place: JudgedAt::Pixels, all, points, t0: Vec::new(), unit: 0.0 };
        judged.t0 = judged.cast(world, &cast);
        judged.unit = rms(&judged.t0);
        (judged.unit > 0.0).then_some(judged)
    }

    /// Radiosity of the compared points by rays.
    pub fn cast(&self, world: &World<'_>, cast: &RayCast) -> Vec<Radiosity> {
        cast.run_at(world, &self.points).iter().map(|e| e.radiosity).collect()
    }

    /// The compared points' keys.
    pub fn keys(&self) -> impl Iterator<Item = Vertex> {
        self.points.iter().map(|(key, _)| *key)
    }

    /// Difference of the compared points' radiosity to T0, relative to its root mean square.
    pub fn error(&self, found: &[Radiosity]) -> VertexDifference {
        difference(found, &self.t0, self.unit)
    }
}
