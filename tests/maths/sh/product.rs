//! The product tensor: counts, closed forms, quadrature of the pointwise product, the program that is printed as GLSL.

use fastrand::Rng;
use glam::DVec3;
use shadow_fields::sh::basis::{Y00, coefficient_count, evaluate};
use shadow_fields::sh::lobe::cap;
use shadow_fields::sh::product::{Tensor, eigenvalues};
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

#[test]
fn matrix_multiplies_as_the_product_does_and_is_symmetric() {
    let mut rng = Rng::with_seed(7);
    for b_bands in [4, 7] {
        let tensor = Tensor::new(4, b_bands, 4);
        let (a, b) = (random(&mut rng, 4), random(&mut rng, b_bands));
        let matrix = tensor.matrix(&b);
        let product: Vec<f64> = matrix.chunks(16).map(|row| row.iter().zip(&a).map(|(m, a)| m * a).sum()).collect();
        assert_close(&product, &multiply(&tensor, &a, &b), "matrix");
        for i in 0..16 {
            for j in 0..i {
                assert!((matrix[i * 16 + j] - matrix[j * 16 + i]).abs() < 1e-14);
            }
        }
    }
}

#[test]
fn eigenvalues_of_known_matrices() {
    // A path of n masses: 2 - 2 cos(k pi / (n + 1)).
    let n = 9;
    let mut path = vec![0.0; n * n];
    for i in 0..n {
        path[i * n + i] = 2.0;
        if i > 0 {
            (path[i * n + i - 1], path[(i - 1) * n + i]) = (-1.0, -1.0);
        }
    }
    let expected: Vec<f64> =
        (1..=n).map(|k| 2.0 - 2.0 * (k as f64 * std::f64::consts::PI / (n + 1) as f64).cos()).collect();
    assert_close(&eigenvalues(&path), &expected, "path");
    assert_close(&eigenvalues(&[3.0, 0.0, 0.0, -5.0]), &[-5.0, 3.0], "diagonal");
}

/// The visibility of a 30 degree cap: 4 bands can grow by 1.058 a factor, 7 bands of visibility never.
#[test]
fn growth_certificate_of_a_cap() {
    let visibility = |bands| {
        let mut v: Vec<f64> = cap(bands, DVec3::new(0.6, 0.0, 0.8), 30.0_f64.to_radians());
        v.iter_mut().for_each(|b| *b = -*b);
        v[0] += 1.0 / Y00;
        v
    };
    let grown = eigenvalues(&Tensor::new(4, 4, 4).matrix(&visibility(4)))[15];
    assert!((grown - 1.058).abs() < 5e-4, "{grown}");
    let bounded = eigenvalues(&Tensor::new(4, 7, 4).matrix(&visibility(7)));
    assert!(bounded[0] > -1e-12 && bounded[15] < 1.0 + 1e-12, "{bounded:?}");
}
