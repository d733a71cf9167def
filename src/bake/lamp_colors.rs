//! What a lamp shows in each direction and from each distance: rays against its mesh.

use super::packet::{BlockerTriangle, Blockers};
use super::triangles::unit_positions;
use crate::asset::Mesh;
use crate::field::lamp_colors::{ColorPlane, LampColors, SHELL_STEP, SHELLS};
use crate::field::silhouette::SilhouetteField;
use crate::field::silhouette_nodes::NodeGrid;
use glam::{DMat3, DVec2, DVec3, DVec4, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;

/// Rays along an edge of the square around a view.
const RAYS: usize = 32;
/// Sine of the angular radius that stands for 0: a distance in r at which f32 still tells places apart.
const AFAR: f64 = 0.02;
/// Variance of places on the disc below which what shows is too narrow for a slope.
const NARROW: f64 = 1e-4;

/// Rays that meet a lamp at least, so that their number tells how much of its disc it covers.
const ENOUGH: f64 = 16.0;

/// What rays from one point meet.
struct View {
    count: f64,
    /// Share of the disc.
    share: f64,
    sum: DVec3,
    plane: ColorPlane,
}

impl LampColors {
    /// The colours of a mesh, for nodes of `cells` cells a face. Where the parts of the light shine by its outline,
    /// `silhouette`, colours make up for what they miss of it.
    pub fn bake(mesh: &Mesh, cells: u32, silhouette: Option<&SilhouetteField>) -> Self {
        let nodes = NodeGrid::new(cells);
        let positions = unit_positions(mesh);
        let triangle = |(number, corners): (u32, &[u32; 3])| BlockerTriangle {
            member: 0,
            number,
            corners: corners.map(|corner| positions[corner as usize]),
        };
        let blockers = Blockers::new((0..).zip(&mesh.triangles).map(triangle), Vec::new(), Vec::new());
        let shells: [Vec<[View; 2]>; SHELLS] = std::array::from_fn(|shell| {
            let sine = (shell as f64 * SHELL_STEP).max(AFAR);
            let maps = (0..NodeGrid::map_count(cells)).into_par_iter();
            let seen = |toward: DVec3| {
                let mut view = view(mesh, &blockers, toward, sine);
                if let Some(silhouette) = silhouette.filter(|_| view.count >= ENOUGH) {
                    let factor = (view.share / silhouette.covered(toward, sine).max(0.01)).clamp(0.5, 2.0);
                    view.plane = view.plane.map(|quad| factor * quad);
                }
                view
            };
            maps.map(|map| [1.0, -1.0].map(|sign| seen(sign * nodes.map_direction(map)))).collect()
        });
        let all = || shells[0].iter().flatten();
        let met: f64 = all().map(|view| view.count).sum();
        let sum: DVec3 = all().map(|view| view.sum).sum();
        let mean = if met > 0.0 { sum / met } else { mean_color(mesh) };
        let over_mean = |view: &View| {
            if view.count == 0.0 {
                return [DVec4::W; 3];
            }
            let mut plane = view.plane;
            for (quad, mean) in plane.iter_mut().zip(mean.to_array()) {
                *quad = if mean > 0.0 { *quad / mean } else { *quad };
            }
            plane
        };
        let planes = shells.map(|views| views.iter().map(|pair| pair.each_ref().map(over_mean)).collect());
        LampColors::new(mean, nodes, planes)
    }
}

/// The mean of the colours of a mesh's vertices.
fn mean_color(mesh: &Mesh) -> DVec3 {
    let Some(colors) = &mesh.colors else { return DVec3::ONE };
    colors.iter().map(|color| color.as_dvec3()).sum::<DVec3>() / colors.len().max(1) as f64
}

/// What rays meet from the point whose direction to the centre is `toward` and that sees the bounding sphere under an
/// angular radius of that sine.
fn view(mesh: &Mesh, blockers: &Blockers, toward: DVec3, sine: f64) -> View {
    let color = |corner: u32| mesh.colors.as_ref().map_or(Vec3::ONE, |colors| colors[corner as usize]);
    let (across, down) = toward.any_orthonormal_pair();
    let eye = -toward / sine;
    let at = |i: usize| (2 * i + 1) as f64 / RAYS as f64 - 1.0;
    let square = (0..RAYS * RAYS).map(|i| DVec2::new(at(i % RAYS), at(i / RAYS)));
    let places: Vec<DVec2> = square.filter(|place| place.length_squared() < 1.0).collect();
    let direction = |place: &DVec2| {
        let aside = sine * (place.x * across + place.y * down);
        (aside + (1.0 - aside.length_squared()).sqrt() * toward).as_vec3a()
    };
    let directions: Vec<Vec3A> = places.iter().map(direction).collect();
    let hits = blockers.first(eye.as_vec3a(), &Mat3A::IDENTITY, &directions, &[true]);
    let mut met: Vec<(DVec3, DVec3)> = Vec::new();
    for ((place, direction), hit) in places.iter().zip(&directions).zip(&hits) {
        let Some(hit) = hit else { continue };
        let (number, [second, third]) = blockers.place(eye.as_vec3a(), *direction, hit);
        let [a, b, c] = mesh.triangles[number as usize].map(color);
        let color = (1.0 - second - third) * a + second * b + third * c;
        met.push((place.extend(1.0), color.as_dvec3()));
    }
    let sum = met.iter().map(|(_, color)| *color).sum();
    let count = met.len() as f64;
    let plane = fitted(&met).map(|fit| (fit.x * across + fit.y * down).extend(fit.z));
    View { count, share: count / places.len() as f64, sum, plane }
}

/// The planes through colours over places (x, y, 1), by least squares: slopes and constant of each channel.
fn fitted(met: &[(DVec3, DVec3)]) -> [DVec3; 3] {
    let mut moments = DMat3::from_diagonal(DVec3::new(NARROW, NARROW, 0.0) * met.len() as f64);
    let mut sums = [DVec3::ZERO; 3];
    for (place, color) in met {
        moments += DMat3::from_cols(place.x * *place, place.y * *place, *place);
        sums.iter_mut().zip(color.to_array()).for_each(|(sum, channel)| *sum += channel * *place);
    }
    if met.is_empty() {
        return sums;
    }
    let solve = moments.inverse();
    sums.map(|sum| solve * sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::generate;
    use crate::field::lamp_colors::color_at;

    /// A ball that is red on its right and blue on its left.
    #[test]
    fn a_ball_of_two_colours_shows_each_from_its_side() {
        let ball = generate::sphere(0.5, 4);
        let color = |p: &Vec3| if p.x > 0.0 { Vec3::X } else { Vec3::Z };
        let colors = ball.positions.iter().map(color).collect();
        let mesh = Mesh::new("ball", ball.positions, ball.normals, Some(colors), ball.triangles).unwrap();
        let found = LampColors::bake(&mesh, 8, None);
        assert!((found.mean - DVec3::new(0.5, 0.0, 0.5)).abs().max_element() < 0.02, "{}", found.mean);
        let seen = |toward: DVec3, place: DVec3| found.mean * color_at(&found.seen(toward, 0.0), place);
        // From the right, all is red.
        let right = seen(DVec3::NEG_X, DVec3::ZERO);
        assert!(right.x > 0.97 && right.z < 0.03, "{right}");
        // From the front, the means of both halves are met: at 4 / (3 pi) of the radius.
        for side in [1.0, -1.0] {
            let half = seen(DVec3::NEG_Z, DVec3::X * side * 4.0 / (3.0 * std::f64::consts::PI));
            let [own, other] = if side > 0.0 { [half.x, half.z] } else { [half.z, half.x] };
            assert!(own > 0.82 && other < 0.18 && (own + other - 1.0).abs() < 0.02, "{half}");
        }
        // From near by on the side, more of the near half shows.
        let near = found.mean * color_at(&found.seen(DVec3::new(-0.6, 0.0, -0.8), 0.8), DVec3::ZERO);
        let far = found.mean * color_at(&found.seen(DVec3::new(-0.6, 0.0, -0.8), 0.0), DVec3::ZERO);
        assert!(near.x > far.x + 0.05 && far.x > 0.6, "{near} {far}");
        assert_eq!(found.quads().len(), 3 * 3 * 6 * 81);
    }
}
