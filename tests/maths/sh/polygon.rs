//! Spherical polygons: the closed form against known solids and against quadrature.

use crate::common::cap;
use glam::{DQuat, DVec3};
use shadow_fields::sh::basis::{Y00, evaluate};
use shadow_fields::sh::polygon::{POLYGON_BANDS, POLYGON_COEFFICIENTS, polygon};
use std::f64::consts::PI;

type Coefficients = [f64; POLYGON_COEFFICIENTS];

fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A rectangle at a height under the origin, turned.
#[derive(Clone, Copy)]
struct Rectangle {
    low: [f64; 2],
    high: [f64; 2],
    height: f64,
    turn: DQuat,
}

impl Rectangle {
    fn corner(&self, x: f64, y: f64) -> DVec3 {
        self.turn * DVec3::new(x, y, -self.height)
    }

    fn blocked(&self) -> Coefficients {
        let ([x0, y0], [x1, y1]) = (self.low, self.high);
        polygon(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| self.corner(x, y)))
    }

    /// The integral by the midpoint rule with places as dense as a passing light's: x = height sinh(t).
    fn quadrature(&self, steps: u32) -> Coefficients {
        let mut sum = [0.0; POLYGON_COEFFICIENTS];
        let node = |i: u32, axis: usize| {
            let [from, to] = [self.low[axis], self.high[axis]].map(|end| (end / self.height).asinh());
            let step = (to - from) / f64::from(steps);
            let t = from + (f64::from(i) + 0.5) * step;
            (self.height * t.sinh(), self.height * t.cosh() * step)
        };
        for (x, y) in (0..steps).flat_map(|i| (0..steps).map(move |j| (node(i, 0), node(j, 1)))) {
            let at = self.corner(x.0, y.0);
            let solid_angle = x.1 * y.1 * self.height / at.length().powi(3);
            let mut basis = [0.0; POLYGON_COEFFICIENTS];
            evaluate(POLYGON_BANDS, at.normalize(), &mut basis);
            sum.iter_mut().zip(basis).for_each(|(sum, y)| *sum += y * solid_angle);
        }
        sum
    }
}

fn rectangles(height: f64) -> impl Iterator<Item = Rectangle> {
    let mut rng = fastrand::Rng::with_seed(3);
    (0..12).map(move |_| {
        let mut number = |from: f64, to: f64| from + (to - from) * rng.f64();
        let low = [number(-2.0, 1.0), number(-2.0, 1.0)];
        let high = [low[0] + number(0.05, 2.0), low[1] + number(0.05, 2.0)];
        let axis = DVec3::new(number(-1.0, 1.0), number(-1.0, 1.0), 0.3).normalize();
        Rectangle { low, high, height, turn: DQuat::from_axis_angle(axis, number(0.0, 6.0)) }
    })
}

#[test]
fn rectangles_cover_what_quadrature_sums() {
    for height in [9.0, 1.0, 0.1, 1e-2] {
        for rectangle in rectangles(height) {
            let found = rectangle.blocked();
            let off = worst(&found, &rectangle.quadrature(300));
            assert!(off < 2e-4, "height {height}: {off}");
            assert!(found[0] > 1e-5, "it covers something");
        }
    }
}

/// A rectangle covers what its four parts do: far, close by, at grazing angles, where a cut passes below the eye.
#[test]
fn parts_add_up() {
    for height in [1e4, 1.0, 1e-3, 1e-7] {
        for whole in rectangles(height) {
            let cut = [0, 1].map(|axis| 0.4 * whole.low[axis] + 0.6 * whole.high[axis]);
            let mut sum = [0.0; POLYGON_COEFFICIENTS];
            let ends = [0, 1].map(|axis| [whole.low[axis], cut[axis], whole.high[axis]]);
            for [x, y] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                let [low, high] = [0, 1].map(|end| [ends[0][x + end], ends[1][y + end]]);
                let part = Rectangle { low, high, ..whole };
                sum.iter_mut().zip(part.blocked()).for_each(|(sum, b)| *sum += b);
            }
            let off = worst(&sum, &whole.blocked());
            assert!(off < 1e-9, "height {height}: {off}");
        }
    }
}

#[test]
fn known_solids() {
    // An eighth of the sphere: its solid angle, and by symmetry the same along each axis.
    let eighth = polygon(&[DVec3::X, DVec3::Y, DVec3::Z]);
    assert!((eighth[0] - Y00 * PI / 2.0).abs() < 1e-12, "{eighth:?}");
    let linear = (3.0 / (4.0 * PI)).sqrt() * PI / 4.0;
    assert!(worst(&eighth[1..4], &[-linear, linear, -linear]) < 1e-12, "{eighth:?}");
    // From close by, a large square is half of the view, from either side.
    for side in [1.0, -1.0] {
        let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let found = polygon(&square.map(|(x, y)| DVec3::new(x, y, 1e-6 * side)));
        let off = worst(&found, &cap(POLYGON_BANDS, DVec3::Z * side, PI / 2.0));
        assert!(off < 1e-5, "{off}");
    }
    // In its own plane it covers nothing.
    let edge_on = polygon(&[DVec3::new(1.0, -1.0, 0.0), DVec3::new(2.0, -1.0, 0.0), DVec3::new(2.0, 1.0, 0.0)]);
    assert_eq!(edge_on, [0.0; POLYGON_COEFFICIENTS]);
    // Far away it is a point: its area over the square of the distance, tilted.
    let far = DVec3::new(300.0, 400.0, 1200.0);
    let tiny = polygon(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| far + DVec3::new(x, y, 0.0)));
    let mut basis = [0.0; POLYGON_COEFFICIENTS];
    evaluate(POLYGON_BANDS, far.normalize(), &mut basis);
    let solid_angle = 1200.0 / far.length().powi(3);
    assert!(worst(&tiny, &basis.map(|y| y * solid_angle)) < 3e-3 * solid_angle, "{tiny:?}");
}
