//! Where Vulkan's functions come from: the system's loader, or what a test puts before it; and the drivers' manifests
//! that the loader reads, for messages where it finds none.

use crate::error::{Error, Result, one_line};
use ash::vk;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Variables that name the files of drivers, or folders of them.
const VARIABLES: [&str; 3] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES"];
/// Folders of drivers' files on a Linux system.
const FOLDERS: [&str; 4] =
    ["/etc/vulkan/icd.d", "/usr/share/vulkan/icd.d", "/usr/local/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];

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
    let variable = VARIABLES[..2].iter().find_map(|name| {
        let value = std::env::var_os(name)?;
        Some(format!("; {name} is {}", value.to_string_lossy()))
    });
    Error::Unsupported(format!(
        "no Vulkan driver found (a software driver is in Debian's package mesa-vulkan-drivers{})",
        variable.unwrap_or_default()
    ))
}

/// The error where a driver's file is not JSON: the loader reports it as a lack of memory.
pub(super) fn broken_manifest() -> Option<Error> {
    let named = VARIABLES.iter().filter_map(std::env::var_os);
    let named: Vec<PathBuf> = named.flat_map(|value| std::env::split_paths(&value).collect::<Vec<_>>()).collect();
    named.into_iter().chain(FOLDERS.map(PathBuf::from)).flat_map(|place| files(&place)).find_map(|file| {
        let text = crate::files::read(&file).ok()?;
        let error = serde_json::from_slice::<serde_json::Value>(&text).err()?;
        let why = one_line(&error.to_string());
        Some(Error::Unsupported(format!("{}: the description of a Vulkan driver is not JSON: {why}", file.display())))
    })
}

/// The file itself, or a folder's files in the format of drivers.
fn files(place: &Path) -> Vec<PathBuf> {
    match std::fs::read_dir(place) {
        Ok(entries) => {
            let paths = entries.flatten().map(|entry| entry.path());
            paths.filter(|path| path.extension().is_some_and(|e| e == "json")).collect()
        }
        Err(_) => vec![place.to_owned()],
    }
}
