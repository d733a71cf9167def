//! SH of what a flat convex polygon covers of the view, in closed form for four bands.
//!
//! On the sphere the Laplacian of Y_lm is -l (l + 1) Y_lm, so the integral of Y_lm over a region is that of its
//! derivative along the inward normal of the boundary, over l (l + 1). Along one edge, an arc of angle a whose middle is
//! the unit vector u, that normal is one unit vector n, and Y_lm is a homogeneous polynomial whose derivative is l
//! Y[n, p, ..., p] in its polarised form. With d+ and d- for (u +- n) / sqrt 2, at right angles to each other:
//!
//! ```text
//! band 1: sum over edges of  a / 2 Y(n)
//! band 2:                    sin(a / 2) / 3 (Y(d+) - Y(d-))
//! band 3:                    sqrt 2 / 12 sin a (Y(d+) - Y(d-)) - (a / 8 - sin a / 24) Y(n)
//! ```
//!
//! In band 3 the integral of p p over the arc is sin a u u + (a - sin a) / 2 (1 - n n), and the unit matrix drops out of
//! a harmonic polynomial. Band 0 is the solid angle (reference 6 of [`crate::sh`]).

use super::basis::{Y00, values};
use glam::DVec3;
use std::f64::consts::SQRT_2;

pub const POLYGON_BANDS: usize = 4;

pub const POLYGON_COEFFICIENTS: usize = POLYGON_BANDS * POLYGON_BANDS;

/// The blocked part of a convex polygon, from both sides. `corners` are seen from the origin, in order around it; a
/// polygon whose plane holds the origin covers nothing.
pub fn polygon(corners: &[DVec3]) -> [f64; POLYGON_COEFFICIENTS] {
    let mut blocked = [0.0; POLYGON_COEFFICIENTS];
    let unit: Vec<DVec3> = corners.iter().map(|corner| corner.normalize()).collect();
    let solid_angle: f64 = unit[1..].windows(2).map(|pair| triangle(unit[0], pair[0], pair[1])).sum();
    // Seen from the other side the corners run the other way round.
    let inward = if solid_angle < 0.0 { -1.0 } else { 1.0 };
    let next = unit.iter().cycle().skip(1);
    for (a, b) in unit.iter().zip(next) {
        let across = a.cross(*b);
        let (Some(normal), Some(middle)) = (across.try_normalize(), (*a + *b).try_normalize()) else { continue };
        add_edge(&mut blocked, inward * normal, middle, across.length().atan2(a.dot(*b)));
    }
    blocked[0] = Y00 * solid_angle.abs();
    if solid_angle == 0.0 { [0.0; POLYGON_COEFFICIENTS] } else { blocked }
}

fn add_edge(blocked: &mut [f64; POLYGON_COEFFICIENTS], normal: DVec3, middle: DVec3, angle: f64) {
    let of_normal = values(POLYGON_BANDS, normal);
    let above = values(POLYGON_BANDS, (middle + normal) / SQRT_2);
    let below = values(POLYGON_BANDS, (middle - normal) / SQRT_2);
    let sine = angle.sin();
    for (k, blocked) in blocked.iter_mut().enumerate().skip(1) {
        let change = above[k] - below[k];
        *blocked += match k {
            1..4 => angle / 2.0 * of_normal[k],
            4..9 => (angle / 2.0).sin() / 3.0 * change,
            _ => SQRT_2 / 12.0 * sine * change - (angle / 8.0 - sine / 24.0) * of_normal[k],
        };
    }
}

/// Solid angle of the triangle of three unit vectors, positive where they run counter-clockwise as seen from the
/// origin.
fn triangle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let spread = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
    2.0 * a.dot(b.cross(c)).atan2(spread)
}
