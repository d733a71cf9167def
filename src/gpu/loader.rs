//! Where Vulkan's functions come from: the system's loader, or what a test puts before it.

use crate::error::{Error, Result};
use ash::vk;
use std::sync::OnceLock;

/// Variables that name the files of drivers.
const VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

static BEFORE: OnceLock<vk::PFN_vkGetInstanceProcAddr> = OnceLock::new();

/// Puts a function before the system's loader, for the rest of the process: every function of every instance and device
/// that is made from now on is asked of it. A test finds calls, makes them fail and counts objects with it. The first
/// caller decides.
///
/// # Safety
/// The function keeps the contract of `vkGetInstanceProcAddr`, and so do the functions that it returns, until the
/// process ends.
pub unsafe fn stand_before(function: vk::PFN_vkGetInstanceProcAddr) {
    BEFORE.get_or_init(|| function);
}

/// The functions that need no instance.
pub(super) fn entry() -> Result<ash::Entry> {
    if let Some(function) = BEFORE.get() {
        // SAFETY: whoever stands before the loader keeps its contract.
        return Ok(unsafe { ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr: *function }) });
    }
    // SAFETY: loading the system's Vulkan loader runs its initialisers, which are trusted like any shared library.
    unsafe { ash::Entry::load() }.map_err(|error| {
        Error::Unsupported(format!("no Vulkan loader found ({error}); Debian's package is libvulkan1"))
    })
}

/// The error where the loader has no driver to ask.
pub(super) fn no_driver() -> Error {
    let variable = VARIABLES.iter().find_map(|name| {
        let value = std::env::var_os(name)?;
        Some(format!("; {name} is {}", value.to_string_lossy()))
    });
    Error::Unsupported(format!(
        "no Vulkan driver found (a software driver is in Debian's package mesa-vulkan-drivers{})",
        variable.unwrap_or_default()
    ))
}
