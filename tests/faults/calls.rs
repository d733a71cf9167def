//! Calls that can fail, with errors that the specification allows, and calls that destroy what those make.

#![allow(unsafe_code)]

use super::claimed::*;
use super::layer::{Function, HOST_MEMORY, LOST, MEMORY, born, dies, fault};
use super::special::*;
use ash::vk;
use std::ffi::c_void;
use std::sync::OnceLock;

macro_rules! layer {
    (
        makes { $($make:ident: $make_pfn:ident($owner:ident, $info:ident, $object:ident) [$make_error:ident];)* }
        destroys { $($destroy:ident: $destroy_pfn:ident($keeper:ident, $victim:ident);)* }
        others { $($other:ident: $other_pfn:ident($($parameter:ident: $type:ty),*) [$other_error:ident];)* }
        special { $($special:ident),* $(,)? }
    ) => {
        $(module! {
            $make: $make_pfn(
                owner: vk::$owner, info: *const vk::$info<'_>, allocator: *const vk::AllocationCallbacks<'_>,
                object: *mut vk::$object
            ) -> vk::Result [$make_error] {
                let result = real(owner, info, allocator, object);
                if result == vk::Result::SUCCESS {
                    born(*object);
                }
                result
            }
        })*
        $(module! {
            $destroy: $destroy_pfn(
                owner: vk::$keeper, object: vk::$victim, allocator: *const vk::AllocationCallbacks<'_>
            ) {
                dies(object);
                real(owner, object, allocator);
            }
        })*
        $(module! {
            $other: $other_pfn($($parameter: $type),*) -> vk::Result [$other_error] { real($($parameter),*) }
        })*

        /// The wrapper of a function, or the function itself where it has none.
        ///
        /// # Safety
        /// `real` is the Vulkan function of that name.
        pub unsafe fn find(name: &str, real: Function) -> Option<Function> {
            // SAFETY: the name is that of the function.
            unsafe {
                $(if name == stringify!($make) { return Some($make::wrap(real)); })*
                $(if name == stringify!($destroy) { return Some($destroy::wrap(real)); })*
                $(if name == stringify!($other) { return Some($other::wrap(real)); })*
                $(if name == stringify!($special) { return Some($special::wrap(real)); })*
            }
            Some(real)
        }
    };
}

layer! {
    makes {
        vkCreateDevice: PFN_vkCreateDevice(PhysicalDevice, DeviceCreateInfo, Device) [LOST];
        vkCreateDebugUtilsMessengerEXT: PFN_vkCreateDebugUtilsMessengerEXT(
            Instance, DebugUtilsMessengerCreateInfoEXT, DebugUtilsMessengerEXT) [HOST_MEMORY];
        vkCreatePipelineCache: PFN_vkCreatePipelineCache(Device, PipelineCacheCreateInfo, PipelineCache) [MEMORY];
        vkCreateBuffer: PFN_vkCreateBuffer(Device, BufferCreateInfo, Buffer) [MEMORY];
        vkCreateBufferView: PFN_vkCreateBufferView(Device, BufferViewCreateInfo, BufferView) [MEMORY];
        vkCreateImage: PFN_vkCreateImage(Device, ImageCreateInfo, Image) [MEMORY];
        vkCreateImageView: PFN_vkCreateImageView(Device, ImageViewCreateInfo, ImageView) [MEMORY];
        vkCreateSampler: PFN_vkCreateSampler(Device, SamplerCreateInfo, Sampler) [MEMORY];
        vkCreateShaderModule: PFN_vkCreateShaderModule(Device, ShaderModuleCreateInfo, ShaderModule) [MEMORY];
        vkCreatePipelineLayout: PFN_vkCreatePipelineLayout(Device, PipelineLayoutCreateInfo, PipelineLayout) [MEMORY];
        vkCreateDescriptorSetLayout: PFN_vkCreateDescriptorSetLayout(
            Device, DescriptorSetLayoutCreateInfo, DescriptorSetLayout) [MEMORY];
        vkCreateDescriptorPool: PFN_vkCreateDescriptorPool(Device, DescriptorPoolCreateInfo, DescriptorPool) [MEMORY];
        vkCreateCommandPool: PFN_vkCreateCommandPool(Device, CommandPoolCreateInfo, CommandPool) [MEMORY];
        vkCreateFence: PFN_vkCreateFence(Device, FenceCreateInfo, Fence) [MEMORY];
        vkCreateQueryPool: PFN_vkCreateQueryPool(Device, QueryPoolCreateInfo, QueryPool) [MEMORY];
    }
    destroys {
        vkDestroyDebugUtilsMessengerEXT: PFN_vkDestroyDebugUtilsMessengerEXT(Instance, DebugUtilsMessengerEXT);
        vkDestroyPipelineCache: PFN_vkDestroyPipelineCache(Device, PipelineCache);
        vkDestroyBuffer: PFN_vkDestroyBuffer(Device, Buffer);
        vkDestroyBufferView: PFN_vkDestroyBufferView(Device, BufferView);
        vkDestroyImage: PFN_vkDestroyImage(Device, Image);
        vkDestroyImageView: PFN_vkDestroyImageView(Device, ImageView);
        vkDestroySampler: PFN_vkDestroySampler(Device, Sampler);
        vkDestroyShaderModule: PFN_vkDestroyShaderModule(Device, ShaderModule);
        vkDestroyPipelineLayout: PFN_vkDestroyPipelineLayout(Device, PipelineLayout);
        vkDestroyDescriptorSetLayout: PFN_vkDestroyDescriptorSetLayout(Device, DescriptorSetLayout);
        vkDestroyDescriptorPool: PFN_vkDestroyDescriptorPool(Device, DescriptorPool);
        vkDestroyCommandPool: PFN_vkDestroyCommandPool(Device, CommandPool);
        vkDestroyFence: PFN_vkDestroyFence(Device, Fence);
        vkDestroyQueryPool: PFN_vkDestroyQueryPool(Device, QueryPool);
        vkDestroyPipeline: PFN_vkDestroyPipeline(Device, Pipeline);
        vkFreeMemory: PFN_vkFreeMemory(Device, DeviceMemory);
    }
    others {
        vkEnumerateInstanceVersion: PFN_vkEnumerateInstanceVersion(version: *mut u32) [HOST_MEMORY];
        vkEnumerateInstanceLayerProperties: PFN_vkEnumerateInstanceLayerProperties(
            count: *mut u32, properties: *mut vk::LayerProperties) [MEMORY];
        vkEnumeratePhysicalDevices: PFN_vkEnumeratePhysicalDevices(
            instance: vk::Instance, count: *mut u32, devices: *mut vk::PhysicalDevice) [MEMORY];
        vkGetPipelineCacheData: PFN_vkGetPipelineCacheData(
            device: vk::Device, cache: vk::PipelineCache, size: *mut usize, data: *mut c_void) [MEMORY];
        vkBindBufferMemory: PFN_vkBindBufferMemory(
            device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize) [MEMORY];
        vkBindImageMemory: PFN_vkBindImageMemory(
            device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: vk::DeviceSize) [MEMORY];
        vkAllocateCommandBuffers: PFN_vkAllocateCommandBuffers(
            device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, buffers: *mut vk::CommandBuffer) [MEMORY];
        vkAllocateDescriptorSets: PFN_vkAllocateDescriptorSets(
            device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, sets: *mut vk::DescriptorSet) [MEMORY];
        vkBeginCommandBuffer: PFN_vkBeginCommandBuffer(
            buffer: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>) [MEMORY];
        vkEndCommandBuffer: PFN_vkEndCommandBuffer(buffer: vk::CommandBuffer) [MEMORY];
        vkQueueSubmit2: PFN_vkQueueSubmit2(
            queue: vk::Queue, count: u32, infos: *const vk::SubmitInfo2<'_>, fence: vk::Fence) [LOST];
        vkWaitForFences: PFN_vkWaitForFences(
            device: vk::Device, count: u32, fences: *const vk::Fence, all: vk::Bool32, timeout: u64) [LOST];
        vkDeviceWaitIdle: PFN_vkDeviceWaitIdle(device: vk::Device) [LOST];
        vkGetQueryPoolResults: PFN_vkGetQueryPoolResults(
            device: vk::Device, pool: vk::QueryPool, first: u32, count: u32, size: usize, data: *mut c_void,
            stride: vk::DeviceSize, flags: vk::QueryResultFlags) [LOST];
    }
    special {
        vkEnumerateInstanceExtensionProperties, vkSetDebugUtilsObjectNameEXT, vkCreateInstance, vkDestroyInstance, vkDestroyDevice, vkGetDeviceProcAddr,
        vkAllocateMemory, vkMapMemory, vkCreateComputePipelines, vkCreateGraphicsPipelines, vkGetPhysicalDeviceProperties,
        vkGetPhysicalDeviceProperties2, vkGetPhysicalDeviceFeatures2, vkGetPhysicalDeviceQueueFamilyProperties,
        vkGetPhysicalDeviceMemoryProperties, vkGetBufferMemoryRequirements, vkGetImageMemoryRequirements,
    }
}
