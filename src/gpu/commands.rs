//! Recording and submitting: dispatches, draws, copies, barriers, timers and labels.
//!
//! A [`Commands`] borrows every resource that is recorded into it; `submit` waits for the device, so nothing that the
//! device still uses can be dropped.

use super::Checked;
use super::access::{Access, Tracker};
use super::device::Device;
use super::memory::{Buffer, BufferKind, Image, TexelView, whole};
use super::pipeline::{ComputePipeline, GraphicsPipeline, Layout, descriptor_type};
use super::reflect::BindingKind;
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::ffi::CString;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

/// A resource given to a pass; its position in the list is its binding number.
#[derive(Clone)]
pub enum Bind<'r> {
    /// A whole buffer, as storage or uniform block.
    Buffer(&'r Buffer),
    /// A byte range of a buffer. Its start keeps the device's offset alignment (at most 256 bytes).
    Range(&'r Buffer, Range<u64>),
    /// A texel view.
    Texel(&'r TexelView<'r>),
    /// An image that is read with `texelFetch`.
    Image(&'r Image),
    /// Nothing: the variant in use does not have this binding.
    None,
}

/// Duration of one pass on the device.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Name of the pass.
    pub pass: String,
    /// Milliseconds between the timestamps around it.
    pub milliseconds: f64,
}

/// What a render pass draws into. The colour image is cleared, and resolved into `resolve` where one is given.
pub struct Target<'r> {
    /// Colour attachment.
    pub color: &'r Image,
    /// Colour that it starts with.
    pub clear: [f32; 4],
    /// Depth attachment, cleared to 0 (the far end of reversed depth).
    pub depth: Option<&'r Image>,
    /// Single-sampled image that the multisampled colour is averaged into.
    pub resolve: Option<&'r Image>,
}

/// Timed passes in one recording; a pass takes two timestamps.
const MAX_PASSES: u32 = 64;
/// Descriptor sets in one pool; another pool is made when it is full.
const SETS_PER_POOL: u32 = 256;

/// A recording in progress. Borrows what it uses until [`Commands::submit`] has waited for the device.
pub struct Commands<'r> {
    device: Arc<Device>,
    name: String,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    fence: vk::Fence,
    queries: vk::QueryPool,
    descriptors: Vec<(vk::DescriptorPool, u32)>,
    passes: Vec<String>,
    in_pass: bool,
    tracker: Tracker,
    /// Buffers that the host will read, with the ranges that were copied into them.
    read_back: Vec<(&'r Buffer, Range<u64>)>,
    barrier_count: usize,
    borrows: PhantomData<&'r Buffer>,
}

impl<'r> Commands<'r> {
    /// Starts a recording; `name` stands in messages and captures.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self> {
        let mut commands = Commands {
            device: device.clone(),
            name: name.to_owned(),
            pool: vk::CommandPool::null(),
            buffer: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            queries: vk::QueryPool::null(),
            descriptors: Vec::new(),
            passes: Vec::new(),
            in_pass: false,
            tracker: Tracker::default(),
            read_back: Vec::new(),
            barrier_count: 0,
            borrows: PhantomData,
        };
        let handle = &device.handle;
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        let queries =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * MAX_PASSES);
        // SAFETY: for the whole block, every handle is stored in `commands` as soon as it exists and destroyed in its `Drop`.
        unsafe {
            commands.pool = handle.create_command_pool(&pool, None).checked("vkCreateCommandPool", name)?;
            commands.fence =
                handle.create_fence(&vk::FenceCreateInfo::default(), None).checked("vkCreateFence", name)?;
            commands.queries = handle.create_query_pool(&queries, None).checked("vkCreateQueryPool", name)?;
            let allocate = vk::CommandBufferAllocateInfo::default()
                .command_pool(commands.pool)
                .level(vk::CommandBufferLevel::PRIMARY)
                .command_buffer_count(1);
            commands.buffer = handle.allocate_command_buffers(&allocate).checked("vkAllocateCommandBuffers", name)?[0];
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            handle.begin_command_buffer(commands.buffer, &begin).checked("vkBeginCommandBuffer", name)?;
            handle.cmd_reset_query_pool(commands.buffer, commands.queries, 0, 2 * MAX_PASSES);
        }
        device.name(commands.pool, name);
        device.name(commands.buffer, name);
        device.name(commands.fence, name);
        device.name(commands.queries, name);
        Ok(commands)
    }

    /// Runs `record` as one labelled, timed pass.
    ///
    /// # Errors
    /// What `record` returns.
    ///
    /// # Panics
    /// When passes nest or a recording has more than 64 of them.
    pub fn pass(&mut self, name: &str, record: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        assert!(!self.in_pass, "{}: pass {name} starts inside another", self.name);
        let index = self.passes.len() as u32;
        assert!(index < MAX_PASSES, "{}: more than {MAX_PASSES} passes", self.name);
        self.passes.push(name.to_owned());
        self.in_pass = true;
        let label_name = CString::new(name).unwrap_or_default();
        let label = vk::DebugUtilsLabelEXT::default().label_name(&label_name);
        // SAFETY: the command buffer is recording.
        unsafe {
            if let Some(names) = &self.device.names {
                names.cmd_begin_debug_utils_label(self.buffer, &label);
            }
        }
        self.stamp(2 * index);
        let outcome = record(self);
        self.stamp(2 * index + 1);
        // SAFETY: as above.
        unsafe {
            if let Some(names) = &self.device.names {
                names.cmd_end_debug_utils_label(self.buffer);
            }
        }
        self.in_pass = false;
        outcome
    }

    /// Writes a timestamp once everything before is done.
    fn stamp(&mut self, query: u32) {
        let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
        // SAFETY: the command buffer is recording and the query was reset at its start.
        unsafe { self.device.handle.cmd_write_timestamp2(self.buffer, stage, self.queries, query) };
        if self.device.info.is_software() {
            // llvmpipe takes the time when it next rasterises or meets a barrier, not where the stamp stands among dispatches:
            // an empty barrier settles it. It orders nothing that the passes' own barriers do not, and is not tracked.
            let barriers = [vk::MemoryBarrier2::default().src_stage_mask(stage).dst_stage_mask(stage)];
            let info = vk::DependencyInfo::default().memory_barriers(&barriers);
            // SAFETY: the command buffer is recording and outside a render pass.
            unsafe { self.device.handle.cmd_pipeline_barrier2(self.buffer, &info) };
        }
    }

    fn pass_name(&self) -> String {
        self.passes.last().unwrap_or(&self.name).clone()
    }

    /// Makes what `from` did before complete and visible to `to` after, for every buffer.
    pub fn barrier(&mut self, from: Access, to: Access) {
        if self.skip_barrier() {
            return;
        }
        self.tracker.barrier(from, to, None);
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(from.stage())
            .src_access_mask(from.mask())
            .dst_stage_mask(to.stage())
            .dst_access_mask(to.mask())];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is recording and outside a render pass.
        unsafe { self.device.handle.cmd_pipeline_barrier2(self.buffer, &info) };
    }

    /// As [`Commands::barrier`] for one image, moving it to the layout that `to` needs. `from` of `None` throws its
    /// content away.
    pub fn image_barrier(&mut self, image: &'r Image, from: Option<Access>, to: Access) {
        if from.is_some() && self.skip_barrier() {
            return;
        }
        let (stage, mask, layout) = match from {
            Some(from) => {
                self.tracker.barrier(from, to, Some(image.id));
                (from.stage(), from.mask(), from.layout())
            }
            None => {
                self.tracker.discard(image.id, to);
                (to.stage(), vk::AccessFlags2::NONE, vk::ImageLayout::UNDEFINED)
            }
        };
        let barriers = [vk::ImageMemoryBarrier2::default()
            .image(image.raw())
            .subresource_range(whole(image.shape.format))
            .old_layout(layout)
            .new_layout(to.layout())
            .src_stage_mask(stage)
            .src_access_mask(mask)
            .dst_stage_mask(to.stage())
            .dst_access_mask(to.mask())];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: the command buffer is recording and outside a render pass; the image is borrowed until it has run.
        unsafe { self.device.handle.cmd_pipeline_barrier2(self.buffer, &info) };
    }

    /// Counts a barrier and says whether a test wants it left out.
    fn skip_barrier(&mut self) -> bool {
        self.barrier_count += 1;
        self.barrier_count - 1 == self.device.omitted_barrier()
    }

    /// Runs a compute pipeline over `elements` invocations in x, y and z; `resources` stand at their binding numbers.
    ///
    /// # Errors
    /// `Input` when a buffer is larger than the device can bind or the elements are more than it can dispatch.
    ///
    /// # Panics
    /// When resources or push constants are not what the shader declares.
    pub fn dispatch<P: Pod>(
        &mut self,
        pipeline: &'r ComputePipeline,
        resources: &[Bind<'r>],
        push: &P,
        elements: [u32; 3],
    ) -> Result<()> {
        let groups = [0, 1, 2].map(|axis| elements[axis].div_ceil(pipeline.local_size[axis]));
        let most = self.device.limits.max_compute_work_group_count;
        if (0..3).any(|axis| groups[axis] > most[axis]) {
            return Err(Error::Input(format!("{}: {groups:?} workgroups, the device takes {most:?}", pipeline.name)));
        }
        if groups.contains(&0) {
            return Ok(());
        }
        self.bind(&pipeline.layout, &pipeline.name, vk::PipelineBindPoint::COMPUTE, resources)?;
        self.push(&pipeline.layout, &pipeline.name, push);
        // SAFETY: pipeline and resources are borrowed until the commands have run; limits were checked above.
        unsafe {
            let handle = &self.device.handle;
            handle.cmd_bind_pipeline(self.buffer, vk::PipelineBindPoint::COMPUTE, pipeline.raw());
            handle.cmd_dispatch(self.buffer, groups[0], groups[1], groups[2]);
        }
        Ok(())
    }

    fn push<P: Pod>(&mut self, layout: &Layout, name: &str, push: &P) {
        let bytes = bytemuck::bytes_of(push);
        assert!(
            bytes.len() >= layout.push_bytes as usize && (layout.push_bytes > 0 || bytes.is_empty()),
            "{name}: {} bytes of push constants given, the shader has {}",
            bytes.len(),
            layout.push_bytes
        );
        if layout.push_bytes > 0 {
            let bytes = &bytes[..layout.push_bytes as usize];
            // SAFETY: size and stages are the layout's own.
            unsafe {
                self.device.handle.cmd_push_constants(self.buffer, layout.pipeline, layout.push_stages, 0, bytes);
            }
        }
    }

    /// Writes a descriptor set for `resources` and binds it; tells the tracker what the shader does with each.
    fn bind(
        &mut self,
        layout: &Layout,
        name: &str,
        point: vk::PipelineBindPoint,
        resources: &[Bind<'r>],
    ) -> Result<()> {
        if layout.bindings.is_empty() {
            return Ok(());
        }
        let set = self.descriptor_set(layout)?;
        let pass = self.pass_name();
        for binding in &layout.bindings {
            let resource = resources.get(binding.index as usize).unwrap_or(&Bind::None);
            let complain =
                |what: &str| -> ! { panic!("pass {name}, binding {} ({}): {what}", binding.index, binding.name) };
            let mut write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.index)
                .descriptor_type(descriptor_type(binding.kind))
                .descriptor_count(1);
            let (mut buffers, mut views, mut images) =
                ([Default::default()], [Default::default()], [Default::default()]);
            match (binding.kind, resource) {
                (BindingKind::Storage | BindingKind::Uniform, Bind::Buffer(_) | Bind::Range(..)) => {
                    let (buffer, range) = match resource {
                        Bind::Range(buffer, range) => (*buffer, range.clone()),
                        Bind::Buffer(buffer) => (*buffer, buffer.all()),
                        _ => unreachable!("matched above"),
                    };
                    let size = range.end - range.start;
                    let (most, alignment) = if binding.kind == BindingKind::Storage {
                        let limits = &self.device.limits;
                        (limits.max_storage_buffer_range, limits.min_storage_buffer_offset_alignment)
                    } else {
                        let limits = &self.device.limits;
                        (limits.max_uniform_buffer_range, limits.min_uniform_buffer_offset_alignment)
                    };
                    if size > u64::from(most) {
                        return Err(Error::Input(format!(
                            "{}: {size} bytes in one buffer, the device can bind {most}",
                            buffer.name
                        )));
                    }
                    if range.end > buffer.size_bytes || size < u64::from(binding.block_bytes) {
                        complain("the buffer is smaller than the shader's block or the range is outside it");
                    }
                    if !range.start.is_multiple_of(alignment) {
                        complain("the range does not start at the device's offset alignment");
                    }
                    let access = match (binding.kind, binding.writes) {
                        (BindingKind::Storage, true) => Access::ComputeWrite,
                        _ => Access::ComputeRead,
                    };
                    self.tracker.use_range(buffer.id, &buffer.name, range.clone(), access, &pass);
                    buffers = [vk::DescriptorBufferInfo { buffer: buffer.raw(), offset: range.start, range: size }];
                    write = write.buffer_info(&buffers);
                }
                (BindingKind::Texel, Bind::Texel(view)) => {
                    let buffer = view.buffer;
                    self.tracker.use_range(buffer.id, &buffer.name, buffer.all(), Access::ComputeSampled, &pass);
                    views = [view.handle];
                    write = write.texel_buffer_view(&views);
                }
                (BindingKind::Image, Bind::Image(image)) => {
                    self.tracker.use_image(image.id, &image.name, Access::ComputeSampled, &pass);
                    images = [vk::DescriptorImageInfo {
                        sampler: vk::Sampler::null(),
                        image_view: image.view(),
                        image_layout: Access::ComputeSampled.layout(),
                    }];
                    write = write.image_info(&images);
                }
                _ => complain("another kind of resource, or none, was given"),
            }
            // SAFETY: the set is fresh and not yet in use; every resource is borrowed until the commands have run.
            unsafe { self.device.handle.update_descriptor_sets(&[write], &[]) };
            let _ = (buffers, views, images);
        }
        // SAFETY: the command buffer is recording and the set matches the layout.
        unsafe {
            self.device.handle.cmd_bind_descriptor_sets(self.buffer, point, layout.pipeline, 0, &[set], &[]);
        }
        Ok(())
    }

    fn descriptor_set(&mut self, layout: &Layout) -> Result<vk::DescriptorSet> {
        let handle = &self.device.handle;
        if self.descriptors.last().is_none_or(|(_, used)| *used == SETS_PER_POOL) {
            // Twelve bindings of a kind in a set is more than any pass has.
            let sizes = [
                vk::DescriptorType::STORAGE_BUFFER,
                vk::DescriptorType::UNIFORM_BUFFER,
                vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
                vk::DescriptorType::SAMPLED_IMAGE,
            ]
            .map(|ty| vk::DescriptorPoolSize { ty, descriptor_count: 12 * SETS_PER_POOL });
            let create = vk::DescriptorPoolCreateInfo::default().max_sets(SETS_PER_POOL).pool_sizes(&sizes);
            // SAFETY: destroyed in `Drop`, after the commands that use its sets have run.
            let pool = unsafe { handle.create_descriptor_pool(&create, None) }
                .checked("vkCreateDescriptorPool", &self.name)?;
            self.device.name(pool, &self.name);
            self.descriptors.push((pool, 0));
        }
        let (pool, used) = self.descriptors.last_mut().expect("a pool was just made");
        *used += 1;
        let layouts = [layout.set];
        let allocate = vk::DescriptorSetAllocateInfo::default().descriptor_pool(*pool).set_layouts(&layouts);
        // SAFETY: the pool has room (counted); freed with it.
        let sets =
            unsafe { handle.allocate_descriptor_sets(&allocate) }.checked("vkAllocateDescriptorSets", &self.name)?;
        self.device.name(sets[0], &self.name);
        Ok(sets[0])
    }

    /// Copies the whole of `from` to the start of `to`.
    ///
    /// # Panics
    /// When `to` is smaller.
    pub fn copy(&mut self, from: &'r Buffer, to: &'r Buffer) {
        self.copy_range(from, 0..from.size_bytes, to, 0);
    }

    /// Copies a byte range of `from` to a byte offset of `to`.
    ///
    /// # Panics
    /// When either range is out of bounds.
    pub fn copy_range(&mut self, from: &'r Buffer, range: Range<u64>, to: &'r Buffer, offset_bytes: u64) {
        let size = range.end - range.start;
        assert!(range.end <= from.size_bytes, "{}: copy of {range:?} of {}", from.name, from.size_bytes);
        let target = offset_bytes..offset_bytes + size;
        assert!(target.end <= to.size_bytes, "{}: copy into {target:?} of {}", to.name, to.size_bytes);
        let pass = self.pass_name();
        self.tracker.use_range(from.id, &from.name, range.clone(), Access::TransferRead, &pass);
        self.copied_into(to, target, &pass);
        let regions = [vk::BufferCopy { src_offset: range.start, dst_offset: offset_bytes, size }];
        // SAFETY: both ranges are in bounds and both buffers are borrowed until the commands have run.
        unsafe { self.device.handle.cmd_copy_buffer(self.buffer, from.raw(), to.raw(), &regions) };
    }

    /// Notes a copy into `to`; what lies in a readback buffer is read by the host once the commands have run.
    fn copied_into(&mut self, to: &'r Buffer, range: Range<u64>, pass: &str) {
        self.tracker.use_range(to.id, &to.name, range.clone(), Access::TransferWrite, pass);
        if to.kind == BufferKind::Readback {
            self.read_back.push((to, range));
        }
    }

    /// Copies a whole single-sampled image into a buffer, rows tightly packed.
    pub fn copy_image(&mut self, from: &'r Image, to: &'r Buffer) {
        let pass = self.pass_name();
        self.tracker.use_image(from.id, &from.name, Access::TransferRead, &pass);
        self.copied_into(to, to.all(), &pass);
        let range = whole(from.shape.format);
        let region = vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: range.aspect_mask,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D { width: from.shape.width, height: from.shape.height, depth: 1 });
        // SAFETY: both are borrowed until the commands have run; the layout is that of a transfer read (tracked).
        unsafe {
            let layout = Access::TransferRead.layout();
            self.device.handle.cmd_copy_image_to_buffer(self.buffer, from.raw(), layout, to.raw(), &[region]);
        }
    }

    /// Renders into `target`: everything that `record` draws, in order.
    ///
    /// # Errors
    /// What `record` returns.
    pub fn render(
        &mut self,
        target: &Target<'r>,
        record: impl FnOnce(&mut Drawing<'_, 'r>) -> Result<()>,
    ) -> Result<()> {
        let pass = self.pass_name();
        let shape = target.color.shape;
        self.tracker.use_image(target.color.id, &target.color.name, Access::ColorWrite, &pass);
        let mut color = vk::RenderingAttachmentInfo::default()
            .image_view(target.color.view())
            .image_layout(Access::ColorWrite.layout())
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32: target.clear } });
        if let Some(resolve) = target.resolve {
            self.tracker.use_image(resolve.id, &resolve.name, Access::ColorWrite, &pass);
            color = color
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .resolve_mode(vk::ResolveModeFlags::AVERAGE)
                .resolve_image_view(resolve.view())
                .resolve_image_layout(Access::ColorWrite.layout());
        }
        let depth = target.depth.map(|depth| {
            self.tracker.use_image(depth.id, &depth.name, Access::DepthWrite, &pass);
            vk::RenderingAttachmentInfo::default()
                .image_view(depth.view())
                .image_layout(Access::DepthWrite.layout())
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } })
        });
        let colors = [color];
        let extent = vk::Extent2D { width: shape.width, height: shape.height };
        let mut info = vk::RenderingInfo::default()
            .render_area(vk::Rect2D { offset: vk::Offset2D::default(), extent })
            .layer_count(1)
            .color_attachments(&colors);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        // SAFETY: the attachments are borrowed until the commands have run and in the layouts stated (tracked).
        unsafe { self.device.handle.cmd_begin_rendering(self.buffer, &info) };
        let outcome = record(&mut Drawing { commands: self, pipeline: None });
        // SAFETY: begun above.
        unsafe { self.device.handle.cmd_end_rendering(self.buffer) };
        outcome
    }

    /// Ends the recording, runs it and waits. Returns the duration of each pass, in order.
    ///
    /// # Errors
    /// `Failed` when the tracker found a barrier missing (nothing is submitted then); `Device` when the device was lost.
    pub fn submit(mut self) -> Result<Vec<Timing>> {
        for (buffer, range) in std::mem::take(&mut self.read_back) {
            self.tracker.use_range(buffer.id, &buffer.name, range, Access::HostRead, "host");
        }
        self.tracker.verdict().map_err(|error| error.context(&self.name))?;
        let handle = &self.device.handle;
        let last = self.pass_name();
        let count = 2 * self.passes.len();
        let mut stamps = vec![0_u64; count];
        // SAFETY: for the whole block, the recording is complete, its resources are borrowed by `self`, and the queue is used by
        // one submission at a time because each waits for its fence before it returns.
        unsafe {
            handle.end_command_buffer(self.buffer).checked("vkEndCommandBuffer", &self.name)?;
            let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.buffer)];
            let submit = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
            handle
                .queue_submit2(self.device.queue, &submit, self.fence)
                .checked("vkQueueSubmit2", &format!("{}, last pass {last}", self.name))?;
            handle
                .wait_for_fences(&[self.fence], true, u64::MAX)
                .checked("vkWaitForFences", &format!("{}, last pass {last}", self.name))?;
            if count > 0 {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                handle
                    .get_query_pool_results(self.queries, 0, &mut stamps, flags)
                    .checked("vkGetQueryPoolResults", &self.name)?;
            }
        }
        let period_ns = f64::from(self.device.limits.timestamp_period);
        let passes = self.passes.iter().zip(stamps.chunks_exact(2));
        Ok(passes
            .map(|(pass, pair)| Timing {
                pass: pass.clone(),
                milliseconds: pair[1].saturating_sub(pair[0]) as f64 * period_ns * 1e-6,
            })
            .collect())
    }
}

impl Drop for Commands<'_> {
    fn drop(&mut self) {
        let handle = &self.device.handle;
        // SAFETY: `submit` waited for the device, or nothing was ever submitted; a handle that was never made is null.
        unsafe {
            for (pool, _) in &self.descriptors {
                handle.destroy_descriptor_pool(*pool, None);
            }
            handle.destroy_query_pool(self.queries, None);
            handle.destroy_fence(self.fence, None);
            handle.destroy_command_pool(self.pool, None);
        }
    }
}

/// Inside a render pass.
pub struct Drawing<'c, 'r> {
    commands: &'c mut Commands<'r>,
    pipeline: Option<&'r GraphicsPipeline>,
}

impl<'r> Drawing<'_, 'r> {
    /// Selects the pipeline and its vertex buffers, in order of location, and the index buffer (32-bit).
    ///
    /// # Panics
    /// When the number of vertex buffers is not the shader's number of inputs.
    pub fn bind(&mut self, pipeline: &'r GraphicsPipeline, vertices: &[(&'r Buffer, u64)], indices: &'r Buffer) {
        assert_eq!(vertices.len(), pipeline.inputs.len(), "{}: vertex buffers against shader inputs", pipeline.name);
        let pass = self.commands.pass_name();
        let tracker = &mut self.commands.tracker;
        for (buffer, offset) in vertices {
            tracker.use_range(buffer.id, &buffer.name, *offset..buffer.size_bytes, Access::VertexRead, &pass);
        }
        tracker.use_range(indices.id, &indices.name, indices.all(), Access::VertexRead, &pass);
        let handle = &self.commands.device.handle;
        let buffer = self.commands.buffer;
        // SAFETY: everything is borrowed until the commands have run.
        unsafe {
            handle.cmd_bind_pipeline(buffer, vk::PipelineBindPoint::GRAPHICS, pipeline.raw());
            for (input, (vertex, offset)) in pipeline.inputs.iter().zip(vertices) {
                handle.cmd_bind_vertex_buffers(buffer, input.location, &[vertex.raw()], &[*offset]);
            }
            handle.cmd_bind_index_buffer(buffer, indices.raw(), 0, vk::IndexType::UINT32);
        }
        self.pipeline = Some(pipeline);
    }

    /// Restricts drawing to a rectangle in pixels: viewport and scissor.
    pub fn area(&mut self, x: u32, y: u32, width: u32, height: u32) {
        let viewport = vk::Viewport {
            x: x as f32,
            y: y as f32,
            width: width as f32,
            height: height as f32,
            min_depth: 0.0,
            max_depth: 1.0,
        };
        let scissor = vk::Rect2D {
            offset: vk::Offset2D { x: x.cast_signed(), y: y.cast_signed() },
            extent: vk::Extent2D { width, height },
        };
        let handle = &self.commands.device.handle;
        // SAFETY: the command buffer is recording.
        unsafe {
            handle.cmd_set_viewport(self.commands.buffer, 0, &[viewport]);
            handle.cmd_set_scissor(self.commands.buffer, 0, &[scissor]);
        }
    }

    /// Sets the bound pipeline's push constants.
    ///
    /// # Panics
    /// Before [`Drawing::bind`].
    pub fn push<P: Pod>(&mut self, push: &P) {
        let pipeline = self.pipeline.expect("a pipeline is bound before its push constants");
        self.commands.push(&pipeline.layout, &pipeline.name, push);
    }

    /// Draws the indices of a range, three a triangle.
    ///
    /// # Panics
    /// Before [`Drawing::bind`].
    pub fn indexed(&mut self, range: Range<u32>) {
        assert!(self.pipeline.is_some(), "a pipeline is bound before drawing");
        // SAFETY: the index buffer covers the range (its owner made both); values were checked when the mesh was read.
        unsafe {
            let count = range.end - range.start;
            self.commands.device.handle.cmd_draw_indexed(self.commands.buffer, count, 1, range.start, 0, 0);
        }
    }
}
