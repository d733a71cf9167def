//! Where the merge and ray casting are compared: at vertices, which the merge lights, and at pixels, which a person
//! sees.

use super::Bench;
use super::budget::device_radiosity;
use super::cases::Case;
use super::figures::{Radiosity, VertexDifference, difference, rms};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::truth::pixels::lit_points;
use crate::truth::raycast::relative_error;
use crate::truth::world::VertexView;
use crate::truth::{RayCast, Vertex, World, receiver_vertices, sample_vertices};
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

/// Points chosen at random, and their radiosity by ray casting (T0).
pub struct Judged {
    pub place: JudgedAt,
    /// How many there are to light, of which some are compared.
    pub all: usize,
    /// Of those that are compared: an entity with the number of its vertex or of the pixel, and the view from there.
    pub points: Vec<(Vertex, VertexView)>,
    pub t0: Vec<Radiosity>,
    /// Relative standard error of `t0`.
    pub t0_error: f64,
    /// Root mean square of `t0`: the unit of errors.
    pub unit: f64,
}

impl Judged {
    fn new(world: &World<'_>, place: JudgedAt, all: usize, points: Vec<(Vertex, VertexView)>, cast: &RayCast) -> Self {
        let lit = cast.run_at(world, &points);
        let t0: Vec<Radiosity> = lit.iter().map(|e| e.radiosity).collect();
        let unit = rms(&t0).max(f64::MIN_POSITIVE);
        Judged { place, all, points, t0, t0_error: relative_error(&lit), unit }
    }

    /// `count` vertices of the world's scene, or all if there are fewer.
    pub fn vertices(world: &World<'_>, count: usize, cast: &RayCast) -> Self {
        let chosen = sample_vertices(world.scene, count, cast.seed).into_iter();
        let points = chosen.map(|vertex| (vertex, world.view(vertex))).collect();
        Self::new(world, JudgedAt::Vertices, receiver_vertices(world.scene).len(), points, cast)
    }

    /// Vertices of a case. Their truth does not depend on options of bake or merge; an error where no light reaches any
    /// of them.
    pub fn vertices_of(bench: &Bench<'_>, case: &Case) -> Result<Self> {
        let world = World::of(&case.scene, &case.scene.at(case.time_s));
        let (count, cast) = effort(bench, case);
        let judged = Self::vertices(&world, count, &cast);
        if judged.is_lit() {
            return Ok(judged);
        }
        let count = judged.points.len();
        let what = format!("no light reaches any of the {count} judged vertices, so there is nothing to compare");
        Err(Error::Input(format!("{}: {what}", case.name)))
    }

    /// Pixels of a case; `None` where the camera sees nothing that is lit.
    pub fn pixels(bench: &Bench<'_>, case: &Case, world: &World<'_>) -> Option<Self> {
        let (count, cast) = effort(bench, case);
        let mut points = lit_points(world, PIXEL_SIZE);
        let all = points.len();
        fastrand::Rng::with_seed(bench.seed).shuffle(&mut points);
        points.truncate(count);
        Some(Self::new(world, JudgedAt::Pixels, all, points, &cast)).filter(Self::is_lit)
    }

    fn is_lit(&self) -> bool {
        self.t0.as_flattened().iter().any(|c| *c > 0.0)
    }

    /// Radiosity of the compared points by rays.
    pub fn cast(&self, world: &World<'_>, cast: &RayCast) -> Vec<Radiosity> {
        cast.run_at(world, &self.points).iter().map(|e| e.radiosity).collect()
    }

    /// The compared points' keys.
    pub fn keys(&self) -> Vec<Vertex> {
        self.points.iter().map(|(key, _)| *key).collect()
    }

    /// Radiosity of the compared points as a frame has lit them.
    pub fn found(&self, frame: &Frame) -> Result<Vec<Radiosity>> {
        if self.place == JudgedAt::Vertices {
            return device_radiosity(frame, &self.keys());
        }
        let picture = frame.picture();
        let pixel = |(key, _): &(Vertex, _)| std::array::from_fn(|c| f64::from(picture[3 * key.index + c]));
        Ok(self.points.iter().map(pixel).collect())
    }

    /// Difference of the compared points' radiosity to T0, relative to its root mean square.
    pub fn error(&self, found: &[Radiosity]) -> VertexDifference {
        difference(found, &self.t0, self.unit)
    }
}

/// How many points of a case are compared, all if there are fewer, and the rays of their truth.
fn effort(bench: &Bench<'_>, case: &Case) -> (usize, RayCast) {
    let (count, rays) = if bench.quick { (1000, 1024) } else { (1500, 16384) };
    (count, RayCast { rays, seed: bench.seed, distant: case.distant, ..Default::default() })
}
