//! Calls whose wrappers do more than fail: those that make instances, memory and pipelines.

#![allow(unsafe_code)]

use super::claimed::OF_DEVICE;
use super::layer::{Function, MEMORY, born, device_address, dies, fault, state};
use ash::vk::{self, Handle};
use std::ffi::{c_char, c_void};
use std::sync::OnceLock;

type Allocator<'a> = vk::AllocationCallbacks<'a>;

module! {
    vkGetDeviceProcAddr: PFN_vkGetDeviceProcAddr(device: vk::Device, name: *const c_char) -> Option<Function> {
        device_address(device, name)
    }
}

module! {
    vkEnumerateInstanceExtensionProperties: PFN_vkEnumerateInstanceExtensionProperties(
        layer: *const c_char, count: *mut u32, out: *mut vk::ExtensionProperties
    ) -> vk::Result [MEMORY] {
        let has = state().claims.extension;
        let result = real(layer, count, out);
        if result == vk::Result::SUCCESS && !out.is_null() {
            for one in std::slice::from_raw_parts_mut(out, *count as usize) {
                if one.extension_name_as_c_str().is_ok_and(|name| !has(name)) {
                    one.extension_name = [0; 256];
                }
            }
        }
        result
    }
}

module! {
    vkSetDebugUtilsObjectNameEXT: PFN_vkSetDebugUtilsObjectNameEXT(
        device: vk::Device, info: *const vk::DebugUtilsObjectNameInfoEXT<'_>
    ) -> vk::Result [MEMORY] {
        if (*info).object_type == vk::ObjectType::DESCRIPTOR_SET {
            state().heard.wrong.push("a descriptor set was named, which lavapipe of Mesa 22.3 never frees".into());
        }
        real(device, info)
    }
}

module! {
    vkCreateInstance: PFN_vkCreateInstance(
        info: *const vk::InstanceCreateInfo<'_>, allocator: *const Allocator<'_>, out: *mut vk::Instance
    ) -> vk::Result [MEMORY] {
        let result = real(info, allocator, out);
        if result == vk::Result::SUCCESS {
            born(*out);
            state().instance = *out;
        }
        result
    }
}

module! {
    vkDestroyInstance: PFN_vkDestroyInstance(instance: vk::Instance, allocator: *const Allocator<'_>) {
        dies(instance);
        real(instance, allocator);
    }
}

module! {
    vkDestroyDevice: PFN_vkDestroyDevice(device: vk::Device, allocator: *const Allocator<'_>) {
        dies(device);
        real(device, allocator);
    }
}

module! {
    vkAllocateMemory: PFN_vkAllocateMemory(
        device: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, allocator: *const Allocator<'_>,
        out: *mut vk::DeviceMemory
    ) -> vk::Result [MEMORY] {
        let splits = state().claims.splits_memory;
        let mut own = *info;
        if splits {
            // Both claimed types are the driver's only one.
            own.memory_type_index = 0;
        }
        let result = real(device, &raw const own, allocator, out);
        if result == vk::Result::SUCCESS {
            born(*out);
            if splits && (*info).memory_type_index == OF_DEVICE {
                state().census.hide(*out);
            }
        }
        result
    }
}

module! {
    vkMapMemory: PFN_vkMapMemory(
        device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize,
        flags: vk::MemoryMapFlags, data: *mut *mut c_void
    ) -> vk::Result [MEMORY] {
        let mut state = state();
        if state.census.is_hidden(memory) {
            state.heard.wrong.push("memory was mapped that the host cannot see".into());
        }
        drop(state);
        real(device, memory, offset, size, flags, data)
    }
}

macro_rules! pipelines {
    ($name:ident, $pfn:ident, $info:ident) => {
        module! {
            $name: $pfn(
                device: vk::Device, cache: vk::PipelineCache, count: u32, infos: *const vk::$info<'_>,
                allocator: *const Allocator<'_>, out: *mut vk::Pipeline
            ) -> vk::Result {
                if let Some(error) = fault(stringify!($name), MEMORY) {
                    // The caller has room for `count` handles, which are null where creation fails.
                    std::slice::from_raw_parts_mut(out, count as usize).fill(vk::Pipeline::null());
                    return error;
                }
                let result = real(device, cache, count, infos, allocator, out);
                let made = std::slice::from_raw_parts(out, count as usize);
                made.iter().filter(|pipeline| !pipeline.is_null()).for_each(|pipeline| born(*pipeline));
                result
            }
        }
    };
}

pipelines!(vkCreateComputePipelines, PFN_vkCreateComputePipelines, ComputePipelineCreateInfo);
pipelines!(vkCreateGraphicsPipelines, PFN_vkCreateGraphicsPipelines, GraphicsPipelineCreateInfo);
