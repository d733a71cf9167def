//! Images that passes draw into and read, each with the memory it owns.

use super::device::Device;
use super::memory::{Allocation, Buffer, BufferKind};
use super::owned::Owned;
use super::{Access, Checked, Commands};
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::Ordering;

#[derive(Clone, Copy, Debug)]
pub struct ImageShape {
    pub format: vk::Format,
    pub width: u32,
    pub height: u32,
    /// Samples per texel: 1 or 4.
    pub samples: u32,
}

/// A two-dimensional image that passes draw into and read.
pub struct Image {
    view: Owned<vk::ImageView>,
    image: vk::Image,
    /// Dropped after the view: the swapchain, or the image itself before its memory.
    _owner: Arc<dyn Any + Send + Sync>,
    pub(super) levels: u32,
    pub shape: ImageShape,
    pub name: String,
    pub(super) id: u64,
}

impl Image {
    /// An image without content. Depth formats become depth attachments, all else colour attachments.
    pub fn new(device: &Arc<Device>, name: &str, shape: ImageShape) -> Result<Self> {
        use vk::ImageUsageFlags as Use;
        let ImageShape { format, width, height, samples } = shape;
        let most = device.most_image_px();
        if [width, height].iter().any(|px| !(1..=most).contains(px)) {
            return Err(Error::Input(format!("{name}: {width}x{height} is outside the device's 1..={most}")));
        }
        let usage = match (format == vk::Format::D32_SFLOAT, samples > 1) {
            (true, true) => Use::DEPTH_STENCIL_ATTACHMENT,
            (true, false) => Use::DEPTH_STENCIL_ATTACHMENT | Use::SAMPLED,
            (false, true) => Use::COLOR_ATTACHMENT,
            (false, false) => Use::COLOR_ATTACHMENT | Use::SAMPLED | Use::TRANSFER_SRC | Use::TRANSFER_DST,
        };
        // Every device stores to images of this format.
        let usage = if format == vk::Format::R32G32B32A32_UINT { usage | Use::STORAGE } else { usage };
        Self::with_levels(device, name, shape, 1, usage)
    }

    /// An image with so many levels of detail, for some usage.
    pub(super) fn with_levels(
        device: &Arc<Device>,
        name: &str,
        shape: ImageShape,
        levels: u32,
        usage: vk::ImageUsageFlags,
    ) -> Result<Self> {
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(shape.format)
            .extent(vk::Extent3D { width: shape.width, height: shape.height, depth: 1 })
            .mip_levels(levels)
            .array_layers(1)
            .samples(vk::SampleCountFlags::from_raw(shape.samples))
            .usage(usage);
        // SAFETY: destroyed by `Owned`.
        let image = unsafe { device.handle.create_image(&create, None) }.checked("vkCreateImage", name)?;
        let own = Owned::new(device, name, image, ash::Device::destroy_image);
        // SAFETY: the handle is alive.
        let needs = unsafe { device.handle.get_image_memory_requirements(image) };
        let memory = Allocation::new(device, name, needs, BufferKind::Device.preferences())?;
        // SAFETY: fresh image and memory of sufficient size.
        unsafe { device.handle.bind_image_memory(image, memory.handle, 0) }.checked("vkBindImageMemory", name)?;
        Self::with_view(device, name, image, Arc::new((own, memory)), shape, levels)
    }

    /// Wraps an image of a swapchain and keeps the swapchain alive.
    #[cfg(feature = "view")]
    pub(super) fn of_swapchain(
        device: &Arc<Device>,
        owner: Arc<dyn Any + Send + Sync>,
        image: vk::Image,
        shape: ImageShape,
    ) -> Result<Self> {
        let name = "window";
        device.name(image, name);
        Self::with_view(device, name, image, owner, shape, 1)
    }

    fn with_view(
        device: &Arc<Device>,
        name: &str,
        image: vk::Image,
        owner: Arc<dyn Any + Send + Sync>,
        shape: ImageShape,
        levels: u32,
    ) -> Result<Self> {
        let view = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(shape.format)
            .subresource_range(whole(shape.format, levels));
        // SAFETY: the image is alive and has its memory; the view is destroyed by `Owned`.
        let view = unsafe { device.handle.create_image_view(&view, None) }.checked("vkCreateImageView", name)?;
        let view = Owned::new(device, name, view, ash::Device::destroy_image_view);
        let id = device.next_resource.fetch_add(1, Ordering::Relaxed);
        Ok(Image { view, image, _owner: owner, levels, shape, name: name.to_owned(), id })
    }

    /// Copies an image of one sample, whose last access was a [`Access::TransferRead`], to the host in a submission of
    /// its own: one `T` a texel.
    pub fn download<T: Pod>(&self) -> Result<Vec<T>> {
        let device = &self.view.device;
        let count = self.shape.width as usize * self.shape.height as usize;
        let staging = Buffer::new(device, "download", BufferKind::Readback, (count * size_of::<T>()) as u64)?;
        let mut commands = Commands::new(device, "download")?;
        commands.copy_image(self, &staging);
        commands.barrier(Access::TransferWrite, Access::HostRead);
        commands.submit()?;
        Ok(staging.read(0, count))
    }

    pub(super) fn raw(&self) -> vk::Image {
        self.image
    }

    pub(super) fn view(&self) -> vk::ImageView {
        self.view.handle
    }

    /// All levels of its one layer.
    pub(super) fn whole(&self) -> vk::ImageSubresourceRange {
        whole(self.shape.format, self.levels)
    }
}

/// Whether the device encodes linear colours as sRGB when they are drawn into images of that format.
pub fn encodes_srgb(format: vk::Format) -> bool {
    matches!(format, vk::Format::B8G8R8A8_SRGB | vk::Format::R8G8B8A8_SRGB)
}

fn whole(format: vk::Format, levels: u32) -> vk::ImageSubresourceRange {
    let aspect =
        if format == vk::Format::D32_SFLOAT { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR };
    vk::ImageSubresourceRange {
        aspect_mask: aspect,
        base_mip_level: 0,
        level_count: levels,
        base_array_layer: 0,
        layer_count: 1,
    }
}
