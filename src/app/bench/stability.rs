//! `shadow-fields bench stability` tests the merge with long chains and extreme scenes.

use super::common::start;
use crate::app::{Global, output};
use crate::bench::refusals::Refusal;
use crate::bench::stability::{self, NEAR_F16, NEAR_F32};
use crate::bench::trials::NEAR_TWIN;
use crate::error::{Error, Result};
use crate::text::three;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench stability`.
#[derive(Args)]
pub struct Arguments {
    /// Chains of up to 64 factors instead of 1 000
    #[arg(long)]
    quick: bool,
    /// Folder for chains.csv, trials.csv, turns.csv, refusals.csv, stability.json and plots
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Measures, prints both tables, and fails where a trial did.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (context, outcome) = start(global, arguments.quick, |bench| stability::run(bench, &arguments.out))?;
    if global.json {
        output::say(serde_json::to_value(&outcome).expect("results are plain data").to_string());
    } else {
        let yes = |good: bool| if good { "yes" } else { "NO" }.to_owned();
        output::say(format!(
            "Irradiance behind chains of caps (1 where nothing blocks). A guarded chain stays from 0 to 1, in f32 within \
             {NEAR_F32:e} of f64,\nwith factors in f16 within {NEAR_F16:e}; 5 to 7 bands of visibility are not guarded"
        ));
        let rows: Vec<Vec<String>> = outcome
            .chains
            .iter()
            .map(|c| {
                let numbers = [c.truth, c.plain, c.guarded, c.f32, c.f16, c.bands_5, c.bands_6, c.bands_7];
                let cells = [c.caps.to_owned(), c.count.to_string()].into_iter().chain(numbers.map(three));
                cells.chain([yes(c.passed)]).collect()
            })
            .collect();
        let header =
            ["caps", "count", "truth", "plain", "guarded", "f32", "f16", "5 bands", "6 bands", "7 bands", "passed"];
        output::table(&header, &rows);
        output::say(format!(
            "\nOdd scenes: everything finite, the same bytes when merged again, radiosity within its bound, and within {NEAR_TWIN:e} \
             of the f64 twin"
        ));
        let rows: Vec<Vec<String>> = outcome
            .trials
            .iter()
            .map(|t| {
                vec![
                    format!("{}, {}", t.name, format!("{:?}", t.storage).to_lowercase()),
                    yes(t.finite),
                    yes(t.repeatable),
                    format!("{:.2e}", t.largest),
                    format!("{:.2e}", t.bound),
                    format!("{:.1e}", t.twin_error),
                    yes(t.passed),
                ]
            })
            .collect();
        output::table(&["scene", "finite", "repeatable", "largest", "bound", "against f64", "passed"], &rows);
        output::say("\nRotations composed of small steps in f32");
        let rows: Vec<Vec<String>> = outcome
            .turns
            .iter()
            .map(|t| {
                let numbers = [format!("{:.7}", t.length), format!("{:.1e}", t.not_orthogonal), three(t.drift_deg)];
                [t.name.to_owned(), t.steps.to_string()].into_iter().chain(numbers).chain([yes(t.passed)]).collect()
            })
            .collect();
        output::table(&["steps", "count", "length", "SH lengths off", "drift, degrees", "passed"], &rows);
        output::say("\nRefused in one line");
        let row = |r: &Refusal| vec![r.name.clone(), yes(r.passed), r.message.clone()];
        output::table(&["input", "passed", "message"], &outcome.refusals.iter().map(row).collect::<Vec<_>>());
    }
    context.finish()?;
    match outcome.failed() {
        [0, _] => Ok(()),
        [failed, all] => Err(Error::Failed(format!("{failed} of {all} trials failed"))),
    }
}
