//! The resources of a recording, and its execution: either submitted and waited for, or launched without waiting.
//!
//! A one-shot recording waits. A frame of the window is launched: at most [`FLIGHTS`] frames are in flight, and the
//! owner of anything that they may use waits for all of them before it destroys it ([`Device::settle`]).

use super::Checked;
use super::device::Device;
use super::memory::{Buffer, BufferKind};
use crate::error::Result;
use ash::vk;
use std::sync::{Arc, MutexGuard};

/// Largest number of recordings in flight: the device executes one while another waits.
pub const FLIGHTS: usize = 2;

/// Largest number of timed passes in one recording; each pass takes two timestamps.
pub(super) const MAX_PASSES: u32 = 64;

#[derive(Clone, Debug)]
pub struct Timing {
    pub pass: String,
    /// Milliseconds between the timestamps around it.
    pub milliseconds: f64,
    /// The number that it has counted, see [`super::Commands::count`]; `None` where it counts nothing.
    pub counted: Option<u32>,
}

/// Command buffer, fence, timestamps and descriptor pools of one recording.
pub(super) struct Recording {
    pub device: Arc<Device>,
    pub name: String,
    pool: vk::CommandPool,
    pub buffer: vk::CommandBuffer,
    fence: vk::Fence,
    pub queries: vk::QueryPool,
    /// A word of every pass, once one of them counts.
    counts: Option<Buffer>,
    /// Passes that count.
    counted: Vec<usize>,
    pub descriptors: Vec<(vk::DescriptorPool, u32)>,
    pub passes: Vec<String>,
    running: bool,
}

impl Recording {
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self> {
        let mut recording = Recording {
            device: device.clone(),
            name: name.to_owned(),
            pool: vk::CommandPool::null(),
            buffer: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            queries: vk::QueryPool::null(),
            counts: None,
            counted: Vec::new(),
            descriptors: Vec::new(),
            passes: Vec::new(),
            running: false,
        };
        let handle = &device.handle;
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        let queries =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * MAX_PASSES);
        // SAFETY: for the whole block, every handle is stored in `recording` as soon as it exists and destroyed in its
        // `Drop`.
        unsafe {
            recording.pool = handle.create_command_pool(&pool, None).checked("vkCreateCommandPool", name)?;
            recording.fence =
                handle.create_fence(&vk::FenceCreateInfo::default(), None).checked("vkCreateFence", name)?;
            recording.queries = handle.create_query_pool(&queries, None).checked("vkCreateQueryPool", name)?;
            let allocate = vk::CommandBufferAllocateInfo::default()
                .command_pool(recording.pool)
                .level(vk::CommandBufferLevel::PRIMARY)
                .command_buffer_count(1);
            recording.buffer = handle.allocate_command_buffers(&allocate).checked("vkAllocateCommandBuffers", name)?[0];
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            handle.begin_command_buffer(recording.buffer, &begin).checked("vkBeginCommandBuffer", name)?;
            handle.cmd_reset_query_pool(recording.buffer, recording.queries, 0, 2 * MAX_PASSES);
        }
        device.name(recording.pool, name);
        device.name(recording.buffer, name);
        device.name(recording.fence, name);
        device.name(recording.queries, name);
        Ok(recording)
    }

    /// Where the current pass's count goes: a buffer and a byte offset.
    pub fn next_count(&mut self) -> Result<(vk::Buffer, u64)> {
        let pass = self.passes.len() - 1;
        self.counted.push(pass);
        if self.counts.is_none() {
            self.counts = Some(Buffer::new(&self.device, "counts", BufferKind::Readback, 4 * u64::from(MAX_PASSES))?);
        }
        let counts = self.counts.as_ref().expect("it was made");
        Ok((counts.raw(), 4 * pass as u64))
    }

    /// The current pass, or the recording where it has none yet.
    pub fn pass_name(&self) -> &str {
        self.passes.last().unwrap_or(&self.name)
    }

    fn last_pass(&self) -> String {
        format!("{}, last pass {}", self.name, self.pass_name())
    }

    /// Submits; the caller must wait before it releases anything that the recording uses.
    pub fn run(mut self) -> Result<Flight> {
        self.start(None, None)?;
        Ok(Flight { recording: self, launched: false })
    }

    /// Submits as one of at most [`FLIGHTS`] recordings in flight. Colour attachments are written only after `wait`;
    /// `signal` is signalled when the submission has finished.
    pub fn launch(mut self, wait: Option<vk::Semaphore>, signal: Option<vk::Semaphore>) -> Result<Flight> {
        let device = self.device.clone();
        let mut flights = device.flights();
        assert!(flights.len() < FLIGHTS, "{}: {} recordings are already in flight", self.name, flights.len());
        self.start(wait, signal)?;
        flights.push(self.fence);
        Ok(Flight { recording: self, launched: true })
    }

    fn start(&mut self, wait: Option<vk::Semaphore>, signal: Option<vk::Semaphore>) -> Result<()> {
        let handle = &self.device.handle;
        let stage = vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT;
        let wait = wait.map(|s| vk::SemaphoreSubmitInfo::default().semaphore(s).stage_mask(stage));
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let signal = signal.map(|s| vk::SemaphoreSubmitInfo::default().semaphore(s).stage_mask(all));
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.buffer)];
        let submit = [vk::SubmitInfo2::default()
            .command_buffer_infos(&buffers)
            .wait_semaphore_infos(wait.as_slice())
            .signal_semaphore_infos(signal.as_slice())];
        // SAFETY: for the whole block, the recording is complete; what it uses outlives it because its owners settle
        // the device first, or because the caller waits; the queue is locked.
        unsafe {
            handle.end_command_buffer(self.buffer).checked("vkEndCommandBuffer", &self.name)?;
            let queue = self.device.queue();
            handle.queue_submit2(*queue, &submit, self.fence).checked("vkQueueSubmit2", &self.last_pass())?;
        }
        self.running = true;
        Ok(())
    }

    fn wait(&mut self) -> Result<()> {
        if self.running {
            // SAFETY: the fence is alive and was submitted.
            unsafe { self.device.handle.wait_for_fences(&[self.fence], true, u64::MAX) }
                .checked("vkWaitForFences", &self.last_pass())?;
            self.running = false;
        }
        Ok(())
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        // A lost device executes nothing; the error was reported where the recording was waited for.
        let _ = self.wait();
        let handle = &self.device.handle;
        // SAFETY: the device has finished, or nothing was ever submitted; a handle that was never made is null.
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

/// A submitted recording. Dropping it waits for its end.
pub struct Flight {
    recording: Recording,
    launched: bool,
}

impl Flight {
    /// Waits for its end. Returns the duration of each pass, in order.
    pub fn wait(mut self) -> Result<Vec<Timing>> {
        let recording = &mut self.recording;
        recording.wait()?;
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        let mut stamps = vec![0_u64; 2 * recording.passes.len()];
        if !stamps.is_empty() {
            // SAFETY: the pool is alive and has two stamps a pass.
            unsafe { recording.device.handle.get_query_pool_results(recording.queries, 0, &mut stamps, flags) }
                .checked("vkGetQueryPoolResults", &recording.name)?;
        }
        let period_ns = f64::from(recording.device.limits.timestamp_period);
        let passes = recording.passes.iter().zip(stamps.chunks_exact(2));
        let mut timings: Vec<Timing> = passes
            .map(|(pass, pair)| Timing {
                pass: pass.clone(),
                milliseconds: pair[1].saturating_sub(pair[0]) as f64 * period_ns * 1e-6,
                counted: None,
            })
            .collect();
        for &pass in &recording.counted {
            let counts = recording.counts.as_ref().expect("a pass that counts has made it");
            timings[pass].counted = Some(counts.read_finished(4 * pass as u64, 1)[0]);
        }
        Ok(timings)
    }
}

impl Drop for Flight {
    fn drop(&mut self) {
        let _ = self.recording.wait();
        if self.launched {
            // The fence leaves the list before it is destroyed.
            let fence = self.recording.fence;
            self.recording.device.flights().retain(|f| *f != fence);
        }
    }
}

impl Device {
    /// Fences of the recordings that may be in flight.
    pub(super) fn flights(&self) -> MutexGuard<'_, Vec<vk::Fence>> {
        self.flights.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Number of recordings in flight, at most [`FLIGHTS`].
    pub fn flight_count(&self) -> usize {
        self.flights().len()
    }

    /// Waits until the device has finished all launched recordings; returns at once if there are none. Owners of Vulkan
    /// objects call it before they destroy them.
    pub fn settle(&self) {
        let flights = self.flights();
        if !flights.is_empty() {
            // SAFETY: a fence is taken off the list, whose lock is held, before it is destroyed. A lost device executes
            // nothing; the caller that waits for the flight receives the error.
            let _ = unsafe { self.handle.wait_for_fences(&flights, true, u64::MAX) };
        }
    }

    pub(super) fn queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}
