//! Which physical device to use: a list of what the machine offers and a rule to pick one.

use crate::error::{Error, Result};
use ash::vk;

/// What a user needs to know of one physical device.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Position in the loader's list; `--device INDEX` names it.
    pub index: usize,
    /// The driver's name of the device.
    pub name: String,
    /// Kind of device.
    pub kind: vk::PhysicalDeviceType,
    /// Highest Vulkan version, as `major.minor.patch`.
    pub api: String,
    /// Driver name and version in the driver's own words.
    pub driver: String,
    /// Device UUID as 32 hexadecimal digits.
    pub uuid: String,
    /// Why this device cannot be used, if it cannot.
    pub unsuitable: Option<String>,
}

impl Candidate {
    /// Whether shaders run on the host's processor.
    pub fn is_software(&self) -> bool {
        self.kind == vk::PhysicalDeviceType::CPU
    }

    /// One word for the kind.
    pub fn kind_name(&self) -> &'static str {
        match self.kind {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
            vk::PhysicalDeviceType::CPU => "cpu",
            _ => "other",
        }
    }

    fn rank(&self) -> usize {
        match self.kind {
            vk::PhysicalDeviceType::DISCRETE_GPU => 0,
            vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
            vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
            vk::PhysicalDeviceType::CPU => 3,
            _ => 4,
        }
    }
}

/// Picks a device by index, UUID (hyphens ignored) or part of its name; without a word the first of the best kind, GPUs
/// before processors.
///
/// # Errors
/// `Unsupported` when there is no device, none matches, several names match different devices equally well, or the match
/// lacks something that is required.
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
        Error::Unsupported(format!("no device matches \"{word}\" (there is: {})", names.join(", ")))
    })?;
    match &found.unsuitable {
        Some(reason) => Err(Error::Unsupported(format!("{}: {reason}", found.name))),
        None => Ok(found),
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
