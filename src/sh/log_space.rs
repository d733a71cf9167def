//! Chains in log space: the logarithms of all factors are added, and one exponential at the end is multiplied into the transfer
//! (reference 6 of [`crate::sh`]).

use super::basis::{MAX_COEFFICIENTS, coefficient_count};
use super::product::{Tensor, eigenvectors};
use std::f64::consts::PI;

/// Smallest eigenvalue whose logarithm is taken: four bands of a deep shadow ring below 0, where there is none. A floor anywhere
/// from 0.005 to 0.2 makes no difference to caps of up to 40 degrees.
const FLOOR: f64 = 0.02;
/// Longest expansion, without its constant, of which the exponential is a series.
const SHORT: f64 = 0.5;
/// Terms of that series beyond the constant: the next one is below 1e-5.
const TERMS: usize = 4;

/// Logarithm and exponential of expansions, for factors of as many bands as the transfer.
pub struct LogSpace {
    tensor: Tensor,
    count: usize,
}

impl LogSpace {
    /// For factors and transfers of `bands` bands.
    pub fn new(bands: usize) -> Self {
        LogSpace { tensor: Tensor::new(bands, bands, bands), count: coefficient_count(bands) }
    }

    /// Coefficients of the logarithm of the visibility 1 - `blocked`: that of its product matrix, with eigenvalues of at least
    /// `FLOOR`, applied to the constant function 1. Turns with its factor.
    pub fn logarithm(&self, blocked: &[f64]) -> Vec<f64> {
        let n = self.count;
        let (values, vectors) = eigenvectors(&self.tensor.matrix(blocked));
        let logs: Vec<f64> = values.iter().map(|blocked| (1.0 - blocked).max(FLOOR).ln()).collect();
        let one = (4.0 * PI).sqrt();
        (0..n).map(|i| one * (0..n).map(|k| vectors[i * n + k] * logs[k] * vectors[k]).sum::<f64>()).collect()
    }

    /// Coefficients of the exponential of an expansion: its constant apart, where the exponential is exact; the rest halved until
    /// it is short, put into the series, and squared as often.
    pub fn exponential(&self, logarithm: &[f64]) -> [f64; MAX_COEFFICIENTS] {
        let (n, one) = (self.count, (4.0 * PI).sqrt());
        let mut rest = [0.0; MAX_COEFFICIENTS];
        rest[1..n].copy_from_slice(&logarithm[1..n]);
        let length = rest.iter().map(|c| c * c).sum::<f64>().sqrt();
        let halvings = (length / SHORT).max(1.0).log2().ceil();
        rest.iter_mut().for_each(|c| *c *= (-halvings).exp2());
        let (mut sum, mut product) = ([0.0; MAX_COEFFICIENTS], [0.0; MAX_COEFFICIENTS]);
        sum[0] = one;
        // Horner's rule.
        for term in (1..=TERMS).rev() {
            self.tensor.multiply(&rest, &sum, &mut product);
            sum = product.map(|c| c / term as f64);
            sum[0] += one;
        }
        for _ in 0..halvings as u32 {
            self.tensor.multiply(&sum, &sum, &mut product);
            sum = product;
        }
        let constant = (logarithm[0] / one).exp();
        sum.map(|c| c * constant)
    }

    /// Multiplies `transfer` by the exponential of an expansion.
    pub fn multiply(&self, transfer: &mut [f64], logarithm: &[f64]) {
        let mut product = [0.0; MAX_COEFFICIENTS];
        self.tensor.multiply(&self.exponential(logarithm), transfer, &mut product);
        transfer[..self.count].copy_from_slice(&product[..self.count]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sh::basis::evaluate;
    use crate::sh::lobe::{cap, clamped_cosine};
    use glam::DVec3;

    const ONE: f64 = 3.544_907_701_811_032;

    fn apart(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn constants_and_weak_factors_are_exact() {
        let space = LogSpace::new(4);
        // Half of the light everywhere.
        let mut half = [0.0; 16];
        half[0] = 0.5 * ONE;
        let log = space.logarithm(&half);
        assert!((log[0] - 0.5_f64.ln() * ONE).abs() < 1e-12 && log[1..].iter().all(|c| c.abs() < 1e-12), "{log:?}");
        assert!(apart(&space.exponential(&log)[..16], &half) < 1e-12);
        // ln(1 - b) = -b - b^2 / 2 of what blocks little.
        let mut basis = [0.0; MAX_COEFFICIENTS];
        evaluate(4, DVec3::new(0.36, 0.48, 0.8), &mut basis);
        let weak: Vec<f64> = basis[..16].iter().map(|y| 1e-3 * y).collect();
        let mut square = [0.0; 16];
        Tensor::new(4, 4, 4).multiply(&weak, &weak, &mut square);
        let series: Vec<f64> = weak.iter().zip(square).map(|(b, square)| -b - square / 2.0).collect();
        let found = space.logarithm(&weak);
        assert!(
            apart(&found, &series) < 1e-8
                && apart(&found, &series) < 0.01 * apart(&found, &weak.iter().map(|b| -b).collect::<Vec<_>>())
        );
    }

    /// The logarithm of four bands is cut to four bands itself, so that its exponential is not the factor again; what of it meets
    /// a cosine differs by less than four bands err.
    #[test]
    fn the_exponential_of_a_logarithm_gives_a_factor_back() {
        let space = LogSpace::new(4);
        let tensor = Tensor::new(4, 4, 4);
        let cosine = clamped_cosine(4, DVec3::Y);
        let axis = DVec3::new(0.48, 0.6, 0.64);
        for (half_angle_deg, allowed) in [(5.0, 2e-4), (10.0, 1e-3), (20.0, 4e-3), (40.0, 2e-2)] {
            let blocked = cap(4, axis, f64::to_radians(half_angle_deg));
            let log = space.logarithm(&blocked);
            let mut through = cosine.clone();
            space.multiply(&mut through, &log);
            let (mut plain, mut product) = (cosine.clone(), [0.0; 16]);
            tensor.multiply(&cosine, &blocked, &mut product);
            plain.iter_mut().zip(product).for_each(|(t, p)| *t -= p);
            assert!(apart(&through, &plain) < allowed, "{half_angle_deg} degrees: {}", apart(&through, &plain));
            assert!(
                apart(&through, &cosine) > 2.0 * apart(&through, &plain),
                "{half_angle_deg} degrees: nothing was multiplied"
            );
        }
    }

    #[test]
    fn two_small_caps_are_near_their_products() {
        let space = LogSpace::new(4);
        let tensor = Tensor::new(4, 4, 4);
        let cosine = clamped_cosine(4, DVec3::Y);
        let caps = [(DVec3::new(0.48, 0.6, 0.64), 10.0), (DVec3::new(-0.6, 0.8, 0.0), 12.0)];
        let (mut plain, mut sum) = (cosine.clone(), [0.0; 16]);
        for (axis, half_angle_deg) in caps {
            let blocked = cap(4, axis, f64::to_radians(half_angle_deg));
            let mut product = [0.0; 16];
            tensor.multiply(&plain, &blocked, &mut product);
            plain.iter_mut().zip(product).for_each(|(t, p)| *t -= p);
            sum.iter_mut().zip(space.logarithm(&blocked)).for_each(|(s, l)| *s += l);
        }
        let mut through = cosine.clone();
        space.multiply(&mut through, &sum);
        let (off, blocked) = (apart(&through, &plain), apart(&plain, &cosine));
        assert!(off < 0.05 * blocked, "{off} of {blocked}");
    }
}
