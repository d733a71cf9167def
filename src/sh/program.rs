//! Straight-line programs: one list of instructions, run in f64 by the tests and printed as GLSL for the shaders.
//!
//! All generators of these modules build a [`Program`]. Because the tests run the same list that the shaders' text is
//! printed from, only two short functions here have to agree.

use std::fmt::Write;

/// Operand of an instruction: an input of the program or a variable that an earlier instruction has set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Value {
    Input(usize),
    Variable(usize),
}

/// `coefficient * factors[0] * factors[1] ...`; without factors, a constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Computed in f64 and printed as the nearest f32.
    pub coefficient: f64,
    /// At most three in practice.
    pub factors: Vec<Value>,
}

impl Term {
    pub fn new(coefficient: f64, factors: &[Value]) -> Self {
        Self { coefficient, factors: factors.to_vec() }
    }
}

/// `variable = terms` or `variable += terms`.
#[derive(Clone, Debug)]
struct Instruction {
    target: usize,
    accumulate: bool,
    terms: Vec<Term>,
}

#[derive(Clone, Debug, Default)]
pub struct Program {
    input_texts: Vec<String>,
    variable_count: usize,
    instructions: Vec<Instruction>,
    outputs: Vec<(String, Value)>,
}

impl Program {
    /// A program that reads the given GLSL expressions, which may be repeated in the text and so should be cheap.
    pub fn new(input_texts: Vec<String>) -> Self {
        Self { input_texts, ..Self::default() }
    }

    /// Sets a new variable to a sum and returns it.
    pub fn define(&mut self, terms: Vec<Term>) -> Value {
        assert!(!terms.is_empty(), "a definition needs a term");
        self.instructions.push(Instruction { target: self.variable_count, accumulate: false, terms });
        self.variable_count += 1;
        Value::Variable(self.variable_count - 1)
    }

    /// Adds a sum to `variable`, or defines it when it is `None`.
    pub fn accumulate(&mut self, variable: &mut Option<Value>, terms: Vec<Term>) {
        match *variable {
            None => *variable = Some(self.define(terms)),
            Some(Value::Variable(target)) => self.instructions.push(Instruction { target, accumulate: true, terms }),
            Some(Value::Input(input)) => panic!("input {input} cannot be written"),
        }
    }

    /// Declares that the expression `text` receives `value` after the last instruction, so that it may alias an input.
    pub fn output(&mut self, text: String, value: Value) {
        self.outputs.push((text, value));
    }

    /// Runs the program in f64; `outputs` are in the order of their declaration.
    pub fn evaluate(&self, inputs: &[f64], outputs: &mut [f64]) {
        assert_eq!((inputs.len(), outputs.len()), (self.input_texts.len(), self.outputs.len()), "inputs, outputs");
        let mut variables = vec![f64::NAN; self.variable_count];
        let read = |variables: &[f64], value: Value| match value {
            Value::Input(i) => inputs[i],
            Value::Variable(i) => variables[i],
        };
        for Instruction { target, accumulate, terms } in &self.instructions {
            let mut sum = if *accumulate { variables[*target] } else { 0.0 };
            for term in terms {
                sum += term.factors.iter().fold(term.coefficient, |p, &f| p * read(&variables, f));
            }
            variables[*target] = sum;
        }
        for (output, (_, value)) in outputs.iter_mut().zip(&self.outputs) {
            *output = read(&variables, *value);
        }
    }

    /// The body of a GLSL function, one statement per line, indented by four spaces.
    pub fn glsl_body(&self) -> String {
        let mut text = String::new();
        let mut defined = vec![false; self.variable_count];
        for Instruction { target, accumulate, terms } in &self.instructions {
            let kind = if std::mem::replace(&mut defined[*target], true) { "" } else { "float " };
            // Print `v -= x` instead of `v += -x`.
            let subtract = *accumulate && terms.iter().all(|term| term.coefficient < 0.0);
            let assign = if subtract {
                "-="
            } else if *accumulate {
                "+="
            } else {
                "="
            };
            write!(text, "    {kind}v{target} {assign} ").expect("writing to a String cannot fail");
            for (position, term) in terms.iter().enumerate() {
                let negative = (term.coefficient < 0.0) != subtract;
                text.push_str(match (position, negative) {
                    (0, false) => "",
                    (0, true) => "-",
                    (_, false) => " + ",
                    (_, true) => " - ",
                });
                let mut factors: Vec<String> = term.factors.iter().map(|&factor| self.text(factor)).collect();
                if term.coefficient.abs() != 1.0 || factors.is_empty() {
                    factors.insert(0, literal(term.coefficient.abs()));
                }
                text.push_str(&factors.join(" * "));
            }
            text.push_str(";\n");
        }
        for (name, value) in &self.outputs {
            writeln!(text, "    {name} = {};", self.text(*value)).expect("writing to a String cannot fail");
        }
        text
    }

    fn text(&self, value: Value) -> String {
        match value {
            Value::Input(i) => self.input_texts[i].clone(),
            Value::Variable(i) => format!("v{i}"),
        }
    }
}

/// A GLSL literal that reads back as the f32 nearest to `value`: the shortest decimal that does.
fn literal(value: f64) -> String {
    format!("{:?}", value as f32)
}

/// `name[0]` to `name[count - 1]`.
pub fn elements(name: &str, count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{name}[{i}]")).collect()
}
