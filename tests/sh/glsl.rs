//! The generated GLSL compiles, and its text, read back by a small interpreter, computes what Rust computes.

use std::collections::HashMap;

use fastrand::Rng;
use glam::{DQuat, DVec3};
use shadow_fields::sh::basis::{evaluate, glsl_basis};
use shadow_fields::sh::product::Tensor;
use shadow_fields::sh::product_program::glsl_subtract;
use shadow_fields::sh::rotation::{Rotation, glsl_rotate, turns};

/// Compiles `functions` in a compute shader with `main` as its body.
fn compile(name: &str, functions: &str, main: &str) {
    let source = format!(
        "#version 460\nlayout(local_size_x = 64) in;\n\
         layout(std430, binding = 0) buffer Data {{ float data[]; }};\n\
         {functions}\nvoid main() {{\n{main}\n}}\n"
    );
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    let result = compiler.compile_into_spirv(&source, shaderc::ShaderKind::Compute, name, "main", None);
    let artifact = result.unwrap_or_else(|error| panic!("{name}: {error}\n{source}"));
    assert_eq!(artifact.get_num_warnings(), 0, "{name}: {}", artifact.get_warning_messages());
    assert!(artifact.as_binary().len() > 100, "{name} has code");
}

/// GLSL that loads `count` floats into a new array.
fn load(array: &str, count: usize) -> String {
    format!("float {array}[{count}]; for (int i = 0; i < {count}; ++i) {array}[i] = data[i];")
}

fn store(array: &str, count: usize) -> String {
    format!("for (int i = 0; i < {count}; ++i) data[i] = {array}[i];")
}

#[test]
fn basis_compiles() {
    for bands in 1..=8 {
        let count = bands * bands;
        let main = format!("float y[{count}]; sh_basis(vec3(data[0], data[1], data[2]), y); {}", store("y", count));
        compile(&format!("basis {bands}"), &glsl_basis(bands), &main);
    }
}

#[test]
fn product_compiles() {
    for bands in 2..=6 {
        let count = bands * bands;
        let main =
            format!("{} {} sh_subtract_product(a, b); {}", load("a", count), load("b", count), store("a", count));
        compile(&format!("product {bands}"), &glsl_subtract(bands, bands), &main);
    }
}

#[test]
fn rotation_compiles() {
    for bands in 2..=6 {
        let count = bands * bands;
        let main = format!("{} sh_rotate(c, vec4(data[0]), vec2(data[1])); {}", load("c", count), store("c", count));
        compile(&format!("rotation {bands}"), &glsl_rotate(bands), &main);
    }
}

/// Runs the statements of function `name`, sums of products of names and literals, in f64.
fn interpret(text: &str, name: &str, names: &mut HashMap<String, f64>) {
    let start = text.find(&format!("void {name}(")).expect("the function is there");
    for line in text[start..].lines().skip(1).take_while(|line| *line != "}") {
        let statement = line.trim().strip_suffix(';').expect("a line is a statement");
        let words: Vec<&str> = statement.strip_prefix("float ").unwrap_or(statement).split(' ').collect();
        let mut sum = 0.0;
        let mut product = 1.0;
        for word in &words[2..] {
            match *word {
                "*" => {}
                "+" | "-" => {
                    sum += product;
                    product = if *word == "+" { 1.0 } else { -1.0 };
                }
                word => {
                    let (sign, word) = word.strip_prefix('-').map_or((1.0, word), |rest| (-1.0, rest));
                    let value = names.get(word).copied();
                    product *=
                        sign * value.unwrap_or_else(|| word.parse().unwrap_or_else(|_| panic!("{word}: {line}")));
                }
            }
        }
        sum += product;
        let target = names.entry(words[0].to_string()).or_insert(0.0);
        *target = match words[1] {
            "=" => sum,
            "+=" => *target + sum,
            "-=" => *target - sum,
            other => panic!("{other}: {line}"),
        };
    }
}

fn set(names: &mut HashMap<String, f64>, array: &str, values: &[f64]) {
    names.extend(values.iter().enumerate().map(|(i, &value)| (format!("{array}[{i}]"), value)));
}

/// Literals are f32: 6e-8 relative in each, in sums of terms up to about 10.
fn assert_array(names: &HashMap<String, f64>, array: &str, expected: &[f64], what: &str) {
    for (i, expected) in expected.iter().enumerate() {
        let value = names[&format!("{array}[{i}]")];
        assert!((value - expected).abs() < 5e-6, "{what}: {array}[{i}] = {value}, not {expected}");
    }
}

#[test]
fn text_computes_what_rust_computes() {
    let mut rng = Rng::with_seed(31);
    for bands in 2..=6 {
        let count = bands * bands;
        let mut random = || -> Vec<f64> { (0..count).map(|_| 2.0 * rng.f64() - 1.0).collect() };
        let (a, b) = (random(), random());
        let mut expected = vec![0.0; count];

        let direction = DVec3::new(-0.48, 0.8, -0.36);
        evaluate(bands, direction, &mut expected);
        let mut names: HashMap<_, _> =
            ["d.x", "d.y", "d.z"].map(String::from).into_iter().zip(direction.to_array()).collect();
        interpret(&glsl_basis(bands), "sh_basis", &mut names);
        assert_array(&names, "y", &expected, "basis");

        Tensor::new(bands, bands, bands).multiply(&a, &b, &mut expected);
        let mut names = HashMap::new();
        set(&mut names, "t", &a);
        set(&mut names, "b", &b);
        interpret(&glsl_subtract(bands, bands), "sh_subtract_product", &mut names);
        let remaining: Vec<f64> = a.iter().zip(&expected).map(|(a, c)| a - c).collect();
        assert_array(&names, "t", &remaining, "subtracted product");

        let rotation = DQuat::from_xyzw(0.1, -0.7, 0.5, 0.5);
        Rotation::new(bands, rotation).apply(&a, &mut expected);
        let parameters = ["alpha_beta.x", "alpha_beta.y", "alpha_beta.z", "alpha_beta.w", "gamma.x", "gamma.y"];
        let mut names: HashMap<_, _> = parameters.map(String::from).into_iter().zip(turns(rotation)).collect();
        set(&mut names, "c", &a);
        interpret(&glsl_rotate(bands), "sh_rotate", &mut names);
        assert_array(&names, "c", &expected, "rotation");
    }
}

#[test]
fn text_is_deterministic() {
    for bands in [3, 4, 5] {
        assert_eq!(glsl_basis(bands), glsl_basis(bands));
        let [one, two] = [(); 2].map(|()| glsl_subtract(bands, bands));
        assert_eq!(one, two);
        assert_eq!(glsl_rotate(bands), glsl_rotate(bands));
    }
}
