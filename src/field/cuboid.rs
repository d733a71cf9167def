//! Boxes in closed form: what one blocks of a small round light follows from its edges, and nothing is baked.
//!
//! Along a ray a box is a hexagon, the overlap of three strips, one for each direction of its edges. The strips' edges
//! are those of the box that are seen against what lies beyond, so that of each the distance from the ray and the depth
//! are known; a light is cut by both edges of a strip, and by the two strips that take most of it. Lengths are in
//! bounding radii of the box, as those of silhouette fields ([`super::silhouette`]) are, and so is the rule of what lies
//! between a point and a light.

use super::sheet::both;
use super::silhouette::{LEAST_PENUMBRA, NEAREST, NO_BOX, blocked_share, counts_between, through_box};
use glam::DVec3;

/// Square of the sine of the angle between a ray and edges within which the ray counts as parallel to them: what the
/// strip cuts off the other two is no more than that sine.
pub const PARALLEL: f64 = 1e-6;
/// How far before a light, in r, a ray enters a box that blocks all of it though it would leave the box beyond: as a pole
/// that reaches into its lamp, whose lower part it hides.
pub const ENTERED: f64 = 0.004;

/// Least distance of an edge from a receiver that a penumbra is computed for, in r. Edges are exact, so that it is less
/// than that of maps: on a wall of several boxes the next one begins in the wall's plane.
pub const NEAREST_EDGE: f64 = 1e-4;

/// A box about the centre of its bounding sphere, in the frame of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Halves of three edges, at right angles to each other, in r.
    pub half_edges: [DVec3; 3],
}

/// A box in the frame of a mesh, where it is part of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedCuboid {
    pub centre_m: DVec3,
    pub radius_m: f64,
    pub cuboid: Cuboid,
}

/// A ray beside a box.
#[derive(Clone, Copy, Debug)]
pub struct CuboidRay {
    /// Signed distance from the nearest edge of each strip, positive within, and from the other one.
    distances: [[f64; 2]; 3],
    /// How far along the ray the nearest edge of each strip is, and the other one.
    away: [[f64; 2]; 3],
    /// Cosines of the angles between the nearest edges of each strip and the next.
    cosines: [f64; 3],
    in_box: [f64; 2],
}

impl Cuboid {
    /// As `glsl/sharp_cuboid.glsl` reads it.
    pub fn quads(&self) -> [[f32; 4]; 3] {
        self.half_edges.map(|edge| edge.extend(0.0).as_vec4().to_array())
    }

    /// The face that looks most in a direction: that at the end of edge `face / 2`, or at its beginning if it is odd.
    pub fn face(&self, direction: DVec3) -> usize {
        let looks = |face: &usize| {
            let edge = self.half_edges[face / 2].normalize().dot(direction);
            if face % 2 == 0 { edge } else { -edge }
        };
        (0..6).max_by(|a, b| looks(a).total_cmp(&looks(b))).expect("six faces")
    }

    /// The ray from a point along a unit vector.
    pub fn ray(&self, point: DVec3, along: DVec3) -> CuboidRay {
        let edges = self.half_edges;
        let to = -point;
        let depth = to.dot(along);
        let cosines = edges.map(|edge| edge.dot(along));
        let faces = [0, 1, 2].map(|i| edges[(i + 1) % 3].cross(edges[(i + 2) % 3]).dot(along));
        let squares = edges.map(|edge| edge.length_squared());
        let places = edges.map(|edge| edge.dot(to));
        let lengths = squares.map(f64::sqrt);
        let corner = DVec3::from_array(lengths);
        let local = |v: DVec3| DVec3::from_array(std::array::from_fn(|i| edges[i].dot(v) / lengths[i]));
        let mut out = CuboidRay {
            distances: [[f64::INFINITY; 2]; 3],
            away: [[depth; 2]; 3],
            cosines: [0.0; 3],
            in_box: through_box([-corner, corner], local(point), local(along)).unwrap_or([-NO_BOX, NO_BOX]),
        };
        let mut normals = [DVec3::ZERO; 3];
        for i in 0..3 {
            let [j, k] = [(i + 1) % 3, (i + 2) % 3];
            let square = squares[i] - cosines[i] * cosines[i];
            if square < PARALLEL * squares[i] {
                continue;
            }
            let length = square.sqrt();
            let normal = edges[i].cross(along) / length;
            let half = (faces[j].abs() + faces[k].abs()) / length;
            let off = normal.dot(to);
            let side = if off > 0.0 { -1.0 } else { 1.0 };
            let sign = |x: f64| if x > 0.0 { 1.0 } else { -1.0 };
            // The middles of the strip's edges, and the places on these that are nearest to the ray.
            let middle = side * (sign(faces[j]) * cosines[k] - sign(faces[k]) * cosines[j]);
            let away = |edge: f64| edge + ((edge * cosines[i] - places[i]) / square).clamp(-1.0, 1.0) * cosines[i];
            out.distances[i] = [half - off.abs(), half + off.abs()];
            out.away[i] = [away(depth + middle), away(depth - middle)];
            normals[i] = side * normal;
        }
        out.cosines = [0, 1, 2].map(|i| normals[i].dot(normals[(i + 1) % 3]));
        out
    }

    /// Share of a small round light that the box blocks, as seen from a point: the light's middle lies in the unit
    /// direction `along`, `distance` away, and `tangent` is that of its angular radius.
    pub fn blocked(&self, point: DVec3, along: DVec3, distance: f64, tangent: f64) -> f64 {
        let ray = self.ray(point, along);
        let strip = |i: usize| {
            let [near, far] = [0, 1].map(|side| {
                let width = (ray.away[i][side].max(NEAREST_EDGE) * tangent).max(LEAST_PENUMBRA);
                blocked_share(ray.distances[i][side] / width)
            });
            (near + far - 1.0).max(0.0)
        };
        let shares = [strip(0), strip(1), strip(2)];
        let two = |i: usize| both(shares[i], shares[(i + 1) % 3], ray.cosines[i].max(0.0));
        let (_, away) = ray.nearest();
        let [enters, mut leaves] = ray.in_box;
        // A ray that enters the box before the light is blocked there, wherever it would leave it.
        if enters > -NO_BOX {
            leaves = leaves.min(distance + NEAREST * (1.0 - ((distance - enters) / ENTERED).clamp(0.0, 1.0)));
        }
        two(0).min(two(1)).min(two(2)) * counts_between(away, distance, [enters, leaves])
    }
}

impl CuboidRay {
    /// Signed distance of the ray from the box's outline, positive where the ray meets the box, and how far away that
    /// outline is.
    pub fn nearest(&self) -> (f64, f64) {
        let nearer = |a: usize, b: usize| if self.distances[b][0] < self.distances[a][0] { b } else { a };
        let nearest = nearer(nearer(0, 1), 2);
        (self.distances[nearest][0], self.away[nearest][0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(half: DVec3) -> Cuboid {
        Cuboid {
            half_edges: [DVec3::X * half.x, DVec3::Y * half.y, DVec3::Z * half.z].map(|edge| edge / half.length()),
        }
    }

    /// Share of rays towards a disc that meet the box, which is wholly between.
    fn counted(half: DVec3, point: DVec3, along: DVec3, tangent: f64) -> f64 {
        let half = half / half.length();
        let across = along.any_orthonormal_vector();
        let beside = along.cross(across);
        let count = 4000;
        let meets = |i: &u32| {
            let radius = tangent * ((f64::from(*i) + 0.5) / f64::from(count)).sqrt();
            let turn = f64::from(*i) * 2.399963;
            let direction = (along + radius * (turn.cos() * across + turn.sin() * beside)).normalize();
            through_box([-half, half], point, direction).is_some()
        };
        (0..count).filter(meets).count() as f64 / f64::from(count)
    }

    /// A cube, a plank, a pole and a plate from everywhere, before lights that are narrower and wider than they are.
    #[test]
    fn boxes_block_as_counted_rays_do() {
        let mut rng = fastrand::Rng::with_seed(3);
        let boxes =
            [([1.0, 1.0, 1.0], 0.006), ([1.0, 0.3, 0.06], 0.02), ([0.04, 1.0, 0.05], 0.02), ([1.0, 0.02, 0.8], 0.025)];
        for (half, most) in boxes {
            let half = DVec3::from_array(half);
            let cuboid = cuboid(half);
            let mut squares = 0.0;
            let mut worst: f64 = 0.0;
            let count = 300;
            for _ in 0..count {
                let mut unit = || DVec3::from_array(std::array::from_fn(|_| 2.0 * rng.f64() - 1.0)).normalize();
                let point = 4.0 * unit();
                let aim = half / half.length() * unit() * 1.1;
                let along = (aim - point).normalize();
                let tangent = 0.005 * 20.0_f64.powf(rng.f64());
                let error = cuboid.blocked(point, along, 1e6, tangent) - counted(half, point, along, tangent);
                squares += error * error;
                worst = worst.max(error.abs());
            }
            let rms = (squares / f64::from(count)).sqrt();
            assert!(rms < most, "{half}: RMS {rms}, at most {worst}");
        }
    }

    /// A plate below a point blocks none of what is above, and a light between plate and point is not hidden.
    #[test]
    fn only_what_stands_between_counts() {
        let cuboid = cuboid(DVec3::new(1.0, 0.02, 1.0));
        let above = DVec3::new(0.2, 0.3, 0.1);
        assert_eq!(cuboid.blocked(above, DVec3::Y, 10.0, 0.01), 0.0);
        assert_eq!(cuboid.blocked(above, -DVec3::Y, 0.2, 0.01), 0.0);
        assert_eq!(cuboid.blocked(above, -DVec3::Y, 10.0, 0.01), 1.0);
    }
}
