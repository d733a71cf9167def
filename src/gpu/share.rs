//! The device as other programs hold it: one of the library's own, or one that the program made and shares with it.

use super::device::{Device, DeviceOptions, Parts};
use super::instance::Instance;
use super::select::{describe, serves};
use crate::error::{Error, Result};
use ash::vk;
use std::path::Path;
use std::sync::{Arc, MutexGuard};

/// A Vulkan device with the queue that the library works on. Clones are the same device.
#[derive(Clone)]
pub struct Gpu(Arc<Device>);

impl Gpu {
    /// Opens a device: the one that `options` name, or the first GPU, or else a software device.
    ///
    /// # Errors
    /// As [`Device::new`].
    pub fn own(options: &DeviceOptions) -> Result<Self> {
        Device::new(options).map(Gpu)
    }

    /// Works on a device that the caller has made. Compiled shaders are kept in the folder `cache_dir`, or nowhere.
    ///
    /// The library makes buffers, images, pipelines and command pools of its own and destroys them with the [`Gpu`] and
    /// what was made with it. It never destroys the instance or the device, and never waits for the whole device.
    ///
    /// *Who waits.* Every method that submits waits with a fence of its own until its work has ended; nothing of the
    /// library's is under way between two calls. Each recording starts behind all that the caller has submitted to the
    /// queue before, so that no light is overwritten while a command of the caller's reads it; and what it writes is
    /// visible to all that the caller submits to the queue afterwards. On another queue the caller needs a semaphore
    /// and, as the buffers are exclusive to this queue family, a transfer of ownership.
    ///
    /// # Errors
    /// `Unsupported` where the physical device, the queue family or the version that the device was made for does not
    /// do; `Device` when memory ran out.
    ///
    /// # Safety
    /// - `instance`, `physical` and `device` belong together and are alive, and so they stay until this [`Gpu`], its
    ///   clones and all that was made with them are dropped.
    /// - The instance was made for Vulkan 1.3 or later. The device was made with the features of
    ///   [`required_features`](super::device::required_features): dynamic rendering and synchronization2. No extension
    ///   and no other feature is needed.
    /// - `queue` is a queue of the family `queue_family` of that device, without special flags.
    /// - While a call of this library runs on one thread, another one submits to `queue` or waits for it (or for the
    ///   whole device) only while it holds [`Gpu::lock_queue`].
    /// - Handles that the library shows are not destroyed by the caller, and what they hold is only read.
    pub unsafe fn from_vulkan(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        queue: vk::Queue,
        queue_family: u32,
        cache_dir: Option<&Path>,
    ) -> Result<Self> {
        let info = describe(instance, 0, physical);
        if let Some(reason) = &info.unsuitable {
            return Err(Error::Unsupported(format!("{}: {reason}", info.name)));
        }
        // SAFETY: the caller's instance is alive, and the physical device is one of its own.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        if queue == vk::Queue::null() || !families.get(queue_family as usize).is_some_and(serves) {
            let what =
                format!("{}: family {queue_family} has no queue with graphics, compute and timestamps", info.name);
            return Err(Error::Unsupported(what));
        }
        // SAFETY: the caller's device is alive; the name ends with a zero.
        let known = unsafe {
            (instance.fp_v1_0().get_device_proc_addr)(device.handle(), c"vkCmdPipelineBarrier2".as_ptr()).is_some()
        };
        if !known {
            let what = format!("{}: the device was made for a version of Vulkan below 1.3", info.name);
            return Err(Error::Unsupported(what));
        }
        let instance = Arc::new(Instance::borrowed(instance.clone()));
        let parts = Parts { physical, handle: device.clone(), queue, queue_family, info, is_shared: true };
        Device::complete(&instance, parts, cache_dir.map(Path::to_owned)).map(Gpu)
    }

    /// Keeps the library off the queue until the guard is dropped: for another thread that uses the queue of a shared
    /// device. A thread that holds it calls nothing of the library that submits, which would wait for ever.
    pub fn lock_queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.0.queue()
    }

    /// The device, for all that the library has below its front door.
    pub fn device(&self) -> &Arc<Device> {
        &self.0
    }
}

impl From<Arc<Device>> for Gpu {
    fn from(device: Arc<Device>) -> Self {
        Gpu(device)
    }
}
