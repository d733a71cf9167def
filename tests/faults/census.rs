//! A census of Vulkan objects: what was made and not destroyed.

use ash::vk::{self, Handle};
use std::collections::BTreeSet;

#[derive(Default)]
pub struct Census {
    /// Kind and handle of every object that exists.
    live: BTreeSet<(i32, u64)>,
    unseen: BTreeSet<u64>,
}

impl Census {
    pub fn born<H: Handle>(&mut self, handle: H) {
        self.live.insert((H::TYPE.as_raw(), handle.as_raw()));
    }

    /// What is wrong with it, if anything. To destroy a null handle does nothing.
    pub fn dies<H: Handle + Copy>(&mut self, handle: H) -> Option<String> {
        self.unseen.remove(&handle.as_raw());
        let known = handle.is_null() || self.live.remove(&(H::TYPE.as_raw(), handle.as_raw()));
        (!known).then(|| format!("{:?} {:#x} was destroyed, which does not exist", H::TYPE, handle.as_raw()))
    }

    pub fn hide(&mut self, memory: vk::DeviceMemory) {
        self.unseen.insert(memory.as_raw());
    }

    pub fn is_hidden(&self, memory: vk::DeviceMemory) -> bool {
        self.unseen.contains(&memory.as_raw())
    }

    pub fn devices(&self) -> Vec<vk::Device> {
        let of_kind = |(kind, _): &&(i32, u64)| *kind == vk::ObjectType::DEVICE.as_raw();
        self.live.iter().filter(of_kind).map(|(_, raw)| vk::Device::from_raw(*raw)).collect()
    }

    /// Every object that exists, in words.
    pub fn left(&self) -> Vec<String> {
        let words = |(kind, raw): &(i32, u64)| format!("{:?} {raw:#x}", vk::ObjectType::from_raw(*kind));
        self.live.iter().map(words).collect()
    }
}
