//! The reflection of distant light by three taps: a table over roughness and the angle of the view.
//!
//! The lobe is cut across the plane of incidence into three parts that reflect the same. Each part becomes a tap: the
//! mean direction of its light, and the symmetric lobe of the prefiltered map that has the same mean cosine. So the
//! taps keep the lobe's energy and its first moment.

use super::brdf::{self, sampled_lobe};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Entries of the table along roughness and along the angle of the view.
pub const TABLE: usize = 24;
/// Taps of a reflection.
pub const TAPS: usize = 3;
/// Levels of the prefiltered map.
pub const LEVELS: usize = 8;
/// Cosine of the view from which on the lobe's parts become one.
const ROUND: f64 = 0.8;
/// Slopes and azimuths of the rule that integrates a lobe. Doubling both changes no energy by more than 0.004.
const RULE: [usize; 2] = [32, 24];

/// A tap, in the plane of incidence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tap {
    /// Its angle to the normal less that of the mirrored view, over alpha.
    pub shift: f64,
    /// Level of the prefiltered map, 0 to [`LEVELS`] - 1.
    pub level: f64,
    /// What it reflects of unit light, of a unit Fresnel factor.
    pub weight: f64,
    /// Coefficients of its lobe in bands 1 to 3, over that of band 0 and the root of 2 l + 1: means of the Legendre
    /// polynomials.
    pub bands: [f64; 3],
}

/// What one entry of the table holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lobe {
    /// From the normal to the surface.
    pub taps: [Tap; TAPS],
    /// What is reflected of unit light from everywhere, weighed by Schlick's term.
    pub grazing: f64,
}

/// The width of slopes at a level of the map.
pub fn level_alpha(level: f64) -> f64 {
    let share = level / (LEVELS - 1) as f64;
    share * share
}

/// Means of the Legendre polynomials 1 to 3 of the cosine to the axis, over the lobe of the map: a microfacet reflection
/// seen along the normal, weighed by the cosine.
fn map_bands(alpha: f64) -> [f64; 3] {
    let mut sums = [0.0; 4];
    for i in 0..256 {
        let light = brdf::reflected(alpha, DVec3::Z, (f64::from(i) + 0.5) / 256.0, 0.0);
        let c = light.z.max(0.0);
        let legendre = [1.0, c, 1.5 * c * c - 0.5, 2.5 * c * c * c - 1.5 * c];
        sums.iter_mut().zip(legendre).for_each(|(sum, p)| *sum += c * p);
    }
    [1, 2, 3].map(|l| sums[l] / sums[0])
}

/// Means of the map's lobes at finely spaced levels.
static MAP_BANDS: LazyLock<Vec<[f64; 3]>> =
    LazyLock::new(|| (0..=256).map(|i| map_bands(brdf::LEAST_ALPHA.max((f64::from(i) / 256.0).powi(2)))).collect());

/// The level whose lobe has a mean cosine, and its means.
fn level_of_mean(cosine: f64) -> (f64, [f64; 3]) {
    let bands = &*MAP_BANDS;
    let at = bands.partition_point(|means| means[0] > cosine).min(bands.len() - 1);
    ((LEVELS - 1) as f64 * at as f64 / (bands.len() - 1) as f64, bands[at])
}

impl Lobe {
    /// What it reflects of unit light from everywhere, of a unit Fresnel factor.
    fn energy(&self) -> f64 {
        self.taps.iter().map(|tap| tap.weight).sum()
    }

    /// The lobe of a roughness, seen at a cosine to the normal.
    pub fn new(roughness: f64, view_z: f64) -> Self {
        let alpha = brdf::alpha(roughness);
        let view = DVec3::new((1.0 - view_z * view_z).max(0.0).sqrt(), 0.0, view_z);
        let [slopes, azimuths] = RULE;
        let mut samples = Vec::with_capacity(slopes * azimuths);
        let mut grazing = 0.0;
        for (i, j) in (0..slopes).flat_map(|i| (0..azimuths).map(move |j| (i, j))) {
            let u = (i as f64 + 0.5) / slopes as f64;
            // The lobe is the same on both sides of the plane of incidence.
            let light = brdf::reflected(alpha, view, u, PI * (j as f64 + 0.5) / azimuths as f64);
            let [value, schlick] = sampled_lobe(alpha, view, light).map(|part| part / (slopes * azimuths) as f64);
            if value > 0.0 {
                grazing += value * schlick * (slopes * azimuths) as f64;
                samples.push((f64::atan2(-light.x, light.z), value, light));
            }
        }
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let whole: f64 = samples.iter().map(|(_, value, _)| value).sum();
        let mut parts = [(0.0, DVec2::ZERO); TAPS];
        let mut before = 0.0;
        for (_, value, light) in &samples {
            let part = (TAPS as f64 * (before + 0.5 * value) / whole) as usize;
            let (sum, direction) = &mut parts[part.min(TAPS - 1)];
            *sum += value;
            *direction += *value * DVec2::new(-light.x, light.z);
            before += value;
        }
        // Seen along the normal the lobe has no plane of incidence: the parts become one, or the plane's turn would show.
        let even = ((view_z - ROUND) / (1.0 - ROUND)).clamp(0.0, 1.0).powi(2);
        let moment: DVec2 = parts.iter().map(|(_, sum)| *sum).sum();
        let mirrored = view.x.atan2(view.z);
        let taps = parts.map(|(weight, sum)| {
            let sum = sum.lerp(moment * (weight / whole), even);
            if weight <= 0.0 {
                return Tap::default();
            }
            let (level, bands) = level_of_mean(sum.length() / weight);
            Tap { shift: (sum.x.atan2(sum.y) - mirrored) / alpha, level, weight, bands }
        });
        Lobe { taps, grazing }
    }
}

/// The cosine of a column: dense where the view grazes.
fn column_cosine(column: usize) -> f64 {
    let root = column as f64 / (TABLE - 1) as f64;
    (1.0 - root * root).max(1e-3)
}

/// All entries, roughness by roughness.
static LOBES: LazyLock<Vec<Lobe>> = LazyLock::new(|| {
    let entry = |i: usize| Lobe::new((i / TABLE) as f64 / (TABLE - 1) as f64, column_cosine(i % TABLE));
    (0..TABLE * TABLE).into_par_iter().map(entry).collect()
});

/// What the lobe of a roughness reflects of unit light from everywhere, seen at a cosine to the normal; interpolated as
/// shaders do.
pub fn energy(roughness: f64, view_z: f64) -> f64 {
    let last = (TABLE - 1) as f64;
    let [row, column] = [roughness, (1.0 - view_z).max(0.0).sqrt()].map(|at| at.clamp(0.0, 1.0) * last);
    let [low, left] = [row, column].map(|at| (at as usize).min(TABLE - 2));
    let [up, right] = [row - low as f64, column - left as f64];
    let of = |row: usize, column: usize| LOBES[row * TABLE + column].energy();
    let along = |row: usize| (1.0 - right) * of(row, left) + right * of(row, left + 1);
    (1.0 - up) * along(low) + up * along(low + 1)
}

/// What the lobe of a roughness reflects of unit light from everywhere, in the mean over all views weighed by their
/// cosine.
pub fn mean_energy(roughness: f32) -> f32 {
    let row = |row: usize| {
        let mut sums = [0.0; 2];
        for column in 0..TABLE {
            // Columns are even in the root of 1 - cosine, so that each stands for that root times twice a step.
            let cosine = column_cosine(column);
            let weight = cosine * (1.0 - cosine).sqrt();
            sums[0] += weight * LOBES[row * TABLE + column].energy();
            sums[1] += weight;
        }
        sums[0] / sums[1]
    };
    let at = f64::from(roughness) * (TABLE - 1) as f64;
    let below = (at as usize).min(TABLE - 2);
    let share = at - below as f64;
    ((1.0 - share) * row(below) + share * row(below + 1)) as f32
}

/// The table as texels of four numbers, [`TABLE`] wide: for each tap the rows of shift, level, weight and what is
/// reflected by Schlick's term, then for each tap the rows of its three bands.
pub fn texels() -> Vec<[f32; 4]> {
    let rows = |texel: fn(&Lobe, &Tap) -> [f64; 4]| {
        let of_tap = move |k: usize| LOBES.iter().map(move |lobe| texel(lobe, &lobe.taps[k]).map(|x| x as f32));
        (0..TAPS).flat_map(of_tap)
    };
    let of_taps = rows(|lobe, tap| [tap.shift, tap.level, tap.weight, lobe.grazing]);
    let of_bands = rows(|_, tap| [tap.bands[0], tap.bands[1], tap.bands[2], 0.0]);
    of_taps.chain(of_bands).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a lobe reflects, and what it reflects by Schlick's term, by a rule of its own: the hemisphere of lights.
    fn by_lights(roughness: f64, view_z: f64) -> [f64; 2] {
        let alpha = brdf::alpha(roughness);
        let view = DVec3::new((1.0 - view_z * view_z).sqrt(), 0.0, view_z);
        let count = 400;
        let mut sums = [0.0; 2];
        for (i, j) in (0..count).flat_map(|i| (0..2 * count).map(move |j| (i, j))) {
            let z = (f64::from(i) + 0.5) / f64::from(count);
            let (sin, cos) = (PI * (f64::from(j) + 0.5) / f64::from(count)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let [value, schlick] = brdf::lobe(alpha, view, DVec3::new(across * cos, across * sin, z));
            let area = 2.0 * PI / f64::from(count) / f64::from(2 * count);
            sums[0] += area * value;
            sums[1] += area * value * schlick;
        }
        sums
    }

    /// Direction of a tap for a view at an angle to the normal, by the axes of the plane of incidence: away from the
    /// view, and along the normal.
    fn direction(tap: &Tap, alpha: f64, view_rad: f64) -> DVec2 {
        let (sin, cos) = (view_rad + alpha * tap.shift).sin_cos();
        DVec2::new(sin, cos.max(0.0)).normalize_or(DVec2::Y)
    }

    #[test]
    fn lobes_reflect_as_much_as_the_integral_over_all_lights() {
        for (roughness, view_z) in [(0.4, 0.9), (0.5, 0.3), (0.7, 0.6), (1.0, 0.95), (1.0, 0.2), (0.85, 0.05)] {
            let [energy, schlick] = by_lights(roughness, view_z);
            let lobe = Lobe::new(roughness, view_z);
            let found = lobe.energy();
            assert!((found - energy).abs() < 0.01, "{roughness} {view_z}: {found}, not {energy}");
            assert!((lobe.grazing - schlick).abs() < 0.005, "{roughness} {view_z}: {}, not {schlick}", lobe.grazing);
            assert!(energy < 1.0 && lobe.grazing < found);
        }
    }

    #[test]
    fn a_mirror_has_its_taps_where_the_view_is_mirrored() {
        let lobe = Lobe::new(0.0, 0.6);
        assert!((lobe.energy() - 1.0).abs() < 0.01, "{}", lobe.energy());
        for tap in &lobe.taps {
            let direction = direction(tap, brdf::LEAST_ALPHA, f64::acos(0.6));
            assert!((direction - DVec2::new(0.8, 0.6)).length() < 0.02, "{direction}");
            assert!(tap.level < 1.0, "{}", tap.level);
        }
    }

    /// The taps' first moment is the lobe's, since each has the mean direction and the mean cosine of its part.
    #[test]
    fn taps_keep_the_moment_of_the_lobe() {
        for (roughness, view_z) in [(0.5, 0.3), (0.8, 0.8), (1.0, 0.5)] {
            let lobe = Lobe::new(roughness, view_z);
            let alpha = brdf::alpha(roughness);
            let all = lobe.taps.iter().map(|tap| tap.weight * tap.bands[0] * direction(tap, alpha, f64::acos(view_z)));
            let moment: DVec2 = all.sum();
            let view = DVec3::new((1.0 - view_z * view_z).sqrt(), 0.0, view_z);
            let mut wanted = DVec2::ZERO;
            for (i, j) in (0..300).flat_map(|i| (0..300).map(move |j| (i, j))) {
                let light =
                    brdf::reflected(alpha, view, (f64::from(i) + 0.5) / 300.0, PI * (f64::from(j) + 0.5) / 300.0);
                let [value, _] = sampled_lobe(alpha, view, light);
                wanted += value / 9e4 * DVec2::new(-light.x, light.z);
            }
            assert!((moment - wanted).length() < 0.02, "{roughness} {view_z}: {moment}, not {wanted}");
        }
    }
}
