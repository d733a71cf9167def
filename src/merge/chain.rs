//! A chain of occluders on one vertex's transfer, in f64: the twin of `glsl/merge_product.glsl`.

use crate::sh::basis::{MAX_COEFFICIENTS, Y00, coefficient_count};
use crate::sh::product::Tensor;

/// Coefficients; zero past the last.
pub type ChainState = [f64; MAX_COEFFICIENTS];

/// Multiplies chains by factors of as many bands.
pub struct Multiplier {
    tensor: Tensor,
}

impl Multiplier {
    pub fn new(bands: usize) -> Self {
        Multiplier { tensor: Tensor::new(bands) }
    }

    pub fn begin(&self, transfer: &[f64]) -> ChainState {
        let mut state = [0.0; MAX_COEFFICIENTS];
        state[..transfer.len()].copy_from_slice(transfer);
        state
    }

    /// The integral of a chain against a function of as many bands as the transfer.
    pub fn meet(&self, state: &ChainState, function: &[f64]) -> f64 {
        dot(state, &function[..self.count()])
    }

    /// Multiplies by 1 - `blocked`, and takes back what no factor between 0 and 1 could have added: `chain_multiply`.
    pub fn multiply(&self, state: &mut ChainState, blocked: &[f64]) {
        let first_before = state[0];
        let rest_before = rest(state);
        self.multiply_unguarded(state, blocked);
        let kept = state[0].clamp(first_before.min(0.0), first_before.max(0.0));
        let room = (rest_before + (first_before - kept) * (first_before + kept)).max(0.0);
        let rest = rest(state);
        let factor = if rest > room { (room / rest).sqrt() } else { 1.0 };
        state[0] = kept;
        state[1..].iter_mut().for_each(|t| *t *= factor);
    }

    /// Multiplies by 1 - `blocked`, whatever the cut to a few bands adds.
    pub fn multiply_unguarded(&self, state: &mut ChainState, blocked: &[f64]) {
        let mut product = [0.0; MAX_COEFFICIENTS];
        self.tensor.multiply(state, blocked, &mut product);
        state.iter_mut().zip(product).for_each(|(t, p)| *t -= p);
    }

    /// Takes away the chain's value in the direction whose basis is `y`, over a solid angle: `chain_cover`.
    pub fn cover(&self, state: &mut ChainState, y: &[f64], solid_angle: f64) {
        let value = self.meet(state, y);
        let taken = (solid_angle * value.max(0.0)).min(state[0].max(0.0) / Y00);
        state.iter_mut().zip(&y[..self.count()]).for_each(|(t, y)| *t -= taken * y);
    }

    fn count(&self) -> usize {
        coefficient_count(self.tensor.bands)
    }
}

fn rest(state: &ChainState) -> f64 {
    dot(&state[1..], &state[1..])
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

    /// Caps about one place and caps all over the view, as large as there are: no chain becomes longer, its light
    /// neither grows nor becomes less than none.
    #[test]
    fn caps_never_brighten() {
        let mut rng = fastrand::Rng::with_seed(9);
        let multiplier = Multiplier::new(4);
        for spread in [0.0, 0.2, 3.0] {
            let mut state = multiplier.begin(&clamped_cosine(4, DVec3::Y));
            let mut first = state[0];
            let mut length = dot(&state, &state);
            for _ in 0..1000 {
                let mut aside = || spread * (rng.f64() - 0.5);
                let toward = DVec3::new(0.3 + aside(), 1.0 + aside(), aside()).normalize();
                let cone = Cone::new(toward / CAP_SINES[1], 1.0, DVec3::ZERO);
                cone.cap(1.0).cover(&multiplier, &mut state);
                let now = dot(&state, &state);
                assert!(state[0] <= first + 1e-14 && state[0] >= -1e-14, "{spread}: {first} to {}", state[0]);
                assert!(now <= length * (1.0 + 1e-12), "{spread}: {length} to {now}");
                first = state[0];
                length = now;
            }
            let left = first / (PI.sqrt() / 2.0);
            assert!(if spread < 1.0 { left > 0.5 && left < 0.95 } else { left < 0.2 }, "{spread}: {left}");
        }
    }
}
