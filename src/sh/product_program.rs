//! The SH product as straight-line code.
//!
//! Form "pairs": `p_ij = a_i b_j + a_j b_i` once for every unordered pair, then `c_k += G_ijk p_ij`. Two savings on it:
//!
//! - products with coefficient 0 are a scaling by Y00, which is done once on `a_0` and `b_0`;
//! - where several `c_k` contain two pairs in the same proportion, `p + ratio q` is formed once (the linear half of the
//!   greedy factoring of reference 3 of [`crate::sh`]).
//!
//! At 4 bands that is 392 multiplications and 267 additions, 394 slots where multiply-adds fuse; plain pairs take 428 slots.

use std::collections::BTreeMap;

use super::basis::{Y00, coefficient_count};
use super::product::Tensor;
use super::program::{Cost, Program, Term, Value, elements};

/// A value that rows of the product are summed from.
#[derive(Clone, Copy, Debug)]
enum Column {
    /// `a_i b_j + a_j b_i`, or `a_i b_i`.
    Pair(usize, usize),
    /// `columns[first] + ratio * columns[second]`.
    Sum { first: usize, second: usize, ratio: f64 },
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
        let tensor = Tensor::new(bands, bands, bands);
        let kept: Vec<_> = tensor.entries().iter().filter(|entry| 0 < entry.i && entry.i <= entry.j).collect();
        for run in kept.chunk_by(|x, y| (x.i, x.j) == (y.i, y.j)) {
            for entry in run {
                rows[entry.k].insert(columns.len(), entry.value);
            }
            columns.push(Column::Pair(run[0].i, run[0].j));
        }
        Self { columns, rows }
    }

    /// Introduces the sum that the most rows share, until none is shared by two: each saves one operation a further row.
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

    /// (first, second, ratio, rows): ties go to the smallest columns, so that the text is the same in every run.
    fn most_shared(&self) -> Option<(usize, usize, f64, Vec<usize>)> {
        let mut shared: BTreeMap<(usize, usize, i64), (f64, Vec<usize>)> = BTreeMap::new();
        for (k, row) in self.rows.iter().enumerate() {
            for (&first, x) in row {
                for (&second, y) in row.range(first + 1..) {
                    // Ratios that are equal in exact arithmetic differ by rounding only, far under this step.
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

/// Emits columns as soon as they can be formed, each followed by the rows that it goes to.
struct Emitter<'a> {
    program: &'a mut Program,
    linear: &'a Linear,
    values: Vec<Option<Value>>,
    sums: Vec<Option<Value>>,
    /// 1 or -1: what the tensor's part is multiplied by.
    sign: f64,
}

impl Emitter<'_> {
    fn emit(&mut self, column: usize, terms: Vec<Term>) {
        let value = self.program.define(terms);
        self.values[column] = Some(value);
        for (row, sum) in self.linear.rows.iter().zip(&mut self.sums) {
            if let Some(coefficient) = row.get(&column) {
                self.program.accumulate(sum, vec![Term::new(self.sign * coefficient, &[value])]);
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

/// What a product program computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `c = product(a, b)`: inputs a then b, outputs c.
    Product,
    /// `t -= product(t, b)`, multiplication by 1 - b: inputs t then b, outputs t.
    Subtract,
}

/// The product of two expansions of `bands` bands as a program.
pub fn product_program(bands: usize, form: Form) -> Program {
    let count = coefficient_count(bands);
    let left = if form == Form::Product { "a" } else { "t" };
    let mut program = Program::new([elements(left, count), elements("b", count)].concat());
    let (a, b) = (Value::Input, |j: usize| Value::Input(count + j));
    let mut linear = Linear::new(bands);
    linear.factor();

    // The terms of coefficient 0: c_0 = Y00 a_0 b_0, c_k = Y00 (a_0 b_k + a_k b_0).
    let sign = if form == Form::Product { 1.0 } else { -1.0 };
    let a_0 = program.define(vec![Term::new(Y00, &[a(0)])]);
    let b_0 = match form {
        Form::Product => program.define(vec![Term::new(Y00, &[b(0)])]),
        Form::Subtract => program.define(vec![Term::new(1.0, &[]), Term::new(-Y00, &[b(0)])]),
    };
    let mut sums = vec![None; count];
    let first = match form {
        Form::Product => Term::new(1.0, &[a_0, b(0)]),
        Form::Subtract => Term::new(1.0, &[a(0), b_0]),
    };
    program.accumulate(&mut sums[0], vec![first]);
    for (k, sum) in sums.iter_mut().enumerate().skip(1) {
        program.accumulate(sum, vec![Term::new(1.0, &[a(k), b_0]), Term::new(sign, &[a_0, b(k)])]);
    }

    let values = vec![None; linear.columns.len()];
    let mut emitter = Emitter { program: &mut program, linear: &linear, values, sums, sign };
    for (column, definition) in linear.columns.iter().enumerate() {
        if let &Column::Pair(i, j) = definition {
            let mut terms = vec![Term::new(1.0, &[a(i), b(j)])];
            if i != j {
                terms.push(Term::new(1.0, &[a(j), b(i)]));
            }
            emitter.emit(column, terms);
        }
    }
    let sums = emitter.sums;
    let target = if form == Form::Product { "c" } else { "t" };
    for (text, sum) in elements(target, count).into_iter().zip(sums) {
        program.output(text, sum.expect("every coefficient has a term"));
    }
    program
}

/// Arithmetic of one product.
pub fn product_cost(bands: usize, form: Form) -> Cost {
    product_program(bands, form).cost()
}

/// GLSL 460 text of two functions, N = bands^2:
///
/// - `void sh_product(float a[N], float b[N], out float c[N])`: c = product(a, b);
/// - `void sh_subtract_product(inout float t[N], float b[N])`: t -= product(t, b), multiplication by the visibility 1 - b
///   of a factor that is stored as its blocked part b.
pub fn glsl_product(bands: usize) -> String {
    let count = coefficient_count(bands);
    let (product, subtract) = (product_program(bands, Form::Product), product_program(bands, Form::Subtract));
    format!(
        "void sh_product(float a[{count}], float b[{count}], out float c[{count}]) {{\n{}}}\n\
         void sh_subtract_product(inout float t[{count}], float b[{count}]) {{\n{}}}\n",
        product.glsl_body(),
        subtract.glsl_body()
    )
}
