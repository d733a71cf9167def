//! Vulkan objects that destroy themselves.

use super::device::Device;
use ash::vk;
use std::sync::Arc;

/// The function of [`ash::Device`] that destroys a kind of object.
type Destroy<H> = unsafe fn(&ash::Device, H, Option<&vk::AllocationCallbacks<'_>>);

/// A Vulkan object, destroyed with its owner once no submission is under way.
pub(super) struct Owned<H: Copy> {
    pub device: Arc<Device>,
    pub handle: H,
    destroy: Destroy<H>,
}

impl<H: vk::Handle + Copy> Owned<H> {
    /// Takes over an object of the device and names it.
    pub fn new(device: &Arc<Device>, name: &str, handle: H, destroy: Destroy<H>) -> Self {
        device.name(handle, name);
        Owned { device: device.clone(), handle, destroy }
    }
}

impl<H: Copy> Drop for Owned<H> {
    fn drop(&mut self) {
        self.device.settle();
        // SAFETY: recordings that use the object borrow it until they are submitted, and no submission is under way
        // (settled).
        unsafe { (self.destroy)(&self.device.handle, self.handle, None) };
    }
}
