//! Textures: sampled pictures with their levels of detail, filled once.

use super::Checked;
use super::access::Access;
use super::commands::Commands;
use super::device::Device;
use super::memory::{Allocation, Buffer, BufferKind};
use crate::error::Result;
use ash::vk;
use std::sync::Arc;

/// Texels of one level of detail; rows from the top.
pub struct Level<'t> {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Texels, as many as that, in the texture's format.
    pub bytes: &'t [u8],
}

/// Destroys a texture's handles before its memory is freed.
struct TextureHandle {
    device: Arc<Device>,
    image: vk::Image,
    view: vk::ImageView,
    sampler: vk::Sampler,
}

impl Drop for TextureHandle {
    fn drop(&mut self) {
        self.device.settle();
        // SAFETY: recordings that use the texture borrow it until they are submitted, and no submission is under way
        // (settled). Null handles are ignored.
        unsafe {
            self.device.handle.destroy_sampler(self.sampler, None);
            self.device.handle.destroy_image_view(self.view, None);
            self.device.handle.destroy_image(self.image, None);
        }
    }
}

/// A picture that shaders sample, bilinear and of the nearest level.
pub struct Texture {
    handle: TextureHandle,
    _memory: Allocation,
    /// Device memory, bytes.
    pub size_bytes: u64,
}

impl Texture {
    /// Uploads the levels, each half as large as the one before, rounded down. `wrap` says how it goes on along u and v.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        format: vk::Format,
        levels: &[Level<'_>],
        wrap: [vk::SamplerAddressMode; 2],
    ) -> Result<Self> {
        let [first, ..] = levels else { unreachable!("a texture has a level") };
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: first.width, height: first.height, depth: 1 })
            .mip_levels(levels.len() as u32)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: destroyed by `TextureHandle`.
        let image = unsafe { device.handle.create_image(&create, None) }.checked("vkCreateImage", name)?;
        let null = vk::ImageView::null();
        let mut handle = TextureHandle { device: device.clone(), image, view: null, sampler: vk::Sampler::null() };
        device.name(image, name);
        // SAFETY: the handle is alive.
        let needs = unsafe { device.handle.get_image_memory_requirements(image) };
        let memory = Allocation::new(device, name, needs, BufferKind::Device.preferences())?;
        // SAFETY: fresh image and memory of sufficient size.
        unsafe { device.handle.bind_image_memory(image, memory.handle, 0) }.checked("vkBindImageMemory", name)?;
        let view = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(all(levels.len()));
        // SAFETY: the image is alive and has its memory; the view is destroyed by `TextureHandle`.
        handle.view = unsafe { device.handle.create_image_view(&view, None) }.checked("vkCreateImageView", name)?;
        device.name(handle.view, name);
        let sampler = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .mipmap_mode(vk::SamplerMipmapMode::NEAREST)
            .address_mode_u(wrap[0])
            .address_mode_v(wrap[1])
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: destroyed by `TextureHandle`.
        handle.sampler = unsafe { device.handle.create_sampler(&sampler, None) }.checked("vkCreateSampler", name)?;
        let texture = Texture { handle, _memory: memory, size_bytes: needs.size };
        texture.fill(name, levels)?;
        Ok(texture)
    }

    fn fill(&self, name: &str, levels: &[Level<'_>]) -> Result<()> {
        let device = &self.handle.device;
        let bytes: Vec<u8> = levels.iter().flat_map(|level| level.bytes).copied().collect();
        let mut staging = Buffer::new(device, name, BufferKind::Upload, bytes.len() as u64)?;
        staging.write(0, &bytes);
        let mut commands = Commands::new(device, name)?;
        commands.fill_texture(&staging, self, levels);
        commands.submit().map(|_| ())
    }

    /// What a descriptor holds.
    pub(super) fn descriptor(&self) -> vk::DescriptorImageInfo {
        vk::DescriptorImageInfo {
            sampler: self.handle.sampler,
            image_view: self.handle.view,
            image_layout: Access::GraphicsSampled.layout(),
        }
    }
}

fn all(levels: usize) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        base_mip_level: 0,
        level_count: levels as u32,
        base_array_layer: 0,
        layer_count: 1,
    }
}

impl<'r> Commands<'r> {
    /// Copies the levels, which stand one after the other in `from`, and leaves the texture ready to be sampled.
    fn fill_texture(&mut self, from: &'r Buffer, to: &'r Texture, levels: &[Level<'_>]) {
        let pass = self.pass_name();
        self.tracker.use_range(from.id, &from.name, from.all(), Access::TransferRead, &pass);
        let mut offset = 0;
        let mut regions = Vec::with_capacity(levels.len());
        for (number, level) in levels.iter().enumerate() {
            let layers = vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: number as u32,
                base_array_layer: 0,
                layer_count: 1,
            };
            let extent = vk::Extent3D { width: level.width, height: level.height, depth: 1 };
            let region = vk::BufferImageCopy::default().buffer_offset(offset).image_subresource(layers);
            regions.push(region.image_extent(extent));
            offset += level.bytes.len() as u64;
        }
        let image = to.handle.image;
        let moved = |from: Option<Access>, to: Access| {
            vk::ImageMemoryBarrier2::default()
                .image(image)
                .subresource_range(all(levels.len()))
                .old_layout(from.map_or(vk::ImageLayout::UNDEFINED, Access::layout))
                .new_layout(to.layout())
                .src_stage_mask(from.unwrap_or(to).stage())
                .src_access_mask(from.map_or(vk::AccessFlags2::NONE, Access::mask))
                .dst_stage_mask(to.stage())
                .dst_access_mask(to.mask())
        };
        let before = [moved(None, Access::TransferWrite)];
        let after = [moved(Some(Access::TransferWrite), Access::GraphicsSampled)];
        let handle = &self.recording.device.handle;
        let buffer = self.recording.buffer;
        // SAFETY: the command buffer is recording and outside a render pass; both are borrowed until it has run, and the
        // regions lie within the staging buffer, which was made for them.
        unsafe {
            handle.cmd_pipeline_barrier2(buffer, &vk::DependencyInfo::default().image_memory_barriers(&before));
            let layout = Access::TransferWrite.layout();
            handle.cmd_copy_buffer_to_image(buffer, from.raw(), image, layout, &regions);
            handle.cmd_pipeline_barrier2(buffer, &vk::DependencyInfo::default().image_memory_barriers(&after));
        }
    }
}
