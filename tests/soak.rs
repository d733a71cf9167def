//! Thousands of frames of a moving scene whose entities change; `bench soak` draws a million.

mod common;

use common::{cache_dir, library, report, skip};
use shadow_fields::bake::Baker;
use shadow_fields::bake::cache::Cache;
use shadow_fields::bench::{Bench, soak};
use shadow_fields::gpu::{Device, DeviceOptions};
use std::path::Path;

#[test]
fn frames_neither_drift_nor_take_more_memory() {
    // Not under the validation layer, which keeps what it has seen.
    let options = DeviceOptions { cache_dir: Some(cache_dir()), ..DeviceOptions::default() };
    let device = match Device::new(&options) {
        Ok(device) => device,
        Err(error) => return skip(&error.to_string()),
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fields-soak");
    let (baker, cache) = (Baker::new(&device, &library()), Cache::new(Some(&folder)));
    let bench = Bench {
        baker: &baker,
        cache: &cache,
        progress: &|_| (),
        quick: true,
        seed: 1,
        origin: serde_json::Value::Null,
    };
    let outcome = soak::run(&bench, 2500, None).unwrap();
    report(&format!("{outcome:?}"));
    assert!(outcome.compared > 2000, "{outcome:?}");
    assert_eq!(outcome.faults(), [""; 0]);
}
