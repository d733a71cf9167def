//! Sky views: how much of the sky a vertex sees by direction, finer than its transfer vector tells.
//!
//! A transfer vector meets a sky that four bands have blurred. Under the open sky the cosine blurs it as much. Through a
//! window, however, a wall sees only the sky above the horizon, and a ceiling only the ground: the blur carries light from
//! one to the other. So surfaces at rest keep the shares of their view by cells of direction, and their transfer vectors
//! are fitted to the sky of the scene: they meet the blurred sky in the light that comes from the exact one. Shaders know
//! nothing of it, and what moves still dims that light by its bands.

use crate::sh::basis::{MAX_COEFFICIENTS, coefficient_count};
use crate::sh::rotation::Rotation;
use glam::{DMat3, DQuat, DVec3, Vec3A};
use std::f64::consts::PI;

/// Rows of equal height, the horizon between two of them, and columns of each.
const ROWS: usize = 16;
const COLUMNS: usize = 16;
pub const CELLS: usize = ROWS * COLUMNS;
/// Directions along both sides of a cell over which its radiance is averaged.
const STEPS: usize = 8;
/// The most of the cosine-weighted hemisphere that is kept of a cell; the largest cell has 0.6 of it.
const MOST_SHARE: f32 = 1.0 / 32.0;
/// Bounds of the factor on a transfer vector; the rest of the light is added in the sky's own shape.
const FACTORS: [f64; 2] = [0.5, 2.0];
/// Of the mean square of the sky's three colours: skies that are nearly gray tell little of differences between them.
const GRAY: f64 = 1e-5;
/// What stands for it where the sky is black.
const LEAST_SQUARE: f64 = 1e-100;

/// The number of the cell of a direction, of any length but 0. The turn about +y goes by |x| + |z|.
pub fn cell(toward: Vec3A) -> usize {
    let height = 0.5 + 0.5 * toward.y / toward.length();
    let across = (toward.x.abs() + toward.z.abs()).max(f32::MIN_POSITIVE);
    let x = toward.x / across;
    let turn = if toward.z >= 0.0 { 1.0 - x } else { 3.0 + x };
    let place = |share: f32, count: usize| ((share * count as f32) as usize).min(count - 1);
    place(height, ROWS) * COLUMNS + place(turn / 4.0, COLUMNS)
}

/// A unit direction of a cell, from its place along both sides, and what the direction weighs.
fn toward(cell: usize, [along, up]: [f64; 2]) -> (DVec3, f64) {
    let turn = 4.0 * ((cell % COLUMNS) as f64 + along) / COLUMNS as f64;
    let x = if turn < 2.0 { 1.0 - turn } else { turn - 3.0 };
    let z = (1.0 - x.abs()) * if turn < 2.0 { 1.0 } else { -1.0 };
    let y = 2.0 * ((cell / COLUMNS) as f64 + up) / ROWS as f64 - 1.0;
    let flat = (1.0 - y * y).sqrt() / x.hypot(z);
    (DVec3::new(flat * x, y, flat * z), 1.0 / (x * x + z * z))
}

/// Shares by cell as they are kept: the number of each cell that has any, and its share's root, which keeps small ones to a
/// few per cent.
pub fn pack(shares: &[f32; CELLS]) -> Vec<[u8; 2]> {
    let root = |share: &f32| (255.0 * (share / MOST_SHARE).sqrt()).round() as u8;
    let packed = shares.iter().enumerate().map(|(cell, share)| [cell as u8, root(share)]);
    packed.filter(|[_, root]| *root > 0).collect()
}

fn unpack(root: u8) -> f64 {
    f64::from(MOST_SHARE) * (f64::from(root) / 255.0).powi(2)
}

/// What the vertices of a surface see of the sky, one after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkyViews {
    /// Whether the cells are of the world, as those of a group; else of a mesh that stands alone.
    pub of_world: bool,
    /// Cells of each vertex.
    pub counts: Vec<u8>,
    pub cells: Vec<[u8; 2]>,
}

impl SkyViews {
    pub fn push(&mut self, cells: &[[u8; 2]]) {
        // A hemisphere meets about half of all cells.
        let cells = &cells[..cells.len().min(usize::from(u8::MAX))];
        self.counts.push(cells.len() as u8);
        self.cells.extend_from_slice(cells);
    }
}

/// A sky to which transfer vectors are fitted.
pub struct SkyFit {
    bands: usize,
    /// Mean radiance of each cell.
    cells: Vec<DVec3>,
    /// Projections of red, green and blue on SH: the blurred sky.
    blurred: [Vec<f64>; 3],
}

impl SkyFit {
    /// `turn`: from the frame of the views' cells to that of the sky.
    pub fn new(radiance: &dyn Fn(DVec3) -> DVec3, blurred: [Vec<f64>; 3], turn: DQuat) -> Self {
        let bands = blurred[0].len().isqrt();
        let mean = |cell: usize| {
            let mut sum = DVec3::ZERO;
            let mut whole = 0.0;
            for step in 0..STEPS * STEPS {
                let place = [step % STEPS, step / STEPS].map(|at| (at as f64 + 0.5) / STEPS as f64);
                let (toward, weight) = toward(cell, place);
                sum += weight * radiance(turn * toward);
                whole += weight;
            }
            sum / whole
        };
        SkyFit { bands, cells: (0..CELLS).map(mean).collect(), blurred }
    }

    /// Fits transfer vectors of `stride` floats each, in the order of the views. `turn`: from their frame to the sky's.
    pub fn fit(&self, views: &SkyViews, turn: DQuat, transfers: &mut [f32], stride: usize) {
        let rotation = Rotation::new(self.bands, turn.inverse());
        let mut blurred = [DVec3::ZERO; MAX_COEFFICIENTS];
        for (axis, channel) in self.blurred.iter().enumerate() {
            let mut turned = [0.0; MAX_COEFFICIENTS];
            rotation.apply(channel, &mut turned);
            blurred.iter_mut().zip(turned).for_each(|(to, from)| to[axis] = from);
        }
        let blurred = &blurred[..coefficient_count(self.bands)];
        // The least change of a vector that adds given amounts of the three colours.
        let mut squares = blurred.iter().map(|c| DMat3::from_cols(c.x * *c, c.y * *c, c.z * *c)).sum::<DMat3>();
        let gray = GRAY / 3.0 * (squares.x_axis.x + squares.y_axis.y + squares.z_axis.z);
        squares += DMat3::from_diagonal(DVec3::splat(gray.max(LEAST_SQUARE)));
        let least = squares.inverse();
        let mut unread = &views.cells[..];
        for (&count, transfer) in views.counts.iter().zip(transfers.chunks_exact_mut(stride)) {
            let (view, after) = unread.split_at(usize::from(count));
            unread = after;
            let of_cell = |[cell, root]: &[u8; 2]| unpack(*root) * self.cells[usize::from(*cell)];
            let light = PI * view.iter().map(of_cell).sum::<DVec3>();
            let met = transfer.iter().zip(blurred).map(|(t, sky)| f64::from(*t) * *sky).sum::<DVec3>();
            let factor = if met.element_sum() > 0.0 { light.element_sum() / met.element_sum() } else { 1.0 };
            let factor = factor.clamp(FACTORS[0], FACTORS[1]);
            let rest = least * (light - factor * met);
            let fitted = |t: f32, sky: &DVec3| factor * f64::from(t) + rest.dot(*sky);
            transfer.iter_mut().zip(blurred).for_each(|(t, sky)| *t = fitted(*t, sky) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sh::basis::values;
    use crate::sh::quadrature::even_directions;

    #[test]
    fn directions_of_a_cell_lie_in_it() {
        for number in 0..CELLS {
            for place in [[0.02, 0.03], [0.5, 0.5], [0.98, 0.97]] {
                let (toward, _) = toward(number, place);
                assert!((toward.length() - 1.0).abs() < 1e-12);
                assert_eq!(cell(toward.as_vec3a()), number);
            }
        }
    }

    /// A wall that stands turned sees a window of 40 degrees above the horizon, and a ceiling the ground through it: their
    /// light is that of the exact sky, whose ground is dark.
    #[test]
    fn light_through_a_window_is_that_of_the_exact_sky() {
        let sky = |d: DVec3| if d.y > 0.0 { DVec3::new(1.0, 1.5, 2.0) - d.y } else { DVec3::splat(0.1) };
        const COUNT: usize = 200_000;
        let solid_angle = 4.0 * PI / COUNT as f64;
        let mut blurred = [0; 3].map(|_| vec![0.0; 16]);
        for direction in even_directions(COUNT) {
            let light = sky(direction).to_array();
            let basis = values(4, direction);
            for (channel, light) in blurred.iter_mut().zip(light) {
                channel.iter_mut().zip(basis).for_each(|(c, y)| *c += solid_angle * light * y);
            }
        }
        let fit = SkyFit::new(&sky, blurred.clone(), DQuat::IDENTITY);
        let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4);
        for (normal, is_free) in [
            (DVec3::Z, (|d: DVec3| d.y > 0.0 && d.y < 0.4 && d.x.abs() < 0.5) as fn(DVec3) -> bool),
            (DVec3::NEG_Y, |d: DVec3| d.z > 0.0 && d.x.abs() < 0.4),
        ] {
            let mut shares = [0.0; CELLS];
            let mut transfer = [0.0_f32; 16];
            let mut wanted = DVec3::ZERO;
            for direction in even_directions(COUNT).filter(|d| is_free(*d) && d.dot(normal) > 0.0) {
                let weight = solid_angle * direction.dot(normal);
                shares[cell(direction.as_vec3a())] += (weight / PI) as f32;
                let local = values(4, turn.inverse() * direction);
                transfer.iter_mut().zip(local).for_each(|(t, y)| *t += (weight * y) as f32);
                wanted += weight * sky(direction);
            }
            let light = |transfer: &[f32]| {
                let mut turned = [0.0; MAX_COEFFICIENTS];
                let local: Vec<f64> = transfer.iter().map(|t| f64::from(*t)).collect();
                Rotation::new(4, turn).apply(&local, &mut turned);
                DVec3::from_array(blurred.each_ref().map(|c| c.iter().zip(turned).map(|(c, t)| c * t).sum()))
            };
            let before = light(&transfer);
            let mut views = SkyViews::default();
            views.push(&pack(&shares));
            fit.fit(&views, turn, &mut transfer, 16);
            let after = light(&transfer);
            println!("{normal}: {wanted}, in four bands {before}, fitted {after}");
            assert!((before - wanted).length() > 0.1 * wanted.length());
            assert!((after - wanted).length() < 0.02 * wanted.length());
            let black = SkyFit::new(&|_| DVec3::ZERO, [0; 3].map(|_| vec![0.0; 16]), DQuat::IDENTITY);
            let before = transfer;
            black.fit(&views, turn, &mut transfer, 16);
            assert_eq!(before, transfer);
        }
    }
}
