//! How far a plan is, and what is left of it.

use super::plan::Plan;
use super::results;
use serde::Serialize;

/// Most results whose times correct the estimate: each is a file to open.
const SAMPLES: usize = 200;

/// How far a plan is. A result counts that is there; whether it is intact, `collect` finds out.
#[derive(Clone, Debug, Serialize)]
pub struct Status {
    /// Slices in all.
    pub slices: usize,
    /// Slices whose result is there.
    pub done: usize,
    /// Seconds that slices took beside what was estimated; 1 before any is done.
    pub correction: f64,
    /// Seconds of work in what is left, corrected: divided by the number of workers, the time that is left.
    pub left_s: f64,
    /// Largest memory of a slice in MB.
    pub memory_mb: u32,
    /// Space that all results take, in MB.
    pub disk_mb: u64,
}

/// Slices without a result.
pub fn missing(plan: &Plan) -> Vec<usize> {
    (0..plan.slices.len()).filter(|&slice| !results::path(plan, slice).exists()).collect()
}

impl Status {
    /// How far a plan is.
    pub fn of(plan: &Plan) -> Self {
        let missing = missing(plan);
        let estimated = |slice: &usize| f64::from(plan.slices[*slice].seconds);
        let done = (0..plan.slices.len()).filter(|slice| missing.binary_search(slice).is_err());
        let step = (plan.slices.len() - missing.len()).div_ceil(SAMPLES).max(1);
        let took = done.step_by(step).filter_map(|slice| Some((results::seconds(plan, slice)?, estimated(&slice))));
        let (took, wanted) = took.fold((0.0, 0.0), |(a, b), (took, wanted)| (a + took, b + wanted));
        let correction = if wanted > 0.0 { took / wanted } else { 1.0 };
        Status {
            slices: plan.slices.len(),
            done: plan.slices.len() - missing.len(),
            correction,
            left_s: correction * missing.iter().map(estimated).sum::<f64>(),
            memory_mb: plan.slices.iter().map(|slice| slice.memory_mb).max().unwrap_or(0),
            disk_mb: plan.slices.iter().map(|slice| u64::from(slice.disk_kb)).sum::<u64>() / 1000,
        }
    }

    /// A bar of so many characters, and what is left.
    pub fn line(&self, width: usize) -> String {
        let full = (width * self.done).checked_div(self.slices).unwrap_or(width);
        let bar: String = (0..width).map(|at| if at < full { '=' } else { ' ' }).collect();
        let left = self.left_s.round() as u64;
        let (hours, minutes, seconds) = (left / 3600, left / 60 % 60, left % 60);
        let left = match (hours, minutes) {
            (0, 0) => format!("{seconds} s"),
            (0, _) => format!("{minutes} min {seconds} s"),
            _ => format!("{hours} h {minutes} min"),
        };
        format!("[{bar}] {} of {} slices, about {left} of work left", self.done, self.slices)
    }
}

/// Numbers in ranges: `0-3,7`.
pub fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = runs.map(|run| match run {
        [one] => one.to_string(),
        _ => format!("{}-{}", run[0], run[run.len() - 1]),
    });
    text.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_bars_read_well() {
        assert_eq!(ranges(&[0, 1, 2, 3, 7, 9, 10]), "0-3,7,9-10");
        let mut status = Status { slices: 4, done: 1, correction: 1.0, left_s: 95.2, memory_mb: 0, disk_mb: 0 };
        assert_eq!(status.line(8), "[==      ] 1 of 4 slices, about 1 min 35 s of work left");
        (status.done, status.left_s) = (0, 7260.0);
        assert_eq!(status.line(4), "[    ] 0 of 4 slices, about 2 h 1 min of work left");
    }
}
