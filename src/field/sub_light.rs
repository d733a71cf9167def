//! A round light cut into smaller ones, so that several occluders and wide lights come out right.
//!
//! One straight edge before a disc is exact only where the occluder's outline is straight over the whole light, and two occluders
//! multiply only where each blocks its share of every part alike. Both get better as the parts get smaller.

use glam::DVec2;
use std::f64::consts::TAU;

/// Most parts of a light.
pub const MOST: usize = 16;
/// Angular radii in radians, 1 and 15 degrees, up to which a light is 1 part and 7 parts; larger ones are [`MOST`].
const LIMITS_RAD: [f64; 2] = [1.0 * TAU / 360.0, 15.0 * TAU / 360.0];
/// A light whose radius lies this much above a limit has the finer parts alone; between them, both by shares.
const BLEND: f64 = 1.25;

/// Centres of parts on the unit disc; each part is a disc of radius 1 / sqrt(parts).
pub fn centres(parts: usize) -> Vec<DVec2> {
    match parts {
        1 => vec![DVec2::ZERO],
        7 => {
            let ring = (0..6).map(|i| 2.0 / 3.0 * DVec2::from_angle(TAU / 6.0 * f64::from(i)));
            std::iter::once(DVec2::ZERO).chain(ring).collect()
        }
        // Fermat's spiral: equal areas at the golden angle.
        _ => {
            let golden = TAU * (1.0 - 2.0 / (1.0 + 5.0_f64.sqrt()));
            (0..parts)
                .map(|i| ((i as f64 + 0.5) / parts as f64).sqrt() * DVec2::from_angle(golden * i as f64))
                .collect()
        }
    }
}

/// Numbers of parts that a light of this angular radius is computed with, and their weights, which add up to 1: two numbers while
/// one fades into the other, so that nothing jumps as a light comes nearer.
pub fn parts(angle_rad: f64) -> [(usize, f64); 2] {
    let share = |limit: f64| ((angle_rad / limit - 1.0) / (BLEND - 1.0)).clamp(0.0, 1.0);
    let [first, second] = LIMITS_RAD.map(share);
    if second > 0.0 { [(7, 1.0 - second), (MOST, second)] } else { [(1, 1.0 - first), (7, first)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_lie_on_the_disc_around_its_middle() {
        for count in [1, 7, MOST] {
            let centres = centres(count);
            assert_eq!(centres.len(), count);
            let mean = centres.iter().sum::<DVec2>() / count as f64;
            assert!(mean.length() < 0.06, "{count}: {mean}");
            // The mean square of a disc is 1/2; a part adds that of its own disc.
            let spread = centres.iter().map(|c| c.length_squared()).sum::<f64>() / count as f64 + 0.5 / count as f64;
            assert!(count == 1 || (spread - 0.5).abs() < 0.05, "{count}: {spread}");
        }
    }

    #[test]
    fn weights_add_up_and_change_without_a_step() {
        let mut before = parts(0.0);
        // The first ramp is 0.25 degrees wide: 436 of these steps.
        for i in 0..=60_000 {
            let now = parts(f64::from(i) * 1e-5);
            assert!((now[0].1 + now[1].1 - 1.0).abs() < 1e-12);
            let of = |parts: [(usize, f64); 2], n| parts.iter().filter(|p| p.0 == n).map(|p| p.1).sum::<f64>();
            for n in [1, 7, MOST] {
                assert!((of(now, n) - of(before, n)).abs() < 0.01, "{n} parts at step {i}");
            }
            before = now;
        }
    }
}
