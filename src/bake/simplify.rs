//! Meshes with fewer triangles for eyes that stand far off, where the difference is a fraction of a texel.
//!
//! A point that is moved by e (in r) is seen moved by at most e / depth of a face's coordinates, and depth is at least
//! distance / sqrt 3 within a face; a face of N texels spans two units. So a mesh may stand for the full one where
//! e <= [`TEXEL_SHARE`] 2 / (sqrt 3 N) times the distance of the nearest surface. The error of each level is not taken from the
//! simplifier, whose quadrics are a mean, but checked both ways against the full mesh.

use super::inside::nearest_on_triangle;
use crate::asset::Mesh;
use glam::{DVec3, IVec3, Vec3};
use meshopt::SimplifyOptions;
use rayon::prelude::*;
use std::collections::HashMap;

/// Largest displacement of what is captured, in texels of a face. A simplified mesh lies mostly within the full one, so that its
/// silhouette shrinks as a whole: a quarter of a texel was seen to change a field of 32-texel faces by .014 (relative root mean
/// square), more than the texels themselves do.
pub const TEXEL_SHARE: f64 = 0.125;
/// Meshes of fewer triangles are captured as they are: far captures of 6 320 triangles take as long as of 854.
const WORTHWHILE_TRIANGLES: usize = 20_000;
/// Distance of the nearest surface, in r, for which the coarsest level is made; each finer one serves a quarter of the distance.
const FARTHEST: f64 = 7.0;
const LEVELS: i32 = 3;
/// Share of the eyes that a level must serve.
const WORTHWHILE_SHARE: f64 = 0.03;

/// A mesh that stands for the full one within `error`.
pub struct Level {
    /// In r from the centre of the full mesh's bounding sphere.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Whether it is closed.
    pub closed: bool,
    /// No point of either surface is farther than this from the other, in r.
    pub error: f64,
}

/// Displacement, in r, that may be seen from a surface's distance (in r) on faces of `face_px`.
pub fn allowed(distance: f64, face_px: u32) -> f64 {
    TEXEL_SHARE * 2.0 / 3.0_f64.sqrt() * distance / f64::from(face_px)
}

/// Levels of a mesh whose positions are given in r, from coarse to fine, each with at most two thirds of the next one's
/// triangles; none for a small mesh.
pub fn levels(positions: &[Vec3], triangles: &[[u32; 3]], eyes: &[Vec3], face_px: u32) -> Vec<Level> {
    let mut levels = Vec::new();
    if triangles.len() < WORTHWHILE_TRIANGLES {
        return levels;
    }
    let (positions, triangles) = weld(positions, triangles);
    let full = Soup::new(&positions, &triangles);
    let mut most = triangles.len();
    // Finest first: a level must be worth its place beside what is finer.
    for level in (0..LEVELS).rev() {
        let distance = FARTHEST / 4.0_f64.powi(level);
        // Within the bounding sphere an eye may be far from the surface too, but few are.
        let served = eyes.iter().filter(|eye| f64::from(eye.length()) - 1.0 >= distance).count();
        if (served as f64) < WORTHWHILE_SHARE * eyes.len() as f64 {
            continue;
        }
        if let Some(found) = simplified(&positions, &triangles, &full, allowed(distance, face_px), 2 * most / 3) {
            most = found.triangles.len();
            levels.push(found);
        }
    }
    levels.reverse();
    levels
}

/// The level that each eye may see, coarsest first: its index, or `None` for the full mesh.
pub fn choose(levels: &[Level], eyes: &[Vec3], face_px: u32) -> Vec<Option<usize>> {
    let soups: Vec<Soup> = levels.iter().map(|level| Soup::new(&level.positions, &level.triangles)).collect();
    let of_eye = |eye: &Vec3| {
        let eye = eye.as_dvec3();
        // The full surface is nearer than the level's by at most its error.
        let may = |(soup, level): (&Soup, &Level)| soup.farther_than(eye, level.error, face_px);
        soups.iter().zip(levels).position(may)
    };
    eyes.par_iter().map(of_eye).collect()
}

/// Joins vertices at one place, which normals or colours keep apart.
fn weld(positions: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut found, mut welded) = (HashMap::new(), Vec::new());
    let index: Vec<u32> = positions
        .iter()
        .map(|p| {
            *found.entry(p.to_array().map(f32::to_bits)).or_insert_with(|| {
                welded.push(*p);
                welded.len() as u32 - 1
            })
        })
        .collect();
    let triangles = triangles.iter().map(|t| t.map(|i| index[i as usize]));
    (welded, triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect())
}

/// The mesh with as few triangles as the error allows, which is checked; `None` where that takes more than `most`.
fn simplified(positions: &[Vec3], triangles: &[[u32; 3]], full: &Soup, error: f64, most: usize) -> Option<Level> {
    let points: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
    // The simplifier's error is a mean over planes; where it is too bold, ask for less.
    for share in [1.0, 0.5, 0.25] {
        let options = SimplifyOptions::ErrorAbsolute;
        let indices: &[u32] = bytemuck::cast_slice(triangles);
        let target = (error * share) as f32;
        let indices = meshopt::simplify_decoder(indices, &points, 0, target, options, None);
        if indices.len() > 3 * most {
            return None;
        }
        if indices.len() < 12 {
            continue;
        }
        let kept: Vec<[u32; 3]> = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let coarse = Soup::new(positions, &kept);
        if coarse.holds(full, error) && full.holds(&coarse, error) {
            let mesh = Mesh::new("level", positions.to_vec(), Vec::new(), None, kept).ok()?;
            let closed = mesh.is_closed();
            return Some(Level { closed, error, positions: mesh.positions, triangles: mesh.triangles });
        }
    }
    None
}

/// Triangles by themselves.
struct Soup(Vec<[DVec3; 3]>);

impl Soup {
    fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        Soup(triangles.iter().map(|t| t.map(|i| positions[i as usize].as_dvec3())).collect())
    }

    /// Whether all points of another surface that are tried lie within `error` of this one: on triangles that are large against
    /// it at distances of a quarter of their edges, on small ones the corners.
    fn holds(&self, other: &Soup, error: f64) -> bool {
        let mean = self.0.iter().map(|[a, b, _]| a.distance(*b)).sum::<f64>() / self.0.len() as f64;
        let cell = (2.0 * mean).max(2.0 * error);
        let at = |p: DVec3| (p / cell).floor().as_ivec3();
        let mut cells: HashMap<IVec3, Vec<u32>> = HashMap::new();
        for (index, corners) in self.0.iter().enumerate() {
            let low = at(corners[0].min(corners[1]).min(corners[2]) - error);
            let high = at(corners[0].max(corners[1]).max(corners[2]) + error);
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        cells.entry(IVec3::new(x, y, z)).or_default().push(index as u32);
                    }
                }
            }
        }
        let near = |p: DVec3| {
            let candidates = cells.get(&at(p)).map_or(&[][..], Vec::as_slice);
            candidates
                .iter()
                .any(|&i| nearest_on_triangle(self.0[i as usize].map(|c| c - p)).length_squared() <= error * error)
        };
        other.0.par_iter().all(|[a, b, c]| {
            let parts = if a.distance(*b).max(a.distance(*c)).max(b.distance(*c)) > error { 4 } else { 1 };
            (0..=parts).all(|i| {
                (0..=parts - i).all(|j| {
                    let (u, v) = (f64::from(i) / f64::from(parts), f64::from(j) / f64::from(parts));
                    near(*a + u * (*b - *a) + v * (*c - *a))
                })
            })
        })
    }

    /// Whether a surface within `error` of this one is so far from `eye` that the error may be.
    fn farther_than(&self, eye: DVec3, error: f64, face_px: u32) -> bool {
        // allowed(d) >= error from this distance on.
        let least = error / allowed(1.0, face_px) + error;
        self.0.iter().all(|t| {
            // The triangle lies within its longest edge of a corner.
            let reach = t[0].distance_squared(t[1]).max(t[0].distance_squared(t[2])).sqrt();
            eye.distance(t[0]) - reach >= least || nearest_on_triangle(t.map(|c| c - eye)).length() >= least
        })
    }
}
