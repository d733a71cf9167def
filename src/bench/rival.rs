//! Comparison with the alternative to shadow fields, at vertices and at pixels: soft shadows by ray casting on all CPU
//! threads.
//!
//! The rival is [`RayCast`] in one run. It uses an 8-wide hierarchy per mesh behind a bounding sphere test, scrambled
//! Sobol points, cosine sampling of the sky and cone sampling of local lights, and leaves out occluders that cannot lie
//! between point and light. Rays stop at the light's surface; where along a ray that is, is asked only where an
//! occluder lies beside the light. Its hierarchies are built beforehand, as fields are baked beforehand. At pixels a
//! frame of ours draws its picture, and the rival is given what each pixel shows and lights that; the time of a plain
//! drawing is added to its own.

use super::cases::Case;
use super::figures::{Radiosity, Spread, VertexDifference, along, crossing, spread};
use super::judged::{Judged, JudgedAt, PIXEL_SIZE};
use super::{Bench, default_options, merge_ms};
use crate::draw::Shading;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::scene::light::has_sharp;
use crate::scene::{Lights, Placement};
use crate::truth::{RayCast, RayMeshes, World};
use serde::Serialize;
use std::time::Instant;

/// Ray casting with one number of rays.
#[derive(Clone, Debug, Serialize)]
pub struct RivalPoint {
    /// Rays per point for the sky and for each light.
    #[serde(rename = "ray_count")]
    pub rays: u32,
    /// Wall time for all points, scaled from the compared ones, milliseconds.
    pub wall_ms: Spread,
    /// Difference to T0.
    pub error: VertexDifference,
}

/// Merge and ray casting on one case.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    pub case: String,
    /// The case, how the merge takes its lights, and where it is judged.
    pub title: String,
    pub place: JudgedAt,
    #[serde(rename = "point_count")]
    pub points: usize,
    /// How the merge takes the lights; none where no light can be sharp.
    pub lights: Option<Lights>,
    /// Where sharp lights are evaluated.
    pub shading: Shading,
    /// Wall time of a frame, everything merged anew, milliseconds; at vertices without drawing.
    pub frame_wall_ms: Spread,
    /// Device time of the merge and of sharp lights in it, milliseconds.
    pub merge_ms: Spread,
    /// Error of the merge against T0.
    pub merge_error: VertexDifference,
    /// Ray casting with increasing numbers of rays.
    pub rival: Vec<RivalPoint>,
    /// Wall time in which ray casting reaches the merge's root mean square error, milliseconds: interpolated,
    /// extrapolated, or the time of one ray if that already has a smaller error.
    pub rival_ms_at_equal_rms: Option<f64>,
    /// Number of rays at which it reaches that error.
    #[serde(rename = "rays_at_equal_rms_count")]
    pub rays_at_equal_rms: Option<f64>,
    /// Ratio of that wall time to a frame of the merge.
    #[serde(rename = "speed_up_at_equal_rms_ratio")]
    pub speed_up_at_equal_rms: Option<f64>,
    /// Ratio of that wall time to the merge's device time, without lists, uploads and waiting.
    #[serde(rename = "merge_speed_up_at_equal_rms_ratio")]
    pub merge_speed_up_at_equal_rms: Option<f64>,
}

/// The merge with one way to take the lights, and its times in milliseconds, round by round.
struct Merged {
    place: JudgedAt,
    lights: Option<Lights>,
    shading: Shading,
    frame: Frame,
    walls: Vec<f64>,
    merges: Vec<f64>,
}

impl Merged {
    /// With sharp lights and without, where a light can be sharp.
    fn all(bench: &Bench<'_>, case: &Case, place: JudgedAt) -> Result<Vec<Self>> {
        let sharp = Some(Lights::Sharp);
        let sh = Some(Lights::Sh);
        let ways: &[(Option<Lights>, Shading)] = match (has_sharp(&case.scene, Lights::Sharp), place) {
            (false, _) => &[(None, Shading::Vertex)],
            (true, JudgedAt::Vertices) => &[(sharp, Shading::Vertex), (sh, Shading::Vertex)],
            (true, JudgedAt::Pixels) => &[(sharp, Shading::Pixel), (sharp, Shading::Vertex), (sh, Shading::Vertex)],
        };
        let merged = |(lights, shading): &(Option<Lights>, Shading)| {
            let usual = default_options();
            let size = if place == JudgedAt::Pixels { PIXEL_SIZE } else { usual.size };
            let options = frame::Options { lights: lights.unwrap_or_default(), shading: Some(*shading), size, ..usual };
            let frame = bench.frame(&case.scene, options)?;
            Ok(Merged { place, lights: *lights, shading: *shading, frame, walls: Vec::new(), merges: Vec::new() })
        };
        ways.iter().map(merged).collect()
    }

    fn round(&mut self, placements: &[Placement]) -> Result<()> {
        let white = (self.place == JudgedAt::Pixels).then_some(f32::INFINITY);
        // The first frame after ray casting warms up threads and caches.
        for warm in [false, true, true, true] {
            // Everything is merged, as if all entities had moved.
            self.frame.forget();
            let started = Instant::now();
            let timings = self.frame.render(placements, white)?;
            if warm {
                self.walls.push(started.elapsed().as_secs_f64() * 1e3);
                self.merges.push(merge_ms(&timings));
            }
        }
        Ok(())
    }

    /// Wall time of drawing what is lit already, milliseconds.
    fn redraw_ms(&mut self, placements: &[Placement]) -> Result<f64> {
        let started = Instant::now();
        self.frame.redraw(placements, f32::INFINITY)?;
        Ok(started.elapsed().as_secs_f64() * 1e3)
    }

    fn comparison(&self, case: &Case, judged: &Judged, rival: &[RivalPoint]) -> Result<Comparison> {
        let merge_error = judged.error(&judged.found(&self.frame)?);
        let errors: Vec<(f64, f64)> = rival.iter().map(|p| (f64::from(p.rays), p.error.rms)).collect();
        let times: Vec<(f64, f64)> = rival.iter().map(|p| (f64::from(p.rays), p.wall_ms.median)).collect();
        let rays_at_equal_rms = crossing(&errors, merge_error.rms);
        let rival_ms = rays_at_equal_rms.map(|rays| along(&times, rays));
        let frame_wall_ms = spread(&self.walls);
        let merge_ms = spread(&self.merges);
        let way = match (self.lights, judged.place, self.shading) {
            (None, ..) => "merge",
            (Some(Lights::Sh), ..) => "lights in SH",
            (Some(Lights::Sharp), JudgedAt::Vertices, _) => "sharp lights",
            (Some(Lights::Sharp), JudgedAt::Pixels, Shading::Vertex) => "sharp lights by vertex",
            (Some(Lights::Sharp), JudgedAt::Pixels, Shading::Pixel) => "sharp lights by pixel",
        };
        Ok(Comparison {
            case: case.name.clone(),
            title: format!("{}, {way} at {}", case.name, judged.place.name()),
            place: judged.place,
            points: judged.all,
            lights: self.lights,
            shading: self.shading,
            merge_error,
            rival_ms_at_equal_rms: rival_ms,
            rays_at_equal_rms,
            speed_up_at_equal_rms: rival_ms.map(|ms| ms / frame_wall_ms.median),
            merge_speed_up_at_equal_rms: rival_ms.map(|ms| ms / merge_ms.median),
            frame_wall_ms,
            merge_ms,
            rival: rival.to_vec(),
        })
    }
}

/// Measures merge and ray casting in turns, at vertices and at pixels: where a light can be sharp, with
/// sharp lights and with lights in SH, at pixels also with sharp lights by vertex.
pub fn compare(bench: &Bench<'_>, case: &Case, vertices: &Judged) -> Result<Vec<Comparison>> {
    let shapes = RayMeshes::new(&case.scene);
    let world = World::new(&case.scene, &shapes, &case.scene.at(case.time_s));
    let pixels = Judged::pixels(bench, case, &world);
    let mut comparisons = Vec::new();
    for judged in std::iter::once(vertices).chain(&pixels) {
        comparisons.extend(compare_at(bench, case, &shapes, judged)?);
    }
    Ok(comparisons)
}

fn compare_at(bench: &Bench<'_>, case: &Case, shapes: &RayMeshes, judged: &Judged) -> Result<Vec<Comparison>> {
    let placements = case.scene.at(case.time_s);
    let mut merged = Merged::all(bench, case, judged.place)?;
    let rays: &[u32] = if bench.quick { &[1, 4, 16, 64, 256] } else { &[1, 4, 16, 64, 256, 1024, 4096] };
    let share = judged.all as f64 / judged.points.len() as f64;
    let mut rival_walls = vec![Vec::new(); rays.len()];
    let mut found: Vec<Vec<Radiosity>> = vec![Vec::new(); rays.len()];
    let mut redrawn = Vec::new();
    for round in 0..if bench.quick { 3 } else { 7 } {
        merged.iter_mut().try_for_each(|merged| merged.round(&placements))?;
        if let (Some(last), JudgedAt::Pixels) = (merged.last_mut(), judged.place) {
            redrawn.push(last.redraw_ms(&placements)?);
        }
        for (index, &rays) in rays.iter().enumerate() {
            // Long runs need fewer repetitions.
            if round >= 3 && rays > 256 {
                continue;
            }
            let cast = RayCast { rays, runs: 1, seed: bench.seed + 77, distant: case.distant, ..Default::default() };
            let started = Instant::now();
            let world = World::new(&case.scene, shapes, &placements);
            found[index] = judged.cast(&world, &cast);
            rival_walls[index].push(started.elapsed().as_secs_f64() * 1e3 * share);
        }
    }
    let redraw_ms = spread(&redrawn).median;
    let with_drawing = |walls: &[f64]| spread(&walls.iter().map(|ms| ms + redraw_ms).collect::<Vec<_>>());
    let rival = rays.iter().zip(rival_walls).zip(&found);
    let rival: Vec<RivalPoint> = rival
        .map(|((&rays, walls), found)| RivalPoint { rays, wall_ms: with_drawing(&walls), error: judged.error(found) })
        .collect();
    (bench.progress)(&format!("{}: merge against rays measured at {}", case.name, judged.place.name()));
    merged.iter().map(|merged| merged.comparison(case, judged, &rival)).collect()
}
