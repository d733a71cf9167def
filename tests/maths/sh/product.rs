//! The product tensor: counts, closed forms, quadrature of the pointwise product, the program that is printed as GLSL.

use super::{assert_close, random};
use fastrand::Rng;
use shadow_fields::sh::basis::{coefficient_count, values};
use shadow_fields::sh::product::Tensor;
use shadow_fields::sh::product_program::product_program;
use shadow_fields::sh::quadrature::sphere_rule;

/// Sums of up to a few hundred terms of order 1.
const SUMS: f64 = 1e-12;

fn multiply(tensor: &Tensor, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; coefficient_count(tensor.bands)];
    tensor.multiply(a, b, &mut out);
    out
}

#[test]
fn product_equals_quadrature_of_the_pointwise_product() {
    let mut rng = Rng::with_seed(4);
    for bands in [2, 3, 4, 7, 8] {
        let tensor = Tensor::new(bands);
        let [a, b] = [(); 2].map(|()| random(&mut rng, bands));
        let mut expected = vec![0.0; coefficient_count(bands)];
        for (direction, weight) in sphere_rule(3 * bands) {
            let y = values(8, direction);
            let dot = |c: &[f64]| c.iter().zip(&y).map(|(c, y)| c * y).sum::<f64>();
            let value = dot(&a) * dot(&b);
            for (sum, y) in expected.iter_mut().zip(&y) {
                *sum += weight * value * y;
            }
        }
        assert_close(&multiply(&tensor, &a, &b), &expected, SUMS, &format!("{bands} bands"));
    }
}

#[test]
fn the_program_that_is_printed_equals_the_product() {
    let mut rng = Rng::with_seed(6);
    for bands in 1..=6 {
        let tensor = Tensor::new(bands);
        let program = product_program(bands);
        for _ in 0..20 {
            let [a, b] = [(); 2].map(|()| random(&mut rng, bands));
            let inputs = [a.clone(), b.clone()].concat();
            let mut out = vec![f64::NAN; a.len()];
            program.evaluate(&inputs, &mut out);
            let expected: Vec<f64> = a.iter().zip(multiply(&tensor, &a, &b)).map(|(a, c)| a - c).collect();
            assert_close(&out, &expected, SUMS, &format!("{bands} bands"));
        }
    }
}
