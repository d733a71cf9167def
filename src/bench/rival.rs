//! Comparison with the alternatives to shadow fields: soft shadows per vertex by ray casting on all CPU threads, and, where all
//! lights are balls, by shadow maps on the same device ([`super::shadow_map`]).
//!
//! The rival is [`RayCast`] in one run. It uses an 8-wide hierarchy per mesh behind a bounding sphere test, scrambled Sobol points,
//! cosine sampling of the sky and cone sampling of local lights, and leaves out occluders that cannot lie between vertex and light.
//! Rays stop at the light's surface; where along a ray that is, is asked only where an occluder lies beside the light.
//! Its hierarchies are built beforehand, as fields are baked beforehand.

use super::budget::{Truth, device_radiosity};
use super::cases::Case;
use super::figures::{Difference, Radiosity, Spread, along, crossing, spread};
use super::shadow_map::{Filter, ShadowMaps, maps_apply};
use super::sweep;
use super::{Bench, default_options, has_sharp_lights};
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::scene::{Lights, Placement};
use crate::truth::{RayCast, RayMeshes, World, receiver_vertices};
use serde::Serialize;
use std::time::Instant;

/// Ray casting with one number of rays.
#[derive(Clone, Debug, Serialize)]
pub struct RivalPoint {
    /// Rays per vertex for the sky and for each light.
    #[serde(rename = "ray_count")]
    pub rays: u32,
    /// Wall time for all lit vertices, scaled from the compared ones, milliseconds.
    pub wall_ms: Spread,
    /// Difference to T0.
    pub error: Difference,
}

/// Shadow maps of one size. They light from the lamps alone: the sky's part of the truth is given to them.
#[derive(Clone, Debug, Serialize)]
pub struct MapPoint {
    /// One comparison, or percentage-closer soft shadows.
    pub filter: Filter,
    /// Texels across a view.
    pub map_px: u32,
    /// Wall time of drawing the maps and lighting all vertices, milliseconds.
    pub wall_ms: Spread,
    /// Difference to T0.
    pub error: Difference,
}

impl MapPoint {
    /// Name in tables: `hard map 512`.
    pub fn title(&self) -> String {
        format!("{} map {}", if self.filter == Filter::Hard { "hard" } else { "PCSS" }, self.map_px)
    }
}

/// Merge, ray casting and shadow maps on one case.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Scene and light.
    pub case: String,
    /// What lights it, in words.
    pub light: String,
    /// Lit vertices.
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// Threads of the ray caster.
    #[serde(rename = "thread_count")]
    pub threads: usize,
    /// How the merge takes the lights; none where no light can be sharp.
    pub lights: Option<Lights>,
    /// Wall time of a frame of the merge without drawing, milliseconds.
    pub frame_wall_ms: Spread,
    /// Device time of the merge and of sharp lights in it, milliseconds.
    pub merge_ms: Spread,
    /// Error of the merge against T0.
    pub merge_error: Difference,
    /// Ray casting with increasing numbers of rays.
    pub rival: Vec<RivalPoint>,
    /// Wall time in which ray casting reaches the merge's root mean square error, milliseconds: interpolated, extrapolated, or the
    /// time of one ray if that already has a smaller error.
    pub rival_ms_at_equal_rms: Option<f64>,
    /// Shadow maps, hard ones first, with increasing sizes; none where a light is no ball.
    pub maps: Vec<MapPoint>,
    /// The shortest wall time in which a shadow map has at most the merge's root mean square error, milliseconds.
    pub map_ms_at_equal_rms: Option<f64>,
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

impl Comparison {
    /// Name of the case with its light, unless the name contains it, and with how lights are taken.
    pub fn title(&self) -> String {
        let light = if self.case.contains(", (") { String::new() } else { format!(" ({})", self.light) };
        let lights = if self.lights == Some(Lights::Sh) { ", lights in SH" } else { "" };
        format!("{}{light}{lights}", self.case)
    }
}

/// The merge with one way to take the lights, and its times in milliseconds, round by round.
struct Merged {
    lights: Option<Lights>,
    frame: Frame,
    walls: Vec<f64>,
    merges: Vec<f64>,
}

impl Merged {
    /// With sharp lights and without, where a light can be sharp.
    fn all(bench: &Bench<'_>, case: &Case) -> Result<Vec<Self>> {
        let both: &[Option<Lights>] = &[Some(Lights::Sharp), Some(Lights::Sh)];
        let ways = if has_sharp_lights(&case.scene) { both } else { &[None] };
        let merged = |lights: &Option<Lights>| {
            let options = frame::Options { lights: lights.unwrap_or_default(), ..default_options() };
            let frame = bench.frame(&case.scene, options)?;
            Ok(Merged { lights: *lights, frame, walls: Vec::new(), merges: Vec::new() })
        };
        ways.iter().map(merged).collect()
    }

    fn round(&mut self, placements: &[Placement]) -> Result<()> {
        // The first frame after ray casting warms up threads and caches.
        for warm in [false, true, true, true] {
            // Everything is merged, as if all entities had moved.
            self.frame.forget();
            let started = Instant::now();
            let timings = self.frame.render(placements, None)?;
            if warm {
                self.walls.push(started.elapsed().as_secs_f64() * 1e3);
                self.merges.push(sweep::merge_ms(&timings));
            }
        }
        Ok(())
    }

    fn comparison(&self, case: &Case, truth: &Truth, rival: &[RivalPoint], maps: &[MapPoint]) -> Result<Comparison> {
        let merge_error = truth.error(&device_radiosity(&self.frame, &truth.vertices)?);
        let as_good = maps.iter().filter(|p| p.error.rms <= merge_error.rms).map(|p| p.wall_ms.median);
        let errors: Vec<(f64, f64)> = rival.iter().map(|p| (f64::from(p.rays), p.error.rms)).collect();
        let times: Vec<(f64, f64)> = rival.iter().map(|p| (f64::from(p.rays), p.wall_ms.median)).collect();
        let rays_at_equal_rms = crossing(&errors, merge_error.rms);
        let rival_ms = rays_at_equal_rms.map(|rays| along(&times, rays));
        let (frame_wall_ms, merge_ms) = (spread(&self.walls), spread(&self.merges));
        Ok(Comparison {
            case: case.name.clone(),
            light: case.light.clone(),
            vertices: self.frame.receiver_vertex_count(),
            threads: rayon::current_num_threads(),
            lights: self.lights,
            merge_error,
            map_ms_at_equal_rms: as_good.min_by(f64::total_cmp),
            maps: maps.to_vec(),
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

/// Measures merge, shadow maps and ray casting in turns: a comparison with sharp lights and one with lights in SH, or one where no
/// light can be sharp.
///
/// # Errors
/// As [`Frame::new`] and [`Frame::render`].
pub fn compare(bench: &Bench<'_>, case: &Case, truth: &Truth) -> Result<Vec<Comparison>> {
    let placements = case.scene.at(case.time_s);
    let mut merged = Merged::all(bench, case)?;
    let shapes = RayMeshes::new(&case.scene);
    let rays: &[u32] = if bench.quick { &[1, 4, 16, 64, 256] } else { &[1, 4, 16, 64, 256, 1024, 4096] };
    let share = merged[0].frame.receiver_vertex_count() as f64 / truth.vertices.len() as f64;
    let mut maps = Maps::new(bench, case, truth);
    let mut rival_walls = vec![Vec::new(); rays.len()];
    let mut found: Vec<Vec<Radiosity>> = vec![Vec::new(); rays.len()];
    for round in 0..if bench.quick { 3 } else { 7 } {
        merged.iter_mut().try_for_each(|merged| merged.round(&placements))?;
        maps.round(&placements)?;
        for (index, &rays) in rays.iter().enumerate() {
            // Long runs need fewer repetitions.
            if round >= 3 && rays > 256 {
                continue;
            }
            let cast = RayCast { rays, runs: 1, seed: bench.seed + 77, distant: case.distant, ..Default::default() };
            let started = Instant::now();
            let world = World::new(&case.scene, &shapes, &placements);
            let lit = cast.run(&world, &truth.vertices);
            rival_walls[index].push(started.elapsed().as_secs_f64() * 1e3 * share);
            found[index] = lit.iter().map(|e| e.radiosity).collect();
        }
    }
    let rival: Vec<RivalPoint> = rays
        .iter()
        .enumerate()
        .map(|(i, &rays)| RivalPoint { rays, wall_ms: spread(&rival_walls[i]), error: truth.error(&found[i]) })
        .collect();
    let maps = maps.points();
    (bench.progress)(&format!("{}: merge against ray casting measured", case.name));
    merged.iter().map(|merged| merged.comparison(case, truth, &rival, &maps)).collect()
}

/// Texels across a view that are measured; a quick run takes every other.
const MAP_PX: [u32; 4] = [256, 512, 1024, 2048];
/// Rays of the sky's part, which both the truth and the maps have.
const SKY_RAYS: u32 = 1024;

/// Shadow maps of all sizes, measured round by round.
struct Maps<'c> {
    bench: &'c Bench<'c>,
    case: &'c Case,
    truth: &'c Truth,
    /// What the sky gives to the compared vertices.
    sky: Vec<Radiosity>,
    /// Filter, size, wall times, and what was found last.
    measured: Vec<(Filter, u32, Vec<f64>, Vec<Radiosity>)>,
}

impl<'c> Maps<'c> {
    fn new(bench: &'c Bench<'c>, case: &'c Case, truth: &'c Truth) -> Self {
        let sizes = || MAP_PX.into_iter().skip(usize::from(bench.quick)).step_by(1 + usize::from(bench.quick));
        let all = [Filter::Hard, Filter::Pcss].into_iter().flat_map(|filter| sizes().map(move |px| (filter, px)));
        let all = all.filter(|_| maps_apply(&case.scene));
        let measured: Vec<_> = all.map(|(filter, px)| (filter, px, Vec::new(), Vec::new())).collect();
        let sky = if measured.is_empty() { Vec::new() } else { sky(bench, case, truth) };
        Maps { bench, case, truth, sky, measured }
    }

    /// Draws and lights three times with each; the first time warms up.
    fn round(&mut self, placements: &[Placement]) -> Result<()> {
        let gpu = (self.bench.baker.device(), self.bench.baker.library());
        for (filter, px, walls, found) in &mut self.measured {
            let maps = ShadowMaps::new(gpu, &self.case.scene, placements, *filter, *px)?;
            for warm in [false, true, true] {
                let started = Instant::now();
                maps.run(&self.case.scene, placements)?;
                if warm {
                    walls.push(started.elapsed().as_secs_f64() * 1e3);
                }
            }
            let (all, lamps) = (receiver_vertices(&self.case.scene), maps.radiosity()?);
            let of = |(vertex, sky): (_, &Radiosity)| {
                let lamps = lamps[all.binary_search(vertex).expect("it is lit")];
                std::array::from_fn(|c| sky[c] + lamps[c])
            };
            *found = self.truth.vertices.iter().zip(&self.sky).map(of).collect();
        }
        Ok(())
    }

    fn points(self) -> Vec<MapPoint> {
        let point = |(filter, map_px, walls, found): &(Filter, u32, Vec<f64>, Vec<Radiosity>)| MapPoint {
            filter: *filter,
            map_px: *map_px,
            wall_ms: spread(walls),
            error: self.truth.error(found),
        };
        self.measured.iter().map(point).collect()
    }
}

/// What the sky alone gives to the compared vertices.
fn sky(bench: &Bench<'_>, case: &Case, truth: &Truth) -> Vec<Radiosity> {
    let shapes = RayMeshes::new(&case.scene);
    let mut world = World::new(&case.scene, &shapes, &case.scene.at(case.time_s));
    world.lights.clear();
    let cast = RayCast { rays: SKY_RAYS, runs: 1, seed: bench.seed, distant: case.distant, ..Default::default() };
    cast.run(&world, &truth.vertices).iter().map(|e| e.radiosity).collect()
}
