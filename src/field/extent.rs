//! The directions around its object in which a field is not zero.

use super::{ShadowField, quantity::FieldKind};
use crate::sh::basis::coefficient_count;
use glam::DVec3;
use std::f64::consts::PI;

/// Where a field is not zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// The field is zero in all directions: its object blocks or emits nothing.
    Nothing,
    /// The field is zero outside a cone of directions from the centre, object's frame.
    Cone {
        axis: DVec3,
        /// Less than pi.
        half_angle_rad: f64,
    },
    /// The field may differ from zero in all directions.
    All,
}

/// The extent of a field, computed from its stored numbers; a lookup outside it returns exactly zero.
pub fn extent(field: &ShadowField) -> Extent {
    let header = &field.header;
    let lattice = header.lattice;
    let count = coefficient_count(header.bands);
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
        // Means are of cells that are tested themselves.
        .filter(|(_, cells)| cells.len() == 1)
        .filter(|(at, _)| (0..lattice.shells).any(|shell| holds(shell * stored + *at as u32)))
        .map(|(_, cells)| cells[0])
        .collect();
    if lit.is_empty() {
        return Extent::Nothing;
    }
    let axis = lit.iter().map(|&d| at(d)).sum::<DVec3>().normalize_or_zero();
    // A cone of directions from a shifted centre is no cone from the sphere's centre.
    if axis == DVec3::ZERO || fit.centre != [0.0; 3] {
        return Extent::All;
    }
    // A sample affects lookups within one step along either axis; twice the longer step exceeds the diagonal.
    let reach_rad = |direction: u32| {
        let steps = lattice.cell_neighbours(direction).into_iter().map(|n| at(n).angle_between(at(direction)));
        2.0 * steps.fold(0.0, f64::max)
    };
    let half_angle_rad = lit.iter().map(|&d| at(d).angle_between(axis) + reach_rad(d)).fold(0.0, f64::max);
    if half_angle_rad < PI { Extent::Cone { axis, half_angle_rad } } else { Extent::All }
}
