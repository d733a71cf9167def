//! Exact quadrature over the sphere: sums that equal integrals of polynomials up to a stated degree.
//!
//! A product of SH of bands l and l' is a polynomial of degree l + l' on the sphere, so a finite sum gives every table
//! of these modules (product tensor, rotation blocks) without discretisation error.

use std::f64::consts::PI;

use glam::DVec3;

/// Nodes and weights on [-1, 1] that integrate polynomials up to degree `2 * node_count - 1`; weights sum to 2.
///
/// Newton iteration on the Legendre polynomial from the usual cosine estimate of its roots.
pub fn gauss_legendre(node_count: usize) -> Vec<(f64, f64)> {
    let n = node_count as f64;
    (0..node_count)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..8 {
                let mut below = 1.0;
                let mut value = x;
                for l in 2..=node_count {
                    let l = l as f64;
                    (below, value) = (value, ((2.0 * l - 1.0) * x * value - (l - 1.0) * below) / l);
                }
                slope = n * (x * value - below) / (x * x - 1.0);
                x -= value / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Points and weights (steradians, sum 4 pi) that integrate every polynomial of degree at most `degree` over the unit
/// sphere.
///
/// Gauss-Legendre nodes in z times equal angles in azimuth: `(degree / 2 + 1) * (degree + 1)` points.
pub fn sphere_rule(degree: usize) -> Vec<(DVec3, f64)> {
    let azimuth_count = degree + 1;
    let mut rule = Vec::with_capacity((degree / 2 + 1) * azimuth_count);
    for (z, weight) in gauss_legendre(degree / 2 + 1) {
        let radius = (1.0 - z * z).sqrt();
        for k in 0..azimuth_count {
            // An offset of half a step keeps the points off the coordinate planes, where many SH vanish at once.
            let (sin, cos) = (2.0 * PI * (k as f64 + 0.5) / azimuth_count as f64).sin_cos();
            rule.push((DVec3::new(radius * cos, radius * sin, z), weight * 2.0 * PI / azimuth_count as f64));
        }
    }
    rule
}

/// Unit directions all over the sphere, of equal areas: a Fibonacci lattice.
pub fn even_directions(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (sin, cos) = (2.399963229728653 * i as f64).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cos, radius * sin, z)
    })
}

pub fn random_direction(rng: &mut fastrand::Rng) -> DVec3 {
    let z = 2.0 * rng.f64() - 1.0;
    let azimuth = 2.0 * PI * rng.f64();
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * azimuth.cos(), radius * azimuth.sin(), z)
}

/// The 32-point rule, exact to degree 9: twelve icosahedron vertices of weight 4 pi * 25/840 and the twenty vertices of
/// the dual dodecahedron, the directions of its face centres, of weight 4 pi * 27/840 (McLaren 1963, reference 5 of
/// [`crate::sh`]).
///
/// Points come in antipodal pairs: `rule[2 * k + 1].0 == -rule[2 * k].0`, so a sum of an even function needs only every
/// second point.
pub fn icosahedral_rule() -> Vec<(DVec3, f64)> {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut rule = Vec::with_capacity(32);
    let mut push = |point: DVec3, parts: f64| {
        let point = point.normalize();
        let weight = 4.0 * PI * parts / 840.0;
        rule.push((point, weight));
        rule.push((-point, weight));
    };
    for sign in [1.0, -1.0] {
        let ico = DVec3::new(0.0, sign, golden);
        let dodeca = DVec3::new(sign / golden, 0.0, golden);
        for (v, parts) in [(ico, 25.0), (dodeca, 27.0)] {
            push(v, parts);
            push(DVec3::new(v.z, v.x, v.y), parts);
            push(DVec3::new(v.y, v.z, v.x), parts);
        }
    }
    for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        push(DVec3::new(x, y, 1.0), 27.0);
    }
    rule
}
