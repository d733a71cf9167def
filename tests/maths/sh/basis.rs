//! The basis: constants of the convention, orthonormality, a slow twin in angles, the program that is printed as GLSL.

use std::f64::consts::PI;

use fastrand::Rng;
use glam::DVec3;
use shadow_fields::sh::basis::{MAX_BANDS, MAX_COEFFICIENTS, basis_program, coefficient_count, evaluate, values};
use shadow_fields::sh::quadrature::{icosahedral_rule, random_direction, sphere_rule};

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

#[test]
fn basis_is_orthonormal() {
    let rule = sphere_rule(2 * (MAX_BANDS - 1));
    let values: Vec<_> = rule.iter().map(|&(d, weight)| (values(MAX_BANDS, d), weight)).collect();
    for i in 0..MAX_COEFFICIENTS {
        for j in 0..MAX_COEFFICIENTS {
            let sum: f64 = values.iter().map(|(y, weight)| weight * y[i] * y[j]).sum();
            let expected = f64::from(i == j);
            assert!((sum - expected).abs() < 1e-13, "{i} {j}: {sum}");
        }
    }
}

/// The integral of x^p y^q z^r over the sphere: 0 with an odd power, else 4 pi (p-1)!! (q-1)!! (r-1)!! / (p+q+r+1)!!.
fn monomial_integral(powers: [i32; 3]) -> f64 {
    if powers.iter().any(|p| p % 2 == 1) {
        return 0.0;
    }
    let double_factorial = |n: i32| (1..=n).rev().step_by(2).map(f64::from).product::<f64>();
    let numerator: f64 = powers.iter().map(|p| double_factorial(p - 1)).product();
    4.0 * PI * numerator / double_factorial(powers.iter().sum::<i32>() + 1)
}

/// The largest error of a rule over all monomials of exactly this degree.
fn rule_error(rule: &[(DVec3, f64)], degree: i32) -> f64 {
    let mut worst = 0.0_f64;
    for p in 0..=degree {
        for q in 0..=degree - p {
            let powers = [p, q, degree - p - q];
            let sum: f64 =
                rule.iter().map(|(d, w)| w * d.x.powi(powers[0]) * d.y.powi(powers[1]) * d.z.powi(powers[2])).sum();
            worst = worst.max((sum - monomial_integral(powers)).abs());
        }
    }
    worst
}

#[test]
fn rules_are_exact_to_their_degree_and_no_further() {
    for degree in [0, 3, 6, 9, 14, 21] {
        let rule = sphere_rule(degree as usize);
        for d in 0..=degree {
            assert!(rule_error(&rule, d) < 1e-13, "degree {degree}: monomials of {d}");
        }
    }
    // An odd degree gives an even rule that integrates the next odd monomials too: look two further.
    assert!(rule_error(&sphere_rule(6), 8) > 1e-4, "the test can fail");

    let rule = icosahedral_rule();
    assert_eq!(rule.len(), 32);
    for degree in 0..=9 {
        assert!(rule_error(&rule, degree) < 1e-14, "icosahedral rule: monomials of {degree}");
    }
    assert!(rule_error(&rule, 10) > 1e-4, "degree 10 is past the icosahedral rule");
    assert!(rule.chunks(2).all(|pair| pair[0].0 == -pair[1].0), "points come in antipodal pairs");
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
