//! The generated GLSL compiles, and does what its program does as far as its text can be read: counts and prints.

use shadow_fields::sh::basis::{basis_cost, glsl_basis};
use shadow_fields::sh::product_program::{Form, glsl_product, product_cost};
use shadow_fields::sh::rotation::{block_count, glsl_rotate};

/// Compiles `functions` in a compute shader with `main` as its body.
fn compile(name: &str, functions: &str, main: &str) {
    let source = format!(
        "#version 460\nlayout(local_size_x = 64) in;\n\
         layout(std430, binding = 0) buffer Data {{ float data[]; }};\n\
         layout(std140, binding = 1) uniform Rotations {{ vec4 rotations[32]; }};\n\
         #define SH_ROTATION(k) rotations[(k) >> 2][(k) & 3]\n\
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
        let main = format!(
            "{} {} float c[{count}]; sh_product(a, b, c); sh_subtract_product(a, c); {}",
            load("a", count),
            load("b", count),
            store("a", count)
        );
        compile(&format!("product {bands}"), &glsl_product(bands), &main);
    }
}

#[test]
fn rotation_compiles_and_reads_each_element_once() {
    for bands in 2..=6 {
        let count = bands * bands;
        let text = glsl_rotate(bands);
        for k in 0..block_count(bands) {
            assert_eq!(text.matches(&format!("SH_ROTATION({k})")).count(), 1, "bands {bands} element {k}");
        }
        let main = format!("{} sh_rotate(c, 0u); {}", load("c", count), store("c", count));
        // 5 bands and more need more than the 128 floats of the test's uniform block; indices stay constant.
        let text = text.replace("SH_ROTATION(", "SH_ROTATION(127 & ");
        compile(&format!("rotation {bands}"), &text, &main);
    }
}

#[test]
fn text_is_deterministic() {
    for bands in [3, 4, 5] {
        assert_eq!(glsl_basis(bands), glsl_basis(bands));
        assert_eq!(glsl_product(bands), glsl_product(bands));
        assert_eq!(glsl_rotate(bands), glsl_rotate(bands));
    }
}

#[test]
fn costs_are_what_the_design_counts_on() {
    println!("basis {:?}", (2..=7).map(|bands| basis_cost(bands).fma_count).collect::<Vec<_>>());
    for bands in 2..=6 {
        println!("product {bands} {:?}", product_cost(bands, Form::Product));
        println!("subtract {bands} {:?}", product_cost(bands, Form::Subtract));
    }
    assert!(product_cost(4, Form::Product).fma_count < 428, "the plain pairs form");
}
