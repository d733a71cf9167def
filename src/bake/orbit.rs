//! Samples that a symmetry carries into one another are captured once an orbit; the rest is made by turning coefficients, which is
//! exact.
//!
//! A symmetry may be used for a sample where its deviation (see [`super::symmetry`]) is seen from there as at most
//! [`TEXEL_SHARE`] of a texel: those that are exact to rounding serve everywhere, the turns of a faceted body from afar.

use super::symmetry::{Operation, Points, Symmetry};
use crate::asset::Mesh;
use crate::field::Lattice;
use crate::field::quantity::channel_stride;
use crate::sh::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, evaluate};
use crate::sh::lobe;
use crate::sh::rotation::Rotation;
use glam::{DMat3, DQuat, DVec3, IVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::PI;

/// Largest displacement of what is captured, in texels of a face. Facets go to and fro, so that the solid neither shrinks nor
/// grows with them.
pub const TEXEL_SHARE: f64 = 0.25;

/// A sample that is made from another.
#[derive(Clone, Copy, Debug)]
pub struct Twin {
    /// The captured one.
    pub of: u32,
    /// Orthogonal: what the captured one sees at w, this one sees at `turn` w.
    pub turn: DMat3,
    /// Deviation of the symmetry, in r.
    pub deviation: f64,
}

impl Twin {
    /// The same sample under another index.
    pub fn same(of: u32) -> Self {
        Twin { of, turn: DMat3::IDENTITY, deviation: 0.0 }
    }
}

/// For every sample of a lattice the one that it is, where that stands before it.
pub fn same(lattice: &Lattice) -> Vec<Option<Twin>> {
    let count = lattice.direction_count();
    let first = |sample: u32| sample / count * count + lattice.first_of(sample % count);
    (0..lattice.sample_count()).map(|s| (first(s) < s).then(|| Twin::same(first(s)))).collect()
}

/// Deviation, in r, that may be seen from a surface's distance (in r) on faces of `face_px`. A face of N texels spans two units of
/// position over depth, and depth is at least distance / sqrt 3.
pub fn allowed(distance: f64, face_px: u32) -> f64 {
    TEXEL_SHARE * 2.0 / 3.0_f64.sqrt() * distance / f64::from(face_px)
}

/// What is captured and what is turned.
pub struct Plan {
    /// For every sample of the lattice the one it is made from, or `None` where it is captured.
    pub twins: Vec<Option<Twin>>,
    /// For every shell from which the object looks like a sphere, the captured samples: one function about the direction stands for
    /// all of the shell's samples, and is the mean over these. A shell has none where the object does not look like one.
    pub round: Vec<Vec<u32>>,
}

/// Captured samples of a shell on which all are alike. One would do but for its texels: the same rounding of the same silhouette
/// would be the error of the whole shell.
const ROUND_SAMPLES: u32 = 8;

/// Plans the samples of a lattice; `distance(sample)` is that of the surface from the eye, in r.
pub fn plan(lattice: &Lattice, symmetry: &Symmetry, face_px: u32, distance: impl Fn(u32) -> f64 + Sync) -> Plan {
    let count = lattice.direction_count();
    let directions: Vec<DVec3> = (0..count).map(|d| lattice.direction(d)).collect();
    let places: HashMap<IVec3, u32> = (0..count).rev().map(|i| (place(directions[i as usize]), i)).collect();
    // For each operation and direction the one that it comes from; an operation that leaves the lattice is of no use.
    let from_where = |matrix: DMat3| -> Option<Vec<u32>> {
        let back = matrix.transpose();
        directions.iter().map(|d| places.get(&place(back * *d)).copied()).collect()
    };
    let operations: Vec<(f64, DMat3, Vec<u32>)> =
        symmetry.operations.iter().filter_map(|o| Some((o.deviation, o.matrix, from_where(o.matrix)?))).collect();
    let mut twins: Vec<Option<Twin>> = vec![None; lattice.sample_count() as usize];
    let limits: Vec<f64> = (0..lattice.sample_count()).into_par_iter().map(|s| allowed(distance(s), face_px)).collect();
    let round: Vec<Vec<u32>> = (0..lattice.shells)
        .map(|shell| {
            let of_shell = shell * count..(shell + 1) * count;
            let all = symmetry
                .sphere
                .is_some_and(|d| limits[of_shell.start as usize..of_shell.end as usize].iter().all(|l| d <= *l));
            // Spread over the shell, and off its symmetric places, which see the same texels.
            let step = (count / ROUND_SAMPLES).max(1) as usize;
            if all { of_shell.step_by(step).collect() } else { Vec::new() }
        })
        .collect();
    // The first of each shell and height along an axis.
    let mut of_height = HashMap::new();
    for sample in 0..lattice.sample_count() {
        let (shell, direction) = (sample / count, sample % count);
        let limit = limits[sample as usize];
        let fits = |deviation: &f64| *deviation <= limit;
        let here = directions[direction as usize];
        let by_operation = || {
            operations.iter().filter(|o| fits(&o.0)).find_map(|(deviation, turn, from)| {
                let other = from[direction as usize];
                let of = shell * count + other;
                let twin = Twin { of, turn: *turn, deviation: *deviation };
                (other < direction && twins[of as usize].is_none()).then_some(twin)
            })
        };
        let heights = [0, 1, 2].map(|k| (shell, k, (here[k] * 1e6).round() as i64));
        let by_axis = || {
            (0..3).find_map(|k| {
                let first: u32 = *of_height.get(&heights[k])?;
                let turn = about(k, directions[(first % count) as usize], here);
                // The first of a height may come from elsewhere itself.
                let before = twins[first as usize].unwrap_or(Twin::same(first));
                let deviation = symmetry.revolution[k]? + before.deviation;
                fits(&deviation).then_some(Twin { of: before.of, turn: turn * before.turn, deviation })
            })
        };
        if let Some(&of) = round[shell as usize].first() {
            // All of them come in by way of the mean: the turn is only told.
            let turn = DMat3::from_quat(DQuat::from_rotation_arc(directions[(of % count) as usize], here));
            let made = !round[shell as usize].contains(&sample);
            twins[sample as usize] = made.then_some(Twin { of, turn, deviation: symmetry.sphere.unwrap_or(0.0) });
            continue;
        }
        let first = shell * count + lattice.first_of(direction);
        if first < sample {
            twins[sample as usize] = Some(twins[first as usize].unwrap_or(Twin::same(first)));
            continue;
        }
        twins[sample as usize] = by_operation().or_else(by_axis);
        heights.into_iter().for_each(|height| _ = of_height.entry(height).or_insert(sample));
    }
    Plan { twins, round }
}

/// The turn about a coordinate axis that takes one direction to another of the same height.
fn about(axis: usize, from: DVec3, to: DVec3) -> DMat3 {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let angle = to[j].atan2(to[i]) - from[j].atan2(from[i]);
    DMat3::from_axis_angle(DVec3::AXES[axis], angle)
}

/// A direction's key: computed directions agree to rounding, and the odd offset keeps common ones off the edges of cells.
fn place(direction: DVec3) -> IVec3 {
    (direction * 1e6 + 0.37).floor().as_ivec3()
}

/// Turns coefficients of one channel: f'(w) = f(turn^-1 w), for mirrors too.
pub struct Turn {
    rotation: Rotation,
    mirrored: bool,
}

impl Turn {
    /// For an orthogonal matrix.
    pub fn new(bands: usize, matrix: DMat3) -> Self {
        // A mirror is a turn of the inversion w -> -w, under which odd bands change sign.
        let mirrored = matrix.determinant() < 0.0;
        let proper = if mirrored { -matrix } else { matrix };
        Turn { rotation: Rotation::new(bands, DQuat::from_mat3(&proper).normalize()), mirrored }
    }

    /// As [`Rotation::apply`].
    pub fn apply(&self, coefficients: &[f64], out: &mut [f64]) {
        self.rotation.apply(coefficients, out);
        if self.mirrored {
            for l in (1..self.rotation.bands()).step_by(2) {
                out[l * l..(l + 1) * (l + 1)].iter_mut().for_each(|c| *c = -*c);
            }
        }
    }
}

/// Makes the samples that were not captured, in place: `values` are floats of `channels` x `channel_stride(bands)` a sample.
pub fn spread(values: &mut [f32], plan: &Plan, lattice: &Lattice, bands: usize, channels: usize) {
    turn_all(values, &plan.twins, bands, channels);
    let stride = channel_stride(bands);
    let count = lattice.direction_count();
    for (shell, captured) in plan.round.iter().enumerate().filter(|(_, captured)| !captured.is_empty()) {
        for channel in 0..channels {
            let first = |sample: u32| sample as usize * channels * stride + channel * stride;
            // What is seen is symmetric about the direction to the eye: its part of a band is Y_lm(direction) times a number.
            let mut zonal = [0.0; MAX_BANDS];
            for &sample in captured {
                let mut basis = [0.0; MAX_COEFFICIENTS];
                evaluate(bands, lattice.direction(sample % count), &mut basis);
                for (l, z) in zonal.iter_mut().enumerate().take(bands) {
                    let band = l * l..(l + 1) * (l + 1);
                    let part: f64 = band.map(|k| basis[k] * f64::from(values[first(sample) + k])).sum();
                    *z += part * (4.0 * PI / (2 * l + 1) as f64).sqrt() / captured.len() as f64;
                }
            }
            for direction in 0..count {
                let made = lobe::zonal(bands, &zonal, lattice.direction(direction));
                let at = first(shell as u32 * count + direction);
                values[at..at + made.len()].iter_mut().zip(made).for_each(|(value, made)| *value = made as f32);
            }
        }
    }
}

/// Makes the samples that are turned from single ones, in place.
pub fn turn_all(values: &mut [f32], twins: &[Option<Twin>], bands: usize, channels: usize) {
    let stride = channel_stride(bands);
    let sample_floats = channels * stride;
    let coefficients = coefficient_count(bands);
    let made: Vec<Option<Vec<f32>>> = twins
        .par_iter()
        .map(|twin| {
            let twin = twin.as_ref()?;
            let turn = Turn::new(bands, twin.turn);
            let mut out = vec![0.0; sample_floats];
            let source = &values[twin.of as usize * sample_floats..][..sample_floats];
            for (from, to) in source.chunks_exact(stride).zip(out.chunks_exact_mut(stride)) {
                let (mut exact, mut turned) = ([0.0; MAX_COEFFICIENTS], [0.0; MAX_COEFFICIENTS]);
                exact.iter_mut().zip(&from[..coefficients]).for_each(|(e, f)| *e = f64::from(*f));
                turn.apply(&exact, &mut turned);
                to.iter_mut().zip(&turned[..coefficients]).for_each(|(t, e)| *t = *e as f32);
            }
            Some(out)
        })
        .collect();
    for (sample, made) in made.into_iter().enumerate().filter_map(|(sample, made)| Some((sample, made?))) {
        values[sample * sample_floats..][..sample_floats].copy_from_slice(&made);
    }
}

/// For every vertex of a mesh the one whose transfer it turns, or `None`; symmetries that are exact within what may be seen from
/// `distance` only.
pub fn plan_vertices(mesh: &Mesh, symmetry: &Symmetry, face_px: u32, distance: f64) -> Vec<Option<Twin>> {
    let mut twins: Vec<Option<Twin>> = vec![None; mesh.positions.len()];
    let points = Points::new(mesh, None);
    let limit = allowed(distance, face_px);
    let fits = symmetry.operations.par_iter().filter(|o| o.deviation <= limit);
    let maps: Vec<(&Operation, Vec<u32>)> =
        fits.filter_map(|o| Some((o, points.vertices(o.matrix.transpose(), mesh)?))).collect();
    for vertex in 0..twins.len() {
        // The maps lead back, from a vertex to the one that the symmetry carries there.
        twins[vertex] = maps.iter().find_map(|(operation, from)| {
            let twin = Twin { of: from[vertex], turn: operation.matrix, deviation: operation.deviation };
            ((twin.of as usize) < vertex && twins[twin.of as usize].is_none()).then_some(twin)
        });
    }
    twins
}
