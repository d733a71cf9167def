//! Checks whether a scene's fields fit a device, before they are baked, and its lists.

use super::ALIGNMENT;
use crate::bake::SceneNeeds;
use crate::error::{Error, Result};
use crate::gpu::Device;
use ash::vk;

/// Refuses a scene whose fields the device cannot hold. Other buffers are refused once their sizes are known.
pub fn check(device: &Device, baked: &SceneNeeds) -> Result<()> {
    check_fields(baked.field_bytes(ALIGNMENT), &device.limits, device.heap_bytes())
}

fn check_fields(bytes: u64, limits: &vk::PhysicalDeviceLimits, heap_bytes: u64) -> Result<()> {
    let most = heap_bytes.min(u64::from(limits.max_storage_buffer_range));
    if bytes > most {
        return Err(Error::Input(format!(
            "the scene's fields take {bytes} bytes, the device takes {most}: use a smaller --lattice or f16 storage"
        )));
    }
    Ok(())
}

/// Entries that a merge takes on a software device: llvmpipe (Mesa 22.3) ends all loops of an invocation after 65 535
/// iterations together, without a word, and an entry takes up to two.
const SOFTWARE_ENTRIES: u32 = 30_000;

/// Refuses a list of entries that is longer than a software device goes through.
pub fn check_entries(longest: u32) -> Result<()> {
    if longest > SOFTWARE_ENTRIES {
        return Err(Error::Input(format!(
            "{longest} lookups of occluders and lights matter to one cluster of vertices, a software device makes at most {SOFTWARE_ENTRIES}: \
             use fewer lights or occluders, or a larger --eps"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_that_do_not_fit_are_refused_with_numbers() {
        let limits = vk::PhysicalDeviceLimits { max_storage_buffer_range: 1000, ..Default::default() };
        check_fields(1000, &limits, 1000).unwrap();
        for heap_bytes in [1000, 2000] {
            let error = check_fields(1001, &limits, heap_bytes).unwrap_err();
            assert_eq!(error.exit_code(), 4);
            assert!(error.to_string().contains("1001") && error.to_string().contains("1000"), "{error}");
        }
        check_fields(900, &limits, 800).unwrap_err();
    }

    #[test]
    fn a_list_beyond_the_loop_limit_is_refused_with_numbers() {
        check_entries(SOFTWARE_ENTRIES).unwrap();
        let error = check_entries(SOFTWARE_ENTRIES + 1).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("30001") && error.to_string().contains("--eps"), "{error}");
    }
}
