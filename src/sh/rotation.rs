//! Rotation of SH expansions: block-diagonal, a (2l+1) x (2l+1) orthogonal matrix for each band.
//!
//! The block of a rotation Q is `R_ij = integral of Y_i(Q w) Y_j(w)`, a polynomial of degree 2l: the sum over an exact
//! rule gives it without angles, special cases or error beyond rounding.

use std::sync::OnceLock;

use glam::{DMat3, DQuat, DVec3};

use super::basis::{MAX_BANDS, MAX_COEFFICIENTS, coefficient_count, evaluate, values};
use super::program::{Program, Term, Value, elements};
use super::quadrature::{icosahedral_rule, sphere_rule};

/// The basis at the points of a rule, multiplied by the weights. It is the same for all rotations.
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
        let points = rule.into_iter().map(|(point, weight)| (point, values(bands, point).map(|y| weight * y)));
        Self { points: points.collect() }
    }

    fn get(bands: usize) -> &'static Self {
        static TABLES: [OnceLock<WeightedBasis>; MAX_BANDS + 1] = [const { OnceLock::new() }; MAX_BANDS + 1];
        assert!((1..=MAX_BANDS).contains(&bands), "bands must be 1 to {MAX_BANDS}, not {bands}");
        TABLES[bands].get_or_init(|| Self::new(bands))
    }
}

/// Number of matrix elements of a rotation of `bands` bands: 9 + 25 + ..., 83 at 4 bands. The constant band needs none.
pub const fn block_count(bands: usize) -> usize {
    bands * (4 * bands * bands - 1) / 3 - 1
}

/// A rotation, ready to be applied to expansions.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotation {
    bands: usize,
    /// The row-major blocks of bands 1, 2, ... in this order: [`block_count`] numbers.
    blocks: Vec<f64>,
}

impl Rotation {
    /// The rotation by `rotation`, a unit quaternion. `bands` is 1 to [`MAX_BANDS`].
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

    /// Writes the coefficients of the rotated function f'(w) = f(Q^-1 w): what f shows at w, f' shows at Q w.
    ///
    /// The slices must hold at least bands^2 coefficients.
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

/// A rotation as turns about two axes, `Rz(alpha) Ry(beta) Rz(gamma)`: cosine and sine of alpha, beta and gamma. Any
/// unit quaternion has such angles; where beta is 0 or pi, alpha and gamma are one of many pairs.
pub fn turns(rotation: DQuat) -> [f64; 6] {
    let DQuat { x, y, z, w } = rotation;
    let half_sum = z.atan2(w);
    let half_difference = (-x).atan2(y);
    let alpha = half_sum + half_difference;
    let gamma = half_sum - half_difference;
    let cos_beta = (w * w + z * z) - (x * x + y * y);
    let sin_beta = 2.0 * x.hypot(y) * w.hypot(z);
    [alpha.cos(), alpha.sin(), cos_beta, sin_beta, gamma.cos(), gamma.sin()]
}

/// The rotation as a program: inputs are the coefficients, then [`turns`].
///
/// A turn about z mixes only the pair m, -m. A turn about y is a turn about z between two quarter turns about x, which
/// are constant and sparse. At 4 bands this takes 128 multiply-adds instead of the 83 of [`Rotation`]'s blocks, but a
/// shader reads 6 numbers per rotation instead of 83.
pub fn rotate_program(bands: usize) -> Program {
    let count = coefficient_count(bands);
    let angles = ["alpha_beta.x", "alpha_beta.y", "alpha_beta.z", "alpha_beta.w", "gamma.x", "gamma.y"];
    let mut program = Program::new(elements("c", count).into_iter().chain(angles.map(String::from)).collect());
    let mut values: Vec<Value> = (0..count).map(Value::Input).collect();
    let angle = |i: usize| [Value::Input(count + 2 * i), Value::Input(count + 2 * i + 1)];
    let quarter = |sign: f64| Rotation::new(bands, DQuat::from_rotation_x(sign * std::f64::consts::FRAC_PI_2));
    turn_about_z(&mut program, bands, angle(2), &mut values);
    turn_fixed(&mut program, &quarter(1.0), &mut values);
    turn_about_z(&mut program, bands, angle(1), &mut values);
    turn_fixed(&mut program, &quarter(-1.0), &mut values);
    turn_about_z(&mut program, bands, angle(0), &mut values);
    for (text, value) in elements("c", count).into_iter().zip(values).skip(1) {
        program.output(text, value);
    }
    program
}

/// Appends a turn about z by the angle of the given cosine and sine.
fn turn_about_z(program: &mut Program, bands: usize, [cosine, sine]: [Value; 2], values: &mut [Value]) {
    let mut c = cosine;
    let mut s = sine;
    for m in 1..bands {
        if m > 1 {
            let next = program.define(vec![Term::new(1.0, &[c, cosine]), Term::new(-1.0, &[s, sine])]);
            s = program.define(vec![Term::new(1.0, &[s, cosine]), Term::new(1.0, &[c, sine])]);
            c = next;
        }
        for l in m..bands {
            let plus = l * (l + 1) + m;
            let minus = l * (l + 1) - m;
            let a = values[plus];
            let b = values[minus];
            values[plus] = program.define(vec![Term::new(1.0, &[c, a]), Term::new(-1.0, &[s, b])]);
            values[minus] = program.define(vec![Term::new(1.0, &[s, a]), Term::new(1.0, &[c, b])]);
        }
    }
}

/// Appends a constant rotation; elements that are 0 in exact arithmetic are left out.
fn turn_fixed(program: &mut Program, rotation: &Rotation, values: &mut [Value]) {
    let mut rest = rotation.blocks.as_slice();
    for l in 1..rotation.bands {
        let (block, after) = rest.split_at((2 * l + 1) * (2 * l + 1));
        let band = l * l..(l + 1) * (l + 1);
        let before = values[band.clone()].to_vec();
        for (value, row) in values[band].iter_mut().zip(block.chunks_exact(2 * l + 1)) {
            let kept = row.iter().zip(&before).filter(|(element, _)| element.abs() > 1e-9);
            let exact = |element: f64| if (element.abs() - 1.0).abs() < 1e-9 { element.round() } else { element };
            let terms: Vec<Term> = kept.map(|(&element, &from)| Term::new(exact(element), &[from])).collect();
            // A row with a single element of 1 only moves a coefficient.
            *value = match &terms[..] {
                [Term { coefficient: 1.0, factors }] => factors[0],
                _ => program.define(terms),
            };
        }
        rest = after;
    }
}

/// GLSL 460 text of `void sh_rotate(inout float c[N], vec4 alpha_beta, vec2 gamma)`, N = bands^2: the rotation whose
/// [`turns`] are the parameters' components.
pub fn glsl_rotate(bands: usize) -> String {
    let count = coefficient_count(bands);
    let body = rotate_program(bands).glsl_body();
    format!("void sh_rotate(inout float c[{count}], vec4 alpha_beta, vec2 gamma) {{\n{body}}}\n")
}
