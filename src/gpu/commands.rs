//! Recording and submitting: dispatches, draws, copies, barriers, timers and labels.
//!
//! A [`Commands`] borrows every resource that is recorded into it. `submit` waits for the device; `launch` does not.
//! Dropping a resource waits for every launched recording ([`Device::settle`]), so nothing is destroyed while the
//! device uses it.

use super::access::{Access, Tracker};
use super::descriptors::Bind;
use super::device::Device;
use super::flight::{Flight, MAX_PASSES, Recording, Timing};
use super::image::Image;
use super::memory::{Buffer, BufferKind};
use super::pipeline::ComputePipeline;
use super::texture::Texture;
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::ffi::CString;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The first level of an image beside a buffer with tightly packed rows.
pub(super) fn packed(image: &Image) -> vk::BufferImageCopy {
    let layers = vk::ImageSubresourceLayers {
        aspect_mask: image.whole().aspect_mask,
        mip_level: 0,
        base_array_layer: 0,
        layer_count: 1,
    };
    let extent = vk::Extent3D { width: image.shape.width, height: image.shape.height, depth: 1 };
    vk::BufferImageCopy::default().image_subresource(layers).image_extent(extent)
}

/// After accesses of one kind and before those of another, for all memory.
fn between(from: Access, to: Access) -> vk::MemoryBarrier2<'static> {
    vk::MemoryBarrier2::default()
        .src_stage_mask(from.stage())
        .src_access_mask(from.mask())
        .dst_stage_mask(to.stage())
        .dst_access_mask(to.mask())
}

/// A recording in progress. It borrows every resource that it uses until it is submitted.
pub struct Commands<'r> {
    pub(super) recording: Recording,
    in_pass: bool,
    pub(super) tracker: Tracker,
    /// Buffers that the host will read, with the ranges that were copied into them.
    read_back: Vec<(&'r Buffer, Range<u64>)>,
    barrier_count: usize,
}

impl<'r> Commands<'r> {
    /// Starts a recording; messages and captures show `name`.
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self> {
        Ok(Commands {
            recording: Recording::new(device, name)?,
            in_pass: false,
            tracker: Tracker::default(),
            read_back: Vec::new(),
            barrier_count: 0,
        })
    }

    /// The device's functions and the command buffer, which is recording.
    pub(super) fn raw(&self) -> (&ash::Device, vk::CommandBuffer) {
        (&self.recording.device.handle, self.recording.buffer)
    }

    /// Runs `record` as one labelled, timed pass. On some devices full barriers stand around it, see
    /// [`Commands::separates_passes`].
    pub fn pass(&mut self, name: &str, record: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        assert!(!self.in_pass, "{}: pass {name} starts inside another", self.recording.name);
        let index = self.recording.passes.len() as u32;
        assert!(index < MAX_PASSES, "{}: more than {MAX_PASSES} passes", self.recording.name);
        self.recording.passes.push(name.to_owned());
        self.in_pass = true;
        let label_name = CString::new(name).unwrap_or_default();
        let label = vk::DebugUtilsLabelEXT::default().label_name(&label_name);
        if let Some(names) = &self.recording.device.names {
            // SAFETY: the command buffer is recording.
            unsafe { names.cmd_begin_debug_utils_label(self.recording.buffer, &label) };
        }
        self.stamp(2 * index);
        let outcome = record(self);
        self.stamp(2 * index + 1);
        if let Some(names) = &self.recording.device.names {
            // SAFETY: as above.
            unsafe { names.cmd_end_debug_utils_label(self.recording.buffer) };
        }
        self.in_pass = false;
        outcome
    }

    /// Has this pass's [`super::Timing`] tell a number that it has left in a word of a buffer, at a byte offset.
    pub fn count(&mut self, buffer: &'r Buffer, offset_bytes: u64) -> Result<()> {
        self.uses_range(buffer, offset_bytes..offset_bytes + 4, Access::TransferRead);
        let (counts, at) = self.recording.next_count()?;
        let regions = [vk::BufferCopy { src_offset: offset_bytes, dst_offset: at, size: 4 }];
        let (handle, commands) = self.raw();
        // SAFETY: the buffer is borrowed until the commands have run, and the recording keeps the other.
        unsafe { handle.cmd_copy_buffer(commands, buffer.raw(), counts, &regions) };
        self.memory_barrier(between(Access::TransferWrite, Access::HostRead));
        Ok(())
    }

    /// Writes a timestamp when all commands before it have finished.
    fn stamp(&mut self, query: u32) {
        let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
        let (handle, buffer) = self.raw();
        // SAFETY: the command buffer is recording and the query was reset at its start.
        unsafe { handle.cmd_write_timestamp2(buffer, stage, self.recording.queries, query) };
        if self.separates_passes() {
            // It orders execution and makes no memory visible. llvmpipe takes a timestamp when it next rasterises or
            // meets a barrier, not at its place among dispatches.
            self.memory_barrier(vk::MemoryBarrier2::default().src_stage_mask(stage).dst_stage_mask(stage));
        }
    }

    /// Whether a barrier between all commands stands on both sides of each pass, so that passes do not overlap. This is
    /// so on software devices, whose timestamps need it. The tracker does not count these barriers, so they cannot
    /// replace one between passes.
    pub fn separates_passes(&self) -> bool {
        self.recording.device.info.is_software()
    }

    fn memory_barrier(&self, barrier: vk::MemoryBarrier2<'_>) {
        let barriers = [barrier];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        let (handle, buffer) = self.raw();
        // SAFETY: the command buffer is recording and outside a render pass.
        unsafe { handle.cmd_pipeline_barrier2(buffer, &info) };
    }

    /// Notes that the current pass uses a byte range of a buffer.
    pub(super) fn uses_range(&mut self, buffer: &Buffer, range: Range<u64>, access: Access) {
        self.tracker.use_range(buffer.id, &buffer.name, range, access, self.recording.pass_name());
    }

    pub(super) fn uses_image(&mut self, image: &Image, access: Access) {
        self.tracker.use_image(image.id, &image.name, access, self.recording.pass_name());
    }

    /// Memory barrier: all `from` accesses before it are complete and visible to all `to` accesses after it, for every
    /// buffer.
    pub fn barrier(&mut self, from: Access, to: Access) {
        if self.skip_barrier() {
            return;
        }
        self.tracker.barrier(from, to, None);
        self.memory_barrier(between(from, to));
    }

    /// Barriers between all that compute shaders wrote and what they read next.
    pub fn computed(&mut self) {
        self.barrier(Access::ComputeWrite, Access::ComputeRead);
        self.barrier(Access::ComputeWrite, Access::ComputeSampled);
    }

    /// As [`Commands::barrier`] for one image, which moves to the layout that `to` needs. With `from` of `None` its
    /// content is discarded.
    pub fn image_barrier(&mut self, image: &'r Image, from: Option<Access>, to: Access) {
        if from.is_some() && self.skip_barrier() {
            return;
        }
        let (memory, layout) = match from {
            Some(from) => {
                self.tracker.barrier(from, to, Some(image.id));
                (between(from, to), from.layout())
            }
            None => {
                self.tracker.discard(image.id, to);
                (between(to, to).src_access_mask(vk::AccessFlags2::NONE), vk::ImageLayout::UNDEFINED)
            }
        };
        self.turn(image, image.whole(), [layout, to.layout()], memory);
    }

    /// A barrier for a part of an image that goes from one layout to another.
    fn turn(
        &self,
        image: &'r Image,
        part: vk::ImageSubresourceRange,
        [from, to]: [vk::ImageLayout; 2],
        memory: vk::MemoryBarrier2<'_>,
    ) {
        let barriers = [vk::ImageMemoryBarrier2::default()
            .image(image.raw())
            .subresource_range(part)
            .old_layout(from)
            .new_layout(to)
            .src_stage_mask(memory.src_stage_mask)
            .src_access_mask(memory.src_access_mask)
            .dst_stage_mask(memory.dst_stage_mask)
            .dst_access_mask(memory.dst_access_mask)];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        let (handle, buffer) = self.raw();
        // SAFETY: the command buffer is recording and outside a render pass; the image is borrowed until it has run.
        unsafe { handle.cmd_pipeline_barrier2(buffer, &info) };
    }

    /// Counts a barrier and returns whether a test asked to omit it ([`Device::omit_barrier`]).
    fn skip_barrier(&mut self) -> bool {
        self.barrier_count += 1;
        self.barrier_count - 1 == self.recording.device.omitted_barrier.load(Ordering::Relaxed)
    }

    /// Runs a compute pipeline over `elements` invocations in x, y and z; `resources` stand at their binding numbers.
    pub fn dispatch<P: Pod>(
        &mut self,
        pipeline: &'r ComputePipeline,
        resources: &[Bind<'r>],
        push: &P,
        elements: [u32; 3],
    ) -> Result<()> {
        let ComputePipeline { pipeline, local_size } = pipeline;
        let groups = [0, 1, 2].map(|axis| elements[axis].div_ceil(local_size[axis]));
        let most = self.recording.device.limits.max_compute_work_group_count;
        if (0..3).any(|axis| groups[axis] > most[axis]) {
            return Err(Error::Input(format!("{}: {groups:?} workgroups, the device takes {most:?}", pipeline.name)));
        }
        if groups.contains(&0) {
            return Ok(());
        }
        self.bind(pipeline, vk::PipelineBindPoint::COMPUTE, resources)?;
        self.push(pipeline, push);
        let (handle, buffer) = self.raw();
        // SAFETY: pipeline and resources are borrowed until the commands have run; limits were checked above.
        unsafe {
            handle.cmd_bind_pipeline(buffer, vk::PipelineBindPoint::COMPUTE, pipeline.raw());
            handle.cmd_dispatch(buffer, groups[0], groups[1], groups[2]);
        }
        Ok(())
    }

    /// Runs as many workgroups as three words at a byte offset of a buffer say.
    pub fn dispatch_indirect<P: Pod>(
        &mut self,
        ComputePipeline { pipeline, .. }: &'r ComputePipeline,
        resources: &[Bind<'r>],
        push: &P,
        groups: (&'r Buffer, u64),
    ) -> Result<()> {
        self.bind(pipeline, vk::PipelineBindPoint::COMPUTE, resources)?;
        self.push(pipeline, push);
        let (buffer, offset) = groups;
        self.uses_range(buffer, offset..offset + 12, Access::Indirect);
        let (handle, commands) = self.raw();
        // SAFETY: pipeline, resources and the buffer are borrowed until the commands have run; the words lie within it.
        unsafe {
            handle.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline.raw());
            handle.cmd_dispatch_indirect(commands, buffer.raw(), offset);
        }
        Ok(())
    }

    /// Copies a byte range of `from` to a byte offset of `to`.
    pub fn copy_range(&mut self, from: &'r Buffer, range: Range<u64>, to: &'r Buffer, offset_bytes: u64) {
        let size = range.end - range.start;
        assert!(range.end <= from.size_bytes, "{}: copy of {range:?} of {}", from.name, from.size_bytes);
        let target = offset_bytes..offset_bytes + size;
        assert!(target.end <= to.size_bytes, "{}: copy into {target:?} of {}", to.name, to.size_bytes);
        self.uses_range(from, range.clone(), Access::TransferRead);
        self.copied_into(to, target);
        let regions = [vk::BufferCopy { src_offset: range.start, dst_offset: offset_bytes, size }];
        let (handle, buffer) = self.raw();
        // SAFETY: both ranges are in bounds and both buffers are borrowed until the commands have run.
        unsafe { handle.cmd_copy_buffer(buffer, from.raw(), to.raw(), &regions) };
    }

    /// Notes a copy into `to`. The host reads a readback buffer after the commands have run.
    fn copied_into(&mut self, to: &'r Buffer, range: Range<u64>) {
        self.uses_range(to, range.clone(), Access::TransferWrite);
        if to.kind == BufferKind::Readback {
            self.read_back.push((to, range));
        }
    }

    /// Copies a whole single-sampled image into a buffer; rows are tightly packed.
    pub fn copy_image(&mut self, from: &'r Image, to: &'r Buffer) {
        self.copy_rows(from, from.shape.height, to, to.all());
    }

    /// Copies the first rows of a single-sampled image, tightly packed, to a range of a buffer of their size.
    pub fn copy_rows(&mut self, from: &'r Image, rows: u32, to: &'r Buffer, range: Range<u64>) {
        let mut region = packed(from).buffer_offset(range.start);
        region.image_extent.height = rows;
        self.uses_image(from, Access::TransferRead);
        self.copied_into(to, range);
        let layout = Access::TransferRead.layout();
        let (handle, buffer) = self.raw();
        // SAFETY: both are borrowed until the commands have run; the layout is that of a transfer read (tracked).
        unsafe { handle.cmd_copy_image_to_buffer(buffer, from.raw(), layout, to.raw(), &[region]) };
    }

    /// Copies a buffer into the whole of a single-sampled image; rows are tightly packed.
    pub fn copy_to_image(&mut self, from: &'r Buffer, to: &'r Image) {
        self.copy_regions(from, to, &[packed(to)]);
    }

    /// Copies parts of a buffer, which lie within it, into parts of an image.
    pub(super) fn copy_regions(&mut self, from: &'r Buffer, to: &'r Image, regions: &[vk::BufferImageCopy]) {
        self.uses_range(from, from.all(), Access::TransferRead);
        self.uses_image(to, Access::TransferWrite);
        let layout = Access::TransferWrite.layout();
        let (handle, buffer) = self.raw();
        // SAFETY: both are borrowed until the commands have run; the layout is that of a transfer write (tracked).
        unsafe { handle.cmd_copy_buffer_to_image(buffer, from.raw(), to.raw(), layout, regions) };
    }

    /// Copies a whole single-sampled image into another image of the same size and format.
    pub fn copy_between(&mut self, from: &'r Image, to: &'r Image) {
        let of = |image: &Image| (image.shape.format, image.shape.width, image.shape.height);
        assert_eq!(of(from), of(to), "{} and {}", from.name, to.name);
        self.uses_image(from, Access::TransferRead);
        self.uses_image(to, Access::TransferWrite);
        let vk::BufferImageCopy { image_subresource: layers, image_extent, .. } = packed(from);
        let region = vk::ImageCopy::default().src_subresource(layers).dst_subresource(layers).extent(image_extent);
        let [read, write] = [Access::TransferRead, Access::TransferWrite].map(Access::layout);
        let (handle, buffer) = self.raw();
        // SAFETY: both are borrowed until the commands have run; the layouts are those of the accesses (tracked).
        unsafe { handle.cmd_copy_image(buffer, from.raw(), read, to.raw(), write, &[region]) };
    }

    /// Fills all levels of a texture, each with the one before at half its size, from the first `width` columns of an
    /// image of its own size. The image was made the source of a copy; the texture loses its content and is ready to be
    /// sampled.
    pub fn fill_levels(&mut self, from: &'r Image, texture: &'r Texture, width: u32) {
        let to = &texture.image;
        self.image_barrier(to, None, Access::TransferWrite);
        self.uses_image(from, Access::TransferRead);
        self.uses_image(to, Access::TransferWrite);
        let [read, write] = [Access::TransferRead, Access::TransferWrite].map(Access::layout);
        let (handle, buffer) = self.raw();
        let layers = packed(to).image_subresource;
        let corner = |level: u32| {
            let [width, height] = [width, to.shape.height].map(|size| (size >> level).max(1).cast_signed());
            [vk::Offset3D::default(), vk::Offset3D { x: width, y: height, z: 1 }]
        };
        let turn = |level: u32, layouts: [vk::ImageLayout; 2]| {
            let part = vk::ImageSubresourceRange { base_mip_level: level, level_count: 1, ..to.whole() };
            self.turn(to, part, layouts, between(Access::TransferWrite, Access::TransferRead));
        };
        let extent = vk::Extent3D { width, height: to.shape.height, depth: 1 };
        let first = [vk::ImageCopy::default().src_subresource(layers).dst_subresource(layers).extent(extent)];
        // SAFETY: both are borrowed until the commands have run, and the layouts are those stated above.
        unsafe { handle.cmd_copy_image(buffer, from.raw(), read, to.raw(), write, &first) };
        for level in 1..to.levels {
            turn(level - 1, [write, read]);
            let region = [vk::ImageBlit::default()
                .src_subresource(vk::ImageSubresourceLayers { mip_level: level - 1, ..layers })
                .src_offsets(corner(level - 1))
                .dst_subresource(vk::ImageSubresourceLayers { mip_level: level, ..layers })
                .dst_offsets(corner(level))];
            // SAFETY: as above.
            unsafe { handle.cmd_blit_image(buffer, to.raw(), read, to.raw(), write, &region, vk::Filter::LINEAR) };
        }
        // All levels have one layout again.
        (0..to.levels - 1).for_each(|level| turn(level, [read, write]));
        self.image_barrier(to, Some(Access::TransferWrite), Access::GraphicsSampled);
    }

    /// Ends the recording, submits it and waits. Returns the duration of each pass, in order.
    pub fn submit(self) -> Result<Vec<Timing>> {
        self.end()?.run()?.wait()
    }

    /// Ends the recording and submits it without waiting. The recording must begin with [`Commands::after_flights`],
    /// because earlier recordings may still use its resources.
    pub fn launch(self) -> Result<Flight> {
        self.end()?.launch(None, None)
    }

    /// Whether the caller of the library uses the queue and what is on the device too.
    pub fn is_shared(&self) -> bool {
        self.recording.device.is_shared
    }

    /// Barrier between all that was submitted to the queue before and all commands that follow in this recording.
    pub fn after_flights(&mut self) {
        self.memory_barrier(
            vk::MemoryBarrier2::default()
                .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE),
        );
    }

    /// Asks the tracker for its verdict and gives up the borrows.
    pub(super) fn end(mut self) -> Result<Recording> {
        for (buffer, range) in std::mem::take(&mut self.read_back) {
            self.tracker.use_range(buffer.id, &buffer.name, range, Access::HostRead, "host");
        }
        self.tracker.verdict().map_err(|error| error.context(&self.recording.name))?;
        Ok(self.recording)
    }
}
