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

/// Compares, prints the table, and fails where a comparison did.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let context = Context::new(global)?;
    let told = |row: &check::CheckRow| {
        output::note(global, format!("{} {}", if row.passed { "passed" } else { "FAILED" }, row.line()))
    };
    let all = check::PASSES.map(|(name, _)| name);
    let wanted = |name: &&str| arguments.passes.is_empty() || arguments.passes.iter().any(|pass| pass == name);
    let passes: Vec<&str> = all.into_iter().filter(wanted).collect();
    let rows = check::run(&context.baker, &passes, if global.no_progress { &|_| {} } else { &told })?;
    let failed = rows.iter().filter(|row| !row.passed).count();
    if global.json {
        let report = serde_json::json!({ "origin": context.origin(global), "passed": failed == 0, "rows": rows });
        output::say(format!("{report:#}"));
    } else {
        let info = &context.device.info;
        output::say(format!("Passes against their CPU twins on {} ({})", info.name, info.driver));
        let cells = rows.iter().map(|row| {
            let mark = if row.passed { "passed" } else { "FAILED" };
            vec![
                format!("{}: {}", row.pass, row.what),
                format!("{:.1e}", row.worst),
                format!("{:.0e}", row.tolerance),
                row.measure.to_owned(),
                mark.to_owned(),
            ]
        });
        output::table(&["pass", "worst", "tolerance", "measured in", "result"], &cells.collect::<Vec<_>>());
    }
    let count = rows.len();
    context.finish()?;
    if failed > 0 {
        return Err(Error::Failed(format!("{failed} of {count} comparisons failed")));
    }
    Ok(())
}
