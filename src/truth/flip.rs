//! LDR-FLIP: how different two pictures look when one flips between them.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, *FLIP: A Difference Evaluator for Alternating
//! Images*, HPG 2020. The colours of both are blurred as the eye blurs them at a distance, and compared in a space
//! where distances are alike; then edges and points that only one of them has raise the difference. 0 is no difference
//! at a pixel, 1 the largest there is. The one crate for it builds the authors' C++; this is the paper's text in Rust,
//! tested against the authors' program.

use rayon::prelude::*;
use std::f64::consts::PI;

/// The authors' viewing conditions, on which published means rest: a screen of 3840 pixels and 0.7 m, seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Contrast sensitivity as sums of two Gaussians, amplitude and squared width of each, in degrees: of luminance, red to
/// green, and blue to yellow (the paper's table 1).
const SENSITIVITY: [[[f64; 2]; 2]; 3] =
    [[[1.0, 0.0047], [0.0, 1e-5]], [[1.0, 0.0053], [0.0, 1e-5]], [[34.1, 0.04], [13.5, 0.025]]];
/// Exponent of colour differences, and the share of the largest that is mapped to which share of the range.
const COLOR_EXPONENT: f64 = 0.7;
const COLOR_KNEE: [f64; 2] = [0.4, 0.95];
/// Exponent of feature differences, and the width of an edge that the eye sees best, degrees.
const FEATURE_EXPONENT: f64 = 0.5;
const FEATURE_DEG: f64 = 0.082;

/// Rec.709 to XYZ, from the primaries' and D65's chromaticities (ITU-R BT.709).
struct ColorSpace {
    to_xyz: glam::DMat3,
    to_rgb: glam::DMat3,
    white: glam::DVec3,
}

impl ColorSpace {
    fn new() -> Self {
        let xyz = |x: f64, y: f64| glam::DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        let primaries = glam::DMat3::from_cols(xyz(0.64, 0.33), xyz(0.3, 0.6), xyz(0.15, 0.06));
        let white = xyz(0.3127, 0.329);
        let to_xyz = primaries * glam::DMat3::from_diagonal(primaries.inverse() * white);
        ColorSpace { to_xyz, to_rgb: to_xyz.inverse(), white }
    }

    /// Linear RGB to the opponent space Y, Cx, Cz in which the eye's blur is stated.
    fn opponent(&self, rgb: glam::DVec3) -> [f64; 3] {
        let [x, y, z] = (self.to_xyz * rgb / self.white).to_array();
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn rgb_of_opponent(&self, [y, cx, cz]: [f64; 3]) -> glam::DVec3 {
        let y = (y + 16.0) / 116.0;
        self.to_rgb * (glam::DVec3::new(y + cx / 500.0, y, y - cz / 200.0) * self.white)
    }

    /// CIELAB with chroma in proportion to lightness, after Hunt: dark colours differ less.
    fn lab(&self, rgb: glam::DVec3) -> [f64; 3] {
        let knee = 6.0_f64 / 29.0;
        let f = |t: f64| if t > knee.powi(3) { t.cbrt() } else { t / (3.0 * knee * knee) + 4.0 / 29.0 };
        let [x, y, z] = (self.to_xyz * rgb / self.white).to_array().map(f);
        let lightness = 116.0 * y - 16.0;
        [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
    }
}

/// Distance for large colour differences: lightness apart, chroma Euclidean (Abasi et al. 2020).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// One channel of a picture, row by row.
struct Plane {
    width: usize,
    values: Vec<f64>,
}

impl Plane {
    /// The picture filtered along rows and then along columns; its rim is repeated outwards.
    fn filtered(&self, across: &[f64], down: &[f64]) -> Plane {
        let rows = self.pass(across, |i| (i / self.width * self.width, i % self.width, self.width, 1));
        let height = self.values.len() / self.width;
        rows.pass(down, |i| (i % self.width, i / self.width, height, self.width))
    }

    /// `line` gives for a pixel the start of its row or column, its place in it, the row's length and the step along
    /// it.
    fn pass(&self, kernel: &[f64], line: impl Fn(usize) -> (usize, usize, usize, usize) + Sync) -> Plane {
        let radius = (kernel.len() / 2) as isize;
        let at = |i: usize| {
            let (start, place, length, step) = line(i);
            let value = |(k, weight): (usize, &f64)| {
                let place = (place as isize + k as isize - radius).clamp(0, length as isize - 1) as usize;
                weight * self.values[start + place * step]
            };
            kernel.iter().enumerate().map(value).sum()
        };
        Plane { width: self.width, values: (0..self.values.len()).into_par_iter().map(at).collect() }
    }
}

/// A function of pixels from the middle, over `radius` to either side.
fn kernel(radius: usize, of: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * radius).map(|i| of(i as f64 - radius as f64)).collect()
}

fn scaled(kernel: &[f64], factor: f64) -> Vec<f64> {
    kernel.iter().map(|k| k * factor).collect()
}

/// A channel as the eye blurs it: the sum of two Gaussians, of weight 1 in all.
fn blurred(plane: &Plane, sensitivity: &[[f64; 2]; 2]) -> Plane {
    let widest = SENSITIVITY.as_flattened().iter().map(|[_, b]| *b).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as usize;
    let parts = sensitivity.iter().filter(|[a, _]| *a > 0.0).map(|[a, b]| {
        let gauss = kernel(radius, |x| (-(PI * x / PIXELS_PER_DEGREE).powi(2) / b).exp());
        let sum: f64 = gauss.iter().sum();
        (a * (PI / b).sqrt() * sum * sum, plane, scaled(&gauss, 1.0 / sum))
    });
    let parts: Vec<(f64, &Plane, Vec<f64>)> = parts.collect();
    let total: f64 = parts.iter().map(|(weight, ..)| weight).sum();
    let mut out = Plane { width: plane.width, values: vec![0.0; plane.values.len()] };
    for (weight, plane, gauss) in parts {
        let part = plane.filtered(&gauss, &gauss);
        out.values.iter_mut().zip(&part.values).for_each(|(sum, value)| *sum += weight / total * value);
    }
    out
}

/// Strength of edges and of points at every pixel of a luminance of 0 to 1.
fn features(luminance: &Plane) -> Vec<[f64; 2]> {
    let sd = 0.5 * FEATURE_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * sd).ceil() as usize;
    let gauss = |x: f64| (-x * x / (2.0 * sd * sd)).exp();
    let smooth = kernel(radius, gauss);
    let smooth = scaled(&smooth, 1.0 / smooth.iter().sum::<f64>());
    // Positive weights sum to 1 and negative ones to -1, so that the strongest edge or point is 1.
    let balanced = |raw: Vec<f64>| {
        let of = |sign: f64| raw.iter().map(|k| (sign * k).max(0.0)).sum::<f64>();
        let positive = of(1.0);
        let negative = of(-1.0);
        raw.iter().map(|k| if *k > 0.0 { k / positive } else { k / negative }).collect::<Vec<f64>>()
    };
    let edge = balanced(kernel(radius, |x| -x * gauss(x)));
    let point = balanced(kernel(radius, |x| (x * x / (sd * sd) - 1.0) * gauss(x)));
    let [edges, points] = [edge, point].map(|feature| {
        let x = luminance.filtered(&feature, &smooth);
        let y = luminance.filtered(&smooth, &feature);
        x.values.iter().zip(&y.values).map(|(x, y)| x.hypot(*y)).collect::<Vec<f64>>()
    });
    edges.into_iter().zip(points).map(|(edge, point)| [edge, point]).collect()
}

/// What is compared of a picture: blurred colours, edges and points.
struct Seen {
    lab: Vec<[f64; 3]>,
    features: Vec<[f64; 2]>,
}

impl Seen {
    fn new(space: &ColorSpace, width: usize, linear_rgb: &[f32]) -> Self {
        // NaN is black, as in a PNG.
        let rgb = |p: &[f32]| {
            glam::DVec3::new(p[0].into(), p[1].into(), p[2].into()).max(glam::DVec3::ZERO).min(glam::DVec3::ONE)
        };
        let opponent: Vec<[f64; 3]> = linear_rgb.chunks_exact(3).map(|p| space.opponent(rgb(p))).collect();
        let plane = |c: usize| Plane { width, values: opponent.iter().map(|o| o[c]).collect() };
        let luminance = Plane { width, values: opponent.iter().map(|o| (o[0] + 16.0) / 116.0).collect() };
        let [y, cx, cz] = std::array::from_fn(|c| blurred(&plane(c), &SENSITIVITY[c]).values);
        let lab = |i: usize| {
            let blurred = space.rgb_of_opponent([y[i], cx[i], cz[i]]);
            space.lab(blurred.max(glam::DVec3::ZERO).min(glam::DVec3::ONE))
        };
        Seen { lab: (0..opponent.len()).map(lab).collect(), features: features(&luminance) }
    }
}

/// FLIP of every pixel, 0 to 1, of two pictures in linear Rec.709 (three floats a pixel, rows of `width` pixels) as a
/// screen shows them: exposed, and clamped to 0 to 1. Neither counts as the better one.
///
/// # Panics
/// When the pictures have different sizes, or no whole rows.
pub fn flip(width: usize, a: &[f32], b: &[f32]) -> Vec<f64> {
    assert!(a.len() == b.len() && width > 0 && a.len().is_multiple_of(3 * width), "{width}: {}, {}", a.len(), b.len());
    let space = ColorSpace::new();
    let a = Seen::new(&space, width, a);
    let b = Seen::new(&space, width, b);
    let largest = hyab(space.lab(glam::DVec3::Y), space.lab(glam::DVec3::Z)).powf(COLOR_EXPONENT);
    let [share, range] = COLOR_KNEE;
    let color = |i: usize| {
        let found = hyab(a.lab[i], b.lab[i]).powf(COLOR_EXPONENT) / largest;
        if found < share { found * range / share } else { range + (found - share) / (1.0 - share) * (1.0 - range) }
    };
    let feature = |i: usize| {
        let apart: [f64; 2] = std::array::from_fn(|f| (a.features[i][f] - b.features[i][f]).abs());
        (apart[0].max(apart[1]) / 2.0_f64.sqrt()).powf(FEATURE_EXPONENT)
    };
    (0..a.lab.len()).into_par_iter().map(|i| color(i).powf(1.0 - feature(i)).min(1.0)).collect()
}
