//! Products at points: an expansion of up to 4 bands is evaluated at the 32 points of the icosahedral rule, multiplied there, and
//! projected back, which is exact for one product (degree 9). A chain may also stay at the points and be projected once; the
//! rule is then no longer exact, but a factor costs one evaluation.
//!
//! The points come in sets that the reflections of the axes map to themselves: one set of eight, (1, 1, 1) and its mirror images,
//! and six sets of four in coordinate planes. Coefficients that are odd in the same axes have the same magnitude at all points of
//! a set: they are summed at the one point without negative coordinates, and sums and differences give the others.

use std::collections::BTreeMap;

use glam::DVec3;

use super::basis::{MAX_COEFFICIENTS, coefficient_count, evaluate};
use super::program::{Program, Term, Value, elements};
use super::quadrature::icosahedral_rule;

/// Largest number of bands of a factor whose products the rule projects exactly.
pub const BANDS: usize = 4;

/// Number of points of the rule.
pub const COUNT: usize = 32;

/// The unit directions of the rule with their weights (sum 4 pi), one set of mirror images after another.
pub fn points() -> Vec<(DVec3, f64)> {
    reflected_points().iter().flat_map(|set| (0..set.size()).map(|s| (set.point(s), set.weight))).collect()
}

/// A set of points that are reflections of one another in coordinate planes.
struct ReflectedPoints {
    /// The point without negative coordinates.
    corner: DVec3,
    /// Axes in which the point has a non-zero coordinate, and so a mirror image.
    axes: Vec<usize>,
    weight: f64,
}

impl ReflectedPoints {
    fn size(&self) -> usize {
        1 << self.axes.len()
    }

    /// The point whose coordinate along `axes[n]` is negative where bit n is set.
    fn point(&self, signs: usize) -> DVec3 {
        let mut point = self.corner;
        for (bit, &axis) in self.axes.iter().enumerate() {
            if signs >> bit & 1 == 1 {
                point[axis] = -point[axis];
            }
        }
        point
    }

    /// Coefficients with their values at the corner, grouped by the axes in which they are odd (as bits of this set's axes).
    /// Coefficients that vanish at all points of the set are left out.
    fn classes(&self, bands: usize) -> BTreeMap<usize, Vec<(usize, f64)>> {
        // At a direction in general position, the sign change under a reflection gives each coefficient's parity.
        let place = DVec3::new(0.36, 0.48, 0.8);
        let basis = |at: DVec3| {
            let mut y = [0.0; MAX_COEFFICIENTS];
            evaluate(bands, at, &mut y);
            y
        };
        let (here, corner) = (basis(place), basis(self.corner));
        let mirrored = [0, 1, 2].map(|axis| {
            let mut at = place;
            at[axis] = -at[axis];
            basis(at)
        });
        let mut classes: BTreeMap<usize, Vec<(usize, f64)>> = BTreeMap::new();
        for k in (0..coefficient_count(bands)).filter(|&k| corner[k].abs() > 1e-12) {
            let bits = self
                .axes
                .iter()
                .enumerate()
                .map(|(bit, &axis)| (usize::from(mirrored[axis][k] * here[k] < 0.0)) << bit);
            classes.entry(bits.sum()).or_default().push((k, corner[k]));
        }
        classes
    }
}

fn reflected_points() -> Vec<ReflectedPoints> {
    let mut reflected_points: Vec<ReflectedPoints> = Vec::new();
    for (point, weight) in icosahedral_rule() {
        let corner = point.abs();
        if reflected_points.iter().all(|set| set.corner.distance(corner) > 1e-9) {
            let axes = (0..3).filter(|&axis| corner[axis] > 1e-9).collect();
            reflected_points.push(ReflectedPoints { corner, axes, weight });
        }
    }
    reflected_points
}

/// Sums and differences along every axis (a Walsh-Hadamard transform): from parity classes to points, or back.
fn butterflies(program: &mut Program, values: &mut [Option<Value>]) {
    let size = values.len();
    let mut step = 1;
    while step < size {
        for low in (0..size).filter(|low| low & step == 0) {
            let (x, y) = (values[low], values[low | step]);
            let term = |sign: f64, v: Value| Term::new(sign, &[v]);
            (values[low], values[low | step]) = match (x, y) {
                (Some(x), Some(y)) => {
                    let sum = program.define(vec![term(1.0, x), term(1.0, y)]);
                    (Some(sum), Some(program.define(vec![term(1.0, x), term(-1.0, y)])))
                }
                (Some(x), None) => (Some(x), Some(x)),
                (None, Some(y)) => (Some(y), Some(program.define(vec![term(-1.0, y)]))),
                (None, None) => (None, None),
            };
        }
        step *= 2;
    }
}

/// Values at the points of one set.
fn at_points(program: &mut Program, set: &ReflectedPoints, bands: usize, input: impl Fn(usize) -> Value) -> Vec<Value> {
    let mut values = vec![None; set.size()];
    for (class, members) in set.classes(bands) {
        let terms = members.into_iter().map(|(k, y)| Term::new(y, &[input(k)])).collect();
        values[class] = Some(program.define(terms));
    }
    butterflies(program, &mut values);
    values.into_iter().map(|v| v.expect("coefficient 0 is even everywhere")).collect()
}

/// Adds the projection of values at a set's points to coefficients; `factor` multiplies the weight.
fn project(
    program: &mut Program,
    set: &ReflectedPoints,
    bands: usize,
    values: Vec<Value>,
    factor: f64,
    sums: &mut [Option<Value>],
) {
    let mut values: Vec<Option<Value>> = values.into_iter().map(Some).collect();
    butterflies(program, &mut values);
    for (class, members) in set.classes(bands) {
        let value = values[class].expect("every point has a value");
        for (k, y) in members {
            program.accumulate(&mut sums[k], vec![Term::new(factor * y, &[value])]);
        }
    }
}

/// The product program by evaluation at the points, multiplication and projection.
pub(super) fn product_program(bands: usize) -> Program {
    let count = coefficient_count(bands);
    let mut program = Program::new([elements("t", count), elements("b", count)].concat());
    let mut sums: Vec<Option<Value>> =
        (0..count).map(|k| Some(program.define(vec![Term::new(1.0, &[Value::Input(k)])]))).collect();
    for set in reflected_points() {
        let a = at_points(&mut program, &set, bands, Value::Input);
        let b = at_points(&mut program, &set, bands, |k| Value::Input(count + k));
        let products = a.into_iter().zip(b).map(|(a, b)| program.define(vec![Term::new(1.0, &[a, b])])).collect();
        project(&mut program, &set, bands, products, -set.weight, &mut sums);
    }
    for (text, sum) in elements("t", count).into_iter().zip(sums) {
        program.output(text, sum.expect("every coefficient has a term"));
    }
    program
}

/// Evaluation of an expansion at the points: inputs c, outputs v in the order of [`points`].
pub fn evaluate_program(bands: usize) -> Program {
    let mut program = Program::new(elements("c", coefficient_count(bands)));
    let mut values = Vec::new();
    for set in reflected_points() {
        values.extend(at_points(&mut program, &set, bands, Value::Input));
    }
    for (text, value) in elements("v", COUNT).into_iter().zip(values) {
        program.output(text, value);
    }
    program
}

/// Projection of values at the points, already multiplied by their weights: inputs v, outputs c.
pub fn project_program(bands: usize) -> Program {
    let count = coefficient_count(bands);
    let mut program = Program::new(elements("v", COUNT));
    let (mut sums, mut first) = (vec![None; count], 0);
    for set in reflected_points() {
        let values = (first..first + set.size()).map(Value::Input).collect();
        project(&mut program, &set, bands, values, 1.0, &mut sums);
        first += set.size();
    }
    for (text, sum) in elements("c", count).into_iter().zip(sums) {
        program.output(text, sum.expect("every coefficient has a term"));
    }
    program
}

/// GLSL 460 text of `POINT_WEIGHTS` and their reciprocals `POINT_INVERSES`, `void sh_points(float c[N], out float v[32])` and
/// `void sh_from_points(float v[32], out float c[N])`, the latter for values that are already multiplied by their weights.
pub fn glsl_points(bands: usize) -> String {
    let count = coefficient_count(bands);
    let list = |of: &dyn Fn(f64) -> f64| {
        points().iter().map(|(_, weight)| format!("{:?}", of(*weight) as f32)).collect::<Vec<_>>().join(", ")
    };
    let (weights, inverses) = (list(&|weight| weight), list(&|weight| 1.0 / weight));
    format!(
        "const float POINT_WEIGHTS[{COUNT}] = float[]({weights});\n\
         const float POINT_INVERSES[{COUNT}] = float[]({inverses});\n\
         void sh_points(float c[{count}], out float v[{COUNT}]) {{\n{}}}\n\
         void sh_from_points(float v[{COUNT}], out float c[{count}]) {{\n{}}}\n",
        evaluate_program(bands).glsl_body(),
        project_program(bands).glsl_body()
    )
}
