//! Which samples a lookup takes, and by what weights.

use super::{ROUNDING, interpolate, lattices, noise, store};
use fastrand::Rng;
use glam::DVec3;
use shadow_fields::sh::quadrature::random_direction;

#[test]
fn weights_are_convex_everywhere() {
    let mut rng = Rng::with_seed(2);
    for lattice in lattices() {
        let radial = (0..3000).map(|_| random_direction(&mut rng) * 10.0_f64.powf(3.0 * rng.f64() - 1.5));
        let far = [DVec3::ZERO, DVec3::splat(1e-300), DVec3::splat(-1e6), DVec3::new(1e6, 0.0, 0.0), -1e6 * DVec3::Y];
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|v| [v, -v, 3.0 * v, -0.3 * v]);
        let corners = (0..8).map(|k| DVec3::new(1.0, f64::from(k & 2) - 1.0, f64::from((k & 1) * 2) - 1.0));
        let edges = [DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, -1.0, 1.0), DVec3::new(-2.0, 0.3, 2.0)];
        for position in radial.chain(far).chain(axes).chain(corners).chain(edges) {
            let found = lattice.corners(position);
            assert!(found.weight.iter().all(|w| *w >= 0.0 && w.is_finite()), "{lattice} {position} {found:?}");
            assert!((found.weight.iter().sum::<f64>() - 1.0).abs() < ROUNDING, "{lattice} {position} {found:?}");
            assert!(found.index.iter().all(|i| *i < lattice.stored_count()), "{lattice} {position} {found:?}");
            let unscale = lattice.unscale(position.length());
            assert!(unscale.is_finite() && unscale >= 0.0, "{lattice} {position}");
        }
    }
}

#[test]
fn a_sample_point_gives_its_sample() {
    let mut rng = Rng::with_seed(3);
    for lattice in lattices() {
        let captured = noise(&lattice, &mut rng);
        let stored = store(&lattice, &captured);
        for index in 0..lattice.sample_count() {
            let value = interpolate(&lattice, &stored, lattice.position(index));
            let wanted = captured[index as usize];
            assert!((value - wanted).abs() < ROUNDING, "{lattice} sample {index}: {value}, not {wanted}");
        }
    }
}

#[test]
fn linear_in_the_shell_coordinate_is_exact() {
    let mut rng = Rng::with_seed(5);
    for lattice in lattices() {
        let captured: Vec<f64> =
            (0..lattice.sample_count()).map(|i| 3.0 - 0.25 * f64::from(i / lattice.direction_count())).collect();
        let stored = store(&lattice, &captured);
        let (slope, offset) = lattice.radial_map();
        for _ in 0..500 {
            let d = lattice.inner + (lattice.outer - lattice.inner) * rng.f64();
            let wanted = 3.0 - 0.25 * (slope * lattice.coordinate(d) + offset);
            let value = interpolate(&lattice, &stored, d * random_direction(&mut rng));
            assert!((value - wanted).abs() < ROUNDING, "{lattice} {d}: {value}, not {wanted}");
        }
    }
}
