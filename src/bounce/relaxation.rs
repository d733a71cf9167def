//! How few steps bring all bounces: Richardson's iteration with Chebyshev's nodes.
//!
//! With b the light of one bounce and d direct light, a step takes the light x to b x + d and adds g times the change, so
//! that an eigenvector of b with eigenvalue e keeps (1 + g) e - g of its error. That is nothing for g = e / (1 - e), and
//! little for all if the steps' e are the nodes of Chebyshev's polynomial between the least and the largest eigenvalue
//! (Young, *On Richardson's method*, 1953). The largest comes by power iteration; how far negative ones go, as between
//! walls that face each other, is tried. Where Jacobi's iteration leaves 0.006 of the light after eight steps, these
//! leave as much after five. A plain bounce follows.

use glam::DVec3;
use std::f64::consts::PI;

/// Error that is not seen, where all runs have a direct light of 1: the root of its mean square.
const UNSEEN: f64 = 0.01;
/// Most steps, the plain bounce among them.
pub const MOST_STEPS: usize = 8;
/// Least eigenvalues that are tried, of the largest one.
const LEAST: [f64; 4] = [0.0, -0.3, -0.6, -1.0];

/// Steps that are enough before a plain bounce.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    pub steps: usize,
    /// Largest eigenvalue, by channel, and the least one, of that.
    largest: DVec3,
    least: f64,
}

impl Relaxation {
    /// What each of so many steps adds, by channel: so many times its change.
    pub fn gains(&self, steps: usize) -> Vec<DVec3> {
        let node = |k: usize| {
            let cosine = ((2 * k + 1) as f64 * PI / (2 * steps) as f64).cos();
            let eigenvalue = self.largest * (0.5 * (1.0 + self.least) + 0.5 * (1.0 - self.least) * cosine);
            eigenvalue / (1.0 - eigenvalue)
        };
        (0..steps).map(node).collect()
    }
}

/// The fewest steps that bring all of some lights to within [`UNSEEN`], or the most. Of each light there are all bounces
/// from direct light, of 1 in the mean, to number [`MOST_STEPS`].
pub fn fewest(lights: &[Vec<Vec<DVec3>>]) -> Relaxation {
    let ratios = lights.iter().map(|bounces| ratio(bounces));
    let largest = ratios.fold(DVec3::ZERO, DVec3::max);
    let grams: Vec<Gram> = lights.iter().map(|bounces| gram(bounces, largest)).collect();
    let error = |tried: &Relaxation| {
        let gains: Vec<DVec3> = tried.gains(tried.steps).into_iter().chain([DVec3::ZERO]).collect();
        grams.iter().map(|gram| missing(gram, &gains)).fold(0.0, f64::max)
    };
    let of_count = |steps: usize| {
        let tried = LEAST.map(|least| Relaxation { steps, largest, least });
        let errors = tried.map(|tried| (error(&tried), tried));
        errors.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("some are tried")
    };
    let found: Vec<(f64, Relaxation)> = (0..MOST_STEPS).map(of_count).collect();
    found.iter().find(|(error, _)| *error <= UNSEEN).unwrap_or(&found[MOST_STEPS - 1]).1
}

fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    a.iter().zip(b).map(|(a, b)| *a * *b).sum()
}

/// The largest eigenvalue of each channel, from the last two bounces.
fn ratio(bounces: &[Vec<DVec3>]) -> DVec3 {
    let [.., before, last] = bounces else { unreachable!("more than one bounce is computed") };
    let found = dot(last, before) / dot(before, before).max(DVec3::splat(1e-30));
    found.clamp(DVec3::ZERO, DVec3::splat(0.98))
}

/// Mean products of what is still missing after each number of bounces.
type Gram = [[DVec3; MOST_STEPS + 1]; MOST_STEPS + 1];

fn gram(bounces: &[Vec<DVec3>], largest: DVec3) -> Gram {
    // Of bounces that were not computed each is the one before times the largest eigenvalue.
    let mut missing: Vec<Vec<DVec3>> =
        vec![bounces[MOST_STEPS].iter().map(|b| *b * largest / (1.0 - largest)).collect()];
    for bounce in bounces[1..].iter().rev() {
        let after = &missing[missing.len() - 1];
        missing.push(after.iter().zip(bounce).map(|(after, bounce)| *after + *bounce).collect());
    }
    missing.reverse();
    let vertices = bounces[0].len() as f64;
    std::array::from_fn(|i| std::array::from_fn(|j| dot(&missing[i], &missing[j]) / vertices))
}

/// Error after steps with these gains, the root of its mean square, of the channel that errs most.
fn missing(gram: &Gram, gains: &[DVec3]) -> f64 {
    // What is left is a polynomial of b, applied to what is missing at first.
    let mut polynomial = vec![DVec3::ONE];
    for gain in gains {
        polynomial.push(DVec3::ZERO);
        for power in (0..polynomial.len()).rev() {
            let lower = if power > 0 { polynomial[power - 1] } else { DVec3::ZERO };
            polynomial[power] = (1.0 + *gain) * lower - *gain * polynomial[power];
        }
    }
    let mut square = DVec3::ZERO;
    for (row, a) in gram.iter().zip(&polynomial) {
        square += row.iter().zip(&polynomial).map(|(product, b)| *product * *a * *b).sum::<DVec3>();
    }
    square.max_element().max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a diagonal operator the steps come to d / (1 - e), and as near as is foretold.
    #[test]
    fn few_steps_bring_all_bounces() {
        let eigenvalues: Vec<DVec3> =
            (0..40).map(|i| DVec3::new(0.7, 0.5, 0.3) * (f64::from(i) / 30.0 - 0.3)).collect();
        let times = |light: &[DVec3]| light.iter().zip(&eigenvalues).map(|(light, e)| *light * *e).collect::<Vec<_>>();
        let direct = vec![DVec3::ONE; 40];
        let mut bounces = vec![direct.clone()];
        for _ in 0..MOST_STEPS {
            bounces.push(times(&bounces[bounces.len() - 1]));
        }
        let plain = missing(&gram(&bounces, ratio(&bounces)), &[DVec3::ZERO; MOST_STEPS]);
        let found = fewest(&[bounces]);
        let mut light = direct.clone();
        for gain in found.gains(found.steps).into_iter().chain([DVec3::ZERO]) {
            let next = times(&light).into_iter().zip(&direct).map(|(bounced, direct)| bounced + *direct);
            light = next.zip(&light).map(|(next, before)| next + gain * (next - *before)).collect();
        }
        let errors = light.iter().zip(&eigenvalues).map(|(light, e)| *light - 1.0 / (1.0 - *e));
        let error = (errors.map(|error| error * error).sum::<DVec3>() / 40.0).max_element().sqrt();
        assert!(error < 1.05 * UNSEEN && found.steps <= 4, "{error} after {}", found.steps);
        assert!(plain > error, "as many bounces as there may be steps leave {plain}");
    }
}
