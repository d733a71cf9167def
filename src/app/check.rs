//! `shadow-fields check` compares every pass with its CPU twin.

use super::context::Context;
use super::{Global, output};
use crate::check;
use crate::error::{Error, Result};
use clap::Args;

#[derive(Args)]
pub struct Arguments {
    /// Only these passes
    #[arg(value_name = "PASS", value_parser = check::PASSES.map(|(name, _)| name))]
    passes: Vec<String>,
}

/// Compares, prints a line for each comparison, and fails where one did.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let context = Context::new(global)?;
    let info = &context.device.info;
    if !global.json {
        output::say(format!("Passes against their CPU twins on {} ({})", info.name, info.driver));
    }
    let told = |row: &check::CheckRow| {
        if !global.json {
            output::say(format!("{} {}", if row.passed { "passed" } else { "FAILED" }, row.line()));
        }
    };
    let rows = check::run(&context.baker, &arguments.passes, &told)?;
    let failed = rows.iter().filter(|row| !row.passed).count();
    if global.json {
        let report = serde_json::json!({ "origin": context.origin(global), "passed": failed == 0, "rows": rows });
        output::say(format!("{report:#}"));
    }
    let count = rows.len();
    context.finish()?;
    if failed > 0 {
        return Err(Error::Failed(format!("{failed} of {count} comparisons failed")));
    }
    Ok(())
}
