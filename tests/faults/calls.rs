//! Calls that can fail, with the errors that the specification allows, and calls that destroy what those make.

#![allow(unsafe_code)]

use super::claimed::*;
use super::layer::{Function, born, dies, fault};
use super::special::*;
use ash::vk;
use std::ffi::c_void;
use std::sync::OnceLock;

macro_rules! layer {
    (
        makes { $($make:ident: $make_pfn:ident($owner:ident, $info:ident, $object:ident) [$($make_error:ident)*];)* }
        destroys { $($destroy:ident: $destroy_pfn:ident($keeper:ident, $victim:ident);)* }
        others { $($other:ident: $other_pfn:ident($($parameter:ident: $type:ty),*) [$($other_error:ident)*];)* }
        special { $($special:ident),* $(,)? }
    ) => {
        $(module! {
            $make: $make_pfn(
                owner: vk::$owner, info: *const vk::$info<'_>, allocator: *const vk::AllocationCallbacks<'_>,
                object: *mut vk::$object
            ) -> vk::Result {
                if let Some(error) = fault(stringify!($make), &[$(vk::Result::$make_error),*]) {
                    return error;
                }
                // SAFETY: the caller keeps the contract of this very function, which writes the handle where it succeeds.
                unsafe {
                    let result = REAL.get().expect("wrapped")(owner, info, allocator, object);
                    if result == vk::Result::SUCCESS {
                        born(*object);
                    }
                    result
                }
            }
        })*
        $(module! {
            $destroy: $destroy_pfn(
                owner: vk::$keeper, object: vk::$victim, allocator: *const vk::AllocationCallbacks<'_>
            ) {
                dies(object);
                // SAFETY: the caller keeps the contract of this very function.
                unsafe { REAL.get().expect("wrapped")(owner, object, allocator) }
            }
        })*
        $(module! {
            $other: $other_pfn($($parameter: $type),*) -> vk::Result {
                if let Some(error) = fault(stringify!($other), &[$(vk::Result::$other_error),*]) {
                    return error;
                }
                // SAFETY: the caller keeps the contract of this very function.
                unsafe { REAL.get().expect("wrapped")($($parameter),*) }
            }
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
        vkCreateDevice: PFN_vkCreateDevice(PhysicalDevice, DeviceCreateInfo, Device)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_INITIALIZATION_FAILED ERROR_EXTENSION_NOT_PRESENT
             ERROR_FEATURE_NOT_PRESENT ERROR_TOO_MANY_OBJECTS ERROR_DEVICE_LOST];
        vkCreateDebugUtilsMessengerEXT: PFN_vkCreateDebugUtilsMessengerEXT(
            Instance, DebugUtilsMessengerCreateInfoEXT, DebugUtilsMessengerEXT) [ERROR_OUT_OF_HOST_MEMORY];
        vkCreateXlibSurfaceKHR: PFN_vkCreateXlibSurfaceKHR(Instance, XlibSurfaceCreateInfoKHR, SurfaceKHR)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateXcbSurfaceKHR: PFN_vkCreateXcbSurfaceKHR(Instance, XcbSurfaceCreateInfoKHR, SurfaceKHR)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateSwapchainKHR: PFN_vkCreateSwapchainKHR(Device, SwapchainCreateInfoKHR, SwapchainKHR)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST ERROR_SURFACE_LOST_KHR
             ERROR_NATIVE_WINDOW_IN_USE_KHR ERROR_INITIALIZATION_FAILED];
        vkCreatePipelineCache: PFN_vkCreatePipelineCache(Device, PipelineCacheCreateInfo, PipelineCache)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateBuffer: PFN_vkCreateBuffer(Device, BufferCreateInfo, Buffer)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateBufferView: PFN_vkCreateBufferView(Device, BufferViewCreateInfo, BufferView)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateImage: PFN_vkCreateImage(Device, ImageCreateInfo, Image)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateImageView: PFN_vkCreateImageView(Device, ImageViewCreateInfo, ImageView)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateSampler: PFN_vkCreateSampler(Device, SamplerCreateInfo, Sampler)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_TOO_MANY_OBJECTS];
        vkCreateShaderModule: PFN_vkCreateShaderModule(Device, ShaderModuleCreateInfo, ShaderModule)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreatePipelineLayout: PFN_vkCreatePipelineLayout(Device, PipelineLayoutCreateInfo, PipelineLayout)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateDescriptorSetLayout: PFN_vkCreateDescriptorSetLayout(
            Device, DescriptorSetLayoutCreateInfo, DescriptorSetLayout) [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateDescriptorPool: PFN_vkCreateDescriptorPool(Device, DescriptorPoolCreateInfo, DescriptorPool)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_FRAGMENTATION];
        vkCreateCommandPool: PFN_vkCreateCommandPool(Device, CommandPoolCreateInfo, CommandPool)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateFence: PFN_vkCreateFence(Device, FenceCreateInfo, Fence)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateSemaphore: PFN_vkCreateSemaphore(Device, SemaphoreCreateInfo, Semaphore)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkCreateQueryPool: PFN_vkCreateQueryPool(Device, QueryPoolCreateInfo, QueryPool)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
    }
    destroys {
        vkDestroyDebugUtilsMessengerEXT: PFN_vkDestroyDebugUtilsMessengerEXT(Instance, DebugUtilsMessengerEXT);
        vkDestroySurfaceKHR: PFN_vkDestroySurfaceKHR(Instance, SurfaceKHR);
        vkDestroySwapchainKHR: PFN_vkDestroySwapchainKHR(Device, SwapchainKHR);
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
        vkDestroySemaphore: PFN_vkDestroySemaphore(Device, Semaphore);
        vkDestroyQueryPool: PFN_vkDestroyQueryPool(Device, QueryPool);
        vkDestroyPipeline: PFN_vkDestroyPipeline(Device, Pipeline);
        vkFreeMemory: PFN_vkFreeMemory(Device, DeviceMemory);
    }
    others {
        vkEnumerateInstanceVersion: PFN_vkEnumerateInstanceVersion(version: *mut u32) [ERROR_OUT_OF_HOST_MEMORY];
        vkEnumerateInstanceLayerProperties: PFN_vkEnumerateInstanceLayerProperties(
            count: *mut u32, properties: *mut vk::LayerProperties) [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkEnumeratePhysicalDevices: PFN_vkEnumeratePhysicalDevices(
            instance: vk::Instance, count: *mut u32, devices: *mut vk::PhysicalDevice)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_INITIALIZATION_FAILED];
        vkGetPipelineCacheData: PFN_vkGetPipelineCacheData(
            device: vk::Device, cache: vk::PipelineCache, size: *mut usize, data: *mut c_void)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkBindBufferMemory: PFN_vkBindBufferMemory(
            device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: vk::DeviceSize)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkBindImageMemory: PFN_vkBindImageMemory(
            device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: vk::DeviceSize)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkAllocateCommandBuffers: PFN_vkAllocateCommandBuffers(
            device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, buffers: *mut vk::CommandBuffer)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkAllocateDescriptorSets: PFN_vkAllocateDescriptorSets(
            device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, sets: *mut vk::DescriptorSet)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_FRAGMENTED_POOL ERROR_OUT_OF_POOL_MEMORY];
        vkBeginCommandBuffer: PFN_vkBeginCommandBuffer(
            buffer: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkEndCommandBuffer: PFN_vkEndCommandBuffer(buffer: vk::CommandBuffer)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
        vkQueueSubmit: PFN_vkQueueSubmit(
            queue: vk::Queue, count: u32, infos: *const vk::SubmitInfo<'_>, fence: vk::Fence)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST];
        vkQueueSubmit2: PFN_vkQueueSubmit2(
            queue: vk::Queue, count: u32, infos: *const vk::SubmitInfo2<'_>, fence: vk::Fence)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST];
        vkWaitForFences: PFN_vkWaitForFences(
            device: vk::Device, count: u32, fences: *const vk::Fence, all: vk::Bool32, timeout: u64)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST];
        vkQueueWaitIdle: PFN_vkQueueWaitIdle(queue: vk::Queue)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST];
        vkDeviceWaitIdle: PFN_vkDeviceWaitIdle(device: vk::Device)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST];
        vkGetQueryPoolResults: PFN_vkGetQueryPoolResults(
            device: vk::Device, pool: vk::QueryPool, first: u32, count: u32, size: usize, data: *mut c_void,
            stride: vk::DeviceSize, flags: vk::QueryResultFlags)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST];
        vkGetPhysicalDeviceSurfaceSupportKHR: PFN_vkGetPhysicalDeviceSurfaceSupportKHR(
            physical: vk::PhysicalDevice, family: u32, surface: vk::SurfaceKHR, supported: *mut vk::Bool32)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_SURFACE_LOST_KHR];
        vkGetPhysicalDeviceSurfaceCapabilitiesKHR: PFN_vkGetPhysicalDeviceSurfaceCapabilitiesKHR(
            physical: vk::PhysicalDevice, surface: vk::SurfaceKHR, capabilities: *mut vk::SurfaceCapabilitiesKHR)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_SURFACE_LOST_KHR];
        vkGetPhysicalDeviceSurfaceFormatsKHR: PFN_vkGetPhysicalDeviceSurfaceFormatsKHR(
            physical: vk::PhysicalDevice, surface: vk::SurfaceKHR, count: *mut u32, formats: *mut vk::SurfaceFormatKHR)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_SURFACE_LOST_KHR];
        vkGetPhysicalDeviceSurfacePresentModesKHR: PFN_vkGetPhysicalDeviceSurfacePresentModesKHR(
            physical: vk::PhysicalDevice, surface: vk::SurfaceKHR, count: *mut u32, modes: *mut vk::PresentModeKHR)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_SURFACE_LOST_KHR];
        vkGetSwapchainImagesKHR: PFN_vkGetSwapchainImagesKHR(
            device: vk::Device, swapchain: vk::SwapchainKHR, count: *mut u32, images: *mut vk::Image)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
    }
    special {
        vkEnumerateInstanceExtensionProperties, vkSetDebugUtilsObjectNameEXT, vkCreateInstance, vkDestroyInstance, vkDestroyDevice, vkGetDeviceProcAddr,
        vkAllocateMemory, vkMapMemory, vkCreateComputePipelines, vkCreateGraphicsPipelines, vkAcquireNextImageKHR, vkQueuePresentKHR, vkGetPhysicalDeviceProperties,
        vkGetPhysicalDeviceProperties2, vkGetPhysicalDeviceFeatures2, vkGetPhysicalDeviceQueueFamilyProperties,
        vkGetPhysicalDeviceMemoryProperties, vkGetBufferMemoryRequirements, vkGetImageMemoryRequirements,
    }
}
