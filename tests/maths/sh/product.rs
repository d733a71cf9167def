//! The product tensor: counts, closed forms, quadrature of the pointwise product, the program that is printed as GLSL.

use fastrand::Rng;
use shadow_fields::sh::basis::{coefficient_count, evaluate};
use shadow_fields::sh::product::Tensor;
use shadow_fields::sh::product_program::product_program;
use shadow_fields::sh::quadrature::sphere_rule;

fn random(rng: &mut Rng, bands: usize) -> Vec<f64> {
    (0..coefficient_count(bands)).map(|_| 2.0 * rng.f64() - 1.0).collect()
}

fn multiply(tensor: &Tensor, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; coefficient_count(tensor.bands()[2])];
    tensor.multiply(a, b, &mut out);
    out
}

/// Sums of up to a few hundred terms of order 1: absolute, with the relative part in the terms.
fn assert_close(value: &[f64], expected: &[f64], what: &str) {
    assert_eq!(value.len(), expected.len());
    for (k, (x, y)) in value.iter().zip(expected).enumerate() {
        assert!((x - y).abs() < 1e-12 * (1.0 + y.abs()), "{what}, coefficient {k}: {x} {y}");
    }
}

/// The product is the projection of the pointwise product, whichever bands go in and come out.
#[test]
fn product_equals_quadrature_of_the_pointwise_product() {
    let mut rng = Rng::with_seed(4);
    for [a_bands, b_bands, c_bands] in [[4, 4, 4], [2, 2, 2], [3, 3, 3], [7, 4, 4], [4, 7, 4], [3, 5, 6], [8, 8, 8]] {
        let tensor = Tensor::new(a_bands, b_bands, c_bands);
        let (a, b) = (random(&mut rng, a_bands), random(&mut rng, b_bands));
        let mut expected = vec![0.0; coefficient_count(c_bands)];
        for (direction, weight) in sphere_rule(a_bands + b_bands + c_bands) {
            let mut y = vec![0.0; 64];
            evaluate(8, direction, &mut y);
            let dot = |c: &[f64]| c.iter().zip(&y).map(|(c, y)| c * y).sum::<f64>();
            let value = dot(&a) * dot(&b);
            for (sum, y) in expected.iter_mut().zip(&y) {
                *sum += weight * value * y;
            }
        }
        assert_close(&multiply(&tensor, &a, &b), &expected, &format!("{a_bands} x {b_bands} -> {c_bands}"));
    }
}

#[test]
fn the_program_that_is_printed_equals_the_product() {
    let mut rng = Rng::with_seed(6);
    let square = (1..=6).map(|bands| (bands, bands));
    let other = [(4, 7), (4, 6), (4, 5), (3, 4), (3, 7), (5, 4), (6, 7), (4, 2)];
    for (a_bands, b_bands) in square.chain(other) {
        let tensor = Tensor::new(a_bands, b_bands, a_bands);
        let program = product_program(a_bands, b_bands);
        for _ in 0..20 {
            let (a, b) = (random(&mut rng, a_bands), random(&mut rng, b_bands));
            let inputs = [a.clone(), b.clone()].concat();
            let mut out = vec![f64::NAN; a.len()];
            program.evaluate(&inputs, &mut out);
            let expected: Vec<f64> = a.iter().zip(multiply(&tensor, &a, &b)).map(|(a, c)| a - c).collect();
            assert_close(&out, &expected, &format!("{a_bands} by {b_bands} bands"));
        }
    }
}
