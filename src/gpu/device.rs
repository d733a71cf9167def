//! Logical device and queue: the root that every other Vulkan object keeps alive.

use super::Checked;
use super::instance::Instance;
use super::pipeline::CachedPipeline;
use super::select::{Candidate, choose, physical_devices, queue_family};
use super::shader::{sealed, unsealed};
use super::validation::Validation;
use crate::error::Result;
use ash::vk;
use std::collections::HashMap;
use std::ffi::{CStr, CString};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The caller's choices for a device.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// Index, UUID or part of a name; `None` takes the best device.
    pub device: Option<String>,
    /// Which validation checks run.
    pub validation: Validation,
    /// Folder for compiled shaders and the pipeline cache; `None` keeps nothing on disk.
    pub cache_dir: Option<PathBuf>,
}

/// Features of Vulkan 1.3 that a device must have been made with. Nothing else has to be enabled, and no extension.
pub fn required_features() -> vk::PhysicalDeviceVulkan13Features<'static> {
    vk::PhysicalDeviceVulkan13Features::default().dynamic_rendering(true).synchronization2(true)
}

pub(super) struct Parts {
    pub physical: vk::PhysicalDevice,
    pub handle: ash::Device,
    pub queue: vk::Queue,
    pub queue_family: u32,
    pub info: Candidate,
    pub is_shared: bool,
}

/// The logical device, its one queue (graphics and compute) and what is known of the hardware.
///
/// Everything that owns a Vulkan object holds an `Arc<Device>`.
pub struct Device {
    pub(super) handle: ash::Device,
    #[cfg(feature = "view")]
    pub(super) physical: vk::PhysicalDevice,
    /// Whether a caller made the device, uses its queue too and destroys it.
    pub(super) is_shared: bool,
    pub(super) queue: Mutex<vk::Queue>,
    /// Fences of launched recordings; see `flight`.
    pub(super) flights: Mutex<Vec<vk::Fence>>,
    pub(super) queue_family: u32,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) names: Option<ash::ext::debug_utils::Device>,
    pub(super) pipeline_cache: vk::PipelineCache,
    /// By the hash of all that they are made of.
    pub(super) pipelines: Mutex<HashMap<[u8; 32], Arc<CachedPipeline>>>,
    pipeline_key: String,
    pub limits: vk::PhysicalDeviceLimits,
    pub info: Candidate,
    pub cache_dir: Option<PathBuf>,
    pub(super) next_resource: AtomicU64,
    pub(super) allocated_bytes: AtomicU64,
    pub(super) omitted_barrier: AtomicUsize,
    /// Last: the instance outlives the device.
    pub(super) instance: Arc<Instance>,
}

impl Device {
    /// Every physical device, in the loader's order.
    pub fn list() -> Result<Vec<Candidate>> {
        let instance = Instance::new(Validation::Off, &[])?;
        Ok(physical_devices(&instance.handle)?.into_iter().map(|(_, candidate)| candidate).collect())
    }

    /// The step to which corners snap before rasterisation, pixels.
    pub fn snap_px(&self) -> f64 {
        (-f64::from(self.limits.sub_pixel_precision_bits)).exp2()
    }

    /// Opens the chosen device with Vulkan 1.3 core features and no extension.
    pub fn new(options: &DeviceOptions) -> Result<Arc<Self>> {
        Self::with_extensions(options, &[], &[])
    }

    /// As [`Device::new`], with the instance and device extensions that a window needs.
    pub(super) fn with_extensions(
        options: &DeviceOptions,
        surface: &[&'static CStr],
        swapchain: &[&'static CStr],
    ) -> Result<Arc<Self>> {
        let instance = Arc::new(Instance::new(options.validation, surface)?);
        let devices = physical_devices(&instance.handle)?;
        let candidates: Vec<_> = devices.iter().map(|(_, candidate)| candidate.clone()).collect();
        let info = choose(&candidates, options.device.as_deref())?.clone();
        let physical = devices[info.index].0;
        if info.is_software() {
            super::process::keep_freed_memory();
        }
        // SAFETY: a query on a handle that the live instance returned.
        let families = unsafe { instance.handle.get_physical_device_queue_family_properties(physical) };
        let queue_family = queue_family(&families).expect("a suitable candidate has a queue");
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        let mut core_1_3 = required_features();
        let extension_names: Vec<_> = swapchain.iter().map(|name| name.as_ptr()).collect();
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extension_names)
            .push_next(&mut core_1_3);
        // SAFETY: the features were checked in `physical_devices`; destroyed in `Drop`, before the instance.
        let handle =
            unsafe { instance.handle.create_device(physical, &create, None) }.checked("vkCreateDevice", &info.name)?;
        // SAFETY: family and index were given at creation.
        let queue = unsafe { handle.get_device_queue(queue_family, 0) };
        let parts = Parts { physical, handle, queue, queue_family, info, is_shared: false };
        Self::complete(&instance, parts, options.cache_dir.clone())
    }

    /// A device of its parts: made here, or shared by a caller.
    pub(super) fn complete(instance: &Arc<Instance>, parts: Parts, cache_dir: Option<PathBuf>) -> Result<Arc<Self>> {
        let Parts { physical, handle, queue, queue_family, info, is_shared } = parts;
        // SAFETY: queries on a handle that the live instance returned.
        let (memory, properties) = unsafe {
            (
                instance.handle.get_physical_device_memory_properties(physical),
                instance.handle.get_physical_device_properties(physical),
            )
        };
        let own = instance.own.as_ref().filter(|own| own.has_debug_utils);
        let names = own.map(|_| ash::ext::debug_utils::Device::new(&instance.handle, &handle));
        let mut device = Device {
            handle,
            #[cfg(feature = "view")]
            physical,
            is_shared,
            queue: Mutex::new(queue),
            flights: Mutex::default(),
            queue_family,
            memory,
            names,
            pipeline_cache: vk::PipelineCache::null(),
            pipelines: Mutex::default(),
            pipeline_key: pipeline_key(&properties),
            limits: properties.limits,
            info,
            cache_dir,
            next_resource: AtomicU64::new(1),
            allocated_bytes: AtomicU64::new(0),
            omitted_barrier: AtomicUsize::new(usize::MAX),
            instance: instance.clone(),
        };
        device.pipeline_cache = device.load_pipeline_cache()?;
        Ok(Arc::new(device))
    }

    /// Memory of all buffers and images that exist now, bytes.
    pub fn allocated_bytes(&self) -> u64 {
        self.allocated_bytes.load(Ordering::Relaxed)
    }

    /// Size of the largest device-local heap in bytes.
    pub fn heap_bytes(&self) -> u64 {
        let own = |heap: &&vk::MemoryHeap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
        self.memory.memory_heaps_as_slice().iter().filter(own).map(|heap| heap.size).max().unwrap_or(u64::MAX)
    }

    /// Largest edge in pixels of an image that passes draw into.
    pub fn most_image_px(&self) -> u32 {
        let limits = &self.limits;
        limits.max_image_dimension2_d.min(limits.max_framebuffer_width).min(limits.max_framebuffer_height)
    }

    pub fn take_validation_messages(&self) -> Vec<String> {
        self.instance.messages.take()
    }

    /// Makes every recording omit its `index`-th barrier, counted from 0, so that a test can show that the tracker
    /// reports it; `None` restores normal recording.
    pub fn omit_barrier(&self, index: Option<usize>) {
        self.omitted_barrier.store(index.unwrap_or(usize::MAX), Ordering::Relaxed);
    }

    /// The driver's compiled pipelines on disk. Only what this program wrote, for this very device, reaches a driver.
    fn pipeline_cache_path(&self) -> Option<PathBuf> {
        Some(self.cache_dir.as_ref()?.join(format!("pipelines-{}.bin", self.info.uuid)))
    }

    /// A pipeline cache that begins with what is on disk.
    fn load_pipeline_cache(&self) -> Result<vk::PipelineCache> {
        let file = self.pipeline_cache_path().and_then(|path| crate::files::read(&path).ok()).unwrap_or_default();
        let data = unsealed(&self.pipeline_key, &file).unwrap_or_default();
        if data.is_empty() && !file.is_empty() {
            log::info!("the pipeline cache on disk is damaged or belongs to another driver, and is replaced");
        }
        let create = vk::PipelineCacheCreateInfo::default().initial_data(data);
        // SAFETY: the data is what this device gave before; destroyed in `Drop`.
        unsafe { self.handle.create_pipeline_cache(&create, None) }.checked("vkCreatePipelineCache", "pipeline cache")
    }

    /// Writes the pipeline cache to disk through a temporary file. A failure is logged and is no error.
    pub fn save_pipeline_cache(&self) {
        let Some(path) = self.pipeline_cache_path() else { return };
        // SAFETY: the cache is alive.
        let Ok(data) = (unsafe { self.handle.get_pipeline_cache_data(self.pipeline_cache) }) else { return };
        if let Err(error) = crate::files::replace(&path, &sealed(&self.pipeline_key, &data)) {
            log::warn!("{}: the pipeline cache was not saved: {error}", path.display());
        }
    }

    /// Gives a Vulkan object the name that debuggers and the validation layer show.
    pub(super) fn name(&self, object: impl vk::Handle, name: &str) {
        let Some(names) = &self.names else { return };
        let name = CString::new(name).unwrap_or_default();
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object belongs to this device and is alive. Names only serve debugging, so a failure is ignored.
        let _ = unsafe { names.set_debug_utils_object_name(&info) };
    }
}

/// What a device and its driver tell of the pipelines that they can read.
fn pipeline_key(properties: &vk::PhysicalDeviceProperties) -> String {
    let vk::PhysicalDeviceProperties { vendor_id, device_id, pipeline_cache_uuid, .. } = properties;
    format!("{vendor_id:08x}{device_id:08x}{:032x}", u128::from_be_bytes(*pipeline_cache_uuid))
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: every owner of a child object holds an `Arc` of this device, so no child object is left. What was
        // submitted has ended, as its owners wait for it; a shared device may still work for its caller, who destroys
        // it.
        unsafe {
            if !self.is_shared {
                let _ = self.handle.device_wait_idle();
            }
            let pipelines = std::mem::take(self.pipelines.get_mut().unwrap_or_else(PoisonError::into_inner));
            pipelines.values().for_each(|pipeline| pipeline.destroy(self));
            self.handle.destroy_pipeline_cache(self.pipeline_cache, None);
            if !self.is_shared {
                self.handle.destroy_device(None);
            }
        }
    }
}
