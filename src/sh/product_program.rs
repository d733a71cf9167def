//! Multiplication by 1 - b as straight-line code, `t -= product(t, b)`. A program has the inputs t, here called a, and
//! b, and the outputs t.
//!
//! `p_ij = a_i b_j + a_j b_i` is formed once for every unordered pair, then `c_k += G_ijk p_ij`; products with
//! coefficient 0 scale by Y00, which is applied once to `a_0` and `b_0`. Where several `c_k` contain two pairs in the
//! same proportion, `p + ratio q` is formed once (the linear half of the greedy factoring of reference 3 of
//! [`crate::sh`]). At 4 bands that takes 394 multiply-adds.

use std::collections::BTreeMap;

use super::basis::{Y00, coefficient_count};
use super::product::Tensor;
use super::program::{Program, Term, Value, elements};

/// A value that rows of the product are summed from.
#[derive(Clone, Copy, Debug)]
enum Column {
    /// `a_i b_j + a_j b_i`, or `a_i b_i`.
    Pair(usize, usize),
    Sum {
        first: usize,
        second: usize,
        ratio: f64,
    },
}

/// `c_k = sum over columns of rows[k][column] * column`, without the terms of coefficient 0 of either factor.
struct Linear {
    columns: Vec<Column>,
    rows: Vec<BTreeMap<usize, f64>>,
}

impl Linear {
    fn new(bands: usize) -> Self {
        let mut columns = Vec::new();
        let mut rows = vec![BTreeMap::new(); coefficient_count(bands)];
        let tensor = Tensor::new(bands);
        let kept: Vec<_> = tensor.entries.iter().filter(|entry| 0 < entry.i && entry.i <= entry.j).collect();
        for run in kept.chunk_by(|x, y| (x.i, x.j) == (y.i, y.j)) {
            for entry in run {
                rows[entry.k].insert(columns.len(), entry.value);
            }
            columns.push(Column::Pair(run[0].i, run[0].j));
        }
        Self { columns, rows }
    }

    /// Introduces the sum that the most rows share, until no sum is shared by two rows. Each saves one operation per
    /// further row.
    fn factor(&mut self) {
        while let Some((first, second, ratio, users)) = self.most_shared() {
            let sum = self.columns.len();
            self.columns.push(Column::Sum { first, second, ratio });
            for k in users {
                let coefficient = self.rows[k].remove(&first).expect("a user has both columns");
                self.rows[k].remove(&second);
                self.rows[k].insert(sum, coefficient);
            }
        }
    }

    /// Returns (first, second, ratio, rows). Ties go to the smallest columns, so that every run generates the same
    /// text.
    fn most_shared(&self) -> Option<(usize, usize, f64, Vec<usize>)> {
        let mut shared: BTreeMap<(usize, usize, i64), (f64, Vec<usize>)> = BTreeMap::new();
        for (k, row) in self.rows.iter().enumerate() {
            for (&first, x) in row {
                for (&second, y) in row.range(first + 1..) {
                    // Ratios that are equal in exact arithmetic differ by rounding only, which is far below this step
                    // of 1e-9.
                    let key = (first, second, (y / x * 1e9).round() as i64);
                    shared.entry(key).or_insert_with(|| (y / x, Vec::new())).1.push(k);
                }
            }
        }
        let most = shared.into_iter().rev().max_by_key(|(_, (_, users))| users.len())?;
        let ((first, second, _), (ratio, users)) = most;
        (users.len() > 1).then_some((first, second, ratio, users))
    }
}

/// Emits each column as soon as it can be computed, followed by the additions to its rows.
struct Emitter<'a> {
    program: &'a mut Program,
    linear: &'a Linear,
    values: Vec<Option<Value>>,
    sums: &'a mut [Option<Value>],
}

impl Emitter<'_> {
    fn emit(&mut self, column: usize, terms: Vec<Term>) {
        let value = self.program.define(terms);
        self.values[column] = Some(value);
        for (row, sum) in self.linear.rows.iter().zip(self.sums.iter_mut()) {
            if let Some(coefficient) = row.get(&column) {
                self.program.accumulate(sum, vec![Term::new(-coefficient, &[value])]);
            }
        }
        for (next, definition) in self.linear.columns.iter().enumerate().skip(column + 1) {
            if let (None, &Column::Sum { first, second, ratio }) = (self.values[next], definition)
                && let (Some(x), Some(y)) = (self.values[first], self.values[second])
            {
                self.emit(next, vec![Term::new(1.0, &[x]), Term::new(ratio, &[y])]);
            }
        }
    }
}

/// The multiplication of two expansions, cut to as many bands.
pub fn product_program(bands: usize) -> Program {
    let count = coefficient_count(bands);
    let mut program = Program::new([elements("t", count), elements("b", count)].concat());
    let a = Value::Input;
    let b = |j: usize| Value::Input(count + j);
    let mut linear = Linear::new(bands);
    linear.factor();
    // The terms of coefficient 0: c_0 = Y00 a_0 b_0, c_k = Y00 (a_0 b_k + a_k b_0).
    let a_0 = program.define(vec![Term::new(Y00, &[a(0)])]);
    let b_0 = program.define(vec![Term::new(1.0, &[]), Term::new(-Y00, &[b(0)])]);
    let mut sums = vec![None; count];
    program.accumulate(&mut sums[0], vec![Term::new(1.0, &[a(0), b_0])]);
    for (k, sum) in sums.iter_mut().enumerate().skip(1) {
        program.accumulate(sum, vec![Term::new(1.0, &[a(k), b_0]), Term::new(-1.0, &[a_0, b(k)])]);
    }
    let values = vec![None; linear.columns.len()];
    let mut emitter = Emitter { program: &mut program, linear: &linear, values, sums: &mut sums };
    for (column, definition) in linear.columns.iter().enumerate() {
        if let &Column::Pair(i, j) = definition {
            let mut terms = vec![Term::new(1.0, &[a(i), b(j)])];
            if i != j {
                terms.push(Term::new(1.0, &[a(j), b(i)]));
            }
            emitter.emit(column, terms);
        }
    }
    for (text, sum) in elements("t", count).into_iter().zip(sums) {
        program.output(text, sum.expect("every coefficient has a term"));
    }
    program
}

/// GLSL 460 text of `void sh_subtract_product(inout float t[N], float b[N])`, N = bands^2: t -= product(t, b),
/// multiplication by the visibility 1 - b of a factor that is stored as its blocked part b.
pub fn glsl_subtract(bands: usize) -> String {
    let count = coefficient_count(bands);
    let body = product_program(bands).glsl_body();
    format!("void sh_subtract_product(inout float t[{count}], float b[{count}]) {{\n{body}}}\n")
}
