//! A chain of occluders on one vertex's transfer, in f64: the twin of `glsl/merge_product.glsl`, and the choices that both have.

use crate::merge::variant::Chain;
use crate::sh::basis::{MAX_COEFFICIENTS, Y00, coefficient_count, evaluate};
use crate::sh::log_space::LogSpace;
use crate::sh::points;
use crate::sh::product::Tensor;

/// Coefficients, or values at points times the weights; zero past the last. In log space the transfer, and from `SUM` on the sum
/// of the factors' logarithms.
pub type State = [f64; MAX_COEFFICIENTS];

/// Where the sum of logarithms begins.
const SUM: usize = MAX_COEFFICIENTS / 2;

/// How factors come into a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// One product after the other, as the device does it.
    Products(Chain),
    /// Their logarithms are added, and the exponential of the sum is multiplied in at the end. For comparison, on the CPU only.
    Logarithms,
}

/// Multiplies chains of some bands by factors of some bands.
pub struct Multiplier {
    tensor: Tensor,
    guard: bool,
    /// The basis at each point with the point's weight, where a chain stays at points.
    points: Option<Vec<(State, f64)>>,
    logarithms: Option<LogSpace>,
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
            logarithms: None,
        }
    }

    /// For a method, transfers of `bands` bands and factors of `field_bands`.
    ///
    /// # Panics
    /// When logarithms are to be added of more than 5 bands, or of others than the transfer's.
    pub fn by(method: Method, bands: usize, field_bands: usize) -> Self {
        match method {
            Method::Products(chain) => Self::new(chain, bands, field_bands),
            Method::Logarithms => {
                assert!(
                    bands == field_bands && coefficient_count(bands) <= SUM,
                    "{bands} and {field_bands} bands in log space"
                );
                let plain = Chain { guard: false, ..Chain::default() };
                Multiplier { logarithms: Some(LogSpace::new(bands)), ..Self::new(plain, bands, field_bands) }
            }
        }
    }

    /// The chain without a factor.
    pub fn begin(&self, transfer: &[f64]) -> State {
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

    /// Ends a chain: nothing more is multiplied in.
    pub fn finish(&self, state: &mut State) {
        if let Some(space) = &self.logarithms {
            let (transfer, sum) = state.split_at_mut(SUM);
            space.multiply(transfer, sum);
        }
    }

    /// The integral of a finished chain against a function of as many bands as the transfer.
    pub fn meet(&self, state: &State, function: &[f64]) -> f64 {
        match &self.points {
            None => dot(state, &function[..self.count()]),
            Some(points) => {
                state.iter().zip(points).map(|(value, (y, _))| value * dot(y, &function[..self.count()])).sum()
            }
        }
    }

    /// Multiplies by 1 - `blocked`; in log space `blocked` is that factor's logarithm.
    pub fn multiply(&self, state: &mut State, blocked: &[f64]) {
        if self.logarithms.is_some() {
            state[SUM..].iter_mut().zip(&blocked[..self.count()]).for_each(|(sum, log)| *sum += log);
            return;
        }
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
    pub fn cover(&self, state: &mut State, y: &[f64], solid_angle: f64) {
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
    fn parts(&self, state: &State) -> [f64; 2] {
        match &self.points {
            None => [state[0], dot(&state[1..], &state[1..])],
            Some(points) => {
                let first = Y00 * state.iter().sum::<f64>();
                let apart =
                    |(value, (_, weight)): (&f64, &(State, f64))| (value - weight * Y00 * first).powi(2) / weight;
                [first, state.iter().zip(points).map(apart).sum()]
            }
        }
    }

    /// Takes back what no factor between 0 and 1 could have added (see `merge_product.glsl`).
    fn shorten(&self, state: &mut State, [first_before, rest_before]: [f64; 2]) {
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
    use crate::merge::reference::Cone;
    use crate::merge::variant::PRODUCTS;
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
