//! The basis: constants of the convention, orthonormality, a slow twin in angles, the program that is printed as GLSL.

use fastrand::Rng;
use glam::DVec3;
use shadow_fields::sh::basis::{MAX_BANDS, basis_program, coefficient_count, evaluate, values};
use shadow_fields::sh::quadrature::{icosahedral_rule, random_direction, sphere_rule};
use std::f64::consts::PI;

/// The associated Legendre function P_l^m(cos theta) with Condon-Shortley phase from its explicit sum over powers:
/// (-1)^m 2^l sin^m sum_k k! / (k - m)! cos^(k-m) binomial(l, k) binomial((l + k - 1) / 2, l).
fn legendre(l: i32, m: i32, theta: f64) -> f64 {
    let binomial = |top: f64, below: i32| (0..below).map(|i| (top - i as f64) / (i + 1) as f64).product::<f64>();
    let falling = |k: i32| (k - m + 1..=k).map(f64::from).product::<f64>();
    let sum: f64 = (m..=l)
        .map(|k| {
            let binomials = binomial(l as f64, k) * binomial((l + k - 1) as f64 / 2.0, l);
            falling(k) * theta.cos().powi(k - m) * binomials
        })
        .sum();
    (-1.0_f64).powi(m) * 2.0_f64.powi(l) * theta.sin().powi(m) * sum
}

/// Y_lm in angles.
fn slow_twin(l: i32, m: i32, direction: DVec3) -> f64 {
    let theta = direction.z.clamp(-1.0, 1.0).acos();
    let azimuth = direction.y.atan2(direction.x);
    let k = m.abs();
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let scale = ((2 * l + 1) as f64 / (4.0 * PI) * factorial(l - k) / factorial(l + k)).sqrt();
    let turn = match m {
        0 => 1.0,
        m if m > 0 => 2.0_f64.sqrt() * (k as f64 * azimuth).cos(),
        _ => 2.0_f64.sqrt() * (k as f64 * azimuth).sin(),
    };
    scale * legendre(l, k, theta) * turn
}

#[test]
fn evaluation_equals_the_slow_twin() {
    let mut rng = Rng::with_seed(1);
    for _ in 0..500 {
        let d = random_direction(&mut rng);
        let values = values(MAX_BANDS, d);
        for l in 0..MAX_BANDS as i32 {
            for m in -l..=l {
                let value = values[(l * (l + 1) + m) as usize];
                let expected = slow_twin(l, m, d);
                // The twin's sum cancels: its terms reach 2^l, 1e3 times an f64 rounding, times azimuths near poles.
                assert!((value - expected).abs() < 1e-11, "l {l} m {m} at {d}: {value} {expected}");
            }
        }
    }
}

#[test]
#[should_panic(expected = "bands must be 1 to 8")]
fn nine_bands_are_refused() {
    evaluate(9, DVec3::Z, &mut [0.0; 81]);
}

/// Products of two functions of band l have degree 2 l: a rule integrates them up to its own degree, no further.
#[test]
fn basis_is_orthonormal_by_rules_of_its_degree() {
    let icosahedral = icosahedral_rule();
    assert!(icosahedral.len() == 32 && icosahedral.chunks(2).all(|pair| pair[0].0 == -pair[1].0), "antipodal pairs");
    // Of degree 9, which is odd, its antipodal pairs integrate everything.
    for (rule, bands, is_exact) in [
        (sphere_rule(2 * (MAX_BANDS - 1)), MAX_BANDS, true),
        (sphere_rule(9), 5, true),
        (sphere_rule(6), 4, true),
        (sphere_rule(6), 5, false),
        (icosahedral.clone(), 5, true),
        (icosahedral, 6, false),
    ] {
        let values: Vec<_> = rule.iter().map(|&(d, weight)| (values(bands, d), weight)).collect();
        let mut worst = 0.0_f64;
        for i in 0..coefficient_count(bands) {
            for j in 0..coefficient_count(bands) {
                let sum: f64 = values.iter().map(|(y, weight)| weight * y[i] * y[j]).sum();
                worst = worst.max((sum - f64::from(i == j)).abs());
            }
        }
        assert!(if is_exact { worst < 1e-13 } else { worst > 1e-4 }, "{} points, {bands} bands: {worst}", rule.len());
    }
}

#[test]
fn the_program_that_is_printed_equals_evaluation() {
    let mut rng = Rng::with_seed(3);
    for bands in 1..=MAX_BANDS {
        for _ in 0..20 {
            let d = random_direction(&mut rng);
            let mut out = vec![f64::NAN; coefficient_count(bands)];
            basis_program(bands).evaluate(&d.to_array(), &mut out);
            for (index, (value, expected)) in out.iter().zip(values(bands, d)).enumerate() {
                // Horner's rule in z^2 cancels coefficients of up to 1e2 at 8 bands.
                assert!((value - expected).abs() < 1e-13, "bands {bands} coefficient {index}: {value} {expected}");
            }
        }
    }
}
