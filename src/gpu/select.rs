//! Lists the physical devices and selects one of them.

use super::Checked;
use crate::error::{Error, Result};
use ash::vk;
use std::ffi::CStr;

/// Kinds of devices, the best first.
const KINDS: [(vk::PhysicalDeviceType, &str); 4] = [
    (vk::PhysicalDeviceType::DISCRETE_GPU, "discrete"),
    (vk::PhysicalDeviceType::INTEGRATED_GPU, "integrated"),
    (vk::PhysicalDeviceType::VIRTUAL_GPU, "virtual"),
    (vk::PhysicalDeviceType::CPU, "cpu"),
];

/// One physical device, as `devices` prints it.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Position in the loader's list; `--device INDEX` names it.
    pub index: usize,
    pub name: String,
    pub kind: vk::PhysicalDeviceType,
    /// Highest supported Vulkan version, as `major.minor.patch`.
    pub api: String,
    /// Driver name and version as the driver reports them.
    pub driver: String,
    /// Device UUID as 32 hexadecimal digits.
    pub uuid: String,
    /// Why this device cannot be used, if it cannot.
    pub unsuitable: Option<String>,
}

impl Candidate {
    /// Whether shaders run on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == vk::PhysicalDeviceType::CPU
    }

    /// Whether its compiler takes minutes for long shaders without loops.
    pub fn wants_loops(&self) -> bool {
        self.name.contains("SwiftShader")
    }

    pub fn kind_name(&self) -> &'static str {
        KINDS.iter().find(|(kind, _)| *kind == self.kind).map_or("other", |(_, name)| name)
    }

    fn rank(&self) -> usize {
        KINDS.iter().position(|(kind, _)| *kind == self.kind).unwrap_or(KINDS.len())
    }
}

/// Selects a device by index, UUID (hyphens are ignored) or part of its name; without `word`, the first of the best
/// kind, GPUs before CPUs.
///
/// # Errors
/// `Unsupported` when there is no device, when none or several match, or when the match lacks a required feature.
pub fn choose<'c>(candidates: &'c [Candidate], word: Option<&str>) -> Result<&'c Candidate> {
    if candidates.is_empty() {
        return Err(Error::Unsupported(
            "no Vulkan device found (a software driver is in Debian's package mesa-vulkan-drivers)".into(),
        ));
    }
    let Some(word) = word else {
        return candidates.iter().filter(|c| c.unsuitable.is_none()).min_by_key(|c| c.rank()).ok_or_else(|| {
            let reasons: Vec<_> = candidates
                .iter()
                .map(|c| format!("{}: {}", c.name, c.unsuitable.as_deref().unwrap_or_default()))
                .collect();
            Error::Unsupported(format!("no suitable Vulkan device ({})", reasons.join("; ")))
        });
    };
    let uuid = word.replace('-', "").to_lowercase();
    let lower = word.to_lowercase();
    let found = match word.parse::<usize>() {
        Ok(index) if index < candidates.len() => Some(&candidates[index]),
        _ => candidates.iter().find(|c| c.uuid == uuid).or_else(|| {
            let named = |c: &&Candidate| c.name.to_lowercase().contains(&lower);
            candidates.iter().filter(named).min_by_key(|c| (c.unsuitable.is_some(), c.rank()))
        }),
    };
    let found = found.ok_or_else(|| {
        let names: Vec<_> = candidates.iter().map(|c| format!("{} {}", c.index, c.name)).collect();
        Error::Unsupported(format!("no device matches \"{word}\"; available: {}", names.join(", ")))
    })?;
    match &found.unsuitable {
        Some(reason) => Err(Error::Unsupported(format!("{}: {reason}", found.name))),
        None => Ok(found),
    }
}

pub(super) fn queue_family(families: &[vk::QueueFamilyProperties]) -> Option<u32> {
    families.iter().position(serves).and_then(|index| u32::try_from(index).ok())
}

/// Whether queues of a family do graphics, compute and timestamps.
pub(super) fn serves(family: &vk::QueueFamilyProperties) -> bool {
    let needed = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    family.queue_flags.contains(needed) && family.timestamp_valid_bits > 0
}

pub(super) fn version_text(version: u32) -> String {
    let major = vk::api_version_major(version);
    let minor = vk::api_version_minor(version);
    let patch = vk::api_version_patch(version);
    format!("{major}.{minor}.{patch}")
}

pub(super) fn physical_devices(instance: &ash::Instance) -> Result<Vec<(vk::PhysicalDevice, Candidate)>> {
    // SAFETY: a query on a live instance. Without a driver the list is empty.
    let handles = match unsafe { instance.enumerate_physical_devices() } {
        Err(vk::Result::ERROR_INITIALIZATION_FAILED | vk::Result::ERROR_INCOMPATIBLE_DRIVER) => Vec::new(),
        other => other.checked("vkEnumeratePhysicalDevices", "instance")?,
    };
    Ok(handles.into_iter().enumerate().map(|(index, handle)| (handle, describe(instance, index, handle))).collect())
}

pub(super) fn describe(instance: &ash::Instance, index: usize, physical: vk::PhysicalDevice) -> Candidate {
    let mut identity = vk::PhysicalDeviceIDProperties::default();
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut both = vk::PhysicalDeviceProperties2::default().push_next(&mut identity).push_next(&mut driver);
    let mut core_1_3 = vk::PhysicalDeviceVulkan13Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut core_1_3);
    // SAFETY: for the whole block, queries on live handles with structs that outlive the calls; structs are only chained
    // if the device supports their version.
    let (properties, families) = unsafe {
        let properties = instance.get_physical_device_properties(physical);
        if properties.api_version >= vk::API_VERSION_1_2 {
            instance.get_physical_device_properties2(physical, &mut both);
        }
        if properties.api_version >= vk::API_VERSION_1_3 {
            instance.get_physical_device_features2(physical, &mut features);
        }
        (properties, instance.get_physical_device_queue_family_properties(physical))
    };
    let unsuitable = if properties.api_version < vk::API_VERSION_1_3 {
        Some(format!("supports Vulkan {}, but 1.3 is needed", version_text(properties.api_version)))
    } else if core_1_3.dynamic_rendering == vk::FALSE {
        Some("lacks the feature dynamicRendering".into())
    } else if core_1_3.synchronization2 == vk::FALSE {
        Some("lacks the feature synchronization2".into())
    } else if queue_family(&families).is_none() {
        Some("has no queue with graphics, compute and timestamps".into())
    } else {
        None
    };
    let text = |found: &CStr| found.to_string_lossy().into_owned();
    let driver_name = driver.driver_name_as_c_str().map(text).unwrap_or_default();
    let driver_info = driver.driver_info_as_c_str().map(text).unwrap_or_default();
    let driver = match (driver_name.is_empty(), driver_info.is_empty()) {
        (true, _) => format!("driver version {}", properties.driver_version),
        (false, true) => driver_name,
        (false, false) => format!("{driver_name}, {driver_info}"),
    };
    Candidate {
        index,
        name: properties.device_name_as_c_str().map(text).unwrap_or_default(),
        kind: properties.device_type,
        api: version_text(properties.api_version),
        driver,
        uuid: identity.device_uuid.iter().map(|byte| format!("{byte:02x}")).collect(),
        unsuitable,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(index: usize, name: &str, kind: vk::PhysicalDeviceType, unsuitable: Option<&str>) -> Candidate {
        Candidate {
            index,
            name: name.into(),
            kind,
            api: "1.3.0".into(),
            driver: "test".into(),
            uuid: format!("{index:032x}"),
            unsuitable: unsuitable.map(String::from),
        }
    }

    #[test]
    fn gpu_before_processor_and_words_select() {
        let list = [
            candidate(0, "llvmpipe", vk::PhysicalDeviceType::CPU, None),
            candidate(1, "Old GPU", vk::PhysicalDeviceType::DISCRETE_GPU, Some("Vulkan 1.1")),
            candidate(2, "New GPU", vk::PhysicalDeviceType::DISCRETE_GPU, None),
        ];
        assert_eq!(choose(&list, None).unwrap().index, 2);
        assert_eq!(choose(&list, Some("0")).unwrap().index, 0);
        assert_eq!(choose(&list, Some("LLVM")).unwrap().index, 0);
        assert_eq!(choose(&list, Some("gpu")).unwrap().index, 2, "a suitable match comes first");
        assert_eq!(choose(&list, Some("00000000-0000-0000-0000-000000000002")).unwrap().index, 2);
        assert_eq!(choose(&list, Some("1")).unwrap_err().exit_code(), 3);
        assert_eq!(choose(&list, Some("absent")).unwrap_err().exit_code(), 3);
        assert_eq!(choose(&[], None).unwrap_err().exit_code(), 3);
    }
}
