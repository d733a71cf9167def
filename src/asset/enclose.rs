//! The smallest sphere around a set of points.
//!
//! Smallest enclosing balls are an LP-type problem (Welzl 1991): the ball is fixed by at most four of the points. The
//! loop here keeps such a support, adds the point farthest outside, and solves the five points by trying every subset.
//! The radius grows in every iteration, so the loop ends; meshes take 5 to 30 iterations, each one pass over the
//! points.

use glam::{DMat3, DVec3, Vec3};

/// A point counts as inside when its distance is within this factor of the radius: far above f64 rounding, far below
/// f32.
const INSIDE: f64 = 1.0 + 1e-11;
/// The centre of the bounding box is used instead if its sphere is larger by at most this factor, one f32 rounding,
/// because it is exact for a symmetric mesh.
const CENTRE_SLACK: f64 = 1.0 + 2e-7;
/// Bound on the iterations, more than any mesh needs, in case rounding makes the support cycle.
const TURN_LIMIT: usize = 1000;

/// Centre and radius of the smallest sphere around `positions`, solved in f64; zeros without any.
///
/// The radius is rounded up so that every position lies inside, measured in f64 and in f32.
pub fn bounding_sphere(positions: &[Vec3]) -> (Vec3, f32) {
    if positions.is_empty() {
        return (Vec3::ZERO, 0.0);
    }
    let (low, high) = positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let middle = (low.as_dvec3() + high.as_dvec3()) * 0.5;
    let ball = smallest_ball(positions, middle);
    let boxed = farthest(positions, middle).1;
    let centre = if boxed <= ball.radius * CENTRE_SLACK { middle } else { ball.centre }.as_vec3();
    let exact = farthest(positions, centre.as_dvec3()).1;
    let single = positions.iter().map(|p| p.distance(centre)).fold(0.0, f32::max);
    let radius_m = (exact as f32).max(single);
    (centre, if radius_m > 0.0 { radius_m.next_up() } else { 0.0 })
}

/// The box around boxes, each its least and its greatest corner; `None` without any.
pub fn around_boxes(boxes: impl Iterator<Item = [DVec3; 2]>) -> Option<[DVec3; 2]> {
    boxes.reduce(|[low, high], [from, to]| [low.min(from), high.max(to)])
}

/// Centre and radius of a sphere around spheres, about the middle of their bounding box; `None` without any.
pub fn around_spheres(spheres: &[(DVec3, f64)]) -> Option<(DVec3, f64)> {
    let [low, high] = around_boxes(spheres.iter().map(|(centre, radius)| [*centre - *radius, *centre + *radius]))?;
    let middle = (low + high) / 2.0;
    Some((middle, spheres.iter().map(|(centre, radius)| centre.distance(middle) + radius).fold(0.0, f64::max)))
}

#[derive(Clone, Copy)]
struct Ball {
    centre: DVec3,
    radius: f64,
}

impl Ball {
    fn holds(&self, point: DVec3) -> bool {
        self.centre.distance(point) <= self.radius * INSIDE
    }
}

fn smallest_ball(positions: &[Vec3], start: DVec3) -> Ball {
    let first = farthest(positions, start).0;
    let mut ball = Ball { centre: first, radius: 0.0 };
    let mut support = vec![first];
    for _ in 0..TURN_LIMIT {
        let (point, distance) = farthest(positions, ball.centre);
        if distance <= ball.radius * INSIDE {
            break;
        }
        support.push(point);
        match smallest_of(&support) {
            Some((next, kept)) if next.radius > ball.radius => (ball, support) = (next, kept),
            // Rounding prevents progress; the remaining error is far below f32 precision.
            _ => break,
        }
    }
    ball
}

fn farthest(positions: &[Vec3], centre: DVec3) -> (DVec3, f64) {
    let squared = |p: &Vec3| p.as_dvec3().distance_squared(centre);
    let (index, most) = positions
        .iter()
        .enumerate()
        .map(|(i, p)| (i, squared(p)))
        .fold((0, -1.0), |best, next| if next.1 > best.1 { next } else { best });
    (positions[index].as_dvec3(), most.max(0.0).sqrt())
}

/// The smallest ball around at most five points, with the points that fix it, by trying every subset of one to four.
fn smallest_of(points: &[DVec3]) -> Option<(Ball, Vec<DVec3>)> {
    (1u32..1 << points.len())
        .filter(|mask| mask.count_ones() <= 4)
        .filter_map(|mask| {
            let subset: Vec<DVec3> = (0..points.len()).filter(|i| mask >> i & 1 == 1).map(|i| points[i]).collect();
            let ball = circumscribed(&subset)?;
            points.iter().all(|p| ball.holds(*p)).then_some((ball, subset))
        })
        .min_by(|a, b| a.0.radius.total_cmp(&b.0.radius))
}

/// The smallest ball with all of one to four points on its surface; `None` if they are nearly affinely dependent.
///
/// With q_i = p_i - p_0 the centre is p_0 + sum x_i q_i where 2 (q_i . q_j) x_j = q_i . q_i.
fn circumscribed(points: &[DVec3]) -> Option<Ball> {
    let q: Vec<DVec3> = points[1..].iter().map(|p| *p - points[0]).collect();
    // The Gram matrix, filled up with ones on the diagonal for fewer than four points.
    let entry = |i: usize, j: usize| match (q.get(i), q.get(j)) {
        (Some(a), Some(b)) => 2.0 * a.dot(*b),
        _ => f64::from(u8::from(i == j)),
    };
    let column = |j: usize| DVec3::new(entry(0, j), entry(1, j), entry(2, j));
    let gram = DMat3::from_cols(column(0), column(1), column(2));
    let scale: f64 = (0..3).map(|i| entry(i, i)).product();
    // The determinant over the product of the diagonal is a squared relative volume: 1e-14 means a sliver 1e-7 thick.
    if gram.determinant() <= 1e-14 * scale {
        return None;
    }
    let squared = |i: usize| q.get(i).map_or(0.0, |a| a.length_squared());
    let x = gram.inverse() * DVec3::new(squared(0), squared(1), squared(2));
    let offset: DVec3 = q.iter().enumerate().map(|(i, a)| *a * x[i]).sum();
    Some(Ball { centre: points[0] + offset, radius: offset.length() })
}
