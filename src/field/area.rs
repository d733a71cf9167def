//! Projected area of an object by direction, as a polynomial. It is fitted to what stands for the object near by, so that
//! nothing changes where the area takes over: the outermost shell of its field, or of a light its outline.

use super::ShadowField;
use super::lattice::cap_height;
use crate::sh::basis::{MAX_COEFFICIENTS, Y00};
use crate::sh::quadrature::sphere_rule;
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

const TERMS: usize = 6;

/// Projected area as a share of the bounding sphere's, for a direction d to or from the object: a polynomial in the
/// squares of d's cosines with two of three axes. It is equal for opposite directions, as a projected area is, and
/// symmetric about the planes of the three axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Area {
    /// The first two axes, unit vectors in the object's frame.
    pub axes: [DVec3; 2],
    /// Factors of 1, u, v, u u, v v, u v.
    pub terms: [f64; TERMS],
}

impl Area {
    /// Fits the area to the outermost shell of an occlusion field.
    pub fn new(field: &ShadowField) -> Self {
        let outer = field.header.lattice.outer;
        Self::of(|direction| {
            let mut found = [0.0; MAX_COEFFICIENTS];
            field.lookup(outer * direction, 0, &mut found);
            found[0] / (Y00 * 2.0 * PI * cap_height(outer))
        })
    }

    /// Fits what an object fills of its bounding sphere's disc, seen from a unit direction of its frame.
    pub fn of(filled: impl Fn(DVec3) -> f64) -> Self {
        let sample = |(direction, weight)| (direction, weight, filled(direction));
        let samples: Vec<(DVec3, f64, f64)> = sphere_rule(12).into_iter().map(sample).collect();
        let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        let moment = samples.iter().fold(DMat3::ZERO, |sum, &(d, weight, area)| sum + outer(d) * (weight * area));
        let axes = principal_axes(moment);
        let mut area = Area { axes: [axes.x_axis, axes.y_axis], ..Area::default() };
        // Normal equations with the right side as a seventh column.
        let mut rows = [[0.0; TERMS + 1]; TERMS];
        for (d, weight, value) in samples {
            let basis = area.basis(d);
            for (row, b) in rows.iter_mut().zip(basis) {
                row[..TERMS].iter_mut().zip(basis).for_each(|(sum, c)| *sum += weight * b * c);
                row[TERMS] += weight * b * value;
            }
        }
        area.terms = solve(rows);
        area
    }

    /// The area for a direction (unit vector in the object's frame), as a share of the bounding sphere's.
    pub fn at(&self, direction: DVec3) -> f64 {
        let basis = self.basis(direction);
        self.terms.iter().zip(basis).map(|(term, b)| term * b).sum::<f64>().max(0.0)
    }

    fn basis(&self, direction: DVec3) -> [f64; TERMS] {
        let [u, v] = self.axes.map(|axis| axis.dot(direction).powi(2));
        [1.0, u, v, u * u, v * v, u * v]
    }
}

/// Eigenvectors of a symmetric matrix by Jacobi rotations. If eigenvalues are nearly equal, the frame's own axes are
/// kept, because meshes tend to be symmetric about them.
fn principal_axes(mut matrix: DMat3) -> DMat3 {
    let mut axes = DMat3::IDENTITY;
    let least = 1e-3 * (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z);
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = matrix.col(p)[q];
            if off.abs() <= least {
                continue;
            }
            let angle = 0.5 * (2.0 * off).atan2(matrix.col(p)[p] - matrix.col(q)[q]);
            let (sin, cos) = angle.sin_cos();
            let mut turn = DMat3::IDENTITY;
            (turn.col_mut(p)[p], turn.col_mut(p)[q]) = (cos, sin);
            (turn.col_mut(q)[p], turn.col_mut(q)[q]) = (-sin, cos);
            matrix = turn.transpose() * matrix * turn;
            axes *= turn;
        }
    }
    axes
}

/// Solves a positive definite system by Gaussian elimination.
fn solve(mut rows: [[f64; TERMS + 1]; TERMS]) -> [f64; TERMS] {
    for pivot in 0..TERMS {
        let scale = rows[pivot][pivot].recip();
        rows[pivot].iter_mut().for_each(|x| *x *= scale);
        let of = rows[pivot];
        for (_, row) in rows.iter_mut().enumerate().filter(|(other, _)| *other != pivot) {
            let factor = row[pivot];
            row.iter_mut().zip(of).for_each(|(x, p)| *x -= factor * p);
        }
    }
    rows.map(|row| row[TERMS])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// The area that is fitted to a shape, and how far it is off where it is fitted.
    fn fitted(of: impl Fn(DVec3) -> f64) -> (Area, f64) {
        let area = Area::of(&of);
        (area, sphere_rule(12).iter().map(|&(d, _)| (area.at(d) - of(d)).abs()).fold(0.0, f64::max))
    }

    /// Sphere, ellipsoid, plate, cube: as they are and turned.
    #[test]
    fn areas_of_plain_shapes() {
        let turn = DQuat::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 0.9);
        let cube = |d: DVec3| d.abs().element_sum() / 3_f64.sqrt();
        type Shape<'s> = (&'s str, &'s dyn Fn(DVec3) -> f64, f64);
        let shapes: [Shape<'_>; 5] = [
            ("sphere", &|_| 0.7, 1e-12),
            ("ellipsoid", &|d| (d * DVec3::new(1.0, 0.5, 0.7)).length(), 0.02),
            ("turned ellipsoid", &|d| ((turn * d) * DVec3::new(1.0, 0.5, 0.7)).length(), 0.02),
            ("turned plate", &|d| (turn * d).y.abs(), 0.12),
            ("cube", &|d| cube(d), 0.11),
        ];
        for (name, of, most) in shapes {
            let (area, deviation) = fitted(of);
            assert!(deviation <= most, "{name}: {deviation}");
            let d = DVec3::new(0.2, -0.7, 0.4).normalize();
            assert!((area.at(d) - of(d)).abs() <= 1.5 * most && area.at(d) == area.at(-d), "{name}");
        }
    }
}
