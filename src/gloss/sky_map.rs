//! Distant light as glossy surfaces see it: prefiltered for a set of roughnesses, and its products with spherical
//! harmonics.

use super::brdf;
use super::lobe::{LEVELS, level_alpha};
use crate::asset::environment::Environment;
use crate::field::octahedron::{direction, place};
use crate::sh::basis::values;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Texels along a side of a level. One more on each side continues it, for bilinear reads.
pub const SIDE: usize = 256;
/// Texels along a side that the lobes of levels need, the last one of all further levels; they are filtered so, and
/// interpolated to [`SIDE`].
const SIDES: [usize; 3] = [SIDE, 128, 64];
/// Coefficients of a product's rows and columns: four bands.
pub(super) const COUNT: usize = 16;
/// Texels along a side of the map that is filtered, and of the coarser one that wide lobes take.
const FINE: usize = 128;
const COARSE: usize = 32;
/// Least width of lobes that take the coarser map.
const WIDE: f64 = 0.1;
/// Directions that narrower lobes take.
const SAMPLES: usize = 64;

/// A cell of a map: a direction, its solid angle and the mean radiance within.
#[derive(Clone, Copy)]
struct Cell {
    toward: DVec3,
    solid_angle: f64,
    radiance: DVec3,
}

/// The cells of a map with `side` texels, rows first.
fn cells(environment: &Environment, side: usize) -> Vec<Cell> {
    let at = |x: f64, y: f64| direction(DVec2::new(x, y) / side as f64);
    let cell = |i: usize| {
        let x = (i % side) as f64;
        let y = (i / side) as f64;
        let toward = at(x + 0.5, y + 0.5);
        let quarters = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];
        let radiance = |[u, v]: [f64; 2]| DVec3::from_array(environment.radiance(at(x + u, y + v)));
        // On the octahedron all cells have the same area.
        let flat = toward / toward.abs().element_sum();
        let area = 4.0 * 3.0_f64.sqrt() / (side * side) as f64;
        let height = 1.0 / 3.0_f64.sqrt();
        Cell {
            toward,
            solid_angle: area * height / flat.length().powi(3),
            radiance: quarters.into_iter().map(radiance).sum::<DVec3>() / 4.0,
        }
    };
    (0..side * side).into_par_iter().map(cell).collect()
}

fn coarser(fine: &[Cell]) -> Vec<Cell> {
    let step = FINE / COARSE;
    let cell = |i: usize| {
        let corner = i / COARSE * step * FINE + i % COARSE * step;
        let parts = (0..step * step).map(|k| &fine[corner + k / step * FINE + k % step]);
        let solid_angle: f64 = parts.clone().map(|part| part.solid_angle).sum();
        let toward: DVec3 = parts.clone().map(|part| part.solid_angle * part.toward).sum();
        let light: DVec3 = parts.map(|part| part.solid_angle * part.radiance).sum();
        Cell { toward: toward.normalize(), solid_angle, radiance: light / solid_angle }
    };
    (0..COARSE * COARSE).map(cell).collect()
}

/// What a microfacet reflection of that width sees along its axis, weighed by the cosine.
fn filtered(axis: DVec3, alpha: f64, fine: &[Cell], coarse: &[Cell]) -> DVec3 {
    let mut light = DVec3::ZERO;
    let mut whole = 0.0;
    if alpha >= WIDE {
        for cell in coarse {
            let cosine = axis.dot(cell.toward);
            if cosine > 0.0 {
                let half_z = (0.5 + 0.5 * cosine).sqrt();
                let weight = cell.solid_angle * brdf::distribution(alpha, half_z) * cosine;
                light += weight * cell.radiance;
                whole += weight;
            }
        }
        return light / whole;
    }
    let (across, along) = axis.any_orthonormal_pair();
    for i in 0..SAMPLES {
        let turn = std::f64::consts::TAU * 0.618_034 * i as f64;
        let u = (i as f64 + 0.5) / SAMPLES as f64;
        let local = brdf::reflected(alpha.max(brdf::LEAST_ALPHA), DVec3::Z, u, turn);
        if local.z > 0.0 {
            let at = place(local.x * across + local.y * along + local.z * axis) * FINE as f64;
            let cell = (at.y as usize).min(FINE - 1) * FINE + (at.x as usize).min(FINE - 1);
            light += local.z * fine[cell].radiance;
            whole += local.z;
        }
    }
    light / whole
}

/// A map of `side` texels along a side, and one beyond each, from a function of the direction.
fn level_of(side: usize, radiance: impl Fn(DVec3) -> DVec3 + Sync) -> Vec<DVec3> {
    let wide = side + 2;
    let at = |i: usize| DVec2::new((i % wide) as f64 - 0.5, (i / wide) as f64 - 0.5) / side as f64;
    (0..wide * wide).into_par_iter().map(|i| radiance(direction(at(i)))).collect()
}

/// Such a map in a direction.
fn bilinear(texels: &[DVec3], side: usize, axis: DVec3) -> DVec3 {
    let at = place(axis) * side as f64 + 0.5;
    let low = at.floor().min(DVec2::splat(side as f64));
    let first = low.y as usize * (side + 2) + low.x as usize;
    let along = |row: usize| texels[row].lerp(texels[row + 1], at.x - low.x);
    along(first).lerp(along(first + side + 2), at.y - low.y)
}

/// Distant light as glossy surfaces read it.
pub struct SkyMap {
    /// [`LEVELS`] maps of [`SIDE`] + 2 texels a side, one below the other, over [`SkyMap::scale`]: RGB, and 1.
    pub texels: Vec<[f32; 4]>,
    /// The largest radiance of any colour.
    pub scale: f32,
    /// For each colour the integrals of its radiance times two functions of the basis: 16 rows of 16.
    pub products: Vec<f32>,
}

impl SkyMap {
    /// Filters an environment; its discs are left out, as they are sharp lights.
    pub fn new(environment: &Environment) -> Self {
        if environment.is_none() {
            let texels = vec![[0.0; 4]; LEVELS * (SIDE + 2).pow(2)];
            return SkyMap { texels, scale: 0.0, products: vec![0.0; 3 * COUNT * COUNT] };
        }
        let fine = cells(environment, FINE);
        let coarse = coarser(&fine);
        let level = |level: usize| match level {
            0 => level_of(SIDE, |axis| DVec3::from_array(environment.radiance(axis))),
            _ => {
                let side = SIDES[level.min(SIDES.len() - 1)];
                let texels = level_of(side, |axis| filtered(axis, level_alpha(level as f64), &fine, &coarse));
                level_of(SIDE, |axis| bilinear(&texels, side, axis))
            }
        };
        let levels: Vec<DVec3> = (0..LEVELS).flat_map(level).collect();
        let scale = levels.iter().map(|light| light.max_element()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        SkyMap {
            texels: levels.iter().map(|light| (*light / scale).as_vec3().extend(1.0).to_array()).collect(),
            scale: scale as f32,
            products: products(&fine),
        }
    }
}

fn products(cells: &[Cell]) -> Vec<f32> {
    let mut sums = vec![0.0_f64; 3 * COUNT * COUNT];
    for cell in cells {
        let basis = values(4, cell.toward);
        let light = (cell.solid_angle * cell.radiance).to_array();
        for (of_color, light) in sums.chunks_exact_mut(COUNT * COUNT).zip(light) {
            for (row, y) in of_color.chunks_exact_mut(COUNT).zip(&basis) {
                row.iter_mut().zip(&basis).for_each(|(sum, other)| *sum += light * y * other);
            }
        }
    }
    sums.into_iter().map(|sum| sum as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::environment::EnvironmentData;
    use glam::Vec3;
    use std::f64::consts::PI;

    fn uniform() -> Environment {
        let data = EnvironmentData { uniform: Some(Vec3::new(1.0, 0.5, 0.25)), ..EnvironmentData::default() };
        Environment::new(&data, &|_| unreachable!("no picture")).unwrap()
    }

    #[test]
    fn places_and_directions_are_inverse() {
        for i in 0..200 {
            let z = 1.0 - (f64::from(i) + 0.5) / 100.0;
            let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let toward = DVec3::new(across * cos, z, across * sin);
            assert!((direction(place(toward)) - toward).length() < 1e-9, "{toward}");
        }
    }

    #[test]
    fn cells_cover_the_sphere() {
        let whole: f64 = cells(&uniform(), FINE).iter().map(|cell| cell.solid_angle).sum();
        assert!((whole / (4.0 * PI) - 1.0).abs() < 1e-3, "{whole}");
    }

    /// Beyond its edge a map goes on with the texels that are its neighbours on the sphere.
    #[test]
    fn the_edge_of_a_map_goes_on() {
        for along in [0.1, 0.37, 0.8] {
            for (within, beyond) in [([1e-4, along], [-1e-4, along]), ([along, 1.0 - 1e-4], [along, 1.0 + 1e-4])] {
                let gap = direction(DVec2::from_array(within)).distance(direction(DVec2::from_array(beyond)));
                assert!(gap < 2e-3, "{along}: {gap}");
            }
        }
    }

    #[test]
    fn a_uniform_sky_is_the_same_at_every_level() {
        let map = SkyMap::new(&uniform());
        let scaled = |texel: &[f32; 4]| Vec3::from_slice(texel) * map.scale - Vec3::new(1.0, 0.5, 0.25);
        assert!(map.texels.iter().all(|texel| scaled(texel).abs().max_element() < 1e-5));
        for (i, product) in map.products.iter().enumerate() {
            let [color, row, column] = [i / 256, i / 16 % 16, i % 16];
            let wanted = if row == column { [1.0, 0.5, 0.25][color] } else { 0.0 };
            assert!((product - wanted).abs() < 2e-3, "{color} {row} {column}: {product}");
        }
    }
}
