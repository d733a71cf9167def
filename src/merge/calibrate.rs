//! Which variant of the merge is fastest on a device: measured once on a small made-up scene, when a command has done
//! its work, and kept in the cache folder. Until then a device gets a default.

use crate::error::{Error, Result};
use crate::gpu::Device;
use crate::merge::variant::{VARIANTS, Variant};
use crate::merge::workload::Workload;
use crate::shaders::Library;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Driver in its own words; another driver is measured anew.
    pub driver: String,
    /// Version of this program; its shaders differ from another's.
    pub program: String,
    pub fastest: String,
    /// Milliseconds of the made-up scene, by variant; `None` of one that the driver refused.
    pub milliseconds: Vec<(String, Option<f64>)>,
}

/// Vertices of the made-up scene: some hundred workgroups, so that every core has work.
const VERTICES: u32 = 16_384;
/// Occluders that each vertex meets.
const OCCLUDERS: u32 = 8;
/// Timed runs of each variant, interleaved; the least counts, since noise only adds.
const RUNS: u32 = 5;
/// Share of the default's time that another variant may take at most to replace it: its shaders have to be compiled once
/// more, and differences of a tenth are noise on a graphics card.
const WORTH: f64 = 0.9;

fn path(device: &Device) -> Option<PathBuf> {
    Some(device.cache_dir.as_ref()?.join(format!("calibration-{}.json", device.info.uuid)))
}

/// The variant that was measured fastest on the device, with this driver and program.
fn known(device: &Device) -> Option<Variant> {
    let calibration: Calibration = serde_json::from_slice(&crate::files::read(&path(device)?).ok()?).ok()?;
    let names = calibration.milliseconds.iter().map(|(name, _)| name.as_str());
    let same = calibration.driver == device.info.driver
        && calibration.program == env!("CARGO_PKG_VERSION")
        && names.eq(VARIANTS.iter().map(|variant| variant.name));
    same.then(|| Variant::named(&calibration.fastest).ok())?
}

/// The device's fastest variant as far as it is known, at once: as measured, or [`Variant::sane_default`] on a device
/// that was never measured.
pub fn best_known(device: &Device) -> Variant {
    known(device).unwrap_or_else(|| Variant::sane_default(device))
}

/// Measures a device that was never measured and keeps the outcome in its cache folder; nothing where it is known or
/// where there is no such folder. It takes some seconds, most of them the driver's compiler.
pub fn learn(device: &Arc<Device>, library: &Library) -> Result<Option<Calibration>> {
    let Some(path) = path(device).filter(|_| known(device).is_none()) else { return Ok(None) };
    let calibration = measure(device, library)?;
    for (name, milliseconds) in &calibration.milliseconds {
        log::info!("calibration: {name} {:.3} ms", milliseconds.unwrap_or(f64::NAN));
    }
    let bytes = serde_json::to_vec_pretty(&calibration).expect("a calibration is plain data");
    if let Err(error) = crate::files::replace(&path, &bytes) {
        log::warn!("{}: the calibration was not kept: {error}", path.display());
    }
    Ok(Some(calibration))
}

/// Times every variant on a made-up scene: a sky and some turned occluders with fields of default shape. What a driver
/// refuses to compile takes no part.
pub fn measure(device: &Arc<Device>, library: &Library) -> Result<Calibration> {
    let workload = Workload::new(device, VERTICES, OCCLUDERS)?;
    let times = workload.time(library, VARIANTS, RUNS)?;
    let least = times.iter().map(|times| Some(times.as_ref()?.iter().copied().fold(f64::INFINITY, f64::min)));
    let milliseconds: Vec<(String, Option<f64>)> =
        VARIANTS.iter().map(|variant| variant.name.to_owned()).zip(least).collect();
    let default = Variant::sane_default(device).name;
    let weight = |name: &str| if name == default { WORTH } else { 1.0 };
    let weighed = milliseconds.iter().filter_map(|(name, ms)| Some((name, weight(name) * (*ms)?)));
    let (fastest, _) = weighed
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or_else(|| Error::Failed("the driver compiles no variant of the merge".into()))?;
    Ok(Calibration {
        driver: device.info.driver.clone(),
        program: env!("CARGO_PKG_VERSION").into(),
        fastest: fastest.clone(),
        milliseconds,
    })
}
