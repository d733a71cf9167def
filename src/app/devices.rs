//! `shadow-fields devices` lists the Vulkan devices of this machine.

use super::{Global, output};
use crate::error::Result;
use crate::gpu::Device;
use clap::Args;

#[derive(Args)]
pub struct Arguments {}

/// Lists the devices, the one that would be taken marked.
pub fn run(global: &Global, _: &Arguments) -> Result<()> {
    let list = Device::list()?;
    let chosen = crate::gpu::select::choose(&list, global.device.as_deref());
    let taken = |index: usize| chosen.as_ref().is_ok_and(|c| c.index == index);
    if global.json {
        let devices: Vec<_> = list
            .iter()
            .map(|d| {
                serde_json::json!({
                    "index": d.index, "name": d.name, "kind": d.kind_name(), "vulkan": d.api, "driver": d.driver,
                    "uuid": d.uuid, "unsuitable": d.unsuitable, "chosen": taken(d.index),
                })
            })
            .collect();
        output::say(serde_json::Value::from(devices).to_string());
    } else {
        let rows: Vec<Vec<String>> = list
            .iter()
            .map(|d| {
                let state = match (&d.unsuitable, taken(d.index)) {
                    (Some(reason), _) => format!("unsuitable: {reason}"),
                    (None, true) => "chosen".into(),
                    (None, false) => "suitable".into(),
                };
                let cells = [&d.index.to_string(), &d.name, d.kind_name(), &d.api, &d.driver, &d.uuid, &state];
                cells.map(String::from).to_vec()
            })
            .collect();
        if !rows.is_empty() {
            output::table(&["index", "name", "kind", "Vulkan", "driver", "uuid", ""], &rows);
        }
    }
    chosen.map(|_| ())
}
