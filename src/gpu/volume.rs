//! Three-dimensional images that are filled once and that shaders read through a sampler.

use super::device::Device;
use super::memory::{Allocation, Buffer, BufferKind};
use super::{Access, Checked, Commands};
use crate::error::{Error, Result};
use ash::vk;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A texel has four f16 channels.
const FORMAT: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
const WHOLE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

/// Destroys the handles before the memory is freed.
struct Handles {
    device: Arc<Device>,
    image: vk::Image,
    view: vk::ImageView,
    sampler: vk::Sampler,
}

impl Drop for Handles {
    fn drop(&mut self) {
        self.device.settle();
        // SAFETY: recordings that use the image borrow it until they are submitted, and no submission is under way (settled).
        unsafe {
            self.device.handle.destroy_sampler(self.sampler, None);
            self.device.handle.destroy_image_view(self.view, None);
            self.device.handle.destroy_image(self.image, None);
        }
    }
}

/// A three-dimensional image with four f16 channels per texel, and a sampler that interpolates linearly and clamps to the edge.
pub struct Volume {
    handles: Handles,
    _memory: Allocation,
    /// Texels along x, y and z.
    pub size: [u32; 3],
    /// Name shown in messages and debuggers.
    pub name: String,
    pub(super) id: u64,
}

impl Volume {
    /// Largest number of texels along an edge.
    pub fn most(device: &Device) -> u32 {
        device.limits.max_image_dimension3_d
    }

    /// An image that holds `texels`, ordered by x, then y, then z.
    ///
    /// # Errors
    /// `Input` when it exceeds the device's largest image, `Device` when memory ran out.
    ///
    /// # Panics
    /// When the number of texels does not match the size.
    pub fn with_data(device: &Arc<Device>, name: &str, size: [u32; 3], texels: &[[u16; 4]]) -> Result<Self> {
        let [width, height, depth] = size;
        assert_eq!(texels.len() as u64, size.iter().map(|&n| u64::from(n)).product::<u64>(), "{name}: {size:?} texels");
        if size.iter().any(|&n| n == 0 || n > Self::most(device)) {
            return Err(Error::Input(format!("{name}: {size:?} texels, the device takes 1..={}", Self::most(device))));
        }
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_3D)
            .format(FORMAT)
            .extent(vk::Extent3D { width, height, depth })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: destroyed by `Handles`.
        let image = unsafe { device.handle.create_image(&create, None) }.checked("vkCreateImage", name)?;
        let (view, sampler) = (vk::ImageView::null(), vk::Sampler::null());
        let mut handles = Handles { device: device.clone(), image, view, sampler };
        device.name(image, name);
        // SAFETY: the handle is alive.
        let needs = unsafe { device.handle.get_image_memory_requirements(image) };
        let memory = Allocation::new(device, name, needs, BufferKind::Device.preferences())?;
        // SAFETY: fresh image and memory of sufficient size.
        unsafe { device.handle.bind_image_memory(image, memory.handle, 0) }.checked("vkBindImageMemory", name)?;
        let view = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_3D)
            .format(FORMAT)
            .subresource_range(WHOLE);
        // SAFETY: the image is alive and has its memory; the view is destroyed by `Handles`.
        handles.view = unsafe { device.handle.create_image_view(&view, None) }.checked("vkCreateImageView", name)?;
        device.name(handles.view, name);
        let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let sampler = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(edge)
            .address_mode_v(edge)
            .address_mode_w(edge);
        // SAFETY: destroyed by `Handles`.
        handles.sampler = unsafe { device.handle.create_sampler(&sampler, None) }.checked("vkCreateSampler", name)?;
        device.name(handles.sampler, name);
        let id = device.next_resource.fetch_add(1, Ordering::Relaxed);
        let volume = Volume { handles, _memory: memory, size, name: name.to_owned(), id };
        volume.fill(device, texels)?;
        Ok(volume)
    }

    /// Copies the texels through a staging buffer and leaves the image ready to be sampled.
    fn fill(&self, device: &Arc<Device>, texels: &[[u16; 4]]) -> Result<()> {
        let mut staging = Buffer::new(device, "staging", BufferKind::Upload, size_of_val(texels) as u64)?;
        staging.write(0, texels);
        let mut commands = Commands::new(device, "upload")?;
        let [width, height, depth] = self.size;
        let barrier = |from: Option<Access>, to: Access| {
            vk::ImageMemoryBarrier2::default()
                .image(self.handles.image)
                .subresource_range(WHOLE)
                .old_layout(from.map_or(vk::ImageLayout::UNDEFINED, Access::layout))
                .new_layout(to.layout())
                .src_stage_mask(from.unwrap_or(to).stage())
                .src_access_mask(from.map_or(vk::AccessFlags2::NONE, Access::mask))
                .dst_stage_mask(to.stage())
                .dst_access_mask(to.mask())
        };
        let region = vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: WHOLE.aspect_mask,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D { width, height, depth });
        let before = [barrier(None, Access::TransferWrite)];
        let after = [barrier(Some(Access::TransferWrite), Access::ComputeSampled)];
        let (buffer, handle) = (commands.recording.buffer, &device.handle);
        // SAFETY: the command buffer is recording; image and staging buffer outlive it, since `submit` waits.
        unsafe {
            handle.cmd_pipeline_barrier2(buffer, &vk::DependencyInfo::default().image_memory_barriers(&before));
            let layout = Access::TransferWrite.layout();
            handle.cmd_copy_buffer_to_image(buffer, staging.raw(), self.handles.image, layout, &[region]);
            handle.cmd_pipeline_barrier2(buffer, &vk::DependencyInfo::default().image_memory_barriers(&after));
        }
        commands.tracker.use_range(staging.id, &staging.name, staging.all(), Access::TransferRead, "upload");
        commands.submit()?;
        Ok(())
    }

    /// Device memory of the texels, bytes.
    pub fn size_bytes(&self) -> u64 {
        8 * self.size.iter().map(|&n| u64::from(n)).product::<u64>()
    }

    pub(super) fn descriptor(&self, layout: vk::ImageLayout) -> vk::DescriptorImageInfo {
        vk::DescriptorImageInfo { sampler: self.handles.sampler, image_view: self.handles.view, image_layout: layout }
    }
}
