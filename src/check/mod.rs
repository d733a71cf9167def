//! Every pass held against its CPU twin on one device: what `check` prints and what the tests of the passes assert.
//!
//! A comparison answers with a [`CheckRow`]: its worst error beside the tolerance and the reason for it. Nothing is
//! read but the embedded scenes and shaders (or those that replace them), and fields are baked anew.

pub mod assemble;
pub mod bounce;
pub mod capture;
pub mod draw;
pub mod gloss;
pub mod merge;
pub mod project;
pub mod sharp;
pub mod show;

use crate::bake::Baker;
use crate::error::Result;
use serde::Serialize;

#[derive(Clone, Debug, Serialize)]
pub struct CheckRow {
    /// Pass, by the one word that names it everywhere.
    pub pass: &'static str,
    /// The input that was compared.
    pub what: String,
    pub measure: &'static str,
    /// The worst error; infinite where an outcome is no number, differs from run to run or shows nothing to compare.
    #[serde(serialize_with = "finite_or_text")]
    pub worst: f64,
    /// The largest error that passes.
    pub tolerance: f64,
    pub passed: bool,
}

/// JSON knows no infinity.
fn finite_or_text<S: serde::Serializer>(value: &f64, to: S) -> std::result::Result<S::Ok, S::Error> {
    if value.is_finite() { to.serialize_f64(*value) } else { to.serialize_str("infinite") }
}

impl CheckRow {
    /// A comparison's outcome. An error that is no number does not pass.
    pub fn new(pass: &'static str, what: impl Into<String>, measure: &'static str, worst: f64, tolerance: f64) -> Self {
        let worst = if worst.is_nan() { f64::INFINITY } else { worst };
        CheckRow { pass, what: what.into(), measure, worst, tolerance, passed: worst <= tolerance }
    }

    /// The row as a line for people.
    pub fn line(&self) -> String {
        format!("{} {}: {:.1e} of {:.0e} ({})", self.pass, self.what, self.worst, self.tolerance, self.measure)
    }
}

/// The comparisons of one pass, each told as it comes.
type PassCheck = fn(&Baker, &mut dyn FnMut(CheckRow)) -> Result<()>;

/// Every pass in the order of execution, by the one word that names it everywhere.
pub const PASSES: [(&str, PassCheck); 10] = [
    ("capture", capture::rows),
    ("project", project::rows),
    ("assemble", assemble::rows),
    ("merge", merge::rows),
    ("sharp", sharp::rows),
    ("bounce", bounce::rows),
    ("gloss", gloss::rows),
    ("draw", draw::rows),
    ("smooth", draw::smooth_rows),
    ("show", show::rows),
];

/// Runs every comparison of the given passes, of all where none is given; `told` hears each row as it comes.
pub fn run(baker: &Baker, passes: &[String], told: &dyn Fn(&CheckRow)) -> Result<Vec<CheckRow>> {
    let mut rows = Vec::new();
    let is_wanted = |name: &str| passes.is_empty() || passes.iter().any(|pass| pass == name);
    for (_, part) in PASSES.iter().filter(|(name, _)| is_wanted(name)) {
        part(baker, &mut |row| {
            told(&row);
            rows.push(row);
        })?;
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_numbers_within_the_tolerance_pass() {
        let passed = |worst| CheckRow::new("merge", "", "", worst, 1e-3).passed;
        assert!(passed(0.0) && passed(1e-3));
        assert!(!passed(1.1e-3) && !passed(f64::NAN) && !passed(f64::INFINITY));
        let json = serde_json::to_string(&CheckRow::new("merge", "", "", f64::NAN, 1e-3)).unwrap();
        assert!(json.contains("\"infinite\"") && json.contains("false"), "{json}");
    }
}
