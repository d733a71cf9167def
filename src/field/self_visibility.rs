//! Self-visibility: what a vertex sees past its own mesh, or its own group, for lights too small for four SH bands.
//!
//! Every vertex has a map of [`SIDE`] x [`SIDE`] nodes over the hemisphere about its normal, two bytes each. One is the
//! angle from the node's direction to the nearest edge of what the vertex sees past its own mesh, positive where that
//! direction is free. The other is how far away the mesh is there, or at that edge where the direction is free: what
//! lies beyond a light leaves it free. A lookup is bilinear, and the edge counts as straight over a small light
//! ([`blocked_share`]).
//!
//! A direction's place on the map is that of the octahedron |x| + |y| + z = 1, unfolded to a square and enlarged by 1 /
//! [`RIM`]. Light that comes from lower than the square's rim, 12 to 17 degrees above the horizon, reads the rim: the
//! cosine makes it small, and the nodes serve better higher up.
//!
//! Direct light of the teapot's vertices is wrong by 0.046 under lights of 1 degree and by 0.009 under lights of 30
//! degrees: root mean square against rays, over that of the unoccluded light (`tests/gpu/self_visibility.rs`). SH
//! transfer of 4 bands gives 0.144 and 0.040. A rim on the horizon, or an equal-area square, gives larger errors. With 8
//! nodes a side the teapot's errors are 0.062 and 0.012, and those of a room of one mesh, lit through its window, 0.15 in
//! place of 0.060; 16 a side leave 0.060 in twice the memory.

use super::silhouette::{blocked_share, decode, encode};
use glam::{DMat3, DVec2, DVec3};

/// Nodes along an edge of a map.
pub const SIDE: usize = 12;
pub const NODES: usize = SIDE * SIDE;
/// Bytes of a map: the angles of all nodes, row by row, and then the distances.
pub const BYTES: usize = 2 * NODES;
/// Steps of a distance's byte an octave: 4.4 % each.
pub const DISTANCE_STEPS: f64 = 16.0;
/// The octave, of r, at which distances begin: from 1/32 r to beyond 2 000 r, since what hides a light may be any member
/// of the vertex's group.
pub const DISTANCE_FIRST: f64 = -5.0;
/// How much nearer than a light, in octaves, the mesh has to be to block it whole; where it is not nearer it leaves the
/// light free, as the ceiling does that a lamp hangs from. More than a step of a distance's byte.
pub const RAMP: f64 = 0.07;
/// Cells of a map: the squares between four nodes.
pub const CELLS: usize = (SIDE - 1) * (SIDE - 1);
/// Largest angle from an edge that a map holds, 45 degrees: steps of 0.35 degrees.
pub const LIMIT_RAD: f64 = std::f64::consts::FRAC_PI_4;
/// Half the edge of the part of the octahedron's square that a map covers, where 1 reaches the horizon.
pub const RIM: f64 = 0.82;
/// Least radius of a light, so that one of no size divides by more than 0.
const RADIUS_MINIMUM_RAD: f64 = 1e-6;

/// The axes of a vertex's hemisphere in the object's frame, as columns: tangent, bitangent, and the normal itself.
///
/// Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin, *Building an Orthonormal Basis, Revisited*, JCGT 6(1),
/// 2017. The axes jump where the normal's z changes its sign, so a lookup needs the very normal that the bake had.
pub fn frame(normal: DVec3) -> DMat3 {
    let sign = if normal.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    DMat3::from_cols(tangent, DVec3::new(b, sign + normal.y * normal.y * a, -normal.y), normal)
}

/// Length by the octahedron |x| + |y| + z = 1 (z along the normal). What a map has of distances is in this measure: over a
/// plane its reciprocal is linear on the map but for the octahedron's edges, so that it is blended exactly.
pub fn octahedral(local: DVec3) -> f64 {
    local.x.abs() + local.y.abs() + local.z.max(0.0)
}

/// Place of a direction (any length but 0; z along the normal) on the map: nodes lie at whole numbers from 0 to SIDE -
/// 1, which the place never leaves.
pub fn place(local: DVec3) -> DVec2 {
    let flat = local.truncate() / octahedral(local).max(1e-20);
    let square = DVec2::new(flat.x + flat.y, flat.x - flat.y) / RIM;
    (square.clamp(DVec2::NEG_ONE, DVec2::ONE) + 1.0) * (0.5 * (SIDE - 1) as f64)
}

/// Unit direction of a node, 0 to NODES - 1, row by row; z along the normal.
pub fn node_direction(node: usize) -> DVec3 {
    let place = DVec2::new((node % SIDE) as f64, (node / SIDE) as f64);
    let square = (place * (2.0 / (SIDE - 1) as f64) - 1.0) * RIM;
    let flat = DVec2::new(square.x + square.y, square.x - square.y) / 2.0;
    flat.extend(1.0 - flat.x.abs() - flat.y.abs()).normalize()
}

pub fn encode_angle(angle_rad: f64) -> u8 {
    encode(angle_rad, LIMIT_RAD)
}

pub fn decode_angle(byte: u8) -> f64 {
    decode(byte, LIMIT_RAD)
}

/// Rounded up, so that nothing comes to lie nearer than a lamp that it is behind.
pub fn encode_distance(distance: f64) -> u8 {
    ((distance.log2() - DISTANCE_FIRST) * DISTANCE_STEPS).ceil().clamp(0.0, 255.0) as u8
}

/// Base-2 logarithm of a byte's distance in r.
pub fn decode_distance(byte: u8) -> f64 {
    f64::from(byte) / DISTANCE_STEPS + DISTANCE_FIRST
}

/// The map of [`BYTES`] in a direction (z along the normal): the signed angle in radians to the edge of the part that
/// the vertex sees, and the base-2 logarithm of the octahedral distance in r to the surface that hides the rest.
pub fn lookup(map: &[u8], local: DVec3) -> [f64; 2] {
    let place = place(local);
    let cell = place.floor().min(DVec2::splat((SIDE - 2) as f64));
    let within = place - cell;
    let node = |i, j| (cell.y as usize + j) * SIDE + cell.x as usize + i;
    let near = |i, j| (-decode_distance(map[NODES + node(i, j)])).exp2();
    let corner = |i, j| DVec2::new(decode_angle(map[node(i, j)]), near(i, j));
    let row = |j| corner(0, j) * (1.0 - within.x) + corner(1, j) * within.x;
    let [angle, near] = (row(0) * (1.0 - within.y) + row(1) * within.y).to_array();
    [angle, -near.log2()]
}

/// Share of a round light that the mesh itself leaves free: 0 to 1. `map` has the vertex's [`BYTES`]; its normal and
/// the light's unit direction are in the object's frame, the normal as the mesh has it. The light's radius spans
/// `radius_rad`; it should be small, or one part of a light ([`super::sub_light`]). It is `distance` away, in r. What
/// the horizon leaves of it is the cosine's affair.
pub fn visible(map: &[u8], normal: DVec3, direction: DVec3, radius_rad: f64, distance: f64) -> f64 {
    let local = frame(normal).transpose() * direction;
    let [angle, away] = lookup(map, local);
    let blocks = (((distance * octahedral(local)).log2() - away) / RAMP).clamp(0.0, 1.0);
    1.0 - (1.0 - blocked_share(angle / radius_rad.max(RADIUS_MINIMUM_RAD))) * blocks
}

/// Writes a map of [`BYTES`] as `glsl/self_visibility.glsl` reads it: two words for each of [`CELLS`], row by row, with
/// the angles and the distances of its corners (0, 0), (1, 0), (0, 1) and (1, 1), the first in the lowest bits.
pub fn write_cells(map: &[u8], cells: &mut [[u32; 2]]) {
    let word = |above: &[u8], below: &[u8]| u32::from_le_bytes([above[0], above[1], below[0], below[1]]);
    for (word_of_cell, nodes) in map.chunks_exact(NODES).enumerate() {
        for (y, row) in cells.chunks_exact_mut(SIDE - 1).enumerate() {
            let nodes = nodes[y * SIDE..][..2 * SIDE].split_at(SIDE);
            for (cell, (above, below)) in row.iter_mut().zip(nodes.0.windows(2).zip(nodes.1.windows(2))) {
                cell[word_of_cell] = word(above, below);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sh::quadrature::random_direction;

    #[test]
    fn frames_are_right_handed_for_every_normal() {
        let mut rng = fastrand::Rng::with_seed(5);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_Z, DVec3::new(0.0, 0.0, -0.0)];
        let close_to_pole = DVec3::new(1e-9, -1e-9, -1.0);
        for normal in
            (0..1000).map(|_| random_direction(&mut rng)).chain([close_to_pole]).chain(axes.into_iter().take(4))
        {
            let frame = frame(normal);
            assert!((frame.transpose() * frame).abs_diff_eq(DMat3::IDENTITY, 1e-9), "{normal}: {frame}");
            assert!(frame.determinant() > 0.0, "{normal}");
        }
        assert!(frame(axes[4]).is_finite(), "a normal of no length");
    }

    #[test]
    fn directions_and_places_are_inverse() {
        for node in 0..NODES {
            let there = place(3.0 * node_direction(node));
            let wanted = DVec2::new((node % SIDE) as f64, (node / SIDE) as f64);
            assert!(there.abs_diff_eq(wanted, 1e-12), "{node}: {there}");
            assert!(node_direction(node).z > 0.2, "{node} stands above the horizon");
        }
        // The rim, a direction below the horizon, and the two for which the octahedron has no place.
        let all = DVec2::splat((SIDE - 1) as f64);
        for local in [DVec3::X, DVec3::new(0.6, -0.3, -4.0), DVec3::NEG_Z, DVec3::ZERO] {
            let place = place(local);
            assert!(place.cmpge(DVec2::ZERO).all() && place.cmple(all).all(), "{local}: {place}");
        }
    }

    #[test]
    fn cells_hold_the_corners_that_a_lookup_blends() {
        let mut rng = fastrand::Rng::with_seed(6);
        let map: Vec<u8> = (0..BYTES).map(|_| rng.u8(..)).collect();
        let mut cells = [[0; 2]; CELLS];
        write_cells(&map, &mut cells);
        for _ in 0..1000 {
            let local = random_direction(&mut rng);
            let place = place(local);
            let cell = place.floor().min(DVec2::splat((SIDE - 2) as f64));
            let [angles, distances] = cells[cell.y as usize * (SIDE - 1) + cell.x as usize].map(u32::to_le_bytes);
            let within = place - cell;
            let blend = |[a, b, c, d]: [f64; 4]| {
                (a + (b - a) * within.x) * (1.0 - within.y) + (c + (d - c) * within.x) * within.y
            };
            let near = blend(distances.map(|byte| (-decode_distance(byte)).exp2()));
            let wanted = [blend(angles.map(decode_angle)), -near.log2()];
            assert!(lookup(&map, local).iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-12));
        }
    }

    #[test]
    fn a_light_of_no_size_is_seen_or_not() {
        let free = map(0.3, 0.0);
        let blocked = map(-0.3, 0.0);
        for radius in [0.0, 1e-300, 0.1] {
            assert_eq!(visible(&free, DVec3::Y, DVec3::Y, radius, 1.0), 1.0);
            assert_eq!(visible(&blocked, DVec3::Y, DVec3::Y, radius, 1.0), 0.0);
        }
        assert_eq!(visible(&[0; BYTES], DVec3::Y, DVec3::new(0.3, 1.0, 0.2), 0.1, 1.0), 0.5);
    }

    fn map(angle_rad: f64, distance: f64) -> [u8; BYTES] {
        let bytes = [encode_angle(angle_rad), encode_distance(distance)];
        std::array::from_fn(|i| bytes[i / NODES])
    }

    #[test]
    fn distances_are_rounded_up_to_a_step() {
        for distance in [0.04, 0.3, 1.0, 17.0, 1500.0_f64] {
            let found = decode_distance(encode_distance(distance)) - distance.log2();
            assert!((0.0..1.0 / DISTANCE_STEPS).contains(&found), "{distance}: {found} octaves");
        }
        assert_eq!([encode_distance(0.0), encode_distance(f64::INFINITY)], [0, 255]);
    }

    #[test]
    fn what_lies_beyond_a_light_leaves_it_free() {
        let map = map(-0.3, 8.0);
        let sees = |distance| visible(&map, DVec3::Y, DVec3::Y, 0.1, distance);
        assert_eq!([5.0, 7.99, 8.41, 10.0, f64::INFINITY].map(sees), [1.0, 1.0, 0.0, 0.0, 0.0]);
        assert!((sees(8.2) - 0.5).abs() < 0.02);
    }
}
