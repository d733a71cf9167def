//! `bench skip`: what each skip saves and what it does to the error against ray casting, with it off and on in turns.

use super::budget::device_radiosity;
use super::cases::{self, Case};
use super::figures::{Radiosity, Spread, VertexDifference, difference, rms, spread};
use super::plot::{AxisScale, PlotColumn, RowGroup, Rows};
use super::sweep::merge_ms;
use super::town::{Town, moved};
use super::{Bench, default_options, house};
use crate::draw::Antialias;
use crate::error::Result;
use crate::frame::{self, Frame};
use crate::lists::gather::Counts;
use crate::lists::skip::{self, BenchCase, EPS, Skip};
use crate::scene::{Placement, Scene};
use crate::truth::raycast::{Distant, relative_error};
use crate::truth::{RayCast, RayMeshes, Vertex, World, sample_vertices};
use serde::Serialize;
use serde_json::json;
use std::path::Path;
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
    /// Fields on the device, bytes.
    pub field_bytes: u64,
}

/// One skip in one case.
#[derive(Clone, Debug, Serialize)]
pub struct SkipCost {
    /// Scene.
    pub case: String,
    /// Name of the skip.
    pub skip: String,
    /// Lit vertices.
    #[serde(rename = "vertex_count")]
    pub vertices: usize,
    /// Without it, all others on.
    pub off: Side,
    /// With all skips.
    pub on: Side,
    /// Frame time off over on.
    #[serde(rename = "speed_up_ratio")]
    pub times_faster: f64,
    /// Largest change of a vertex, relative to the root mean square of T0.
    pub change: VertexDifference,
    /// What the lists leave off, all skips on.
    pub counts: Counts,
    /// What this skip left off: (cluster, chain, entity) triples, a cluster being 64 vertices. `None` where it does not work on
    /// lists.
    pub left_off_count: Option<u64>,
}

/// What the skip of that row's name left off.
fn left_off(name: &str, counts: &Counts) -> Option<u64> {
    serde_json::to_value(counts).ok()?.get(skip::row(name)?.counter?)?.as_u64()
}

/// Measures every skip in some cases, and writes `skip.csv`, `skip.json` and `skip.svg` into `folder`.
///
/// # Errors
/// `Failed` when the folder cannot be written; else as [`Frame::new`].
pub fn run(bench: &Bench<'_>, folder: &Path, cases: &[Case]) -> Result<Vec<SkipCost>> {
    crate::text::make_folder(folder)?;
    let mut rows = Vec::new();
    for case in cases {
        rows.extend(of_case(bench, case)?);
    }
    let origin = json!({
        "origin": bench.origin, "quick": bench.quick, "seed": bench.seed,
        "errors": "relative to the root mean square of T0 over the judged vertices",
    });
    crate::text::write_rows(folder, "skip", &origin, &rows)?;
    crate::text::write(&folder.join("skip.svg"), &plot(&rows).svg())?;
    Ok(rows)
}

/// Time and error of every skip, off and on.
fn plot(rows: &[SkipCost]) -> Rows {
    let mut cases: Vec<&str> = rows.iter().map(|row| row.case.as_str()).collect();
    cases.dedup();
    let group = |case: &&str| RowGroup {
        heading: (*case).to_owned(),
        rows: rows.iter().filter(|row| row.case == *case).map(|row| row.skip.clone()).collect(),
    };
    let column = |x_label: &str, value: &dyn Fn(&SkipCost) -> [Option<f64>; 2]| PlotColumn {
        x_label: x_label.into(),
        scale: AxisScale::Log,
        limit: None,
        values: rows.iter().map(|row| value(row).to_vec()).collect(),
    };
    let lead = column("times faster with it", &|row| [None, Some(row.times_faster)]);
    Rows {
        title: "Every skip off and on, all others on".into(),
        series: vec!["off".into(), "on".into()],
        groups: cases.iter().map(group).collect(),
        columns: vec![
            column("frame without drawing, milliseconds (median)", &|row| {
                [row.off, row.on].map(|side| Some(side.frame_ms.median))
            }),
            PlotColumn { limit: Some((1.0, "equal".into())), ..lead },
            column("RMS error against ray casting, relative", &|row| {
                [row.off, row.on].map(|side| Some(side.error.rms))
            }),
        ],
    }
}

/// All cases.
///
/// # Errors
/// As [`cases::scenes`].
pub fn all(quick: bool) -> Result<Vec<Case>> {
    let town = |things, lights, cells| -> Result<Case> {
        let scene = Town { things, lights, cells, receive: true }.scene()?;
        Ok(Case::at_start(format!("town of {things}, {lights} lights"), scene, Distant::Exact))
    };
    // A storey of a house: a floor with things on it below a ceiling, flat lamps between that shine down, of which most are out, and
    // an attic full of things.
    let house = Case::at_start("house".into(), house::scene()?, Distant::Exact);
    if quick {
        return Ok(vec![cases::scene("torus_over_plane")?, town(64, 4, 80)?, house]);
    }
    let mut cases = cases::scenes()?;
    cases.extend([town(64, 4, 160)?, town(256, 8, 160)?, house]);
    Ok(cases)
}

fn of_case(bench: &Bench<'_>, case: &Case) -> Result<Vec<SkipCost>> {
    (bench.progress)(&format!("{}: casting rays", case.name));
    let placements = case.scene.at(case.time_s);
    let shapes = RayMeshes::new(&case.scene);
    let world = World::new(&case.scene, &shapes, &placements);
    let vertices = sample_vertices(&case.scene, if bench.quick { 500 } else { 1500 }, bench.seed);
    let rays = if bench.quick { 512 } else { 4096 };
    let cast = RayCast { rays, seed: bench.seed, distant: case.distant, ..Default::default() };
    let lit = cast.run(&world, &vertices);
    let truth: Vec<Radiosity> = lit.iter().map(|e| e.radiosity).collect();
    let judge = Judge { unit: rms(&truth).max(f64::MIN_POSITIVE), vertices, truth };
    (bench.progress)(&format!("{}: relative standard error of T0 {:.1e}", case.name, relative_error(&lit)));

    let at_rest = default_options();
    let kept = frame::Options { skip: Skip::ALL, ..at_rest };
    let shown = frame::Options { size: PICTURE, antialias: Antialias::usual(bench.baker.device()), ..kept };
    let mut rows = Vec::new();
    for row in skip::switches() {
        let (what, base, timed) = match row.bench {
            Some(BenchCase::OneMoves) => (format!("{}, one moves", row.name), kept, BenchCase::OneMoves),
            Some(BenchCase::AllMove) => (format!("{}, all move", row.name), shown, BenchCase::AllMove),
            _ => (row.name.to_owned(), at_rest, BenchCase::AtRest),
        };
        let mut off = base;
        *off.skip.switch(row.name).expect("a row with a switch") = false;
        rows.push(judge.row(bench, case, &placements, [row.name, &what], [off, base], timed)?);
    }
    let what = format!("eps {EPS}");
    let without_eps = frame::Options { eps: 0.0, ..at_rest };
    rows.push(judge.row(bench, case, &placements, ["eps", &what], [without_eps, at_rest], BenchCase::AtRest)?);
    let none = frame::Options { eps: 0.0, skip: Skip::NONE, ..at_rest };
    let what = "all but unmoved";
    rows.push(judge.row(bench, case, &placements, [what, what], [none, at_rest], BenchCase::AtRest)?);
    Ok(rows)
}

/// Size of the pictures where they are timed.
const PICTURE: [u32; 2] = [1280, 720];

/// The entities that move.
fn movers(scene: &Scene, timed: BenchCase) -> Vec<usize> {
    let entities = &scene.entities;
    let occluders = (0..entities.len()).filter(|&i| entities[i].occludes);
    let lights = (0..entities.len()).filter(|&i| entities[i].emits && !entities[i].occludes);
    match timed {
        BenchCase::AtRest => Vec::new(),
        BenchCase::OneMoves => occluders.take(1).collect(),
        BenchCase::AllMove => occluders.chain(lights).collect(),
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
    timed: BenchCase,
) -> Result<Times> {
    let (mut walls, mut merges) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    for round in 0..rounds + 2 {
        let mut now = placements.to_vec();
        for &mover in movers {
            now[mover] = moved(&placements[mover], 0.2 * f64::from(round));
        }
        for (side, frame) in frames.iter_mut().enumerate() {
            let started = Instant::now();
            let passes = if timed == BenchCase::AllMove { frame.show(&now, 1.0)? } else { frame.render(&now, None)? };
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

/// What results are held against.
struct Judge {
    unit: f64,
    vertices: Vec<Vertex>,
    truth: Vec<Radiosity>,
}

impl Judge {
    /// One row: both sides in turns.
    fn row(
        &self,
        bench: &Bench<'_>,
        case: &Case,
        placements: &[Placement],
        [name, what]: [&str; 2],
        [off, on]: [frame::Options; 2],
        timed: BenchCase,
    ) -> Result<SkipCost> {
        let mut frames = [bench.frame(&case.scene, off)?, bench.frame(&case.scene, on)?];
        let rounds = if bench.quick { 5 } else { 11 };
        let (walls, merges) = in_turns(&mut frames, &movers(&case.scene, timed), placements, rounds, timed)?;
        let entries = [frames[0].merged().merged_entries, frames[1].merged().merged_entries];
        let mut found = Vec::new();
        for frame in &mut frames {
            frame.render(placements, None)?;
            found.push(device_radiosity(frame, &self.vertices)?);
        }
        let side = |i: usize| Side {
            frame_ms: spread(&walls[i]),
            merge_ms: spread(&merges[i]),
            entries: entries[i],
            error: difference(&found[i], &self.truth, self.unit),
            field_bytes: frames[i].memory().fields,
        };
        let (off, on) = (side(0), side(1));
        let counts = frames[1].counts(placements);
        (bench.progress)(&format!("{}: {what} measured", case.name));
        Ok(SkipCost {
            case: case.name.clone(),
            skip: what.to_owned(),
            vertices: frames[0].receiver_vertex_count(),
            times_faster: off.frame_ms.median / on.frame_ms.median,
            change: difference(&found[0], &found[1], self.unit),
            left_off_count: left_off(name, &counts),
            counts,
            off,
            on,
        })
    }
}
