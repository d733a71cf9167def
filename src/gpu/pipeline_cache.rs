//! The driver's compiled pipelines on disk. Only what this program wrote, for this very device, reaches a driver.

use super::Checked;
use super::device::Device;
use super::shader::{sealed, unsealed};
use crate::error::Result;
use ash::vk;
use std::path::PathBuf;

impl Device {
    fn pipeline_cache_path(&self) -> Option<PathBuf> {
        Some(self.cache_dir.as_ref()?.join(format!("pipelines-{}.bin", self.info.uuid)))
    }

    /// A pipeline cache that begins with what is on disk.
    pub(super) fn load_pipeline_cache(&self) -> Result<vk::PipelineCache> {
        let file = self.pipeline_cache_path().and_then(|path| crate::files::read(&path).ok()).unwrap_or_default();
        let data = unsealed(&self.pipeline_key, &file).unwrap_or_default();
        if data.is_empty() && !file.is_empty() {
            log::info!("the pipeline cache on disk is damaged or belongs to another driver, and is replaced");
        }
        let create = vk::PipelineCacheCreateInfo::default().initial_data(data);
        // SAFETY: the data is what this device gave before; destroyed in `Drop`.
        unsafe { self.handle.create_pipeline_cache(&create, None) }.checked("vkCreatePipelineCache", "pipeline cache")
    }

    /// Writes the pipeline cache to disk through a temporary file. A failure is logged and is no error.
    pub fn save_pipeline_cache(&self) {
        let Some(path) = self.pipeline_cache_path() else { return };
        // SAFETY: the cache is alive.
        let Ok(data) = (unsafe { self.handle.get_pipeline_cache_data(self.pipeline_cache) }) else { return };
        if let Err(error) = crate::files::replace(&path, &sealed(&self.pipeline_key, &data)) {
            log::warn!("{}: the pipeline cache was not saved: {error}", path.display());
        }
    }
}

/// What a device and its driver tell of the pipelines that they can read.
pub(super) fn key(properties: &vk::PhysicalDeviceProperties) -> String {
    let vk::PhysicalDeviceProperties { vendor_id, device_id, pipeline_cache_uuid, .. } = properties;
    format!("{vendor_id:08x}{device_id:08x}{:032x}", u128::from_be_bytes(*pipeline_cache_uuid))
}
