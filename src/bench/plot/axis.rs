//! Axes of plots: map values to positions and choose ticks.

/// Mapping from values to positions on an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisScale {
    /// Logarithmic; values that are not above 0 lie at the low end.
    Log,
    /// Linear between two values; values outside lie at the edge.
    Linear(f64, f64),
}

/// An axis between two positions of a drawing.
pub(super) struct Axis {
    scale: AxisScale,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    pub fn new(scale: AxisScale, values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) = match scale {
            AxisScale::Linear(low, high) => (low, high),
            AxisScale::Log => {
                let within = values.filter(|v| *v > 0.0 && v.is_finite());
                let (low, high) = within.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
                let (low, high) = if low <= high { (low, high) } else { (0.1, 10.0) };
                // A margin of a twelfth of the length at both ends, and at least 3 %.
                let room = ((high / low).ln() / 12.0).max(0.03);
                (low.ln() - room, high.ln() + room)
            }
        };
        Axis { scale, low, high, from, to }
    }

    pub fn at(&self, value: f64) -> f64 {
        let value = match self.scale {
            AxisScale::Log if value > 0.0 => value.ln(),
            AxisScale::Log => self.low,
            AxisScale::Linear(..) => value,
        };
        let share = ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        self.from + share * (self.to - self.from)
    }

    /// Round values whose positions are at least `apart` from each other, with their names.
    pub fn ticks(&self, apart: f64) -> Vec<(f64, String)> {
        let most = ((self.to - self.from).abs() / apart).floor().max(2.0) as usize;
        match self.scale {
            AxisScale::Log if self.high - self.low > 3.0_f64.ln() => self.decades(most),
            AxisScale::Log => linear(self.low.exp(), self.high.exp(), most),
            AxisScale::Linear(..) => linear(self.low, self.high, most),
        }
    }

    /// As many round numbers per power of ten as there is room for.
    fn decades(&self, most: usize) -> Vec<(f64, String)> {
        let powers = (self.low / 10_f64.ln()).floor() as i32..=(self.high / 10_f64.ln()).ceil() as i32;
        let of = |leading: &[i32], every: usize| -> Vec<(f64, String)> {
            let powers = powers.clone().filter(|p| p.rem_euclid(every as i32) == 0);
            let all = powers.flat_map(|power| leading.iter().map(move |digit| (*digit, power)));
            let all = all.map(|(digit, power)| {
                let value: f64 = format!("{digit}e{power}").parse().expect("a number");
                let name = if (-4..6).contains(&power) { format!("{value}") } else { format!("{digit}e{power}") };
                (value, name)
            });
            all.filter(|(value, _)| (self.low..=self.high).contains(&value.ln())).collect()
        };
        let choices: [(&[i32], usize); 7] = [
            (&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1),
            (&[1, 2, 3, 5, 7], 1),
            (&[1, 2, 5], 1),
            (&[1, 3], 1),
            (&[1], 1),
            (&[1], 2),
            (&[1], 3),
        ];
        let ticks = choices.into_iter().map(|(leading, every)| of(leading, every)).find(|t| t.len() <= most);
        ticks.unwrap_or_else(|| of(&[1], 5))
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear(low: f64, high: f64, most: usize) -> Vec<(f64, String)> {
    let least = (high - low) / most as f64;
    let power = least.log10().floor() as i32;
    let steps = [1, 2, 5, 10].into_iter().map(|digit| f64::from(digit) * 10_f64.powi(power));
    let step = steps.into_iter().find(|step| *step >= least).unwrap_or(least);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let first = (low / step).ceil() as i64;
    let values = (first..).map(|i| i as f64 * step).take_while(|v| *v <= high * (1.0 + 1e-12) + 1e-12);
    values.map(|v| (v, format!("{:.digits$}", if v == 0.0 { 0.0 } else { v }))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_apart_and_within() {
        let spans = [(1e-9, 1e9), (0.001, 0.9), (1.0, 1.1), (0.0917, 0.0921), (3.0, 40.0), (5.0, 5.0)];
        for (low, high) in spans {
            let axis = Axis::new(AxisScale::Log, [low, high, 0.0, f64::INFINITY].into_iter(), 0.0, 400.0);
            let ticks = axis.ticks(40.0);
            assert!((1..=11).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
            for (value, name) in &ticks {
                assert!((0.0..=400.0).contains(&axis.at(*value)) && name.len() < 8, "{ticks:?}");
                assert!((name.parse::<f64>().unwrap() / value - 1.0).abs() < 1e-9, "{ticks:?}");
            }
            assert!(axis.at(0.0) == 0.0 && axis.at(low) < axis.at(high * 1.01));
        }
        let names: Vec<_> = linear(-0.1, 1.0, 6).into_iter().map(|(_, name)| name).collect();
        assert_eq!(names, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    }
}
