//! A chain of occluders on one vertex's transfer, in f64: the twin of `glsl/merge_product.glsl` and `glsl/product_points.glsl`.

use crate::sh::basis::{MAX_COEFFICIENTS, Y00, coefficient_count, evaluate};
use crate::sh::points;
use crate::sh::product::Tensor;
use crate::sh::product_program::Style;

/// Coefficients, or values at points times the weights; zero past the last.
pub type ChainState = [f64; MAX_COEFFICIENTS];

/// How a factor is multiplied into a chain. The merge has factored products; the others are what `bench product` compares with them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
pub struct Chain {
    /// How the product is computed, and in which space the chain stays meanwhile.
    pub product: Product,
    /// Whether a factor is kept from lengthening a chain (see `glsl/merge_product.glsl`).
    pub guard: bool,
}

impl Default for Chain {
    /// What the merge does: factored products, guarded.
    fn default() -> Self {
        Chain { product: Product::Factored, guard: true }
    }
}

/// How a product is computed. All compute the same function, save [`Product::PointChain`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Product {
    /// Tensor pairs, shared sums factored out. "matrix" where transfer and field differ in bands.
    #[default]
    Factored,
    /// Tensor pairs. "matrix" where transfer and field differ in bands.
    Pairs,
    /// The matrix of multiplication by the occluder's visibility.
    Matrix,
    /// Evaluated at 32 points, multiplied and projected back. Up to 4 bands.
    Points,
    /// A whole chain stays at the 32 points and is projected once: exact for one factor only. Up to 4 bands.
    PointChain,
}

/// Every product, by its name in `bench product`.
pub const PRODUCTS: &[(&str, Product)] = &[
    ("factored", Product::Factored),
    ("pairs", Product::Pairs),
    ("matrix", Product::Matrix),
    ("points", Product::Points),
    ("point-chain", Product::PointChain),
];

impl Product {
    /// The generated code. At points there is none of coefficients, so any will do.
    pub fn style(self, bands: usize, field_bands: usize) -> Style {
        let style = match self {
            Product::Factored | Product::PointChain => Style::Factored,
            Product::Pairs => Style::Pairs,
            Product::Matrix => Style::Matrix,
            Product::Points => Style::Points,
        };
        if style.fits(bands, field_bands) { style } else { Style::Matrix }
    }

    /// Whether a chain is kept as values at points rather than as coefficients.
    pub fn stays_at_points(self) -> bool {
        self == Product::PointChain
    }
}

/// Multiplies chains of some bands by factors of some bands.
pub struct Multiplier {
    tensor: Tensor,
    guard: bool,
    /// The basis at each point with the point's weight, where a chain stays at points.
    points: Option<Vec<(ChainState, f64)>>,
}

impl Multiplier {
    /// For transfers of `bands` bands and blocked parts of `field_bands`.
    pub fn new(chain: Chain, bands: usize, field_bands: usize) -> Self {
        let basis = |direction| {
            let mut y = [0.0; MAX_COEFFICIENTS];
            evaluate(bands, direction, &mut y);
            y
        };
        let points = || points::points().into_iter().map(|(p, weight)| (basis(p), weight)).collect();
        Multiplier {
            tensor: Tensor::new(bands, field_bands, bands),
            guard: chain.guard,
            points: chain.product.stays_at_points().then(points),
        }
    }

    /// The chain without a factor.
    pub fn begin(&self, transfer: &[f64]) -> ChainState {
        let mut state = [0.0; MAX_COEFFICIENTS];
        match &self.points {
            None => state[..transfer.len()].copy_from_slice(transfer),
            Some(points) => {
                for (value, (y, weight)) in state.iter_mut().zip(points) {
                    *value = weight * dot(y, transfer);
                }
            }
        }
        state
    }

    /// The integral of a chain against a function of as many bands as the transfer.
    pub fn meet(&self, state: &ChainState, function: &[f64]) -> f64 {
        match &self.points {
            None => dot(state, &function[..self.count()]),
            Some(points) => {
                state.iter().zip(points).map(|(value, (y, _))| value * dot(y, &function[..self.count()])).sum()
            }
        }
    }

    /// Multiplies by 1 - `blocked`.
    pub fn multiply(&self, state: &mut ChainState, blocked: &[f64]) {
        let before = self.parts(state);
        match &self.points {
            None => {
                let mut product = [0.0; MAX_COEFFICIENTS];
                self.tensor.multiply(state, blocked, &mut product);
                state.iter_mut().zip(product).for_each(|(t, p)| *t -= p);
            }
            Some(points) => {
                for (value, (y, _)) in state.iter_mut().zip(points) {
                    *value -= *value * dot(y, &blocked[..self.count()]);
                }
            }
        }
        if self.guard {
            self.shorten(state, before);
        }
    }

    /// Takes away the chain's value in the direction whose basis is `y`, over a solid angle: `chain_cover`.
    pub fn cover(&self, state: &mut ChainState, y: &[f64], solid_angle: f64) {
        let value = self.meet(state, y);
        let [first, _] = self.parts(state);
        let taken = (solid_angle * value.max(0.0)).min(first.max(0.0) / Y00);
        match &self.points {
            None => state.iter_mut().zip(&y[..self.count()]).for_each(|(t, y)| *t -= taken * y),
            Some(points) => {
                for (value, (basis, weight)) in state.iter_mut().zip(points) {
                    *value -= taken * weight * dot(basis, &y[..self.count()]);
                }
            }
        }
    }

    /// Coefficient 0, and the square of the length of the others.
    fn parts(&self, state: &ChainState) -> [f64; 2] {
        match &self.points {
            None => [state[0], dot(&state[1..], &state[1..])],
            Some(points) => {
                let first = Y00 * state.iter().sum::<f64>();
                let apart =
                    |(value, (_, weight)): (&f64, &(ChainState, f64))| (value - weight * Y00 * first).powi(2) / weight;
                [first, state.iter().zip(points).map(apart).sum()]
            }
        }
    }

    /// Takes back what no factor between 0 and 1 could have added (see `merge_product.glsl`).
    fn shorten(&self, state: &mut ChainState, [first_before, rest_before]: [f64; 2]) {
        let [first, rest] = self.parts(state);
        let kept = first.clamp(first_before.min(0.0), first_before.max(0.0));
        let room = (rest_before + (first_before - kept) * (first_before + kept)).max(0.0);
        let factor = if rest > room { (room / rest).sqrt() } else { 1.0 };
        match &self.points {
            None => {
                state[0] = kept;
                state[1..].iter_mut().for_each(|t| *t *= factor);
            }
            Some(points) => {
                for (value, (_, weight)) in state.iter_mut().zip(points) {
                    *value = factor * (*value - weight * Y00 * first) + weight * Y00 * kept;
                }
            }
        }
    }

    fn count(&self) -> usize {
        coefficient_count(self.tensor.bands()[0])
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lists::skip::CAP_SINES;
    use crate::merge::twin::Cone;
    use crate::sh::lobe::clamped_cosine;
    use glam::DVec3;
    use std::f64::consts::PI;

    /// Caps about one place and caps all over the view, as large as there are: no chain becomes longer, its light neither grows nor
    /// becomes less than none.
    #[test]
    fn caps_never_brighten() {
        let mut rng = fastrand::Rng::with_seed(9);
        for (name, product) in PRODUCTS {
            let multiplier = Multiplier::new(Chain { product: *product, guard: true }, 4, 4);
            for spread in [0.0, 0.2, 3.0] {
                let mut state = multiplier.begin(&clamped_cosine(4, DVec3::Y));
                let [mut first, mut rest] = multiplier.parts(&state);
                for _ in 0..1000 {
                    let mut aside = || spread * (rng.f64() - 0.5);
                    let toward = DVec3::new(0.3 + aside(), 1.0 + aside(), aside()).normalize();
                    let cone = Cone::new(toward / CAP_SINES[1], 1.0, DVec3::ZERO);
                    cone.cap(1.0).cover(&multiplier, &mut state);
                    let [now, others] = multiplier.parts(&state);
                    let lengths = [first * first + rest, now * now + others];
                    assert!(now <= first + 1e-14 && now >= -1e-14, "{name}, {spread}: {first} to {now}");
                    assert!(lengths[1] <= lengths[0] * (1.0 + 1e-12), "{name}, {spread}: {lengths:?}");
                    (first, rest) = (now, others);
                }
                let left = first / (PI.sqrt() / 2.0);
                assert!(if spread < 1.0 { left > 0.5 && left < 0.95 } else { left < 0.2 }, "{name}, {spread}: {left}");
            }
        }
    }
}
