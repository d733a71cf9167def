//! Statistics: errors over vertices, and times over rounds.

use serde::Serialize;

/// Radiosity of a vertex: linear RGB radiance.
pub type Radiosity = [f64; 3];

/// Difference between two sets of vertex values, relative to a given unit. A vertex's error is the root mean square
/// over its three channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct VertexDifference {
    /// Root mean square over vertices.
    #[serde(rename = "rms_relative")]
    pub rms: f64,
    /// 99th percentile over vertices.
    #[serde(rename = "p99_relative")]
    pub p99: f64,
    /// Maximum over vertices.
    #[serde(rename = "max_relative")]
    pub max: f64,
}

/// Root mean square over vertices and channels.
pub fn rms(values: &[Radiosity]) -> f64 {
    let squares: f64 = values.iter().flatten().map(|c| c * c).sum();
    (squares / (3 * values.len()).max(1) as f64).sqrt()
}

/// The difference of two sets of the same vertices in units of `unit`.
pub fn difference(a: &[Radiosity], b: &[Radiosity], unit: f64) -> VertexDifference {
    assert_eq!(a.len(), b.len(), "sets of vertices");
    let apart: Vec<Radiosity> = a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
    let mut sorted: Vec<f64> = apart.iter().map(|d| rms(&[*d])).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get(((sorted.len() as f64 * share).ceil() as usize).saturating_sub(1)).copied();
    VertexDifference {
        rms: rms(&apart) / unit,
        p99: at(0.99).unwrap_or(0.0) / unit,
        max: at(1.0).unwrap_or(0.0) / unit,
    }
}

/// Median and quartiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// First quartile.
    pub lower: f64,
    pub median: f64,
    /// Third quartile.
    pub upper: f64,
}

/// Quartiles by linear interpolation between ranks.
pub fn spread(values: &[f64]) -> Spread {
    let [lower, median, upper] = quantiles(values, [0.25, 0.5, 0.75]);
    Spread { lower, median, upper }
}

/// The values below which those shares of all lie, by linear interpolation between ranks; 0 where there are none.
pub fn quantiles<const N: usize>(values: &[f64], shares: [f64; N]) -> [f64; N] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    shares.map(|share| {
        let rank = share * (sorted.len().max(1) - 1) as f64;
        let low = rank as usize;
        let part = rank.fract();
        match (sorted.get(low), sorted.get(low + 1)) {
            (Some(a), Some(b)) => a + part * (b - a),
            (Some(a), None) => *a,
            _ => 0.0,
        }
    })
}

/// The x at which a falling curve of (x, y) reaches `y`, interpolated linearly in logarithms and extrapolated beyond
/// its last two points. If the curve starts below `y`, its first x is returned. `None` if there are fewer than two
/// points or the curve does not fall.
pub fn crossing(curve: &[(f64, f64)], y: f64) -> Option<f64> {
    let logs: Vec<(f64, f64)> = curve.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let target = y.ln();
    let pair = logs.windows(2).find(|pair| pair[1].1 <= target).or(logs.windows(2).last())?;
    let slope = (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0);
    (slope < 0.0).then(|| (pair[0].0 + (target - pair[0].1) / slope).exp().max(curve[0].0))
}

/// The value of a rising curve of (x, y) at `x`, interpolated and extrapolated linearly in logarithms. A single point
/// gives its y.
///
/// # Panics
/// When there is no point.
pub fn along(curve: &[(f64, f64)], x: f64) -> f64 {
    let last = curve.len().saturating_sub(1);
    let after = curve.iter().position(|p| p.0 >= x).unwrap_or(last).clamp(1, last.max(1));
    let (Some(a), Some(b)) = (curve.get(after - 1), curve.get(after)) else { return curve[0].1 };
    a.1 * ((b.1 / a.1).ln() * (x / a.0).ln() / (b.0 / a.0).ln()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_in_the_given_unit() {
        let a: Vec<Radiosity> = (0..100).map(|i| [f64::from(i); 3]).collect();
        let b = vec![[0.0; 3]; 100];
        let found = difference(&a, &b, 2.0);
        assert_eq!((found.p99, found.max), (49.0, 49.5));
        assert!((found.rms - (328_350.0_f64 / 100.0).sqrt() / 2.0).abs() < 1e-12, "sum of squares to 99: {found:?}");
    }

    #[test]
    fn quartiles_and_crossings() {
        assert_eq!(spread(&[4.0, 1.0, 3.0, 2.0, 5.0]), Spread { lower: 2.0, median: 3.0, upper: 4.0 });
        assert_eq!(spread(&[]), Spread::default());
        // y = 1 / x, between points and beyond the last.
        let curve = [(1.0, 1.0), (10.0, 0.1), (100.0, 0.01)];
        for y in [0.5, 0.05, 0.001] {
            assert!((crossing(&curve, y).unwrap() * y - 1.0).abs() < 1e-12);
        }
        assert_eq!(crossing(&curve, 2.0), Some(1.0), "already better at its first point");
        // y = x^2, at its points, between and beyond.
        for x in [1.0, 3.0, 4.0, 64.0] {
            assert!((along(&[(1.0, 1.0), (4.0, 16.0), (16.0, 256.0)], x) / (x * x) - 1.0).abs() < 1e-12);
        }
        assert_eq!(along(&[(2.0, 7.0)], 5.0), 7.0);
        assert_eq!(crossing(&[(1.0, 1.0), (2.0, 1.0)], 0.5), None);
    }
}
