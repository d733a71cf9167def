//! What a device claims to have, which may be less than it has.

#![allow(unsafe_code)]

use super::layer::{Function, state};
use ash::vk;
use std::ffi::CStr;
use std::sync::OnceLock;

/// What a device claims to have: each function changes what the driver said.
#[derive(Clone, Copy)]
pub struct Claims {
    pub api_version: u32,
    pub limits: fn(&mut vk::PhysicalDeviceLimits),
    pub features: fn(&mut vk::PhysicalDeviceVulkan13Features<'_>),
    pub family: fn(&mut vk::QueueFamilyProperties),
    /// Whether the instance has an extension that it has.
    pub extension: fn(&CStr) -> bool,
    /// Whether memory of the device cannot be seen by the host, as on a graphics card.
    pub splits_memory: bool,
    /// Bytes of device memory, where they are fewer than there are.
    pub heap_bytes: Option<u64>,
}

impl Default for Claims {
    fn default() -> Self {
        Claims::NONE
    }
}

impl Claims {
    pub const NONE: Self = Claims {
        api_version: u32::MAX,
        limits: |_| (),
        features: |_| (),
        family: |_| (),
        extension: |_| true,
        splits_memory: false,
        heap_bytes: None,
    };

    fn change(&self, properties: &mut vk::PhysicalDeviceProperties) {
        properties.api_version = properties.api_version.min(self.api_version);
        (self.limits)(&mut properties.limits);
    }
}

/// The memory type that the driver has, and the one beside it that [`Claims::splits_memory`] adds.
pub const OF_DEVICE: u32 = 0;
const OF_HOST: u32 = 1;

module! {
    vkGetPhysicalDeviceProperties: PFN_vkGetPhysicalDeviceProperties(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceProperties
    ) {
        let claims = state().claims;
        real(physical, out);
        claims.change(&mut *out);
    }
}

module! {
    vkGetPhysicalDeviceProperties2: PFN_vkGetPhysicalDeviceProperties2(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceProperties2<'_>
    ) {
        let claims = state().claims;
        real(physical, out);
        claims.change(&mut (*out).properties);
    }
}

module! {
    vkGetPhysicalDeviceFeatures2: PFN_vkGetPhysicalDeviceFeatures2(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceFeatures2<'_>
    ) {
        let change = state().claims.features;
        real(physical, out);
        // Each struct of a chain begins with its type and the next.
        let mut next = (*out).p_next.cast::<vk::BaseOutStructure<'_>>();
        while !next.is_null() {
            if (*next).s_type == vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES {
                change(&mut *next.cast());
            }
            next = (*next).p_next.cast();
        }
    }
}

module! {
    vkGetPhysicalDeviceQueueFamilyProperties: PFN_vkGetPhysicalDeviceQueueFamilyProperties(
        physical: vk::PhysicalDevice, count: *mut u32, out: *mut vk::QueueFamilyProperties
    ) {
        let change = state().claims.family;
        real(physical, count, out);
        if !out.is_null() {
            std::slice::from_raw_parts_mut(out, *count as usize).iter_mut().for_each(change);
        }
    }
}

module! {
    vkGetPhysicalDeviceMemoryProperties: PFN_vkGetPhysicalDeviceMemoryProperties(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceMemoryProperties
    ) {
        let Claims { splits_memory: splits, heap_bytes, .. } = state().claims;
        real(physical, out);
        if let Some(bytes) = heap_bytes {
            (*out).memory_heaps.iter_mut().for_each(|heap| heap.size = heap.size.min(bytes));
        }
        if splits {
            use vk::MemoryPropertyFlags as Flags;
            assert_eq!((*out).memory_type_count, 1, "memory can be split where there is one type of it");
            (*out).memory_type_count = 2;
            (*out).memory_types[OF_DEVICE as usize].property_flags = Flags::DEVICE_LOCAL;
            (*out).memory_types[OF_HOST as usize] =
                vk::MemoryType { property_flags: Flags::HOST_VISIBLE | Flags::HOST_COHERENT, heap_index: 0 };
        }
    }
}

macro_rules! requirements {
    ($name:ident, $pfn:ident, $object:ident) => {
        module! {
            $name: $pfn(device: vk::Device, object: vk::$object, out: *mut vk::MemoryRequirements) {
                let splits = state().claims.splits_memory;
                real(device, object, out);
                if splits {
                    (*out).memory_type_bits = 1 << OF_DEVICE | 1 << OF_HOST;
                }
            }
        }
    };
}

requirements!(vkGetBufferMemoryRequirements, PFN_vkGetBufferMemoryRequirements, Buffer);
requirements!(vkGetImageMemoryRequirements, PFN_vkGetImageMemoryRequirements, Image);
