//! `bench scaling`: time and memory of a frame as vertices, entities and lights increase.

use super::figures::{Spread, spread};
use super::judged::Judged;
use super::town::{Town, moved};
use super::{Bench, default_options, merge_ms};
use crate::error::{Error, Result};
use crate::frame::{self, Frame};
use crate::lists::skip::Skip;
use crate::scene::Placement;
use crate::truth::{RayCast, World};
use serde::Serialize;
use std::time::Instant;

/// Measurements at one size along one axis.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingPoint {
    /// The varied quantity: vertices, entities (only the floor is lit), entities all lit, or lights.
    pub axis: &'static str,
    /// Number of lit vertices.
    pub vertices: usize,
    /// Number of entities, including the floor.
    pub entities: usize,
    /// Number of lights among them.
    pub lights: usize,
    /// Wall time of a frame without drawing in which everything but the floor moves, milliseconds.
    pub all_move_ms: Spread,
    /// Device time of the merge in it, milliseconds.
    pub merge_ms: Spread,
    /// The same in nanoseconds per vertex.
    pub merge_ns_a_vertex: f64,
    /// Wall time of a frame in which one entity moves, milliseconds.
    pub one_moves_ms: Spread,
    /// Wall time of a frame at rest, milliseconds.
    pub rest_ms: Spread,
    /// Lookups per vertex.
    pub entries_a_vertex: f64,
    /// Relative root mean square error of a sample of vertices against ray casting.
    pub error: f64,
    pub device_bytes: u64,
}

/// Measures the `chosen` axes (all if empty).
pub fn run(bench: &Bench<'_>, chosen: &[String]) -> Result<Vec<ScalingPoint>> {
    let mut axes = axes(bench.quick);
    if let Some(name) = chosen.iter().find(|name| !axes.iter().any(|(axis, _)| axis == name)) {
        let names: Vec<&str> = axes.iter().map(|(axis, _)| *axis).collect();
        return Err(Error::Usage(format!("unknown axis \"{name}\" ({})", names.join(", "))));
    }
    axes.retain(|(axis, _)| chosen.is_empty() || chosen.iter().any(|name| name == axis));
    let mut points = Vec::new();
    for (axis, towns) in &axes {
        for &town in towns {
            points.push(point(bench, axis, town)?);
        }
    }
    Ok(points)
}

/// Every axis with its towns from small to large. With more entities the town becomes larger at equal density of
/// entities and vertices, so the neighbourhood of a vertex stays the same.
fn axes(quick: bool) -> Vec<(&'static str, Vec<Town>)> {
    let cells: &[usize] = if quick { &[31, 63, 127, 255] } else { &[31, 63, 127, 255, 511, 1023] };
    let things: &[usize] = if quick { &[16, 64, 1024, 4095] } else { &[1, 4, 16, 64, 256, 1024, 4095] };
    let lights: &[usize] = if quick { &[1, 16] } else { &[1, 4, 16, 64] };
    let base = Town { things: 64, lights: 0, cells: 64, receive: false };
    let with = |of: &[usize], town: &dyn Fn(usize) -> Town| of.iter().map(|&n| town(n)).collect::<Vec<_>>();
    let edge = |things: usize| (things as f64).sqrt().ceil() as usize;
    let mut axes = vec![
        ("vertices", with(cells, &|cells| Town { cells, things: 16, ..base })),
        ("entities", with(things, &|things| Town { things, cells: 4 * edge(things), ..base })),
        // With so many entities that lights remain few among them.
        ("lights", with(lights, &|lights| Town { lights, things: 256, ..base })),
    ];
    if !quick {
        let lit = |things| Town { things, cells: 4 * edge(things), receive: true, ..base };
        axes.insert(2, ("entities all lit", with(things, &lit)));
    }
    axes
}

/// Relative root mean square error of a sample of vertices against ray casting.
fn error(bench: &Bench<'_>, frame: &mut Frame, placements: &[Placement]) -> Result<f64> {
    let scene = frame.scene().clone();
    let world = World::of(&scene, placements);
    let cast = RayCast { rays: if bench.quick { 256 } else { 1024 }, seed: bench.seed, ..Default::default() };
    let judged = Judged::vertices(&world, if bench.quick { 64 } else { 256 }, &cast);
    frame.render(placements, None)?;
    Ok(judged.error(&judged.found(frame)?).rms)
}

fn point(bench: &Bench<'_>, axis: &'static str, town: Town) -> Result<ScalingPoint> {
    let scene = town.scene()?;
    let placements = scene.at(0.0);
    let mut frame = bench.frame(&scene, frame::Options { skip: Skip::ALL, ..default_options() })?;
    let everything = |time_s: f64| -> Vec<Placement> {
        let floor = placements.iter().take(1).copied();
        floor.chain(placements.iter().skip(1).map(|p| moved(p, time_s))).collect()
    };
    let most = if bench.quick { 3 } else { 7 };
    let timed = |frame: &mut Frame, at: &dyn Fn(usize) -> Vec<Placement>| -> Result<(Vec<f64>, Vec<f64>)> {
        let mut walls = Vec::new();
        let mut merges = Vec::new();
        let begun = Instant::now();
        for round in 0..=most {
            let now = at(round);
            let started = Instant::now();
            let merge = merge_ms(&frame.render(&now, None)?);
            if round > 0 {
                walls.push(started.elapsed().as_secs_f64() * 1e3);
                merges.push(merge);
            }
            // Long frames need fewer repetitions.
            if walls.len() >= 3 && begun.elapsed().as_secs_f64() > 5.0 {
                break;
            }
        }
        Ok((walls, merges))
    };
    let (walls, merges) = timed(&mut frame, &|round| everything(round as f64))?;
    let vertices = frame.receiver_vertex_count();
    let entries_a_vertex = frame.merged().merged_entries as f64 / frame.merged().clusters.max(1) as f64;
    let last = scene.entities.len() - 1;
    let (one, _) = timed(&mut frame, &|round| {
        let mut now = placements.clone();
        now[last / 2] = moved(&placements[last / 2], round as f64);
        now
    })?;
    let (rest, _) = timed(&mut frame, &|_| placements.clone())?;
    let merge_ms = spread(&merges);
    (bench.progress)(&format!("{axis}: {vertices} vertices, {} entities measured", scene.entities.len()));
    Ok(ScalingPoint {
        axis,
        vertices,
        entities: scene.entities.len(),
        lights: town.lights,
        all_move_ms: spread(&walls),
        merge_ms,
        merge_ns_a_vertex: merge_ms.median * 1e6 / vertices as f64,
        one_moves_ms: spread(&one),
        rest_ms: spread(&rest),
        entries_a_vertex,
        error: error(bench, &mut frame, &placements)?,
        device_bytes: bench.baker.device().allocated_bytes(),
    })
}
