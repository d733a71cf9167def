//! Textures: sampled pictures with their levels of detail.

use super::Checked;
use super::access::Access;
use super::commands::{Commands, packed};
use super::device::Device;
use super::image::{Image, ImageShape};
use super::memory::{Buffer, BufferKind};
use super::owned::Owned;
use crate::error::Result;
use ash::vk;
use half::f16;
use std::sync::Arc;

/// Texels of one level of detail; rows from the top.
pub struct Level<'t> {
    pub width: u32,
    pub height: u32,
    /// Texels, as many as that, in the texture's format.
    pub bytes: &'t [u8],
}

/// A picture that shaders sample, bilinear.
pub struct Texture {
    sampler: Owned<vk::Sampler>,
    pub image: Image,
}

impl Texture {
    /// Uploads the levels, of which the nearest is sampled, each half as large as the one before, rounded down. `wrap`
    /// says how it goes on along u and v.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        format: vk::Format,
        levels: &[Level<'_>],
        wrap: [vk::SamplerAddressMode; 2],
    ) -> Result<Self> {
        let [first, ..] = levels else { unreachable!("a texture has a level") };
        let shape = ImageShape { format, width: first.width, height: first.height, samples: 1 };
        let mipmaps = vk::SamplerMipmapMode::NEAREST;
        let texture = Self::empty(device, name, shape, levels.len() as u32, wrap, mipmaps)?;
        let bytes: Vec<u8> = levels.iter().flat_map(|level| level.bytes).copied().collect();
        let mut staging = Buffer::new(device, name, BufferKind::Upload, bytes.len() as u64)?;
        staging.write(0, &bytes);
        let mut offset = 0;
        let mut regions = Vec::with_capacity(levels.len());
        for (number, level) in levels.iter().enumerate() {
            let extent = vk::Extent3D { width: level.width, height: level.height, depth: 1 };
            let mut region = packed(&texture.image).buffer_offset(offset).image_extent(extent);
            region.image_subresource.mip_level = number as u32;
            regions.push(region);
            offset += level.bytes.len() as u64;
        }
        let mut commands = Commands::new(device, name)?;
        commands.image_barrier(&texture.image, None, Access::TransferWrite);
        commands.copy_regions(&staging, &texture.image, &regions);
        commands.image_barrier(&texture.image, Some(Access::TransferWrite), Access::GraphicsSampled);
        commands.submit()?;
        Ok(texture)
    }

    /// A texture of one level of half floats: RGBA, rows of `width` texels.
    pub fn of_halves(
        device: &Arc<Device>,
        name: &str,
        width: u32,
        texels: &[[f32; 4]],
        wrap: [vk::SamplerAddressMode; 2],
    ) -> Result<Self> {
        let halves: Vec<u16> = texels.as_flattened().iter().map(|x| f16::from_f32(*x).to_bits()).collect();
        let level = Level { width, height: texels.len() as u32 / width, bytes: bytemuck::cast_slice(&halves) };
        Self::new(device, name, vk::Format::R16G16B16A16_SFLOAT, &[level], wrap)
    }

    /// A texture that a pass fills ([`Commands::fill_levels`]), bilinear and between two levels.
    pub fn filled_by_passes(device: &Arc<Device>, name: &str, shape: ImageShape, levels: u32) -> Result<Self> {
        let edge = [vk::SamplerAddressMode::CLAMP_TO_EDGE; 2];
        Self::empty(device, name, shape, levels, edge, vk::SamplerMipmapMode::LINEAR)
    }

    fn empty(
        device: &Arc<Device>,
        name: &str,
        shape: ImageShape,
        levels: u32,
        wrap: [vk::SamplerAddressMode; 2],
        mipmaps: vk::SamplerMipmapMode,
    ) -> Result<Self> {
        use vk::ImageUsageFlags as Use;
        let usage = Use::SAMPLED | Use::TRANSFER_DST | Use::TRANSFER_SRC;
        let image = Image::with_levels(device, name, shape, levels, usage)?;
        let sampler = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .mipmap_mode(mipmaps)
            .address_mode_u(wrap[0])
            .address_mode_v(wrap[1])
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: destroyed by `Owned`.
        let sampler = unsafe { device.handle.create_sampler(&sampler, None) }.checked("vkCreateSampler", name)?;
        let sampler = Owned::new(device, name, sampler, ash::Device::destroy_sampler);
        Ok(Texture { sampler, image })
    }

    pub(super) fn descriptor(&self) -> vk::DescriptorImageInfo {
        vk::DescriptorImageInfo {
            sampler: self.sampler.handle,
            image_view: self.image.view(),
            image_layout: Access::GraphicsSampled.layout(),
        }
    }
}
