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
    pub(super) fn load_pipeline_cache(&self, properties: &vk::PhysicalDeviceProperties) -> Result<vk::PipelineCache> {
        let file = self.pipeline_cache_path().and_then(|path| crate::files::read(&path).ok()).unwrap_or_default();
        let data = trusted(&file, properties).unwrap_or_default();
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
        if let Err(error) = crate::files::replace(&path, &sealed("", &data)) {
            log::warn!("{}: the pipeline cache was not saved: {error}", path.display());
        }
    }
}

/// The data of a file; `None` if it was not sealed, or if it does not start with a version-one header of this very
/// device (Vulkan specification, "Pipeline Cache Header").
pub fn trusted<'f>(file: &'f [u8], properties: &vk::PhysicalDeviceProperties) -> Option<&'f [u8]> {
    let data = unsealed("", file)?;
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes(b.try_into().expect("four bytes")));
    let one = vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32;
    let fits = word(0).is_some_and(|length| length >= 32 && length as usize <= data.len())
        && word(4) == Some(one)
        && word(8) == Some(properties.vendor_id)
        && word(12) == Some(properties.device_id)
        && data.get(16..32) == Some(&properties.pipeline_cache_uuid[..]);
    fits.then_some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_and_damaged_pipeline_caches_are_refused() {
        let mut properties = vk::PhysicalDeviceProperties { vendor_id: 7, device_id: 9, ..Default::default() };
        properties.pipeline_cache_uuid[3] = 5;
        let mut data = Vec::new();
        for word in [32_u32, 1, 7, 9] {
            data.extend(word.to_le_bytes());
        }
        data.extend(properties.pipeline_cache_uuid);
        data.extend([1, 2, 3]);
        assert_eq!(trusted(&sealed("", &data), &properties), Some(&data[..]));
        for at in [0, 4, 8, 12, 19] {
            let mut foreign = data.clone();
            foreign[at] ^= 0x40;
            assert!(trusted(&sealed("", &foreign), &properties).is_none(), "byte {at}");
        }
        for at in [0, 31, 32, 66] {
            let mut damaged = sealed("", &data);
            damaged[at] ^= 0x40;
            assert!(trusted(&damaged, &properties).is_none(), "byte {at}");
        }
        assert!(trusted(&sealed("", &data[..31]), &properties).is_none());
        assert!(trusted(&data, &properties).is_none() && trusted(&[], &properties).is_none());
    }
}
