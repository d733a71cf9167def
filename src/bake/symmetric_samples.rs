//! Which samples of a field are captured, and which are made from those by a symmetry of the mesh. Making a sample means turning
//! its SH coefficients, which is exact.
//!
//! No symmetry of a mesh is perfect. The *deviation* of a symmetry is the distance by which it misses the surface (see
//! [`super::symmetry`]). A sample may use a symmetry if its deviation, seen from there, is at most [`TEXEL_SHARE`] of a texel.
//! Symmetries that are exact to rounding therefore serve every sample. The turns of a faceted body serve distant samples only.

use super::levels::TEXEL_SHARE;
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
use std::ops::Range;

/// A sample that is turned from a captured one.
#[derive(Clone, Copy, Debug)]
pub struct Turned {
    /// Index of the captured sample.
    pub of: u32,
    /// Orthogonal matrix: what the captured sample sees in direction w, this one sees in direction `turn` w.
    pub turn: DMat3,
    /// Deviation of the symmetry, in r.
    pub deviation: f64,
}

impl Turned {
    /// The captured sample `of` itself, under another index.
    pub fn same(of: u32) -> Self {
        Turned { of, turn: DMat3::IDENTITY, deviation: 0.0 }
    }
}

/// The plan without symmetries. Samples on the seam between two cells have several indices; the first of these is captured.
pub fn same(lattice: &Lattice) -> Vec<Option<Turned>> {
    let count = lattice.direction_count();
    let first = |sample: u32| sample / count * count + lattice.first_of(sample % count);
    (0..lattice.sample_count()).map(|s| (first(s) < s).then(|| Turned::same(first(s)))).collect()
}

/// The largest deviation, in r, that a sample may use. `distance` is that of the eye from the surface, in r, and a face has
/// `face_px` texels a side. A face of N texels spans two units of position over depth, and depth is at least distance / sqrt 3.
pub fn allowed(distance: f64, face_px: u32) -> f64 {
    TEXEL_SHARE * 2.0 / 3.0_f64.sqrt() * distance / f64::from(face_px)
}

/// Which samples are captured and which are turned.
pub struct SymmetricPlan {
    /// For every sample of the lattice the captured sample it is turned from, or `None` where it is captured itself.
    pub turned: Vec<Option<Turned>>,
    /// For every shell from which the object looks like a sphere, the captured samples. The mean of these gives one function of
    /// the direction, which serves all samples of the shell. The list is empty for other shells.
    pub round: Vec<Vec<u32>>,
}

/// Number of captured samples on a shell whose samples are all alike. One sample would carry the rounding of its silhouette to
/// texels into the whole shell; the mean of several reduces that error.
const ROUND_SAMPLES: u32 = 8;

/// An operation of the mesh's symmetry that maps the lattice's directions onto themselves.
struct LatticeOperation {
    deviation: f64,
    turn: DMat3,
    /// For every direction the one that the operation carries there.
    from: Vec<u32>,
}

/// What a plan is made from.
struct Planner<'p> {
    lattice: &'p Lattice,
    symmetry: &'p Symmetry,
    directions: Vec<DVec3>,
    operations: Vec<LatticeOperation>,
    /// Largest deviation that each sample may use, in r.
    limits: Vec<f64>,
}

/// The first sample at each height along an axis of a shell, by shell, axis and height in millionths of the unit vector.
type FirstOfHeight = HashMap<(u32, usize, i64), u32>;

impl Planner<'_> {
    fn samples_of(&self, shell: u32) -> Range<u32> {
        let count = self.directions.len() as u32;
        shell * count..(shell + 1) * count
    }

    /// The samples to capture on a shell from which the object looks like a sphere; none on other shells. They are spread over
    /// the shell and avoid its symmetric places, which see the same texels.
    fn round(&self, shell: u32) -> Vec<u32> {
        let samples = self.samples_of(shell);
        let limits = &self.limits[samples.start as usize..samples.end as usize];
        let looks_round = self.symmetry.sphere.is_some_and(|d| limits.iter().all(|limit| d <= *limit));
        let step = (self.directions.len() as u32 / ROUND_SAMPLES).max(1) as usize;
        if looks_round { samples.step_by(step).collect() } else { Vec::new() }
    }

    /// A sample of a round shell. It comes in by way of the mean, so the turn here is only for the record.
    fn on_round_shell(&self, captured: &[u32], sample: u32) -> Option<Turned> {
        let (of, count) = (captured[0], self.directions.len() as u32);
        let [from, to] = [of, sample].map(|s| self.directions[(s % count) as usize]);
        let turn = DMat3::from_quat(DQuat::from_rotation_arc(from, to));
        (!captured.contains(&sample)).then_some(Turned { of, turn, deviation: self.symmetry.sphere.unwrap_or(0.0) })
    }

    /// The captured sample that an operation of the symmetry carries to `sample`.
    fn by_operation(&self, turned: &[Option<Turned>], sample: u32) -> Option<Turned> {
        let count = self.directions.len() as u32;
        let (shell, direction) = (sample / count, sample % count);
        let mut usable = self.operations.iter().filter(|o| o.deviation <= self.limits[sample as usize]);
        usable.find_map(|LatticeOperation { deviation, turn, from }| {
            let other = from[direction as usize];
            let of = shell * count + other;
            let found = Turned { of, turn: *turn, deviation: *deviation };
            (other < direction && turned[of as usize].is_none()).then_some(found)
        })
    }

    /// The keys under which a sample may be the first of its height, one for each axis.
    fn heights(&self, sample: u32) -> [(u32, usize, i64); 3] {
        let count = self.directions.len() as u32;
        let here = self.directions[(sample % count) as usize];
        [0, 1, 2].map(|axis| (sample / count, axis, (here[axis] * 1e6).round() as i64))
    }

    /// The captured sample that a turn about a coordinate axis carries to `sample`, on a body of revolution.
    fn by_axis(&self, turned: &[Option<Turned>], firsts: &FirstOfHeight, sample: u32) -> Option<Turned> {
        let count = self.directions.len() as u32;
        let direction = |sample: u32| self.directions[(sample % count) as usize];
        self.heights(sample).into_iter().enumerate().find_map(|(axis, height)| {
            let first: u32 = *firsts.get(&height)?;
            let turn = about(axis, direction(first), direction(sample));
            // The first sample of a height may itself be turned from another.
            let before = turned[first as usize].unwrap_or(Turned::same(first));
            let deviation = self.symmetry.revolution[axis]? + before.deviation;
            let found = Turned { of: before.of, turn: turn * before.turn, deviation };
            (deviation <= self.limits[sample as usize]).then_some(found)
        })
    }

    fn plan(&self) -> SymmetricPlan {
        let count = self.directions.len() as u32;
        let round: Vec<Vec<u32>> = (0..self.lattice.shells).map(|shell| self.round(shell)).collect();
        let mut turned: Vec<Option<Turned>> = vec![None; self.limits.len()];
        let mut firsts = FirstOfHeight::new();
        for sample in 0..self.limits.len() as u32 {
            let (shell, direction) = (sample / count, sample % count);
            let captured = &round[shell as usize];
            if !captured.is_empty() {
                turned[sample as usize] = self.on_round_shell(captured, sample);
                continue;
            }
            let first = shell * count + self.lattice.first_of(direction);
            if first < sample {
                turned[sample as usize] = Some(turned[first as usize].unwrap_or(Turned::same(first)));
                continue;
            }
            turned[sample as usize] =
                self.by_operation(&turned, sample).or_else(|| self.by_axis(&turned, &firsts, sample));
            self.heights(sample).into_iter().for_each(|height| _ = firsts.entry(height).or_insert(sample));
        }
        SymmetricPlan { turned, round }
    }
}

/// Plans the samples of a lattice. `distance(sample)` is that of the surface from the sample's eye, in r.
pub fn plan(
    lattice: &Lattice,
    symmetry: &Symmetry,
    face_px: u32,
    distance: impl Fn(u32) -> f64 + Sync,
) -> SymmetricPlan {
    let count = lattice.direction_count();
    let directions: Vec<DVec3> = (0..count).map(|d| lattice.direction(d)).collect();
    let places: HashMap<IVec3, u32> = (0..count).rev().map(|i| (place(directions[i as usize]), i)).collect();
    // An operation that moves a direction off the lattice is of no use.
    let of_lattice = |operation: &Operation| {
        let back = operation.matrix.transpose();
        let from = directions.iter().map(|d| places.get(&place(back * *d)).copied()).collect::<Option<_>>()?;
        Some(LatticeOperation { deviation: operation.deviation, turn: operation.matrix, from })
    };
    let operations: Vec<LatticeOperation> = symmetry.operations.iter().filter_map(of_lattice).collect();
    let has_turns = symmetry.sphere.is_some() || symmetry.revolution.iter().any(Option::is_some);
    // Distances take longer to find than all else here.
    let limit = |s| if has_turns || !operations.is_empty() { allowed(distance(s), face_px) } else { 0.0 };
    let limits = (0..lattice.sample_count()).into_par_iter().map(limit).collect();
    Planner { lattice, symmetry, directions, operations, limits }.plan()
}

/// The turn about a coordinate axis that takes one direction to another of the same height.
fn about(axis: usize, from: DVec3, to: DVec3) -> DMat3 {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let angle = to[j].atan2(to[i]) - from[j].atan2(from[i]);
    DMat3::from_axis_angle(DVec3::AXES[axis], angle)
}

/// The key of a direction. Directions that agree to rounding share a cell of 1e-6. The odd offset keeps common directions off the
/// cells' edges.
fn place(direction: DVec3) -> IVec3 {
    (direction * 1e6 + 0.37).floor().as_ivec3()
}

/// Turns the coefficients of one channel: f'(w) = f(turn^-1 w). Mirrors count as turns.
pub struct CoefficientTurn {
    rotation: Rotation,
    mirrored: bool,
}

impl CoefficientTurn {
    /// The turn by an orthogonal matrix, which may be a mirror.
    pub fn new(bands: usize, matrix: DMat3) -> Self {
        // A mirror is a turn of the inversion w -> -w, and the inversion changes the sign of odd bands.
        let mirrored = matrix.determinant() < 0.0;
        let proper = if mirrored { -matrix } else { matrix };
        CoefficientTurn { rotation: Rotation::new(bands, DQuat::from_mat3(&proper).normalize()), mirrored }
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

/// Makes the samples that were not captured, in place. `values` holds `channels` x `channel_stride(bands)` floats a sample.
pub fn spread(values: &mut [f32], plan: &SymmetricPlan, lattice: &Lattice, bands: usize, channels: usize) {
    turn_all(values, &plan.turned, bands, channels);
    let stride = channel_stride(bands);
    let count = lattice.direction_count();
    for (shell, captured) in plan.round.iter().enumerate().filter(|(_, captured)| !captured.is_empty()) {
        for channel in 0..channels {
            let first = |sample: u32| sample as usize * channels * stride + channel * stride;
            // A sphere is symmetric about the direction to the eye, so each band is Y_lm(direction) times one number.
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

/// Makes the samples that are turned from one captured sample each, in place.
pub fn turn_all(values: &mut [f32], turned: &[Option<Turned>], bands: usize, channels: usize) {
    let stride = channel_stride(bands);
    let sample_floats = channels * stride;
    let coefficients = coefficient_count(bands);
    let made: Vec<Option<Vec<f32>>> = turned
        .par_iter()
        .map(|sample| {
            let Turned { of, turn, .. } = sample.as_ref()?;
            let turn = CoefficientTurn::new(bands, *turn);
            let mut out = vec![0.0; sample_floats];
            let source = &values[*of as usize * sample_floats..][..sample_floats];
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

/// For every vertex of a mesh the vertex whose transfer vector it turns, or `None` where its own is captured. Uses the symmetries
/// whose deviation may not be seen from `distance`, in r.
pub fn plan_vertices(mesh: &Mesh, symmetry: &Symmetry, face_px: u32, distance: f64) -> Vec<Option<Turned>> {
    let mut turned: Vec<Option<Turned>> = vec![None; mesh.positions.len()];
    let limit = allowed(distance, face_px);
    let fits: Vec<&Operation> = symmetry.operations.iter().filter(|o| o.deviation <= limit).collect();
    if fits.is_empty() {
        return turned;
    }
    let points = Points::new(mesh, None);
    let maps: Vec<(&Operation, Vec<u32>)> =
        fits.into_par_iter().filter_map(|o| Some((o, points.vertices(o.matrix.transpose(), mesh)?))).collect();
    for vertex in 0..turned.len() {
        // `from` leads back: from a vertex to the one that the symmetry carries there.
        turned[vertex] = maps.iter().find_map(|(operation, from)| {
            let of = from[vertex];
            let found = Turned { of, turn: operation.matrix, deviation: operation.deviation };
            ((of as usize) < vertex && turned[of as usize].is_none()).then_some(found)
        });
    }
    turned
}
