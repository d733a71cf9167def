//! `shadow-fields bench stability` tests the merge with long chains and extreme scenes.

use super::common::{start, table};
use crate::app::{Global, output};
use crate::bench::stability::{self, NEAR_F16, NEAR_F32};
use crate::bench::trials::NEAR_TWIN;
use crate::error::{Error, Result};
use clap::Args;
use std::path::PathBuf;

/// Arguments of `bench stability`.
#[derive(Args)]
pub struct Arguments {
    /// Chains of up to 64 factors instead of 1 000
    #[arg(long)]
    quick: bool,
    /// Folder for chains.csv, trials.csv and stability.json
    #[arg(short, long = "output", alias = "out", value_name = "DIR")]
    out: PathBuf,
}

/// Measures, prints both tables, and fails where a trial did.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (context, outcome) =
        start(global, arguments.quick, &arguments.out, |bench| stability::run(bench, &arguments.out))?;
    if global.json {
        output::say(serde_json::to_value(&outcome).expect("results are plain data").to_string());
    } else {
        output::say(format!(
            "Irradiance behind chains of caps (1 where nothing blocks). A guarded chain stays from 0 to 1, in f32 within \
             {NEAR_F32:e} of f64,\nwith factors in f16 within {NEAR_F16:e}; 5 to 7 bands of visibility are not guarded"
        ));
        let columns = [
            ("caps", "/caps"),
            ("count", "/cap_count"),
            ("truth", "/truth_relative"),
            ("plain", "/plain_relative"),
            ("guarded", "/guarded_relative"),
            ("f32", "/guarded_f32_relative"),
            ("f16", "/guarded_f16_relative"),
            ("5 bands", "/plain_5_bands_relative"),
            ("6 bands", "/plain_6_bands_relative"),
            ("7 bands", "/plain_7_bands_relative"),
            ("passed", "/passed"),
        ];
        table(&outcome.chains, &columns);
        output::say(format!(
            "\nOdd scenes: everything finite, the same bytes when merged again, radiosity within its bound, and within {NEAR_TWIN:e} \
             of the f64 twin"
        ));
        let columns = [
            ("scene", "/name"),
            ("fields", "/storage"),
            ("finite", "/finite"),
            ("repeatable", "/repeatable"),
            ("largest", "/largest_radiosity"),
            ("bound", "/bound_radiosity"),
            ("against f64", "/twin_error_relative"),
            ("passed", "/passed"),
        ];
        table(&outcome.trials, &columns);
    }
    context.finish()?;
    match outcome.failed() {
        [0, _] => Ok(()),
        [failed, all] => Err(Error::Failed(format!("{failed} of {all} trials failed"))),
    }
}
