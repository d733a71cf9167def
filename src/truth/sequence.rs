//! Low-discrepancy points: the first two dimensions of Sobol's sequence, scrambled by nested uniform (Owen) scrambling,
//! and their maps to disk, hemisphere, cone and sphere.
//!
//! Every power-of-two prefix puts one point into each elementary interval; the error at an edge falls about as n^-3/4,
//! for smooth integrands as n^-3/2. Scrambling by hashes: Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4),
//! 2020, after Laine, Karras 2011.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// A scrambled sequence; different seeds are independent.
#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    seeds: [u32; 2],
}

impl Sequence {
    /// The sequence for a seed and for keys that identify its use.
    pub fn new(seed: u64, keys: [u64; 3]) -> Self {
        let mixed = keys.into_iter().fold(mix(seed), |hash, key| mix(hash ^ mix(key)));
        Sequence { seeds: [mixed as u32, (mixed >> 32) as u32] }
    }

    /// Another sequence, which is independent of this one.
    pub fn other(&self, number: u32) -> Self {
        Sequence::new(self.seed(), [number.into(), 1, 2])
    }

    /// A seed that is this sequence's own.
    pub fn seed(&self) -> u64 {
        u64::from(self.seeds[0]) << 32 | u64::from(self.seeds[1])
    }

    /// Point `index` of the unit square.
    pub fn point(&self, index: u32) -> DVec2 {
        let unit = |bits: u32, seed: u32| (f64::from(scramble(bits, seed)) + 0.5) / 4_294_967_296.0;
        DVec2::new(unit(index.reverse_bits(), self.seeds[0]), unit(second(index), self.seeds[1]))
    }
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Sobol's second dimension: direction numbers of the primitive polynomial x + 1, that is Pascal's triangle modulo 2.
fn second(mut index: u32) -> u32 {
    let mut bits = 0;
    let mut direction = 1_u32 << 31;
    while index != 0 {
        if index & 1 != 0 {
            bits ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    bits
}

/// Nested uniform scrambling of a binary fraction: a bit is flipped by a hash of the bits above it. On reversed bits,
/// carries of a multiplication affect only the bits whose flips may depend on that bit.
fn scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits().wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// Unit square to unit disk, area kept (Shirley, Chiu 1997).
pub fn disk(point: DVec2) -> DVec2 {
    let square = 2.0 * point - 1.0;
    let (radius, angle) = if square.x.abs() > square.y.abs() {
        (square.x, FRAC_PI_4 * (square.y / square.x))
    } else if square.y != 0.0 {
        (square.y, FRAC_PI_2 - FRAC_PI_4 * (square.x / square.y))
    } else {
        return DVec2::ZERO;
    };
    DVec2::new(radius * angle.cos(), radius * angle.sin())
}

/// A frame whose third axis is a given unit vector.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    tangent: DVec3,
    bitangent: DVec3,
    axis: DVec3,
}

impl Axes {
    /// The frame around `axis`.
    pub fn new(axis: DVec3) -> Self {
        let (tangent, bitangent) = axis.any_orthonormal_pair();
        Axes { tangent, bitangent, axis }
    }

    /// A vector by these axes.
    pub fn local(&self, world: DVec3) -> DVec3 {
        DVec3::new(self.tangent.dot(world), self.bitangent.dot(world), self.axis.dot(world))
    }

    /// A vector that is given by these axes.
    pub fn world(&self, local: DVec3) -> DVec3 {
        local.x * self.tangent + local.y * self.bitangent + local.z * self.axis
    }

    /// A direction with density cosine / pi on the hemisphere.
    pub fn cosine(&self, point: DVec2) -> DVec3 {
        let across = disk(point);
        self.world(across.extend((1.0 - across.length_squared()).max(0.0).sqrt()))
    }

    /// A direction of uniform density in the cone of [`cone_solid_angle`] `height` x 2 pi, height being 1 - cosine: 2
    /// is the whole sphere.
    pub fn cone(&self, point: DVec2, height: f64) -> DVec3 {
        // The disk's squared radius is uniform in [0, 1]: it becomes the height.
        let across = disk(point);
        let share = across.length_squared();
        let below = height * share;
        let sine = (below * (2.0 - below)).max(0.0).sqrt();
        let scale = if share > 0.0 { sine / share.sqrt() } else { 0.0 };
        self.world((across * scale).extend(1.0 - below))
    }
}

/// Solid angle of a cone of that height (1 - cosine of the half angle), steradians; at height 2, 4 pi.
pub fn cone_solid_angle(height: f64) -> f64 {
    TAU * height
}

/// Integral of the density of [`Axes::cosine`] against a cosine: pi.
pub const COSINE_INTEGRAL: f64 = PI;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prefix_of_a_power_of_two_is_stratified() {
        for seed in 0..5 {
            let sequence = Sequence::new(seed, [1, 2, 3]);
            for (columns, rows) in [(256, 1), (16, 16), (1, 256), (4, 64)] {
                let mut seen = vec![0; 256];
                for i in 0..256 {
                    let p = sequence.point(i);
                    seen[(p.x * f64::from(columns)) as usize * rows + (p.y * rows as f64) as usize] += 1;
                }
                assert!(seen.iter().all(|n| *n == 1), "seed {seed}, {columns} x {rows}: {seen:?}");
            }
        }
    }

    #[test]
    fn cosine_and_cone_have_their_means() {
        let axis = DVec3::new(0.48, -0.6, 0.64);
        let axes = Axes::new(axis);
        let sequence = Sequence::new(7, [0; 3]);
        let mean = |direction: &dyn Fn(DVec2) -> DVec3| {
            (0..4096).map(|i| direction(sequence.point(i))).sum::<DVec3>() / 4096.0
        };
        // Means: 2/3 under the cosine density, 1 - height / 2 in a cone. Tolerance: twice what 4096 points leave.
        assert!((mean(&|p| axes.cosine(p)) - 2.0 / 3.0 * axis).length() < 1e-4);
        for height in [1e-6, 0.1, 1.0, 2.0] {
            let found = mean(&|p| axes.cone(p, height));
            assert!((found - (1.0 - height / 2.0) * axis).length() < 3e-4, "height {height}: {found}");
            assert!((0..64).all(|i| axes.cone(sequence.point(i), height).dot(axis) >= 1.0 - height - 1e-12));
        }
    }
}
