//! `bench skip`: what each skip saves and what it does to the error against ray casting, with it off and on in turns.

use super::cases::{self, Case};
use super::figures::{Spread, VertexDifference, difference, spread};
use super::judged::Judged;
use super::town::{Town, moved};
use super::{Bench, default_options, merge_ms};
use crate::draw::Antialias;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::lists::skip::{EPS, Skip, SkipRow, TABLE};
use crate::scene::{Placement, Scene};
use crate::truth::{RayCast, World};
use serde::Serialize;
use std::time::Instant;

/// A frame without drawing, with the skip off or on.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Side {
    /// Wall time of lists, merge and all else, milliseconds.
    pub frame_ms: Spread,
    /// Device time of the merge, milliseconds.
    pub merge_ms: Spread,
    /// Lookups in the lists that were merged, one for 64 vertices.
    #[serde(rename = "entry_count")]
    pub entries: usize,
    /// Against ray casting.
    pub error: VertexDifference,
}

#[derive(Clone, Debug, Serialize)]
pub struct SkipCost {
    pub case: String,
    pub skip: String,
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// Without it, all others on.
    pub off: Side,
    pub on: Side,
    /// Frame time off over on.
    #[serde(rename = "speed_up_ratio")]
    pub times_faster: f64,
    /// Largest change of a vertex, relative to the root mean square of T0.
    pub change: VertexDifference,
}

/// Motion of the scene while a skip is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    /// Nothing: frames without drawing, everything merged in each.
    AtRest,
    /// One thing, frames without drawing.
    OneMoves,
    /// All that casts shadows or shines, frames as a window shows them.
    AllMove,
}

/// Measures every skip in some cases.
pub fn run(bench: &Bench<'_>, cases: &[Case]) -> Result<Vec<SkipCost>> {
    let mut rows = Vec::new();
    for case in cases {
        rows.extend(of_case(bench, case)?);
    }
    Ok(rows)
}

/// The built-in scenes and towns, of which a quick run takes two.
pub fn all(quick: bool) -> Result<Vec<Case>> {
    let town = |things, lights, cells| -> Result<Case> {
        let scene = Town { things, lights, cells, receive: true }.scene()?;
        Ok(Case::at_start(format!("town of {things}, {lights} lights"), scene))
    };
    if quick {
        return Ok(vec![cases::scene("torus_over_plane")?, town(64, 4, 80)?]);
    }
    let mut cases = cases::scenes()?;
    cases.extend([town(64, 4, 160)?, town(256, 8, 160)?]);
    Ok(cases)
}

fn of_case(bench: &Bench<'_>, case: &Case) -> Result<Vec<SkipCost>> {
    (bench.progress)(&format!("{}: casting rays", case.name));
    let placements = case.scene.at(case.time_s);
    let world = World::of(&case.scene, &placements);
    let rays = if bench.quick { 512 } else { 4096 };
    let cast = RayCast { rays, seed: bench.seed, distant: case.distant, ..Default::default() };
    let judged = Judged::vertices(&world, if bench.quick { 500 } else { 1500 }, &cast);
    (bench.progress)(&format!("{}: relative standard error of T0 {:.1e}", case.name, judged.t0_error));

    let at_rest = default_options();
    let kept = frame::Options { skip: Skip::ALL, ..at_rest };
    let shown = frame::Options { size: PICTURE, antialias: Antialias::usual(bench.baker.device()), ..kept };
    let mut rows = Vec::new();
    for SkipRow { name, .. } in TABLE {
        let (what, base, motion) = match *name {
            "unmoved" => (format!("{name}, one moves"), kept, Motion::OneMoves),
            "hidden" => (format!("{name}, all move"), shown, Motion::AllMove),
            _ => ((*name).to_owned(), at_rest, Motion::AtRest),
        };
        let mut off = base;
        *off.skip.switch(name).expect("a skip with a switch") = false;
        rows.push(row(bench, case, &judged, &placements, &what, [off, base], motion)?);
    }
    let what = format!("eps {EPS}");
    let without_eps = frame::Options { eps: 0.0, ..at_rest };
    rows.push(row(bench, case, &judged, &placements, &what, [without_eps, at_rest], Motion::AtRest)?);
    let none = frame::Options { eps: 0.0, skip: Skip::NONE, ..at_rest };
    let what = "all but unmoved";
    rows.push(row(bench, case, &judged, &placements, what, [none, at_rest], Motion::AtRest)?);
    Ok(rows)
}

/// Size of the pictures where they are timed.
const PICTURE: [u32; 2] = [1280, 720];

/// The entities that move.
fn movers(scene: &Scene, motion: Motion) -> Vec<usize> {
    let entities = &scene.entities;
    let occluders = (0..entities.len()).filter(|&i| entities[i].occludes);
    let lights = (0..entities.len()).filter(|&i| entities[i].emits && !entities[i].occludes);
    match motion {
        Motion::AtRest => Vec::new(),
        Motion::OneMoves => occluders.take(1).collect(),
        Motion::AllMove => occluders.chain(lights).collect(),
    }
}

/// Times of a frame and of its merge in milliseconds, by side and round.
type Times = ([Vec<f64>; 2], [Vec<f64>; 2]);

/// Times both sides in turns.
fn in_turns(
    frames: &mut [Frame; 2],
    movers: &[usize],
    placements: &[Placement],
    rounds: u32,
    motion: Motion,
) -> Result<Times> {
    let mut walls = [Vec::new(), Vec::new()];
    let mut merges = [Vec::new(), Vec::new()];
    for round in 0..rounds + 2 {
        let mut now = placements.to_vec();
        for &mover in movers {
            now[mover] = moved(&placements[mover], 0.2 * f64::from(round));
        }
        for (side, frame) in frames.iter_mut().enumerate() {
            let started = Instant::now();
            let passes = if motion == Motion::AllMove { frame.show(&now, 1.0)? } else { frame.render(&now, None)? };
            let merge = merge_ms(&passes);
            // The first frames compile.
            if round >= 2 {
                walls[side].push(started.elapsed().as_secs_f64() * 1e3);
                merges[side].push(merge);
            }
        }
    }
    Ok((walls, merges))
}

/// One row: both sides in turns.
fn row(
    bench: &Bench<'_>,
    case: &Case,
    judged: &Judged,
    placements: &[Placement],
    what: &str,
    [off, on]: [frame::Options; 2],
    motion: Motion,
) -> Result<SkipCost> {
    let mut frames = [bench.frame(&case.scene, off)?, bench.frame(&case.scene, on)?];
    let rounds = if bench.quick { 5 } else { 11 };
    let (walls, merges) = in_turns(&mut frames, &movers(&case.scene, motion), placements, rounds, motion)?;
    let entries = [frames[0].merged().merged_entries, frames[1].merged().merged_entries];
    let mut found = Vec::new();
    for frame in &mut frames {
        frame.render(placements, None)?;
        found.push(judged.found(frame)?);
    }
    let side = |i: usize| Side {
        frame_ms: spread(&walls[i]),
        merge_ms: spread(&merges[i]),
        entries: entries[i],
        error: judged.error(&found[i]),
    };
    let off = side(0);
    let on = side(1);
    (bench.progress)(&format!("{}: {what} measured", case.name));
    Ok(SkipCost {
        case: case.name.clone(),
        skip: what.to_owned(),
        vertices: frames[0].receiver_vertex_count(),
        times_faster: off.frame_ms.median / on.frame_ms.median,
        change: difference(&found[0], &found[1], judged.unit),
        off,
        on,
    })
}
