//! Instance, logical device and queue: the root that every other Vulkan object keeps alive.

use super::select::{Candidate, choose, physical_devices, queue_family, version_text};
use super::validation::{LAYER, Messages, Validation, on_message};
use super::{Checked, loader, manifest};
use crate::error::{Error, Result};
use ash::vk;
use std::ffi::{CStr, CString};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// What the caller decides about a device.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// Index, UUID or part of a name; `None` takes the best device.
    pub device: Option<String>,
    /// Which validation checks run.
    pub validation: Validation,
    /// Folder for compiled shaders and the pipeline cache; `None` keeps nothing on disk.
    pub cache_dir: Option<PathBuf>,
}

/// Instance-level objects; dropped after the logical device.
pub(super) struct Instance {
    pub(super) entry: ash::Entry,
    pub(super) handle: ash::Instance,
    debug: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    has_debug_utils: bool,
    /// Shared, with an address that stays: the messenger holds it.
    messages: Arc<Messages>,
}

/// Checks that the loader has Vulkan 1.3, the validation layer if it is asked for, and the extensions in `surface`, which a window
/// needs. Answers whether the loader has debug utils, which name objects in captures.
///
/// # Errors
/// `Unsupported` with what is missing.
fn check_loader(entry: &ash::Entry, validation: Validation, surface: &[&'static CStr]) -> Result<bool> {
    // SAFETY: this and the two enumerations below are plain queries on a live entry.
    let version = unsafe { entry.try_enumerate_instance_version() }
        .checked("vkEnumerateInstanceVersion", "instance")?
        .unwrap_or(vk::API_VERSION_1_0);
    if version < vk::API_VERSION_1_3 {
        return Err(Error::Unsupported(format!(
            "the Vulkan loader supports version {}, but 1.3 is needed",
            version_text(version)
        )));
    }
    // SAFETY: as above.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .checked("vkEnumerateInstanceLayerProperties", "instance")?;
    let has_layer = layers.iter().any(|l| l.layer_name_as_c_str() == Ok(LAYER));
    if validation != Validation::Off && !has_layer {
        return Err(Error::Unsupported(
            "the Khronos validation layer is not installed (Debian's package is vulkan-validationlayers)".into(),
        ));
    }
    // SAFETY: as above.
    let extensions = match unsafe { entry.enumerate_instance_extension_properties(None) } {
        Err(vk::Result::ERROR_OUT_OF_HOST_MEMORY) if let Some(broken) = manifest::broken() => return Err(broken),
        other => other.checked("vkEnumerateInstanceExtensionProperties", "instance")?,
    };
    let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    if let Some(missing) = surface.iter().find(|name| !has(name)) {
        let missing = missing.to_string_lossy();
        return Err(Error::Unsupported(format!(
            "the Vulkan driver opens no windows here (it lacks {missing}); `shadow-fields render` needs none"
        )));
    }
    Ok(has(ash::ext::debug_utils::NAME))
}

impl Instance {
    /// `surface` lists the extensions that a window needs.
    fn new(validation: Validation, surface: &[&'static CStr]) -> Result<Self> {
        let entry = loader::entry()?;
        let has_debug_utils = check_loader(&entry, validation, surface)?;
        let application = vk::ApplicationInfo::default()
            .application_name(c"shadow-fields")
            .engine_name(c"shadow-fields")
            .api_version(vk::API_VERSION_1_3);
        let mut layer_names = Vec::new();
        let mut extension_names: Vec<_> = surface.iter().map(|name| name.as_ptr()).collect();
        if has_debug_utils {
            extension_names.push(ash::ext::debug_utils::NAME.as_ptr());
        }
        if validation != Validation::Off {
            layer_names.push(LAYER.as_ptr());
            extension_names.push(ash::ext::validation_features::NAME.as_ptr());
        }
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(validation.features());
        let mut create = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extension_names);
        if validation != Validation::Off {
            create = create.push_next(&mut features);
        }
        // SAFETY: every pointer in `create` outlives the call; the handle is destroyed in `Drop` after its children.
        let handle = match unsafe { entry.create_instance(&create, None) } {
            // The loader returns this code when it finds no driver.
            Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => return Err(manifest::no_driver()),
            Err(vk::Result::ERROR_OUT_OF_HOST_MEMORY) if let Some(broken) = manifest::broken() => return Err(broken),
            other => other.checked("vkCreateInstance", "instance")?,
        };
        let mut instance = Instance { entry, handle, debug: None, has_debug_utils, messages: Arc::default() };
        if validation != Validation::Off {
            instance.listen()?;
        }
        Ok(instance)
    }

    fn listen(&mut self) -> Result<()> {
        let loader = ash::ext::debug_utils::Instance::new(&self.entry, &self.handle);
        let create = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                    | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                    | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(on_message))
            .user_data((&raw const *self.messages).cast_mut().cast());
        // SAFETY: `messages` does not move and is dropped after the messenger (see `Drop`).
        let messenger = unsafe { loader.create_debug_utils_messenger(&create, None) }
            .checked("vkCreateDebugUtilsMessengerEXT", "instance")?;
        self.debug = Some((loader, messenger));
        Ok(())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the logical device was dropped before (field order of `Device`); the messenger goes before its instance.
        unsafe {
            if let Some((loader, messenger)) = &self.debug {
                loader.destroy_debug_utils_messenger(*messenger, None);
            }
            self.handle.destroy_instance(None);
        }
    }
}

/// The logical device, its one queue (graphics and compute) and what is known of the hardware.
///
/// Everything that owns a Vulkan object holds an `Arc<Device>`.
pub struct Device {
    pub(super) handle: ash::Device,
    #[cfg(feature = "view")]
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue: Mutex<vk::Queue>,
    /// Fences of launched recordings; see `flight`.
    pub(super) flights: Mutex<Vec<vk::Fence>>,
    pub(super) queue_family: u32,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) names: Option<ash::ext::debug_utils::Device>,
    pub(super) pipeline_cache: vk::PipelineCache,
    /// Limits of the physical device.
    pub limits: vk::PhysicalDeviceLimits,
    /// Name, driver and kind of the physical device.
    pub info: Candidate,
    /// Folder for compiled shaders and the pipeline cache.
    pub cache_dir: Option<PathBuf>,
    pub(super) next_resource: AtomicU64,
    omitted_barrier: AtomicUsize,
    /// Last: the instance outlives the device.
    pub(super) instance: Arc<Instance>,
}

impl Device {
    /// Every physical device, in the loader's order.
    ///
    /// # Errors
    /// `Unsupported` without a loader.
    pub fn list() -> Result<Vec<Candidate>> {
        let instance = Instance::new(Validation::Off, &[])?;
        Ok(physical_devices(&instance.handle)?.into_iter().map(|(_, candidate)| candidate).collect())
    }

    /// Opens the chosen device with Vulkan 1.3 core features and no extension.
    ///
    /// # Errors
    /// `Unsupported` without a loader, a suitable device, or the validation layer that was asked for.
    pub fn new(options: &DeviceOptions) -> Result<Arc<Self>> {
        Self::with_extensions(options, &[], &[])
    }

    /// As [`Device::new`], with the instance and device extensions that a window needs.
    pub(super) fn with_extensions(
        options: &DeviceOptions,
        surface: &[&'static CStr],
        swapchain: &[&'static CStr],
    ) -> Result<Arc<Self>> {
        let instance = Instance::new(options.validation, surface)?;
        let devices = physical_devices(&instance.handle)?;
        let candidates: Vec<_> = devices.iter().map(|(_, candidate)| candidate.clone()).collect();
        let info = choose(&candidates, options.device.as_deref())?.clone();
        let physical = devices[info.index].0;
        if info.is_software() {
            super::heap::keep_freed_memory();
        }
        Self::open(&Arc::new(instance), physical, info, swapchain, options.cache_dir.clone())
    }

    fn open(
        instance: &Arc<Instance>,
        physical: vk::PhysicalDevice,
        info: Candidate,
        extensions: &[&'static CStr],
        cache_dir: Option<PathBuf>,
    ) -> Result<Arc<Self>> {
        // SAFETY: queries on a handle that the live instance returned.
        let (families, memory, properties) = unsafe {
            (
                instance.handle.get_physical_device_queue_family_properties(physical),
                instance.handle.get_physical_device_memory_properties(physical),
                instance.handle.get_physical_device_properties(physical),
            )
        };
        let queue_family = queue_family(&families).expect("a suitable candidate has a queue");
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        let mut core_1_3 = vk::PhysicalDeviceVulkan13Features::default()
            .dynamic_rendering(true)
            .synchronization2(true)
            .maintenance4(true);
        let extension_names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let features = vk::PhysicalDeviceFeatures::default().occlusion_query_precise(info.counts_samples);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extension_names)
            .enabled_features(&features)
            .push_next(&mut core_1_3);
        // SAFETY: the features were checked in `physical_devices`; destroyed in `Drop`, before the instance.
        let handle =
            unsafe { instance.handle.create_device(physical, &create, None) }.checked("vkCreateDevice", &info.name)?;
        // SAFETY: family and index were given at creation.
        let queue = unsafe { handle.get_device_queue(queue_family, 0) };
        let names = instance.has_debug_utils.then(|| ash::ext::debug_utils::Device::new(&instance.handle, &handle));
        let mut device = Device {
            handle,
            #[cfg(feature = "view")]
            physical,
            queue: Mutex::new(queue),
            flights: Mutex::default(),
            queue_family,
            memory,
            names,
            pipeline_cache: vk::PipelineCache::null(),
            limits: properties.limits,
            info,
            cache_dir,
            next_resource: AtomicU64::new(1),
            omitted_barrier: AtomicUsize::new(usize::MAX),
            instance: instance.clone(),
        };
        device.pipeline_cache = device.load_pipeline_cache(&properties)?;
        Ok(Arc::new(device))
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

    /// Messages of the validation layer since the last call.
    pub fn take_validation_messages(&self) -> Vec<String> {
        self.instance.messages.take()
    }

    /// Where the validation layer's messages arrive, to read what it says when the device is destroyed.
    pub fn validation_messages(&self) -> Arc<Messages> {
        self.instance.messages.clone()
    }

    /// Makes every recording omit its `index`-th barrier, counted from 0, so that a test can show that the tracker reports it;
    /// `None` restores normal recording.
    pub fn omit_barrier(&self, index: Option<usize>) {
        self.omitted_barrier.store(index.unwrap_or(usize::MAX), Ordering::Relaxed);
    }

    pub(super) fn omitted_barrier(&self) -> usize {
        self.omitted_barrier.load(Ordering::Relaxed)
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

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: every owner of a child object holds an `Arc` of this device, so no child object is left.
        unsafe {
            let _ = self.handle.device_wait_idle();
            self.handle.destroy_pipeline_cache(self.pipeline_cache, None);
            self.handle.destroy_device(None);
        }
    }
}
