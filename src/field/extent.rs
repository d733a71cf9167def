//! In which directions around its object a field holds anything at all.

use super::lattice::Directions;
use super::{ShadowField, quantity::FieldKind};
use crate::sh::basis::coefficient_count;
use glam::DVec3;
use std::f64::consts::PI;

/// Where a field is not zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// Nowhere: its object blocks or sends nothing.
    Nothing,
    /// At most within a cone of directions from the centre, object's frame.
    Cone {
        /// Unit.
        axis: DVec3,
        /// Less than pi.
        half_angle_rad: f64,
    },
    /// Perhaps everywhere.
    All,
}

/// The extent of a field, from its stored numbers; a lookup outside it gives exactly zero.
pub fn extent(field: &ShadowField) -> Extent {
    let header = &field.header;
    let (lattice, count) = (header.lattice, coefficient_count(header.bands));
    let fit = lattice.fit();
    let channels = if header.kind == FieldKind::Radiance { 3 } else { 1 };
    let stored = lattice.stored_direction_count();
    let holds = |sample: u32| (0..channels).any(|c| (0..count).any(|k| field.stored(sample, c, k) != 0.0));
    // Directions in the object's frame.
    let at = |direction: u32| (lattice.direction(direction) / DVec3::from(fit.stretch)).normalize();
    let lit: Vec<u32> = lattice
        .sources()
        .iter()
        .enumerate()
        // The corner of a border is the mean of three cells that are looked at by themselves.
        .filter(|(_, cells)| cells.len() == 1)
        .filter(|(at, _)| (0..lattice.shells).any(|shell| holds(shell * stored + *at as u32)))
        .map(|(_, cells)| cells[0])
        .collect();
    if lit.is_empty() {
        return Extent::Nothing;
    }
    let axis = lit.iter().map(|&d| at(d)).sum::<DVec3>().normalize_or_zero();
    // Directions from a centre elsewhere make no cone from the sphere's.
    if axis == DVec3::ZERO || fit.centre != [0.0; 3] {
        return Extent::All;
    }
    // A sample reaches one step along either axis of its plane; twice the longer one is more than the diagonal.
    let reach_rad = |direction: u32| match lattice.directions {
        Directions::Cube { .. } => {
            let steps = lattice.cell_neighbours(direction).into_iter().map(|n| at(n).angle_between(at(direction)));
            2.0 * steps.fold(0.0, f64::max)
        }
        // No angle grows by more than the largest factor on its way to the object's frame.
        Directions::LatLon { latitudes, longitudes } => {
            2.0 * fit.largest() * (PI / f64::from(latitudes)).max(2.0 * PI / f64::from(longitudes))
        }
    };
    let half_angle_rad = lit.iter().map(|&d| at(d).angle_between(axis) + reach_rad(d)).fold(0.0, f64::max);
    if half_angle_rad < PI { Extent::Cone { axis, half_angle_rad } } else { Extent::All }
}
