//! Real orthonormal SH as polynomials of a unit vector.
//!
//! For m >= 0, with (x + i y)^m = C_m + i S_m and a polynomial Q_lm of degree l - m in z,
//!
//! ```text
//! Y_l,m = Q_lm(z) C_m(x, y)        Y_l,-m = Q_lm(z) S_m(x, y)
//! Q_mm  = (-1)^m sqrt(2 - [m = 0]) sqrt((2m+1)!! / (2m)!! / (4 pi))
//! Q_lm  = rise_lm z Q_l-1,m - fall_lm Q_l-2,m
//! rise  = sqrt((4 l^2 - 1) / (l^2 - m^2))
//! fall  = sqrt((2l + 1) ((l-1)^2 - m^2) / ((2l - 3) (l^2 - m^2)))
//! ```
//!
//! which is the normalised Legendre recurrence with the factor sin^m moved into C and S (references 1 and 2 of
//! [`crate::sh`]). The factor (-1)^m is the Condon-Shortley phase.

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::DVec3;

use super::program::{Program, Term, Value, elements};

/// The largest number of bands that these modules support and their tests cover.
pub const MAX_BANDS: usize = 8;

pub const MAX_COEFFICIENTS: usize = coefficient_count(MAX_BANDS);

/// The value of Y00, the constant function: 1 / sqrt(4 pi).
pub const Y00: f64 = 0.282_094_791_773_878_14;

pub const fn coefficient_count(bands: usize) -> usize {
    bands * bands
}

struct Recurrence {
    start: [f64; MAX_BANDS],
    rise: [[f64; MAX_BANDS]; MAX_BANDS],
    fall: [[f64; MAX_BANDS]; MAX_BANDS],
}

/// Indexed by `[m]` and `[m][l]`, which is the order in which evaluation reads them.
static RECURRENCE: LazyLock<Recurrence> = LazyLock::new(|| {
    let mut table =
        Recurrence { start: [0.0; 8], rise: [[0.0; MAX_BANDS]; MAX_BANDS], fall: [[0.0; MAX_BANDS]; MAX_BANDS] };
    let mut start = 0.5 / PI.sqrt();
    for m in 0..MAX_BANDS {
        if m > 0 {
            let doubled = if m == 1 { 2.0 } else { 1.0 };
            start *= -(doubled * (2 * m + 1) as f64 / (2 * m) as f64).sqrt();
        }
        table.start[m] = start;
        for l in m + 1..MAX_BANDS {
            let lf = l as f64;
            let span = (l * l - m * m) as f64;
            table.rise[m][l] = ((4.0 * lf * lf - 1.0) / span).sqrt();
            if l > m + 1 {
                let numerator = (2 * l + 1) * ((l - 1) * (l - 1) - m * m);
                table.fall[m][l] = (numerator as f64 / ((2.0 * lf - 3.0) * span)).sqrt();
            }
        }
    }
    table
});

/// Writes Y_lm(`direction`) to `out[l (l + 1) + m]` for every l < `bands`.
///
/// `direction` is a unit vector (the polynomials are not homogeneous, so another length gives no SH); `bands` is 1 to
/// [`MAX_BANDS`]; entries of `out` past the last coefficient are left alone.
pub fn evaluate(bands: usize, direction: DVec3, out: &mut [f64]) {
    match bands {
        1 => evaluate_bands::<1>(direction, out),
        2 => evaluate_bands::<2>(direction, out),
        3 => evaluate_bands::<3>(direction, out),
        4 => evaluate_bands::<4>(direction, out),
        5 => evaluate_bands::<5>(direction, out),
        6 => evaluate_bands::<6>(direction, out),
        7 => evaluate_bands::<7>(direction, out),
        8 => evaluate_bands::<8>(direction, out),
        _ => panic!("bands must be 1 to {MAX_BANDS}, not {bands}"),
    }
}

/// Y_lm(`direction`) as [`evaluate`] writes them, and zeros past the last.
pub fn values(bands: usize, direction: DVec3) -> [f64; MAX_COEFFICIENTS] {
    let mut out = [0.0; MAX_COEFFICIENTS];
    evaluate(bands, direction, &mut out);
    out
}

/// [`evaluate`] for a number of bands that the compiler knows, so that it unrolls the loops.
fn evaluate_bands<const BANDS: usize>(direction: DVec3, out: &mut [f64]) {
    let out = &mut out[..coefficient_count(BANDS)];
    let table = &*RECURRENCE;
    let DVec3 { x, y, z } = direction;
    let mut cos = 1.0;
    let mut sin = 0.0;
    for m in 0..BANDS {
        let mut below = 0.0;
        let mut q = table.start[m];
        for l in m..BANDS {
            if l > m {
                (below, q) = (q, table.rise[m][l] * z * q - table.fall[m][l] * below);
            }
            out[l * (l + 1) - m] = q * sin;
            out[l * (l + 1) + m] = q * cos;
        }
        (cos, sin) = (x * cos - y * sin, x * sin + y * cos);
    }
}

/// Coefficients of Q_lm by power of z.
fn polynomial(l: usize, m: usize) -> Vec<f64> {
    let table = &*RECURRENCE;
    let mut below = vec![0.0; l - m + 1];
    let mut q = vec![0.0; l - m + 1];
    q[0] = table.start[m];
    for i in m + 1..=l {
        let next = (0..q.len())
            .map(|power| {
                let raised = if power > 0 { q[power - 1] } else { 0.0 };
                table.rise[m][i] * raised - table.fall[m][i] * below[power]
            })
            .collect();
        (below, q) = (q, next);
    }
    q
}

/// The basis as a program of the inputs x, y, z: Q_lm by Horner's rule in z^2, shared between the two signs of m.
pub fn basis_program(bands: usize) -> Program {
    assert!((1..=MAX_BANDS).contains(&bands), "bands must be 1 to {MAX_BANDS}, not {bands}");
    let mut program = Program::new(["d.x", "d.y", "d.z"].map(String::from).to_vec());
    let [x, y, z] = [0, 1, 2].map(Value::Input);
    let mut values = vec![None; coefficient_count(bands)];
    let z_squared = (bands > 2).then(|| program.define(vec![Term::new(1.0, &[z, z])]));
    let mut cos = x;
    let mut sin = y;
    for m in 0..bands {
        if m > 1 {
            let next_cos = program.define(vec![Term::new(1.0, &[x, cos]), Term::new(-1.0, &[y, sin])]);
            let next_sin = program.define(vec![Term::new(1.0, &[x, sin]), Term::new(1.0, &[y, cos])]);
            (cos, sin) = (next_cos, next_sin);
        }
        for l in m..bands {
            let q = horner(&mut program, &polynomial(l, m), z, z_squared);
            let centre = l * (l + 1);
            for (index, factor) in [(centre - m, sin), (centre + m, cos)] {
                let mut term = q.clone();
                if m > 0 {
                    term.factors.push(factor);
                }
                values[index] = Some(program.define(vec![term]));
                if m == 0 {
                    break;
                }
            }
        }
    }
    for (text, value) in elements("y", values.len()).into_iter().zip(values) {
        program.output(text, value.expect("every l and m was visited"));
    }
    program
}

/// An even or odd polynomial as one term: a literal, or a variable that the instructions before it set.
fn horner(program: &mut Program, coefficients: &[f64], z: Value, z_squared: Option<Value>) -> Term {
    let odd = (coefficients.len() - 1) % 2;
    let mut powers = coefficients.iter().skip(odd).step_by(2).rev();
    let mut sum = Term::new(*powers.next().expect("a polynomial has a coefficient"), &[]);
    for &coefficient in powers {
        sum.factors.push(z_squared.expect("z^2 exists from three bands on"));
        let value = program.define(vec![sum, Term::new(coefficient, &[])]);
        sum = Term::new(1.0, &[value]);
    }
    if odd == 1 {
        sum.factors.push(z);
        sum = Term::new(1.0, &[program.define(vec![sum])]);
    }
    sum
}

/// GLSL 460 text of `void sh_basis(vec3 d, out float y[N])`, N = bands^2: [`evaluate`] as straight-line f32 code.
pub fn glsl_basis(bands: usize) -> String {
    let count = coefficient_count(bands);
    let body = basis_program(bands).glsl_body();
    format!("void sh_basis(vec3 d, out float y[{count}]) {{\n{body}}}\n")
}
