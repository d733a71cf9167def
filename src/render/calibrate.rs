//! Which variant of the merge is fastest on a device: measured once on a small made-up scene and kept in the cache folder.

use super::merge::Merge;
use super::variant::{VARIANTS, Variant};
use super::workload::Workload;
use crate::error::Result;
use crate::gpu::Device;
use crate::shaders::Library;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// What was measured on a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Driver in its own words; another driver is measured anew.
    pub driver: String,
    /// Version of this program; its shaders differ from another's.
    pub program: String,
    /// Name of the fastest variant.
    pub fastest: String,
    /// Milliseconds of the made-up scene, by variant.
    pub milliseconds: Vec<(String, f64)>,
}

/// Vertices of the made-up scene: some hundred workgroups, so that every core has work.
const VERTICES: u32 = 16_384;
/// Occluders that each vertex meets.
const OCCLUDERS: u32 = 8;
/// Timed runs of each variant, interleaved; the least counts, since noise only adds.
const RUNS: usize = 5;

fn path(device: &Device) -> Option<PathBuf> {
    Some(device.cache_dir.as_ref()?.join(format!("calibration-{}.json", device.info.uuid)))
}

/// The device's fastest variant: from the cache folder, else measured and kept there. Without a cache folder nothing is
/// measured and the device gets [`Variant::sane_default`].
///
/// # Errors
/// As [`measure`].
pub fn fastest(device: &Arc<Device>, library: &Library) -> Result<Variant> {
    let Some(path) = path(device) else { return Ok(Variant::sane_default(device)) };
    let known = std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice::<Calibration>(&bytes).ok());
    let known = known.filter(|c| c.driver == device.info.driver && c.program == env!("CARGO_PKG_VERSION"));
    if let Some(variant) = known.and_then(|c| Variant::named(&c.fastest).ok()) {
        return Ok(variant);
    }
    let calibration = measure(device, library)?;
    for (name, milliseconds) in &calibration.milliseconds {
        log::info!("calibration: {name} {milliseconds:.3} ms");
    }
    let bytes = serde_json::to_vec_pretty(&calibration).expect("a calibration is plain data");
    if let Err(error) = crate::files::replace(&path, &bytes) {
        log::warn!("{}: the calibration was not kept: {error}", path.display());
    }
    Variant::named(&calibration.fastest)
}

/// Times every variant on a made-up scene: a sky and some turned occluders with fields of default shape.
///
/// # Errors
/// `Failed` when a shader does not compile, `Device` when the device is lost.
pub fn measure(device: &Arc<Device>, library: &Library) -> Result<Calibration> {
    let workload = Workload::new(device, VERTICES, OCCLUDERS)?;
    let mut contenders = Vec::new();
    for &variant in VARIANTS {
        let merge = Merge::new(device, library, workload.form(variant))?;
        contenders.push((variant, merge, workload.inputs(variant)?, f64::INFINITY));
    }
    for run in 0..=RUNS {
        for (_, merge, inputs, least) in &mut contenders {
            let milliseconds = workload.run(merge, inputs)?;
            // The first run compiles.
            if run > 0 {
                *least = least.min(milliseconds);
            }
        }
    }
    let best = contenders.iter().min_by(|a, b| a.3.total_cmp(&b.3)).expect("there are variants");
    Ok(Calibration {
        driver: device.info.driver.clone(),
        program: env!("CARGO_PKG_VERSION").into(),
        fastest: best.0.name.into(),
        milliseconds: contenders.iter().map(|(variant, .., least)| (variant.name.into(), *least)).collect(),
    })
}
