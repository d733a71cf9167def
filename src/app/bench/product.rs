//! `shadow-fields bench product` times one SH product in each of its forms.

use super::common::start;
use crate::app::{Global, output};
use crate::bench::product;
use crate::error::Result;
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench product`.
#[derive(Args)]
pub struct Arguments {
    /// Fewer chains and rounds
    #[arg(long)]
    quick: bool,
    /// Folder for product.csv and product.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Measures and prints the table.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (context, timed) = start(global, arguments.quick, |bench| product::run(bench, &arguments.out))?;
    if global.json {
        output::say(serde_json::to_value(&timed).expect("results are plain data").to_string());
        return context.finish();
    }
    output::say("One product of a chain of 4 bands, on the whole device (64 identical caps: truth 0.77)");
    let rows: Vec<Vec<String>> = timed
        .iter()
        .map(|t| {
            let guard = if t.guard { "on" } else { "off" };
            let ns = t.ns_per_product;
            let mut row = vec![t.product.to_owned(), guard.to_owned(), t.field_bands.to_string()];
            row.push(t.multiply_adds.to_string());
            row.extend([ns.median, ns.lower, ns.upper, t.gflops].map(three));
            row.extend([format!("{:.1e}", t.error), three(t.identical_64)]);
            row
        })
        .collect();
    let header = ["product", "guard", "bands", "FMA", "ns", "quarter", "3 quarters", "GFLOP/s", "f32 error", "64 caps"];
    output::table(&header, &rows);
    context.finish()
}
