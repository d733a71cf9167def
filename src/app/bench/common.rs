//! Shared set-up and tables of the measurements of `bench`.

use crate::app::context::Context;
use crate::app::{Global, output, outputs};
use crate::bench::Bench;
use crate::error::Result;
use crate::text::three;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;
use std::time::Instant;

/// Makes the folder of results and opens the device, measures with progress on stderr, and hands back device and
/// outcome.
pub fn start<T>(
    global: &Global,
    quick: bool,
    folder: &Path,
    measure: impl FnOnce(&Bench<'_>) -> Result<T>,
) -> Result<(Context, T)> {
    outputs::check_folder("--output", folder, &[])?;
    let context = Context::new(global)?;
    let started = Instant::now();
    let show = |what: &str| {
        if !global.no_progress {
            output::note(global, format!("{:6.1} s  {what}", started.elapsed().as_secs_f64()));
        }
    };
    let outcome = measure(&bench(&context, global, quick, &show))?;
    Ok((context, outcome))
}

/// The measurements' view of an open device.
pub fn bench<'b>(context: &'b Context, global: &Global, quick: bool, progress: &'b dyn Fn(&str)) -> Bench<'b> {
    let origin = context.origin(global);
    Bench { baker: &context.baker, cache: &context.cache, progress, quick, seed: global.seed, origin }
}

/// Prints rows of results: each column is its header and the JSON pointer of its value in a row.
pub fn table(rows: &impl Serialize, columns: &[(&str, &str)]) {
    let rows = serde_json::to_value(rows).expect("results are plain data");
    let rows = rows.as_array().map_or(&[][..], Vec::as_slice);
    let cell = |row: &Value, pointer: &str| match row.pointer(pointer) {
        None | Some(Value::Null) => "-".to_owned(),
        Some(Value::Bool(yes)) => if *yes { "yes" } else { "NO" }.to_owned(),
        Some(Value::Number(number)) if number.is_f64() => three(number.as_f64().expect("it is f64")),
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    };
    let cells = rows.iter().map(|row| columns.iter().map(|(_, pointer)| cell(row, pointer)).collect());
    let header: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    output::table(&header, &cells.collect::<Vec<_>>());
}
