//! A layer between the program and Vulkan, in the same process: it counts the calls that can fail and makes one of them fail, keeps
//! a census of objects, and changes what a device claims to have.

#![allow(unsafe_code)]

use ash::vk::{self, Handle};
use std::collections::BTreeSet;
use std::ffi::{CStr, c_char, c_void};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// A call that can fail, with the errors that the specification allows and that do not need an extension or a structure which the
/// program does not use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Call {
    pub name: &'static str,
    pub errors: &'static [vk::Result],
}

/// Which call is to fail, counted from 0, and with which of its errors.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub at: usize,
    pub error: usize,
}

/// What a device claims to have: each function changes what the driver said.
#[derive(Clone, Copy)]
pub struct Claims {
    pub properties: fn(&mut vk::PhysicalDeviceProperties),
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
        Claims {
            properties: |_| (),
            features: |_| (),
            family: |_| (),
            extension: |_| true,
            splits_memory: false,
            heap_bytes: None,
        }
    }
}

/// What was seen during a watch.
#[derive(Debug, Default)]
pub struct Heard {
    /// Calls that could fail, in order.
    pub calls: Vec<Call>,
    /// The call that failed, and its error.
    pub fired: Option<(Call, vk::Result)>,
    /// Objects that were not destroyed.
    pub left: Vec<String>,
    /// What no valid program does: an object destroyed twice, memory mapped that the host cannot see.
    pub wrong: Vec<String>,
}

#[derive(Default)]
struct State {
    heard: Heard,
    plan: Option<Plan>,
    claims: Claims,
    /// Whether the device was lost: all that can tell so does, from then on.
    lost: bool,
    live: BTreeSet<(i32, u64)>,
    /// Memory that the host cannot see.
    unseen: BTreeSet<u64>,
    instance: vk::Instance,
}

static STATE: OnceLock<Mutex<State>> = OnceLock::new();

fn state() -> MutexGuard<'static, State> {
    STATE.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs something and tells what was seen. One watch at a time.
pub fn watch<R>(plan: Option<Plan>, claims: Claims, run: impl FnOnce() -> R) -> (R, Heard) {
    // SAFETY: the function answers with the loader's functions or with wrappers of the same kind, all of which are static.
    unsafe { shadow_fields::gpu::loader::stand_before(instance_address) };
    *state() = State { plan, claims, ..State::default() };
    let outcome = run();
    let mut state = state();
    let mut heard = std::mem::take(&mut state.heard);
    let kind = |(kind, handle): &(i32, u64)| format!("{:?} {handle:#x}", vk::ObjectType::from_raw(*kind));
    heard.left = state.live.iter().map(kind).collect();
    *state = State::default();
    (outcome, heard)
}

/// Runs something whose words on stdout nobody wants to read.
pub fn without_stdout<R>(run: impl FnOnce() -> R) -> R {
    /// Stdout, to be put back.
    struct Kept(i32);
    impl Drop for Kept {
        fn drop(&mut self) {
            // SAFETY: the descriptor is a copy of stdout that nobody else knows.
            unsafe {
                libc::dup2(self.0, 1);
                libc::close(self.0);
            }
        }
    }
    let nowhere = std::fs::File::options().write(true).open("/dev/null").unwrap();
    // SAFETY: both descriptors are open.
    let _kept = unsafe {
        let kept = Kept(libc::dup(1));
        libc::dup2(std::os::fd::AsRawFd::as_raw_fd(&nowhere), 1);
        kept
    };
    run()
}

/// Notes a call and answers with the error that it is to have, if any.
fn fault(name: &'static str, errors: &'static [vk::Result]) -> Option<vk::Result> {
    let (error, devices) = {
        let mut state = state();
        let (index, call) = (state.heard.calls.len(), Call { name, errors });
        state.heard.calls.push(call);
        if state.lost && errors.contains(&vk::Result::ERROR_DEVICE_LOST) {
            return Some(vk::Result::ERROR_DEVICE_LOST);
        }
        let plan = state.plan.filter(|plan| plan.at == index)?;
        let error = errors[plan.error % errors.len()];
        state.heard.fired = Some((call, error));
        state.lost = error == vk::Result::ERROR_DEVICE_LOST;
        let device =
            |(kind, raw): &(i32, u64)| (*kind == vk::ObjectType::DEVICE.as_raw()).then(|| vk::Device::from_raw(*raw));
        let devices: Vec<_> = if state.lost { state.live.iter().filter_map(device).collect() } else { Vec::new() };
        (error, devices)
    };
    // A lost device executes nothing any more.
    for device in devices {
        if let Some(wait) = vkDeviceWaitIdle::REAL.get() {
            // SAFETY: the device is in the census; the program uses one queue on one thread at a time.
            let _ = unsafe { wait(device) };
        }
    }
    Some(error)
}

fn born<H: Handle + Copy>(handle: H) {
    state().live.insert((H::TYPE.as_raw(), handle.as_raw()));
}

fn dies<H: Handle + Copy>(handle: H) {
    let mut state = state();
    state.unseen.remove(&handle.as_raw());
    if !handle.is_null() && !state.live.remove(&(H::TYPE.as_raw(), handle.as_raw())) {
        state.heard.wrong.push(format!("{:?} {:#x} was destroyed, which does not exist", H::TYPE, handle.as_raw()));
    }
}

type Function = unsafe extern "system" fn();

/// The loader itself.
fn loader() -> vk::PFN_vkGetInstanceProcAddr {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    // SAFETY: the system's loader is trusted, and is never unloaded.
    ENTRY.get_or_init(|| unsafe { ash::Entry::load() }.expect("a loader")).static_fn().get_instance_proc_addr
}

/// As `vkGetInstanceProcAddr`, with wrappers.
unsafe extern "system" fn instance_address(instance: vk::Instance, name: *const c_char) -> Option<Function> {
    // SAFETY: the caller keeps the contract of this very function.
    let (real, name) = unsafe { (loader()(instance, name)?, CStr::from_ptr(name)) };
    // SAFETY: the name is that of the function.
    unsafe { find(name.to_str().unwrap_or_default(), real) }
}

/// As `vkGetDeviceProcAddr`, with wrappers of the loader's own functions, which serve every device.
unsafe extern "system" fn device_address(device: vk::Device, name: *const c_char) -> Option<Function> {
    let instance = state().instance;
    let real = vkGetDeviceProcAddr::REAL.get().expect("an instance was loaded before its device");
    // SAFETY: the caller keeps the contract of this very function, and the device keeps its instance alive.
    let (of_device, of_loader, name) = unsafe { (real(device, name)?, loader()(instance, name), CStr::from_ptr(name)) };
    // SAFETY: the name is that of the function.
    let wrapped = of_loader.and_then(|real| unsafe { find(name.to_str().unwrap_or_default(), real) });
    wrapped.filter(|wrapped| Some(*wrapped as usize) != of_loader.map(|real| real as usize)).or(Some(of_device))
}

/// A module for each function that is wrapped: where the loader's own function is kept, and the wrapper.
macro_rules! module {
    ($name:ident: $pfn:ident($($parameter:ident: $type:ty),*) $(-> $result:ty)? $body:block) => {
        #[allow(non_snake_case)]
        mod $name {
            #[allow(unused_imports)]
            use super::*;
            pub static REAL: OnceLock<vk::$pfn> = OnceLock::new();

            /// # Safety
            /// `real` is the Vulkan function of this name.
            pub unsafe fn wrap(real: Function) -> Function {
                // SAFETY: both are pointers to functions, of the kind that the name says.
                unsafe {
                    REAL.get_or_init(|| std::mem::transmute::<Function, vk::$pfn>(real));
                    std::mem::transmute::<vk::$pfn, Function>(call)
                }
            }

            /// # Safety
            /// That of the Vulkan function.
            unsafe extern "system" fn call($($parameter: $type),*) $(-> $result)? $body
        }
    };
}

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
        unsafe fn find(name: &str, real: Function) -> Option<Function> {
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

type Allocator<'a> = vk::AllocationCallbacks<'a>;

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
        vkSetDebugUtilsObjectNameEXT: PFN_vkSetDebugUtilsObjectNameEXT(
            device: vk::Device, info: *const vk::DebugUtilsObjectNameInfoEXT<'_>)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY];
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
        vkAcquireNextImageKHR: PFN_vkAcquireNextImageKHR(
            device: vk::Device, swapchain: vk::SwapchainKHR, timeout: u64, semaphore: vk::Semaphore, fence: vk::Fence,
            index: *mut u32)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST ERROR_OUT_OF_DATE_KHR ERROR_SURFACE_LOST_KHR];
        vkQueuePresentKHR: PFN_vkQueuePresentKHR(queue: vk::Queue, info: *const vk::PresentInfoKHR<'_>)
            [ERROR_OUT_OF_HOST_MEMORY ERROR_OUT_OF_DEVICE_MEMORY ERROR_DEVICE_LOST ERROR_OUT_OF_DATE_KHR ERROR_SURFACE_LOST_KHR];
    }
    special {
        vkEnumerateInstanceExtensionProperties, vkCreateInstance, vkDestroyInstance, vkDestroyDevice, vkGetDeviceProcAddr,
        vkAllocateMemory, vkMapMemory, vkCreateComputePipelines, vkCreateGraphicsPipelines, vkGetPhysicalDeviceProperties,
        vkGetPhysicalDeviceProperties2, vkGetPhysicalDeviceFeatures2, vkGetPhysicalDeviceQueueFamilyProperties,
        vkGetPhysicalDeviceMemoryProperties, vkGetBufferMemoryRequirements, vkGetImageMemoryRequirements,
    }
}

const OUT_OF_MEMORY: &[vk::Result] = &[vk::Result::ERROR_OUT_OF_HOST_MEMORY, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY];

module! {
    vkGetDeviceProcAddr: PFN_vkGetDeviceProcAddr(device: vk::Device, name: *const c_char) -> Option<Function> {
        // SAFETY: the caller keeps the contract of this very function.
        unsafe { device_address(device, name) }
    }
}

module! {
    vkEnumerateInstanceExtensionProperties: PFN_vkEnumerateInstanceExtensionProperties(
        layer: *const c_char, count: *mut u32, out: *mut vk::ExtensionProperties
    ) -> vk::Result {
        const ERRORS: &[vk::Result] = &[
            vk::Result::ERROR_OUT_OF_HOST_MEMORY, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_LAYER_NOT_PRESENT,
        ];
        if let Some(error) = fault("vkEnumerateInstanceExtensionProperties", ERRORS) {
            return error;
        }
        let has = state().claims.extension;
        // SAFETY: the caller keeps the contract of this very function.
        unsafe {
            let result = REAL.get().expect("wrapped")(layer, count, out);
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
}

module! {
    vkCreateInstance: PFN_vkCreateInstance(
        info: *const vk::InstanceCreateInfo<'_>, allocator: *const Allocator<'_>, out: *mut vk::Instance
    ) -> vk::Result {
        const ERRORS: &[vk::Result] = &[
            vk::Result::ERROR_OUT_OF_HOST_MEMORY, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            vk::Result::ERROR_INITIALIZATION_FAILED, vk::Result::ERROR_LAYER_NOT_PRESENT,
            vk::Result::ERROR_EXTENSION_NOT_PRESENT, vk::Result::ERROR_INCOMPATIBLE_DRIVER,
        ];
        if let Some(error) = fault("vkCreateInstance", ERRORS) {
            return error;
        }
        // SAFETY: the caller keeps the contract of this very function, which writes the handle where it succeeds.
        unsafe {
            let result = REAL.get().expect("wrapped")(info, allocator, out);
            if result == vk::Result::SUCCESS {
                born(*out);
                state().instance = *out;
            }
            result
        }
    }
}

module! {
    vkDestroyInstance: PFN_vkDestroyInstance(instance: vk::Instance, allocator: *const Allocator<'_>) {
        dies(instance);
        // SAFETY: the caller keeps the contract of this very function.
        unsafe { REAL.get().expect("wrapped")(instance, allocator) }
    }
}

module! {
    vkDestroyDevice: PFN_vkDestroyDevice(device: vk::Device, allocator: *const Allocator<'_>) {
        dies(device);
        // SAFETY: the caller keeps the contract of this very function.
        unsafe { REAL.get().expect("wrapped")(device, allocator) }
    }
}

/// The memory type that the driver has, and the one beside it that [`Claims::splits_memory`] adds.
const OF_DEVICE: u32 = 0;
const OF_HOST: u32 = 1;

module! {
    vkAllocateMemory: PFN_vkAllocateMemory(
        device: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, allocator: *const Allocator<'_>,
        out: *mut vk::DeviceMemory
    ) -> vk::Result {
        const ERRORS: &[vk::Result] = &[
            vk::Result::ERROR_OUT_OF_HOST_MEMORY, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_TOO_MANY_OBJECTS,
        ];
        if let Some(error) = fault("vkAllocateMemory", ERRORS) {
            return error;
        }
        let splits = state().claims.splits_memory;
        // SAFETY: the caller keeps the contract of this very function; both claimed types are the driver's only one.
        unsafe {
            let mut own = *info;
            if splits {
                own.memory_type_index = 0;
            }
            let result = REAL.get().expect("wrapped")(device, &raw const own, allocator, out);
            if result == vk::Result::SUCCESS {
                born(*out);
                if splits && (*info).memory_type_index == OF_DEVICE {
                    state().unseen.insert((*out).as_raw());
                }
            }
            result
        }
    }
}

module! {
    vkMapMemory: PFN_vkMapMemory(
        device: vk::Device, memory: vk::DeviceMemory, offset: vk::DeviceSize, size: vk::DeviceSize,
        flags: vk::MemoryMapFlags, data: *mut *mut c_void
    ) -> vk::Result {
        const ERRORS: &[vk::Result] = &[
            vk::Result::ERROR_OUT_OF_HOST_MEMORY, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_MEMORY_MAP_FAILED,
        ];
        if let Some(error) = fault("vkMapMemory", ERRORS) {
            return error;
        }
        let mut state = state();
        if state.unseen.contains(&memory.as_raw()) {
            state.heard.wrong.push("memory was mapped that the host cannot see".into());
        }
        drop(state);
        // SAFETY: the caller keeps the contract of this very function.
        unsafe { REAL.get().expect("wrapped")(device, memory, offset, size, flags, data) }
    }
}

macro_rules! pipelines {
    ($name:ident, $pfn:ident, $info:ident) => {
        module! {
            $name: $pfn(
                device: vk::Device, cache: vk::PipelineCache, count: u32, infos: *const vk::$info<'_>,
                allocator: *const Allocator<'_>, out: *mut vk::Pipeline
            ) -> vk::Result {
                if let Some(error) = fault(stringify!($name), OUT_OF_MEMORY) {
                    // SAFETY: the caller has room for `count` handles, which are null where creation fails.
                    unsafe { std::slice::from_raw_parts_mut(out, count as usize) }.fill(vk::Pipeline::null());
                    return error;
                }
                // SAFETY: the caller keeps the contract of this very function, which writes all handles.
                unsafe {
                    let result = REAL.get().expect("wrapped")(device, cache, count, infos, allocator, out);
                    let made = std::slice::from_raw_parts(out, count as usize);
                    made.iter().filter(|pipeline| !pipeline.is_null()).for_each(|pipeline| born(*pipeline));
                    result
                }
            }
        }
    };
}

pipelines!(vkCreateComputePipelines, PFN_vkCreateComputePipelines, ComputePipelineCreateInfo);
pipelines!(vkCreateGraphicsPipelines, PFN_vkCreateGraphicsPipelines, GraphicsPipelineCreateInfo);

module! {
    vkGetPhysicalDeviceProperties: PFN_vkGetPhysicalDeviceProperties(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceProperties
    ) {
        let change = state().claims.properties;
        // SAFETY: the caller keeps the contract of this very function, which writes the struct.
        unsafe {
            REAL.get().expect("wrapped")(physical, out);
            change(&mut *out);
        }
    }
}

module! {
    vkGetPhysicalDeviceProperties2: PFN_vkGetPhysicalDeviceProperties2(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceProperties2<'_>
    ) {
        let change = state().claims.properties;
        // SAFETY: the caller keeps the contract of this very function, which writes the struct.
        unsafe {
            REAL.get().expect("wrapped")(physical, out);
            change(&mut (*out).properties);
        }
    }
}

module! {
    vkGetPhysicalDeviceFeatures2: PFN_vkGetPhysicalDeviceFeatures2(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceFeatures2<'_>
    ) {
        let change = state().claims.features;
        // SAFETY: the caller keeps the contract of this very function, which writes the structs of a chain, each of which begins
        // with its type and the next.
        unsafe {
            REAL.get().expect("wrapped")(physical, out);
            let mut next = (*out).p_next.cast::<vk::BaseOutStructure<'_>>();
            while !next.is_null() {
                if (*next).s_type == vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES {
                    change(&mut *next.cast());
                }
                next = (*next).p_next.cast();
            }
        }
    }
}

module! {
    vkGetPhysicalDeviceQueueFamilyProperties: PFN_vkGetPhysicalDeviceQueueFamilyProperties(
        physical: vk::PhysicalDevice, count: *mut u32, out: *mut vk::QueueFamilyProperties
    ) {
        let change = state().claims.family;
        // SAFETY: the caller keeps the contract of this very function, which writes `count` structs if there is room for them.
        unsafe {
            REAL.get().expect("wrapped")(physical, count, out);
            if !out.is_null() {
                std::slice::from_raw_parts_mut(out, *count as usize).iter_mut().for_each(change);
            }
        }
    }
}

module! {
    vkGetPhysicalDeviceMemoryProperties: PFN_vkGetPhysicalDeviceMemoryProperties(
        physical: vk::PhysicalDevice, out: *mut vk::PhysicalDeviceMemoryProperties
    ) {
        let Claims { splits_memory: splits, heap_bytes, .. } = state().claims;
        // SAFETY: the caller keeps the contract of this very function, which writes the struct.
        unsafe {
            REAL.get().expect("wrapped")(physical, out);
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
}

macro_rules! requirements {
    ($name:ident, $pfn:ident, $object:ident) => {
        module! {
            $name: $pfn(device: vk::Device, object: vk::$object, out: *mut vk::MemoryRequirements) {
                let splits = state().claims.splits_memory;
                // SAFETY: the caller keeps the contract of this very function, which writes the struct.
                unsafe {
                    REAL.get().expect("wrapped")(device, object, out);
                    if splits {
                        (*out).memory_type_bits = 1 << OF_DEVICE | 1 << OF_HOST;
                    }
                }
            }
        }
    };
}

requirements!(vkGetBufferMemoryRequirements, PFN_vkGetBufferMemoryRequirements, Buffer);
requirements!(vkGetImageMemoryRequirements, PFN_vkGetImageMemoryRequirements, Image);
