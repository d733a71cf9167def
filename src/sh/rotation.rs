//! Rotation of SH expansions: block-diagonal, a (2l+1) x (2l+1) orthogonal matrix for each band.
//!
//! The block of a rotation Q is `R_ij = integral of Y_i(Q w) Y_j(w)`, a polynomial of degree 2l: the sum over an exact rule
//! gives it without angles, special cases or error beyond rounding.

use std::sync::OnceLock;

use glam::{DMat3, DQuat, DVec3};

use super::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, evaluate};
use super::program::{Program, Term, Value, elements};
use super::quadrature::{icosahedral_rule, sphere_rule};

/// Points of a rule with the basis there, multiplied by the weight: what no rotation changes.
struct WeightedBasis {
    points: Vec<(DVec3, [f64; MAX_COEFFICIENTS])>,
}

impl WeightedBasis {
    fn new(bands: usize) -> Self {
        let degree = 2 * (bands - 1);
        // Products within a band are even functions, so one point of an antipodal pair stands for both.
        let rule: Vec<(DVec3, f64)> = if degree <= 9 {
            icosahedral_rule().into_iter().step_by(2).map(|(point, weight)| (point, 2.0 * weight)).collect()
        } else {
            sphere_rule(degree)
        };
        let points = rule.into_iter().map(|(point, weight)| {
            let mut basis = [0.0; MAX_COEFFICIENTS];
            evaluate(bands, point, &mut basis);
            (point, basis.map(|y| weight * y))
        });
        Self { points: points.collect() }
    }

    fn get(bands: usize) -> &'static Self {
        static TABLES: [OnceLock<WeightedBasis>; MAX_BANDS + 1] = [const { OnceLock::new() }; MAX_BANDS + 1];
        assert!((1..=MAX_BANDS).contains(&bands), "bands must be 1 to {MAX_BANDS}, not {bands}");
        TABLES[bands].get_or_init(|| Self::new(bands))
    }
}

/// Matrix elements of a rotation of `bands` bands: 9 + 25 + ... ; 83 at 4 bands. The constant band needs none.
pub const fn block_count(bands: usize) -> usize {
    bands * (4 * bands * bands - 1) / 3 - 1
}

/// A rotation, ready to be applied to expansions.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotation {
    bands: usize,
    blocks: Vec<f64>,
}

impl Rotation {
    /// The rotation by `rotation`, a unit quaternion. `bands` is 1 to [`MAX_BANDS`]. Microseconds at 4 bands.
    pub fn new(bands: usize, rotation: DQuat) -> Self {
        let mut blocks = vec![0.0; block_count(bands)];
        let matrix = DMat3::from_quat(rotation);
        let mut turned = [0.0; MAX_COEFFICIENTS];
        for (point, weighted) in &WeightedBasis::get(bands).points {
            evaluate(bands, matrix * point, &mut turned);
            let mut rest = blocks.as_mut_slice();
            for l in 1..bands {
                let band = l * l..(l + 1) * (l + 1);
                let (block, after) = rest.split_at_mut((2 * l + 1) * (2 * l + 1));
                for (row, y) in block.chunks_exact_mut(2 * l + 1).zip(&turned[band.clone()]) {
                    for (element, weighted) in row.iter_mut().zip(&weighted[band.clone()]) {
                        *element += y * weighted;
                    }
                }
                rest = after;
            }
        }
        Self { bands, blocks }
    }

    /// Bands of the expansions that this turns.
    pub fn bands(&self) -> usize {
        self.bands
    }

    /// The row-major blocks of bands 1, 2, ... one after the other: [`block_count`] numbers.
    pub fn blocks(&self) -> &[f64] {
        &self.blocks
    }

    /// Writes the coefficients of the rotated function f'(w) = f(Q^-1 w): what f shows at w, f' shows at Q w.
    ///
    /// Slices must hold at least the bands' coefficients.
    pub fn apply(&self, coefficients: &[f64], out: &mut [f64]) {
        out[0] = coefficients[0];
        let mut rest = self.blocks.as_slice();
        for l in 1..self.bands {
            let (block, after) = rest.split_at((2 * l + 1) * (2 * l + 1));
            let band = l * l..(l + 1) * (l + 1);
            for (target, row) in out[band.clone()].iter_mut().zip(block.chunks_exact(2 * l + 1)) {
                *target = row.iter().zip(&coefficients[band.clone()]).map(|(r, c)| r * c).sum();
            }
            rest = after;
        }
    }
}

/// The rotation as a program: inputs are the coefficients, then the blocks.
pub fn rotate_program(bands: usize) -> Program {
    let count = coefficient_count(bands);
    let blocks = (0..block_count(bands)).map(|k| format!("SH_ROTATION({k})"));
    let mut program = Program::new(elements("c", count).into_iter().chain(blocks).collect());
    let mut element = count;
    for l in 1..bands {
        for row in l * l..(l + 1) * (l + 1) {
            let terms = (l * l..(l + 1) * (l + 1)).map(|column| {
                element += 1;
                Term::new(1.0, &[Value::Input(element - 1), Value::Input(column)])
            });
            let value = program.define(terms.collect());
            program.output(format!("c[{row}]"), value);
        }
    }
    program
}

/// GLSL 460 text of `void sh_rotate(inout float c[N], uint instance)`, N = bands^2.
///
/// The shader that includes it defines the macro `SH_ROTATION(k)`, element k of [`Rotation::blocks`]; the macro may name
/// the parameter `instance`. Each element is read once.
pub fn glsl_rotate(bands: usize) -> String {
    let count = coefficient_count(bands);
    format!("void sh_rotate(inout float c[{count}], uint instance) {{\n{}}}\n", rotate_program(bands).glsl_body())
}
