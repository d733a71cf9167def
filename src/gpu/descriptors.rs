//! Resources of a dispatch: writes descriptor sets in binding order, checks them against the shader and reports them to
//! the tracker.

use super::Checked;
use super::access::Access;
use super::commands::Commands;
use super::image::Image;
use super::memory::{Buffer, TexelView};
use super::pipeline::{Layout, Pipeline};
use super::reflect::Binding;
use super::texture::Texture;
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::ops::Range;

/// A resource given to a pass; its position in the list is its binding number.
#[derive(Clone)]
pub enum Bind<'r> {
    /// A whole buffer, as storage or uniform block.
    Buffer(&'r Buffer),
    /// A byte range of a buffer. Its start keeps the device's offset alignment (at most 256 bytes).
    Range(&'r Buffer, Range<u64>),
    Texel(TexelView<'r>),
    /// An image that is read with `texelFetch`, or that a compute shader stores to.
    Image(&'r Image),
    /// A texture that a fragment shader samples.
    Texture(&'r Texture),
    /// No resource: the shader permutation does not have this binding.
    None,
}

impl<'r> Bind<'r> {
    /// A whole buffer: through a texel view of a format, or as a block.
    pub fn read(texels: bool, buffer: &'r Buffer, format: vk::Format) -> Result<Self> {
        Ok(if texels { Bind::Texel(TexelView::new(buffer, format)?) } else { Bind::Buffer(buffer) })
    }
}

fn complain(pass: &str, binding: &Binding, what: &str) -> ! {
    panic!("pass {pass}, binding {} ({}): {what}", binding.index, binding.name)
}

/// Descriptor sets in one pool; a full pool is followed by another.
const SETS_PER_POOL: u32 = 256;

impl<'r> Commands<'r> {
    pub(super) fn push<P: Pod>(&mut self, pipeline: &Pipeline, push: &P) {
        let layout = pipeline.layout();
        let bytes = bytemuck::bytes_of(push);
        assert!(
            bytes.len() >= layout.push_bytes as usize && (layout.push_bytes > 0 || bytes.is_empty()),
            "{}: {} bytes of push constants given, the shader has {}",
            pipeline.name,
            bytes.len(),
            layout.push_bytes
        );
        if layout.push_bytes > 0 {
            let bytes = &bytes[..layout.push_bytes as usize];
            let (handle, buffer) = self.raw();
            // SAFETY: size and stages are the layout's own.
            unsafe { handle.cmd_push_constants(buffer, layout.pipeline, layout.push_stages, 0, bytes) };
        }
    }

    /// Writes a descriptor set for `resources`, binds it, and reports to the tracker how the shader uses each resource.
    pub(super) fn bind(
        &mut self,
        pipeline: &Pipeline,
        point: vk::PipelineBindPoint,
        resources: &[Bind<'r>],
    ) -> Result<()> {
        use vk::DescriptorType as Kind;
        let layout = pipeline.layout();
        if layout.bindings.is_empty() {
            return Ok(());
        }
        let set = self.descriptor_set(layout)?;
        let graphics = point == vk::PipelineBindPoint::GRAPHICS;
        let sampled = if graphics { Access::GraphicsSampled } else { Access::ComputeSampled };
        for binding in &layout.bindings {
            let resource = match resources.get(binding.index as usize).unwrap_or(&Bind::None) {
                Bind::Buffer(buffer) => &Bind::Range(buffer, buffer.all()),
                other => other,
            };
            let mut write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.index)
                .descriptor_type(binding.kind)
                .descriptor_count(1);
            let mut buffers = [Default::default()];
            let mut views = [Default::default()];
            let mut images = [Default::default()];
            match (binding.kind, resource) {
                (Kind::STORAGE_BUFFER | Kind::UNIFORM_BUFFER, Bind::Range(buffer, range)) => {
                    self.check_range(binding, buffer, range, &pipeline.name)?;
                    let size = range.end - range.start;
                    let access = if binding.writes { Access::ComputeWrite } else { Access::ComputeRead };
                    self.uses_range(buffer, range.clone(), access);
                    buffers = [vk::DescriptorBufferInfo { buffer: buffer.raw(), offset: range.start, range: size }];
                    write = write.buffer_info(&buffers);
                }
                (Kind::UNIFORM_TEXEL_BUFFER, Bind::Texel(view)) => {
                    let buffer = view.buffer;
                    self.uses_range(buffer, buffer.all(), sampled);
                    views = [view.handle];
                    write = write.texel_buffer_view(&views);
                }
                (Kind::SAMPLED_IMAGE | Kind::STORAGE_IMAGE, Bind::Image(image)) => {
                    let access = if binding.writes { Access::ComputeWrite } else { sampled };
                    self.uses_image(image, access);
                    images = [vk::DescriptorImageInfo {
                        sampler: vk::Sampler::null(),
                        image_view: image.view(),
                        image_layout: access.layout(),
                    }];
                    write = write.image_info(&images);
                }
                (Kind::COMBINED_IMAGE_SAMPLER, Bind::Texture(texture)) => {
                    self.uses_image(&texture.image, sampled);
                    images = [texture.descriptor()];
                    write = write.image_info(&images);
                }
                _ => complain(&pipeline.name, binding, "another kind of resource, or none, was given"),
            }
            // SAFETY: the set is fresh and not yet in use; every resource is borrowed until the commands have run.
            unsafe { self.recording.device.handle.update_descriptor_sets(&[write], &[]) };
            let _ = (buffers, views, images);
        }
        let (handle, buffer) = self.raw();
        // SAFETY: the command buffer is recording and the set matches the layout.
        unsafe { handle.cmd_bind_descriptor_sets(buffer, point, layout.pipeline, 0, &[set], &[]) };
        Ok(())
    }

    /// Checks the byte range of a block's buffer against the block and the device's limits.
    fn check_range(&self, binding: &Binding, buffer: &Buffer, range: &Range<u64>, name: &str) -> Result<()> {
        let size = range.end - range.start;
        let limits = &self.recording.device.limits;
        let (most, alignment) = if binding.kind == vk::DescriptorType::STORAGE_BUFFER {
            (limits.max_storage_buffer_range, limits.min_storage_buffer_offset_alignment)
        } else {
            (limits.max_uniform_buffer_range, limits.min_uniform_buffer_offset_alignment)
        };
        if size > u64::from(most) {
            let buffer = &buffer.name;
            return Err(Error::Input(format!("{buffer}: {size} bytes in one buffer, the device can bind {most}")));
        }
        if range.end > buffer.size_bytes || size < u64::from(binding.block_bytes) {
            complain(name, binding, "the buffer is smaller than the shader's block or the range is outside it");
        }
        if !range.start.is_multiple_of(alignment) {
            complain(name, binding, "the range does not start at the device's offset alignment");
        }
        Ok(())
    }

    fn descriptor_set(&mut self, layout: &Layout) -> Result<vk::DescriptorSet> {
        let handle = &self.recording.device.handle;
        if self.recording.descriptors.last().is_none_or(|(_, used)| *used == SETS_PER_POOL) {
            // No pass has more than sixteen bindings of one kind.
            let sizes = [
                vk::DescriptorType::STORAGE_BUFFER,
                vk::DescriptorType::UNIFORM_BUFFER,
                vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
                vk::DescriptorType::SAMPLED_IMAGE,
                vk::DescriptorType::STORAGE_IMAGE,
                vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            ]
            .map(|ty| vk::DescriptorPoolSize { ty, descriptor_count: 16 * SETS_PER_POOL });
            let create = vk::DescriptorPoolCreateInfo::default().max_sets(SETS_PER_POOL).pool_sizes(&sizes);
            // SAFETY: destroyed in `Drop`, after the commands that use its sets have run.
            let pool = unsafe { handle.create_descriptor_pool(&create, None) }
                .checked("vkCreateDescriptorPool", &self.recording.name)?;
            self.recording.device.name(pool, &self.recording.name);
            self.recording.descriptors.push((pool, 0));
        }
        let (pool, used) = self.recording.descriptors.last_mut().expect("a pool was just made");
        *used += 1;
        let layouts = [layout.set];
        let allocate = vk::DescriptorSetAllocateInfo::default().descriptor_pool(*pool).set_layouts(&layouts);
        // SAFETY: the pool has room (counted); freed with it.
        let sets = unsafe { handle.allocate_descriptor_sets(&allocate) }
            .checked("vkAllocateDescriptorSets", &self.recording.name)?;
        // The set has no name beside its pool's: lavapipe of Mesa 22.3 never frees those, which took 142 bytes a frame.
        Ok(sets[0])
    }
}
