//! Fits a lattice to an object that is not round: shells lie about the middle of its box, and its short axes are
//! stretched.
//!
//! The blocked part changes fastest near the surface. Spherical shells about the bounding sphere's centre do not follow
//! most surfaces: the first shell must start where the surface is nearest, so elsewhere shells lie inside the solid.
//! Stretching each axis by the square root of longest edge over edge halves the box's proportions (in logarithms) and
//! costs a lookup three multiply-adds.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Maps a point p (object's frame, in r from the bounding sphere's centre) to (p - centre) * stretch in the lattice's
/// space, in which directions and distances are measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Centre of the shells in r from the bounding sphere's centre, a multiple of 1/1024.
    pub centre: [f64; 3],
    /// Factor of each axis, 1 to 2, a multiple of 1/64, so that three factors fit one f32 ([`Fit::packed`]).
    pub stretch: [f64; 3],
}

/// A box thinner than this share of its longest edge is a sheet and is not stretched: captures on its two sides differ
/// however near they are.
const SHEET: f64 = 0.02;

impl Fit {
    /// No fit: spherical shells about the bounding sphere's centre.
    pub const ROUND: Fit = Fit { centre: [0.0; 3], stretch: [1.0; 3] };

    pub const MOST: f64 = 2.0;

    /// The fit of a mesh, whose positions are in r from the bounding sphere's centre: the middle of its box, and the
    /// square root of longest edge over edge. A ball and a cube keep spherical shells.
    pub fn new(positions: &[Vec3]) -> Self {
        let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
        let low = low.as_dvec3();
        let high = high.as_dvec3();
        let size = high - low;
        let middle = (high + low) / 2.0;
        let longest = size.max_element();
        if !(size.min_element() > SHEET * longest && longest.is_finite()) {
            return Fit::ROUND;
        }
        let to = |x: f64, steps: f64| (x * steps).round() / steps;
        Fit {
            centre: middle.to_array().map(|c| to(c, 1024.0)),
            stretch: size.to_array().map(|s| to((longest / s).sqrt().min(Fit::MOST), 64.0)),
        }
    }

    /// From the object's frame to the lattice's space.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        (p - DVec3::from(self.centre)) * DVec3::from(self.stretch)
    }

    /// From the lattice's space to the object's frame.
    pub fn invert(&self, q: DVec3) -> DVec3 {
        q / DVec3::from(self.stretch) + DVec3::from(self.centre)
    }

    /// Whether the numbers have the range and steps that [`Fit::new`] produces.
    pub fn is_usable(&self) -> bool {
        self.centre.iter().all(|c| c.abs() <= 1.0) && self.stretch.iter().all(|s| (1.0..=Fit::MOST).contains(s))
    }

    /// For a shader: x, y, z are added after stretching; w holds the three factors, in 64ths above 1, as one whole
    /// number.
    pub fn packed(&self) -> [f32; 4] {
        let shift = -DVec3::from(self.centre) * DVec3::from(self.stretch);
        let [x, y, z] = self.stretch.map(|s| ((s - 1.0) * 64.0).round() as u32);
        shift.as_vec3().extend((x | y << 7 | z << 14) as f32).to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(middle: Vec3, half: Vec3) -> Vec<Vec3> {
        let sign = |bit: usize, i: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        (0..8).map(|i| middle + half * Vec3::new(sign(0, i), sign(1, i), sign(2, i))).collect()
    }

    #[test]
    fn cubes_and_sheets_stay_round() {
        for half in [Vec3::ONE, Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.01, 1.0)] {
            assert_eq!(Fit::new(&cuboid(Vec3::ZERO, half)), Fit::ROUND, "{half}");
        }
        assert_eq!(Fit::new(&[]), Fit::ROUND);
    }

    #[test]
    fn half_of_a_boxs_proportions_is_taken_away() {
        let middle = Vec3::new(0.0, 0.3, -0.1);
        let fit = Fit::new(&cuboid(middle, Vec3::new(0.8, 0.4, 0.1)));
        assert_eq!(fit.stretch, [1.0, 1.421875, 2.0], "square roots of 2 and of 8, at most 2, in steps of 1/64");
        assert!(fit.apply(middle.as_dvec3()).length() < 2e-3, "to 1/1024 a component");
        let p = DVec3::new(0.3, -0.2, 0.9);
        assert!((fit.invert(fit.apply(p)) - p).length() < 1e-15);
        // The shader's reading of the packed numbers.
        let [x, y, z, packed] = fit.packed();
        let steps = [packed as u32 & 127, packed as u32 >> 7 & 127, packed as u32 >> 14].map(f64::from);
        let found = p * (1.0 + DVec3::from(steps) / 64.0) + Vec3::new(x, y, z).as_dvec3();
        assert!((found - fit.apply(p)).length() < 1e-6);
        assert!(fit.is_usable() && !Fit { stretch: [1.0, 3.0, 1.0], ..fit }.is_usable());
    }
}
